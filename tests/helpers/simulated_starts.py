"""Paths sent from other places than they start at, on a simulated board of every kind: the pins against the path.

`tests/bench/bench_starts.py` carries out all of them, `test_starts.py` samples of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

import armkin
from armkin.board import path_run
from armkin.board.backend import Backend
from armkin.board.backend.board import Board
from armkin.board.firmware.configuration import configure
from armkin.board.kinds import board_of
from armkin.board.klipper.extra_axes import axes_of
from armkin.board.sim.sim_servo_bus import Servo
from armkin.board_catalogue import BOARDS
from armkin.formula.arrays import Array
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file
from command_line import ROOT

ELSEWHERE = ((8, 84, -80), (-60, 30, 20), (75, 110, -115), (-84, 60, -10), (20, -15, 25))  # [deg]
EXAMPLES = tuple(path for path in sorted(ROOT.glob("examples/*.yaml")) if "moves:" in path.read_text())

PATHS: tuple[dict[str, Any], ...] = (
    {"start": {"point": [350, 0, 300]}, "moves": [{"circle": {"centre": [300, 0, 300]}}]},
    {"start": "home", "moves": [{"line": [390, 60, 300]}, {"line": [390, -60, 300]}]},
    {"moves": [{"line": [330, 20, 320]}]},
    {"moves": [{"point": [390, 80, 300]}, {"line": [390, -80, 300]}]},
    {"start": {"joints": [30, 80, -80]}, "moves": [{"offset": {"xyz": [0, 0, -30]}}, {"offset": {"xyz": [0, -40, 0]}}]},
    {"start": {"joints": {"q1": -40}}, "moves": [{"joint": {"q2": 70}}, {"wait": 0.2}, {"joint": [0, 80, -80]}]},
    {"start": {"point": [330, 80, 330]}, "moves": [{"joint": "home"}]},
    {"start": {"point": [330, 80, 330]}, "moves": [{"wait": 0.3}, {"line": [330, -80, 330]}]},
    {"start": {"point": [330, 80, 330]}, "moves": [{"point": [390, 0, 300]}, {"line": [390, 50, 300]}]},
    {"start": "home", "moves": [{"arc": {"via": [370, 40, 340], "to": [330, 80, 330]}}]},
    {"start": "home", "blend": 5, "moves": [{"polyline": [[380, 40, 340], [340, 60, 300], [380, 0, 300]]}]},
    {"start": "home", "moves": [{"spline": [[380, 40, 340], [340, 60, 300], [380, 0, 300]]}]},
    {"start": "home", "speed": 40, "moves": [{"line": [360, 60, 330]}, {"joint": [10, 70, -70]}]},
    {"start": {"joints": [-50, 60, -60]}, "tool_speed": 60, "moves": [{"line": [300, -100, 330]}]},
    {"start": {"point": [320, -90, 260]}, "blend": 10, "moves": [{"line": [380, 0, 260]}, {"line": [320, 90, 260]}]},
    {"start": {"point": [350, 0, 250]}, "moves": [{"circle": {"centre": [330, 0, 250], "turns": 2, "rise": 30}}]},
    {"moves": [{"joint": [0, 90, -90]}, {"line": [400, 0, 320]}, {"wait": 0.1}, {"line": [400, 60, 320]}]},
    {"start": "home", "moves": [{"wait": 0.2}]},
    {"start": {"joints": [0, 90, -90]}, "moves": [{"offset": {"xyz": [20, 0, 0], "frame": "tool"}}]},
    {"start": {"point": [400, 50, 280]}, "tolerance": 0.5, "moves": [{"line": [400, -50, 280]}, {"joint": "home"}]},
)


@dataclass
class Kind:
    """An arm on a simulated board of one kind."""

    arm: armkin.Arm
    board: Board
    pins: Callable[[], list[list[float]]]  # counts of the motors since this was last asked
    tolerance: float  # [mm] of the tip from its path
    rest: int  # [counts] from the end
    grips: bool

    @property
    def machine(self) -> Backend:
        """The arm on it."""
        return self.board.machine


def _robot_text(board: str, axes: Sequence[str] = "XYZ", drives: Sequence[str] = (), gripper: bool = True) -> str:
    """three_dof's file with another board, other axes or drives."""
    document = yaml.safe_load((ROOT / "robots/three_dof.yaml").read_text())
    document["board"] = yaml.safe_load(board)
    for joint, axis in zip(document["joints"], axes, strict=True):
        joint["drive"]["axis"] = axis
    for joint, drive in zip(document["joints"], drives, strict=False):
        joint["drive"] = yaml.safe_load(drive)
    if "uno_servos" in board:
        document["joints"][0]["limits"], document["joints"][2]["limits"] = [-85, 85], [-120, 30]
        document["gripper"]["axis"] = "S3"
    if not gripper:
        del document["gripper"]
    return str(yaml.safe_dump(document))


SERVOS = [f"{{kind: servo, axis: S{k}, travel: [0, 180], pulse_us: [500, 2500], zero: {zero}}}"
          for k, zero in enumerate((90, 40, 150))]  # fmt: skip
BUS = [f"{{kind: bus, id: {k}, counts: 4096, zero: 2048}}" for k in (1, 2, 3)]
KINDS = {
    "uno_cnc_shield": _robot_text("{kind: uno_cnc_shield, driver: A4988}"),
    "mega_ramps14": _robot_text("{kind: mega_ramps14, driver: A4988}"),
    "pico6": _robot_text("{kind: pico6, driver: A4988}"),
    "uno_servos": _robot_text("{kind: uno_servos}", drives=SERVOS),
    "grbl": _robot_text("{kind: grbl}", gripper=False),
    "klipper": _robot_text("{kind: klipper}", "ABC", gripper=False),
    "feetech": _robot_text("{kind: feetech}", drives=BUS, gripper=False),
}


def simulated_kind(kind: str, at: Array | None = None) -> Kind:
    """three_dof on a simulated board of that kind, at home or at joint values (n,) [rad]."""
    arm = arm_of_file(parse_robot_file(KINDS[kind]))
    seen: list[list[float]] = []
    board = board_of(arm)
    port: Any = board.simulated()
    if kind == "feetech":
        for k, count in enumerate(armkin.pulses(arm, arm.home if at is None else at), 1):
            port.servos[k] = Servo(k, count)
    watch_counts(arm, kind, port, seen)
    machine = board.connect(port)
    machine.prepare(assume=None if kind == "feetech" else at)

    def pins() -> list[list[float]]:
        out = seen.copy()
        seen.clear()
        return out

    # RC servos' and bus servos' counts are some tenths of a mm at the tip.
    tolerance = {"uno_servos": 1.2, "feetech": 1.2}.get(kind, 0.4)
    return Kind(arm, board, pins, tolerance, 12 if kind == "feetech" else 0, kind in BOARDS)


def watch_counts(arm: armkin.Arm, kind: str, port: Any, seen: list[list[float]]) -> None:
    """Note what the motors of a simulated board have counted whenever its time has passed."""
    sim = port
    if kind in BOARDS:
        axes, sim = configure(arm).axes, port.board

        def pins() -> list[float]:
            return [float(sim.motors.counts()[axis]) for axis in axes]

    elif arm.motors[0].kind == "bus":

        def pins() -> list[float]:
            return [port.servos[k].position for k in (1, 2, 3)]

    elif kind == "klipper":
        found = axes_of(arm)

        def pins() -> list[float]:
            return [(port.at[axis.section] - axis.at_home) * axis.steps for axis in found]

    else:

        def pins() -> list[float]:
            return [float(port.steps[k]) for k in range(3)]

    advance = sim.advance

    def note_and_call(seconds: float) -> None:
        advance(seconds)
        seen.append(pins())

    sim.advance = note_and_call


@dataclass(frozen=True)
class Result:
    """What a path sent from elsewhere came to."""

    off_mm: float  # the tip's distance from approach and path, at most
    begins_mm: float  # how near the tip came to the path's own first point before the path began
    rest: int  # [counts] from the plan's end


def carried_out(kind: Kind, moves: dict[str, Any], place: Sequence[float]) -> Result:
    """Send a path from a place [deg]."""
    arm, machine = kind.arm, kind.machine
    q = np.clip(np.deg2rad(place), arm.lower, arm.upper)
    machine.run([machine.plan(machine.counts(), q[None])])
    machine.refresh()
    moves = {**moves, "moves": [m for m in moves["moves"] if kind.grips or "grip" not in m]}
    plan = armkin.path(arm, moves, start=machine.joints())
    laid = path_run.plan_parts(plan, machine.counts(), machine.plan_trajectory)
    kind.pins()
    path_run.follow_plan(kind.board, plan, laid, lambda done, total: None)
    return judge_motion(plan, np.array([*kind.pins(), list(machine.counts())], dtype=float))


def judge_motion(plan: armkin.PathPlan, counts: Array) -> Result:
    """Counts (N, motors) of a motion against its plan."""
    arm = plan.arm
    moved = counts[np.append(True, (np.diff(counts, axis=0) != 0).any(axis=1))]
    tips = np.asarray(armkin.fk(arm, armkin.joints(arm, moved[:: max(len(moved) // 1500, 1)]))[:, :3, 3])
    ways = [plan.motion] if plan.approach is None else [plan.approach, plan.motion]
    way = np.concatenate([armkin.fk(arm, one.q(np.linspace(0, one.duration, 2000)))[:, :3, 3] for one in ways])
    first = armkin.fk(arm, plan.motion.start)[:3, 3]
    # of every step: the arm rests at the path's start for one row of them
    begins = float(np.linalg.norm(armkin.fk(arm, armkin.joints(arm, moved))[:, :3, 3] - first, axis=1).min())
    return Result(
        float(polyline_distance(tips, way).max()),
        begins,
        int(np.abs(counts[-1] - armkin.pulses(arm, plan.motion.end)).max()),
    )


def polyline_distance(tips: Array, way: Array) -> Array:
    """Distance of points (N, 3) from a polyline (M, 3): (N,)."""
    found = np.full(len(tips), np.inf)
    near = np.array([((way - p) ** 2).sum(axis=1).argmin() for p in tips])
    for a in (np.maximum(near - 1, 0), np.minimum(near, len(way) - 2)):
        along = way[a + 1] - way[a]
        share = ((tips - way[a]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
        foot = way[a] + np.clip(share, 0.0, 1.0)[:, None] * along
        found = np.minimum(found, np.linalg.norm(tips - foot, axis=1))
    return found
