"""Commissioning of an arm on its board: directions, zeros, limits, and a first move out of home and back.

Every motion before that move is a jog at a tenth of the joint's speed that lasts as long as a key is held. The results
are not applied here: `Findings` collects them for the robot file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from armkin.board.planner import where_arm_stands
from armkin.errors import NoSolutionError, PositionLostError, UsageError
from armkin.forward import fk, jacobian
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend.board import Board
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

SPEED_SHARE = 0.1  # share of a joint's max_speed of all motions here
DIRECTION_STEP = 2.0  # largest joint travel [deg | mm] in the test of a direction
_FIRST_DISTANCE = 5.0  # joint travel [deg | mm] of the first move
_MAX_JOG = 60.0  # longest jog [s]
_VISIBLE_DISTANCE = 1.0  # smallest tool travel [mm] that shows a direction


class Operator(Protocol):
    """The person beside the arm, who reads messages and presses keys."""

    def say(self, text: str) -> None:
        """Show a message."""

    def ask(self, question: str, answers: str) -> str:
        """Ask a question, and return the key among `answers` that answers it."""

    def key(self) -> str:
        """The next key: a character, ``+`` and ``-`` also for arrow keys, a line feed for Enter."""

    def held(self, key: str) -> Callable[[], bool] | None:
        """A function that tells whether the key is still held; None if it was released at once."""


@dataclass
class Findings:
    """Corrections and additions to the robot file."""

    inverted: set[int] = field(default_factory=set)  # motors with the opposite direction
    zeros: dict[int, int] = field(default_factory=dict)  # motor: count where its joint is 0
    limits: dict[int, tuple[float, float]] = field(default_factory=dict)  # joint: lower and upper limit [deg | mm]
    at_home: bool | None = None  # whether the first move came back to the home pose


def directions(board: Board, person: Operator) -> set[int]:
    """The motors whose direction differs from the robot file, found by moving each joint by up to 2 degrees or mm."""
    arm, inverted_motors = board.arm, set()
    _able_to_jog(board, person)
    person.say("Directions: hold + to move a joint by up to 2 degrees (mm), - to take it back; Enter when you saw it.")
    for joint, name in enumerate(arm.joint_names):
        person.say(
            f"{name}, +: {_expected_motion(arm, board.machine.joints() if _position_known(board) else arm.home, joint)}"
        )
        board.machine.refresh()
        start = float(board.machine.joints()[joint])
        while True:
            _nudge_joint(board, person, joint, start)
            answer = person.ask(f"{name}: did + move it so? y yes, n the other way, a again, s skip", "ynas")
            if answer != "a":
                break
        if answer == "n":
            inverted_motors |= _motors_of(arm, joint, person)
    return inverted_motors


def zeros(board: Board, person: Operator, *, forget: bool = False) -> dict[int, int]:
    """Bring the arm to its home pose and set the board's position; for bus servos the counts where joints are 0.

    forget: drop the board's position, which was counted in wrong directions.
    """
    arm, machine = board.arm, board.machine
    if forget:
        board.adopt_robot_file()
    home_values = units.joints_out(arm, arm.home)
    home = ", ".join(f"{name} = {value:g}" for name, value in zip(arm.joint_names, home_values, strict=True))
    if board.can("zero") and np.count_nonzero(arm.motor_gain) == arm.n:
        question = f"Zeros: hold the arm, its servos will be switched off. y: off; s: keep the file's zeros ({home})"
        if person.ask(question, "ys") == "s":
            return {}
        board.relax()
        _until_enter(person, f"Put it into its home pose by hand ({home}), then press Enter.")
        counts = np.array(board.zero(None)[0]) - arm.motor_gain @ arm.home
        return dict(enumerate(np.rint(counts).astype(int).tolist()))
    _able_to_jog(board, person)
    machine.refresh()
    if _position_known(board):
        person.say(f"Zeros: the board knows where the arm stands: {_position_in_words(board)}.")
        if person.ask("Does it stand so? y yes, n no", "yn") == "n":
            raise UsageError(
                "the board has another position than the arm stands in: home it (armkin home), or switch the board off "
                "and on so that it forgets, then begin again"
            )
        return {}
    person.say(f"Zeros: bring each joint to its home pose ({home}), by eye or to its mark, then press Enter.")
    jog_by_keys(board, person)
    machine.prepare(assume=arm.home)
    return {}


def limits(board: Board, person: Operator) -> dict[int, tuple[float, float]]:
    """Narrower limits for joints that cannot use the whole range in the robot file."""
    person.say("Limits: go where a joint may not go farther, then [ makes that its lower limit, ] its upper one.")
    person.say("The file's limits stop it, too. Enter when there is nothing more to correct.")
    return jog_by_keys(board, person, narrower=True)


def first_move(board: Board, person: Operator) -> bool:
    """Move out of home by a few degrees and back at a tenth of the speed; whether the arm is at home afterwards."""
    arm, machine = board.arm, board.machine
    machine.prepare()
    range_above, range_below = arm.upper - arm.home, arm.home - arm.lower
    excursion = np.minimum(units.joints_in(arm, [_FIRST_DISTANCE] * arm.n), 0.5 * np.maximum(range_above, range_below))
    goals = np.array([arm.home + np.where(range_above >= range_below, excursion, -excursion), arm.home])
    try:
        plan = board.plan(machine.counts(), goals, SPEED_SHARE)
    except NoSolutionError as error:
        person.say(f"The way out of home is not free ({error.message.splitlines()[0]}): the arm moves home only.")
        plan = board.plan(machine.counts(), arm.home[None], SPEED_SHARE)
    question = f"First move: {plan.duration:.1f} s out and back home by itself, Ctrl-C stops it. y: go; s: skip"
    if person.ask(question, "ys") == "s":
        return False
    machine.run([plan])
    return person.ask("Check: does it stand in its home pose again, to the mark? y yes, n no", "yn") == "y"


def jog_by_keys(board: Board, person: Operator, *, narrower: bool = False) -> dict[int, tuple[float, float]]:
    """Jog joints by keys: a number chooses a joint, + and - move it while they are held, Enter ends.

    narrower: [ and ] set the lower or upper limit to the joint's present value. Returns these limits.
    """
    arm, joint = board.arm, 0
    limits_set: dict[int, tuple[float, float]] = {}
    names = ", ".join(f"{_KEYS[number]} {name}" for number, name in enumerate(arm.joint_names))
    person.say(f"Joints: {names}; hold + or - to move the chosen one.")
    person.say(f"{arm.joint_names[joint]} is chosen.")
    while (key := person.key()) != "\n":
        if key in _KEYS[: arm.n]:
            joint = _KEYS.index(key)
            person.say(f"{arm.joint_names[joint]} is chosen.")
        elif key in "+-" and (is_held := person.held(key)) is not None:
            _jog_joint(board, person, joint, 1 if key == "+" else -1, _MAX_JOG, is_held)
            person.say(_position_in_words(board))
        elif narrower and key in "[]":
            _narrow_limit(board, person, limits_set, joint, upper=key == "]")
    return limits_set


_KEYS = "123456789abc"  # keys of up to twelve joints


def _narrow_limit(
    board: Board, person: Operator, limits: dict[int, tuple[float, float]], joint: int, *, upper: bool
) -> None:
    """Set a limit of a joint to its present value, rounded inwards to a tenth."""
    arm, name = board.arm, board.arm.joint_names[joint]
    rows = np.stack([arm.lower, arm.upper, arm.home, board.machine.joints()])
    low, high, home, present = (round(value, 9) for value in units.joints_out(arm, rows)[:, joint].tolist())
    low, high = limits.get(joint, (low, high))
    value = round(float(np.floor(present * 10 + 1e-6) if upper else np.ceil(present * 10 - 1e-6)) / 10, 1) + 0.0
    pair = (low, value) if upper else (value, high)
    if not np.isfinite(pair).all():
        person.say(f"{name} has no limits in the file: write both there, limits: [LOWER, UPPER], then begin again.")
    elif not pair[0] <= home <= pair[1] or pair[0] >= pair[1]:
        person.say(f"{name}: {pair[0]:g} to {pair[1]:g} would leave its home ({home:g}) out: not taken.")
    else:
        limits[joint] = pair
        person.say(f"{name}: limits {pair[0]:g} to {pair[1]:g}.")


def _able_to_jog(board: Board, person: Operator) -> None:
    """Get ready to jog; if the board needs a position for that, ask for the arm in its home pose."""
    try:
        board.ready_to_jog(0, float(SPEED_SHARE * board.arm.max_speed[0]))
    except PositionLostError:
        _until_enter(
            person,
            f"The position is lost, and {board.called} moves nothing so. With the motors' power off put the arm into "
            "its home pose by hand, switch the power on, then press Enter: it is taken to stand there.",
        )
        board.machine.prepare(assume=board.arm.home)
    except NoSolutionError:
        return  # the joint is at its limit and can move the other way


def _until_enter(person: Operator, text: str) -> None:
    person.say(text)
    while person.key() != "\n":
        pass


def _nudge_joint(board: Board, person: Operator, joint: int, start: float) -> None:
    """Move a joint by keys within DIRECTION_STEP of its start [rad | mm], stopping there on the return; Enter ends."""
    arm, machine = board.arm, board.machine
    step = float(units.joints_in(arm, [DIRECTION_STEP] * arm.n)[joint])
    while (key := person.key()) != "\n":
        if key not in "+-" or (is_held := person.held(key)) is None:
            continue
        sign = 1 if key == "+" else -1
        travel = sign * (float(machine.joints()[joint]) - start)
        seconds = (step - travel if travel > -0.1 * step else -travel) / (SPEED_SHARE * float(arm.max_speed[joint]))
        if seconds > 0.01:
            _jog_joint(board, person, joint, sign, seconds, is_held)
        else:
            reverse = "-+"[sign < 0]
            person.say(
                f"{arm.joint_names[joint]} has moved by {DIRECTION_STEP:g}: {reverse} takes it back, Enter goes on."
            )


def _jog_joint(
    board: Board, person: Operator, joint: int, sign: int, seconds: float, goes_on: Callable[[], bool]
) -> None:
    """Jog a joint at a tenth of its speed, and show the message of an error that stops it."""
    rate = sign * SPEED_SHARE * float(board.arm.max_speed[joint])
    try:
        board.jog(joint, board.ready_to_jog(joint, rate), seconds, goes_on)
    except NoSolutionError as error:
        person.say(error.message.splitlines()[0])
    board.machine.refresh()


def _position_known(board: Board) -> bool:
    return board.machine.position() != "lost"


def _position_in_words(board: Board) -> str:
    """The arm's position in words."""
    q = where_arm_stands(board.machine)["joints"]
    if q is None:
        return "moved; its position is not known yet"
    return ", ".join(f"{name} = {value:.2f}" for name, value in zip(board.arm.joint_names, q, strict=True))


def _expected_motion(arm: Arm, q: Array, joint: int) -> str:
    """The tool's motion for 2 degrees (mm) of a joint, in the base: ``the tool goes 6.9 mm towards +y``."""
    J = jacobian(arm, q)[:, joint] * float(units.joints_in(arm, [DIRECTION_STEP] * arm.n)[joint])
    shift = J[:3]
    if float(np.linalg.norm(shift)) >= _VISIBLE_DISTANCE:
        return f"the tool goes {float(np.linalg.norm(shift)):.1f} mm, mostly towards {_main_direction(shift)}"
    axis = fk(arm, q)[:3, :3].T @ J[3:]
    axis_name = _main_direction(J[3:])
    remark = " (the tool's own z)" if abs(axis[2]) > 0.99 * float(np.linalg.norm(axis)) else ""
    turn = "counter-clockwise" if axis_name[0] == "+" else "clockwise"
    return f"the tool turns {turn} about {axis_name[1]}{remark}, seen with {axis_name[1]} pointing at you"


def _main_direction(vector: Array) -> str:
    axis = int(np.argmax(np.abs(vector)))
    return f"{'+' if vector[axis] > 0 else '-'}{'xyz'[axis]}"


def _motors_of(arm: Arm, joint: int, person: Operator) -> set[int]:
    """The motors that drive a joint alone; none, with a message, if the joint shares its motors."""
    motors = {motor for motor in range(len(arm.motors)) if arm.motor_gain[motor, joint]}
    shared = [arm.motors[motor].name for motor in motors if np.count_nonzero(arm.motor_gain[motor]) > 1]
    if shared:
        person.say(
            f"{arm.joint_names[joint]} shares its motors ({', '.join(sorted(shared))}): which is wrong "
            "follows from all its joints together; correct invert: or joints: of these motors in the file by hand."
        )
        return set()
    return motors
