"""`armkin grip`."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli.boards import board_link
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import is_number, number
from armkin.cli.parsing.options import Json, Robot
from armkin.cli.printing import output, render
from armkin.errors import LinkError, UsageError

if TYPE_CHECKING:
    from armkin.board.backend.board import Board, Gripped


_WORD = {"open": "open", "closed": "closed", "close": "closed", "shut": "closed"}


def grip(
    robot: Robot,
    value: Annotated[str, typer.Argument(metavar="open|closed|VALUE", help="In the gripper drive's degrees (mm).")],
    port: PortName = None,
    assume: Annotated[
        str | None,
        typer.Option(
            "--assume",
            metavar="open|closed|VALUE",
            help="Where a gripper whose position is lost stands: a servo jumps there first.",
        ),
    ] = None,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Open or close the gripper."""
    arm = arguments.load_arm(robot)
    board = board_link.board_of(arm, rehearsal=port == board_link.SIM)
    target = _gripper_value(board, value, "VALUE")
    start = None if assume is None else _gripper_value(board, assume, "--assume")
    with board_link.open_backend(board, port, baud, reset=not no_reset) as machine:
        grip_result = board.grip(target, start)
    if grip_result.counts is not None and grip_result.position != grip_result.target:
        raise LinkError(
            f"the gripper stands at {render.short_text(grip_result.position)} instead of "
            f"{render.short_text(grip_result.target)} {grip_result.unit}: please report this as a bug"
        )
    answer: dict[str, Any] = {**render.head(arm), "port": machine.port.name, "gripper": grip_result.position}
    if grip_result.counts is None:
        answer |= {"target": grip_result.target, "measured": grip_result.measured}
    else:
        answer["counts"] = grip_result.counts
    with output.destination(None) as write:
        write(render.to_json(answer) + "\n" if json else f"gripper: {_rest_text(grip_result)}\n")


def _rest_text(grip_result: Gripped) -> str:
    """Where a gripper has come to rest, in words: ``29.97 deg (833 us)``."""
    text = f"{render.short_text(grip_result.position)} {grip_result.unit}"
    if grip_result.counts is not None:
        return f"{text} ({grip_result.counts} {grip_result.count_unit})"
    if not grip_result.measured:
        return f"{text}, as sent: nothing measures it"
    if abs(grip_result.position - grip_result.target) < 1.5:
        return text
    return f"{text} of {render.short_text(grip_result.target)}: it holds something, or is blocked"


def _gripper_value(board: Board, text: str, option: str) -> str | float:
    """A gripper's value: open, closed, or a number within them. Raises UsageError for others."""
    board.check_grip("open")
    if text in _WORD:
        return _WORD[text]
    if not is_number(text) and (similar_words := get_close_matches(text.lower(), _WORD, 1)):
        raise UsageError(
            f"{option}: '{text}' is neither open nor closed nor a number; did you mean {_WORD[similar_words[0]]}?"
        )
    value = number(text, option)
    board.check_grip(value)
    return value
