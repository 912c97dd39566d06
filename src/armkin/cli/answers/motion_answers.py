"""Answers about motions: send and path."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Literal, NotRequired, TypedDict

from armkin.board.json_summaries import Summary
from armkin.cli.answers.board_answers import Port
from armkin.cli.answers.shared_keys import Head, Tooled
from armkin.model.units import JointUnits


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
        "s_mm": Annotated[float, "where it is least; of a refused path where the first hit is: distance along it [mm]"],
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
