"""A route: consecutive pieces of a tool path, with blends or rests at their corners."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.tasks.task import Task
from armkin.motion.timing.trajectory import group_numbers
from armkin.motion.tool_path.corner_blend import blend
from armkin.motion.tool_path.fit_points import REVERSAL_ANGLE
from armkin.motion.tool_path.path_pieces import MIN_LENGTH, Dense, Piece

_ONE_BREAK = 1e-6  # distance [mm] below which two breaks are one
_SMOOTH_ANGLE = 1e-3  # angle [rad] below which two directions are the same


@dataclass(frozen=True)
class Detour:
    """A displacement (3,) [mm] of the path between lengths `begin` and `end`, whole in the middle third."""

    begin: float
    end: float
    displacement: Array

    def offset(self, s: Array) -> Array:
        """The displacement at lengths s (N,): (N, 3) [mm], with continuous second derivative."""
        f = (s - self.begin) / (self.end - self.begin)
        f = np.clip(3 * np.minimum(f, 1 - f), 0.0, 1.0)
        return np.asarray((f**3 * (10 - f * (15 - 6 * f)))[:, None] * self.displacement)


@dataclass(frozen=True)
class Route:
    """Consecutive pieces of a tool path, and where the arm stops on them."""

    task: Task
    pieces: tuple[Piece, ...]
    stops: frozenset[int]  # piece numbers (and len(pieces)) at whose start the arm is at rest
    detours: tuple[Detour, ...] = ()

    @cached_property
    def ends(self) -> Array:
        """The lengths at which pieces begin, and the end: (pieces + 1,) [mm]."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    @property
    def length(self) -> float:
        """Whole length [mm, and 30 mm per rad]."""
        return float(self.ends[-1])

    def piece_number(self, s: Array) -> NDArray[np.intp]:
        """Number of the piece at lengths s (N,)."""
        return np.clip(np.searchsorted(self.ends, s, side="right") - 1, 0, len(self.pieces) - 1)

    def targets(self, s: Array) -> Array:
        """Targets (N, m) or (N, 4, 4) at lengths s (N,), increasing or not."""
        targets: Array | None = None
        for k, rows in group_numbers(self.piece_number(s)):
            values = self.pieces[k].targets(s[rows] - self.ends[k])
            if targets is None:
                targets = np.empty((len(s), *values.shape[1:]))
            targets[rows] = values
        assert targets is not None
        for detour in self.detours:
            targets[..., :3, 3] += detour.offset(s)
        return targets

    @cached_property
    def largest_detour(self) -> float:
        """The largest displacement of the route's detours [mm], 0 without a detour."""
        return max((float(np.linalg.norm(detour.displacement)) for detour in self.detours), default=0.0)

    @cached_property
    def breaks(self) -> Array:
        """The sorted lengths [mm] where the curvature may jump: ends of pieces, and bends inside dense ones."""
        bends = [self.ends[k] + piece.dense.bends for k, piece in enumerate(self.pieces) if piece.dense is not None]
        if not bends:
            return self.ends
        breaks = np.sort(np.concatenate([self.ends, *bends]))
        distinct = np.append(True, np.diff(breaks) > _ONE_BREAK)  # two blends may meet in the middle of a side
        breaks = breaks[distinct]
        breaks[-1] = self.length
        return np.asarray(breaks)

    @cached_property
    def spans(self) -> Array:
        """The lengths [mm] where cubics of dense pieces begin and end, which every grid includes."""
        spans = [self.ends[k] + piece.dense.spans for k, piece in enumerate(self.pieces) if piece.dense is not None]
        return np.concatenate(spans) if spans else np.zeros(0)

    @cached_property
    def given_points(self) -> tuple[Array, Array]:
        """Points that the route was fitted to: where each is passed (N,) [mm], and its position (N, 2 or 3)."""
        dense = [(self.ends[k], piece.dense) for k, piece in enumerate(self.pieces) if piece.dense is not None]
        if not dense:
            return np.zeros(0), np.zeros((0, self.task.position))
        return np.concatenate([begin + d.given_lengths for begin, d in dense]), np.concatenate(
            [d.points for _, d in dense]
        )

    @cached_property
    def _paces(self) -> tuple[Array, Array, Array]:
        """The lengths where speeds begin, fractions of the joints' speed, and tool speeds; nan: the path's own."""
        rows = []
        for begin, piece in zip(self.ends, self.pieces, strict=False):
            paces = (piece.speed, piece.tool_speed)
            if piece.dense is None or len(piece.dense.begins) == 0:
                rows.append(np.array([[begin, *(np.nan if x is None else x for x in paces)]]))
            else:
                dense = piece.dense
                rows.append(np.stack([np.maximum(begin + dense.begins, begin), dense.speed, dense.tool_speed], axis=1))
        table = np.concatenate(rows)
        return table[:, 0], table[:, 1], table[:, 2]

    def speed_limits(self, s: Array, speed: float, tool: float | None) -> tuple[Array, Array]:
        """Fraction of the joints' speed and tool speed [mm/s] (inf: none) in the intervals between s: (N - 1,) each."""
        begins, *paces_of_begin = self._paces
        numbers = np.searchsorted(begins, (s[:-1] + s[1:]) / 2, side="right") - 1
        parts, tools = (paces[numbers] for paces in paces_of_begin)
        path_speed = np.inf if tool is None else tool
        return np.where(np.isnan(parts), speed, parts), np.where(np.isnan(tools), path_speed, tools)


@dataclass
class ReducedBlends:
    """The number of blends that did not fit, and the wanted and actual radius [mm] of the smallest."""

    count: int = 0
    wished_radius: float = 0.0
    reduced_radius: float = np.inf

    def note(self, wished_radius: float, reduced_radius: float) -> None:
        """Count a blend whose radius was reduced."""
        if reduced_radius >= wished_radius * (1 - 1e-9):
            return
        self.count += 1
        if reduced_radius < self.reduced_radius:
            self.wished_radius, self.reduced_radius = wished_radius, reduced_radius


def join_pieces(
    task: Task,
    pieces: Sequence[Piece],
    blends: Sequence[float | None],
    pauses: frozenset[int],
    tolerance: float = 0.0,
    reduced: ReducedBlends | None = None,
) -> tuple[Route, dict[int, int]]:
    """Join pieces to a route, with a blend or a stop at each corner; blends: one for each piece's end.

    blends: [mm], None: the largest that passes the corner within `tolerance`. pauses: numbers of pieces before which
    the arm has to stop. Returns the route, and the number in it of each piece with a pause. Blends that do not fit are
    reduced, and counted in `reduced`.
    """
    reduced = ReducedBlends() if reduced is None else reduced
    all_pieces: list[Piece] = []
    side = 0.0  # length of the last piece before its blend
    stops, order = {0}, {}
    rests: set[int] = set()  # values of `order`
    for number, piece in enumerate(pieces):
        if number in pauses:
            order[number] = len(all_pieces)
            rests.add(len(all_pieces))
        if piece.length < MIN_LENGTH:
            continue
        if not all_pieces or len(all_pieces) in rests:
            stops.add(len(all_pieces))
            all_pieces.append(piece)
            side = piece.length
            continue
        previous, blend_radius = all_pieces[-1], blends[number - 1]
        angle = _corner_angle(previous, piece)
        if angle < _SMOOTH_ANGLE:
            all_pieces.append(piece)
        elif (radius := _blend_radius(previous, piece, angle, blend_radius, tolerance)) <= 0:
            stops.add(len(all_pieces))
            all_pieces.append(piece)
        else:
            rounded = blend(task, previous, piece, radius, side)
            middle = rounded.middle
            if blend_radius is None:
                middle = replace(middle, dense=_dense_of_corner(middle, piece.first.position))
            else:
                reduced.note(blend_radius, rounded.radius)
            parts = [part for part in (rounded.first, middle) if part.length > MIN_LENGTH]
            all_pieces[-1:] = [*parts, rounded.second]
        side = piece.length
    stops.add(len(all_pieces))
    return Route(task, tuple(all_pieces), frozenset(stops)), order


def _corner_angle(last_piece: Piece, piece: Piece) -> float:
    """The angle of the corner between two pieces [rad], 0 for none."""
    a, b = last_piece.direction(last_piece.length), piece.direction(0.0)
    return float(np.arccos(np.clip(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)), -1, 1)))


def _blend_radius(last_piece: Piece, piece: Piece, angle: float, wanted: float | None, tolerance: float) -> float:
    """The radius of a corner's blend [mm]; 0: none, and the arm rests there. wanted: as in `join_pieces`'s blends."""
    # a cubic blend passes its corner at r |a - b| / 4
    radius = 2 * tolerance / max(np.sin(angle / 2), 1e-12) if wanted is None else wanted
    sharpest = REVERSAL_ANGLE if wanted is None else np.pi - _SMOOTH_ANGLE
    return radius if radius > 0 and angle <= sharpest and both_move(last_piece, piece) else 0.0


def _dense_of_corner(piece: Piece, corner: Array) -> Dense:
    """The given point of a blend: its corner, passed in the middle."""
    none = np.zeros(0)
    return Dense(
        given_lengths=np.array([piece.length / 2]),
        points=corner[None],
        bends=none,
        spans=none,
        begins=none,
        speed=none,
        tool_speed=none,
    )


def both_move(a: Piece, b: Piece) -> bool:
    """Whether the position moves in both pieces, since a pure rotation cannot be blended within a sphere."""
    return _position_moves(a) and _position_moves(b)


def _position_moves(piece: Piece) -> bool:
    points = [
        piece.curve(np.array([fraction * piece.length]))[0, : piece.task.position] for fraction in (0.0, 0.5, 1.0)
    ]
    return bool(max(np.linalg.norm(points[0] - points[1]), np.linalg.norm(points[1] - points[2])) > 1e-6)
