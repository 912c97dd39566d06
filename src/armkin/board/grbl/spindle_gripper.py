"""Drives a gripper by GRBL's M3 output: a servo (with the grbl-servo builds), a pump or a magnet.

GRBL sets one pin to the share S / $30 of its range, and measures nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from armkin.board.grbl import replies
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.grbl.grbl_session import Session
    from armkin.robot_file.robot_keys import Gripper

GRIP_TIME = 0.5  # time [s] of a gripper without max_speed


class Spindle:
    """The M3 output of the GRBL board of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        answer = (replies.parse_spindle(line) for line in session.ask("$G"))
        # the active S word; None: off, or unknown
        self.value = next((speed for speed in answer if speed is not None), None)

    def grip(self, gripper: Gripper, value: float, settings: Mapping[int, float]) -> float:
        """Set an S word, wait for the gripper, and return the word.

        Raises LinkError, before anything is sent, if GRBL's settings do not allow this word.
        """
        for number, forbids in ((30, settings.get(30, value) < value), (32, settings.get(32, 0.0) != 0)):
            if forbids:
                setting_text = f"${number} is {settings[number]:g}"
                raise LinkError(
                    f"GRBL does not give out S {value:g}: {setting_text} ($30: its greatest S, $32: laser mode)"
                )
        speed = gripper.max_speed
        seconds = GRIP_TIME if speed is None else abs(gripper.closed - gripper.open) / speed
        self._session.ask(f"M3S{value:.3f}", patience=seconds + 5.0)
        self.value = value
        self._session.ask(f"G4P{seconds:.3f}", patience=seconds + 5.0)
        return value

    def regrip(self) -> None:
        """Restore the S word after a reset, which switches M3 off, unless GRBL is in an alarm."""
        report = self._session.report
        if self.value is not None and report is not None and report.state != "Alarm":
            self._session.ask(f"M3S{self.value:.3f}")
