"""Where the nominal robot puts each measurement, without loads, in frames and targets
fitted to most of the measurements."""

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

# Poses enough to tell what concerns all measurements.
MANY_POSES = 80
# No geometric error, no deflection moves a robot so far.
IMPLAUSIBLE_M = 0.02
IMPLAUSIBLE_RAD = 0.1
# A correction must lower the residual by this factor.
FAR_BETTER = 5.0
# Share of the measurements that frames and targets are first fitted to, and steps of
# fitting to those that fit best. Those beyond so many robust standard deviations, by
# the median of their distances, take no part in the last fit.
_CORE = 0.6
_CORE_STEPS = 5
_APART = 5.0
_TRIMMED = 0.1


@dataclass(frozen=True)
class Placement:
    """Measurements beside the nominal robot, in base axes.

    `model`: frames and targets alone. `nominal` (N, 3), (N, 3, 3): poses of the
    measuring points. `estimate`: frames, targets.
    """

    model: Model
    observations: Observations
    nominal: tuple[np.ndarray, np.ndarray]
    estimate: Estimate

    @cached_property
    def predicted(self) -> np.ndarray:
        """Positions that the robot gives the targets, ndarray (N, 3), m."""
        position, rotation = self.nominal
        return (
            position
            + (
                rotation
                @ self.estimate.target_offset[self.observations.target][..., None]
            )[..., 0]
        )

    @cached_property
    def measured(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Positions (N, 3), m, and orientations (N, 3, 3); these None where positions
        alone are measured."""
        return transform_to_base(self.estimate, self.observations)

    @cached_property
    def distance(self) -> np.ndarray:
        """From the predicted to the measured position, ndarray (N,), m."""
        return np.linalg.norm(self.measured[0] - self.predicted, axis=1)

    @cached_property
    def turn(self) -> np.ndarray | None:
        """Angle between predicted and measured orientation, ndarray (N,), rad; None
        where positions are measured."""
        if (seen := self.measured[1]) is None:
            return None
        predicted = (
            self.nominal[1] @ self.estimate.target_rotation[self.observations.target]
        )
        return np.linalg.norm(
            compute_rotation_vectors(seen @ predicted.transpose(0, 2, 1)), axis=1
        )

    @cached_property
    def misfit(self) -> np.ndarray:
        """What is left of positions (m) and orientations (rad) of the target that fits
        worst, ndarray (2,).

        RMS without the largest tenth: single measurements say nothing of all.
        """
        target = self.observations.target
        parts = (self.distance, self.turn)
        each = [target == number for number in np.unique(target)]
        return np.array(
            [
                0.0 if part is None else max(_trimmed_rms(part[mine]) for mine in each)
                for part in parts
            ]
        )


def place_measurements(
    campaign: Campaign, estimate: Estimate | None = None
) -> Placement:
    """Measurements in given frames and targets, or in those fitted to all measurements
    alike."""
    model = replace(build_declared_model(campaign), effects=())
    observations = separate_measurements(campaign.measurements)
    nominal = compute_nominal_poses(model, observations)
    return Placement(
        model,
        observations,
        nominal,
        estimate or register_to_poses(model, observations, *nominal),
    )


def place_robustly(campaign: Campaign) -> Placement:
    """Fit frames and targets to the measurements that agree with each other.

    Least trimmed squares by concentration steps [1] from the fit to all, trimmed for
    each target in each session; then one reweighted fit.

    [1] Rousseeuw, P. J. and Van Driessen, K., Computing LTS regression for large data sets, Data Mining and Knowledge Discovery
        12, 2006.
    """
    found = place_measurements(campaign)
    if campaign.frame == "base" and not found.model.fitted_target_components:
        return found
    for step in range(_CORE_STEPS + 1):
        distance = found.distance
        kept = np.zeros(len(campaign.measurements), bool)
        for members in group_by_target(campaign.measurements):
            limit = np.quantile(distance[members], _CORE)
            if step == _CORE_STEPS:
                limit = max(
                    limit,
                    _APART * np.median(distance[members]) / np.sqrt(chdtri(3, 0.5)),
                )
            kept[members] = distance[members] <= limit
        some = select_states(found.observations, kept)
        nominal = (part[kept] for part in found.nominal)
        found = replace(found, estimate=register_to_poses(found.model, some, *nominal))
    return found


def select_spread_poses(campaign: Campaign, poses: int = MANY_POSES) -> Campaign:
    """A campaign with measurements of so many poses of each target in each session at
    most, at the lowest load of each."""
    seen = campaign.measurements
    chosen = []
    for members in group_by_target(seen):
        order = members[
            np.lexsort((seen.repeat[members], seen.load[members], seen.pose[members]))
        ]
        first = order[np.unique(seen.pose[order], return_index=True)[1]]
        chosen.append(
            first[np.unique(np.linspace(0, len(first) - 1, poses).round().astype(int))]
        )
    return replace(campaign, measurements=seen.select(np.sort(np.concatenate(chosen))))


def root_mean_square(values: np.ndarray) -> float:
    """Root of the mean square, of an array of any shape."""
    return float(np.sqrt((values**2).mean()))


def _trimmed_rms(distance: np.ndarray) -> float:
    return root_mean_square(
        np.sort(distance)[: max(int((1 - _TRIMMED) * len(distance)), 1)]
    )


def group_by_target(measurements: Measurements) -> list[np.ndarray]:
    """Indices of the measurements of each target in each session."""
    number = group_equal_rows(
        np.column_stack([measurements.session, measurements.target])
    )[1]
    return [np.flatnonzero(number == group) for group in range(number.max() + 1)]
