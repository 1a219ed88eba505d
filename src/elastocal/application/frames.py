"""In which frame errors of a robot are stated, and what of them is none there.

`BASE`, that of the declared base, where measurements were taken in it. `ROBOT`, the
robot's own, is after the best rigid placement of the base over the campaign's poses
[1]. In both, where the offset of the target on the end effector was fitted, a constant
offset there is no error. Data and use have these freedoms in common: what the data
cannot say of them costs the use nothing. They are taken up over the campaign's poses,
so that a single new pose has an error too.

[1] Kabsch, W., A solution for the best rotation to relate two sets of vectors, Acta
Crystallographica A32, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

ROBOT = "robot"
BASE = "base"
FRAMES = {
    ROBOT: "in the robot's own frame (after the best placement of its base)",
    BASE: "in the frame of the declared base",
}


@dataclass(frozen=True)
class Scope:
    """What the errors of a robot mean.

    `frame`: "robot" or "base". `origin` (3,): about which the placement turns, m.
    `absorbed` (12, P): motion of the base (m, rad), constant offset and turn of the end
    effector that take up each parameter. `absorbed_before` (12,): the same of the
    nominal robot less the calibrated one. `left_out`: effects of the fit that no
    command contains, with what they contribute at the campaign's poses, RMS and at the
    worst. `form_m`: what the form of the model leaves open there, RMS. `contradicted`:
    whether held-out poses showed that to be more than other models say.
    `repeated_freedom`: degrees of freedom of the square of the joints' repeatability; 0
    where it is taken as known.
    """

    frame: str
    origin: np.ndarray
    absorbed: np.ndarray = field(default_factory=lambda: np.zeros((12, 0)))
    absorbed_before: np.ndarray = field(default_factory=lambda: np.zeros(12))
    offset_removed: bool = False
    left_out: tuple[str, ...] = ()
    left_out_m: float = 0.0
    left_out_worst_m: float = 0.0
    form_m: float = 0.0
    contradicted: bool = False
    repeated_freedom: float = 0.0


def compute_placement_columns(
    scope: Scope, position: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """Displacement and turn of poses by shift and turn of the base, offset and turn of
    the end effector, (N, 6, 12)."""
    x, y, z = (position - scope.origin).T
    found = np.zeros((len(position), 6, 12))
    found[:, :3, :3] = found[:, 3:, 3:6] = np.eye(3)
    found[:, 0, 4] = z
    found[:, 0, 5] = -y
    found[:, 1, 3] = -z
    found[:, 1, 5] = x
    found[:, 2, 3] = y
    found[:, 2, 4] = -x
    found[:, :3, 6:9] = found[:, 3:, 9:] = rotation
    return found


def fit_placement(
    columns: np.ndarray, field: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """How much of the free columns of `placement` takes up most of a field (N, 6, K) of
    displacements, ndarray (12, K).

    Positions decide on all but the constant turn of the end effector, which takes up
    what is left of orientations.
    """
    found = np.zeros((12, field.shape[2]))
    for rows, first, last in ((slice(0, 3), 0, 9), (slice(3, 6), 9, 12)):
        mine = np.flatnonzero(free[first:last]) + first
        if len(mine):
            left = (field - columns @ found)[:, rows].reshape(
                3 * len(field), field.shape[2]
            )
            found[mine] = np.linalg.lstsq(
                columns[:, rows, mine].reshape(len(left), -1), left, rcond=None
            )[0]
    return found


def free_parts(base: bool, offset: bool, turn: bool = False) -> np.ndarray:
    """Which columns of `placement` are free, ndarray of bool (12,): of the base,
    constant offset and turn at its end."""
    return np.repeat([base, base, offset, turn], 3)


def subtract_placement(
    scope: Scope, position: np.ndarray, rotation: np.ndarray, fields: np.ndarray
) -> np.ndarray:
    """Displacements (N, 6, K) of poses less what the placement that a scope leaves free
    takes up of each over these poses."""
    columns = compute_placement_columns(scope, position, rotation)
    free = free_parts(scope.frame == ROBOT, scope.offset_removed)
    return np.asarray(fields - columns @ fit_placement(columns, fields, free))


def root_mean_square(lengths: np.ndarray) -> float:
    """Root mean square of lengths (N,), or of those of displacements (N, 3)."""
    return float(np.sqrt((lengths**2).sum() / len(lengths)))
