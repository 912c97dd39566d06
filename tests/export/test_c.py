"""`armkin export --c`: what is generated compiles everywhere without a warning, and says what Python says."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exported_c import Exported, compare_answers, random_postures, texts_of

import armkin
import right_angles
from armkin.export.c.c_program import identifier, program
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of
from armkin.model.build_arm import arm_of_file
from armkin.model.rotation import rotation_about
from armkin.robot_file import parse_robot_file
from command_line import run as run_armkin

ROBOTS = Path(__file__).parents[2] / "robots"
WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
SANITIZERS = ["-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
CLOSED = ["three_dof", "puma560", "ur5e", "labvolt_5150", "cobra600", "stanford"]
GENERAL = ["jaco_j2n6s300", "moveo"]


def write_sources(folder: Path, robot: str, single: bool = False) -> Path:
    """The generated files of a shipped robot; the path of the source."""
    texts = texts_of(armkin.load(ROBOTS / f"{robot}.yaml"), f"{robot}.c", None, single)
    (folder / f"{robot}.c").write_text(texts.source)
    (folder / f"{robot}.h").write_text(texts.header)
    (folder / f"{robot}_test.c").write_text(texts.test)
    return folder / f"{robot}.c"


def run_command(*command: str | Path, folder: Path) -> str:
    completed = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stdout[-2000:] + completed.stderr[-4000:]
    assert not completed.stderr
    return completed.stdout


@pytest.mark.parametrize("robot", [*CLOSED, *GENERAL, "panda", "kinova_gen3"])
def test_the_test_program_passes_under_the_sanitizers(robot: str, tmp_path: Path) -> None:
    source = write_sources(tmp_path, robot)
    run_command("gcc", *WARNINGS, *SANITIZERS, source, f"{robot}_test.c", "-lm", "-o", "test", folder=tmp_path)
    assert run_command("./test", folder=tmp_path) == "8 postures, 0 failed\n"


@pytest.mark.parametrize("robot", ["three_dof", "puma560", "labvolt_5150"])
def test_single_precision_passes_its_test_program_too(robot: str, tmp_path: Path) -> None:
    source = write_sources(tmp_path, robot, single=True)
    run_command("gcc", *WARNINGS, *SANITIZERS, source, f"{robot}_test.c", "-lm", "-o", "test", folder=tmp_path)
    assert run_command("./test", folder=tmp_path) == "8 postures, 0 failed\n"


@pytest.mark.parametrize(("robot", "count"), [("iiwa7", 60), ("kinova_gen3", 5)])
def test_of_seven_joints_the_redundant_one_is_held_where_near_has_it(robot: str, count: int, tmp_path: Path) -> None:
    """kinova_gen3, whose others have no closed form, had no export."""
    arm = armkin.load(robot)
    exported = Exported(arm, tmp_path)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    rng = np.random.default_rng(4)
    for q, near in zip(rng.uniform(low, high, (count, 7)), rng.uniform(low, high, (count, 7)), strict=True):
        near[6] = q[6] if near[0] > 0 else near[6]
        target = armkin.fk(arm, q)
        count, edge, branches, _ = exported.ik(target, near)
        held = {"J7": float(near[6])}
        s = armkin.ik(armkin.lock(arm, held), target, near=near[:6])
        python = armkin.unlock(arm, held, s.q[s.valid])
        if not edge:
            assert count == len(python)
        if not edge and count:
            assert np.abs(branches[:, None] - python[None]).max(axis=2).min(axis=1).max(initial=0.0) < 1e-7


def test_a_wrong_number_fails_the_test_program(tmp_path: Path) -> None:
    source = write_sources(tmp_path, "three_dof")
    source.write_text(source.read_text().replace("170.0", "171.0"))
    run_command("gcc", *WARNINGS, source, "three_dof_test.c", "-lm", "-o", "test", folder=tmp_path)
    completed = subprocess.run(["./test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert completed.returncode == 8
    assert "not what armkin says" in completed.stdout


@pytest.mark.parametrize("robot", ["three_dof", "ur5e", "jaco_j2n6s300"])
@pytest.mark.parametrize(
    "compiler",
    [
        ["clang"],
        ["clang", "-x", "c++", "-fsyntax-only"],
        ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard"],
        ["avr-gcc", "-mmcu=atmega328p"],
    ],
    ids=lambda words: " ".join(words[:3]),
)
def test_it_compiles_without_a_warning(robot: str, compiler: list[str], tmp_path: Path) -> None:
    assert shutil.which(compiler[0]), f"{compiler[0]} is not installed: scripts/test installs it"
    single = "gcc" in compiler[0] and robot not in GENERAL
    if robot in GENERAL and compiler[0] == "avr-gcc":
        with pytest.raises(armkin.UsageError, match="needs double precision"):
            program(armkin.load(ROBOTS / f"{robot}.yaml"), "arm.c", None, single=True)
        return
    source = write_sources(tmp_path, robot, single)
    if "c++" in compiler:  # a header for programs in C++
        use = f"{identifier(robot)}_real q[{identifier(robot).upper()}_JOINTS], T[16];"
        use += f"int main() {{ {identifier(robot)}_fk(q, T); return 0; }}"
        (tmp_path / "use.cpp").write_text(f'#include "{robot}.h"\n{use}\n')
        run_command(*compiler, "-Wall", "-Wextra", "-Werror", "use.cpp", folder=tmp_path)
        return
    # on an AVR double has 32 bits, and its libm functions of float are those of double
    warnings = [flag for flag in WARNINGS if compiler[0] != "avr-gcc" or flag != "-Wdouble-promotion"]
    optimised = "-O0" if compiler[0] == "clang" else "-Os"  # gcc warns of what it finds while it optimises
    run_command(*compiler, *warnings, optimised, "-c", source, "-o", "arm.o", folder=tmp_path)


def test_the_files_say_what_they_were_made_from() -> None:
    arm = armkin.load(ROBOTS / "puma560.yaml")
    for text in program(arm, "puma.c"):
        for word in (arm.name, arm.sha256, f"armkin {armkin.__version__}", "Task pose; spherical wrist"):
            assert word in text


@pytest.mark.parametrize(
    ("robot", "count"), [("three_dof", 4000), ("puma560", 2000), ("stanford", 1000), ("jaco_j2n6s300", 400)]
)
def test_it_says_what_python_says(robot: str, count: int, tmp_path: Path) -> None:
    compared = compare_answers(armkin.load(ROBOTS / f"{robot}.yaml"), tmp_path, count)
    assert compared.different == []
    assert compared.edges <= 0.01 * count
    assert compared.largest_fk < 1e-14
    assert compared.largest < 1e-8


def test_a_calibrated_arm_takes_and_gives_commanded_values(tmp_path: Path) -> None:
    arm = replace(armkin.load(ROBOTS / "three_dof.yaml"), ratio=np.array([1.01, 0.99, 1.002]))
    assert compare_answers(arm, tmp_path, 500).different == []


def test_the_command_writes_three_files(tmp_path: Path) -> None:
    completed = run_armkin("export", "robots/three_dof.yaml", "--c", "--float", "--out", tmp_path / "arm.c")
    assert completed.code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm.c", "arm.h", "arm_test.c"]
    assert "typedef float three_dof_real;" in (tmp_path / "arm.h").read_text()


@pytest.mark.parametrize("name", ["arm_ik", "arm_real", "an arm", "Größe", "int", "@stem@"])
def test_the_source_may_have_any_name(name: str, tmp_path: Path) -> None:
    completed = run_armkin("export", "three_dof", "--c", "--out", tmp_path / f"{name}.c")
    assert completed.code == 0
    run_command("gcc", *WARNINGS, f"{name}.c", f"{name}_test.c", "-lm", "-o", "test", folder=tmp_path)
    assert run_command("./test", folder=tmp_path) == "8 postures, 0 failed\n"


def test_words_of_a_robot_file_stay_within_their_comment(tmp_path: Path) -> None:
    arm = replace(armkin.load("three_dof"), name="a */ b /* ???/ @real@", path="arm_ik/x*/y.yaml")
    assert (
        run_test_program(tmp_path, replace(arm, joint_names=("*/ int x = ;", "/*/*", "q3"))) == "8 postures, 0 failed\n"
    )
    assert "from arm_ik/x* /y.yaml" in (tmp_path / "arm.h").read_text()


@pytest.mark.parametrize("name", ["arm.c", "arm.h", "arm_test.c"])
def test_a_file_that_cannot_be_written_leaves_the_others_as_they_were(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    completed = run_armkin("export", "three_dof", "--c", "--out", tmp_path / "arm.c")
    assert completed.code == 1
    assert f"{name}: cannot write: Is a directory" in completed.err
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_header_that_cannot_be_included_is_refused(tmp_path: Path) -> None:
    completed = run_armkin("export", "three_dof", "--c", "--out", tmp_path / 'a"b.c')
    assert completed.code == 2
    assert "#include cannot name a header with a quote" in completed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("robot", ["puma560", "jaco_j2n6s300", "labvolt_5150", "three_dof"])
def test_a_target_that_is_not_finite_is_none(robot: str, tmp_path: Path) -> None:
    arm = armkin.load(robot)
    code, (task, _) = Exported(arm, tmp_path), solver(arm, None)
    target = targets_of(task, armkin.fk(arm, arm.home[None]), arm.home[None]).ravel()
    for place in (3, 7, 11, 0, 5) if len(target) == 16 else range(len(target)):
        for wrong in (np.nan, np.inf, -np.inf, 1e200, 1e16):
            spoilt = target.copy()
            spoilt[place] = wrong
            assert code.ik(spoilt, arm.home)[0] == -1, (place, wrong)


STANDING = ["ur5e", "puma560", "wx250s", "labvolt_5150", "stanford", "three_dof"]


@pytest.mark.parametrize(
    ("robot", "single"),
    [(robot, single) for single in (False, True) for robot in STANDING] + [("jaco_j2n6s300", False)],
)
def test_an_arm_that_stands_at_its_target_stays(robot: str, single: bool, tmp_path: Path) -> None:
    """Also at compound singularities, and where the exact answer to a rounded target is elsewhere."""
    arm = armkin.load(robot)
    code, (task, geometry), rng = Exported(arm, tmp_path, single), solver(arm, None), np.random.default_rng(8)
    count = 500 if geometry.pairs is not None else 40
    q = random_postures(arm, count)
    q = np.where(rng.random(q.shape) < 0.6, np.pi / 4 * rng.integers(-4, 5, q.shape), q)
    q[: count // 2, -2] = 10.0 ** rng.uniform(-9, -2, count // 2)  # beside the wrist's singularity
    q = np.clip(np.where(arm.prismatic, random_postures(arm, count), q), arm.lower, arm.upper)
    q = q.astype(np.float32).astype(float) if single else q
    for near, target in zip(q, targets_of(task, armkin.fk(arm, q), q), strict=True):
        if not single and task.orientation == "full":
            target[:3, 3] = np.round(target[:3, 3], 7)
        found, _, branches, best = code.ik(target, near)
        assert found > 0
        np.testing.assert_array_equal(branches[best], near.astype(branches.dtype))


def test_a_calibrated_arm_that_stands_at_its_target_stays(tmp_path: Path) -> None:
    """Both of three_dof's elbows are in line; `near` is of commanded values."""
    arm = replace(armkin.load("three_dof"), ratio=np.array([1.01, 0.99, 1.002]))
    code = Exported(arm, tmp_path)
    for near in ([0.3, 0.5, 0.0], [0.3, 1.2, -1.0], [-1.0, 1.5, 1e-9]):
        _, _, branches, best = code.ik(armkin.fk(arm, near)[:3, 3], np.array(near))
        np.testing.assert_array_equal(branches[best], near)


@pytest.mark.parametrize("robot", ["ur5e", "puma560", "jaco_j2n6s300"])
def test_an_arm_asked_for_its_own_pose_in_few_digits_stays(robot: str, tmp_path: Path) -> None:
    """Wrists in line, every second of which moved a joint by up to 180 degrees."""
    arm = armkin.load(robot)
    code, q = Exported(arm, tmp_path), np.clip(random_postures(arm, 60), arm.lower, arm.upper)
    q[:, 4] = 0.0
    if robot == "puma560":  # by right angles alone, where the position shows the rounding
        q[0], q[4], q[8] = np.radians(right_angles.POSTURES[robot])
    q = np.clip(q, arm.lower, arm.upper)
    for k, (near, T) in enumerate(zip(q, armkin.fk(arm, q), strict=True)):
        rounded = [np.round(T, 6), np.round(T, 8), T.astype(np.float32).astype(float)][k % 3]
        _, _, branches, best = code.ik(rounded, near)
        np.testing.assert_array_equal(branches[best], near)


@pytest.mark.parametrize("robot", ["ur5e", "ur10e"])
def test_a_free_joint_that_cannot_stay_at_near_is_asked_elsewhere(robot: str, tmp_path: Path) -> None:
    """Joint 5 at zero: joints 2, 3, 4 and 6 turn about parallel axes; few values of joint 6 leave the rest in reach."""
    arm = armkin.load(robot)
    code, (task, _) = Exported(arm, tmp_path), solver(arm, None)
    q = random_postures(arm, 400)
    q[:, 2:4] *= 0.2  # all but stretched
    q[:, 4] = 0.0
    for target in targets_of(task, armkin.fk(arm, q), q):
        count, edge, branches, _ = code.ik(target, arm.home)
        assert edge
        assert count > 0
        np.testing.assert_allclose(armkin.fk(arm, branches), np.broadcast_to(target, (count, 4, 4)), atol=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["three_dof.yaml", "--c"], "name the source, for example -o arm.c"),
        (["three_dof.yaml", "--c", "--out", "arm.txt"], "name the source, for example -o arm.c"),
        (["three_dof.yaml", "--float", "--dh"], "--float goes with --c alone"),
        (["jaco_j2n6s300.yaml", "--c", "--float", "--out", "arm.c"], "leave --float away"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_words(words: list[str], message: str) -> None:
    completed = run_armkin("export", f"robots/{words[0]}", *words[1:])
    assert completed.code == 2
    assert message in completed.err
    assert not completed.out


def run_test_program(folder: Path, arm: armkin.Arm, single: bool = False) -> str:
    """What the test program of an arm says."""
    texts = program(arm, "arm.c", single=single)
    for name, text in (("arm.c", texts.source), ("arm.h", texts.header), ("arm_test.c", texts.test)):
        (folder / name).write_text(text)
    run_command("gcc", *WARNINGS, "arm.c", "arm_test.c", "-lm", "-o", "test", folder=folder)
    return run_command("./test", folder=folder)


def test_the_test_program_of_a_calibrated_arm_passes(tmp_path: Path) -> None:
    arm = replace(armkin.load("three_dof"), ratio=np.array([1.01, 0.99, 1.002]))
    assert run_test_program(tmp_path, arm) == "8 postures, 0 failed\n"


def test_an_arm_a_little_off_its_class_is_written_with_numbered_branches(tmp_path: Path) -> None:
    """A calibrated AR4: its wrist's axes miss each other by some tenths of a millimetre."""
    text = (ROBOTS / "ar4.yaml").read_text()
    arm = arm_of_file(parse_robot_file(text.replace("a: 0,", "a: 0.3,").replace("alpha: 90,", "alpha: 90.2,")))
    assert "named after that class" in solver(arm, None)[1].why
    assert run_test_program(tmp_path, arm) == "8 postures, 0 failed\n"
    assert '"branch 1"' in (tmp_path / "arm.c").read_text()
    compared = compare_answers(arm, tmp_path, 100)
    assert compared.different == []
    assert compared.largest < 1e-8


CROOKED = [(70, 20, 100), (30, 200, 10), (-50, 150, 20), (80, 50, 60), (40, 10, 80), (0, 10, 80)]


def crooked_arm(count: int, slides: tuple[int, ...] = (), task: str = "") -> armkin.Arm:
    """An arm of no class, of so many joints."""
    rows = [
        f"  - {{name: j{k}, {'type: prismatic, limits: [0, 500], ' if k in slides else ''}"
        f"dh: {{alpha: {alpha}, a: {a}, d: {d}}}}}"
        for k, (alpha, a, d) in enumerate(CROOKED[:count])
    ]
    return arm_of_file(parse_robot_file("\n".join(["name: crooked", "convention: standard", task, "joints:", *rows])))


def test_five_joints_and_the_tool_s_axis_have_a_form(tmp_path: Path) -> None:
    """None of its postures is far from singular: those farthest from it are taken."""
    assert run_test_program(tmp_path, crooked_arm(5)) == "8 postures, 0 failed\n"


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("robot", ["three_dof", "labvolt_5150", "cobra600"])
def test_arms_off_their_class_have_a_form(robot: str, single: bool, tmp_path: Path) -> None:
    """Seeds and Newton steps are straight-line code, too."""
    arm = armkin.load(robot)
    link = arm.link.copy()
    for k in range(1, arm.n):
        link[k, :3, 3] += 0.1
        link[k, :3, :3] = link[k, :3, :3] @ rotation_about(0, 2e-4 * (-1) ** k) @ rotation_about(1, 1e-4)
    arm = replace(arm, link=link)
    assert armkin.method(arm)[0].startswith("near ")
    assert run_test_program(tmp_path, arm, single=single).endswith(", 0 failed\n")


@pytest.mark.parametrize(
    ("arm", "why"),
    [
        (
            lambda: crooked_arm(4, task="task: pose"),
            "4 joints for a full pose are searched among the branches of a longer",
        ),
        (
            lambda: crooked_arm(6, slides=(0, 2, 4)),
            "three of its joints are slides; task pose is solved in Python alone",
        ),
    ],
)
def test_classes_without_a_form_say_why(arm: Callable[[], armkin.Arm], why: str) -> None:
    with pytest.raises(armkin.UsageError, match=f"has no form in C: .*{why}"):
        program(arm(), "arm.c")
