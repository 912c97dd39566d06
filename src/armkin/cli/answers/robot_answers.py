"""Answers about robot files: info, robots, export."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Any, Literal, NotRequired, TypedDict

from armkin.cli.answers.shared_keys import Head, Hit
from armkin.model.units import JointUnits

_Ends = TypedDict(
    "_Ends",
    {
        "from": Annotated[list[float], "where its axis begins: x, y, z [mm]"],
        "to": Annotated[list[float], "where its axis ends: x, y, z [mm]"],
    },
)


class Solver(TypedDict):
    """How targets are solved."""

    method: Annotated[str, "the class of solution"]
    why: Annotated[str, "why that class applies"]
    complete: Annotated[bool, "whether no real branch is missing, as a rule; ik says it of each target"]


class Solving(TypedDict):
    """What `ik` solves for, and how."""

    task: Annotated[str | None, "the task: what a target of ik prescribes; null: none fits the arm"]
    target_labels: Annotated[list[str], "names of a target's numbers"]
    target_units: Annotated[list[str], "unit of each of a target's numbers: mm or deg"]
    solver: Annotated[Solver | None, "how ik solves this task; null: it does not"]
    ik_refuses: Annotated[str | None, "why there is no solver; null: there is one"]
    redundant: Annotated[NotRequired[str], "where the arm has one joint to spare: the joint whose intervals ik gives"]


class BodySegment(_Ends):
    """A part of a body."""

    slide: Annotated[NotRequired[bool], "true: it begins where the body before ends, given for the home pose"]


class BodyOf(TypedDict):
    """What a joint moves."""

    name: Annotated[str, "the joint's name, or base"]
    radius_mm: Annotated[float, "radius of the capsules along it [mm]"]
    assumed: Annotated[bool, "whether no file states the radius: it is 2 % of the reach then"]
    segments: Annotated[
        list[BodySegment],
        "axes of its capsules, in the frame that the body moves with: fk --frames has it",
    ]


class KeepOuts(TypedDict):
    """Bodies, and what they are held against; absent where there are no keep-outs."""

    clearance_mm: Annotated[NotRequired[float], "distance that is to be kept from keep-outs [mm]"]
    keep_out: Annotated[NotRequired[list[str]], "names of the keep-outs; self: the arm itself"]
    bodies: Annotated[NotRequired[list[BodyOf]], "the arm's bodies"]
    pairs_left_out: Annotated[
        NotRequired[list[list[str]]],
        "pairs of bodies that overlap in every posture looked at, and are not checked",
    ]
    hits_at_home: Annotated[NotRequired[list[Hit]], "pairs that are too near in the home pose"]


class Info(Head, Solving, KeepOuts):
    """What a robot file says."""

    description: Annotated[str, "what the arm is, in the file's words"]
    source: Annotated[str, "where the numbers come from"]
    convention: Annotated[
        Literal["standard", "modified", "screws"],
        "convention of the file's table: standard or modified DH, or screw axes",
    ]
    joint_units: JointUnits
    joints: Annotated[list[dict[str, Any]], "the joints as in the robot file, with all defaults"]
    poses: Annotated[dict[str, list[float]], "the named poses, home first: joint values [deg or mm]"]
    base: Annotated[dict[str, list[float]], "where the chain begins: xyz [mm], rpy [deg]"]
    tool: Annotated[dict[str, list[float]], "the tool in the last joint's frame: xyz [mm], rpy [deg]"]
    zero_pose: Annotated[
        dict[str, list[float]] | None,
        "convention screws: the end frame when all joints are 0, xyz [mm], rpy [deg]; else null",
    ]
    pitch_offset: Annotated[float, "constant that is added to a target's phi [deg]"]
    reach_mm: Annotated[float, "no point of the chain is farther from its first joint [mm]"]
    motors: Annotated[list[dict[str, Any]], "the motors as in the robot file, with what their step chain multiplies to"]
    one_to_one: Annotated[bool, "whether each joint has a motor of its own"]
    resolution: Annotated[
        list[float] | None,
        "what one pulse is worth at each joint [deg or mm]; null: the file has no drives",
    ]
    gripper: Annotated[dict[str, Any] | None, "the gripper as in the robot file; null: none"]
    board: Annotated[dict[str, Any] | None, "the board as in the robot file; null: none"]
    lacks: Annotated[dict[str, list[str]], "what the file lacks for pulses, simulate, send and home; empty: nothing"]
    lines_to_add: Annotated[list[str], "lines for the file that send asks for, with examples for figures"]


class ShippedRobot(Head):
    """A robot that comes with armkin."""

    description: Annotated[str, "what the arm is, in the file's words"]
    joints: Annotated[list[str], "names of the joints"]
    joint_types: Annotated[list[str], "kind of each joint: revolute or prismatic"]
    task: Annotated[str | None, "the task: what a target of ik prescribes; null: none fits the arm"]
    target_labels: Annotated[list[str], "names of a target's numbers"]
    can: Annotated[dict[str, bool], "whether the file suffices for ik, pulses, simulate, send and home"]
    lacks: Annotated[dict[str, list[str]], "what each of these lacks, in words"]
    compared: Annotated[str, "what the geometry was compared with: a maker's figure, or only a URDF"]


class Robots(TypedDict):
    """The robots that come with armkin."""

    robots: Annotated[list[ShippedRobot], "one entry a robot, in alphabetical order"]


class Export(Head):
    """`export --json`: the arm in numbers."""

    length_unit: Annotated[Literal["mm"], "unit of all lengths"]
    angle_unit: Annotated[Literal["deg"], "unit of all angles"]
    joints: Annotated[
        list[dict[str, Any]],
        "the joints: name, type, unit, screw {w, q or v}, sign, ratio, limits, home, rates",
    ]
    base: Annotated[list[list[float]], "where the chain begins: a homogeneous matrix, 4 x 4, row by row"]
    zero_pose: Annotated[dict[str, list[float]], "the end frame when all joints are 0: xyz [mm], rpy [deg]"]
    tool: Annotated[dict[str, list[float]], "the tool in the end frame: xyz [mm], rpy [deg]"]
    links: Annotated[
        list[list[list[float]]],
        "constant matrices, 4 x 4: the tool's pose is links[0] Z1(q1) links[1] ... Zn(qn) links[n]",
    ]
    dh_standard: Annotated[dict[str, Any] | None, "standard DH table: base, rows, tool; null: none gives this arm"]
    dh_modified: Annotated[dict[str, Any] | None, "modified DH table: base, rows, tool; null: none gives this arm"]
