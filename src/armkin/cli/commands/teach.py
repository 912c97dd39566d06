"""`armkin teach`."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Annotated

import typer

from armkin.cli.boards import keep_outs
from armkin.cli.boards.board_link import SIM, Baud
from armkin.cli.boards.keep_outs import NoScene
from armkin.cli.parsing.options import Meshes, Robot, Scene
from armkin.cli.printing import output


def teach(
    robot: Robot,
    port: Annotated[
        str | None,
        typer.Option("--port", "-p", metavar="PORT", help="A board: device, COM port, pyserial URL, or sim."),
    ] = None,
    scene: Scene = None,
    no_scene: NoScene = False,
    baud: Baud = None,
    meshes: Meshes = None,
    open_page: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> None:
    """A page in the browser: see the arm, choose a branch, send it.

    It is served on 127.0.0.1 until Ctrl-C; its address holds the key that every action needs. A board is touched
    with --port alone. Keys: Esc stops, 1 to 8 choose a branch, arrows, PageUp and PageDown move the tip, R records,
    P plays, G grips.
    """
    import threading

    from armkin.teach.actions import Actions
    from armkin.teach.server import Server
    from armkin.teach.urdf_meshes import meshes_json as read_meshes

    keep_outs.check_together(scene, no_scene)
    arm = keep_outs.load_moving_arm(robot, scene)
    if port is not None and port != SIM:
        from armkin.board.ports.serial_port import check_port

        check_port(port)
        keep_outs.check_port(port, arm, no_scene)
    actions = Actions(arm, port, baud, None if meshes is None else read_meshes(arm, meshes))
    try:
        with Server(actions) as server, ExitStack() as stack:
            with output.destination(None) as write:
                write(f"{server.address}\n")
            output.note("Ctrl-C ends it" + (", after the arm has been stopped" if port is not None else ""))
            threading.Thread(target=actions.warm, daemon=True).start()
            if open_page:
                import webbrowser

                webbrowser.open(stack.enter_context(redirection(server.address)))
            server.serve_forever(poll_interval=0.2)
    finally:
        actions.close()  # a moving arm is stopped first


@contextmanager
def redirection(address: str) -> Iterator[str]:
    """Address of a private file that sends a browser on: `address` has the key, and every user sees command lines."""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory(prefix="armkin-") as folder:  # the folder is for its owner alone
        file = Path(folder) / "teach.html"
        file.touch(mode=0o600)
        file.write_text(f'<!doctype html><meta http-equiv="refresh" content="0; url={address}">\n', encoding="ascii")
        yield file.as_uri()
