"""Curves that dense points are taken from, and what is asked of their plans."""

from __future__ import annotations

import numpy as np

import armkin
from armkin.motion.plan.path_plan import PathPlan

CENTRE = np.array([340.0, 80.0, 300.0])


def harmonic_curve(seed: int, count: int) -> np.ndarray:
    """A random closed curve of five harmonics within 60 mm of its middle: (count, 2) [mm]."""
    c = np.random.default_rng(seed).normal(size=(4, 5)) * 40 / np.arange(1, 6) ** 1.6
    a = np.arange(1, 6)[:, None] * np.linspace(0, 2 * np.pi, count)
    xy = np.stack([c[0] @ np.cos(a) + c[1] @ np.sin(a), c[2] @ np.cos(a) + c[3] @ np.sin(a)])
    return np.asarray((60 * xy / np.hypot(*xy).max()).T)


def on_path(plan: PathPlan) -> float:
    """Seconds on the tool's way, without the joint move to it."""
    return sum(stretch.duration for stretch, _ in plan.on_path.values())


def executed_tips(plan: PathPlan) -> np.ndarray:
    """The executed tip, densely, while it is on the path."""
    parts = []
    for number, (stretch, _) in sorted(plan.on_path.items()):
        begin = plan.motion.begins[number]
        parts.append(plan.q(np.linspace(begin, begin + stretch.duration, 20_000)))
    return armkin.fk(plan.arm, np.concatenate(parts))[:, :3, 3]
