"""Shared by all commands that use a board: options of the port, signals, an open machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli.boards.default_port import port_name
from armkin.cli.parsing import arguments, completion
from armkin.cli.parsing.number_parsing import whole_number
from armkin.cli.printing import output, render
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned, Progress
    from armkin.board.backend.board import Board
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_MAX_BAUD = 4_000_000  # rate [bit/s], at most, that USB adapters make; a bus has 1,000,000


def _baud_rate(text: str | None) -> int | None:
    return None if text is None else whole_number(text, "--baud", 1, _MAX_BAUD)


Baud = Annotated[
    int | None,
    typer.Option(
        "--baud",
        metavar="N",
        parser=str,
        callback=_baud_rate,
        help="Baud rate of the port. [default: what the kind of board uses]",
    ),
]
NoReset = Annotated[
    bool,
    typer.Option(
        "--no-reset",
        help="Leave DTR low while the port is opened, so that an Uno is not reset: Windows and rfc2217://. "
        "Linux and macOS reset it with the first opening after plugging in, and never again.",
    ),
]
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Go on with a motion that was stopped on its way; give the same arguments again."),
]
Assume = Annotated[
    str | None,
    typer.Option(
        "--assume",
        metavar="home|POSE|Q,...",
        help="Where the arm stands, if the board has lost its position; refused while it is known. "
        "--assume-home is --assume home.",
        autocompletion=completion.poses,
    ),
]
BAUD = 250_000  # rate [bit/s] of the firmware's port
_LONGEST_NOTE = 10_000  # size [bytes], at most, of a note
SIM = "sim"  # name of a port to a board in this process
AT_HOME = "the simulated board starts with the arm in its home pose, and forgets all at the end"


@dataclass(frozen=True)
class Link:
    """The options of a command on its connection to a board, and on assumptions there."""

    port: str | None
    baud: int | None
    assume: str | None
    resume: bool
    reset: bool
    no_scene: bool = False


@contextmanager
def open_backend(
    board: Board, port: str | None, baud: int | None, *, simulated: str = AT_HOME, reset: bool = True
) -> Iterator[Backend]:
    """The arm on a board of any kind behind a port, which is closed at the end; a signal stops the arm first.

    simulated: the note for a simulated board.
    """
    from armkin.board.backend import StoppedError
    from armkin.board.open_board import open_board
    from armkin.board.stop_signals import stoppable

    port = port_name(port, board, baud, reset=reset)
    if port == SIM:
        output.note(simulated)
    with stoppable() as stop, open_board(board, port, baud=baud, stop=stop, reset=reset) as machine:
        if port != SIM:
            _once_a_day(port, machine.differences)
        try:
            yield machine
        except StoppedError:
            output.warn(f"stopped: {machine.standing_text()}{_goes_on(machine)}")
            raise


def _once_a_day(port: str, words: Sequence[str]) -> None:
    """Print the limitations of a kind of board on a port's first use of a day."""
    from datetime import date

    from armkin.board.ports import note_path, read_note, write_note

    path, note = f"{note_path(port)}.told", {"day": date.today().isoformat(), "words": list(words)}
    if words and read_note(path, _LONGEST_NOTE) != note:
        for word in words:
            output.note(word)
        write_note(path, note)


def _goes_on(machine: Backend) -> str:
    return "; --resume goes on with this motion" if getattr(machine, "resumable", False) else ""


def can_resume(options: Mapping[str, object]) -> None:
    """Raise UsageError for an option that contradicts --resume; options: {option: whether it is given}."""
    for option, is_given in options.items():
        if is_given:
            raise UsageError(f"--resume and {option}: a motion that was held goes on from where the arm stands")


@contextmanager
def motion_progress(plans: Sequence[Planned], note: Callable[[float], None]) -> Iterator[Progress]:
    """A progress bar of the plans' time on a terminal, which also updates the note of the motion."""
    with output.progress("ms of motion", round(1000 * sum(plan.duration for plan in plans))) as tick:

        def report(elapsed: float, _: float) -> None:
            note(elapsed)
            tick(round(1000 * elapsed))

        yield report


def resumed_note(board: Board, resume: bool) -> Any:
    """The note of the motion that `--resume` goes on with; None without that option."""
    return board.recall() if resume else None


def board_of(arm: Arm, *, rehearsal: bool = False) -> Board:
    """The arm's board, of whatever kind; rehearsal: for a plan or a simulated board."""
    from armkin.board import kinds

    return kinds.board_of(arm, rehearsal=rehearsal)


def arm_for_port(arm: Arm, port: str | None, *, quiet: bool = False) -> Arm:
    """The arm for a port; on `sim` with assumed motors and rates where its file has none, and a note of them."""
    if port != SIM:
        return arm
    from armkin.board.backend.assumptions import arm_with_assumptions

    arm, made_up = arm_with_assumptions(arm)
    if made_up and not quiet:
        words = "; ".join(made_up)
        output.note(f"assumed for the simulation alone, as {arm.path or arm.name} does not say: {words}")
    return arm


def arm_for_plan(arm: Arm) -> Arm:
    """The arm for a mere plan, with assumed rates where its file has none, and a note of them."""
    from armkin.board.backend.assumptions import with_rates

    arm, made_up = with_rates(arm)
    if made_up:
        words = "; ".join(made_up)
        output.note(f"assumed for this plan alone, as {arm.path or arm.name} does not say: {words}")
    return arm


def simulation_note(assume: str | None) -> str:
    """The note for a simulated board, which starts without a position."""
    return AT_HOME if assume in (None, "home") else "the simulated board forgets all at the end"


def assumed_joints(arm: Arm, text: str | None) -> Array | None:
    """`--assume`: joint values (n,) [rad | mm] of a lost arm, within its limits."""
    return None if text is None else standing_joints(arm, text, "--assume")


def standing_joints(arm: Arm, text: str, option: str) -> Array:
    """Joint values (n,) [rad | mm] of an option. Raises NoSolutionError outside the limits."""
    from armkin.model.limits import check_limits

    q: Array = units.joints_in(arm, arguments.joint_list(arm, text, option))
    try:
        check_limits(arm, q[None])
    except NoSolutionError as error:
        raise error.within(option) from None
    return q


def prepare_motion(arm: Arm, machine: Backend, text: str | None, assume: Array | None) -> None:
    """Get the board ready to move, with a note if it sets a lost position as the operator states it."""
    if machine.prepare(assume=assume) and text is not None:
        place_text = f"in its pose {text}" if text in arm.poses else f"at {text}"
        output.note(f"the board takes the arm to stand {'in its home pose' if text == 'home' else place_text}")


def where_text(arm: Arm, answer: Mapping[str, Any]) -> str:
    """The answer of `armkin.board.planner.where_arm_stands` as tables."""
    from armkin.motors import motor_names, pulse_units

    if answer["joints"] is None:
        reason = answer.get("lost_because")
        return f"{arm.name}: its position is lost{f' ({reason})' if reason else ''}\n"
    head = [f"{name}/{unit}" for name, unit in zip(motor_names(arm), pulse_units(arm), strict=True)]
    tables = [
        render.row("joints", render.joint_headings(arm), [render.fixed_text(value) for value in answer["joints"]]),
        render.row("pulses", head, [str(value) for value in answer["pulses"]]),
        render.row("tool", ["x/mm", "y/mm", "z/mm"], [render.fixed_text(value) for value in answer["position_mm"]]),
    ]
    return "\n".join([f"{arm.name}: position {answer['position']}", *tables, ""])
