"""The simulated board's motors: what moves them, holds, and the board's state.

What the firmware does every millisecond happens every millisecond here.
"""

from collections.abc import Callable, Iterator

from armkin.board.firmware.wire.protocol import HALF, STEP, Error, Segment, State
from armkin.board.sim.axis_counts import Axes
from armkin.board.sim.cruise import Cruise
from armkin.board.sim.host_settings import Setup
from armkin.board.sim.segment_queue import Queue
from armkin.board.sim.sim_homing import Homing, Search
from armkin.board.sim.sim_jogging import Jogging

_STANDING_TIME = 0.001  # time [s] to a stop at which a hold stands still


class Motors:
    """State of the axes, which either the queue or a cruise moves.

    `level`: level of a limit input; `fault`: told why the session ends.
    """

    def __init__(self, setup: Setup, level: Callable[[int], bool], fault: Callable[[Error], None]) -> None:
        self.axes = Axes(setup)
        self.queue = Queue(self.axes, setup.board.clock, setup.board.queue)
        self.cruise = Cruise(self.axes)
        self.homing = Homing(self.cruise, level, fault)
        self.jogging = Jogging(self.cruise)
        self.state = State.IDLE
        self._cruising: Iterator[None] | None = None  # homing or jogging, a step a millisecond
        self._hold = 0.0  # [s] time to a stop that the hold allows
        self._brake = 1.0  # seconds by which the time to a stop falls in a second
        self._fault = fault

    def append(self, segments: list[Segment], at_rest: bool, brake: float) -> None:
        """Queue segments (a step for every axis), the last one ending at rest or not; brake: see `stop`."""
        self._brake = min(self._brake, brake)
        self.queue.append(segments, at_rest)
        if self.state == State.IDLE:
            self.state = State.MOVING
            self.queue.begin()

    def counts(self) -> list[int]:
        """Steps that the pins have made."""
        return self._plus_made(self.axes.base)

    def net(self) -> list[int]:
        """Steps since power-on."""
        return self._plus_made(self.axes.net)

    def place(self, counts: dict[int, int]) -> None:
        """Say what counts are, at rest."""
        for axis, count in counts.items():
            self.axes.base[axis], self.queue.plan[axis] = count, count * STEP + HALF
            self.axes.known |= 1 << axis

    def rest_at(self, counts: list[int]) -> None:
        """Stand there."""
        self.axes.base = list(counts)
        self._stop_at_rest()

    def velocity(self) -> list[float]:
        """Every axis's velocity just now, in any unit."""
        return self.queue.velocity() if self._cruising is None else self.cruise.velocity()

    def jog(self, rate: list[int]) -> None:
        """Move with this vector for another 250 ms."""
        self.jogging.set_rates(rate)
        if self.state == State.IDLE:
            self._begin(State.JOGGING, self.jogging.run())

    def home(self, search: Search) -> None:
        """Look for a switch along a vector, whose axes are lost from now on."""
        self.axes.lose(search.rate)
        self._begin(State.HOMING, self.homing.run(search))

    def stop(self, *, wholly: bool = False) -> None:
        """Come to rest along the path, as gently as its batches ask for, or along the vector of homing and jogging.

        wholly: with all of the accelerations.
        """
        self._brake = 1.0 if wholly else self._brake
        if self.state == State.MOVING:
            self.state, self._hold = State.HOLDING, self.queue.stop_time()
        elif self.state in (State.HOMING, State.JOGGING):
            self.state, self.cruise.stopped = State.HOLDING, True

    def cut(self) -> None:
        """Stop dead, as a reset does."""
        self.axes.add_steps(self.queue.steps_made())
        self._stop_at_rest()

    def advance(self, seconds: float) -> None:
        """Let at most a millisecond pass."""
        self.cruise.now += seconds
        if self._cruising is not None:
            if next(self._cruising, self) is self:
                self._stop_at_rest()
        elif self.state == State.MOVING:
            self._run(seconds)
            if self.state == State.MOVING and self.queue.dry(self.queue.stop_time()):
                self._fault(Error.DRY)
        elif self.state == State.HOLDING:
            if self.queue.dry(self._hold, is_holding=True):
                self._brake = 1.0
            self._hold -= seconds * self._brake
            plan = self.queue.stop_time()
            if self._hold < _STANDING_TIME:
                self.cut()
            else:
                self._run(seconds * min(1.0, self._hold / plan if plan else 1.0))

    def _run(self, seconds: float) -> None:
        finished = self.queue.run(seconds)
        if finished is None:
            return
        if not finished.end and self.state == State.MOVING:
            self.state = State.HOLDING
            self._fault(Error.DRY)
        self._stop_at_rest()

    def _begin(self, state: State, cruise_steps: Iterator[None]) -> None:
        self.state, self._cruising = state, cruise_steps
        self.cruise.stopped = False

    def _stop_at_rest(self) -> None:
        self.queue.clear()
        self._cruising = None
        self._brake = 1.0
        self.state = State.IDLE

    def _plus_made(self, counts: list[int]) -> list[int]:
        return [count + steps for count, steps in zip(counts, self.queue.steps_made(), strict=True)]
