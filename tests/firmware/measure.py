"""The quality figures of the compiled firmware, measured in the emulator in simulated time: they repeat to the cycle.

`tests/bench/bench_firmware.py` prints them, `test_quality.py` holds them to their bars.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bare_host import AXES, CLOCK, STEPPERS, WIDE, BareHost, Batch, cruise_segments, cut_batches, image_for, run_up
from emulator import BUILD, FIRMWARE, EmulatedBoard, run_make
from numpy.typing import NDArray

import armkin
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Segment, whole_steps
from armkin.motion.timing.profile import Profile

NAMES = "XYZABCUV"  # the emulator's axes, in order


def counts_at_home(board: str) -> dict[int, int]:
    """Steppers at 0, servos at 1500."""
    return {i: 0 if i < STEPPERS[board] else 1500 for i in range(AXES[board])}


def slow_elf(board: str) -> Path:
    """The firmware built for 115200 baud."""
    run_make("-C", str(FIRMWARE), f"BOARD={board}", "BAUD=115200")
    return BUILD / f"{board}-115200.elf"


@dataclass(frozen=True)
class Stepping:
    """A cruise of all steppers (one step a tick each) and a servo, under constant questions."""

    rate: float  # [Hz] measured between steps of the cruise
    jitter_us: float  # peak to peak, worst axis
    high_us: float  # shortest
    low_us: float
    dir_setup_us: float
    violations: int
    overruns: int
    exact: bool  # counts, pins and plan agree
    error: int
    stack_free: int


def measure_stepping(board: str, rate: float, seconds: float = 0.6) -> Stepping:
    """Every stepper one step a tick, alternating directions and reversing half way; the first servo moves along."""
    steppers = STEPPERS[board]
    axes = tuple(range(steppers + 1))
    share = [(-1.0) ** i for i in range(steppers)] + [100 / (rate * seconds)]
    segments_out = cruise_segments(rate, seconds, share)
    back = cruise_segments(rate, seconds, [-s for s in share])
    image = image_for(board, replace(WIDE, max_rate=60_000))
    row = protocol.RowImage(-(1 << 28), 1 << 28, (1, 1) + (0,) * (AXES[board] - 2))
    limit = replace(image.axes[0], lower=-(1 << 27), upper=1 << 27)
    image = replace(image, axes=(limit, limit, *image.axes[2:]), rows=(row,))
    with EmulatedBoard(board, speed="step", trace=True) as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        host.setup(image, counts_at_home(board))
        emulated.control("clear")
        start = [0] * steppers + [1500]
        plan = cut_batches(axes, start, segments_out, 4)
        plan += cut_batches(axes, plan[-1].end, back, 4)
        status = host.stream(plan, poll=0.01)
        stats = emulated.stats()
        named = [stats["axes"][name] for name in list(stats["axes"])[:steppers]]
        rises = emulated.trace().rises(f"{next(iter(stats['axes']))}.STEP")
        exact = (
            status.counts[: steppers + 1] == plan[-1].end
            and len(rises) > 0
            and all(figures["net"] == end for figures, end in zip(named, plan[-1].end, strict=False))
        )
        gaps = np.diff(rises)
        return Stepping(
            CLOCK / float(np.median(gaps)) if len(gaps) else 0.0,
            max(f["jitter_us"] or 0.0 for f in named),
            min(f["high_min_us"] or 0.0 for f in named),
            min(f["low_min_us"] or 0.0 for f in named),
            min(f["dir_setup_min_us"] or 1e9 for f in named),
            sum(sum(f["violations"].values()) for f in named),
            status.overruns,
            exact,
            status.error,
            stats["memory"]["stack_never_touched"],
        )


def highest_rate(board: str, rates: range, jitter_us: float = 10.0) -> float:
    """The highest of the rates at which `measure_stepping` is still without fault."""
    best = 0.0
    for rate in rates:
        measured = measure_stepping(board, rate, seconds=1.0)
        if (
            not measured.exact
            or measured.error
            or measured.overruns
            or measured.violations
            or measured.jitter_us > jitter_us
        ):
            break
        best = measured.rate
    return best


def segments_per_second(baud: int, rate: float, board: str = "uno_cnc_shield") -> tuple[float, bool]:
    """Streams short segments of four axes in ticks of 25 kHz; what came out at the pins, and whether it was all exact.

    The interval grows or falls with every tick of each, and each changes two velocities by more than half of what
    ACCEL allows. As many segments in a frame as the board takes, and enough of them that a queue would run dry.
    """
    batch, count = (15, 4000) if board == "mega_ramps14" else (8, 1500)
    ticks = round(25_000 / rate)
    interval = round(CLOCK / rate / ticks)
    ends = interval - ticks // 2, interval + ticks // 2

    def changing_segment(number: int, counts: tuple[int, ...]) -> Segment:
        """One cycle a tick longer or shorter."""
        return whole_steps(ticks, ends[number % 2], 256 * (1 - 2 * (number % 2)), counts)

    elf = slow_elf(board) if baud == 115_200 else None
    with EmulatedBoard(board, speed="step", elf=elf) as emulated:
        host = BareHost(emulated, baud)
        host.run(0.02)
        host.setup(image_for(board, replace(WIDE, max_accel=1_950_000)), counts_at_home(board))
        emulated.control("clear")
        steps = [(3 + i % 2, -3, 2 - i % 2, -1) for i in range(count)]
        steps += [(3, -2, 2, -1), (2, -1, 1, -1), (1, -1, 1, -1)]
        # a pause in front, so that the queue is full when it matters
        work = [whole_steps(100, 9600, 0, (0, 0, 0, 0))] + [
            changing_segment(i, counts) for i, counts in enumerate(steps)
        ]
        plan = cut_batches((0, 1, 2, 3), (0, 0, 0, 0), work, batch)
        status = host.stream(plan, slice_s=0.25e-3, bytes_ahead=300)  # more than it promises, but it keeps up
        x = emulated.stats()["axes"]["X"]
        seconds = (x["last_step_cycle"] - x["first_step_cycle"]) / CLOCK
        exact = (status.error, status.overruns) == (0, 0) and status.counts[:4] == plan[-1].end
        return len(steps) / seconds, exact


def first_step_ms(batch: int = 6) -> float:
    """From the end of the first batch's last byte to the first step's edge, at rest."""
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        image = image_for("uno_cnc_shield", replace(WIDE, max_accel=15_000_000))
        host.setup(image, counts_at_home("uno_cnc_shield"))
        work = [whole_steps(50, 1600, 0, (50, -50, 25, 25))] * batch
        host.order(Batch((0, 1, 2, 3), (0, 0, 0, 0), tuple(work), at_rest=True).payload(0))
        trace = emulated.trace()
        arrived, _ = trace.edges("uart.in")
        step = trace.rises("X.STEP")[0]
        return float(step - arrived[arrived < step][-1]) / CLOCK * 1e3


@dataclass(frozen=True)
class Hold:
    """A hold from full speed."""

    milliseconds: float
    ideal: float
    off_path: float  # [steps] the farthest that Y was from its share of X
    exact: bool  # the board's counts are the pins'
    known: bool


def measure_hold(rate: float = 10_000, accel: int = 50_000, cause: str = "hold") -> Hold:
    """X at `rate` counts/s, Y at half of it; then HOLD, or A0 to ground, or no more bytes from the host."""
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        image = image_for("uno_cnc_shield", replace(WIDE, max_accel=accel))
        host.setup(image, counts_at_home("uno_cnc_shield"))
        interval = round(CLOCK / rate)
        long = [whole_steps(15_000, interval, 0, (15_000, -7_500))] * 2
        ramp = run_up(rate, rate / accel, (1.0, -0.5))
        for batch in cut_batches((0, 1), (0, 0), ramp + long + ramp[::-1][:4], 6, at_rest=False):
            host.order(batch.payload(0))
        host.run(0.3)
        host.status()
        begin = emulated.control("cycles")["cycle"]
        if cause == "hold":
            host.run(0, protocol.encode_frame(protocol.hold(0)))
            begin += 10 * 8 * 64
        elif cause == "abort":
            emulated.control("pin A0 0")
        for _ in range(20):
            host.run(0.1)
        trace = emulated.trace()
        if cause == "silence":
            begin = int(trace.edges("uart.in")[0][-1]) + CLOCK // 2
        status = host.status()
        x_cycle, x = trace.positions("X")
        y_cycle, y = trace.positions("Y")
        # wherever Y steps: X's count just then, and what Y's share of it is
        x_then = x[np.searchsorted(x_cycle, y_cycle, side="right") - 1]
        deviation = np.abs(y + x_then / 2).max()
        exact = status.counts[:2] == (int(x[-1]), int(y[-1]))
        return Hold(
            float(x_cycle[-1] - begin) / CLOCK * 1e3,
            rate / accel * 1e3,
            float(deviation),
            exact,
            status.known == 0b11111,
        )


def measure_reversing(board: str, interval: int, high: int = 10) -> tuple[float, float, float, int]:
    """Every segment turns every axis round, `interval` cycles a tick, DRV8825 timing.

    Shortest DIR set-up, STEP high and low [us], violations. `high`: STEP's configured high time in 0.1 us.
    """
    steppers = STEPPERS[board]
    axes = tuple(range(steppers))
    with EmulatedBoard(board, speed="step", driver="drv8825") as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        fast = replace(WIDE, max_rate=60_000, max_accel=15_000_000)
        image = replace(image_for(board, fast), step_high=high, step_low=19, dir_setup=7, wake=2)
        host.setup(image, counts_at_home(board))
        emulated.control("clear")
        work = [whole_steps(20, interval, 0, ((-1) ** n * 20,) * steppers) for n in range(8)]
        host.order(Batch(axes, (0,) * steppers, tuple(work), at_rest=True).payload(0))
        host.run(0.1)
        figures = list(emulated.stats()["axes"].values())[:steppers]
        assert all(f["net"] == 0 and f["positive"] == 80 for f in figures), figures
        return (
            min(f["dir_setup_min_us"] for f in figures),
            min(f["high_min_us"] for f in figures),
            min(f["low_min_us"] for f in figures),
            sum(sum(f["violations"].values()) for f in figures),
        )


@dataclass(frozen=True)
class Turning:
    """Every motor turns round with every segment, a servo on, STATUS? every 10 ms."""

    exact: bool  # counts and pins agree with the plan
    error: int
    overruns: int
    violations: int  # of a DRV8825's timing
    servo_ms: float  # longest period of the servo's pulses
    late_servos: int  # as the board counts them
    stack_free: int


def measure_turning(board: str, interval: int, ticks: int = 100, count: int = 200) -> Turning:
    """`count` segments of one step a tick on every stepper, `interval` cycles a tick, each the other way."""
    steppers = STEPPERS[board]
    with EmulatedBoard(board, speed="step", driver="drv8825") as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        fast = replace(WIDE, max_rate=60_000, max_accel=15_000_000)
        image = replace(image_for(board, fast), step_high=19, step_low=19, dir_setup=7)
        host.setup(image, counts_at_home(board))
        host.run(0.1)
        emulated.control("clear")
        work = [whole_steps(100, 16_000, 0, (0,) * steppers)]  # a pause in front, while the queue fills
        work += [whole_steps(ticks, interval, 0, ((-1) ** n * ticks,) * steppers) for n in range(count)]
        plan = cut_batches(tuple(range(steppers)), (0,) * steppers, work, 6)
        status = host.stream(plan, poll=0.01, slice_s=0.25e-3)
        stats = emulated.stats()
        figures = list(stats["axes"].values())[:steppers]
        exact = status.counts[:steppers] == plan[-1].end and all(f["net"] == 0 for f in figures)
        return Turning(
            exact,
            status.error,
            status.overruns,
            sum(sum(f["violations"].values()) for f in figures),
            next(iter(stats["servos"].values()))["period_max_us"] / 1e3,
            status.late_servos,
            stats["memory"]["stack_never_touched"],
        )


@dataclass(frozen=True)
class Noise:
    """A motion of 1,000 segments over a line that flips and drops bytes in both directions."""

    exact: bool  # pins, board and plan agree at the end
    on_path: bool  # every step went the right way, within one step of the straight line
    sessions: int  # each hold for want of segments costs one
    resent: int  # frames
    seconds: float  # simulated


def measure_noise(seed: int, segments: int = 1000, rate: float = 0.01) -> Noise:
    """X, Y, Z along a line; `rate` of the bytes flipped and as many dropped, each way."""
    share = (3, -5, 2)
    with EmulatedBoard("uno_cnc_shield", speed="step", seed=seed, trace=True) as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        image = image_for("uno_cnc_shield", replace(WIDE, max_accel=1_000_000))
        host.setup(image, counts_at_home("uno_cnc_shield"), nonce=seed + 1)
        emulated.control(f"noise flip {rate} drop {rate} seed {seed} dir both")
        counts = (0, 0, 0)
        end = tuple(segments * s for s in share)
        sessions = 0
        while counts != end and sessions < 500:
            sessions += 1
            host.hello(1000 * (seed + 1) + sessions)
            left = (end[0] - counts[0]) // share[0]
            work = [whole_steps(12, 16_000, 0, share)] * left
            # first what a hold in mid-segment, and the rounding of rates, left over of the one step ratio
            remainder = tuple(e - a - left * s for e, a, s in zip(end, counts, share, strict=True))
            if any(remainder):
                work.insert(0, whole_steps(20, 16_000, 0, remainder))
            status = host.stream(
                cut_batches((0, 1, 2), counts, work, 3), resend=0.009, slice_s=2e-3, window=3, poll=0.05
            )
            counts = (status.counts[0], status.counts[1], status.counts[2])
        emulated.control("restore")
        trace = emulated.trace()
        x_cycle, x = trace.positions("X")
        on_path = True
        for axis, ratio in (("Y", -5 / 3), ("Z", 2 / 3)):
            cycle, count = trace.positions(axis)
            x_then = np.concatenate([[0], x])[np.searchsorted(x_cycle, cycle, side="right")]
            on_path &= bool((np.abs(count - ratio * x_then) <= abs(ratio) + 1.5).all())
            on_path &= bool((np.diff(count) * np.sign(ratio) > 0).all())
        net = emulated.stats()["axes"]
        exact = counts == end and tuple(net[a]["net"] for a in "XYZ") == end
        return Noise(exact, on_path and bool((np.diff(x) > 0).all()), sessions, host.resent, host.time)


@dataclass(frozen=True)
class Smooth:
    """How far step intervals of one axis are from those of the time law, ramps included."""

    axis: str
    peak_to_peak_us: float  # of the cruise
    period_us: float  # there
    worst: float  # greatest deviation of any step of the move, over max(60 us, 2 % of its period)


def measure_smoothness(speed: float) -> list[Smooth]:
    """The published move of three axes, at a share of the joints' speeds: from the edges on the pins."""
    arm = armkin.load("three_dof")
    configuration = configure(arm)
    cut = plan_moves(arm, [0, 0, 0], np.deg2rad([-30, 5, -5]), speed=speed, min_interval=448)
    move = next(cut.moves())
    work = [protocol.Segment(80, 20_000, 0, (0, 0, 0)), *move.segments]  # a pause in front, while the queue fills
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        host.setup(configuration.image, {0: 0, 1: 0, 2: 0})
        status = host.stream(cut_batches((0, 1, 2), (0, 0, 0), work, 5), give_up=400.0, poll=0.1)
        assert status.error == 0, status
        assert status.counts[:3] == tuple(cut.end.tolist())
        trace = emulated.trace()
        law = cut.trajectory.stretches[0].law  # type: ignore[attr-defined]
        return [
            _smooth_of(name, trace.rises(f"{name}.STEP") / CLOCK, int(n), law)
            for name, n in zip("XYZ", cut.end, strict=True)
        ]


def _smooth_of(name: str, seconds: NDArray[np.float64], steps: int, law: Profile) -> Smooth:
    """Intervals between an axis's steps against the trapezoid's: when it has passed 1/2, 3/2, ... steps."""
    share = (np.arange(abs(steps)) + 0.5) / abs(steps)
    ramp = law.peak / law.accel
    way = law.peak * ramp / 2
    exact = np.where(
        share < way,
        np.sqrt(2 * share / law.accel),
        np.where(
            share > 1 - way,
            law.duration - np.sqrt(2 * np.maximum(1 - share, 0) / law.accel),
            ramp + (share - way) / law.peak,
        ),
    )
    lateness, period = np.diff(seconds) - np.diff(exact), np.diff(exact)
    cruise = (exact[:-1] > ramp) & (exact[1:] < law.duration - ramp)
    return Smooth(
        name,
        float(np.ptp(lateness[cruise])) * 1e6,
        float(np.median(period[cruise])) * 1e6,
        float((np.abs(lateness) / np.maximum(60e-6, 0.02 * period)).max()),
    )
