"""Where a UR5e reaches with its tool straight down, and where to put it for a job.

Each cell of the map stands for a place of the tool; a share of 1 means that every turn of the tool is reached there.
"""

import numpy as np

import armkin

arm = armkin.load("ur5e")
found = armkin.reach(arm, grid=100.0, tool_down=True)
print(f"{found.reached} of {found.cells} cells are reached, {found.answers} poses from {found.solves} solves")
table = np.abs(found.z_mm - np.median(np.unique(found.z_mm))) < 1.0
best = np.argmax(np.where(table, found.limit_margin, -1.0))
print(f"farthest from its limits at x {found.x_mm[best]:.0f}, y {found.y_mm[best]:.0f}, z {found.z_mm[best]:.0f} mm")

# Four corners of a tray and two of a rack, the tool down: where may the arm's base stand?
down = np.diag([1.0, -1.0, -1.0, 1.0])
targets = np.tile(down, (6, 1, 1))
targets[:, :3, 3] = [[0, 0, 50], [300, 0, 50], [0, 200, 50], [300, 200, 50], [800, 0, 300], [800, 200, 300]]
[place] = armkin.place(arm, targets, step=100.0, yaw=np.pi / 4)
x, y, _ = place.xyz
print(f"{place.reach_all} places reach all {place.of} targets; the best: x {x:.0f}, y {y:.0f} mm")
print(f"{place.margin[place.best]:.0f} mm from the nearest one that does not")
