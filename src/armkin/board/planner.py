"""Plans for an arm that is sent goals: consecutive plans for its board, from rows as they arrive, and summaries."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.json_summaries import Summary, Where
from armkin.errors import ArmkinError, NoSolutionError, UsageError
from armkin.forward import fk
from armkin.model import units
from armkin.motion.path_planner.path_request import HOLD_FACTOR
from armkin.motion.rounded_waypoints import round_waypoints
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.limit_jerk import Smoothed
from armkin.motors import joints, motor_names, pulse_units, pulses

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.backend.board import Board
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_ROWS_AHEAD = 1000  # most rows that are read ahead of planning


class Planner:
    """Makes plans for one arm at one speed, and sums them up."""

    def __init__(self, board: Board, speed: float, blend: float = 0.0) -> None:
        """blend: how far from a waypoint its rounding begins [deg | mm]; 0: stop in each."""
        self.arm, self.board = board.arm, board
        self.speed, self.blend = speed, blend
        self.total_sent = Total(board.arm)  # the sum of all plans that were sent

    def counts(self, q: Array) -> list[int]:
        """Counts at joint values."""
        return list(pulses(self.arm, q).tolist())

    def plan(self, start: Sequence[int], q: Array) -> Planned:
        """A plan through joint values (w, n) [rad | mm]."""
        if not self.blend:
            return self.board.plan(start, q, self.speed)
        begin = np.asarray(start, dtype=np.int64)
        motion = round_waypoints(self.arm, joints(self.arm, begin), q, self.blend, speed=self.speed, hold=HOLD_FACTOR)
        return self.board.plan_trajectory(motion, begin)

    def sum_up(self, plans: Iterable[Planned | None]) -> Iterator[Planned | None]:
        """Pass plans on and add them to `total_sent`, without keeping them, since rows may arrive for hours."""
        for plan in plans:
            if plan is not None:
                self.total_sent.add(plan)
            yield plan


class Total:
    """The sum of consecutive plans: counts, segments, seconds and greatest speeds."""

    def __init__(self, arm: Arm, plans: Iterable[Planned] = ()) -> None:
        self.arm = arm
        self.waypoints, self.segments, self.duration = 0, 0, 0.0
        self.first: list[int] = []  # counts; empty before the first plan
        self.last: list[int] = []
        self.speed: Array = np.zeros(arm.n)  # greatest speed of each joint
        self.rate: Array = np.zeros(len(motor_names(arm)))  # greatest rate of each motor
        for plan in plans:
            self.add(plan)

    def add(self, plan: Planned) -> None:
        """Add a plan."""
        self.first = self.first or plan.start.tolist()
        self.last = plan.end.tolist()
        self.waypoints += sum(
            stretch.waypoints if isinstance(stretch, Curve | Smoothed) else 1 for stretch in plan.trajectory.stretches
        )
        self.segments += plan.segments
        self.duration += plan.duration
        self.speed = np.maximum(self.speed, plan.trajectory.top_speed)
        self.rate = np.maximum(self.rate, plan.top_rate)

    def summary(self, start: Sequence[int] | None = None) -> Summary:
        """JSON; start: counts where the arm stood, by default the first plan's."""
        arm = self.arm
        first = self.first if start is None else list(start)
        last = self.last or first
        end = joints(arm, last)
        return {
            "waypoints": self.waypoints,
            "start_joints": units.joints_out(arm, joints(arm, first)).tolist(),
            "joints": units.joints_out(arm, end).tolist(),
            "joint_units": units.unit_names(arm),
            "motors": motor_names(arm),
            "pulse_units": pulse_units(arm),
            "start_pulses": first,
            "pulses": last,
            "moves": [b - a for a, b in zip(first, last, strict=True)],
            "position_mm": (fk(arm, end)[:3, 3] + 0.0).tolist(),
            "duration_s": self.duration,
            "segments": self.segments,
            "top_speed": units.joints_out(arm, self.speed).tolist(),
            "top_rate": self.rate.tolist(),
        }


class Stream:
    """Rows of joint values that arrive while the arm moves, each planned on arrival.

    A thread reads at most a thousand rows ahead, so a writer that is faster than the arm has to wait.
    """

    def __init__(self, arm: Arm, rows: Iterable[tuple[int, Sequence[float]]]) -> None:
        """rows: number and joint values [deg | mm]; the iterable raises ArmkinError for a wrong row."""
        self.problem: ArmkinError | None = None
        self._rows: queue.Queue[tuple[int, Sequence[float]] | Exception | None] = queue.Queue(_ROWS_AHEAD)
        self._arm = arm
        threading.Thread(target=self._read_rows, args=(rows,), daemon=True).start()

    def _read_rows(self, rows: Iterable[tuple[int, Sequence[float]]]) -> None:
        try:
            for row in rows:
                self._rows.put(row)
        except Exception as error:  # `plans` reports or raises it in the caller's thread
            self._rows.put(error)
        self._rows.put(None)

    def plans(self, planner: Planner, start: Sequence[int]) -> Iterator[Planned | None]:
        """Plans as rows arrive, None while there is no row. A wrong row ends them and sets `problem`."""
        counts, no_rows = list(start), True
        while True:
            try:
                item = self._rows.get_nowait()
            except queue.Empty:
                yield None
                continue
            if item is None:
                break
            if isinstance(item, ArmkinError):
                self.problem = item
                return
            if isinstance(item, Exception):
                raise item
            no_rows = False
            try:
                plan = planner.plan(counts, units.joints_in(self._arm, [item[1]]))
            except (NoSolutionError, UsageError) as error:
                text = f"row {item[0]}: {error.message}; the rows before it were carried out"
                self.problem = type(error)(text, advice=error.advice, **{**error.fields, "row": item[0]})
                return
            counts = plan.end.tolist()
            yield plan
        if no_rows:
            self.problem = UsageError("there are no rows: nothing was moved")

    def all_plans(self, planner: Planner, start: Sequence[int]) -> list[Planned]:
        """All plans, once the last row has arrived. Raises the error of a wrong row."""
        plans = []
        for plan in self.plans(planner, start):
            if plan is None:
                time.sleep(0.01)
            else:
                plans.append(plan)
        if self.problem is not None:
            raise self.problem
        return plans


def where_arm_stands(machine: Backend) -> Where:
    """The arm's position, as JSON [deg | mm]."""
    arm = machine.arm
    is_known = machine.position() != "lost"
    q = machine.joints() if is_known else None
    return {
        "position": machine.position(),
        "pulses": list(machine.counts()) if is_known else None,
        "joints": None if q is None else units.joints_out(arm, q).tolist(),
        "joint_units": units.unit_names(arm),
        "position_mm": None if q is None else (fk(arm, q)[:3, 3] + 0.0).tolist(),
    }
