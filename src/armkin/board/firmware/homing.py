"""Homing by limit switches (firmware/PROTOCOL.md, section 8).

Each joint moves with all its motors until its switch closes, backs off, and touches the switch again slowly; the board
latches the counts at that edge.
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
from armkin.formula.arrays import Array
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
_SWITCH_RANGES = 1.25  # greatest distance to a switch, in ranges of the joint


@dataclass(frozen=True)
class Search:
    """The search of one joint for its switch, with the fields of a HOME frame."""

    joint: int
    switch: int
    closed: bool
    backoff: int  # counts of the leading motor
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
    joint_numbers = [joint for joint, name in enumerate(arm.joint_names) if not names or name in names]
    joint_numbers = [joint for group in _coupled_groups(arm, joint_numbers) for joint in group]
    orders = _homing_orders(arm, joint_numbers, rest_at_home=rest_at_home)
    joints_in_order = sorted(orders, key=lambda joint: (orders[joint] is None, orders[joint] or 0, joint))
    return [_search_of(arm, configuration, joint) for joint in joints_in_order]


def _homing_orders(arm: Arm, joint_numbers: Sequence[int], *, rest_at_home: bool) -> dict[int, int | None]:
    """{joint: order} of the joints with a homing. Raises NoHomingError for others, unless they rest at home."""
    orders = {joint: homing.order for joint in joint_numbers if (homing := arm.homing[joint]) is not None}
    without_homing = [arm.joint_names[joint] for joint in joint_numbers if joint not in orders]
    if without_homing and not (rest_at_home and orders):
        raise NoHomingError(
            f"{arm.path} has no homing for {', '.join(without_homing)}",
            advice="without limit switches put the arm in its home pose, then FirmwareMachine.prepare(assume=arm.home)",
            joints=without_homing,
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
    """Home joints and set the board's positions; the positions of these joints are lost until then.

    rest_at_home: the operator states that joints without a switch stand in their home pose. Counts are kept during
    homing, so the result has the errors of positions that were known before.
    """
    arm = machine.arm
    searches_left = searches(arm, machine.configuration, names, rest_at_home=rest_at_home)
    if not machine.configured:
        machine.configure()
    machine.enable(machine.configuration.axes)
    q = arm.home.copy()
    axes = list(machine.configuration.axes)
    lost_before, lost_steps = lost_joints(machine), []
    per_count = np.linalg.pinv(arm.motor_gain)
    for group in _groups_in_order(arm, searches_left):
        for search in [search for search in searches_left if search.joint in group]:
            name = arm.joint_names[search.joint]
            announce(name)
            status, edge = _run_search(machine, search)
            lost_steps.append(_lost_steps(machine, search, edge, was_known=name not in lost_before))
            overshoot = np.array([status.counts[axis] - edge.counts[axis] for axis in axes])
            q[search.joint] = _switch_value(arm, search.joint) + per_count[search.joint] @ overshoot
        _vouch_motors(machine, np.flatnonzero(np.abs(arm.motor_gain[:, group]).sum(axis=1)).tolist(), q)
    if rest_at_home:
        _vouch_motors(machine, [k for k, axis in enumerate(axes) if not machine.status.known >> axis & 1], q)
    return lost_steps


def _groups_in_order(arm: Arm, searches: Sequence[Search]) -> list[list[int]]:
    """Groups of the searched joints that home together, by the first search in each."""
    order = {search.joint: i for i, search in enumerate(searches)}
    firsts = [(min(order[j] for j in group if j in order), group) for group in _coupled_groups(arm, list(order))]
    return [group for _, group in sorted(firsts)]


def _vouch_motors(machine: FirmwareMachine, motors: Sequence[int], q: Array) -> None:
    """State to the board that these motors stand where joint values q (n,) have them."""
    axes = list(machine.configuration.axes)
    machine.vouch(dict(zip([axes[k] for k in motors], pulses(machine.arm, q)[motors].tolist(), strict=True)))


def _lost_steps(machine: FirmwareMachine, search: Search, edge: Status, *, was_known: bool) -> LostSteps:
    """The counts at a switch's edge, compared with its place in the robot file."""
    arm, joint = machine.arm, search.joint
    if not was_known:
        return LostSteps(arm.joint_names[joint], None, None)
    counts = [edge.counts[axis] for axis in machine.configuration.axes]
    gain = arm.motor_gain[:, joint]
    leader = gain[np.abs(gain).argmax()]
    steps = round(float((joints(arm, counts)[joint] - _switch_value(arm, joint)) * leader))
    return LostSteps(arm.joint_names[joint], steps, steps / float(leader))


def _run_search(machine: FirmwareMachine, search: Search) -> tuple[Status, Status]:
    """Carry out one search; returns the status at rest, and the one at the switch's edge (page 1)."""
    session = machine.session
    try:
        session.call(search.frame)
        for _ in session.arrivals(search.time / 10):
            pass
        machine.status = session.status()
        machine.check_late_ticks()
        return machine.status, session.status(page=1)
    except DeviceError as error:
        raise resets_and_stops.explain_error(machine, error) from None


def lost_joints(machine: FirmwareMachine) -> list[str]:
    """Names of the joints that are driven by a motor of unknown position."""
    arm, known_axes = machine.arm, machine.status.known if machine.configured else 0
    lost_motors = [not known_axes >> axis & 1 for axis in machine.configuration.axes]
    is_lost = np.abs(arm.motor_gain[lost_motors]).sum(axis=0) > 0
    return [name for name, unknown in zip(arm.joint_names, is_lost, strict=True) if unknown]


def switch_levels(arm: Arm, configuration: Configuration) -> Callable[[int, Sequence[int]], bool]:
    """The levels of the limit inputs of a simulated arm that was switched on in its home pose.

    Returns a function of an input's number and the net steps of all axes since then.
    """
    switches = configuration.board.switches
    joint_of = {switches.index(homing.switch): j for j, homing in enumerate(arm.homing) if homing is not None}
    start, axes = pulses(arm, arm.home), list(configuration.axes)

    def level(number: int, net: Sequence[int]) -> bool:
        j = joint_of.get(number)
        homing = None if j is None else arm.homing[j]
        if j is None or homing is None:
            return True
        value = joints(arm, start + np.array([net[axis] for axis in axes]))[j]
        is_pressed = (value - _switch_value(arm, j)) * homing.direction >= 0
        return bool(is_pressed) == (homing.normally == "closed")  # a pressed switch opens, or closes to ground

    return level


def _coupled_groups(arm: Arm, joint_numbers: Sequence[int]) -> list[list[int]]:
    """Groups of joints that share motors and so home together, in file order."""
    remaining, groups = set(joint_numbers), []
    while remaining:
        group = {min(remaining)}
        while True:
            motors = np.abs(arm.motor_gain[:, sorted(group)]).sum(axis=1) > 0
            coupled_joints = set(np.flatnonzero(np.abs(arm.motor_gain[motors]).sum(axis=0)).tolist())
            if coupled_joints == group:
                break
            group = coupled_joints
        groups.append(sorted(group))
        remaining -= group
    return groups


def _switch_value(arm: Arm, joint: int) -> float:
    """Joint value at the switch's edge [rad | mm]."""
    homing = arm.homing[joint]
    assert homing is not None
    return float(homing.at * joint_scale(arm)[joint])


def _search_of(arm: Arm, configuration: Configuration, joint: int) -> Search:
    """The search of a joint: rates [counts/s], distances [counts], time [0.1 s].

    Raises UsageError for a value out of the range of the board's integers.
    """
    name, unit, homing = arm.joint_names[joint], float(joint_scale(arm)[joint]), arm.homing[joint]
    assert homing is not None
    board = configuration.board
    gain = arm.motor_gain[:, joint]
    speed = homing.speed * unit
    rate = [0] * len(board.axes)
    for axis, value in zip(configuration.axes, gain * homing.direction * speed, strict=True):
        rate[axis] = int(np.rint(value))
    leader = float(np.abs(gain).max())
    fastest, slowest = max(map(abs, rate)), min((abs(axis_rate) for axis_rate in rate if axis_rate), default=0)
    if fastest > _MAX_COUNTS or slowest < 1:
        raise UsageError(
            f"joint {name}: homing.speed {homing.speed:g} is {leader * speed:.4g} counts/s; 1 to {_MAX_COUNTS} can be"
        )
    backoff = math.ceil(leader * homing.backoff * unit)
    if backoff > _MAX_COUNTS:
        raise UsageError(f"joint {name}: homing.backoff {homing.backoff:g} is {backoff} counts; {_MAX_COUNTS} can be")
    span = float(arm.upper[joint] - arm.lower[joint])
    if not math.isfinite(span):
        if arm.prismatic[joint]:
            raise UsageError(f"joint {name} has no limits: homing would not know how far to look")
        span = 2 * math.pi
    travel = math.ceil(leader * (_SWITCH_RANGES * span + homing.backoff * unit))
    seconds = 2 * _SWITCH_RANGES * span / speed + 4 * backoff / (leader * speed * _SLOW_SPEED / 256) + 5
    return Search(
        joint=joint,
        switch=board.switches.index(homing.switch),
        closed=homing.normally == "closed",
        backoff=max(1, backoff),
        travel=travel,
        time=min(65535, math.ceil(10 * seconds)),
        rate=tuple(rate),
    )
