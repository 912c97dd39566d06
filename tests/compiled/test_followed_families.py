"""Families of arms like the Panda by machine code: those of Python, but where rounding hides what happens."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin import Status
from armkin.compiled import c_source, known_curves
from armkin.compiled.families_source import followed_redundancy
from armkin.inverse.redundant.boundaries import boundaries, from_joint7
from armkin.inverse.redundant.families import curves_in_numpy
from armkin.inverse.redundant.interval_pieces import motion

sys.path.insert(0, str(Path(__file__).parents[1] / "inverse"))
from redundant_arms import arm_with_shoulder_and_wrist, covers_value, held_answers, redundant_postures

JOINT = 6  # the redundant one
SANITIZERS = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
DRIVER = """
#include <stdio.h>
#include <stdlib.h>
int main(int words, char **word)
{
    const int64_t n = atoi(word[1]);
    const size_t sizes[] = {128, 96, 8 * ARM_JOINTS, 1, 8, 8 * ARM_PIECES, ARM_PIECES, 16 * ARM_PIECES,
        8 * ARM_PIECES * ARM_JOINTS};
    void *x[9];
    FILE *file = fopen(word[words - 1], "rb");
    int64_t k, pieces = 0;
    for (k = 0; k < 9; k++) {
        x[k] = malloc((size_t)n * sizes[k]);
        if (k < 3 && fread(x[k], sizes[k], (size_t)n, file) != (size_t)n)
            return 1;
    }
    fclose(file);
    arm_families(n, x[0], x[1], x[2], ARM_JOINTS, x[3], x[4], x[5], x[6], x[7], x[8]);
    for (k = 0; k < n; k++)
        pieces += ((int64_t *)x[4])[k];
    for (k = 0; k < 9; k++)
        free(x[k]);
    printf("%d\\n", (int)pieces);
    return 0;
}
"""


def target_sets(arm: armkin.Arm, count: int) -> dict[str, np.ndarray]:
    """Targets of random postures, of some with a joint near a limit, stretched, rounded, and out of reach."""
    q, target = redundant_postures(arm, None, count, 31)
    rng = np.random.default_rng(7)
    beside, joint, at_end = q.copy(), rng.integers(0, arm.n, count), 10.0 ** rng.uniform(-12, -2, count)
    upper = rng.integers(0, 2, count) > 0
    beside[np.arange(count), joint] = np.where(upper, arm.upper[joint] - at_end, arm.lower[joint] + at_end)
    stretched = q.copy()
    stretched[:, 3] = arm.upper[3] - 10.0 ** rng.uniform(-8, -1, count)
    far = target.copy()
    far[:, :3, 3] *= np.linspace(0.8, 2.5, count)[:, None]
    sets = {"random": target, "limits": armkin.fk(arm, beside), "stretched": armkin.fk(arm, stretched)}
    return sets | {"rounded": np.round(target, 7), "far": far}


def assert_same_families(
    arm: armkin.Arm, python: armkin.Solutions, compiled: armkin.Solutions, near: np.ndarray
) -> int:
    """The same pieces, and as near postures, of targets that Python knows to be complete; how many these are.

    Beside a branch's end its joints move with the root of the way to it, so that rounding moves them by 1e-3 degrees.
    """
    assert not (python.complete & ~compiled.complete).any()
    assert python.names[:8] == compiled.names[:8]
    for k in np.flatnonzero(python.complete):
        rows = np.flatnonzero(python.valid[k])
        assert python.status[k] == compiled.status[k]
        for name in ("valid", "within_limits", "branch"):
            left, right = (getattr(s, name)[k] for s in (python, compiled))
            np.testing.assert_array_equal(left[rows], right[rows], err_msg=name)
            assert compiled.valid[k].sum() == len(rows)
        assert python.interval is not None
        assert compiled.interval is not None
        ends = compiled.interval[k, rows]
        np.testing.assert_allclose(ends, python.interval[k, rows], rtol=0, atol=1e-9)
        longer = motion(arm, compiled.q[k, rows], near[k]) - motion(arm, python.q[k, rows], near[k])
        at_end = np.abs(compiled.q[k, rows, JOINT, None] - ends).min(axis=1) < 1e-8
        legal = python.within_limits[k, rows]
        assert (longer[legal] <= np.where(at_end, 1e-2, 1e-5)[legal]).all()
        assert (longer[legal & ~at_end] >= -1e-5).all()
    mm, rad = compiled.residual()
    assert np.nanmax(mm, initial=0.0) <= 1e-9 * arm.reach
    assert np.nanmax(rad, initial=0.0) <= 1e-9
    return int(python.complete.sum())


@pytest.mark.parametrize("kind", ["random", "limits", "stretched", "rounded", "far"])
@pytest.mark.parametrize("at_once", [1, 7, 250])
def test_families_are_those_of_python(kind: str, at_once: int) -> None:
    arm = armkin.load("panda")
    fast = armkin.compile(arm)
    count = min(200, 6 * at_once)
    target = target_sets(arm, count)[kind]
    for near in (np.tile(arm.home, (count, 1)), np.random.default_rng(2).uniform(-3.5, 3.5, (count, arm.n))):
        same = 0
        for begin in range(0, count, at_once):
            rows = slice(begin, begin + at_once)
            python = armkin.ik(arm, target[rows], near=near[rows])
            same += assert_same_families(arm, python, fast.ik(target[rows], near=near[rows]), near[rows])
        assert same >= 0.95 * count


def test_at_the_end_of_the_workspace_no_joint_moves_much() -> None:
    arm = armkin.load("panda")
    fast = armkin.compile(arm)
    _, target = redundant_postures(arm, None, 20, 4)
    scale = np.array([np.ones(20), np.full(20, 4.0)])
    for _ in range(45):
        middle = scale.mean(axis=0)
        reached = fast.ik(scaled(target, middle)).valid.any(axis=1)
        scale = np.where(reached, [middle, scale[1]], [scale[0], middle])
    statuses = []
    for share in (1e-3, 1e-5, 1e-7):
        inside = scaled(target, scale[0] * (1.0 - share))
        python, compiled = armkin.ik(arm, inside), fast.ik(inside)
        assert_same_families(arm, python, compiled, np.tile(arm.home, (20, 1)))
        statuses += compiled.status.tolist()
    assert {Status.EXACT, Status.BOUNDARY} <= set(statuses)


def scaled(target: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Targets (N, 4, 4) at multiples (N,) of their positions."""
    targets = target.copy()
    targets[:, :3, 3] *= scale[:, None]
    return targets


def test_where_rounding_decides_python_is_asked() -> None:
    """Postures at multiples of 30 degrees: several things happen at one place."""
    arm = armkin.load("panda")
    q = np.deg2rad(30.0 * np.random.default_rng(1).integers(-6, 7, (300, arm.n)))
    target = armkin.fk(arm, np.clip(q, arm.lower, arm.upper))
    python, compiled = armkin.ik(arm, target), armkin.compile(arm).ik(target)
    assert not (python.complete & ~compiled.complete).any()
    assert 15 <= (~compiled.complete).sum() <= (~python.complete).sum()


def test_arms_of_the_kind_have_their_families_whatever_their_axes() -> None:
    """Axes 1 to 3 meet, and axes 5 and 6; one joint has no limits, one turns by more than a turn."""
    rng = np.random.default_rng(3)
    limits = np.sort(rng.uniform(-3.1, 3.1, (7, 2)), axis=1) + np.array([-1.0, 1.0])
    limits[0], limits[2] = (-np.inf, np.inf), (-4.5, 4.5)
    arm = arm_with_shoulder_and_wrist(rng, limits)
    target = armkin.fk(arm, rng.uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi), (60, 7)))
    near = rng.uniform(-4, 4, (60, 7))
    python, compiled = armkin.ik(arm, target, near=near), armkin.compile(arm).ik(target, near=near)
    assert assert_same_families(arm, python, compiled, near) >= 54


def test_a_posture_that_stands_on_its_target_stays() -> None:
    arm = armkin.load("panda")
    q, target = redundant_postures(arm, None, 40, 3)
    s = armkin.compile(arm).ik(target, near=q)
    best = np.take_along_axis(s.q, s.best[:, None, None], axis=1)[:, 0]
    np.testing.assert_array_equal(best, q)


def test_few_targets_are_left_to_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 10,000 random ones 18 are."""
    arm, counts = armkin.load("panda"), [0]

    def count_and_follow(follower):  # type: ignore[no-untyped-def]
        counts.append(len(follower.target))
        return curves_in_numpy(follower)

    monkeypatch.setattr(known_curves, "curves_in_numpy", count_and_follow)
    _, target = redundant_postures(arm, None, 1000, 11)
    fast = armkin.compile(arm)
    assert (fast.ik(target).best >= 0).all()
    assert sum(counts) <= 6
    counts.clear()
    fast.ik(target[:3], near=np.full(arm.n, 1e6))  # whole turns of such angles are left to numpy
    assert sum(counts) == 3


def test_places_that_all_but_meet_are_told_apart() -> None:
    """Of these targets double precision has some ends 1e-6 rad off, or sees none."""
    arm = armkin.load("panda")
    _, target = redundant_postures(arm, None, 3500, 21)
    target = target[[1406, 1466, 3475]]
    s = armkin.compile(arm).ik(target)
    assert s.complete.all()
    assert s.interval is not None
    for k in range(len(target)):
        legal = s.interval[k][s.within_limits[k]]
        ends = np.sort(legal.ravel())
        ends = ends[np.diff(ends, prepend=-np.inf) > 1e-8]
        for value in (ends[:, None] + np.deg2rad(1e-6) * np.array([-1.0, 1.0])).ravel():
            if arm.lower[JOINT] < value < arm.upper[JOINT]:
                held = held_answers(arm, JOINT, float(value), target[k], None)
                assert covers_value(arm, legal, float(value), 0.0).sum() == len(held), (k, value)


def test_a_calibrated_arm_has_its_families() -> None:
    """Machine code took its commanded joint values for actual ones: 27 mm off its target."""
    panda = armkin.load("panda")
    ratio = np.array([1.0, 1.01, 0.99, 1.0, 1.02, 1.0, 0.98])
    arm = replace(panda, ratio=ratio)
    q, target = redundant_postures(arm, None, 20, 3)
    s = armkin.compile(arm).ik(target, near=q)
    assert s.arm is arm
    python = armkin.ik(arm, target, near=q)
    assert assert_same_families(arm, python, s, q) >= 19
    best = np.take_along_axis(s.q, s.best[:, None, None], axis=1)[:, 0]
    np.testing.assert_allclose(best, q, rtol=0, atol=1e-12)


def test_the_sanitizers_find_nothing(tmp_path: Path) -> None:
    arm = armkin.load("panda")
    bounds = boundaries(arm)
    assert bounds is not None
    parts = list(target_sets(arm, 40).values())
    corners = np.deg2rad(30.0 * np.random.default_rng(1).integers(-6, 7, (40, arm.n)))
    target = np.concatenate([*parts, armkin.fk(arm, corners)])
    rotation, shoulder = from_joint7(bounds, target)
    near = np.random.default_rng(2).uniform(-4, 4, (len(target), arm.n))
    near[0], near[1] = 1e6, np.nan
    inputs = (target, np.concatenate([rotation.reshape(-1, 9), shoulder], axis=1), near)
    (tmp_path / "targets").write_bytes(b"".join(np.ascontiguousarray(x).tobytes() for x in inputs))
    text = c_source.library(arm, arm, None, None, followed_redundancy(arm, None)).text
    (tmp_path / "families.c").write_text(text + DRIVER)
    command = ["gcc", "-std=c99", *SANITIZERS, "families.c", "-lm", "-o", "families"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    run = subprocess.run(
        ["./families", str(len(target)), "targets"], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert not run.stderr
    assert int(run.stdout) > 8 * len(target)
