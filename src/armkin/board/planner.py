"""An arm that is told where to go: plans for its board one after another, rows as they come, where it stands."""

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
from armkin.motors import joints, motor_names, pulse_units, pulses

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.backend.board import Board
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_ROWS_AHEAD = 1000  # rows that are read before they are planned


class Planner:
    """Plans for one arm at one speed, and what they come to."""

    def __init__(self, board: Board, speed: float, blend: float = 0.0) -> None:
        """blend: how far from a waypoint its rounding begins [deg | mm]; 0: stop in each."""
        self.arm, self.board = board.arm, board
        self.speed, self.blend = speed, blend
        self.total_sent = Total(board.arm)  # what has been sent

    def counts(self, q: Array) -> list[int]:
        """Counts at joint values."""
        return list(pulses(self.arm, q).tolist())

    def plan(self, start: Sequence[int], q: Array) -> Planned:
        """A plan through joint values (w, n) [rad | mm]."""
        if not self.blend:
            return self.board.plan(start, q, self.speed)
        counts = np.asarray(start, dtype=np.int64)
        way = round_waypoints(self.arm, joints(self.arm, counts), q, self.blend, speed=self.speed, hold=HOLD_FACTOR)
        return self.board.lay(way, counts)

    def sum_up(self, plans: Iterable[Planned | None]) -> Iterator[Planned | None]:
        """Pass plans on and sum them up in `total_sent`; none is kept, as rows may come for hours."""
        for made in plans:
            if made is not None:
                self.total_sent.add(made)
            yield made


class Total:
    """What plans, one after another, come to."""

    def __init__(self, arm: Arm, plans: Iterable[Planned] = ()) -> None:
        self.arm = arm
        self.waypoints, self.segments, self.duration = 0, 0, 0.0
        self.first: list[int] = []  # counts; none before the first plan
        self.last: list[int] = []
        self.speed: Array = np.zeros(arm.n)  # greatest of each joint
        self.rate: Array = np.zeros(len(motor_names(arm)))  # greatest of each motor
        for made in plans:
            self.add(made)

    def add(self, made: Planned) -> None:
        """One more plan."""
        self.first = self.first or made.start.tolist()
        self.last = made.end.tolist()
        self.waypoints += sum(
            stretch.waypoints if isinstance(stretch, Curve) else 1 for stretch in made.trajectory.stretches
        )
        self.segments += made.segments
        self.duration += made.duration
        self.speed = np.maximum(self.speed, made.trajectory.top_speed)
        self.rate = np.maximum(self.rate, made.top_rate)

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
    """Rows of joint values that come while the arm moves, each planned as soon as it is there.

    A thread reads them, at most a thousand ahead: who writes faster than the arm moves has to wait.
    """

    def __init__(self, arm: Arm, rows: Iterable[tuple[int, Sequence[float]]]) -> None:
        """rows: number and joint values [deg | mm]; what is wrong with one is an ArmkinError."""
        self.problem: ArmkinError | None = None
        self._rows: queue.Queue[tuple[int, Sequence[float]] | Exception | None] = queue.Queue(_ROWS_AHEAD)
        self._arm = arm
        threading.Thread(target=self._read_rows, args=(rows,), daemon=True).start()

    def _read_rows(self, rows: Iterable[tuple[int, Sequence[float]]]) -> None:
        try:
            for row in rows:
                self._rows.put(row)
        except Exception as error:  # told, or raised if it is a bug, in `plans`: this thread has nobody to tell
            self._rows.put(error)
        self._rows.put(None)

    def plans(self, planner: Planner, start: Sequence[int]) -> Iterator[Planned | None]:
        """Plans as rows come; None while there is none. What is wrong with a row ends it: `problem`."""
        counts, empty = list(start), True
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
            empty = False
            try:
                made = planner.plan(counts, units.joints_in(self._arm, [item[1]]))
            except (NoSolutionError, UsageError) as error:
                words = f"row {item[0]}: {error.message}; the rows before it were carried out"
                self.problem = type(error)(words, advice=error.advice, **{**error.fields, "row": item[0]})
                return
            counts = made.end.tolist()
            yield made
        if empty:
            self.problem = UsageError("there are no rows: nothing was moved")

    def all_plans(self, planner: Planner, start: Sequence[int]) -> list[Planned]:
        """All plans, once the last row has come. Raises what is wrong with one."""
        plans = []
        for made in self.plans(planner, start):
            if made is None:
                time.sleep(0.01)
            else:
                plans.append(made)
        if self.problem is not None:
            raise self.problem
        return plans


def where_arm_stands(machine: Backend) -> Where:
    """Where the arm stands, as JSON [deg | mm]."""
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
