"""A planned curve on the compiled firmware, in simulated time: steps, holds and a cut cable, read from the pins.

`tests/bench/bench_firmware.py --curves` prints the figures, `test_path_on_pins.py` holds samples of them to their bars.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bare_host import BareHost, Batch, cut_batches
from emulator import EmulatedBoard, Trace

import armkin
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.segments.counts_to_segments import CLOCK_RATE
from armkin.board.firmware.segments.straight_lines import straight_line
from armkin.board.firmware.segments.trajectory_to_counts import cut_trajectory
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import HALF, STEP, Segment, State
from armkin.formula.arrays import Array
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.trajectory import Trajectory

CIRCLE: dict[str, Any] = {"start": {"point": [350, 0, 300]}, "moves": [{"circle": {"centre": [300, 0, 300]}}]}
WINDOW = 0.1  # [s] in which an acceleration is read from edges


@dataclass(frozen=True)
class Laid:
    """The curve of a plan as frames, and where it is."""

    plan: armkin.PathPlan
    curve: Curve
    segments: list[Segment]
    work: list[Batch]
    start: list[int]

    @property
    def arm(self) -> armkin.Arm:
        return self.plan.arm

    def off(self, counts: Array) -> Array:
        """Distance [mm] of the tip at counts (N, motors) from the curve."""
        tip = armkin.fk(self.arm, armkin.joints(self.arm, counts))[:, :3, 3]
        way = armkin.fk(self.arm, self.curve.evaluate(np.linspace(0.0, self.curve.duration, 2000)))[:, :3, 3]
        distance = np.full(len(tip), np.inf)
        near = np.array([((way - p) ** 2).sum(axis=1).argmin() for p in tip])
        for a in (np.maximum(near - 1, 0), np.minimum(near, len(way) - 2)):  # the chords on either side
            along = way[a + 1] - way[a]
            f = ((tip - way[a]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
            foot = way[a] + np.clip(f, 0.0, 1.0)[:, None] * along
            distance = np.minimum(distance, np.linalg.norm(tip - foot, axis=1))
        return distance


def lay_curve(moves: dict[str, Any], size: int = 4) -> Laid:
    """Plan moves whose last stretch is a curve, cut that into frames of three_dof's board."""
    arm = armkin.load("three_dof")
    plan = armkin.path(arm, moves)
    curve = plan.motion.stretches[-1]
    assert isinstance(curve, Curve)
    start = armkin.pulses(arm, curve.start)
    board = configure(arm).board
    laid = cut_trajectory(
        Trajectory(arm, curve.start, (curve,)), start, clock=board.clock, min_interval=board.min_interval
    )
    [move] = laid.moves()
    segments = list(move.segments)
    work = cut_batches((0, 1, 2), start.tolist(), segments, size, brake=move.brake)
    return Laid(plan, curve, segments, work, start.tolist())


def ready_host(board: EmulatedBoard, laid: Laid) -> BareHost:
    """The board configured for the arm, which stands at the curve's start."""
    host = BareHost(board)
    host.run(0.02)
    configuration = configure(laid.arm)
    host.setup(configuration.image, dict(enumerate(laid.start)))
    board.control("clear")
    return host


def predicted_steps(segments: Sequence[Segment], start: Sequence[int]) -> list[Array]:
    """When every motor steps by PROTOCOL.md's arithmetic: cycles since the motion's begin, for each motor."""
    cycle = 0
    places = np.array([count * STEP + HALF for count in start])
    rises: list[list[Array]] = [[] for _ in start]
    for s in segments:
        j = np.arange(1, s.ticks + 1)
        bends = 128 * s.bend * (j[:-1] > 0) if s.quick else 4 * s.bend * ((s.ticks - j[:-1]) % 16 == 0)
        grown = np.concatenate([[0], np.cumsum(bends)])
        change = (256 * s.add + grown) >> 8
        interval = np.concatenate([[s.interval << 16], (s.interval << 16) + np.cumsum(change[:-1])])
        ticks = cycle + np.cumsum(interval >> 16)
        for k, rate in enumerate(s.rates):
            count = (places[k] + rate * np.arange(s.ticks + 1)) // STEP
            rises[k].append(ticks[np.diff(count) != 0])
        places += s.ticks * np.array(s.rates)
        cycle = int(ticks[-1])
    return [np.concatenate(steps) for steps in rises]


@dataclass(frozen=True)
class Run:
    """A whole curve."""

    exact: bool  # counts, pins and plan agree at the end
    overruns: int
    violations: int
    error: int
    late_us: float  # a step's distance from PROTOCOL.md's arithmetic, at most
    off_mm: float  # the tip's from the curve, at most, at any step
    segments_a_second: float


def whole_run(laid: Laid) -> Run:
    """Stream it all, then look at every edge."""
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as board:
        host = ready_host(board, laid)
        status = host.stream(laid.work, poll=0.05)
        stats, trace = board.stats(), board.trace()
        axes = [stats["axes"][name] for name in "XYZ"]
        end = list(laid.work[-1].end)
        exact = list(status.counts[:3]) == end and [c + a["net"] for c, a in zip(laid.start, axes, strict=True)] == end
        return Run(
            exact,
            status.overruns,
            sum(sum(a["violations"].values()) for a in axes),
            status.error,
            late_us(trace, predicted_steps(laid.segments, laid.start)),
            float(laid.off(counts_of(trace, laid.start)[1][::7]).max()),
            len(laid.segments) / laid.curve.duration,
        )


def late_us(trace: Trace, expected: Sequence[Array]) -> float:
    """A step's distance [us] from when it is wanted, at most; infinite if there are more steps or fewer."""
    measured = [trace.rises(f"{name}.STEP") for name in "XYZ"]
    if [len(x) for x in measured] != [len(x) for x in expected]:
        return float(np.inf)
    apart = np.concatenate([a - b for a, b in zip(measured, expected, strict=True)])
    return float(np.ptp(apart)) / 2 / CLOCK_RATE * 1e6  # the motion's begin is that which makes it least


def counts_of(trace: Trace, start: Sequence[int]) -> tuple[Array, Array]:
    """Cycle of every step, and all counts after it: (N,), (N, 3)."""
    steps = [trace.steps(name) for name in "XYZ"]
    cycle = np.concatenate([c for c, _ in steps])
    change = np.zeros((len(cycle), 3), np.int64)
    begin = 0
    for k, (c, direction) in enumerate(steps):
        change[begin : begin + len(c), k] = direction
        begin += len(c)
    order = np.argsort(cycle, kind="stable")
    return cycle[order], np.asarray(start) + np.cumsum(change[order], axis=0)


@dataclass(frozen=True)
class Held:
    """A curve that ended before its end."""

    known: bool  # the board says it knows where it stands, and that is what the pins made
    off_mm: float  # how far from the curve it stands
    off_way_mm: float  # and how far the tip was at most, from the first step on
    accel: float  # greatest acceleration of a joint while it slowed down, as a share of its max_accel
    goes_on: bool  # the next motion, back to the curve's start, ends at exact counts
    milliseconds: float  # to a stop, from the cause


def hold_curve(laid: Laid, share: float, *, cable: bool = False) -> Held:
    """HOLD, or no more bytes in either direction (cable), after a share of the curve's time."""
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as board:
        host = ready_host(board, laid)
        moment = share * laid.curve.duration
        _stream_until(host, laid.work, moment)
        begin = board.control("cycles")["cycle"]
        if not cable:
            host.run(0.0, protocol.encode_frame(protocol.hold(0)))
        host.run(1.6)
        status = host.rest()
        trace = board.trace()
        cycle, counts = counts_of(trace, laid.start)
        rest_counts = np.array(status.counts[:3])
        if cable:  # the board notices 500 ms after the last byte
            begin = int(trace.edges("uart.in")[0][trace.edges("uart.in")[0] <= begin][-1]) + CLOCK_RATE // 2
        is_known = bool((rest_counts == counts[-1]).all()) and (status.known & 0b111) == 0b111
        accel = _greatest_acceleration(laid.arm, trace, laid.start, begin)
        host.hello(77)
        host.order(protocol.enable(0, 3))
        goal = laid.start if (rest_counts != laid.start).any() else [count + 200 for count in laid.start]
        after = host.stream(_straight_batches(rest_counts.tolist(), goal))
        return Held(
            is_known,
            float(laid.off(rest_counts[None])[0]),
            float(laid.off(counts[::7]).max()),
            accel,
            list(after.counts[:3]) == goal and after.error == 0,
            float(cycle[-1] - begin) / CLOCK_RATE * 1e3,
        )


def _stream_until(host: BareHost, work: Sequence[Batch], moment: float) -> None:
    """Stream batches as `BareHost.stream` does, and stop talking so long [s] after the motion began."""
    begun: float | None = None
    free, sent, acknowledged = host.status().free, 0, 0
    first = host.sequence
    time_asked = host.time
    while begun is None or host.time < begun + moment:
        frame = b""
        under_way = sum(len(b.segments) for b in work[acknowledged:sent])
        if sent < len(work) and sent == acknowledged and under_way + len(work[sent].segments) <= free:
            frame = protocol.encode_frame(work[sent].payload((first + sent) % 256))
            sent += 1
        elif host.time > time_asked + 0.01:
            frame, time_asked = protocol.encode_frame(protocol.status_query(1)), host.time
        for reply in host.run(0.5e-3, frame):
            if isinstance(reply, protocol.Info):
                continue
            acknowledged += (reply.next - (first + acknowledged)) % 256
            free = reply.free
            assert reply.error == 0, reply
            if begun is None and reply.state == State.MOVING:
                begun = host.time
    host.sequence = (first + acknowledged) % 256


def _straight_batches(start: list[int], end: list[int]) -> list[Batch]:
    """A straight joint move between counts."""
    move = straight_line(start, end, 1.0, 2.0)
    return cut_batches((0, 1, 2), start, list(move.segments), 4)


def _greatest_acceleration(arm: armkin.Arm, trace: Trace, start: Sequence[int], begin: int) -> float:
    """Greatest acceleration of a joint after a cycle, as a share: parabolas fitted to the edges of WINDOW.

    An edge says where a motor is exactly: on the border between two counts.
    """
    gain = arm.motor_gain
    assert np.count_nonzero(gain) == arm.n, "one motor a joint"
    worst = 0.0
    for k, name in enumerate("XYZ"):
        cycle, direction = trace.steps(name)
        place = start[k] + np.cumsum(direction) - np.where(direction > 0, 0, -1)
        t = cycle / CLOCK_RATE
        joint = int(np.abs(gain[k]).argmax())
        last = t[-1]
        for a in np.arange(begin / CLOCK_RATE, last - WINDOW, WINDOW / 20):
            inside = (t >= a) & (t <= a + WINDOW)
            if inside.sum() < 12:
                continue
            fit = np.polyfit(t[inside] - a - WINDOW / 2, place[inside], 2)
            worst = max(worst, float(abs(2 * fit[0] / gain[k, joint]) / arm.max_accel[joint]))
    return worst
