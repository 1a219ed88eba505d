"""Every notation of one orientation gives one rotation vector."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elastocal.exchange.rotations import rotation_vectors

ORIENTATIONS = Rotation.random(20, random_state=3)


def elementary(axis, angle):
    """Matrix about one axis, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array({
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis])  # fmt: skip


@pytest.mark.parametrize(
    ("notation", "values"),
    [
        ("vector", ORIENTATIONS.as_rotvec()),
        ("quaternion", np.roll(ORIENTATIONS.as_quat(), 1, axis=1)),
        ("quaternion", -np.roll(ORIENTATIONS.as_quat(), 1, axis=1)),
        ("matrix", ORIENTATIONS.as_matrix().reshape(-1, 9)),
        ("homogeneous", np.concatenate([ORIENTATIONS.as_matrix(), np.ones((20, 3, 1))], axis=2).reshape(-1, 12)),
    ],
)
def test_notations_agree(notation, values):
    vectors, off = rotation_vectors(notation, values)
    assert not off.any()
    np.testing.assert_allclose(Rotation.from_rotvec(vectors).as_matrix(), ORIENTATIONS.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("sequence", ["ZYX", "XYZ", "ZYZ"])
def test_capitals_turn_about_axes_that_move_and_small_letters_about_fixed_ones(sequence):
    angles = np.array([[0.3, -0.4, 0.5]])
    factors = [elementary(axis.lower(), angle) for axis, angle in zip(sequence, angles[0], strict=True)]
    moving, _ = rotation_vectors(f"euler:{sequence}", angles)
    fixed, _ = rotation_vectors(f"euler:{sequence.lower()}", angles)
    np.testing.assert_allclose(Rotation.from_rotvec(moving[0]).as_matrix(), factors[0] @ factors[1] @ factors[2], atol=1e-12)
    np.testing.assert_allclose(Rotation.from_rotvec(fixed[0]).as_matrix(), factors[2] @ factors[1] @ factors[0], atol=1e-12)


def test_rounded_values_pass_and_what_is_no_rotation_is_marked():
    rounded = np.round(ORIENTATIONS.as_matrix().reshape(-1, 9), 4)
    assert not rotation_vectors("matrix", rounded)[1].any()
    mirrored = np.diag([1.0, 1.0, -1.0]).reshape(1, 9)
    assert rotation_vectors("matrix", np.vstack([rounded[:1], mirrored, 2 * rounded[:1]]))[1].tolist() == [False, True, True]
    assert rotation_vectors("quaternion", np.array([[1.0, 0, 0, 0], [0.0, 0, 0, 0], [1.0, 1, 0, 0]]))[1].tolist() == [
        False,
        True,
        True,
    ]
