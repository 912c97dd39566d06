"""What each command prints, for programs and for people."""

import inspect
import json
from importlib import import_module
from keyword import iskeyword
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.cli.commands import COMMANDS
from command_line import ROOT, THREE_DOF, run

ALL_ROBOTS = sorted(path.name for path in (ROOT / "robots").glob("*.yaml"))


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_the_commands_say(name: str) -> None:
    word = f"{name}_" if iskeyword(name) else name
    function = getattr(import_module(f"armkin.cli.commands.{word}"), word)
    assert (inspect.getdoc(function) or "").splitlines()[0] == COMMANDS[name]
    assert name in run("--help").out
    completed = run(name, "--help")
    assert completed.code == 0
    assert COMMANDS[name] in completed.out
    assert "<" not in completed.out.replace("<=", "")  # no names of Python types


def test_help_fits_a_line_each() -> None:
    listed = run("--help").out.partition("Commands:\n")[2].splitlines()
    assert [line.split()[0] for line in listed] == list(COMMANDS)
    assert all(line.endswith(".") and not line.endswith("..") for line in listed)


def test_version() -> None:
    assert run("--version") == (0, f"armkin {armkin.__version__}\n", "")


def test_fk() -> None:
    completed = run("fk", THREE_DOF, -30, 5, -5, "--json")
    arm = armkin.load(ROOT / THREE_DOF)
    T = armkin.fk(arm, np.deg2rad([-30, 5, -5]))
    answer = completed.json
    assert (completed.code, completed.err) == (0, "")
    assert (answer["robot"], answer["robot_file"]) == ("three_dof", THREE_DOF)
    assert answer["robot_sha256"] == arm.sha256
    assert answer["joint_units"] == ["deg"] * 3
    assert np.allclose(answer["position_mm"], T[:3, 3], rtol=1e-15, atol=0)  # full precision
    assert np.allclose(answer["rotation"], T[:3, :3], rtol=0, atol=1e-15)
    assert answer["rpy_deg"] == pytest.approx([90, 0, -30])
    w, x, y, z = answer["quaternion_wxyz"]
    assert T[0, 0] == pytest.approx(1 - 2 * (y * y + z * z))
    assert T[1, 0] == pytest.approx(2 * (x * y + w * z))
    assert answer["within_limits"] is True
    assert answer["violations"] == []
    assert "frames" not in answer


def test_fk_for_people() -> None:
    text = run("fk", THREE_DOF, -30, 5, -5).out
    assert text.startswith("three_dof: q1 = -30, q2 = 5, q3 = -5 deg\n")
    for word in ("398.3923", "-218.4649", "187.1697", "mm", "deg"):
        assert word in text
    assert "-0.0000" not in text


def test_fk_outside_limits_warns_and_is_done() -> None:
    completed = run("fk", THREE_DOF, 0, 130, 0, "--json")
    assert completed.code == 0
    assert completed.err == "warning: q2 = 130 deg is outside -20 to 120 deg\n"
    assert completed.json["violations"] == [{"joint": "q2", "value": 130, "lower": -20, "upper": 120}]
    on_the_limit = run("fk", THREE_DOF, -120, 120, 120, "--json")
    assert on_the_limit.json["within_limits"] is True


def test_fk_frames() -> None:
    answer = run("fk", THREE_DOF, -30, 5, -5, "--json", "--frames").json
    assert [frame["name"] for frame in answer["frames"]] == ["base", "q1", "q2", "q3", "tool"]
    assert answer["frames"][-1]["position_mm"] == answer["position_mm"]
    assert "tool" in run("fk", THREE_DOF, -30, 5, -5, "--frames").out


def test_ik_lists_the_best_branch_or_all() -> None:
    best_alone = run("ik", THREE_DOF, 390, 80, 300, "--json").json
    all_of_them = run("ik", THREE_DOF, 390, 80, 300, "--json", "--all-branches").json
    assert (best_alone["status"], best_alone["complete"], best_alone["best"], best_alone["closest"]) == (
        "exact",
        True,
        0,
        None,
    )
    assert best_alone["branches"] == all_of_them["branches"][:1]
    assert len(all_of_them["branches"]) == best_alone["branch_count"] == 4
    legal = [branch["within_limits"] for branch in all_of_them["branches"]]
    assert legal == sorted(legal, reverse=True)
    for part in (True, False):
        motion = [b["motion"] for b in all_of_them["branches"] if b["within_limits"] is part]
        assert motion == sorted(motion)
    for branch in all_of_them["branches"]:
        assert branch["residual_mm"] < 1e-9
        assert bool(branch["violations"]) is not branch["within_limits"]
        assert branch["motion"] == pytest.approx(np.abs(np.subtract(branch["joints"], [0, 90, -90])).sum())


def test_ik_near_chooses() -> None:
    near = run("ik", THREE_DOF, 390, 80, 300, "--near", "0,-10,50", "--json").json
    assert near["branches"][0]["name"] == "left, elbow down"


def test_ik_branch_chooses() -> None:
    answer = run("ik", THREE_DOF, 390, 80, 300, "--branch", "left elbow down", "--json").json
    assert answer["branches"][answer["best"]]["name"] == "left, elbow down"
    every = run("ik", THREE_DOF, 390, 80, 300, "--branch", "lower elbow", "--json", "--all-branches").json
    assert every["branches"][every["best"]]["name"] == "left, elbow down"
    outside = run("ik", THREE_DOF, 390, 80, 300, "--branch", "right", "--json")
    assert outside.code == 3
    assert "'right, elbow up' is outside limits: q1, q2; " in outside.err
    assert outside.json["best"] is None
    nearest = outside.json["closest"]  # it reaches the target, but not in the way asked for: it says so
    assert (nearest["branch"], nearest["distance_mm"]) == ("left, elbow up", pytest.approx(0, abs=1e-6))
    T = armkin.fk(armkin.load(ROOT / THREE_DOF), np.deg2rad(nearest["joints"]))
    assert T[:3, 3] == pytest.approx([390, 80, 300])
    unknown = run("ik", THREE_DOF, 390, 80, 300, "--branch", "rihgt")
    assert (unknown.code, unknown.out) == (2, "")
    assert "left, elbow up" in unknown.err


def test_all_branches_are_advised_where_they_are_not_listed_yet() -> None:
    """Whether the limits or a keep-out refuse them."""
    bench = ("--scene", "examples/scenes/three_dof.yaml")
    for words in (("390", "80", "300", "--branch", "right"), ("300", "0", "-100", *bench)):
        refused, listed = (run("ik", THREE_DOF, *words, *more) for more in ((), ("--all-branches",)))
        assert (refused.code, listed.code) == (3, 3)
        assert refused.err == f"{listed.err}  ik --all-branches lists all branches, also those outside limits\n"
        assert "next" not in json.loads(run("ik", THREE_DOF, *words, "--all-branches", "--json").err)


def test_ik_without_a_solution_shows_the_closest_pose() -> None:
    completed = run("ik", THREE_DOF, 900, 0, 0, "--json")
    answer = completed.json
    assert completed.code == 3
    assert "cannot reach" in completed.err
    assert (answer["status"], answer["best"], answer["branches"]) == ("unreachable", None, [])
    nearest = answer["closest"]
    T = armkin.fk(armkin.load(ROOT / THREE_DOF), np.deg2rad(nearest["joints"]))
    assert nearest["position_mm"] == pytest.approx(T[:3, 3].tolist())
    assert nearest["distance_mm"] == pytest.approx(np.linalg.norm(T[:3, 3] - [900, 0, 0]))
    assert "closest" in run("ik", THREE_DOF, 900, 0, 0).out


def test_ik_turns() -> None:
    answer = run("ik", "robots/ur5e.yaml", 400, 100, 400, 180, 0, 0, "--turns", "--json").json
    [branch] = answer["branches"]
    assert branch["turns"][0] == pytest.approx(branch["joints"])
    assert len(branch["turns"]) > 1
    for copy in branch["turns"]:
        turns = (np.array(copy) - branch["joints"]) / 360
        assert np.abs(turns - np.rint(turns)).max() < 1e-12


def test_ik_locked_and_swept() -> None:
    target = (400, 0, 400, 180, 0, 0)
    locked = run("ik", "robots/panda.yaml", *target, "--lock", "J3=-6", "--json").json
    assert locked["branches"][0]["joints"][2] == pytest.approx(-6)
    swept = run("ik", "robots/panda.yaml", *target, "--sweep", "J3=-18:18:4", "--json").json
    assert swept["complete"] is False
    assert min(abs(swept["branches"][0]["joints"][2] - v) for v in (-18, -6, 6, 18)) < 1e-9
    assert swept["branches"][0]["motion"] <= locked["branches"][0]["motion"] + 1e-9
    q = np.deg2rad(swept["branches"][0]["joints"])
    assert armkin.fk(armkin.load(ROOT / "robots/panda.yaml"), q)[:3, 3] == pytest.approx([400, 0, 400])
    free = run("ik", "robots/panda.yaml", *target, "--json").json
    assert free["branches"][free["best"]]["family"]["joint"] == "J7"


@pytest.mark.parametrize("more", [[], ["--all-branches"]])
def test_a_joint_locked_outside_its_limits_is_refused(more: list[str]) -> None:
    """Else the nearest pose, which holds it as well, would pass for one within limits."""
    completed = run("ik", "iiwa7", 400, 0, 600, 0, 180, 0, "--lock", "J3=171", "--json", *more)
    assert (completed.code, completed.out) == (3, "")
    error = json.loads(completed.err)
    assert "--lock J3=171: J3 = 171 deg is outside -170 to 170 deg" in error["error"]
    assert (error["joint"], error["value"], error["upper"]) == ("J3", pytest.approx(171), pytest.approx(170))
    assert run("ik", "iiwa7", 400, 0, 600, 0, 180, 0, "--lock", "J3=170", "--all-branches").code in (0, 3)


def test_ik_lets_another_task_be_asked_for() -> None:
    xy = run("fk", "robots/planar_3dof.yaml", 20, 50, -30, "--json").json["position_mm"][:2]
    completed = run("ik", "robots/planar_3dof.yaml", *xy, "--task", "xy")
    assert completed.code == 0
    assert "families of q1" in completed.out
    more = run("ik", "panda", 400, 0, 400, "--task", "xyz")
    assert (more.code, "4 degrees of freedom" in more.err) == (2, True)


def test_pulses() -> None:
    answer = run("pulses", THREE_DOF, -30, 5, -5, "--json").json
    assert answer["motors"] == ["q1", "q2", "q3"]
    assert answer["pulse_units"] == ["step"] * 3
    assert answer["resolution"] == pytest.approx([0.028125, 360 / 42962, 0.015])
    difference = np.abs(np.subtract(answer["position_mm"]["actual"], answer["position_mm"]["theoretical"]))
    assert np.allclose(difference, answer["position_mm"]["difference"], atol=1e-12)
    assert answer["error_mm"] == pytest.approx(np.linalg.norm(difference))


def test_pulses_from() -> None:
    answer = run("pulses", THREE_DOF, -30, 5, -5, "--from", "0,0,0", "--json").json
    zero = run("pulses", THREE_DOF, 0, 0, 0, "--json").json
    assert answer["moves"] == [a - b for a, b in zip(answer["pulses"], zero["pulses"], strict=True)]


def test_pulses_best() -> None:
    answer = run("pulses", THREE_DOF, -30, 5, -5, "--best", "--json").json
    assert answer["rounded"]["pulses"] == [-1067, -10144, 5667]
    assert answer["gain_mm"] == pytest.approx(answer["rounded"]["error_mm"] - answer["error_mm"])
    assert answer["gain_mm"] > 0
    assert "nearer than" in run("pulses", THREE_DOF, -30, 5, -5, "--best").out


def test_pulses_of_servos() -> None:
    answer = run("pulses", "robots/planar_2dof.yaml", 0, 50, "--json").json
    assert answer["pulse_units"] == ["us", "us"]
    completed = run("pulses", "robots/planar_2dof.yaml", 0, 500)
    assert completed.code == 0
    assert "the servo of q2 cannot turn that far" in completed.err


def test_pulses_of_a_differential() -> None:
    answer = run("pulses", "tests/robots/differential_wrist.yaml", "home", "--json").json
    assert all(count == 0 for count in answer["pulses"])
    text = run("info", "tests/robots/differential_wrist.yaml").out
    assert "2 " in text.partition("motor ")[2]


@pytest.mark.parametrize("robot", ALL_ROBOTS)
def test_info_of_every_arm(robot: str) -> None:
    completed = run("info", f"robots/{robot}", "--json")
    assert (completed.code, completed.err) == (0, "")
    answer = completed.json
    arm = armkin.load(ROOT / "robots" / robot)
    assert [joint["name"] for joint in answer["joints"]] == list(arm.joint_names)
    assert (answer["solver"] is None) == (answer["ik_refuses"] is not None)
    text = run("info", f"robots/{robot}").out
    for name in arm.joint_names:
        assert name in text
    assert "-0 " not in text
    if answer["solver"]:
        assert answer["solver"]["method"] in text


def test_info_says_the_step_chain() -> None:
    text = run("info", THREE_DOF).out
    for word in ("42962", "26.85125", "0.028125", "-120 .. 120", "-90", "uno_cnc_shield", "xyz"):
        assert word in text


def test_schema(tmp_path: Path) -> None:
    shipped = json.loads((ROOT / "robots/robot.schema.json").read_text())
    assert run("schema").json == shipped
    assert run("schema", "--out", tmp_path / "s.json").out == ""
    assert json.loads((tmp_path / "s.json").read_text()) == shipped


def test_out_writes_what_stdout_would_get(tmp_path: Path) -> None:
    for words in (["--json"], [], ["--frames"]):
        path = tmp_path / "out"
        assert run("fk", THREE_DOF, 1, 2, 3, *words, "--out", path) == (0, "", "")
        assert path.read_text() == run("fk", THREE_DOF, 1, 2, 3, *words).out
        assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_an_arm_without_lengths_reaches_nowhere(tmp_path: Path) -> None:
    robot = tmp_path / "point.yaml"
    robot.write_text("name: point\nconvention: standard\njoints:\n" + "  - {name: q1, dh: {alpha: 90, a: 0, d: 0}}\n")
    assert run("info", robot, "--json").json["reach_mm"] == 0
