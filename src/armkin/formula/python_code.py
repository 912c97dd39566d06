"""A recording as plain Python: for one pose a call of numpy costs more than what it computes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from armkin.formula.recording import Node, Recording, axes_of

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
    "sqrt": "math.sqrt({})",
    "cbrt": "math.cbrt({})",
    "tan": "math.tan({})",
    "arctan2": "math.atan2({}, {})",
    "rint": "float(round({}))",
    "sign": "math.copysign(1.0, {0}) if {0} else 0.0",
    "copysign": "math.copysign({}, {})",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "greater": "{} > {}",
    "greater_equal": "{} >= {}",
    "equal": "{} == {}",
    "bitwise_or": "{} or {}",
    "bitwise_and": "{} and {}",
    "where": "{1} if {0} else {2}",
}


def write(recording: Recording) -> Callable[..., tuple[Any, ...]]:
    """One Python expression a line and branch, branch axes unrolled: a function of the inputs as numbers."""
    names: dict[int, dict[tuple[int, ...], str]] = {id(node): {(): f"i{k}"} for k, node in enumerate(recording.inputs)}
    lines = []

    def name(x: Any, index: tuple[int, ...]) -> str:
        axes = axes_of(x)
        at = tuple(0 if size == 1 else i for size, i in zip(axes, index[len(index) - len(axes) :], strict=True))
        if isinstance(x, Node):
            return names[id(x)][at]
        return repr(float(np.asarray(x)[(*at, 0)] if np.ndim(x) else x))

    for k, node in enumerate(recording.nodes):
        names[id(node)] = {}
        for b, index in enumerate(np.ndindex(*node.axes)):
            names[id(node)][index] = f"t{k}_{b}"
            lines.append(f"t{k}_{b} = " + _PYTHON[node.op].format(*(name(x, index) for x in node.args)))
    outputs = []
    for x in recording.outputs:
        every = [name(x, index) for index in np.ndindex(*axes_of(x))]
        outputs.append(f"({', '.join(every)},)" if axes_of(x) else every[0])
    return function_of([names[id(x)][()] for x in recording.inputs], lines, outputs, {"math": math})


def function_of(
    parameters: list[str], lines: list[str], outputs: list[str], scope: dict[str, Any]
) -> Callable[..., tuple[Any, ...]]:
    """A function made of these lines. They consist of names and numbers written by this package alone."""
    source = "\n    ".join([f"def run({', '.join(parameters)}):", *lines, f"return ({', '.join(outputs)},)"])
    exec(source, scope)
    run: Callable[..., tuple[Any, ...]] = scope["run"]
    return run
