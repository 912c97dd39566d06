"""Converts a trajectory to G-code: straight lines in GRBL's machine coordinates, the feed for the joint vector."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.sent_positions import Job, is_one_line, piece_times
from armkin.board.grbl.settings import Axis
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.motion.timing.trajectory import Trajectory

PIECE_TIME = 0.04  # length [s] of a stretch in one line, if it is curved or has jerk: 25 lines a second
LINE_HEAD = "G21G94"  # words in every line, as another program may set inches or inverse time
STOP = "G4P0"  # a dwell is carried out after all lines before it, at rest
MIN_FEED = 0.01  # lowest feed [units/min], as GRBL refuses 0


def job(trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
    """The job of a trajectory from counts `start` (motors,) on; GRBL's own planner may take longer."""
    return Job(trajectory, start, sum(len(piece_times(stretch, PIECE_TIME)) for stretch in trajectory.stretches))


def gcode_lines(job: Job, axes: Sequence[Axis], offset: NDArray[np.int64]) -> Iterator[str]:
    """The G-code lines, one for each piece; offset: GRBL's machine steps minus the arm's counts."""
    arm, position = job.trajectory.arm, np.asarray(job.start, dtype=np.int64)
    steps = np.array([axis.steps for axis in axes])
    for stretch in job.trajectory.stretches:
        last_time = 0.0  # end of the last piece with a step; pieces without one add their time to the next that has one
        for t in piece_times(stretch, PIECE_TIME):
            goal = np.asarray(pulses(arm, stretch.evaluate(np.array([t]))[0]), dtype=np.int64)
            travel = float(np.linalg.norm((goal - position) / steps))
            if travel == 0.0:
                continue
            speed = travel * stretch.law.peak if is_one_line(stretch) else travel / (t - last_time)
            values = (goal + offset) / steps
            words = "".join(f"{axes[k].letter}{values[k]:.5f}" for k in np.flatnonzero(goal != position).tolist())
            yield f"{LINE_HEAD}G53G1{words}F{max(60 * speed, MIN_FEED):.3f}"
            position, last_time = goal, t
        rest = stretch.duration - last_time
        if rest > PIECE_TIME or 0.0 < rest == stretch.duration:  # a slow end, or a pause; one piece is too short for it
            yield f"G4P{rest:.3f}"
        elif is_one_line(stretch) and last_time and stretch is not job.trajectory.stretches[-1]:
            yield STOP  # the plan rests here, and GRBL would pass the corner without
