"""Distances between segments."""

import numpy as np

from armkin.formula.arrays import Array


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Least distance of segments a-b and c-d: (3, ...) each, broadcast -> (...).

    The least distance is at the feet of the common normal, if both are inside, or at one of the four ends. The least of
    these five is exact, for parallel segments and points as well (after Ericson, Real-Time Collision Detection, 5.1.9).
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    spread = uu * vv - uv * uv  # squared length of u x v
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (uv * vw - vv * uw) / spread, (uu * vw - uv * uw) / spread
        is_inside = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)  # False for nan, that is for parallel segments
        # the nearest point of the other segment to each end
        candidates = (
            (0.0, _clip_to_segment(vw / vv)),
            (1.0, _clip_to_segment((vw + uv) / vv)),
            (_clip_to_segment(-uw / uu), 0.0),
            (_clip_to_segment((uv - uw) / uu), 1.0),
        )
    square = _squared_distance(w, u, v, np.where(is_inside, s, 0.0), np.where(is_inside, t, candidates[0][1]))
    for s_end, t_end in candidates:
        square = np.minimum(square, _squared_distance(w, u, v, s_end, t_end))
    return np.sqrt(square)


def _clip_to_segment(x: Array) -> Array:
    """A parameter clipped to [0, 1]; 0 for a segment without length."""
    return np.clip(np.where(np.isfinite(x), x, 0.0), 0.0, 1.0)


def _squared_distance(w: Array, u: Array, v: Array, s: Array | float, t: Array | float) -> Array:
    offset = w + s * u - t * v
    return _dot(offset, offset)


def _dot(x: Array, y: Array) -> Array:
    dot: Array = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    return dot
