"""Serial ports: what resets a board, and who holds one."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from armkin.board.ports import SerialPort, holder_pid, port_lock, serial_port
from command_line import THREE_DOF, run


class FakeSerial:
    """A port that notes what was done to it, in order."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("dtr", "rts"):
            self.done.append(f"{name} {value}")
        object.__setattr__(self, name, value)

    def open(self) -> None:
        self.done.append("open")

    def close(self) -> None:
        self.done.append("close")


class FakeLock:
    """The right to a port that is not there."""

    def __init__(self, name: str, rate: int) -> None:
        pass

    def release(self) -> None:
        pass


@pytest.mark.parametrize(
    ("platform", "name", "reset", "expected"),
    [
        ("win32", "COM3", False, ["dtr False", "rts False", "open"]),
        ("win32", "COM3", True, ["open"]),
        ("linux", "rfc2217://host:4000", False, ["dtr False", "rts False", "open"]),
        (
            "linux",
            "/dev/ttyACM0",
            False,
            ["open"],
        ),  # the kernel raises DTR; dropping it here would cost the next opening
    ],
)
def test_no_reset_leaves_dtr_low_before_the_port_opens(
    monkeypatch: pytest.MonkeyPatch, platform: str, name: str, reset: bool, expected: list[str]
) -> None:
    import serial

    fake = FakeSerial()
    monkeypatch.setattr(serial, "serial_for_url", lambda name, **_: fake)
    monkeypatch.setattr("armkin.board.ports.serial_port.sys.platform", platform)
    monkeypatch.setattr(serial_port, "Lock", FakeLock)
    SerialPort(name, reset=reset).close()
    assert fake.done == [*expected, "close"]


WORDS = {"home": "q1", "send": "0 90 -90", "jog": "q1 5", "grip": "open", "path": "--via 390,80,300 --via 390,90,300"}


@pytest.mark.parametrize("command", ["status", "home", "send", "jog", "grip", "path"])
def test_every_command_that_opens_a_port_takes_no_reset(monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    opened: list[bool] = []

    def open_port(name: str, *, reset: bool, **_: object) -> None:
        opened.append(reset)
        raise KeyboardInterrupt

    monkeypatch.setattr("armkin.board.kinds.firmware.open_port", open_port)
    robot = "examples/every_key.yaml" if command == "home" else THREE_DOF
    words = [command, robot, *WORDS.get(command, "").split()]
    assert run(*words, "--port", "COM9", "--no-reset").code == 130
    assert run(*words, "--port", "COM9").code == 130
    assert opened == [False, True]


def test_a_holder_is_known_by_its_birth_too(tmp_path: Path) -> None:
    """A process number that was given to another process since is not taken for the holder."""
    name = str(tmp_path / "ttyX")
    lock = port_lock.Lock(name)
    try:
        assert holder_pid(name) == os.getpid()
        note = Path(port_lock._lock_path(name, "pid"))
        note.write_text(f"{os.getpid()} 12345")  # an earlier process of this number
        assert holder_pid(name) is None
    finally:
        lock.release()


def test_a_line_that_never_falls_silent_leaves_time_for_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """One read gives back what it has; the clock and Ctrl-C are looked at between reads."""

    class Flood:
        in_waiting, given = 1000, 0

        def read(self, size: int) -> bytes:
            self.given += size
            assert self.given < 100_000, "one read does not come to an end"
            return b"A" * size

        def close(self) -> None:
            pass

    monkeypatch.setattr("armkin.board.ports.serial_port._open_serial", lambda *given: Flood())
    port = SerialPort("flood")
    assert len(port.read(0.1)) >= 1000
    port.close()


HOLDER = """
import sys, time
from armkin.board.ports import port_lock
from armkin.board.stop_signals import stoppable
port_lock._signals = False
with stoppable() as asked:
    lock = port_lock.Lock(sys.argv[1])
    print("holds", flush=True)
    while not asked():
        time.sleep(0.01)
    print("brakes", flush=True)
    lock.release()
"""


def test_without_signals_a_file_asks_the_holder_to_stop(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """On Windows a signal of another process would end the sender before it stops the arm."""
    name = str(tmp_path / "COM3")
    monkeypatch.setattr(port_lock, "_signals", False)
    Path(port_lock._lock_path(name, "stop")).touch()  # of an earlier holder: it stops nobody
    with subprocess.Popen([sys.executable, "-c", HOLDER, name], stdout=subprocess.PIPE, text=True) as sender:
        assert sender.stdout is not None
        assert sender.stdout.readline() == "holds\n"
        time.sleep(4 * port_lock._POLL_S)
        assert sender.poll() is None
        assert holder_pid(name) == sender.pid
        port_lock.ask_to_stop(name, sender.pid)
        assert sender.stdout.readline() == "brakes\n"
        assert sender.wait(30) == 0
    assert holder_pid(name) is None
    assert not Path(port_lock._lock_path(name, "stop")).exists()
