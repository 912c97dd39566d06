"""The JSON of the commands: what they print is what answers.py says, and docs/json.md says the same."""

from __future__ import annotations

import importlib.util
import json
import math
import re
import types
from pathlib import Path
from typing import Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints, is_typeddict

import numpy as np
import pytest

import armkin
from armkin.cli import answers
from armkin.cli.app import load_command
from armkin.cli.commands import COMMANDS
from command_line import ROOT, run

DOF = "three_dof"


def check_type(value: Any, hint: Any, context: str) -> None:
    """Hold a JSON value to a type: no key more, none less, no number that is not finite."""
    origin, parts = get_origin(hint), get_args(hint)
    if is_typeddict(hint):
        hints = get_type_hints(hint)
        assert isinstance(value, dict), context
        assert not value.keys() - hints.keys(), f"{context}: keys without a type"
        assert not hint.__required_keys__ - value.keys(), f"{context}: keys missing"
        for key, inner in value.items():
            check_type(inner, hints[key], f"{context}.{key}")
    elif origin is NotRequired:
        check_type(value, parts[0], context)
    elif origin is Literal:
        assert value in parts, context
    elif origin in (Union, types.UnionType):
        kinds = [part for part in parts if _fits_type(value, part)]
        assert kinds, f"{context}: {value!r}"
        check_type(value, kinds[0], context)
    elif origin is list:
        assert isinstance(value, list), context
        for i, inner in enumerate(value):
            check_type(inner, parts[0], f"{context}[{i}]")
    elif origin is dict:
        assert isinstance(value, dict), context
        for key, inner in value.items():
            check_type(inner, parts[1], f"{context}.{key}")
    elif hint is not Any:
        assert _fits_type(value, hint), f"{context}: {value!r}"


def _fits_type(value: Any, hint: Any) -> bool:
    if hint is type(None):
        return value is None
    if hint is float:
        return type(value) in (int, float) and math.isfinite(value)
    if hint in (int, str, bool):
        return type(value) is hint
    return isinstance(value, dict if is_typeddict(hint) or get_origin(hint) is dict else list)


GRBL, BUS = "tests/robots/three_dof_grbl.yaml", "tests/robots/bus_arm.yaml"
CASES: list[tuple[type, tuple[object, ...]]] = [
    (answers.Fk, ("fk", DOF, -30, 5, -5)),
    (answers.Fk, ("fk", DOF, 0, 130, 0, "--frames")),
    (answers.Ik, ("ik", DOF, 390, 80, 300, "--all-branches", "--turns")),
    (answers.Ik, ("ik", DOF, 900, 0, 0)),
    (answers.Ik, ("ik", DOF, 390, 80, 300, "--branch", "right")),
    (answers.Ik, ("ik", "ur5e", 300, -200, 400, 180, 0, 0)),
    (answers.Pulses, ("pulses", DOF, -30, 5, -5)),
    (answers.Pulses, ("pulses", DOF, 0, 130, 0, "--best")),
    (answers.Workspace, ("workspace", DOF, "--samples", 100, "--measure", "step_error")),
    (answers.Workspace, ("workspace", "planar_2dof", "--samples", 100)),
    (answers.Reach, ("reach", DOF, "--grid", 100, "--azimuths", 12)),
    (answers.Place, ("place", DOF, "TARGETS", "--step", 200, "--yaw", 90)),
    (answers.Robots, ("robots",)),
    *((answers.Export, ("export", name)) for name in ("three_dof", "stanford", "ra02_screws", "panda")),
    (answers.Ports, ("ports",)),
    (answers.DryRun, ("send", DOF, 10, 20, 30, "--dry-run")),
    (answers.Send, ("send", DOF, 10, 20, 30, "--port", "sim")),
    (answers.Path, ("path", DOF, "--via", "390,80,300", "--via", "390,20,300")),
    (answers.Path, ("path", DOF, "--via", "390,80,300", "--via", "390,-400,300")),
    (answers.PathMoved, ("path", DOF, "--via", "390,80,300", "--via", "390,20,300", "--port", "sim")),
    (answers.Suggested, ("calibrate", DOF, "--suggest", 3)),
    (answers.Calibrate, ("calibrate", DOF, "CSV")),
    (answers.StatusOfBoard, ("status", DOF, "--port", "sim")),
    (answers.Stands, ("jog", DOF, "q1", 5, "--seconds", 0.2, "--port", "sim")),
    (answers.Home, ("home", "SWITCHED", "--port", "sim")),
    (answers.Grip, ("grip", DOF, "closed", "--port", "sim")),
    (answers.StatusOfGrbl, ("status", GRBL, "--port", "sim")),
    (answers.StatusOfServos, ("status", BUS, "--port", "sim")),
    (answers.Send, ("send", GRBL, -30, 5, -5, "--port", "sim")),
    (answers.Send, ("send", BUS, 10, -5, "--port", "sim")),
    (answers.GripOfServo, ("grip", BUS, "closed", "--port", "sim")),
    (answers.Setup, ("setup", GRBL, "--port", "sim")),
    (answers.SetupOfKlipper, ("setup", "tests/robots/three_dof_klipper.yaml")),
    (answers.Zero, ("zero", BUS, "--port", "sim")),
    *((answers.Info, ("info", path.stem)) for path in sorted((ROOT / "robots").glob("*.yaml"))),
]


@pytest.mark.parametrize(
    ("kind", "words"), CASES, ids=lambda part: " ".join(map(str, part)) if type(part) is tuple else ""
)
def test_an_answer_has_its_keys_and_types(kind: type, words: tuple[object, ...], tmp_path: Path) -> None:
    made = {"CSV": measured_file, "SWITCHED": switched_file, "TARGETS": targets_file}
    completed = run(*(made[str(word)](tmp_path) if word in made else word for word in words), "--json")
    assert completed.code in (0, 3), completed.err
    check_type(completed.json, kind, kind.__name__)
    if completed.code:
        error = json.loads(completed.err)
        check_type({key: error[key] for key in get_type_hints(answers.Error) if key in error}, answers.Error, "Error")


def measured_file(folder: Path) -> Path:
    """Thirty poses of an arm that stands 5 mm beside its table, one of them a slip."""
    arm = armkin.load(DOF)
    q = np.random.default_rng(3).uniform(arm.lower, arm.upper, (30, arm.n))
    tips = armkin.fk(arm, q)[:, :3, 3] + [5.0, 0.0, 0.0]
    tips[7] += 40.0
    np.savetxt(folder / "tips.csv", np.hstack([np.rad2deg(q), tips]), delimiter=",")
    return folder / "tips.csv"


def targets_file(folder: Path) -> Path:
    """Two targets of an arm that may stand anywhere."""
    (folder / "targets.csv").write_text("x,y,z\n600,0,200\n600,300,200\n")
    return folder / "targets.csv"


def switched_file(folder: Path) -> Path:
    """The arm with a limit switch on every joint."""
    text = (ROOT / "robots" / "three_dof.yaml").read_text()
    for axis, switch_value in zip("XYZ", (-20, 75, -105), strict=True):
        homing = f"homing: {{switch: {axis}, direction: -1, at: {switch_value}, speed: 40, backoff: 3, normally: open}}"
        text = text.replace(f"    drive: {{axis: {axis},", f"    {homing}\n    drive: {{axis: {axis},")
    (folder / "switched.yaml").write_text(text)
    return folder / "switched.yaml"


def test_a_batch_has_one_a_row() -> None:
    for line in run("ik", DOF, "--batch", "-", "--json", stdin=b"390,80,300\n900,0,0\n").lines:
        check_type(line, answers.Ik, "Ik")


@pytest.mark.parametrize(
    "value",
    [{}, {"robot": "a", "robot_file": "b"}, {"robot": 1, "robot_file": "b", "robot_sha256": "c"}, [], None],
)
def test_a_wrong_answer_is_noticed(value: Any) -> None:
    with pytest.raises(AssertionError):
        check_type(value, answers.Head, "Head")


def test_every_command_with_json_has_a_type_and_a_case() -> None:
    with_json = {name for name in COMMANDS if any("--json" in p.opts for p in load_command(name).params)}
    assert with_json == answers.ANSWERS.keys()
    tried = {kind for kind, _ in CASES} | {answers.Flash}  # tests/flash: it needs an image
    assert {kind for kinds in answers.ANSWERS.values() for kind in kinds} == tried


def test_every_key_on_the_page_has_a_meaning_and_every_length_and_angle_its_unit() -> None:
    rows = [line[2:-2].split(" | ") for line in _json_docs().page().splitlines() if line.startswith("| `")]
    keys = [row for row in rows if len(row) == 3]  # the others are commands
    assert len(keys) > 300
    for key, value, meaning in keys:
        assert len(meaning.split()) > 1, key
        if "number" in value and key.partition("` ")[0].strip("`").endswith(("_mm", "_deg", "_mm2", "_mm3", "_s")):
            assert re.search(r"\[(mm|mm2|mm3|deg|s)\]", meaning), (key, meaning)


def test_the_page_is_written_from_the_types() -> None:
    module = _json_docs()
    assert Path(module.PAGE).read_text() == module.page(), "run scripts/json_docs.py"


def _json_docs() -> Any:
    path = ROOT / "scripts" / "json_docs.py"
    spec = importlib.util.spec_from_file_location("json_docs", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
