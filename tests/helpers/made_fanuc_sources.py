"""Synthetic measurements of the FANUC in the formats of its two public sources."""

from pathlib import Path

import numpy as np
import scipy.io
from scipy.spatial.transform import Rotation

from elastocal.mechanics.kinematics import compute_poses

OFFSETS = np.array([[0.2, 0.0, 0.05], [0.2, 0.06, -0.02], [0.15, -0.04, -0.04]])
POSES = 8
REPEATS = 3


def reflectors(chain, angles, seed):
    """Return positions (N, 3 reflectors, 3) in the frame of a tracker."""
    rng = np.random.default_rng(seed)
    position, rotation = compute_poses(chain, angles, chain.end_effector)
    flange = position[:, None] + np.einsum("nij,kj->nki", rotation, OFFSETS)
    return flange @ Rotation.random(rng=rng).as_matrix().T + rng.uniform(-3, 3, 3)


def model_angles(degrees, elbow):
    """Return the angles of the chain in rad from those of the controller in degrees;
    `elbow` is the angle between the arms."""
    j1, j2, _, j4, j5, j6 = degrees.T
    return np.radians(np.column_stack([j1, j2 - 90, 90 - elbow, -j4, -j5, -j6]))


def static_source(fanuc, folder):
    """Write a file of the static source. Return its path, and the joint angles and
    positions that its campaign must contain, row by row."""
    degrees = (
        np.random.default_rng(1).uniform(-50, 50, (POSES, 6)).repeat(REPEATS, axis=0)
    )
    angles = model_angles(degrees, degrees[:, 2])
    positions = reflectors(fanuc.chain, angles, 2)
    path = Path(folder) / "calibration.mat"
    named = {f"m{name}": positions[:, index] for index, name in enumerate("ABC")}
    scipy.io.savemat(path, {"q": np.radians(degrees), **named})
    return path, angles, positions


def cpa_source(fanuc, folder):
    """Write the files of the source that moves one joint at a time. Returns its path,
    the joint angles and the positions of the reflectors."""
    degrees = np.random.default_rng(3).uniform(-50, 50, (POSES, 6))
    angles = model_angles(degrees, degrees[:, 1] + degrees[:, 2])
    positions = reflectors(fanuc.chain, angles, 4)
    path = Path(folder) / "values.csv"
    np.savetxt(
        path, np.hstack([1e3 * positions.reshape(-1, 9), np.zeros((POSES, 6)), degrees])
    )
    return path, angles, positions


def assert_holds(measurements, angles, positions):
    """Check that measurements have these joint angles and positions, and no loads."""
    assert len(measurements) == 3 * len(angles)
    np.testing.assert_allclose(
        measurements.joint_angles, angles.repeat(3, axis=0), rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(
        measurements.position, positions.reshape(-1, 3), rtol=0, atol=1e-12
    )
    np.testing.assert_array_equal(measurements.wrench, 0)
    np.testing.assert_array_equal(measurements.load, 0)
