"""The actions of a page on the board: send a pose, home, jog, grip, follow; each is refused unless it is safe."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.board import path_run
from armkin.errors import ArmkinError, FileError, LinkError, NoSolutionError, UsageError
from armkin.model import units
from armkin.model.limits import check_limits
from armkin.robot_file.catalogue import locate
from armkin.teach import request_checks
from armkin.teach.page_key import RefusedError

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.backend.board import Board
    from armkin.formula.arrays import Array
    from armkin.motion.path_planner.jog_line import Frame
    from armkin.motion.plan.path_plan import PathPlan
    from armkin.teach.board_thread import BoardThread, Job
    from armkin.teach.tabs import Action, Fields, Tab

DEAD_MAN = 0.3  # time [s] of a jog after the last request of its page
FOLLOW_SPEED = 0.15  # share of every joint's max_speed
FOLLOW_HOP = 5.0  # longest move [deg | 2 mm] of the fastest joint until the arm looks for a new goal
_LONGEST_JOG = 60.0  # longest jog [s]


class BoardActions:
    """The actions on a board, as jobs for its thread."""

    def __init__(self, thread: BoardThread, program: Callable[[Array, float], PathPlan]) -> None:
        """program: the motion of the page's program from joint values (n,) [rad | mm], at a fraction of its speed."""
        self.thread, self.arm, self.program = thread, thread.arm, program
        self._alive = 0.0  # time at which a jog ends
        self._goal: Array | None = None
        self._lock = threading.Lock()

    def actions(self) -> dict[str, Action]:
        """{name: action} for the page in control. Each except `follow` ends following, even if it is refused."""
        others = {
            "connect": self.connect,
            "send": self.send,
            "run": self.run_program,
            "assume_home": self.assume_home,
            "home": self.home,
            "jog": self.jog,
            "jog_on": self.jog_on,
            "jog_end": self.jog_end,
            "grip": self.grip,
        }
        return {"follow": self.follow, **{name: self._ending_follow(action) for name, action in others.items()}}

    def _ending_follow(self, action: Action) -> Action:
        def act(tab: Tab, fields: Fields) -> dict[str, Any]:
            self.end_follow()
            return action(tab, fields)

        return act

    def stop(self) -> None:
        """STOP: hold the arm and end following."""
        self._alive = 0.0
        self.thread.stop()
        self.end_follow()

    def abandoned(self) -> None:
        """End all motion after the page in control was closed."""
        self._alive = 0.0
        self.thread.abandoned()
        self.end_follow()

    def connect(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Open the port again."""
        self.thread.submit("connect", lambda machine: None)
        return {}

    def send(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Move to joint values, at a percentage of the joints' speeds."""
        arm = self.arm
        q = units.joints_in(arm, request_checks.number_list_field(fields, "q", arm.n))
        speed = request_checks.number_field(fields, "speed", 1, 100) / 100
        check_limits(arm, q[None])
        self.check_file()
        self.thread.submit("send", lambda machine: self.run(machine, q[None], speed))
        return {}

    def run_program(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Carry out the page's program from the arm's position."""
        speed = request_checks.number_field(fields, "speed", 1, 100) / 100
        self.check_file()
        self.thread.submit("run", lambda machine: self._run_program(machine, speed))
        return {}

    def assume_home(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Accept the operator's statement that the arm stands in its home pose."""
        if not request_checks.flag_field(fields, "consent"):
            raise UsageError("say first that the arm stands in its home pose")
        self.check_file()

        def job(machine: Backend) -> None:
            machine.prepare(assume=self.arm.home)

        self.thread.submit("assume home", job)
        return {}

    def home(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Find the limit switches."""
        board = self.thread.board
        board.check_home()
        self.check_file()
        self.thread.submit("home", lambda machine: _run_homing(board))
        return {}

    def jog(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Begin a jog of a joint, or of the tip along an axis, that lasts while `jog_on` arrives in time.

        Each press of a button begins at most one jog, so that a late `jog_on`, or a request that arrives after the
        release, does not move the arm.
        """
        press = _press_number(fields)
        percent = request_checks.number_field(fields, "percent", -100, 100)
        if percent == 0:
            raise UsageError("percent: 0 is no jog")
        job = self._jog_of(fields, percent)
        self.check_file()
        with self._lock:  # the job reads its deadline as soon as it is submitted
            if press > tab.press:
                tab.press = press
                self.thread.submit("jog", job)
                self._alive = time.monotonic() + DEAD_MAN
        return {}

    def _jog_of(self, fields: Fields, percent: float) -> Job:
        """The job that jogs the joint or the tip in the fields."""
        if "axis" not in fields:
            joint = request_checks.index_field(fields, "joint", self.arm.n)
            return lambda machine: self._jog(machine, joint, percent)
        from armkin.motion.path_planner.jog_line import jog_axes

        axis, frame = request_checks.text_field(fields, "axis", 10), request_checks.text_field(fields, "frame", 10)
        if axis not in jog_axes(self.arm) or frame not in ("base", "tool"):
            raise UsageError(f"axis, frame: expected one of {', '.join(jog_axes(self.arm))}, and base or tool")
        tool: Frame = "tool" if frame == "tool" else "base"
        return lambda machine: self._jog_tip(machine, axis, tool, percent / 100)

    def jog_on(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Extend the jog of a held button, unless its deadline has passed."""
        press = _press_number(fields)
        with self._lock:
            now = time.monotonic()
            if press == tab.press and now < self._alive:
                self._alive = now + DEAD_MAN
        return {}

    def jog_end(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """End the jog of a released button, and ignore later requests of that press."""
        press = _press_number(fields)
        with self._lock:
            tab.press = max(tab.press, press)
            self._alive = 0.0
        return {}

    def grip(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Open or close the gripper, or move it to a value; `assume`: take a lost gripper to be open."""
        value = fields.get("value")
        if isinstance(value, str) and value not in ("open", "closed"):
            raise UsageError("value: expected open, closed or a number")
        target = value if isinstance(value, str) else request_checks.number_field(fields, "value", -1e6, 1e6)
        board = self.thread.board
        board.check_grip(target)
        assume = request_checks.flag_field(fields, "assume")
        self.check_file()
        self.thread.submit("grip", lambda machine: _move_gripper(self.thread.board, target, assume))
        return {}

    def follow(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Let the arm slowly follow poses that are dragged or typed in this page; off at every start."""
        follows = request_checks.flag_field(fields, "on")
        if follows and self.thread.standing_pulses() is None:
            raise LinkError("the arm's position is not known: it does not follow from there")
        self._goal = None
        self.thread.set_follower(tab.id if follows else "")
        return {"on": follows}

    def end_follow(self) -> None:
        """End following; a move in progress is completed."""
        self._goal = None
        self.thread.set_follower("")

    def follow_pose(self, tab: Tab, q: Array) -> None:
        """Set the goal of a following arm to a pose within limits that was dragged or typed in its page."""
        with self._lock:
            if self.thread.follower != tab.id:
                return
            self._goal = q
            if self.thread.doing:
                return
            self.check_file()
            with suppress(RefusedError):  # another job has begun since
                self.thread.submit("follow", self._follow)

    def check_file(self) -> None:
        """Raise FileError if the robot file has changed since the page was made."""
        if not self.arm.path:
            return
        try:
            content = Path(locate(self.arm.path)).read_bytes()
        except OSError as error:
            raise FileError(f"{self.arm.path}: {error.strerror}: the arm was not moved") from None
        if hashlib.sha256(content).hexdigest() != self.arm.sha256:
            raise FileError(f"{self.arm.path} has changed: start armkin teach again, the arm was not moved")

    def run(self, machine: Backend, goals: Array, speed: float) -> None:
        """Move through joint values (w, n), stopping at each."""
        _prepare_motors(machine)
        plan = machine.plan(machine.counts(), goals, speed=speed)
        self.thread.parts = [plan.trajectory]
        machine.run([plan], self._report_progress)

    def _run_program(self, machine: Backend, speed: float) -> None:
        """Plan and check all parts before the first one moves, and run them with the gripper moves between."""
        _prepare_motors(machine)
        plan = self.program(machine.joints(), speed)
        path_run.check_gripper(plan, self.thread.board)
        path_run.check_pauses(plan, answers=False)
        board = self.thread.board
        self._carry_out(plan, path_run.plan_parts(plan, machine.counts(), board.plan_trajectory))

    def _carry_out(self, plan: PathPlan, parts: list[Planned]) -> None:
        self.thread.parts = [part.trajectory for part in parts]
        path_run.follow_plan(self.thread.board, plan, parts, self._report_progress)

    def _jog(self, machine: Backend, joint: int, percent: float) -> None:
        board = self.thread.board
        rate = board.ready_to_jog(joint, percent / 100 * float(self.arm.max_speed[joint]))
        board.jog(joint, rate, _LONGEST_JOG, self._held_down)

    def _jog_tip(self, machine: Backend, axis: str, frame: Frame, share: float) -> None:
        """Move along lines of an axis, each planned to a rest, and hold the arm when the button is released."""
        from armkin.motion.path_planner.jog_line import jog_line

        _prepare_motors(machine)
        end_text = ""
        while not end_text and self._held_down():
            plan, end_text = jog_line(self.arm, machine.joints(), axis, frame, share)
            parts = path_run.plan_parts(plan, machine.counts(), self.thread.board.plan_trajectory)
            with self.thread.held_motion(lambda: not self._held_down()):
                self._carry_out(plan, parts)
        if end_text and self._held_down():
            raise NoSolutionError(f"the jog ends: {end_text}")

    def _held_down(self) -> bool:
        """Whether the jog's deadline has not passed, so its button counts as held."""
        with self._lock:
            return time.monotonic() < self._alive

    def _follow(self, machine: Backend) -> None:
        """Move in short steps towards the newest goal, so that each step ends near the present goal."""
        scale = np.where(self.arm.prismatic, 0.5, 180 / np.pi) / FOLLOW_HOP
        try:
            while (goal := self._goal) is not None and self.thread.follower:
                present = machine.joints()
                steps = float((np.abs(goal - present) * scale).max())
                self.run(machine, (present + (goal - present) / max(steps, 1.0))[None], FOLLOW_SPEED)
                with self._lock:
                    if steps <= 1.0 and goal is self._goal:
                        self._goal = None
        except ArmkinError:
            self.end_follow()
            raise

    def _report_progress(self, elapsed: float, total: float) -> None:
        self.thread.progress, self.thread.progress_seconds = (round(elapsed, 1), round(total, 1)), elapsed


def _press_number(fields: Fields) -> int:
    """The number of the press of a jog's button, as counted by the page."""
    return request_checks.index_field(fields, "press", 2**31)


def _prepare_motors(machine: Backend) -> None:
    """Switch the motors on. Raises LinkError if the position is lost."""
    if machine.position() == "lost" and not machine.port.simulated:
        raise LinkError("the arm's position is lost: home it, or put it in its home pose and say so; it was not moved")
    machine.prepare()


def _move_gripper(board: Board, value: str | float, assume: bool) -> None:
    """Move the gripper; assume: take a lost gripper to be open."""
    is_known = board.grip_known()
    if not is_known and not assume:
        raise LinkError(
            "the gripper's position is lost: say first that it stands open\n"
            "a servo jumps there at once, at its full speed: keep your fingers out"
        )
    board.grip(value, None if is_known else "open")


def _run_homing(board: Board) -> None:
    board.home()
