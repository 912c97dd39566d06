"""`armkin teach`."""

from __future__ import annotations

from typing import Annotated

import typer

from armkin.cli import inputs, output
from armkin.cli.linking import Baud
from armkin.cli.options import Robot


def teach(
    robot: Robot,
    port: Annotated[
        str | None,
        typer.Option("--port", "-p", metavar="PORT", help="A board: device, COM port, pyserial URL, or sim."),
    ] = None,
    baud: Baud = None,
    open: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> None:
    """A page in the browser: see the arm, choose a branch, send it.

    It is served on 127.0.0.1 until Ctrl-C; its address holds the key that every action needs. A board is touched
    with --port alone.
    """
    import threading

    from armkin.teach.desk import Desk
    from armkin.teach.server import Server

    desk = Desk(inputs.load(robot), port, baud)
    try:
        with Server(desk) as server:
            with output.destination(None) as write:
                write(f"{server.address}\n")
            threading.Thread(target=desk.warm, daemon=True).start()
            if open:
                import webbrowser

                webbrowser.open(server.address)
            server.serve_forever(poll_interval=0.2)
    finally:
        desk.close()  # a moving arm is stopped first
