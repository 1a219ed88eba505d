"""Joint angles of the rigid robot for wanted poses, in closed form or by damped least
squares from several starts, and a path through them without jumps.

Many arms of six joints have eight postures in closed form, see `closed_form`. For other
arms each step is that of Levenberg and Marquardt [1] on the pose error, in
which rotations count as lengths at the reach of the arm; it is batched over targets and
starts. All
solutions of all rows, and their copies whole turns away, are candidates for the path, see
`least_motion`.

[1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling,
Planning and Control, section 3.7, Springer, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.closed_form import ClosedFormArm, find_closed_form
from elastocal.application.least_motion import (
    JOINT_ROUNDING,
    PathCandidates,
    find_least_motion,
)
from elastocal.mechanics.kinematics import (
    compute_jacobians,
    compute_pose_differences,
    compute_poses_and_jacobians,
)

if TYPE_CHECKING:
    from elastocal.mechanics.robot import Robot

# Upper bound on iterations: Newton's method doubles the digits in the last few of them,
# so a start that has not converged by then never will.
_ITERATIONS = 60
# Pose error (m, rotations as lengths at the reach) below which a start has converged: a
# thousand times the rounding errors of poses of some metres.
_CONVERGED_M = 1e-10
# Pose error above which a pose is out of reach.
SOLVED_M = 1e-7
# A posture of six joints counts as singular if the normalised determinant of its
# Jacobian is below this value; the sign of the determinant then does not identify a
# posture, and more than rounding of joint angles changes the pose by less than rounding.
SINGULAR_DETERMINANT = 1e-6
# Solutions that differ by less (rad, or m) are one.
_SAME = 1e-6
# Initial damping in units of the trace of J J', factors after a step that fails or
# succeeds, and bounds: above the largest damping a start has failed.
_DAMPING = 1e-2
_DAMPING_AFTER_FAILURE = 8.0
_DAMPING_AFTER_SUCCESS = 0.15
_SMALLEST_DAMPING = 1e-14
_LARGEST_DAMPING = 1e6
# Starts for each row: an arm of six joints usually has eight postures.
_STARTS = 12
# Distance, in rows of a path, between rows that are solved from all starts. Between them
# the solutions of the nearest such row are close enough for Newton's method, which then
# needs a few iterations instead of some twenty.
_ANCHOR_SPACING = 16
# A joint may turn from target to target by this multiple of the rotation of the path,
# and by a constant (rad). Unless a wrist is near a singular posture, its joints rotate at
# most a few times as far as the tool, and targets that differ in position alone need some
# rotation too. A change of posture or of whole turns is far larger than both.
STEP_PER_TURN = 5.0
STEP_ALLOWANCE = np.radians(10.0)
# Copies of a solution that differ by whole turns are candidates too, within two turns
# of the middle of the limits.
_MOST_TURNS = 4
# Longest step of a joint in an iteration, rad or m; the linearization is valid for no
# longer ones.
_LONGEST_STEP = 0.5


def compute_reach_m(robot: Robot) -> float:
    """Compute the length of the stretched chain, at which an angle counts as a length,
    m."""
    lengths = (abs(t.constant) for t in robot.chain.transforms if t.kind == "T")
    return max(sum(lengths), 1e-3)


def solve_poses(
    robot: Robot, position: np.ndarray, rotation: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve for joint angles by damped least squares from one start for each target.

    Parameters
    ----------
    robot : the robot, taken as rigid.
    position, rotation : (N, 3), m, and (N, 3, 3) wanted poses of the end effector's
        measuring point, base axes.
    start : (N, n) angles of the chain, rad.

    Returns
    -------
    angles : (N, n) angles of the chain with the smallest error, rad.
    error_m : (N,) pose errors, rotations as lengths at the reach.
    """
    angles = start.copy()
    trial_angles = start.copy()
    best = _PoseErrors.infinite(len(start), robot.commands)
    damping = np.full(len(start), _DAMPING)
    rows = np.arange(len(start))
    for _ in range(_ITERATIONS):
        trial = _compute_pose_errors(
            robot, position[rows], rotation[rows], trial_angles[rows]
        )
        better = trial.length_m < best.length_m[rows]
        improved = rows[better]
        angles[improved] = trial_angles[improved]
        best.length_m[improved] = trial.length_m[better]
        best.error[improved] = trial.error[better]
        best.jacobian[improved] = trial.jacobian[better]
        factor = np.where(better, _DAMPING_AFTER_SUCCESS, _DAMPING_AFTER_FAILURE)
        damping[rows] = np.maximum(damping[rows] * factor, _SMALLEST_DAMPING)
        rows = np.flatnonzero(
            (best.length_m > _CONVERGED_M) & (damping < _LARGEST_DAMPING)
        )
        if not len(rows):
            break
        trial_angles[rows] = angles[rows] + robot.expand_steps(
            _compute_damped_steps(best.jacobian[rows], best.error[rows], damping[rows])
        )
    return angles, best.length_m


@dataclass(frozen=True)
class _PoseErrors:
    """Pose errors of the rigid robot; rotations count as lengths at its reach.

    Attributes
    ----------
    length_m : (N,) size of the errors.
    error : (N, 6) wanted less reached pose, m.
    jacobian : (N, 6, m) derivatives of the pose by the motions that commands bring
        about, see `Robot.restrict_jacobians`, m/rad.
    """

    length_m: np.ndarray
    error: np.ndarray
    jacobian: np.ndarray

    @classmethod
    def infinite(cls, count: int, commands: int) -> _PoseErrors:
        """Errors that are larger than any other."""
        error = np.zeros((count, 6))
        return cls(np.full(count, np.inf), error, np.zeros((count, 6, commands)))


def _compute_pose_errors(
    robot: Robot, position: np.ndarray, rotation: np.ndarray, angles: np.ndarray
) -> _PoseErrors:
    scale = np.repeat([1.0, compute_reach_m(robot)], 3)
    reached_position, reached_rotation, jacobian = compute_poses_and_jacobians(
        robot.chain, angles, robot.chain.end_effector
    )
    differences = compute_pose_differences(
        position, rotation, reached_position, reached_rotation
    )
    error = differences * scale
    length_m = np.sqrt((error**2).sum(axis=1))
    jacobian = robot.restrict_jacobians(jacobian * scale[:, None])
    return _PoseErrors(length_m, error, jacobian)


def _compute_damped_steps(
    jacobian: np.ndarray, pose_error: np.ndarray, damping: np.ndarray
) -> np.ndarray:
    """Compute steps (N, n) in the space of the poses, J' (J J' + d I)^-1 e, shortened to
    the longest allowed step."""
    gram = jacobian @ jacobian.transpose(0, 2, 1)
    trace = np.trace(gram, axis1=1, axis2=2)
    gram += (damping * trace)[:, None, None] * np.eye(6)
    solution = np.linalg.solve(gram, pose_error[..., None])
    step = (jacobian.transpose(0, 2, 1) @ solution)[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True)
    return step * np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))


def find_beyond_limits(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Find joints outside of their limits by more than rounding, (..., n) bool."""
    low, high = robot.joint_limits.T
    return (angles < low - JOINT_ROUNDING) | (angles > high + JOINT_ROUNDING)


def compute_allowed_steps(
    robot: Robot, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """Compute how far each joint may move from each of N poses to the next.

    A revolute joint may move in proportion to the rotation between the poses, see
    `STEP_PER_TURN`, a prismatic one in proportion to their distance; angles count as
    lengths at the reach. Returns (N - 1, n), rad or m.
    """
    differences = compute_pose_differences(
        position[1:], rotation[1:], position[:-1], rotation[:-1]
    )
    shift = np.linalg.norm(differences[:, :3], axis=1)[:, None]
    turn = np.linalg.norm(differences[:, 3:], axis=1)[:, None]
    return np.where(
        robot.chain.prismatic,
        STEP_PER_TURN * shift + STEP_ALLOWANCE * compute_reach_m(robot),
        STEP_PER_TURN * turn + STEP_ALLOWANCE,
    )


@dataclass(frozen=True)
class _Solutions:
    """K solutions of each of N rows of a path.

    Attributes
    ----------
    angles : (K, N, n) angles of the chain, rad.
    error_m : (K, N) pose errors.
    """

    angles: np.ndarray
    error_m: np.ndarray


def solve_path(
    robot: Robot, position: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve for the joint angles along a path that move the joints as little as possible,
    within their limits if this can be done.

    Parameters
    ----------
    robot, position, rotation : as in `solve_poses`.

    Returns
    -------
    angles, error_m : (N, n) and (N,) as in `solve_poses`.
    """
    arm = None if robot.has_followers else find_closed_form(robot.chain)
    if arm is None:
        solutions = _solve_from_anchors(robot, position, rotation)
    else:
        solutions = _solve_in_closed_form(robot, arm, position, rotation)
    path, path_error_m = _choose_path(robot, position, rotation, solutions)
    steps = np.abs(np.diff(path, axis=0))
    if (
        (steps <= compute_allowed_steps(robot, position, rotation)).all()
        and (path_error_m <= SOLVED_M).all()
        and not find_beyond_limits(robot, path).any()
    ):
        return path, path_error_m
    # Continue the solutions from row to row in both directions. This finds postures that
    # the starts of a row have missed, and nearby solutions where there are infinitely
    # many: of a singular posture, or of an arm with more joints than it needs.
    rows = np.arange(len(position))
    if arm is not None and arm.is_exact:
        rows = np.flatnonzero(_find_singular(robot, solutions).any(axis=0))
    if not len(rows):
        return path, path_error_m
    forward = _continue_solutions(
        robot, position, rotation, solutions, rows[rows > 0], -1
    )
    backward = _continue_solutions(
        robot, position, rotation, solutions, rows[rows < len(position) - 1][::-1], 1
    )
    every = (solutions, forward, backward)
    extended = _Solutions(
        np.concatenate([candidates.angles for candidates in every]),
        np.concatenate([candidates.error_m for candidates in every]),
    )
    return _choose_path(robot, position, rotation, extended)


def compute_determinants(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Compute the determinants (...) of the Jacobian of six commands at angles (..., n).

    Angles count as lengths at the reach, in which the Jacobian is normalised.
    """
    scale = np.repeat([1.0 / compute_reach_m(robot), 1.0], 3)[:, None]
    jacobian = compute_jacobians(robot.chain, angles, robot.chain.end_effector)
    return np.asarray(np.linalg.det(robot.restrict_jacobians(jacobian * scale)))


def _find_singular(robot: Robot, solutions: _Solutions) -> np.ndarray:
    """Find the solutions of an arm of six joints that are singular, (K, N) bool."""
    is_singular = solutions.error_m <= SOLVED_M
    determinants = compute_determinants(robot, solutions.angles[is_singular])
    is_singular[is_singular] = np.abs(determinants) < SINGULAR_DETERMINANT
    return is_singular


def _solve_in_closed_form(
    robot: Robot, arm: ClosedFormArm, position: np.ndarray, rotation: np.ndarray
) -> _Solutions:
    """Find all postures of each row; those that do not reach it have an infinite
    error."""
    angles, is_reached = arm.solve_all_postures(position, rotation)
    error_m = np.full(is_reached.shape, np.inf)
    _, row = np.nonzero(is_reached)
    angles[is_reached], error_m[is_reached] = solve_poses(
        robot, position[row], rotation[row], angles[is_reached]
    )
    return _Solutions(angles, error_m)


def _solve_from_anchors(
    robot: Robot, position: np.ndarray, rotation: np.ndarray
) -> _Solutions:
    """Solve the rows of a path from the solutions of some of them, and rows that this
    does not solve from all starts."""
    count = len(position)
    anchors = np.unique([*range(0, count, _ANCHOR_SPACING), count - 1])
    at_anchors = _solve_from_all_starts(robot, position[anchors], rotation[anchors])
    postures = _move_into_limits(robot, at_anchors.angles)
    is_start = _find_distinct(postures, at_anchors.error_m <= SOLVED_M)
    between_anchors = 0.5 * (anchors[1:] + anchors[:-1])
    nearest = np.searchsorted(between_anchors, np.arange(count))
    angles = postures[:, nearest].copy()
    error_m = np.full(angles.shape[:2], np.inf)
    start, row = np.nonzero(is_start[:, nearest])
    angles[start, row], error_m[start, row] = solve_poses(
        robot, position[row], rotation[row], angles[start, row]
    )
    unsolved = np.flatnonzero(~(error_m <= SOLVED_M).any(axis=0))
    if len(unsolved):
        again = _solve_from_all_starts(robot, position[unsolved], rotation[unsolved])
        angles[:, unsolved] = again.angles
        error_m[:, unsolved] = again.error_m
    return _Solutions(angles, error_m)


def _solve_from_all_starts(
    robot: Robot, position: np.ndarray, rotation: np.ndarray
) -> _Solutions:
    """Solve each row from the middle of the limits and from random angles within
    them."""
    shares = np.random.default_rng(0).random((_STARTS, robot.commands))
    shares[0] = 0.5
    starts = robot.spread_angles(shares, robot.joint_limits)
    angles, error_m = solve_poses(
        robot,
        np.tile(position, (_STARTS, 1)),
        np.tile(rotation, (_STARTS, 1, 1)),
        np.repeat(starts, len(position), axis=0),
    )
    return _Solutions(
        angles.reshape(_STARTS, -1, robot.joints), error_m.reshape(_STARTS, -1)
    )


def _continue_solutions(
    robot: Robot,
    position: np.ndarray,
    rotation: np.ndarray,
    solutions: _Solutions,
    rows: np.ndarray,
    neighbour: int,
) -> _Solutions:
    """Solve each of the rows again, from the solutions of the row before it (-1) or
    behind it (1)."""
    angles = solutions.angles.copy()
    error_m = solutions.error_m.copy()
    for row in rows:
        previous = row + neighbour
        starts = np.flatnonzero(error_m[:, previous] <= SOLVED_M)
        continued, continued_error_m = solve_poses(
            robot,
            np.repeat(position[[row]], len(starts), axis=0),
            np.repeat(rotation[[row]], len(starts), axis=0),
            angles[starts, previous],
        )
        solved = continued_error_m <= SOLVED_M
        angles[starts[solved], row] = continued[solved]
        error_m[starts[solved], row] = continued_error_m[solved]
    return _Solutions(angles, error_m)


def _choose_path(
    robot: Robot, position: np.ndarray, rotation: np.ndarray, solutions: _Solutions
) -> tuple[np.ndarray, np.ndarray]:
    """Choose one of the solutions of each row, or a copy of it whole turns away.

    Rows without a solution within the limits are not part of the path and get the
    solution with the smallest error. Returns `angles` (N, n) and `error_m` (N,).
    """
    limits = _narrow_limits(robot)
    lowest = _move_into_limits(robot, solutions.angles)
    error_m = solutions.error_m
    usable = _find_usable(robot, lowest, error_m)
    best = np.argmin(error_m, axis=0), np.arange(error_m.shape[1])
    path = lowest[best]
    is_solved = usable.any(axis=0)
    rows = np.flatnonzero(is_solved)
    if len(rows):
        most = usable.sum(axis=0).max()
        order = np.argsort(~usable[:, rows], axis=0, kind="stable")[:most]
        candidates = PathCandidates(
            copies=_copy_postures(robot, lowest[order, rows], limits),
            limits=limits,
            exclusion=np.where(usable[order, rows], 0.0, np.inf),
            allowed=compute_allowed_steps(robot, position[rows], rotation[rows]),
        )
        path[rows] = find_least_motion(candidates)
    largest_error_m = np.where(usable, error_m, 0.0).max(axis=0)
    return path, np.where(is_solved, largest_error_m, error_m[best])


def _move_into_limits(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Subtract whole turns from angles (..., n), so that each is the lowest one above its
    lower limit."""
    low = _narrow_limits(robot)[:, 0]
    turns = np.floor((angles - low + JOINT_ROUNDING) / _find_periods(robot))
    return angles - np.where(find_turning_joints(robot), 2 * np.pi * turns, 0.0)


def find_turning_joints(robot: Robot) -> np.ndarray:
    """Whether a whole turn of a joint alone keeps the pose, (n,) bool."""
    return ~np.array(robot.chain.prismatic) & ~robot.is_coupled


def _find_periods(robot: Robot) -> np.ndarray:
    """Return the change of each joint (n,) that does not change the pose: a turn, or
    infinity for a joint that has none alone."""
    return np.where(find_turning_joints(robot), 2 * np.pi, np.inf)


def _copy_postures(
    robot: Robot, postures: np.ndarray, limits: np.ndarray
) -> list[np.ndarray]:
    """Copy postures (K, N, n) shifted by all whole turns upwards within the limits.

    Returns angles (K, N, turns) of each joint.
    """
    width = limits[:, 1] - limits[:, 0]
    turns = np.ceil(width / _find_periods(robot) - JOINT_ROUNDING)
    counts = np.maximum(1, turns).astype(int)
    return [
        postures[..., joint, None] + 2 * np.pi * np.arange(count)
        for joint, count in enumerate(counts)
    ]


def _narrow_limits(robot: Robot) -> np.ndarray:
    """Narrow the joint limits to the largest number of turns, (n, 2), rad or m."""
    low, high = robot.joint_limits.T
    widest = _MOST_TURNS * _find_periods(robot)
    low = np.maximum(low, 0.5 * (low + high - widest))
    high = np.minimum(high, low + widest)
    return np.stack([low, high], axis=1)


def _find_usable(robot: Robot, angles: np.ndarray, error_m: np.ndarray) -> np.ndarray:
    """Find the solutions (K, N, n) of each row that reach the pose within the limits,
    each once; (K, N) bool."""
    is_within = ~find_beyond_limits(robot, angles).any(axis=-1)
    return _find_distinct(angles, (error_m <= SOLVED_M) & is_within)


def _find_distinct(angles: np.ndarray, candidate: np.ndarray) -> np.ndarray:
    """Find the candidates (K, N) among the solutions (K, N, n) of each row, each once;
    (K, N) bool."""
    distinct = candidate.copy()
    for number in range(1, len(distinct)):
        distance = np.abs(angles[:number] - angles[number]).max(axis=-1)
        repeated = (distance < _SAME) & distinct[:number]
        distinct[number] &= ~repeated.any(axis=0)
    return distinct
