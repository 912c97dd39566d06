"""The simulated board's handling of frames: checks, then actions of setup or motors."""

import struct
from collections.abc import Sequence

from armkin.board.firmware.wire.protocol import Error, State, Type
from armkin.board.sim.digital_inputs import Inputs
from armkin.board.sim.frame_fields import RefusedError, axes_of
from armkin.board.sim.frame_fields import read_batch as read_batch
from armkin.board.sim.host_settings import Setup
from armkin.board.sim.motion_frame_checks import Batches
from armkin.board.sim.sim_homing import Search
from armkin.board.sim.sim_motors import Motors

_RUNNING = (State.IDLE, State.MOVING)


class Commands:
    """Carries out frames in sequence, or refuses them with RefusedError."""

    def __init__(self, setup: Setup, inputs: Inputs, motors: Motors) -> None:
        self._board = setup.board
        self._setup, self._inputs, self._motors = setup, inputs, motors
        self._batches = Batches(setup, motors.queue)
        self._handlers = {
            Type.CONFIG: self._configure,
            Type.COMMIT: self._commit,
            Type.ENABLE: self._enable,
            Type.SET_POSITION: self._set_position,
            Type.MOTION: self._queue_motion,
            Type.HOME: self._home,
            Type.JOG: self._jog,
        }

    def execute(self, payload: bytes) -> None:
        """Carry out a frame."""
        if payload[0] not in self._handlers:
            raise RefusedError(Error.TYPE)
        self._handlers[Type(payload[0])](payload)

    def _require_state(self, *states: State, config: bool = True, abort: bool = False) -> None:
        if config and not self._setup.crc:
            raise RefusedError(Error.CONFIG_NONE)
        if abort and self._inputs.is_aborted():
            raise RefusedError(Error.ABORT)
        if abort and self._inputs.power_cut():
            raise RefusedError(Error.POWER)
        if self._motors.state not in states:
            raise RefusedError(Error.BUSY)

    def _axis_known(self, axis: int) -> bool:
        return bool(self._motors.axes.known >> axis & 1)

    def _configure(self, payload: bytes) -> None:
        if len(payload) < 5:
            raise RefusedError(Error.LENGTH)
        self._require_state(State.IDLE, config=False)
        self._setup.write(struct.unpack_from("<H", payload, 2)[0], payload[4:])
        self._motors.axes.known = 0

    def _commit(self, payload: bytes) -> None:
        if len(payload) != 8:
            raise RefusedError(Error.LENGTH)
        self._require_state(State.IDLE, config=False)
        self._setup.commit(*struct.unpack_from("<HI", payload, 2))

    def _enable(self, payload: bytes) -> None:
        if len(payload) != 3:
            raise RefusedError(Error.LENGTH)
        if payload[2] > 3:
            raise RefusedError(Error.VALUE)
        self._require_state(State.IDLE)
        self._setup.drivers, self._setup.pulses = bool(payload[2] & 1), bool(payload[2] & 2)
        if not self._setup.drivers:
            self._motors.axes.known &= self._board.servo_mask
        if not self._setup.pulses:
            self._motors.axes.known &= ~self._board.servo_mask

    def _set_position(self, payload: bytes) -> None:
        """SET_POSITION: set the counts of motors whose position is lost."""
        if len(payload) < 4:
            raise RefusedError(Error.LENGTH)
        axes = axes_of(struct.unpack_from("<H", payload, 2)[0])
        if len(payload) != 4 + 4 * len(axes):
            raise RefusedError(Error.LENGTH)
        if self._inputs.power_cut():
            raise RefusedError(Error.POWER)
        self._require_state(State.IDLE)
        counts = dict(zip(axes, struct.unpack_from(f"<{len(axes)}i", payload, 4), strict=True))
        for i, count in counts.items():
            if not self._setup.uses_axis(i) or abs(count) > 2**30:
                raise RefusedError(Error.VALUE, i)
            axis = self._setup.image.axes[i]
            if self._setup.servo(i) and not axis.lower <= count <= axis.upper:
                raise RefusedError(Error.VALUE, i)
            if self._axis_known(i):
                raise RefusedError(Error.KNOWN, i)
        self._motors.place(counts)
        self._setup.retained = False

    def _queue_motion(self, payload: bytes) -> None:
        """Queue a batch of segments; RefusedError where it does not follow on, or a switch is pressed."""
        batch, queue = read_batch(payload), self._motors.queue
        self._require_state(*_RUNNING, abort=True)
        counts = queue.plan_counts()
        for axis, start in zip(batch.axes, batch.start, strict=True):
            self._check_axis_ready(axis)
            if counts[axis] != start:
                raise RefusedError(Error.START, axis)
        if len(batch.segments) > queue.free:
            raise RefusedError(Error.CREDIT)
        idle = self._motors.state == State.IDLE
        if idle:
            self._batches.begin()
        segments = self._batches.check(batch, self._motors.axes.known)
        if idle and (switch := self._inputs.switch_ahead(segments[0].rates)) is not None:
            raise RefusedError(Error.LIMIT_SWITCH, switch)
        self._motors.append(segments, batch.at_rest, batch.brake)

    def _check_axis_ready(self, axis: int) -> None:
        """Raise unless an axis is used, known and has its drivers or pulses on."""
        if not self._setup.uses_axis(axis):
            raise RefusedError(Error.VALUE, axis)
        if not self._axis_known(axis):
            raise RefusedError(Error.LOST, axis)
        if not self._setup.is_powered(axis):
            raise RefusedError(Error.DISABLED, axis)

    def _check_rates(self, rate: Sequence[int], *, jogging: bool) -> None:
        """Raise unless axes may move at these rates without a plan."""
        moving_axes = [i for i, axis_rate in enumerate(rate) if axis_rate]
        is_slow = jogging and not all(self._axis_known(i) for i in moving_axes)
        for i in moving_axes:
            servo = self._setup.servo(i)
            if not self._setup.uses_axis(i) or (servo and not jogging):
                raise RefusedError(Error.VALUE, i)
            if servo and not self._axis_known(i):
                raise RefusedError(Error.LOST, i)
            if not self._setup.is_powered(i):
                raise RefusedError(Error.DISABLED, i)
            max_rate = self._setup.image.axes[i].max_rate
            max_rate = max(max_rate // 8, 1) if is_slow else max_rate
            if abs(rate[i]) > min(max_rate, 2**31 - 1):  # the way back has to be a rate, too
                raise RefusedError(Error.RATE, i)

    def _home(self, payload: bytes) -> None:
        """Start a switch search; RefusedError for fields out of range or another state."""
        n = len(self._board.axes)
        if len(payload) != 15 + 4 * n:
            raise RefusedError(Error.LENGTH)
        self._require_state(State.IDLE, abort=True)
        switch, flags, slow_share, backoff, travel, time, *rate = struct.unpack_from(f"<BBBIIH{n}i", payload, 2)
        too_far = backoff > 2**30 or travel > 2**30
        if (
            not any(rate)
            or switch >= len(self._board.switches)
            or flags > 1
            or not slow_share
            or not backoff
            or too_far
        ):
            raise RefusedError(Error.VALUE)
        self._check_rates(rate, jogging=False)
        self._motors.home(
            Search(
                switch=switch,
                closed=bool(flags),
                slow=slow_share / 256,
                backoff=backoff,
                travel=travel,
                time=time / 10,
                rate=rate,
            )
        )

    def _jog(self, payload: bytes) -> None:
        n = len(self._board.axes)
        if len(payload) != 2 + 4 * n:
            raise RefusedError(Error.LENGTH)
        self._require_state(State.IDLE, State.JOGGING, abort=True)
        rate = list(struct.unpack_from(f"<{n}i", payload, 2))
        self._check_rates(rate, jogging=True)
        self._motors.jog(rate)
