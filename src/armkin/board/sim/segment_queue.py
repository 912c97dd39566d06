"""The simulated board's queue of segments, run in simulated time; its counts are exact to the tick."""

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate

from armkin.board.firmware.wire.protocol import HALF, STEP, Segment, count_at
from armkin.board.sim.axis_counts import Axes

_TOO_FAST = 0.030  # shortest time [s] to a stop at which an abrupt stop loses steps
_SLOW_STOP = 0.024  # longest time [s] to a stop at which the arm may stop at the queue's end


def intervals(segment: Segment) -> Iterator[int]:
    """Cycles before every tick, as the device adds them up."""
    interval, add = segment.interval << 16, segment.add * 256
    change, block = segment.growth
    for tick in range(1, segment.ticks + 1):
        yield interval >> 16
        interval += add >> 8
        if (segment.ticks - tick) % block == 0:
            add += change


def _places_after(segment: Segment, places: list[int], ticks: int | None = None) -> list[int]:
    """Places [2^-23 step] after a segment that begins at `places`, or after its first ticks."""
    ticks = segment.ticks if ticks is None else ticks
    return [place + ticks * rate for place, rate in zip(places, segment.rates, strict=True)]


@dataclass
class QueuedSegment:
    """A segment with a step for every axis of the board."""

    segment: Segment
    end: bool
    times: list[int] = field(default_factory=list)  # cycles from its start to each tick, made when it runs

    def start(self) -> None:
        """Get ready to run."""
        self.times = list(accumulate(intervals(self.segment)))


class Queue:
    """The queued segments, and the progress of the first one."""

    def __init__(self, axes: Axes, clock: int, slots: int) -> None:
        self.axes, self.clock, self.slots = axes, clock, slots
        self.plan = [HALF] * len(axes.base)  # places where the queue ends, 2^-23 step
        self._fraction = [HALF] * len(axes.base)  # how far the axes are beyond their base, 2^-23 step
        self._queue: deque[QueuedSegment] = deque()
        self._units = 0  # length of all of them, in units of 256 cycles: asked for every millisecond
        self._cycles_run = 0.0  # cycles since the running segment's start

    @property
    def free(self) -> int:
        """Free slots."""
        return self.slots - len(self._queue)

    def milliseconds(self) -> int:
        """Milliseconds of motion in the queue, the running segment counted whole."""
        return min(self._units * 256 * 1000 // self.clock, 65535)

    def plan_counts(self) -> list[int]:
        """Counts where the queue ends."""
        return [count_at(place) for place in self.plan]

    def append(self, segments: list[Segment], at_rest: bool) -> None:
        """Queue segments (a step for every axis), the last one ending at rest or not."""
        for i, segment in enumerate(segments):
            self._queue.append(QueuedSegment(segment, at_rest and i + 1 == len(segments)))
            self._units += segment.units()
            self.plan = _places_after(segment, self.plan)
        if at_rest:
            self.plan = [count_at(place) * STEP + HALF for place in self.plan]

    def begin(self) -> None:
        """Run from the first segment's start."""
        self._cycles_run = 0.0
        if self._queue:
            self._queue[0].start()

    def clear(self) -> None:
        """Be empty, with the axes at rest on their counts."""
        self._queue.clear()
        self._units = 0
        self._cycles_run = 0.0
        self._fraction = [HALF] * len(self.axes.base)
        self.plan = [count * STEP + HALF for count in self.axes.base]

    def steps_made(self) -> list[int]:
        """Steps of every axis in the running segment so far."""
        if not self._queue or not self._queue[0].times:
            return [0] * len(self.axes.base)
        running_segment = self._queue[0]
        places = _places_after(
            running_segment.segment, self._fraction, bisect_right(running_segment.times, self._cycles_run)
        )
        return [count_at(place) for place in places]

    def velocity(self) -> list[float]:
        """Every axis's velocity just now, in any unit."""
        return [float(rate) for rate in self._queue[0].segment.rates] if self._queue else [0.0] * len(self.axes.base)

    def run(self, seconds: float) -> QueuedSegment | None:
        """Let time pass; returns the last segment if it has ended. Axes that stop too abruptly lose their position."""
        self._cycles_run += seconds * self.clock
        while self._queue and self._cycles_run >= self._queue[0].times[-1]:
            speed = self.stop_time()
            finished = self._queue.popleft()
            self._units -= finished.segment.units()
            places = _places_after(finished.segment, self._fraction)
            self.axes.add_steps([count_at(place) for place in places])
            self._fraction = [HALF if finished.end else place % STEP for place in places]
            cycles_left = self._cycles_run - finished.times[-1]
            self.begin()
            self._cycles_run = cycles_left
            if not self._queue:
                if not finished.end and speed > _TOO_FAST:
                    self.axes.lose(finished.segment.rates)
                return finished
        return None

    def stop_time(self) -> float:
        """u of PROTOCOL.md, section 7: the time that the arm needs to stop from its present speed."""
        if not self._queue or not self._queue[0].times:
            return 0.0
        running_segment = self._queue[0]
        tick = min(bisect_right(running_segment.times, self._cycles_run), len(running_segment.times) - 1)
        interval = running_segment.times[tick] - (running_segment.times[tick - 1] if tick else 0)
        rate = self.clock / (STEP * interval)
        limits = zip(running_segment.segment.rates, self.axes.image.axes, strict=True)
        return max((abs(n) * rate / axis.max_accel for n, axis in limits if n), default=0.0)

    def dry(self, u: float, *, is_holding: bool = False) -> bool:
        """Whether the queue is just long enough for a stop of u seconds and does not end at rest."""
        if not self._queue or self._queue[-1].end or (u < _SLOW_STOP and not is_holding):
            return False
        cycles_left = self._units * 256 - self._cycles_run
        return cycles_left / self.clock < u + u / 32 + 0.002
