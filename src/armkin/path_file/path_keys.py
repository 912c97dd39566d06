"""The path file as pydantic sees it: every key, its unit, its bounds and its help text. Degrees and millimetres."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

MAX_NUMBER = 1e7  # size of a number, at most
Number = Annotated[float, Field(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Values = Annotated[list[Number], Field(min_length=1, max_length=16)]
Triple = Annotated[list[Number], Field(min_length=2, max_length=3)]
MAX_POINTS = 120_000  # points of a polyline or a spline, and of a CSV file, at most
MIN_PERCENT = 0.01  # share [%] of a speed, at least
MIN_TOOL_SPEED = 1e-3  # speed [mm/s] of the tool, at least
MIN_TOLERANCE = 1e-6  # tolerance [mm], at least
Percent = Annotated[float, Field(ge=MIN_PERCENT, le=100)]
Speed = Annotated[float, Field(ge=MIN_TOOL_SPEED, le=1e6)]
Joints = Values | dict[str, Number] | str

KINDS = ("joint", "point", "line", "polyline", "arc", "circle", "spline", "offset", "wait", "grip")
EXAMPLES = {
    "joint": "joint: [0, 90, -90]",
    "point": "point: [390, 80, 300]",
    "line": "line: [390, 160, 300]",
    "polyline": "polyline: [[390, 160, 300], [390, 80, 300]]",
    "arc": "arc: {via: [420, 190, 300], to: [450, 160, 300]}",
    "circle": "circle: {centre: [450, 120, 300], normal: [0, 0, 1]}",
    "spline": "spline: [[400, 120, 300], [420, 100, 320]]",
    "offset": "offset: {xyz: [0, 0, -30], frame: tool}",
    "wait": "wait: 0.5",
    "grip": "grip: closed",
    "start": "start: home, start: {joints: [0, 90, -90]} or start: {point: [390, 80, 300]}",
    "corners": "corners: stop, corners: blend or corners: tolerance",
    "tolerance": "tolerance: 0.1",
    "turn_tolerance": "turn_tolerance: 0.1",
    "tool_speed": "tool_speed: 100",
    "speed": "speed: 50",
    "blend": "blend: 5",
    "robot": "robot: three_dof",
    "task": "task: xyz",
    "moves": "moves: [{line: [390, 160, 300]}, {wait: 1}]",
}


class _Model(BaseModel):
    """Keys that are not known are refused, and numbers are finite."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Arc(_Model):
    """An arc of a circle."""

    via: Triple = Field(description="A point on the arc, in mm.")
    to: Values = Field(description="Its end: a target.")


class Circle(_Model):
    """A circle, or with a rise a helix, from where the tool is."""

    centre: Triple = Field(description="Centre in mm.")
    normal: Triple = Field(
        default_factory=lambda: [0.0, 0.0, 1.0], description="Axis; positive turns are right-handed about it."
    )
    turns: Annotated[float, Field(ge=-1000, le=1000)] = Field(1.0, description="Turns; negative: the other way.")
    rise: Number = Field(0.0, description="mm along the normal, over all turns.")


class Offset(_Model):
    """A line to a place beside the present one."""

    xyz: Triple = Field(description="mm.")
    frame: Literal["tool", "base"] = Field("base", description="Whose axes: tool or base.")


class Start(_Model):
    """Where a path begins."""

    joints: Joints | None = Field(None, description="Joint values, or a pose's name.")
    point: Values | None = Field(None, description="A target.")

    @model_validator(mode="after")
    def _check_one_given(self) -> Start:
        if (self.joints is None) == (self.point is None):
            raise PydanticCustomError("problem", "give joints: or point:, one of them")
        return self


class Move(_Model):
    """One move: exactly one of joint, point, line, polyline, arc, circle, spline, offset, wait, grip."""

    joint: Joints | None = Field(None, description="A joint move: values, a pose's name, or {q1: 30}.")
    point: Values | None = Field(None, description="A target, reached by a joint move.")
    line: Values | None = Field(None, description="A straight line to a target.")
    polyline: Annotated[list[Values], Field(min_length=1)] | None = Field(None, description="Lines through targets.")
    arc: Arc | None = Field(None, description="An arc through via, to to.")
    circle: Circle | None = Field(None, description="A circle or helix.")
    spline: Annotated[list[Values], Field(min_length=1, max_length=MAX_POINTS)] | None = Field(
        None, description="A smooth curve through targets."
    )
    offset: Offset | None = Field(None, description="A line by an offset.")
    wait: Annotated[float, Field(ge=0, le=86400)] | Literal["enter"] | None = Field(
        None, description="Seconds at rest, or enter: until the Enter key."
    )
    grip: Literal["open", "closed"] | Number | None = Field(None, description="open, closed, or the drive's value.")
    branch: str | None = Field(None, description="With point: the branch's name.")
    blend: Annotated[float, Field(ge=0, le=1e6)] | None = Field(
        None, description="mm: radius of the sphere that rounds the corner at the move's end; 0 = stop."
    )
    speed: Percent | None = Field(None, description="Percent of the joints' max_speed.")
    tool_speed: Speed | None = Field(None, description="mm/s.")

    @property
    def kind(self) -> str:
        """Which move it is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @model_validator(mode="after")
    def _check_one_kind(self) -> Move:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            text = f"has {' and '.join(kinds)}: one of them" if kinds else f"is none of {', '.join(KINDS)}"
            raise PydanticCustomError("problem", "{text}", {"text": text})
        if self.branch is not None and kinds != ["point"]:
            raise PydanticCustomError("problem", "branch: belongs to point:")
        return self


@dataclass(frozen=True)
class Source:
    """Where a path was read: the text's name, and the lines of its keys and moves, ("moves", 0) for the first."""

    name: str
    lines: Mapping[tuple[str | int, ...], int]
    rows: bool = False  # whether the moves are rows of CSV
    notes: tuple[str, ...] = ()  # what was read and ignored


class PathFile(_Model):
    """A path: moves one after another."""

    _source: Source | None = PrivateAttr(None)

    robot: str | None = Field(None, description="Name or file of the robot.")
    task: str | None = Field(None, description="What targets prescribe; by default the arm's task.")
    tolerance: Annotated[float, Field(ge=MIN_TOLERANCE, le=1000)] | None = Field(
        None, description="mm between plan and path; 0.05 by default."
    )
    turn_tolerance: Annotated[float, Field(ge=0, le=10)] | None = Field(
        None, description="Degrees by which the tool may be turned to pass a wrist singularity; 0 by default."
    )
    tool_speed: Speed | None = Field(None, description="mm/s, for all moves.")
    speed: Percent | None = Field(None, description="Percent of the joints' max_speed, for all moves.")
    corners: Literal["stop", "blend", "tolerance"] | None = Field(
        None, description="How corners without their own blend are passed; tolerance: dense points as one curve."
    )
    blend: Annotated[float, Field(ge=0, le=1e6)] | None = Field(None, description="mm, for all corners; 0 = stop.")
    start: str | Start | None = Field(None, description="A pose's name, joints: or point:. Absent: where the arm is.")
    moves: Annotated[list[Move], Field(min_length=1, max_length=1_000_000)] = Field(description="The moves, in order.")

    def read_from(self, source: Source) -> PathFile:
        """Note where the path was read, for messages; returns the path."""
        self._source = source
        return self

    @property
    def notes(self) -> tuple[str, ...]:
        """What a foreign file says that was ignored, a sentence each."""
        return () if self._source is None else self._source.notes

    @property
    def folder(self) -> str:
        """The folder of the file; "" for a path that is none."""
        return "" if self._source is None else os.path.dirname(self._source.name)

    def place(self, key: str) -> str:
        """Where a key stands, to begin a message with: ``g.yaml:1: robot``; of a path that is no file the key."""
        line = None if self._source is None else self._source.lines.get((key,))
        return key if self._source is None or line is None else f"{self._source.name}:{line}: {key}"

    def place_of(self, first: int, last: int) -> str:
        """Where moves stand (numbers from 0): ``g.yaml:5: move 2``, ``q.csv: row 3``; "" if there is no more to say."""
        source = self._source
        if source is not None and source.rows:
            a, b = (source.lines["moves", k] for k in (first, last))
            return f"{source.name}: row {a}" if a == b else f"{source.name}: rows {a} to {b}"
        numbers = f"move {first + 1}" if first == last else f"moves {first + 1} to {last + 1}"
        if source is None:
            return "" if (first, last) == (0, len(self.moves) - 1) else numbers
        line = f"{source.name}:{source.lines['moves', first]}"
        return line if len(self.moves) == 1 else f"{line}: {numbers}"
