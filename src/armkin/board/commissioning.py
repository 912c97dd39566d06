"""The first hour of an arm on its board: directions, zeros, limits, and a first move that comes back home.

Every motion before the last one is a jog that lasts as long as a key is held, at a tenth of the joint's speed. What is
found is not applied here: it is `Findings`, for the robot file.
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

SPEED_SHARE = 0.1  # share of a joint's max_speed for all that moves here
DIRECTION_STEP = 2.0  # way [deg | mm] that a joint may leave its place while its direction is looked at
_FIRST_DISTANCE = 5.0  # way [deg | mm] that each joint leaves home in the first move
_MAX_JOG = 60.0  # length [s], at most, of one jog
_VISIBLE_DISTANCE = 1.0  # way [mm] that the tool must move to tell a direction by it


class Operator(Protocol):
    """Who stands beside the arm."""

    def say(self, text: str) -> None:
        """Something to read."""

    def ask(self, question: str, answers: str) -> str:
        """A question that one of some keys answers."""

    def key(self) -> str:
        """The next key: a character, ``+`` and ``-`` also for arrows, a line feed for Enter."""

    def held(self, key: str) -> Callable[[], bool] | None:
        """Whether a key is still held, asked again and again; None if it was pressed and let go at once."""


@dataclass
class Findings:
    """What the robot file does not say, or says otherwise."""

    inverted: set[int] = field(default_factory=set)  # motors whose direction is the other one
    zeros: dict[int, int] = field(default_factory=dict)  # motor -> count where its joint is 0
    limits: dict[int, tuple[float, float]] = field(default_factory=dict)  # joint -> [deg | mm]
    at_home: bool | None = None  # whether the arm came back


def directions(board: Board, person: Operator) -> set[int]:
    """The motors that turn the other way than the robot file says: each joint moves by 2 degrees or mm at most."""
    arm, wrong = board.arm, set()
    _able_to_jog(board, person)
    person.say("Directions: hold + to move a joint by up to 2 degrees (mm), - to take it back; Enter when you saw it.")
    for j, name in enumerate(arm.joint_names):
        person.say(
            f"{name}, +: {_expected_motion(arm, board.machine.joints() if _position_known(board) else arm.home, j)}"
        )
        board.machine.refresh()
        place = float(board.machine.joints()[j])
        while True:
            _nudge_joint(board, person, j, place)
            answer = person.ask(f"{name}: did + move it so? y yes, n the other way, a again, s skip", "ynas")
            if answer != "a":
                break
        if answer == "n":
            wrong |= _motors_of(arm, j, person)
    return wrong


def zeros(board: Board, person: Operator, *, forget: bool = False) -> dict[int, int]:
    """Have the arm stand in its home pose and its board know it; bus servos: the counts where joints are 0.

    forget: what the board believed was counted in wrong directions.
    """
    arm, machine = board.arm, board.machine
    if forget:
        board.forget()
    home = ", ".join(f"{n} = {v:g}" for n, v in zip(arm.joint_names, units.joints_out(arm, arm.home), strict=True))
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
    """Narrower limits for joints that cannot go as far as the robot file says."""
    person.say("Limits: go where a joint may not go farther, then [ makes that its lower limit, ] its upper one.")
    person.say("The file's limits stop it, too. Enter when there is nothing more to correct.")
    return jog_by_keys(board, person, narrower=True)


def first_move(board: Board, person: Operator) -> bool:
    """Leave home by a few degrees and come back, planned, at a tenth of the speed; whether the arm stands at home."""
    arm, machine = board.arm, board.machine
    machine.prepare()
    up, down = arm.upper - arm.home, arm.home - arm.lower
    excursion = np.minimum(units.joints_in(arm, [_FIRST_DISTANCE] * arm.n), 0.5 * np.maximum(up, down))
    goals = np.array([arm.home + np.where(up >= down, excursion, -excursion), arm.home])
    try:
        made = board.plan(machine.counts(), goals, SPEED_SHARE)
    except NoSolutionError as error:
        person.say(f"The way out of home is not free ({error.message.splitlines()[0]}): the arm moves home only.")
        made = board.plan(machine.counts(), arm.home[None], SPEED_SHARE)
    question = f"First move: {made.duration:.1f} s out and back home by itself, Ctrl-C stops it. y: go; s: skip"
    if person.ask(question, "ys") == "s":
        return False
    machine.run([made])
    return person.ask("Check: does it stand in its home pose again, to the mark? y yes, n no", "yn") == "y"


def jog_by_keys(board: Board, person: Operator, *, narrower: bool = False) -> dict[int, tuple[float, float]]:
    """Joints by keys: a number chooses one, + and - move it while they are held, Enter ends.

    narrower: [ and ] make where a joint stands its lower or upper limit; these are returned.
    """
    arm, chosen = board.arm, 0
    limits_set: dict[int, tuple[float, float]] = {}
    names = ", ".join(f"{_KEYS[j]} {name}" for j, name in enumerate(arm.joint_names))
    person.say(f"Joints: {names}; hold + or - to move the chosen one.")
    person.say(f"{arm.joint_names[chosen]} is chosen.")
    while (key := person.key()) != "\n":
        if key in _KEYS[: arm.n]:
            chosen = _KEYS.index(key)
            person.say(f"{arm.joint_names[chosen]} is chosen.")
        elif key in "+-" and (more := person.held(key)) is not None:
            _jog_joint(board, person, chosen, 1 if key == "+" else -1, _MAX_JOG, more)
            person.say(_position_in_words(board))
        elif narrower and key in "[]":
            _narrow_limit(board, person, limits_set, chosen, upper=key == "]")
    return limits_set


_KEYS = "123456789abc"  # keys of up to twelve joints


def _narrow_limit(
    board: Board, person: Operator, limits: dict[int, tuple[float, float]], j: int, *, upper: bool
) -> None:
    """Make where joint j stands its limit, rounded inwards to a tenth."""
    arm, name = board.arm, board.arm.joint_names[j]
    rows = np.stack([arm.lower, arm.upper, arm.home, board.machine.joints()])
    low, high, home, standing = (round(value, 9) for value in units.joints_out(arm, rows)[:, j].tolist())
    low, high = limits.get(j, (low, high))
    value = round(float(np.floor(standing * 10 + 1e-6) if upper else np.ceil(standing * 10 - 1e-6)) / 10, 1) + 0.0
    pair = (low, value) if upper else (value, high)
    if not np.isfinite(pair).all():
        person.say(f"{name} has no limits in the file: write both there, limits: [LOWER, UPPER], then begin again.")
    elif not pair[0] <= home <= pair[1] or pair[0] >= pair[1]:
        person.say(f"{name}: {pair[0]:g} to {pair[1]:g} would leave its home ({home:g}) out: not taken.")
    else:
        limits[j] = pair
        person.say(f"{name}: limits {pair[0]:g} to {pair[1]:g}.")


def _able_to_jog(board: Board, person: Operator) -> None:
    """Have a board whose kind moves nothing while the position is lost take the arm to stand at home."""
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
        return  # the joint stands at its limit: the other way is open


def _until_enter(person: Operator, text: str) -> None:
    person.say(text)
    while person.key() != "\n":
        pass


def _nudge_joint(board: Board, person: Operator, j: int, place: float) -> None:
    """Move joint j by keys within DIRECTION_STEP of its place [rad | mm]; each way back stops there; Enter ends."""
    arm, machine = board.arm, board.machine
    step = float(units.joints_in(arm, [DIRECTION_STEP] * arm.n)[j])
    while (key := person.key()) != "\n":
        if key not in "+-" or (more := person.held(key)) is None:
            continue
        sign = 1 if key == "+" else -1
        away = sign * (float(machine.joints()[j]) - place)
        seconds = (step - away if away > -0.1 * step else -away) / (SPEED_SHARE * float(arm.max_speed[j]))
        if seconds > 0.01:
            _jog_joint(board, person, j, sign, seconds, more)
        else:
            back = "-+"[sign < 0]
            person.say(f"{arm.joint_names[j]} has moved by {DIRECTION_STEP:g}: {back} takes it back, Enter goes on.")


def _jog_joint(board: Board, person: Operator, j: int, sign: int, seconds: float, goes_on: Callable[[], bool]) -> None:
    """Jog a joint at a tenth of its speed; what stops it is told."""
    rate = sign * SPEED_SHARE * float(board.arm.max_speed[j])
    try:
        board.jog(j, board.ready_to_jog(j, rate), seconds, goes_on)
    except NoSolutionError as error:
        person.say(error.message.splitlines()[0])
    board.machine.refresh()


def _position_known(board: Board) -> bool:
    return board.machine.position() != "lost"


def _position_in_words(board: Board) -> str:
    """Where the arm stands, in words."""
    q = where_arm_stands(board.machine)["joints"]
    if q is None:
        return "moved; its position is not known yet"
    return ", ".join(f"{name} = {value:.2f}" for name, value in zip(board.arm.joint_names, q, strict=True))


def _expected_motion(arm: Arm, q: Array, j: int) -> str:
    """What 2 degrees (mm) of a joint do, in the base's frame: ``the tool goes 6.9 mm towards +y``."""
    J = jacobian(arm, q)[:, j] * float(units.joints_in(arm, [DIRECTION_STEP] * arm.n)[j])
    shift = J[:3]
    if float(np.linalg.norm(shift)) >= _VISIBLE_DISTANCE:
        return f"the tool goes {float(np.linalg.norm(shift)):.1f} mm, mostly towards {_main_direction(shift)}"
    axis = fk(arm, q)[:3, :3].T @ J[3:]
    about = _main_direction(J[3:])
    remark = " (the tool's own z)" if abs(axis[2]) > 0.99 * float(np.linalg.norm(axis)) else ""
    turn = "counter-clockwise" if about[0] == "+" else "clockwise"
    return f"the tool turns {turn} about {about[1]}{remark}, seen with {about[1]} pointing at you"


def _main_direction(vector: Array) -> str:
    k = int(np.argmax(np.abs(vector)))
    return f"{'+' if vector[k] > 0 else '-'}{'xyz'[k]}"


def _motors_of(arm: Arm, j: int, person: Operator) -> set[int]:
    """The motors that turn joint j alone; of motors that several joints share nothing is concluded."""
    mine = {k for k in range(len(arm.motors)) if arm.motor_gain[k, j]}
    shared = [arm.motors[k].name for k in mine if np.count_nonzero(arm.motor_gain[k]) > 1]
    if shared:
        person.say(
            f"{arm.joint_names[j]} shares its motors ({', '.join(sorted(shared))}): which is wrong follows from all "
            "its joints together; correct invert: or joints: of these motors in the file by hand."
        )
        return set()
    return mine
