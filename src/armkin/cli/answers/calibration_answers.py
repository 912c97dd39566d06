"""The JSON of `armkin calibrate`."""

# No annotations as text here: a key that may be absent is known by NotRequired at run time.
from typing import Annotated, TypedDict

from armkin.cli.answers.shared_keys import Head
from armkin.model.units import JointUnits


class Errors(TypedDict):
    """Distances between computed and measured tips, on rows that the fit has not seen."""

    median_mm: Annotated[float, "median [mm]"]
    rms_mm: Annotated[float, "root of the mean square [mm]"]
    max_mm: Annotated[float, "greatest [mm]"]


class Flagged(TypedDict):
    """A row that does not fit the others."""

    row: Annotated[int, "number of the row in the file, from 1"]
    off_mm: Annotated[float, "its distance from where the corrected arm has the tip [mm]"]


class Correction(TypedDict):
    """A corrected number of the robot file."""

    name: Annotated[str, "what is corrected"]
    value: Annotated[float, "the correction, in `unit`"]
    deviation: Annotated[float | None, "its standard deviation, in `unit`; null: fewer than 20 rows were measured"]
    unit: Annotated[str, "unit of both: deg, mm or %"]


class Calibrate(Head):
    """A corrected robot file from measured tips."""

    rows: Annotated[int, "how many rows were measured"]
    level: Annotated[str, "how much is corrected, in words"]
    corrected: Annotated[list[str], "kinds of numbers that are corrected: base, zeros, ..."]
    before: Annotated[Errors, "distances with the robot file as given"]
    after: Annotated[Errors, "distances with the corrected robot file"]
    noise_mm: Annotated[float, "estimated standard deviation of a measured coordinate [mm]"]
    flagged: Annotated[list[Flagged], "rows that were left out"]
    corrections: Annotated[list[Correction], "the numbers that are corrected"]
    unseen: Annotated[list[str], "numbers that these rows do not determine"]
    held: Annotated[list[str], "why a number was not corrected, in words"]
    out: Annotated[str | None, "the robot file that was written; null: none"]


class Suggested(Head):
    """`calibrate --suggest`: the next poses to measure."""

    joint_units: JointUnits
    poses: Annotated[list[list[float]], "joint values of the poses to measure [deg or mm]"]
