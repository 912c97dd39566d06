"""A closed, curved path on the compiled firmware in the emulator: exact counts, nothing violated, holds on the path."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import curve_on_pins
import numpy as np
import pytest
import waypoints_on_pins
from bare_host import WIDE, BareHost, cut_batches, image_for
from emulator import EmulatedBoard
from pins import net_steps

import armkin
from armkin.board.firmware.wire import protocol
from armkin.motors import motor_accel
from command_line import ROOT, THREE_DOF, run, run_patiently

HALF_A_STEP = 0.14  # [mm] of all motors, at the tip
CIRCLE = "moves:\n  - point: [350, 0, 300]\n  - circle: {centre: [300, 0, 300]}\n"


def off_the_circle(arm: armkin.Arm, counts: list[int]) -> float:
    """Distance [mm] of the tip at counts from the circle."""
    x, y, z = armkin.fk(arm, armkin.joints(arm, counts))[:3, 3]
    return float(np.hypot(np.hypot(x - 300, y) - 50, z - 300))


def test_a_closed_circle_ends_at_exact_counts_and_a_hold_stays_on_it(board: EmulatedBoard, tmp_path: Path) -> None:
    path = tmp_path / "circle.yaml"
    path.write_text(CIRCLE)
    completed = run_patiently("path", THREE_DOF, path, "--port", board.port, "--assume-home", "--json")
    assert completed.code == 0, completed.err
    arm = armkin.load(THREE_DOF)
    counts = net_steps(board)
    assert counts == completed.json["pulses"]
    assert completed.json["segments"] < 100 * completed.json["duration_s"]
    assert off_the_circle(arm, counts) < 0.3
    stats = board.stats()
    for axis in "XYZ":
        assert set(stats["axes"][axis]["violations"].values()) == {0}
    # Again, held half-way round: within the tolerance, half a step of all motors (0.14 mm) and one step of the path.
    command = [sys.executable, "-m", "armkin", "path", THREE_DOF, str(path), "--port", board.port]
    sender = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    end = time.monotonic() + 60
    while net_steps(board)[0] > counts[0] - 120:
        assert sender.poll() is None, sender.communicate()
        assert time.monotonic() < end, "it does not move"
        time.sleep(0.01)
    sender.send_signal(signal.SIGINT)
    _, err = sender.communicate(timeout=60)
    assert sender.returncode == 130, err
    held = run("status", THREE_DOF, "--port", board.port, "--json").json
    assert held["position"] in ("known", "retained")
    assert held["pulses"] == net_steps(board)
    assert off_the_circle(arm, net_steps(board)) < 0.05 + 0.14 + 0.2
    back = run_patiently("path", THREE_DOF, path, "--port", board.port, "--json")
    assert back.code == 0, back.err
    assert net_steps(board) == counts


@pytest.fixture(scope="module")
def circle() -> curve_on_pins.Laid:
    return curve_on_pins.lay_curve(curve_on_pins.CIRCLE)


def test_every_step_of_a_curve_comes_when_the_protocol_says(circle: curve_on_pins.Laid) -> None:
    run = curve_on_pins.whole_run(circle)
    assert run.exact
    assert (run.overruns, run.violations, run.error) == (0, 0, 0)
    assert run.late_us <= 5.0
    assert run.off_mm <= 0.05 + HALF_A_STEP
    assert run.segments_a_second <= 100


def test_a_tick_behind_the_shortest_interval_is_not_early() -> None:
    """Loading a segment takes longer than the shortest interval: the timer must know of the next one before."""
    fast = protocol.Segment(400, 448, 0, (204_800, -102_400, 51_200))
    slow = protocol.Segment(200, 1344, 5000, tuple(-3 * rate for rate in fast.rates), 50, True)
    segments = [fast, slow] * 10
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as uno:
        host = BareHost(uno)
        host.run(0.02)
        host.setup(image_for("uno_cnc_shield", replace(WIDE, max_accel=1 << 23)), {0: 0, 1: 0, 2: 0})
        uno.control("clear")
        status = host.stream(cut_batches((0, 1, 2), (0, 0, 0), segments, 4))
        assert (status.error, status.overruns) == (0, 0)
        expected = curve_on_pins.predicted_steps(segments, [0, 0, 0])
        assert curve_on_pins.late_us(uno.trace(), expected) <= 5.0


@pytest.mark.parametrize(("share", "cable"), [(0.22, False), (0.61, False), (0.4, True)])
def test_a_curve_held_or_cut_off_stays_on_its_way_and_known(
    circle: curve_on_pins.Laid, share: float, cable: bool
) -> None:
    held = curve_on_pins.hold_curve(circle, share, cable=cable)
    assert held.known
    assert held.goes_on
    assert held.off_way_mm <= 0.05 + HALF_A_STEP
    assert held.accel <= 1.6
    if not cable:  # 5/8 of the accelerations: slower than with all of them, unless the plan is slower by itself
        speed = circle.curve.evaluate(np.array([share * circle.curve.duration]), 1)[0]
        ramp = (np.abs(circle.arm.motor_gain @ speed) / motor_accel(circle.arm)).max()
        assert 0.92 < held.milliseconds / 1000 / (ramp / 0.625) < 1.05


def test_waypoints_are_streamed_without_a_stop() -> None:
    # A frame carries 0.2 s of motion as a mean; every 0.04 s the board's time waits for a host without a processor.
    streamed = waypoints_on_pins.stream_waypoints(60, patience=0.04)
    assert streamed.good, streamed
    assert streamed.processor < streamed.seconds  # it keeps up, on a machine that has time for it
    assert streamed.waypoints == 60
    assert streamed.late_us <= 50
    assert streamed.segments_a_second <= 100
