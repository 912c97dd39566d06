"""Paths against brute force, toppra and ruckig, in one run on one machine.

    pip install -e '.[bench]'
    OPENBLAS_NUM_THREADS=1 python tests/bench/bench_path.py [--lines 50] [--splines 20] [--tips 2000] [--laws]

Runs and reach against brute force over every branch, copy and edge at four times the samples (about the place where a
run ends again and again, until its samples are 0.005 mm apart; where the runs differ, ten times finer); the chosen time
against the fastest of all branches; the ladder against the arm's own ik batch; the law of time against toppra on the
same grid; straight moves with jerk against ruckig; what is executed at 1 ms against the limits.
"""

from __future__ import annotations

import argparse
import logging
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "motion"))

import brute_force_reach
from lines import random_line

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.motion.branches.branch_chains import BranchChain, chains_of_columns, fewest_runs
from armkin.motion.branches.linked_branches import link_branches
from armkin.motion.plan.path_plan import PathPlan
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.profile import seven_phases
from armkin.motion.timing.time_optimal import Bounds, optimal_law, refine_knots
from armkin.motion.tool_path.path_pieces import split_target

SIX = ("three_dof", "irb2400", "puma560", "ar4", "labvolt_5150", "ur5e")
ARMS = ("three_dof", "irb2400", "puma560", "irb120", "ar4", "labvolt_5150", "parol6", "ra02")


def arm_with_rates(name: str) -> armkin.Arm:
    """An arm with rates, ours where its file has none."""
    arm = armkin.load(name)
    unit = np.where(arm.prismatic, 5.0, np.pi / 180)
    speed = np.where(np.isnan(arm.max_speed), 90 * unit, arm.max_speed)
    return replace(arm, max_speed=speed, max_accel=np.where(np.isnan(arm.max_accel), 3 * speed, arm.max_accel))


def planned_along(arm: armkin.Arm, ends: np.ndarray) -> PathPlan | None:
    """The plan of a line; None: no branch carries it."""
    try:
        return armkin.path(arm, ends, hold=None)
    except armkin.NoSolutionError:
        return None


def print_branches(lines: int) -> None:
    """Reach, runs, worst tip deviation and cost of the ladder."""
    print("arm            lines  whole  reach differs (worst/mm)  runs differ  worst dev/um  ladder us/pt  ik us/pt")
    for name in ARMS:
        arm, rng = arm_with_rates(name), np.random.default_rng(7)
        carried = differ = unlike_runs = 0
        reach_error = worst = spent = ik_seconds = 0.0
        for _ in range(lines):
            way = random_line(arm, rng)
            dense = np.linspace(0, way.length, 1001)
            columns = link_branches(arm, way.targets, dense[::4], task=None, tolerance=0.05, near=arm.home)
            chains = chains_of_columns(arm, columns)
            mine = max(
                (columns.s[c.carries_to(0)] for c in chains if c.first == 0 and c.carries_to(0) >= 0), default=-1.0
            )
            carried += mine >= way.length - 1e-9
            apart = abs(mine - brute_force_reach.reach_length(arm, way.targets, dense, 0.05))
            reach_error, differ = max(reach_error, apart), differ + (apart > 0.01)
            length = [columns.s[run.last] - columns.s[run.first] for run in fewest_runs(chains, len(columns.s))]
            for finer_by in (1, 10):  # a run that is shorter than their step is none to the samples
                s = np.linspace(0, way.length, 1000 * finer_by + 1)
                unlike = sum(x > s[1] for x in length) != len(brute_force_reach.fewest_runs(arm, way.targets(s), 0.05))
                if not unlike:
                    break
            unlike_runs += unlike
            worst = max(worst, tips_off(arm, chains))
            s = np.linspace(0, way.length, 10_000)
            targets = way.targets(s)
            began = time.process_time()
            armkin.ik(arm, targets)
            between = time.process_time()
            fewest_runs(
                chains_of_columns(arm, link_branches(arm, way.targets, s, task=None, tolerance=0.05, near=arm.home)),
                10_000,
            )
            ik_seconds, spent = ik_seconds + between - began, spent + time.process_time() - between
        per = 1e6 / lines / 10_000
        print(
            f"{name:14} {lines:5d} {carried:6d} {differ:7d} ({reach_error:.4f}) {unlike_runs:20d} {1000 * worst:13.1f} "
            f"{spent * per:13.1f} {ik_seconds * per:9.2f}",
            flush=True,
        )


def tips_off(arm: armkin.Arm, chains: list[BranchChain]) -> float:
    """How far the tip leaves its chord at most, on twenty points of every step of all chains [mm]."""
    worst, f = 0.0, np.linspace(0, 1, 20)[:, None]
    for chain in chains:
        for part in np.array_split(np.arange(len(chain.q) - 1), max(len(chain.q) // 2000, 1)):
            if len(part):
                a, b = chain.q[part, None], chain.q[part + 1, None]
                p = armkin.fk(arm, a + f * (b - a))[..., :3, 3]
                deviation = np.linalg.norm(p - p[:, :1] - f * (p[:, -1:] - p[:, :1]), axis=2).max()
                worst = max(worst, float(deviation))
    return worst


def print_tips(lines: int) -> None:
    """The tip between samples on many lines, few samples each: every chain, and what is planned of those carried."""
    print("arm            lines  chains' steps  beyond 0.05 mm  worst dev/um  planned  beyond  worst/um")
    for name in SIX:
        arm, rng = arm_with_rates(name), np.random.default_rng(31)
        lines_each = -(-lines // len(SIX))
        steps = beyond = planned = wrong = 0
        worst = far = 0.0
        for _ in range(lines_each):
            way = random_line(arm, rng)
            columns = link_branches(
                arm, way.targets, np.linspace(0, way.length, 60), task=None, tolerance=0.05, near=arm.home
            )
            chains = chains_of_columns(arm, columns)
            steps += sum(len(chain.q) - 1 for chain in chains)
            deviation = tips_off(arm, chains)
            worst, beyond = max(worst, deviation), beyond + (deviation > 0.05)
            ends = way.targets(np.array([0.0, way.length]))
            plan = planned_along(arm, ends)
            if plan is None:
                continue
            planned += 1
            curve = plan.motion.stretches[-1]
            assert isinstance(curve, Curve)
            t = np.interp(np.arange(20 * len(curve.times)) / 20, np.arange(len(curve.times)), curve.times)
            p = armkin.fk(arm, curve.evaluate(t))[:, :3, 3]
            a, b = (split_target(task_for(arm), end).position for end in ends)
            a, b = (np.append(x, p[0, 2])[:3] if len(x) < 3 else x for x in (a, b))
            d = (b - a) / np.linalg.norm(b - a)
            deviation = float(np.linalg.norm(p - a - ((p - a) @ d)[:, None] * d, axis=1).max())
            far, wrong = max(far, deviation), wrong + (deviation > 0.05)
        print(
            f"{name:14} {lines_each:5d} {steps:14d} {beyond:15d} {1000 * worst:13.1f} {planned:8d} {wrong:7d} "
            f"{1000 * far:9.1f}",
            flush=True,
        )


def print_chosen(lines: int) -> None:
    """The chosen branch's time against the fastest of all that carry the line; executed at 1 ms."""
    print("arm            planned  chosen/best  speed   accel   (executed at 1 ms, shares of the limits)")
    for name in ARMS:
        arm, rng = arm_with_rates(name), np.random.default_rng(7)
        ratio = speed = accel = 0.0
        planned = 0
        for _ in range(lines):
            way = random_line(arm, rng)
            ends = way.targets(np.array([0.0, way.length]))
            plan = planned_along(arm, ends)
            if plan is None:
                continue
            planned += 1
            times = []
            for branch in plan.branches:
                if branch.carries >= plan.length - 1e-6 and branch.name:
                    times.append(armkin.path(arm, ends, hold=None, branch=branch.name).motion.stretches[-1].duration)
            ratio = max(ratio, plan.motion.stretches[-1].duration / min(times, default=np.inf))
            q = plan.q(np.arange(0, plan.duration, 0.001))
            speed = max(speed, float((np.abs(np.diff(q, axis=0)) / 0.001 / arm.max_speed).max()))
            accel = max(accel, float((np.abs(np.diff(q, n=2, axis=0)) / 1e-6 / arm.max_accel).max()))
        print(f"{name:14} {planned:7d} {ratio:12.5f} {speed:7.4f} {accel:7.4f}", flush=True)


def print_laws(splines: int) -> None:
    """The law of time on cubic splines against toppra on the same grid: cost and result."""
    try:
        import toppra
        from scipy.interpolate import CubicSpline
        from toppra import algorithm, constraint
    except ImportError:
        print("toppra is not installed")
        return
    logging.disable(logging.CRITICAL)
    print("joints  points  ours ms  toppra ms  ratio   T ours/toppra - 1 (least, greatest)")
    u = np.linspace(0, 1, 7)
    for n in (3, 6):
        v, a = np.ones(n), np.full(n, 2.0)
        bounds = [
            constraint.JointVelocityConstraint(np.stack([-v, v], 1)),
            constraint.JointAccelerationConstraint(np.stack([-a, a], 1)),
        ]
        ways = [np.random.default_rng(seed).normal(size=(7, n)) for seed in range(splines)]
        curves = [CubicSpline(u, way) for way in ways]
        theirs_of = [toppra.SplineInterpolator(u, way) for way in ways]
        for N, rounds in ((100, 9), (200, 9), (1000, 3), (10_000, 1)):
            s = np.linspace(0, 1, N)
            ours, theirs = [], []
            for _ in range(rounds):  # all splines ours, all splines theirs, in turn: the best round of each counts
                began = time.process_time()
                paths = [refine_knots(Knots(s, curve(s), curve(s, 1))) for curve in curves]
                mine = [optimal_law(path, Bounds(v, a, np.full(len(path.s), np.inf))) for path in paths]
                between = time.process_time()
                made = [algorithm.TOPPRA(bounds, c, gridpoints=s).compute_parameterization(0, 0)[1] for c in theirs_of]
                ours.append(between - began)
                theirs.append(time.process_time() - between)
            apart = [
                Curve(path, x).duration / float(np.sum(2 * np.diff(s) / (sd[1:] + sd[:-1]))) - 1
                for path, x, sd in zip(paths, mine, made, strict=True)
            ]
            us = 1e3 / splines
            print(
                f"{n:6d} {N:7d} {us * min(ours):8.2f} {us * min(theirs):10.2f} {min(ours) / min(theirs):6.2f}   "
                f"{min(apart):+.1e} {max(apart):+.1e}",
                flush=True,
            )


def print_straight(moves: int) -> None:
    """Straight moves with bounded jerk against ruckig."""
    try:
        import ruckig
    except ImportError:
        print("ruckig is not installed")
        return
    worst, rng = 0.0, np.random.default_rng(1)
    for _ in range(moves):
        length, v, a, j = 10 ** rng.uniform([-2, -1, -1, -1], [2, 1, 1, 2])
        parameters = ruckig.InputParameter(1)
        parameters.current_position, parameters.target_position = [0.0], [length]
        parameters.max_velocity, parameters.max_acceleration, parameters.max_jerk = [v], [a], [j]
        made = ruckig.Trajectory(1)
        ruckig.Ruckig(1).calculate(parameters, made)
        worst = max(worst, abs(seven_phases(length, v, a, j).duration / made.duration - 1))
    print(f"straight moves with jerk, {moves} at random: T ours/ruckig - 1 at most {worst:.1e}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--lines", type=int, default=50)
    parser.add_argument("--splines", type=int, default=20)
    parser.add_argument("--tips", type=int, default=0, help="lines on six arms, 20 points a step, and nothing else")
    parser.add_argument("--laws", action="store_true", help="the law of time against toppra, and nothing else")
    arguments = parser.parse_args()
    if arguments.laws:
        print_laws(arguments.splines)
        return
    if arguments.tips:
        print_tips(arguments.tips)
        return
    print_straight(2000)
    print_laws(arguments.splines)
    print_chosen(arguments.lines)
    print_branches(arguments.lines)


if __name__ == "__main__":
    main()
