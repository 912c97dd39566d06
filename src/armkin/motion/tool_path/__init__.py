"""The tool's way, each piece at unit speed.

path_numbers.py   the moves of a path file, in degrees, as joint values and targets
drawing_frame.py  where a drawing stands, and how the tool is held on it
path_pieces.py    a smooth part of the way, at unit speed
piece_shapes.py   lines, arcs, helices and splines as such pieces
corner_blend.py   the curve that rounds the corner of two pieces
dense_points.py   targets on lines, gathered; fit_points.py: one smooth curve of them; chords.py: what lies between them
least_knots.py    splines of few knots; b_spline.py: their least squares
route.py          one piece after another, with rests at corners
"""
