"""Poses of a board in a camera, and joint angles of a Panda, as programs save them."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

PANDA = Path(__file__).resolve().parents[2] / "config" / "robots" / "panda.yaml"


def make_board_poses(count=12, seed=1):
    """Return joint angles (N, 7), and rotation (N, 3, 3) and position (N, 3) of the
    board."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-0.4, 0.4, (count, 7)) + np.array([0, 0, 0, -2, 0, 2, 0])
    rotation = Rotation.from_rotvec(rng.uniform(-1, 1, (count, 3))).as_matrix()
    position = rng.uniform(-0.2, 0.2, (count, 3)) + np.array([0, 0, 0.5])
    return angles, rotation, position


def stack_matrices(rotation, position):
    """Return homogeneous matrices (N, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(position), 1, 1))
    matrices[:, :3, :3] = rotation
    matrices[:, :3, 3] = position
    return matrices
