"""Records formulas: runs a function once on symbols and keeps its operations as a list.

The closed forms and the forward kinematics are ordinary functions of arrays. Called on arrays,
they would spend much time in Python, also for products with constant zeros. Called once on
`Node` symbols, they give a list of the necessary operations, without repetitions.
`numpy_code`, `python_code` and `c_and_js_code` write this list as programs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

BOOLEAN = {"less", "less_equal", "greater", "greater_equal", "bitwise_or", "bitwise_and", "equal"}
ODD = {"arctan2", "rint", "tan", "cbrt"}  # functions that are odd in their first argument
COMMUTING = {"multiply", "add", "bitwise_or", "bitwise_and"}


FLIPS = {f"flip_{axis}": axis for axis in range(3)}  # operations that exchange branches on an axis


def index_before_flip(op: str, index: tuple[int, ...], axes: tuple[int, ...]) -> tuple[int, ...]:
    """The branch, before a flip, of the value at a branch after the flip.

    >>> index_before_flip("flip_1", (0, 0, 0), (2, 2, 1))
    (0, 1, 0)
    """
    axis = FLIPS[op]
    return (*index[:axis], axes[axis] - 1 - index[axis], *index[axis + 1 :])


Sign = Any  # 1.0, -1.0 or an array of them on branch axes


class Node(np.lib.mixins.NDArrayOperatorsMixin):
    """A symbol for an array; operations of numpy on it are recorded.

    axes: lengths of the branch axes in front of the batch axis, () for a plain (N,) array. number: of operations
    recorded before; negative for inputs.
    """

    def __init__(self, trace: Trace, op: str, args: tuple[Any, ...], axes: tuple[int, ...], number: int) -> None:
        self.trace, self.number = trace, number
        self.op, self.args, self.axes = op, args, axes

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            raise TypeError(f"{ufunc.__name__}.{method} cannot be recorded")
        return self.trace.simplify(ufunc.__name__, inputs)

    def __array_function__(self, function: Any, types: Any, inputs: Any, options: Any) -> Any:
        if function is np.any:
            return True  # an unknown value may be true for some pose
        if function is np.flip:  # flipping a branch axis exchanges its branches
            x, axis = inputs
            return x if axis >= len(x.axes) or x.axes[axis] == 1 else self.trace.record(f"flip_{axis}", (x,))
        if function is not np.where or len(inputs) != 3:
            raise TypeError(f"{function.__name__} cannot be recorded")
        return self.trace.record("where", inputs)


class Trace:
    """The operations recorded so far, without repetitions."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.nodes_by_key: dict[tuple[Any, ...], Node] = {}

    def simplify(self, op: str, inputs: Sequence[Any]) -> Any:
        """Record an operation or a shorter equal one, without zeros and ones, and with signs moved outwards.

        Signs include those of branches: ``(s a) (s b)`` is computed once for both values of s.
        """
        if op in ("bitwise_and", "bitwise_or"):
            return self._combine_truths(op, *inputs)
        if op == "power" and inputs[1] == 2:
            return self.simplify("multiply", (inputs[0], inputs[0]))
        if op not in ODD and op not in ("negative", "absolute", "multiply", "divide", "add", "subtract"):
            return self.record(op, inputs)
        return self._signs_outwards(op, inputs)

    def _signs_outwards(self, op: str, inputs: Sequence[Any]) -> Any:
        """Record an operation on its arguments without their signs."""
        (s, a), (t, b) = _split_sign(inputs[0]), _split_sign(inputs[-1])
        if op == "negative":
            return self._apply_sign(a, -s)
        if op == "absolute":
            return self.record(op, (a,))
        if op in ODD:
            return self._apply_sign(self.record(op, (a, *inputs[1:])), s)
        if op == "divide":
            return self._apply_sign(self.record(op, (a, b)), _sign_product(s, t))
        if op == "multiply":
            return self._multiply(a, b, _sign_product(s, t))
        return self._sum(s, a, -t if op == "subtract" else t, b)

    def _combine_truths(self, op: str, x: Any, y: Any) -> Any:
        """``x & y`` or ``x | y``, without an operation if one argument is a constant."""
        for constant, value in ((x, y), (y, x)):
            # a constant decides the result, or leaves it to the other argument
            if isinstance(constant, bool | np.bool_):
                return value if bool(constant) == (op == "bitwise_and") else bool(constant)
        return self.record(op, (x, y))

    def _multiply(self, a: Any, b: Any, sign: Sign) -> Any:
        """``sign a b``."""
        for x, y in ((a, b), (b, a)):
            if not isinstance(x, Node) and _ndim(x) == 0 and abs(x) in (0.0, 1.0):
                return self._apply_sign(y, _sign_product(sign, x)) if x else 0.0
        return self._apply_sign(self._product(a, b), sign)

    def _sum(self, s: Sign, a: Any, t: Sign, b: Any) -> Any:
        """``s a + t b``."""
        if _is_zero(b):
            return self._apply_sign(a, s)
        if _is_zero(a):
            return self._apply_sign(b, t)
        if _ndim(s) and not _ndim(t):
            (s, a), (t, b) = (t, b), (s, a)
        relative = _sign_product(s, t)
        if _ndim(relative):
            return self._apply_sign(self.record("add", (a, self._apply_sign(b, relative))), s)
        if relative > 0:
            return self._apply_sign(self.record("add", (a, b)), s)
        if a is b:
            return 0.0
        if _ndim(s) == 0 and s < 0:
            return self.record("subtract", (b, a))
        return self._apply_sign(self.record("subtract", (a, b)), s)

    def _apply_sign(self, x: Any, sign: Sign) -> Any:
        """``sign x``."""
        own_sign, x = _split_sign(x)
        sign = _sign_product(sign, own_sign)
        if not isinstance(x, Node):
            return sign * x
        if _ndim(sign):
            return self.record("multiply", (sign, x))
        return x if sign > 0 else self.record("negative", (x,))

    def _product(self, a: Any, b: Any) -> Any:
        """The product of two factors, with constants combined: ``k1 (k2 x)`` is one operation."""
        for k, x in ((a, b), (b, a)):
            if not isinstance(k, Node) and isinstance(x, Node) and x.op == "multiply":
                for factor, y in (x.args, x.args[::-1]):
                    if not isinstance(factor, Node):
                        return self.simplify("multiply", (k * factor, y))
        return self.record("multiply", (a, b))

    def record(self, op: str, inputs: Sequence[Any]) -> Node:
        """The node of an operation; equal inputs give the same node."""
        if op in COMMUTING and _commuting_key(inputs[0]) > _commuting_key(inputs[1]):
            inputs = inputs[::-1]  # a fixed order gives equal keys: constants first, then older nodes
        key = (op, *[id(x) if isinstance(x, Node) else _constant_key(x) for x in inputs])
        node = self.nodes_by_key.get(key)
        if node is None:
            shapes = {axes_of(x) for x in inputs} - {()}
            axes = np.broadcast_shapes(*shapes) if len(shapes) > 1 else next(iter(shapes), ())
            node = self.nodes_by_key[key] = Node(self, op, tuple(inputs), axes, len(self.nodes))
            self.nodes.append(node)
        return node


def _commuting_key(x: Any) -> float:
    return x.number if isinstance(x, Node) else -math.inf


def _ndim(x: Any) -> int:
    """`numpy.ndim` of an array or a number."""
    return x.ndim if isinstance(x, np.ndarray) else 0


def branch_signs(x: Any, zeros: bool = False) -> bool:
    """Whether a node is a value times an array of signs on branch axes; zeros: whether zeros count as signs."""
    if not isinstance(x, Node) or x.op != "multiply" or not _ndim(x.args[0]):
        return False
    magnitudes = np.abs(x.args[0])
    return bool(((magnitudes == 1.0) | (zeros & (magnitudes == 0.0))).all())


def _split_sign(x: Any) -> tuple[Sign, Any]:
    """A value as a sign and a remaining factor; the sign may depend on branches."""
    if isinstance(x, Node) and x.op == "negative":
        return -1.0, x.args[0]
    if isinstance(x, Node):
        return x.args if branch_signs(x) else (1.0, x)
    if _ndim(x) and np.all(abs(x) == abs(x).flat[0]) and x.flat[0]:
        return _sign_product(np.sign(x), 1.0), abs(float(x.flat[0]))
    return 1.0, x


def _sign_product(s: Sign, t: Sign) -> Sign:
    """The product of two signs, without branch axes on which it is constant."""
    sign = s * t
    for axis in range(_ndim(sign)):
        first = sign.take([0], axis)
        sign = first if (sign == first).all() else sign
    return float(sign.flat[0]) if _ndim(sign) and sign.size == 1 else sign


def _is_zero(x: Any) -> bool:
    return not isinstance(x, Node) and _ndim(x) == 0 and x == 0.0


def _constant_key(x: Any) -> Any:
    """A key of the exact bits of a constant, different for -0.0 and 0.0."""
    return x.hex() if isinstance(x, float) else (np.shape(x), np.asarray(x).tobytes())


def axes_of(x: Any) -> tuple[int, ...]:
    """Lengths of the branch axes of a node, an array or a number."""
    if isinstance(x, Node):
        return x.axes
    return x.shape[:-1] if isinstance(x, np.ndarray) else ()


@dataclass(frozen=True, eq=False)
class Recording:
    """A formula as a list of operations.

    inputs: nodes. outputs: nodes, arrays or numbers. nodes: all operations that the outputs depend on, without the
    inputs, arguments before results.
    """

    inputs: list[Node]
    outputs: list[Any]
    nodes: list[Node]


def record(formula: Callable[[list[Any]], Sequence[Any]], inputs: int) -> Recording:
    """The recording of a formula of a list of `inputs` arrays."""
    trace = Trace()
    symbols = [Node(trace, "input", (), (), k - inputs) for k in range(inputs)]
    outputs = list(formula(list(symbols)))
    return Recording(symbols, outputs, _live_nodes(trace.nodes, outputs))


def _live_nodes(nodes: list[Node], outputs: Sequence[Any]) -> list[Node]:
    """The operations that the outputs depend on, in order."""
    needed_ids = {id(x) for x in outputs if isinstance(x, Node)}
    for node in reversed(nodes):
        if id(node) in needed_ids:
            needed_ids.update(id(x) for x in node.args if isinstance(x, Node))
    return [node for node in nodes if id(node) in needed_ids]
