"""Writes a recording as plain Python, because for one pose the calls of numpy would cost most of the time."""

import math
from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from types import CodeType
from typing import Any, NamedTuple

import numpy as np

from armkin.formula.recording import FLIPS, Node, Recording, axes_of, index_before_flip

# operations on single numbers
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
MAX_BRACKETS = 20  # deepest nesting of brackets in a line; Python's parser accepts 200

Value = tuple[int, tuple[int, ...]]  # id of a node, and index of a branch


class Step(NamedTuple):
    """An operation on values or on texts of constants."""

    output: Value
    op: str
    args: list[Value | str]


class Expression(NamedTuple):
    """Python code of a value, and the depth of its brackets."""

    code: str
    depth: int = 0


def write_python(recording: Recording) -> Callable[..., tuple[Any, ...]]:
    """The function of a recording for single numbers, with a line for each value that is used more than once."""
    steps, outputs = _unroll(recording)
    inputs: dict[Value, str] = {(id(node), ()): f"i{k}" for k, node in enumerate(recording.inputs)}
    lines, expressions = _write_lines(steps, _count_uses(steps, outputs), inputs)
    output_codes = []
    for x, branches in zip(recording.outputs, outputs, strict=True):
        codes = ", ".join(_expression(value, expressions).code for value in branches)
        output_codes.append(f"({codes},)" if axes_of(x) else codes)
    return function_of(list(inputs.values()), lines, output_codes, dict(_FUNCTIONS))


def _write_lines(
    steps: list[Step], uses: Counter[Value | str], inputs: dict[Value, str]
) -> tuple[list[str], dict[Value, Expression]]:
    """Lines for values that are used more than once or nested too deeply, and the expression of every value."""
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
    """The expression of a value or of a constant."""
    return Expression(x) if isinstance(x, str) else expressions[x]


def _count_uses(steps: list[Step], outputs: list[list[Value | str]]) -> Counter[Value | str]:
    """Number of uses of each value that an output depends on."""
    uses: Counter[Value | str] = Counter(value for branches in outputs for value in branches)
    for output, op, args in reversed(steps):
        if uses[output]:
            uses.update(args * 2 if op == "sign" else args)
    return uses


def _unroll(recording: Recording) -> tuple[list[Step], list[list[Value | str]]]:
    """The operations on single branches without flips and signs, and the values of each output on its branches."""
    alias_of: dict[Value, Value | str] = {}

    def value(x: Any, index: tuple[int, ...]) -> Value | str:
        """The argument on a branch: a value, or the text of a constant."""
        axes = axes_of(x)
        last = index[len(index) - len(axes) :]
        place = tuple(0 if size == 1 else i for size, i in zip(axes, last, strict=True))
        if isinstance(x, Node):
            return alias_of.get(key := (id(x), place), key)
        return repr(float(np.asarray(x)[(*place, 0)] if np.ndim(x) else x))

    steps: list[Step] = []
    minus: dict[Value | str, Value | str] = {}  # negated values
    for node in recording.nodes:
        for index in np.ndindex(*node.axes):
            output = id(node), index
            if node.op in FLIPS:
                alias_of[output] = value(node.args[0], index_before_flip(node.op, index, node.axes))
                continue
            op, args = _shorten(node.op, [value(x, index) for x in node.args], minus)
            if op == "same":
                alias_of[output] = args[0]
                continue
            if op == "negative":
                minus[output] = args[0]
            steps.append(Step(output, op, args))
    return steps, [[value(x, index) for index in np.ndindex(*axes_of(x))] for x in recording.outputs]


def _shorten(op: str, args: list[Value | str], minus: dict[Value | str, Value | str]) -> tuple[str, list[Value | str]]:
    """A simpler equal operation; "same": the result is its argument. minus: arguments of negated values."""
    if op == "multiply":
        for sign, operation in (("1.0", "same"), ("-1.0", "negative")):
            if sign in args:
                return operation, [args[1 - args.index(sign)]]
    if op == "add":
        for negated, summand in (args, args[::-1]):
            if negated in minus:
                return "subtract", [summand, minus[negated]]
    return op, args


def function_of(
    parameters: list[str], lines: list[str], outputs: list[str], scope: dict[str, Any]
) -> Callable[..., tuple[Any, ...]]:
    """A function made of these lines, which consist of names and numbers written by this package."""
    source = "\n    ".join([f"def run({', '.join(parameters)}):", *lines, f"return ({', '.join(outputs)},)"])
    exec(_compile_source(source), scope)
    run: Callable[..., tuple[Any, ...]] = scope["run"]
    return run


@lru_cache(maxsize=128)
def _compile_source(source: str) -> CodeType:
    """Compiled source; cached, as compiling takes most of the time and similar arms have the same source."""
    return compile(source, "<formula>", "exec")
