"""Six-axis arms on an emulated Pico, from the command line to the pins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import pytest
from emulator import PICO, EmulatedBoard
from numpy.typing import NDArray

import armkin
from command_line import ROOT, run

# joint values, some degrees away from home
ARMS = {
    "ar4_pico6": (4, 3, -4, 5, -4, 5),
    "parol6_pico6": (85, -86, 185, 4, -5, 188),
    "thor_pico6": (3, -2, 3, 4, 5, -6),
}


def wire_switches(board: EmulatedBoard, arm: armkin.Arm, edges: Sequence[int]) -> None:
    """Limit switches that close (open) after so many net steps."""
    for axis, switch, steps in zip("XYZABC", arm.homing, edges, strict=True):
        if switch is not None:
            contact = "nc" if switch.normally == "closed" else "no"
            # an edge at the very place where the arm is switched on is met from the other side
            above = steps > 0 or (steps == 0 and switch.direction > 0)
            board.control(f"set-switch {axis} at {steps} {'above' if above else 'below'} {contact}")


def switch_pulses(arm: armkin.Arm) -> NDArray[np.int64]:
    """Pulses at the switches, from home; 0 where there is none."""
    switch_values = [
        np.radians(switch.at) if switch is not None else home for switch, home in zip(arm.homing, arm.home, strict=True)
    ]
    return armkin.pulses(arm, switch_values)


@pytest.mark.parametrize("name", ARMS)
def test_a_six_axis_arm_moves_end_to_end(name: str) -> None:
    robot = ROOT / "robots" / f"{name}.yaml"
    arm = armkin.load(robot)
    pose = ARMS[name]
    # at 0.4 of real time neither a busy host nor a busy emulator runs into the other's time-outs
    link: Literal["uart", "usb"] = "usb" if name == "parol6_pico6" else "uart"
    planned = run("send", robot, *pose, "--dry-run", "--json")
    assert planned.code == 0, planned.err
    rehearsed = run("send", robot, *pose, "--port", "sim", "--json")
    assert rehearsed.code == 0, rehearsed.err
    with EmulatedBoard(PICO, speed=0.4, trace=True, driver="tmc2209", link=link) as board:
        wire_switches(board, arm, switch_pulses(arm).tolist())
        sent = run("send", robot, *pose, "--port", board.port, "--assume-home", "--json")
        assert sent.code == 0, sent.err
        assert sent.json["pulses"] == rehearsed.json["pulses"] == planned.json["pulses"]
        assert list(board.net().values()) == sent.json["pulses"]
        goal = armkin.pulses(arm, np.radians(pose))
        assert list(board.net().values()) == goal.tolist()
        # on the straight line in counts, every axis within two steps, and none ever turns round
        trace = board.trace()
        ways = [trace.positions(axis) for axis in "XYZABC"]
        far = int(np.argmax(np.abs(goal)))
        for (cycle, count), end in zip(ways, goal, strict=True):
            assert (np.diff(count) * np.sign(end) > 0).all()
            leader = ways[far][1][np.searchsorted(ways[far][0], cycle, side="right") - 1]
            assert np.abs(count - leader * (end / goal[far])).max() <= 2
        figures = board.stats()["axes"]
        assert all(sum(axis["violations"].values()) == 0 for axis in figures.values())
        home = run("send", robot, "home", "--port", board.port, "--json")
        assert home.code == 0, home.err
        assert set(board.net().values()) == {0}
        status = run("status", robot, "--port", board.port, "--json").json
        assert (status["position"], status["board"]) == ("known", PICO)


def test_six_axis_arms_find_their_switches(pytestconfig: pytest.Config, monkeypatch: pytest.MonkeyPatch) -> None:
    """A degree off each switch it takes itself to be at home; homing tells how wrong that was, to the step.

    The last joint of one arm, which homes fast; with --long all six of two.
    """
    long = pytestconfig.getoption("--long")
    for name in ["parol6_pico6", "ar4_pico6"] if long else ["parol6_pico6"]:
        finds_its_switches(name, range(6) if long else range(5, 6), monkeypatch)


def finds_its_switches(name: str, joints: range, monkeypatch: pytest.MonkeyPatch) -> None:
    # the emulator takes 5 s of a core for a second of six fast axes: the host must not take that for a standstill
    monkeypatch.setattr("armkin.board.firmware.wire.session._STALL_TIMEOUT", 120.0)
    robot = ROOT / "robots" / f"{name}.yaml"
    arm = armkin.load(robot)
    step = np.radians([switch.direction for switch in arm.homing if switch is not None])
    away = armkin.pulses(arm, arm.home + step)
    with EmulatedBoard(PICO) as board:
        wire_switches(board, arm, away.tolist())
        assert run("send", robot, "home", "--port", board.port, "--assume-home").code == 0
        names = [arm.joint_names[j] for j in joints]
        completed = run("home", robot, *names, "--port", board.port, "--stay", "--json")
        assert completed.code == 0, completed.err
        difference = np.subtract(completed.json["pulses"], list(board.net().values()))
        wrong = np.where(np.isin(np.arange(6), joints), switch_pulses(arm) - away, 0)
        assert difference.tolist() == wrong.tolist()
        lost = {joint_loss["joint"]: abs(joint_loss["steps"]) for joint_loss in completed.json["lost_steps"]}
        assert lost == dict(zip(names, np.abs(wrong[list(joints)]).tolist(), strict=True))
