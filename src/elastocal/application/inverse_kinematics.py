"""Joint angles of the rigid robot for wanted poses: damped least squares from several starts, and a path without jumps.

Each step is that of Levenberg and Marquardt [1] on the pose error, whose rotations count at the reach of the arm as lengths;
batched over targets and starts. Of the solutions of all rows those are taken that move the joints least from row to row, by
dynamic programming (Viterbi's algorithm [2]).

[1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling, Planning and Control, section 3.7, Springer,
    2009.
[2] Forney, G. D., The Viterbi algorithm, Proceedings of the IEEE 61, 1973.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.pose_differences import pose_differences

if TYPE_CHECKING:
    from elastocal.mechanics.robot import Robot

# Steps after which a start has converged or will not: Newton's method doubles the digits in the last few.
_STEPS = 60
# Of the pose error, m and as length at the reach; rounding of poses of some metres is a thousandth of it.
_CONVERGED_M = 1e-10
# Of a solution: beyond it the pose is out of reach.
SOLVED_M = 1e-7
# Damping in parts of the largest squared singular value, and by how much a step that fails or succeeds changes it.
_DAMPING, _GROWS, _SHRINKS, _LEAST = 1e-2, 8.0, 0.15, 1e-14
# Solutions of a row are sought from so many starts: an arm of six joints has eight postures as a rule.
_STARTS = 12
# No joint turns farther in a step, rad or m: beyond it the linearization means nothing.
_LONGEST_STEP = 0.5


def reach_m(robot: Robot) -> float:
    """Length of the chain stretched out, at which an angle counts as a length, m."""
    return max(sum(abs(t.constant) for t in robot.chain.transforms if t.kind == "T"), 1e-3)


def refine(robot: Robot, position: np.ndarray, rotation: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles by damped least squares from one start for each target.

    `position`, `rotation` (N, 3), (N, 3, 3): wanted, of the end effector's measuring point, m, base axes. `start` (N, n):
    angles of the chain, rad. Returns `angles` (N, n): of the chain, rad; the best that was found; `error_m` (N,): what is left,
    rotations as lengths at the reach.
    """
    angles, length = start.copy(), reach_m(robot)
    scale = np.array([1.0, 1.0, 1.0, length, length, length])
    error = np.full(len(angles), np.inf)
    damping = np.full(len(angles), _DAMPING)
    trial, open_rows = angles.copy(), np.arange(len(angles))
    step_of = np.zeros((len(angles), 6)), np.zeros((len(angles), 6, robot.joints))
    for _ in range(_STEPS):
        at, turned, jacobian = poses_and_jacobians(robot.chain, trial[open_rows], robot.chain.end_effector)
        off = pose_differences(position[open_rows], rotation[open_rows], at, turned) * scale
        left = np.sqrt((off**2).sum(axis=1))
        better = left < error[open_rows]
        rows = open_rows[better]
        angles[rows], error[rows] = trial[rows], left[better]
        step_of[0][rows], step_of[1][rows] = off[better], jacobian[better] * scale[:, None]
        damping[open_rows] = np.maximum(damping[open_rows] * np.where(better, _SHRINKS, _GROWS), _LEAST)
        open_rows = np.flatnonzero((error > _CONVERGED_M) & (damping < 1e6))
        if not len(open_rows):
            break
        trial[open_rows] = angles[open_rows] + _step_damped(step_of[1][open_rows], step_of[0][open_rows], damping[open_rows])
    return angles, error


def _step_damped(jacobian: np.ndarray, off: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Steps (N, n) by damped least squares in the space of the poses, J' (J J' + d I)^-1 e, no longer than the bound."""
    gram = jacobian @ jacobian.transpose(0, 2, 1)
    size = np.trace(gram, axis1=1, axis2=2)
    gram += (damping * size)[:, None, None] * np.eye(6)
    step = (jacobian.transpose(0, 2, 1) @ np.linalg.solve(gram, off[..., None]))[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))


def remove_turns(robot: Robot, angles: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """The same postures with each joint that turns as near as whole turns bring it to somewhere.

    `angles` (..., n): of the chain, rad. `near` (..., n): the middle of the limits without. Returns (..., n).
    """
    middle = robot.joint_limits.mean(axis=1) if near is None else near
    turns = np.round((angles - middle) / (2 * np.pi)) * ~np.array(robot.chain.prismatic)
    return angles - 2 * np.pi * turns


def find_beyond_limits(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Whether each joint is outside of its limits, by more than rounding, ndarray of bool (..., n)."""
    low, high = robot.joint_limits.T
    return (angles < low - 1e-9) | (angles > high + 1e-9)


def along_path(robot: Robot, position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles for the poses of a path, within the limits where there are such, moving as little as possible.

    `robot`, `position`, `rotation`: as in `refine`. Returns `angles`, `error_m` (N, n), (N,): as by `refine`.
    """
    count, joints = len(position), robot.joints
    low, high = robot.joint_limits.T
    drawn = low + (high - low) * np.random.default_rng(0).random((_STARTS, joints))
    drawn[0] = 0.5 * (low + high)
    first = _solutions(robot, position, rotation, np.repeat(drawn[:, None], count, axis=1))
    picked = first[0][_least_motion(robot, *first), np.arange(count)]
    # Postures that the starts of a row missed, from those of its neighbours.
    beside = np.stack([np.roll(picked, shift, axis=0) for shift in (1, -1)])
    second = _solutions(robot, position, rotation, beside)
    angles, error = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    chosen = _least_motion(robot, angles, error), np.arange(count)
    return angles[chosen], error[chosen]


def _solutions(robot: Robot, position: np.ndarray, rotation: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles (K, N, n) and what is left (K, N) from starts (K, N, n)."""
    many = len(starts)
    angles, error = refine(
        robot, np.tile(position, (many, 1)), np.tile(rotation, (many, 1, 1)), starts.reshape(-1, robot.joints)
    )
    return remove_turns(robot, angles).reshape(starts.shape), error.reshape(starts.shape[:2])


def _least_motion(robot: Robot, angles: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Which solution of each row, ndarray (N,): those that leave least, within the limits, and then move the joints least."""
    solved = error <= SOLVED_M
    outside = find_beyond_limits(robot, angles).any(axis=-1)
    # Far more than a path can be long: first of all the wanted pose, then the limits, then the way.
    cost = np.where(solved, 0.0, 1e6 * (1.0 + error)) + 1e4 * outside
    total, came_from = cost[:, 0], np.zeros(error.shape[::-1], int)
    for row in range(1, error.shape[1]):
        way = np.abs(angles[:, None, row] - angles[None, :, row - 1]).max(axis=-1) + total
        came_from[row] = np.argmin(way, axis=1)
        total = way[np.arange(len(way)), came_from[row]] + cost[:, row]
    chosen = np.empty(error.shape[1], int)
    chosen[-1] = np.argmin(total)
    for row in range(error.shape[1] - 1, 0, -1):
        chosen[row - 1] = came_from[row, chosen[row]]
    return chosen
