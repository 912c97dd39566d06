"""`armkin stop`."""

from typing import Annotated

import typer

from armkin.cli.boards import board_link
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName, only_port
from armkin.cli.printing import output
from armkin.errors import LinkError, UsageError

_REST_TIMEOUT = 15.0  # time [s] for an arm to come to rest


def stop(
    port: PortName = None,
    baud: Baud = None,
    no_reset: NoReset = False,
    power_cut: Annotated[
        bool,
        typer.Option("--power-cut", help="The motors' power was cut: declare the arm's position lost, drivers off."),
    ] = False,
) -> None:
    """Stop the arm along its path.

    Works from another terminal: the armkin that holds the port is told to stop. This is no emergency stop:
    for that, cut the motors' power.
    """
    from armkin.board.ports import SIM, SerialPort, holder_pid, holder_rate, is_socket

    baud = baud or board_link.BAUD
    port = _port_of(port, baud, not no_reset)
    if port == SIM:
        raise UsageError("there is nothing to stop: a simulated board lives in the command that started it")
    process = holder_pid(port)
    if process is not None:
        # The process that moved a board of others has stopped it.
        is_foreign = holder_rate(port) not in (None, baud)
        _end_process(process, port)
        output.note(f"process {process} has given the port back")
        if is_foreign and not power_cut:
            output.note("it has stopped the arm first")
            return
    elif is_socket(port):
        raise UsageError(f"no armkin moves an arm by {port}; M112 stops Klipper at once, and loses the position")
    from armkin.board.firmware.wire import protocol
    from armkin.board.firmware.wire.session import Session
    from armkin.board.stop_signals import stoppable

    with stoppable() as stop_asked:
        link = SerialPort(port, baud, reset=not no_reset)
        try:
            session = Session(link, stop_asked)
            session.open()  # a former session's motion is held by that alone
            session.hold()
            if power_cut and session.reopen().config:
                session.call(lambda tag: protocol.enable(tag, 0))
        finally:
            link.close()
    output.note("the arm stands" + ("; its position is lost: home it, or say --assume-home" if power_cut else ""))


def _port_of(port: str | None, baud: int, reset: bool) -> str:
    """The port given, the only one that armkin holds, or the only one where a board answers."""
    from armkin.board.firmware.wire.find_boards import answering_ports, likely_ports
    from armkin.board.ports import holder_pid
    from armkin.board.stop_signals import stoppable

    if port is None:
        held = [name for name in likely_ports() if holder_pid(name) is not None]
        if len(held) == 1:
            return held[0]
        with stoppable() as stop:
            return only_port(answering_ports(None, baud, stop, reset=reset), "a board")
    return port


def _end_process(process: int, port: str) -> None:
    """Ask the process that holds a port to stop its arm, and wait until it lets go."""
    import time

    from armkin.board.ports import ask_to_stop, holder_pid

    try:
        ask_to_stop(port, process)
    except OSError as error:
        raise LinkError(f"process {process} holds {port} and cannot be told to stop: {error.strerror}") from None
    deadline = time.monotonic() + _REST_TIMEOUT
    while holder_pid(port) == process:
        if time.monotonic() > deadline:
            raise LinkError(f"process {process} does not let go of {port}: cut the motors' power if the arm moves")
        time.sleep(0.05)
