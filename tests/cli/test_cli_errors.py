"""Errors for programs: one JSON object on stderr; the core knows no option."""

from __future__ import annotations

import ast
import json
import pickle
import re
from pathlib import Path
from typing import Any

import pytest

from armkin import errors
from armkin.cli import advice
from armkin.cli.app import load_command, option_names
from armkin.cli.commands import COMMANDS
from command_line import run
from source_trees import nodes_of

SOURCE = Path(__file__).parents[2] / "src" / "armkin"
DOF = "robots/three_dof.yaml"


def error_of(*words: object, stdin: bytes = b"") -> dict[str, Any]:
    """The error of a command line under --json, whose stdout must be empty."""
    completed = run(*words, "--json", stdin=stdin)
    assert completed.out == ""
    error: dict[str, Any] = json.loads(completed.err)
    assert error["exit_code"] == completed.code
    return error


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("fk", "nope"), {"kind": "file", "exit_code": 1, "file": "nope"}),
        (("fk", DOF, 1, 2), {"kind": "usage", "exit_code": 2, "names": ["q1", "q2", "q3"], "got": 2}),
        (("fk", DOF, 1, "x", 3), {"kind": "usage", "argument": "q2", "value": "x"}),
        (("fk", DOF, 1, 2, 3, "--jsn"), {"kind": "usage", "exit_code": 2}),
        (("fq",), {"kind": "usage", "exit_code": 2}),
        (("ik", "panda", 1, 2, 3, "--task", "xyz"), {"kind": "redundant_arm", "exit_code": 2, "surplus": 4}),
        (("send", DOF, 0, 500, 0, "--port", "sim"), {"joint": "q2", "value": 500.0}),  # as typed: 500.00000000000006
        (("send", DOF, 0, 121, 0, "--port", "sim"), {"kind": "no_solution", "joint": "q2", "value": 121, "upper": 120}),
        (("send", DOF, 0, 0, 0, "--port", "/no/port"), {"kind": "link", "exit_code": 5}),
        (("fk", DOF, "--batch", "-", "--out", "/no/such/folder/x"), {"kind": "file", "exit_code": 1}),
    ],
)
def test_an_error_is_one_object(words: tuple[object, ...], expected: dict[str, Any]) -> None:
    answer = error_of(*words)
    assert answer["error"]
    assert {key: answer[key] for key in expected} == expected


def test_an_invalid_robot_file_names_its_line(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text("name: bad\nconvention: standard\njoints: [{name: q1, dh: {alpha: 0, a: 1, d: 2}}]\nbored: 1\n")
    answer = error_of("info", path)
    assert (answer["kind"], answer["exit_code"], answer["file"], answer["line"]) == ("robot_file", 4, str(path), 4)


def test_a_row_is_named() -> None:
    completed = run("fk", DOF, "--batch", "-", "--json", stdin=b"1,2,3\n1,2\n")
    assert completed.code == 2
    assert len(completed.lines) == 1  # the complete rows before it stand
    assert json.loads(completed.err)["row"] == 2


def test_without_a_solution_both_are_there() -> None:
    completed = run("ik", DOF, 900, 0, 0, "--json")
    assert (completed.code, completed.json["best"]) == (3, None)
    answer = json.loads(completed.err)
    assert (answer["kind"], answer["status"]) == ("no_solution", "unreachable")
    assert answer["distance_mm"] == completed.json["closest"]["distance_mm"]


def test_notes_and_warnings_go_into_the_error() -> None:
    completed = run("ik", DOF, 0.5, 0, 0.3, "--json")
    answer = json.loads(completed.err)
    assert answer["exit_code"] == 3
    assert len(answer["notes"]) == 1


def test_without_an_error_notes_and_warnings_are_lines() -> None:
    completed = run("fk", DOF, 0, 130, 0, "--json")
    assert completed.code == 0
    assert completed.err.startswith("warning: q2 = 130 deg is outside")


def command_line(*words: str) -> advice.CommandLine:
    return advice.CommandLine([*words], option_names(words))


def test_errors_survive_pickling() -> None:
    error = errors.RedundantArmError("too many", advice="hold one", joints=["J1"], surplus=1)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.fields, again.advice) == ("too many: hold one", error.fields, "hold one")


def test_a_program_reads_other_advice_than_a_terminal() -> None:
    error = errors.RedundantArmError("7 joints", advice="hold 1 with armkin.lock", joints=["J1", "J2"], surplus=1)
    assert str(error) == "7 joints: hold 1 with armkin.lock"
    said = {name: advice.next_step(error, command_line(name)) for name in ("ik", "path", "reach", "nothing")}
    assert said["path"] == "fix 1 of J1, J2 with --lock JOINT=VALUE"
    assert said["ik"] == f"{said['path']}, or try values with --sweep JOINT=LOW:HIGH:COUNT"
    assert said["reach"] == said["nothing"] == "ik --lock and Python's armkin.lock hold joints"
    assert advice.message_with_advice(error, command_line("path")) == f"7 joints: {said['path']}"


def test_what_is_advised_is_an_option_of_the_command() -> None:
    """Whatever the error: a command that lacks an option is not told to take it."""
    fields: dict[str, Any] = {
        "joints": ["J1"], "surplus": 1, "robot_file": "three_dof", "port": "COM3", "homing": False, "process": 7,
    }  # fmt: skip
    needs = [{"needs": need} for need in ("blend", "task", "task pose", "other joint")]
    cases: list[errors.ArmkinError] = [errors.UsageError("", **more) for more in needs]
    cases += [
        kind("", **fields) for kind in (errors.RedundantArmError, errors.PositionLostError, errors.UnfinishedError)
    ]
    for name in ("jog", "reach", "place", "workspace", "send", "path", "ik", "relax", "begin"):
        for error in cases:
            words = re.sub(
                r"armkin \w+ [^,;]*|ik --lock", "", advice.next_step(error, command_line(name))
            )  # other commands' options
            named = {option.replace("--assume-home", "--assume") for option in re.findall(r"--[a-z-]+", words)}
            assert named <= set(option_names([name])), (name, words)


def test_every_kind_that_has_advice_is_raised_somewhere() -> None:
    source = "".join(path.read_text() for path in SOURCE.rglob("*.py"))
    for kind in advice._WORDS:
        assert re.search(rf"(raise|return) {kind.__name__}\(", source), kind


def test_no_text_of_the_core_names_an_option() -> None:
    options = {word for name in COMMANDS for p in load_command(name).params for word in p.opts if word.startswith("--")}
    naming = [
        f"{module}:{node.lineno}: {word}"
        for module, node in nodes_of(ast.Constant)
        if isinstance(node.value, str) and not f"{module}.".startswith("armkin.cli.")
        for word in re.findall(r"(?<![\w-])--[a-z][a-z-]*", node.value)
        if word in options
    ]
    assert not naming
