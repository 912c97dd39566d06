"""The JSON of `armkin ik`."""

from typing import Annotated, NotRequired, TypedDict

from armkin.cli.answers.shared_keys import Head, Near, Tooled, Violation
from armkin.model.units import JointUnits


class Family(TypedDict):
    """A piece of a curve of answers, of arms with one joint more than the target asks for."""

    joint: Annotated[str, "the redundant joint, along which the family is monotone"]
    interval: Annotated[
        list[float],
        "its least and greatest value [deg] within limits; of a branch outside limits the whole family's",
    ]


class Branch(Near):
    """One branch, modulo whole turns: the legal copy nearest to --near."""

    joints: Annotated[list[float], "joint values [deg or mm]"]
    name: Annotated[str, "name of the branch: left, elbow up, ...; branch 1, ... where a class has no names"]
    within_limits: Annotated[bool, "whether every joint is within its limits"]
    violations: Annotated[list[Violation], "the joints that are outside their limits"]
    residual_mm: Annotated[float, "distance between the tool and the target [mm]"]
    residual_deg: Annotated[float, "angle between them [deg], where the task has one"]
    motion: Annotated[float, "sum of the joints' distances from --near, without sign [deg or mm]"]
    family: Annotated[
        NotRequired[Family],
        "where the arm has one joint more than the task asks for: the answers that this one stands for",
    ]
    turns: Annotated[
        NotRequired[list[list[float]]],
        "with --turns: joint values of all copies within limits [deg or mm], the nearest to --near first",
    ]


class Closest(Near):
    """The nearest pose within limits."""

    joints: Annotated[list[float], "joint values [deg or mm]"]
    position_mm: Annotated[list[float], "the tool's x, y, z in the base frame [mm]"]
    distance_mm: Annotated[float, "distance from the tool to the target [mm]"]
    angle_deg: Annotated[float, "angle between them [deg], where the task has one"]
    converged: Annotated[bool, "false: the search ended at its bound of steps"]
    branch: Annotated[str | None, "name of the branch, where only the branch asked for will not do; else null"]


class Ik(Head, Tooled):
    """All joint values that reach a target."""

    task: Annotated[str, "the task: what the target prescribes"]
    target: Annotated[list[float], "the target as given [mm, deg]"]
    target_labels: Annotated[list[str], "names of its numbers"]
    near: Annotated[list[float], "joint values to stay close to [deg or mm]"]
    status: Annotated[
        str,
        "exact, boundary, singular or unreachable: geometry alone, limits apart; with --position-first, of "
        "`best`, exact or position; unreachable where none is within limits",
    ]
    method: Annotated[str, "the class of solution used"]
    why: Annotated[str, "why that class applies"]
    complete: Annotated[bool, "whether every isolated real branch is guaranteed to be found"]
    joint_units: JointUnits
    branch_count: Annotated[int, "how many branches were found, listed or not"]
    branches_within_limits: Annotated[int, "how many of these are within limits"]
    branches: Annotated[
        list[Branch],
        "branches within limits first, then by hits, residual_deg (--position-first) and motion; with "
        "--all-branches all of them",
    ]
    best: Annotated[int | None, "index of the default answer in `branches`, from 0; null: none may be taken"]
    closest: Annotated[
        Closest | None,
        "the nearest pose within limits, where `best` is null; null, too, where every branch within limits "
        "hits something",
    ]
    free_joints: Annotated[list[str], "joints whose value does not matter here (a self-motion)"]
    branches_free: Annotated[
        NotRequired[int],
        "where there are keep-outs: how many branches are within limits and hit nothing",
    ]
