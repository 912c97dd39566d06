"""What is told of an arm on its board, as JSON: where it stands, what a plan comes to."""

from __future__ import annotations

from typing import Annotated, TypedDict


class Where(TypedDict):
    """Where the arm stands."""

    position: Annotated[str, "known, retained (over a reset of the board) or lost"]
    pulses: Annotated[list[int] | None, "of every motor, as the board counts; null while lost"]
    joints: Annotated[list[float] | None, "[deg or mm]; null while lost"]
    joint_units: Annotated[list[str], "deg or mm"]
    position_mm: Annotated[list[float] | None, "of the tool; null while lost"]


class Summary(TypedDict):
    """What a plan comes to."""

    waypoints: int
    start_joints: Annotated[list[float], "where it begins [deg or mm]"]
    joints: Annotated[list[float], "where it ends: the joint values of whole pulses [deg or mm]"]
    joint_units: Annotated[list[str], "deg or mm"]
    motors: Annotated[list[str], "names"]
    pulse_units: Annotated[list[str], "step, us or count"]
    start_pulses: list[int]
    pulses: Annotated[list[int], "at the end"]
    moves: Annotated[list[int], "pulses of every motor, signed"]
    position_mm: Annotated[list[float], "of the tool at the end"]
    duration_s: float
    segments: Annotated[int, "pieces of constant acceleration that the board is sent"]
    top_speed: Annotated[list[float], "greatest speed of every joint [deg/s or mm/s]"]
    top_rate: Annotated[list[float], "greatest rate of every motor [pulses/s]"]
