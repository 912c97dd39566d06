"""A session with GRBL: lines with their answers, and real-time commands that bypass the queue.

Lines are sent ahead as long as they fit GRBL's receive buffer (character counting), and each is answered in order by
``ok`` or ``error:N``. GRBL has no checksum, so the effect of a damaged line shows only in the position.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

from armkin.board.grbl import replies
from armkin.board.grbl.replies import Report
from armkin.board.ports import LOG
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.ports import Port

BAUD = 115_200  # rate [bit/s] of the port
_BOOT_TIMEOUT = 4.0  # longest time [s] from the opening of the port to the greeting
_ANSWER_TIMEOUT = 2.0  # longest time [s] of a line without motion
_POLL_PERIOD = 0.1  # time [s] between two status requests during motion
_SILENCE_TIMEOUT = 2.0  # time [s] without an answer at rest, besides dwells, after which one was lost
_HELD_TIMEOUT = 15.0  # the same while GRBL holds, after a button or a damaged byte
_LATE_ANSWERS = 0.05  # time [s] in which answers to another program's lines may arrive
_NONSENSE_CHARACTERS = ")&"  # characters that make any unfinished line invalid
_KEPT_PARAMETERS = "$G", "G54", "G55", "G56", "G57", "G58", "G59", "G92", "TLO"
_MAX_READINGS = 13  # most readings until three in a row agree
_UNCLEAR_TEXT = "{port}: what GRBL says differs from reading to reading: is the cable too long, or beside a motor's?"
_REPORT_TIMEOUT = 0.5  # longest time [s] to a status report
_MAX_LINE = 4096  # more characters without a line end are not from GRBL


T = TypeVar("T")


class GrblError(LinkError):
    """GRBL has refused a line or is in an alarm."""

    def __init__(self, message: str, *, alarm: int = 0, error: int = 0) -> None:
        super().__init__(message)
        self.alarm, self.error = alarm, error


class Session:
    """GRBL behind an open port."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self.version, self.hal = "", False  # hal: whether it is grblHAL
        self.was_reset = False  # whether a greeting showed a reset, which clears offsets and position
        self.report: Report | None = None
        self._unseen: Report | None = None
        self.state = ""  # last reported state
        self.feed = 100  # [%] last reported feed override
        self.buffer = replies.RX_BUFFER
        self._text, self._heard = "", 0
        self._time_asked = -math.inf  # [s] when the last status report was asked for
        self._sent: deque[tuple[int, str]] = deque()  # unanswered lines, with their bytes
        self._other_lines: list[str] = []  # other lines received: settings, offsets, messages

    def open(self) -> None:
        """Wait until GRBL answers a status request. Raises LinkError if it does not, or does not stand still."""
        self.demand_rest(self.wake())
        self._end_line()
        for line in self.ask("$I"):
            if match := re.match(r"\[VER:([^:\]]*)", line):
                self.version = match[1]
            if match := re.match(r"\[OPT:[^,\]]*,(\d+),(\d+)", line):
                self.buffer = max(32, min(int(match[2]), 4096))
            self.hal = self.hal or line == "[FIRMWARE:grblHAL]"
        self.was_reset = False

    def wake(self) -> Report:
        """The first status report. Raises LinkError if none arrives."""
        deadline = self.port.now() + _BOOT_TIMEOUT
        while self.port.now() < deadline:
            self.port.write(replies.STATUS)
            with suppress(GrblError):  # ignore errors of another program's line, or of a new board's memory
                self._wait(lambda: self.report is not None, 0.25)
            if self.report is not None:
                return self.report
            self.port.write(b")")  # end an open comment, in which grblHAL ignores `?`
            with suppress(GrblError):
                self._pump(0.01)
        raise LinkError(
            f"{self.port.name} does not answer as GRBL does: is it the right port, and its rate {self.port.baud}?"
        )

    def demand_rest(self, report: Report) -> None:
        """Raise LinkError unless GRBL is at rest and takes lines: a motion now is another program's."""
        if report.state in ("Run", "Jog", "Home"):
            raise LinkError(
                f"GRBL on {self.port.name} moves (state {report.state}): another program drives it, or the rest of "
                "a command that was killed; wait until it stands"
            )
        if report.state not in ("Idle", "Alarm"):
            raise LinkError(
                f"GRBL on {self.port.name} is in state {report.state}, not Idle: end that first (~ goes on, a reset "
                "ends it)"
            )

    def _end_line(self) -> None:
        """Turn an unfinished line of another program into an error, so that GRBL does not execute it.

        `)` ends a comment, and `&` is no valid word. A comment after `;` ends with the line, which GRBL then executes.
        """
        self.realtime(replies.JOG_CANCEL)  # grblHAL drops an unfinished line
        self._send(_NONSENSE_CHARACTERS)
        try:
            is_answered = self._wait(lambda: not self._sent, _ANSWER_TIMEOUT)
        except GrblError as error:
            if not error.error:
                raise
            with suppress(GrblError):  # the first error may belong to another program's line
                self._wait(lambda: False, _LATE_ANSWERS)
            return
        if not is_answered:
            raise LinkError(f"GRBL on {self.port.name} takes no lines: does it dwell for another program?")
        self.realtime(replies.HOLD)
        self._wait(lambda: self.status().state not in ("Run", "Jog"), _SILENCE_TIMEOUT)
        self.reset()
        raise LinkError(
            f"another program had left a line open on {self.port.name}, in a comment, and GRBL obeyed it; it was "
            "stopped"
        )

    def ask(self, line: str, patience: float = _ANSWER_TIMEOUT) -> list[str]:
        """Send one line, wait for its ``ok``, and return the lines before it."""
        self._other_lines.clear()
        self._send(line)
        if not self._wait(lambda: not self._sent, patience):
            self._sent.clear()  # a late answer must not count for the next line
            raise LinkError(f"GRBL on {self.port.name} did not answer {line!r} within {patience:g} s")
        return list(self._other_lines)

    def status(self, patience: float = _REPORT_TIMEOUT) -> Report:
        """A fresh status report."""
        for _ in range(6):  # a request or its answer may be lost
            self.report = None
            self.port.write(replies.STATUS)
            if self._wait(lambda: self.report is not None, patience):
                assert self.report is not None
                return self.report
        raise LinkError(f"GRBL on {self.port.name} does not answer any more: is the cable plugged in?")

    def fresh_report(self) -> Report | None:
        """A status report that arrived since the last call."""
        report, self._unseen = self._unseen, None
        return report

    def sure_status(self) -> Report:
        """A status report that three in a row agree on, as they have no checksum; during motion the last one."""
        return _agreeing_reading(self.status, self.port.name, lambda report: report.state in ("Run", "Jog", "Home"))

    def stable_offsets(self) -> tuple[dict[str, tuple[float, ...]], tuple[str, ...]]:
        """Offsets by name (G54 to G59, G92, TLO) and the words of ``$G``: each as three readings in a row agree on."""
        readings: dict[str, tuple[Any, int]] = {}  # last value of each name, and how often in a row
        for _ in range(_MAX_READINGS):
            offset_words: dict[str, Any] = dict(
                pair for line in self.ask("$#") if (pair := replies.parse_offset(line)) is not None
            )
            words = [words for line in self.ask("$G") if (words := replies.parse_modes(line))]
            offset_words |= {"$G": tuple(words[-1])} if words else {}
            for name, value in offset_words.items():
                last, count = readings.get(name, (None, 0))
                readings[name] = value, count + 1 if value == last else 1
            if all(readings.get(name, (None, 0))[1] >= 3 for name in _KEPT_PARAMETERS):
                return {name: readings[name][0] for name in _KEPT_PARAMETERS[1:]}, readings["$G"][0]
        raise LinkError(_UNCLEAR_TEXT.format(port=self.port.name))

    def settings(self) -> dict[int, float]:
        """The answer to ``$$``: number -> value."""
        return dict(pair for line in self.ask("$$") if (pair := replies.parse_setting(line)) is not None)

    def stream(self, work: Iterable[str], tick: Callable[[], bool]) -> bool:
        """Send lines as fast as GRBL takes them, until all are answered; False if `tick` asked for a stop.

        Raises GrblError at the first line that is refused.
        """
        for line in work:
            if not self._drain(self.buffer - 1 - len(line) - 1, tick):
                return False
            self._send(line)
        return self._drain(0, tick)

    def _drain(self, max_bytes: int, tick: Callable[[], bool]) -> bool:
        """Wait until at most `max_bytes` are unanswered; False if `tick` asked for a stop."""
        last_answer = self.port.now()
        while (waiting_bytes := sum(size for size, _ in self._sent)) > max_bytes:
            if tick():
                return False
            self._not_reset()
            answers_before, time = self._heard, self.port.now()
            if time > self._time_asked + _POLL_PERIOD:  # lines of a curve are answered sooner than this
                self._time_asked = time
                self.port.write(replies.STATUS)
            self._pump(0.01)
            if self._heard != answers_before:
                last_answer = self.port.now()
            state = "" if self.report is None else self.report.state
            timeout = _HELD_TIMEOUT if state in ("Hold", "Door") else _SILENCE_TIMEOUT
            if self.port.now() > last_answer + timeout + self._dwell_seconds():
                state_text = f"GRBL on {self.port.name}, in state {state or '?'},"
                raise LinkError(f"{state_text} has left {waiting_bytes} bytes without an answer")
        self._not_reset()
        return True

    def _dwell_seconds(self) -> float:
        """The dwell time [s] in unanswered lines."""
        return sum(float(line[3:]) for _, line in self._sent if line.startswith("G4P"))

    def _not_reset(self) -> None:
        if self.was_reset:
            raise GrblError("GRBL was reset in motion")

    def reset(self) -> None:
        """Soft reset, which clears GRBL's queue and offsets, and keeps the machine position at rest."""
        self.port.write(replies.RESET)
        self._sent.clear()
        self.report = None
        self._wait(lambda: self.was_reset, 1.0)
        self.was_reset = False
        self.status()

    def realtime(self, command: bytes) -> None:
        """Send a real-time command, which bypasses the queue."""
        self.port.write(command)

    def _send(self, line: str) -> None:
        raw = line.encode("ascii") + b"\n"
        self._sent.append((len(raw), line))
        self.port.write(raw)

    def _wait(self, finished: Callable[[], bool], seconds: float) -> bool:
        deadline = self.port.now() + seconds
        while not finished():
            if self.port.now() >= deadline:
                return False
            self._pump(0.01)
        return True

    def _pump(self, timeout: float) -> None:
        self._text += self.port.read(timeout).decode("ascii", "replace")
        *lines, self._text = self._text.split("\n")
        if len(self._text) > _MAX_LINE:
            raise LinkError(f"{self.port.name} does not answer as GRBL does: {_MAX_LINE} characters without a line end")
        for line in lines:
            self._hear(line.strip("\r "))

    def _hear(self, line: str) -> None:
        """Process a received line. Raises GrblError for a refusal or an alarm."""
        if line == "ok":
            self._heard += 1
            if self._sent:
                self._sent.popleft()
        elif match := re.fullmatch(r"error:(\d{1,3})", line):
            refused_line = self._sent.popleft()[1] if self._sent else ""
            number = int(match[1])
            raise GrblError(
                f"GRBL refused {refused_line!r}: {replies.error_text(number)} (error {number})", error=number
            )
        elif match := re.fullmatch(r"ALARM:(\d{1,3})", line):
            number = int(match[1])
            self._sent.clear()
            raise GrblError(f"GRBL stopped: {replies.alarm_text(number)} (alarm {number})", alarm=number)
        elif line.lower().startswith("grbl "):
            self.was_reset = True
            self._sent.clear()
        elif (report := replies.parse_report(line)) is not None:
            self._take_report(report)
        elif line:
            self._other_lines.append(line)
            del self._other_lines[:-400]

    def _take_report(self, report: replies.Report) -> None:
        if self.state != report.state:
            LOG.info("GRBL: %s", report.state)
            self.state = report.state
        self.report = self._unseen = report
        self.feed = self.feed if report.feed is None else report.feed
        self._heard += report.state in ("Run", "Jog", "Home")  # at rest a report shows no progress


def _agreeing_reading(read: Callable[[], T], port: str, accepts: Callable[[T], bool]) -> T:
    """The value of three equal readings in a row, or one that `accepts` takes. Raises LinkError if none agree.

    Three are needed, since two may lose the same digit, for example one of the first zeros of -1000.000.
    """
    last, equal_count = read(), 1
    for _ in range(_MAX_READINGS):
        previous, last = last, read()
        equal_count = equal_count + 1 if last and last == previous else 1
        if equal_count == 3 or (accepts(previous) and accepts(last)):
            return last
    raise LinkError(_UNCLEAR_TEXT.format(port=port))
