"""A fit is transferred to frames and targets of other measurements; poses outside its
range are found as by refits that leave out each pose."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from planted import planted
from synthetic import (
    add_noise,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import evaluate_conditions
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import select_states
from elastocal.validation import transfer
from elastocal.validation.held_out import compute_position_errors
from elastocal.validation.transfer import (
    compute_predictive_variances,
    find_beyond_campaign,
    find_extrapolated_poses,
    find_larger_loads,
    keep_transferable_effects,
    place_unseen_sessions,
    transfer_fit,
    warn_of_repeated_poses,
)

ADOPTED = ("joint_offset@2", "joint_offset@3", "payload", "base_compliance")


@pytest.mark.parametrize("rows", [3, 6])
def test_an_unseen_session_gets_a_frame_of_its_own_and_nothing_else_changes(
    rows, fanuc
):
    model = make_model(fanuc.chain, rows=rows, compliance=fanuc.compliance)
    true = make_estimate(model, (2, 5, 7), seed=3)
    states = make_states(6, 45, seed=4)
    # The unseen session has so few poses that a fit to them would change the target.
    states.session[:] = np.repeat([2, 5, 7], [20, 3, 22])
    observations = add_noise(
        observe_exactly(model, true, states), np.random.default_rng(5)
    )
    is_fitted = states.session != 5
    fitted_sessions = select_states(observations, is_fitted)
    fit = fit_model(model, fitted_sessions, Noise("declared", 6e-5, 6e-5, np.zeros(6)))
    placed = place_unseen_sessions(fit, observations)
    assert placed.sessions == (2, 5, 7)
    np.testing.assert_array_equal(placed.target_offset, fit.estimate.target_offset)
    np.testing.assert_array_equal(
        placed.frame_position[[0, 2]], fit.estimate.frame_position
    )
    np.testing.assert_allclose(
        placed.frame_position[1], true.frame_position[1], atol=4e-4
    )
    distance = compute_position_errors(model, placed, observations).distance
    assert np.sqrt((distance[~is_fitted] ** 2).mean()) < 1.3 * np.sqrt(3) * 6e-5
    if rows == 6:
        np.testing.assert_allclose(
            placed.frame_rotation[1].T @ true.frame_rotation[1], np.eye(3), atol=2e-4
        )
    assert place_unseen_sessions(fit, fitted_sessions) is fit.estimate
    # If the target has moved by 1 mm, the frame takes up a part of that. A target that
    # was fitted anew would take up all of it.
    moved = replace(
        true,
        target_offset=true.target_offset + 1e-3 * np.eye(len(true.target_offset), 3),
    )
    with_moved_target = select_states(observe_exactly(model, moved, states), ~is_fitted)
    placed = place_unseen_sessions(fit, with_moved_target)
    distance = compute_position_errors(model, placed, with_moved_target).distance
    assert distance.min() < 8e-4


def fit_some_poses(robot, seed, fitted, unseen, **options):
    """Fit four effects to the first poses of a campaign.

    Returns the fit, the observations of the fitted poses and those of the unseen ones.
    """
    campaign = planted(robot, {}, seed=seed, poses=fitted + unseen, **options)
    is_fitted = campaign.observations.states.pose < fitted
    fitted_poses = select_states(campaign.observations, is_fitted)
    unseen_poses = select_states(campaign.observations, ~is_fitted)
    effects = [campaign.candidates[key] for key in ADOPTED]
    declared = campaign.declared
    fit = fit_model(
        declared.model.with_effects(effects),
        fitted_poses,
        declared.noise,
        declared.estimate.with_effects(effects),
    )
    return fit, fitted_poses, unseen_poses


def compute_variances(white, sensitivities, prior_precision):
    """Return the predictive variance of each position, summed over its coordinates,
    from whitened rows (M, rows, P) and sensitivities (N, 3, P)."""
    precision = np.einsum("mrp,mrq->pq", white, white) + np.diag(prior_precision)
    covariance = np.linalg.inv(precision)
    return np.einsum("mrp,pq,mrq->m", sensitivities, covariance, sensitivities)


@pytest.mark.parametrize("rows", [3, 6])
def test_variances_of_fitted_poses_are_those_without_the_measurements_of_the_pose(
    rows, fanuc
):
    fit, fitted_poses, unseen_poses = fit_some_poses(fanuc, 1, 9, 4, rows=rows)
    fitted_variance, unseen_variance = compute_predictive_variances(
        fit, fitted_poses, fit.model, fit.estimate, unseen_poses
    )
    sensitivities = linearize(
        fit.model, fit.estimate, fitted_poses, fit.conditions
    ).sensitivities
    white = fit.whiten(sensitivities)
    plausible = [parameter.plausible for _, parameter in fit.parameters]
    prior_precision = np.minimum(plausible, fit.prior_std) ** -2.0
    for pose in range(9):
        in_pose = fitted_poses.cluster == pose
        variances = compute_variances(
            white[~in_pose], sensitivities[in_pose, :3], prior_precision
        )
        assert fitted_variance[pose] == pytest.approx(variances.max(), rel=1e-6)
    conditions = evaluate_conditions(fit.model, fit.estimate, unseen_poses.states)
    unseen_sensitivities = linearize(
        fit.model, fit.estimate, unseen_poses, conditions
    ).sensitivities[:, :3]
    variances = compute_variances(white, unseen_sensitivities, prior_precision)
    expected = [variances[unseen_poses.state == state].max() for state in range(8)]
    np.testing.assert_allclose(unseen_variance, expected, rtol=1e-6)


def test_variances_from_a_sample_of_very_many_poses_are_nearly_those_of_all(
    fanuc, monkeypatch
):
    fit, fitted_poses, unseen_poses = fit_some_poses(fanuc, 1, 60, 9)
    expected_fitted, expected_unseen = compute_predictive_variances(
        fit, fitted_poses, fit.model, fit.estimate, unseen_poses
    )
    monkeypatch.setattr(transfer, "_MAX_FITTED", len(fitted_poses) // 2)
    fitted_variance, unseen_variance = compute_predictive_variances(
        fit, fitted_poses, fit.model, fit.estimate, unseen_poses
    )
    assert len(fitted_variance) == 30
    assert unseen_variance == pytest.approx(expected_unseen, rel=0.5)
    assert np.median(unseen_variance / expected_unseen) == pytest.approx(1.0, abs=0.2)
    assert np.median(fitted_variance) == pytest.approx(
        np.median(expected_fitted), rel=0.3
    )


def test_effects_of_the_setup_or_of_a_missing_temperature_are_not_transferred(fanuc):
    campaign = planted(fanuc, {})
    keys = (
        "joint_offset@3",
        "setup_step",
        "payload",
        "temperature_gradient@1[temperature]",
    )
    effects = [campaign.candidates[key] for key in keys]
    declared = campaign.declared
    fit = replace(
        declared,
        model=declared.model.with_effects(effects),
        estimate=declared.estimate.with_effects(effects),
    )
    states = replace(campaign.observations.states, temperature_c=None)
    transferred = keep_transferable_effects(fit, declared.model, states)
    assert transferred.model.effects == (
        *declared.model.effects,
        effects[0],
        effects[2],
    )
    counts = [len(values) for values in transferred.estimate.coefficients]
    assert counts == [len(effect.parameters) for effect in transferred.model.effects]


def test_another_campaign_has_its_own_frame_and_targets_and_the_effects_of_the_fit(
    fanuc,
):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, fitted_frames=True)
    fit = campaign.declared
    shift = np.array([0.0, 0.2, 0.0])
    moved = replace(
        campaign.observations, position=campaign.observations.position + shift
    )
    fitted_case, new_case = (
        SimpleNamespace(
            campaign=SimpleNamespace(name=name), model=fit.model, observations=moved
        )
        for name in "cd"
    )
    assert transfer_fit(fit, fitted_case, fitted_case)[1] is fit.estimate
    model, estimate = transfer_fit(fit, fitted_case, new_case)
    assert model.effects == fit.model.effects
    assert model.nominal_compliance is fit.model.nominal_compliance
    np.testing.assert_allclose(
        estimate.frame_position - fit.estimate.frame_position, shift[None], atol=1e-6
    )
    np.testing.assert_array_equal(
        estimate.coefficients[0], fit.estimate.coefficients[0]
    )


def find_outside(fit, fitted_poses, unseen_poses, **changes):
    """Mark the unseen poses outside the range of the fit, after changes of their
    states."""
    changed = replace(unseen_poses, states=replace(unseen_poses.states, **changes))
    campaign = SimpleNamespace(name="c")
    return find_extrapolated_poses(
        fit,
        SimpleNamespace(campaign=campaign, observations=fitted_poses),
        SimpleNamespace(campaign=campaign, observations=changed),
    )


def test_similar_poses_are_seldom_outside_and_larger_loads_and_far_angles_always(
    fanuc,
):
    """Of 72 poses beside 14 fitted ones, 5 % are outside by their angles and 1 in 15 by
    their variance. 8 are expected, and 19 are four standard errors more.

    Three times as many are detected with a power of 0.85.
    """
    similar = 0
    loaded = 0
    far_angle = np.array([0, 0, 3.0, 0, 0, 0])
    for seed in range(8):
        poses = fit_some_poses(fanuc, seed, 14, 9)
        states = poses[2].states
        similar += find_outside(*poses).sum()
        loaded += find_outside(*poses, wrench=10 * states.wrench).sum()
        far_angles = states.joint_angles + far_angle
        assert find_outside(*poses, joint_angles=far_angles).all()
    assert 1 <= similar <= 19
    # The joint angles do not show that a load is ten times as large.
    assert loaded > 0.9 * 72


def test_frames_of_other_sessions_do_not_contribute_to_the_variance(fanuc):
    """Only the effects determine the uncertainty of a prediction in another session,
    whatever the name of this session is."""
    campaign = planted(fanuc, {}, seed=3, poses=20, fitted_frames=True)
    observations = campaign.observations
    states = observations.states
    states = replace(states, session=np.where(states.pose < 15, 0, 4))
    observations = replace(observations, states=states)
    fitted_poses = select_states(observations, states.session == 0)
    unseen_poses = select_states(observations, states.session == 4)
    fit = fit_model(campaign.declared.model, fitted_poses, campaign.declared.noise)
    elsewhere = replace(fit.estimate, sessions=(4,))
    fitted_variance, variance = compute_predictive_variances(
        fit, fitted_poses, fit.model, elsewhere, unseen_poses
    )
    assert fitted_variance.shape == (15,)
    assert variance.shape == (10,)
    assert (variance > 0).any()
    assert np.isfinite(variance).all()
    # Without a load the compliances do not matter. The frame would matter, but it does
    # not count.
    assert (variance[unseen_poses.states.load == 0] == 0).all()
    # A model without free parameters has no uncertainty at all.
    rigid = replace(campaign.declared.model, fitted_frames=False, effects=())
    rigid_fit = fit_model(rigid, fitted_poses, campaign.declared.noise)
    assert not rigid_fit.parameters
    variances = compute_predictive_variances(
        rigid_fit, fitted_poses, rigid, rigid_fit.estimate, unseen_poses
    )
    assert not np.concatenate(variances).any()


def test_angles_forces_and_moments_beyond_those_of_a_campaign_are_marked(fanuc):
    states = planted(fanuc, {}, seed=3, poses=20).observations.states
    angles = states.joint_angles[:4].copy()
    wrench = np.zeros((4, 6))
    assert not find_beyond_campaign(states, angles, None).any()
    force = np.linalg.norm(states.wrench[:, :3], axis=1).max()
    moment = np.linalg.norm(states.wrench[:, 3:], axis=1).max()
    wrench[1, 2] = -1.1 * force
    wrench[2, 4] = 1.1 * moment
    wrench[3, 0] = force
    angles[0, 2] = states.joint_angles[:, 2].max() + 1.0
    is_beyond = find_beyond_campaign(states, angles, wrench)
    assert is_beyond.tolist() == [True, True, True, False]
    too_large = np.array([[0.0, 1.5 * force, 0, 0, 0, 2.1 * moment]])
    assert find_larger_loads(states, too_large, 2.0).all()
    large = np.array([[0.0, 1.5 * force, 0, 0, 0, 1.9 * moment]])
    assert not find_larger_loads(states, large, 2.0).any()


@pytest.mark.parametrize(
    ("seed", "poses", "message"),
    [(1, 8, "all 8 validation poses repeat"), (2, 8, ""), (3, 10, "8 of 10")],
)
def test_a_warning_counts_poses_that_repeat_fitted_configurations(seed, poses, message):
    fitted = make_states(6, 8, seed=1)
    states = make_states(6, poses, seed=seed)
    if poses > 8:
        states.joint_angles[:8] = fitted.joint_angles
    warnings = warn_of_repeated_poses(fitted, states)
    beginnings = [warning[: len(message)] for warning in warnings]
    assert beginnings == ([message] if message else [])
