"""`armkin status`."""

import sys
import time
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import typer

from armkin.cli.boards import board_link
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.parsing import arguments
from armkin.cli.parsing.options import Json, Robot
from armkin.cli.printing import output, render

_READ_PERIOD = 0.2  # time [s] between two readings


def status(
    robot: Robot,
    port: PortName = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Five times a second, until Ctrl-C; with --json a line whenever it changes.")
    ] = False,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Where the board says that the arm stands.

    Moves nothing and changes nothing. (Opening its port resets an Uno the first time: an arm that stood
    still keeps its position.)
    """
    from armkin.board.planner import where_arm_stands

    arm = arguments.load_arm(robot)
    unknown_note = "the simulated board is new in every command: nothing has told it yet where the arm stands"
    board = board_link.board_of(arm, rehearsal=port == board_link.SIM)
    with board_link.open_backend(board, port, baud, simulated=unknown_note, reset=not no_reset) as machine:

        def status_json() -> dict[str, Any]:
            head = {**render.head(arm), "port": machine.port.name, "board": board.kind}
            return {**head, **where_arm_stands(machine), **machine.report()}

        def text(status: dict[str, Any]) -> str:
            return render.to_json(status) + "\n" if json else board_link.where_text(arm, status) + _report_text(status)

        if watch:
            _print_changes(text(status_json()) for _ in _until_signal(machine.refresh, board.stop))
            return
        answer = text(status_json())
    with output.destination(None) as write:
        write(answer)


def _until_signal(refresh: Callable[[], None], stop: Callable[[], bool]) -> Iterator[None]:
    """Now and then, until a signal comes: nothing moves that would have to be stopped."""
    while not stop():
        yield
        time.sleep(_READ_PERIOD)
        refresh()


def _print_changes(texts: Iterator[str]) -> None:
    """On a terminal in place; else what differs from the text before."""
    if not sys.stdout.isatty():
        last_text = ""
        with output.destination(None) as write:
            for text in texts:
                if text != last_text:
                    write(text)
                    sys.stdout.flush()
                last_text = text
        return
    from rich.live import Live
    from rich.text import Text

    last_text = ""
    with Live(auto_refresh=False) as live_display:
        for text in texts:
            if text != last_text:  # drawing what stands there makes it flicker
                live_display.update(Text(text.rstrip()), refresh=True)
            last_text = text


def _report_text(answer: dict[str, Any]) -> str:
    """What the kind of board says of itself, as a table."""
    if "servos" in answer:
        return _servos_text(answer)
    return _grbl_text(answer) if "settings" in answer else _firmware_text(answer)


def _servos_text(answer: dict[str, Any]) -> str:
    rows = [["servo", "id", "torque", "load", "voltage", "temperature", "errors"]]
    for servo in answer["servos"]:
        figures = (f"{servo['load_percent']:.1f} %", f"{servo['voltage']:.1f} V", f"{servo['temperature']} C")
        torque = "on" if servo["torque"] else "off"
        rows.append([servo["name"], str(servo["id"]), torque, *figures, ", ".join(servo["errors"]) or "none"])
    return render.table(rows) + "\n"


def _grbl_text(answer: dict[str, Any]) -> str:
    """The state of a GRBL board as a table."""
    differences = answer["settings"]
    rows = [
        ["board", f"{answer['board']} on {answer['port']}, {answer['firmware']}"],
        ["state", answer["state"]],
        ["active inputs", answer["inputs"] or "none"],
        [
            "settings",
            f"{len(differences)} differ from the robot file: armkin setup tells"
            if differences
            else "fit the robot file",
        ],
    ]
    return render.table(rows, left_aligned=(0, 1)) + "\n"


_POWER = {
    True: "on",
    False: "off: the position is lost",
    None: "not sensed",
}


def _firmware_text(answer: dict[str, Any]) -> str:
    """The state of a board with armkin's firmware as a table."""
    high = [name for name, level in answer["switches"].items() if level]
    low = [name for name, level in answer["switches"].items() if not level]
    switch_word = {True: "on", False: "off"}
    power = _POWER[answer["motor_power"]]
    if answer["motor_power"] is None and answer["joints"] is not None:
        power += ": after a cut the position above is wrong; armkin stop --power-cut declares it lost"
    rows = [
        ["board", f"{answer['board']} on {answer['port']}, firmware {answer['firmware']}"],
        ["configured", "for this robot file" if answer["configured"] else "not for this robot file"],
        ["state", answer["state"]],
        ["drivers", f"{switch_word[answer['drivers_on']]}, servo pulses {switch_word[answer['servo_pulses_on']]}"],
        ["switches", f"high: {', '.join(high) or 'none'}; low: {', '.join(low) or 'none'}"],
        ["abort input", "active" if answer["abort_input"] else "not active"],
        ["motor power", power],
    ]
    return render.table(rows, left_aligned=(0, 1)) + "\n"
