"""The simulated board's checks of a MOTION frame before it queues any segment (firmware/PROTOCOL.md, 6)."""

from dataclasses import replace

from armkin.board.firmware.wire.protocol import STEP, Error, Segment, count_at
from armkin.board.sim.axis_counts import limit_rule_holds
from armkin.board.sim.coupled_limits import CoupledLimits
from armkin.board.sim.frame_fields import MotionFields, RefusedError
from armkin.board.sim.host_settings import Setup
from armkin.board.sim.rate_checks import Velocity, times_valid
from armkin.board.sim.segment_queue import Queue


class Batches:
    """The batches of one motion: speeds at the plan's end, and least distances of coupled joints from their limits."""

    def __init__(self, setup: Setup, queue: Queue) -> None:
        self._setup, self._queue = setup, queue
        self.begin()

    def begin(self) -> None:
        """Begin a motion at rest at the end of the queue."""
        self._velocity = Velocity(self._setup.board, self._setup.image)
        self._coupled_limits = CoupledLimits(self._setup.image, self._queue.plan_counts())

    def check(self, batch: MotionFields, known_axes: int) -> list[Segment]:
        """The batch's segments with a rate for every axis; RefusedError if one of them must not run."""
        plan, velocity = list(self._queue.plan), self._velocity.copy()
        segments = [
            self._check_segment(number, segment, batch.axes, plan, velocity, known_axes)
            for number, segment in enumerate(batch.segments)
        ]
        ends = dict(zip(batch.axes, batch.end, strict=True))
        for axis in range(len(plan)):
            if batch.at_rest:
                velocity.check_rest(axis)
            if axis in ends and count_at(plan[axis]) != ends[axis]:
                raise RefusedError(Error.END, axis)
        self._velocity = Velocity(self._setup.board, self._setup.image) if batch.at_rest else velocity
        return segments

    def _check_segment(
        self, number: int, segment: Segment, axes: list[int], plan: list[int], velocity: Velocity, known_axes: int
    ) -> Segment:
        """A batch's segment with a rate for every axis; moves `plan` to its end."""
        if not times_valid(segment, self._setup.board.min_interval):
            raise RefusedError(Error.INTERVAL, number)
        rates, start_counts = [0] * len(plan), [count_at(place) for place in plan]
        rate_of = dict(zip(axes, segment.rates, strict=True))
        velocity.begin(segment)
        for axis in range(len(plan)):
            rate = rate_of.get(axis, 0)
            if rate == -STEP:
                raise RefusedError(Error.STEPS, axis)
            velocity.check(axis, rate)
            rates[axis] = rate
            plan[axis] += segment.ticks * rate
            image, end_count = self._setup.image.axes[axis], count_at(plan[axis])
            if axis in rate_of and not limit_rule_holds(image.lower, image.upper, start_counts[axis], end_count):
                raise RefusedError(Error.LIMIT, axis)
        self._coupled_limits.check([count_at(place) for place in plan], known_axes)
        return replace(segment, rates=tuple(rates))
