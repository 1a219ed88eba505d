"""Inputs of a regression from the observations of a campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.prediction import target_points
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.remainder.protocol import Inputs

if TYPE_CHECKING:
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations


def inputs_of(model: Model, estimate: Estimate, observations: Observations, elsewhere: bool) -> Inputs:
    """Inputs of observations, from the nominal chain and the places of the targets.

    `estimate`: says where the targets sit. `elsewhere`: whether observations of another campaign are to be predicted: time then
    carries nothing over. Returns without time or temperature where they were not recorded.
    """
    states, chain, joints = observations.states, model.sites.chain, model.sites.joints
    coordinates = np.zeros((len(states), chain.coordinates))
    coordinates[:, :joints] = states.joint_angles
    jacobian = np.empty((len(observations), 3, chain.coordinates))
    for number, point in enumerate(target_points(model, estimate)):
        mask = observations.target == number
        jacobian[mask] = poses_and_jacobians(chain, coordinates[observations.state[mask]], point)[2][:, :3]
    recorded = () if elsewhere else (states.time_s, states.temperature_c)
    others = [states.wrench, *(values[:, None] for values in recorded if values is not None)]
    return Inputs(
        states.joint_angles[observations.state],
        np.hstack([np.hstack(others)[observations.state], estimate.target_offset[observations.target]]),
        jacobian,
    )
