"""What newcomers type, and what they are told: a hint at the right words, exit code 2."""

from pathlib import Path

import pytest

from armkin import robot_file
from armkin.errors import RobotFileError
from command_line import ROOT, THREE_DOF, run

DOF = THREE_DOF


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("fk 1 2 3", "ROBOT comes first"),
        (f"fk 1 2 3 {DOF}", "ROBOT comes first"),
        (f"fk {DOF} pi/2 0 0", "angles are degrees; write 90"),
        (f"fk {DOF} -3pi/4 0 0", "write -135"),
        (f"fk {DOF} 0 -pi/4 0", "write -45"),
        (f"ik {DOF} 390 80 300 --near 0 0 0", "with commas and no spaces, as 0,0,0"),
        (f"ik {DOF} --near 0 0 0 390 80 300", "with commas and no spaces, as 0,0,0"),
        (f"plot {DOF} --target 390 80 300 --out x.png", "with commas: --target 390,80,300"),
        (f"send {DOF} --target 390 80 300 --port sim", "with commas: --target 390,80,300"),
        (f"grip {DOF} close --port sim", "did you mean closed?"),
        (f"grip {DOF} opne --port sim", "did you mean open?"),
        (f"workspace {DOF} --grid 10x10x10", "with commas: 10,10,10"),
    ],
)
def test_a_slip_is_answered_with_what_is_meant(line: str, says: str) -> None:
    result = run(*line.split())
    assert (result.code, result.out) == (2, "")
    assert says in result.err
    assert result.err.count("\n") <= 2


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (f"fk {DOF} 0.5 -1.2 0.1", "look like radians"),
        (f"ik {DOF} 390 80 300 --near 0.1,1.5708,-1.2", "--near's numbers are degrees"),
        (f"ik {DOF} 0.39 0.08 0.3", "looks like metres"),
        ("ik robots/ra02.yaml 100 0 100 1.5708", "look like radians"),
    ],
)
def test_numbers_in_other_units_are_noted_and_taken(line: str, says: str) -> None:
    result = run(*line.split())
    assert result.code in (0, 3)
    assert f"{says}" in result.err
    assert result.err.startswith("note: ")


@pytest.mark.parametrize(
    "line",
    [
        f"fk {DOF} 0 0 0",
        f"fk {DOF} 1 2 3",
        f"fk {DOF} 0.5 0.5 45",
        f"ik {DOF} 0 0 0",
        f"ik {DOF} 390 80 300",
        "fk robots/cobra600.yaml 0 0 1.5 0",
        "fk robots/moveo.yaml home",
    ],
)
def test_ordinary_numbers_are_not_noted(line: str) -> None:
    assert "note" not in run(*line.split()).err


def test_a_robot_file_in_metres_and_radians_is_noted(tmp_path: Path) -> None:
    text = (ROOT / THREE_DOF).read_text()
    for old, new in {"d: 170": "d: 0.17", "a: 197, d: -10": "a: 0.197, d: -0.01", "a: 258": "a: 0.258"}.items():
        text = text.replace(old, new)
    path = tmp_path / "metres.yaml"
    path.write_text(text.replace("alpha: 90", "alpha: 1.5708"))
    result = run("fk", path, 0, 0, 0)
    assert result.code == 0
    assert "together are 0.635 mm; if they are metres, multiply them by 1000" in result.err
    assert "an angle of 1.5708 degrees; if it is in radians, write 90" in result.err


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "robots").glob("*.yaml")))
def test_no_shipped_robot_looks_like_metres_or_radians(name: str) -> None:
    assert "note" not in run("fk", f"robots/{name}.yaml", "home").err


@pytest.mark.parametrize("variable", ["q1", "theta1", "q_1", "q1 + 90"])
def test_a_variable_in_the_table_is_left_out(variable: str) -> None:
    text = (ROOT / THREE_DOF).read_text().replace("d: 170, theta: 0", f"d: 170, theta: {variable}")
    with pytest.raises(RobotFileError, match="leave the variable out: theta is the constant part"):
        robot_file.parse(text, "arm.yaml")
