"""How far one pose is from another: a displacement and a rotation vector."""

import numpy as np


def pose_differences(position: np.ndarray, rotation: np.ndarray, position_0: np.ndarray, rotation_0: np.ndarray) -> np.ndarray:
    """How far one pose is from another: displacement (m) and rotation vector (rad), both in base axes.

    `position`, `position_0` (..., 3), `rotation`, `rotation_0` (..., 3, 3). Returns (..., 6): memory is component first.
    """
    relative = np.empty((3, 3, *position.shape[:-1]))
    for i in range(3):
        for j in range(3):
            relative[i, j] = sum(rotation[..., i, k] * rotation_0[..., j, k] for k in range(3))
    turn = rotation_vectors(np.moveaxis(relative, (0, 1), (-2, -1)))
    difference = np.empty((6, *position.shape[:-1]))
    difference[:3] = np.moveaxis(position - position_0, -1, 0)
    difference[3:] = np.moveaxis(turn, -1, 0)
    return np.moveaxis(difference, 0, -1)


def rotation_vectors(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotation matrices, for angles below pi.

    The logarithm on SO(3) [1], by the arctangent of sine and cosine, so that small angles keep their digits.

    `rotation` (..., 3, 3). Returns (..., 3): rad.

    [1] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic Manipulation, CRC Press, 1994.
    """
    skew = 0.5 * np.stack(
        [
            rotation[..., 2, 1] - rotation[..., 1, 2],
            rotation[..., 0, 2] - rotation[..., 2, 0],
            rotation[..., 1, 0] - rotation[..., 0, 1],
        ]
    )
    sine = np.sqrt((skew**2).sum(axis=0))
    cosine = 0.5 * (rotation[..., 0, 0] + rotation[..., 1, 1] + rotation[..., 2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)
    return np.moveaxis(skew * scale, 0, -1)
