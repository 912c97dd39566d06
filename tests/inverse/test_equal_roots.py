"""Roots that several solutions share: their vectors, however mixed, give all of them back."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from geometries import case_of, right_angles
from oracle import goal_of_joints
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.formula.arrays import Array
from armkin.inverse.elimination import equal_roots
from armkin.inverse.solvers.solver_of_arm import solver


def half_powers(q: complex) -> Array:
    f = q / 2
    return np.array([np.cos(3 * f), np.sin(3 * f), np.cos(f), np.sin(f)])


def outer_product(q: complex, k: complex, wide: bool) -> Array:
    return np.outer(half_powers(q), half_powers(k) if wide else [1.0, np.cos(k), np.sin(k)])


def mix_products(vectors: list[Array], weights: Array) -> Array:
    """Matrices (1, d, 4, 3 or 4) that span the same space, orthonormal."""
    flat = weights @ np.stack([v.ravel() for v in vectors])
    return np.linalg.qr(flat.T)[0].T.reshape(1, len(vectors), *vectors[0].shape)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize(
    "solutions",
    [
        [(0.3, -1.2), (2.0, 0.4)],
        [(0.3, -1.2), (0.3, 0.4)],  # the dialytic joint is alike, too
        [(0.3, 0.4), (2.0, 0.4)],  # and the third
        [(0.3, -1.2), (0.3 + np.pi, -1.2)],
        [(0.3, -1.2), (0.3 + np.pi, -1.2 + np.pi)],
        [(np.pi, np.pi / 2), (0.0, -np.pi / 2)],
        [(0.3, -1.2), (0.3, 1.9), (-2.0, -1.2), (-2.0, 1.9)],  # four of a CRX-10iA with axis 6 upright
    ],
)
def test_all_products_come_back_from_any_mixture(solutions: list[tuple[float, float]], wide: bool) -> None:
    rng = np.random.default_rng(0)
    products = [outer_product(*solution, wide) for solution in solutions]
    for _ in range(20):
        v = mix_products(products, rng.normal(size=(len(products), len(products))))
        weights, real, good = equal_roots.products(v)
        assert good.all()
        assert real.all()
        recovered = (weights[0] @ v.reshape(len(products), -1)).reshape(-1, *products[0].shape)
        for expected in products:
            cosines = [abs((f * expected).sum()) / np.linalg.norm(f) / np.linalg.norm(expected) for f in recovered]
            assert max(cosines) == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize("wide", [False, True])
def test_complex_solutions_are_told_and_others_are_left(wide: bool) -> None:
    rng = np.random.default_rng(1)
    z = outer_product(0.3 + 0.4j, -1.2 + 0.2j, wide)  # of two complex solutions real and imaginary part are in the span
    real, good = equal_roots.products(mix_products([z.real, z.imag], rng.normal(size=(2, 2))))[1:]
    assert good.all()
    assert not real.any()
    z = outer_product(0.3 + 1e-6j, -1.2 + 1e-6j, wide)  # two real ones, or two complex ones: rounding hides which
    assert not equal_roots.products(mix_products([z.real, 1e6 * z.imag], rng.normal(size=(2, 2))))[2].any()


def test_groups_are_equal_roots_of_one_pose() -> None:
    pose = np.array([0, 0, 0, 1, 1, 1, 2, 2])
    x = np.array([1.0, 0.2, 1.0 + 1e-12, 0.5, 0.5 + 1e-12, 0.5 - 1e-12, 1.0, 0.2])
    assert [[set(rows) for rows in same.tolist()] for same in equal_roots.groups(pose, x)] == [[{0, 2}], [{3, 4, 5}]]
    assert equal_roots.groups(pose[:0], x[:0]) == []


def test_round_postures_that_share_a_joint_are_complete() -> None:
    """A CRX-10iA at 200 postures of multiples of 90 degrees: of 37 regular ones 30 were left open, 7 are."""
    arm, screw = shipped_arm("fanuc_crx10ia")
    task, _ = solver(arm, None)
    q = truth.round_postures(arm, 90, 200, seed=2)
    solutions = armkin.ik(arm, goal_of_joints(task, screw, q).array())
    regular = np.flatnonzero(solutions.status == Status.EXACT)
    assert len(regular) > 30
    assert solutions.complete[regular].mean() > 0.8
    q = q[regular]
    target = goal_of_joints(task, screw, q).array()
    verdict = truth.judge(arm, screw, None, q, target)
    truth.ask_oracle(arm, screw, verdict, target, np.arange(0, len(q), 3), 250, 3)
    assert verdict, verdict


def test_solutions_that_differ_in_the_end_joints_alone_are_one_root_and_not_forgotten() -> None:
    """Eight branches of an arm of right angles, four with joint 2 at 0, four at 180, pairs with joints 2 to 4 alike.

    Two double roots gave four of these, and no more were said to be there: six listed, complete true.
    """
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(5)), "pose")
    task, _ = solver(arm, "pose")
    q = np.radians([[-90, 0, 0, 90, -90, 90]])
    verdict = truth.judge(arm, screw, "pose", q, goal_of_joints(task, screw, q).array())
    assert verdict, verdict
    assert verdict.solutions.valid.sum() == 8


def test_a_shared_root_that_rounding_makes_a_complex_pair_is_two_solutions() -> None:
    """Of targets that differ by 1e-13 mm 72 in 400 had six branches, not eight, and said complete."""
    locked_arm = armkin.lock(armkin.load("kinova_gen3"), {"J7": np.deg2rad(75.6)})
    posture = np.deg2rad([-45.0, -90, 90, -180, 90, -45])
    targets = np.repeat(armkin.fk(locked_arm, posture)[None], 50, axis=0)
    targets[:, :3, 3] += np.random.default_rng(0).uniform(-1e-13, 1e-13, (50, 3))
    s = armkin.ik(locked_arm, targets)
    assert (s.valid.sum(axis=1) == 8).all()


def test_a_multiple_root_that_rounding_tears_apart_loses_no_posture() -> None:
    """Of a CRX folded upright four solutions share a root; rounding takes it apart by 1e-4, and off the line.

    19 of 500 roundings of the target lost the posture, all of them called complete.
    """
    arm, rng = armkin.load("fanuc_crx10ia"), np.random.default_rng(0)
    q = np.radians([0.0, -90, 45, -90, 0, -135])
    T = np.repeat(armkin.fk(arm, q)[None], 300, axis=0)
    T[:, :3, :3] += 1.1e-16 * rng.integers(-2, 3, (300, 3, 3))
    T[:, :3, 3] *= 1 + 2.2e-16 * rng.integers(-1, 2, (300, 3))
    s = armkin.ik(arm, T)
    away = np.abs(np.angle(np.exp(1j * (s.q - q)))).max(axis=2)
    assert (np.where(s.valid, away, np.inf).min(axis=1) < 1e-5).all()
    assert (s.status == armkin.Status.BOUNDARY).all()
