"""Six-axis arms on an emulated Pico, from the command line to the pins."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from emulator import PICO, EmulatedBoard

import armkin
from command_line import ROOT, run

# joint values, some degrees away from home
ARMS = {
    "ar4_pico6": (4, 3, -4, 5, -4, 5),
    "parol6_pico6": (85, -86, 185, 4, -5, 188),
    "thor_pico6": (3, -2, 3, 4, 5, -6),
}


@pytest.mark.parametrize("name", ARMS)
def test_a_six_axis_arm_moves_end_to_end(name: str) -> None:
    robot = ROOT / "robots" / f"{name}.yaml"
    pose = ARMS[name]
    # at 0.4 of real time neither a busy host nor a busy emulator runs into the other's time-outs
    by: Literal["uart", "usb"] = "usb" if name == "parol6_pico6" else "uart"
    planned = run("send", robot, *pose, "--dry-run", "--json")
    assert planned.code == 0, planned.err
    rehearsed = run("send", robot, *pose, "--port", "sim", "--json")
    assert rehearsed.code == 0, rehearsed.err
    with EmulatedBoard(PICO, speed=0.4, trace=True, driver="tmc2209", by=by) as board:
        sent = run("send", robot, *pose, "--port", board.port, "--assume-home", "--json")
        assert sent.code == 0, sent.err
        assert sent.json["pulses"] == rehearsed.json["pulses"] == planned.json["pulses"]
        assert list(board.net().values()) == sent.json["pulses"]
        arm = armkin.load(robot)
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
