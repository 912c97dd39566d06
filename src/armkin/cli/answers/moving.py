"""Answers about an arm that moves, and about its board."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Literal, NotRequired, TypedDict

from armkin.board.summaries import Summary, Where
from armkin.cli.answers.arm import Head, Tooled


class DryRun(Head, Tooled, Summary):
    """`send --dry-run`."""

    dry_run: Literal[True]


class Send(Head, Tooled):
    """`send`: the plan, and where the arm stands after it."""

    port: str
    waypoints: Annotated[int, "that it went through"]
    start_joints: Annotated[list[float], "[deg or mm]"]
    joints: Annotated[list[float] | None, "where the board says that it stands [deg or mm]"]
    joint_units: Annotated[list[str], "deg or mm"]
    motors: list[str]
    pulse_units: Annotated[list[str], "step, us or count"]
    start_pulses: Annotated[list[int], "where it began"]
    pulses: Annotated[list[int] | None, "as the board counts"]
    moves: Annotated[list[int], "planned"]
    position_mm: Annotated[list[float] | None, "of the tool, there"]
    position: Annotated[str, "known, retained or lost"]
    duration_s: Annotated[float, "planned"]
    segments: Annotated[int, "pieces of constant acceleration that the board was sent"]
    top_speed: Annotated[list[float], "greatest speed of every joint [deg/s or mm/s]"]
    top_rate: Annotated[list[float], "greatest rate of every motor [pulses/s]"]


class BranchAt(TypedDict):
    """Where on a path a branch's name begins."""

    s_mm: Annotated[float, "along the path, from its start"]
    name: str


class PathRun(TypedDict):
    """A part of a path on one branch."""

    s_mm: Annotated[list[float], "where it begins and ends"]
    branches: list[BranchAt]
    start_joints: Annotated[list[float], "[deg or mm]"]
    end_joints: Annotated[list[float], "[deg or mm]"]


class Reconfiguration(TypedDict):
    """Where a run ends before the path does."""

    s_mm: Annotated[float, "along the path, from its start"]
    why: Annotated[str, "limit, reach, boundary, singularity, hit (a keep-out) or end"]
    joint: Annotated[str | None, "whose limit it is"]
    value: Annotated[float | None, "the limit [deg or mm]"]
    status_beyond: Annotated[str, "exact, boundary, singular or unreachable"]


class PathBranch(TypedDict):
    """A branch at a path's start."""

    name: str
    start_joints: Annotated[list[float], "[deg or mm]"]
    carries_mm: Annotated[float, "how far along the path it goes"]
    ends_because: Annotated[str, "why no farther, in words"]


class NearestSingularity(TypedDict):
    """Where the arm comes nearest to a singularity."""

    s_mm: Annotated[float, "along the path, from its start"]
    condition: Annotated[float | None, "of the Jacobian; null: infinite"]


class Approach(TypedDict):
    """The joint move from where the arm stands to where a path starts: in no other field."""

    from_joints: Annotated[list[float], "[deg or mm]"]
    duration_s: Annotated[float, "of this joint move"]


# Where a path is nearest to what it must not touch.
PathClearance = TypedDict(
    "PathClearance",
    {
        "mm": Annotated[float | None, "a lower bound of the whole motion; negative: a hit; null: nothing counts"],
        "s_mm": Annotated[float, "where it is least, or where the first hit is"],
        "body": str,
        "with": str,
    },
)


class WristPassed(TypedDict):
    """A wrist singularity that a path goes straight through."""

    s_mm: Annotated[list[float], "where joints 4 to 6, or the tip, leave their exact way, and where they are back"]
    turned_deg: Annotated[float, "by which the tool is turned at most; 0: the tip goes aside"]
    aside_mm: Annotated[float, "by which the tip goes aside at most; 0: the tool is turned"]


class Path(Head, Tooled):
    """`path`: a plan, or with exit 3 what is known of one that is not carried to its end."""

    task: str
    length_mm: Annotated[float, "of the path"]
    duration_s: Annotated[float | None, "null: not planned to its end"]
    samples: Annotated[int, "targets that were solved"]
    complete: Annotated[bool, "every isolated branch of every sample is guaranteed to be known"]
    tolerance_mm: Annotated[float, "allowed between plan and path"]
    deviation_mm: Annotated[
        float | None, "a bound of the distance between plan and path; of points passed by the tolerance their greatest"
    ]
    blends_reduced: Annotated[int, "blends that half of a side made smaller"]
    joint_units: Annotated[list[str], "deg or mm"]
    start_joints: Annotated[list[float] | None, "[deg or mm]"]
    joints: Annotated[list[float] | None, "at the end [deg or mm]"]
    runs: list[PathRun]
    reconfigurations: list[Reconfiguration]
    branches: list[PathBranch]
    limits: Annotated[dict[str, dict[str, float]] | None, "speed, accel, jerk: greatest share of each joint's limit"]
    nearest_singularity: NearestSingularity | None
    segments: Annotated[int | None, "that a board is sent; null without drives"]
    held: Annotated[NotRequired[dict[str, float]], "joints that are held along the path, and where [deg or mm]"]
    turned_deg: Annotated[NotRequired[float], "by which the tool is turned at wrist singularities, if it is"]
    wrists_passed: Annotated[NotRequired[list[WristPassed]], "straight through singularities, if there are any"]
    approach: Annotated[NotRequired[Approach], "absent where the arm stands at the path's start"]
    clearance: Annotated[NotRequired[PathClearance], "where there are keep-outs"]
    dry_run: Annotated[NotRequired[bool], "of `send --path --dry-run`"]


class PathMoved(Path):
    """`path --port`: the plan, and where the arm stands after it."""

    port: str
    position: Annotated[str, "known, retained or lost"]
    pulses: Annotated[list[int] | None, "as the board counts"]
    position_mm: Annotated[list[float] | None, "of the tool at the end"]


class Stands(Head, Where):
    """`home` and `jog`: where the arm stands after it."""

    port: str


class LostSteps(TypedDict):
    """A switch that was met again, against the count that was held."""

    joint: str
    steps: Annotated[int | None, "that the count was ahead of the arm; null: the position was not known"]
    difference: Annotated[float | None, "the same [deg or mm]"]


class Home(Stands):
    """`home`: where the arm stands after it, and the steps that were lost before."""

    lost_steps: Annotated[NotRequired[list[LostSteps]], "one a joint that was homed; boards with armkin's firmware"]


class StatusOfBoard(Stands):
    """`status`: what the board says."""

    board: Annotated[str, "its kind"]
    firmware: str
    configured: Annotated[bool, "for this robot file"]
    state: Annotated[str, "idle, moving, holding, ..."]
    error: Annotated[str | None, "why the last session ended"]
    drivers_on: Annotated[bool, "whether the steppers' drivers are switched on"]
    servo_pulses_on: Annotated[bool, "whether RC servos get their signal"]
    abort_input: Annotated[bool, "whether it is active"]
    motor_power: Annotated[bool | None, "null: no input senses it, so a cut goes unnoticed"]
    switches: Annotated[dict[str, bool], "levels of the limit inputs"]
    boots: Annotated[int, "starts since the board's memory was last lost"]
    reset_cause: Annotated[int, "of the last start, as firmware/PROTOCOL.md has it"]


class StatusOfGrbl(Stands):
    """`status` of a board of kind grbl or klipper."""

    board: Annotated[str, "its kind"]
    firmware: str
    state: Annotated[str, "as the board says it: idle, run, hold, alarm, ...; ready, shutdown, ..."]
    inputs: Annotated[str, "letters of the active ones: limits X Y Z A B C, probe P, door D; Klipper tells none"]
    settings: Annotated[list[str], "those that differ from the robot file, in words"]
    lost_because: Annotated[str | None, "why the position is lost, in words"]


class Servo(TypedDict):
    """What a bus servo says of itself."""

    name: Annotated[str, "of the motor"]
    id: int
    torque: Annotated[bool, "whether its motor is on"]
    load_percent: Annotated[float, "of its greatest torque"]
    voltage: float
    temperature: Annotated[int, "[deg C]"]
    errors: Annotated[list[str], "voltage, angle sensor, overheating, overcurrent, overload"]


class StatusOfServos(Stands):
    """`status` of a board of kind feetech."""

    board: Annotated[str, "its kind"]
    firmware: str
    servos: list[Servo]


class Difference(TypedDict):
    """A setting of a board that is not as the robot file wants it."""

    setting: Annotated[int, "its number, as in $100"]
    what: str
    found: Annotated[float | None, "null: the board has no such setting"]
    wanted: float
    serious: Annotated[bool, "motion would be wrong or too fast; otherwise only slower"]


class Setup(Head):
    """`setup`: a board's settings against the robot file."""

    port: str
    firmware: str
    differences: Annotated[list[Difference], "as found, before anything was written"]
    written: bool


class Option(TypedDict):
    """An option of Klipper's printer.cfg that is not as the robot file wants it."""

    setting: Annotated[str, "its section and name"]
    found: str | None
    wanted: str


class SetupOfKlipper(Head):
    """`setup` of a board of kind klipper: the sections of printer.cfg."""

    port: Annotated[str | None, "null: nothing was compared"]
    firmware: str | None
    differences: Annotated[list[Option] | None, "null: nothing was compared"]
    printer_cfg: Annotated[str, "the sections that the arm needs, pins left open"]


class Zero(Head):
    """`zero`: where the zero of bus servos is."""

    port: str | None
    counts: Annotated[list[int] | None, "of every servo, in the pose given; null: --from"]
    zero: Annotated[list[int | float], "of every drive"]
    gripper_zero: Annotated[int | float | None, "with --gripper, or --from"]
    limits: Annotated[NotRequired[list[list[float]]], "--from: of every joint [deg]"]
    invert: Annotated[NotRequired[list[bool]], "--from: of every drive"]
    gripper_ends: Annotated[NotRequired[list[float] | None], "--from: open and closed [deg]"]


class GripOfServo(Head):
    """`grip` on a board without armkin's firmware."""

    port: str
    gripper: Annotated[float, "where it came to rest, in its drive's degrees; a spindle's S word as it was sent"]
    target: Annotated[float, "where it was sent"]
    measured: Annotated[bool, "false on GRBL, which measures nothing"]


class Grip(Head):
    """Where the gripper stands."""

    port: str
    gripper: Annotated[float, "in its drive's degrees (mm with a lead)"]
    counts: Annotated[int, "the same, as the board counts"]
