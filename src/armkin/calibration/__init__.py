"""Calibration: computes a corrected robot file from measured tips.

corrected_chain.py     an arm with small corrections at every link, its poses and their Jacobian
robust_fit.py          damped Gauss-Newton with a prior of workshop tolerances
dropped_rows.py        weights that ignore outliers
calibrate_arm.py       `calibrate`: the corrected arm and its corrections
model_selection.py     selects the corrections that the rows justify, by cross-validation
observability.py       corrections that the rows determine, and the most informative next poses
measurement_checks.py  refuses wrong measurements: units, columns, joints that never move
"""
