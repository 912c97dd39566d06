"""examples/board_plugin, installed as a package of its own: a kind of board that armkin does not know."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import armkin
from armkin import board_catalogue
from armkin.board import conformance, path_run
from armkin.board.backend.board import Board
from armkin.board.kinds import board_of
from armkin.errors import NoSolutionError, RobotFileError
from command_line import ROOT, run, run_process
from emulated_kinds import run_sample

WIDOW_X = {"waist": 1, "shoulder": 2, "elbow": 4, "forearm_roll": 6, "wrist_angle": 7, "wrist_rotate": 8}


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the package was installed into."""
    folder = tmp_path_factory.mktemp("packages")
    words = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(folder)]
    subprocess.run([sys.executable, *words, str(ROOT / "examples/board_plugin")], check=True)
    return folder


@pytest.fixture
def plugin_installed(packages: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package is installed here."""
    monkeypatch.syspath_prepend(str(packages))
    board_catalogue._entry_points.cache_clear()
    yield
    board_catalogue._entry_points.cache_clear()


def robots(folder: Path) -> list[Path]:
    """The WidowX 250 and the OpenMANIPULATOR with their servos' drives."""
    arm = folder / "open_manipulator.yaml"
    completed = run("import", "docs/open_manipulator.urdf", "--tip", "end_effector_link")
    assert completed.code == 0, completed.err
    files = []
    for text, ids in ((completed.out, {}), ((ROOT / "robots/wx250s.yaml").read_text(), WIDOW_X)):
        data: dict[str, Any] = yaml.safe_load(text)
        for k, joint in enumerate(data["joints"], 11):
            low, high = joint.get("limits", (-180, 180))  # a turn has no count for 180 degrees
            joint |= {"max_speed": 90, "max_accel": 200, "limits": [max(low, -179), min(high, 179)]}
            joint["drive"] = {"kind": "bus", "id": ids.get(joint["name"], k), "counts": 4096, "zero": 2048}
        data["board"] = {"kind": "dynamixel"}
        arm = folder / f"{data['name']}_dynamixel.yaml"
        arm.write_text(yaml.safe_dump(data, sort_keys=False))
        files.append(arm)
    return files


def connect_emulated(arm: armkin.Arm, **noise: float) -> tuple[Board, Any]:
    """The arm's board and its emulated servos."""
    board = board_of(arm)
    port: Any = board.simulated()
    port._lost, port._damaged = noise.get("lost", 0.0), noise.get("damaged", 0.0)
    board.connect(port).prepare()
    return board, port


def test_a_kind_that_is_not_installed_is_named_with_those_that_are(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="pico6, feetech, grbl or klipper, not the text 'dynamixel'"):
        armkin.load(robots(tmp_path)[1])


@pytest.mark.usefixtures("plugin_installed")
def test_both_arms_move_exactly_and_keep_to_their_path(tmp_path: Path) -> None:
    for file in robots(tmp_path):
        arm = armkin.load(file)
        board, port = connect_emulated(arm)
        assert board.kind == "dynamixel"
        rng = np.random.default_rng(1)
        for _ in range(5):
            goal = np.clip(rng.uniform(-1, 1, arm.n), arm.lower, arm.upper)
            plan = board.plan(board.machine.counts(), goal[None])
            port.log.clear()
            board.machine.run([plan])
            assert list(board.machine.counts()) == plan.end.tolist()
            positions = np.array([list(shafts.values()) for shafts in port.log])
            way = np.array(plan.end - plan.start, dtype=float)
            share = (positions - plan.start) @ way / (way @ way)
            assert (
                np.abs(positions - plan.start - share[:, None] * way).max() < 12
            )  # a degree off the straight joint move


@pytest.mark.usefixtures("plugin_installed")
def test_a_path_from_elsewhere_lost_and_damaged_answers(tmp_path: Path) -> None:
    arm = armkin.load(robots(tmp_path)[1])
    board, port = connect_emulated(arm, lost=0.01, damaged=0.01)
    board.machine.run([board.plan(board.machine.counts(), np.full((1, 6), 0.3))])
    board.machine.refresh()
    moves = {"start": "home", "moves": [{"joint": [10, 20, -20, 5, 5, 5]}, {"offset": {"xyz": [0, 0, 20]}}]}
    plan = armkin.path(arm, moves, start=board.machine.joints())
    assert plan.approach is not None
    path_run.follow_plan(
        board, plan, path_run.plan_parts(plan, board.machine.counts(), board.plan_trajectory), lambda done, total: None
    )
    distance = np.array([servo.position for servo in port.servos.values()]) - armkin.pulses(arm, plan.motion.end)
    assert np.abs(distance).max() <= 12


@pytest.mark.usefixtures("plugin_installed")
def test_the_servos_own_limits_zero_and_relax(tmp_path: Path) -> None:
    arm = armkin.load(robots(tmp_path)[1])
    board = board_of(arm)
    port: Any = board.simulated()
    for number in port.servos:
        port.servos[number].table[48:52] = (2500).to_bytes(4, "little")
    board.connect(port).prepare()
    with pytest.raises(NoSolutionError, match="outside its own limits 0 to 2500"):
        board.machine.run([board.machine.plan(board.machine.counts(), np.deg2rad([60, 0, 0, 0, 0, 0]))])
    assert port.servos[1].position == 2048
    assert board.can("relax")
    assert not board.can("home")
    board.relax()
    port.servos[1].position = 2100
    port.advance(0.001)
    board.machine.refresh()
    assert board.zero(None) == ([2100, 2048, 2048, 2048, 2048, 2048], None)


@pytest.mark.usefixtures("plugin_installed")
def test_the_command_line_tells_of_it(tmp_path: Path) -> None:
    robot = robots(tmp_path)[1]
    status = run("status", robot, "--port", "sim")
    assert "wrist_rotate   8     off  0.0 %   12.0 V" in status.out, status.out + status.err
    home = run("home", robot, "--port", "sim")
    assert (home.code, "there is nothing to home" in home.err) == (2, True)
    assert '"dynamixel"' in run("schema").out


@pytest.mark.usefixtures("plugin_installed")
@pytest.mark.parametrize("case", conformance.CASES, ids=lambda case: case.__name__)
def test_it_conforms(case: Callable[..., None]) -> None:
    run_sample(case, "dynamixel")


def test_the_command_line_knows_the_kind(packages: Path, tmp_path: Path) -> None:
    robot = robots(tmp_path)[1]
    environment = {**os.environ, "PYTHONPATH": str(packages)}
    completed = run_process("send", robot, 10, -10, 10, 5, 5, 5, "--port", "sim", "--json", env=environment)
    assert completed.code == 0, completed.err
    assert completed.json["joints"] == pytest.approx([10, -10, 10, 5, 5, 5], abs=0.1)
