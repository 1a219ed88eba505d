"""Poses outside the range of the fitted ones: by leaving each out indeed, and by draws of poses that are alike."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.fitting.least_squares import fit
from elastocal.fitting.linearization import linearize
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import select_states
from elastocal.fitting.prediction import conditions
from elastocal.validation.placing import beyond_campaign, beyond_loads, outside_fitted_range, predictive_variances

FOUND = ("joint_offset@2", "joint_offset@3", "payload", "base_compliance")


def fitted_part(robot, seed, fitted, unseen):
    """A fit of four effects to some poses, and observations of these and of others."""
    campaign = planted(robot, {}, seed=seed, poses=fitted + unseen)
    known = campaign.observations.states.pose < fitted
    own, other = (select_states(campaign.observations, mask) for mask in (known, ~known))
    added = [campaign.candidates[key] for key in FOUND]
    declared = campaign.declared
    return fit(declared.model.with_effects(added), own, declared.noise, declared.estimate.with_effects(added)), own, other


def test_variances_are_those_without_the_measurements_of_the_pose(fanuc):
    fitted, own, other = fitted_part(fanuc, 1, 9, 4)
    found, there = predictive_variances(fitted, own, fitted.model, fitted.estimate, other)
    line = linearize(fitted.model, fitted.estimate, own, fitted.conditions)
    white, prior = fitted.whitened(line.sensitivities), [p.plausible**-2.0 for _, p in fitted.parameters]
    for pose in range(9):
        rest, here = white[own.cluster != pose], line.sensitivities[own.cluster == pose, :3]
        covariance = np.linalg.inv(np.einsum("mrp,mrq->pq", rest, rest) + np.diag(prior))
        assert found[pose] == pytest.approx(np.einsum("mrp,pq,mrq->m", here, covariance, here).max(), rel=1e-6)
    covariance = np.linalg.inv(np.einsum("mrp,mrq->pq", white, white) + np.diag(prior))
    around = conditions(fitted.model, fitted.estimate, other.states)
    away = linearize(fitted.model, fitted.estimate, other, around).sensitivities[:, :3]
    variance = np.einsum("mrp,pq,mrq->m", away, covariance, away)
    np.testing.assert_allclose(there, [variance[other.state == state].max() for state in range(8)], rtol=1e-6)


def test_poses_drawn_alike_are_seldom_outside_and_larger_loads_always(fanuc):
    """Of 72 poses beside 14, 5 % by their angles and 1 in 15 by the variance: 8 expected, 19 four standard errors away.

    Three times as many are seen with a power of 0.85.
    """
    alike = loaded = count = 0
    for seed in range(8):
        fitted, own, other = fitted_part(fanuc, seed, 14, 9)
        own_variance, variance = predictive_variances(fitted, own, fitted.model, fitted.estimate, other)
        outside = outside_fitted_range(own.states, other.states, own_variance, variance)
        alike += np.bincount(other.states.pose - 14, outside).astype(bool).sum()
        heavier = replace(other, states=replace(other.states, wrench=10 * other.states.wrench))
        _, variance = predictive_variances(fitted, own, fitted.model, fitted.estimate, heavier)
        outside = outside_fitted_range(own.states, other.states, own_variance, variance)
        loaded += outside[other.states.load == 1].sum()
        count += 9
    assert 1 <= alike <= 19
    # No range of angles tells a load ten times as large.
    assert loaded > 0.9 * count


def test_angles_alone_are_judged_without_variances(fanuc):
    _, own, other = fitted_part(fanuc, 2, 20, 5)
    states = replace(other.states, joint_angles=other.states.joint_angles + np.array([0, 0, 3.0, 0, 0, 0]))
    assert outside_fitted_range(own.states, states).all()
    assert not outside_fitted_range(own.states, own.states).any()


def test_frames_of_other_sessions_do_not_count(fanuc):
    """Whatever the frame of another session is called, only the effects say how sure the model is there."""
    campaign = planted(fanuc, {}, seed=3, poses=20, fitted_frames=True)
    observations = campaign.observations
    states = replace(observations.states, session=np.where(observations.states.pose < 15, 0, 4))
    observations = replace(observations, states=states)
    known = states.session == 0
    own, other = (select_states(observations, mask) for mask in (known, ~known))
    fitted = fit(campaign.declared.model, own, campaign.declared.noise)
    elsewhere = replace(fitted.estimate, sessions=(4,))
    own_variance, variance = predictive_variances(fitted, own, fitted.model, elsewhere, other)
    assert own_variance.shape == (15,) and variance.shape == (10,)
    assert (variance > 0).any() and np.isfinite(variance).all()
    # Unloaded, the compliances say nothing, and the frame, which would, is not counted.
    assert (variance[other.states.load == 0] == 0).all()


def test_poses_forces_and_moments_beyond_those_of_a_campaign_are_marked(fanuc):
    states = planted(fanuc, {}, seed=3, poses=20).observations.states
    angles, wrench = states.joint_angles[:4].copy(), np.zeros((4, 6))
    assert not beyond_campaign(states, angles, None).any()
    force, moment = (np.linalg.norm(states.wrench[:, part], axis=1).max() for part in (slice(0, 3), slice(3, 6)))
    wrench[1, 2], wrench[2, 4] = -1.1 * force, 1.1 * moment
    wrench[3, 0] = force
    angles[0, 2] = states.joint_angles[:, 2].max() + 1.0
    assert beyond_campaign(states, angles, wrench).tolist() == [True, True, True, False]


def test_a_model_without_parameters_is_as_sure_everywhere(fanuc):
    model = replace(made_model(fanuc.chain, rows=3, compliance=fanuc.compliance), fitted_frames=False, effects=())
    model = replace(model, targets=tuple(replace(target, offset_m=(0.0, 0.0, 0.1)) for target in model.targets))
    states = made_states(6, 12, seed=4)
    seen = seen_exactly(model, made_estimate(model, tuple(np.unique(states.session)), seed=3), states)
    fitted = fit(model, seen, Noise("declared", 6e-5, 6e-5, np.zeros(6)))
    assert not fitted.parameters
    own, other = predictive_variances(fitted, seen, model, fitted.estimate, seen)
    assert not own.any() and not other.any() and len(other) == len(seen.states)


def test_loads_are_beyond_by_force_or_moment_and_so_many_times():
    states = replace(made_states(6, 2), wrench=np.array([[0.0, 0.0, -100.0, 0.0, 0.0, 0.0], [30.0, 0.0, 0.0, 0.0, 20.0, 0.0]]))
    wrench = np.array([[0, 150, 0, 0, 0, 0], [0, 0, 201, 0, 0, 0], [0, 0, 0, 39, 0, 0], [0, 0, 0, 0, 0, 41]], float)
    assert beyond_loads(states, wrench).all()
    assert beyond_loads(states, wrench, 2.0).tolist() == [False, True, False, True]
