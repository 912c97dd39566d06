"""How far a long command has come, on a terminal: a bar, count, rate and time left (rich, imported here alone)."""

import sys

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn

_WIDTH = 10  # characters of the bar: with counts in millions the time left, at the end, still fits 80 columns


class Bar:
    """One line that is drawn anew, and gone at the end."""

    def __init__(self, task: str, console: Console) -> None:
        self.task = task
        columns = (BarColumn(_WIDTH), TextColumn("{task.fields[progress_text]}"))
        self._drawn = Progress(*columns, console=console, auto_refresh=False, transient=True)
        self._task: TaskID = self._drawn.add_task("", total=None, progress_text="")
        self._drawn.start()

    def update(self, count: int, total: int | None, seconds: float) -> None:
        """Draw the bar for `count` done of `total` (None: unknown) after so many seconds."""
        self._drawn.update(
            self._task, completed=count, total=total, progress_text=progress_text(self.task, count, total, seconds)
        )
        self._drawn.refresh()

    def end(self) -> None:
        """Take the line away."""
        self._drawn.stop()


def start_bar(task: str) -> Bar:
    """A bar on stderr."""
    return Bar(task, Console(file=sys.stderr, highlight=False))


def progress_text(task: str, count: int, total: int | None, seconds: float) -> str:
    """Count, rate and time left in words.

    >>> progress_text("rows", 250_000, 1_000_000, 5.0)
    '25 %  250,000 of 1,000,000 rows, 50,000/s, 0:00:15 left'
    >>> progress_text("rows", 250_000, None, 5.0)
    '250,000 rows, 50,000/s, 0:00:05'
    """
    rate = count / max(seconds, 1e-3)
    if not total:
        return f"{count:,} {task}, {rate:,.0f}/s, {_clock_text(seconds)}"
    left = f", {_clock_text((total - count) / rate)} left" if 0 < count <= total else ""
    return f"{100 * count // total} %  {count:,} of {total:,} {task}, {rate:,.0f}/s{left}"


def _clock_text(seconds: float) -> str:
    whole_seconds = round(seconds)
    return f"{whole_seconds // 3600}:{whole_seconds // 60 % 60:02d}:{whole_seconds % 60:02d}"
