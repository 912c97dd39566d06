"""A UR5e follows a moving target: one solve a step, near the last one, as a controller asks."""

import time

import numpy as np

import armkin

arm = armkin.load("ur5e")
joints = [np.deg2rad([0, -90, 90, -90, -90, 0])]  # a posture a step
target = armkin.fk(arm, joints[0])  # 4 x 4, millimetres
begin = target[:3, 3].copy()
errors = []  # [mm] how far the tip is off its target
start_time = time.perf_counter()
for angle in np.linspace(0, 2 * np.pi, 1000):  # two seconds of a controller at 500 Hz
    target[:3, 3] = begin + 100 * np.array([np.cos(angle) - 1, np.sin(angle), 0])
    solutions = armkin.ik(arm, target, near=joints[-1])
    if solutions.best < 0:
        raise SystemExit(f"no branch within the limits at {np.rad2deg(angle):.0f} degrees")
    joints.append(solutions.q[solutions.best])
    errors.append(np.abs(armkin.fk(arm, joints[-1]) - target)[:3, 3].max())
seconds = time.perf_counter() - start_time
widest = np.rad2deg(np.abs(np.diff(joints, axis=0)).max())
print(f"1000 steps, no joint turned more than {widest:.2f} degrees in one, the tip off by {max(errors):.0e} mm")
print(f"back where it began: {np.allclose(joints[-1], joints[0])}; {seconds:.2f} s of computing for 2 s of motion")
