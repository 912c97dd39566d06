"""The emulated Pico behind a pseudo-terminal: starts board.mjs in node, and carries the port's bytes to it and back.

The options are those of firmware/sim (README.md there). rp2040js comes from npm: `make -C firmware/sim/rp2040`.
"""

from __future__ import annotations

import os
import pty
import select
import socket
import subprocess
import sys
import tty
from contextlib import suppress
from pathlib import Path

HERE = Path(__file__).parent


def main(arguments: list[str]) -> int:
    """The exit code of the emulator."""
    link = Path(arguments[arguments.index("--link") + 1]) if "--link" in arguments else None
    rest = [a for i, a in enumerate(arguments) if a != "--link" and (i == 0 or arguments[i - 1] != "--link")]
    master, slave = pty.openpty()  # the slave stays open here, so that the master outlasts its users
    tty.setraw(slave)
    name = os.ttyname(slave)
    if link is not None:
        link.unlink(missing_ok=True)
        link.symlink_to(name)
        name = str(link)
    ours, theirs = socket.socketpair()
    try:
        return _serve(master, ours, theirs, ["node", str(HERE / "board.mjs"), *rest, "--port", name])
    finally:
        if link is not None:
            link.unlink(missing_ok=True)


def _serve(master: int, ours: socket.socket, theirs: socket.socket, command: list[str]) -> int:
    os.set_blocking(master, False)
    pipe = theirs.fileno()
    with subprocess.Popen([*command, "--fd", str(pipe)], pass_fds=(pipe,)) as board:
        theirs.close()
        try:
            while _carry(master, ours):
                pass
        except KeyboardInterrupt:
            board.terminate()
        return board.wait()


def _carry(master: int, ours: socket.socket) -> bool:
    """Waits for bytes and hands them on; False: the emulator has ended."""
    ready, _, _ = select.select([master, ours], [], [])
    if master in ready and (data := _read(master)):
        ours.sendall(data)
    if ours in ready:
        try:
            data = ours.recv(1 << 16)
        except ConnectionResetError:
            return False
        if not data:
            return False
        with suppress(BlockingIOError):  # nobody reads: it is gone
            os.write(master, data)
    return True


def _read(master: int) -> bytes:
    try:
        return os.read(master, 1 << 16)
    except BlockingIOError:
        return b""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
