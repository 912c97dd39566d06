"""Answers about an arm that moves, and about its board."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Literal, NotRequired, TypedDict

from armkin.board.json_summaries import Summary, Where
from armkin.cli.answers.kinematics import Head, Tooled
from armkin.model.units import JointUnits

Port = Annotated[str, "the port that was used; sim: a simulated board"]


class DryRun(Head, Tooled, Summary):
    """`send --dry-run`."""

    dry_run: Annotated[Literal[True], "says that nothing was moved"]


class Send(Head, Tooled):
    """`send`: the plan, and where the arm stands after it."""

    port: Port
    waypoints: Annotated[int, "how many waypoints it went through"]
    start_joints: Annotated[list[float], "joint values where it began [deg or mm]"]
    joints: Annotated[
        list[float] | None,
        "joint values where the board says that the arm stands [deg or mm]; null while lost",
    ]
    joint_units: JointUnits
    motors: Annotated[list[str], "names of the motors"]
    pulse_units: Annotated[list[str], "unit of each motor's pulses: step, us or count"]
    start_pulses: Annotated[list[int], "position of every motor where it began [pulses]"]
    pulses: Annotated[list[int] | None, "position of every motor now, as the board counts [pulses]; null while lost"]
    moves: Annotated[list[int], "how far every motor was to turn, signed [pulses]"]
    position_mm: Annotated[list[float] | None, "the tool's x, y, z now [mm]; null while lost"]
    position: Annotated[str, "whether the board knows where the arm stands: known, retained (over a reset) or lost"]
    duration_s: Annotated[float, "planned duration [s]"]
    segments: Annotated[int, "pieces of constant acceleration, or positions, that the board was sent"]
    top_speed: Annotated[list[float], "greatest speed of every joint [deg/s or mm/s]"]
    top_rate: Annotated[list[float], "greatest rate of every motor [pulses/s]"]


class BranchAt(TypedDict):
    """Where on a path a branch's name begins."""

    s_mm: Annotated[float, "distance along the path, from its start [mm]"]
    name: Annotated[str, "name of the branch from there on"]


class PathRun(TypedDict):
    """A part of a path on one branch."""

    s_mm: Annotated[list[float], "where it begins and ends: distances along the path [mm]"]
    branches: Annotated[list[BranchAt], "names of the branch along it, where they begin"]
    start_joints: Annotated[list[float], "joint values at its begin [deg or mm]"]
    end_joints: Annotated[list[float], "joint values at its end [deg or mm]"]


class Reconfiguration(TypedDict):
    """Where a run ends before the path does."""

    s_mm: Annotated[float, "distance along the path, from its start [mm]"]
    why: Annotated[str, "limit, reach, boundary, singularity, hit (a keep-out) or end"]
    joint: Annotated[str | None, "the joint whose limit it is; null: it is no limit"]
    value: Annotated[float | None, "that limit [deg or mm]; null: it is no limit"]
    status_beyond: Annotated[str, "status of the target just beyond: exact, boundary, singular or unreachable"]


class PathBranch(TypedDict):
    """A branch at a path's start."""

    name: Annotated[str, "name of the branch"]
    start_joints: Annotated[list[float], "joint values at the path's start [deg or mm]"]
    carries_mm: Annotated[float, "how far along the path it goes [mm]"]
    ends_because: Annotated[str, "why it goes no farther, in words"]


class NearestSingularity(TypedDict):
    """Where the arm comes nearest to a singularity."""

    s_mm: Annotated[float, "distance along the path, from its start [mm]"]
    condition: Annotated[float | None, "condition number of the Jacobian there; null: infinite"]


class Approach(TypedDict):
    """The joint move from where the arm stands to where a path starts: in no other field."""

    from_joints: Annotated[list[float], "joint values where the arm stands [deg or mm]"]
    duration_s: Annotated[float, "duration of this joint move [s]"]


PathClearance = TypedDict(
    "PathClearance",
    {
        "mm": Annotated[
            float | None,
            "lower bound of the distance over the whole motion [mm]; negative: a hit; null: no pair counts",
        ],
        "s_mm": Annotated[float, "where it is least, or where the first hit is: distance along the path [mm]"],
        "body": Annotated[str, "body of the arm: the name of the joint that moves it, or base"],
        "with": Annotated[str, "name of the keep-out, or of another body of the arm"],
    },
)
PathClearance.__doc__ = "Where a path is nearest to what it must not touch."


class WristPassed(TypedDict):
    """A wrist singularity that a path goes straight through."""

    s_mm: Annotated[
        list[float],
        "where joints 4 to 6, or the tip, leave their exact way, and where they are back: distances along "
        "the path [mm]",
    ]
    turned_deg: Annotated[float, "angle by which the tool is turned at most [deg]; 0: the tip goes aside"]
    aside_mm: Annotated[float, "distance by which the tip goes aside at most [mm]; 0: the tool is turned"]


class Path(Head, Tooled):
    """`path`: a plan, or with exit 3 what is known of one that is not carried to its end."""

    task: Annotated[str, "the task: what a target of the path prescribes"]
    length_mm: Annotated[float, "length of the path [mm]"]
    duration_s: Annotated[float | None, "planned duration [s]; null: not planned to its end"]
    samples: Annotated[int, "how many targets along it were solved"]
    complete: Annotated[bool, "whether every isolated branch of every sample is guaranteed to be known"]
    tolerance_mm: Annotated[float, "distance that is allowed between plan and path [mm]"]
    deviation_mm: Annotated[
        float | None,
        "bound of the distance between plan and path [mm]; of points passed by the tolerance their greatest",
    ]
    blends_reduced: Annotated[int, "how many blends were made smaller, to half of a side"]
    joint_units: JointUnits
    start_joints: Annotated[list[float] | None, "joint values at the start [deg or mm]; null: no plan"]
    joints: Annotated[list[float] | None, "joint values at the end [deg or mm]; null: no plan"]
    runs: Annotated[list[PathRun], "parts of the path on one branch each, in order"]
    reconfigurations: Annotated[list[Reconfiguration], "where a part ends before the path does"]
    branches: Annotated[list[PathBranch], "branches at the path's start, and how far each carries it"]
    limits: Annotated[
        dict[str, dict[str, float]] | None,
        "speed, accel, jerk: greatest share of each joint's limit, 1 at the limit; null: no plan",
    ]
    nearest_singularity: Annotated[
        NearestSingularity | None,
        "where the arm comes nearest to a singularity; null: not known",
    ]
    segments: Annotated[
        int | None,
        "pieces of constant acceleration, or positions, that a board is sent; null: the file has no drives",
    ]
    held: Annotated[NotRequired[dict[str, float]], "joints that are held along the path, and where [deg or mm]"]
    turned_deg: Annotated[
        NotRequired[float],
        "where the tool is turned at wrist singularities: by how much at most [deg]",
    ]
    wrists_passed: Annotated[NotRequired[list[WristPassed]], "wrist singularities that are passed straight through"]
    approach: Annotated[NotRequired[Approach], "where the arm stands elsewhere: the joint move to the path's start"]
    clearance: Annotated[
        NotRequired[PathClearance],
        "where there are keep-outs: where the path is nearest to what it must not touch",
    ]
    dry_run: Annotated[NotRequired[bool], "true: nothing was moved, by `send --path --dry-run`"]


class PathMoved(Path):
    """`path --port`: the plan, and where the arm stands after it."""

    port: Port
    position: Annotated[str, "whether the board knows where the arm stands: known, retained (over a reset) or lost"]
    pulses: Annotated[list[int] | None, "position of every motor now, as the board counts [pulses]; null while lost"]
    position_mm: Annotated[list[float] | None, "the tool's x, y, z now [mm]; null while lost"]


class Stands(Head, Where):
    """`home` and `jog`: where the arm stands after it."""

    port: Port


class LostSteps(TypedDict):
    """A switch that was met again, against the count that was held."""

    joint: Annotated[str, "name of the joint"]
    steps: Annotated[int | None, "by how many steps the count was ahead of the arm; null: the position was not known"]
    difference: Annotated[float | None, "the same at the joint [deg or mm]; null: the position was not known"]


class Home(Stands):
    """`home`: where the arm stands after it, and the steps that were lost before."""

    lost_steps: Annotated[
        NotRequired[list[LostSteps]],
        "one entry a joint that was homed; boards with armkin's firmware",
    ]


class StatusOfBoard(Stands):
    """`status`: what the board says."""

    board: Annotated[str, "kind of the board"]
    firmware: Annotated[str, "version of its firmware"]
    configured: Annotated[bool, "whether it is configured for this robot file"]
    state: Annotated[str, "what it does: idle, moving, holding, ..."]
    error: Annotated[str | None, "why the last session ended; null: it ended well"]
    drivers_on: Annotated[bool, "whether the steppers' drivers are switched on"]
    servo_pulses_on: Annotated[bool, "whether RC servos get their signal"]
    abort_input: Annotated[bool, "whether the abort input is active"]
    motor_power: Annotated[
        bool | None,
        "whether the motors have power; null: no input senses it, so a cut goes unnoticed",
    ]
    switches: Annotated[dict[str, bool], "level of each limit input: true is high"]
    boots: Annotated[int, "how often the board has started since its memory was last lost"]
    reset_cause: Annotated[int, "cause of the last start, a number of firmware/PROTOCOL.md"]


class StatusOfGrbl(Stands):
    """`status` of a board of kind grbl or klipper."""

    board: Annotated[str, "kind of the board"]
    firmware: Annotated[str, "its firmware, as it names itself"]
    state: Annotated[str, "the board's own word: idle, run, hold, alarm, ...; ready, shutdown, ..."]
    inputs: Annotated[str, "letters of the active inputs: limits X Y Z A B C, probe P, door D; Klipper tells none"]
    settings: Annotated[list[str], "settings that differ from the robot file, in words"]
    lost_because: Annotated[str | None, "why the position is lost, in words; null: it is not"]


class Servo(TypedDict):
    """What a bus servo says of itself."""

    name: Annotated[str, "name of the motor"]
    id: Annotated[int, "the servo's number on its bus"]
    torque: Annotated[bool, "whether its motor is on"]
    load_percent: Annotated[float, "load, in percent of its greatest torque"]
    voltage: Annotated[float, "supply voltage [V]"]
    temperature: Annotated[int, "temperature [deg C]"]
    errors: Annotated[list[str], "errors that it reports: voltage, angle sensor, overheating, overcurrent, overload"]


class StatusOfServos(Stands):
    """`status` of a board of kind feetech."""

    board: Annotated[str, "kind of the board"]
    firmware: Annotated[str, "what kind of servos they are"]
    servos: Annotated[list[Servo], "one entry a servo"]


class Difference(TypedDict):
    """A setting of a board that is not as the robot file wants it."""

    setting: Annotated[int, "its number: 100 is GRBL's $100"]
    what: Annotated[str, "what it sets, in words"]
    found: Annotated[float | None, "its value on the board; null: the board has no such setting"]
    wanted: Annotated[float, "value that the robot file asks for"]
    serious: Annotated[bool, "whether motion would be wrong or too fast; otherwise it is only slower"]


class Setup(Head):
    """`setup`: a board's settings against the robot file."""

    port: Port
    firmware: Annotated[str, "the board's firmware, as it names itself"]
    differences: Annotated[list[Difference], "settings that differ, as found, before anything was written"]
    written: Annotated[bool, "whether they were written to the board"]


class Option(TypedDict):
    """An option of Klipper's printer.cfg that is not as the robot file wants it."""

    setting: Annotated[str, "its section and name"]
    found: Annotated[str | None, "its value in the running configuration; null: it has none"]
    wanted: Annotated[str, "value that the robot file asks for"]


class SetupOfKlipper(Head):
    """`setup` of a board of kind klipper: the sections of printer.cfg."""

    port: Annotated[str | None, "the port that was used; null: nothing was compared"]
    firmware: Annotated[str | None, "the version that Klipper says; null: nothing was compared"]
    differences: Annotated[list[Option] | None, "options that differ; null: nothing was compared"]
    printer_cfg: Annotated[str, "the sections of printer.cfg that the arm needs, pins left open"]


class Zero(Head):
    """`zero`: where the zero of bus servos is."""

    port: Annotated[str | None, "the port that was used; null: none was needed"]
    counts: Annotated[list[int] | None, "counts of every servo in the pose given; null: with --from"]
    zero: Annotated[list[int | float], "counts of each motor where all joints are 0: `zero` of its drive"]
    gripper_zero: Annotated[int | float | None, "with --gripper or --from: the gripper's zero [counts]; else null"]
    limits: Annotated[NotRequired[list[list[float]]], "with --from: lower and upper limit of every joint [deg]"]
    invert: Annotated[NotRequired[list[bool]], "with --from: whether each drive turns the other way"]
    gripper_ends: Annotated[
        NotRequired[list[float] | None],
        "with --from: the gripper's value when open and when closed [deg]",
    ]


class GripOfServo(Head):
    """`grip` on a board without armkin's firmware."""

    port: Port
    gripper: Annotated[float, "where it came to rest, in its drive's degrees; of a spindle the S word that was sent"]
    target: Annotated[float, "where it was sent, in the same unit"]
    measured: Annotated[bool, "whether the servo measured it; false on GRBL, which measures nothing"]


class Grip(Head):
    """Where the gripper stands."""

    port: Port
    gripper: Annotated[float, "where it stands, in its drive's degrees (mm with a lead)"]
    counts: Annotated[int, "the same, as the board counts [pulses]"]
