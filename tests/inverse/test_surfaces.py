"""Self-motions of two dimensions: an iiwa7 with J7 held whose elbow is folded or stretched.

Folded, its wrist is in its shoulder: the axes of joints 3 and 5 are one line, and what is left is a spherical linkage
of three bars of 90 degrees, z1 z2, z2 z3 and z3 z6, closed by the angle between z1 and z6. For a given z2 the line z3
is across z2 and z6: it has two senses, which are two circuits. Where z1 and z6 are at right angles z2 may be along z6,
with z3 anywhere across it, or z3 along z1: four circuits that cross. Stretched upwards, joints 1, 3 and 5 are about one
line.
"""

from __future__ import annotations

import numpy as np
import pytest

import armkin
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.choose_task import task_for

FOLDED = [
    ([60, 60, -120, 180, -150, 180, 0], 2),
    ([33, 71, 12, 180, 17, 50, 40], 2),
    ([0, -90, 180, 180, 90, -90, -130], 2),
    ([90, 180, 90, 180, 90, 90, 0], 4),
    ([-150, 0, 105, 180, -15, -75, -45.5], 4),
]
CORNER = [-90, -180, 180, 180, -90, 180]


def _held_rows(q: list[float]) -> tuple[armkin.Arm, armkin.Solutions]:
    arm, posture = armkin.load("iiwa7"), np.deg2rad(q)
    locked_arm = armkin.lock(arm, {"J7": posture[6]})
    return locked_arm, armkin.ik(locked_arm, armkin.fk(arm, posture))


@pytest.mark.parametrize(("q", "count"), FOLDED)
def test_a_folded_elbow_has_a_row_for_each_circuit_of_its_linkage(q: list[float], count: int) -> None:
    resting_arm, s = _held_rows(q)
    rows = s.q[s.valid]
    assert s.status == armkin.Status.SINGULAR
    assert len(rows) == count
    np.testing.assert_allclose(np.cos(rows[:, 3]), -1.0, atol=1e-12)
    z1, z2, z3, _, _, z6 = np.moveaxis(armkin.jacobian(resting_arm, rows)[:, 3:], 2, 0)
    if count == 2:
        assert sorted(np.sign((np.cross(z2, z6) * z3).sum(axis=1))) == [-1.0, 1.0]
    else:
        along = np.stack([(z3 * z1).sum(axis=1), -(z3 * z1).sum(axis=1), (z2 * z6).sum(axis=1), -(z2 * z6).sum(axis=1)])
        assert sorted(along.argmax(axis=0)) == [0, 1, 2, 3]
        assert s.free.tolist() == [True, True, True, False, True, True]


@pytest.mark.parametrize(
    "q", [[180, 0, 90, 0, 45, -180, -129.5], [-90, 180, -90, 0, 180, 90, 0], [0, 0, 0, 0, 0, 90, 9]]
)
def test_three_joints_about_one_line_are_one_surface(q: list[float]) -> None:
    _, s = _held_rows(q)
    assert s.status == armkin.Status.SINGULAR
    assert s.valid.sum() == 1
    assert s.free.tolist() == [True, False, True, False, True, False]


def test_an_arm_that_stands_on_a_surface_stays() -> None:
    arm, posture = armkin.load("iiwa7"), np.deg2rad([10.0, 0, 20, 0, 30, 40, 50])
    locked_arm = armkin.lock(arm, {"J7": posture[6]})
    s = armkin.ik(locked_arm, armkin.fk(arm, posture), near=posture[:6])
    assert s.valid.sum() == 1
    assert s.best == 0
    assert (s.q[0] == posture[:6]).all()


def _round_last_digits(target: np.ndarray, seed: int, digit: float) -> np.ndarray:
    """A target with other last digits."""
    target[:3] += np.random.default_rng(seed).uniform(-1, 1, (3, 4)) * [digit, digit, digit, 2e-13]
    return target


@pytest.mark.parametrize(("q", "seed"), [*((CORNER, seed) for seed in (24, 39, 72)), ([90, 180, 90, 180, 180, 0], 57)])
def test_where_surfaces_meet_rounding_does_not_choose_how_many_are_listed(q: list[float], seed: int) -> None:
    """All axes in two lines at right angles, three directions lost: these roundings were one row, three `complete`.

    Of the last the posture that was found is 7e-4 rad from where surfaces meet: no joint was said to rest there.
    """
    locked_arm = armkin.lock(armkin.load("iiwa7"), {"J7": 0.0})
    s = armkin.ik(locked_arm, _round_last_digits(armkin.fk(locked_arm, np.deg2rad(q)), seed, 2e-16))
    z1, z2, z3, _, _, z6 = np.moveaxis(armkin.jacobian(locked_arm, s.q[s.valid])[:, 3:], 2, 0)
    along = np.stack([(z3 * z1).sum(axis=1), -(z3 * z1).sum(axis=1), (z2 * z6).sum(axis=1), -(z2 * z6).sum(axis=1)])
    assert sorted(along.argmax(axis=0)) == [0, 1, 2, 3]
    assert not s.complete


def test_a_surface_that_goes_through_limits_is_listed_within() -> None:
    """Many starts come to postures of it outside limits, all but as exact; nearer ones are within."""
    arm, posture = armkin.load("iiwa7"), np.deg2rad([90.0, 0, 90, 0, 90, 0, -129.50000000000003])
    locked_arm = armkin.lock(arm, {"J7": posture[6]})
    s = armkin.ik(locked_arm, armkin.fk(locked_arm, posture[:6]))
    assert s.valid.sum() == 1
    assert s.best == 0
    np.testing.assert_allclose(np.abs(s.q[0]).sum(), np.pi / 2, atol=1e-6)


def test_a_joint_that_rests_on_a_surface_at_a_double_root_is_not_free() -> None:
    """A Thor stretched along joint 1: from 4,000 random starts joints 1, 4 and 6 alone come to different values."""
    arm = armkin.load("thor")
    target = armkin.fk(arm, np.deg2rad([90.0, 0, -180, 135, 0, 135]))
    starts = np.random.default_rng(1).uniform(-np.pi, np.pi, (4000, 6))
    corrected, size = newton.correct(arm, task_for(arm, None), starts, np.tile(target, (4000, 1, 1)), steps=60)
    solved = newton.difference(arm, corrected[size < 1e-12], np.deg2rad([0.0, 0, -180, 0, 0, 0]))
    assert len(solved) > 500
    moves = (np.abs(solved).max(axis=0) > 0.1).tolist()
    assert moves == [True, False, False, True, False, True]
    for seed in (56, 59, 143):
        assert armkin.ik(arm, _round_last_digits(target, seed, 3e-16)).free.tolist() == moves


@pytest.mark.parametrize("seed", [25, 94, 284])
def test_a_surface_of_double_roots_is_one_row_whatever_near_is(seed: int) -> None:
    """Joints 1, 4 and 6 of a Thor about one line: roots there are known to the root of rounding, listed ones too."""
    arm = armkin.load("thor")
    T = armkin.fk(arm, np.radians([90, 0, -180, 135, 0, 135]))
    s = armkin.ik(arm, T, near=np.random.default_rng(seed).uniform(-2.0, 2.0, 6))
    assert s.valid.sum() == 1
    assert s.free.tolist() == [True, False, False, True, False, True]
