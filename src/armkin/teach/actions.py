"""One arm and its pages: every action by its name."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from armkin.errors import UsageError
from armkin.model import units
from armkin.teach import request_checks
from armkin.teach.program_actions import Rehearsal
from armkin.teach.request_checks import RefusedError
from armkin.teach.scene import first_lock, scene
from armkin.teach.tabs import Action, Fields, Tab, Tabs

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.teach.board import Board


class Desk:
    """What the pages of one run share: the arm, the pose they show, who holds control."""

    def __init__(self, arm: Arm, port: str | None = None, baud: int | None = None) -> None:
        """port: of a board, as `armkin send` takes it. Raises UsageError if the robot file says too little for it."""
        self.arm = arm
        self.board: Board | None = None
        self.tabs = Tabs(self._abandoned)
        self._solving = threading.Lock()  # one question at a time: two cores are not many
        self._shown: dict[str, Any] = {}
        # Name -> what it does, for the page in control; and what every page may do.
        self.rehearsal = Rehearsal(arm, self.stands, lambda state: self.tabs.tell("program", state))
        self.actions: dict[str, Action] = {"look": self._look, **self.rehearsal.actions()}
        self.free: dict[str, Action] = {"take": self._take, "stop": self._stop}
        if port is not None:
            from armkin.teach.board import Board
            from armkin.teach.board_thread import Pilot

            pilot = Pilot(arm, port, baud, lambda state: self.tabs.tell("board", state))
            self.board = Board(pilot, self.rehearsal.program.plan)
            self.actions |= self.board.actions()

    def close(self) -> None:
        """Stop the arm, give the port back."""
        if self.board is not None:
            self.board.pilot.close()

    def act(self, name: str, tab_id: str, fields: Fields) -> dict[str, Any]:
        """Carry out an action for a page. Raises RefusedError, or an ArmkinError that says what is wrong."""
        if name == "open":
            return self._open()
        if name == "stop":
            return self.free["stop"](Tab(), fields)  # whoever holds the key may stop the arm
        tab = self.tabs.find(tab_id)
        if name in self.free:
            return self.free[name](tab, fields)
        if name not in self.actions:
            raise RefusedError(404, f"there is no action {name[:40]!r}")
        self.tabs.check_control(tab)
        return self.actions[name](tab, fields)

    def warm(self) -> None:
        """Have the first page's answer ready, while its browser still loads the files."""
        from armkin.teach.pose_answers import Question, look

        with self._solving:
            if not self._shown:
                held = first_lock(self.arm)
                self._shown = look(self.arm, Question(self.arm.home, held=() if held is None else (held,)))

    def _open(self) -> dict[str, Any]:
        tab = self.tabs.open()
        self.warm()
        board = None if self.board is None else self.board.pilot.state()
        return {
            "tab": tab.id,
            "scene": scene(self.arm),
            "look": self._shown,
            "program": self.rehearsal.program.state(),
            "board": board,
        }

    def _look(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Where a pose or a target is, with all branches; the other pages see it, too."""
        from armkin.teach.pose_answers import Question, look  # the solver: imported while the browser loads the page

        arm = self.arm
        q = units.joints_in(arm, request_checks.numbers(fields, "q", arm.n))
        held = fields.get("held", [])
        if not isinstance(held, list) or any(name not in arm.joint_names for name in held):
            raise UsageError("held: expected names of joints")
        target = fields.get("target")
        if target is not None:
            count = len(target) if isinstance(target, list) and len(target) <= 6 else 6
            target = request_checks.numbers(fields, "target", count)
        question = Question(
            q,
            target,
            tuple(name for name in arm.joint_names if name in held),
            request_checks.text(fields, "branch") if fields.get("branch") is not None else "",
            request_checks.flag(fields, "best"),
            request_checks.flag(fields, "nearest"),
            self.stands(),
        )
        with self._solving:
            answer = look(arm, question)
        self._shown = answer
        self.tabs.tell("look", answer, but=tab)
        if self.board is not None and not answer["outside"]:
            self.board.shown(units.joints_in(arm, answer["q"]))
        return answer

    def stands(self) -> tuple[int, ...] | None:
        """Pulses where the arm stands; None if nothing is known of it."""
        return None if self.board is None else self.board.pilot.stands()

    def _abandoned(self) -> None:
        if self.board is not None:
            self.board.abandoned()

    def _take(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        self.tabs.take(tab)
        return {}

    def _stop(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        if self.board is not None:
            self.board.stop()
        return {}
