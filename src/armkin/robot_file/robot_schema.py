"""JSON Schema of the robot file, for the help and the red underlines of editors.

Made from the pydantic model, less what our YAML never holds (null), and with lists written the way that
every schema version knows.
"""

from typing import Any

from pydantic import BaseModel, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from armkin.robot_file import keep_out_keys
from armkin.robot_file.robot import RobotFile
from armkin.robot_file.robot_keys import Base, Pose

# The smallest useful file of each convention.
EXAMPLES: list[dict[str, Any]] = [
    {
        "name": "two_links",
        "convention": "standard",
        "task": "xy",
        "joints": [
            {"name": "q1", "dh": {"alpha": 0, "a": 200, "d": 0}, "limits": [-120, 120]},
            {"name": "q2", "dh": {"alpha": 0, "a": 300, "d": 0}, "limits": [-150, 150]},
        ],
    },
    {
        "name": "pan_tilt",
        "convention": "modified",
        "tool": {"xyz": [1500, 0, 0]},
        "joints": [
            {"name": "q1", "dh": {"alpha": 0, "a": 0, "d": 0}},
            {"name": "q2", "dh": {"alpha": -90, "a": 0, "d": 1000}},
        ],
    },
    {
        "name": "lift",
        "convention": "screws",
        "zero_pose": {"xyz": [300, 0, 115]},
        "joints": [
            {"name": "q1", "screw": {"w": [0, 0, 1], "v": [0, 0, 0]}},
            {
                "name": "q2",
                "type": "prismatic",
                "screw": {"w": [0, 0, 0], "v": [0, 0, 1]},
                "limits": [0, 200],
            },
        ],
    },
]


class _Generator(GenerateJsonSchema):
    """An optional key is absent, not null; a homogeneous tuple is a list of so many items."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """Null is no value of a file."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """A default of null is none."""
        schema_part = super().default_schema(schema)
        if schema_part.get("default") is None:
            schema_part.pop("default", None)
        return schema_part

    def tuple_schema(self, schema: core_schema.TupleSchema) -> JsonSchemaValue:
        """One kind of item instead of a list of kinds."""
        schema_part = super().tuple_schema(schema)
        items = schema_part.pop("prefixItems", None)
        if items:
            schema_part["items"] = items[0]  # all our tuples are of one kind
        return schema_part


def json_schema() -> dict[str, Any]:
    """The schema of a robot file as plain JSON data.

    >>> json_schema()["required"]
    ['name', 'convention', 'joints']
    """
    for model in (Pose, Base):  # their defaults stand in the schema, and their own build was deferred
        model.model_rebuild()
    return add_keep_out_schema(schema_of_model(RobotFile, "armkin robot file", examples=EXAMPLES))


def scene_schema() -> dict[str, Any]:
    """The schema of a scene."""
    from armkin.robot_file.scene_file import Scene

    return add_keep_out_schema(schema_of_model(Scene, "armkin scene"))


def add_keep_out_schema(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema whose `keep_out` says what an entry is: the word self, or one of the shapes."""
    entry_schema = _tidy_schema(TypeAdapter(keep_out_keys.Entry).json_schema(schema_generator=_Generator))
    schema.setdefault("$defs", {}).update(entry_schema.pop("$defs", {}))
    schema["$defs"]["Entry"] = entry_schema
    items = {"anyOf": [{"const": keep_out_keys.SELF}, {"$ref": "#/$defs/Entry"}]}
    schema["properties"]["keep_out"] |= {"items": items, "maxItems": keep_out_keys.MAX_ENTRIES}
    return schema


def schema_of_model(model: type[BaseModel], title: str, **keys: Any) -> dict[str, Any]:
    """The schema of a kind of file; keys: what stands before those of the model."""
    model_schema = _tidy_schema(model.model_json_schema(schema_generator=_Generator))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **keys, **model_schema}


def _tidy_schema(part: Any) -> Any:
    """A schema that does not depend on pydantic's version: whole bounds as integers, a lone reference without allOf.

    Titles go ("Max Speed"), as they hide the descriptions in editors' hovers.
    """
    if isinstance(part, float) and part.is_integer():
        return int(part)
    if isinstance(part, list):
        return [_tidy_schema(value) for value in part]
    if not isinstance(part, dict):
        return part
    titles = {name for name, content in part.items() if name == "title" and isinstance(content, str)}
    tidy_part = {name: _tidy_schema(content) for name, content in part.items() if name not in titles}
    match tidy_part.get("allOf"):
        case [{"$ref": str(reference)}]:
            del tidy_part["allOf"]
            return {"$ref": reference, **tidy_part}
    return tidy_part
