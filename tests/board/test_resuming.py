"""`send --resume`: a motion that was held goes on where the arm stands, or is refused with the reason."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.remaining_plan import places_on, remaining_trajectory
from armkin.board.firmware.segments.trajectory_to_counts import Cut, cut_trajectory, plan_moves
from armkin.board.firmware.wire.protocol import HALF, STEP
from armkin.board.ports import note_path
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_port import SimPort
from armkin.board_catalogue import BOARDS
from armkin.motion.joint_moves import straight_move
from armkin.motion.timing.trajectory import Trajectory
from armkin.motors import exact_pulses, joints
from command_line import ROOT, THREE_DOF, run

_ROUNDED = 1e-6  # share of a rate, or [rad/s], that rounding leaves
ROWS = "10,80,-80\n12,60,-82\n-3,70,-60\n-20,70,-85\n0,90,-90\n"
PATH = """
moves:
  - point: [390, 80, 300]
  - line: [390, 120, 300]
  - circle: {centre: [370, 120, 300], normal: [0, 0, 1], turns: 1}
  - wait: 0.3
  - grip: closed
  - line: [390, 80, 290]
"""


class Arm:
    """A board behind a port that outlives the commands; its line can fall silent for a second."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.board = SimBoard(BOARDS["uno_cnc_shield"])
        self.name = str(folder / "port")
        self.paused_at: float | None = None  # seconds of the next motion after which the sender is paused
        self.track: list[tuple[int, ...]] = []
        monkeypatch.setattr("armkin.board.kinds.firmware.open_port", lambda name, **_: Wire(self))

    def send(self, *words: object) -> tuple[int, str]:
        completed = run("send", THREE_DOF, *words, "--port", self.name)
        return completed.code, completed.err

    @property
    def counts(self) -> list[int]:
        return self.board.motors.counts()[:3]


class Wire(SimPort):
    """The port of such a board."""

    simulated = False

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm.board, arm.name)
        self._arm, self._moved = arm, 0.0

    def read(self, timeout: float) -> bytes:
        arm, began = self._arm, self._now
        data = super().read(timeout)
        if arm.board.motors.state:
            arm.track.append(tuple(arm.counts))
            self._moved += self._now - began
        if arm.paused_at is not None and self._moved > arm.paused_at:
            arm.paused_at = None
            for _ in range(5000):
                arm.board.advance(0.001)
                arm.track.append(tuple(arm.counts))
        return data


@pytest.fixture
def arm(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Arm:
    return Arm(monkeypatch, tmp_path)


@pytest.fixture
def motions(tmp_path: Path) -> dict[str, tuple[object, ...]]:
    (tmp_path / "rows.csv").write_text(ROWS)
    (tmp_path / "path.yaml").write_text(PATH)
    return {
        "single": (-30, 5, -5),
        "target": ("--target", "390,80,300"),
        "batch": ("--batch", tmp_path / "rows.csv"),
        "blend": ("--batch", tmp_path / "rows.csv", "--blend", 5),
        "path": ("--path", tmp_path / "path.yaml"),
    }


def farthest_from(track: list[tuple[int, ...]], way: np.ndarray) -> float:
    """The farthest that a point of the track is from a polyline, over all motors [steps]."""
    a, d = way[:-1], np.diff(way, axis=0)
    worst = 0.0
    for point in np.unique(np.array(track), axis=0):
        share = np.clip(((point - a) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-12), 0, 1)
        worst = max(worst, float(np.abs(a + share[:, None] * d - point).max(axis=1).min()))
    return worst


@pytest.mark.parametrize("name", ["single", "target", "batch", "blend", "path"])
def test_a_motion_that_was_held_goes_on_and_ends_where_it_should(
    arm: Arm, motions: dict[str, tuple[object, ...]], name: str
) -> None:
    words = motions[name]
    assert run("grip", THREE_DOF, "open", "--assume", "open", "--port", arm.name).code == 0
    assert arm.send(0, 90, -90, "--assume-home")[0] == 0
    arm.track.clear()
    assert arm.send(*words)[0] == 0
    full_track, end = np.array(list(dict.fromkeys(arm.track)), dtype=float), arm.counts
    assert arm.send(0, 90, -90)[0] == 0
    arm.track.clear()
    for pause in (0.45, 0.8, 1.1):  # held three times on its way
        arm.paused_at = pause
        code, err = arm.send(*words, *(["--resume"] if pause > 0.45 else []))
        if code == 0:
            break
        assert code == 5
        assert "the same command with --resume goes on" in err
    if code:
        arm.paused_at = None
        code, err = arm.send(*words, "--resume")
    assert code == 0, err
    assert arm.counts == end
    assert len(arm.track) > 500
    assert farthest_from(arm.track, full_track) <= 4  # the whole motion was sampled every few ms


def test_a_motion_held_in_its_approach_goes_on_with_that(arm: Arm, tmp_path: Path) -> None:
    file = tmp_path / "lines.yaml"
    file.write_text("start: home\nmoves: [{line: [390, 60, 300]}, {line: [390, -60, 300]}]\n")
    end = armkin.pulses(armkin.load(THREE_DOF), armkin.path(armkin.load(THREE_DOF), file).motion.end).tolist()
    assert arm.send(60, 70, -70, "--assume-home")[0] == 0  # an approach of 1.5 s: held in its middle
    arm.track.clear()
    arm.paused_at = 0.3
    code, err = arm.send("--path", file)
    assert (code, "first a joint move to where the path starts" in err) == (5, True)
    assert arm.counts[0] not in (0, end[0])  # it stands on its way home
    code, err = arm.send("--path", file, "--resume")
    assert (code, "first a joint move" in err) == (0, False), err
    assert arm.counts == end
    assert (0, 0, 0) in arm.track


def test_what_cannot_be_gone_on_with_is_refused_with_the_next_step(
    arm: Arm, motions: dict[str, tuple[object, ...]]
) -> None:
    def assert_refused(code: int, pattern: str, *words: object) -> None:
        before = arm.counts
        exit_code, err = arm.send(*words, "--resume")
        assert (exit_code, arm.counts) == (code, before), err
        assert re.search(pattern, err), err

    assert_refused(5, "position is lost.*\n?.*--assume-home", *motions["single"])
    assert arm.send(0, 90, -90, "--assume-home")[0] == 0
    assert_refused(2, "no motion was held.*\n?.*leave --resume out", *motions["single"])
    arm.paused_at = 0.8
    assert arm.send(*motions["single"])[0] == 5
    assert_refused(2, "another motion than the one that was held", 20, 80, -80)
    assert_refused(2, "--resume and --dry-run", *motions["single"], "--dry-run")
    assert_refused(2, "--resume and --assume", *motions["single"], "--assume-home")
    assert_refused(2, "--resume needs the same rows again.*\n.*give a file with the rows, --batch FILE", "--batch", "-")
    assert run("jog", THREE_DOF, "q1", 10, "--seconds", 0.3, "--port", arm.name).code == 0
    assert_refused(5, "the arm has moved since", *motions["single"])
    assert arm.send(*motions["single"])[0] == 0
    assert_refused(2, "no motion was held", *motions["single"])  # it has arrived


def test_a_sender_that_was_killed_leaves_a_note_that_is_enough(
    arm: Arm, motions: dict[str, tuple[object, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """kill -9: nobody has noted where the arm came to rest; it must lie on the plan."""
    assert arm.send(0, 90, -90, "--assume-home")[0] == 0
    _kill_sender(monkeypatch, lambda: arm.board.motors.counts()[1] < -3000)
    assert arm.send(*motions["single"])[0] == 130
    note = Path(note_path(arm.name)).read_text()
    assert '"stands": null' in note
    for _ in range(3000):
        arm.board.advance(0.001)
    assert arm.counts[1] < -3000
    monkeypatch.undo()
    Arm.__init__(again := Arm.__new__(Arm), monkeypatch, Path(arm.name).parent)
    again.board = arm.board
    assert again.send(*motions["single"], "--resume")[0] == 0
    assert again.counts == [-1067, -10144, 5667]


def _kill_sender(monkeypatch: pytest.MonkeyPatch, is_time: Callable[[], bool]) -> None:
    """The sender ends without a word once `is_time` says so."""
    read = Wire.read

    def read_or_die(self: Wire, timeout: float) -> bytes:
        if is_time():
            raise KeyboardInterrupt
        return read(self, timeout)

    monkeypatch.setattr(Wire, "read", read_or_die)


def test_a_stop_says_where_the_arm_stands_and_that_it_can_go_on(
    arm: Arm, motions: dict[str, tuple[object, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    from armkin.board.stop_signals import Stop

    assert arm.send(0, 90, -90, "--assume-home")[0] == 0
    monkeypatch.setattr(Stop, "__call__", lambda self: arm.board.motors.counts()[1] < -3000)
    _, err = arm.send(*motions["single"])
    q = np.rad2deg(armkin.joints(armkin.load(ROOT / THREE_DOF), arm.counts))
    assert f"q2 = {q[1]:.4f}" in err
    assert "--resume goes on with this motion" in err
    monkeypatch.setattr(Stop, "__call__", lambda self: False)
    assert arm.send(*motions["single"], "--resume")[0] == 0
    assert arm.counts == [-1067, -10144, 5667]


def _counts_reached(way: Cut) -> list[int]:
    """Where a fresh board has come to that carries a plan out from its start."""
    arm = way.trajectory.arm
    machine = FirmwareMachine(SimPort(SimBoard(BOARDS["uno_cnc_shield"])), arm, configure(arm))
    machine.prepare(assume=joints(arm, way.start))
    machine.run([way])
    return list(machine.counts())


@pytest.mark.parametrize("goal", [(-30, 5, -5), (10, 80, -80), (25, 85, -60)])
def test_what_is_left_at_every_one_of_the_last_steps_is_taken(goal: tuple[int, ...]) -> None:
    """ACCEL was answered within the last two steps: whole steps are another direction there than the line's."""
    arm = armkin.load(ROOT / THREE_DOF)
    full_plan = plan_moves(arm, [0, 0, 0], np.deg2rad(goal), min_interval=448)
    position, stands = np.array(full_plan.start) * STEP + HALF, list[list[int]]()
    for s in next(full_plan.moves()).segments:
        stands += ((position + np.arange(1, s.ticks + 1)[:, None] * np.array(s.rates)) // STEP).tolist()
        position += s.ticks * np.array(s.rates)
    last = list(dict.fromkeys(map(tuple, stands)))[-14:-1]
    for counts in map(np.array, last):
        place = next(places_on([full_plan], counts))
        left = cut_trajectory(remaining_trajectory(full_plan, place, joints(arm, counts)), counts, min_interval=448)
        assert _counts_reached(left) == full_plan.end.tolist(), counts


def test_a_way_of_less_than_a_step_is_taken() -> None:
    """An arm 0.55 steps before a path's start has a whole one to make: ACCEL was answered."""
    arm = armkin.load(ROOT / THREE_DOF)
    standing = joints(arm, [128, -1193, 1333])
    for steps in ([0.55, -0.55, 0], [0, 0, 0.7], [-0.6, 0, 0.6], [1.51, -0.55, 2.6]):
        goal = standing + joints(arm, steps) - arm.home
        way = cut_trajectory(
            Trajectory(arm, standing, (straight_move(arm, standing, goal),)), [128, -1193, 1333], min_interval=448
        )
        assert _counts_reached(way) == way.end.tolist() != way.start.tolist()


@pytest.mark.parametrize("begin", [0.0, 0.2, 0.5, 0.8, 0.999])
def test_what_is_left_of_a_joint_move_keeps_max_jerk(begin: float) -> None:
    from armkin.motion.remaining_stretch import remainder

    arm, jerk = armkin.load(ROOT / THREE_DOF), np.deg2rad([100.0, 200.0, 100.0])
    for held_arm, asked in ((replace(arm, max_jerk=jerk), None), (arm, jerk)):  # the file's, or asked for
        whole = straight_move(held_arm, arm.home, np.deg2rad([60, 20, -20]), 0.5, jerk=asked)
        t0 = begin * whole.duration
        left = remainder(held_arm, whole, t0, whole.evaluate(np.array([t0]))[0])
        t = np.linspace(0, left.duration, 4001)
        assert np.abs(np.diff(left.evaluate(t, 2), axis=0) / t[1] / jerk).max() <= 1 + _ROUNDED
        assert (left.top_speed <= (1 + _ROUNDED) * whole.top_speed).all()  # no faster than was asked for
        assert np.abs(left.evaluate(t, 1)[[0, -1]]).max() < _ROUNDED  # from rest to rest
        assert left.end == pytest.approx(whole.end)
        assert left.duration <= (1 + _ROUNDED) * whole.duration


@pytest.mark.parametrize("begin", [0.3, 0.5, 0.8, 0.95])
def test_what_is_left_of_a_curve_keeps_to_the_joints_limits(begin: float) -> None:
    from armkin.motion.remaining_stretch import remainder

    arm = armkin.load(ROOT / THREE_DOF)
    corners = np.array([[390, 80, 300], [390, 160, 300], [340, 160, 280], [340, 20, 300]])
    plan = armkin.path(arm, corners, blend=15.0)
    stretch = max(plan.motion.stretches, key=lambda s: s.duration)
    t0 = begin * stretch.duration
    left = remainder(arm, stretch, t0, stretch.evaluate(np.array([t0]))[0])
    t = np.linspace(0, left.duration, 4000)
    assert np.abs(left.evaluate(t, 1) / arm.max_speed).max() <= 1.001
    assert np.abs(left.evaluate(t, 2) / arm.max_accel).max() <= 1.02
    assert np.abs(left.evaluate(t, 1)[[0, -1]]).max() < 1e-6  # from rest to rest
    assert left.end == pytest.approx(stretch.end)
    assert left.duration < stretch.duration - t0 + 1.5
    way = exact_pulses(arm, stretch.evaluate(np.linspace(t0, stretch.duration, 20_000)))
    track = [tuple(row) for row in exact_pulses(arm, left.evaluate(t[::40]))]
    assert farthest_from(track, way) < 0.01
