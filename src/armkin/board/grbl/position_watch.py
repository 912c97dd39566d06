"""Whether GRBL is where its plan is, by its status reports in motion.

A line that was damaged on its way may name another target or another feed, and GRBL obeys. Reports come ten a
second: two in a row beside the path, or ahead of the plan, end the motion, and so does one that hardly goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.grbl.trajectory_to_gcode import PIECE_TIME
from armkin.errors import LinkError
from armkin.motion.timing.trajectory import Straight
from armkin.motors import exact_pulses, pulses

if TYPE_CHECKING:
    from armkin.board.backend.sent_positions import Job
    from armkin.board.grbl.replies import Report
    from armkin.board.grbl.settings import Axis
    from armkin.formula.arrays import Array

PATH_DISTANCE = 2.0  # distance [steps] of a motor from the path: GRBL's own rounding and its reports' is below 1
LEAD_TIME = 0.3  # time [s] ahead of the plan, at most: GRBL is never faster than it was told
CREEP_TIMES = 0.1, 3.0  # part [s] of the plan, and time [s] that GRBL takes for it when it no longer moves
_WINDOW_POINTS = 250  # points of the path that are looked at, 10 s


class Watch:
    """The path of a job, and how far along it the arm was seen."""

    def __init__(self, job: Job, axes: Sequence[Axis], offset: NDArray[np.int64]) -> None:
        self._axes, self._offset = axes, offset
        self._times, self._points = _path_samples(job)
        self._points_passed = 0  # points that the arm has passed
        self._doubts = 0
        self._plan_time = 0.0  # [s] of the plan that were done
        self._progress_time = 0.0  # [s] since the start when that was seen
        self._pause = 0.0  # [s] that the arm may stand there by the plan

    def heed(self, report: Report | None, elapsed: float) -> None:
        """Raise LinkError if a report, where there is one, tells of a damaged line, or of another program's."""
        if report is not None and report.feed is not None and report.feed > 100:
            raise LinkError(f"another program has set feeds to {report.feed} %")
        wrong = None if report is None else self.fault(report, elapsed)
        if wrong:
            raise LinkError(
                f"the arm is not where its plan is: {wrong}; a line was damaged on its way, or another program has "
                "sent one"
            )

    def fault(self, report: Report, elapsed: float) -> str | None:
        """What is wrong with a report that came so many seconds after the start; None while nothing is."""
        if report.position is None or report.state not in ("Run", "Idle"):
            return None
        steps = np.array([report.position[axis.index] * axis.steps for axis in self._axes])
        plan_times = self._plan_times(steps - self._offset)
        wrong = "it has left its path" if plan_times is None else None
        if plan_times is not None and plan_times[0] > elapsed + LEAD_TIME:
            wrong = "it is faster than planned"
        self._doubts = self._doubts + 1 if wrong else 0
        if self._doubts >= 2:  # a report has no checksum either
            return wrong
        return (
            None if wrong or plan_times is None or report.state == "Idle" else self._creep_fault(*plan_times, elapsed)
        )

    def _creep_fault(self, first: float, last: float, elapsed: float) -> str | None:
        if last >= min(self._plan_time + CREEP_TIMES[0], float(self._times[-1])):
            self._plan_time, self._progress_time, self._pause = last, elapsed, 0.0
        self._pause = max(self._pause, last - first)
        return "it hardly moves on" if elapsed - self._progress_time > CREEP_TIMES[1] + self._pause else None

    def _plan_times(self, counts: Array) -> tuple[float, float] | None:
        """Seconds of the plan when the motors stand at these counts, first and last; None: beside the path."""
        begin = max(self._points_passed - 1, 0)
        points = self._points[begin : begin + _WINDOW_POINTS + 1]
        if len(points) == 1:
            return (0.0, 0.0) if np.abs(counts - points[0]).max() <= PATH_DISTANCE else None
        way = np.diff(points, axis=0)
        share = ((counts - points[:-1]) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-12)
        share = np.clip(share, 0.0, 1.0)
        near = np.abs(counts - points[:-1] - share[:, None] * way).max(axis=1) <= PATH_DISTANCE
        if not near.any():
            return None
        first = int(near.argmax())
        last = first + int(np.argmin(np.append(near[first:], False))) - 1  # the last that follows without a gap
        times = self._times[begin:]
        self._points_passed = begin + first
        ends = [float(times[k] + share[k] * (times[k + 1] - times[k])) for k in (first, last)]
        return ends[0], ends[1]


def _path_samples(job: Job) -> tuple[Array, Array]:
    """Times (T,) [s] and the counts of every motor then (T, motors): the lines that GRBL is sent, in pieces."""
    arm = job.trajectory.arm
    times, points = [np.zeros(1)], [np.asarray(job.start, dtype=float)[None]]
    for stretch, began in zip(job.trajectory.stretches, job.trajectory.begins, strict=False):
        t = np.linspace(0.0, stretch.duration, max(int(np.ceil(stretch.duration / PIECE_TIME)), 1) + 1)[1:]
        sampled = stretch.evaluate(t)
        times.append(began + t)
        points.append(
            exact_pulses(arm, sampled) if isinstance(stretch, Straight) else pulses(arm, sampled).astype(float)
        )
    return np.concatenate(times), np.concatenate(points)
