"""A recording as numpy code: one call a line, into buffers that are used again and again."""

import math
import operator
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.python_code import function_of
from armkin.formula.recording import BOOLEAN, FLIPS, Node, Recording, axes_of, branch_signs

Run = Callable[..., tuple[Any, ...]]
# Functions that are not rounded to the nearest number, as plain Python has them.
_ROUNDED: dict[str, Callable[..., Any]] = {
    "arctan2": np.frompyfunc(math.atan2, 2, 1),
    "tan": np.frompyfunc(math.tan, 1, 1),
    "cbrt": np.frompyfunc(math.cbrt, 1, 1),
    "power": np.frompyfunc(operator.pow, 2, 1),
}
Place = tuple[int | slice, ...]


class Buffer(NamedTuple):
    """Branch axes in front of the batch and what it holds; or which part it is of which buffer before it."""

    axes: tuple[int, ...]
    dtype: type
    full_index: int = -1
    part: Place = ()


def workspace(buffers: list[Buffer], length: int) -> list[NDArray[Any]]:
    """The buffers for batches of that length."""
    arrays: list[NDArray[Any]] = []
    for axes, dtype, full_index, part in buffers:
        arrays.append(np.empty((*axes, length), dtype) if full_index < 0 else arrays[full_index][part])
    return arrays


class _Buffers:
    """Which buffer holds which value, constants and parts by name; one is free again after its value's last use."""

    def __init__(self, recording: Recording) -> None:
        self.names = {id(node): f"i{k}" for k, node in enumerate(recording.inputs)}
        self.constants: dict[str, Any] = {}
        self.buffers: list[Buffer] = []
        self._kinds: dict[int, tuple[tuple[int, ...], type]] = {}
        self._free: dict[tuple[tuple[int, ...], type], list[str]] = {}
        self._parts: dict[tuple[str, str], str] = {}

    def name(self, x: Any, half: tuple[int | None, ...] = ()) -> str:
        """A value, or its part; half: the place on each of the last branch axes, None for all places."""
        if isinstance(x, Node) and not half:
            return self.names[id(x)]
        axes = axes_of(x)
        place: Place = tuple(
            slice(None) if k is None else min(k, size - 1) for k, size in zip(half[-len(axes) :], axes, strict=False)
        )
        if not isinstance(x, Node):
            # an array of no axes reaches the loop 0.2 us sooner than a Python number
            self.constants[f"k{len(self.constants)}"] = x[place] if np.ndim(x) else np.array(float(x))
            return f"k{len(self.constants) - 1}"
        full_name = self.names[id(x)]
        if all(isinstance(k, slice) for k in place):
            return full_name
        if (full_name, str(place)) not in self._parts:
            self._parts[full_name, str(place)] = f"b{len(self.buffers)}"
            self.buffers.append(Buffer(*self._kinds[id(x)], int(full_name[1:]), place))
        return self._parts[full_name, str(place)]

    def take(self, node: Node) -> None:
        """A buffer for a value."""
        kind = self._kinds[id(node)] = (node.axes, bool if node.op in BOOLEAN else float)
        if self._free.get(kind):
            self.names[id(node)] = self._free[kind].pop()
        else:
            self.names[id(node)] = f"b{len(self.buffers)}"
            self.buffers.append(Buffer(*kind))

    def release(self, nodes: list[Node]) -> None:
        """Free the buffers of these values for later ones."""
        for x in nodes:
            self._free.setdefault(self._kinds[id(x)], []).append(self.names[id(x)])

    def take_over(self, node: Node, over: list[Node]) -> None:
        """A buffer for a value that is the last to read some others: one of theirs, unless a flip would read it."""
        if node.op in FLIPS:
            self.take(node)
            self.release(over)
        else:
            self.release(over)
            self.take(node)


def write_numpy(recording: Recording, scalar: bool = False) -> tuple[Run, list[Buffer]]:
    """One numpy call a line, its result in a buffer that is free again after its last use.

    A sum with both signs of a value on branch axes is written half by half, ``a + b`` and ``a - b``. scalar: functions
    that numpy may round another way in its vectorised loops are called number by number.
    Returns the function, which takes the inputs (N,) and the buffers, and what the buffers must be.
    """
    terms = {id(node): _signed_term(node) for node in recording.nodes}
    both_signs, buffers = _both_signs(recording, terms), _Buffers(recording)
    written_nodes = [node for node in recording.nodes if id(node) not in both_signs]
    reads = [_operands(node, both_signs) for node in written_nodes]
    last = _last_lines([*reads, recording.outputs])
    lines: list[str] = []
    for k, node in enumerate(written_nodes):
        signed = term if id(term := terms[id(node)]) in both_signs else None
        arguments = [buffers.name(x) for x in node.args] if signed is None else []
        buffers.take_over(node, [x for x in reads[k] if x.op != "input" and last[id(x)] == k])
        lines += [_call_line(buffers, node, arguments)] if signed is None else _half_lines(buffers, node, signed)
    parameters = [buffers.names[id(x)] for x in recording.inputs] + [f"b{k}" for k in range(len(buffers.buffers))]
    outputs = list(map(buffers.name, recording.outputs))
    return function_of(parameters, lines, outputs, buffers.constants | _functions(recording, scalar)), buffers.buffers


def _functions(recording: Recording, scalar: bool) -> dict[str, Any]:
    """What the written lines call, by name; scalar: see `write_numpy`."""
    functions: dict[str, Any] = {"where": _where_into, "add": np.add, "subtract": np.subtract, "positive": np.positive}
    functions |= {op: partial(_flip, axis) for op, axis in FLIPS.items()}
    if scalar:
        functions |= {op: partial(_one_by_one, function) for op, function in _ROUNDED.items()}
    return functions | {node.op: getattr(np, node.op) for node in recording.nodes if node.op not in functions}


def _operands(node: Node, both_signs: set[int]) -> list[Node]:
    """The values that a node's line reads, each once: of a value with both signs those that it is made of."""
    arguments = [y for x in node.args for y in (x.args if id(x) in both_signs else [x])]
    return list({id(y): y for y in arguments if isinstance(y, Node)}.values())


def _last_lines(reads: list[list[Node]]) -> dict[int, int]:
    """The last line that reads each value, by node; outputs are read behind all lines."""
    return {id(x): k for k, nodes in enumerate(reads) for x in nodes}


def _call_line(buffers: _Buffers, node: Node, arguments: list[str]) -> str:
    """The line of a function of arguments."""
    # numpy deprecates a positional third argument of these
    prefix = "out=" if node.op in ("minimum", "maximum") else ""
    return f"{node.op}({', '.join(arguments)}, {prefix}{buffers.names[id(node)]})"


def _half_lines(buffers: _Buffers, node: Node, signed: Node) -> Iterator[str]:
    """The lines of a sum with both signs of a value, `signed`, one for each half."""
    plain = node.args[0] if signed is node.args[1] else node.args[1]
    factors, value = signed.args
    for branch in np.ndindex(factors.shape[:-1]):
        places = tuple(i if size > 1 else None for i, size in zip(branch, factors.shape, strict=False))
        factor = factors[branch][0] if node.op == "add" else -factors[branch][0]
        if factor == 0:
            yield f"positive({buffers.name(plain, places)}, {buffers.name(node, places)})"
        else:
            op = "add" if factor > 0 else "subtract"
            names = ", ".join(buffers.name(x, places) for x in (plain, value, node))
            yield f"{op}({names})"


def _signed_term(node: Node) -> Node | None:
    """The argument of a sum that is a value times signs of branches, or times nothing on some."""
    terms = {"add": node.args, "subtract": node.args[1:]}.get(node.op, ())
    return next((x for x in terms[::-1] if branch_signs(x, zeros=True)), None)


def _both_signs(recording: Recording, terms: dict[int, Node | None]) -> set[int]:
    """Values times signs of branches that are only asked for as such terms, by node."""
    signed = {
        id(x) for node in recording.nodes if (x := terms[id(node)]) is not None and node.args[0] is not node.args[1]
    }
    read_plainly = {id(x) for node in recording.nodes for x in node.args if x is not terms[id(node)]}
    return signed - read_plainly - {id(x) for x in recording.outputs}


def _flip(axis: int, a: Any, buffer: NDArray[Any]) -> None:
    """`numpy.flip` into a buffer that is not that of a."""
    np.copyto(buffer, np.flip(a, axis))


def _where_into(mask: Any, a: Any, b: Any, buffer: NDArray[Any]) -> None:
    """`numpy.where` into a buffer, which may be that of a or b."""
    np.copyto(buffer, np.where(mask, a, b))


def _one_by_one(function: Any, *arguments: Any) -> None:
    """A function of numbers into a buffer, the last argument."""
    *values, buffer = arguments
    buffer[...] = function(*values)
