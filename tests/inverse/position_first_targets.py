"""Arms of four and five joints, and poses to ask them for, position first."""

import numpy as np

import armkin

ARMS = "so101", "labvolt_5150", "moveo", "cobra600"


def random_targets(arm: armkin.Arm, count: int, seed: int) -> np.ndarray:
    """Positions within reach with a third each of rotations at random, a little off and as the arm has them."""
    rng = np.random.default_rng(seed)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    T = np.array(armkin.fk(arm, rng.uniform(low, high, (count, arm.n))))
    wild = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    wild *= np.sign(np.linalg.det(wild))[:, None, None]
    size = np.array([3.0, 0.05, 0.0])[np.arange(count) % 3][:, None, None]
    axis = rng.normal(size=(count, 3))
    skew = np.cross(np.eye(3), axis[:, None, :]) * size
    little = np.linalg.solve(np.eye(3) - skew / 2, np.eye(3) + skew / 2)  # Cayley's rotation
    T[:, :3, :3] = np.where(size > 1, wild, little @ T[:, :3, :3])
    return T
