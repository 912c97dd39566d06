"""Clearances in C are those of Python: built by `armkin.compile`, and as `export --c` writes them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import armkin
from command_line import run

SCENE = """
clearance: 3
keep_out:
  - self
  - floor: -10
  - box: {min: [300, -300, -10], max: [700, 300, 150]}
  - box: {size: [300, 600, 120], xyz: [-350, 0, 60], rpy: [0, 10, 15]}
    name: a "box"
  - capsule: {from: [-400, -400, 0], to: [-400, -400, 900], radius: 50}
"""
MAIN = """
#include "arm.h"
#include <stdio.h>
int main(void)
{
    double q[3], mm;
    int pair;
    while (scanf("%lf %lf %lf", q, q + 1, q + 2) == 3) {
        const int free = three_dof_free(q, &mm, &pair);
        printf("%d %.17g %s\\n", free, mm, three_dof_pairs[pair][1]);
    }
    return three_dof_free(q, 0, 0) < 0;
}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.mark.usefixtures("optimised")
@pytest.mark.parametrize("robot", ["three_dof", "ur5e"])
def test_compiled_clearances_are_pythons(robot: str, scene: Path, request: pytest.FixtureRequest) -> None:
    if robot != "three_dof":
        request.getfixturevalue("quickly")
    arm = armkin.load(robot, scene=scene)
    q = np.random.default_rng(3).uniform(-3, 3, (3000, arm.n))
    fast, plain = armkin.compile(arm).clearance(q), armkin.clearance(arm, q)
    assert np.abs(fast.mm - plain.mm).max() < 1e-9
    assert (fast.other == plain.other).mean() > 0.99  # but for ties
    assert 0.2 < (plain.mm < 0).mean() < 0.9
    assert np.isnan(armkin.compile(arm).clearance(np.full(arm.n, np.nan)).mm)
    assert armkin.compile(armkin.load(robot)).clearance(q[0]).mm == np.inf


def test_exported_c_tells_whether_a_posture_is_free(scene: Path, tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    assert compiler is not None
    assert run("export", "three_dof", "--c", "--scene", scene, "-o", tmp_path / "arm.c").code == 0
    (tmp_path / "main.c").write_text(MAIN)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1"]
    words = [compiler, *flags, "main.c", "arm.c", "-lm", "-o", "free"]
    subprocess.run(words, cwd=tmp_path, check=True)
    arm = armkin.load("three_dof", scene=scene)
    q = np.random.default_rng(4).uniform(-2, 2, (200, 3))
    text = "".join(f"{a!r} {b!r} {c!r}\n" for a, b, c in q.tolist())
    output = subprocess.run([tmp_path / "free"], input=text, capture_output=True, text=True, check=True).stdout
    plain = armkin.clearance(arm, q)
    for line, mm, obstacle in zip(output.splitlines(), plain.mm.tolist(), plain.other.tolist(), strict=True):
        free, distance, name = line.split(" ", 2)
        assert abs(float(distance) - mm) < 1e-9
        assert (free == "1") == (mm >= 0)
        assert name == obstacle
    assert (
        "three_dof_free"
        not in (run("export", "three_dof", "--c", "-o", tmp_path / "b.c"), (tmp_path / "b.h"))[1].read_text()
    )
