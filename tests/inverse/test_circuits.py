"""Self-motions in pieces: a linkage of four bars has two circuits, and an answer lists one posture of each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import oracle
import pytest
import truth
from oracle import Goal, Screws
from shipped_arms import shipped_arm
from truth import Array, Bool

import armkin
from armkin import Status
from armkin.inverse.singular import curves
from armkin.inverse.solvers.solver_of_arm import solver

STEP = 0.08  # [rad]


def leads_to(screw: Screws, goals: Goal, q: Array, to: Array) -> Bool:
    """Which of the postures to (M, B, n) lie on the curve of solutions through q (M, n), by the oracle: (M, B).

    Walked both ways in small steps along the null vector, pulled back by Newton's method, until it closes.
    """
    way = np.repeat([1.0, -1.0], len(q))
    goals, q, to = goals.take(np.tile(np.arange(len(q)), 2)), np.tile(q, (2, 1)), np.tile(to, (2, 1, 1))
    met = np.zeros(to.shape[:2], bool)
    standing, last, going = q.copy(), np.zeros_like(q), np.ones(len(q), bool)
    for step in range(250):
        k = np.flatnonzero(going)
        _, J = oracle._residual(screw, goals.take(k), standing[k])
        ahead = np.linalg.svd(J)[2][:, -1]
        side = (ahead * last[k]).sum(axis=1) if step else way * ahead[:, np.abs(ahead[0]).argmax()]
        last[k] = ahead * np.sign(side)[:, None]
        beside = truth.settle_across(screw, goals.take(k), standing[k] + STEP * last[k], weak=1e-4)
        standing[k] = truth.settle_across(screw, goals.take(k), beside, weak=1e-4)
        met[k] |= oracle.distance(screw, to[k], standing[k][:, None]) < 0.75 * STEP
        back = (step > 2) & (np.linalg.norm(truth._joint_difference(screw, q[k], standing[k]), axis=1) < 0.6 * STEP)
        stray = np.linalg.norm(oracle._residual(screw, goals.take(k), standing[k])[0], axis=1) > 1e-7
        going[k] = ~(back | stray)
        if not going.any():
            break
    return np.asarray(met[: len(met) // 2] | met[len(met) // 2 :])


@pytest.mark.parametrize(
    ("name", "surface"), [("ur5e", "J5 = 0"), ("mycobot_280", "J5 = 90"), ("wx250s", "elbow moved")]
)
def test_each_circuit_is_listed_once(name: str, surface: str, sample: Callable[[int, int], int]) -> None:
    """Of these up to a quarter lay on a circuit that was not listed."""
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    q = truth.singular_postures(arm, screw, None, 40, seed=3)[surface][: sample(40, 20)]
    goals = oracle.goal_of_joints(task, screw, q)
    s = armkin.ik(arm, goals.array())
    k = np.flatnonzero((s.status == Status.SINGULAR) & (s.free.sum(axis=1) > 2))
    assert len(k) > sample(15, 7)
    is_listed = oracle.distance(screw, s.q[k], q[k][:, None]).min(axis=1) < 1e-3
    held = np.where(s.free[k, None], 0.0, np.abs(truth._joint_difference(screw, q[k][:, None], s.q[k]))).max(axis=2)
    leads = leads_to(screw, goals.take(k), q[k], s.q[k]) & (held < 1e-4)
    assert (is_listed | leads.any(axis=1)).all(), q[k[~(is_listed | leads.any(axis=1))]]
    assert (leads.sum(axis=1) <= 1).all(), q[k[leads.sum(axis=1) > 1]]


def test_circuits_that_nearly_meet_are_two() -> None:
    """0.06 rad apart where the four bars are nearly in one line: long steps went from one to the other."""
    arm, screw = shipped_arm("mycobot_280")
    task, _ = solver(arm, None)
    q = np.array([[1.172430787496, 0.754675891425, 1.099819728616, 1.789600044792, np.pi / 2, -1.650145814715]])
    goals = oracle.goal_of_joints(task, screw, q)
    s = armkin.ik(arm, goals.array())
    assert s.free.tolist() == [[False, True, True, True, False, True]]
    assert leads_to(screw, goals, q, s.q).sum() == 1
    assert s.valid.sum() == 6  # two circuits with a wrist that is straight, four branches with another shoulder


@pytest.mark.parametrize(
    "degrees",
    [[166.2, -7.4, 92.69287, -36.87, -171.28, -30.1], [166.197, -7.388, 92.69287, -36.868, -171.277, -30.108]],
)
def test_of_a_self_motion_with_two_ends_the_posture_nearest_to_near_is_listed(degrees: list[float]) -> None:
    """A folded wrist all but on two axes: 0.2 rad long, and both of its roots were taken for self-motions."""
    arm, q = armkin.load("puma560"), np.radians(degrees)
    s = armkin.ik(arm, armkin.fk(arm, q))
    distance = np.abs(np.angle(np.exp(1j * (s.q[s.valid] - q)))).max(axis=1)
    assert distance.min() < 1e-6  # nearer to home than the other root of the same component
    assert (distance < 0.25).sum() == 1


@pytest.mark.parametrize(
    "degrees",
    [
        [14.0165, -163.0765, 92.9008, 0.8236, 144.8238, 174.8718],
        [-158.4874, 34.3149, 92.7826, -45.7371, -178.5694, -142.5717],
        [166.1973, -7.3876, 92.6929, -36.8677, -171.277, -30.1079],
    ],
)
def test_a_self_motion_on_which_the_residual_grows_is_known_from_end_to_end(
    degrees: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up to 2 rad long: no polynomial holds as far, and each walk to the other roots of its target took 15 to 45 ms."""
    arm = armkin.load("puma560")
    monkeypatch.delattr(curves.Curves, "step")  # nobody walks
    s = armkin.ik(arm, armkin.fk(arm, np.radians(degrees)))
    assert s.status == armkin.Status.SINGULAR
    assert s.valid.sum() == 4


def test_joints_that_move_along_all_of_a_self_motion_are_free() -> None:
    """Joint 1 turns by a thousandth of what joint 6 does over 0.47 rad, and less beside the posture listed."""
    arm = armkin.load("puma560")
    q = np.radians([17.238154, -48.677217, 92.638311, 82.807636, 13.834331, 61.131661])
    s = armkin.ik(arm, armkin.fk(arm, q))
    assert s.free.tolist() == [True, True, False, True, True, True]
