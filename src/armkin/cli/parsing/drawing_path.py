"""Drawings as paths: G-code and SVG, and where `armkin path` puts them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from armkin import files
from armkin.cli.parsing.number_parsing import MAX_NUMBER, number, place_numbers
from armkin.cli.printing import output
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.path_file import PathFile

At = Annotated[
    str | None,
    typer.Option("--at", metavar="X,Y,Z[,R,P,Y]", help="G-code, SVG: where the file's zero lies."),
]
Scale = Annotated[str | None, typer.Option("--scale", metavar="K", help="G-code, SVG: factor of the file's lengths.")]
Feed = Annotated[
    str | None, typer.Option("--feed", metavar="MM/S", help="G-code, SVG: speed of the tool where the file has no F.")
]
Lift = Annotated[str | None, typer.Option("--lift", metavar="MM", help="SVG: height between strokes. [default: 5]")]
GripBy = Annotated[
    str | None, typer.Option("--grip-by", metavar="M3|M106", help="G-code: which words close and open the gripper.")
]


_OF_ONE_LANGUAGE = {"lift": ("svg", "SVG alone: G-code lifts by its own words"), "grip_by": ("gcode", "G-code alone")}


class Placement(NamedTuple):
    """Where and how a drawing is drawn: the options as they are given."""

    at: str | None
    scale: str | None
    feed: str | None
    lift: str | None
    grip_by: str | None


def drawing_moves(arm: Arm, file: str | None, task: str | None, placement: Placement) -> PathFile | None:
    """The moves of a drawing; None: the file is none. Raises UsageError for options that make no sense."""
    from armkin import path_file
    from armkin.motion.drawing_to_path import drawing

    language = None if file is None else path_file.drawing_language(file)
    _check_language(language, placement)
    if file is None or language is None:
        return None
    at, scale, feed, lift, grip_by = placement
    if at is None:
        raise UsageError(f"{file} needs --at X,Y,Z, for example --at 300,0,50: where its zero lies in the arm's frame")
    if grip_by not in (None, "M3", "M106"):
        raise UsageError(f"--grip-by: '{grip_by}' is neither M3 nor M106")
    zero = place_numbers(at, "--at")
    factor = 1.0 if scale is None else _bounded_number(scale, "--scale", (1e-6, 1e6), "from 1e-6 to 1e6")
    speed = None if feed is None else _bounded_number(feed, "--feed", (1e-3, MAX_NUMBER), "at least 0.001")
    height = 5.0 if lift is None else _bounded_number(lift, "--lift", (0.0, MAX_NUMBER), "at least 0")
    files.protect_input(file)
    moves = drawing(arm, file, zero, task=task, scale=factor, feed=speed, lift=height, grip_by=grip_by)
    for text in moves.notes:
        output.note(text)
    return moves


def _check_language(language: str | None, placement: Placement) -> None:
    """Raise UsageError for an option that is of drawings, where there is none (None); note one of another language."""
    for name in [name for name, value in placement._asdict().items() if value is not None]:
        option = f"--{name.replace('_', '-')}"
        if language is None:
            raise UsageError(f"{option} belongs to G-code and SVG: files that end in .gcode, .gco, .nc, .ngc or .svg")
        own_language, words = _OF_ONE_LANGUAGE.get(name, (language, ""))
        if language != own_language:
            output.note(f"{option} is ignored: it belongs to {words}")


def _bounded_number(text: str, option: str, bounds: tuple[float, float], allowed: str) -> float:
    """A number within bounds; allowed: these in words."""
    value = number(text, option)
    if not bounds[0] <= value <= bounds[1]:
        raise UsageError(f"{option}: '{text}' must be {allowed}")
    return value
