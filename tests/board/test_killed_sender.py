"""A sender killed in a motion, on boards that keep counts: the record that it left tells where the arm stands."""

from __future__ import annotations

import itertools
import math
import os
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.kinds import board_of
from armkin.board.klipper import extra_axes as klipper_axes
from armkin.board.ports import record_path
from armkin.board.sim.sim_grbl import Grbl
from armkin.board.sim.sim_klipper import Klipper
from command_line import ROOT

GRBL, KLIPPER = (armkin.load(ROOT / f"tests/robots/three_dof_{kind}.yaml") for kind in ("grbl", "klipper"))
GOAL = np.deg2rad([10, 80, -70])
MOVES = [{"joint": [40, 60, -50]}, {"line": [390, 80, 300]}, {"joint": [0, 90, -90]}]
_numbers = itertools.count()  # of ports: each has a name of its own, and so has its record


class Killed(BaseException):
    """kill -9."""


def grbl_port(name: str, *, hal: bool) -> Grbl:
    settings = {number: value for number, (_, value) in expected_settings(axes_of(GRBL)).items()}
    port = Grbl(4, name, settings | ({384: 1} if hal else {}), hal=hal)
    port.step = 0.01
    return port


def motor_steps(port: Any) -> list[int]:
    """Of the motors, counted from home."""
    if isinstance(port, Grbl):
        return port.steps[:3]
    return [round((port.at[axis.section] - axis.at_home) * axis.steps) for axis in klipper_axes.axes_of(KLIPPER)]


@pytest.mark.parametrize("after", [0.0, 0.4, 1.0, 2.0, 30.0])
@pytest.mark.parametrize("kind", ["grbl", "grblHAL", "klipper"])
def test_a_sender_that_was_killed_goes_on_where_the_arm_stands(kind: str, after: float) -> None:
    def die() -> bool:
        if port.now() > began + after:
            raise Killed
        return False

    name, began = f"killed-{os.getpid()}-{next(_numbers)}", math.inf
    arm = KLIPPER if kind == "klipper" else GRBL
    port: Any = (
        Klipper(klipper_axes.settings_of(klipper_axes.axes_of(arm)), name)
        if kind == "klipper"
        else grbl_port(name, hal=kind == "grblHAL")
    )
    port.simulated = False  # so that nobody vouches for the position by itself
    board = board_of(arm)
    machine = board.attach(port, die)
    assert machine.prepare(assume=arm.home)
    machine.run([machine.plan(machine.counts(), GOAL)])
    path = armkin.path(arm, {"start": {"joints": [10, 80, -70]}, "blend": 8, "moves": MOVES})
    plan = machine.plan_trajectory(path.motion, np.array(machine.counts()))
    began = port.now()
    if after < plan.duration:
        with pytest.raises(Killed):
            machine.run([plan])
    else:
        machine.run([plan])
    for _ in range(500):
        port.advance(0.02)
    port.close()
    again = board.attach(port, lambda: False)
    assert not again.prepare()
    assert (again.position(), list(again.counts())) == ("known", motor_steps(port))
    again.run([again.plan(again.counts(), GOAL)])
    assert motor_steps(port) == armkin.pulses(arm, GOAL).tolist()
    os.unlink(record_path(name))
    assert board.attach(port, lambda: False).position() == "lost"
