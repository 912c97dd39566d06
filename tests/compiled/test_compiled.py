"""`armkin.compile`: machine code says what Python says, wherever it comes from."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from left_to_python import left_to_python

import armkin
from armkin.compiled import toolchain
from armkin.inverse.elimination import method
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file

ROBOTS = Path(__file__).parents[2] / "robots"
CLOSED = ["three_dof", "puma560", "ur5e", "labvolt_5150", "cobra600", "stanford"]
ELIMINATED = ["jaco_j2n6s300", "moveo"]


def assert_same(a: armkin.Solutions, b: armkin.Solutions) -> None:
    """Two answers to the same question: alike but for the rounding of joint values."""
    for name in ("valid", "within_limits", "branch", "status", "free", "complete", "near"):
        left, right = getattr(a, name), getattr(b, name)
        assert left.dtype == right.dtype, name
        np.testing.assert_array_equal(left, right, err_msg=name)
    np.testing.assert_allclose(a.target, b.target, rtol=1e-14)  # an axis of length one to rounding is taken as it is
    np.testing.assert_allclose(a.q, b.q, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(a.best, b.best)
    assert (a.names, a.method, a.why, a.arm, a.task.name) == (b.names, b.method, b.why, b.arm, b.task.name)


def found_by_elimination(a: armkin.Solutions, b: armkin.Solutions) -> None:
    """The same, but that rounding may decide in which pass a pose is settled, and so whether it is `complete`."""
    assert (a.complete & ~b.complete).mean() <= 0.01
    assert_same(a, replace(b, complete=a.complete))


@pytest.mark.parametrize("robot", ELIMINATED)
def test_the_elimination_says_what_python_says(robot: str) -> None:
    arm = armkin.load(ROBOTS / f"{robot}.yaml")
    fast = armkin.compile(arm)
    for kind, count in (("random", 200), ("corners", 8), ("far", 50), ("float32", 4)):
        target = target_set(arm, kind, count)
        found_by_elimination(armkin.ik(arm, target), fast.ik(target))
    target = target_set(arm, "random", 30)
    near = np.random.default_rng(5).uniform(-6, 6, (30, arm.n))
    for k in range(4):
        found_by_elimination(armkin.ik(arm, target[k], near=near[k]), fast.ik(target[k], near=near[k]))
    if arm.n == 6:  # tool down: pencils of their own
        down = target.copy()
        down[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
        python, compiled = armkin.ik(arm, down), fast.ik(down)
        found_by_elimination(python, compiled)
        assert compiled.complete.all()
        assert compiled.valid.any(axis=1).sum() > 10
    far = target[0].copy()
    far[:3, ...] *= 9 if far.ndim == 1 else [1, 1, 1, 9]
    found_by_elimination(armkin.ik(arm, far), fast.ik(far))


def target_set(arm: armkin.Arm, kind: str, count: int) -> np.ndarray:
    """Targets of random postures, of multiples of 45 degrees, out of reach, or rounded."""
    rng = np.random.default_rng(4)
    unit = np.where(arm.prismatic, arm.reach / 8, np.pi)
    q = rng.uniform(-1, 1, (count, arm.n)) * unit
    if kind == "corners":
        q = rng.integers(-4, 5, (count, arm.n)) / 4 * unit
    task = solver(arm, None)[0]
    target = targets_of(task, armkin.fk(arm, q), q)
    if kind == "far":
        target = target.copy()
        if target.ndim == 3:
            target[:, :3, 3] *= 1.5
        else:
            target[:, : task.position if task.orientation != "full" else 3] *= 1.5
    return target.astype(np.float32).astype(float) if kind == "float32" else target


@pytest.mark.parametrize("kind", ["random", "corners", "far", "float32"])
@pytest.mark.parametrize("robot", CLOSED)
def test_it_says_what_python_says(robot: str, kind: str) -> None:
    arm = armkin.load(ROBOTS / f"{robot}.yaml")
    target = target_set(arm, kind, 200 if kind == "corners" else 1000)
    assert_same(armkin.ik(arm, target), armkin.compile(arm).ik(target))


@pytest.mark.parametrize("robot", ["ur5e", "puma560", "three_dof"])
def test_joints_half_a_turn_from_near_say_what_python_says(robot: str) -> None:
    """Limits of a turn either way, of half a turn, and others; one `near` of zeros, another one, and one a target."""
    arm = armkin.load(ROBOTS / f"{robot}.yaml")
    fast, target = armkin.compile(arm), target_set(arm, "corners", 200)
    near_of_each = np.pi / 4 * np.random.default_rng(5).integers(-4, 5, (200, arm.n))
    for near in (np.zeros(arm.n), np.full(arm.n, -np.pi / 2), near_of_each):
        solutions = armkin.ik(arm, target, near=near)
        assert_same(solutions, fast.ik(target, near=near))
        assert (np.abs(np.abs(solutions.q - solutions.near[:, None]) - np.pi) < 1e-9).any()
        alone = near if near.ndim == 1 else near[7]
        assert_same(armkin.ik(arm, target[7], near=alone), fast.ik(target[7], near=alone))


@pytest.mark.parametrize("robot", ["three_dof", "puma560", "labvolt_5150", "cobra600"])
def test_one_target_and_its_shapes(robot: str) -> None:
    arm = armkin.load(ROBOTS / f"{robot}.yaml")
    fast = armkin.compile(arm)
    target = target_set(arm, "random", 4)
    for shaped in (target[0], target[0].tolist(), target.reshape(2, 2, *target.shape[1:]), target[:0]):
        assert_same(armkin.ik(arm, shaped), fast.ik(shaped))
    assert_same(armkin.ik(arm, target[1], near=arm.home + 3), fast.ik(target[1], near=arm.home + 3))


@pytest.mark.parametrize("robot", ["ur5e", "puma560", "three_dof"])
def test_near_decides_the_copies(robot: str) -> None:
    arm = armkin.load(ROBOTS / f"{robot}.yaml")
    fast = armkin.compile(arm)
    target = target_set(arm, "random", 300)
    near = np.random.default_rng(5).uniform(-6, 6, (300, arm.n))
    assert_same(armkin.ik(arm, target, near=near[0]), fast.ik(target, near=near[0]))
    solutions = fast.ik(target, near=near)
    for k in range(40):
        assert_same(armkin.ik(arm, target[k], near=near[k]), fast.ik(target[k], near=near[k]))
        np.testing.assert_array_equal(solutions.q[k], fast.ik(target[k : k + 1], near=near[k : k + 1]).q[0])


def test_poses_are_those_of_python() -> None:
    for robot in ("three_dof", "ur5e", "cobra600", "jaco_j2n6s300", "panda"):
        arm = armkin.load(ROBOTS / f"{robot}.yaml")
        q = np.random.default_rng(6).uniform(-20, 20, (500, arm.n))
        q[3, 0], q[4, 0], q[5, 0] = 1e9, np.nan, np.pi
        np.testing.assert_allclose(armkin.compile(arm).fk(q), armkin.fk(arm, q), atol=1e-9 * arm.reach)
        np.testing.assert_allclose(armkin.compile(arm).fk(q[0]), armkin.fk(arm, q[0]), atol=1e-9 * arm.reach)


def test_what_is_no_target_is_refused_in_the_same_words() -> None:
    arm = armkin.load(ROBOTS / "puma560.yaml")
    fast = armkin.compile(arm)
    bad = np.eye(4)
    bad[0, 0] = 1.1
    for target, near in (
        (bad, None),
        (np.eye(3), None),
        (np.full((4, 4), np.nan), None),
        (np.eye(4), [0, 0]),
        ("x", None),
    ):
        with pytest.raises(armkin.UsageError) as python:
            armkin.ik(arm, target, near=near)
        with pytest.raises(armkin.UsageError) as compiled:
            fast.ik(target, near=near)
        assert str(compiled.value) == str(python.value)


def test_workers_change_nothing() -> None:
    arm = armkin.load(ROBOTS / "ur5e.yaml")
    fast = armkin.compile(arm)
    target = target_set(arm, "random", 20_000)
    alone, two = fast.ik(target), fast.ik(target, workers=2)
    np.testing.assert_array_equal(alone.q, two.q)
    assert_same(alone, two)
    q = np.nan_to_num(alone.q[:, 0])
    np.testing.assert_array_equal(fast.fk(q), fast.fk(q, workers=3))
    with pytest.raises(armkin.UsageError, match="workers"):
        fast.ik(target, workers=0)


def test_results_longer_than_caches_are_those_of_their_parts() -> None:
    """They are written past the caches: 42,000 poses in eight columns are 16 MB."""
    arm = armkin.load(ROBOTS / "puma560.yaml")
    fast = armkin.compile(arm)
    T = armkin.fk(arm, np.random.default_rng(9).uniform(-3, 3, (42_000, 6)))
    at_once, parts = fast.ik(T), [fast.ik(T[start : start + 21_000]) for start in (0, 21_000)]
    for field in ("q", "valid", "within_limits", "branch", "status"):
        B = min(getattr(part, field).shape[-1] for part in parts) if field != "status" else None
        together = np.concatenate([getattr(part, field)[..., :B] for part in parts])
        np.testing.assert_array_equal(getattr(at_once, field)[..., :B], together)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder, of a user who has compiled nothing."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "armkin" / "compiled"


SOURCE = 'const char arm_content[] = "abc"; int answer(void); int answer(void) { return 42; }'


def test_what_was_built_is_kept_and_used_again(cache: Path) -> None:
    assert toolchain.load_library(SOURCE, "abc").answer() == 42
    [library] = cache.glob("*.so")
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700
    assert stat.S_IMODE(library.stat().st_mode) == 0o700
    before = library.stat().st_mtime_ns
    assert toolchain.load_library(SOURCE, "abc").answer() == 42
    assert library.stat().st_mtime_ns == before


@pytest.mark.parametrize("harm", ["open folder", "open file", "link", "torn", "another"])
def test_what_others_could_have_written_is_not_loaded(cache: Path, harm: str, tmp_path: Path) -> None:
    toolchain.load_library(SOURCE, "abc")
    [library] = cache.glob("*.so")
    evil = tmp_path / "evil.so"
    text = SOURCE.replace("42", "666").replace("abc", "abd" if harm == "another" else "abc")
    subprocess.run(["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", evil], input=text.encode(), check=True)
    library.unlink()
    if harm == "link":
        library.symlink_to(evil)
    else:
        library.write_bytes(evil.read_bytes() if harm != "torn" else b"\x7fELF")
        library.chmod(0o722 if harm == "open file" else 0o700)
    if harm == "open folder":
        cache.chmod(0o777)
    assert toolchain.load_library(SOURCE, "abc").answer() == 42


def test_without_a_place_to_keep_it_it_is_built_all_the_same(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(file))
    assert toolchain.load_library(SOURCE, "abc").answer() == 42


def test_without_a_compiler_one_line_says_what_to_install() -> None:
    code = "import armkin; armkin.compile(armkin.load('robots/three_dof.yaml'))"
    environment = {**os.environ, "PATH": str(Path(sys.executable).parent), "CC": ""}
    completed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment, cwd=ROBOTS.parent
    )
    last = completed.stderr.strip().splitlines()[-1]
    assert last.startswith("armkin.errors.MissingExtraError: a C compiler is needed and none is installed: apt install")


def test_the_command_line_says_the_same_with_it(tmp_path: Path) -> None:
    from command_line import run

    rows = tmp_path / "rows.csv"
    rows.write_text("".join(f"{x},80,{300 + x / 7}\n" for x in range(150, 460, 10)))
    for words in (
        ["ik", "robots/three_dof.yaml", "--batch", str(rows), "--all-branches"],
        ["fk", "robots/three_dof.yaml", "--batch", str(rows), "--json"],
        ["workspace", "robots/three_dof.yaml", "--samples", "2000", "--json"],
    ):
        plain, compiled = run(*words), run(*words, "--compiled")
        assert compiled.code == plain.code
        numbers, fast = (
            [float(word) for word in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", re.sub('"seconds": [0-9.e-]+', "", text))]
            for text in (plain.out, compiled.out)
        )
        assert len(numbers) > 8
        np.testing.assert_allclose(fast, numbers, atol=1e-6)
    refused = run("ik", "robots/panda.yaml", "1", "2", "3", "0", "0", "0", "--sweep", "J1=1:2:3", "--compiled")
    assert refused.code == 2
    assert "every value would be another arm to compile" in refused.err


@pytest.mark.usefixtures("quickly")
def test_a_posture_on_its_limit_stays() -> None:
    """The exact answer for the rounded target is beyond the limit of joint 2; `near` solves it, too."""
    arm = armkin.load(ROBOTS / "kuka_kr6_r700.yaml")
    q = np.radians([0.0, 45.0, 0.0, 0.0, 90.0, 0.0])
    T = armkin.fk(arm, q)
    T[:3, 3] = np.round(T[:3, 3], 6)
    fast = armkin.compile(arm)
    for target in (T, np.stack([T] * 3)):
        solutions = fast.ik(target, near=q)
        assert_same(solutions, armkin.ik(arm, target, near=q))
        assert np.abs(solutions.q.reshape(-1, 8, 6)[0, np.ravel(solutions.best)[0]] - q).max() < 1e-12


@pytest.mark.parametrize("robot", ["three_dof", "puma560", "ur5e", "jaco_j2n6s300"])
def test_a_posture_that_solves_its_target_is_listed_to_the_bit(robot: str) -> None:
    """Beside singular postures, where the exact answer to a rounded target is elsewhere; alone and as a batch."""
    arm = armkin.load(ROBOTS / f"{robot}.yaml")
    fast = armkin.compile(arm)
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (24, arm.n))
    q[:, -2] = 10.0 ** np.linspace(-9, -2, 24)
    q = np.clip(q, arm.lower, arm.upper)
    task, _ = solver(arm, None)
    exact = targets_of(task, armkin.fk(arm, q), q)
    rounded = exact.copy()
    rounded[..., :3, -1] = np.round(exact[..., :3, -1], 7)
    for target in (exact, rounded):
        batch = fast.ik(target, near=q)
        np.testing.assert_array_equal(batch.q[np.arange(24), batch.best], q)
        for k in range(0, 24, 3):
            alone, slow = fast.ik(target[k], near=q[k]), armkin.ik(arm, target[k], near=q[k])
            np.testing.assert_array_equal(alone.q[alone.best], q[k])
            np.testing.assert_array_equal(slow.q[slow.best], q[k])
            all_near_one = fast.ik(target, near=q[k])
            np.testing.assert_array_equal(all_near_one.q[k, all_near_one.best[k]], q[k])


@pytest.mark.parametrize("robot", ["three_dof", "puma560", "jaco_j2n6s300"])
def test_results_keep_their_own_targets(robot: str) -> None:
    """A loop that writes the next targets into the same array changes nothing that has been answered."""
    arm = armkin.load(robot)
    fast = armkin.compile(arm)
    target, near = target_set(arm, "random", 3), np.random.default_rng(2).uniform(-1, 1, (3, arm.n))
    for goal, close in ((target, near), (target[0], near[0]), (target, near[0])):
        own_target, beside = goal.copy(), close.copy()
        solutions = fast.ik(own_target, near=beside)
        best = solutions.best
        own_target[...], beside[...] = 0.0, 2.0
        np.testing.assert_array_equal(solutions.target, goal)
        np.testing.assert_array_equal(solutions.near, np.broadcast_to(close, solutions.near.shape))
        np.testing.assert_array_equal(solutions.best, best)


@pytest.mark.parametrize("workers", [0, -1, 1.5, 2.0, "2", None, float("nan")])
def test_workers_are_a_whole_number_for_one_target_too(workers: object) -> None:
    arm = armkin.load("three_dof")
    fast = armkin.compile(arm)
    target = np.array([390.0, 80.0, 300.0])
    for solve in (armkin.ik, lambda _, goal, workers: fast.ik(goal, workers=workers)):
        for goal in (target, np.tile(target, (40_000, 1))):
            with pytest.raises(armkin.UsageError, match="thread"):
                solve(arm, goal, workers=workers)  # type: ignore[arg-type]


@pytest.mark.parametrize("robot", ["xarm6", "jaco_j2n6s300"])
def test_roots_that_solutions_share_are_taken_apart_in_c(
    robot: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    """The tool straight down: C left four of five of an xArm6's targets to Python, 464 to 853 us each."""
    arm = armkin.load(robot)
    rng = np.random.default_rng(6)
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (40, 1, 1))
    yaw = rng.uniform(-np.pi, np.pi, 40)
    T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = np.cos(yaw), np.sin(yaw), np.sin(yaw), -np.cos(yaw)
    T[:, :3, 3] = arm.reach * rng.uniform(-0.4, 0.4, (40, 3)) + [0, 0, 0.2 * arm.reach]
    if robot not in ELIMINATED:
        request.getfixturevalue("quickly")
    python = armkin.ik(arm, T)
    left = left_to_python(monkeypatch)
    solutions = armkin.compile(arm).ik(T)
    assert sum(left) <= 1
    assert python.valid.sum() > 100
    found_by_elimination(solutions, python)


@pytest.mark.usefixtures("quickly")
def test_an_arm_off_its_class_is_solved_in_c_and_named_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A calibrated UR5e: all of its targets were solved in Python, 0.2 ms each."""
    arm = arm_of_file(parse_robot_file((ROBOTS / "ur5e.yaml").read_text().replace("alpha: 0,", "alpha: 0.01,", 1)))
    target = target_set(arm, "random", 60)
    python, single = armkin.ik(arm, target), armkin.ik(arm, target[0])
    left = left_to_python(monkeypatch)
    solutions = armkin.compile(arm).ik(target)
    assert sum(left) <= 1
    assert solutions.method == "general elimination"
    assert "flip" in solutions.names[0]
    found_by_elimination(solutions, python)
    found_by_elimination(armkin.compile(arm).ik(target[0]), single)


@pytest.mark.usefixtures("quickly")
def test_targets_on_an_edge_are_eliminated_in_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """A calibrated UR5e with its wrist all but straight: Python eliminated such a target, and four around it, again."""
    arm = arm_of_file(parse_robot_file((ROBOTS / "ur5e.yaml").read_text().replace("alpha: 0,", "alpha: 0.01,", 1)))
    q = np.random.default_rng(8).uniform(-3, 3, (40, 6))
    low, high = q.copy(), q.copy()
    low[:, 4], high[:, 4] = -0.1, 0.1
    start = np.sign(np.linalg.det(armkin.jacobian(arm, low)))
    for _ in range(40):  # where the determinant vanishes
        q = (low + high) / 2
        below = np.sign(np.linalg.det(armkin.jacobian(arm, q))) == start
        low[below], high[~below] = q[below], q[~below]
    q[:, 4] += np.linspace(1e-5, 1e-4, 40)
    target = armkin.fk(arm, q)
    python, fast = armkin.ik(arm, target), armkin.compile(arm)
    solve, eliminated = method.solve, []

    def count_and_call(elimination: method.Elimination, T: np.ndarray, *more: Any) -> method.Branches:
        eliminated.append(len(T))
        return solve(elimination, T, *more)

    monkeypatch.setattr(method, "solve", count_and_call)
    left = left_to_python(monkeypatch)
    solutions = fast.ik(target)
    assert sum(left) > 5
    assert sum(eliminated) <= 2
    found_by_elimination(solutions, python)
