"""What a robot is used for: the poses of ISO 9283 under its load, and a path under a cutting force.

An accuracy on random configurations says little to whom the robot works in one corner of its space. ISO 9283 [1] has five
poses in a cube and one orientation; the accuracy of a pose is the distance of the mean of the reached positions from the
commanded one. A model that corrects the command leaves its own error there, as repeatability averages out.

[1] ISO 9283:1998, Manipulating industrial robots: Performance criteria and related test methods.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.inverse_kinematics import SOLVED_M, along_path, find_beyond_limits
from elastocal.study.experiments import Experiments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.robot import Robot

# Of a diagonal, from its ends: where the outer four poses lie.
_FROM_ENDS = 0.1
_PATH_POSES = 50
# The x axis of the end-effector downwards, as a spindle or a gripper over a table.
_DOWN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def iso_9283(robot: Robot, centre_m: Sequence[float], edge_m: float, weight_N: float) -> Experiments | None:
    """The five poses in the sloped plane of a cube, under a weight.

    `centre_m`: of the cube, base axes. `weight_N`: downwards, at the end-effector. Returns one set of five configurations
    within the joint limits; None where the robot does not reach them all.
    """
    reach = 0.5 * edge_m * (1 - 2 * _FROM_ENDS)
    corners = np.array([[0, 0, 0], [-1, -1, -1], [-1, 1, -1], [1, 1, 1], [1, -1, 1]])
    return _find_loaded(robot, np.array(centre_m) + reach * corners, np.tile([0.0, 0.0, -weight_N], (5, 1)))


def milling_path(robot: Robot, centre_m: Sequence[float], length_m: float, cutting_N: float) -> Experiments | None:
    """A straight level path across, the cutting force half against the feed and half upwards off the part.

    `robot`, `centre_m`: as in `iso_9283`. Returns one set of configurations within the joint limits; None where the robot does
    not reach all of the path.
    """
    along = np.array([0.0, 1.0, 0.0])
    position = np.array(centre_m) + length_m * np.linspace(-0.5, 0.5, _PATH_POSES)[:, None] * along
    force = cutting_N * np.sqrt(0.5) * (np.array([0.0, 0.0, 1.0]) - along)
    return _find_loaded(robot, position, np.tile(force, (_PATH_POSES, 1)))


def _find_loaded(robot: Robot, position: np.ndarray, force: np.ndarray) -> Experiments | None:
    angles, left = along_path(robot, position, np.broadcast_to(_DOWN, (len(position), 3, 3)))
    if (left > SOLVED_M).any() or find_beyond_limits(robot, angles).any():
        return None
    return Experiments(angles[None], np.pad(force, ((0, 0), (0, 3)))[None])
