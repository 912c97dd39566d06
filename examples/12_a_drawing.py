"""A drawing in SVG, drawn by the published arm with its pen lifted between the strokes. Its argument: a picture."""

import sys
from pathlib import Path

import armkin
from armkin.motion.tool_path.placing import placing
from armkin.path_file import read_drawing
from armkin.path_file.drawing import Wishes
from armkin.plot.path import plot_path

arm = armkin.load("three_dof")
file = str(Path(__file__).with_name("drawing.svg"))
drawing = read_drawing(file, placing(arm, [320, -50, 200]), Wishes(feed=60.0, lift=4.0))  # mm/s, mm
plan = armkin.path(arm, drawing)
strokes = sum(move.tool_speed is None and move.polyline is not None for move in drawing.moves)
print(f"{strokes} strokes, {plan.length:.0f} mm in {plan.duration:.1f} s")
print(f"each point within {plan.deviation:.3f} mm of the motion, {plan.tolerance} allowed")
if sys.argv[1:]:
    plot_path(plan, sys.argv[1])
