"""The simulated board's motors: a queue of segments run in simulated time, holds, homing, jogging.

The counts are exact to the tick; what the firmware does every millisecond happens every millisecond here.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate

from armkin.board.firmware.protocol import BLOCK, HALF, STEP, AxisImage, Error, Image, RowImage, Segment, State

_STANDING = 0.001  # [s] time to a stop at which a hold stands still
_TOO_FAST = 0.030  # [s] time to a stop from which an abrupt stop loses steps
_DEAD_MAN = 0.250  # [s]
_DEBOUNCE = 0.004  # [s]


def within(lower: int, upper: int, before: int, after: int) -> bool:
    """The limit rule: inside, or not farther outside than before."""
    if after < lower:
        return after >= before
    return after <= upper or after <= before


def row_value(row: RowImage, counts: list[int]) -> int:
    """Sum of weight x count."""
    return sum(w * c for w, c in zip(row.weight, counts, strict=True))


def intervals(s: Segment) -> Iterator[int]:
    """Cycles before every tick, as the device adds them up."""
    interval, add = s.interval << 16, s.add * 256
    for tick in range(1, s.ticks + 1):
        yield interval >> 16
        interval += add >> 8
        if (s.ticks - tick) % BLOCK == 0:
            add += s.bend * 4


@dataclass
class Queued:
    """A segment with a step for every axis of the board."""

    segment: Segment
    end: bool
    times: list[int] = field(default_factory=list)  # cycles from its start to each tick, made when it runs

    def start(self) -> None:
        """Get ready to run."""
        s = self.segment
        self.times = list(accumulate(intervals(s)))


class Motors:
    """Queue, counts and state of the axes."""

    def __init__(self, axes: int, clock: int, slots: int, switch: Callable[[int], bool]) -> None:
        self.clock, self.slots = clock, slots
        self.image = Image(tuple(AxisImage() for _ in range(axes)))
        self.state = State.IDLE
        self.known = 0
        self.base = [0] * axes  # counts at the running segment's start
        self._fraction = [HALF] * axes  # and how far the axes are beyond them, 2^-23 step
        self.net = [0] * axes  # steps since power-on: what the arm feels
        self.plan = [HALF] * axes  # places where the queue ends, 2^-23 step
        self.latch = [0] * axes
        self.latched = False  # page 1 holds the latch of a finished HOME
        self._switch = switch  # level of an input
        self._queue: deque[Queued] = deque()
        self._at = 0.0  # cycles since the running segment's start
        self._hold = 0.0  # [s] time to a stop that the hold allows
        self._cruise: Iterator[None] | None = None  # homing or jogging, a step a millisecond
        self._rate = [0] * axes
        self._share = 0.0
        self._jog_until = 0.0
        self._wanted: list[int] = []
        self._now = 0.0
        self.fault: Callable[[Error], None] = lambda error: None  # set by the board

    # Queue

    @property
    def free(self) -> int:
        """Free queue slots."""
        return self.slots - len(self._queue)

    def queued(self) -> int:
        """Milliseconds of motion in the queue, the running segment counted whole."""
        units = sum(q.segment.units() for q in self._queue)
        return min(units * 256 * 1000 // self.clock, 65535)

    def plan_counts(self) -> list[int]:
        """Counts where the queue ends."""
        return [p >> 23 for p in self.plan]

    def append(self, segments: list[Segment], at_rest: bool) -> None:
        """Queue segments (a step for every axis), the last one ending at rest or not."""
        for i, segment in enumerate(segments):
            self._queue.append(Queued(segment, at_rest and i + 1 == len(segments)))
            self.plan = [p + segment.ticks * r for p, r in zip(self.plan, segment.rates, strict=True)]
        if at_rest:
            self.plan = [p // STEP * STEP + HALF for p in self.plan]
        if self.state == State.IDLE:
            self.state = State.MOVING
            self._begin()

    def counts(self) -> list[int]:
        """Steps that the pins have made."""
        return [b + m for b, m in zip(self.base, self._made(), strict=True)]

    def place(self, counts: dict[int, int]) -> None:
        """Say what counts are, at rest."""
        for axis, count in counts.items():
            self.base[axis], self.plan[axis] = count, count * STEP + HALF
            self.known |= 1 << axis

    def rest_at(self, counts: list[int]) -> None:
        """Stand there."""
        self.base = list(counts)
        self._rest()

    def velocity(self) -> list[float]:
        """Every axis's velocity just now, in any unit."""
        if self._cruise is not None:
            return [r * self._share for r in self._rate]
        return [float(r) for r in self._queue[0].segment.rates] if self._queue else [0.0] * len(self.base)

    def stop(self) -> None:
        """Come to rest along the path, or along the vector of homing and jogging."""
        if self.state == State.MOVING:
            self.state, self._hold = State.HOLDING, self._stop_time()
        elif self.state in (State.HOMING, State.JOGGING):
            self.state = State.HOLDING

    def cut(self) -> None:
        """Stop dead, as a reset does."""
        made = self._made()
        self._settle(made)
        self._rest()

    def advance(self, seconds: float) -> None:
        """Let at most a millisecond pass."""
        self._now += seconds
        if self._cruise is not None:
            if next(self._cruise, self) is self:
                self._cruise = None
                self._rest()
        elif self.state == State.MOVING:
            self._run(seconds)
            if self.state == State.MOVING and self._dry():
                self.fault(Error.DRY)
        elif self.state == State.HOLDING:
            self._hold -= seconds
            plan = self._stop_time()
            if self._hold < _STANDING:
                self.cut()
            else:
                self._run(seconds * min(1.0, self._hold / plan if plan else 1.0))

    # Running segments

    def _begin(self) -> None:
        self._at = 0.0
        if self._queue:
            self._queue[0].start()

    def _made(self) -> list[int]:
        if not self._queue or not self._queue[0].times:
            return [0] * len(self.base)
        s, ticks = self._queue[0].segment, bisect_right(self._queue[0].times, self._at)
        return [(f + ticks * r) >> 23 for f, r in zip(self._fraction, s.rates, strict=True)]

    def _settle(self, made: list[int]) -> None:
        self.base = [b + m for b, m in zip(self.base, made, strict=True)]
        self.net = [b + m for b, m in zip(self.net, made, strict=True)]

    def _run(self, seconds: float) -> None:
        self._at += seconds * self.clock
        while self._queue and self._at >= self._queue[0].times[-1]:
            fast = self._stop_time()
            last = self._queue.popleft()
            places = [f + last.segment.ticks * r for f, r in zip(self._fraction, last.segment.rates, strict=True)]
            self._settle([p >> 23 for p in places])
            self._fraction = [HALF if last.end else p % STEP for p in places]
            rest = self._at - last.times[-1]
            self._begin()
            self._at = rest
            if not self._queue:
                self._arrive(last, fast)

    def _arrive(self, last: Queued, fast: float) -> None:
        if not last.end:
            if fast > _TOO_FAST:
                self.known &= ~sum(1 << i for i, r in enumerate(last.segment.rates) if r)
            if self.state == State.MOVING:
                self.state = State.HOLDING
                self.fault(Error.DRY)
        self._rest()

    def _rest(self) -> None:
        self._queue.clear()
        self._at = 0.0
        self._cruise = None
        self._share = 0.0
        self._fraction = [HALF] * len(self.base)
        self.plan = [count * STEP + HALF for count in self.base]
        self.state = State.IDLE

    def _stop_time(self) -> float:
        """u of PROTOCOL.md, section 7: the time that the arm needs to stop from its present speed."""
        if not self._queue or not self._queue[0].times:
            return 0.0
        now = self._queue[0]
        tick = min(bisect_right(now.times, self._at), len(now.times) - 1)
        interval = now.times[tick] - (now.times[tick - 1] if tick else 0)
        return self._brake(now.segment, interval)

    def _brake(self, segment: Segment, interval: int) -> float:
        rate = self.clock / (STEP * interval)
        limits = zip(segment.rates, self.image.axes, strict=True)
        return max((abs(n) * rate / axis.max_accel for n, axis in limits if n), default=0.0)

    def _dry(self) -> bool:
        if not self._queue or self._queue[-1].end:
            return False
        rest = sum(q.segment.units() * 256 for q in self._queue) - self._at
        u = self._stop_time()
        return rest / self.clock < u + u / 32 + 0.002

    # Homing and jogging: a vector of rates, of which a share between 0 and 1 is run

    def jog(self, rate: list[int]) -> None:
        """Move with this vector for another 250 ms."""
        self._wanted, self._jog_until = rate, self._now + _DEAD_MAN
        if self.state == State.IDLE:
            self.state = State.JOGGING
            self._cruise = self._jogging()

    def home(
        self, switch: int, closed: bool, slow: float, backoff: int, travel: int, time: float, rate: list[int]
    ) -> None:
        """Look for a switch along this vector."""
        self.known &= ~sum(1 << i for i, r in enumerate(rate) if r)
        self.state, self.latched = State.HOMING, False
        self._cruise = self._homing(switch, closed, slow, backoff, travel, self._now + time, rate)

    def _vector(self, rate: list[int]) -> None:
        self._rate, self._share = rate, 0.0
        self._done, self._far = [0.0] * len(rate), 0.0

    def _glide(self, target: float) -> None:
        """One millisecond with the share on its way to `target`."""
        slope = min((self.image.axes[i].max_accel / abs(r) for i, r in enumerate(self._rate) if r), default=1e9)
        before, step = self._share, slope * 0.001
        self._share = min(before + step, target) if target > before else max(before - step, target)
        moved = (before + self._share) / 2 * 0.001
        self._far += moved * max(abs(r) for r in self._rate)
        total = [d + r * moved for d, r in zip(self._done, self._rate, strict=True)]
        steps = [int(t) - int(d) for t, d in zip(total, self._done, strict=True)]
        self._done = total
        self._settle(steps)

    def _jogging(self) -> Iterator[None]:
        while True:
            self._vector(self._wanted)
            if not any(self._rate):
                return
            while self.state == State.JOGGING and self._now < self._jog_until and self._wanted == self._rate:
                if not self._clear():
                    self._jog_until = 0.0
                    break
                self._glide(1.0)
                yield
            while self._share > 0:
                self._glide(0.0)
                yield
            if self.state != State.JOGGING or self._now >= self._jog_until:
                return

    def _clear(self) -> bool:
        """Whether the arm, were it to brake after the next millisecond, would stay within its limits."""
        slope = min(self.image.axes[i].max_accel / abs(r) for i, r in enumerate(self._rate) if r)
        share = min(self._share + slope * 0.001, 1.0)
        ahead = share * 0.001 + share * share / (2 * slope) + share * 0.001
        there = [b + round(r * ahead + (r > 0) - (r < 0)) for b, r in zip(self.base, self._rate, strict=True)]
        for i, axis in enumerate(self.image.axes):
            if self._rate[i] and self.known >> i & 1 and not within(axis.lower, axis.upper, self.base[i], there[i]):
                return False
        for row in self.image.rows:
            if all(self.known >> i & 1 for i, w in enumerate(row.weight) if w) and not within(
                row.lower, row.upper, row_value(row, self.base), row_value(row, there)
            ):
                return False
        return True

    def _homing(
        self, switch: int, closed: bool, slow: float, backoff: int, travel: int, end: float, rate: list[int]
    ) -> Iterator[None]:
        back = [-r for r in rate]

        def pressed() -> bool:
            return self._switch(switch) == closed

        def slide(
            vector: list[int], share: float, done: Callable[[], bool], limit: int, error: Error
        ) -> Iterator[bool]:
            """Move until `done`, then to rest; its value: whether it went well."""
            self._vector(vector)
            fine = True
            while self.state == State.HOMING and not done():
                if self._far > limit or self._now > end:
                    self.fault(Error.TIME if self._now > end else error)
                    fine = False
                    break
                self._glide(share)
                yield True
            while self._share > 0:
                self._glide(0.0)
                yield True
            yield fine and self.state == State.HOMING

        def debounced(level: bool) -> Callable[[], bool]:
            since = [-1.0]
            at: list[list[int]] = [[]]

            def check() -> bool:
                if pressed() != level:
                    since[0] = -1.0
                elif since[0] < 0:
                    since[0], at[0] = self._now, list(self.base)
                steady = since[0] >= 0 and self._now - since[0] >= _DEBOUNCE
                if steady:
                    self.latch = at[0]
                return steady

            return check

        beyond = [0]  # counts past the edge that the first approach came to rest at

        def braking() -> bool:
            slope = min(self.image.axes[i].max_accel / abs(r) for i, r in enumerate(rate) if r)
            leader = max(range(len(rate)), key=lambda i: abs(rate[i]))
            if self._far == 0:
                beyond[0] = abs(self.base[leader] - self.latch[leader])
            return self._far + self._share**2 / (2 * slope) * abs(rate[leader]) >= backoff + beyond[0]

        phases: list[tuple[list[int], float, Callable[[], bool], int, Error]] = []
        if pressed():
            phases.append((back, slow, debounced(False), 2 * backoff, Error.SWITCH))
        phases.append((rate, 1.0, debounced(True), travel, Error.TRAVEL))
        phases.append((back, 1.0, braking, 2**31, Error.SWITCH))
        phases.append((rate, slow, debounced(True), 2 * backoff, Error.SWITCH))
        for i, phase in enumerate(phases):
            if i + 1 == len(phases) and pressed():
                self.fault(Error.SWITCH)
                return
            fine = True
            for fine in slide(*phase):
                if fine:
                    yield
            if not fine:
                return
        self.latched = True
