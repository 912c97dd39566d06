"""Without --port: ARMKIN_PORT, else the only board that answers as the robot file's kind."""

import pytest

import armkin
from armkin.board import ports
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.sim.sim_grbl import Grbl
from armkin.board.sim.sim_servo_bus import Servo, ServoBus
from command_line import ROOT, THREE_DOF, run
from pty_board import PtyBoard
from pty_port import PtyPort


def plugged_in(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """What the operating system says is there."""
    ports_found = [ports.Found(name, "a board", "USB", "Arduino Uno") for name in names]
    ports_found.append(ports.Found("/dev/modem", "a modem", "USB", ""))
    for module in ("armkin.board.ports", "armkin.board.backend.board", "armkin.board.firmware.wire.find_boards"):
        monkeypatch.setattr(f"{module}.list_ports", lambda: ports_found)


def test_the_environment_names_a_port(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMKIN_PORT", "sim")
    assert run("send", THREE_DOF, -30, 5, -5, "--json").json["port"] == "sim"
    assert run("status", THREE_DOF, "--json").json["port"] == "sim"
    assert run("jog", THREE_DOF, "q1", 5).code == 0
    assert run("grip", THREE_DOF, "closed").code == 0
    completed = run("send", THREE_DOF, 0, 90, -90, "-p", "/dev/ttyNOWHERE")
    assert completed.code == 5
    assert "/dev/ttyNOWHERE" in completed.err


def test_the_only_board_that_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    with PtyBoard("uno_servos") as servo_board, PtyBoard() as board:
        plugged_in(monkeypatch, servo_board.port, board.port)
        completed = run("status", THREE_DOF, "--json")
        assert completed.json["port"] == board.port
        assert completed.err == f"note: using {board.port}, the only port where an uno_cnc_shield answers\n"
        assert run("send", THREE_DOF, 0, 80, -80, "--assume-home").code == 0
        assert run("stop", "--port", board.port).code == 0


def test_several_boards_or_none(monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch)
    none = run("send", THREE_DOF, 0, 90, -90)
    assert (none.code, none.out) == (2, "")
    assert "no port where an uno_cnc_shield answers was found" in none.err
    assert run("stop").code == 2
    with PtyBoard() as board, PtyBoard() as two:
        plugged_in(monkeypatch, board.port, two.port)
        several = run("send", THREE_DOF, 0, 90, -90)
        assert several.code == 2
        assert f"2 boards answer ({board.port}, {two.port})" in several.err


def test_boards_of_others_are_looked_for_as_the_robot_file_says(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, bus_arm = ("tests/robots/three_dof_grbl.yaml", "tests/robots/bus_arm.yaml")
    settings = {number: value for number, (_, value) in expected_settings(axes_of(armkin.load(ROOT / robot))).items()}
    servos = ServoBus([Servo(1, 2058), Servo(2, 2068)])
    with PtyPort(Grbl(settings=settings)) as grbl, PtyPort(servos) as bus, PtyPort(ServoBus([Servo(1)])) as other_bus:
        plugged_in(monkeypatch, grbl.name, bus.name, other_bus.name)
        completed = run("status", bus_arm, "--json")
        assert completed.json["port"] == bus.name
        assert f"using {bus.name}, the only port where a feetech board answers" in completed.err
        plugged_in(monkeypatch, grbl.name, other_bus.name)
        assert run("status", robot, "--json").json["port"] == grbl.name
        plugged_in(monkeypatch, other_bus.name)
        assert "no port where a feetech board answers was found" in run("status", bus_arm).err


def test_a_dry_run_asks_for_no_port(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMKIN_PORT", "/dev/ttyNOWHERE")
    assert run("send", THREE_DOF, -30, 5, -5, "--dry-run").code == 0


def test_ports_and_stop() -> None:
    assert run("ports", "--json").json["ports"] is not None
    assert run("stop", "--port", "sim").code == 2
