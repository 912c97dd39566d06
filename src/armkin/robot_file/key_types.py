"""What all keys of robot files, scenes and their parts are made of: the strict model, and bounded numbers."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

# Bounds that no arm comes near: they catch slips of units, and keep every later product finite.
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]
Length = Annotated[float, Field(ge=-1e7, le=1e7)]


class Model(BaseModel):
    """No unknown keys, no text for numbers, finite numbers only; immutable."""

    # defer_build: RobotFile's validator holds those of all the others, and is built by the reader.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)
