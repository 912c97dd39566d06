"""Arcs of G-code: the circle of G2 and G3, by its centre or its radius."""

import math

from armkin.path_file.drawing import Point

AXES = "XYZ"
# an arc's end may lie off its circle by _MISS, or by _MISS_SHARE of the radius up to _MAX_MISS
_MISS = 0.005  # [mm]
_MISS_SHARE = 0.001  # [1] of the radius
_MAX_MISS = 0.5  # [mm]


class ArcError(ValueError):
    """What is wrong with an arc, in words."""


def arc(
    word: str, plane: tuple[int, int, int], values: dict[str, float], unit: float, a: Point, b: Point
) -> tuple[Point, Point, float]:
    """Centre, normal and angle of G2 or G3 from a to b; takes its words out of `values`.

    plane: its two axes, and the one across; unit: [mm]. Raises ArcError.
    """
    x, y, normal_axis = plane
    sense = _sense(word)
    turns = values.pop("P", 1.0)
    if turns != int(turns) or not 1 <= turns <= 1000:
        raise ArcError(f"{word} P{turns:g}: turns are whole, 1 to 1000")
    centre = _centre(word, plane, values, unit, a, b)
    radius, miss = _radius(plane, centre, a, b)
    if miss > _MAX_MISS or (miss > _MISS and miss > _MISS_SHARE * radius):
        raise ArcError(f"{word} ends {miss:.4g} mm off its circle of {radius:.6g} mm")
    centre = _equalised_centre(plane, centre, a, b, miss)
    u, v = (a[x] - centre[x], a[y] - centre[y]), (b[x] - centre[x], b[y] - centre[y])
    angle = sense * (math.atan2(v[1], v[0]) - math.atan2(u[1], u[0])) % (2 * math.pi)
    is_circle = math.hypot(a[x] - b[x], a[y] - b[y]) < 1e-9 * max(radius, 1.0)
    angle = 2 * math.pi if is_circle or angle < 1e-12 else angle
    normal = (float(normal_axis == 0), float(normal_axis == 1), float(normal_axis == 2))
    return centre, normal, sense * (angle + 2 * math.pi * (turns - 1))


def _sense(word: str) -> float:
    """1 counter-clockwise, -1 clockwise, seen against the third axis."""
    return -1.0 if word == "G2" else 1.0


def _centre(word: str, plane: tuple[int, int, int], values: dict[str, float], unit: float, a: Point, b: Point) -> Point:
    """The centre by I, J and K, which count from a, or by R; takes these words out of `values`."""
    x, y, normal_axis = plane
    offsets = {k: values.pop(letter) * unit for k, letter in enumerate("IJK") if letter in values}
    if normal_axis in offsets:
        raise ArcError(f"{word} has {'IJK'[normal_axis]} in the plane of {AXES[x]} and {AXES[y]}")
    if "R" not in values:
        if not offsets:
            raise ArcError(f"{word} needs {'IJK'[x]}, {'IJK'[y]} or R")
        return a[0] + offsets.get(0, 0.0), a[1] + offsets.get(1, 0.0), a[2] + offsets.get(2, 0.0)
    if offsets:
        raise ArcError(f"{word} has R and {'IJK'[next(iter(offsets))]}: one of them")
    return _centre_by_radius(word, plane, values.pop("R") * unit, a, b)


def _radius(plane: tuple[int, int, int], centre: Point, a: Point, b: Point) -> tuple[float, float]:
    """The distance of a from the centre, and by how much b's is another one."""
    x, y, _ = plane
    radius = math.hypot(a[x] - centre[x], a[y] - centre[y])
    return radius, abs(math.hypot(b[x] - centre[x], b[y] - centre[y]) - radius)


def _equalised_centre(plane: tuple[int, int, int], centre: Point, a: Point, b: Point, miss: float) -> Point:
    """The centre as far from both ends: what arcs miss, one after another, would add up. miss: see `_radius`."""
    x, y, _ = plane
    chord = b[x] - a[x], b[y] - a[y]
    size = math.hypot(*chord)
    if size == 0.0:
        return centre
    u, v = (a[x] - centre[x], a[y] - centre[y]), (b[x] - centre[x], b[y] - centre[y])
    overhang = ((u[0] + v[0]) * chord[0] + (u[1] + v[1]) * chord[1]) / (2 * size)
    if abs(overhang) > 2 * miss:
        return centre
    centre_list = list(centre)
    centre_list[x] += overhang * chord[0] / size
    centre_list[y] += overhang * chord[1] / size
    return centre_list[0], centre_list[1], centre_list[2]


def _centre_by_radius(word: str, plane: tuple[int, int, int], radius: float, a: Point, b: Point) -> Point:
    """The centre of an arc of this radius, above 0 of at most half a turn, below 0 of more."""
    x, y, _ = plane
    dx, dy = b[x] - a[x], b[y] - a[y]
    chord = math.hypot(dx, dy)
    if chord < 1e-9:
        raise ArcError(f"{word} with R begins where it ends: a whole circle needs I, J or K")
    if chord > 2 * abs(radius) * (1 + 1e-6) + 2 * _MISS:
        raise ArcError(f"{word} R{radius:g} is shorter than half of its chord of {chord:.6g} mm")
    rise = math.sqrt(max(radius * radius - chord * chord / 4, 0.0)) * _sense(word) * (1 if radius > 0 else -1)
    centre = list(a)
    centre[x] += dx / 2 - rise * dy / chord
    centre[y] += dy / 2 + rise * dx / chord
    return centre[0], centre[1], centre[2]
