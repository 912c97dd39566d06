"""An arm on its board: configured, with a known position or a lost one, moved by plans.

Everything here is said in the arm's words (joints, the robot file); `session` below speaks the protocol's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from armkin.board.firmware import cutting, protocol
from armkin.board.firmware.batch import WHY, Batch
from armkin.board.firmware.protocol import Error, Flag, Segment, State, Status
from armkin.board.firmware.session import DeviceError, Session
from armkin.errors import LinkError, PositionKnownError, PositionLostError
from armkin.hardware import board_name
from armkin.model.units import joints_out
from armkin.motors import joints as joints_of
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.board.firmware.segments import Counts, Move
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.trajectory import Trajectory

Position = Literal["known", "retained", "lost"]
Progress = Callable[[float, float], None]  # seconds done, seconds in all

# Standing still while the queue fills: 100 ms, or half a second on a bad line.
_LEAD = (Segment(80, 20_000, 0, ()), Segment(255, 32_000, 0, ()))
_BATCH = (2, 6)  # segments in a frame, on a bad line and on a good one


class Machine:
    """An arm on the board behind an open port.

    `stop` is asked all the time: when it says yes, the arm is held and StoppedError raised.
    """

    def __init__(
        self, port: Port, arm: Arm, configuration: Configuration, stop: Callable[[], bool] = lambda: False
    ) -> None:
        self.arm, self.port, self.configuration = arm, port, configuration
        self.session = Session(port, stop)
        self.info = self.session.open()
        expected, board = configuration.board.number, self.info.board
        if board != expected:
            raise LinkError(
                f"{port.name} is {board_name(board)}, {arm.name}'s board is {configuration.board.kind}: choose "
                f"another port, or correct board: in {arm.path}",
                port=port.name,
                board=board,
                expected=expected,
            )
        self.status = self.session.rest()  # a former session's motion ends first
        self._simulated = port.simulated

    # Where it stands

    @property
    def configured(self) -> bool:
        """Whether the board has this robot file's configuration."""
        return self.info.config == self.configuration.image.crc()

    def position(self) -> Position:
        """Whether the arm's position is known: a board configured for another arm does not know it."""
        mask = _mask(self.configuration.axes)
        if not self.configured or self.status.known & mask != mask:
            return "lost"
        return "retained" if self.status.flags & Flag.RETAINED else "known"

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        return tuple(self.status.counts[axis] for axis in self.configuration.axes)

    def joints(self) -> Array:
        """Joint values where it stands, as last read: (n,) [rad | mm]."""
        return joints_of(self.arm, self.counts())

    @property
    def differences(self) -> tuple[str, ...]:
        """Nothing: what armkin promises of a board is what this firmware does."""
        return ()

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        info, status, board = self.info, self.status, self.configuration.board
        flags = Flag(status.flags)
        return {
            "firmware": ".".join(map(str, info.firmware)),
            "configured": self.configured,
            "state": State(status.state).name.lower(),
            "error": Error(status.error).name.lower() if status.error else None,
            "drivers_on": Flag.DRIVERS in flags,
            "servo_pulses_on": Flag.SERVOS in flags,
            "abort_input": Flag.ABORT in flags,
            "switches": {name: bool(status.switches >> i & 1) for i, name in enumerate(board.switches)},
            "boots": info.boots,
            "reset_cause": info.cause,
        }

    def refresh(self) -> None:
        """Read again where the arm stands."""
        self.status = self.session.status()

    def heard(self) -> None:
        """Take the newest status that has come while the arm moves."""
        if self.session.latest is not None:
            self.status = self.session.latest

    def hold(self) -> None:
        """Stop along the path, and stay: also what another session has begun."""
        self.status = self.session.hold()

    # Getting ready

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Configure the board, settle the position, switch the motors on.

        assume: (n,) [rad | mm] where an arm whose position is lost stands, on the operator's word. Returns True
        if it was lost. Raises LinkError if it is lost and nobody vouches for it, or known and assumed.
        """
        lost = self.position() == "lost"
        if assume is not None and not lost:
            raise PositionKnownError(
                f"the position is known ({self.describe()}), and only a lost one may be assumed\n"
                "motion starts where the arm stands",
                advice="leave assume out",
                joints=joints_out(self.arm, self.joints()).tolist(),
            )
        if lost and assume is None and not self._simulated:
            raise self._demand()
        if not self.configured:
            self.configure()
        if lost:
            counts = pulses(self.arm, self.arm.home if assume is None else assume).tolist()
            self.vouch(dict(zip(self.configuration.axes, counts, strict=True)))
        self.enable(self.configuration.axes)
        self.session.probe()
        return lost

    def configure(self) -> None:
        """Write the configuration; all positions are lost with it."""
        image = self.configuration.image.pack()
        piece = self.info.frame - 8
        for offset in range(0, len(image), piece):
            self._call(partial(protocol.config, offset=offset, data=image[offset : offset + piece]))
        self._call(lambda tag: protocol.commit(tag, len(image), self.configuration.image.crc()))
        self._renew()

    def enable(self, axes: Sequence[int]) -> None:
        """Switch on what these axes need, and what was on or has a position already."""
        servos = self.configuration.board.servo_mask
        need = (_mask(axes) | self.status.known) & _mask(
            i for i, axis in enumerate(self.configuration.image.axes) if axis.used
        )
        on = self.status.flags & (Flag.DRIVERS | Flag.SERVOS)
        what = on | (Flag.DRIVERS if need & ~servos else 0) | (Flag.SERVOS if need & servos else 0)
        if what != on:
            self._call(lambda tag: protocol.enable(tag, int(what)))
            self._renew()

    def vouch(self, counts: dict[int, int]) -> None:
        """Take the operator's word for where lost axes stand: {axis: counts}."""
        missing = {axis: count for axis, count in counts.items() if not self.status.known >> axis & 1}
        if any(self.status.counts[axis] != count for axis, count in counts.items() if axis not in missing):
            raise LinkError(
                "some axes know their position and do not stand there: home the arm, or switch the board "
                "off and on to forget all"
            )
        if missing:
            self._call(lambda tag: protocol.set_position(tag, missing))
            self._renew()

    def _renew(self) -> None:
        """Read again what configuration, position or power have changed."""
        self.status = self.session.status()
        config = self.configuration.image.crc() if self.status.flags & Flag.CONFIGURED else 0
        self.info = protocol.Info(**{**vars(self.info), "config": config, "known": self.status.known})

    def _demand(self) -> PositionLostError:
        what = "the arm's position is lost"
        if self.info.config and not self.configured:
            changed = f"{self.arm.path} has changed"
            what = f"the board is configured for another arm, or {changed}: its position is lost"
        return self._lost(what)

    def _lost(self, message: str) -> PositionLostError:
        homing = all(self.arm.homing)
        put = "put the arm in its home pose and prepare(assume=arm.home)"
        return PositionLostError(
            message,
            advice=f"home it, or {put}" if homing else put,
            robot_file=self.arm.path,
            port=self.session.port.name,
            homing=homing,
        )

    # Moving

    def plan(self, start: Sequence[int], targets: Array, *, speed: float = 1.0) -> cutting.Cut:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each, for the board that is there."""
        info = self.info
        return cutting.plan(self.arm, start, targets, speed=speed, clock=info.clock, min_interval=info.min_interval)

    def lay(self, trajectory: Trajectory, start: Counts) -> cutting.Cut:
        """A trajectory that starts at counts (motors,), for the board that is there."""
        return cutting.cut(trajectory, start, clock=self.info.clock, min_interval=self.info.min_interval)

    def run(self, plans: Iterable[cutting.Cut | None], progress: Progress = lambda done, total: None) -> Status:
        """Carry out plans, one after another; None in between: nothing to do yet.

        Returns the status at the end, where the last plan ends, or raises LinkError.
        """
        end: Counts | None = None
        total = begun = done = 0.0

        def frames() -> Iterator[Batch | None]:
            nonlocal end, total, begun
            for plan in plans:
                if plan is None:
                    yield None
                    continue
                total += plan.duration
                for move in plan.moves(lambda: self.session.noisy):
                    for batch in self._batches(move, self.configuration.axes, plan.clock):
                        begun += batch.seconds
                        yield batch
                end = plan.end

        def tell(left: float) -> None:
            nonlocal done
            done = max(done, min(begun - left, total))  # what is left is an estimate: never backwards
            progress(done, total)

        self._stream(frames(), tell)
        if self.position() == "lost":
            raise self._lost("the board has lost the arm's position on the way")
        if self.status.overruns:
            raise LinkError(f"the board reports {self.status.overruns} late ticks: lower the speed\n{self.standing()}")
        if end is not None and self.counts() != tuple(end.tolist()):
            raise LinkError(
                f"the board says that it stands at {list(self.counts())}, the plan ends at {end.tolist()}: "
                "a bug in armkin or its firmware, please report it"
            )
        return self.status

    def run_axis(self, move: Move, axis: int, clock: int) -> Status:
        """Carry out the move of a single axis: the gripper."""
        self._stream(iter(self._batches(move, (axis,), clock)), lambda left: None)
        return self.status

    def _stream(self, frames: Iterator[Batch | None], left: Callable[[float], None]) -> None:
        session, more = self.session, True
        try:
            while more or session.backlog:
                while more and session.backlog < 2:
                    batch = next(frames, _DONE)
                    if batch is _DONE:
                        more = False
                    if batch is None or not more:
                        break
                    assert isinstance(batch, Batch)
                    session.submit(batch.payload, len(batch.segments), batch.seconds)
                session.pump()
                left(session.under_way + session.queued / 1000)
            for seconds in session.arrivals():
                left(seconds)
            self.status = session.status()
        except DeviceError as error:
            raise self.explain(error) from None

    def _batches(self, move: Move, axes: Sequence[int], clock: int) -> Iterator[Batch]:
        """A move's segments in frames: as many as a good line takes, fewer on a bad one."""
        moving = sorted(move.moving, key=lambda k: axes[k])
        at = [int(move.start[k]) for k in moving]
        room = self.info.frame - 4
        places = [count * protocol.STEP + protocol.HALF for count in at]
        source = (s.of(moving) for s in move.segments)
        todo: list[Segment] = []
        resting = self.session.state == State.IDLE and not self.session.under_way
        if move.segments and (resting or self.session.damaged):
            lead = _LEAD[self.session.damaged]
            todo.append(Segment(lead.ticks, lead.interval, 0, (0,) * len(moving)))
        while todo := todo + list(islice(source, _BATCH[1] + 1 - len(todo))):
            most = _BATCH[0] if self.session.noisy else _BATCH[1]
            n = 1
            while (
                n < min(most, len(todo))
                and todo[n].narrow == todo[0].narrow
                and protocol.motion_size(len(moving), todo[: n + 1]) <= room
            ):
                n += 1
            part, todo = todo[:n], todo[n:]
            if not todo:
                todo = list(islice(source, 1))
            places = [p + sum(s.ticks * s.rates[i] for s in part) for i, p in enumerate(places)]
            end = [p // protocol.STEP for p in places]
            yield Batch([axes[k] for k in moving], at, end, part, not todo, clock)
            at = end

    def jog(self, rate: dict[int, int], seconds: float, more: Callable[[], bool] = lambda: True) -> Status:
        """Move axes at constant rates [counts/s] for a time, then stop; shorter if limits come first.

        more: asked every 10 ms; the motion ends when it says no.
        """
        vector = [rate.get(axis, 0) for axis in range(len(self.configuration.board.axes))]
        port, session = self.session.port, self.session
        begin = port.now()
        try:
            while (left := seconds - (port.now() - begin)) > 0 and more():
                session.call(lambda tag: protocol.jog(tag, vector))
                if session.state != State.JOGGING:
                    break  # at a limit
                pause = port.now() + min(0.08, left)
                while port.now() < pause and more():
                    session.pump(max(0.001, min(0.01, pause - port.now())))
            session.call(lambda tag: protocol.jog(tag, [0] * len(vector)))
            for _ in session.arrivals():
                pass
        except DeviceError as error:
            raise self.explain(error) from None
        self.status = session.status()
        return self.status

    def home(self, make: Callable[[int], bytes], seconds: float) -> tuple[Status, Status]:
        """Carry out one HOME that takes so long at most; status at rest, and at the switch's edge (page 1)."""
        try:
            self.session.call(make)
            for _ in self.session.arrivals(seconds):
                pass
            self.status = self.session.status()
            return self.status, self.session.status(page=1)
        except DeviceError as error:
            raise self.explain(error) from None

    # Words

    def describe(self) -> str:
        """Where it stands, in words: ``q1 = 0, q2 = 90, q3 = -90 deg``."""
        return describe(self.arm, self.joints())

    def explain(self, error: DeviceError) -> LinkError:
        """What the board's error means, and where the arm stands now."""
        why = WHY.get(error.error)
        if why is None:
            return LinkError(
                f"the board refused what it was sent: {error.error.name} ({error.detail}); it stands still\n"
                "armkin and its firmware disagree: please report it with the robot file"
            )
        try:
            self.status = self.session.rest()
            if self.status.error == Error.NO_SESSION:
                self.info = self.session.reopen()
                self.status = self.session.status()
        except LinkError:
            return LinkError(f"{why}; then the board did not answer any more: armkin status tells where it stands")
        if self.position() == "lost":
            return self._lost(f"{why}\n{self.standing()}")
        return LinkError(f"{why}\n{self.standing()}", joints=joints_out(self.arm, self.joints()).tolist())

    def standing(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""
        if self.position() == "lost":
            return "the arm's position is lost"
        return f"the arm stands at {self.describe()}, its position is known: the next command starts there"

    def _call(self, make: Callable[[int], bytes]) -> None:
        try:
            self.session.call(make)
        except DeviceError as error:
            raise self.explain(error) from None


_DONE = object()


def describe(arm: Arm, q: Array) -> str:
    """Joint values in words: ``q1 = 0, q2 = 90, q3 = -90 deg``."""
    unit = np.where(arm.prismatic, 1.0, np.pi / 180)
    values = [f"{name} = {value:.4f}" for name, value in zip(arm.joint_names, q / unit + 0.0, strict=True)]
    words = "mm" if arm.prismatic.all() else "deg" if not arm.prismatic.any() else "(deg, mm)"
    return f"{', '.join(values)} {words}"


def _mask(axes: Iterable[int]) -> int:
    return sum(1 << axis for axis in axes)
