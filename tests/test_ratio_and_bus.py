"""Joint ratios (joint values are commanded ones) and bus servos (absolute counts)."""

import numpy as np
import pytest

import armkin
from armkin import robot_file
from armkin.errors import RobotFileError
from armkin.model.arm import actual_arm, from_links
from armkin.motors import outside_travel, pulse_units
from command_line import ROOT, run

BUS = ROOT / "tests/robots/ratio_arm.yaml"


def test_commanded_values_times_the_ratio_are_actual_ones() -> None:
    arm = armkin.load(BUS)
    plain = from_links(arm.link, arm.prismatic)
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (100, 3))
    turned = q * [1.0, 1.01, 0.99]
    assert np.abs(armkin.fk(arm, q) - armkin.fk(plain, turned)).max() < 1e-12
    assert np.abs(armkin.fk(arm, q[0]) - armkin.fk(plain, turned[0])).max() < 1e-12
    frames, expected = armkin.frames(arm, q), armkin.frames(plain, turned)
    assert np.abs(frames - expected)[:, -1].max() < 1e-12
    assert armkin.lock(arm, {"J2": 0.5}).link[1] == pytest.approx(armkin.lock(plain, {"q2": 0.505}).link[1], abs=1e-12)
    held = armkin.lock(arm, {"J2": 0.5})
    assert armkin.fk(held, [0.3, 0.7]) == pytest.approx(armkin.fk(arm, [0.3, 0.5, 0.7]), abs=1e-12)


def test_jacobian_is_per_commanded_radian() -> None:
    arm = armkin.load(BUS)
    q, h = np.array([0.3, 0.6, -0.8]), 1e-6
    slopes = [(armkin.fk(arm, q + h * e) - armkin.fk(arm, q - h * e))[:3, 3] / (2 * h) for e in np.eye(3)]
    assert armkin.jacobian(arm, q)[:3] == pytest.approx(np.array(slopes).T, abs=1e-6)


@pytest.mark.parametrize("task", ["xyz"])
def test_ik_answers_in_commanded_values(task: str) -> None:
    arm = armkin.load(BUS)
    q = np.random.default_rng(4).uniform(arm.lower, arm.upper, (500, 3))
    s = armkin.ik(arm, armkin.fk(arm, q)[:, :3, 3], task, near=q)
    gap = np.nanmin(np.abs(s.q - q[:, None]).max(axis=2), axis=1)
    assert gap.max() < 1e-9
    assert s.residual()[0][s.valid].max() < 1e-9
    assert (s.best >= 0).all()
    for row in armkin.turns(arm, q[0]):
        assert armkin.fk(arm, row) == pytest.approx(armkin.fk(arm, q[0]), abs=1e-9)


def test_a_turn_of_the_arm_is_less_than_a_commanded_turn() -> None:
    link = np.tile(np.eye(4), (3, 1, 1))
    link[1, 0, 3], link[2, 0, 3] = 200, 100
    arm = from_links(link, [False, False], limits=[[-8, 8], [-3, 3]], ratio=[1.25, 1.0], task="xy")
    copies = armkin.turns(arm, [0.5, 1.0])
    assert np.diff(np.sort(copies[:, 0])) == pytest.approx(2 * np.pi / 1.25)
    s = armkin.ik(arm, armkin.fk(arm, [6.0, 1.0])[:2, 3], near=[6.0, 1.0])
    assert s.q[s.best] == pytest.approx([6.0, 1.0])
    assert actual_arm(arm).upper[0] == 10.0
    assert actual_arm(actual_arm(arm)) is actual_arm(arm)


def test_bus_counts_are_absolute_and_come_back() -> None:
    arm = armkin.load(BUS)
    q = np.radians([[0, 0, 0], [10, 10, 10], [-45, 90, 30]])
    p = armkin.pulses(arm, q)
    assert p.tolist() == [[2048, 1900, 2048], [2162, 1786, 2161], [1536, 876, 2389]]
    assert np.degrees(np.abs(armkin.joints(arm, p) - q)).max() <= 0.5 * 360 / 4096 + 1e-9
    assert pulse_units(arm) == ["count"] * 3
    assert outside_travel(arm, [4096, 0, -1]).tolist() == [True, False, True]
    answer = run("pulses", BUS, 10, 10, 10, "--json").json
    assert answer["pulses"] == [2162, 1786, 2161]
    assert answer["pulse_units"] == ["count"] * 3
    assert "bus servo" in run("info", BUS).out


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("id: 1, ", "", "a bus servo needs id, for example"),
        ("id: 2", "id: 1", "1 is used already; each servo has its own number on the bus"),
        ("counts: 4096, zero: 2048}", "counts: 4096, zero: 2048, full_steps: 200}", "a bus servo has no full_steps"),
        ("zero: 2048}", "zero: 3800}", "110 needs count 5052; with zero 3800 it takes -333.984 to 25.9277"),
        ("zero: 2048}", "zero: 2048, axis: X}", "a bus servo has no axis; its place on the bus is id"),
        ("ratio: 1.01", "ratio: 101", "ratio"),
        ("convention: standard", "convention: standard\nboard: {kind: uno_servos}", "uno_servos has no bus"),
        ("kind: bus, id: 1", "full_steps: 200, microsteps: 1, id: 1", "for a bus servo write kind: bus"),
    ],
)
def test_bus_servo_mistakes_are_named(old: str, new: str, says: str) -> None:
    text = BUS.read_text()
    assert old in text
    with pytest.raises(RobotFileError) as caught:
        robot_file.parse_robot_file(text.replace(old, new, 1))
    assert says in "\n".join(caught.value.problems)
