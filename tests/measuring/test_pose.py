"""The kind `pose`: its derivatives close to the measured pose."""

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.measuring.pose import POSE


def test_a_small_displacement_is_the_residual_of_a_pose():
    rotation = Rotation.random(3, random_state=1)
    position = np.arange(9.0).reshape(3, 3)
    numbers = np.hstack([position, rotation.as_rotvec()])
    shift = np.array([1e-6, -2e-6, 3e-6])
    turned = Rotation.from_rotvec(-shift) * rotation
    predicted = POSE.evaluate(
        position - shift, turned.as_matrix(), numbers, np.zeros(0)
    )
    np.testing.assert_allclose(
        predicted.residual, np.tile(np.hstack([shift, shift]), (3, 1)), atol=1e-11
    )
    np.testing.assert_array_equal(predicted.by_pose, np.tile(np.eye(6), (3, 1, 1)))
