"""What a regression is shown of an observation."""

from dataclasses import replace

import numpy as np
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.fitting.prediction import target_points
from elastocal.mechanics.kinematics import poses
from elastocal.remainder.inputs import inputs_of


def test_the_jacobian_is_that_of_each_target_and_its_place_is_shown(fanuc):
    model = made_model(fanuc.chain, rows=3, compliance=fanuc.compliance)
    estimate = made_estimate(model, (0,), seed=3)
    seen = seen_exactly(model, estimate, made_states(6, 9, seed=4))
    inputs = inputs_of(model, estimate, seen, elsewhere=False)
    step, joint = 1e-6, 2
    for number, point in enumerate(target_points(model, estimate)):
        mask = seen.target == number
        ends = []
        for sign in (-1.0, 1.0):
            coordinates = np.zeros((mask.sum(), model.sites.chain.coordinates))
            coordinates[:, :6] = seen.states.joint_angles[seen.state[mask]]
            coordinates[:, joint] += sign * step
            ends.append(poses(model.sites.chain, coordinates, point)[0])
        np.testing.assert_allclose(inputs.jacobian[mask, :, joint], (ends[1] - ends[0]) / (2 * step), atol=1e-8)
        np.testing.assert_array_equal(inputs.others[mask, -3:], np.tile(estimate.target_offset[number], (mask.sum(), 1)))


def test_time_and_temperature_carry_nothing_over_to_another_campaign(fanuc):
    model = made_model(fanuc.chain, rows=3, compliance=fanuc.compliance)
    estimate = made_estimate(model, (0,), seed=3)
    seen = seen_exactly(model, estimate, made_states(6, 9, seed=4))
    timed, timeless = (
        replace(seen, states=replace(seen.states, time_s=time, temperature_c=temperature))
        for time, temperature in ((np.arange(9.0), np.full(9, 21.0)), (None, None))
    )
    here, there = (inputs_of(model, estimate, timed, elsewhere) for elsewhere in (False, True))
    assert here.others.shape[1] == there.others.shape[1] + 2
    assert inputs_of(model, estimate, timeless, elsewhere=False).others.shape == there.others.shape
