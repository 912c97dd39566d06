"""Straight-line numpy code from formulas: a formula is run once on symbols and its operations recorded.

The closed forms and the forward kinematics are written as ordinary functions of arrays.
Called on arrays they spend much of their time in Python: one call for every product of two
numbers of which one is a known zero. Called once on `Node` symbols they leave behind the
list of what really has to be computed; equal operations are found to be equal, and what is
left runs as a flat sequence of numpy calls into buffers that are used again and again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array

_BOOL = {"less", "less_equal", "greater", "greater_equal", "bitwise_or", "bitwise_and", "equal"}


class Node(np.lib.mixins.NDArrayOperatorsMixin):
    """An array that is not there yet: what numpy is asked to do with it is recorded.

    axes: lengths of the branch axes in front of the batch axis, () for a plain (N,) array.
    """

    def __init__(self, trace: _Trace, op: str, args: tuple[Any, ...], axes: tuple[int, ...]) -> None:
        self.trace, self.op, self.args, self.axes = trace, op, args, axes

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            raise TypeError(f"{ufunc.__name__}.{method} cannot be recorded")
        return self.trace.simplify(ufunc.__name__, inputs)

    def __array_function__(self, function: Any, types: Any, inputs: Any, options: Any) -> Any:
        if function is not np.where or len(inputs) != 3:
            raise TypeError(f"{function.__name__} cannot be recorded")
        return self.trace.record("where", inputs)


class _Trace:
    """The operations recorded so far, equal ones once."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.known: dict[tuple[Any, ...], Node] = {}

    def simplify(self, op: str, inputs: Sequence[Any]) -> Any:
        """Record an operation, or what is equal to it and shorter: no zeros, no ones, signs moved outwards."""
        if op == "negative":
            x = inputs[0]
            return x.args[0] if x.op == "negative" else self.record(op, inputs)
        if op in ("multiply", "add", "subtract"):
            a, b = inputs
            minus_a, minus_b = _is_negative(a), _is_negative(b)
            a, b = (a.args[0] if minus_a else a), (b.args[0] if minus_b else b)
            if op == "multiply":
                for x, y in ((a, b), (b, a)):
                    if not isinstance(x, Node) and np.ndim(x) == 0 and abs(x) in (0.0, 1.0):
                        if x == 0.0:
                            return 0.0
                        return self._signed(y, (x < 0) != (minus_a != minus_b))
                return self._signed(self.record(op, (a, b)), minus_a != minus_b)
            minus_b ^= op == "subtract"
            if _is_zero(b):
                return self._signed(a, minus_a)
            if _is_zero(a):
                return self._signed(b, minus_b)
            if minus_a == minus_b:
                return self._signed(self.record("add", (a, b)), minus_a)
            return self.record("subtract", (b, a) if minus_a else (a, b))
        return self.record(op, inputs)

    def _signed(self, x: Any, minus: bool) -> Any:
        return self.simplify("negative", (x,)) if minus and isinstance(x, Node) else -x if minus else x

    def record(self, op: str, inputs: Sequence[Any]) -> Node:
        key = (op, *(id(x) if isinstance(x, Node) else _constant_key(x) for x in inputs))
        if key not in self.known:
            axes = np.broadcast_shapes(*(_axes(x) for x in inputs))
            self.known[key] = Node(self, op, tuple(inputs), axes)
            self.nodes.append(self.known[key])
        return self.known[key]


def _is_negative(x: Any) -> bool:
    return isinstance(x, Node) and x.op == "negative"


def _is_zero(x: Any) -> bool:
    return not isinstance(x, Node) and np.ndim(x) == 0 and x == 0.0


def _constant_key(x: Any) -> tuple[Any, ...]:
    return ("constant", np.shape(x), np.asarray(x).tobytes())


def _axes(x: Any) -> tuple[int, ...]:
    if isinstance(x, Node):
        return x.axes
    return np.shape(x)[:-1] if np.ndim(x) else ()


class Straight:
    """A recorded formula, as code for batches and as code for one pose."""

    def __init__(self, formula: Callable[[list[Any]], Sequence[Any]], inputs: int) -> None:
        """formula: takes a list of that many arrays, returns a sequence of arrays or numbers."""
        trace = _Trace()
        self._inputs = [Node(trace, "input", (), ()) for _ in range(inputs)]
        self._outputs = list(formula(list(self._inputs)))
        self._nodes = _needed(trace.nodes, self._outputs)
        self._buffers: list[tuple[tuple[int, ...], type]] = []
        self._run = self._batch_code()
        self._run_single: Callable[..., tuple[Any, ...]] | None = None

    def workspace(self, length: int) -> list[NDArray[Any]]:
        """Buffers for batches of that length, to be passed to `run`; one set for each thread."""
        return [np.empty((*axes, length), dtype) for axes, dtype in self._buffers]

    def run(self, inputs: Sequence[Array], workspace: list[NDArray[Any]]) -> tuple[Any, ...]:
        """The formula's outputs for inputs (N,); they stand in the workspace until its next use."""
        return self._run(*inputs, *workspace)

    def single(self, inputs: Sequence[float]) -> list[Array]:
        """The formula's outputs for one pose, as arrays (*branch axes, 1).

        In plain Python numbers: for one pose a call of numpy costs more than what it computes.
        """
        if self._run_single is None:
            self._run_single = self._single_code()
        values = self._run_single(*inputs)
        return [
            np.array(v).reshape(*_axes(x), 1) if isinstance(v, tuple) else np.array([v])
            for x, v in zip(self._outputs, values, strict=True)
        ]

    def _batch_code(self) -> Callable[..., tuple[Any, ...]]:
        """One numpy call a line, its result in a buffer that is free again after its last use."""
        names = {id(node): f"i{k}" for k, node in enumerate(self._inputs)}
        constants: dict[str, Any] = {}
        last = {id(x): k for k, node in enumerate(self._nodes) for x in node.args}
        last |= {id(x): len(self._nodes) for x in self._outputs}
        free: dict[tuple[tuple[int, ...], type], list[str]] = {}
        kinds: dict[int, tuple[tuple[int, ...], type]] = {}
        lines = []

        def name(x: Any) -> str:
            if isinstance(x, Node):
                return names[id(x)]
            if np.ndim(x) == 0:
                return repr(float(x))
            constants[f"k{len(constants)}"] = x
            return f"k{len(constants) - 1}"

        for k, node in enumerate(self._nodes):
            arguments = [name(x) for x in node.args]
            for x in {id(x): x for x in node.args}.values():
                if isinstance(x, Node) and x.op != "input" and last[id(x)] == k:
                    free.setdefault(kinds[id(x)], []).append(names[id(x)])
            kind = kinds[id(node)] = (node.axes, bool if node.op in _BOOL else float)
            if free.get(kind):
                names[id(node)] = free[kind].pop()
            else:
                names[id(node)] = f"b{len(self._buffers)}"
                self._buffers.append(kind)
            # numpy deprecates a positional third argument of minimum and maximum
            out = "out=" if node.op in ("minimum", "maximum") else ""
            lines.append(f"{node.op}({', '.join(arguments)}, {out}{names[id(node)]})")
        parameters = [names[id(x)] for x in self._inputs] + [f"b{k}" for k in range(len(self._buffers))]
        outputs = list(map(name, self._outputs))
        scope = {**constants, **{node.op: getattr(np, node.op) for node in self._nodes}, "where": _where}
        return _compiled(parameters, lines, outputs, scope)

    def _single_code(self) -> Callable[..., tuple[Any, ...]]:
        """One Python expression a line and branch, branch axes unrolled."""
        names: dict[int, dict[tuple[int, ...], str]] = {id(node): {(): f"i{k}"} for k, node in enumerate(self._inputs)}
        lines = []

        def name(x: Any, index: tuple[int, ...]) -> str:
            axes = _axes(x)
            at = tuple(0 if size == 1 else i for size, i in zip(axes, index[len(index) - len(axes) :], strict=True))
            if isinstance(x, Node):
                return names[id(x)][at]
            return repr(float(np.asarray(x)[(*at, 0)] if np.ndim(x) else x))

        for k, node in enumerate(self._nodes):
            names[id(node)] = {}
            for b, index in enumerate(np.ndindex(*node.axes)):
                names[id(node)][index] = f"t{k}_{b}"
                lines.append(f"t{k}_{b} = " + _PYTHON[node.op].format(*(name(x, index) for x in node.args)))
        outputs = []
        for x in self._outputs:
            every = [name(x, index) for index in np.ndindex(*_axes(x))]
            outputs.append(f"({', '.join(every)},)" if _axes(x) else every[0])
        return _compiled([names[id(x)][()] for x in self._inputs], lines, outputs, {"math": math})


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
    "equal": "{} == {}",
    "bitwise_or": "{} or {}",
    "bitwise_and": "{} and {}",
    "where": "{1} if {0} else {2}",
}


class OncePaid:
    """A formula that is recorded once that pays: it takes some milliseconds."""

    def __init__(self, formula: Callable[[list[Any]], Sequence[Any]], inputs: int) -> None:
        """The arguments of `Straight`."""
        self._formula, self._inputs, self._calls = formula, inputs, 0
        self._straight: Straight | None = None

    def get(self, batch: int) -> Straight | None:
        """The recorded code, once a batch or a fifth call makes it worth while."""
        self._calls += 1
        if self._straight is None and (batch >= 64 or self._calls > 4):
            self._straight = Straight(self._formula, self._inputs)
        return self._straight


def _where(mask: Any, a: Any, b: Any, out: NDArray[Any]) -> None:
    """`numpy.where` into a buffer, which may be that of a or b."""
    np.copyto(out, np.where(mask, a, b))


def _compiled(
    parameters: list[str], lines: list[str], outputs: list[str], scope: dict[str, Any]
) -> Callable[..., tuple[Any, ...]]:
    """A function made of these lines. They consist of names and numbers written by this module alone."""
    source = "\n    ".join([f"def run({', '.join(parameters)}):", *lines, f"return ({', '.join(outputs)},)"])
    exec(source, scope)
    run: Callable[..., tuple[Any, ...]] = scope["run"]
    return run


def _needed(nodes: list[Node], outputs: Sequence[Any]) -> list[Node]:
    """The operations that the outputs depend on, in order."""
    needed = {id(x) for x in outputs if isinstance(x, Node)}
    for node in reversed(nodes):
        if id(node) in needed:
            needed |= {id(x) for x in node.args if isinstance(x, Node)}
    return [node for node in nodes if id(node) in needed]
