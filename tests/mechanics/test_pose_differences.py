"""Rotation vectors and differences of poses against scipy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elastocal.mechanics.pose_differences import pose_differences, rotation_vectors


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.floats(0, np.pi - 1e-3))
def test_rotation_vectors_agree_with_scipy(direction, angle):
    norm = np.linalg.norm(direction)
    vector = angle * (np.array(direction) / norm if norm > 1e-3 else np.array([0.0, 0.0, 1.0]))
    rotation = Rotation.from_rotvec(vector)
    # sin(angle) near pi - 1e-3 keeps 13 of 16 digits.
    np.testing.assert_allclose(rotation_vectors(rotation.as_matrix()), rotation.as_rotvec(), rtol=0, atol=1e-12)


def test_pose_difference_is_the_displacement_and_the_rotation_in_base_axes():
    rng = np.random.default_rng(12)
    start, turn = Rotation.random(20, rng=rng), Rotation.from_rotvec(rng.uniform(-1, 1, (20, 3)))
    position, move = rng.uniform(-2, 2, (20, 3)), rng.uniform(-1, 1, (20, 3))
    found = pose_differences(position + move, (turn * start).as_matrix(), position, start.as_matrix())
    np.testing.assert_allclose(found[..., :3], move, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found[..., 3:], turn.as_rotvec(), rtol=0, atol=1e-13)
