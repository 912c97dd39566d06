"""Readers of G-code and SVG that share nothing with armkin's: what a file draws, as points close together.

Written from the NIST report (RS274NGC) and SVG 1.1 for well-formed files; complex numbers and brute sampling.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np

_ARC = 2000  # points of an arc or curve
_MM = 25.4 / 96


def gcode_points(text: str) -> np.ndarray:
    """All points that the tool passes behind the first one: (N, 3) [mm], arcs as chords."""
    unit, absolute, plane, motion, system = 1.0, True, (0, 1, 2), None, 1
    zero = {k: np.zeros(3) for k in range(1, 7)}
    local, shift, place = np.zeros(3), np.zeros(3), np.zeros(3)
    points: list[np.ndarray] = []
    for raw in text.splitlines():
        line = re.sub(r"\([^)]*\)", "", raw.split(";")[0]).upper()
        line = re.sub(r"\*\d+\s*$", "", re.sub(r"\s", "", line))
        words = [(a, float(b)) for a, b in re.findall(r"([A-Z])([-+]?\d*\.?\d*)", line) if b not in ("", "%")]
        codes = [b for a, b in words if a == "G"]
        value = {a: b for a, b in words if a not in "GMN"}
        if 20 in codes or 21 in codes:
            unit = 25.4 if 20 in codes else 1.0
        absolute = True if 90 in codes else False if 91 in codes else absolute
        for k, axes in ((17, (0, 1, 2)), (18, (2, 0, 1)), (19, (1, 2, 0))):
            plane = axes if k in codes else plane
        system = next((int(c) - 53 for c in codes if 54 <= c <= 59), system)
        motion = next((c for c in codes if c in (0, 1, 2, 3)), motion)
        axis_values = [(k, value[a] * unit) for k, a in enumerate("XYZ") if a in value]
        if 10 in codes:
            for k, x in axis_values:
                number = int(value.get("P", 0)) or system
                zero[number][k] = x if value["L"] == 2 else place[k] - local[k] - shift[k] - x
        elif 52 in codes or 92 in codes:
            for k, x in axis_values:
                if 52 in codes:
                    local[k] = x
                else:
                    shift[k] = place[k] - zero[system][k] - local[k] - x
        elif axis_values or (motion in (2, 3) and set(value) & set("IJKR")):
            goal, base = place.copy(), np.zeros(3) if 53 in codes else zero[system] + local + shift
            for k, x in axis_values:
                goal[k] = base[k] + x if absolute or 53 in codes else place[k] + x
            if motion in (2, 3):
                points += _arc_points(place, goal, plane, motion == 3, value, unit, bool(points))
            else:
                points.append(goal)
            place = goal
        if {m for a, m in words if a == "M"} & {2.0, 30.0}:
            break
    return np.array(points)


def _arc_points(
    a: np.ndarray, b: np.ndarray, plane: tuple[int, int, int], left: bool, value: dict[str, float], unit: float,
    drawn: bool,
) -> list[np.ndarray]:  # fmt: skip
    x, y, across = plane
    p, q = complex(a[x], a[y]), complex(b[x], b[y])
    if "R" in value:
        r, half = value["R"] * unit, (q - p) / 2
        away = np.sqrt(max(r * r - abs(half) ** 2, 0.0)) * half / abs(half) * 1j
        centre = p + half + (away if left == (r > 0) else -away)
    else:
        centre = p + complex(*(value.get("IJK"[k], 0.0) * unit for k in (x, y)))
    turn = np.angle((q - centre) / (p - centre)) % (2 * np.pi)
    turn = turn if left else turn - 2 * np.pi
    if abs(q - p) < 1e-9:
        turn = 2 * np.pi if left else -2 * np.pi
    turn += (1 if left else -1) * 2 * np.pi * (value.get("P", 1.0) - 1)
    f = np.linspace(0.0, 1.0, int(_ARC * max(abs(turn), 1.0)))[drawn:]
    z = centre + (p - centre) * np.exp(1j * turn * f) * (1 + f * (abs(q - centre) / abs(p - centre) - 1))
    points = np.empty((len(f), 3))
    points[:, x], points[:, y], points[:, across] = z.real, z.imag, a[across] + f * (b[across] - a[across])
    return list(points)


def svg_strokes(text: str) -> list[np.ndarray]:
    """The strokes of a drawing, (N, 2) [mm] each, zero at the viewBox's lower left corner and y up."""
    root = ElementTree.fromstring(text)
    box = [float(x) for x in root.get("viewBox", "0 0 100 100").split()]
    wide = re.fullmatch(r"([\d.]+)(mm|cm|in|px|)", root.get("width", "100mm"))
    assert wide is not None
    size = float(wide[1]) * {"mm": 1.0, "cm": 10.0, "in": 25.4, "px": _MM, "": _MM}[wide[2]]
    k = size / box[2]
    frame = np.array([[k, 0, -k * box[0]], [0, -k, k * (box[1] + box[3])], [0, 0, 1.0]])
    ids = {e.get("id"): e for e in root.iter() if e.get("id")}
    return [s for child in root for s in _element_strokes(child, frame, ids)]


def _element_strokes(
    e: ElementTree.Element, frame: np.ndarray, ids: dict[str | None, ElementTree.Element]
) -> list[np.ndarray]:
    tag = e.tag.split("}")[-1]
    for name, inside in re.findall(r"(\w+)\s*\(([^)]*)\)", e.get("transform", "")):
        frame = frame @ _transform_matrix(name, [float(x) for x in re.split(r"[\s,]+", inside.strip())])
    if tag == "g":
        return [s for child in e for s in _element_strokes(child, frame, ids)]
    if tag == "use":
        moved = frame @ _transform_matrix("translate", [float(e.get("x", 0)), float(e.get("y", 0))])
        href = e.get("href") or e.get("{http://www.w3.org/1999/xlink}href") or ""
        return _element_strokes(ids[href[1:]], moved, ids)
    if tag == "defs":
        return []
    n = {key: float(x) for key, x in e.items() if re.fullmatch(r"-?[\d.]+(e-?\d+)?", x)}
    t = np.exp(2j * np.pi * np.linspace(0.0, 1.0, _ARC))
    strokes: list[np.ndarray] = []
    if tag == "path":
        strokes = _subpaths(e.get("d", ""))
    elif tag == "line":
        strokes = [np.array([complex(n.get("x1", 0), n.get("y1", 0)), complex(n.get("x2", 0), n.get("y2", 0))])]
    elif tag in ("polyline", "polygon"):
        flat = [float(x) for x in re.split(r"[\s,]+", e.get("points", "").strip())]
        z = np.array(flat[::2]) + 1j * np.array(flat[1::2])
        strokes = [np.append(z, z[0]) if tag == "polygon" else z]
    elif tag == "rect":
        p, w, h = complex(n.get("x", 0), n.get("y", 0)), n["width"], n["height"]
        strokes = [p + np.array([0, w, w + 1j * h, 1j * h, 0])]
    else:
        rx, ry = n.get("rx", n.get("r", 0.0)), n.get("ry", n.get("r", 0.0))
        strokes = [complex(n.get("cx", 0), n.get("cy", 0)) + rx * t.real + 1j * ry * t.imag]
    return [(np.stack([z.real, z.imag, np.ones(len(z))], axis=1) @ frame.T)[:, :2] for z in strokes]


def _transform_matrix(name: str, v: list[float]) -> np.ndarray:
    c, s = np.cos(np.deg2rad(v[0])), np.sin(np.deg2rad(v[0]))
    if name == "translate":
        return np.array([[1, 0, v[0]], [0, 1, v[1] if len(v) > 1 else 0], [0, 0, 1]])
    if name == "scale":
        return np.diag([v[0], v[-1], 1.0])
    if name == "rotate":
        x, y = v[1:] or (0.0, 0.0)
        turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        return np.asarray(_transform_matrix("translate", [x, y]) @ turned @ _transform_matrix("translate", [-x, -y]))
    if name == "skewX":
        return np.array([[1, s / c, 0], [0, 1, 0], [0, 0, 1]])
    a, b, cc, d, e, f = v
    return np.array([[a, cc, e], [b, d, f], [0, 0, 1]])


def _subpaths(d: str) -> list[np.ndarray]:
    """Subpaths of path data as complex numbers; flags of arcs stand apart."""
    tokens = re.findall(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", d)
    strokes: list[list[complex]] = []
    f = np.linspace(0.0, 1.0, _ARC)[1:]
    i, point, begin, command, last, before = 0, 0j, 0j, "", 0j, ""
    while i < len(tokens):
        if tokens[i].isalpha():
            command, i = tokens[i], i + 1
        kind, base = command.upper(), point if command.islower() else 0j
        size = {"Z": 0, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "A": 7}.get(kind, 2)
        v, i = [float(x) for x in tokens[i : i + size]], i + size
        z = [base + complex(v[k], v[k + 1]) for k in range(0, size - 1, 2)] if size % 2 == 0 else []
        if kind == "M":
            point = begin = z[0]
            strokes.append([point])
            command = "l" if command == "m" else "L"
        elif kind == "Z":
            strokes[-1].append(begin)
            point = begin
        elif kind in "LHV":
            point = z[0] if kind == "L" else (
                complex(base.real + v[0], point.imag) if kind == "H" else complex(point.real, base.imag + v[0])
            )  # fmt: skip
            _current_stroke(strokes, begin, before).append(point)
        elif kind in "CSQT":
            cubic = kind in "CS"
            first = (
                z[0] if kind in "CQ" else 2 * point - last if before in ("CS" if cubic else "QT") and before else point
            )
            last = (z[1] if kind == "C" else z[0]) if cubic else first
            b: list[Any] = [point, first, last, z[-1]] if cubic else [point, first, z[-1]]
            for k in range(len(b) - 1, 0, -1):  # de Casteljau
                b = [b[j] + f * (b[j + 1] - b[j]) for j in range(k)]
            _current_stroke(strokes, begin, before).extend(b[0])
            point = z[-1]
        elif kind == "A":
            end = base + complex(v[5], v[6])
            _current_stroke(strokes, begin, before).extend(_ellipse_points(point, end, v, f))
            point = end
        before = kind
    return [np.array(s) for s in strokes if np.ptp(np.array(s).real) + np.ptp(np.array(s).imag) > 0]  # dots are none


def _current_stroke(strokes: list[list[complex]], begin: complex, before: str) -> list[complex]:
    if before == "Z":
        strokes.append([begin])
    return strokes[-1]


def _ellipse_points(a: complex, b: complex, v: list[float], f: np.ndarray) -> np.ndarray:
    """In the frame where the ellipse is a unit circle: both circles through the ends, then the flags choose."""
    rx, ry, tilt, large, sweep = v[0], v[1], np.exp(1j * np.deg2rad(v[2])), v[3], v[4]

    def unit(z: complex) -> complex:
        w = z / tilt
        return complex(w.real / rx, w.imag / ry)

    p, q = unit(a), unit(b)
    half = abs(q - p) / 2
    if half > 1:  # too small: grown until it fits
        return _ellipse_points(a, b, [rx * half * (1 + 1e-12), ry * half * (1 + 1e-12), *v[2:]], f)
    away = np.sqrt(1 - half**2) * (q - p) / abs(q - p) * 1j
    for centre in ((p + q) / 2 + away, (p + q) / 2 - away):
        turn = np.angle((q - centre) / (p - centre)) % (2 * np.pi)
        turn = turn if sweep else turn - 2 * np.pi
        if (abs(turn) > np.pi) == bool(large):
            break
    w = centre + (p - centre) * np.exp(1j * turn * f)
    return np.asarray((w.real * rx + 1j * w.imag * ry) * tilt)
