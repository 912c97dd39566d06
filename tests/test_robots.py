"""The shipped arms against poses that their sources, or others, print."""

import math
from pathlib import Path

import numpy as np
import pytest

from armkin import robot_file
from armkin.forward import fk, frames
from armkin.keep_out.load_with_scene import load
from urdf_chains import CHAINS, moving_joints, tip_pose

ROBOTS = Path(__file__).parents[1] / "robots"
UP = [0, 0, 0, 0, 0, 0]

# robot, joints [deg], tip [mm], tolerance [mm] (the digits that the source prints), source
POSES = [
    ("puma560", [0, 45, 180, 0, 45, 0], (596.3, -150.05, 657.48), 0.01, "RTB notebook kinematics, fkine(qn)"),
    (
        "puma560",
        np.degrees([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
        (247.8, -125.9, 1146),
        0.5,
        "RTB notebook icra2021",
    ),
    ("puma560", UP, (452.1, -150.05, 431.8 + 671.83), 0.001, "ssik puma560_ik T_HOME, plus the pedestal"),
    ("ur3e", UP, (-456.75, -223.15, 66.5), 0.001, "ssik ur3e_ik T_HOME, in the controller's base frame"),
    ("ur5e", UP, (-817.2, -232.9, 62.8), 0.001, "ssik ur5e_ik T_HOME, in the controller's base frame"),
    ("irb120", UP, (374, 0, 630), 0.001, "ssik irb120_ik T_HOME"),
    ("irb2400", UP, (940, 0, 1455), 0.001, "ros-industrial/abb irb2400_macro.xacro"),
    ("jaco_j2n6s300", UP, (0, 64.2619, 361.0789), 0.1, "ssik jaco2_ik T_HOME (another lineage of numbers)"),
    ("panda", [0] * 7, (88, 0, 926), 0.001, "ssik panda_ik T_HOME"),
    (
        "ar4",
        [-9.686, -8.991, 18.549, 7.965, 22.667, -6.458],
        (267.292, -43.402, 412.343),
        0.002,
        "Polymistis/ar4-hmi defaults.json",
    ),
    ("kuka_kr6_r700", UP, (785, 0, 435), 0.001, "25 + 315 + 365 + 80 and 400 + 35 mm, level: the drawing's lengths"),
    ("xarm6", UP, (207, 0, 112), 0.001, "the controller's zero position, 207 0 112 180 0 0"),
    ("wx250s", UP, (458.325 - 50.575, 0, 360.65), 0.001, "Interbotix, M of wx250s, less 23 + 27.575 mm of fingers"),
    ("mycobot_280", UP, (45.6, -64.62, 131.56 + 110.4 + 96 + 73.18), 0.001, "the URDF's lengths, upright"),
    ("fanuc_crx10ia", UP, (540 + 160, -150, 245 + 540), 0.001, "fanuc_description: mx_2, my_1, mz_3"),
    ("kinova_gen3", [0] * 7, (0, -24.8501, 1187.385), 0.001, "the URDF's lengths, upright"),
    (
        "kinova_gen3",
        [0, 15, 180, -130, 0, 55, 90],
        (456.6, 1.3, 433.7),
        0.1,
        "the maker's Home: 0.4566 0.0013 0.4337 m",
    ),
    ("iiwa7", [0] * 7, (0, 0, 1266), 0.001, "ssik iiwa7_ik T_HOME"),
    (
        "niryo_ned2",
        UP,
        (170 + 19.7 + 65 + 12 + 21.5, 0.038, 101.3 + 65 + 221 + 32.5 + 9.25),
        0.001,
        "the URDF's lengths",
    ),
    (
        "so101",
        [0] * 5,
        (391.36147, -0.00921, 226.46971),
        0.005,
        "so101_new_calib.urdf at zero, by pinocchio or yourdfpy",
    ),
    (
        "roarm_m2",
        [0, 0, 90],
        (310.15, 0, 235.09 + 126.06),
        0.001,
        "RoArm-M2_config.h: goalX = L3A + L2B, z = L2A - L3B",
    ),
    (
        "ur10e",
        UP,
        (-1184.25, -290.7, 60.85),
        0.001,
        "a screw model's M, turned by 180 about z into the controller's base",
    ),
    ("cobra600", [0] * 4, (600, 0, 387), 0.001, "325 + 275 mm stretched"),
    ("thor", UP, (0, 0, 569.5), 0.001, "99 + 103 + 160 + 89.5 + 104.5 + 13.5 mm upright, from the URDF"),
]


@pytest.mark.parametrize(("name", "joints", "tip", "tolerance", "source"), POSES)
def test_printed_pose(name: str, joints: list[float], tip: tuple[float, ...], tolerance: float, source: str) -> None:
    arm = load(ROBOTS / f"{name}.yaml")
    assert fk(arm, np.radians(joints))[:3, 3] == pytest.approx(tip, abs=tolerance), source


@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_arm_says_what_it_was_compared_with(path: Path) -> None:
    assert robot_file.read_robot_file(path).compared


def test_makers_reaches() -> None:
    """Data sheets' figures, which no URDF states: KR 6 R700 706.7 mm, CRX-10iA 1249 mm, iiwa 7 800 mm."""
    kuka = load("kuka_kr6_r700")
    level = [0, 0, math.atan2(35, 365), 0, 0, 0]  # the wrist's centre at the height of the elbow
    wrist = frames(kuka, level)[5, :3, 3]
    assert math.hypot(wrist[0], wrist[1]) == pytest.approx(706.7, abs=0.05)
    crx = fk(load("fanuc_crx10ia"), np.radians([0, 90, 90, 0, 0, 0]))[:3, 3]
    assert math.hypot(crx[0], crx[1]) == pytest.approx(1249, abs=0.5)
    iiwa = frames(load("iiwa7"), np.zeros(7))
    assert np.linalg.norm(iiwa[6, :3, 3] - iiwa[2, :3, 3]) == pytest.approx(800)


@pytest.mark.parametrize(
    "name", sorted(set(CHAINS) & {path.stem for path in ROBOTS.glob("*.yaml")} - {"panda", "irb120", "roarm_m2"})
)
def test_a_shipped_arm_is_its_source_s_urdf(name: str) -> None:
    """The robot file against the URDF's chain as numbers, walked by tests/helpers/urdf_chains.py: to 0.01 mm."""
    chain, arm = CHAINS[name], load(name)
    joints = [joint["name"] for joint in moving_joints(chain) if joint["type"] != "fixed"]
    for q in np.random.default_rng(3).uniform(-3, 3, (20, arm.n)):
        assert fk(arm, q)[:3, 3] == pytest.approx(
            1000 * tip_pose(chain, dict(zip(joints, q, strict=True)))[:3, 3], abs=0.02
        )


def test_stanford_reaches_along_its_boom() -> None:
    """412 + 263 mm and the boom's own length straight up, 154 mm aside: the table's lengths added by hand."""
    q = np.array([0, 0, 400.0, 0, 0, 0])
    assert fk(load(ROBOTS / "stanford.yaml"), q)[:3, 3] == pytest.approx((0, 154, 1075), abs=1e-9)


def test_parol6_flange_and_tool_are_the_older_table() -> None:
    """PAROL6_ROBOT.py of commit ce377ab has a6 = -45.25, d6 = -62.8 where we have the flange and a tool."""
    arm = load(ROBOTS / "parol6.yaml")
    q = np.radians([10, -80, 170, 20, 30, 40])
    rows = [  # alpha, a, d
        *((-90, 23.42, 110.5), (180, 180, 0), (90, -43.5, 0)),
        *((-90, 0, -176.35), (90, 0, 0), (180, -45.25, -62.8)),
    ]
    T = np.eye(4)
    for angle, (alpha, a, d) in zip(q, rows, strict=True):
        c, s, ca, sa = (
            math.cos(angle),
            math.sin(angle),
            math.cos(math.radians(alpha)),
            math.sin(math.radians(alpha)),
        )
        T = T @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
    assert np.abs(fk(arm, q) - T).max() < 1e-9


def test_step_chains_give_the_steps_that_the_sources_print() -> None:
    printed = {
        "ar4": [88.888, 111.111, 111.111, 99.555, 43.720, 44.444],
        "parol6": [113.777778, 355.555556, 321.693122, 71.111111, 71.111111, 177.777778],
        "moveo": [32800 / 360, 18000 / 360, 72000 / 360, 3280 / 360, 14400 / 360],
    }
    for name, steps_per_degree in printed.items():
        motors = robot_file.read_robot_file(ROBOTS / f"{name}.yaml").motor_list()
        assert [motor.pulses_per_unit() for motor in motors] == pytest.approx(steps_per_degree, abs=1e-3), name


def test_screws_shed_the_rounding_of_a_printed_table(tmp_path: Path) -> None:
    """An axis printed as (0.7071, 0.7071, 0) is still one: the arm turns about it and keeps its shape."""
    text = """
name: rounded
convention: screws
zero_pose: {xyz: [300, 0, 115]}
joints:
  - {name: q1, screw: {w: [0.7071, 0.7071, 0], v: [0, 0, 10]}}
  - {name: q2, screw: {w: [0, 0.7071, 0.7071], q: [0, 0, 115]}}
  - {name: q3, type: prismatic, screw: {w: [0, 0, 0], v: [0.577, 0.577, 0.577]}}
"""
    path = tmp_path / "rounded.yaml"
    path.write_text(text, encoding="utf-8")
    arm, q = load(path), [1.3, 0.4, 20.0]
    expected = np.eye(4)
    assert arm.file is not None
    for joint, value in zip(arm.file.joints, q, strict=True):
        w, v = joint.twist()
        expected = expected @ screw_exponential(np.array(w), np.array(v), value)
    expected = expected @ [[1, 0, 0, 300], [0, 1, 0, 0], [0, 0, 1, 115], [0, 0, 0, 1]]
    assert fk(arm, q) == pytest.approx(expected, abs=1e-11)


def screw_exponential(w: np.ndarray, v: np.ndarray, value: float) -> np.ndarray:
    """exp([S] q), Lynch & Park, Modern Robotics, eq. 3.88."""
    W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    s, c = math.sin(value), math.cos(value)
    T = np.eye(4)
    T[:3, :3] = np.eye(3) + s * W + (1 - c) * W @ W
    T[:3, 3] = (value * np.eye(3) + (1 - c) * W + (value - s) * W @ W) @ v
    return T
