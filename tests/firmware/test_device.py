"""What the compiled firmware does with switches, resets, cables and servos, in the emulator."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from bare_host import CLOCK, WIDE, BareHost, Batch, image_for
from emulator import EmulatedBoard

from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Error, Flag, State, whole_steps

MODERATE = replace(WIDE, lower=-50_000, upper=50_000, max_rate=8000, max_accel=160_000)
KNOWN = {0: 0, 1: 0, 2: 0, 3: 0, 4: 1500}


@pytest.fixture
def board() -> Iterator[EmulatedBoard]:
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as emulated:
        emulated.run(0.02)
        yield emulated


def ready_host(board: EmulatedBoard) -> BareHost:
    host = BareHost(board)
    host.setup(image_for("uno_cnc_shield", MODERATE), KNOWN)
    return host


def move_x(host: BareHost, start: int, steps: int) -> None:
    """X by `steps`, one a tick, as one segment: at 8,000 steps/s if it is long enough to begin so fast."""
    segment = whole_steps(abs(steps), 2000 if abs(steps) > 600 else 8000, 0, (steps,))
    host.order(Batch((0,), (start,), (segment,), at_rest=True).payload(0))


def net_steps(board: EmulatedBoard, axis: str = "X") -> int:
    count: int = board.stats()["axes"][axis]["net"]
    return count


# Homing


@pytest.mark.parametrize(("count", "bounce"), [(-3000, 0), (-777, 2), (40, 1)])
def test_homing_latches_the_switch_to_the_step(board: EmulatedBoard, count: int, bounce: int) -> None:
    board.control(f"set-switch X at {count} below bounce {bounce}ms" if bounce else f"set-switch X at {count} below")
    host = ready_host(board)
    rate = (-4000, 0, 0, 0, 0)
    host.order(protocol.home(0, switch=0, closed=False, slow=26, backoff=300, travel=8000, time=200, rate=rate))
    assert host.status().known == 0b11110
    status = host.rest()
    assert (status.error, bool(status.flags & Flag.LATCH)) == (0, True)
    latch = host.status(page=1).counts[0]
    # 1 ms of bouncing at 406 steps/s is within half a step
    assert abs(latch - count) <= (1 if bounce else 0)
    assert status.counts[0] == net_steps(board)
    host.order(protocol.set_position(0, {0: status.counts[0] - latch - 5000}))
    assert host.status().known == 0b11111
    assert board.stats()["memory"]["stack_never_touched"] >= 128


def test_homing_gives_up_after_its_travel(board: EmulatedBoard) -> None:
    host = ready_host(board)
    rate = (-4000, 0, 0, 0, 0)
    host.order(protocol.home(0, switch=0, closed=False, slow=26, backoff=300, travel=3000, time=200, rate=rate))
    status = host.rest()
    assert status.error == Error.TRAVEL
    assert not status.known & 1
    assert -4000 < net_steps(board) <= -3000


# Resets, power, cables


@pytest.mark.parametrize("cause", ["external", "watchdog", "power", "brownout"])
@pytest.mark.parametrize("moving", [False, True])
def test_only_a_reset_at_rest_keeps_the_position(board: EmulatedBoard, cause: str, moving: bool) -> None:
    host = ready_host(board)
    move_x(host, 0, 2000)
    host.run(0.1 if moving else 0.5)
    board.control(f"reset {cause}")
    host.run(0.05)
    info = host.hello(2)
    assert info.cause == {"external": 2, "watchdog": 8, "power": 1, "brownout": 4}[cause]
    if not moving and cause in ("external", "watchdog"):
        assert info.known == 0b01111  # nothing holds a servo without pulses
        assert info.flags == Flag.DRIVERS | Flag.CONFIGURED | Flag.RETAINED
        assert info.boots == 2
        assert host.status().counts[0] == net_steps(board) == 2000
    else:
        assert (info.known, info.config) == (0, 0)
    stood = net_steps(board)
    host.run(0.5)
    assert net_steps(board) == stood


def test_a_bootloader_that_hides_the_cause_leaves_the_position() -> None:
    with EmulatedBoard("uno_cnc_shield", speed="step", bootloader=20) as board:
        board.run(0.05)
        host = ready_host(board)
        move_x(host, 0, 500)
        host.run(0.3)
        board.control("reset external")
        host.run(0.1)
        info = host.hello(2)
        assert (info.cause, info.known) == (0, 0b01111)
        assert info.flags & Flag.RETAINED


def test_a_cut_data_line_is_a_hold_with_exact_counts(board: EmulatedBoard) -> None:
    host = ready_host(board)
    move_x(host, 0, 20_000)
    host.run(0.2)
    board.control("cut both")
    for _ in range(10):
        host.run(0.1)
    board.control("restore")
    status = host.status()
    assert (status.state, status.error, status.known) == (State.IDLE, Error.SILENCE, 0b11111)
    assert status.counts[0] == net_steps(board)
    # half a second of silence after the last frame, then a ramp of u = 8000/160000 s
    assert status.counts[0] == pytest.approx(8000 * (0.5 + 0.05 / 2), rel=0.02)
    host.hello(2)
    move_x(host, status.counts[0], -100)
    assert host.rest().counts[0] == status.counts[0] - 100


def test_the_abort_input_holds_and_forbids(board: EmulatedBoard) -> None:
    host = ready_host(board)
    move_x(host, 0, 20_000)
    host.run(0.2)
    board.control("pin A0 0")
    host.run(0.4)
    status = host.status()
    assert (status.state, status.error) == (State.IDLE, Error.ABORT)
    assert status.flags & Flag.ABORT
    assert status.counts[0] == net_steps(board)
    assert status.known == 0b11111
    host.hello(2)
    refused = host.ask(protocol.jog(0, (100, 0, 0, 0, 0)), protocol.Ack)
    assert refused.error == Error.ABORT
    board.control("pin A0 z")
    host.run(0.02)
    host.hello(3)
    move_x(host, status.counts[0], 100)
    assert host.rest().counts[0] == status.counts[0] + 100


# The line


@pytest.mark.parametrize("opened", [True, False])
def test_every_question_of_many_at_once_is_answered_or_told_lost(board: EmulatedBoard, opened: bool) -> None:
    host = BareHost(board)
    if opened:
        host.hello(7)
    replies = host.run(0.2, protocol.encode_frame(protocol.status_query(1)) * 30)
    answers = [r for r in replies if isinstance(r, protocol.Status)]
    acks = [r for r in replies if isinstance(r, protocol.Ack)]
    assert len(answers) == 30 or acks
    assert all((t.error, t.detail) == ((0, Error.SPILL) if opened else (Error.NO_SESSION, 0)) for t in acks)
    # as many as the credit in bytes lets a host ask at once are answered
    replies = host.run(0.2, b"\0" + protocol.encode_frame(protocol.status_query(2)) * 18)
    assert [r.tag for r in replies if isinstance(r, protocol.Status)].count(2) == 18


# Jog


def test_jog_stops_when_the_host_falls_silent(board: EmulatedBoard) -> None:
    host = ready_host(board)
    for _ in range(5):
        host.order(protocol.jog(0, (4000, -2000, 0, 0, 0)))
        host.run(0.08)
    assert host.status().state == State.JOGGING
    begin = net_steps(board)
    host.run(0.5)
    status = host.status()
    assert (status.state, status.error) == (State.IDLE, 0)
    # 250 ms of dead-man, 24 ms of queue, 25 ms of ramp
    assert 4000 * 0.1 < net_steps(board) - begin < 4000 * 0.4
    assert status.counts[:2] == (net_steps(board), net_steps(board, "Y"))
    assert abs(status.counts[0] + 2 * status.counts[1]) <= 2


# Servos


def test_a_servo_is_silent_until_consent_then_ramps() -> None:
    with EmulatedBoard("uno_servos", speed="step", trace=True) as board:
        board.run(0.02)
        host = BareHost(board)
        host.configure(image_for("uno_servos"), dict.fromkeys(range(6), 1500))
        host.run(0.3)
        assert all(s["pulses"] == 0 for s in board.stats()["servos"].values())
        host.order(protocol.enable(0, 2))
        host.run(0.2)
        board.control("clear")
        host.run(0.5)
        for servo in board.stats()["servos"].values():
            assert servo["pulses"] >= 24
            assert abs(servo["width_min_us"] - 1500) < 1
            assert abs(servo["width_max_us"] - 1500) < 1
            assert abs(servo["period_min_us"] - 20_000) < 300
        work = (whole_steps(400, 16_000, 0, (400, -400)), whole_steps(400, 8000, 0, (100, 0)))
        host.order(Batch((0, 1), (1500, 1500), work, at_rest=True).payload(0))
        host.run(0.4)
        host.status()  # or half a second of silence would be a hold
        host.run(0.35)
        cycles, levels = board.trace().edges(next(iter(board.stats()["servos"])))
        rises, falls = cycles[levels == 1], cycles[levels == 0]
        falls = falls[falls > rises[0]][: len(rises)]
        widths = (falls - rises[: len(falls)]) / CLOCK * 1e6
        assert abs(widths[-1] - 2000) < 1
        assert (np.diff(widths) > -2).all()  # 1000 us/s: 20 us from pulse to pulse
        assert np.diff(widths).max() < 23
        assert host.rest().counts[:2] == (2000, 1100)
