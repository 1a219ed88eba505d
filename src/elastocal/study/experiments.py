"""Loaded configurations of a robot, as arrays."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Experiments:
    """Loaded configurations of a robot.

    Attributes
    ----------
    joint_angles : ndarray (sets, configurations, n)
        rad.
    wrench : ndarray (sets, configurations, 6)
        N, N m at the end-effector, base axes.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
