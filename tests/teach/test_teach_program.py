"""A program made in the page is a path file: the same moves, the same plan, every edit taken back."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from served_page import Page, serve_robot

import armkin
from armkin import path_file
from armkin.errors import ArmkinError
from armkin.teach.plan_samples import playback_json
from armkin.teach.recorded_program import Program
from command_line import ROOT, run

POSES = [[10, 80, -80], [-20, 60, -70], [20, 45, -60]]


@pytest.fixture
def arm() -> armkin.Arm:
    return armkin.load(str(ROOT / "robots/three_dof.yaml"))


@pytest.fixture
def program(arm: armkin.Arm) -> Program:
    """A joint move, a line with a blend and a name, an arc, a wait, the gripper."""
    recorded = Program(arm)
    for edit in (
        {"do": "record", "kind": "joint", "q": POSES[0]},
        {"do": "record", "kind": "line", "q": POSES[1]},
        {"do": "via", "q": [0, 50, -60]},
        {"do": "record", "kind": "arc", "q": POSES[2]},
        {"do": "record", "kind": "wait", "seconds": 0.5},
        {"do": "record", "kind": "grip", "value": "closed"},
        {"do": "rename", "index": 1, "name": "above  the # bin"},
        {"do": "blend", "index": 1, "blend": 10},
        {"do": "settings", "tool_speed": 100, "speed": 80},
    ):
        recorded.edit(edit)
    return recorded


def test_what_is_recorded_is_a_path_file(program: Program, tmp_path: Path) -> None:
    text = program.text()
    assert "- {line: [334.737402, -111.192673, 295.805775], blend: 10}  # above the bin" in text
    file = tmp_path / "program.yaml"
    file.write_text(text)
    read = path_file.read_path_file(str(file))
    assert [move.kind for move in read.moves] == ["joint", "line", "arc", "wait", "grip"]
    assert (read.robot, read.tool_speed, read.speed) == ("three_dof", 100, 80)


def test_the_file_gives_the_plan_of_the_page(program: Program, arm: armkin.Arm, tmp_path: Path) -> None:
    file = tmp_path / "program.yaml"
    file.write_text(program.text())
    page, alone = program.plan(None), armkin.path(arm, str(file))
    assert page.duration == alone.duration
    t = np.linspace(0, page.duration, 50)
    assert np.array_equal(page.q(t), alone.q(t))
    by_command = run("path", "robots/three_dof.yaml", file, "--json").json
    assert by_command["duration_s"] == page.duration
    shown = playback_json(arm, page)
    assert shown["duration_s"] == alone.duration
    assert np.max(shown["shares"]) <= 1 + 1e-9
    assert np.allclose(np.deg2rad(shown["joints"]), alone.q(shown["time"]), atol=1e-3)
    assert shown["tips"][-1] == pytest.approx(armkin.fk(arm, alone.q(alone.duration))[:3, 3], abs=1e-3)


def test_a_saved_program_is_loaded_as_it_was(program: Program, arm: armkin.Arm) -> None:
    again = Program(arm)
    again.load(program.text(), "program.yaml")
    assert again.text() == program.text()
    assert again.names[1] == "above the bin"


def test_every_edit_is_taken_back(program: Program) -> None:
    texts = [program.text()]
    while program.state()["undo"]:
        program.edit({"do": "undo"})
        texts.append(program.text())
    assert program.moves == []
    for text in reversed(texts[:-1]):
        program.edit({"do": "redo"})
        assert program.text() == text
    program.edit({"do": "delete", "index": 0})
    assert program.state()["redo"] == 0


def test_order_and_deletion(program: Program) -> None:
    program.edit({"do": "reorder", "index": 1, "to": 0})
    assert [move["kind"] for move in program.state()["moves"]][:2] == ["line", "joint"]
    assert program.names[0] == "above the bin"
    program.edit({"do": "delete", "index": 0})
    assert program.names[0] == ""
    program.edit({"do": "record", "kind": "joint", "q": POSES[0], "index": 0})
    assert [move["kind"] for move in program.state()["moves"]][:2] == ["joint", "joint"]
    program.edit({"do": "clear"})
    assert program.state()["moves"] == []


@pytest.mark.parametrize(
    "edit",
    [
        {"do": "explode"},
        {},
        {"do": "record", "kind": "teleport", "q": POSES[0]},
        {"do": "record", "kind": "joint", "q": [0]},
        {"do": "record", "kind": "arc", "q": POSES[0]},
        {"do": "record", "kind": "wait", "seconds": -1},
        {"do": "record", "kind": "grip", "value": "ajar"},
        {"do": "delete", "index": 99},
        {"do": "delete", "index": True},
        {"do": "rename", "index": 0, "name": "x" * 61},
        {"do": "reorder", "index": 0, "to": 5},
        {"do": "blend", "index": 0, "blend": -1},
        {"do": "settings", "speed": 0},
        {"do": "settings", "speed": 101},
        {"do": "settings", "tool_speed": "fast"},
    ],
)
def test_an_edit_that_makes_no_sense_changes_nothing(program: Program, edit: dict[str, Any]) -> None:
    before = program.state()
    with pytest.raises(ArmkinError):
        program.edit(edit)
    assert program.state() == before


@pytest.mark.parametrize(
    "text",
    [
        "",
        "moves: 5",
        "moves:\n  - fly: [1, 2, 3]\n",
        "robot: ur5e\nmoves:\n  - joint: [0, 0, 0]\n",
        "moves:\n  - joint: [0, 0, 0]\n  - joint: [0, 0]\n",
        "moves:\n  - line: [390, 80]\n",
        "moves:\n  - arc: {via: [1, 2, 3], to: [390, 80]}\n",
        "moves:\n  - joint: nowhere\n",
        "\0",
        "x" * 999,
    ],
)
def test_a_file_that_is_no_path_changes_nothing(program: Program, text: str) -> None:
    before = program.state()
    with pytest.raises(ArmkinError):
        program.load(text, "broken.yaml")
    assert program.state() == before


def test_pages_share_one_program() -> None:
    with serve_robot() as server:
        first, second = Page(server), Page(server)
        first.hear("control", lambda news: news["holder"] == "yours")
        status, state = first.act("program", do="record", kind="joint", q=POSES[0])
        assert (status, len(state["moves"])) == (200, 1)
        assert second.hear("program") == state
        assert second.act("program", do="clear")[0] == 409
        assert Page(server).opened["program"] == state
        assert first.act("plan")[1]["duration_s"] > 0
        status, saved = first.act("save")
        assert saved["name"] == "three_dof_path.yaml"
        status, answer = first.act("load", text="moves:\n  - fly: 5\n", name="bad.yaml")
        assert status == 422
        assert "bad.yaml:2" in answer["error"]
        assert first.act("load", text=saved["text"], name="good.yaml")[0] == 200
        first.act("program", do="clear")
        assert first.act("plan")[0] == 422
        first.close()
        second.close()


def test_the_pose_where_a_move_ends(program: Program, arm: armkin.Arm) -> None:
    assert np.rad2deg(program.end_of(0, None)) == pytest.approx(POSES[0])
    for index, pose in ((1, POSES[1]), (2, POSES[2]), (4, POSES[2])):
        tip = armkin.fk(arm, np.deg2rad(pose))[:3, 3]
        assert armkin.fk(arm, program.end_of(index, None))[:3, 3] == pytest.approx(tip, abs=1e-5)


def test_a_file_with_too_few_numbers_names_the_move(program: Program) -> None:
    with pytest.raises(ArmkinError, match=r"short.yaml:3: move 2: three_dof has 3 joints .* got 2 values"):
        program.load("moves:\n  - joint: [0, 0, 0]\n  - joint: [0, 0]\n", "short.yaml")


@pytest.mark.parametrize("name", ["a\x07bell", "a\u2028b", "a\x85b", "a\ufeffb", "a\x1b[31m", "# a\nb", "\ud800"])
def test_a_name_is_saved_as_a_path_file_may_have_it(program: Program, tmp_path: Path, name: str) -> None:
    program.edit({"do": "rename", "index": 0, "name": name})
    assert program.names[0].isprintable()
    file = tmp_path / "named.yaml"
    file.write_text(program.text())
    assert len(path_file.read_path_file(str(file)).moves) == len(program.moves)


def test_what_is_played_is_where_the_tip_is_however_long_it_takes(arm: armkin.Arm) -> None:
    """Eleven minutes: with 1,500 samples the tip was shown 36 mm off."""
    recorded = Program(arm)
    recorded.edit({"do": "record", "kind": "joint", "q": POSES[0]})
    recorded.edit({"do": "settings", "tool_speed": 30})
    ring = "  - point: [390, 0, 300]\n  - circle: {centre: [340, 0, 300], normal: [0, 0, 1], turns: 62}\n"
    recorded.load(recorded.text() + ring, "long.yaml")
    plan = recorded.plan(None)
    assert plan.duration > 600
    shown = playback_json(arm, plan)
    t = np.sort(np.random.default_rng(3).uniform(0, plan.duration, 4000))
    time, joints = np.array(shown["time"]), np.array(shown["joints"])
    seen = np.stack([np.interp(t, time, joints[:, i]) for i in range(arm.n)], axis=-1)
    tips = armkin.fk(arm, np.deg2rad(seen))[:, :3, 3]
    distance = np.linalg.norm(tips - armkin.fk(arm, plan.q(t))[:, :3, 3], axis=1)
    assert distance.max() < 0.5
    assert shown["shown_mm"] < 0.5
    assert len(time) < 30_000


def test_an_edit_does_not_wait_for_a_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    import armkin.motion.path_planner.path

    with serve_robot() as server:
        page = Page(server)
        assert page.act("program", do="record", kind="joint", q=POSES[0])[0] == 200
        begun, go_on, plan = threading.Event(), threading.Event(), armkin.motion.path_planner.path.path

        def slow(*arguments: Any, **how: Any) -> Any:
            begun.set()
            assert go_on.wait(60)
            return plan(*arguments, **how)

        monkeypatch.setattr(armkin.motion.path_planner.path, "path", slow)
        answers: list[tuple[int, Any]] = []
        planning = threading.Thread(target=lambda: answers.append(page.act("plan")))
        planning.start()
        assert begun.wait(60)
        assert page.act("program", do="record", kind="joint", q=POSES[1])[0] == 200
        assert not answers
        go_on.set()
        planning.join()
        assert answers[0][0] == 200  # of the program as it was
        page.close()
