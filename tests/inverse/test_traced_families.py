"""Families of an arm whose other joints have no closed form: curves that are traced between answers on planes."""

from dataclasses import replace

import numpy as np
import pytest
from redundant_arms import assert_ends, covers_value, held_answers, redundant_postures

import armkin
from armkin import Status
from armkin.inverse.redundant import curve_starts


def test_families_of_a_nearly_stretched_arm_are_listed() -> None:
    """The elbow turns in so small a circle that no value of joint 1 that is asked meets it: 1.1 % of random targets."""
    arm = armkin.load("kinova_gen3")
    degrees = [[-33, -33, -64, 0.3, 68, 61, 97], [29, 20, 25, 0.7, 43, -60, -85], [-56, 41, 60, 1.4, -83, -73, -130],
               [74, -129, -39, -2.2, -42, 15, -70]]  # fmt: skip
    q = np.deg2rad(degrees)
    s = armkin.ik(arm, armkin.fk(arm, q))
    assert s.interval is not None
    for k in range(len(q)):
        assert covers_value(arm, s.interval[k][s.within_limits[k]], q[k, 6]).any()


def test_where_an_arm_without_a_closed_form_has_no_answer_nothing_is_traced() -> None:
    """kinova_gen3 alone, at values of J7 that have no answer, ended in a traceback."""
    arm = armkin.load("kinova_gen3")
    far = np.eye(4)[None].copy()
    far[:, 2, 3] = 3000.0
    assert (armkin.ik(arm, far).status == Status.UNREACHABLE).all()


@pytest.mark.parametrize("near", [np.zeros(7), None])
def test_a_stretched_arm_without_a_closed_form_stands_there(near: np.ndarray | None) -> None:
    """All answers of this target are one posture, which no value that the elimination is asked at has."""
    arm = armkin.load("kinova_gen3")
    s = armkin.ik(arm, armkin.fk(arm, np.zeros(7)), near=near)
    assert s.status == Status.EXACT
    assert not s.complete
    assert s.residual()[0][s.best] <= 1e-9 * arm.reach
    assert near is None or s.motion[s.best] <= 1e-9


def test_traced_intervals_end_where_their_arm_has_one_posture_less() -> None:
    """kinova_gen3: a sixth of these places disagreed, as branches were linked wrongly and ended before their turns."""
    arm = armkin.load("kinova_gen3")
    q, target = redundant_postures(arm, None, 5, 21)
    s = armkin.ik(arm, target)
    assert s.interval is not None
    for k in range(len(q)):
        assert covers_value(arm, s.interval[k][s.within_limits[k]], q[k, 6]).any()
    assert np.nanmax(s.residual()) <= 1e-9
    again = armkin.ik(arm, target, near=q)
    assert np.take_along_axis(again.motion, again.best[:, None], axis=1).max() <= 1e-6
    legal = s.interval[4][s.within_limits[4]]
    ends = np.unique(legal.ravel().round(7))
    for value in [*(ends[1::3] - np.deg2rad(1e-5)), *(ends[1::3] + np.deg2rad(1e-5))]:
        own = held_answers(arm, 6, float(value), target[4], None)
        assert covers_value(arm, legal, float(value), 0.0).sum() == len(own), np.rad2deg(value)


@pytest.mark.parametrize(
    ("number", "value", "count"),
    [(48, 185.63707, 7), (174, 104.98252, 6), (180, 182.51449, 4), (272, 182.9476, 8), (291, 353.91396, 6)],
)
def test_a_curve_that_passes_a_straight_wrist_is_whole(number: int, value: float, count: int) -> None:
    """kinova_gen3: five targets of 300 that lacked intervals or parts of some, up to half of them."""
    arm = armkin.load("kinova_gen3")
    target = redundant_postures(arm, None, 300, 77)[1][number]
    s = armkin.ik(arm, target)
    assert s.interval is not None
    value = float(np.deg2rad(value))
    assert len(held_answers(arm, 6, value, target, None)) == count
    assert covers_value(arm, s.interval[s.within_limits], value, 0.0).sum() == count


@pytest.mark.parametrize(("number", "count"), [(169, 16), (226, 24), (247, 16)])
def test_curves_on_which_joint_1_hardly_moves_are_found(number: int, count: int) -> None:
    """kinova_gen3, nearly stretched: all answers lie between two of the values of joint 1 that are asked."""
    arm = armkin.load("kinova_gen3")
    s = armkin.ik(arm, redundant_postures(arm, None, 300, 77)[1][number])
    assert s.within_limits.sum() == count


def test_answers_do_not_depend_on_the_joint_whose_values_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """kinova_gen3 by the elimination at values of joint 7, or by a spherical wrist's branches at values of joint 1."""
    arm = armkin.load("kinova_gen3")
    target = redundant_postures(arm, None, 2, 78)[1]
    near = armkin.ik(arm, target)
    assert "near spherical wrist" in near.why
    monkeypatch.setattr(curve_starts, "nearly_closed", lambda arm, free: free)
    by_other_joint = armkin.ik(arm, target)
    assert near.interval is not None
    assert by_other_joint.interval is not None
    for k in range(len(target)):
        legal, same = (
            near.interval[k][near.within_limits[k]],
            by_other_joint.interval[k][by_other_joint.within_limits[k]],
        )
        assert len(legal) == len(same)
        assert len(legal)
        away = np.abs(np.remainder(legal[:, None] - same + np.pi, 2 * np.pi) - np.pi).max(axis=2)
        assert away.min(axis=1).max() < 1e-9


def test_where_a_joint_turns_back_at_the_end_of_a_curve_the_next_target_keeps_its_own_postures() -> None:
    """The second one listed two that are off by half a metre, of the first one's curve."""
    arm = armkin.load("kinova_gen3")
    _, target = redundant_postures(arm, None, 9708, 22)
    mm, rad = armkin.ik(arm, target[-2:]).residual()
    assert np.nanmax(mm) <= 1e-6
    assert np.nanmax(rad) <= 1e-9


def test_families_of_a_nearly_stretched_arm_do_not_depend_on_where_it_is_at_home() -> None:
    """Answers with another joint held, copies near home, made planes in the wrong order: 20 and 16 rows became 26 and
    20."""
    arm = armkin.load("kinova_gen3")
    rng = np.random.default_rng(3)
    q = rng.uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi), (60, 7))
    q[:, 3] = np.deg2rad(rng.uniform(-2.5, 2.5, 60))
    target, near = armkin.fk(arm, q)[[15, 19]], arm.home
    elsewhere = replace(arm, name="elsewhere", home=np.append(3.0, arm.home[1:]))
    listed, listed_elsewhere = armkin.ik(arm, target, near=near), armkin.ik(elsewhere, target, near=near)
    assert listed.interval is not None
    assert listed_elsewhere.interval is not None
    assert listed.valid.sum(axis=1).tolist() == listed_elsewhere.valid.sum(axis=1).tolist()
    assert np.allclose(listed.interval, listed_elsewhere.interval, atol=1e-6, equal_nan=True)


@pytest.mark.parametrize(("number", "count"), [(1424, 16), (1773, 24), (2468, 16)])
def test_where_curves_come_close_to_each_other_neither_ends_nor_turns_into_the_other(number: int, count: int) -> None:
    """kinova_gen3: their counts are those of steps a tenth as long; 18, 23 and 17 were listed, one row 0.05 mm off."""
    arm = armkin.load("kinova_gen3")
    s = armkin.ik(arm, redundant_postures(arm, None, number + 1, 31)[1][number])
    assert s.within_limits.sum() == count
    assert np.nanmax(s.residual()) <= 1e-9


def test_postures_listed_where_two_merge_solve_their_target() -> None:
    """kinova_gen3: two last steps left 0.04 mm, as Newton's method only halves the way to where two roots are one."""
    arm = armkin.load("kinova_gen3")
    s = armkin.ik(arm, redundant_postures(arm, None, 2852, 7)[1][-1])
    assert np.nanmax(s.residual()) <= 1e-9


def test_an_interval_ends_where_its_joint_turns_back_most_sharply() -> None:
    """kinova_gen3: three steps along the curve left its ends 4e-6 to 8e-5 degrees away, as of two of 2,000 targets."""
    arm = armkin.load("kinova_gen3")
    target = redundant_postures(arm, None, 1167, 5)[1][-1]
    s = armkin.ik(arm, target)
    assert s.interval is not None
    assert_ends(arm, s.interval[s.within_limits], 6, target)


@pytest.mark.parametrize("posture", [[163.286, 26.081, 8.565, 0.38, 49.929, -10.184, -13.013],
                                     [-67.619, 136.658, 4.504, 0.116, 39.608, -83.706, -44.235]])  # fmt: skip
def test_a_target_just_within_reach_has_an_answer(posture: list[float]) -> None:
    """kinova_gen3: no posture of a search came to these two of 9,000 within its steps."""
    arm = armkin.load("kinova_gen3")
    s = armkin.ik(arm, armkin.fk(arm, np.deg2rad(posture)))
    assert s.status == Status.EXACT
    assert np.nanmax(s.residual()) <= 1e-9
