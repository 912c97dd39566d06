"""Watches GRBL's status reports during a motion for departures from the plan.

A damaged line may have another target or feed, which GRBL obeys. It reports ten times a second. Two consecutive reports
off the path or ahead of the plan end the motion, and so does one without progress for a while.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.sent_positions import equal_pieces, is_one_line
from armkin.board.grbl.trajectory_to_gcode import PIECE_TIME
from armkin.errors import LinkError
from armkin.motors import exact_pulses, pulses

if TYPE_CHECKING:
    from armkin.board.backend.sent_positions import Job
    from armkin.board.grbl.replies import Report
    from armkin.board.grbl.settings import Axis
    from armkin.formula.arrays import Array

PATH_DISTANCE = 2.0  # largest distance [steps] of a motor from the path; rounding is below 1
LEAD_TIME = 0.3  # longest time [s] ahead of the plan
_PROGRESS_TIME = 0.1  # progress [s] in the plan that a moving GRBL makes within _CREEP_TIME
_CREEP_TIME = 3.0  # [s]
_WINDOW_POINTS = 250  # points of the path that are compared, 10 s, and those of a time without reports


class Watch:
    """The path of a job, and the arm's progress on it."""

    def __init__(self, job: Job, axes: Sequence[Axis], offset: NDArray[np.int64]) -> None:
        self._axes, self._offset = axes, offset
        self._times, self._points = _path_samples(job)
        self._points_passed = 0  # points that the arm has passed
        self._suspect_reports = 0  # consecutive reports with a fault
        self._plan_time = 0.0  # [s] progress in the plan
        self._progress_time = 0.0  # [s] since the start, at that report
        self._pause = 0.0  # [s] planned pause there

    def check_report(self, report: Report | None, elapsed: float) -> None:
        """Raise LinkError if a report, if any, shows a damaged line or another program."""
        if report is not None and report.feed is not None and report.feed > 100:
            raise LinkError(f"another program has set feeds to {report.feed} %")
        fault = None if report is None else self.fault(report, elapsed)
        if fault:
            raise LinkError(
                f"the arm is not where its plan is: {fault}; a line was damaged on its way, or another program has "
                "sent one"
            )

    def fault(self, report: Report, elapsed: float) -> str | None:
        """The fault in a report `elapsed` seconds after the start; None while there is none."""
        if report.position is None or report.state not in ("Run", "Idle"):
            return None
        steps = np.array([report.position[axis.index] * axis.steps for axis in self._axes])
        plan_times = self._plan_times(steps - self._offset, elapsed)
        fault_text = "it has left its path" if plan_times is None else None
        if plan_times is not None and plan_times[0] > elapsed + LEAD_TIME:
            fault_text = "it is faster than planned"
        self._suspect_reports = self._suspect_reports + 1 if fault_text else 0
        if self._suspect_reports >= 2:  # twice, as reports have no checksum
            return fault_text
        return (
            None
            if fault_text or plan_times is None or report.state == "Idle"
            else self._creep_fault(*plan_times, elapsed)
        )

    def _creep_fault(self, first: float, last: float, elapsed: float) -> str | None:
        if last >= min(self._plan_time + _PROGRESS_TIME, float(self._times[-1])):
            self._plan_time, self._progress_time, self._pause = last, elapsed, 0.0
        self._pause = max(self._pause, last - first)
        return "it hardly moves on" if elapsed - self._progress_time > _CREEP_TIME + self._pause else None

    def _plan_times(self, counts: Array, elapsed: float) -> tuple[float, float] | None:
        """First and last time in the plan at which the motors are at these counts; None: off the path."""
        begin = max(self._points_passed - 1, 0)
        last_point = max(begin, int(np.searchsorted(self._times, elapsed))) + _WINDOW_POINTS
        points = self._points[begin : last_point + 1]
        if len(points) == 1:
            return (0.0, 0.0) if np.abs(counts - points[0]).max() <= PATH_DISTANCE else None
        travel = np.diff(points, axis=0)
        share = ((counts - points[:-1]) * travel).sum(axis=1) / np.maximum((travel * travel).sum(axis=1), 1e-12)
        share = np.clip(share, 0.0, 1.0)
        on_path = np.abs(counts - points[:-1] - share[:, None] * travel).max(axis=1) <= PATH_DISTANCE
        if not on_path.any():
            return None
        first = int(on_path.argmax())
        last = first + int(np.argmin(np.append(on_path[first:], False))) - 1  # the last one without a gap
        times = self._times[begin:]
        self._points_passed = begin + first
        ends = [float(times[i] + share[i] * (times[i + 1] - times[i])) for i in (first, last)]
        return ends[0], ends[1]


def _path_samples(job: Job) -> tuple[Array, Array]:
    """Times (T,) [s] and motor counts (T, motors) along the lines that GRBL is sent."""
    arm = job.trajectory.arm
    times, points = [np.zeros(1)], [np.asarray(job.start, dtype=float)[None]]
    for stretch, start_time in zip(job.trajectory.stretches, job.trajectory.begins, strict=False):
        t = equal_pieces(stretch.duration, PIECE_TIME)
        q = stretch.evaluate(t)
        times.append(start_time + t)
        points.append(exact_pulses(arm, q) if is_one_line(stretch) else pulses(arm, q).astype(float))
    return np.concatenate(times), np.concatenate(points)
