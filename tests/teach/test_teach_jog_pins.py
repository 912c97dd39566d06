"""The tip jogged on the emulated board: what its pins do, step by step."""

from __future__ import annotations

import numpy as np
from emulator import EmulatedBoard
from pins import net_steps, rests_within
from served_page import Page, serve_robot

import armkin

BENT = [0.0, 60.0, -60.0]  # three_dof, far from its edges
HALF_A_STEP = 0.14  # [mm] of all motors, at the tip
AXES = "XYZ"


def tips_from(board: EmulatedBoard, arm: armkin.Arm, counts: list[int]) -> np.ndarray:
    """Where the tip was after every step [mm] since the pins stood at these counts for the last time."""
    trace = board.trace()
    steps = [trace.positions(axis) for axis in AXES]
    when = np.sort(np.concatenate([cycle for cycle, _ in steps]))
    counts_at = np.stack([np.append(0, sums)[np.searchsorted(cycle, when, "right")] for cycle, sums in steps], axis=1)
    since = np.flatnonzero((counts_at == counts).all(axis=1)).max()
    way: np.ndarray = armkin.fk(arm, armkin.joints(arm, counts_at[since:]))[:, :3, 3]
    return way


def test_every_step_keeps_the_line_and_a_lost_sign_of_life_stops_it() -> None:
    arm = armkin.load("three_dof")
    with EmulatedBoard(trace=True) as board, serve_robot(board=board.port) as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        assert page.act("assume_home", consent=True)[0] == 200
        page.idle()
        assert page.act("send", q=BENT, speed=100)[0] == 200
        began = page.idle()["pulses"]
        assert began == net_steps(board)
        start = armkin.fk(arm, armkin.joints(arm, began))[:3, 3]
        far = start[1] + 30
        page.jog(
            lambda now: armkin.fk(arm, armkin.joints(arm, net_steps(board)))[1, 3] >= far,
            axis="y",
            frame="base",
            percent=40,
        )
        rests_within(board, 1.5)  # 0.3 s after the last sign of life it brakes
        state = page.idle()
        page.close()
        assert (state["position"], state["error"]) == ("known", "")
        assert state["pulses"] == net_steps(board)
        way = tips_from(board, arm, began) - start
        stats = board.stats()
    assert 30 < way[-1][1] < 200  # the line would have gone on to the edge of the reach
    assert np.abs(way[:, [0, 2]]).max() < 0.05 + HALF_A_STEP  # the path's tolerance
    assert (way[:, 1] > np.maximum.accumulate(way[:, 1]) - 2 * HALF_A_STEP).all()
    for axis in AXES:
        assert set(stats["axes"][axis]["violations"].values()) == {0}
