"""How long the arm stands before a motion, how frames fit the line, and a queue that runs dry before the first step."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board.firmware import carry_out_plans, gripping, streaming
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.wire import framing
from armkin.board.firmware.wire.protocol import Type
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_port import SimPort
from armkin.board_catalogue import BOARDS
from armkin.errors import HeldError
from armkin.model import build_arm as arms

ARM = arms.load_arm("robots/three_dof.yaml")


class Stalling(SimPort):
    """A computer that does nothing for `seconds` behind the MOTION frame with this number; what was sent is kept."""

    def __init__(self, board: SimBoard, frame: int = -1, seconds: float = 0.0, again: int = -1) -> None:
        super().__init__(board)
        self.sent: list[bytes] = []
        self._frames, self._seconds = (frame, again), seconds

    def write(self, data: bytes) -> None:
        super().write(data)
        if payload_of(data)[0] != Type.MOTION:
            return
        self.sent.append(data)
        if len(self.sent) in self._frames:
            for _ in range(round(1000 * self._seconds)):
                self.board.advance(0.001)
                self._now += 0.001


def payload_of(data: bytes) -> bytes:
    """The payload of the first frame on the wire."""
    unstuffed = framing.cobs_decode(data.strip(b"\0").split(b"\0")[0])
    assert unstuffed is not None
    return unstuffed[:-4]


def machine_on(port: SimPort) -> FirmwareMachine:
    machine = FirmwareMachine(port, ARM, configure(ARM))
    machine.prepare()
    return machine


def test_a_hold_is_gentle_on_curves_alone() -> None:
    """Bits 2 to 4 of a frame's flags: eighths of the accelerations that a hold on it leaves out."""
    port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]))
    machine = machine_on(port)
    moves = {"moves": [{"point": [350, 0, 300]}, {"circle": {"centre": [300, 0, 300]}}]}
    plan = armkin.path(ARM, moves).motion
    machine.run([machine.plan_trajectory(plan, np.array(machine.counts()))])
    gentle = [payload_of(frame)[4] >> 2 for frame in port.sent]
    first = gentle.index(3)
    assert gentle == [0] * first + [3] * (len(gentle) - first)
    assert 0 < first < len(gentle) // 2


def test_a_stall_before_the_first_step_begins_again() -> None:
    port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), 1, 0.03)
    machine = machine_on(port)
    plan = machine.plan(machine.counts(), np.deg2rad([-30, 5, -5]))
    assert machine.run([plan]).error == 0
    assert machine.counts() == tuple(plan.end.tolist())
    sent = [payload_of(data) for data in port.sent]
    assert sent[-1][4] & 1  # END
    again = next(frame for frame in sent if frame[1] == 0)  # of a new session
    assert again[6:18] == bytes(12)  # from the start
    assert again[30 + (11 if again[4] & 2 else 5) :][:6] == bytes(6)  # behind a pause


@pytest.mark.parametrize("rows", [[[-30, 5, -5]], [[0.3, 90, -90], [0, 89.7, -90], [-30, 5, -5]]])
def test_a_stall_in_the_beginning_goes_on_from_there(rows: list[list[float]]) -> None:
    port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), 4, 0.08)
    machine = machine_on(port)
    plans, counts = list[Any](), machine.counts()
    for row in rows:
        plans.append(machine.plan(counts, np.deg2rad([row])))
        counts = tuple(plans[-1].end.tolist())
    assert machine.run(plans).error == 0
    assert machine.counts() == counts
    again = next(payload_of(data) for data in port.sent if payload_of(data)[1] == 0)  # of a new session
    assert again[6:18] != bytes(12), "what is left, not all of it"


@pytest.mark.parametrize("again", [48, 92])
def test_two_stalls_lose_none_of_several_moves(again: int) -> None:
    """The second one comes before the board has heard of all that was left at the first."""
    port, shown = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), 4, 0.4, again), list[float]()
    machine = machine_on(port)
    plans, counts = list[Any](), machine.counts()
    for row in [[20, 90, -90], [20, 70, -90], [0, 90, -90], [-20, 60, -60]]:
        plans.append(machine.plan(counts, np.deg2rad([row])))
        counts = tuple(plans[-1].end.tolist())
    machine.run(iter(plans), lambda done, total: shown.append(done))
    assert machine.counts() == counts
    assert shown == sorted(shown)
    assert sum(payload_of(data)[1] == 0 for data in port.sent) == 2  # sessions
    late = shown[-1] - sum(plan.duration for plan in plans)
    assert 0 < late < 0.3, "what is left of a move begins at rest, and takes a little longer"


@pytest.mark.parametrize(("load", "sessions"), [(0.0, 1), (1.5, 0)])
def test_a_stall_where_the_arm_turns_back(monkeypatch: pytest.MonkeyPatch, load: float, sessions: int) -> None:
    """A beginning behind a rest is begun anew, too; a busy computer fills the queue first, for it may stall there."""
    monkeypatch.setattr(streaming, "_processor_load", lambda session: load)
    turning_pose = ARM.home + np.deg2rad([5, -5, 5])
    for frame in (11, 12, 13):  # the first two behind the rest, on a quiet computer
        port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), frame, 0.1)
        machine = machine_on(port)
        machine.run([machine.plan(machine.counts(), np.array([turning_pose, ARM.home]), speed=0.1)])
        assert machine.counts() == (0, 0, 0)
        assert sum(payload_of(data)[1] == 0 for data in port.sent) == sessions


def test_a_stall_behind_the_beginning_is_a_hold() -> None:
    port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), 16, 0.45)
    machine = machine_on(port)
    moves = {"moves": [{"point": [350, 0, 300]}, {"circle": {"centre": [300, 0, 300]}}]}
    plan = machine.plan_trajectory(armkin.path(ARM, moves).motion, np.array(machine.counts()))
    with pytest.raises(HeldError, match="keep its queue filled"):
        machine.run([plan])
    assert machine.counts() != tuple(plan.end.tolist())


def test_after_a_second_somebody_may_be_near_the_arm() -> None:
    """A program that was suspended moves nothing when it goes on."""
    port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), 4, 1.1)
    machine = machine_on(port)
    plan = machine.plan(machine.counts(), np.deg2rad([-30, 5, -5]))
    with pytest.raises(HeldError, match="keep its queue filled"):
        machine.run([plan])
    assert machine.counts() not in {(0, 0, 0), tuple(plan.end.tolist())}


@pytest.mark.parametrize("frame", [1, 3, 6])
def test_a_grip_goes_on_behind_a_stall(frame: int) -> None:
    port, grip = Stalling(SimBoard(BOARDS["uno_cnc_shield"]), frame, 0.1), gripping.gripper_of(ARM.name, configure(ARM))
    machine = machine_on(port)
    gripping.prepare_gripper(machine, grip, None)
    assert gripping.move_gripper(machine, grip, grip.closed) == grip.closed
    assert sum(payload_of(data)[1] == 0 for data in port.sent) == 1  # a new session


@pytest.mark.parametrize(("frame", "seconds", "beginning"), [(4, 1.1, 0.7), (6, 0.1, 0.1)])
def test_a_grip_is_held_after_a_second_and_behind_its_beginning(
    monkeypatch: pytest.MonkeyPatch, frame: int, seconds: float, beginning: float
) -> None:
    monkeypatch.setattr(carry_out_plans, "_BEGINNING_TIME", beginning)
    grip = gripping.gripper_of(ARM.name, configure(ARM))
    machine = machine_on(Stalling(SimBoard(BOARDS["uno_cnc_shield"]), frame, seconds))
    gripping.prepare_gripper(machine, grip, None)
    with pytest.raises(HeldError, match="keep its queue filled"):
        gripping.move_gripper(machine, grip, grip.closed)
    assert machine.status.counts[grip.axis] not in {grip.open, grip.closed}


def test_two_frames_fit_the_line() -> None:
    port = Stalling(SimBoard(BOARDS["uno_cnc_shield"]))
    machine = machine_on(port)
    machine.run([machine.plan(machine.counts(), np.deg2rad([-30, 5, -5]))])
    assert len(port.sent) > 8
    assert max(map(len, port.sent)) <= machine.info.receive - 12  # a STATUS? besides


def test_the_arm_stands_longer_where_answers_take_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = machine_on(SimPort(SimBoard(BOARDS["uno_cnc_shield"])))
    session = machine.session
    leads = []
    frames = [(0.01, 2, 70), (0.01, 3, 90), (0.02, 6, 140), (0.04, 6, 140), (0.08, 6, 140)]
    for slowest in (0.0005, 0.002, 0.016, 0.2):
        session.line.slowest = slowest
        leads.append(streaming.lead_time(session, frames))
    assert leads == sorted(leads)
    assert leads[-1] - leads[-2] > 0.3  # two answers are waited for
    session.line.slowest = 1.0
    assert streaming.lead_time(session, frames) == 0.6
    assert streaming.lead_time(session, frames, 0.7) == 0.7
    session.port.simulated, session.line.slowest = False, 0.0
    cores = os.cpu_count() or 1
    for mean, running, seconds in ((1.5, 0, 0.25), (0.7, 0, 0.1), (0.09, 0, 0.0015), (0.0, 0.5, 0.1), (0.1, 1.5, 0.25)):
        monkeypatch.setattr("os.getloadavg", lambda mean=mean: (mean * cores, 0.0, 0.0))
        monkeypatch.setattr(streaming, "_others_running", lambda running=running: running * cores)
        assert streaming.lead_time(session, []) == seconds
    session.line.resent = 1
    assert streaming.lead_time(session, []) == 0.25
    monkeypatch.setattr(streaming, "_processor_load", lambda session: 0.0)
    assert streaming.lead_time(session, []) == 0.05


@pytest.mark.parametrize("bad", [0, 1])
def test_the_end_of_a_motion_is_asked_for_every_10_ms(bad: int) -> None:
    """On a line that had lost a byte the host asked as fast as it was answered: 2,000 questions a motion."""
    ask_times: list[float] = []

    class Asked(SimPort):
        def write(self, data: bytes) -> None:
            super().write(data)
            if payload_of(data)[0] == Type.STATUS_QUERY:
                ask_times.append(self.now())
                assert len(ask_times) < 1000

    machine = machine_on(Asked(SimBoard(BOARDS["uno_cnc_shield"])))
    machine.session.line.splitter.bad += bad
    plan = machine.plan(machine.counts(), np.deg2rad([-30, 5, -5]))
    began = machine.port.now()
    machine.run([plan])
    during = [time for time in ask_times if began < time < machine.port.now()]
    assert len(during) < 110 * plan.duration
    assert min(np.diff(during)) > 0.009
