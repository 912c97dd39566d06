"""The JSON of `armkin ik`."""

from typing import Annotated, NotRequired, TypedDict

from armkin.cli.answers.arm import Head, Near, Tooled, Violation


class Family(TypedDict):
    """A piece of a curve of answers, of arms with one joint more than the target asks for."""

    joint: Annotated[str, "the redundant joint, along which the family is monotone"]
    interval: Annotated[list[float], "its values [deg] within limits; of a branch outside limits the whole family's"]


class Branch(Near):
    """One branch, modulo whole turns: the legal copy nearest to --near."""

    joints: Annotated[list[float], "[deg or mm]"]
    name: Annotated[str, "left, elbow up, ...; branch 1, ... where a class has no names"]
    within_limits: bool
    violations: list[Violation]
    residual_mm: Annotated[float, "distance between the tool and the target"]
    residual_deg: Annotated[float, "angle between them, where the task has one"]
    motion: Annotated[float, "sum of |change| from --near in joint units"]
    family: Annotated[NotRequired[Family], "where the arm has one joint more than the task asks for"]
    turns: Annotated[NotRequired[list[list[float]]], "with --turns: all copies within limits, the nearest first"]


class Closest(Near):
    """The nearest pose within limits."""

    joints: Annotated[list[float], "[deg or mm]"]
    position_mm: Annotated[list[float], "of the tool"]
    distance_mm: Annotated[float, "from the tool to the target"]
    angle_deg: Annotated[float, "between them, where the task has one"]
    converged: Annotated[bool, "false: the search ended at its bound"]
    branch: Annotated[str | None, "the branch it is, where only the branch asked for will not do"]


class Ik(Head, Tooled):
    """All joint values that reach a target."""

    task: Annotated[str, "what the target prescribes"]
    target: Annotated[list[float], "as given [mm, deg]"]
    target_labels: Annotated[list[str], "names of its numbers"]
    near: Annotated[list[float], "the pose to stay close to [deg or mm]"]
    status: Annotated[
        str,
        "exact, boundary, singular or unreachable: geometry alone, limits apart; with --position-first, of `best`, "
        "exact or position; unreachable where none is within limits",
    ]
    method: Annotated[str, "the class of solution used"]
    why: Annotated[str, "why that class applies"]
    complete: Annotated[bool, "every isolated real branch is guaranteed to be found"]
    joint_units: Annotated[list[str], "deg or mm"]
    branch_count: Annotated[int, "found, listed or not"]
    branches_within_limits: Annotated[int, "of these, how many may be taken"]
    branches: Annotated[
        list[Branch],
        "within limits first, then without hits, residual_deg (--position-first), motion; all with --all-branches",
    ]
    best: Annotated[int | None, "index of the default answer in `branches`"]
    closest: Annotated[Closest | None, "whenever `best` is null, but where every branch within limits hits something"]
    free_joints: Annotated[list[str], "joints whose value does not matter here (a self-motion)"]
    branches_free: Annotated[NotRequired[int], "within limits and without hits, where there are keep-outs"]
