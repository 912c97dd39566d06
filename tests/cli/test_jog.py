"""`armkin jog` on the simulated board."""

from __future__ import annotations

import pytest

from command_line import THREE_DOF, run


def test_jog() -> None:
    done = run("jog", THREE_DOF, "q1", -30, "--port", "sim", "--seconds", "0.5", "--json")
    assert done.code == 0, done.err
    assert -20 < done.json["joints"][0] < -13
    assert done.json["joints"][1:] == pytest.approx([90, -90])
    assert run("jog", THREE_DOF, "q9", 5, "--port", "sim").code == 2
    assert run("jog", THREE_DOF, "q1", 61, "--port", "sim").code == 2
