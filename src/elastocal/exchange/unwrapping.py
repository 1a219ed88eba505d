"""Joint angles of controllers that count 0 to 360 degrees, or -180 to 180, whatever the
limits of the joint are."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import format_integer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.robot import Robot

_TURN_RAD = 2.0 * math.pi
# Ranges in which such controllers count, rad, and the rounding of their angles.
_COUNTED_RAD = ((0.0, _TURN_RAD), (-math.pi, math.pi))
_ROUNDING_RAD = 1e-4
# A servo stands this far beyond a limit at most.
_BEYOND_LIMITS_RAD = 1e-2


def unwrap_into_limits(
    reported: np.ndarray, robot: Robot, headers: Sequence[str]
) -> tuple[np.ndarray, list[str]]:
    """Move joint angles beyond the limits by a turn, if this takes them into the limits.

    A joint is left as it is unless all its angles lie within one counted turn, and all
    that are beyond its limits come to lie within them.

    Parameters
    ----------
    reported : (N, n) joint angles as the controller reports them, rad (m).
    robot : robot with the limits.
    headers : names of the joints in the table.

    Returns
    -------
    angles : (N, n) joint angles.
    notes : a sentence on all joints that were moved, if any.
    """
    angles = reported.copy()
    moved = []
    for joint, header in enumerate(headers):
        if robot.prismatic_commands[joint] or not _counts_alone(robot, joint):
            continue
        turns = _find_turns(reported, robot, joint)
        if turns.any():
            angles[:, joint] += _TURN_RAD * turns
            moved.append(repr(header))
    if not moved:
        return angles, []
    changed = format_integer(int(np.count_nonzero(angles != reported)))
    counted = format_integer(len(moved) * len(angles))
    note = (
        f"counted over a turn whatever the limits: {', '.join(moved)}; {changed} of"
        f" {counted} angles became another by a turn, within the limits"
    )
    return angles, [note]


def _counts_alone(robot: Robot, joint: int) -> bool:
    """Whether a reported angle turns one joint of the chain, and turns it as far."""
    matrix = np.abs(robot.reported_matrix)
    leading = robot.leading_joints[joint]
    is_coupled = np.delete(matrix[leading], joint).any()
    is_coupled |= np.delete(matrix[:, joint], leading).any()
    return bool(matrix[leading, joint] == 1.0 and not is_coupled)


def _find_turns(reported: np.ndarray, robot: Robot, joint: int) -> np.ndarray:
    """Find the turns (N,) that take the angles of a joint into its limits; zeros if
    there are none for all of them."""
    column = reported[:, joint]
    none = np.zeros(len(column))
    if not any(
        (low - _ROUNDING_RAD <= column).all() and (column <= high + _ROUNDING_RAD).all()
        for low, high in _COUNTED_RAD
    ):
        return none
    turns = none
    is_outside = _find_outside(reported, robot, joint)
    for turn in (-1.0, 1.0):
        moved = reported.copy()
        moved[:, joint] += _TURN_RAD * turn
        fits = is_outside & ~_find_outside(moved, robot, joint)
        turns = np.where(fits, turn, turns)
    return turns if (turns != 0.0)[is_outside].all() else none


def _find_outside(reported: np.ndarray, robot: Robot, joint: int) -> np.ndarray:
    """Find angles (N,) of a joint beyond its limits."""
    leading = robot.leading_joints[joint]
    low, high = robot.joint_limits[leading]
    angle = robot.model_angles(reported)[:, leading]
    return (angle < low - _BEYOND_LIMITS_RAD) | (angle > high + _BEYOND_LIMITS_RAD)
