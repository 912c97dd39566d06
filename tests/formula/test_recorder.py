"""Formulas recorded: random expressions against numpy itself, batches against single poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armkin.formula.recording import record
from armkin.formula.trace import LazyCode, StraightLineCode

Expression = Any  # an input's number, a constant, a column of branch constants, or (operation, expressions...)

# Operations that IEEE arithmetic defines to the last bit: every way of computing them gives the same.
EXACT: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / (1.0 + np.abs(b)),
    "negative": lambda a: -a,
    "absolute": lambda a: np.abs(a),
    "sqrt": lambda a: np.sqrt(np.abs(a)),
    "minimum": lambda a, b: np.minimum(a, b),
    "maximum": lambda a, b: np.maximum(a, b),
    "rint": lambda a: np.rint(a),
    "sign": lambda a: np.sign(a),
    "square": lambda a: a**2,
    "choose": lambda a, b, c, d: np.where(a < b, c, d),
    "both": lambda a, b, c: np.where((a <= b) & (b <= c), a, c),
    "either": lambda a, b, c: np.where((a > b) | (b > c), b, c),
}
# Those that libraries round each in their own way; without jumps, so that a bit more or less stays a bit.
SMOOTH: dict[str, Callable[..., Any]] = {
    "add": EXACT["add"],
    "subtract": EXACT["subtract"],
    "multiply": EXACT["multiply"],
    "tan": lambda a: np.tan(a / (1.0 + np.abs(a))),
    "arctan2": lambda a, b: np.arctan2(a, 1.0 + np.abs(b)),
    "cbrt": lambda a: np.cbrt(8.0 + np.abs(a)),
}
INPUTS = 3
COLUMNS = [
    np.array([[1.0], [-1.0]]),
    np.array([[0.0], [2.5]]),
    np.array([[[1.0]], [[-0.5]], [[0.0]]]),
    np.array([[[1.0]], [[-1.0]], [[-1.0]]]),
    np.array([[0.0], [-1.0]]),
    np.array([[-2.0], [2.0]]),
]


def expression_strategy(operations: dict[str, Callable[..., Any]]) -> st.SearchStrategy[Expression]:
    leaves = st.one_of(
        st.integers(0, INPUTS - 1).map(lambda k: ("input", k)),
        st.sampled_from([0.0, 1.0, -1.0, 0.5, -3.25]).map(lambda c: ("constant", c)),
        st.integers(0, len(COLUMNS) - 1).map(lambda k: ("column", k)),
    )

    def grown(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
        return st.one_of(
            [
                st.tuples(st.just(name), *[inner] * function.__code__.co_argcount)
                for name, function in operations.items()
            ]
        )

    return st.recursive(leaves, grown, max_leaves=12)


def value_of(expression: Expression, inputs: Sequence[Any], operations: dict[str, Callable[..., Any]]) -> Any:
    """An expression of arrays, numbers or symbols."""
    name, *operands = expression
    if name == "input":
        return inputs[operands[0]]
    if name == "constant":
        return operands[0]
    if name == "column":
        return COLUMNS[operands[0]]
    arguments = [value_of(part, inputs, operations) for part in operands]
    if all(isinstance(a, float) for a in arguments):
        return float(operations[name](*arguments))  # constants stay numbers, as `arrays` keeps them
    return operations[name](*arguments)


def check_operations(expression: Expression, operations: dict[str, Callable[..., Any]], tolerance: float) -> None:
    rng = np.random.default_rng(7)
    inputs = [np.concatenate([rng.uniform(-10, 10, 5), [0.0, 1.0, -2.0]]) for _ in range(INPUTS)]
    expected = np.asarray(value_of(expression, inputs, operations), dtype=float)
    formula = StraightLineCode(lambda symbols: [value_of(expression, symbols, operations)], INPUTS)
    [batch] = formula.run(inputs, formula.workspace(len(inputs[0])))
    values = np.broadcast_to(np.asarray(batch, dtype=float), expected.shape)
    np.testing.assert_allclose(values, expected, rtol=tolerance, atol=tolerance)
    for i in range(len(inputs[0])):
        [single] = formula.one_by_one([[float(x[i]) for x in inputs]])
        rows = np.broadcast_to(expected, np.broadcast_shapes(expected.shape, (len(inputs[0]),)))
        row = rows[..., i]
        np.testing.assert_allclose(np.broadcast_to(single[..., 0], row.shape), row, rtol=tolerance, atol=tolerance)


@settings(max_examples=300, deadline=None)
@given(expression_strategy(EXACT))
def test_exact_operations_are_numpys_to_the_last_bit(expression: Expression) -> None:
    check_operations(expression, EXACT, 0.0)


@settings(max_examples=150, deadline=None)
@given(expression_strategy(SMOOTH))
def test_other_operations_are_numpys_to_rounding(expression: Expression) -> None:
    check_operations(expression, SMOOTH, 1e-10)


def test_equal_operations_are_recorded_once_and_known_zeros_not_at_all() -> None:
    made = record(lambda x: [(x[0] * x[1] + 0.0) * 1.0, x[0] * x[1], 0.0 * x[1], np.negative(-x[0])], 2)
    assert [node.op for node in made.nodes] == ["multiply"]
    assert made.outputs[0] is made.outputs[1]
    assert made.outputs[2] == 0.0
    assert made.outputs[3] is made.inputs[0]


def test_signs_move_outwards() -> None:
    made = record(lambda x: [(-x[0]) * (-x[1]), (-x[0]) - x[1], x[0] - (-x[1])], 2)
    assert [node.op for node in made.nodes] == ["multiply", "add", "negative"]


def test_signs_of_branches_move_outwards() -> None:
    """What they are multiplied with is computed once for both, and their square not at all."""
    sign = COLUMNS[0]
    made = record(lambda x: [(sign * x[0]) * x[1] * 3.0, (sign * x[0]) ** 2, np.arctan2(sign * x[0], x[1])], 2)
    rows = [(node.op, node.axes) for node in made.nodes]
    single, two = (), (2,)
    assert rows == [
        ("multiply", single), ("multiply", single), ("multiply", two),
        ("multiply", single),
        ("arctan2", single), ("multiply", two),
    ]  # fmt: skip


def test_a_sum_with_both_signs_is_written_half_by_half() -> None:
    formula = StraightLineCode(lambda x: [x[0] + COLUMNS[0] * x[1], x[0] - COLUMNS[0] * x[1]], 2)
    buffers = formula.workspace(3)
    assert sum(b.flags.owndata for b in buffers) == 2, "no buffer for the value with both signs"
    total, difference = formula.run([np.arange(3.0), np.full(3, 10.0)], buffers)
    assert total.tolist() == [[10, 11, 12], [-10, -9, -8]]
    assert difference.tolist() == total[::-1].tolist()


def test_a_buffer_is_used_again() -> None:
    """A sum of ten products needs the buffers of two, not of ten."""
    formula = StraightLineCode(lambda x: [sum((x[0] * float(k + 2) for k in range(10)), start=0.0)], 1)
    assert len(formula.workspace(4)) <= 3
    [total] = formula.run([np.arange(4.0)], formula.workspace(4))
    assert total.tolist() == [0.0, 65.0, 130.0, 195.0]


def test_what_cannot_be_recorded_is_refused_by_name() -> None:
    with pytest.raises(TypeError, match=r"add\.reduce cannot be recorded"):
        record(lambda x: [np.add.reduce(x[0])], 1)
    with pytest.raises(TypeError, match="concatenate cannot be recorded"):
        record(lambda x: [np.concatenate([x[0], x[0]])], 1)


def test_recording_waits_until_it_pays() -> None:
    def formula(x: list[Any]) -> list[Any]:
        return [x[0] + x[1]]

    once = LazyCode(formula, 2)
    assert [once.get(1) is None for _ in range(5)] == [True] * 4 + [False]
    assert LazyCode(formula, 2).get(64) is not None
