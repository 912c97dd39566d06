"""Names of array shapes for signatures; n is the arm's number of joints, ... the batch.

All names are `Array` for the type checker and at run time; they only inform the reader.
"""

from armkin.formula.arrays import Array

Joints = Array  # (..., n) joint values [rad | mm]
Points = Array  # (..., 3) positions of the tool [mm]
Poses = Array  # (..., 4, 4) homogeneous transforms [mm]
Frames = Array  # (..., n + 2, 4, 4) base, joints' frames and tool [mm]
Jacobians = Array  # (..., 6, n) linear rows first [mm/rad, 1; prismatic: 1, 0]
Figures = Array  # (...) a number for each posture
