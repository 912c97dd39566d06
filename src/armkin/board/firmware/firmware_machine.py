"""An arm on a board with our firmware: configuration, position and motion.

This class works with joints and the robot file; its `session` handles the protocol.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from armkin.board.backend import Backend, Position, Progress, StoppedError
from armkin.board.backend.motion_start import from_counts, why_impossible
from armkin.board.firmware import resets_and_stops
from armkin.board.firmware.board_status import as_json
from armkin.board.firmware.carry_out_plans import carry_out, carry_out_axis
from armkin.board.firmware.segments import trajectory_to_counts
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.protocol import Flag, Status
from armkin.board.firmware.wire.session import DeviceError, Session, probe_line
from armkin.board_catalogue import board_name
from armkin.errors import LinkError, PositionKnownError
from armkin.model.units import joints_out
from armkin.motors import motor_names, pulses

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.board.firmware.segments.counts_to_segments import Counts, Move
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory


class FirmwareMachine(Backend):
    """An arm on the board behind an open port.

    `stop` is called again and again; when it returns True, the arm is held and StoppedError is raised.
    """

    resumable = False  # whether a held motion was recorded, see `armkin.board.firmware.resume_after_hold`

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
        self.status = self.session.wait_for_rest()  # wait for the motion of an earlier session
        self._simulated = port.simulated

    # Position

    @property
    def configured(self) -> bool:
        """Whether the board has this robot file's configuration."""
        return self.info.config == self.configuration.image.crc()

    def position(self) -> Position:
        """Whether the arm's position is known; it is lost on a board that is configured for another arm."""
        mask = protocol.mask_of(self.configuration.axes)
        if not self.configured or self.status.known & mask != mask:
            return "lost"
        if why_impossible(self.arm, self.counts()):
            return "lost"
        return "retained" if self.status.flags & Flag.RETAINED else "known"

    @property
    def loss_reason(self) -> str:
        """Why the position is lost, in words; empty while it is known."""
        if self.position() != "lost":
            return ""
        if self.info.config and not self.configured:
            return "the board is configured for another arm, or the robot file has changed"
        return why_impossible(self.arm, self.counts()) or "the board forgot it, or nobody has said where the arm stands"

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        return tuple(self.status.counts[axis] for axis in self.configuration.axes)

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        return {"configured": self.configured, **as_json(self.info, self.status, self.configuration)}

    def refresh(self) -> None:
        """Read the arm's position again."""
        self.status = self.session.status()

    def take_report(self) -> None:
        """Process the newest status that arrived while the arm moves."""
        if self.session.latest is not None:
            self.status = self.session.latest

    def hold(self) -> None:
        """Stop along the path, and stay there, also in a motion of another session."""
        self.status = self.session.hold()

    # Getting ready

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Configure the board, settle the position, switch the motors on.

        assume: (n,) [rad | mm] joint values of an arm whose position is lost, as the operator states them. Returns True
        if it was lost. Raises LinkError if it is lost and not assumed, or known and assumed.
        """
        is_lost = self.position() == "lost"
        if assume is not None and not is_lost:
            raise PositionKnownError(
                f"the position is known ({self.describe()}), and only a lost one may be assumed\n"
                "motion starts where the arm stands",
                advice="leave assume out",
                joints=joints_out(self.arm, self.joints()).tolist(),
            )
        if is_lost and assume is None and not self._simulated:
            raise resets_and_stops.must_be_told(self)
        if not self.configured:
            self.configure()
        if is_lost:
            counts = pulses(self.arm, self.arm.home if assume is None else assume).tolist()
            self.vouch(dict(zip(self.configuration.axes, counts, strict=True)))
        self.enable(self.configuration.axes)
        probe_line(self.session)
        return is_lost

    def configure(self) -> None:
        """Write the configuration; the board loses all positions."""
        image = self.configuration.image.pack()
        piece = self.info.frame - 8
        for offset in range(0, len(image), piece):
            self._call_board(partial(protocol.config, offset=offset, piece=image[offset : offset + piece]))
        self._call_board(lambda tag: protocol.commit(tag, len(image), self.configuration.image.crc()))
        self._renew_info()

    def enable(self, axes: Sequence[int]) -> None:
        """Switch on drivers or servos for these axes and for all axes with a known position."""
        servos = self.configuration.board.servo_mask
        needed_axes = (protocol.mask_of(axes) | self.status.known) & protocol.mask_of(
            i for i, axis in enumerate(self.configuration.image.axes) if axis.used
        )
        switched_on = self.status.flags & (Flag.DRIVERS | Flag.SERVOS)
        switches = (
            switched_on | (Flag.DRIVERS if needed_axes & ~servos else 0) | (Flag.SERVOS if needed_axes & servos else 0)
        )
        if switches != switched_on:
            self._call_board(lambda tag: protocol.enable(tag, int(switches)))
            self._renew_info()

    def vouch(self, counts: dict[int, int]) -> None:
        """Set the positions of lost axes as the operator states them: {axis: counts}."""
        lost_counts = {axis: count for axis, count in counts.items() if not self.status.known >> axis & 1}
        names = dict(zip(self.configuration.axes, motor_names(self.arm), strict=True))
        if contradictions := [
            f"{names.get(axis, 'the gripper')} at {self.status.counts[axis]} counts, not {count}"
            for axis, count in counts.items()
            if axis not in lost_counts and self.status.counts[axis] != count
        ]:
            raise LinkError(
                f"the board knows other positions than those stated: {'; '.join(contradictions)}: home the arm, or "
                "switch the board off and on to forget all"
            )
        if lost_counts:
            self._call_board(lambda tag: protocol.set_position(tag, lost_counts))
            self._renew_info()

    def _renew_info(self) -> None:
        """Read the status and update `info` after a change of configuration, position or power."""
        self.status = self.session.status()
        config = self.configuration.image.crc() if self.status.flags & Flag.CONFIGURED else 0
        self.info = protocol.Info(**{**vars(self.info), "config": config, "known": self.status.known})

    # Moving

    def plan(self, start: Sequence[int], targets: Array, *, speed: float = 1.0) -> trajectory_to_counts.Cut:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each, for the connected board."""
        info = self.info
        return trajectory_to_counts.plan_moves(
            self.arm, start, targets, speed=speed, clock=info.clock, min_interval=info.min_interval
        )

    def plan_trajectory(self, trajectory: Trajectory, start: Counts) -> trajectory_to_counts.Cut:
        """The plan of a trajectory that starts at counts (motors,), for the connected board."""
        return trajectory_to_counts.cut_trajectory(
            trajectory, start, clock=self.info.clock, min_interval=self.info.min_interval
        )

    def run(
        self, plans: Iterable[trajectory_to_counts.Cut | None], progress: Progress = lambda elapsed, total: None
    ) -> Status:
        """Carry out plans in order; a None among them means that the next plan is not there yet.

        Returns the status at the end of the last plan, or raises LinkError.
        """
        try:
            self.status, end = carry_out(
                self.session, from_counts(plans, self.counts), self.configuration.axes, progress, self.plan_trajectory
            )
        except StoppedError as stopped:
            self.status = stopped.status or self.status
            raise
        except DeviceError as error:
            raise resets_and_stops.explain_error(self, error) from None
        if self.position() == "lost":
            raise resets_and_stops.position_lost_error(self, "the board has lost the arm's position on the way")
        self.check_late_ticks()
        if end is not None and self.counts() != tuple(end.tolist()):
            raise LinkError(
                f"the board says that it stands at {list(self.counts())}, the plan ends at {end.tolist()}: "
                "a bug in armkin or its firmware, please report it"
            )
        return self.status

    def check_late_ticks(self) -> None:
        """Raise LinkError if the board reports late ticks."""
        if late_ticks := self.status.overruns:
            raise LinkError(f"the board reports {late_ticks} late ticks: lower the speed\n{self.standing_text()}")

    def run_axis(self, plan_move: Callable[[int], Move | None], axis: int, clock: int) -> Status:
        """Carry out the gripper's move, which `plan_move` makes from its counts; None: it has arrived."""
        try:
            self.status = carry_out_axis(self.session, plan_move, axis, self.status.counts[axis], clock)
        except DeviceError as error:
            raise resets_and_stops.explain_error(self, error) from None
        return self.status

    # Words

    def describe(self) -> str:
        """Joint values in words: ``q1 = 0, q2 = 90, q3 = -90 deg``."""
        return joints_text(self.arm, self.joints())

    def standing_text(self) -> str:
        """A sentence on where the arm has come to rest, and where the next command starts."""
        if self.position() == "lost":
            return "the arm's position is lost"
        return f"the arm stands at {self.describe()}, its position is known: the next command starts there"

    def _call_board(self, make: Callable[[int], bytes]) -> None:
        try:
            self.session.call(make)
        except DeviceError as error:
            raise resets_and_stops.explain_error(self, error) from None


def joints_text(arm: Arm, q: Array) -> str:
    """Joint values in words: ``q1 = 0, q2 = 90, q3 = -90 deg``."""
    values = [f"{name} = {value:.4f}" for name, value in zip(arm.joint_names, joints_out(arm, q), strict=True)]
    units = sorted({"mm" if slides else "deg" for slides in arm.prismatic})
    return f"{', '.join(values)} {units[0] if len(units) == 1 else '(deg, mm)'}"
