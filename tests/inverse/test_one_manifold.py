"""A manifold is one row, whichever of its postures are candidates, and is followed once."""

from __future__ import annotations

import numpy as np
import pytest
from small_steps import manifolds

import armkin
from armkin.formula.arrays import Array
from armkin.inverse.closed import crossings
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import LABELS
from armkin.model.target_numbers import targets_in

# The wrist 0.001 degrees off straight, its centre all but on axis 1: two directions are nearly lost
BESIDE = [-5.660692012689249e-06, -8.204135961199831e-06, 524.75, np.pi / 2, -3.1415681650441143, 3.1415661793087657]
# A Puma whose joints 1 to 3 are within 1e-5 rad of a fold: the manifold is short, and both its ends are known
SHORT = [1.5836968407619585, -0.8901812286952255, 1.617829428444212, -2.8485155934616904, 2.8328757558239435,
         -1.8342311940795621]  # fmt: skip

FOLD = [-0.7854146633121711, -np.pi, 262.375, np.pi / 2, -3.141510855987255, -2.356194490192345]
ARCS = [2.3561944911768986, 1.5707963336752944, 1.5707963305306343, -3.141592650653632, -np.pi, -1.167432798680643e-10]

CIRCUIT = [-1.3775657173733071, -0.21475437132500894, -1.3524585503614908, 0.23490001999027776, 2.796888346067023,
           0.7830329160780761]  # fmt: skip
FLAT = [0.8487981197583796, -1.5834526887369684, 1.617782823941284, 0.3378108023961631, -2.473330274111655,
        -2.4097472431493117]  # fmt: skip
BENDS = [-0.25593536604020745, -1.74843120996385, 1.6179598106092539, 2.394289170403917, 0.004527652638556409,
         2.2178298192062207]  # fmt: skip
# Wrists 1.5e-7 and 1.4e-6 rad off straight, whose self-motions go half a turn and end
HALF_TURNS = [1.710007560461471, -3.141592645536817, -1.524345424490568, -0.7853981657546913, -3.1415925010943075,
              -2.3561944723909973]  # fmt: skip
ALONE = [-2.3561944768073277, -3.14301958993539, -1.5239035805240875, 0.9905624072906454, -3.141594046209012,
         2.8890822198705735]  # fmt: skip
# Elbows within 1e-4 rad of folded or stretched, whose two roots meet, while a second direction is lost to 4e-5
MEETING = {
    "thor": [-0.42951359943271417, -3.141041883807918, -3.141616452117232, 3.02093705626603, -0.7857010594752032,
             -1.5707967750023173],
    "three_dof": [-3.141614336823653, -1.5708555103047157, 9.269870674877077e-05],
}  # fmt: skip
# Elbows and wrists beside singular ones, whose self-motions are longer than 16 polynomials from one posture
LONG = [
    ("ur5e", 5, [-1.5707833435333534, -2.3561653643042035, 2.6074741421635457, 0.47400742867377277,
                 -3.1415926469320996, -0.811357099359816]),
    ("puma560", 3, [-2.3561944345090895, 1.8512401700274106, -1.523816430964725, -0.11866715835984154,
                    -3.1415926745183502, -0.7853981656830631]),
    ("puma560", 4, [2.5809644482746705, 0.6432416688362292, -1.5237933507398123, 0.22503440004391084,
                    -3.1415895834922587, -0.6071761190695821]),
    ("ur5e", 7, [-3.141592649828343, -0.8590597443081327, -3.1415950510288977, -0.6886170543753769,
                 -3.141592658466479, -3.1418441176861984]),
    ("puma560", 4, [0.647480413107163, 1.309102542927663, -1.523822366041992, 1.1448831723377628,
                    -3.1415917070240162, 1.5765716180695266]),
]  # fmt: skip


@pytest.mark.parametrize("neighbours", [0, 60])
def test_a_wrist_beside_straight_is_listed_once_a_shoulder(neighbours: int) -> None:
    """On either side of the straight wrist lie candidates that miss by nothing; those between them miss by 5e-10.

    They were two or three rows, the number depending on what else was in the batch.
    """
    arm = armkin.load("stanford")
    round_angles = np.pi / 2 * np.random.default_rng(1).integers(-2, 3, (neighbours, arm.n))
    q = np.concatenate([[BESIDE], np.where(arm.prismatic, BESIDE[2], round_angles)])
    solutions = armkin.ik(arm, armkin.fk(arm, q), near=q)
    rows = solutions.q[0][solutions.valid[0]]
    assert solutions.status[0] == armkin.Status.SINGULAR
    assert solutions.complete[0]
    assert len(rows) == 2
    np.testing.assert_array_equal(rows[0], BESIDE)
    assert rows[1][2] == pytest.approx(-BESIDE[2])


def test_a_curve_that_does_not_pass_its_posture_tells_nothing_of_it() -> None:
    """A shoulder's fold 0.005 degrees from a straight wrist: Newton's method found the wrist's curve 6e-5 rad beside.

    Each branch was there twice, as two roots, and exact.
    """
    arm = armkin.load("stanford")
    T = armkin.fk(arm, FOLD)
    solutions = armkin.ik(arm, T)
    assert solutions.status == armkin.Status.BOUNDARY
    assert solutions.valid.sum() == 4
    apart = newton.distances(arm, solutions.q[None, solutions.valid], solutions.q[None, solutions.valid])[0]
    assert (apart + np.eye(4) > 0.1).all()


def test_manifolds_on_both_sides_of_a_straight_wrist_are_rows_of_their_own() -> None:
    """A wrist 2e-8 rad off straight: its two arcs of 340 degrees end where the least residual is above 1e-9.

    One of three such pairs was one row.
    """
    arm = armkin.load("puma560")
    T = armkin.fk(arm, ARCS)
    solutions = armkin.ik(arm, T)
    assert solutions.status == armkin.Status.SINGULAR
    assert solutions.complete
    assert solutions.valid.sum() == 7
    a, b = solutions.q[solutions.valid][3:5]
    np.testing.assert_allclose(np.abs(newton.difference(arm, a, b)), [0, 0, 0, np.pi, 0, np.pi], atol=1e-6)
    t = np.linspace(0.0, 2.0 * np.pi, 361)[:, None]
    way = a + t * np.array([0.0, 0.0, 0.0, 1.0, 0.0, -1.0])
    goals = np.broadcast_to(T, (len(way), 4, 4))
    # with joint 4 held where it is, the others leave what they cannot take away
    across = way + 0.0
    for _ in range(12):
        r, J = newton.scaled_residual_and_jacobian(arm, solutions.task, across, goals)
        step = np.linalg.pinv(np.delete(J, 3, axis=2), rcond=1e-10) @ r[:, :, None]
        across += np.insert(step[:, :, 0], 3, 0.0, axis=1)
    size = newton.misses(arm, solutions.task, across, goals)
    assert (size[:181].max() > 2e-9) & (size[180:].max() > 2e-9)
    assert np.median(size) < 5e-10


def test_nothing_is_sought_that_crosses_a_manifold_of_which_all_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was half of the time of the dearest random targets."""
    arm = armkin.load("puma560")
    T = armkin.fk(arm, SHORT)
    before = armkin.ik(arm, T)
    assert before.status == armkin.Status.SINGULAR
    monkeypatch.setattr(crossings, "postures_beside", None)
    np.testing.assert_array_equal(armkin.ik(arm, T).q, before.q)


def test_a_curve_not_followed_from_one_posture_is_known_from_another_on_it() -> None:
    """A wrist 1e-11 beside axis 1, two circuits an elbow, were listed by six postures; one 1e-3 beside, by three."""
    for name, q, count in (("ar4", CIRCUIT, 4), ("puma560", FLAT, 2)):
        arm = armkin.load(name)
        solutions = armkin.ik(arm, armkin.fk(arm, q), near=q)
        assert solutions.status == armkin.Status.SINGULAR, name
        assert bool(solutions.complete), name
        assert solutions.valid.sum() == count, name
        assert (solutions.q[solutions.valid] == q).all(axis=1).any(), name


def test_an_edge_s_candidate_that_leads_to_another_branch_is_no_second_row() -> None:
    """One of the left shoulder, on an edge and off its target, was moved onto a branch of the right, and listed."""
    arm = armkin.load("ur5e")
    solutions = armkin.ik(arm, targets_in(LABELS["pose"], [[-213.531, 53.1393, 1047.8, -105.174, 28.9358, 48.3678]])[0])
    assert solutions.valid.sum() == 2


def test_what_bends_within_a_shortened_span_is_followed_to_its_ends() -> None:
    """A boundary along which joint 2 moves by 0.098 rad, no self-motion, was two rows on each side of the wrist."""
    arm = armkin.load("puma560")
    solutions = armkin.ik(arm, armkin.fk(arm, BENDS))
    rows = solutions.q[solutions.valid]
    assert solutions.status == armkin.Status.SINGULAR
    assert len(rows) == 4
    np.testing.assert_allclose(np.sort(rows[:, 2]), [1.6175887, 1.6175887, 1.6179598, 1.6179598], atol=1e-6)


def test_self_motions_that_end_half_a_turn_on_are_rows_of_their_own() -> None:
    """Their curves were not followed to the ends, and each was one row with that of the wrist turned over."""
    arm = armkin.load("puma560")
    for q, count in ((HALF_TURNS, 8), (ALONE, 4)):
        T = armkin.fk(arm, q)
        solutions = armkin.ik(arm, T[None].repeat(3, axis=0))
        assert (solutions.valid.sum(axis=1) == count).all()
        assert solutions.complete.all()
        rows = solutions.q[0][solutions.valid[0]]
        turned = np.abs(newton.difference(arm, rows[:, None], rows[None]))
        flips = (np.abs(turned[:, :, [3, 5]] - np.pi) < 1e-5).all(axis=2) & (turned[:, :, :3] < 1e-5).all(axis=2)
        assert flips.sum() == count
        for way in (np.pi, -np.pi):
            assert _least_misses(arm, T, rows, 3, way).max(axis=0).min() > 1.5e-9


@pytest.mark.parametrize(("name", "count", "q"), LONG)
def test_long_self_motions_are_known_to_their_ends(name: str, count: int, q: list[float]) -> None:
    """Two rows were lost where an end was not reached, one was listed twice, one lost; the last two lost two and one,
    as their self-motions, exact to 1e-12 beside a posture, were taken for closed.

    Small steps from each row come by no other.
    """
    arm = armkin.load(name)
    T = armkin.fk(arm, q)
    solutions = armkin.ik(arm, T)
    rows = solutions.q[solutions.valid]
    assert solutions.status == armkin.Status.SINGULAR
    assert len(rows) == count
    assert len(manifolds(arm, T, rows)) == count


@pytest.mark.parametrize(("name", "count"), [("thor", 4), ("three_dof", 1)])
def test_roots_that_meet_where_a_second_direction_is_nearly_lost_are_one(name: str, count: int) -> None:
    """Half way between two of them 5e-10 are missed; they were two exact rows, or four where all four meet."""
    arm = armkin.load(name)
    T = armkin.fk(arm, MEETING[name]) if arm.n == 6 else armkin.fk(arm, MEETING[name])[:3, 3]
    solutions = armkin.ik(arm, T)
    assert solutions.status == armkin.Status.BOUNDARY
    assert solutions.valid.sum() == count


def _least_misses(arm: armkin.Arm, T: Array, q: Array, joint: int, way: float) -> Array:
    """What postures (M, n) miss at least, as a joint goes a way in 400 steps, the others free: (401, M)."""
    q, goals, misses = q.copy(), T[None].repeat(len(q), axis=0), []
    task = task_for(arm)
    start = q[:, joint].copy()
    for share in np.linspace(0.0, 1.0, 401):
        q[:, joint] = start + share * way
        for _ in range(6):
            r, J = newton.scaled_residual_and_jacobian(arm, task, q, goals)
            step = np.linalg.pinv(np.delete(J, joint, axis=2), rcond=1e-7) @ r[:, :, None]
            q += np.insert(step[:, :, 0], joint, 0.0, axis=1)
        misses.append(newton.misses(arm, task, q, goals))
    return np.array(misses)
