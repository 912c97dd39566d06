"""GRBL's M3 output, on which a gripper hangs: a servo (with the grbl-servo builds), a pump, a magnet.

GRBL gives out a share S / $30 of its range on one pin and measures nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from armkin.board.grbl import replies
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.grbl.grbl_session import Session
    from armkin.robot_file.robot_keys import Gripper

GRIP_TIME = 0.5  # time [s] that a gripper without max_speed takes


class Spindle:
    """The M3 output of the GRBL board of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        answer = (replies.parse_spindle(line) for line in session.ask("$G"))
        self.value = next((s for s in answer if s is not None), None)  # the S word in force; None: off, or not known

    def grip(self, gripper: Gripper, value: float, settings: Mapping[int, float]) -> float:
        """Give out an S word, wait until the gripper has had its time, and return the word.

        Raises LinkError, before anything is sent, if GRBL's settings do not let it out.
        """
        for number, wrong in ((30, settings.get(30, value) < value), (32, settings.get(32, 0.0) != 0)):
            if wrong:
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
        """After a reset, which switches M3 off: grip what was gripped, unless GRBL is in an alarm."""
        report = self._session.report
        if self.value is not None and report is not None and report.state != "Alarm":
            self._session.ask(f"M3S{self.value:.3f}")
