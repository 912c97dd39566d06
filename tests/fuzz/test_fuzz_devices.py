"""Boards that say anything: an answer, or an error in words, in bounded time."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
from attack import attack, random_generator

from armkin import load
from armkin.board.firmware import streaming
from armkin.board.firmware.wire import session
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.klipper.extra_axes import axes_of as klipper_axes_of
from armkin.board.klipper.extra_axes import settings_of
from armkin.board.ports import Port
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_grbl import Grbl
from armkin.board.sim.sim_klipper import Klipper
from armkin.board.sim.sim_port import SimPort
from armkin.board.sim.sim_servo_bus import Servo, ServoBus
from armkin.board_catalogue import BOARDS
from command_line import ROOT

GRBL_ARM = ROOT / "tests/robots/three_dof_grbl.yaml"
FITS = {number: value for number, (_, value) in expected_settings(axes_of(load(GRBL_ARM))).items()}
KLIPPER_ARM = ROOT / "tests/robots/three_dof_klipper.yaml"
SECTIONS = settings_of(klipper_axes_of(load(KLIPPER_ARM)))
BOARDS_OF: dict[str, Callable[[random.Random], Port]] = {
    str(ROOT / "robots/three_dof.yaml"): lambda rng: SimPort(SimBoard(BOARDS["uno_cnc_shield"])),
    str(GRBL_ARM): lambda rng: Grbl(axes=4, settings=rng.choice((FITS, FITS, FITS, {}))),
    str(ROOT / "tests/robots/bus_arm.yaml"): lambda rng: ServoBus([Servo(number) for number in (1, 2, 6, 7)]),
    str(KLIPPER_ARM): lambda rng: Klipper(rng.choice((SECTIONS, SECTIONS, SECTIONS, {}))),
}
SAID = (
    b"ok\r\n",
    b"error:9\r\n",
    b"ALARM:1\r\n",
    b"<Idle|MPos:0,0,0|FS:0,0>\r\n",
    b"<Run|MPos:nan,inf,1e400|WCO:1,2>\r\n",
    b"Grbl 1.1h ['$' for help]\r\n",
    b"$110=\r\n$110=x\r\n$999999999999=1\r\n",
    b"[VER:1.1]\r\n",
    b"\x00\x00\x00",
    b"\xff\xff\x01\x04\x00\x00\x00\xfa",
    b"\xff\xff\xfe\xff",
    b"\x03",
    b'{"id": 1, "result": {"state": "ready"}}\x03',
    b'{"id": 2, "result": {"status": {"toolhead": {"position": [NaN, 1e999, 0, 0, -1e18, 7, {}]}}}}\x03',
    b'{"id": 3, "error": {"error": "WebRequestError", "message": "Printer is shutdown\\n!!"}}\x03',
)


class Unreliable:
    """A simulated board on a line that changes, drops, repeats and adds bytes, or falls silent."""

    simulated = False
    baud = 115_200

    def __init__(self, port: Port, rng: random.Random) -> None:
        self.port, self.name, self.rng = port, port.name, rng
        self.to_program = isinstance(port, Klipper)  # a socket to a program, which hears what it is told
        self.share = rng.choice((0.0, 0.003, 0.03, 0.3)) * (0.1 if self.to_program else 1.0)  # its answers are long
        self.silent_from = rng.choice((1e9, rng.uniform(0, 4)))

    def write(self, data: bytes) -> None:
        self.port.write(data if self.to_program else self.spoilt(data))

    def read(self, timeout: float) -> bytes:
        data = self.port.read(timeout)
        if self.port.now() > self.silent_from:
            return b""
        if self.rng.random() < self.share:
            data += self.rng.choice((*SAID, self.rng.randbytes(self.rng.randrange(40))))
        return self.spoilt(data)

    def now(self) -> float:
        return self.port.now()

    def close(self) -> None:
        self.port.close()

    def spoilt(self, data: bytes) -> bytes:
        damaged = bytearray()
        share = 0.02 * self.share
        if not share:
            return data
        for byte in data:
            if self.rng.random() >= share:
                damaged.append(byte)
                continue
            kind = self.rng.randrange(3)
            damaged += bytes([byte, byte] if kind == 0 else [byte ^ 1 << self.rng.randrange(8)] if kind == 1 else [])
        return bytes(damaged)


class Numbers:
    """Of the module `secrets` what a session takes, from the test's own seed."""

    def __init__(self, rng: random.Random) -> None:
        self.randbits, self.randbelow = rng.getrandbits, rng.randrange


@pytest.mark.parametrize("robot", BOARDS_OF, ids=("own firmware", "grbl", "servo bus", "klipper"))
def test_any_device(robot: str, rounds: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random_generator(robot.rpartition("/")[2])
    boards: list[Port] = []

    def open_fuzzed(*words_given: object, **options: object) -> Port:
        if not boards or rng.random() < 0.4:  # else the one of the command before, as that has left it
            boards[:] = [BOARDS_OF[robot](rng)]
        return Unreliable(boards[0], rng)

    # our firmware's; boards of others, and stop; Klipper's
    places = "kinds.firmware.SerialPort", "backend.board.SerialPort", "ports.SerialPort", "kinds.klipper.SocketPort"
    for port in places:
        monkeypatch.setattr(f"armkin.board.{port}", open_fuzzed)
    # The same in every run: no notes of other runs, no random session numbers, no leads for a busy computer.
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(session, "secrets", Numbers(rng))
    monkeypatch.setattr(streaming, "_processor_load", lambda session: 0.0)
    codes = list[int]()
    moved = 0
    while len(codes) < rounds or (not moved and len(codes) < 10 * rounds):
        assume = rng.choice(((), ("--assume-home",), ("--assume-home",))) if "bus" not in robot else ()
        words = rng.choice(
            (
                ("send", robot, "home", "--assume-home"),
                ("send", robot, *(round(rng.uniform(-20, 20), 1) for _ in range(2 if "bus" in robot else 3)), *assume),
                ("send", robot, "--batch", "-", *assume),
                ("status", robot),
                ("home", robot),
                ("jog", robot, "q1" if "bus" not in robot else "j1", rng.choice((-5, 5)), *assume),
                ("stop",),
                ("grip", robot, "closed", "--assume", "open"),
                ("setup", robot),
                ("path", robot, "--via", "390,80,300", "--via", "390,100,300", *assume),
            )
        )
        stdin = b"0,85,-85\n5,80,-80\n" if "bus" not in robot else b"1,2\n3,4\n"
        completed = attack(*words, "--port", "fuzzed", *(["--json"] if words[0] != "stop" else []), stdin=stdin)
        assert "no port fuzzed" not in completed.err, words
        codes.append(completed.code)
        moved += completed.code == 0 and words[0] in ("send", "path") and "home" not in words
    assert {0, 5} <= set(codes)
    assert moved
