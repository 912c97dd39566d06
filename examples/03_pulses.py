"""Motor pulses: what the motors are told, where the tool really is, and what rounding costs."""

import numpy as np

import armkin

arm = armkin.load("three_dof")
q = np.deg2rad([-30, 5, -5])
p = armkin.pulses(arm, q)
print(p)  # [ -1067 -10144   5667], counted from home
print(np.rad2deg(armkin.joints(arm, p)).round(4))  # where those pulses put the joints
plain, best = armkin.rounding(arm, q), armkin.best_pulses(arm, q).chosen
print(f"rounded {plain.error:.6f} mm off, best neighbour {best.error:.6f} mm off")
