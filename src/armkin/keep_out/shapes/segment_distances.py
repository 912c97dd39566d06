"""Distances between segments."""

from __future__ import annotations

import numpy as np

from armkin.formula.arrays import Array


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Least distance of segments a-b and c-d: (3, ...) each, broadcast -> (...).

    Either both feet of the common normal are inside, or an end is nearest: the least of these five is exact,
    for parallel segments and points, too (Ericson, Real-Time Collision Detection, 5.1.9, without its clamping).
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    spread = uu * vv - uv * uv  # squared length of u x v
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (uv * vw - vv * uw) / spread, (uu * vw - uv * uw) / spread
        crossing = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)  # nan, of parallel ones, is not
        # from each end to the other segment: where the parameter is clipped
        candidates = (
            (0.0, _clip_to_segment(vw / vv)),
            (1.0, _clip_to_segment((vw + uv) / vv)),
            (_clip_to_segment(-uw / uu), 0.0),
            (_clip_to_segment((uv - uw) / uu), 1.0),
        )
    least = _squared_distance(w, u, v, np.where(crossing, s, 0.0), np.where(crossing, t, candidates[0][1]))
    for s_end, t_end in candidates:
        least = np.minimum(least, _squared_distance(w, u, v, s_end, t_end))
    return np.sqrt(least)


def _clip_to_segment(x: Array) -> Array:
    """Clipped to [0, 1]; of a segment without length the beginning."""
    return np.clip(np.where(np.isfinite(x), x, 0.0), 0.0, 1.0)


def _squared_distance(w: Array, u: Array, v: Array, s: Array | float, t: Array | float) -> Array:
    apart = w + s * u - t * v
    return _dot(apart, apart)


def _dot(x: Array, y: Array) -> Array:
    dot: Array = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    return dot
