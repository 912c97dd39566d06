"""Every number of the five published documents, through the API and through the command line's JSON.

Where a document contradicts itself the value that agrees with its own other results stands here, and
the erratum beside it. Tolerances are half a unit of the last digit given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import armkin
from command_line import ROOT, run

Solve = Callable[..., list[dict[str, Any]]]


@pytest.fixture(params=["api", "cli"])
def how(request: pytest.FixtureRequest) -> str:
    """By which of the two ways a number is asked for."""
    return str(request.param)


def load_robot(robot: str) -> armkin.Arm:
    return armkin.load(ROOT / f"robots/{robot}.yaml")


def tip_position(how: str, robot: str, q: Sequence[float]) -> list[float]:
    """Tip position for joint values in degrees."""
    if how == "cli":
        return list(run("fk", f"robots/{robot}.yaml", *q, "--json").json["position_mm"])
    return list(armkin.fk(load_robot(robot), np.deg2rad(q))[:3, 3])


def frame_positions(how: str, robot: str, q: Sequence[float]) -> dict[str, list[float]]:
    if how == "cli":
        answer = run("fk", f"robots/{robot}.yaml", *q, "--frames", "--json").json
        return {frame["name"]: frame["position_mm"] for frame in answer["frames"]}
    arm = load_robot(robot)
    F = armkin.frames(arm, np.deg2rad(q))
    return dict(zip(("base", *arm.joint_names, "tool"), F[:, :3, 3].tolist(), strict=True))


def branches_of(how: str, robot: str, target: Sequence[float]) -> list[dict[str, Any]]:
    """All branches [deg], as joints, name and within_limits; angles of the target in degrees."""
    if how == "cli":
        return list(run("ik", f"robots/{robot}.yaml", *target, "--all-branches", "--json").json["branches"])
    s = armkin.ik(load_robot(robot), [*target[:3], *np.deg2rad(target[3:])] if len(target) > 2 else target)
    return [
        {
            "joints": np.rad2deg(s.q[b]).tolist(),
            "name": s.names[s.branch[b]],
            "within_limits": bool(s.within_limits[b]),
        }
        for b in s.order
        if s.valid[b]
    ]


def joints_of(found: list[dict[str, Any]]) -> list[list[float]]:
    return sorted(branch["joints"] for branch in found)


def near_values(values: Any, digits: int) -> Any:
    return pytest.approx(values, abs=0.5001 * 10.0**-digits)


# 1. Three-DOF stepper arm -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("q", "expected"),
    # E2: Table 4 prints its first case as [0, -90, 90].
    [([0, 90, -90], (258, 10, 367)), ([-30, 5, -5], (398.3923, -218.4649, 187.1697))],
)
def test_three_dof_forward(how: str, q: list[float], expected: tuple[float, ...]) -> None:
    assert tip_position(how, "three_dof", q) == near_values(expected, 4)


def test_three_dof_closed_form(how: str) -> None:
    # Equations 8 to 10.
    q1, q2, q3 = np.deg2rad([17, 34, -61])
    radius = 258 * math.cos(q2 + q3) + 197 * math.cos(q2)
    expected = (
        math.cos(q1) * radius - 10 * math.sin(q1),
        math.sin(q1) * radius + 10 * math.cos(q1),
        170 + 197 * math.sin(q2) + 258 * math.sin(q2 + q3),
    )
    assert tip_position(how, "three_dof", [17, 34, -61]) == pytest.approx(expected, abs=1e-9)


def test_three_dof_step_chain() -> None:
    # E6: Table 2 leaves out M2's gear ratio (26.85125) and M3's (5); its pulses per turn contain them.
    motors = run("info", "robots/three_dof.yaml", "--json").json["motors"]
    assert [motor["pulses_per_turn"] for motor in motors] == [12800, 42962, 24000]
    assert [motor["unit_per_pulse"] for motor in motors] == near_values([0.028125, 0.0083795, 0.015], 7)
    steps = np.rad2deg(1 / np.abs(np.diag(load_robot("three_dof").motor_gain)))
    assert steps.tolist() == near_values([0.028125, 0.0083795, 0.015], 7)


def test_three_dof_pulses(how: str) -> None:
    # Table 4's "actual" columns: pulses count from home, [0, 90, -90].
    # From zero it would be (-1067, 597, -333).
    pulses = [-1067, -10144, 5667]
    actual_joints, actual_tip = (-30.009375, 4.998371, -4.995), (398.3570, -218.5304, 187.1793)
    difference = (0.035329, 0.065428, 0.009597)
    if how == "cli":
        answer = run("pulses", "robots/three_dof.yaml", -30, 5, -5, "--json").json
        assert answer["pulses"] == answer["moves"] == pulses
        assert answer["actual_joints"] == near_values(actual_joints, 6)
        assert answer["position_mm"]["actual"] == near_values(actual_tip, 4)
        assert answer["position_mm"]["difference"] == near_values(difference, 6)
        assert answer["error_mm"] == near_values(math.hypot(*difference), 5)
    else:
        arm = load_robot("three_dof")
        q = np.deg2rad([-30, 5, -5])
        p = armkin.pulses(arm, q)
        back = armkin.joints(arm, p)
        assert p.tolist() == pulses
        assert np.rad2deg(back).tolist() == near_values(actual_joints, 6)
        assert armkin.fk(arm, back)[:3, 3].tolist() == near_values(actual_tip, 4)
        assert np.abs(armkin.fk(arm, back) - armkin.fk(arm, q))[:3, 3].tolist() == near_values(difference, 6)


TABLE_5 = {
    # name: joints, pulses from home, actual q2 and q3, within limits
    "left, elbow up": ((10.1529, 44.6560, -46.5354), (361, -5411, 2898), (44.6585, -46.5300), True),
    # E3: the table prints q3 = -46.5354.
    "left, elbow down": ((10.1529, -8.4781, 46.5354), (361, -11752, 9102), (-8.4759, 46.5300), True),
    # E4: the table repeats the left arm's q2 and q3 in both rows of the right arm.
    "right, elbow up": ((-166.9685, 135.3440, 46.5354), (-5937, 5411, 9102), (135.3415, 46.5300), False),
    "right, elbow down": (
        (-166.9685, -171.5219, -46.5354),
        (-5937, -31210, 2898),
        (-171.5241, -46.53),
        False,
    ),
}


def test_three_dof_inverse(how: str) -> None:
    found = branches_of(how, "three_dof", [390, 80, 300])
    assert {branch["name"] for branch in found} == set(TABLE_5)
    assert found[0]["name"] == "left, elbow up"  # the least motion from home
    for branch in found:
        joints, _, _, legal = TABLE_5[branch["name"]]
        assert branch["joints"] == near_values(joints, 4)
        assert branch["within_limits"] is legal
        assert tip_position(how, "three_dof", branch["joints"]) == pytest.approx((390, 80, 300), abs=1e-9)


@pytest.mark.parametrize("name", TABLE_5)
def test_three_dof_inverse_pulses(how: str, name: str) -> None:
    [branch] = [branch for branch in branches_of(how, "three_dof", [390, 80, 300]) if branch["name"] == name]
    _, pulses, actual, _ = TABLE_5[name]
    if how == "cli":
        answer = run("pulses", "robots/three_dof.yaml", *branch["joints"], "--json").json
        counts, joints = answer["pulses"], answer["actual_joints"]
    else:
        arm = load_robot("three_dof")
        p = armkin.pulses(arm, np.deg2rad(branch["joints"]))
        counts, joints = p.tolist(), np.rad2deg(armkin.joints(arm, p)).tolist()
    assert tuple(counts) == pulses
    assert joints[1:] == near_values(list(actual), 4)
    # E5: q1's "offset" is printed as 0.0020 in all rows.
    assert abs(joints[0] - branch["joints"][0]) == near_values(0.0003 if name.startswith("left") else 0.0096, 4)


def test_three_dof_branch_by_name() -> None:
    # The paper's GUI offers "left angle" and "upper elbow".
    for name in ("left angle upper elbow", "elbow up left", "Upper Elbow, Left Angle"):
        answer = run("ik", "robots/three_dof.yaml", 390, 80, 300, "--branch", name, "--json").json
        assert answer["branches"][answer["best"]]["name"] == "left, elbow up"


def test_three_dof_as_printed() -> None:
    from armkin import robot_file
    from armkin.model import build_arm as arm

    text = (ROOT / "robots/three_dof.yaml").read_text()
    # E1: Tables 1 and 3 print alpha1 = -90 and d2 = +10, which mirrors z for all cases but the first.
    other = text.replace("alpha: 90, a: 0, d: 170", "alpha: -90, a: 0, d: 170").replace(
        "a: 197, d: -10", "a: 197, d: 10"
    )
    printed = arm.arm_of_file(robot_file.parse_robot_file(other))
    assert armkin.fk(printed, np.deg2rad([0, -90, 90]))[:3, 3].tolist() == near_values([258, 10, 367], 4)
    assert armkin.fk(printed, np.deg2rad([-30, 5, -5]))[2, 3] == near_values(152.8303, 4)
    # E4: the right arm's rows as printed do not reach the target.
    shipped = load_robot("three_dof")
    for q, where in (
        ((44.6560, -46.5354), (-385.49, -99.49, 300.00)),
        ((-8.4781, -46.5354), (-331.70, -87.03, -70.42)),
    ):
        assert armkin.fk(shipped, np.deg2rad([-166.9685, *q]))[:3, 3].tolist() == near_values(where, 2)


# 2. RA-02, DH and product of exponentials --------------------------------------------------------

RA02 = [
    ([0, 0, 0, 0], (300, 0, 115)),
    ([0, 90, 0, 0], (0, 0, 415)),
    ([-90, 0, -90, 0], (0, -120, -65)),
    ([180, 45, -90, 45], (-238.492, 0, 136.213)),
    ([30, 40, -50, 20], (233.126, 134.595, 192.135)),
]


@pytest.mark.parametrize("robot", ["ra02", "ra02_screws"])
@pytest.mark.parametrize(("q", "expected"), RA02)
def test_ra02_forward(how: str, robot: str, q: list[float], expected: tuple[float, ...]) -> None:
    assert tip_position(how, robot, q) == near_values(expected, 3)


def test_ra02_screws_differ_by_a_constant_turn() -> None:
    # Erratum: "identical" holds for positions; the end frames differ by a quarter turn about x.
    dh, screws = load_robot("ra02"), load_robot("ra02_screws")
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (1000, 4))
    A, B = armkin.fk(dh, q), armkin.fk(screws, q)
    assert np.abs(A[:, :3, 3] - B[:, :3, 3]).max() < 1e-9
    turn = np.swapaxes(B[:, :3, :3], 1, 2) @ A[:, :3, :3]
    quarter = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert np.abs(turn - quarter).max() < 1e-12


@pytest.mark.parametrize("robot", ["ra02", "ra02_screws"])
def test_ra02_inverse(how: str, robot: str) -> None:
    # Erratum: eq. 13 loses the quadrant and the mirrored base, q1 + 180 with the same phi.
    q = [30, 20, 60, 40]
    target = [*tip_position(how, robot, q), 120]
    found = joints_of(branches_of(how, robot, target))
    assert len(found) == 4
    assert any(joints == pytest.approx(q, abs=1e-6) for joints in found)
    assert sorted(round(joints[0], 6) for joints in found) == [-150, -150, 30, 30]
    for joints in found:
        assert tip_position(how, robot, joints) == pytest.approx(target[:3], abs=1e-9)
        assert math.remainder(sum(joints[1:]) - 120, 360) == pytest.approx(0, abs=1e-9)


# 3. Planar servo arms ----------------------------------------------------------------------------


def test_planar_2dof_forward(how: str) -> None:
    # Erratum: the text says 20 and 30 degrees; the code and its result use 20 and 50.
    assert tip_position(how, "planar_2dof", [20, 50])[:2] == near_values((290.544567, 350.311815), 6)
    # The serial monitor, in cm and single precision.
    assert tip_position(how, "planar_2dof", [20, 50])[:2] == pytest.approx((290.544567108, 350.311813354), abs=1e-4)


def test_planar_theta() -> None:
    assert run("fk", "robots/planar_2dof.yaml", 20, 50, "--json").json["rpy_deg"][2] == pytest.approx(70)
    assert run("fk", "robots/planar_3dof.yaml", 20, 50, -30, "--json").json["rpy_deg"][2] == pytest.approx(40)


def test_planar_2dof_inverse(how: str) -> None:
    # Erratum: acos > 0 finds only one of the two elbows.
    found = joints_of(branches_of(how, "planar_2dof", tip_position(how, "planar_2dof", [20, 50])[:2]))
    assert len(found) == 2
    assert found[0] == pytest.approx([20, 50], abs=1e-9)
    assert found[1][1] == pytest.approx(-50, abs=1e-9)


def test_planar_3dof(how: str) -> None:
    assert tip_position(how, "planar_3dof", [20, 50, -30])[:2] == near_values((367.149, 414.591), 3)
    # Erratum: phi1's closed form has a sign error in y2; the two-circle solution is right.
    x, y, _ = tip_position(how, "planar_3dof", [20, 50, -30])
    arm = load_robot("planar_3dof")
    if how == "cli":
        answer = run("ik", "robots/planar_3dof.yaml", x, y, 40, "--all-branches", "--json").json
        found = joints_of(answer["branches"])
    else:
        s = armkin.ik(arm, [x, y, math.radians(40)])
        found = sorted(np.rad2deg(s.q[s.valid]).tolist())
    assert len(found) == 2
    assert any(joints == pytest.approx([20, 50, -30], abs=1e-9) for joints in found)


# 4. LabVolt R5150 --------------------------------------------------------------------------------


def test_labvolt_case_4(how: str) -> None:
    # Erratum: elbow and wrist heights are printed 24.87 off (389.35, 233.711), the tool 0.05 off.
    frames = frame_positions(how, "labvolt_5150", [45, 35, -90, 90, 90])
    assert frames["q1"] == near_values((0, 0, 255.5), 3)
    assert frames["q2"] == near_values((110.053, 110.053, 364.480), 3)
    assert frames["q3"] == near_values((187.113, 187.113, 208.841), 3)
    assert frames["tool"] == near_values((233.755, 233.755, 114.638), 3)


def test_labvolt_case_5(how: str) -> None:
    # Erratum: the wrist is printed as (32.289, 107.452, 157.159).
    frames = frame_positions(how, "labvolt_5150", [72, 77, -147, 90, 90])
    assert frames["q2"] == near_values((13.208, 40.649, 440.630), 3)
    assert frames["q3"] == near_values((33.289, 102.452, 262.089), 3)
    assert frames["tool"] == near_values((45.443, 139.859, 154.024), 3)


def test_labvolt_roll_does_not_move_the_tip(how: str) -> None:
    assert tip_position(how, "labvolt_5150", [45, 35, -90, 90, -20]) == pytest.approx(
        tip_position(how, "labvolt_5150", [45, 35, -90, 90, 90]), abs=1e-9
    )


# 5. Medical-robot homework -----------------------------------------------------------------------


def test_pan_tilt(how: str) -> None:
    assert tip_position(how, "pan_tilt", [36, 45]) == near_values((270.3069, 1432.4574, -1060.6602), 4)


def test_pan_tilt_has_no_inverse_task() -> None:
    completed = run("ik", "robots/pan_tilt.yaml", 270, 1432, -1060)
    assert (completed.code, completed.out) == (2, "")
    assert "no task fits" in completed.err
    with pytest.raises(armkin.UsageError, match="no task fits"):
        armkin.ik(load_robot("pan_tilt"), [270, 1432, -1060])


def circle_points(degrees: float) -> list[float]:
    """The homework's path: radius 400 about (0, 0, 660), tilted by -45 degrees."""
    t, tilt = math.radians(degrees), math.radians(-45)
    along = 400 * math.cos(t)
    return [math.cos(tilt) * along, 400 * math.sin(t), 660 - math.sin(tilt) * along]


@pytest.mark.parametrize(
    ("t", "point", "digits", "expected"),
    [
        (0, (282.84, 0, 942.84), 2, [(0, 107.282, -124.565), (0, -17.282, 124.565)]),
        (36, (228.8, 235.1, 888.8), 1, [(45.777, 97.176, -124.565), (45.777, -27.388, 124.565)]),
    ],
)
def test_yaw_two_link(
    how: str, t: float, point: tuple[float, ...], digits: int, expected: list[tuple[float, ...]]
) -> None:
    assert circle_points(t) == near_values(point, digits)
    # It leaves out the two branches with the base turned round.
    found = joints_of(branches_of(how, "yaw_two_link", circle_points(t)))
    assert len(found) == 4
    for joints in expected:
        assert any(branch == near_values(joints, 3) for branch in found)


def test_yaw_two_link_path(how: str) -> None:
    for k in range(11):
        for branch in branches_of(how, "yaw_two_link", circle_points(36 * k)):
            assert tip_position(how, "yaw_two_link", branch["joints"]) == pytest.approx(circle_points(36 * k), abs=1e-9)
