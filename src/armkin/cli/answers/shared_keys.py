"""Keys that many answers have, and errors."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Any, NotRequired, TypedDict


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


class Error(TypedDict):
    """An error under --json, on stderr; besides these keys it has the fields of its kind."""

    error: Annotated[str, "the message, as without --json"]
    kind: Annotated[str, "usage, file, robot_file, no_solution, no_branch, link, position_lost, ..."]
    exit_code: Annotated[int, "1 runtime or file, 2 usage, 3 no solution, 4 robot file, 5 link or device"]
    next: Annotated[NotRequired[str], "what to do, where there is a next step"]
    sent: Annotated[NotRequired[dict[str, Any]], "send --batch -: its answer for the rows before the malformed one"]
    notes: Annotated[NotRequired[list[str]], "notes that were said before the error"]
    warnings: Annotated[NotRequired[list[str]], "warnings that were said before the error"]
