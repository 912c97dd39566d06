"""Double roots that two solutions share: their two vectors, however mixed, give both solutions back."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from geometries import case, right_angles
from oracle import goal
from test_every_branch import shipped

import armkin
from armkin import Status
from armkin.formula.arrays import Array
from armkin.inverse.elimination import equal_roots
from armkin.inverse.solvers.recognise import solver


def product(q: float, k: float) -> Array:
    f = q / 2
    return np.outer([np.cos(3 * f), np.sin(3 * f), np.cos(f), np.sin(f)], [1.0, np.cos(k), np.sin(k)])


def mixed(one: Array, other: Array, weights: Array) -> tuple[Array, Array]:
    """Two matrices (1, 4, 3) that span the same plane, orthonormal."""
    vectors = np.linalg.qr((weights @ np.stack([one.ravel(), other.ravel()])).T)[0].T
    return vectors[0].reshape(1, 4, 3), vectors[1].reshape(1, 4, 3)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((0.3, -1.2), (2.0, 0.4)),
        ((0.3, -1.2), (0.3, 0.4)),  # the dialytic joint is alike, too
        ((0.3, 0.4), (2.0, 0.4)),  # and the third
        ((0.3, -1.2), (0.3 + np.pi, -1.2)),
        ((0.3, -1.2), (0.3 + np.pi, -1.2 + np.pi)),
        ((np.pi, np.pi / 2), (0.0, -np.pi / 2)),
    ],
)
def test_both_products_come_back_from_any_mixture(first: tuple[float, float], second: tuple[float, float]) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = mixed(product(*first), product(*second), rng.normal(size=(2, 2)))
        weights, good = equal_roots.products(a, b)
        assert good.all()
        found = [weights[0, i, 0] * a[0] + weights[0, i, 1] * b[0] for i in (0, 1)]
        for wanted in (product(*first), product(*second)):
            cosines = [abs((f * wanted).sum()) / np.linalg.norm(f) / np.linalg.norm(wanted) for f in found]
            assert max(cosines) == pytest.approx(1.0, abs=1e-12)


def test_a_plane_without_two_products_gives_none() -> None:
    rng = np.random.default_rng(1)
    one = product(0.3, -1.2)
    for other in (rng.normal(size=(4, 3)), product(0.3, -1.2) + 1e-3 * rng.normal(size=(4, 3))):
        assert not equal_roots.products(*mixed(one, other, rng.normal(size=(2, 2))))[1].any()
    # two complex solutions: real and imaginary part of their products
    f, k = 0.3 + 0.4j, -1.2 + 0.2j
    z = np.outer([np.cos(3 * f), np.sin(3 * f), np.cos(f), np.sin(f)], [1.0, np.cos(k), np.sin(k)])
    assert not equal_roots.products(*mixed(z.real, z.imag, rng.normal(size=(2, 2))))[1].any()


def test_pairs_are_two_roots_and_not_three() -> None:
    pose = np.array([0, 0, 0, 1, 1, 1, 2, 2])
    x = np.array([1.0, 0.2, 1.0 + 1e-12, 0.5, 0.5 + 1e-12, 0.5 - 1e-12, 1.0, 0.2])
    first, second = equal_roots.pairs(pose, x)
    assert [set(pair) for pair in zip(first, second, strict=True)] == [{0, 2}]


def test_round_postures_that_share_a_joint_are_complete() -> None:
    """A CRX-10iA at 200 postures of multiples of 90 degrees: of 37 regular ones 30 were left open, 7 are."""
    arm, screw = shipped("fanuc_crx10ia")
    task, _ = solver(arm, None)
    q = truth.round_postures(arm, 90, 200, seed=2)
    solutions = armkin.ik(arm, goal(task, screw, q).array())
    regular = np.flatnonzero(solutions.status == Status.EXACT)
    assert len(regular) > 30
    assert solutions.complete[regular].mean() > 0.8
    q = q[regular]
    target = goal(task, screw, q).array()
    verdict = truth.judge(arm, screw, None, q, target)
    truth.ask_oracle(arm, screw, verdict, target, np.arange(0, len(q), 3), 250, 3)
    assert verdict, verdict


def test_solutions_that_differ_in_the_end_joints_alone_are_one_root_and_not_forgotten() -> None:
    """Eight branches of an arm of right angles, four with joint 2 at 0, four at 180, pairs with joints 2 to 4 alike.

    Two double roots gave four of these, and no more were said to be there: six listed, complete true.
    """
    arm, screw, *_ = case(right_angles(np.random.default_rng(5)), "pose")
    task, _ = solver(arm, "pose")
    q = np.radians([[-90, 0, 0, 90, -90, 90]])
    verdict = truth.judge(arm, screw, "pose", q, goal(task, screw, q).array())
    assert verdict, verdict
    assert verdict.solutions.valid.sum() == 8
