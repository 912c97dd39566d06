"""A route: pieces one after another, with rests between them where they meet at a corner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.tasks.task import Task
from armkin.motion.geometry import SMALL, Piece, blend
from armkin.motion.trajectory import grouped

_SMOOTH = 1e-3  # [rad] between two directions that count as one


@dataclass(frozen=True)
class Route:
    """Pieces in order; `rests`: numbers of the pieces before which the arm stands, and for how long."""

    task: Task
    pieces: tuple[Piece, ...]
    stops: frozenset[int]  # piece numbers (and len(pieces)) at whose start the arm is at rest

    @cached_property
    def ends(self) -> Array:
        """Where pieces begin, and the end: (pieces + 1,) [mm]."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    @property
    def length(self) -> float:
        """Whole length [mm, and 30 mm per rad]."""
        return float(self.ends[-1])

    def which(self, s: Array) -> NDArray[np.intp]:
        """Number of the piece at lengths s (N,)."""
        return np.clip(np.searchsorted(self.ends, s, side="right") - 1, 0, len(self.pieces) - 1)

    def targets(self, s: Array) -> Array:
        """Targets (N, m) or (N, 4, 4) at lengths s (N,), increasing or not."""
        out: Array | None = None
        for k, here in grouped(self.which(s)):
            values = self.pieces[k].targets(s[here] - self.ends[k])
            if out is None:
                out = np.empty((len(s), *values.shape[1:]))
            out[here] = values
        assert out is not None
        return out

    @cached_property
    def _paces(self) -> tuple[Array, Array]:
        """Fraction of the joints' speed and tool speed of every piece; nan: it has none of its own."""
        return tuple(  # type: ignore[return-value]
            np.array([np.nan if x is None else x for x in each])
            for each in ([p.speed for p in self.pieces], [p.tool_speed for p in self.pieces])
        )

    def limit(self, s: Array, speed: float, tool: float | None) -> tuple[Array, Array]:
        """Fraction of the joints' speed and tool speed [mm/s] (inf: none) in the intervals between s: (N - 1,) each."""
        which = self.which((s[:-1] + s[1:]) / 2)
        parts, tools = (own[which] for own in self._paces)
        most = np.inf if tool is None else tool
        return np.where(np.isnan(parts), speed, parts), np.where(np.isnan(tools), most, tools)


def joined(
    task: Task, pieces: Sequence[Piece], blends: Sequence[float], pauses: frozenset[int]
) -> tuple[Route, dict[int, int]]:
    """Pieces as a route: corners rounded by their blends (one for each piece's end), rests where there is none.

    pauses: numbers of pieces before which the arm has to stand in any case. Returns the route, and for each of
    them the number of the piece in it.
    """
    made: list[Piece] = []
    side = 0.0  # of the last piece, before it was cut
    stops, order = {0}, {}
    rests: set[int] = set()  # values of `order`
    for k, piece in enumerate(pieces):
        if k in pauses:
            order[k] = len(made)
            rests.add(len(made))
        if piece.length < SMALL:
            continue
        if not made or order.get(k) == len(made) or len(made) in rests:
            stops.add(len(made))
            made.append(piece)
            side = piece.length
            continue
        before = made[-1]
        a, b = before.direction(before.length), piece.direction(0.0)
        angle = float(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1, 1)))
        radius = blends[k - 1]
        if angle < _SMOOTH:
            made.append(piece)
        elif radius <= 0 or angle > np.pi - _SMOOTH or not (_moves(before) and _moves(piece)):
            stops.add(len(made))
            made.append(piece)
        else:
            first, middle, last = blend(task, before, piece, radius, side)
            made[-1:] = [p for p in (first, middle, last) if p is last or p.length > SMALL]
        side = piece.length
    stops.add(len(made))
    return Route(task, tuple(made), frozenset(stops)), order


def _moves(piece: Piece) -> bool:
    """Whether the position moves at all: a pure turn has no sphere to be blended in."""
    p = [piece.along(np.array([f * piece.length]))[0, : piece.task.position] for f in (0.0, 0.5, 1.0)]
    return bool(max(np.linalg.norm(p[0] - p[1]), np.linalg.norm(p[1] - p[2])) > 1e-6)
