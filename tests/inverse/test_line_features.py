"""Laws of line features, the algebra of the general solver: rigid motions act on them linearly."""

import numpy as np
import pytest
from general_arms import random_motions

from armkin.inverse.elimination import line_features
from armkin.model.rotation import joint_motion


def test_rep_is_a_homomorphism() -> None:
    X, Y = random_motions(np.random.default_rng(0), 40).reshape(2, 20, 4, 4)
    product = line_features.rep(X) @ line_features.rep(Y)
    np.testing.assert_allclose(line_features.rep(X @ Y), product, atol=1e-12)
    np.testing.assert_array_equal(line_features.rep(np.eye(4)), np.eye(15))


def test_rigid_motions_act_linearly_on_features() -> None:
    rng = np.random.default_rng(1)
    T, p, direction = random_motions(rng, 20), rng.standard_normal((20, 3)), random_motions(rng, 20)[:, :3, 0]
    moved = line_features.features(
        (T[:, :3, :3] @ p[..., None])[..., 0] + T[:, :3, 3], (T[:, :3, :3] @ direction[..., None])[..., 0]
    )
    acted = (line_features.rep(T) @ line_features.features(p, direction)[..., None])[..., 0]
    np.testing.assert_allclose(moved, acted, atol=1e-12)


def test_z_axis_are_the_features_of_a_frames_own_axis() -> None:
    np.testing.assert_array_equal(line_features.Z_AXIS, line_features.features(np.zeros(3), np.eye(3)[2]))


@pytest.mark.parametrize("prismatic", [False, True])
@pytest.mark.parametrize("inverse", [False, True])
def test_a_joints_rep_is_affine_in_two_numbers(prismatic: bool, inverse: bool) -> None:
    U = line_features.joint_rep(prismatic, inverse)
    for q in (-2.5, -0.4, 0.0, 1.3, 3.1):
        b = (q, q * q) if prismatic else (np.cos(q), np.sin(q))
        motion = joint_motion(prismatic, -q if inverse else q)
        np.testing.assert_allclose(U[0] + U[1] * b[0] + U[2] * b[1], line_features.rep(motion), atol=1e-13)
