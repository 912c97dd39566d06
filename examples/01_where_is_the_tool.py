"""Forward kinematics: where the tool is for given joint values."""

import numpy as np

import armkin

arm = armkin.load("three_dof")  # a shipped robot; or the path of a robot file
T = armkin.fk(arm, np.deg2rad([-30, 5, -5]))  # 4 x 4, millimetres
print(T[:3, 3].round(4))  # [ 398.3923 -218.4649  187.1697]
