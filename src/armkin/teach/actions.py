"""Every action of the page, by its name."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from armkin.errors import UsageError
from armkin.model import units
from armkin.teach import request_checks
from armkin.teach.arm_description import first_lock, scene_json, tip_jog_axes
from armkin.teach.page_key import RefusedError
from armkin.teach.program_actions import ProgramActions
from armkin.teach.tabs import Action, Fields, Tab, Tabs

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.teach.board_actions import BoardActions
    from armkin.teach.pose_answers import Question
    from armkin.teach.quick_ik import QuickIk


class Actions:
    """The actions of one run of `armkin teach`, and the state that its pages share: arm, pose, program and control."""

    def __init__(
        self, arm: Arm, port: str | None = None, baud: int | None = None, meshes: dict[str, Any] | None = None
    ) -> None:
        """port: of a board, as `armkin send` takes it; meshes: see `armkin.teach.urdf_meshes.meshes_json`.

        Raises UsageError if the robot file lacks keys for the board.
        """
        self.arm, self.meshes = arm, meshes
        self.board: BoardActions | None = None
        self.tabs = Tabs(self._abandoned)
        self._solving = threading.Lock()  # solve one question at a time, to leave a core for other work
        self._last_answer: dict[str, Any] = {}
        self._quick: QuickIk | None = None
        self.program_actions = ProgramActions(
            arm, self.standing_pulses, lambda state: self.tabs.publish("program", state)
        )
        # actions by name that need no control: every page may stop the arm
        self.for_everyone: dict[str, Callable[[], dict[str, Any]]] = {
            "open": self._open,
            "solver": self._solver,
            "reach": self._reach,
            "stop": self._stop,
        }
        self.for_control: dict[str, Action] = {"look": self._look, **self.program_actions.actions()}  # actions by name
        if port is not None:
            from armkin.teach.board_actions import BoardActions
            from armkin.teach.board_thread import BoardThread

            thread = BoardThread(arm, port, baud, lambda state: self.tabs.publish("board", state))
            self.board = BoardActions(thread, self.program_actions.program.plan)
            self.for_control |= self.board.actions()

    def close(self) -> None:
        """Stop the arm, and close the port."""
        if self.board is not None:
            self.board.thread.close()

    def act(self, name: str, tab_id: str, fields: Fields) -> dict[str, Any]:
        """Carry out an action for a page. Raises RefusedError, or an ArmkinError for an invalid one."""
        if name in self.for_everyone:
            return self.for_everyone[name]()
        tab = self.tabs.find(tab_id)
        if name == "take":
            return self._prepare_first_answer(tab)
        if name not in self.for_control:
            raise RefusedError(404, f"there is no action {name[:40]!r}")
        self.tabs.check_control(tab)
        return self.for_control[name](tab, fields)

    def _solver(self) -> dict[str, Any]:
        from armkin.teach.browser_solver import solver_fields

        return solver_fields(self.arm)

    def _reach(self) -> dict[str, Any]:
        from armkin.teach.reach_slice import reach_slice

        return reach_slice(self.arm)

    def _stop(self) -> dict[str, Any]:
        if self.board is not None:
            self.board.stop()
        return {}

    def _prepare_first_answer(self, tab: Tab) -> dict[str, Any]:
        self.tabs.take_control(tab)
        if self.board is not None:
            self.board.end_follow()
        return {}

    def warm(self) -> None:
        """Prepare the first page's answer while its browser loads the files."""
        from armkin.teach.pose_answers import Question, answer_question

        with self._solving:
            if not self._last_answer:
                held = first_lock(self.arm)
                self._last_answer = answer_question(
                    self.arm, Question(self.arm.home, held=() if held is None else (held,))
                )

    def _open(self) -> dict[str, Any]:
        """What the page needs to begin: scene, last answer, program and board."""
        tab = self.tabs.open()
        self.warm()
        board = None if self.board is None else self.board.thread.state()
        jog_axes = [] if self.board is None else tip_jog_axes(self.arm)
        return {
            "tab": tab.id,
            "scene": scene_json(self.arm) | {"meshes": self.meshes, "jogs": jog_axes},
            "look": self._last_answer,
            "program": self.program_actions.program.state(),
            "board": board,
        }

    def _look(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Answer a pose or a target with all branches, and show it on the other pages.

        `goal`: the user drags or types it, so a following arm goes there. Any other new pose ends following, since the
        next drag would otherwise move the arm to a pose that nobody dragged.
        """
        from armkin.teach.pose_answers import answer_question  # imported late, while the browser loads the page
        from armkin.teach.quick_ik import QuickIk

        question = self._question(fields)
        with self._solving:
            self._quick = self._quick or QuickIk()
            answer = answer_question(self.arm, question, self._quick)
        last_answer, self._last_answer = self._last_answer, answer
        self.tabs.publish("look", answer, except_tab=tab)
        if self.board is None:
            return answer
        if request_checks.flag_field(fields, "goal"):
            if not answer["outside"]:
                self.board.follow_pose(tab, units.joints_in(self.arm, answer["q"]))
        elif not last_answer or answer["q"] != last_answer["q"]:
            self.board.end_follow()
        return answer

    def _question(self, fields: Fields) -> Question:
        """The question in a page's fields. Raises UsageError for invalid fields."""
        from armkin.teach.pose_answers import Question

        arm = self.arm
        q = units.joints_in(arm, request_checks.number_list_field(fields, "q", arm.n))
        held = fields.get("held", [])
        if not isinstance(held, list) or any(name not in arm.joint_names for name in held):
            raise UsageError("held: expected names of joints")
        target = fields.get("target")
        if target is not None:
            count = len(target) if isinstance(target, list) and len(target) <= 6 else 6
            target = request_checks.number_list_field(fields, "target", count)
        return Question(
            q=q,
            target=target,
            held=tuple(name for name in arm.joint_names if name in held),
            branch=request_checks.text_field(fields, "branch") if fields.get("branch") is not None else "",
            best=request_checks.flag_field(fields, "best"),
            nearest=request_checks.flag_field(fields, "nearest"),
            standing_pulses=self.standing_pulses(),
        )

    def standing_pulses(self) -> tuple[int, ...] | None:
        """Pulses of the arm's position; None if unknown."""
        return None if self.board is None else self.board.thread.standing_pulses()

    def _abandoned(self) -> None:
        if self.board is not None:
            self.board.abandoned()
