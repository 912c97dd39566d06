"""The JSON types of an arm's position and of the summary of a plan."""

from typing import Annotated, TypedDict

from armkin.model.units import JointUnits


class Where(TypedDict):
    """The position of an arm."""

    position: Annotated[
        str,
        "whether the board knows where the arm stands: known, retained (over a reset of the board) or lost",
    ]
    pulses: Annotated[list[int] | None, "position of every motor, as the board counts [pulses]; null while lost"]
    joints: Annotated[list[float] | None, "joint values [deg or mm]; null while lost"]
    joint_units: JointUnits
    position_mm: Annotated[list[float] | None, "the tool's x, y, z in the base frame [mm]; null while lost"]


class Summary(TypedDict):
    """The summary of a plan."""

    waypoints: Annotated[int, "how many waypoints it goes through"]
    start_joints: Annotated[list[float], "joint values where it begins [deg or mm]"]
    joints: Annotated[list[float], "joint values where it ends, those of whole pulses [deg or mm]"]
    joint_units: JointUnits
    motors: Annotated[list[str], "names of the motors"]
    pulse_units: Annotated[list[str], "unit of each motor's pulses: step, us or count"]
    start_pulses: Annotated[list[int], "position of every motor where it begins [pulses]"]
    pulses: Annotated[list[int], "position of every motor at the end [pulses]"]
    moves: Annotated[list[int], "how far every motor turns, signed [pulses]"]
    position_mm: Annotated[list[float], "the tool's x, y, z at the end [mm]"]
    duration_s: Annotated[float, "planned duration [s]"]
    segments: Annotated[int, "pieces of constant acceleration, or positions, that the board is sent"]
    top_speed: Annotated[list[float], "greatest speed of every joint [deg/s or mm/s]"]
    top_rate: Annotated[list[float], "greatest rate of every motor [pulses/s]"]
