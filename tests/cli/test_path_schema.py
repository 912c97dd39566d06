"""The shipped schema of path files is the model's, and the example is a valid path."""

from __future__ import annotations

import json

import pytest

import armkin
from armkin import path_file
from command_line import ROOT, run


def test_the_shipped_schema_is_the_models() -> None:
    shipped = json.loads((ROOT / "robots" / "path.schema.json").read_text())
    assert shipped == path_file.json_schema(), "armkin schema --path -o robots/path.schema.json"
    assert run("schema", "--path").json == shipped


def test_the_example_is_carried_and_ends_at_home() -> None:
    arm = armkin.load("three_dof")
    plan = armkin.path(arm, ROOT / "examples" / "pick_and_place.yaml")
    assert plan.q(plan.duration) == pytest.approx(arm.home)
    assert [marker.value for marker in plan.markers] == ["open", "closed", "open"]


@pytest.mark.parametrize("key", ["moves", "tolerance", "start", "blend"])
def test_the_keys_of_the_documentation_are_the_models(key: str) -> None:
    assert f"{key}:" in (ROOT / "docs" / "paths.md").read_text()
    assert key in path_file.PathFile.model_fields
