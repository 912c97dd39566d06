"""A drawing in SVG, drawn by the published arm with its pen lifted between the strokes. Its argument: a picture."""

import sys
from pathlib import Path

import armkin
from armkin.plot.path_picture import plot_path

arm = armkin.load("three_dof")
# feed: mm/s along the strokes; lift: mm that the pen goes up between them.
drawing = armkin.drawing(arm, Path(__file__).with_name("drawing.svg"), at=[320, -50, 200], feed=60.0, lift=4.0)
plan = armkin.path(arm, drawing)
strokes = sum(move.tool_speed is None and move.polyline is not None for move in drawing.moves)
print(f"{strokes} strokes, {plan.length:.0f} mm in {plan.duration:.1f} s")
print(f"each point within {plan.deviation:.3f} mm of the motion, {plan.tolerance} allowed")
if sys.argv[1:]:
    plot_path(plan, sys.argv[1])
