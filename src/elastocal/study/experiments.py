"""Loaded configurations of a robot, as arrays."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Experiments:
    """Loaded configurations of a robot.

    `joint_angles` (sets, configurations, n): rad. `wrench` (sets, configurations, 6): N, N m at the end-effector, base axes.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
