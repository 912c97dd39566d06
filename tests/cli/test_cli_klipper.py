"""Commands on Klipper: a stand-in behind a real Unix socket."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import armkin
from armkin.board.klipper.extra_axes import axes_of, settings_of
from armkin.board.sim.sim_klipper import Klipper
from command_line import ROOT, run
from unix_port import UnixPort

ROBOT = str(ROOT / "tests/robots/three_dof_klipper.yaml")
AXES = axes_of(armkin.load(ROBOT))


def pin_counts(port: Klipper) -> list[int]:
    return [round((port.at[axis.section] - axis.at_home) * axis.steps) for axis in AXES]


def test_a_new_klipper_is_told_where_the_arm_stands_then_moved(tmp_path: Path) -> None:
    board = Klipper(settings_of(AXES))
    with UnixPort(board, tmp_path / "klippy.sock") as port:
        lost = run("send", ROBOT, -3, 85, -85, "--port", port.name)
        assert (lost.code, "position is lost" in lost.err, "--assume-home" in lost.err) == (5, True, True)
        moved = run("send", ROBOT, -3, 85, -85, "--port", port.name, "--assume-home", "--json")
        assert moved.code == 0, moved.err
        assert moved.json["pulses"] == pin_counts(board) == [-107, -597, 333]
        assert "a stop takes effect when Klipper has carried out what it holds" in lost.err  # once a day
        status = run("status", ROBOT, "--port", port.name, "--json").json
        assert (status["position"], status["state"], status["settings"]) == ("known", "ready", [])
        assert "position is known" in run("send", ROBOT, 0, 90, -90, "--port", port.name, "--assume-home").err
        assert "fit the robot file" in run("setup", ROBOT, "--port", port.name).out
        assert run("setup", ROBOT, "--port", port.name, "--json").json["differences"] == []
        assert run("jog", ROBOT, "q1", 1, "--port", port.name).code == 0
        board.restart()
        assert run("status", ROBOT, "--port", port.name, "--json").json["position"] == "lost"


def test_stop_ends_the_motion_of_another_terminal(tmp_path: Path) -> None:
    board = Klipper(settings_of(AXES))
    with UnixPort(board, tmp_path / "klippy.sock") as port:
        words = ["send", ROBOT, "60", "20", "-60", "--speed", "5", "--assume-home", "--port", port.name]
        mover = subprocess.Popen([sys.executable, "-m", "armkin", *words], stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 60
        while board.at["X"] < 3:
            assert time.monotonic() < end
            time.sleep(0.02)
        assert run("stop", "--port", port.name).code == 0
        _, output = mover.communicate(timeout=60)
        assert mover.returncode == 128 + signal.SIGTERM
        assert "stopped: the arm stands at q1 = " in output
        stands = run("status", ROBOT, "--port", port.name, "--json").json
        assert stands["position"] == "known"
        assert stands["pulses"] == pin_counts(board)
        assert 0 < stands["pulses"][0] < 2133
        nobody = run("stop", "--port", port.name)
        assert (nobody.code, "no armkin moves an arm by" in nobody.err) == (2, True)


def test_setup_prints_what_printer_cfg_needs() -> None:
    completed = run("setup", ROBOT)
    assert completed.code == 0
    assert completed.out.startswith("[printer]\nkinematics: none\n")
    for axis, name in zip("abc", ("q1", "q2", "q3"), strict=True):
        assert f"[manual_stepper axis_{axis}]\n# {name}\nstep_pin: ?\n" in completed.out
    assert "not compared" in completed.out
    answer = run("setup", ROBOT, "--json").json
    assert (answer["port"], answer["differences"]) == (None, None)
    assert answer["printer_cfg"] + "\n# not compared" in completed.out


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("home", ROBOT, "--port", "sim"), 2, "armkin homes no joints through Klipper"),
        (("grip", ROBOT, "open", "--port", "sim"), 2, "no gripper that a board of kind klipper moves; it moves none"),
        (("setup", ROBOT, "--write"), 2, "stand in printer.cfg"),
        (("status", ROBOT, "--port", "/nowhere/klippy.sock"), 5, "there is no socket /nowhere/klippy.sock"),
        (("status", ROBOT, "--port", ROBOT), 5, "it is no socket"),
        (("send", ROBOT, 0, 90, -90), 2, "no port where a klipper board answers was found"),
    ],
)
def test_what_cannot_be_done_is_refused(
    words: tuple[object, ...], code: int, message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    completed = run(*words)
    assert (completed.code, completed.out, message in completed.err) == (code, "", True), completed.err


def test_a_socket_that_nobody_listens_on_and_one_that_is_not_klipper_s(tmp_path: Path) -> None:
    class Other(Klipper):
        def write(self, data: bytes) -> None:
            self._out += b"HTTP/1.1 400 Bad Request\r\n\r\n\x03"

    board, path = Other(settings_of(AXES)), tmp_path / "other.sock"
    with UnixPort(board, path) as port:
        assert "does not answer as Klipper's API server does" in run("status", ROBOT, "--port", port.name).err
    assert os.path.exists(path)
    silent = run("status", ROBOT, "--port", path)
    assert (silent.code, "does Klipper run?" in silent.err) == (5, True)
