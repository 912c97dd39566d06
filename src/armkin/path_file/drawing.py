"""What foreign files draw, as the moves of a path: points in the file's millimetres, placed in the arm's frame."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from armkin.errors import PathFileError
from armkin.path_file.path_keys import MIN_TOOL_SPEED, Arc, Circle, Move, PathFile, Source
from armkin.robot_file.robot_keys import cross

Point = tuple[float, float, float]
MAX_COORDINATE = 1e6  # coordinate [mm], at most
_FULL_TURN = 2 * math.pi  # [rad]
_THREE_POINTS = 1.6 * math.pi  # angle [rad] beyond which a rounded end beside the start makes them another circle's
_NO_ARC = 1e-6  # length [mm] below which an arc is none


@dataclass(frozen=True)
class Placing:
    """Where a drawing stands: its zero and axes in the arm's frame, and what follows x y z in every target."""

    origin: Point  # [mm]
    axes: tuple[Point, Point, Point]  # rows of the rotation from the drawing's frame to the arm's
    orientation: tuple[float, ...] = ()  # [deg, 1] the tool's orientation, the same everywhere
    scale: float = 1.0

    def point(self, point: Sequence[float]) -> list[float]:
        """A point of the drawing in the arm's frame."""
        return self.points([point])[0]

    def points(self, points: Iterable[Sequence[float]]) -> list[list[float]]:
        """Points of the drawing in the arm's frame."""
        k, (ox, oy, oz), ((ax, ay, az), (bx, by_, bz), (cx, cy, cz)) = self.scale, self.origin, self.axes
        scaled_points = ((x * k, y * k, z * k) for x, y, z in points)
        return [
            [ox + ax * x + ay * y + az * z, oy + bx * x + by_ * y + bz * z, oz + cx * x + cy * y + cz * z]
            for x, y, z in scaled_points
        ]

    def direction(self, direction: Sequence[float]) -> list[float]:
        """A direction of the drawing in the arm's frame."""
        return [a[0] * direction[0] + a[1] * direction[1] + a[2] * direction[2] for a in self.axes]


@dataclass(frozen=True)
class DrawingOptions:
    """What the command line says of a foreign file beside its place."""

    feed: float | None = None  # [mm/s] where the file says none
    lift: float = 5.0  # [mm] of the pen between strokes of a drawing
    grip_by: str | None = None  # M3 or M106


def _speed_key(speed: float | None) -> dict[str, float]:
    """The key of a move's speed [mm/s]; none where it is as fast as the joints go."""
    return {} if speed is None else {"tool_speed": max(speed, MIN_TOOL_SPEED)}


class Pen:
    """Draws moves one after another; straight ones of the same speed become one polyline."""

    def __init__(self, placing: Placing) -> None:
        self.placing = placing
        self.moves: list[Move] = []
        self.lines: list[int] = []  # lines of the file where each move begins
        self.points = 0  # points that lines and arcs lead to
        self._open: list[Sequence[float]] | None = None  # points of the drawing: placed in the end
        self._drawn: list[list[Sequence[float]]] = []
        self._speed: float | None = None

    def jump(self, point: Sequence[float], line: int) -> None:
        """A joint move to a point."""
        self._add(Move.model_construct({"point"}, point=[*self.placing.point(point), *self.placing.orientation]), line)

    def line(self, point: Sequence[float], speed: float | None, line: int) -> None:
        """A straight line; speed: [mm/s], None: as fast as the joints go."""
        if self._open is None or speed != self._speed:
            polyline: list[Sequence[float]] = []
            self._add(Move.model_construct({"polyline"}, polyline=polyline, **_speed_key(speed)), line)
            self._open, self._speed = polyline, speed
            self._drawn.append(polyline)
        self._open.append(point)
        self.points += 1

    def arc(
        self, a: Point, centre: Point, b: Point, normal: Point, angle: float, speed: float | None, line: int
    ) -> None:
        """An arc or helix from a to b about an axis, by an angle [rad] (positive: right-handed)."""
        self.points += 1
        rise = sum(n * (y - x) for n, x, y in zip(normal, a, b, strict=True))
        radial = [x - c for x, c in zip(a, centre, strict=True)]
        lift = sum(n * o for n, o in zip(normal, radial, strict=True))
        radial = [o - lift * n for o, n in zip(radial, normal, strict=True)]
        radius = math.sqrt(sum(o * o for o in radial))
        if radius < _NO_ARC:
            self.line(b, speed, line)
            return
        base = [x - o for x, o in zip(a, radial, strict=True)]
        if abs(rise) < _NO_ARC and abs(angle) < _THREE_POINTS:
            tangent = cross(normal, (radial[0], radial[1], radial[2]))
            end = math.dist(base, b)  # it may differ a little from the radius at the start
            half_angle, mean = angle / 2, (radius + end) / 2 / radius
            offsets = [
                math.cos(half_angle) * o + math.sin(half_angle) * w for o, w in zip(radial, tangent, strict=True)
            ]
            via = [c + mean * offset for c, offset in zip(base, offsets, strict=True)]
            three_points = Arc.model_construct(via=self.placing.point(via), to=self.placing.point(b))
            self._add(Move.model_construct({"arc"}, arc=three_points, **_speed_key(speed)), line)
            return
        circle = Circle.model_construct(
            centre=self.placing.point(base),
            normal=self.placing.direction(normal),
            turns=angle / _FULL_TURN,
            rise=rise * self.placing.scale,
        )
        self._add(Move.model_construct({"circle"}, circle=circle, **_speed_key(speed)), line)

    def home(self, line: int) -> None:
        """A joint move home."""
        self._add(Move.model_construct({"joint"}, joint="home"), line)

    def wait(self, seconds: float, line: int) -> None:
        """Rest."""
        self._add(Move.model_construct({"wait"}, wait=seconds), line)

    def pause(self, line: int) -> None:
        """Rest until Enter."""
        self._add(Move.model_construct({"wait"}, wait="enter"), line)

    def grip(self, value: str, line: int) -> None:
        """The gripper."""
        self._add(Move.model_construct({"grip"}, grip=value), line)

    def _add(self, move: Move, line: int) -> None:
        self._open = None
        self.moves.append(move)
        self.lines.append(line)

    def file(self, name: str, notes: Sequence[str], raw: bytes, expected: str) -> PathFile:
        """The path. Raises PathFileError if nothing is drawn; raw: the whole file, expected: what would be drawn."""
        if not any(move.kind in ("polyline", "arc", "circle") for move in self.moves):
            last = max(len(raw.splitlines()), 1)
            raise PathFileError(f"{name}:{last}: draws nothing up to here: {expected}", file=name, line=last)
        for points in self._drawn:
            points[:] = self.placing.points(points)
        lines: dict[tuple[str | int, ...], int] = {("moves", k): line for k, line in enumerate(self.lines)}
        path_file = PathFile.model_construct(moves=self.moves, corners="tolerance")
        return path_file.read_from(Source(name, lines, notes=tuple(notes)))
