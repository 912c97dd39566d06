"""Commands on boards of others: GRBL and a bus of servos, simulated in the process."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.kinds import board_of
from armkin.board.ports import note_path
from armkin.board.sim.sim_grbl import Grbl
from armkin.board.sim.sim_servo_bus import Servo, ServoBus
from armkin.robot_file.replace_values import with_values
from command_line import ROOT, THREE_DOF, run
from pty_port import PtyPort

BUS = (ROOT / "tests/robots/bus_arm.yaml").read_text()


@pytest.fixture
def grbl(tmp_path: Path) -> str:
    text = (ROOT / "tests/robots/three_dof_grbl.yaml").read_text()
    path = tmp_path / "grbl.yaml"
    path.write_text(text)
    return str(path)


@pytest.fixture
def bus(tmp_path: Path) -> str:
    path = tmp_path / "bus.yaml"
    path.write_text(BUS)
    return str(path)


def test_grbl_takes_the_published_pose_to_the_published_steps(grbl: str) -> None:
    completed = run("send", grbl, -30, 5, -5, "--port", "sim", "--json")
    assert completed.code == 0
    assert completed.json["pulses"] == [-1067, -10144, 5667]
    assert completed.json["position"] == "known"


def test_a_dry_run_of_grbl_plans_what_ours_plans(grbl: str) -> None:
    ours, theirs = (run("send", robot, -30, 5, -5, "--dry-run", "--json").json for robot in (THREE_DOF, grbl))
    for key in ("pulses", "moves", "duration_s", "top_speed", "position_mm"):
        assert theirs[key] == pytest.approx(ours[key], rel=1e-3)


def test_a_new_grbl_board_is_set_up_then_moved(grbl: str) -> None:
    board = Grbl(axes=4)
    with PtyPort(board) as pty:
        Path(f"{note_path(pty.name)}.told").unlink(missing_ok=True)  # of another board that had this name today
        refused = run("send", grbl, -30, 5, -5, "--port", pty.name, "--assume-home")
        assert (refused.code, refused.out) == (5, "")
        assert "settings do not fit three_dof_grbl: $100" in refused.err
        completed = run("setup", grbl, "--port", pty.name, "--json")
        assert {100, 101, 102} <= {row["setting"] for row in completed.json["differences"] if row["serious"]}
        assert board.settings[100] == 250
        assert run("setup", grbl, "--port", pty.name, "--write").code == 0
        written = {number: value for number, (_, value) in _expected_settings(grbl).items() if number != 10}
        assert {number: board.settings[number] for number in written} == pytest.approx(written)
        lost = run("send", grbl, -3, 85, -85, "--port", pty.name)
        assert (lost.code, "position is lost" in lost.err) == (5, True)
        jog = run("jog", grbl, "q1", 1, "--port", pty.name)
        assert (jog.code, jog.out, board.steps[0]) == (5, "", 0)
        assert f"then armkin send {grbl} home --port {pty.name} --assume-home\n" in jog.err
        moved = run("send", grbl, -3, 85, -85, "--port", pty.name, "--assume-home", "--json")
        planned = armkin.pulses(armkin.load(grbl), np.deg2rad([-3, 85, -85])).tolist()
        assert moved.json["pulses"] == board.steps[:3] == planned
        assert "GRBL has no checksum" in refused.err  # what a kind cannot promise is said once a day
        assert "GRBL has no checksum" not in moved.err
        again = run("status", grbl, "--port", pty.name, "--json").json
        assert (again["position"], again["pulses"]) == ("known", moved.json["pulses"])
        board.boot()
        assert run("status", grbl, "--port", pty.name, "--json").json["position"] == "lost"


def _expected_settings(robot: str) -> dict[int, tuple[str, float]]:
    return expected_settings(axes_of(armkin.load(robot)))


def test_bus_servos_move_jog_grip_and_tell(bus: str) -> None:
    moved = run("send", bus, 10, -20, "--port", "sim", "--json")
    assert moved.json["pulses"] == pytest.approx([2058 + 10 * 4096 / 360, 2068 + 20 * 4096 / 360], abs=14)
    assert run("jog", bus, "j1", 20, "--port", "sim", "--json").json["joints"] == pytest.approx([10, 0], abs=1.2)
    assert run("grip", bus, "open", "--port", "sim", "--json").json["gripper"] == pytest.approx(60, abs=1.2)
    servos = run("status", bus, "--port", "sim", "--json").json["servos"]
    assert [servo["name"] for servo in servos] == ["j1", "j2"]
    assert all(not servo["errors"] for servo in servos)


def test_relaxed_rows_are_played_back(bus: str, tmp_path: Path) -> None:
    rows = tmp_path / "rows.csv"
    port = ServoBus([Servo(1, 2158), Servo(2, 2168), Servo(6)])
    with PtyPort(port) as pty:
        assert run("relax", bus, "--port", pty.name, "--seconds", "0.3", "--out", rows).code == 0
    lines = rows.read_text().splitlines()
    assert lines[0] == "j1,j2"
    assert len(lines) == 5
    assert [float(value) for value in lines[1].split(",")] == pytest.approx([100 * 360 / 4096, -100 * 360 / 4096])
    assert run("send", bus, "--batch", rows, "--dry-run").code == 0


def test_zero_writes_counts_and_leaves_the_rest_of_the_file(bus: str, tmp_path: Path) -> None:
    written = tmp_path / "new.yaml"
    with PtyPort(ServoBus([Servo(1, 2100), Servo(2, 1600)])) as pty:
        assert run("zero", bus, "--port", pty.name, "--pose", "0,45", "--out", written).code == 0
    text = BUS.replace("zero: 2058", "zero: 2100").replace("zero: 2068", "zero: 2112")
    assert written.read_text() == text
    assert Path(bus).read_text() == BUS


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("home", "{bus}", "--port", "sim"), 2, "bus servos know their position"),
        (("home", "{grbl}", "--port", "sim"), 2, "joints without homing: q1, q2, q3"),
        (("setup", "{bus}", "--port", "sim"), 2, "setup is for board: {kind: grbl} and {kind: klipper}"),
        (("relax", "{grbl}", "--port", "sim"), 2, "no bus servos"),
        (("zero", "{grbl}", "--port", "sim"), 2, "zero is for arms whose joints have a bus servo"),
        (("grip", "{grbl}", "open", "--port", "sim"), 2, "no gripper that a board of kind grbl moves"),
        (("send", "{bus}", 0, 0, "--port", "sim", "--assume-home"), 5, "know their position"),
        (("send", "{bus}", 0, 0), 2, "no port where a feetech board answers was found"),
        (("send", "{grbl}", 0, 200, 0, "--port", "sim"), 3, "nothing was moved"),
        (("relax", "{bus}", "--port", "sim", "--seconds", "-1"), 2, "must be from 0 to 3600"),
    ],
)
def test_what_cannot_be_done_is_refused(
    words: tuple[object, ...], code: int, message: str, grbl: str, bus: str
) -> None:
    completed = run(*(str(word).replace("{bus}", bus).replace("{grbl}", grbl) for word in words))
    assert (completed.code, completed.out) == (code, "")
    assert message in completed.err


HOMING = "homing: {switch: X, direction: %s, at: %s, speed: 20, backoff: 3, normally: open}"
ENDS = {"q1": (1, 120), "q2": (-1, -20), "q3": (1, 120)}


@pytest.fixture
def grbl_with_switches(grbl: str) -> str:
    """The GRBL arm with a switch on every joint, and a gripper on M3."""
    text = Path(grbl).read_text()
    for name, (direction, switch_value) in ENDS.items():
        text = text.replace(f"  - name: {name}\n", f"  - name: {name}\n    {HOMING % (direction, switch_value)}\n")
    begin, end = text.index("gripper:"), text.index("# The paper has no limit switches")
    text = text[:begin] + "gripper: {kind: spindle, open: 40, closed: 200}\n" + text[end:]
    Path(grbl).write_text(text)
    return grbl


def grbl_for(robot: str, **more: float) -> Grbl:
    """A GRBL board as the robot file wants it."""
    settings = {number: value for number, (_, value) in _expected_settings(robot).items()}
    return Grbl(
        axes=3, settings=settings | {int(key[1:]): value for key, value in more.items()}, ends={0: 0, 1: 0, 2: 0}
    )


def test_home_ends_in_the_home_pose_and_stays_at_the_switches_when_told(grbl_with_switches: str) -> None:
    rehearsed = run("home", grbl_with_switches, "--port", "sim", "--json")
    assert rehearsed.json["joints"] == pytest.approx([0, 90, -90], abs=0.03)
    assert "moving to the home pose" in rehearsed.err
    board = grbl_for(grbl_with_switches)
    with PtyPort(board) as pty:
        at_switches = run("home", grbl_with_switches, "--port", pty.name, "--stay", "--json").json
        assert at_switches["joints"] == pytest.approx([119, -19, 119], abs=0.03)  # $27 = 1 deg off the switches
        steps_before = board.steps[:3]
        home = run("home", grbl_with_switches, "--port", pty.name, "--json").json
        assert (home["position"], home["pulses"]) == ("known", [0, 0, 0])
        assert [a - b for a, b in zip(board.steps, steps_before, strict=True)] == [-n for n in at_switches["pulses"]]


def test_home_refuses_a_board_that_would_look_at_the_other_end(grbl_with_switches: str) -> None:
    board = grbl_for(grbl_with_switches, s23=0)
    with PtyPort(board) as pty:
        refused = run("home", grbl_with_switches, "--port", pty.name)
        assert (refused.code, board.steps) == (5, [0, 0, 0])
        assert "would not home as three_dof_grbl needs: $23 (homing downwards) is 0" in refused.err
        assert (
            run("send", grbl_with_switches, 0, 89, -89, "--port", pty.name, "--assume-home").code == 0
        )  # no matter to a move
        assert run("setup", grbl_with_switches, "--port", pty.name, "--write").code == 0
        assert run("home", grbl_with_switches, "--port", pty.name).code == 0


def test_a_gripper_on_m3_is_given_its_word_and_told_to_be_unmeasured(grbl_with_switches: str) -> None:
    board = grbl_for(grbl_with_switches)
    with PtyPort(board) as pty:
        completed = run("grip", grbl_with_switches, "closed", "--port", pty.name, "--json")
        assert (board.spindle, completed.json["gripper"], completed.json["measured"]) == (200, 200, False)
        assert "S, as sent: nothing measures it" in run("grip", grbl_with_switches, "open", "--port", pty.name).out
        assert board.spindle == 40
        assert "outside of the gripper's 40 to 200" in run("grip", grbl_with_switches, 201, "--port", pty.name).err
        board.settings[30] = 100
        refused = run("grip", grbl_with_switches, "closed", "--port", pty.name)
        assert (refused.code, board.spindle) == (5, 40)
        assert "does not give out S 200: $30 is 100" in refused.err


def test_a_spindle_is_for_grbl_s_gripper_alone(grbl_with_switches: str, tmp_path: Path) -> None:
    text, path = Path(grbl_with_switches).read_text(), tmp_path / "wrong.yaml"
    for before, after, says in (
        ("kind: spindle, open: 40", "kind: spindle, axis: X, open: 40", "a spindle has none"),
        ("closed: 200", "closed: -200", "is an S word of M3"),
        ("axis: X, full_steps: 200, microsteps: 16, gear: 1, pulley: 4", "kind: spindle", "which turns no joint"),
        ("board: {kind: grbl}", "board: {kind: uno_cnc_shield}", "which uno_cnc_shield has not"),
    ):
        path.write_text(text.replace(before, after))
        refused = run("info", path)
        assert (refused.code, says in refused.err) == (4, True), refused.err


def test_zero_records_the_jaw_too(bus: str, tmp_path: Path) -> None:
    written = tmp_path / "new.yaml"
    with PtyPort(ServoBus([Servo(1, 2100), Servo(2, 1600), Servo(6, 1900)])) as pty:
        completed = run("zero", bus, "--port", pty.name, "--pose", "0,45", "--gripper", "open", "--out", written)
    assert completed.code == 0
    assert armkin.load(written).gripper == armkin.load(bus).gripper.model_copy(update={"zero": 1217})  # type: ignore[union-attr]


def test_the_jaws_of_the_so_arms_move_as_far_as_their_urdf_says() -> None:
    for robot, wide in (("so100", 114.592), ("so101", 100)):
        assert run("grip", robot, "open", "--port", "sim", "--json").json["gripper"] == pytest.approx(wide, abs=0.1)


def test_values_are_replaced_where_they_stand() -> None:
    text = "a:\n  - {b: 1, c: [2, 3]}  # one\n  - b: 4\n    d: x\ne: 5\n"
    replaced = with_values(
        text, {("a", 0, "b"): 10, ("a", 0, "z"): 11, ("a", 1, "d"): 12, ("a", 1, "z"): 13, ("e",): 14}
    )
    assert replaced == "a:\n  - {b: 10, c: [2, 3], z: 11}  # one\n  - b: 4\n    d: 12\n    z: 13\ne: 14\n"


def test_a_path_grips_with_grbl_s_output_between_its_moves(grbl_with_switches: str, tmp_path: Path) -> None:
    """What the board cannot reach is refused before anything moves."""
    path, wide = tmp_path / "path.yaml", tmp_path / "wide.yaml"
    path.write_text("moves:\n  - joint: [3, 85, -85]\n  - grip: closed\n  - joint: [0, 90, -90]\n")
    wide.write_text("moves:\n  - joint: [3, 85, -85]\n  - grip: 999\n")
    board = grbl_for(grbl_with_switches)
    with PtyPort(board) as pty:
        refused = run("path", grbl_with_switches, wide, "--port", pty.name, "--assume-home")
        assert (refused.code, board.steps[:3]) == (2, [0, 0, 0])
        assert "outside of the gripper's 40 to 200" in refused.err
        completed = run("path", grbl_with_switches, path, "--port", pty.name, "--json")
        assert completed.code == 0, completed.err
        assert (board.spindle, completed.json["pulses"]) == (200, [0, 0, 0])


def test_a_path_grips_with_a_servo_on_the_bus(tmp_path: Path) -> None:
    arm, path = armkin.load("so101"), tmp_path / "path.yaml"
    path.write_text(f"moves:\n  - joint: {{{arm.joint_names[0]}: 5}}\n  - grip: open\n  - joint: home\n")
    board = board_of(arm)
    port = board.simulated()
    assert isinstance(port, ServoBus)
    assert arm.gripper is not None
    jaw = port.servos[arm.gripper.id or 0]
    before = jaw.position
    with PtyPort(port) as pty:
        completed = run("path", "so101", path, "--port", pty.name, "--json")
        assert completed.code == 0, completed.err
    assert abs(jaw.position - before) > 100


def test_stop_leaves_a_board_of_others_alone_once_its_own_process_has_stopped_it(grbl: str) -> None:
    """Our firmware's frames are noise to GRBL, and a byte of them may reset it: the position would be lost."""
    board = Grbl(axes=3, settings={number: value for number, (_, value) in _expected_settings(grbl).items()})
    with PtyPort(board) as pty:
        words = ["send", grbl, "60", "20", "-60", "--speed", "5", "--assume-home", "--port", pty.name]
        mover = subprocess.Popen([sys.executable, "-m", "armkin", *words], stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 60
        while not any(board.steps):
            assert time.monotonic() < end
            time.sleep(0.02)
        stopped = run("stop", "--port", pty.name)
        assert (stopped.code, "it has stopped the arm first" in stopped.err) == (0, True), stopped.err
        _, output = mover.communicate(timeout=60)
        assert (mover.returncode, "its position is known" in output) == (143, True)
        stands = run("status", grbl, "--port", pty.name, "--json").json
        assert (stands["position"], stands["pulses"]) == ("known", board.steps[:3])
