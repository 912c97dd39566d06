"""A recording as numpy code: one call a line, into buffers that are used again and again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.python_code import function_of
from armkin.formula.recording import BOOLEAN, Node, Recording

Run = Callable[..., tuple[Any, ...]]
Buffer = tuple[tuple[int, ...], type]  # branch axes in front of the batch, and what it holds


def write(recording: Recording) -> tuple[Run, list[Buffer]]:
    """One numpy call a line, its result in a buffer that is free again after its last use.

    Returns the function, which takes the inputs (N,) and the buffers, and what the buffers must be.
    """
    names = {id(node): f"i{k}" for k, node in enumerate(recording.inputs)}
    constants: dict[str, Any] = {}
    last = {id(x): k for k, node in enumerate(recording.nodes) for x in node.args}
    last |= {id(x): len(recording.nodes) for x in recording.outputs}
    free: dict[tuple[tuple[int, ...], type], list[str]] = {}
    kinds: dict[int, tuple[tuple[int, ...], type]] = {}
    buffers: list[Buffer] = []
    lines = []

    def name(x: Any) -> str:
        if isinstance(x, Node):
            return names[id(x)]
        # an array of no axes reaches the loop 0.2 us sooner than a Python number
        constants[f"k{len(constants)}"] = x if np.ndim(x) else np.array(float(x))
        return f"k{len(constants) - 1}"

    for k, node in enumerate(recording.nodes):
        arguments = [name(x) for x in node.args]
        for x in {id(x): x for x in node.args}.values():
            if isinstance(x, Node) and x.op != "input" and last[id(x)] == k:
                free.setdefault(kinds[id(x)], []).append(names[id(x)])
        kind = kinds[id(node)] = (node.axes, bool if node.op in BOOLEAN else float)
        if free.get(kind):
            names[id(node)] = free[kind].pop()
        else:
            names[id(node)] = f"b{len(buffers)}"
            buffers.append(kind)
        # numpy deprecates a positional third argument of minimum and maximum
        out = "out=" if node.op in ("minimum", "maximum") else ""
        lines.append(f"{node.op}({', '.join(arguments)}, {out}{names[id(node)]})")
    parameters = [names[id(x)] for x in recording.inputs] + [f"b{k}" for k in range(len(buffers))]
    outputs = list(map(name, recording.outputs))
    scope = {**constants, **{node.op: getattr(np, node.op) for node in recording.nodes}, "where": _where}
    return function_of(parameters, lines, outputs, scope), buffers


def _where(mask: Any, a: Any, b: Any, out: NDArray[Any]) -> None:
    """`numpy.where` into a buffer, which may be that of a or b."""
    np.copyto(out, np.where(mask, a, b))
