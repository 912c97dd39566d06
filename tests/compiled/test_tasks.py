"""`armkin.compile` of an arm for a task: no library is built that nobody asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import armkin
from armkin.compiled import compiled_arm, toolchain


def watch_loading(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What libraries hold as `arm_content` from now on, one by one; no arm has any yet."""
    contents: list[str] = []
    load = toolchain.load_library

    def count_and_call(source: str, content: str, level: int = 3) -> object:
        contents.append(content)
        return load(source, content, level)

    monkeypatch.setattr(toolchain, "load_library", count_and_call)
    compiled_arm._compiled_arm.cache_clear()
    return contents


@pytest.mark.usefixtures("quickly")
def test_a_task_by_name_is_built_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The arm's usual task, and that of the arm whose last joint is held, were built, too."""
    arm, contents = armkin.load("ur5e"), watch_loading(monkeypatch)
    fast = armkin.compile(arm, "xyz_axis")
    T = armkin.fk(arm, arm.home)
    np.testing.assert_allclose(fast.fk(arm.home), T, atol=1e-9)
    solutions = fast.ik(np.concatenate([T[:3, 3], T[:3, 2]]), "xyz_axis")
    assert solutions.status == armkin.Status.EXACT
    assert len(contents) == 2  # the chain; five joints, a sixth held


def test_the_usual_task_by_its_name_is_the_usual_one(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, contents = armkin.load("three_dof"), watch_loading(monkeypatch)
    for task in ("xyz", None, "xyz"):
        assert armkin.compile(arm, task).ik([390, 80, 300], task).valid.sum() == 4
    assert len(contents) == 1


@pytest.mark.usefixtures("quickly")
def test_the_files_task_is_not_the_one_that_the_structure_suggests() -> None:
    arm = replace(armkin.load("so101"), task="xyz_axis")
    fast, T = armkin.compile(arm, "xyz_pitch_roll"), armkin.fk(arm, arm.home + 0.1)
    target = np.concatenate([T[:3, 3], T[:3, 2]])
    solutions = fast.ik(target)
    assert solutions.task.name == "xyz_axis"
    assert solutions.valid.sum() == armkin.ik(arm, target).valid.sum() > 0
