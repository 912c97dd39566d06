"""Answers of fk and pulses."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, NotRequired, TypedDict

from armkin.cli.answers.shared_keys import Head, Near, Tooled, Violation
from armkin.model.units import JointUnits


class Frame(TypedDict):
    """A frame of the arm."""

    name: Annotated[str, "base, the joint's name, or tool"]
    position_mm: Annotated[list[float], "the frame's origin x, y, z in the base frame [mm]"]
    rotation: Annotated[list[list[float]], "its rotation matrix in the base frame, 3 x 3, row by row"]


class Fk(Head, Tooled, Near):
    """Where the tool is."""

    joints: Annotated[list[float], "joint values as given [deg or mm]"]
    joint_units: JointUnits
    position_mm: Annotated[list[float], "the tool's x, y, z in the base frame [mm]"]
    rotation: Annotated[list[list[float]], "the tool's rotation matrix in the base frame, 3 x 3, row by row"]
    rpy_deg: Annotated[list[float], "the same as roll, pitch, yaw [deg]: R = Rz(yaw) Ry(pitch) Rx(roll)"]
    quaternion_wxyz: Annotated[list[float], "the same as a unit quaternion, w first"]
    within_limits: Annotated[bool, "whether every joint is within its limits"]
    violations: Annotated[list[Violation], "the joints that are outside their limits"]
    frames: Annotated[NotRequired[list[Frame]], "with --frames: every frame of the chain, base first, tool last"]


class PulsePositions(TypedDict):
    """The tool with and without rounding."""

    theoretical: Annotated[list[float], "x, y, z for the joint values as given [mm]"]
    actual: Annotated[list[float], "x, y, z for whole pulses [mm]"]
    difference: Annotated[list[float], "distance between the two along each axis, without sign [mm]"]


class Rounded(TypedDict):
    """Plain rounding, beside --best."""

    pulses: Annotated[list[int], "each motor's nearest whole pulse"]
    error_mm: Annotated[float, "the tool's distance from its exact position with these pulses [mm]"]


_From = TypedDict("_From", {"from": Annotated[list[float], "joint values where `moves` begin [deg or mm]"]})


class Pulses(Head, _From, Near):
    """Motor pulses of a pose."""

    motors: Annotated[list[str], "names of the motors"]
    pulse_units: Annotated[list[str], "unit of each motor's pulses: step, us (RC servos) or count (bus servos)"]
    joint_units: JointUnits
    resolution: Annotated[list[float], "what one pulse is worth at each joint [deg or mm]"]
    joints: Annotated[list[float], "joint values as given [deg or mm]"]
    pulses: Annotated[list[int], "position of every motor, counted from home [pulses]"]
    moves: Annotated[list[int], "how far every motor turns from the pose of --from, signed [pulses]"]
    actual_joints: Annotated[list[float], "joint values at which the whole pulses put the joints [deg or mm]"]
    position_mm: Annotated[PulsePositions, "the tool's position in the base frame, exact and with whole pulses"]
    error_mm: Annotated[float, "distance between these two positions [mm]"]
    within_limits: Annotated[bool, "whether every joint is within its limits"]
    violations: Annotated[list[Violation], "the joints that are outside their limits"]
    outside_travel: Annotated[list[str], "motors whose servo cannot turn that far"]
    rounded: Annotated[NotRequired[Rounded], "with --best: plain rounding, to compare with"]
    gain_mm: Annotated[NotRequired[float], "with --best: how much nearer the tool is than with plain rounding [mm]"]
    tried: Annotated[NotRequired[int], "with --best: how many pulse vectors were compared"]
