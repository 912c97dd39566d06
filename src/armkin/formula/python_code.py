"""A recording as plain Python: for one pose a call of numpy costs more than what it computes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from types import CodeType
from typing import Any, NamedTuple

import numpy as np

from armkin.formula.recording import FLIPS, Node, Recording, axes_of, index_before_flip

# Operations on single numbers.
_PYTHON = {
    "multiply": "{} * {}",
    "add": "{} + {}",
    "subtract": "{} - {}",
    "divide": "{} / {}",
    "negative": "-{}",
    "absolute": "abs({})",
    "maximum": "max({}, {})",
    "minimum": "min({}, {})",
    "power": "{} ** {}",
    "sqrt": "sqrt({})",
    "cbrt": "cbrt({})",
    "tan": "tan({})",
    "arctan2": "atan2({}, {})",
    "rint": "float(round({}))",
    "sign": "copysign(1.0, {0}) if {0} else 0.0",
    "copysign": "copysign({}, {})",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "greater": "{} > {}",
    "greater_equal": "{} >= {}",
    "equal": "{} == {}",
    "bitwise_or": "{} or {}",
    "bitwise_and": "{} and {}",
    "where": "{1} if {0} else {2}",
}
_FUNCTIONS = {name: getattr(math, name) for name in ("sqrt", "cbrt", "tan", "atan2", "copysign")}
MAX_BRACKETS = 20  # brackets within brackets, at most, that a line may have: Python's parser takes 200

Value = tuple[int, tuple[int, ...]]  # a node, by its id, on one of its branches


class Step(NamedTuple):
    """An operation on values or constants' digits."""

    output: Value
    op: str
    args: list[Value | str]


class Expression(NamedTuple):
    """Python code of a value, and how many brackets within brackets it has."""

    code: str
    depth: int = 0


def write_python(recording: Recording) -> Callable[..., tuple[Any, ...]]:
    """Branch axes unrolled, one line a value that is used more than once: a function of the inputs as numbers."""
    steps, outputs = _unroll(recording)
    inputs: dict[Value, str] = {(id(node), ()): f"i{k}" for k, node in enumerate(recording.inputs)}
    lines, expressions = _write_lines(steps, _count_uses(steps, outputs), inputs)
    returned = []
    for x, branches in zip(recording.outputs, outputs, strict=True):
        joined = ", ".join(_expression(value, expressions).code for value in branches)
        returned.append(f"({joined},)" if axes_of(x) else joined)
    return function_of(list(inputs.values()), lines, returned, dict(_FUNCTIONS))


def _write_lines(
    steps: list[Step], uses: Counter[Value | str], inputs: dict[Value, str]
) -> tuple[list[str], dict[Value, Expression]]:
    """A line for each value that is used more than once or has too many brackets, and how every value is read."""
    expressions = {value: Expression(name) for value, name in inputs.items()}
    lines: list[str] = []
    for output, op, args in steps:
        if not uses[output]:
            continue
        operands = [_expression(x, expressions) for x in args]
        code, depth = _PYTHON[op].format(*(x.code for x in operands)), 1 + max(x.depth for x in operands)
        if uses[output] == 1 and depth < MAX_BRACKETS:
            expressions[output] = Expression(f"({code})", depth)
        else:
            name = f"t{len(lines)}"
            lines.append(f"{name} = {code}")
            expressions[output] = Expression(name)
    return lines, expressions


def _expression(x: Value | str, expressions: dict[Value, Expression]) -> Expression:
    """How a value or a constant's digits are read."""
    return Expression(x) if isinstance(x, str) else expressions[x]


def _count_uses(steps: list[Step], outputs: list[list[Value | str]]) -> Counter[Value | str]:
    """How many times each value that leads to an output is read."""
    uses: Counter[Value | str] = Counter(value for branches in outputs for value in branches)
    for output, op, args in reversed(steps):
        if uses[output]:
            uses.update(args * 2 if op == "sign" else args)
    return uses


def _unroll(recording: Recording) -> tuple[list[Step], list[list[Value | str]]]:
    """The operations on single branches, those on signs of branches left out; and what each output is on each."""
    same: dict[Value, Value | str] = {}

    def value(x: Any, index: tuple[int, ...]) -> Value | str:
        """What an argument is on a branch: a value, or a constant's digits."""
        axes = axes_of(x)
        last = index[len(index) - len(axes) :]
        place = tuple(0 if size == 1 else i for size, i in zip(axes, last, strict=True))
        if isinstance(x, Node):
            return same.get(key := (id(x), place), key)
        return repr(float(np.asarray(x)[(*place, 0)] if np.ndim(x) else x))

    steps: list[Step] = []
    minus: dict[Value | str, Value | str] = {}  # negated values
    for node in recording.nodes:
        for index in np.ndindex(*node.axes):
            output = id(node), index
            if node.op in FLIPS:
                same[output] = value(node.args[0], index_before_flip(node.op, index, node.axes))
                continue
            op, args = _shorten(node.op, [value(x, index) for x in node.args], minus)
            if op == "same":
                same[output] = args[0]
                continue
            if op == "negative":
                minus[output] = args[0]
            steps.append(Step(output, op, args))
    return steps, [[value(x, index) for index in np.ndindex(*axes_of(x))] for x in recording.outputs]


def _shorten(op: str, args: list[Value | str], minus: dict[Value | str, Value | str]) -> tuple[str, list[Value | str]]:
    """An operation without signs of branches; "same": it is its argument. minus: negated values, before that."""
    if op == "multiply":
        for sign, shorter in (("1.0", "same"), ("-1.0", "negative")):
            if sign in args:
                return shorter, [args[1 - args.index(sign)]]
    if op == "add":
        for negated, summand in (args, args[::-1]):
            if negated in minus:
                return "subtract", [summand, minus[negated]]
    return op, args


def function_of(
    parameters: list[str], lines: list[str], outputs: list[str], scope: dict[str, Any]
) -> Callable[..., tuple[Any, ...]]:
    """A function made of these lines. They consist of names and numbers written by this package alone."""
    source = "\n    ".join([f"def run({', '.join(parameters)}):", *lines, f"return ({', '.join(outputs)},)"])
    exec(_compile_source(source), scope)
    run: Callable[..., tuple[Any, ...]] = scope["run"]
    return run


@lru_cache(maxsize=128)
def _compile_source(source: str) -> CodeType:
    """An arm that is read again, or another of its size, has the same lines: compiling them is most of the time."""
    return compile(source, "<formula>", "exec")
