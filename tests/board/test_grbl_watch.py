"""Lines that reach GRBL damaged: it obeys them, and is held as soon as its reports tell."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

import armkin
from armkin.board import path_run
from armkin.board.backend.sent_positions import Job
from armkin.board.grbl.grbl_machine import GrblMachine
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.position_watch import Watch
from armkin.board.grbl.replies import Report
from armkin.board.grbl.settings import expected_settings
from armkin.board.sim.sim_grbl import Grbl
from armkin.errors import LinkError

ARM = armkin.load("three_dof")
FITS = {number: value for number, (_, value) in expected_settings(axes_of(ARM)).items()}
Spoil = Callable[[str], str]


class Spoilt(Grbl):
    """Lines of motion are changed on their way, from the time when `spoil` is set."""

    spoil: Spoil | None = None

    def write(self, data: bytes) -> None:
        """Send bytes: lines come whole, one a call."""
        text = data.decode("latin1")
        super().write((self.spoil(text) if self.spoil and "G53" in text else text).encode("latin1"))


def open_grbl(spoil: Spoil | None = None) -> tuple[Spoilt, GrblMachine]:
    port = Spoilt(axes=4, settings=FITS)
    port.simulated = False
    machine = GrblMachine(port, ARM)
    machine.prepare(assume=ARM.home)
    port.spoil = spoil
    return port, machine


def spoil_feed(value: float) -> Spoil:
    return lambda line: re.sub(r"F[\d.]+", f"F{value}", line)


def spoil_target(before: str, after: str) -> Spoil:
    return lambda line: line.replace(before, after)


@pytest.mark.parametrize(
    ("spoil", "message", "seconds"),
    [
        (spoil_feed(9000), "it is faster than planned", 1.5),
        (spoil_feed(0.02), "it hardly moves on", 4.5),
        (spoil_target("X-5", "X-1"), "it has left its path", 1.5),
        (spoil_target("Y", "A"), "it has left its path", 1.5),
    ],
)
def test_a_damaged_line_is_held_in_motion(spoil: Spoil, message: str, seconds: float) -> None:
    port, machine = open_grbl(spoil)
    plan = machine.plan(machine.counts(), np.deg2rad([-60, 60, -60]), speed=0.2)
    began = port.now()
    with pytest.raises(
        LinkError,
        match=f"{message}; a line was damaged on its way, or another program has sent one; the arm was stopped",
    ):
        machine.run([plan])
    assert port.now() - began < seconds
    assert machine.position() == "known"
    assert list(machine.counts()) == port.steps[:3]
    port.spoil = None
    machine.prepare()
    machine.run([machine.plan(machine.counts(), ARM.home[None])])
    assert port.steps[:3] == [0, 0, 0]


def test_a_feed_lost_of_a_slow_move_is_caught_before_it_comes_far() -> None:
    """At 5 % of the speed a lost decimal point asks for 1,000 times as much; GRBL's own limits allow 20 times."""
    port, machine = open_grbl(lambda line: line[: line.index("F")] + line[line.index("F") :].replace(".", ""))
    plan = machine.plan(machine.counts(), np.deg2rad([-60, 60, -60]), speed=0.05)
    with pytest.raises(LinkError, match="faster than planned"):
        machine.run([plan])
    share = np.abs(port.steps[:3]).max() / np.abs(plan.end).max()
    assert share < 0.6


def test_what_is_as_planned_is_left_alone() -> None:
    """A curve, a pause, a slow board: all of them arrive."""
    for accel in (1.0, 0.2):
        port, machine = open_grbl()
        port.settings.update({120 + k: FITS[120 + k] * accel for k in range(3)})
        machine.prepare()
        moves = [{"joint": [0, 80, -80]}, {"wait": 5}, {"joint": [20, 70, -90]}, {"joint": [0, 90, -90]}]
        plan = armkin.path(ARM, {"start": "home", "blend": 5, "moves": moves})
        for part in path_run.plan_parts(plan, machine.counts(), machine.plan_trajectory):
            assert isinstance(part, Job)
            machine.run([part])
        assert port.steps[:3] == [0, 0, 0]


def test_one_damaged_report_is_not_believed() -> None:
    _, machine = open_grbl()
    job = machine.plan(machine.counts(), np.deg2rad([-60, 60, -60]))
    assert isinstance(job, Job)
    watch = Watch(job, machine.axes, np.zeros(3, dtype=np.int64))
    machine.refresh()
    report = machine.session.report
    assert report is not None
    away = report.__class__("Run", 0, (99.0, 0.0, 0.0, 0.0), None, "")
    assert watch.fault(away, 0.1) is None
    assert watch.fault(away, 0.2) == "it has left its path"


def test_a_silence_of_a_minute_is_no_fault_of_the_arm_s() -> None:
    """A computer that is busy, or GRBL: the next report is of a place that the plan has come to meanwhile."""
    _, machine = open_grbl()
    job = machine.plan(machine.counts(), np.deg2rad([-60, 60, -60]), speed=0.01)
    assert isinstance(job, Job)
    for seconds in (30.0, 60.0, 90.0):
        watch = Watch(job, machine.axes, np.zeros(3, dtype=np.int64))
        counts = armkin.pulses(ARM, job.trajectory.q([seconds])[0])
        place = tuple(count / axis.steps for axis, count in zip(machine.axes, counts, strict=True))
        report = Report("Run", 0, (*place, 0.0), None, "")
        assert [watch.fault(report, seconds + late) for late in (0.0, 0.1, 0.2)] == [None] * 3
        assert "faster" in str([watch.fault(report, seconds - 5.0) for _ in range(2)][-1])


def test_settings_are_read_again_before_a_motion() -> None:
    """A long session (a page) outlives resets, and whoever else turns a board's screws."""
    port, machine = open_grbl()
    port.settings[100] = 250.0
    port.advance(6.0)
    with pytest.raises(LinkError, match=r"settings do not fit three_dof: \$100"):
        machine.prepare()
    port.settings[100] = FITS[100]
    port.boot()
    port.advance(0.1)
    assert machine.prepare(assume=ARM.home)
    machine.run([machine.plan(machine.counts(), np.deg2rad([-3, 85, -85]))])
    assert list(machine.counts()) == port.steps[:3]


def test_reports_are_asked_for_while_a_curve_streams() -> None:
    """Its lines are answered sooner than reports are due: none was asked for until the last line."""
    port, machine = open_grbl()
    asked, write = list[float](), port.write

    def listen(data: bytes) -> None:
        asked.extend([port.now()] * (data == b"?"))
        write(data)

    port.write = listen  # type: ignore[method-assign]
    moves = {"start": "home", "moves": [{"point": [390, 80, 300]}, {"line": [390, -80, 300]}]}
    plan = armkin.path(ARM, moves, tool_speed=10.0)
    for part in path_run.plan_parts(plan, machine.counts(), machine.plan_trajectory):
        assert isinstance(part, Job)
        began = port.now()
        machine.run([part])
    assert plan.motion.duration > 15.0
    assert np.diff([time for time in asked if time >= began]).max() < 0.5
