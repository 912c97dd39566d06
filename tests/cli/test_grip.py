"""`armkin grip` on the simulated board."""

from __future__ import annotations

from command_line import THREE_DOF, run


def test_grip() -> None:
    closed = run("grip", THREE_DOF, "closed", "--port", "sim", "--json")
    assert closed.json["counts"] == 1833
    assert run("grip", THREE_DOF, 75, "--port", "sim", "--json").json["counts"] == 1333
    assert run("grip", THREE_DOF, 30, "--port", "sim").out == "gripper: 29.97 deg (833 us)\n"
    assert run("grip", THREE_DOF, 29.97, "--port", "sim").code == 0  # what it says, it takes
    assert "have no max_speed" in run("grip", "robots/planar_2dof.yaml", "open", "--port", "sim").err


def test_a_value_beyond_the_gripper_is_refused_in_the_file_s_numbers() -> None:
    """Not in those of the nearest counts, 29.97 to 119.97 degrees."""
    for value in (29.9, 130):
        refused = run("grip", THREE_DOF, value, "--port", "sim")
        assert refused == (2, "", f"error: grip: {value} is outside of the gripper's 30 to 120\n")
