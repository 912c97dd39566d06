"""Files at random as armkin reads them, and how far that lies off what another reader makes of them."""

from __future__ import annotations

import numpy as np

import other_readers
import random_drawings
from armkin.errors import PathFileError
from armkin.path_file import gcode, svg
from armkin.path_file.drawing import DrawingOptions, Placing

AS_IT_IS = Placing((0.0, 0.0, 0.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


def points_along(points: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, float]:
    """Points at shares of a polyline's length, and the length."""
    u = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return np.stack([np.interp(f * u[-1], u, points[:, k]) for k in range(points.shape[1])], axis=1), float(u[-1])


def greatest_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Greatest distance of two ways, each point from the other way's segments about the same share of its length."""
    f = np.linspace(0.0, 1.0, 4001)
    (p, long), (q, other_length) = points_along(a, f), points_along(b, f)
    return max(_distance_from(p, q), _distance_from(q, p), abs(long - other_length) / 50 - 0.01)


def _distance_from(p: np.ndarray, q: np.ndarray) -> float:
    least = np.full(len(p), np.inf)
    for shift in range(-4, 4):
        i = np.clip(np.arange(len(p)) + shift, 0, len(q) - 2)
        step = q[i + 1] - q[i]
        share = ((p - q[i]) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-300)
        foot = q[i] + np.clip(share, 0.0, 1.0)[:, None] * step
        least = np.minimum(least, np.linalg.norm(p - foot, axis=1))
    return float(least.max())


def program_read(text: str) -> np.ndarray:
    """What armkin reads of a program: (N, 3) [mm], arcs as chords."""
    points: list[np.ndarray] = []
    for move in gcode.parse_gcode(text.encode(), "t.gcode", AS_IT_IS, DrawingOptions()).moves:
        if move.point is not None:
            points.append(np.array(move.point))
        points += [np.array(p) for p in move.polyline or []]
        if move.arc is not None:
            points += list(_arc_through(points[-1], np.array(move.arc.via), np.array(move.arc.to)))
        if move.circle is not None:
            c, n = np.array(move.circle.centre), np.array(move.circle.normal)
            r, turn = points[-1] - c, 2 * np.pi * move.circle.turns
            f = np.linspace(0.0, 1.0, int(2000 * max(abs(turn), 1.0)))[1:, None]
            flat = np.cos(turn * f) * r + np.sin(turn * f) * np.cross(n, r)
            points += list(c + flat + f * move.circle.rise * n)
    return np.array(points)


def _arc_through(a: np.ndarray, via: np.ndarray, b: np.ndarray) -> np.ndarray:
    """An arc of three points: (N, 3)."""
    u, v = via - a, b - a
    w = np.cross(u, v)
    if np.linalg.norm(w) < 1e-9:
        return np.stack([via, b])
    centre = a + np.cross((u @ u) * v - (v @ v) * u, w) / (2 * w @ w)
    n, r = w / np.linalg.norm(w), a - centre
    across = np.cross(n, r)
    turn = np.arctan2((b - centre) @ across, (b - centre) @ r) % (2 * np.pi)
    t = np.linspace(0.0, turn, 2000)[1:, None]
    return np.asarray(centre + np.cos(t) * r + np.sin(t) * across)


def program_off(seed: int) -> float:
    """How far a program's way lies off the other reader's [mm]."""
    text = random_drawings.random_program(seed)
    return greatest_distance(program_read(text), other_readers.gcode_points(text))


def drawing_off(seed: int) -> float:
    """How far a drawing's strokes lie off the other reader's [mm]."""
    text = random_drawings.random_drawing(seed)
    strokes: list[list[list[float]]] = []
    for move in svg.parse_svg(text.encode(), "t.svg", AS_IT_IS, DrawingOptions(lift=0.0)).moves:
        if move.point is not None:
            strokes.append([list(move.point)])
        strokes[-1] += [list(p) for p in move.polyline or []]
    mine = np.concatenate([np.array(s)[:, :2] for s in strokes])
    return greatest_distance(mine, np.concatenate(other_readers.svg_strokes(text)))


def spoil_drawing(seed: int, number: int) -> tuple[str, str, str]:
    """A drawing with a broken element, or a broken line: its text, the place that is named, what is said."""
    lines, rng = random_drawings.random_drawing(seed).splitlines(), np.random.default_rng(seed)
    line, words = random_drawings.BROKEN_ELEMENTS[number % len(random_drawings.BROKEN_ELEMENTS)]
    k = int(rng.integers(3, len(lines)))  # behind the head, before the end
    lines.insert(k, line)
    return "\n".join(lines), f"t.svg:{k + 1}: ", words


def refusal(text: str) -> str:
    """Why a drawing is refused; empty: it is drawn."""
    try:
        svg.parse_svg(text.encode(), "t.svg", AS_IT_IS, DrawingOptions())
    except PathFileError as error:
        return str(error)
    return ""
