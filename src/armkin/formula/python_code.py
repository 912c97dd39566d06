"""A recording as plain Python: for one pose a call of numpy costs more than what it computes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from types import CodeType
from typing import Any

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
Step = tuple[Value, str, list[Value | str]]  # a value: the operation that it is the result of, and on what


def write_python(recording: Recording) -> Callable[..., tuple[Any, ...]]:
    """Branch axes unrolled, one line a value that is used more than once: a function of the inputs as numbers."""
    steps, outputs = _unroll(recording)
    uses = _count_uses(steps, outputs)
    inputs: list[Value] = [(id(node), ()) for node in recording.inputs]
    texts: dict[Value | str, tuple[str, int]] = {x: (f"i{k}", 0) for k, x in enumerate(inputs)}
    lines: list[str] = []

    def text(x: Value | str) -> tuple[str, int]:
        return (x, 0) if isinstance(x, str) else texts[x]

    for output, op, args in steps:
        if not uses[output]:
            continue
        shown = [text(x) for x in args]
        line, depth = _PYTHON[op].format(*(t for t, _ in shown)), 1 + max(d for _, d in shown)
        if uses[output] == 1 and depth < MAX_BRACKETS:
            texts[output] = f"({line})", depth
        else:
            name = f"t{len(lines)}"
            lines.append(f"{name} = {line}")
            texts[output] = name, 0
    returned = []
    for x, every in zip(recording.outputs, outputs, strict=True):
        joined = ", ".join(text(v)[0] for v in every)
        returned.append(f"({joined},)" if axes_of(x) else joined)
    return function_of([texts[x][0] for x in inputs], lines, returned, dict(_FUNCTIONS))


def _count_uses(steps: list[Step], outputs: list[list[Value | str]]) -> Counter[Value | str]:
    """How many times each value that leads to an output is read."""
    uses: Counter[Value | str] = Counter(x for every in outputs for x in every)
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
            steps.append((output, op, args))
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
