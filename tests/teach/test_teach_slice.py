"""The slice of reach on the page: the cells of `armkin.reach` in the plane of the arm's links, as cubic voxels."""

from __future__ import annotations

import numpy as np
import pytest
from browser_page import open_page, wait_until
from playwright.sync_api import Browser
from served_page import serve_actions

import armkin
from armkin.errors import UsageError
from armkin.reachability import voxels
from armkin.reachability.reach_cells import Grid
from armkin.teach.actions import Actions
from armkin.teach.reach_slice import DIRECTION_COUNT, VALUE_COUNT, VOXELS_ACROSS, reach_slice


def test_voxels_are_shown_and_hidden_again(browser: Browser) -> None:
    arm = armkin.load("three_dof")
    with serve_actions(Actions(arm)) as server, open_page(browser, server.address) as page:
        slice_button = page.get_by_role("button", name="Slice")
        slice_button.click()
        wait_until(page, "document.getElementById('legend').innerText.includes('share of 1 orientations')")
        assert slice_button.get_attribute("aria-pressed") == "true"
        slice_button.click()
        wait_until(page, "!document.getElementById('legend').innerText.includes('voxels')")


def test_a_voxel_says_what_ik_says_of_its_centre() -> None:
    arm = armkin.load("puma560")
    answer = reach_slice(arm)
    centres = np.reshape(answer["centres"], (-1, 3))
    assert answer["size"] == pytest.approx(arm.reach / VOXELS_ACROSS)
    assert answer["of"] == DIRECTION_COUNT
    assert len(centres) == len(answer["shares"]) > 20
    assert (centres[:, 1] == 0).all()
    F = np.array(answer["frame"])
    for i in (0, len(centres) // 2, len(centres) - 1):
        back = centres[i, 0] < 0
        turned = np.diag([-1.0, -1.0, 1.0]) if back else np.eye(3)  # the cell's own frame: x outwards
        n = np.arange(DIRECTION_COUNT)
        z = 1 - (2 * n + 1) / DIRECTION_COUNT
        away = np.stack([np.sqrt(1 - z**2) * f(n * np.pi * (3 - np.sqrt(5))) for f in (np.cos, np.sin)] + [z], axis=1)
        T = np.tile(np.eye(4), (DIRECTION_COUNT, 1, 1))
        for goal, direction in zip(T, away, strict=True):
            x = np.cross(direction, [0.3, 0.5, 0.1])  # the roll is free: joint 6 turns all round
            x /= np.linalg.norm(x)
            goal[:3, :3] = F[:3, :3] @ turned @ np.stack([x, np.cross(direction, x), direction], axis=1)
            goal[:3, 3] = F[:3, 3] + F[:3, :3] @ centres[i]
        assert armkin.ik(arm, T).within_limits.any(axis=1).mean() == pytest.approx(answer["shares"][i], abs=1e-4)


def test_of_seven_joints_one_of_some_values_must_reach_and_no_task_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """With J7 at home alone every target of an iiwa7 was singular, and the slice took 25 s."""
    monkeypatch.setattr("armkin.teach.reach_slice.VOXELS_ACROSS", 4)
    arm = armkin.load("iiwa7")
    answer = reach_slice(arm)
    assert (answer["held"], answer["values"]) == ("J7", VALUE_COUNT)
    grid = Grid(arm, arm.reach / 4, 2, DIRECTION_COUNT, 1, False)
    row = voxels.section_layer(grid).row
    total = 0.0
    for k in row[:: len(row) // 4].tolist():
        rings = np.repeat(grid.rings[[k // 2]], DIRECTION_COUNT, axis=0)
        away = np.full(DIRECTION_COUNT, k % 2 * np.pi)
        T = grid.targets(rings, away, np.arange(DIRECTION_COUNT), np.zeros(DIRECTION_COUNT))
        exact = (armkin.ik(arm, T).best >= 0).mean()  # at any value
        centre = np.linalg.inv(grid.frame)[:3] @ T[0, :, 3]
        apart = np.linalg.norm(np.reshape(answer["centres"], (-1, 3)) - centre, axis=1)
        share = answer["shares"][apart.argmin()] if apart.min() < 1.0 else 0.0
        assert exact - 0.3 <= share <= exact + 1e-4
        total += share
    assert total > 0.5
    assert reach_slice(armkin.load("kinova_gen3"))["values"] == 1
    with pytest.raises(UsageError, match="no task fits"):
        reach_slice(armkin.load("pan_tilt"))
