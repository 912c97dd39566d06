"""Reads triangles from mesh files: STL in both forms, and triangles and polygons of Collada (.dae).

Collada: https://www.khronos.org/files/collada_spec_1_4.pdf; `up_axis` is ignored, as in RViz.
"""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.errors import MissingExtraError, UsageError
from armkin.formula.arrays import Array

MAX_BYTES = 64 * 2**20  # largest file [bytes]
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
_MAX_DEPTH = 40  # deepest nesting of nodes
_Index = NDArray[np.int64]


def read_triangles(path: Path) -> Array:
    """The triangles (N, 3, 3) of a file, in its own units; a Collada file's in metres. Raises UsageError."""
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise UsageError(f"{path}: {size / 2**20:.0f} MB; a mesh may have {MAX_BYTES // 2**20}")
        raw = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: cannot read the mesh: {error.strerror}") from None
    try:
        corners = _parse_collada(raw) if path.suffix.lower() == ".dae" else _parse_stl(raw)
    except (ValueError, LookupError, TypeError, OverflowError) as error:
        raise UsageError(f"{path}: is no mesh that can be read: {error}") from None
    if not np.isfinite(corners).all():
        raise UsageError(f"{path}: holds a number that is not finite")
    return corners


def _parse_stl(raw: bytes) -> Array:
    if len(raw) >= 84 and len(raw) == 84 + 50 * int.from_bytes(raw[80:84], "little"):
        rows = np.frombuffer(raw, np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]), offset=84)
        return rows["v"].astype(float)
    if not raw.lstrip().startswith(b"solid"):
        raise ValueError("neither binary STL of the length that it states, nor text that begins with solid")
    vertices = np.array([[float(x) for x in row] for row in _VERTEX.findall(raw)])
    return vertices.reshape(-1, 3, 3)


def _parse_collada(raw: bytes) -> Array:
    """Triangles (N, 3, 3) [m] of a Collada file. Raises ValueError for what is no XML."""
    try:
        from defusedxml.ElementTree import fromstring
    except ImportError:
        raise MissingExtraError(
            "reading a Collada file needs defusedxml: pip install defusedxml (armkin's extra: urdf)"
        ) from None
    try:
        root = fromstring(raw, forbid_dtd=True)
    except SyntaxError as error:  # the base class of ElementTree's ParseError
        raise ValueError(f"no XML: {error}") from None
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]
    unit = root.find("asset/unit")
    metre = 1.0 if unit is None else float(unit.get("meter", 1.0))
    shapes = {
        geometry.get("id"): list(_geometry_triangles(geometry.find("mesh")))
        for geometry in root.iter("geometry")
        if geometry.find("mesh")
    }
    nodes = {node.get("id"): node for node in root.iter("node")}
    parts = [np.zeros((0, 3, 3))]
    for scene in root.iter("visual_scene"):
        for node in scene.findall("node"):
            parts += _node_triangles(node, np.eye(4), shapes, nodes, 0)
    return np.concatenate(parts) * metre


def _node_triangles(
    node: Any, T: Array, shapes: dict[Any, list[Array]], nodes: dict[Any, Any], depth: int
) -> Iterator[Array]:
    """The triangles of a node and of the nodes in it."""
    if depth > _MAX_DEPTH:
        raise ValueError(f"nodes nested deeper than {_MAX_DEPTH}")
    for element in node:
        T = T @ _transformation(element.tag, [float(x) for x in (element.text or "").split()]) if element.text else T
    for instances in node.findall("instance_geometry"):
        for corners in shapes.get(instances.get("url", "").removeprefix("#"), []):
            yield corners @ T[:3, :3].T + T[:3, 3]
    instances = [nodes[instance.get("url", "").removeprefix("#")] for instance in node.findall("instance_node")]
    for child in [*node.findall("node"), *instances]:
        yield from _node_triangles(child, T, shapes, nodes, depth + 1)


def _transformation(tag: str, values: list[float]) -> Array:
    T = np.eye(4)
    if tag == "matrix":
        T[:] = np.reshape(values, (4, 4))
    elif tag == "translate":
        T[:3, 3] = values
    elif tag == "scale":
        T[:3, :3] = np.diag(values)
    elif tag == "rotate":
        x, y, z = np.array(values[:3]) / np.linalg.norm(values[:3])
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = math.radians(values[3])
        T[:3, :3] += math.sin(angle) * K + (1 - math.cos(angle)) * K @ K
    return T


def _geometry_triangles(mesh: Any) -> Iterator[Array]:
    """The triangles of a geometry, from its triangles, polylists and polygons, which are assumed to be convex."""
    sources = dict(_source_arrays(mesh))
    vertices = {node.get("id"): node for node in mesh.findall("vertices")}
    for kind, index_of in _INDEX_OF.items():
        for group in mesh.findall(kind):
            inputs = group.findall("input")
            width = 1 + max(int(node.get("offset", 0)) for node in inputs)
            vertex = _input_of(inputs, "VERTEX")
            owner = vertices[vertex.get("source", "").removeprefix("#")]
            place = _input_of(owner.findall("input"), "POSITION")
            points = sources[place.get("source", "").removeprefix("#")][:, :3]
            lists = [np.array((node.text or "").split(), dtype=np.int64) for node in group.findall("p")]
            corners = [indices.reshape(-1, width)[:, int(vertex.get("offset", 0))] for indices in lists]
            for triangles in index_of(group, corners):
                if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(points)):
                    raise ValueError("a triangle names a vertex that is not there")
                yield points[triangles]


def _input_of(inputs: list[Any], semantic: str) -> Any:
    """The only input with this semantic."""
    [match] = [source for source in inputs if source.get("semantic") == semantic]
    return match


def _source_arrays(mesh: Any) -> Iterator[tuple[str, Array]]:
    """Arrays of numbers by their ids, a row for each vertex."""
    for source in mesh.findall("source"):
        numbers, accessor = source.find("float_array"), source.find("technique_common/accessor")
        if numbers is not None and accessor is not None:
            values = np.array((numbers.text or "").split(), dtype=float)
            stride = int(accessor.get("stride", 1))
            yield source.get("id"), values[: len(values) // stride * stride].reshape(-1, stride)


def _triangle_indices(group: Any, corners: list[_Index]) -> list[_Index]:
    return [indices[: len(indices) // 3 * 3].reshape(-1, 3) for indices in corners]


def _polygon_indices(group: Any, corners: list[_Index]) -> list[_Index]:
    return [_fan_triangles(polygon) for polygon in corners]


def _polylist_indices(group: Any, corners: list[_Index]) -> list[_Index]:
    counts = np.array(group.findtext("vcount", "").split(), dtype=np.int64)
    return [_fan_triangles(polygon) for polygon in np.split(np.concatenate(corners), np.cumsum(counts)[:-1])]


_INDEX_OF = {"triangles": _triangle_indices, "polylist": _polylist_indices, "polygons": _polygon_indices}


def _fan_triangles(corners: _Index) -> _Index:
    """A polygon's triangles."""
    fan = [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
    return np.array(fan, dtype=np.int64).reshape(-1, 3)
