"""Writes examples/first_layer.gcode: a plate of our own in PrusaSlicer's dialect of G-code, sliced by the lines below.

    python scripts/first_layer.py [--layers 1] > examples/first_layer.gcode

No slicer made it and nothing of one is in it: the plate, its offsets and its infill are computed here. Perimeters are
offset outlines with rounded and sharp corners, round ones as chords within 0.0125 mm; infill goes at 45 degrees, by
turns, between the walls; between two loops the head travels with the filament drawn back.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WIDTH, HEIGHT = 0.45, 0.2  # [mm] of a line
CHORD = 0.0125  # [mm] from a chord to its arc
# A corner each, anticlockwise: x, y, and the radius that rounds it [mm].
PLATE = np.array([
    [0, 0, 5], [60, 0, 5], [60, 22, 0], [46, 22, 3], [46, 34, 6], [14, 34, 6], [14, 22, 3], [0, 22, 0],
], float)  # fmt: skip
HOLES = np.array([[10, 11, 4], [50, 11, 4], [30, 20, 8]], float)  # x, y, radius [mm]
FEED, TRAVEL = 1200, 7800  # [mm/min]


def outline(inset: float) -> Array:
    """The plate's outline, moved inwards: (N, 2), closed."""
    p, radius = PLATE[:, :2], PLATE[:, 2]
    along = np.roll(p, -1, axis=0) - p
    along /= np.linalg.norm(along, axis=1)[:, None]
    before = np.roll(along, 1, axis=0)
    left, left_before = (np.stack([-d[:, 1], d[:, 0]], axis=1) for d in (along, before))
    corner = p + inset * (left + left_before) / (1 + (left * left_before).sum(axis=1))[:, None]
    turn = np.arctan2(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], (before * along).sum(axis=1))
    out: list[Array] = []
    for q, d, n, angle, r in zip(corner, before, left_before, turn, radius, strict=True):
        size = max(r - inset * np.sign(angle), 0.0)
        begin = q - size * np.tan(abs(angle) / 2) * d
        centre = begin + np.sign(angle) * size * n
        out += [centre + rotated(begin - centre, a) for a in np.linspace(0, angle, chords(size, angle) + 1)]
    out.append(out[0])
    points = np.array(out)
    apart: Array = points[np.append(True, np.abs(np.diff(points, axis=0)).max(axis=1) > 1e-9)]
    return apart


def rotated(v: Array, angle: float) -> Array:
    """A vector turned to the left."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


def chords(radius: float, angle: float) -> int:
    """How many chords an arc needs."""
    return 0 if radius <= CHORD else int(np.ceil(abs(angle) / (2 * np.arccos(1 - CHORD / radius))))


def hole(k: int, inset: float) -> Array:
    """A hole's rim, moved into the plate: (N, 2), closed."""
    x, y, r = HOLES[k]
    a = np.linspace(0, -2 * np.pi, chords(r + inset, 2 * np.pi) + 1)
    return np.stack([x + (r + inset) * np.cos(a), y + (r + inset) * np.sin(a)], axis=1)


def infill(walls: list[Array], angle: float) -> Iterator[Array]:
    """Lines between walls at an angle [rad], turn about; where the next one is near they go on: (N, 2) each."""
    c, s = np.cos(angle), np.sin(angle)
    to = np.array([[c, s], [-s, c]])
    edges = np.concatenate([np.stack([w[:-1] @ to.T, w[1:] @ to.T], axis=1) for w in walls])
    low, high = edges[:, :, 1].min(), edges[:, :, 1].max()
    open_: list[list[Array]] = []
    for k, y in enumerate(np.arange(low + WIDTH / 2, high, WIDTH)):
        a, b = edges[:, 0], edges[:, 1]
        cut = (a[:, 1] <= y) != (b[:, 1] <= y)
        share = (y - a[cut, 1]) / (b[cut, 1] - a[cut, 1])
        x = np.sort(a[cut, 0] + share * (b[cut, 0] - a[cut, 0]))
        parts = [
            (np.array([x0, y]), np.array([x1, y])) for x0, x1 in zip(x[::2], x[1::2], strict=True) if x1 - x0 > 0.3
        ]
        still: list[list[Array]] = []
        for part in parts:
            one, other = part if k % 2 else part[::-1]
            way = next((w for w in open_ if np.linalg.norm(w[-1] - one) < 4 * WIDTH), None)
            if way is None:
                way = []
            else:
                open_ = [w for w in open_ if w is not way]
            still.append([*way, one, other])
        yield from (np.array(way) @ to for way in open_)
        open_ = still
    yield from (np.array(way) @ to for way in open_)


def ways(layer: int) -> Iterator[tuple[str, Array]]:
    """What a layer is drawn of: kind and points (N, 2)."""
    if layer == 0:
        yield "Skirt/Brim", outline(-6.0)
    for inset in (2.5 * WIDTH, 1.5 * WIDTH, 0.5 * WIDTH):
        kind = "External perimeter" if inset < WIDTH else "Perimeter"
        yield from ((kind, hole(k, inset)) for k in range(len(HOLES)))
        yield kind, outline(inset)
    walls = [outline(2.8 * WIDTH), *(hole(k, 2.8 * WIDTH) for k in range(len(HOLES)))]
    yield from (("Solid infill", way) for way in infill(walls, np.pi / 4 if layer % 2 else -np.pi / 4))


def number(x: float, digits: int = 3) -> str:
    """As PrusaSlicer prints it: no zero before the point, none behind the last digit."""
    text = f"{x:.{digits}f}".rstrip("0").rstrip(".")
    text = text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text
    return "0" if text in ("", "-", "-0") else text


def program(layers: int) -> Iterator[str]:
    """The lines of the file."""
    yield "; written by scripts/first_layer.py of armkin in PrusaSlicer's dialect: a plate of our own, by no slicer"
    yield from (
        "; layer_height = 0.2, perimeters = 3, solid infill at 45 degrees",
        "M73 P0 R1",
        "M201 X1000 Y1000 Z200 E5000",
    )
    yield from (
        "M203 X200 Y200 Z12 E120",
        "M204 P1250 R1250 T1250",
        "M205 X8.00 Y8.00 Z0.40 E4.50",
        "M107",
        ";TYPE:Custom",
    )
    yield from (
        "G90 ; absolute",
        "M83 ; relative extrusion",
        "M104 S215",
        "M140 S60",
        "M190 S60",
        "M109 S215",
        "G28 W ; home",
    )
    yield from ("G21 ; millimetres", "G92 E0", "M221 S95")
    bead = WIDTH * HEIGHT / (np.pi * 1.75**2 / 4)  # filament for each millimetre
    for layer in range(layers):
        z, said = HEIGHT * (layer + 1), ""
        yield from (";LAYER_CHANGE", f";Z:{number(z)}", f";HEIGHT:{HEIGHT}", "G92 E0", f"G1 Z{number(z)} F720")
        for kind, points in ways(layer):
            x, y = points[0]
            yield from ("G1 E-.8 F2100", f"G1 X{number(x)} Y{number(y)} F{TRAVEL}", "G1 E.8 F2100")
            if kind != said:
                said = kind
                yield from (f";TYPE:{kind}", f";WIDTH:{WIDTH}")
            yield f"G1 F{FEED}"
            for a, b in pairwise(points):
                yield f"G1 X{number(b[0])} Y{number(b[1])} E{number(bead * float(np.linalg.norm(b - a)), 5)}"
    yield from (
        "G1 E-.8 F2100",
        "M107",
        ";TYPE:Custom",
        "G4 ; wait",
        "M104 S0",
        "M140 S0",
        "M84 ; motors off",
        "M73 P100 R0",
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--layers", type=int, default=1)
    sys.stdout.writelines(line + "\n" for line in program(parser.parse_args().layers))
