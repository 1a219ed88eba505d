"""What a model predicts: exact poses of the targets, and residuals of the measurements, both in base axes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.displacement import displaced_coordinates
from elastocal.mechanics.kinematics import pose_differences, poses_of_points

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations
    from elastocal.mechanics.chain import MeasuringPoint


def predict(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> tuple[np.ndarray, np.ndarray]:
    """Exact poses of the targets, in base axes.

    `conditions`: of the states of the observations. Returns `position` (M, 3); `rotation` (M, 3, 3).
    """
    coordinates = displaced_coordinates(model, estimate, conditions)
    position, rotation = poses_of_points(model.sites.chain, coordinates, target_points(model, estimate))
    seen = observations.target, observations.state
    return position[seen], rotation[seen] @ estimate.target_rotation[observations.target]


def residuals(model: Model, estimate: Estimate, observations: Observations, conditions: Conditions) -> np.ndarray:
    """Measured less predicted, in base axes.

    `model`, `estimate`, `observations`, `conditions`: as in `predict`. Returns (M, rows): m and, where poses are measured, rad.
    """
    position, rotation = predict(model, estimate, observations, conditions)
    return differences(measured_in_base(estimate, observations), position, rotation)


def measured_in_base(estimate: Estimate, observations: Observations) -> tuple[np.ndarray, np.ndarray | None]:
    """Measured poses, taken from the frames of the sessions into base axes.

    Returns `position` (M, 3); `rotation` (M, 3, 3).
    """
    session = np.searchsorted(estimate.sessions, observations.states.session[observations.state])
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    position = (into_base @ (observations.position - estimate.frame_position[session])[..., None])[..., 0]
    return position, None if observations.rotation is None else into_base @ observations.rotation


def differences(measured: tuple[np.ndarray, np.ndarray | None], position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Measured less predicted poses, both in base axes.

    `measured` (ndarray (M, 3), ndarray (M, 3, 3) or None): as by `measured_in_base`. `position`, `rotation` (M, 3), (M, 3, 3):
    as by `predict`. Returns (M, rows): m and, where poses are measured, rad.
    """
    measured_position, measured_rotation = measured
    if measured_rotation is None:
        return measured_position - position
    return pose_differences(measured_position, measured_rotation, position, rotation)


def target_points(model: Model, estimate: Estimate) -> list[MeasuringPoint]:
    """The targets as points of the kinematic chain, where an estimate has them: a list of `MeasuringPoint`."""
    points = [model.sites.chain.point(target.point) for target in model.targets]
    return [replace(point, offset_m=tuple(at)) for point, at in zip(points, estimate.target_offset, strict=True)]
