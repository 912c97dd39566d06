"""A trajectory as G1 lines of Klipper's extra axes.

Klipper stops between moves of extra axes alone, for its look-ahead knows X, Y and Z (toolhead.py, `calc_junction`: both
moves must be kinematic). So X carries the time: with `kinematics: none` no motor hangs on it, it goes on by TIME_RATE a
second, and the other axes follow it in proportion. What Klipper's planner makes of that is the plan's own time law, in
pieces of constant speed, 100 a second; when lines run out it brakes within the axes' LIMIT_ACCEL.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.sent_positions import equal_pieces
from armkin.board.klipper.extra_axes import PIECE_TIME, TIME_RATE, Axis
from armkin.motors import exact_pulses, pulses

if TYPE_CHECKING:
    from armkin.board.backend.sent_positions import Job
    from armkin.formula.arrays import Array
    from armkin.motion.timing.trajectory import Trajectory

HEAD = "G90\nM220 S100\nG92 X0"  # words before a motion: absolute values, no override of the speed, the time begins
_CHUNK_LINES = 256  # lines worked out at once
_SHORT_PIECE = 1e-4  # length [s] below which a piece joins the next one: X has five decimals


def line_count(trajectory: Trajectory) -> int:
    """Lines that a trajectory is sent in."""
    return len(_piece_times(trajectory))


class Lines:
    """The lines of a job, one a piece of its time; after `brake` they go on ever slower along the same way.

    Intermediate places are not rounded to whole steps, the last one is: the arm rests on its counts.
    """

    def __init__(self, job: Job, axes: Sequence[Axis]) -> None:
        self._job, self._axes = job, axes
        self._slower: float | None = None  # share of the pace that each line takes away
        self.sent = 0.0  # [s] that all lines so far take

    def brake(self, seconds: float) -> None:
        """Come to rest in so many seconds from here."""
        self._slower = PIECE_TIME / max(seconds, PIECE_TIME)

    def __iter__(self) -> Iterator[str]:
        times, t = _piece_times(self._job.trajectory), 0.0
        for begin in range(0, len(times), _CHUNK_LINES):
            chunk = times[begin : begin + _CHUNK_LINES]
            for time, values in zip(chunk.tolist(), self._values_at(chunk), strict=True):
                if self._slower is not None:
                    break
                t = time
                yield self._line_to(t, self._rest_position(t) if t == self._job.duration else values)
        pace = 1.0
        while self._slower is not None and t < self._job.duration and pace > 0.0:
            pace = max(0.0, pace - self._slower)
            t = min(self._job.duration, t + PIECE_TIME * pace)
            rests = t == self._job.duration or pace == 0.0
            yield self._line_to(
                self.sent + PIECE_TIME, self._rest_position(t) if rests else self._values_at(np.array([t]))[0]
            )

    def _values_at(self, t: Array) -> list[list[float]]:
        """Where the axes are at times (T,) of the plan: T rows of axes, in Klipper's units."""
        return self._to_units(exact_pulses(self._job.trajectory.arm, self._job.trajectory.q(t)))

    def _rest_position(self, t: float) -> list[float]:
        """Where the axes come to rest at a time of the plan: on whole steps."""
        return self._to_units(pulses(self._job.trajectory.arm, self._job.trajectory.q([t])))[0]

    def _to_units(self, counts: Array | NDArray[np.int64]) -> list[list[float]]:
        steps, home = (np.array([getattr(axis, name) for axis in self._axes]) for name in ("steps", "at_home"))
        values: list[list[float]] = (home + counts / steps).tolist()
        return values

    def _line_to(self, x: float, values: Sequence[float]) -> str:
        """The line to these places, which X reaches at second x."""
        self.sent = x
        words = " ".join(f"{axis.letter}{value:.6f}" for axis, value in zip(self._axes, values, strict=True))
        return f"G1 X{TIME_RATE * x:.5f} {words} F{60 * TIME_RATE:g}"


def _piece_times(trajectory: Trajectory) -> Array:
    """Ends of the pieces [s]: every stretch in equal ones of PIECE_TIME at most."""
    ends = [np.zeros(0)]
    for stretch, began in zip(trajectory.stretches, trajectory.begins, strict=False):
        ends.append(began + equal_pieces(stretch.duration, PIECE_TIME))
    times = np.concatenate(ends)
    return np.asarray(times[np.append(np.diff(times) > _SHORT_PIECE, np.ones(len(times[:1]), dtype=bool))])
