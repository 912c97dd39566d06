"""Speed and acceleration at every tick of the segments' own arithmetic, and in 100 ms of steps; and the board's checks.

From the fastest motor's first step to its last: before that no motor tells how it got there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from armkin.board.firmware.segments import counts_to_segments, straight_lines
from armkin.board.firmware.segments.straight_lines import Pieces
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.firmware.streaming import delay_segment
from armkin.board.firmware.wire.protocol import BLOCK, HALF, STEP, AxisImage, Image, Segment
from armkin.board.sim.frame_fields import RefusedError
from armkin.board.sim.rate_checks import Velocity, times_valid
from armkin.board_catalogue import BOARDS
from armkin.model import build_arm as arms
from armkin.motion.timing.profile import Profile, trapezoid
from armkin.motors import pulses

CLOCKS = {"three_dof": (16_000_000, 448), "ar4_pico6": (25_000_000, 100), "parol6_pico6": (25_000_000, 100)}


def intervals(s: Segment) -> NDArray[np.float64]:
    """Cycles before every tick, as PROTOCOL.md adds them up, before each is cut to whole ones."""
    left = s.ticks - np.arange(1, s.ticks + 1)
    more, block = (128 * s.bend, 1) if s.quick else (4 * s.bend, BLOCK)
    add = s.add * 256 + more * np.concatenate([[0], np.cumsum(left % block == 0)[:-1]])
    return np.asarray(s.interval + np.concatenate([[0], np.cumsum(add >> 8)[:-1]]) / 65536)


@pytest.mark.parametrize(("quick", "bend"), [(False, 64), (True, 2)])  # by which `add` grows by one
def test_a_bend_counts_in_the_last_interval_as_often_as_the_device_adds_it_up(quick: bool, bend: int) -> None:
    for ticks in (*range(1, 70), 255, 256, 1024):
        segment = Segment(ticks, 1000, 0, (0,), bend, quick)
        last = intervals(segment)[-1] - segment.interval
        assert counts_to_segments._bend_count(ticks, quick) == round(65536 * last)


def unheard_cycles(cut: list[Segment]) -> float:
    """Cycles by which a line is ahead of its law, as nobody can tell before its first step."""
    first = cut[0]
    is_heard = first.add or any(first.steps)
    return 0.0 if is_heard else first.ticks * first.interval * (1 / straight_lines.UNHEARD_SHARE - 1)


def leaders_limits(cut: list[Segment], law: Profile, steps: int, axis: int, clock: int) -> tuple[float, float, float]:
    """Greatest speed and acceleration at a tick, as shares of the law's; greatest jump between segments, in its bound.

    A segment begins with a whole number of cycles, and a rate of 2^-15 step: what these two can miss at both sides of
    a seam, and 0.8 % that are left to the seams so that the acceleration within is not exceeded, are the jump's bound.
    """
    top, accel = law.peak * steps / law.length, law.accel * steps / law.length
    first = math.sqrt(1 / accel)  # half a step from rest
    cycle = unheard_cycles(cut)
    before, speed, most, jump = 0.0, 0.0, 0.0, 0.0
    for s in cut:
        cycles, rate = intervals(s), abs(s.rates[axis])
        v = rate / STEP / cycles * clock
        begin = (cycle + np.concatenate([[0], np.cumsum(cycles)[:-1]])) / clock
        cruising = (begin > first) & (begin < law.duration - first)
        speed = max(speed, float(v[cruising].max(initial=0.0)) / top)
        change = np.abs(np.diff(v)) / (cycles[1:] + cycles[:-1]) * 2 * clock
        if s.ticks > 2 and abs(s.add) * s.ticks > 3 << 16:  # less spreads whole cycles over a cruise
            most = max(most, float(change[cruising[1:]].max(initial=0.0)) / accel)
        if cruising[0] and before:
            bound = 4 / cycles[0] + (256 if rate >= 1 << 15 else 2) / max(rate, 1) + 0.008
            jump = max(jump, abs(v[0] / before - 1) / bound)
        cycle, before = cycle + float(cycles.sum()), float(v[-1])
    return speed, most, jump


def step_times(cut: list[Segment], axis: int, clock: int) -> NDArray[np.float64]:
    """Seconds at which an axis steps."""
    edge_times, cycle, place = [], 0, HALF
    for s in cut:
        tick_cycles = cycle + np.cumsum(np.floor(intervals(s)).astype(np.int64))
        counts = (place + s.rates[axis] * np.arange(s.ticks + 1)) // STEP
        edge_times.append(tick_cycles[np.diff(counts) != 0])
        cycle, place = int(tick_cycles[-1]), place + s.ticks * s.rates[axis]
    return np.concatenate(edge_times) / clock


def window_maxima(made: NDArray[np.float64], seconds: float) -> tuple[float, float]:
    """Greatest speed and acceleration that the steps in a window tell: a parabola through its ends and its middle."""
    last = np.searchsorted(made, made + seconds)
    k = np.flatnonzero((last < len(made)) & (last - np.arange(len(made)) >= 8))
    if not len(k):
        return 0.0, 0.0
    b = last[k]
    m = (k + b) // 2
    u, w = (m - k) / (made[m] - made[k]), (b - m) / (made[b] - made[m])
    accel = (w - u) / ((made[b] - made[k]) / 2)
    return float(((b - k) / (made[b] - made[k])).max()), float(np.abs(accel).max())


def random_moves(name: str, count: int, seed: int) -> Iterator[tuple[list[Segment], Profile, NDArray[np.int64], int]]:
    """Random moves of a shipped arm at 1 to 100 % of its speed."""
    arm = arms.load_arm(f"robots/{name}.yaml")
    clock, least = CLOCKS[name]
    rng = np.random.default_rng(seed)
    for _ in range(count):
        q = rng.uniform(0.95 * arm.lower + 0.05 * arm.upper, 0.05 * arm.lower + 0.95 * arm.upper, (2, arm.n))
        q[1] = q[0] + (q[1] - q[0]) * 10 ** min(rng.uniform(-2, 1), 0.0)
        speed = 10 ** rng.uniform(-2, 0)
        cut = plan_moves(arm, pulses(arm, q[0]), q[1], speed=speed, clock=clock, min_interval=least)
        move = next(cut.moves())
        law = cut.trajectory.stretches[0].law  # type: ignore[attr-defined]
        yield list(move.segments), law, move.end - move.start, clock


@pytest.mark.parametrize("name", CLOCKS)
def test_no_tick_is_faster_or_speeds_up_faster_than_102_percent(name: str) -> None:
    for cut, law, span, clock in random_moves(name, 12, 3):
        axis = int(np.abs(span).argmax())
        steps = int(abs(span[axis]))
        speed, accel, jump = leaders_limits(cut, law, steps, axis, clock)
        assert speed <= 1.02
        assert accel <= 1.02
        assert jump <= 1.0
        fastest, hardest = window_maxima(step_times(cut, axis, clock), 0.1)
        assert fastest <= 1.02 * law.peak * steps / law.length
        # one tick's time at each of the window's ends and its middle
        tick = max(float(intervals(s).max()) for s in cut[1:-1]) / clock if len(cut) > 2 else 0.0
        assert hardest <= 1.02 * law.accel * steps / law.length + 8 * tick * fastest / 0.1**2


@pytest.mark.parametrize(("pieces", "most"), [(Pieces.FEW, 1.08), (Pieces.ROUGH, 1.1)])
def test_fewer_pieces_keep_to_their_bound(pieces: Pieces, most: float) -> None:
    for ramp in (0.05, 0.2, 0.5):
        n = round(20_000 * ramp)
        law = trapezoid(1.0, 1 / (1.5 * ramp), 1 / (1.5 * ramp) / ramp)  # a cruise of half a ramp
        move = straight_lines.line_segments([0, 0], [n, -n // 7], law, min_interval=448, pieces=pieces)
        assert leaders_limits(list(move.segments), law, n, 0, 16_000_000)[1] <= most


def board_refusal(end: list[int], rate: float, accel: float, pause: float = 0.0) -> str:
    """What the board says of a line from 0 that just keeps to its motors' bounds; n: counts/s and /s^2 of the first.

    pause: [s] that it waits for its queue in the segment before its first step, if it has one.
    """
    n = end[0]
    bounds = [[max(1, math.ceil(most * abs(x) / n)) for x in end] for most in (rate * 1.05, accel)]
    images = [AxisImage(True, False, -n, n, 0, v, a) for v, a in zip(*bounds, strict=True)]
    velocity = Velocity(BOARDS["uno_cnc_shield"]._replace(min_interval=448), Image(tuple(images)))
    try:
        cut = list(straight_lines.straight_line([0] * len(end), end, rate / n, accel / n, min_interval=448).segments)
        cut[0] = delay_segment(cut[0], pause, 16_000_000) or cut[0]
        for s in cut:
            if not times_valid(s, 448):
                return f"INTERVAL {s}"
            velocity.begin(s)
            for axis, made in enumerate(s.rates):
                velocity.check(axis, made)
        for axis in range(len(end)):
            velocity.check_rest(axis)
    except RefusedError as error:
        return f"{error}"
    return ""


# Found by tens of thousands of random lines: cruises of 28 us and of 10 ms behind ramps of 10 s, a motor of 4 counts.
KNOWN = [
    ([18432, 8424, 17454], 1919.0133477273237, 200.0),
    ([178, -66, -27], 8437.348027901053, 400_000.0),
    ([2464, -699, -690], 563.1688978437559, 129.11828234167658),
    ([8481, -682, -1219], 844.4148250310601, 84.17790839326038),
    ([14737, 4, -11919], 190.75280249428837, 28050.01285490119),
    ([12219, -8193, 8809], 1007.2671184887614, 85.30982305536669),
    ([17513, 7, -4851], 142.20796882742303, 55345.27079899878),
    ([9584, 1, -407], 51.27830705814061, 2109.3602496129283),
]


@pytest.mark.parametrize(("end", "rate", "accel"), KNOWN)
def test_lines_that_were_refused_are_taken(end: list[int], rate: float, accel: float) -> None:
    assert board_refusal(end, rate, accel) == ""


def test_the_board_takes_random_lines() -> None:
    """RATE, ACCEL and INTERVAL in the board's integers."""
    rng = np.random.default_rng(9)
    for k in range(120):
        n, rate = int(10 ** rng.uniform(0, 3.7)), 10 ** rng.uniform(math.log10(50), math.log10(16e6 / 448))
        accel = float(np.clip(rate / 10 ** rng.uniform(-3.3, 1), 20, 400_000))
        if k % 5 == 0:  # next to no cruise
            rate = min(math.sqrt(accel * n) * rng.uniform(0.98, 1.001), 16e6 / 448)
        end = [n, int(n * rng.uniform(-1, 1)), int(n * rng.uniform(-1, 1) * 10 ** rng.uniform(-3, 0))]
        pause = 10 ** rng.uniform(-3, -1.3)
        assert board_refusal(end, rate, accel, pause) == "", (end, rate, accel, pause)


def board_takes(seconds: float, share: float, within: float) -> bool:
    """Whether the board takes pieces up to 12,000 steps/s at `share` of 20,000 steps/s^2; `within`: of their change."""
    image = Image((AxisImage(True, False, -(1 << 28), 1 << 28, 0, 20_000, 20_000),))
    velocity = Velocity(BOARDS["uno_cnc_shield"]._replace(min_interval=448), image)
    ticks = max(1, round(seconds * 16e6 / 600))
    speed, change = 10_000 * seconds, 20_000 * share * seconds
    while speed < 12_000:
        inside = within * change if speed > 2 * change else 0.0
        mean = seconds * 16e6 / ticks
        first, last = (round(mean * speed / (speed + half)) for half in (-inside / 2, inside / 2))
        add = round((last - first) / (ticks - 1) * 65536) if ticks > 1 else 0
        segment = Segment(ticks, first, add, (round(speed * mean / 16e6 * (1 << 15)) << 8,))
        velocity.begin(segment)
        try:
            velocity.check(0, segment.rates[0])
        except RefusedError:
            return False
        speed += change
    return True


@pytest.mark.parametrize("seconds", [0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05])
def test_crude_plans_at_1_3_times_max_accel_are_refused_at_any_segment_length(seconds: float) -> None:
    assert board_takes(seconds, 1.0, 0.0)
    assert board_takes(seconds, 1.2, 0.0)
    assert seconds < 0.002 or board_takes(seconds, 1.1, 0.5)  # in less, whole cycles of an interval are jumps
    for within in (0.0, 0.5, 1.0):
        assert not board_takes(seconds, 1.3, within)
        assert not board_takes(seconds, 2.48, within)
