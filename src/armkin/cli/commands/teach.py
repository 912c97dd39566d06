"""`armkin teach`."""

from __future__ import annotations

from typing import Annotated

import typer

from armkin.cli import inputs, output
from armkin.cli.options import Robot


def teach(
    robot: Robot,
    open: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> None:
    """A page in the browser: see the arm, choose a branch.

    It is served on 127.0.0.1 until Ctrl-C; its address holds the key that every action needs.
    """
    from armkin.teach.desk import Desk
    from armkin.teach.server import Server

    arm = inputs.load(robot)
    with Server(Desk(arm)) as server:
        with output.destination(None) as write:
            write(f"{server.address}\n")
        if open:
            import webbrowser

            webbrowser.open(server.address)
        server.serve_forever(poll_interval=0.2)
