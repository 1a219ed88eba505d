"""A smooth path of targets for a robot of the repository, without joint angles: what
`elastocal correct` is timed with (docs/running.md).

Usage: python benchmarks/target_path.py ROBOT TARGETS > path.csv. The joints move through
twelve random postures (seed 1) within their limits.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
from common import load_robot
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from elastocal.mechanics.kinematics import compute_poses

_POSTURES = 12


def make_target_path(name: str, count: int) -> pd.DataFrame:
    """Tabulate x, y, z (m) and rx, ry, rz (rad) of a number of targets."""
    robot = load_robot(name)
    low, high = np.clip(robot.joint_limits.T, -np.pi, np.pi)
    shares = np.random.default_rng(1).uniform(0.15, 0.85, (_POSTURES, robot.joints))
    shape = PchipInterpolator(np.linspace(0, 1, _POSTURES), low + (high - low) * shares)
    angles = shape(np.linspace(0, 1, count))
    position, rotation = compute_poses(robot.chain, angles, robot.chain.end_effector)
    vectors = Rotation.from_matrix(rotation).as_rotvec()
    return pd.DataFrame(
        np.hstack([position, vectors]), columns=["x", "y", "z", "rx", "ry", "rz"]
    )


if __name__ == "__main__":
    robot_name, targets = sys.argv[1:]
    make_target_path(robot_name, int(targets)).to_csv(sys.stdout, index=False)
