"""Points and one tolerance: time beside the smooth curve, slicers' points, starts at points and singular homes.

    OPENBLAS_NUM_THREADS=1 python tests/bench/bench_points.py [--shapes] [--slicer N] [--saw N] [--lines N]
        [--homes [ROBOT ...]]

Without options all, small. Each prints its worst case; times are of the process. --slicer: points of the layers that
scripts/first_layer.py writes; --saw: of a zigzag that turns back at every point; --lines: with `start: {point}`, each
against brute force from every branch; --homes: 20 mm in six directions from home of the arms whose home is singular.
"""

from __future__ import annotations

import argparse
import resource
import runpy
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "motion"))

import brute_force_reach
from closed_curves import harmonic_curve, on_path
from lines import random_line

import armkin
from armkin.forward import condition
from armkin.motion.tool_path.drawing_frame import place_drawing
from armkin.path_file import gcode
from armkin.path_file.drawing import DrawingOptions
from armkin.robot_file import catalogue

_SEEDS = 20  # of each noise
CENTRE = np.array([340.0, 40.0, 300.0])
ARMS = ("three_dof", "irb2400", "puma560", "irb120", "ar4", "labvolt_5150", "ra02")


def arm_with_rates(name: str) -> armkin.Arm:
    """An arm with rates, ours where its file has none."""
    arm = armkin.load(name)
    unit = np.where(arm.prismatic, 5.0, np.pi / 180)
    speed = np.where(np.isnan(arm.max_speed), 90 * unit, arm.max_speed)
    return replace(arm, max_speed=speed, max_accel=np.where(np.isnan(arm.max_accel), 3 * speed, arm.max_accel))


def on_plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.asarray(CENTRE + np.stack([x, y, 0 * x], axis=1))


def curve_points(name: str, count: int) -> np.ndarray:
    """Points of a smooth curve, at even steps of its parameter."""
    a = np.linspace(0, 2 * np.pi, count)
    if name == "circle":
        return on_plane(50 * np.cos(a), 50 * np.sin(a))
    if name == "spiral":
        return on_plane((10 + 5 * a) * np.cos(5 * a), (10 + 5 * a) * np.sin(5 * a))
    if name == "lissajous":
        return on_plane(60 * np.sin(3 * a), 60 * np.sin(2 * a + 0.9))
    if name == "rose":
        return on_plane(55 * np.cos(3 * a / 2) * np.cos(a), 55 * np.cos(3 * a / 2) * np.sin(a))
    if name == "trochoid":
        return on_plane(18 * (a - np.pi) - 22 * np.sin(4 * a), 30 - 22 * np.cos(4 * a))
    return on_plane(*harmonic_curve(int(name), count).T)


def print_shapes() -> None:
    """Time of points beside that of the smooth curve (20,000 points of it), exact and with noise: the worst seed."""
    arm = armkin.load("three_dof")
    print("shape       points  smooth/s  T/smooth: exact  uniform 0.02  Gaussian 0.02   cpu/s  worst point/mm")
    for name in ("circle", "spiral", "lissajous", "rose", "trochoid", *map(str, range(5))):
        count = 1500 if name == "spiral" else 600
        points, seeds = curve_points(name, count), [np.random.default_rng(seed) for seed in range(_SEEDS)]
        smooth = on_path(armkin.path(arm, curve_points(name, 20_000), corners="tolerance"))
        ratios, deviation, spent = [], 0.0, 0.0
        uniform = [rng.uniform(-0.02, 0.02, points.shape) for rng in seeds]
        for noises in ([0 * points], uniform, [rng.normal(0, 0.02, points.shape) for rng in seeds]):
            ratios.append(0.0)
            for noise in noises:
                began = time.process_time()
                plan = armkin.path(arm, points + noise, corners="tolerance")
                spent = max(spent, time.process_time() - began)
                ratios[-1] = max(ratios[-1], on_path(plan) / smooth)
                deviation = max(deviation, plan.deviation)
        print(f"{name:10} {count:7d} {smooth:9.3f} {ratios[0]:16.4f} {ratios[1]:13.4f} {ratios[2]:14.4f} "
              f"{spent:7.2f} {deviation:15.4f}", flush=True)  # fmt: skip


def plan_program(name: str, text: str, place: list[float]) -> None:
    """Read and plan a program; print what it takes."""
    arm = armkin.load("three_dof")
    began = time.process_time()
    file = gcode.parse_gcode(text.encode(), "points.gcode", place_drawing(arm, place), DrawingOptions())
    read = time.process_time() - began
    plan = armkin.path(arm, file)
    spent = time.process_time() - began
    points = sum(len(move.polyline or []) for move in file.moves)
    top = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    size = f"{points} points, {plan.length / 1000:.1f} m, {len(plan.motion.stretches)} stretches"
    cost = f"{spent:.2f} s of CPU ({read:.2f} to read), {1e6 * spent / points:.0f} us a point, {top:.0f} MB"
    print(f"{name}: {size}: {cost}; worst point {plan.deviation:.4f} mm", flush=True)


def slicer_program(points: int) -> None:
    """Layers in a slicer's dialect."""
    script = runpy.run_path(str(Path(__file__).parents[2] / "scripts" / "first_layer.py"))
    lines = "\n".join(script["program"](max(1, round(points / 1110))))
    plan_program("slicer's layers", lines, [320, -20, 200])


def saw_program(points: int) -> None:
    """Lines of 30 mm, 0.4 mm apart, that turn back at every point."""
    lines = [f"G1 X{30 * (k % 2)} Y{0.4 * (k % 75):.1f}" for k in range(points)]
    plan_program("saw", "\n".join(["G21 G90 F3000", *lines]), [340, -20, 200])


def print_lines(count: int) -> None:
    """Lines of 300 mm that begin at a point: planned where some branch carries them, refused where none does."""
    right = carried_count = 0
    for k in range(count):
        arm, rng = arm_with_rates(ARMS[k % len(ARMS)]), np.random.default_rng(1000 + k)
        way = random_line(arm, rng)
        ends = way.targets(np.array([0.0, way.length]))
        carried = brute_force_reach.reach_length(arm, way.targets, np.linspace(0, way.length, 601), 0.05) == way.length
        try:
            end = armkin.path(arm, ends).motion.end
            distance = np.linalg.norm(armkin.fk(arm, end)[: arm.n, 3][:2] - _position(ends[1])[:2])
            planned = bool(distance < 0.01)
        except armkin.NoSolutionError:
            planned = False
        carried_count, right = carried_count + carried, right + (planned == carried)
        if planned != carried:
            print(f"  line {k} of {arm.name}: planned {planned}, by brute force {carried}")
    print(f"lines from a point: {right} of {count} right; {carried_count} are carried")


def _position(target: np.ndarray) -> np.ndarray:
    return np.asarray(target[:3, 3] if target.ndim == 2 else target)


def print_homes(names: list[str]) -> None:
    """Arms whose home is singular, every shipped one if none is named: carried, turned at rest, or not to be done."""
    print("arm               carried  at rest  refused  false sentences")
    for name in names or catalogue.robot_names():
        arm = arm_with_rates(name)
        if arm.n != 6 or condition(arm, arm.home) < 1e9:
            continue
        tally = [0, 0, 0, 0]
        for way in np.concatenate([20 * np.eye(3), -20 * np.eye(3)]):
            moves: dict[str, object] = {"start": "home", "moves": [{"offset": {"xyz": way.tolist()}}]}
            kind = _outcome(arm, moves)
            T = np.tile(armkin.fk(arm, arm.home), (201, 1, 1))
            T[:, :3, 3] += np.linspace(0, 1, 201)[:, None] * way
            alive = brute_force_reach.carried_nodes(arm, T, 0.05, start=arm.home[None])
            tally[kind] += 1
            tally[3] += (kind == 0) != (len(alive) == len(T))
        print(f"{name:18} {tally[0]:6d} {tally[1]:8d} {tally[2]:8d} {tally[3]:16d}", flush=True)


def _outcome(arm: armkin.Arm, moves: dict[str, object]) -> int:
    """0: carried; 1: with the wrist turned at rest; 2: not at all."""
    for split in (False, True):
        try:
            armkin.path(arm, moves, split=split)
            return int(split)
        except armkin.NoSolutionError:
            pass
    return 2


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--shapes", action="store_true")
    parser.add_argument("--homes", nargs="*", metavar="ROBOT")
    for name in ("slicer", "saw", "lines"):
        parser.add_argument(f"--{name}", type=int, default=0)
    arguments = parser.parse_args()
    every = arguments.homes is None and not any(vars(arguments).values())
    if arguments.shapes or every:
        print_shapes()
    if arguments.slicer or every:
        slicer_program(arguments.slicer or 10_000)
    if arguments.saw or every:
        saw_program(arguments.saw or 1000)
    if arguments.lines or every:
        print_lines(arguments.lines or 14)
    if arguments.homes is not None or every:
        print_homes(arguments.homes or [])


if __name__ == "__main__":
    main()
