"""The line of progress on a terminal: its clock starts where the counted work does."""

from __future__ import annotations

import io
import sys
import time

import pytest

from armkin.cli.printing import output, progress_bar


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class _Told:
    """A bar that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def update(self, count: int, total: int | None, seconds: float) -> None:
        self.lines.append(progress_bar.progress_text("bytes", count, total, seconds))

    def end(self) -> None:
        pass


def _progress_lines(monkeypatch: pytest.MonkeyPatch, steps: list[tuple[float, int]]) -> list[str]:
    """What is said at ticks (seconds since the command began, done) of 10,000."""
    present, bar = 0.0, _Told()
    monkeypatch.setattr(sys, "stderr", _Terminal())
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(time, "monotonic", lambda: present)
    monkeypatch.setattr(progress_bar, "start_bar", lambda task: bar)
    with output.progress("bytes", 10_000) as tick:
        for present, count in steps:  # noqa: B007  (the clock reads it)
            tick(count)
    return bar.lines


def test_time_before_the_first_count_is_not_in_the_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """A boot loader is found in 3 s, then 1,000 bytes a second go out: 9 s are left, not 31."""
    lines = _progress_lines(monkeypatch, [(3.0, 0), (3.1, 100), (4.0, 1_000), (13.0, 10_000)])
    assert lines[0] == "10 %  1,000 of 10,000 bytes, 1,000/s, 0:00:09 left"
    assert lines[-1] == "100 %  10,000 of 10,000 bytes, 1,000/s, 0:00:00 left"


def test_without_a_count_of_nothing_the_clock_runs_from_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _progress_lines(monkeypatch, [(2.0, 1_000)]) == ["10 %  1,000 of 10,000 bytes, 500/s, 0:00:18 left"]
