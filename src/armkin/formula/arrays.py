"""Entries of formulas: arrays over the batch, or plain numbers for constants.

Constants, such as the many zeros and ones of DH tables, stay Python floats, so that operations on them cost nothing.
The same code runs for a single pose, with floats only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Int = NDArray[np.intp]
Truth = Bool | bool  # what a comparison of entries gives


class Entry(Protocol):
    """A plain number, an array over the batch, or a symbol of a recording, with element-wise arithmetic."""

    # the other operand is Any, as a float accepts floats only, while an array accepts all operands of numpy
    def __add__(self, other: Any, /) -> Entry: ...
    def __radd__(self, other: Any, /) -> Entry: ...
    def __sub__(self, other: Any, /) -> Entry: ...
    def __rsub__(self, other: Any, /) -> Entry: ...
    def __mul__(self, other: Any, /) -> Entry: ...
    def __rmul__(self, other: Any, /) -> Entry: ...
    def __truediv__(self, other: Any, /) -> Entry: ...
    def __rtruediv__(self, other: Any, /) -> Entry: ...
    def __pow__(self, other: Any, /) -> Entry: ...
    def __neg__(self) -> Entry: ...
    def __abs__(self) -> Entry: ...
    def __lt__(self, other: Any, /) -> Any: ...
    def __le__(self, other: Any, /) -> Any: ...
    def __gt__(self, other: Any, /) -> Any: ...
    def __ge__(self, other: Any, /) -> Any: ...


E = TypeVar("E", bound=Entry)

_numpy: Any = np  # numpy's functions accept all kinds of entries, but its stubs do not say so
absolute: Callable[[Entry], Entry] = _numpy.abs
sign: Callable[[Entry], Entry] = _numpy.sign
sqrt: Callable[[Entry], Entry] = _numpy.sqrt
cbrt: Callable[[Entry], Entry] = _numpy.cbrt
tan: Callable[[Entry], Entry] = _numpy.tan
maximum: Callable[[Entry, Entry], Entry] = _numpy.maximum
minimum: Callable[[Entry, Entry], Entry] = _numpy.minimum
arctan2: Callable[[Entry, Entry], Entry] = _numpy.arctan2
copysign: Callable[[Entry, Entry], Entry] = _numpy.copysign
where: Callable[[Any, Entry, Entry], Entry] = _numpy.where
flip: Callable[[Entry, int], Entry] = _numpy.flip


CHUNK = 8000  # poses computed together: enough to hide the cost of calls, few enough for the cache


def real_array(values: ArrayLike, name: str) -> Array:
    """Values from outside as an array of floats; name: their name, for the message.

    Raises UsageError for text, dates, complex numbers and lists of unequal lengths. nan and infinity pass.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind in "biufO":  # O: objects, such as fractions
            return array.astype(np.float64)
        kind = f"an array of {array.dtype}"
    except (TypeError, ValueError):
        kind = type(values).__name__
    raise UsageError(f"{name}: expected an array of real numbers, got {kind}")


def is_single(values: ArrayLike) -> bool:
    """Whether values are an array in float32."""
    return getattr(values, "dtype", None) == np.float32


def mul(a: Entry, b: Entry) -> Entry:
    """Product that skips known zeros and ones.

    >>> mul(0.0, np.array([1.0, 2.0])), mul(-1.0, 3.0)
    (0.0, -3.0)
    """
    for factor, cofactor in ((a, b), (b, a)):
        if isinstance(factor, float) and factor == 0.0:
            return 0.0
        if isinstance(factor, float) and abs(factor) == 1.0:
            return cofactor if factor == 1.0 else -cofactor
    return a * b


def add(a: Entry, b: Entry) -> Entry:
    """Sum that skips known zeros."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def sub(a: Entry, b: Entry) -> Entry:
    """Difference that skips known zeros."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return -b
    return a - b


def dot(u: Sequence[Entry], v: Sequence[Entry]) -> Entry:
    """Scalar product of two vectors of entries."""
    total: Entry = 0.0
    for a, b in zip(u, v, strict=True):
        total = add(total, mul(a, b))
    return total


def combine(a: Entry, u: Sequence[Entry], b: Entry, v: Sequence[Entry]) -> list[Entry]:
    """The vector ``a u + b v``."""
    return [add(mul(a, x), mul(b, y)) for x, y in zip(u, v, strict=True)]


def cross(u: Sequence[Entry], v: Sequence[Entry]) -> list[Entry]:
    """Vector product of two vectors of entries."""
    return [
        sub(mul(u[1], v[2]), mul(u[2], v[1])),
        sub(mul(u[2], v[0]), mul(u[0], v[2])),
        sub(mul(u[0], v[1]), mul(u[1], v[0])),
    ]


def cross_rows(a: Array, b: Array) -> Array:
    """Vector products (..., 3); for few vectors np.cross takes three times as long."""
    following, preceding = [1, 2, 0], [2, 0, 1]
    product: Array = a[..., following] * b[..., preceding] - a[..., preceding] * b[..., following]
    return product


def cos_sin(angle: Entry) -> tuple[Entry, Entry]:
    """Cosine and sine of an angle [rad].

    Arrays use the tangent of the half angle, because numpy has a vectorised tangent but no vectorised
    double precision sine; the result differs from the library's by at most 2.3e-16 over several turns.
    """
    if isinstance(angle, float):
        return math.cos(angle), math.sin(angle)
    t = tan(0.5 * angle)
    t2 = t * t
    scale = 1.0 / (1.0 + t2)
    return (1.0 - t2) * scale, (t + t) * scale


def wrap_angle(angle: E) -> E:
    """An angle [rad] without its whole turns, in [-pi, pi].

    >>> round(float(wrap_angle(7.0)), 6)
    0.716815
    """
    wrapped_angle: E = angle - 2 * np.pi * _numpy.rint(angle / (2 * np.pi))
    return wrapped_angle


def numbers_within(count: Int) -> Int:
    """The numbers 0, 1, ... within consecutive groups of `count` items: (G,) -> (sum of count,)."""
    return np.asarray(np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count))


def slices(count: int, size: int) -> list[slice]:
    """Consecutive slices from 0 to count of a size, with a shorter last one.

    >>> slices(5, 2)
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
