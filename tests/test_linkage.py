"""docs/urdf.md's arms with a linkage: three joints, the level piece in joint 1's a and d, the forearm's motor a sum."""

import numpy as np
import pytest

import armkin
from armkin import robot_file
from armkin.model.build_arm import arm_of_file

LEVEL, DROP = 60.0, -40.0  # from the last joint to the tip, always level

TEXT = f"""
name: linkage
convention: standard
task: xyz
joints:
  - {{name: q1, dh: {{alpha: 90, a: {LEVEL}, d: {100 + DROP}}}}}
  - {{name: q2, dh: {{alpha: 0, a: 150, d: 0}}}}
  - {{name: q3, dh: {{alpha: 0, a: 160, d: 0}}}}
motors:
  - {{name: M1, axis: X, joints: {{q1: 1}}, full_steps: 200, microsteps: 16, gear: 5}}
  - {{name: M2, axis: Y, joints: {{q2: 1}}, full_steps: 200, microsteps: 16, gear: 5}}
  - {{name: M3, axis: Z, joints: {{q2: 1, q3: 1}}, full_steps: 200, microsteps: 16, gear: 5}}
"""


def test_a_level_tool_is_an_offset_of_joint_1() -> None:
    """Against the linkage by trigonometry: heights and distances of both bars, then the level piece."""
    arm = arm_of_file(robot_file.parse_robot_file(TEXT))
    for yaw, lift, bend in np.random.default_rng(1).uniform(-1, 1, (20, 3)):
        out = 150 * np.cos(lift) + 160 * np.cos(lift + bend) + LEVEL
        up = 100 + 150 * np.sin(lift) + 160 * np.sin(lift + bend) + DROP
        tip = armkin.fk(arm, [yaw, lift, bend])[:3, 3]
        assert tip == pytest.approx([out * np.cos(yaw), out * np.sin(yaw), up], abs=1e-9)


def test_the_forearms_motor_turns_the_sum() -> None:
    arm = arm_of_file(robot_file.parse_robot_file(TEXT))
    per_degree = 200 * 16 * 5 / 360
    pulses = armkin.pulses(arm, np.radians([10, 20, -30]))
    assert pulses.tolist() == [round(10 * per_degree), round(20 * per_degree), round(-10 * per_degree)]
