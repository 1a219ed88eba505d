"""Loaded configurations of a robot, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Experiments:
    """Loaded configurations of a robot.

    `joint_angles` (sets, configurations, n): rad. `wrench` (sets, configurations, 6): N, N m at the end-effector, base axes.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray

    def first(self, configurations: int) -> Experiments:
        """The first configurations of each data set."""
        return Experiments(self.joint_angles[:, :configurations], self.wrench[:, :configurations])
