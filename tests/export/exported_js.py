"""What `armkin export --js` writes, asked in node: does it say what Python says?"""

from __future__ import annotations

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import armkin
from armkin.export.js.es_module import module_text
from armkin.inverse.numeric.newton import difference
from armkin.inverse.singular.local_structure import local_structure, members
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import targets_of
from armkin.model.arm import actual_arm

# of one arm there is one text in all tests of a process
_text_of = cache(module_text)

_ASK = """
import * as arm from './arm.mjs';
import { readFileSync, writeFileSync } from 'node:fs';
const asked = JSON.parse(readFileSync('asked.json', 'utf8'));
const began = process.hrtime.bigint();
const ik = asked.targets.map((target, k) => arm.ik(target, asked.near[k], asked.held?.[k]));
const seconds = Number(process.hrtime.bigint() - began) / 1e9;
const told = { ik, seconds, redundant: arm.redundant };
for (const name of ['fk', 'jacobian', 'target', 'pulses']) if (arm[name]) told[name] = asked.q.map(arm[name]);
if (arm.clearance) told.clearance = asked.q.map(arm.clearance);
if (arm.joints) told.joints = told.pulses.map(arm.joints);
writeFileSync('told.json', JSON.stringify(told));
"""


def ask_module(
    arm: armkin.Arm,
    folder: Path,
    q: np.ndarray,
    near: np.ndarray | None = None,
    targets: np.ndarray | None = None,
    task: str | None = None,
    held: np.ndarray | None = None,
) -> dict[str, Any]:
    """What the exported module says of postures (N, n): fk, jacobian, target, pulses, and ik of targets.

    held: (N,) where the joint to spare is held.
    """
    node = shutil.which("node")
    assert node, "node runs the module; scripts/test installs it"
    goals = goals_of(arm, q) if targets is None else targets
    close = np.broadcast_to(arm.home, q.shape) if near is None else near
    question = {"q": q.tolist(), "targets": goals.tolist(), "near": close.tolist()}
    if held is not None:
        question["held"] = held.tolist()
    (folder / "arm.mjs").write_text(_text_of(arm, task), encoding="utf-8")
    (folder / "asked.json").write_text(json.dumps(question))
    (folder / "ask.mjs").write_text(_ASK)
    subprocess.run([node, "ask.mjs"], cwd=folder, check=True, timeout=300)
    answer: dict[str, Any] = json.loads((folder / "told.json").read_text())
    return answer


def goals_of(arm: armkin.Arm, q: np.ndarray) -> np.ndarray:
    """The targets that postures (N, n) answer."""
    task, _ = solver(actual_arm(arm), None)
    return targets_of(task, armkin.fk(arm, q), q * arm.ratio)


def differences(arm: armkin.Arm, answers: list[dict[str, Any]], s: armkin.Solutions) -> list[str]:
    """What differs between the module's answers and Python's (N,): a line for each target that is not the same."""
    return [line for k, answer in enumerate(answers) if (line := _difference(arm, answer, s, k))]


def _difference(arm: armkin.Arm, answer: dict[str, Any], s: armkin.Solutions, k: int) -> str:
    status = armkin.Status(s.status[k]).name.lower()
    if answer["status"] != status:
        return f"target {k}: {answer['status']}, Python {status}"
    order = [b for b in s.order[k] if s.valid[k, b]]
    python, theirs = s.q[k][order], np.array([row["joints"] for row in answer["branches"]]).reshape(-1, arm.n)
    if len(python) != len(theirs):
        return f"target {k} ({status}): {len(theirs)} branches, Python {len(python)}"
    names, free = [s.names[i] for i in s.branch[k][order]], [arm.joint_names[j] for j in np.flatnonzero(s.free[k])]
    if answer["free_joints"] != free:
        return f"target {k}: free {answer['free_joints']}, Python {free}"
    if status == "singular":  # a posture of each self-motion: which one is a matter of the way there
        target = np.repeat(s.target[k][None], len(theirs), axis=0)
        error = residual(s.task, armkin.fk(arm, theirs), theirs * arm.ratio, target)
        error[:, : s.task.position] /= arm.reach
        worst = float(np.abs(error).max(initial=0.0))
        legal = [any(row["within_limits"] for row in answer["branches"]), bool(s.within_limits[k].any())]
        if worst > 2e-9 or legal[0] != legal[1]:
            return f"target {k}: a row misses by {worst:.1e}; legal ones here and in Python: {legal}"
        return ""
    if sorted(row["name"] for row in answer["branches"]) != sorted(names) and status == "exact":
        return f"target {k}: names"
    if status == "boundary":
        return "" if _one_each(arm, s, k, python, theirs) else f"target {k} (boundary): other solutions"
    unit = np.where(arm.prismatic, arm.reach, 1.0)
    apart = np.abs((theirs[:, None] - python[None]) / unit).max(axis=2)
    if (worst := float(apart.min(axis=0).max(initial=0.0))) > np.deg2rad(1e-9):
        return f"target {k}: joint values {worst:.1e} apart"
    if s.within_limits[k][order].tolist() != [row["within_limits"] for row in answer["branches"]]:
        return f"target {k}: limits"
    best = None if s.best[k] < 0 else 0
    return "" if answer["best"] == best else f"target {k}: best {answer['best']}, Python {best}"


def _one_each(arm: armkin.Arm, s: armkin.Solutions, k: int, python: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether each posture (B, n) is of the component of one of Python's, modulo whole turns.

    A posture at which the Jacobian loses several directions, so that its component is not known, is at the same place
    but for the root of rounding.
    """
    structure = local_structure(arm, s.task, python * arm.ratio, np.repeat(s.target[k][None], len(python), axis=0))
    way = difference(arm, theirs[None] * arm.ratio, python[:, None] * arm.ratio)
    same = (structure.known[:, None] & members(structure, np.arange(len(python)), way)) | (
        np.abs(way).max(axis=2) < np.where(structure.known, 1e-7, 1e-4)[:, None]
    )
    return bool((same.sum(axis=0) >= 1).all() and (same.sum(axis=1) >= 1).all())
