"""Joint angles of the rigid robot for wanted poses: damped least squares from several
starts, and a path without jumps.

Each step is that of Levenberg and Marquardt [1] on the pose error, whose rotations
count at the reach of the arm as lengths; batched over targets and starts. All solutions
of all rows, and their copies whole turns away, are candidates of one path: that without
large steps where there is one, and of these that along which the joints move least, by
dynamic programming (Viterbi's algorithm [2]).

[1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling, Planning and Control, section 3.7, Springer,
    2009.
[2] Forney, G. D., The Viterbi algorithm, Proceedings of the IEEE 61, 1973.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import pose_differences, poses_and_jacobians

if TYPE_CHECKING:
    from elastocal.mechanics.robot import Robot

# Steps after which a start has converged or will not: Newton's method doubles the
# digits in the last few.
_STEPS = 60
# Of the pose error, m and as length at the reach: converged, a thousand times the
# rounding of poses of some metres; and beyond which a pose is out of reach. Of joint
# limits, rad or m; and of solutions that are one.
_CONVERGED_M = 1e-10
SOLVED_M = 1e-7
_ROUNDING = 1e-9
_SAME = 1e-6
# Damping in parts of the largest squared singular value, and by how much a step that
# fails or succeeds changes it.
_DAMPING = 1e-2
_GROWS = 8.0
_SHRINKS = 0.15
_LEAST = 1e-14
# Solutions of a row are sought from so many starts: an arm of six joints has eight
# postures as a rule.
_STARTS = 12
# A joint may turn so many times as far from target to target as the path itself, and by
# so much (rad) beside: wrists turn a few times as far as what they hold unless they are
# near a singular posture, and targets that are shifted alone need some turn too. A
# change of posture or of turns is far beyond both.
STEP_PER_TURN = 5.0
STEP_BESIDE = np.radians(10.0)
# Copies of a solution whole turns away, nearest the middle of the limits: all that fit
# into two turns either way.
_MOST_TURNS = 4
# What steps are too large by comes first, then the way, then how far from the middle of
# the limits it lies.
_TOO_LARGE = 1e4
_OFF_MIDDLE = 1e-5
# No joint turns farther in a step, rad or m: beyond it the linearization means nothing.
_LONGEST_STEP = 0.5


def reach_m(robot: Robot) -> float:
    """Length of the chain stretched out, at which an angle counts as a length, m."""
    return max(
        sum(abs(t.constant) for t in robot.chain.transforms if t.kind == "T"), 1e-3
    )


def solve_poses(
    robot: Robot, position: np.ndarray, rotation: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles by damped least squares from one start for each target.

    `position`, `rotation` (N, 3), (N, 3, 3): wanted, of the end effector's measuring
    point, m, base axes. `start` (N, n): angles of the chain, rad. Returns `angles` (N,
    n): of the chain, rad; the best that was found; `error_m` (N,): what is left,
    rotations as lengths at the reach.
    """
    angles = start.copy()
    scale = np.repeat([1.0, reach_m(robot)], 3)
    error = np.full(len(angles), np.inf)
    damping = np.full(len(angles), _DAMPING)
    trial = angles.copy()
    open_rows = np.arange(len(angles))
    step_of = np.zeros((len(angles), 6)), np.zeros((len(angles), 6, robot.joints))
    for _ in range(_STEPS):
        at, turned, jacobian = poses_and_jacobians(
            robot.chain, trial[open_rows], robot.chain.end_effector
        )
        off = (
            pose_differences(position[open_rows], rotation[open_rows], at, turned)
            * scale
        )
        left = np.sqrt((off**2).sum(axis=1))
        better = left < error[open_rows]
        rows = open_rows[better]
        angles[rows] = trial[rows]
        error[rows] = left[better]
        step_of[0][rows] = off[better]
        step_of[1][rows] = jacobian[better] * scale[:, None]
        damping[open_rows] = np.maximum(
            damping[open_rows] * np.where(better, _SHRINKS, _GROWS), _LEAST
        )
        open_rows = np.flatnonzero((error > _CONVERGED_M) & (damping < 1e6))
        if not len(open_rows):
            break
        trial[open_rows] = angles[open_rows] + _step_damped(
            step_of[1][open_rows], step_of[0][open_rows], damping[open_rows]
        )
    return angles, error


def _step_damped(
    jacobian: np.ndarray, off: np.ndarray, damping: np.ndarray
) -> np.ndarray:
    """Steps (N, n) by damped least squares in the space of the poses, J' (J J' + d
    I)^-1 e, no longer than the bound."""
    gram = jacobian @ jacobian.transpose(0, 2, 1)
    size = np.trace(gram, axis1=1, axis2=2)
    gram += (damping * size)[:, None, None] * np.eye(6)
    step = (jacobian.transpose(0, 2, 1) @ np.linalg.solve(gram, off[..., None]))[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))


def find_beyond_limits(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Whether each joint is outside of its limits, by more than rounding, ndarray of
    bool (..., n)."""
    low, high = robot.joint_limits.T
    return (angles < low - _ROUNDING) | (angles > high + _ROUNDING)


def allowed_steps(
    robot: Robot, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """How far each joint may move from each of N poses to the next, ndarray (N - 1, n),
    rad or m.

    Joints that turn by the rotation between the poses, see `STEP_PER_TURN`; that shift
    by their distance, angles at the reach.
    """
    apart = pose_differences(position[1:], rotation[1:], position[:-1], rotation[:-1])
    shift, turn = (
        np.linalg.norm(part, axis=1)[:, None] for part in (apart[:, :3], apart[:, 3:])
    )
    return np.where(
        robot.chain.prismatic,
        STEP_PER_TURN * shift + STEP_BESIDE * reach_m(robot),
        STEP_PER_TURN * turn + STEP_BESIDE,
    )


def solve_path(
    robot: Robot, position: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles for the poses of a path, within the limits where there are such,
    moving as little as possible.

    `robot`, `position`, `rotation`: as in `refine`. Returns `angles`, `error_m` (N, n),
    (N,): as by `refine`.
    """
    low, high = robot.joint_limits.T
    drawn = low + (high - low) * np.random.default_rng(0).random(
        (_STARTS, robot.joints)
    )
    drawn[0] = 0.5 * (low + high)
    starts = np.repeat(drawn, len(position), axis=0)
    found, left = solve_poses(
        robot,
        np.tile(position, (_STARTS, 1)),
        np.tile(rotation, (_STARTS, 1, 1)),
        starts,
    )
    first = found.reshape(_STARTS, -1, robot.joints), left.reshape(_STARTS, -1)
    angles, error = _shortest_path(robot, position, rotation, *first)
    large = np.abs(np.diff(angles, axis=0)) > allowed_steps(robot, position, rotation)
    if (
        large.any()
        or (error > SOLVED_M).any()
        or find_beyond_limits(robot, angles).any()
    ):
        # Postures that the starts of a row missed, from its neighbours; and the ways of
        # an arm with more joints than it needs.
        ways = [
            first,
            *(_continued(robot, position, rotation, *first, way) for way in (1, -1)),
        ]
        return _shortest_path(
            robot,
            position,
            rotation,
            *(np.concatenate(each) for each in zip(*ways, strict=True)),
        )
    return angles, error


def _continued(
    robot: Robot,
    position: np.ndarray,
    rotation: np.ndarray,
    angles: np.ndarray,
    error: np.ndarray,
    way: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Solutions (K, N, n) and what is left (K, N), each from that of the row before; of
    the row behind where `way` is -1."""
    angles = angles.copy()
    error = error.copy()
    rows = np.arange(len(position))[::way]
    for before, row in pairwise(rows):
        good = np.flatnonzero(error[:, before] <= SOLVED_M)
        wanted = (
            np.repeat(position[[row]], len(good), axis=0),
            np.repeat(rotation[[row]], len(good), axis=0),
        )
        found, left = solve_poses(robot, *wanted, angles[good, before])
        kept = good[left <= SOLVED_M]
        angles[kept, row] = found[left <= SOLVED_M]
        error[kept, row] = left[left <= SOLVED_M]
    return angles, error


def _shortest_path(
    robot: Robot,
    position: np.ndarray,
    rotation: np.ndarray,
    angles: np.ndarray,
    error: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The path through one of K solutions of each row, or a copy of it whole turns
    away: `angles` (N, n), `error_m` (N,).

    Rows that no solution reaches within the limits are no part of it, and get what
    leaves least.
    """
    low, high = robot.joint_limits.T
    period = np.where(robot.chain.prismatic, np.inf, 2 * np.pi)
    low = np.maximum(low, 0.5 * (low + high - _MOST_TURNS * period))
    high = np.minimum(high, low + _MOST_TURNS * period)
    turns = np.floor((angles - low + _ROUNDING) / period)
    lowest = angles - np.where(robot.chain.prismatic, 0.0, 2 * np.pi * turns)
    usable = (error <= SOLVED_M) & ~find_beyond_limits(robot, lowest).any(axis=-1)
    for number in range(1, len(usable)):
        same = np.abs(lowest[:number] - lowest[number]).max(axis=-1) < _SAME
        usable[number] &= ~(same & usable[:number]).any(axis=0)
    best = np.argmin(error, axis=0), np.arange(error.shape[1])
    path = lowest[best]
    rows = np.flatnonzero(usable.any(axis=0))
    if len(rows):
        order = np.argsort(~usable[:, rows], axis=0, kind="stable")[
            : usable.sum(axis=0).max()
        ]
        postures = lowest[order, rows]
        never = np.where(usable[order, rows], 0.0, np.inf)
        counts = np.maximum(1, np.ceil((high - low) / period - _ROUNDING)).astype(int)
        copies = [
            postures[..., j, None] + 2 * np.pi * np.arange(count)
            for j, count in enumerate(counts)
        ]
        path[rows] = _least_motion(
            copies,
            np.stack([low, high], axis=1),
            never,
            allowed_steps(robot, position[rows], rotation[rows]),
        )
    return path, np.where(
        usable.any(axis=0), np.where(usable, error, 0.0).max(axis=0), error[best]
    )


def _least_motion(
    copies: list[np.ndarray], limits: np.ndarray, never: np.ndarray, allowed: np.ndarray
) -> np.ndarray:
    """Angles (N, n) along which steps exceed what is allowed (N - 1, n) by least, and
    then the sum of all steps is least.

    `copies`: of each joint its angle and those whole turns above (K, N, turns), none
    above its `limits` (n, 2). `never` (K, N): infinite where there is no such posture.
    A sum, so that the best turns of each joint are found apart: of two turns each, 2^n
    copies cost 2 n.
    """
    counts = [each.shape[-1] for each in copies]
    joints = len(copies)

    def along(values: np.ndarray, joint: int) -> np.ndarray:
        """Values (K, turns) of a joint as (K, turns of all joints)."""
        return values.reshape(
            len(values),
            *(counts[joint] if axis == joint else 1 for axis in range(joints)),
        )

    def steps(row: int, joint: int) -> np.ndarray:
        """What the steps of a joint to a row cost, (K, turns) of the row before by (K,
        turns) of this one."""
        step = np.abs(copies[joint][:, row - 1, :, None, None] - copies[joint][:, row])
        return step + _TOO_LARGE * np.maximum(step - allowed[row - 1, joint], 0.0)

    def standing(row: int) -> np.ndarray:
        """What it costs to stand at each copy of a row, (K, turns of all joints)."""
        found = never[:, row].reshape(-1, *[1] * joints)
        for joint, (low, high) in enumerate(limits):
            angle = copies[joint][:, row]
            off = _OFF_MIDDLE * np.abs(angle - 0.5 * (low + high))
            found = found + along(
                np.where(angle > high + _ROUNDING, np.inf, off), joint
            )
        return found

    totals = [standing(0)]
    for row in range(1, never.shape[1]):
        # (K before, K, turns of all joints): those before go from the front, joint by
        # joint, and those of the row to the end.
        way = np.broadcast_to(totals[-1][:, None], (len(never), len(never), *counts))
        for joint in range(joints):
            cost = steps(row, joint).transpose(0, 2, 1, 3)
            way = (
                way[..., None] + np.expand_dims(cost, tuple(range(3, joints + 2)))
            ).min(axis=2)
        totals.append(way.min(axis=0) + standing(row))
    found = np.empty((never.shape[1], joints))
    way = totals[-1]
    for row in range(len(found) - 1, -1, -1):
        posture, *turn = np.unravel_index(np.argmin(way), way.shape)
        found[row] = [
            each[posture, row, chosen]
            for each, chosen in zip(copies, turn, strict=True)
        ]
        if row:
            costs = [
                steps(row, joint)[:, :, posture, turn[joint]] for joint in range(joints)
            ]
            way = sum(
                (along(cost, joint) for joint, cost in enumerate(costs)),
                totals[row - 1],
            )
    return found
