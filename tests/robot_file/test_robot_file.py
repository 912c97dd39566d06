"""The robot file: what loads, what is refused and in which words."""

import json
import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from armkin import robot_file
from armkin.errors import ArmkinError, FileError, RobotFileError
from hostile_robot_files import DH, MOTORS, SCREWS, SERVO, VALID, hostile_files
from least_time import least_seconds

ROOT = Path(__file__).parents[2]
SNAPSHOT = Path(__file__).parents[1] / "snapshots" / "robot_file_errors.txt"
CASES = hostile_files()


def error_message(raw: bytes | str) -> str:
    with pytest.raises(RobotFileError) as caught:
        robot_file.parse_robot_file(raw, "arm.yaml")
    return str(caught.value)


def read_snapshots() -> dict[str, str]:
    blocks = SNAPSHOT.read_text().split("\n\n")
    return {name: text for name, _, text in (block.strip().partition("\n") for block in blocks)}


@pytest.fixture(scope="module", autouse=True)
def _update() -> None:
    """ARMKIN_UPDATE_SNAPSHOTS=1 writes the messages anew, for review in the diff."""
    if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS"):
        blocks = [f"[{name}]\n{error_message(raw)}" for name, raw in CASES.items()]
        SNAPSHOT.write_text("\n\n".join(blocks) + "\n")


@pytest.mark.parametrize("name", CASES)
def test_hostile_file_is_refused_in_the_reviewed_words(name: str) -> None:
    robot_file.parse_robot_file(DH)  # the model is built once in a process; that is not the file's time
    texts: list[str] = []
    seconds = least_seconds(lambda: texts.append(error_message(CASES[name])), 2)
    text = texts[0]
    assert text == read_snapshots()[f"[{name}]"]
    assert len(text.splitlines()) <= 21, "all problems, a line each, and how many more"
    assert all(len(line) <= 240 for line in text.splitlines())
    assert seconds < 2  # 0.03 s at most on an idle machine


def test_every_snapshot_belongs_to_a_case() -> None:
    assert set(read_snapshots()) == {f"[{name}]" for name in CASES}
    assert len(CASES) >= 120


@pytest.mark.parametrize("name", VALID)
def test_the_files_that_the_cases_spoil_are_valid(name: str) -> None:
    assert robot_file.parse_robot_file(VALID[name]).name == "arm"


def all_robot_files() -> list[Path]:
    return sorted((ROOT / "robots").glob("*.yaml")) + sorted((ROOT / "tests" / "robots").glob("*.yaml"))


@pytest.mark.parametrize("path", all_robot_files(), ids=lambda path: path.stem)
def test_shipped_robot(path: Path) -> None:
    robot = robot_file.read_robot_file(path)
    assert robot.name == path.stem
    assert robot.path == str(path)
    head = path.read_text().splitlines()[0]
    assert head.startswith("# yaml-language-server: $schema=")
    assert (path.parent / head.partition("=")[2]).resolve() == ROOT / "robots" / "robot.schema.json"
    if path.parent == ROOT / "robots":
        assert robot.source, "a shipped robot cites where its numbers come from"
    # No motor is asked for more steps than the boards are sure of: 20 kHz, a Pico 100 kHz.
    speeds = {joint.name: joint.max_speed or 0.0 for joint in robot.joints}
    if robot.board is not None:
        for motor in robot.motor_list():
            rate = sum(abs(w) * speeds[n] for n, w in motor.joints.items()) * motor.pulses_per_unit()
            assert rate <= (100_000 if robot.board.kind == "pico6" else 20_000), motor.name


def test_an_error_carries_every_problem() -> None:
    text = DH.replace("home: 0", "home: tall").replace("gear: 2.5", "gear: 0").replace("a: 258, d: 0", "a: x")
    with pytest.raises(RobotFileError) as caught:
        robot_file.parse_robot_file(text, "arm.yaml")
    problems = caught.value.problems
    assert [problem.split(": ")[0] for problem in problems] == [f"arm.yaml:{n}" for n in (10, 13, 23, 23)]
    assert str(caught.value) == "\n".join(problems)
    with pytest.raises(RobotFileError) as caught:
        robot_file.parse_robot_file("name: 017", "arm.yaml")
    assert caught.value.problems == (str(caught.value),)


def test_shipped_robots_are_those_of_the_documents() -> None:
    names = {path.stem for path in (ROOT / "robots").glob("*.yaml")}
    papers = {"three_dof", "ra02", "ra02_screws", "planar_2dof", "planar_3dof", "labvolt_5150"}
    named_elsewhere = {"pan_tilt", "yaw_two_link", "puma560", "stanford", "ur3e", "ur5e", "irb120", "irb2400"}
    more = {"jaco_j2n6s300", "cobra600", "moveo", "ar4", "thor", "parol6", "panda"}
    assert papers | named_elsewhere | more <= names


def test_schema_file_is_current() -> None:
    path = ROOT / "robots" / "robot.schema.json"
    made = json.dumps(robot_file.json_schema(), indent=2) + "\n"
    if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS"):
        path.write_text(made)
    assert path.read_text() == made, "run the tests once with ARMKIN_UPDATE_SNAPSHOTS=1"


def test_schema_helps_with_every_key_and_knows_no_null() -> None:
    schema = robot_file.json_schema()
    for part in (schema, *schema["$defs"].values()):
        assert part["additionalProperties"] is False
        for key, value in part["properties"].items():
            assert value.get("description", "").endswith((".", ")")), key
    assert '"null"' not in json.dumps(schema)


def test_schema_examples_are_valid_files_of_each_convention() -> None:
    examples = robot_file.json_schema()["examples"]
    read = [robot_file.parse_robot_file(json.dumps(example)) for example in examples]  # JSON is YAML too
    assert [robot.convention for robot in read] == ["standard", "modified", "screws"]


def test_what_is_absent_is_absent() -> None:
    robot = robot_file.parse_robot_file(
        "name: arm\nconvention: standard\njoints: [{name: q1, dh: {alpha: 0, a: 1, d: 2}}]"
    )
    joint = robot.joints[0]
    assert (robot.task, robot.zero_pose, robot.motors, robot.gripper, robot.board) == (None,) * 5
    assert (joint.limits, joint.max_speed, joint.max_accel, joint.drive, joint.homing) == (None,) * 5
    assert (joint.type, joint.sign, joint.home) == ("revolute", 1, 0.0)
    assert joint.dh is not None
    assert joint.dh.theta == 0.0
    assert robot.tool == robot_file.Pose.model_validate({})
    assert robot.base.model_dump(exclude_none=True) == robot.tool.model_dump()
    assert robot.motor_list() == ()


def test_the_model_is_immutable() -> None:
    robot = robot_file.parse_robot_file(DH)
    with pytest.raises(ValidationError):
        robot.name = "other"
    with pytest.raises(ValidationError):
        robot.joints[0].home = 3.0
    assert isinstance(robot.joints, tuple)
    assert isinstance(robot.joints[0].limits, tuple)


def test_rules_hold_without_a_file_too() -> None:
    row = {"name": "q1", "dh": {"alpha": 0, "a": 1, "d": 2}, "limits": (10, 20)}
    with pytest.raises(ValidationError, match="home is 0 unless given"):
        robot_file.RobotFile.model_validate({"name": "arm", "convention": "standard", "joints": (row,)})


def test_chain_of_the_published_arm() -> None:
    motors = robot_file.read_robot_file(ROOT / "robots" / "three_dof.yaml").motor_list()
    assert [motor.pulses_per_turn() for motor in motors] == [12800, 42962, 24000]
    assert [round(1 / motor.pulses_per_unit(), 7) for motor in motors] == [0.028125, 0.0083795, 0.015]
    assert [(motor.name, motor.axis, motor.joints) for motor in motors] == [
        ("q1", "X", {"q1": 1.0}),
        ("q2", "Y", {"q2": 1.0}),
        ("q3", "Z", {"q3": 1.0}),
    ]


def test_teeth_are_a_ratio_of_joint_to_motor() -> None:
    robot = robot_file.parse_robot_file(DH.replace("gear: 2.5", "gear: {motor: 16, joint: 80}"))
    assert robot.joints[0].drive is not None
    assert robot.joints[0].drive.gear == 5.0
    assert robot.joints[0].drive.pulses_per_turn() == 200 * 16 * 5 * 4


def test_lead_and_servo_give_pulses_per_unit() -> None:
    lift = robot_file.parse_robot_file(DH).motor_list()[1]
    assert lift.pulses_per_unit() == 200 * 8 / 8  # a turn is 8 mm
    servo = robot_file.parse_robot_file(SERVO).motor_list()[1]
    assert servo.invert
    assert servo.pulses_per_unit() == pytest.approx(2000 / 180)


def test_differential_wrist() -> None:
    robot = robot_file.read_robot_file(ROOT / "tests" / "robots" / "differential_wrist.yaml")
    motors = {motor.name: motor.joints for motor in robot.motor_list()}
    assert len(motors) == 7
    assert motors["M5"] == {"J5": 1.0, "J6": 2.0}
    assert motors["M6"] == {"J5": -1.0, "J6": 2.0}


def test_twist_sheds_the_rounding_of_a_printed_table() -> None:
    text = SCREWS.replace("w: [0, 0, 1], v: [0, 0, 0]", "w: [0.7071, 0, 0.7071], v: [0, 100.01, 0.002]")
    w, v = robot_file.parse_robot_file(text).joints[0].twist()
    assert sum(x * x for x in w) == pytest.approx(1, abs=1e-15)
    assert sum(x * y for x, y in zip(w, v, strict=True)) == pytest.approx(0, abs=1e-12)
    assert v[1] == pytest.approx(100.01, rel=1e-4)
    # A point gives v = -w x q: q3 of SCREWS turns about -y through (0, 0, 115).
    assert robot_file.parse_robot_file(SCREWS).joints[2].twist() == ((0, -1, 0), (115, 0, 0))
    assert robot_file.parse_robot_file(SCREWS).joints[1].twist() == ((0, 0, 0), (0, 0, 1))


def test_a_motor_may_mix_revolute_and_prismatic_joints() -> None:
    """A ball-screw spline: without a lead, the prismatic joint's weight is in degrees per mm."""
    text = MOTORS.replace("joints: {J3: 1}", "joints: {J1: 1, J3: 45}").replace(", lead: 8", "")
    assert robot_file.parse_robot_file(text).motor_list()[2].joints == {"J1": 1.0, "J3": 45.0}


def test_byte_order_mark_and_windows_lines_are_fine() -> None:
    windows = robot_file.parse_robot_file(b"\xef\xbb\xbf" + DH.replace("\n", "\r\n").encode())
    assert windows.model_dump() == robot_file.parse_robot_file(DH).model_dump()


def test_twelve_joints_load() -> None:
    rows = "".join(f"  - {{name: q{i}, dh: {{alpha: 0, a: 1, d: 0}}}}\n" for i in range(12))
    assert len(robot_file.parse_robot_file(f"name: arm\nconvention: standard\njoints:\n{rows}").joints) == 12


def test_sha256_is_that_of_the_bytes() -> None:
    import hashlib

    path = ROOT / "robots" / "ra02.yaml"
    assert robot_file.read_robot_file(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.yaml: cannot read the robot file: No such file"):
        robot_file.read_robot_file(tmp_path / "none.yaml")
    with pytest.raises(FileError, match="Is a directory; name a file"):
        robot_file.read_robot_file(tmp_path)
    with pytest.raises(FileError, match="null byte"):
        robot_file.read_robot_file("arm\0.yaml")
    with pytest.raises(FileError, match="File name too long"):
        robot_file.read_robot_file("x" * 5000)


def test_a_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(DH)

    def refuse(self: Path, *_: object, **__: object) -> None:  # root may read everything
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(FileError, match=r"arm\.yaml: cannot read the robot file: Permission denied"):
        robot_file.read_robot_file(path)


def test_a_huge_file_is_not_read_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    with path.open("wb") as file:
        file.truncate(1 << 36)  # sparse: 64 GB that take no room
    with pytest.raises(RobotFileError, match="larger than 256 kB"):
        robot_file.read_robot_file(path)


SNIPPETS = [
    *("limits", "home", ": ", "- ", "\n", "  ", "[", "]", "{", "}", ",", "'", '"', "#", "&a ", "*a", "!t "),
    *("0", "-1", "1e3", ".nan", "80:16", "017", "null", "true", "off", "---\n", "|\n", "\t", "?", "<<: "),
    *("\u00e9", "\x00", "\u2028", "9" * 30, "name: q1\n", "dh: {}", "%", "@", "\ud800", "\r"),
]


@settings(max_examples=400, deadline=None)
@given(
    st.sampled_from(list(VALID.values())),
    st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(SNIPPETS) | st.text(max_size=5)),
        min_size=1,
        max_size=5,
    ),
)
def test_mutated_files_load_or_are_refused(text: str, edits: list[tuple[float, int, str]]) -> None:
    for place, length, snippet in edits:
        index = int(place * len(text))
        text = text[:index] + snippet + text[index + length :]
    robot, refusal = None, ""
    try:
        robot = robot_file.parse_robot_file(text.encode(errors="surrogatepass"), "arm.yaml")
    except ArmkinError as error:
        refusal = str(error)
    if robot is None:
        assert refusal.startswith("arm.yaml:")
        assert len(refusal.splitlines()) <= 21
    else:
        assert 1 <= len(robot.joints) <= 12
        json.dumps(robot.model_dump(), allow_nan=False)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300))
def test_arbitrary_bytes_are_refused(raw: bytes) -> None:
    with pytest.raises(RobotFileError):
        robot_file.parse_robot_file(raw)
