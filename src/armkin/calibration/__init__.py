"""Measured tips in, a corrected robot file out.

corrected_chain.py     an arm with small corrections at every link, its poses and their exact Jacobian
robust_fit.py          damped Gauss-Newton with a workshop prior
dropped_rows.py        rows that are far out lose their weight
calibrate_arm.py       `calibrate`: checks, levels by cross-validation, what was seen, the corrected arm
model_selection.py     which corrections the rows justify: levels from few to all
observability.py       which corrections the rows show, and the next poses that would show most
measurement_checks.py  what cannot be right is refused: units, columns, joints that never move
"""
