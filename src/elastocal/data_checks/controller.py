"""Positions that a controller worked out of its joint angles, handed in for measured ones.

No NAMES: nothing about the robot is at fault, and a diagnosis only finds that nothing is; `check` says so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.placement import at_targets, placed, rms

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign

# Nobody writes more digits than this; lengths of a robot file have no more than micrometres.
_MOST_DIGITS, _DIGITS_OF_LENGTHS_M = 9, 1e-6
# By so much rounding may be exceeded by chance; where it is itself as large as this, it cannot be told from a good robot.
_BY_CHANCE, _TOO_COARSE_M = 1.5, 5e-5
_FEWEST_POSES = 6


def controller_warnings(campaign: Campaign) -> list[str]:
    """Say where positions are those of the robot file's own kinematics, to the rounding of what is written, in every row.

    No robot goes where its nominal kinematics are to a few micrometres, and no instrument would show it.
    """
    measurements, robot = campaign.measurements, campaign.robot
    if len(np.unique(measurements.pose)) < _FEWEST_POSES:
        return []
    placement = placed(campaign, measurements)
    reported = robot.reported_angles(measurements.joint_angles)
    step = max(_last_digit(reported), np.radians(_last_digit(np.degrees(reported))))
    jacobian = at_targets(robot.chain, measurements.joint_angles, campaign, measurements, placement.estimate)[2]
    # A number is off by a uniform error of its last digit.
    shown = max(_last_digit(measurements.position), _DIGITS_OF_LENGTHS_M)
    rounding = np.sqrt(((step * jacobian) ** 2).sum(axis=(1, 2)) + 3 * shown**2)
    expected = rms(rounding) / np.sqrt(12.0)
    off = placement.distance
    if expected > _TOO_COARSE_M or rms(off) > _BY_CHANCE * expected or (off > rounding * robot.joints).any():
        return []
    return [
        f"positions are those of the robot file's own kinematics to {1e6 * max(rms(off), 1e-7):.2g} µm in every row, as a"
        " controller works them out of the joint angles: they are no measurements, and show nothing of the robot"
    ]


def _last_digit(values: np.ndarray) -> float:
    """Of numbers that were rounded the least step, such as 0.001; 0 where they have all digits."""
    for digits in range(_MOST_DIGITS):
        scaled = values * 10.0**digits
        if (np.abs(scaled - np.round(scaled)) <= 1e-6 + 1e-13 * np.abs(scaled)).all():
            return 10.0**-digits
    return 0.0
