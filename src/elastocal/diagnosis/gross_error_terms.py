"""Gross errors as terms that compete with every effect in the same evidence.

A row or a pose is wrong for a reason outside the model with a small probability, which
does not depend on other rows; then its deviation may have any size: the mean-shift
model of outliers with a prior [1]_, [2]_. One effect that explains thirty rows
therefore wins over thirty accidents.

A row is shifted in each of its components. A pose whose angles are mistyped shows all
its targets displaced as by one error of its joint angles.

References
----------
.. [1] Box and Tiao, A Bayesian approach to some outlier problems, Biometrika 55, 1968.
.. [2] Abraham and Box, Linear models and spurious observations, Applied Statistics 27,
   1978.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.hypotheses import GROSS_ERROR, ModelTerm

if TYPE_CHECKING:
    from elastocal.diagnosis.local_effects import LocalEffects
    from elastocal.fitting.observations import Observations

# The most likely size of a term is this share of its plausible size, so that the size
# of a gross error is as likely below its observed deviation as above it.
_LIKELIEST_SCALE = 0.1
# Decades between the smallest deviation that stands out and the largest one that a
# tracker reads. The size of a gross error is equally likely in each of them.
_DECADES = 5.0
# Kinds of locations: a row, or a pose as a whole.
ROW = "row"
POSE = "pose"


@dataclass(frozen=True)
class GrossErrorBasis:
    """Displacements of suspect rows, each of which has an observation and a state of its
    own, and of poses with several suspect rows.

    Attributes
    ----------
    observations : M observations
    suspects : (k,) int, the observations that may be wrong
    sizes : (k,), length of the deviation of each, in standard deviations
    pose_sizes_rad : by pose, joint error of the plausible size of its deviation
    joints : number of joints, the first coordinates of the Jacobian
    local_effects : effects that compete with gross errors only
    """

    observations: Observations
    suspects: np.ndarray
    sizes: np.ndarray
    pose_sizes_rad: dict[int, float]
    joints: int
    local_effects: LocalEffects

    @cached_property
    def poses(self) -> np.ndarray:
        """Pose of each observation, (M,) of int."""
        return self.observations.cluster

    def build_terms(self, first_column: int, scales: int) -> tuple[ModelTerm, ...]:
        """Build the terms, whose columns are numbered from `first_column`, on a grid of
        so many scales."""
        widths = [self.observations.rows] * len(self.suspects)
        locations: list[tuple[str, int]] = [
            (ROW, row) for row in self.suspects.tolist()
        ]
        widths += [self.joints] * len(self.pose_sizes_rad)
        locations += [(POSE, pose) for pose in self.pose_sizes_rad]
        terms = []
        for location, width in zip(locations, widths, strict=True):
            terms.append(
                ModelTerm(
                    GROSS_ERROR,
                    location,
                    candidate=None,
                    shapes=(),
                    columns=np.arange(first_column, first_column + width),
                    sizes=self._size_of(location) * np.ones(width),
                    signs=np.zeros(width, int),
                    log_prior=-float(np.log(_DECADES)),
                    largest=scales - 1,
                )
            )
            first_column += width
        return (*terms, *self.local_effects.build_terms(first_column, scales))

    def _size_of(self, location: tuple[str, int]) -> float:
        """Plausible size of the coefficients of a term."""
        kind, number = location
        if kind == POSE:
            deviation = self.pose_sizes_rad[number]
        else:
            suspect = int(np.flatnonzero(self.suspects == number)[0])
            deviation = self.sizes[suspect] / np.sqrt(self.observations.rows)
        return float(deviation) / _LIKELIEST_SCALE

    def displacement(self, coordinates: int) -> list[dict[int, np.ndarray]]:
        """Displacements (S,) by coordinate, a dictionary for each column.

        Parameters
        ----------
        coordinates
            Number of coordinates of the Jacobian that `extend_jacobian` extends.
        """
        displacements = []
        state = self.observations.state
        for row in self.suspects.tolist():
            in_state = np.zeros(len(self.observations.states))
            in_state[state[row]] = 1.0
            displacements += [
                {coordinates + component: in_state}
                for component in range(self.observations.rows)
            ]
        for pose in self.pose_sizes_rad:
            in_pose = np.zeros(len(self.observations.states))
            in_pose[state[self.poses == pose]] = 1.0
            displacements += [{joint: in_pose} for joint in range(self.joints)]
        return displacements + self.local_effects.displacement()

    def extend_jacobian(self, jacobian: np.ndarray) -> np.ndarray:
        """Append a coordinate for each component of a row, which shifts that component
        by one standard deviation, to a whitened Jacobian (M, rows, C)."""
        components = jacobian.shape[1]
        shift = np.broadcast_to(np.eye(components), (*jacobian.shape[:2], components))
        return np.concatenate([jacobian, shift], axis=2)

    def list_shifted(self, term: ModelTerm) -> np.ndarray:
        """Observations, (M,) of bool, that a term makes wrong."""
        kind, number = term.location
        if kind == POSE:
            return np.asarray(self.poses == number)
        return np.arange(len(self.observations)) == number
