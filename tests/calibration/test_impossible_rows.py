"""Rows that cannot be right are refused by name; a frame that stands anywhere is none of these."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from built_arms import build_real_arm, measure_tips, random_commands

import armkin
from armkin.errors import UsageError
from command_line import run


def bad_rows(how: str) -> tuple[np.ndarray, np.ndarray]:
    arm = armkin.load("ar4")
    rng = np.random.default_rng(10)
    c = random_commands(arm, 40, rng)
    if how == "still":
        c[:, 2] = 0.3
    if how == "in step":
        c = np.linspace(-0.5, 0.5, 40)[:, None] * np.arange(1, 7)
    if how == "line":
        c = np.zeros((40, 6))
        c[:, 3:] = rng.uniform(-1, 1, (40, 3))
        c[:, :3] = rng.uniform(-1e-2, 1e-2, (40, 3))
    x = measure_tips(build_real_arm(arm, 10), c, rng)
    if how == "line":
        x = x[0] + np.linspace(0, 100, 40)[:, None] * [1.0, 2.0, 0.5] + rng.normal(size=(40, 3)) * 0.1
    return {
        "radians": (np.radians(c), x),
        "degrees": (np.degrees(c), x),
        "metres": (c, x / 1000),
        "inches": (c, x / 25.4),
        "columns": (c, x[:, [1, 0, 2]]),
        "turned columns": (c, x[:, [1, 2, 0]]),
        "joints": (c[:, [0, 2, 1, 3, 4, 5]], x),
        "sign": (c * [1, -1, 1, 1, 1, 1], x),
        "mirror": (c, x * [1, -1, 1]),
        "another arm": (c, rng.uniform(-300, 300, (40, 3))),
        "few": (c[:3], x[:3]),
    }.get(how, (c, x))


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("still", "J3 never moves in the rows"),
        ("in step", "all joints move in step"),
        ("line", "the measured points lie on a line"),
        ("radians", "the joint values look like radians"),
        ("degrees", "the joint values look like degrees"),
        ("metres", "the measured points look like metres"),
        ("inches", "the measured points look like inches"),
        ("columns", "columns y x z of the measured points look like x y z"),
        ("turned columns", "columns z x y of the measured points look like x y z"),
        ("joints", "the columns of J2 and J3 look swapped"),
        ("sign", "J2 looks commanded with the other sign"),
        ("mirror", "the measured y looks negative"),
        ("another arm", "the rows do not fit this arm"),
        ("few", "3 rows are too few"),
    ],
)
def test_rows_that_cannot_be_right_are_named(how: str, says: str, tmp_path: Path) -> None:
    c, x = bad_rows(how)
    with pytest.raises(UsageError, match=says):
        armkin.calibrate(armkin.load("ar4"), c, x)
    csv, corrected = tmp_path / "rows.csv", tmp_path / "new.yaml"
    np.savetxt(csv, np.concatenate([np.degrees(c), x], axis=1), delimiter=",")
    completed = run("calibrate", "ar4", csv, "--out", corrected)
    assert completed.code == 2
    assert completed.out == ""
    assert not corrected.exists()


def test_a_measuring_frame_may_stand_anywhere() -> None:
    """A frame half a turn and a metre away is a base, not a mistake."""
    arm = armkin.load("ar4")
    rng = np.random.default_rng(11)
    c = random_commands(arm, 40, rng)
    away = armkin.fk(arm, c)[:, :3, 3] @ np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 1]]) + [1000, 0, 0]
    calibration = armkin.calibrate(arm, c, away + rng.normal(size=(40, 3)) * 0.1)
    assert np.median(calibration.after) < 0.4
