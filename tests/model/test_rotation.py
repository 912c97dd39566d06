"""Rotations against definitions: products of turns about single axes, Rodrigues' formula, the quaternion's product."""

from __future__ import annotations

import numpy as np
import pytest

from armkin.model.rotation import inverse, quaternion, rotation_about, rpy, transform, transforms

RNG = np.random.default_rng(12)
ANGLES = np.concatenate([RNG.uniform(-180, 180, (40, 3)), 90.0 * RNG.integers(-4, 5, (20, 3)), [[0, 90, 0]]])
PLACES = RNG.uniform(-500, 500, (len(ANGLES), 3))


def test_roll_pitch_yaw_are_turns_about_fixed_axes() -> None:
    """R = Rz(yaw) Ry(pitch) Rx(roll), of one and of many to the same bits."""
    roll, pitch, yaw = np.radians(ANGLES).T
    R = rotation_about(2, yaw) @ rotation_about(1, pitch) @ rotation_about(0, roll)
    batch = transforms(PLACES, ANGLES)
    np.testing.assert_allclose(batch[:, :3, :3], R, atol=1e-15)
    assert (batch[:, :3, 3] == PLACES).all()
    assert (batch[:, 3] == [0, 0, 0, 1]).all()
    row_by_row = np.array([transform(list(p), list(a)) for p, a in zip(PLACES, ANGLES, strict=True)])
    assert row_by_row.tobytes() == batch.tobytes()
    again = transforms(PLACES, np.degrees(rpy(R)))
    np.testing.assert_allclose(again[:, :3, :3], R, atol=1e-14)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_about_an_axis_is_rodrigues(axis: int) -> None:
    angle = np.linspace(-4, 4, 9)
    K = np.cross(np.eye(3)[axis], np.eye(3)).T  # K v = axis x v
    R = np.eye(3) + np.sin(angle)[:, None, None] * K + (1 - np.cos(angle))[:, None, None] * (K @ K)
    np.testing.assert_allclose(rotation_about(axis, angle), R, atol=1e-15)


def test_a_quaternion_turns_vectors_as_its_matrix_does() -> None:
    """v' = v + 2 w (u x v) + 2 u x (u x v), of unit length, w never negative."""
    R = transforms(PLACES, ANGLES)[:, :3, :3]
    q, v = quaternion(R), RNG.normal(size=(len(R), 3))
    w, u = q[:, :1], q[:, 1:]
    turned = v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))
    np.testing.assert_allclose(turned, (R @ v[:, :, None])[:, :, 0], atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-15)
    assert (w >= 0).all()


def test_the_inverse_undoes_a_transform() -> None:
    T = transforms(PLACES, ANGLES)
    np.testing.assert_allclose(inverse(T) @ T, np.broadcast_to(np.eye(4), T.shape), atol=1e-12)
