"""Families that are traced in machine code: those of numpy."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import armkin
from armkin.compiled import compiled_arm, compiled_curves, known_curves
from armkin.formula.array_tuples import rows_of
from armkin.inverse import solve
from armkin.inverse.redundant.families import curves_in_numpy, families
from armkin.inverse.solvers.choose_redundant_joint import redundancy

# Motion [deg] by which a posture may be further than numpy's: where the redundant joint turns back, rounding leaves its
# root, over the smallest singular value.
FURTHER = 1e-3


@lru_cache
def gen3() -> armkin.Arm:
    return armkin.load("kinova_gen3")


@lru_cache
def reversed_gen3() -> armkin.Arm:
    """The same from its tool to its base, some joints with more copies: its guide is joint 7, of a near shoulder."""
    arm = gen3()
    lower, upper = -arm.upper[::-1], -arm.lower[::-1]
    lower[2], upper[2], lower[4], upper[4] = np.deg2rad([-100, 400, -180, 180])
    link = np.stack([np.linalg.inv(T) for T in arm.link[::-1]])
    return replace(arm, name="reversed", link=link, lower=lower, upper=upper, home=-arm.home[::-1])


def random_postures(arm: armkin.Arm, count: int, seed: int) -> np.ndarray:
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high, (count, arm.n))


def in_machine_code(arm: armkin.Arm, target: np.ndarray, near: np.ndarray | None) -> armkin.Solutions:
    """Without the libraries of the arms with a joint held, which take half a minute to be built."""
    redundant = redundancy(arm, None)
    assert redundant is not None
    traced = compiled_curves.compiled_curves(arm, redundant)
    assert traced is not None

    def held_answers(held_arm: armkin.Arm, targets: np.ndarray) -> np.ndarray:
        return solve.ik(held_arm, targets, "pose", examine=False).q

    return families(solve.ik, arm, redundant, target, near, None, traced.of(held_answers))


def assert_same(by_numpy: armkin.Solutions, in_c: armkin.Solutions, by: float = FURTHER) -> None:
    """Rows that are the same intervals, as legal, of the same curves, with postures that are as near."""
    assert (by_numpy.status == in_c.status).all()
    assert (by_numpy.complete == in_c.complete).all()
    assert by_numpy.interval is not None
    assert in_c.interval is not None
    for k in range(len(by_numpy.valid)):
        a, b = by_numpy.valid[k], in_c.valid[k]
        assert a.sum() == b.sum(), k
        off = np.abs(np.remainder(by_numpy.interval[k][a][:, None] - in_c.interval[k][b] + np.pi, 2 * np.pi) - np.pi)
        other = by_numpy.within_limits[k][a][:, None] != in_c.within_limits[k][b]
        further = in_c.motion[k][b] - by_numpy.motion[k][a][:, None]
        match = (off.max(axis=2, initial=0.0) < 1e-8) & ~other & (further < by)
        assert match.any(axis=1).all(), k
        assert match.any(axis=0).all(), k
        assert len(np.unique(by_numpy.branch[k][a])) == len(np.unique(in_c.branch[k][b]))


def assert_as_by_numpy(
    arm: armkin.Arm, target: np.ndarray, near: np.ndarray | None, by: float = FURTHER
) -> armkin.Solutions:
    found = in_machine_code(arm, target, near)
    assert_same(solve.ik(arm, target, near=near), found, by)
    mm, rad = found.residual()
    assert np.nanmax(mm, initial=0.0) < 1e-9 * arm.reach
    assert np.nanmax(rad, initial=0.0) < 1e-9
    return found


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many targets are left to numpy, call by call."""
    counts: list[int] = []

    def count_and_trace(follower):  # type: ignore[no-untyped-def]
        counts.append(len(follower.target))
        return curves_in_numpy(follower)

    monkeypatch.setattr(known_curves, "curves_in_numpy", count_and_trace)
    return counts


@pytest.mark.parametrize("arm", [gen3, reversed_gen3])
@pytest.mark.parametrize("seed", [11, 12])
def test_families_are_those_of_numpy(arm, seed: int, left: list[int]) -> None:  # type: ignore[no-untyped-def]
    """Random targets with `near` at home and elsewhere; none is left to numpy, or the code would be of no use."""
    q = random_postures(arm(), 30, seed)
    near = None if seed == 11 else random_postures(arm(), 30, 1)
    assert_as_by_numpy(arm(), armkin.fk(arm(), q), near)
    assert not left


def test_postures_that_solve_their_targets_are_their_own_nearest() -> None:
    arm, q = gen3(), random_postures(gen3(), 30, 13)
    s = assert_as_by_numpy(arm, armkin.fk(arm, q), q)
    assert np.take_along_axis(s.motion, s.best[:, None], axis=1).max() <= 1e-6


def test_families_of_a_nearly_stretched_arm_are_listed() -> None:
    """Short curves between two planes, and closed ones that only the arm with another joint held tells."""
    arm = gen3()
    degrees = [[-33, -33, -64, 0.3, 68, 61, 97], [29, 20, 25, 0.7, 43, -60, -85], [-56, 41, 60, 1.4, -83, -73, -130],
               [74, -129, -39, -2.2, -42, 15, -70]]  # fmt: skip
    q = np.deg2rad(degrees)
    s = in_machine_code(arm, armkin.fk(arm, q), None)
    assert s.interval is not None
    middle, half_width = s.interval.mean(axis=2), 0.5 * np.ptp(s.interval, axis=2)
    away = np.abs(np.remainder(q[:, 6:] - middle + np.pi, 2 * np.pi) - np.pi)
    assert ((away <= half_width + 1e-8) & s.within_limits).any(axis=1).all()


def test_curves_between_planes_are_those_of_numpy() -> None:
    """Targets that have all answers between two values of the guide's joint: 16, 24 and 16 intervals.

    Where the nearest of the postures is at such a turn it is hardly determined.
    """
    arm, q = gen3(), random_postures(gen3(), 300, 77)[[169, 226, 247]]
    s = assert_as_by_numpy(arm, armkin.fk(arm, q), None, np.inf)
    assert s.within_limits.sum(axis=1).tolist() == [16, 24, 16]


def test_targets_out_of_reach_and_a_stretched_arm_are_those_of_numpy() -> None:
    arm, q = gen3(), random_postures(gen3(), 10, 19)
    target = np.concatenate([armkin.fk(arm, q), armkin.fk(arm, np.zeros((1, 7)))])
    target[:10, :3, 3] *= np.linspace(0.9, 1.6, 10)[:, None]
    assert_as_by_numpy(arm, target, np.zeros(7))


def test_targets_that_are_left_to_numpy_stand_in_their_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here every other stretch of them, as if C had found something odd."""
    arm, q = gen3(), random_postures(gen3(), 9, 23)
    target = armkin.fk(arm, q)
    solve_all = compiled_curves.CompiledCurves._solve

    def leave_some(self, *given):  # type: ignore[no-untyped-def]
        known, left = solve_all(self, *given)
        unsolved = left | np.isin(np.arange(len(left)), [0, 3, 4, 8])
        rows = ~unsolved[known.pieces.row]
        return known._replace(pieces=rows_of(known.pieces, rows), nearest=known.nearest[rows]), unsolved

    monkeypatch.setattr(compiled_curves.CompiledCurves, "_solve", leave_some)
    assert_as_by_numpy(arm, target, None)


def test_batches_of_any_size_have_the_same_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, q = gen3(), random_postures(gen3(), 8, 29)
    target = armkin.fk(arm, q)
    together = in_machine_code(arm, target, None)
    monkeypatch.setattr(compiled_curves, "AT_ONCE", 3)
    parts = in_machine_code(arm, target, None)
    np.testing.assert_array_equal(together.q, parts.q)
    np.testing.assert_array_equal(together.interval, parts.interval)


def test_a_compiled_arm_traces_in_machine_code(monkeypatch: pytest.MonkeyPatch, left: list[int]) -> None:
    """Its other arms are solved by numpy here, and its rows are those of `in_machine_code`."""
    arm, q = gen3(), random_postures(gen3(), 5, 31)
    target = armkin.fk(arm, q)
    monkeypatch.setattr(compiled_arm, "_held_answers", lambda a, t: solve.ik(a, t, "pose", examine=False).q)
    monkeypatch.setattr(compiled_arm, "_solve_others", solve.ik)
    s = armkin.compile(arm).ik(target)
    assert not left
    np.testing.assert_array_equal(s.q, in_machine_code(arm, target, None).q)


def test_where_curves_come_close_to_each_other_their_ways_are_followed_again_as_by_numpy() -> None:
    target = armkin.fk(gen3(), random_postures(gen3(), 2469, 31))[[579, 1424, 1773, 2468]]
    s = assert_as_by_numpy(gen3(), target, None)
    assert s.within_limits.sum(axis=1)[1:].tolist() == [16, 24, 16]
