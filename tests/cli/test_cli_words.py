"""What newcomers type, and what they are told: a hint at the right words, exit code 2."""

import tempfile
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
        (f"grip {DOF} colsed --port sim", "did you mean closed?"),
        (f"grip {DOF} opne --port sim", "did you mean open?"),
        (f"workspace {DOF} --grid 10x10x10", "with commas: 10,10,10"),
        ("three_dof fk 1 2 3", "the command comes first: armkin fk three_dof ..."),
        (f"ik {DOF} 390 80 300 --all", "did you mean --all-branches?"),
        (f"ik {DOF} targets.csv", "--batch targets.csv"),
        (f"send {DOF} home --speed 50% --dry-run", "write 50,"),
        (f"send {DOF} park --dry-run", "its poses: home"),
        (f"path {DOF} --via 390 80 300 --via 390 160 300", "commas and no spaces, as 390,80,300"),
        ("new myarm --dh 90 0 170", "commas and no spaces"),
        ("info", "a robot file or the name of a shipped robot (armkin robots)"),
        ("import robots/ur5e.yaml", "armkin info robots/ur5e.yaml"),
        ("import ur5e", "armkin info ur5e"),
        ("reach pan_tilt", "\n  task: pose in the robot file asks for whole poses, some of which it reaches"),
        ("place pan_tilt x.csv", "\n  task: pose in the robot file asks for whole poses"),
        ("ik pan_tilt 1 2 3", "--task pose asks for whole poses, some of which it reaches; so does task: pose in the"),
        ("plot panda --target 300,0,400 --task xyz -o x.png", "J6, J7 with --lock JOINT=VALUE\n"),
        ("ik so101 250 50 150 180 0 --position-first", "add --task pose"),
        ("export so101 --task xyz --c -o arm.c", "ik --lock and Python's armkin.lock hold joints"),
    ],
)
def test_a_slip_is_answered_with_what_is_meant(line: str, says: str) -> None:
    completed = run(*line.split())
    assert (completed.code, completed.out) == (2, "")
    assert says in completed.err
    assert completed.err.count("\n") <= 2


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
    completed = run(*line.split())
    assert completed.code in (0, 3)
    assert f"{says}" in completed.err
    assert completed.err.startswith("note: ")


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
    for millimetres, metres in {
        "d: 170": "d: 0.17",
        "a: 197, d: -10": "a: 0.197, d: -0.01",
        "a: 258": "a: 0.258",
    }.items():
        text = text.replace(millimetres, metres)
    path = tmp_path / "metres.yaml"
    path.write_text(text.replace("alpha: 90", "alpha: 1.5708"))
    completed = run("fk", path, 0, 0, 0)
    assert completed.code == 0
    assert "together are 0.635 mm; if they are metres, multiply them by 1000" in completed.err
    assert "an angle of 1.5708 degrees; if it is in radians, write 90" in completed.err


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "robots").glob("*.yaml")))
def test_no_shipped_robot_looks_like_metres_or_radians(name: str) -> None:
    assert "note" not in run("fk", f"robots/{name}.yaml", "home").err


@pytest.mark.parametrize("variable", ["q1", "theta1", "q_1", "q1 + 90"])
def test_a_variable_in_the_table_is_left_out(variable: str) -> None:
    text = (ROOT / THREE_DOF).read_text().replace("d: 170, theta: 0", f"d: 170, theta: {variable}")
    with pytest.raises(RobotFileError, match="leave the variable out: theta is the constant part"):
        robot_file.parse_robot_file(text, "arm.yaml")


def test_a_path_file_in_the_robots_place_is_called_one() -> None:
    completed = run("path", "examples/pick_and_place.yaml", "three_dof")
    assert (completed.code, completed.out) == (4, "")
    assert "a path file, not a robot; write armkin path ROBOT FILE" in completed.err
    assert completed.err.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("puma", "did you mean puma560?"),
        ("kuka", "did you mean kuka_kr6_r700?"),
        ("ur", "did you mean ur10e or ur3e or ur5e?"),
    ],
)
def test_the_beginning_of_a_robots_name_is_completed(name: str, says: str) -> None:
    completed = run("fk", name, "home")
    assert completed.code == 1
    assert says in completed.err


@pytest.mark.parametrize(
    "line", ["send moveo home --dry-run", "path ur5e --via 390,80,300,0,180,0 --via 390,160,300,0,180,0 --port none"]
)
def test_what_a_shipped_robot_lacks_is_added_to_a_copy(line: str, tmp_path: Path) -> None:
    completed = run(*line.split())
    assert (completed.code, completed.out) == (2, "")
    name = line.split()[1]
    copy = f"armkin export {name} --dh -o my_{name}.yaml"
    assert copy in completed.err
    again = run(*line.replace(name, f"robots/{name}.yaml").split())
    assert f"add to robots/{name}.yaml" in again.err
    assert "copy" not in again.err
    assert run(*copy.split()[1:-1], str(tmp_path / "copy.yaml")).code == 0


def test_a_new_robots_note_can_be_typed() -> None:
    with tempfile.TemporaryDirectory() as folder:  # tmp_path is so long that the note is cut
        file = Path(folder) / "my arm.yaml"
        completed = run("new", "my arm", "--dh", "90,0,170", "--convention", "standard", "--out", str(file))
    assert completed.code == 0
    assert f"armkin info '{file}'" in completed.err


def test_answers_of_ik_are_corners_of_a_path(tmp_path: Path) -> None:
    (tmp_path / "targets.csv").write_text("390,80,300\n400,0,250\n")
    rows = tmp_path / "rows.csv"
    assert run("ik", DOF, "--batch", str(tmp_path / "targets.csv"), "--out", str(rows)).code == 0
    completed = run("path", DOF, str(rows))
    assert (completed.code, completed.err) == (0, "")


def test_a_path_ends_for_each_reason_once(tmp_path: Path) -> None:
    moves = tmp_path / "far.yaml"
    moves.write_text("moves:\n  - point: [390, 80, 300]\n  - line: [900, 80, 300]\n")
    completed = run("path", DOF, str(moves))
    assert completed.code == 3
    lines = [line for line in completed.out.splitlines() if line.startswith("  at ")]
    assert len(lines) == len(set(lines)) > 0
