"""`armkin grip` on the simulated board."""

from __future__ import annotations

from command_line import THREE_DOF, run


def test_grip() -> None:
    closed = run("grip", THREE_DOF, "closed", "--port", "sim", "--json")
    assert closed.json["counts"] == 1833
    assert run("grip", THREE_DOF, 75, "--port", "sim", "--json").json["counts"] == 1333
    assert run("grip", THREE_DOF, 30, "--port", "sim").out == "gripper: 29.97 deg (833 us)\n"
    assert run("grip", THREE_DOF, 130, "--port", "sim").code == 2
    assert "have no max_speed" in run("grip", "robots/planar_2dof.yaml", "open", "--port", "sim").err
