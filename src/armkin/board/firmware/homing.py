"""Homing by limit switches: what the robot file says, in the board's counts.

Each joint moves along its own vector of motors until its switch closes, backs off, and touches the switch
again slowly; the board latches the counts at that edge. (firmware/PROTOCOL.md, section 8.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.backend.board import LostSteps
from armkin.board.firmware import resets_and_stops
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.session import DeviceError
from armkin.errors import NoHomingError, UsageError
from armkin.model.lock_joints import joint_index
from armkin.model.units import joint_scale
from armkin.motors import joints, pulses

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.board.firmware.firmware_machine import FirmwareMachine
    from armkin.board.firmware.wire.protocol import Status
    from armkin.model.arm import Arm

_SLOW_SPEED = 26  # speed of the second approach, in 1/256 of the first: a tenth
_MAX_COUNTS = 2**30  # greatest number of counts and of counts/s in a command
_SWITCH_RANGES = 1.25  # distance of a switch, at most, in a joint's ranges


@dataclass(frozen=True)
class Search:
    """One joint's way to its switch, in the protocol's terms."""

    joint: int
    switch: int
    closed: bool
    backoff: int  # leader's counts
    travel: int
    time: int  # [0.1 s]
    rate: tuple[int, ...]  # per axis of the board

    def frame(self, tag: int) -> bytes:
        """The payload of the HOME frame that starts this search."""
        return protocol.home(
            tag,
            switch=self.switch,
            closed=self.closed,
            slow=_SLOW_SPEED,
            backoff=self.backoff,
            travel=self.travel,
            time=self.time,
            rate=self.rate,
        )


def searches(
    arm: Arm, configuration: Configuration, names: Sequence[str] = (), *, rest_at_home: bool = False
) -> list[Search]:
    """The searches of the named joints (all, by default) in their order.

    rest_at_home: leave joints without homing out. Raises UsageError that names the joint which has no homing.
    """
    for name in names:
        joint_index(arm, name)
    chosen = [j for j, name in enumerate(arm.joint_names) if not names or name in names]
    chosen = [j for group in _coupled_groups(arm, chosen) for j in group]
    orders = _homing_orders(arm, chosen, rest_at_home=rest_at_home)
    in_order = sorted(orders, key=lambda j: (orders[j] is None, orders[j] or 0, j))
    return [_search_of(arm, configuration, j) for j in in_order]


def _homing_orders(arm: Arm, joints: Sequence[int], *, rest_at_home: bool) -> dict[int, int | None]:
    """Joint -> its order, of joints that have a homing. Raises NoHomingError for others that are not left out."""
    orders = {j: homing.order for j in joints if (homing := arm.homing[j]) is not None}
    bare = [arm.joint_names[j] for j in joints if j not in orders]
    if bare and not (rest_at_home and orders):
        raise NoHomingError(
            f"{arm.path} has no homing for {', '.join(bare)}",
            advice="without limit switches put the arm in its home pose, then FirmwareMachine.prepare(assume=arm.home)",
            joints=bare,
            file=arm.path,
            some=bool(orders),
        )
    return orders


def home_joints(
    machine: FirmwareMachine,
    names: Sequence[str] = (),
    announce: Callable[[str], None] = lambda name: None,
    *,
    rest_at_home: bool = False,
) -> list[LostSteps]:
    """Home joints and tell the board where they stand; all positions of theirs are lost until then.

    rest_at_home: the joints that have no switch stand in their home pose, says the operator. Counts go on through
    homing: where they were known before, the result tells how far they were from where the switches are.
    """
    arm = machine.arm
    pending = searches(arm, machine.configuration, names, rest_at_home=rest_at_home)
    if not machine.configured:
        machine.configure()
    machine.enable(machine.configuration.axes)
    q = arm.home.copy()
    axes = list(machine.configuration.axes)
    lost_before, lost_steps = lost_joints(machine), []
    per_count = np.linalg.pinv(arm.motor_gain)
    turn = {search.joint: i for i, search in enumerate(pending)}
    for group in sorted(_coupled_groups(arm, list(turn)), key=lambda group: min(turn.get(j, len(turn)) for j in group)):
        for search in (s for s in pending if s.joint in group):
            announce(arm.joint_names[search.joint])
            status, edge = _run_search(machine, search)
            lost_steps.append(
                _lost_steps(machine, search, edge, was_known=arm.joint_names[search.joint] not in lost_before)
            )
            beyond = np.array([status.counts[axis] - edge.counts[axis] for axis in axes])
            q[search.joint] = _switch_value(arm, search.joint) + per_count[search.joint] @ beyond
        motors = np.flatnonzero(np.abs(arm.motor_gain[:, group]).sum(axis=1))
        machine.vouch(dict(zip([axes[k] for k in motors], pulses(arm, q)[motors].tolist(), strict=True)))
    if rest_at_home:
        left = [k for k, axis in enumerate(axes) if not machine.status.known >> axis & 1]
        machine.vouch(dict(zip([axes[k] for k in left], pulses(arm, q)[left].tolist(), strict=True)))
    return lost_steps


def _lost_steps(machine: FirmwareMachine, search: Search, edge: Status, *, was_known: bool) -> LostSteps:
    """The counts at a switch's edge, against where the robot file says that it is."""
    arm, j = machine.arm, search.joint
    if not was_known:
        return LostSteps(arm.joint_names[j], None, None)
    counts = [edge.counts[axis] for axis in machine.configuration.axes]
    gain = arm.motor_gain[:, j]
    leader = gain[np.abs(gain).argmax()]
    steps = round(float((joints(arm, counts)[j] - _switch_value(arm, j)) * leader))
    return LostSteps(arm.joint_names[j], steps, steps / float(leader))


def _run_search(machine: FirmwareMachine, search: Search) -> tuple[Status, Status]:
    """Carry out one search; status at rest, and at the switch's edge (page 1)."""
    session = machine.session
    try:
        session.call(search.frame)
        for _ in session.arrivals(search.time / 10):
            pass
        machine.status = session.status()
        machine.in_time()
        return machine.status, session.status(page=1)
    except DeviceError as error:
        raise resets_and_stops.explain_error(machine, error) from None


def lost_joints(machine: FirmwareMachine) -> list[str]:
    """Names of the joints that a motor of unknown position turns."""
    arm, known_axes = machine.arm, machine.status.known if machine.configured else 0
    lost = [not known_axes >> axis & 1 for axis in machine.configuration.axes]
    moved = np.abs(arm.motor_gain[lost]).sum(axis=0) > 0
    return [name for name, unknown in zip(arm.joint_names, moved, strict=True) if unknown]


def switch_levels(arm: Arm, configuration: Configuration) -> Callable[[int, Sequence[int]], bool]:
    """The limit inputs' levels of a simulated arm that was switched on in its home pose.

    The result takes the number of an input and the net steps of all axes since then.
    """
    joint_of = {
        configuration.board.switches.index(homing.switch): j
        for j, homing in enumerate(arm.homing)
        if homing is not None
    }
    start, axes = pulses(arm, arm.home), list(configuration.axes)

    def level(number: int, net: Sequence[int]) -> bool:
        j = joint_of.get(number)
        homing = None if j is None else arm.homing[j]
        if j is None or homing is None:
            return True
        value = joints(arm, start + np.array([net[axis] for axis in axes]))[j]
        pressed = (value - _switch_value(arm, j)) * homing.direction >= 0
        return bool(pressed) == (homing.normally == "closed")  # a pressed switch opens, or closes to ground

    return level


def _coupled_groups(arm: Arm, joints: Sequence[int]) -> list[list[int]]:
    """Joints that share motors home together: sets of joints, in file order."""
    left, groups = set(joints), []
    while left:
        group = {min(left)}
        while True:
            motors = np.abs(arm.motor_gain[:, sorted(group)]).sum(axis=1) > 0
            coupled = set(np.flatnonzero(np.abs(arm.motor_gain[motors]).sum(axis=0)).tolist())
            if coupled == group:
                break
            group = coupled
        groups.append(sorted(group))
        left -= group
    return groups


def _switch_value(arm: Arm, joint: int) -> float:
    """Joint value at the switch's edge [rad | mm]."""
    homing = arm.homing[joint]
    assert homing is not None
    return float(homing.at * joint_scale(arm)[joint])


def _search_of(arm: Arm, configuration: Configuration, j: int) -> Search:
    """Joint j's search as the board takes it: rates [counts/s], ways [counts], time [0.1 s].

    Raises UsageError where the board's whole numbers do not hold them.
    """
    name, unit, homing = arm.joint_names[j], float(joint_scale(arm)[j]), arm.homing[j]
    assert homing is not None
    board = configuration.board
    gain = arm.motor_gain[:, j]
    speed = homing.speed * unit
    rate = [0] * len(board.axes)
    for axis, value in zip(configuration.axes, gain * homing.direction * speed, strict=True):
        rate[axis] = int(np.rint(value))
    leader = float(np.abs(gain).max())
    fastest, slowest = max(map(abs, rate)), min((abs(r) for r in rate if r), default=0)
    if fastest > _MAX_COUNTS or slowest < 1:
        raise UsageError(
            f"joint {name}: homing.speed {homing.speed:g} is {leader * speed:.4g} counts/s; 1 to {_MAX_COUNTS} can be"
        )
    backoff = math.ceil(leader * homing.backoff * unit)
    if backoff > _MAX_COUNTS:
        raise UsageError(f"joint {name}: homing.backoff {homing.backoff:g} is {backoff} counts; {_MAX_COUNTS} can be")
    span = float(arm.upper[j] - arm.lower[j])
    if not math.isfinite(span):
        if arm.prismatic[j]:
            raise UsageError(f"joint {name} has no limits: homing would not know how far to look")
        span = 2 * math.pi
    travel = math.ceil(leader * (_SWITCH_RANGES * span + homing.backoff * unit))
    seconds = 2 * _SWITCH_RANGES * span / speed + 4 * backoff / (leader * speed * _SLOW_SPEED / 256) + 5
    return Search(
        joint=j,
        switch=board.switches.index(homing.switch),
        closed=homing.normally == "closed",
        backoff=max(1, backoff),
        travel=travel,
        time=min(65535, math.ceil(10 * seconds)),
        rate=tuple(rate),
    )
