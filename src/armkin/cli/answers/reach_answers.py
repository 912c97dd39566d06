"""Answers of workspace, reach and place."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, Literal, NotRequired, TypedDict

from armkin.cli.answers.shared_keys import Head, Tooled


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
