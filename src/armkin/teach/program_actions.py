"""The page's actions on its program: edits, plans for playback, text of the path file."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from armkin.errors import NoSolutionError
from armkin.forward import fk
from armkin.model import units
from armkin.motors import joints as joints_of
from armkin.teach import request_checks
from armkin.teach.plan_samples import playback_json
from armkin.teach.recorded_program import Program

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.teach.tabs import Action, Fields, Tab


class ProgramActions:
    """The program that all pages show; `publish` is called with it on every change."""

    def __init__(
        self, arm: Arm, standing_pulses: Callable[[], tuple[int, ...] | None], publish: Callable[[dict[str, Any]], None]
    ) -> None:
        self.arm, self.program = arm, Program(arm)
        self._standing_pulses, self._publish = standing_pulses, publish
        self._lock = threading.Lock()
        self._planning = threading.Lock()  # one plan at a time; edits do not wait for it

    def actions(self) -> dict[str, Action]:
        """{name: action} for the page in control."""
        return {"program": self.edit, "plan": self.plan, "end": self.end, "save": self.save, "load": self.load}

    def start(self) -> Array | None:
        """Joint values of the arm's position; None if unknown."""
        counts = self._standing_pulses()
        return None if counts is None else joints_of(self.arm, counts)

    def edit(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """One edit of the program."""
        with self._lock:
            self.program.edit(fields)
            return self._publish_program()

    def load(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """Take a path file's text as the program."""
        with self._lock:
            self.program.load(
                request_checks.text_field(fields, "text", request_checks.MAX_BYTES),
                request_checks.text_field(fields, "name"),
            )
            return self._publish_program()

    def save(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """The text of a path file, for `armkin path` and `armkin send`."""
        with self._lock:
            return {"text": self.program.text(), "name": f"{self.arm.name}_path.yaml"}

    def plan(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """The program's motion from the arm's position, or from home if unknown, for playback.

        If it hits something, `refused` has the reason and `hit` the position of the tip there.
        """
        with self._planning:
            with self._lock:
                program = self.program.copied()
            try:
                return playback_json(self.arm, program.plan(self.start()))
            except NoSolutionError as error:
                if "joints" not in error.fields:
                    raise
                q = units.joints_in(self.arm, error.fields["joints"])
                has_motion = error.plan is not None and error.plan.trajectory is not None
                playback = playback_json(self.arm, error.plan) if has_motion else {"tips": []}
                return {**playback, "refused": str(error), "hit": fk(self.arm, q)[:3, 3].round(3).tolist()}

    def end(self, tab: Tab, fields: Fields) -> dict[str, Any]:
        """The joint values at the end of a move."""
        with self._lock:
            program = self.program.copied()
        index = request_checks.index_field(fields, "index", max(len(program.moves), 1))
        q = program.end_of(index, self.start())
        return {"q": units.joints_out(self.arm, q).tolist()}

    def _publish_program(self) -> dict[str, Any]:
        state = self.program.state()
        self._publish(state)
        return state
