"""One joint more than the target asks for: intervals of the redundant joint, against brute force along it."""

import numpy as np
import pytest
from redundant_arms import assert_ends, covers_value, held_answers, redundant_postures

import armkin
from armkin import Status
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.redundant import boundaries
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.solve import ik
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.model.arm import from_links
from command_line import run

ARMS = [("panda", None), ("iiwa7", None), ("planar_3dof", "xy")]


@pytest.mark.parametrize(("name", "task"), ARMS)
def test_the_generating_posture_lies_in_a_listed_interval(name: str, task: str | None) -> None:
    arm = armkin.load(name)
    q, target = redundant_postures(arm, task, 60, 3)
    s = armkin.ik(arm, target, task)
    redundant = redundancy(arm, task)
    assert redundant is not None
    assert s.interval is not None
    assert (s.status == Status.EXACT).all()
    assert (s.best >= 0).all()
    for k in range(len(q)):
        legal = s.interval[k][s.within_limits[k]]
        assert covers_value(arm, legal, q[k, redundant.joint]).any()
    mm, rad = s.residual()
    assert np.nanmax(mm) <= 1e-9 * arm.reach
    assert np.nanmax(rad, initial=0.0) <= 1e-9


@pytest.mark.parametrize(("name", "task"), ARMS)
def test_as_many_legal_postures_as_intervals_at_any_value(name: str, task: str | None) -> None:
    """On both sides of each end, 1e-6 degrees from it, and between: as many as the arm with the joint held has."""
    arm = armkin.load(name)
    _, target = redundant_postures(arm, task, 1, 8)
    s = armkin.ik(arm, target, task)
    redundant = redundancy(arm, task)
    assert redundant is not None
    assert s.interval is not None
    for k in range(len(target)):
        legal = s.interval[k][s.within_limits[k]]
        ends = np.unique(legal.ravel().round(7))
        beside = np.concatenate([legal.ravel() - np.deg2rad(1e-6), legal.ravel() + np.deg2rad(1e-6)])
        for value in [*beside[::9], *(0.5 * (ends[1:] + ends[:-1]))[:3]]:
            if arm.lower[redundant.joint] <= value <= arm.upper[redundant.joint]:
                own = held_answers(arm, redundant.joint, float(value), target[k], task)
                assert covers_value(arm, legal, value, 0.0).sum() == len(own), (k, np.rad2deg(value))


@pytest.mark.parametrize(("name", "task"), ARMS)
def test_a_row_is_the_posture_of_its_interval_nearest_to_near(name: str, task: str | None) -> None:
    arm = armkin.load(name)
    q, target = redundant_postures(arm, task, 1, 9)
    redundant = redundancy(arm, task)
    assert redundant is not None
    s = armkin.ik(arm, target, task)
    assert s.interval is not None
    for k in range(len(target)):
        low, high = s.interval[k, s.best[k]]
        values = np.linspace(low, high, 9)
        least = np.inf
        for value in values:
            for row in held_answers(arm, redundant.joint, float(value), target[k], task):
                least = min(least, float(np.rad2deg(np.abs(row - arm.home)).sum()))
        assert s.motion[k, s.best[k]] <= least + 1e-6
    again = armkin.ik(arm, target, task, near=q)
    assert np.nanmax(np.take_along_axis(again.motion, again.best[:, None], axis=1)) <= 1e-6


@pytest.mark.parametrize("x_y", [(200.0, 100.0), (0.0, 300.0), (-150.0, 250.0)])
def test_a_row_is_at_its_interval_s_end_where_that_is_nearest(x_y: tuple[float, float]) -> None:
    """Where two branches merge one goes away from near, whatever it does farther on; by the law of cosines."""
    arm = armkin.load("planar_3dof")
    solutions = armkin.ik(arm, np.array(x_y), "xy")
    assert solutions.interval is not None
    assert solutions.valid.sum() >= 2
    for branch in np.flatnonzero(solutions.valid).tolist():
        low, high = solutions.interval[branch]
        q1 = np.linspace(low, high, 20_001)
        x, y = x_y[0] - 200.0 * np.cos(q1), x_y[1] - 200.0 * np.sin(q1)
        q3 = np.arccos(np.clip((x * x + y * y - 300.0**2 - 100.0**2) / (2.0 * 300.0 * 100.0), -1.0, 1.0))
        if solutions.names[solutions.branch[branch]] == "elbow up":
            q3 = -q3
        q2 = np.arctan2(y, x) - np.arctan2(100.0 * np.sin(q3), 300.0 + 100.0 * np.cos(q3)) - q1
        motions = np.abs([(value + np.pi) % (2.0 * np.pi) - np.pi for value in (q1, q2, q3)]).sum(axis=0)
        assert np.rad2deg(np.abs(solutions.q[branch]).sum() - motions.min()) < 0.02


def count_over_a_turn(arm: armkin.Arm, target: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Legal postures of joint 7 at values (K,): its closed form asked at each."""
    find = Follower(ik, arm, redundancy(arm, None), target[None], np.zeros((1, 7)))  # type: ignore[arg-type]
    rows = np.zeros(len(values), np.intp)
    q = find.branches_at(rows, values)
    _, legal = nearest_row(arm, np.nan_to_num(q), np.zeros(arm.n))
    return np.asarray((legal & ~np.isnan(q[:, :, 0])).sum(axis=1))


@pytest.mark.parametrize("seed", range(3))
def test_no_interval_and_no_gap_is_missed_between_values(seed: int) -> None:
    """panda, its limits cut at random: 5 of 100 targets lacked intervals or gaps of up to 0.4 degrees."""
    panda, rng = armkin.load("panda"), np.random.default_rng(seed)
    wide = (panda.upper - panda.lower) * (seed > 0)
    limits = np.stack(
        [panda.lower + rng.uniform(0, 0.4, 7) * wide, panda.upper - rng.uniform(0, 0.4, 7) * wide], axis=1
    )
    arm = from_links(panda.link, [False] * 7, limits=limits)
    q = rng.uniform(limits[:, 0], limits[:, 1], (6, 7))
    s = armkin.ik(arm, armkin.fk(arm, q))
    assert s.interval is not None
    assert s.complete.sum() >= 5
    for k in range(len(q)):
        t = np.sort(rng.uniform(-np.pi, np.pi, 5000))
        legal = s.interval[k][s.within_limits[k]]
        ends = legal.ravel()[:, None]
        t = t[(np.abs(np.remainder(t - ends + np.pi, 2 * np.pi) - np.pi) > 2e-8).all(axis=0)]
        listed = covers_value(arm, legal[:, None], t, 0.0).sum(axis=0)
        assert (listed == count_over_a_turn(arm, s.target[k], t)).all()


@pytest.mark.parametrize(("number", "value"), [(6, -129.201714), (154, -17.369938), (37, 121.293372), (577, -15.77265)])
def test_what_is_shorter_than_a_sample_is_there(number: int, value: float) -> None:
    """Four targets of 600 that lacked an interval or a gap here, of 0.003 to 0.07 degrees: no sample was in it."""
    arm = armkin.load("panda")
    target = redundant_postures(arm, None, 600, 23)[1][number]
    s = armkin.ik(arm, target)
    assert s.interval is not None
    assert s.complete
    listed = covers_value(arm, s.interval[s.within_limits], np.deg2rad(value), 0.0).sum()
    assert listed == len(held_answers(arm, 6, float(np.deg2rad(value)), target, None))


def test_the_command_answers_without_options() -> None:
    completed = run("ik", "panda", 400, 0, 400, 180, 0, 0, "--json")
    assert completed.code == 0
    [row] = completed.json["branches"]
    assert row["family"]["joint"] == "J7"
    low, high = row["family"]["interval"]
    assert low <= row["joints"][6] <= high
    every = run("ik", "panda", 400, 0, 400, 180, 0, 0, "--json", "--all-branches").json["branches"]
    assert {branch["within_limits"] for branch in every} == {True, False}
    assert "J7 from -56.9683 to 56.9683" in run("ik", "panda", 400, 0, 400, 180, 0, 0).out


def test_a_turn_without_ends_is_the_whole_of_it() -> None:
    links = np.tile(np.eye(4), (4, 1, 1))
    links[1:, 0, 3] = 50, 300, 300
    s = armkin.ik(from_links(links, [False] * 3), [280.0, 90.0], "xy")
    assert s.interval is not None
    assert np.rad2deg(s.interval[s.valid]).tolist() == [[-180.0, 180.0]] * int(s.valid.sum())


def test_out_of_reach_is_unreachable_and_exits_3() -> None:
    completed = run("ik", "panda", 1400, 0, 400, 180, 0, 0, "--json")
    assert (completed.code, completed.json["status"]) == (3, "unreachable")
    assert completed.json["closest"]["distance_mm"] > 400


def test_held_joints_still_leave_isolated_branches() -> None:
    completed = run("ik", "panda", 400, 0, 400, 180, 0, 0, "--lock", "J7=20", "--json")
    assert completed.code == 0
    assert "family" not in completed.json["branches"][0]
    assert completed.json["branches"][0]["joints"][6] == pytest.approx(20)


def test_with_keep_outs_the_posture_of_an_interval_is_free(tmp_path: object) -> None:
    words = "ik", "panda", 400, 0, 400, 180, 0, 0, "--json"
    best = run(*words).json["branches"][0]
    arm = armkin.load("panda")
    x, y, z = armkin.frames(arm, np.deg2rad(best["joints"]))[4, :3, 3].tolist()
    scene = f"{tmp_path}/ball.yaml"
    with open(scene, "w") as file:
        file.write(f"keep_out:\n  - capsule: {{from: [{x}, {y}, {z}], to: [{x}, {y}, {z + 1}], radius: 20}}\n")
    answer = run(*words, "--scene", scene).json
    if answer["best"] is not None:
        assert not answer["branches"][0]["hits"]
        assert abs(answer["branches"][0]["joints"][6] - best["joints"][6]) > 1


def test_a_nearly_stretched_arm_has_its_short_families() -> None:
    """All values of J7 that answer lie within half a degree: it was called unreachable."""
    arm = armkin.load("iiwa7")
    q = np.deg2rad([-21.3642, 6.3411, -19.648, -0.3067, -57.4691, -59.4958, 14.8183])
    s = armkin.ik(arm, armkin.fk(arm, np.stack([arm.home + 0.3, q])))
    assert s.interval is not None
    assert (s.best >= 0).all()
    assert covers_value(arm, s.interval[1][s.within_limits[1]], q[6]).any()


@pytest.mark.parametrize("joint", [1, 3, 5])
@pytest.mark.parametrize("degrees", [0.013, 1e-4, 0.0])
def test_an_arm_with_an_all_but_straight_joint_loses_no_posture(joint: int, degrees: float) -> None:
    """iiwa7 with its elbow 0.013 degrees from straight was called unreachable: families shorter than a sample."""
    arm = armkin.load("iiwa7")
    q = np.random.default_rng(5).uniform(arm.lower, arm.upper, (30, 7))
    q[:, joint] = np.deg2rad(degrees)
    target = armkin.fk(arm, q)
    s = armkin.ik(arm, target)
    assert s.interval is not None
    assert all(covers_value(arm, s.interval[k][s.within_limits[k]], q[k, 6]).any() for k in range(len(q)))
    assert np.nanmax(s.residual()) <= 1e-9
    assert s.complete.all() or joint != 3
    assert not s.complete.any() or joint == 3 or degrees  # a straight shoulder or wrist turns by itself
    again = armkin.ik(arm, target, near=q)
    assert np.take_along_axis(again.motion, again.best[:, None], axis=1).max() <= 1e-9


def test_a_posture_that_only_touches_the_limits_is_an_interval_without_length() -> None:
    arm = armkin.load("iiwa7")
    q = np.where(np.random.default_rng(1).random((20, 7)) < 0.5, arm.lower, arm.upper)
    s = armkin.ik(arm, armkin.fk(arm, q))
    assert s.interval is not None
    assert all(covers_value(arm, s.interval[k][s.within_limits[k]], q[k, 6]).any() for k in range(len(q)))


def test_the_arm_angle_knows_all_families_of_a_class_whatever_its_zeros_and_elbow() -> None:
    """Zeros of the joints turned, the elbow moved off both lines, flange and base anywhere: the same intervals are
    right."""
    rng, arm = np.random.default_rng(3), armkin.load("iiwa7")
    links = arm.link.copy()
    for k in range(8):
        turn = np.eye(4)
        a = rng.uniform(-np.pi, np.pi)
        turn[:2, :2] = [[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]
        links[k] = links[k] @ turn
    links[3, :3, 3] += links[3, :3, :3] @ [50.0, 20.0, 0.0]
    links[4, :3, 3] += [-40.0, 10.0, 0.0]
    limits = np.stack([arm.lower, arm.upper], axis=1)
    limits[2] = -4.0, 1.0
    limits[6] = -np.inf, np.inf
    turned_arm = from_links(links, [False] * 7, limits=limits)
    q = rng.uniform(np.maximum(limits[:, 0], -3), np.minimum(limits[:, 1], 3), (40, 7))
    s = armkin.ik(turned_arm, armkin.fk(turned_arm, q), near=q)
    assert s.why.endswith("arm angle")
    assert s.complete.all()
    assert np.nanmax(s.residual()) <= 1e-9
    assert s.motion[np.arange(40), s.best].max() <= 1e-9
    s = armkin.ik(turned_arm, armkin.fk(turned_arm, q[:1]))
    assert s.interval is not None
    legal = s.interval[0][s.within_limits[0]]
    for value in rng.uniform(-np.pi, np.pi, 8):
        postures = held_answers(turned_arm, 6, float(value), s.target[0], None)
        assert covers_value(turned_arm, legal, float(value), 0.0).sum() == len(postures)


def test_a_target_that_only_postures_outside_the_limits_reach_has_no_legal_interval() -> None:
    arm = armkin.load("panda")
    q = np.random.default_rng(5).uniform(-3.0, 3.0, (3000, 7))[7]
    solutions = armkin.ik(arm, armkin.fk(arm, q))
    assert solutions.status == Status.EXACT
    assert solutions.valid.any()
    assert not solutions.within_limits.any()


@pytest.mark.parametrize(("k", "degrees", "count"), [(0, -1.38508, 2), (7, 119.39265, 4), (8, -84.25, 4)])
def test_intervals_shorter_than_a_sample_are_listed(k: int, degrees: float, count: int) -> None:
    """Beside a merge the other branch is legal for 1e-4 degrees; between two limits one is for 0.06."""
    arm = armkin.load("panda")
    _, target = redundant_postures(arm, None, 12, 5)
    s = armkin.ik(arm, target[k])
    assert s.interval is not None
    value = float(np.deg2rad(degrees))
    assert len(held_answers(arm, 6, value, target[k], None)) == count
    assert covers_value(arm, s.interval[s.within_limits], value, 0.0).sum() == count


@pytest.mark.parametrize(
    ("degrees", "value"),
    [
        ([140.89, 2.96, 77.21, -142.92, -83.16, 40.33, -89.95], -90.25),
        ([-18.35, -62.5, 42.82, -6.59, 65.1, 43.56, -10.89], -11.0),
        ([-72.79, -48.99, -100.34, -108.24, 42.55, 133.65, 83.48], 69.0),
    ],
)
def test_gaps_and_families_between_two_samples_are_listed(degrees: list[float], value: float) -> None:
    """A straight shoulder takes joint 1 over its limits and back; two limits lie within a degree."""
    arm, value = armkin.load("panda"), float(np.deg2rad(value))
    target = armkin.fk(arm, np.deg2rad(degrees))
    s = armkin.ik(arm, target)
    assert s.interval is not None
    postures = held_answers(arm, 6, value, target, None)
    assert covers_value(arm, s.interval[s.within_limits], value, 0.0).sum() == len(postures)


def axis_targets(arm: armkin.Arm, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Postures within limits (N, n), and where their tools are and point to (N, 6)."""
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    q = np.random.default_rng(seed).uniform(low, high, (count, arm.n))
    T = armkin.fk(arm, q)
    return q, np.concatenate([T[:, :3, 3], T[:, :3, 2]], axis=1)


@pytest.mark.parametrize("name", ["ur5e", "puma560", "jaco_j2n6s300"])
def test_a_joint_that_turns_about_the_tool_is_redundant_where_its_axis_alone_is_asked_for(name: str) -> None:
    """Refused before: 6 joints for 5 constraints. Each branch of a pose is a family, at any value of the last joint."""
    arm = armkin.load(name)
    q, target = axis_targets(arm, 40, 5)
    s, pose = armkin.ik(arm, target, "xyz_axis", near=q), armkin.ik(arm, armkin.fk(arm, q), near=q)
    assert (s.status == Status.EXACT).all()
    assert s.complete.all()
    assert (s.valid.sum(axis=1) == pose.valid.sum(axis=1)).all()
    assert s.interval is not None
    best = np.take_along_axis(s.q, s.best[:, None, None], axis=1)[:, 0]
    np.testing.assert_allclose(best, q, atol=1e-9)
    turn = np.clip([-np.pi, np.pi], arm.lower[5], arm.upper[5])
    np.testing.assert_allclose(s.interval[s.valid], np.broadcast_to(turn, (s.valid.sum(), 2)))
    mm, rad = s.residual()
    assert np.nanmax(mm) <= 1e-9 * arm.reach
    assert np.nanmax(rad) <= 1e-9
    turned = np.where(s.valid[..., None], s.q, 0.0)
    turned[..., 5] = 0.5
    poses = armkin.fk(arm, turned)
    error = np.abs(np.concatenate([poses[..., :3, 3], poses[..., :3, 2]], axis=-1) - target[:, None])
    assert error[s.valid].max() <= 1e-9 * arm.reach
    fast = armkin.compile(arm, "xyz_axis").ik(target, "xyz_axis", near=q)
    np.testing.assert_allclose(fast.q, s.q, atol=1e-9)
    assert (fast.complete == s.complete).all()


def test_a_tool_beside_the_last_axis_has_families_of_the_first_joint() -> None:
    """An internal error before: the axis is three numbers for two constraints."""
    arm = armkin.load("fanuc_crx10ia")
    q, target = axis_targets(arm, 3, 6)
    s = armkin.ik(arm, target, "xyz_axis", near=q)
    assert s.method == "families of J1"
    best = np.take_along_axis(s.q, s.best[:, None, None], axis=1)[:, 0]
    np.testing.assert_allclose(best, q, atol=1e-9)
    mm, rad = s.residual()
    assert np.nanmax(mm) <= 1e-9 * arm.reach
    assert np.nanmax(rad) <= 1e-9


def test_a_batch_of_a_redundant_arm_may_be_compiled() -> None:
    """`--compiled` with a task by name was refused: 7 joints for 6 constraints."""
    arm = armkin.load("panda")
    q, target = redundant_postures(arm, None, 2, 7)
    fast, python = armkin.compile(arm).ik(target, "pose", near=q), armkin.ik(arm, target, near=q)
    np.testing.assert_allclose(fast.q, python.q, atol=1e-6)  # where branches merge rounding moves joints by its root


def test_an_end_before_its_best_sample_by_rounding_is_no_whole_turn() -> None:
    """Of 300 postures of whole degrees 19 had an interval of a whole turn, of a joint that turns by 332 degrees."""
    arm = armkin.load("panda")
    q = np.deg2rad(np.random.default_rng(5).integers(-160, 160, (300, arm.n)) * 1.0).clip(arm.lower, arm.upper)
    s = armkin.ik(arm, armkin.fk(arm, q), near=q)
    assert s.interval is not None
    assert (np.ptp(s.interval[s.within_limits], axis=1) < 5.8).all()


@pytest.mark.parametrize("more", [False, True])
@pytest.mark.parametrize("number", [3233, 5745, 16984])
def test_an_end_that_rounding_moves_is_found_in_more_digits(
    number: int, more: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """panda: one end each of 9 of 40,000 targets was 8e-5 to 1e-3 degrees off, with `complete` true."""
    arm, more = armkin.load("panda"), more and boundaries.MORE_DIGITS
    monkeypatch.setattr(boundaries, "MORE_DIGITS", more)
    target = redundant_postures(arm, None, number + 1, 31)[1][-1]
    s = armkin.ik(arm, target)
    assert s.complete == more
    assert s.interval is not None
    assert_ends(arm, s.interval[s.within_limits], 6, target)


@pytest.mark.parametrize(
    "degrees",
    [
        *(
            [0, -180, -90, 0, 0, 0, -180],
            [-180, -135, -180, 60, 15, 60, -90],
        ),  # where something may change is not known
        [-30, -60, 135, 120, -90, -135, 165],  # or does not explain a change
    ],
)
def test_a_target_whose_changes_nobody_explains_is_sampled_alone_as_in_a_batch(degrees: list[int]) -> None:
    arm = armkin.load("panda")
    T, second_target = (armkin.fk(arm, np.radians(q)) for q in (degrees, [10, -20, 30, -90, 40, 100, 50]))
    alone, batch = armkin.ik(arm, T), armkin.ik(arm, np.stack([T, second_target]))
    count = alone.valid.sum()
    assert alone.interval is not None
    assert batch.interval is not None
    np.testing.assert_array_equal(alone.interval[:count], batch.interval[0, :count])
    assert count == batch.valid[0].sum() > 0
    assert not alone.complete


@pytest.mark.parametrize("degrees", [[-90, -90, -90, -176.001, 90, 0, 90], [90, -45, -135, -176.001, -90, 135, 0]])
def test_an_arm_that_stands_at_a_limit_that_its_family_only_touches_stays(degrees: list[float]) -> None:
    arm = armkin.load("panda")
    q = np.deg2rad(degrees)
    q[3] = arm.lower[3]
    for s in (ik(arm, armkin.fk(arm, q), near=q), armkin.compile(arm).ik(armkin.fk(arm, q), near=q)):
        assert s.q[s.best].tolist() == q.tolist()
        assert s.within_limits[s.best]
