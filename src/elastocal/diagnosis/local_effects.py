"""Effects of unknown law that act only at an end of some variable of the state, as
competitors of gross errors.

A compensator that reaches its stop, a cable that becomes taut, or an arm that is
stretched err only where one variable is beyond some value, and other poses show nothing
of it. Neither a law of the catalogue nor a smooth discrepancy describes that; but
beyond one edge all poses must agree, as accidents do not. Such an effect is a motion of
all joints in proportion to the excess over the edge: a linear spline with one knot [1]_.

References
----------
.. [1] Friedman, Multivariate adaptive regression splines, Annals of Statistics 19,
   1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.hypotheses import LOCAL_EFFECT, ModelTerm

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.observations import Observations

# Fewest poses beyond an edge, ratio of their numbers from one edge to the next, and
# largest share of all poses beyond an edge.
_LEAST_POSES = 2
_MORE_POSES = 1.6
_LARGEST_SHARE = 0.3
# Spread, relative to the largest value, below which a variable does not vary.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class LocalEffects:
    """Excesses over edges in S states.

    Attributes
    ----------
    locations : name of the variable and its end, of each effect
    log_priors : logarithm of the prior share of each effect
    excess : for each effect, the excess (S,) over the edge, one at its largest
    joints : number of joints
    size_rad : joint error at the largest excess
    """

    locations: tuple[tuple[str, int], ...]
    log_priors: tuple[float, ...]
    excess: tuple[np.ndarray, ...]
    joints: int
    size_rad: float

    def build_terms(self, first_column: int, scales: int) -> tuple[ModelTerm, ...]:
        """Build the terms, whose columns are numbered from `first_column`, on a grid of
        so many scales."""
        terms = []
        for location, log_prior in zip(self.locations, self.log_priors, strict=True):
            terms.append(
                ModelTerm(
                    LOCAL_EFFECT,
                    location,
                    candidate=None,
                    shapes=(),
                    columns=np.arange(first_column, first_column + self.joints),
                    sizes=np.full(self.joints, self.size_rad),
                    signs=np.zeros(self.joints, int),
                    log_prior=log_prior,
                    largest=scales - 1,
                )
            )
            first_column += self.joints
        return tuple(terms)

    def displacement(self) -> list[dict[int, np.ndarray]]:
        """Displacements (S,) by joint, a dictionary for each column."""
        return [
            {joint: excess} for excess in self.excess for joint in range(self.joints)
        ]


def build_local_effects(
    conditions: Conditions,
    observations: Observations,
    suspects: np.ndarray,
    size_rad: float,
) -> LocalEffects:
    """Build the effects at the ends of angles, of how far joints are bent, of torques,
    and of the place of the end effector.

    Effects beyond whose edge no row is suspect explain none, and are left out.

    Parameters
    ----------
    conditions
        Of the S states.
    observations
        Observations in these states.
    suspects
        (k,) of int, suspect observations.
    size_rad
        Plausible joint error at the largest excess.
    """
    pose = np.zeros(len(observations.states), int)
    pose[observations.state] = observations.cluster
    suspect_states = observations.state[suspects]
    variables = {
        name: values
        for name, values in _list_variables(conditions).items()
        if np.ptp(values) > _ROUNDING * np.abs(values).max()
    }
    locations: list[tuple[str, int]] = []
    log_shares: list[float] = []
    kept_excesses: list[np.ndarray] = []
    for name, values in variables.items():
        for end in (-1, 1):
            excesses = _list_excesses(end * values, pose)
            for excess in excesses:
                if excess[suspect_states].any():
                    locations.append((name, end))
                    log_shares.append(-float(np.log(len(excesses))))
                    kept_excesses.append(excess)
    # All ends of all variables are equally likely, also those that are left out.
    log_kept = float(np.log(max(len(set(locations)), 1) / max(2 * len(variables), 1)))
    log_priors = tuple(log_share + log_kept for log_share in log_shares)
    joints = conditions.joint_angles.shape[1]
    return LocalEffects(
        tuple(locations), log_priors, tuple(kept_excesses), joints, size_rad
    )


def _list_excesses(values: np.ndarray, pose: np.ndarray) -> list[np.ndarray]:
    """Excesses (S,) of values (S,) over edges beyond which 2, 3, 5, ... poses lie."""
    largest = np.full(pose.max() + 1, -np.inf)
    np.maximum.at(largest, pose, values)
    descending = np.sort(largest[np.isfinite(largest)])[::-1]
    excesses = []
    count = _LEAST_POSES
    while count <= _LARGEST_SHARE * len(descending):
        excess = np.maximum(values - descending[count], 0.0)
        if excess.any():
            excesses.append(excess / excess.max())
        count = int(np.ceil(_MORE_POSES * count))
    return excesses


def _list_variables(conditions: Conditions) -> dict[str, np.ndarray]:
    """Variables (S,) of the state by name."""
    variables = {}
    joints = conditions.joint_angles.shape[1]
    for joint in range(joints):
        angle = conditions.joint_angles[:, joint]
        variables[f"angle {joint + 1}"] = angle
        variables[f"bend {joint + 1}"] = np.cos(angle)
        variables[f"torque {joint + 1}"] = conditions.total[:, joint]
    position = conditions.motion.position[0]
    variables["distance"] = np.linalg.norm(position, axis=0)
    variables["radius"] = np.linalg.norm(position[:2], axis=0)
    variables["height"] = position[2]
    return variables
