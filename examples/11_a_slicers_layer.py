"""A slicer's first layer: walls with corners, infill and travel, on the published arm. Its argument: a picture.

`first_layer.gcode` is a plate of our own, in PrusaSlicer's dialect; `scripts/first_layer.py` writes it.
"""

import sys
from pathlib import Path

import armkin
from armkin.plot.path_picture import plot_path

arm = armkin.load("three_dof")
# The file's zero lies 320 mm in front of the arm, 20 mm to its right, 200 mm up.
layer = armkin.drawing(arm, Path(__file__).with_name("first_layer.gcode"), at=[320, -20, 200])
plan = armkin.path(arm, layer)
points = sum(len(move.polyline or []) for move in layer.moves)
rests = len(plan.on_path)
print(f"{points} points, {plan.length / 1000:.2f} m in {plan.duration:.0f} s, {rests} stretches between rests")
print(f"each point within {plan.deviation:.3f} mm of the motion, {plan.tolerance} allowed")
print(f"{len(layer.notes)} words are of the printer: {layer.notes[0]}")
if sys.argv[1:]:
    plot_path(plan, sys.argv[1])
