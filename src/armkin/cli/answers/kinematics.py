"""Answers about an arm: where it is, what reaches, what its file says; and errors."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Any, Literal, NotRequired, TypedDict

from armkin.model.units import JointUnits


class Head(TypedDict):
    """What every answer about a robot begins with, so that one command's output can be piped into the next."""

    robot: Annotated[str, "the arm's name"]
    robot_file: Annotated[str, "the robot file as given: a path, or the name of a shipped robot"]
    robot_sha256: Annotated[str, "SHA-256 of the robot file's bytes: a changed file is noticed"]
    scene: Annotated[NotRequired[str], "with --scene: the scene's file as given"]
    scene_sha256: Annotated[NotRequired[str], "with --scene: SHA-256 of its bytes"]


class Tooled(TypedDict):
    """What answers begin with that may be asked for another tool."""

    tool: Annotated[
        NotRequired[dict[str, list[float]]],
        "with --tool: the tool that replaces the robot file's, xyz [mm] and rpy [deg]",
    ]


class Violation(TypedDict):
    """A joint outside its limits."""

    joint: Annotated[str, "name of the joint"]
    value: Annotated[float, "its value [deg or mm]"]
    lower: Annotated[float | None, "its lower limit [deg or mm]; null: unlimited"]
    upper: Annotated[float | None, "its upper limit [deg or mm]; null: unlimited"]


Hit = TypedDict(
    "Hit",
    {
        "body": Annotated[str, "body of the arm: the name of the joint that moves it, or base"],
        "with": Annotated[str, "name of the keep-out, or of another body of the arm"],
        "depth_mm": Annotated[float, "by how much the pair is nearer than the clearance to be kept [mm]"],
    },
)
Hit.__doc__ = "A pair that is too near."


class Near(TypedDict):
    """What a posture is near to, where there are keep-outs."""

    clearance_mm: Annotated[
        NotRequired[float | None],
        "least distance of any pair [mm], the clearance to be kept taken off; null: there is no pair",
    ]
    hits: Annotated[NotRequired[list[Hit]], "pairs that are too near, the deepest first"]


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


class Workspace(Head, Tooled):
    """Where the tip can reach."""

    samples: Annotated[int, "how many postures were computed"]
    x_mm: Annotated[list[float], "least and greatest x of the tip [mm]"]
    y_mm: Annotated[list[float], "least and greatest y of the tip [mm]"]
    z_mm: Annotated[list[float], "least and greatest z of the tip [mm]"]
    reach_mm: Annotated[list[float], "least and greatest distance of the tip from the base [mm]"]
    volume_mm3: Annotated[NotRequired[float], "volume of the reachable space [mm3]; an arm that moves in space"]
    volume_error_mm3: Annotated[
        NotRequired[float],
        "error of the volume [mm3]: a bound or an estimate, as `method` says",
    ]
    area_mm2: Annotated[NotRequired[float], "area of the reachable plane [mm2]; an arm that moves in a plane"]
    area_error_mm2: Annotated[NotRequired[float], "error of the area [mm2]: a bound or an estimate, as `method` says"]
    method: Annotated[NotRequired[str], "how the volume or area was found"]
    free_share: Annotated[
        NotRequired[float],
        "share of the samples that hit nothing, 0 to 1; where there are keep-outs",
    ]
    measures: Annotated[dict[str, list[float]], "least and greatest value of each of --measure"]
    seconds: Annotated[float, "how long the computation took [s]"]


class Reach(Head):
    """Where the arm reaches, with which orientations."""

    task: Annotated[str, "the task: what a target prescribes"]
    cells: Annotated[int, "how many cells lie within the reach"]
    orientations: Annotated[int, "how many orientations were asked in each cell"]
    answers: Annotated[int, "how many poses were answered: cells times orientations"]
    solves: Annotated[int, "how many poses were given to the solver"]
    method: Annotated[Literal["arcs", "poses"], "by arcs of joint 1 (and the last joint), or pose by pose"]
    reached: Annotated[int, "how many cells are reached with some orientation"]
    volume_mm3: Annotated[float, "volume of these cells [mm3]"]
    seconds: Annotated[float, "how long the computation took [s]"]


class BestPlace(TypedDict):
    """Where to put a robot: its frame, in the frame of the targets."""

    xyz: Annotated[list[float], "where the robot's frame stands [mm]"]
    yaw_deg: Annotated[float, "turn of that frame about z [deg]"]
    reached: Annotated[int, "how many targets are reached from there; of a path, how many points along it"]
    of: Annotated[int, "how many targets, or points, there are"]
    margin_mm: Annotated[float, "distance to the nearest place of the grid, at this yaw, that does not reach all [mm]"]
    held: Annotated[NotRequired[dict[str, float]], "of a path: the redundant joint, and where it is held [deg]"]


class PlannedPlace(TypedDict):
    """A place from which the path was planned."""

    xyz: Annotated[list[float], "where the robot's frame stands [mm]"]
    yaw_deg: Annotated[float, "turn of that frame about z [deg]"]
    margin_mm: Annotated[float, "distance to the nearest place of the grid, at this yaw, that does not reach all [mm]"]
    duration_s: Annotated[float | None, "how long the path takes from there [s]; null: it cannot be planned"]
    refused: Annotated[str | None, "why it cannot be planned from there; null: it can"]


class PlacedRobot(Head):
    """The places of one robot."""

    best: Annotated[BestPlace, "the place that is farthest from places that do not reach all"]
    places: Annotated[int, "how many places were compared"]
    reach_all: Annotated[int, "how many places reach all targets, or carry the whole path on one branch"]
    planned: Annotated[
        NotRequired[list[PlannedPlace]],
        "where FILE is a path: the best places, with the path planned from each",
    ]


class Place(TypedDict):
    """Where to put robots, each by itself."""

    robots: Annotated[list[PlacedRobot], "one entry a robot, in the order of the command line"]


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


class Found(TypedDict):
    """A serial port."""

    device: Annotated[str, "name to give to --port"]
    description: Annotated[str, "what the system calls the device"]
    hardware: Annotated[str, "USB identifiers of the device, as the system gives them"]
    board: Annotated[str, "the board that it looks like; empty: unknown"]


class Ports(TypedDict):
    """Serial ports of this computer."""

    ports: Annotated[list[Found], "the serial ports, in the system's order"]


class Flash(TypedDict):
    """`flash --json`: what was written, and what the board then said."""

    board: Annotated[str, "kind of the board"]
    port: Annotated[str | None, "port on which the board answers; null: a Pico whose port has not come yet"]
    bytes: Annotated[int, "size of the program [bytes]"]
    uploader: Annotated[
        Literal["armkin", "avrdude", "UF2"],
        "what wrote it: armkin, avrdude, or the Pico's own boot drive (UF2)",
    ]
    firmware: Annotated[str | None, "version that the board then says; null: it was not asked, as `port` is null"]


class Error(TypedDict):
    """An error under --json, on stderr; besides these keys it has the fields of its kind."""

    error: Annotated[str, "the message, as without --json"]
    kind: Annotated[str, "usage, file, robot_file, no_solution, no_branch, link, position_lost, ..."]
    exit_code: Annotated[int, "1 runtime or file, 2 usage, 3 no solution, 4 robot file, 5 link or device"]
    next: Annotated[NotRequired[str], "what to do, where there is a next step"]
    sent: Annotated[NotRequired[dict[str, Any]], "send --batch -: its answer for the rows before the malformed one"]
    notes: Annotated[NotRequired[list[str]], "notes that were said before the error"]
    warnings: Annotated[NotRequired[list[str]], "warnings that were said before the error"]
