"""Answers about an arm: where it is, what reaches, what its file says, how it was measured; and errors."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Any, Literal, NotRequired, TypedDict


class Head(TypedDict):
    """What every answer about a robot begins with, so that one command's output can be piped into the next."""

    robot: Annotated[str, "the arm's name"]
    robot_file: Annotated[str, "as given: a path, or the name of a shipped robot"]
    robot_sha256: Annotated[str, "of the file's bytes: a changed file is noticed"]
    scene: Annotated[NotRequired[str], "with --scene: the file as given"]
    scene_sha256: Annotated[NotRequired[str], "of its bytes"]


class Tooled(TypedDict):
    """What answers begin with that may be asked for another tool."""

    tool: Annotated[NotRequired[dict[str, list[float]]], "with --tool: xyz, rpy, in place of the robot file's"]


class Violation(TypedDict):
    """A joint outside its limits."""

    joint: str
    value: Annotated[float, "[deg or mm]"]
    lower: Annotated[float | None, "null: unlimited"]
    upper: Annotated[float | None, "null: unlimited"]


Hit = TypedDict(
    "Hit",
    {
        "body": Annotated[str, "of the arm: the joint's name that moves it, or base"],
        "with": Annotated[str, "the keep-out's name, or another body's"],
        "depth_mm": Annotated[float, "how far nearer than the clearance it is"],
    },
)
Hit.__doc__ = "A pair that is too near."


class Near(TypedDict):
    """What a posture is near to, where there are keep-outs."""

    clearance_mm: Annotated[NotRequired[float | None], "least distance of any pair, clearance taken off; null: none"]
    hits: Annotated[NotRequired[list[Hit]], "pairs that are too near, the deepest first: body, with, depth_mm"]


class Frame(TypedDict):
    """A frame of the arm."""

    name: Annotated[str, "base, the joint's name, or tool"]
    position_mm: Annotated[list[float], "in the base frame"]
    rotation: Annotated[list[list[float]], "3 x 3, row by row"]


class Fk(Head, Tooled, Near):
    """Where the tool is."""

    joints: Annotated[list[float], "as given [deg or mm]"]
    joint_units: Annotated[list[str], "deg or mm"]
    position_mm: Annotated[list[float], "of the tool, in the base frame"]
    rotation: Annotated[list[list[float]], "3 x 3, row by row"]
    rpy_deg: Annotated[list[float], "roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll)"]
    quaternion_wxyz: Annotated[list[float], "the same, w first"]
    within_limits: Annotated[bool, "whether every joint is"]
    violations: Annotated[list[Violation], "joints outside, if any"]
    frames: Annotated[NotRequired[list[Frame]], "with --frames: base first, tool last"]


class PulsePositions(TypedDict):
    """The tool with and without rounding."""

    theoretical: Annotated[list[float], "for the joint values as given"]
    actual: Annotated[list[float], "for whole pulses"]
    difference: Annotated[list[float], "along each axis, without sign"]


class Rounded(TypedDict):
    """Plain rounding, beside --best."""

    pulses: Annotated[list[int], "each motor's nearest"]
    error_mm: Annotated[float, "of the tool with these"]


_From = TypedDict("_From", {"from": Annotated[list[float], "where `moves` begin [deg or mm]"]})


class Pulses(Head, _From, Near):
    """Motor pulses of a pose."""

    motors: Annotated[list[str], "names"]
    pulse_units: Annotated[list[str], "step, us (RC servos) or count (bus servos)"]
    joint_units: Annotated[list[str], "deg or mm"]
    resolution: Annotated[list[float], "what one pulse is worth at each joint [deg or mm]"]
    joints: Annotated[list[float], "as given [deg or mm]"]
    pulses: Annotated[list[int], "of every motor, counted from home"]
    moves: Annotated[list[int], "signed, from --from"]
    actual_joints: Annotated[list[float], "where the pulses put the joints [deg or mm]"]
    position_mm: Annotated[PulsePositions, "of the tool"]
    error_mm: Annotated[float, "distance between the two positions"]
    within_limits: bool
    violations: list[Violation]
    outside_travel: Annotated[list[str], "motors whose servo cannot turn that far"]
    rounded: Annotated[NotRequired[Rounded], "with --best"]
    gain_mm: Annotated[NotRequired[float], "with --best: how much nearer the tool is"]
    tried: Annotated[NotRequired[int], "with --best: pulse vectors compared"]


class Workspace(Head, Tooled):
    """Where the tip can reach."""

    samples: Annotated[int, "postures looked at"]
    x_mm: Annotated[list[float], "[least, greatest]"]
    y_mm: Annotated[list[float], "[least, greatest]"]
    z_mm: Annotated[list[float], "[least, greatest]"]
    reach_mm: Annotated[list[float], "[least, greatest] distance from the base"]
    volume_mm3: Annotated[NotRequired[float], "an arm that moves in space"]
    volume_error_mm3: Annotated[NotRequired[float], "bound or estimate, see method"]
    area_mm2: Annotated[NotRequired[float], "an arm that moves in a plane"]
    area_error_mm2: Annotated[NotRequired[float], "bound or estimate, see method"]
    method: Annotated[NotRequired[str], "how volume or area were found"]
    free_share: Annotated[NotRequired[float], "of the samples, those that hit nothing, where there are keep-outs"]
    measures: Annotated[dict[str, list[float]], "each of --measure: [least, greatest]"]
    seconds: Annotated[float, "the computation took"]


class Reach(Head):
    """Where the arm reaches, with which orientations."""

    task: Annotated[str, "what a target prescribes"]
    cells: Annotated[int, "within the reach"]
    orientations: Annotated[int, "asked in each cell"]
    answers: Annotated[int, "cells times orientations"]
    solves: Annotated[int, "poses given to the solver"]
    method: Annotated[Literal["arcs", "poses"], "by arcs of joint 1 (and the last joint), or pose by pose"]
    reached: Annotated[int, "cells of which some orientation is reached"]
    volume_mm3: Annotated[float, "of these cells"]
    seconds: Annotated[float, "the computation took"]


class BestPlace(TypedDict):
    """Where to put a robot: its frame, in the frame of the targets."""

    xyz: Annotated[list[float], "of the robot's frame [mm]"]
    yaw_deg: Annotated[float, "turn of that frame about z"]
    reached: Annotated[int, "targets; of a path, points along it"]
    of: Annotated[int, "targets, or points, in all"]
    margin_mm: Annotated[float, "to the nearest place of the grid, at this yaw, that does not reach all"]
    held: Annotated[NotRequired[dict[str, float]], "of a path: the redundant joint, and where it is held [deg]"]


class PlannedPlace(TypedDict):
    """A place from which the path was planned."""

    xyz: Annotated[list[float], "of the robot's frame [mm]"]
    yaw_deg: Annotated[float, "turn of that frame about z"]
    margin_mm: Annotated[float, "as of the best place"]
    duration_s: Annotated[float | None, "null: it cannot be planned from there"]
    refused: Annotated[str | None, "why"]


class PlacedRobot(Head):
    """The places of one robot."""

    best: BestPlace
    places: Annotated[int, "looked at"]
    reach_all: Annotated[int, "places that reach all targets, or carry the whole path on one branch"]
    planned: NotRequired[Annotated[list[PlannedPlace], "the best places, where FILE is a path"]]


class Place(TypedDict):
    """Where to put robots, each by itself."""

    robots: list[PlacedRobot]


_Ends = TypedDict("_Ends", {"from": list[float], "to": list[float]})


class Solver(TypedDict):
    """How targets are solved."""

    method: Annotated[str, "the class of solution"]
    why: Annotated[str, "why that class applies"]
    complete: Annotated[bool, "no real branch is missing, as a rule; ik says it of each target"]


class Solving(TypedDict):
    """What `ik` solves for, and how."""

    task: Annotated[str | None, "what ik solves for"]
    target_labels: Annotated[list[str], "names of a target's numbers"]
    target_units: Annotated[list[str], "mm or deg, each number's"]
    solver: Solver | None
    ik_refuses: Annotated[str | None, "why there is no solver"]
    redundant: Annotated[NotRequired[str], "the joint that ik gives intervals of, where one is to spare"]


class BodySegment(_Ends):
    """A part of a body."""

    slide: Annotated[NotRequired[bool], "true: it begins where the body before ends, given for the home pose"]


class BodyOf(TypedDict):
    """What a joint moves."""

    name: Annotated[str, "the joint's name, or base"]
    radius_mm: Annotated[float, "of the capsules along it"]
    assumed: Annotated[bool, "no file states it: 2 % of the reach"]
    segments: Annotated[list[BodySegment], "in the frame that the body moves with: fk --frames has it"]


class KeepOuts(TypedDict):
    """Bodies, and what they are held against; absent where there are no keep-outs."""

    clearance_mm: NotRequired[Annotated[float, "kept from keep-outs"]]
    keep_out: Annotated[NotRequired[list[str]], "names of the keep-outs, self among them"]
    bodies: NotRequired[Annotated[list[BodyOf], "the arm's, where there are keep-outs"]]
    pairs_left_out: Annotated[NotRequired[list[list[str]]], "bodies that overlap in every posture looked at"]
    hits_at_home: NotRequired[Annotated[list[Hit], "pairs too near in the home pose"]]


class Info(Head, Solving, KeepOuts):
    """What a robot file says."""

    description: str
    source: Annotated[str, "where the numbers come from"]
    convention: Literal["standard", "modified", "screws"]
    joint_units: Annotated[list[str], "deg or mm"]
    joints: Annotated[list[dict[str, Any]], "as in the robot file, with all defaults"]
    poses: Annotated[dict[str, list[float]], "named joint values, home first [deg or mm]"]
    base: Annotated[dict[str, list[float]], "xyz, rpy"]
    tool: Annotated[dict[str, list[float]], "xyz, rpy"]
    zero_pose: Annotated[dict[str, list[float]] | None, "xyz, rpy; convention screws"]
    pitch_offset: Annotated[float, "added to phi [deg]"]
    reach_mm: Annotated[float, "no point of the chain is farther from its first joint"]
    motors: Annotated[list[dict[str, Any]], "as in the robot file, with what the chain multiplies to"]
    one_to_one: Annotated[bool, "each joint has a motor of its own"]
    resolution: Annotated[list[float] | None, "what one pulse is worth at each joint; null without drives"]
    gripper: Annotated[dict[str, Any] | None, "as in the robot file"]
    board: Annotated[dict[str, Any] | None, "as in the robot file"]
    lacks: Annotated[dict[str, list[str]], "what the file lacks for pulses, simulate, send, home; empty: nothing"]
    lines_to_add: Annotated[list[str], "lines for the file, with examples for figures, that send asks for"]


class ShippedRobot(Head):
    """A robot that comes with armkin."""

    description: str
    joints: list[str]
    joint_types: Annotated[list[str], "revolute or prismatic"]
    task: str | None
    target_labels: Annotated[list[str], "names of a target's numbers"]
    can: Annotated[dict[str, bool], "ik, pulses, simulate, send, home: as its file stands"]
    lacks: Annotated[dict[str, list[str]], "what each of them lacks, in words"]
    compared: Annotated[str, "what its geometry was compared with: a maker's figure, or only a URDF"]


class Robots(TypedDict):
    """The robots that come with armkin."""

    robots: list[ShippedRobot]


class Export(Head):
    """`export --json`: the arm in numbers."""

    length_unit: Literal["mm"]
    angle_unit: Literal["deg"]
    joints: Annotated[list[dict[str, Any]], "name, type, unit, screw {w, q or v}, sign, ratio, limits, home, rates"]
    base: Annotated[list[list[float]], "4 x 4"]
    zero_pose: Annotated[dict[str, list[float]], "xyz, rpy of the end frame when all joints are 0"]
    tool: Annotated[dict[str, list[float]], "xyz, rpy after it"]
    links: Annotated[list[list[list[float]]], "the tool's pose is links[0] Z1(q1) links[1] ... Zn(qn) links[n]"]
    dh_standard: Annotated[dict[str, Any] | None, "base, rows, tool; null where there is none"]
    dh_modified: Annotated[dict[str, Any] | None, "base, rows, tool; null where there is none"]


class Found(TypedDict):
    """A serial port."""

    device: str
    description: str
    hardware: str
    board: Annotated[str, "what it looks like; empty if unknown"]


class Ports(TypedDict):
    """Serial ports of this computer."""

    ports: list[Found]


class Flash(TypedDict):
    """`flash --json`: what was written, and what the board then said."""

    board: str
    port: Annotated[str | None, "null: a Pico whose port has not come yet"]
    bytes: Annotated[int, "of the program"]
    uploader: Literal["armkin", "avrdude", "UF2"]
    firmware: Annotated[str | None, "the version that the board says; null with port"]


class Errors(TypedDict):
    """Distances between computed and measured tips, on rows that the fit has not seen."""

    median_mm: float
    rms_mm: float
    max_mm: float


class Flagged(TypedDict):
    """A row that does not fit the others."""

    row: Annotated[int, "its number"]
    off_mm: Annotated[float, "from the corrected arm"]


class Correction(TypedDict):
    """A corrected number of the robot file."""

    name: str
    value: float
    deviation: Annotated[float | None, "standard deviation; null where fewer than 20 rows were measured"]
    unit: str


class Calibrate(Head):
    """A corrected robot file from measured tips."""

    rows: Annotated[int, "that were measured"]
    level: Annotated[str, "how much is corrected, in words"]
    corrected: Annotated[list[str], "kinds of numbers: base, zeros, ..."]
    before: Annotated[Errors, "of the robot file as given"]
    after: Annotated[Errors, "of the corrected one"]
    noise_mm: Annotated[float, "of a measured coordinate, estimated"]
    flagged: Annotated[list[Flagged], "rows that were left out"]
    corrections: list[Correction]
    unseen: Annotated[list[str], "what these rows do not show"]
    held: Annotated[list[str], "why something was not corrected"]
    out: Annotated[str | None, "file that was written"]


class Suggested(Head):
    """`calibrate --suggest`: the next poses to measure."""

    joint_units: Annotated[list[str], "deg or mm"]
    poses: Annotated[list[list[float]], "joint values [deg or mm]"]


class Error(TypedDict):
    """An error under --json, on stderr; besides these keys it has the fields of its kind."""

    error: Annotated[str, "the message, as without --json"]
    kind: Annotated[str, "usage, file, robot_file, no_solution, no_branch, link, position_lost, ..."]
    exit_code: Annotated[int, "1 runtime or file, 2 usage, 3 no solution, 4 robot file, 5 link or device"]
    next: Annotated[NotRequired[str], "what to do, where there is a next step"]
    sent: Annotated[NotRequired[dict[str, Any]], "send --batch -: its answer for the rows before the malformed one"]
    notes: Annotated[NotRequired[list[str]], "said before the error"]
    warnings: Annotated[NotRequired[list[str]], "said before the error"]
