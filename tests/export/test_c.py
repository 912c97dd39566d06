"""`armkin export --c`: what is generated compiles everywhere without a warning, and says what Python says."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exported import agreement

import armkin
from armkin.export.c.program import identifier, program
from command_line import run as run_armkin

ROBOTS = Path(__file__).parents[2] / "robots"
WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
SANITIZERS = ["-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
CLOSED = ["three_dof", "puma560", "ur5e", "labvolt_5150", "cobra600", "stanford"]
GENERAL = ["jaco_j2n6s300", "moveo"]


def written(folder: Path, robot: str, single: bool = False) -> Path:
    """The generated files of a shipped robot; the path of the source."""
    texts = program(armkin.load(ROBOTS / f"{robot}.yaml"), f"{robot}.c", None, single)
    (folder / f"{robot}.c").write_text(texts.source)
    (folder / f"{robot}.h").write_text(texts.header)
    (folder / f"{robot}_test.c").write_text(texts.test)
    return folder / f"{robot}.c"


def run(*command: str | Path, folder: Path) -> str:
    done = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert not done.stderr
    return done.stdout


@pytest.mark.parametrize("robot", [*CLOSED, *GENERAL])
def test_the_test_program_passes_under_the_sanitizers(robot: str, tmp_path: Path) -> None:
    source = written(tmp_path, robot)
    run("gcc", *WARNINGS, *SANITIZERS, source, f"{robot}_test.c", "-lm", "-o", "test", folder=tmp_path)
    assert run("./test", folder=tmp_path) == "8 postures, 0 failed\n"


@pytest.mark.parametrize("robot", ["three_dof", "puma560", "labvolt_5150"])
def test_single_precision_passes_its_test_program_too(robot: str, tmp_path: Path) -> None:
    source = written(tmp_path, robot, single=True)
    run("gcc", *WARNINGS, *SANITIZERS, source, f"{robot}_test.c", "-lm", "-o", "test", folder=tmp_path)
    assert run("./test", folder=tmp_path) == "8 postures, 0 failed\n"


def test_a_wrong_number_fails_the_test_program(tmp_path: Path) -> None:
    source = written(tmp_path, "three_dof")
    source.write_text(source.read_text().replace("170.0", "171.0"))
    run("gcc", *WARNINGS, source, "three_dof_test.c", "-lm", "-o", "test", folder=tmp_path)
    done = subprocess.run(["./test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 8
    assert "not what armkin says" in done.stdout


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
    assert shutil.which(compiler[0]), f"{compiler[0]} is not installed: see the README's line of system packages"
    single = "gcc" in compiler[0] and robot not in GENERAL
    if robot in GENERAL and compiler[0] == "avr-gcc":
        with pytest.raises(armkin.UsageError, match="needs double precision"):
            program(armkin.load(ROBOTS / f"{robot}.yaml"), "arm.c", None, single=True)
        return
    source = written(tmp_path, robot, single)
    if "c++" in compiler:  # a header for programs in C++
        use = f"{identifier(robot)}_real q[{identifier(robot).upper()}_JOINTS], T[16];"
        use += f"int main() {{ {identifier(robot)}_fk(q, T); return 0; }}"
        (tmp_path / "use.cpp").write_text(f'#include "{robot}.h"\n{use}\n')
        run(*compiler, "-Wall", "-Wextra", "-Werror", "use.cpp", folder=tmp_path)
        return
    # on an AVR double has 32 bits, and its libm functions of float are those of double
    warnings = [flag for flag in WARNINGS if compiler[0] != "avr-gcc" or flag != "-Wdouble-promotion"]
    run(*compiler, *warnings, "-Os", "-c", source, "-o", "arm.o", folder=tmp_path)


def test_the_files_say_what_they_were_made_from() -> None:
    arm = armkin.load(ROBOTS / "puma560.yaml")
    for text in program(arm, "puma.c"):
        for said in (arm.name, arm.sha256, f"armkin {armkin.__version__}", "Task pose; spherical wrist"):
            assert said in text


@pytest.mark.parametrize(
    ("robot", "count"), [("three_dof", 4000), ("puma560", 2000), ("stanford", 1000), ("jaco_j2n6s300", 400)]
)
def test_it_says_what_python_says(robot: str, count: int, tmp_path: Path) -> None:
    told = agreement(armkin.load(ROBOTS / f"{robot}.yaml"), tmp_path, count)
    assert told.different == []
    assert told.edges <= 0.01 * count
    assert told.largest_fk < 1e-14
    assert told.largest < 1e-8


def test_a_calibrated_arm_takes_and_gives_commanded_values(tmp_path: Path) -> None:
    arm = replace(armkin.load(ROBOTS / "three_dof.yaml"), ratio=np.array([1.01, 0.99, 1.002]))
    assert agreement(arm, tmp_path, 500).different == []


def test_the_command_writes_three_files(tmp_path: Path) -> None:
    done = run_armkin("export", "robots/three_dof.yaml", "--c", "--float", "--out", tmp_path / "arm.c")
    assert done.code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm.c", "arm.h", "arm_test.c"]
    assert "typedef float three_dof_real;" in (tmp_path / "arm.h").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["three_dof.yaml", "--c"], "name the source, for example -o arm.c"),
        (["three_dof.yaml", "--c", "--out", "arm.txt"], "name the source, for example -o arm.c"),
        (["three_dof.yaml", "--float", "--dh"], "--float goes with --c alone"),
        (["jaco_j2n6s300.yaml", "--c", "--float", "--out", "arm.c"], "leave --float away"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_words(words: list[str], said: str) -> None:
    done = run_armkin("export", f"robots/{words[0]}", *words[1:])
    assert done.code == 2
    assert said in done.err
    assert not done.out
