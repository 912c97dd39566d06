"""The exported ES module answers as Python does: in node, on random and on typed poses of every class of arms."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exported_js import ask_module, differences, goals_of

import armkin
import right_angles
from armkin.errors import UsageError
from armkin.export.js.es_module import module_text
from armkin.inverse.solvers.choose_redundant_joint import redundancy
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import nearest_rotation, targets_of

ROOT = Path(__file__).parents[2]

# a robot of every class that a module can hold, and how many random and typed postures it is asked
ARMS = (
    "three_dof",
    "planar_3dof",
    "yaw_two_link",
    "cobra600",
    "labvolt_5150",
    "so101",
    "stanford",
    "puma560",
    "ur5e",
    "ar4",
)


def _random_postures(arm: armkin.Arm, count: int) -> np.ndarray:
    turn = np.where(arm.prismatic, arm.reach / 4, np.pi)
    return np.random.default_rng(5).uniform(-turn, turn, (count, arm.n))


def _typed_postures(arm: armkin.Arm, count: int) -> np.ndarray:
    """Multiples of 15, 30, 45 and 90 degrees, slides a little out: where people ask, and where arms are singular."""
    rng = np.random.default_rng(6)
    step = rng.choice([15.0, 30.0, 45.0, 90.0], (count, 1))
    values = np.round(rng.uniform(-180, 180, (count, arm.n)) / step) * step
    typed: np.ndarray = np.where(arm.prismatic, 120.0 + values / 4, np.deg2rad(values))
    return typed


def _tool_down(arm: armkin.Arm, count: int) -> np.ndarray:
    T = armkin.fk(arm, _random_postures(arm, 3 * count))
    T[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    solutions = armkin.ik(arm, T)
    postures: np.ndarray = solutions.q[:, 0][solutions.valid[:, 0]][:count]
    assert len(postures) == count
    return postures


@pytest.mark.parametrize("name", ARMS)
def test_the_module_answers_as_python_does(name: str, tmp_path: Path) -> None:
    arm = armkin.load(name)
    q = np.concatenate([_random_postures(arm, 60), _typed_postures(arm, 30)])
    answers = ask_module(arm, tmp_path, q)
    assert not differences(arm, answers["ik"], armkin.ik(arm, goals_of(arm, q)))
    assert np.abs(np.array(answers["fk"]) - armkin.fk(arm, q)).max() < 1e-12 * arm.reach
    assert np.abs(np.array(answers["jacobian"]) - armkin.jacobian(arm, q)).max() < 1e-12 * arm.reach
    assert np.abs(np.array(answers["target"]) - goals_of(arm, q)).max() < 1e-9
    assert ("pulses" in answers) == (arm.motor_gain.size > 0)
    if "pulses" in answers:
        counts = armkin.pulses(arm, q)
        assert (np.array(answers["pulses"]) == counts).all()
        assert np.abs(np.array(answers["joints"]) - armkin.joints(arm, counts)).max() < 1e-9


@pytest.mark.parametrize("name", ["jaco_j2n6s300", "moveo"])
def test_the_general_elimination_answers_as_python_does(name: str, tmp_path: Path) -> None:
    arm = armkin.load(name)
    q = np.concatenate(
        [
            _random_postures(arm, 30),
            _typed_postures(arm, 6),
            _tool_down(arm, 6) if arm.n == 6 else _typed_postures(arm, 0),
        ]
    )
    assert not differences(arm, ask_module(arm, tmp_path, q)["ik"], armkin.ik(arm, goals_of(arm, q)))


_DOUBTS = """
const doubts = [];
for (const q of JSON.parse(readFileSync('asked.json', 'utf8')).q) {
  ik(target(q), q);
  doubts.push(candidates(goalNumbers, q, allJoints, allMisses));
}
console.log(JSON.stringify(doubts));
"""


def test_roots_that_solutions_share_are_taken_apart(tmp_path: Path) -> None:
    """An xArm 6 with its tool straight down has two solutions a root: one pass tells them, without a doubt."""
    arm = armkin.load("xarm6")
    q = _tool_down(arm, 8)
    assert not differences(arm, ask_module(arm, tmp_path, q)["ik"], armkin.ik(arm, goals_of(arm, q)))
    inside = "import { readFileSync } from 'node:fs';\n" + (tmp_path / "arm.mjs").read_text() + _DOUBTS
    (tmp_path / "doubts.mjs").write_text(inside)
    completed = subprocess.run(["node", "doubts.mjs"], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert json.loads(completed.stdout) == [False] * len(q)


_MALFORMED = """
import * as arm from './arm.mjs';
const told = [];
for (const name of ['ik', 'fk', 'jacobian', 'target', 'clearance', 'pulses', 'joints'])
  for (const given of [[null], [undefined], [], [5], [[null]], [arm.target(arm.home), null]])
    if (arm[name] && (name === 'ik' || given.length < 2))
      try {
        told.push([name, 'answer', String(arm[name](...given))]);
      } catch (error) {
        told.push([name, error.name, error.message]);
      }
console.log(JSON.stringify(told));
"""


@pytest.mark.parametrize("name", ["three_dof", "ur5e", "panda"])
def test_what_is_malformed_throws_a_range_error_that_says_what_was_expected(name: str, tmp_path: Path) -> None:
    arm = armkin.load(name)
    (tmp_path / "arm.mjs").write_text(module_text(arm), encoding="utf-8")
    (tmp_path / "malformed.mjs").write_text(_MALFORMED)
    completed = subprocess.run(["node", "malformed.mjs"], cwd=tmp_path, check=True, capture_output=True, text=True)
    told = json.loads(completed.stdout)
    expected = ("a target is ", f"{name} has {arm.n} joints", f"{name} has {arm.n} motors", "cannot be held")
    assert [row for row in told if row[1] != "RangeError" or not any(words in row[2] for words in expected)] == []
    assert not [row for row in told if "undefined values" in row[2] or "null" in row[2]]
    assert {row[0] for row in told} >= {"ik", "fk", "jacobian", "target"}


SINGULAR: dict[str, list[list[float]]] = {
    "thor": [
        [135, 0, 0, 0, -135, 180],  # the elbow stretched over the base: a self-motion of double roots
        [90, 180, 180, 90, 0, 0],  # and with the wrist straight: a surface of them
        [-90, 0, 0, 0, 0, -90],  # home is half a turn off, which has no sine: it is no solution
    ],
    "fanuc_crx10ia": [
        [135, -135, -90, 0, -45, 0],  # four self-motions, two of which cross at a corner
        [-90, 90, -90, 90, -180, -45],  # two self-motions of double roots that never meet
        [-90, 90, -90, -90, 0, 180],  # six self-motions; two have a small basin of Newton's method
    ],
    "wx250s": [[-90, 90, 90, -90, -90, 0]],  # rings of four self-motions, each of which crosses two others
    "puma560": [
        [0, 0, 0, 0, -180, 90],
        # eight roots, of which two are 0.05 rad apart with a residual of 1.013e-9 between them
        [-4.813044711, 145.125268461, 92.595802989, -165.626017016, -44.831758543, 29.670348965],
    ],
    "xarm6": [[90, 135, 45, 0, -180, 180]],  # a root of third order, whose second difference is zero
    "niryo_ned2": [[-180, 180, -90, 0, 0, -180]],  # a root known to 4e-4 rad, and nowhere along it a better one
}


@pytest.mark.parametrize("name", SINGULAR)
def test_singular_postures_are_those_of_python(name: str, tmp_path: Path) -> None:
    arm = armkin.load(name)
    q = np.deg2rad(SINGULAR[name])
    goals = goals_of(arm, q)
    for k, answer in enumerate(ask_module(arm, tmp_path, q, targets=goals)["ik"]):
        assert not differences(arm, [answer], armkin.ik(arm, goals[k : k + 1]))


def test_a_calibrated_arm_is_commanded_in_its_own_values(tmp_path: Path) -> None:
    arm = armkin.load(Path(__file__).parents[1] / "robots" / "ratio_arm.yaml")
    q = _random_postures(arm, 40)
    answers = ask_module(arm, tmp_path, q)
    assert np.abs(np.array(answers["fk"]) - armkin.fk(arm, q)).max() < 1e-12 * arm.reach
    assert not differences(arm, answers["ik"], armkin.ik(arm, goals_of(arm, q)))


@pytest.mark.parametrize("name", ["ur5e", "puma560", "three_dof"])
def test_the_arm_that_stands_at_its_target_stays(name: str, tmp_path: Path) -> None:
    """Singular postures too, asked for in the six digits that a pose is printed with."""
    arm = armkin.load(name)
    typed = np.clip(_typed_postures(arm, 40), arm.lower, arm.upper)
    rounded = goals_of(arm, typed).round(6)
    if name == "three_dof":
        rounded, defect = goals_of(arm, typed), np.zeros(len(typed))
    else:
        R = rounded[:, :3, :3]
        defect = np.abs(R.swapaxes(1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    answers = ask_module(arm, tmp_path, typed, near=typed, targets=rounded)
    stood = 0
    for q, target, rounding, answer in zip(typed, rounded, defect, answers["ik"], strict=True):
        task, _ = solver(arm, None)
        goal = nearest_rotation(target[None, :3, :3])[0] if target.ndim == 2 else target
        error = residual(task, armkin.fk(arm, q[None]), q[None], _with_rotation(target, goal)[None])[0]
        error[: task.position] /= arm.reach
        if np.linalg.norm(error) > 1e-9 + rounding:
            continue  # rounding has turned the pose by more than its columns tell
        stood += 1
        assert answer["best"] == 0
        assert np.abs(np.array(answer["branches"][0]["joints"]) - q).max() == 0.0
    assert stood >= 30


def test_a_rotation_by_right_angles_hides_its_rounding_but_the_position_shows_it(tmp_path: Path) -> None:
    arm = armkin.load("puma560")
    q = np.tile(np.radians(right_angles.POSTURES["puma560"]), (3, 1))
    targets = goals_of(arm, q)
    targets[:3], targets[3:6] = targets[:3].round(4), targets[3:6].round(5)
    targets[6:] = targets[6:].astype(np.float32)
    for near, answer in zip(q, ask_module(arm, tmp_path, q, near=q, targets=targets)["ik"], strict=True):
        assert answer["best"] == 0
        np.testing.assert_array_equal(answer["branches"][0]["joints"], near)


def _with_rotation(target: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """A target whose rotation is made orthonormal, as the module reads it."""
    if target.ndim != 2:
        return target
    turned = target.copy()
    turned[:3, :3] = goal
    return turned


def test_a_target_out_of_reach_has_the_nearest_posture_within_limits(tmp_path: Path) -> None:
    arm = armkin.load("three_dof")
    targets = np.array([[900.0, 0.0, 100.0], [10.0, 20.0, 900.0], [0.0, -400.0, -300.0]])
    answers = ask_module(arm, tmp_path, np.zeros((3, 3)), targets=targets)
    for target, answer in zip(targets, answers["ik"], strict=True):
        assert answer["best"] is None
        mine = armkin.closest(arm, target)
        assert abs(answer["closest"]["distance_mm"] - mine.distance) < 1e-6


@pytest.mark.parametrize("name", ["three_dof", "ur5e"])
def test_hits_are_those_of_python(name: str, tmp_path: Path) -> None:
    arm = armkin.load(name, scene=str(Path(__file__).parents[2] / "examples" / "scenes" / f"{name}.yaml"))
    q = np.random.default_rng(3).uniform(np.maximum(arm.lower, -3), np.minimum(arm.upper, 3), (60, arm.n))
    answers = ask_module(arm, tmp_path, q)
    apart = armkin.clearance(arm, q)
    assert np.abs(np.array([answer["clearance_mm"] for answer in answers["clearance"]]) - apart.mm).max() < 1e-9
    hit = [
        (answer["hits"][0]["body"], answer["hits"][0]["with"]) if answer["hits"] else ("", "")
        for answer in answers["clearance"]
    ]
    told_by_python = zip(apart.body.tolist(), apart.other.tolist(), (apart.mm < 0).tolist(), strict=True)
    assert hit == [(body, obstacle) if deep else ("", "") for body, obstacle, deep in told_by_python]
    assert 3 < int((apart.mm < 0).sum()) < 60
    s = armkin.ik(arm, goals_of(arm, q))
    assert not differences(arm, answers["ik"], s)
    free = [[not row["hits"] for row in answer["branches"]] for answer in answers["ik"]]
    assert [sorted(row) for row in free] == [sorted(s.clear[k, s.valid[k]].tolist()) for k in range(len(q))]


def test_a_name_in_the_module_ends_no_script_and_no_line() -> None:
    arm = replace(armkin.load("three_dof"), name="</script><script>alert(1)//\u2028throw 1")
    text = module_text(arm)
    assert "</script" not in text
    assert "\u2028" not in text


@pytest.mark.parametrize(
    ("name", "task", "count"),
    [("panda", None, 30), ("iiwa7", None, 20), ("planar_3dof", "xy", 20), ("ur5e", "xyz_axis", 20)],
)
def test_of_an_arm_with_a_joint_to_spare_that_joint_is_held(
    name: str, task: str | None, count: int, tmp_path: Path
) -> None:
    arm = armkin.load(name)
    spare = redundancy(arm, task)
    assert spare is not None
    rng = np.random.default_rng(8)
    q = rng.uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi), (count, arm.n))
    targets = targets_of(spare.task, armkin.fk(arm, q), q)
    j, joint = spare.joint, arm.joint_names[spare.joint]
    answers = ask_module(arm, tmp_path, q, near=q, targets=targets, task=task, held=q[:, j])
    flat = targets.reshape(count, -1)
    assert ask_module(arm, tmp_path, q, near=q, targets=flat, task=task, held=q[:, j])["ik"] == answers["ik"]
    assert np.abs(np.array(answers["fk"]) - armkin.fk(arm, q)).max() < 1e-12 * arm.reach
    assert np.abs(np.array(answers["target"]) - targets).max() < 1e-9
    assert answers["redundant"] == joint
    for posture, target, answer in zip(q, targets, answers["ik"], strict=True):
        locked_arm = armkin.lock(arm, {joint: posture[j]})
        s = armkin.ik(locked_arm, target[None], task, near=np.delete(posture, j))
        assert {row["joints"][j] for row in answer["branches"]} == {posture[j]}
        for row in answer["branches"]:
            del row["joints"][j]
        assert not differences(locked_arm, [answer], s)


@pytest.mark.parametrize(
    ("name", "task", "count"),
    [("panda", None, 30), ("iiwa7", None, 20), ("planar_3dof", "xy", 20), ("ur5e", "xyz_axis", 20)],
)
def test_without_a_held_joint_the_module_lists_families(
    name: str, task: str | None, count: int, tmp_path: Path
) -> None:
    arm = armkin.load(name)
    q = np.random.default_rng(8).uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi), (count, arm.n))
    spare = redundancy(arm, task)
    assert spare is not None
    targets = targets_of(spare.task, armkin.fk(arm, q), q)
    near = np.where(np.arange(count)[:, None] % 2, q, arm.home)
    answers = ask_module(arm, tmp_path, q, near=near, targets=targets, task=task)["ik"]
    s = armkin.ik(arm, targets, task, near=near)
    assert s.interval is not None
    same = 0
    for k, answer in enumerate(answers):
        rows = [row for row in answer["branches"] if row["within_limits"]]
        legal = [b for b in s.order[k] if s.within_limits[k, b]]
        assert (answer["status"], answer["complete"]) == (armkin.Status(s.status[k]).name.lower(), False)
        assert answer["best"] == 0
        assert rows[0]["motion"] < np.deg2rad(s.motion[k, s.best[k]]) + 1e-6
        theirs = np.array([(*row["family"]["interval"], row["motion"]) for row in rows])
        ours = np.array([(*s.interval[k, b], np.deg2rad(s.motion[k, b])) for b in legal])
        if len(ours) == len(theirs):  # a motion may be less: beside singular postures there are more samples here
            apart = np.abs(theirs[:, None] - ours)
            alike = (apart[..., :2].max(axis=2) < 1e-6) & (apart[..., 2] < np.deg2rad(0.1))
            same += alike.any(axis=0).all() and alike.any(axis=1).all()
        joints = np.array([row["joints"] for row in answer["branches"]])
        error = residual(s.task, armkin.fk(arm, joints), joints, targets[[k] * len(joints)])
        assert np.abs(error).max() < 1e-9 * arm.reach
        if k % 2:  # the arm stands there
            assert rows[0]["joints"] == q[k].tolist()
    assert same >= 0.9 * count


def test_an_arm_that_stands_in_a_family_narrower_than_a_sample_stays(tmp_path: Path) -> None:
    arm = armkin.load("panda")
    q = np.deg2rad([[118.099, -41.25, 106.335, -24.685, -91.197, 147.857, -10.797]])
    [answer] = ask_module(arm, tmp_path, q, near=q, targets=armkin.fk(arm, q))["ik"]
    assert (answer["best"], answer["branches"][0]["joints"]) == (0, q[0].tolist())


def test_branches_that_are_one_all_along_are_a_row(tmp_path: Path) -> None:
    """Links of 200, 300 and 100: about the base the outer two stay folded, whatever the first joint does."""
    arm = armkin.load("planar_3dof")
    answers = ask_module(arm, tmp_path, np.zeros((2, 3)), targets=np.array([[0.0, 0.0], [200.0, 100.0]]), task="xy")[
        "ik"
    ]
    assert [len(answer["branches"]) for answer in answers] == [1, 4]


def test_surfaces_of_postures_are_counted_by_the_curves_that_they_are_swept_from(tmp_path: Path) -> None:
    """An iiwa7 folded, its wrist in its shoulder, and stretched upwards (`tests/inverse/test_surfaces.py`)."""
    arm = armkin.lock(armkin.load("iiwa7"), {"J7": 0.5})
    q = np.deg2rad([[0, -45, 135, 180, -180, 135], [90, 180, 90, 180, 90, 90], [180, 0, 90, 0, 45, -180]])
    answers = ask_module(arm, tmp_path, q, targets=armkin.fk(arm, q))["ik"]
    assert [len(answer["branches"]) for answer in answers] == [2, 4, 1]
    assert not differences(arm, answers, armkin.ik(arm, armkin.fk(arm, q)))
    standing = np.deg2rad([[10.0, 0, 20, 0, 30, 40]])  # an arm that stands on one stays
    [answer] = ask_module(arm, tmp_path, standing, near=standing, targets=armkin.fk(arm, standing))["ik"]
    assert [row["joints"] for row in answer["branches"]] == standing.tolist()


def test_a_held_joint_outside_its_limits_leaves_no_best_branch(tmp_path: Path) -> None:
    arm = armkin.load("panda", scene=str(ROOT / "examples" / "scenes" / "ur5e.yaml"))
    q = np.array([[0.1, 0.3, -0.2, -1.8, 0.2, 1.9, 0.5], [0.1, 0.3, -0.2, -1.8, 0.2, 1.9, 3.0]])
    answers = ask_module(arm, tmp_path, q, near=q, targets=armkin.fk(arm, q), held=q[:, 6])
    inside, outside = answers["ik"]
    assert (inside["best"], inside["closest"]) == (0, None)
    hit = [bool(row["hits"]) for row in inside["branches"] if row["within_limits"]]
    assert hit == sorted(hit)
    apart = armkin.clearance(arm, np.array([row["joints"] for row in inside["branches"]]))
    assert np.abs(apart.mm - [row["clearance_mm"] for row in inside["branches"]]).max() < 1e-9
    assert outside["best"] is None
    assert {row["violations"][-1]["joint"] for row in outside["branches"]} == {"J7"}


def test_an_arm_that_only_python_solves_has_no_module() -> None:
    panda = armkin.load("panda")
    link = np.concatenate([panda.link, np.broadcast_to(np.eye(4), (1, 4, 4))])
    link[-1, 2, 3], link[-2, 0, 3] = 100.0, 50.0
    with pytest.raises(UsageError, match="8 joints"):
        module_text(armkin.model.arm.from_links(link, [False] * 8))
