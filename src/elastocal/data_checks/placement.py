"""Where the nominal robot puts each measurement, without loads, once frames and targets are fitted to most of the measurements.

No NAMES: what the faults of positions have in common.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from elastocal.campaigns.groups import groups_of
from elastocal.fitting.least_squares import nominal_poses, registered_to
from elastocal.fitting.model import declared_model, measured_in_base
from elastocal.fitting.observations import select_states, single_observations
from elastocal.mechanics.kinematics import poses_and_jacobians, rotation_vectors

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations
    from elastocal.mechanics.chain import Chain

# Poses enough to tell what concerns all measurements.
MANY_POSES = 80
# No geometric error, no deflection moves a robot so far.
IMPLAUSIBLE_M, IMPLAUSIBLE_RAD = 0.02, 0.1
# A correction must lower the residual by this factor.
FAR_BETTER = 5.0
# Share of the measurements that frames and targets are first fitted to, and steps of fitting to those that fit best.
_CORE, _CORE_STEPS = 0.6, 5
# Measurements beyond so many robust standard deviations take no part in the last fit.
_APART = 5.0
# Largest distances that an RMS leaves out: single measurements say nothing of all.
_TRIMMED = 0.1


@dataclass(frozen=True)
class Placement:
    """Measurements beside the nominal robot, in base axes.

    `estimate`: frames and targets. `predicted`, `measured` (N, 3): m. `predicted_rotation`, `measured_rotation` (N, 3, 3).
    """

    estimate: Estimate
    predicted: np.ndarray
    measured: np.ndarray
    predicted_rotation: np.ndarray | None
    measured_rotation: np.ndarray | None

    @property
    def distance(self) -> np.ndarray:
        """From the predicted to the measured position, ndarray (N,), m."""
        return np.linalg.norm(self.measured - self.predicted, axis=1)

    @property
    def turn(self) -> np.ndarray | None:
        """Angle between predicted and measured orientation, ndarray (N,), rad; None where positions are measured."""
        if self.measured_rotation is None or self.predicted_rotation is None:
            return None
        relative = self.measured_rotation @ self.predicted_rotation.transpose(0, 2, 1)
        return np.linalg.norm(rotation_vectors(relative), axis=1)


def placed(campaign: Campaign, measurements: Measurements) -> Placement:
    """Fit frames and targets to all measurements alike."""
    return _Nominal.of(campaign, measurements).placed()


def robustly_placed(campaign: Campaign, measurements: Measurements) -> Placement:
    """Fit frames and targets to the measurements that agree with each other.

    Least trimmed squares by concentration steps [1] from the fit to all, trimmed for each target in each session; then one
    reweighted fit.

    [1] Rousseeuw, P. J. and Van Driessen, K., Computing LTS regression for large data sets, Data Mining and Knowledge Discovery
        12, 2006.
    """
    nominal = _Nominal.of(campaign, measurements)
    found = nominal.placed()
    if campaign.frame == "base" and not nominal.model.fitted_parts:
        return found
    for step in range(_CORE_STEPS + 1):
        distance, kept = found.distance, np.zeros(len(measurements), bool)
        for members in of_each_target(measurements):
            limit = np.quantile(distance[members], _CORE)
            if step == _CORE_STEPS:
                limit = max(limit, _APART * robust_sigma(distance[members], 3))
            kept[members] = distance[members] <= limit
        found = nominal.placed(kept)
    return found


def placed_by(campaign: Campaign, measurements: Measurements, estimate: Estimate) -> Placement:
    """Measurements beside the nominal robot in given frames and targets, without loads: they move it by millimetres only."""
    return _Nominal.of(campaign, measurements).placed_by(estimate)


def spread(measurements: Measurements, poses: int = MANY_POSES) -> Measurements:
    """Measurements of some poses all over the campaign, at the lowest load of each.

    `poses`: at most so many of each target in each session.
    """
    chosen = []
    for members in of_each_target(measurements):
        order = members[np.lexsort((measurements.repeat[members], measurements.load[members], measurements.pose[members]))]
        first = order[np.unique(measurements.pose[order], return_index=True)[1]]
        chosen.append(first[np.unique(np.linspace(0, len(first) - 1, poses).round().astype(int))])
    return measurements.select(np.sort(np.concatenate(chosen)))


def at_targets(
    chain: Chain, coordinates: np.ndarray, campaign: Campaign, measurements: Measurements, estimate: Estimate
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where a chain has the target of each measurement: `position` (N, 3), `rotation` (N, 3, 3), `jacobian` (N, 3, C)."""
    count = len(coordinates)
    found = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 6, chain.coordinates))
    for index, target in enumerate(campaign.targets):
        mine = measurements.target == index
        point = replace(chain.point(target.point), offset_m=tuple(estimate.target_offset[index]))
        for part, values in zip(found, poses_and_jacobians(chain, coordinates[mine], point), strict=True):
            part[mine] = values
    return found[0], found[1], found[2][:, :3]


def free_columns(
    campaign: Campaign, measurements: Measurements, rotation: np.ndarray, position: np.ndarray
) -> list[np.ndarray]:
    """Sensitivities of positions to frames and targets that nobody knows, ndarrays (N, 3, .), base axes.

    `rotation`, `position` (N, 3, 3), (N, 3): of the points on which the targets sit, and of the targets.
    """
    columns = []
    if campaign.frame == "tracker":
        turns = np.stack([np.cross(axis, position) for axis in np.eye(3)], axis=-1)
        rigid = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=-1)
        columns += [rigid * (measurements.session == session)[:, None, None] for session in np.unique(measurements.session)]
    for index, target in enumerate(campaign.targets):
        if target.offset_m is None:
            columns.append(rotation * (measurements.target == index)[:, None, None])
    return columns


def with_measured(measurements: Measurements, source: np.ndarray) -> Measurements:
    """Measurements with the measured columns of other rows."""
    turned = measurements.rotation_vector
    return replace(
        measurements, position=measurements.position[source], rotation_vector=None if turned is None else turned[source]
    )


def rms(values: np.ndarray) -> float:
    """Root of the mean square, of an array of any shape."""
    return float(np.sqrt((values**2).mean()))


def trimmed_rms(distance: np.ndarray) -> float:
    """RMS of distances (N,) without the largest tenth."""
    return rms(np.sort(distance)[: max(int((1 - _TRIMMED) * len(distance)), 1)])


def robust_sigma(distance: np.ndarray, components: int) -> float:
    """Standard deviation of each component of vectors, from the median of their lengths (N,).

    The median absolute deviation [1] for vectors: divided by the median of the chi distribution.

    [1] Hampel, F. R., The influence curve and its role in robust estimation, Journal of the American Statistical Association
        69, 1974.
    """
    return float(np.median(distance) / np.sqrt(chdtri(components, 0.5)))


def of_each_target(measurements: Measurements) -> list[np.ndarray]:
    """Indices of the measurements of each target in each session."""
    number = groups_of(np.column_stack([measurements.session, measurements.target]))[1]
    return [np.flatnonzero(number == group) for group in range(number.max() + 1)]


@dataclass(frozen=True)
class _Nominal:
    """Measurements beside the poses of their measuring points on the nominal robot, which every placement shares.

    `model`: frames and targets alone. `observations`: N of them. `position`, `rotation` (N, 3), (N, 3, 3): as by
    `registration.nominal_poses`.
    """

    model: Model
    observations: Observations
    position: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of(cls, campaign: Campaign, measurements: Measurements) -> _Nominal:
        model, observations = replace(declared_model(campaign), effects=()), single_observations(measurements)
        return cls(model, observations, *nominal_poses(model, observations))

    def placed(self, kept: np.ndarray | None = None) -> Placement:
        """All of them, in frames and targets that are fitted to all, or to those kept, ndarray of bool (N,)."""
        some, at = (self.observations, slice(None)) if kept is None else (select_states(self.observations, kept), kept)
        return self.placed_by(registered_to(self.model, some, self.position[at], self.rotation[at]))

    def placed_by(self, estimate: Estimate) -> Placement:
        target = self.observations.target
        predicted = self.position + (self.rotation @ estimate.target_offset[target][..., None])[..., 0]
        measured, seen = measured_in_base(estimate, self.observations)
        expected = None if seen is None else self.rotation @ estimate.target_rotation[target]
        return Placement(estimate, predicted, measured, expected, seen)
