"""The coordinate frame in which errors of a robot are stated, and the motions that are
not counted as errors in it.

In the frame `BASE` the base is declared, because the measurements were taken in it. In
the frame `ROBOT` errors are counted after the best rigid placement of the base over the
campaign's poses [1]. In both frames a constant offset at the end effector is not an
error if the offset of the target there was fitted. The data do not determine these
degrees of freedom, and the use of the robot does not need them. The placement is fitted
to the campaign's poses as a whole, so that a single new pose has an error, too.

[1] Kabsch, W., A solution for the best rotation to relate two sets of vectors, Acta
Crystallographica A32, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.application.left_out import LeftOutEffects

ROBOT = "robot"
BASE = "base"
FRAMES = {
    ROBOT: "in the robot's own frame (after the best placement of its base)",
    BASE: "in the frame of the declared base",
}
# Parameters of a placement: shift and rotation of the base, offset and rotation at the
# end effector, with three components each.
PLACEMENT_PARAMETERS = 12
# The first of these move the end effector; the others only turn it.
_MOVING_PARAMETERS = 9
# Number of poses whose fields of displacements are copied at once.
_CHUNK = 500


@dataclass(frozen=True)
class Scope:
    """Meaning of the errors of a robot: their frame and their contributions.

    Attributes
    ----------
    frame : "robot" or "base".
    origin : (3,) point about which the placement rotates the base, m.
    absorbed : (12, P) change of the placement (m, rad) that compensates a unit change
        of each parameter best.
    absorbed_before : (12,) placement that compensates the pose of the nominal robot
        less that of the calibrated one best.
    offset_removed : whether a constant offset at the end effector is not an error.
    left_out : keys of the effects of the fit that no command contains.
    left_out_effects : these effects; None if there are none.
    form_m : RMS error at the campaign's poses because the form of the model is
        uncertain.
    contradicted : whether held-out poses showed `form_m` to be larger than the
        differences between models.
    repeatability_dof : degrees of freedom of the estimated variance of the joints'
        repeatability; 0 if it counts as known.
    """

    frame: str
    origin: np.ndarray
    absorbed: np.ndarray = field(
        default_factory=lambda: np.zeros((PLACEMENT_PARAMETERS, 0))
    )
    absorbed_before: np.ndarray = field(
        default_factory=lambda: np.zeros(PLACEMENT_PARAMETERS)
    )
    offset_removed: bool = False
    left_out: tuple[str, ...] = ()
    left_out_effects: LeftOutEffects | None = None
    form_m: float = 0.0
    contradicted: bool = False
    repeatability_dof: float = 0.0


def compute_placement_columns(
    scope: Scope, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """Compute the derivatives of poses by the parameters of a placement.

    Parameters
    ----------
    scope : gives the point about which the base rotates.
    position, rotation : (N, 3), m, and (N, 3, 3) poses of the end effector, base axes.

    Returns
    -------
    (N, 6, 12) displacement and rotation by shift and rotation of the base (base axes),
    then by offset and rotation at the end effector (its own axes).
    """
    x, y, z = (position - scope.origin).T
    columns = np.zeros((len(position), 6, PLACEMENT_PARAMETERS))
    columns[:, :3, :3] = columns[:, 3:, 3:6] = np.eye(3)
    columns[:, 0, 4] = z
    columns[:, 0, 5] = -y
    columns[:, 1, 3] = -z
    columns[:, 1, 5] = x
    columns[:, 2, 3] = y
    columns[:, 2, 4] = -x
    columns[:, :3, 6:9] = columns[:, 3:, 9:] = rotation
    return columns


def fit_placement(
    columns: np.ndarray, displacements: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """Fit the free parameters of a placement to fields of displacements, by least
    squares.

    Positions determine all of them except the constant rotation of the end effector,
    which is then fitted to the residual orientations.

    Parameters
    ----------
    columns : (N, 6, 12) result of `compute_placement_columns`.
    displacements : (N, 6, K) K fields of displacements and rotations, m and rad.
    free : (12,) bool, parameters that are fitted; the rest stay zero.

    Returns
    -------
    (12, K) fitted parameters, m and rad.
    """
    blocks = (displacements[chunk] for chunk in _split_poses(len(displacements)))
    return fit_placement_to_blocks(columns, blocks, free)


def fit_placement_to_blocks(
    columns: np.ndarray, blocks: Iterable[np.ndarray], free: np.ndarray
) -> np.ndarray:
    """Fit a placement as `fit_placement`, to fields of which only some poses are in
    memory at once.

    Parameters
    ----------
    columns, free : as of `fit_placement`.
    blocks : the fields of consecutive poses, (n, 6, K) each, N poses in all.
    """
    moving = np.flatnonzero(free[:_MOVING_PARAMETERS])
    turning = np.flatnonzero(free[_MOVING_PARAMETERS:]) + _MOVING_PARAMETERS
    from_positions = _invert_design(columns[:, :3, moving])
    from_rotations = _invert_design(columns[:, 3:, turning])
    moved = []
    turned = []
    first = 0
    for block in blocks:
        chunk = slice(first, first + len(block))
        moved.append(np.tensordot(from_positions[:, chunk], block[:, :3], axes=2))
        turned.append(np.tensordot(from_rotations[:, chunk], block[:, 3:], axes=2))
        first = chunk.stop
    moved_sum = np.sum(moved, axis=0)
    fitted = np.zeros((PLACEMENT_PARAMETERS, moved_sum.shape[1]))
    fitted[moving] = moved_sum
    # The rotation of the base, which positions determine, turns the end effector too.
    turned_by_base = np.tensordot(from_rotations, columns[:, 3:, moving], axes=2)
    fitted[turning] = np.sum(turned, axis=0) - turned_by_base @ moved_sum
    return fitted


def _invert_design(design: np.ndarray) -> np.ndarray:
    """Pseudoinverse (p, N, 3) of a design (N, 3, p) of least squares."""
    poses, rows, parameters = design.shape
    # Singular values below the rounding of the largest one count as zero.
    rounding = np.finfo(float).eps * max(poses * rows, parameters)
    flat = design.reshape(poses * rows, parameters)
    return np.linalg.pinv(flat, rcond=rounding).reshape(parameters, poses, rows)


def _split_poses(count: int) -> list[slice]:
    """Blocks of poses whose fields are in memory at once."""
    return [slice(start, start + _CHUNK) for start in range(0, count, _CHUNK)]


def select_free_parameters(
    *, base: bool, offset: bool, rotation: bool = False
) -> np.ndarray:
    """Select the parameters of a placement that are free, (12,) bool.

    Parameters
    ----------
    base : whether shift and rotation of the base are free.
    offset, rotation : whether a constant offset and a constant rotation at the end
        effector are.
    """
    return np.repeat([base, base, offset, rotation], 3)


def subtract_placement(
    scope: Scope, position: np.ndarray, rotation: np.ndarray, displacements: np.ndarray
) -> np.ndarray:
    """Subtract from each field its best placement over the given poses.

    Parameters
    ----------
    scope : says which parameters of the placement are free.
    position, rotation : (N, 3), m, and (N, 3, 3) poses, base axes.
    displacements : (N, 6, K) K fields of displacements and rotations there, m and rad.

    Returns
    -------
    (N, 6, K) residual fields.
    """
    columns = compute_placement_columns(scope, position, rotation)
    free = select_free_parameters(
        base=scope.frame == ROBOT, offset=scope.offset_removed
    )
    absorbed = columns @ fit_placement(columns, displacements, free)
    return np.asarray(displacements - absorbed)


def root_mean_square(lengths: np.ndarray) -> float:
    """Return the root mean square of lengths (N,), or of the lengths of vectors
    (N, 3)."""
    return float(np.sqrt((lengths**2).sum() / len(lengths)))
