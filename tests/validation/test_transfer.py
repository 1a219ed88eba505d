"""Frames and targets of other measurements; poses outside the range of the fitted ones,
by leaving each out indeed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from planted import planted
from synthetic import add_noise, make_estimate, make_model, make_states, observe_exactly

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

FOUND = ("joint_offset@2", "joint_offset@3", "payload", "base_compliance")


@pytest.mark.parametrize("rows", [3, 6])
def test_a_session_that_the_fit_has_not_seen_gets_a_frame_of_its_own_and_nothing_else(
    rows, fanuc
):
    model = make_model(fanuc.chain, rows=rows, compliance=fanuc.compliance)
    true = make_estimate(model, (2, 5, 7), seed=3)
    states = make_states(6, 45, seed=4)
    # So few in the new one that a target fitted to them would be another one.
    states.session[:] = np.repeat([2, 5, 7], [20, 3, 22])
    seen = add_noise(observe_exactly(model, true, states), np.random.default_rng(5))
    known = states.session != 5
    fitted = fit_model(
        model, select_states(seen, known), Noise("declared", 6e-5, 6e-5, np.zeros(6))
    )
    placed = place_unseen_sessions(fitted, seen)
    assert placed.sessions == (2, 5, 7)
    np.testing.assert_array_equal(placed.target_offset, fitted.estimate.target_offset)
    np.testing.assert_array_equal(
        placed.frame_position[[0, 2]], fitted.estimate.frame_position
    )
    np.testing.assert_allclose(
        placed.frame_position[1], true.frame_position[1], atol=4e-4
    )
    distance = compute_position_errors(model, placed, seen).distance
    assert np.sqrt((distance[~known] ** 2).mean()) < 1.3 * np.sqrt(3) * 6e-5
    if rows == 6:
        np.testing.assert_allclose(
            placed.frame_rotation[1].T @ true.frame_rotation[1], np.eye(3), atol=2e-4
        )
    assert place_unseen_sessions(fitted, select_states(seen, known)) is fitted.estimate
    # Of a target that has moved by 1 mm the frame takes up what it can, which it could
    # not were the target fitted anew.
    moved = replace(
        true,
        target_offset=true.target_offset + 1e-3 * np.eye(len(true.target_offset), 3),
    )
    off = select_states(observe_exactly(model, moved, states), ~known)
    assert (
        compute_position_errors(
            model, place_unseen_sessions(fitted, off), off
        ).distance.min()
        < 8e-4
    )


def fitted_part(robot, seed, fitted, unseen, **model):
    """A fit of four effects to some poses, and observations of these and of others."""
    campaign = planted(robot, {}, seed=seed, poses=fitted + unseen, **model)
    known = campaign.observations.states.pose < fitted
    own, other = (
        select_states(campaign.observations, mask) for mask in (known, ~known)
    )
    added = [campaign.candidates[key] for key in FOUND]
    declared = campaign.declared
    return (
        fit_model(
            declared.model.with_effects(added),
            own,
            declared.noise,
            declared.estimate.with_effects(added),
        ),
        own,
        other,
    )


@pytest.mark.parametrize("rows", [3, 6])
def test_variances_are_those_without_the_measurements_of_the_pose(rows, fanuc):
    fitted, own, other = fitted_part(fanuc, 1, 9, 4, rows=rows)
    found, there = compute_predictive_variances(
        fitted, own, fitted.model, fitted.estimate, other
    )
    line = linearize(fitted.model, fitted.estimate, own, fitted.conditions)
    white = fitted.whiten(line.sensitivities)
    prior = [p.plausible**-2.0 for _, p in fitted.parameters]
    for pose in range(9):
        rest = white[own.cluster != pose]
        here = line.sensitivities[own.cluster == pose, :3]
        covariance = np.linalg.inv(
            np.einsum("mrp,mrq->pq", rest, rest) + np.diag(prior)
        )
        assert found[pose] == pytest.approx(
            np.einsum("mrp,pq,mrq->m", here, covariance, here).max(), rel=1e-6
        )
    covariance = np.linalg.inv(np.einsum("mrp,mrq->pq", white, white) + np.diag(prior))
    around = evaluate_conditions(fitted.model, fitted.estimate, other.states)
    away = linearize(fitted.model, fitted.estimate, other, around).sensitivities[:, :3]
    variance = np.einsum("mrp,pq,mrq->m", away, covariance, away)
    np.testing.assert_allclose(
        there, [variance[other.state == state].max() for state in range(8)], rtol=1e-6
    )


def test_a_sample_says_nearly_how_surely_very_many_poses_are_predicted(
    fanuc, monkeypatch
):
    fitted, own, other = fitted_part(fanuc, 1, 60, 9)
    own_variance, variance = compute_predictive_variances(
        fitted, own, fitted.model, fitted.estimate, other
    )
    monkeypatch.setattr(transfer, "_MAX_FITTED", len(own) // 2)
    some, there = compute_predictive_variances(
        fitted, own, fitted.model, fitted.estimate, other
    )
    assert len(some) == 30 and there == pytest.approx(variance, rel=0.5)
    assert np.median(there / variance) == pytest.approx(1.0, abs=0.2)
    assert np.median(some) == pytest.approx(np.median(own_variance), rel=0.3)


def test_what_goes_with_the_setup_or_was_not_recorded_is_not_carried_to_another_campaign(
    fanuc,
):
    campaign = planted(fanuc, {})
    keys = (
        "joint_offset@3",
        "setup_step",
        "payload",
        "temperature_gradient@1[temperature]",
    )
    added = [campaign.candidates[key] for key in keys]
    declared = campaign.declared
    model = declared.model.with_effects(added)
    estimate = declared.estimate.with_effects(added)
    states = replace(campaign.observations.states, temperature_c=None)
    there = keep_transferable_effects(
        replace(declared, model=model, estimate=estimate), declared.model, states
    )
    assert there.model.effects == (*declared.model.effects, added[0], added[2])
    assert [len(each) for each in there.estimate.coefficients] == [
        len(effect.parameters) for effect in there.model.effects
    ]


def test_another_campaign_has_its_own_frame_and_targets_and_the_effects_of_the_fit(
    fanuc,
):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, fitted_frames=True)
    fitted = campaign.declared
    shift = np.array([0.0, 0.2, 0.0])
    moved = replace(
        campaign.observations, position=campaign.observations.position + shift
    )
    case, part = (
        SimpleNamespace(
            campaign=SimpleNamespace(name=n), model=fitted.model, observations=moved
        )
        for n in "cd"
    )
    assert transfer_fit(fitted, case, case)[1] is fitted.estimate
    model, estimate = transfer_fit(fitted, case, part)
    assert (
        model.effects == fitted.model.effects
        and model.nominal_compliance is fitted.model.nominal_compliance
    )
    np.testing.assert_allclose(
        estimate.frame_position - fitted.estimate.frame_position, shift[None], atol=1e-6
    )
    np.testing.assert_array_equal(
        estimate.coefficients[0], fitted.estimate.coefficients[0]
    )


def outside(fitted, own, other, **changes):
    """Poses of other observations, with changes of their states, that lie outside the
    range of a fit's own."""
    unseen = replace(other, states=replace(other.states, **changes))
    cases = [
        SimpleNamespace(campaign=SimpleNamespace(name="c"), observations=part)
        for part in (own, unseen)
    ]
    return find_extrapolated_poses(fitted, *cases)


def test_poses_drawn_alike_are_seldom_outside_and_larger_loads_and_far_angles_always(
    fanuc,
):
    """Of 72 poses beside 14, 5 % by their angles and 1 in 15 by the variance: 8
    expected, 19 four standard errors away.

    Three times as many are seen with a power of 0.85.
    """
    alike = loaded = 0
    for seed in range(8):
        fitted, own, other = fitted_part(fanuc, seed, 14, 9)
        states = other.states
        alike += outside(fitted, own, other).sum()
        loaded += outside(fitted, own, other, wrench=10 * states.wrench).sum()
        assert outside(
            fitted,
            own,
            other,
            joint_angles=states.joint_angles + np.array([0, 0, 3.0, 0, 0, 0]),
        ).all()
    assert 1 <= alike <= 19
    # No range of angles tells a load ten times as large.
    assert loaded > 0.9 * 72


def test_frames_of_other_sessions_do_not_count(fanuc):
    """Whatever the frame of another session is called, only the effects say how sure
    the model is there."""
    campaign = planted(fanuc, {}, seed=3, poses=20, fitted_frames=True)
    observations = campaign.observations
    states = replace(
        observations.states, session=np.where(observations.states.pose < 15, 0, 4)
    )
    observations = replace(observations, states=states)
    own, other = (
        select_states(observations, states.session == number) for number in (0, 4)
    )
    fitted = fit_model(campaign.declared.model, own, campaign.declared.noise)
    elsewhere = replace(fitted.estimate, sessions=(4,))
    own_variance, variance = compute_predictive_variances(
        fitted, own, fitted.model, elsewhere, other
    )
    assert own_variance.shape == (15,) and variance.shape == (10,)
    assert (variance > 0).any() and np.isfinite(variance).all()
    # Unloaded, the compliances say nothing, and the frame, which would, is not counted.
    assert (variance[other.states.load == 0] == 0).all()
    # Nor is anything unsure of a model that leaves nothing open.
    known = replace(campaign.declared.model, fitted_frames=False, effects=())
    bare = fit_model(known, own, campaign.declared.noise)
    assert (
        not bare.parameters
        and not np.concatenate(
            compute_predictive_variances(bare, own, known, bare.estimate, other)
        ).any()
    )


def test_poses_forces_and_moments_beyond_those_of_a_campaign_are_marked(fanuc):
    states = planted(fanuc, {}, seed=3, poses=20).observations.states
    angles = states.joint_angles[:4].copy()
    wrench = np.zeros((4, 6))
    assert not find_beyond_campaign(states, angles, None).any()
    force, moment = (
        np.linalg.norm(states.wrench[:, part], axis=1).max()
        for part in (slice(0, 3), slice(3, 6))
    )
    wrench[1, 2] = -1.1 * force
    wrench[2, 4] = 1.1 * moment
    wrench[3, 0] = force
    angles[0, 2] = states.joint_angles[:, 2].max() + 1.0
    assert find_beyond_campaign(states, angles, wrench).tolist() == [
        True,
        True,
        True,
        False,
    ]
    assert find_larger_loads(
        states, np.tile([0.0, 1.5 * force, 0, 0, 0, 2.1 * moment], (1, 1)), 2.0
    ).all()
    assert not find_larger_loads(
        states, np.tile([0.0, 1.5 * force, 0, 0, 0, 1.9 * moment], (1, 1)), 2.0
    ).any()


@pytest.mark.parametrize(
    ("seed", "poses", "words"),
    [(1, 8, "all 8 validation poses repeat"), (2, 8, ""), (3, 10, "8 of 10")],
)
def test_poses_that_repeat_fitted_configurations_are_told(seed, poses, words):
    fitted = make_states(6, 8, seed=1)
    states = make_states(6, poses, seed=seed)
    if poses > 8:
        states.joint_angles[:8] = fitted.joint_angles
    warnings = warn_of_repeated_poses(fitted, states)
    assert [each[: len(words)] for each in warnings] == ([words] if words else [])
