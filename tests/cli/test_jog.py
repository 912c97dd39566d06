"""`armkin jog` on the simulated board."""

from __future__ import annotations

import pytest

from command_line import THREE_DOF, run


def test_jog() -> None:
    completed = run("jog", THREE_DOF, "q1", -30, "--port", "sim", "--seconds", "0.5", "--json")
    assert completed.code == 0, completed.err
    assert -20 < completed.json["joints"][0] < -13
    assert completed.json["joints"][1:] == pytest.approx([90, -90])
    assert run("jog", THREE_DOF, "q9", 5, "--port", "sim").code == 2
    assert run("jog", THREE_DOF, "q1", 61, "--port", "sim").code == 2
