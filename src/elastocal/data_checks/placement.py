"""Predict each measurement by the nominal robot without loads, with frames and targets
that are fitted to most of the measurements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.fitting.least_squares import compute_nominal_poses, register_to_poses
from elastocal.fitting.model import build_declared_model, transform_to_base
from elastocal.fitting.observations import select_states, separate_measurements
from elastocal.mechanics.kinematics import compute_rotation_vectors

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Number of poses that suffices for faults of all measurements.
MANY_POSES = 80
# Lower bounds on a misplacement: geometric errors and deflections do not move a robot
# this far.
IMPLAUSIBLE_M = 0.02
IMPLAUSIBLE_RAD = 0.1
# Factor by which a correction must lower the residual.
FAR_BETTER = 5.0
# Share of the measurements to which frames and targets are first fitted, and number of
# concentration steps.
_CORE_SHARE = 0.6
_CORE_STEPS = 5
# The last fit leaves out measurements that are farther than so many standard deviations;
# the median distance estimates the standard deviation.
_OUTLIER_STD = 5.0
# Share of the largest distances that the misfit ignores.
_TRIMMED_SHARE = 0.1


@dataclass(frozen=True)
class Placement:
    """N measurements and their predictions by the nominal robot, in base axes.

    Attributes
    ----------
    model : Model
        Only frames and targets.
    observations : Observations
    nominal : (N, 3) and (N, 3, 3) arrays
        Poses of the measuring points, m.
    estimate : Estimate of frames and targets
    """

    model: Model
    observations: Observations
    nominal: tuple[np.ndarray, np.ndarray]
    estimate: Estimate

    @cached_property
    def predicted(self) -> np.ndarray:
        """Positions of the targets by the nominal robot, (N, 3) array, m."""
        position, rotation = self.nominal
        offset = self.estimate.target_offset[self.observations.target]
        return position + (rotation @ offset[..., None])[..., 0]

    @cached_property
    def measured(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Measured positions (N, 3), m, and orientations (N, 3, 3); None for the latter if
        only positions are measured."""
        return transform_to_base(self.estimate, self.observations)

    @cached_property
    def distance(self) -> np.ndarray:
        """Distance between predicted and measured position, (N,) array, m."""
        return np.linalg.norm(self.measured[0] - self.predicted, axis=1)

    @cached_property
    def rotation_angle(self) -> np.ndarray | None:
        """Angle between predicted and measured orientation, (N,) array, rad; None if only
        positions are measured."""
        rotation = self.measured[1]
        if rotation is None:
            return None
        mount = self.estimate.target_rotation[self.observations.target]
        predicted = self.nominal[1] @ mount
        difference = rotation @ predicted.transpose(0, 2, 1)
        return np.linalg.norm(compute_rotation_vectors(difference), axis=1)

    @cached_property
    def misfit(self) -> np.ndarray:
        """Residual of positions, m, and orientations, rad, of the worst target: (2,).

        It is a trimmed RMS, because a few wrong measurements are no fault of all.
        """
        target = self.observations.target
        misfit = np.zeros(2)
        for number in np.unique(target):
            members = target == number
            distances = self.distance[members]
            misfit[0] = max(misfit[0], compute_trimmed_rms(distances))
            if self.rotation_angle is not None:
                angles = self.rotation_angle[members]
                misfit[1] = max(misfit[1], compute_trimmed_rms(angles))
        return misfit


def place_measurements(
    campaign: Campaign, estimate: Estimate | None = None
) -> Placement:
    """Place measurements in given frames and targets, or in those fitted to all of them
    with equal weights."""
    model = replace(build_declared_model(campaign), effects=())
    observations = separate_measurements(campaign.measurements)
    nominal = compute_nominal_poses(model, observations)
    if estimate is None:
        estimate = register_to_poses(model, observations, *nominal)
    return Placement(model, observations, nominal, estimate)


def place_robustly(campaign: Campaign) -> Placement:
    """Fit frames and targets to the measurements that agree with each other.

    Least trimmed squares by concentration steps [1]_ from the fit to all measurements,
    trimmed for each target in each session; then one reweighted fit.

    References
    ----------
    .. [1] Rousseeuw and Van Driessen, Computing LTS regression for large data sets, Data
       Mining and Knowledge Discovery 12, 2006.
    """
    placement = place_measurements(campaign)
    if campaign.frame == "base" and not placement.model.has_unknown_targets:
        return placement
    for step in range(_CORE_STEPS + 1):
        distance = placement.distance
        kept = np.zeros(len(campaign.measurements), bool)
        for members in group_by_target(campaign.measurements):
            limit = np.quantile(distance[members], _CORE_SHARE)
            if step == _CORE_STEPS:
                median = np.median(distance[members])
                limit = max(limit, _OUTLIER_STD * median / np.sqrt(chdtri(3, 0.5)))
            kept[members] = distance[members] <= limit
        position, rotation = placement.nominal
        estimate = register_to_poses(
            placement.model,
            select_states(placement.observations, kept),
            position[kept],
            rotation[kept],
        )
        placement = replace(placement, estimate=estimate)
    return placement


def select_spread_poses(campaign: Campaign, poses: int = MANY_POSES) -> Campaign:
    """Select at most so many poses of each target in each session, spread over the
    campaign, with one measurement of each at its lowest load."""
    measurements = campaign.measurements
    chosen = []
    for members in group_by_target(measurements):
        keys = (measurements.repeat, measurements.load, measurements.pose)
        order = members[np.lexsort([key[members] for key in keys])]
        first = order[np.unique(measurements.pose[order], return_index=True)[1]]
        spread = np.linspace(0, len(first) - 1, poses).round().astype(int)
        chosen.append(first[np.unique(spread)])
    rows = np.sort(np.concatenate(chosen))
    return replace(campaign, measurements=measurements.select(rows))


def root_mean_square(values: np.ndarray) -> float:
    """Root mean square of an array of any shape."""
    return float(np.sqrt((values**2).mean()))


def compute_trimmed_rms(distance: np.ndarray) -> float:
    """Root mean square of distances without the largest ones."""
    count = max(int((1 - _TRIMMED_SHARE) * len(distance)), 1)
    return root_mean_square(np.sort(distance)[:count])


def group_by_target(measurements: Measurements) -> list[np.ndarray]:
    """Indices of the measurements of each target in each session."""
    keys = np.column_stack([measurements.session, measurements.target])
    number = group_equal_rows(keys)[1]
    return [np.flatnonzero(number == group) for group in range(number.max() + 1)]
