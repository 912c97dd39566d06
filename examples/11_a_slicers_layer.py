"""A slicer's first layer: walls with corners, infill and travel, on the published arm. Its argument: a picture.

`first_layer.gcode` is a plate of our own, in PrusaSlicer's dialect; `scripts/first_layer.py` writes it.
"""

import sys
from pathlib import Path

import armkin
from armkin.motion.tool_path.placing import placing
from armkin.path_file import read_drawing
from armkin.path_file.drawing import Wishes
from armkin.plot.path import plot_path

arm, file = armkin.load("three_dof"), str(Path(__file__).with_name("first_layer.gcode"))
layer = read_drawing(file, placing(arm, [320, -20, 200]), Wishes())
plan = armkin.path(arm, layer)
points = sum(len(move.polyline or []) for move in layer.moves)
print(
    f"{points} points, {plan.length / 1000:.2f} m in {plan.duration:.0f} s, {len(plan.on_path)} stretches between rests"
)
print(f"each point within {plan.deviation:.3f} mm of the motion, {plan.tolerance} allowed")
print(f"{len(layer.notes)} words are of the printer: {layer.notes[0]}")
if sys.argv[1:]:
    plot_path(plan, sys.argv[1])
