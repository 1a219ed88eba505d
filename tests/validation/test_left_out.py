"""A model without a part of the poses, by one step that is proved, is that of a fit to the rest from nothing."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from synthetic import NOISE, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import evaluated, fit
from elastocal.fitting.observations import select_states, state_clusters
from elastocal.fitting.parameters import stepped
from elastocal.fitting.tolerances import with_size
from elastocal.validation.held_out import position_residuals
from elastocal.validation.left_out import certain_loss, left_out_squares, refits


def test_left_out_squares_are_those_of_refits(kuka):
    keys = [f"joint_offset@{joint}" for joint in (2, 3, 4, 5)]
    campaign = planted(kuka, {key: [5e-4] for key in keys}, seed=3, poses=8, fitted_frames=True)
    model = with_size(campaign.declared.model.with_effects([campaign.candidates[key] for key in keys]), 0.3)
    fitted = fit(model, campaign.observations, campaign.declared.noise)
    found, pose = left_out_squares(fitted, campaign.observations), state_clusters(campaign.observations.states)
    refitted = []
    for number in range(pose.max() + 1):
        rest, alone = (select_states(campaign.observations, pose == number if mine else pose != number) for mine in (0, 1))
        again = fit(model, rest, fitted.noise, fitted.estimate)
        refitted.append((position_residuals(model, again.estimate, alone) ** 2).sum(axis=1).mean())
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(refitted), rtol=0.1)
    inside = np.bincount(campaign.observations.cluster, (fitted.residual[:, :3] ** 2).sum(axis=1))
    assert np.mean(found) > 1.2 * np.mean(inside / np.bincount(campaign.observations.cluster))


def test_what_a_pose_alone_determines_is_no_error_of_it(kuka):
    campaign = planted(kuka, {}, seed=4, poses=6)
    states = replace(campaign.observations.states, session=state_clusters(campaign.observations.states))
    seen = replace(campaign.observations, states=states)
    fitted = fit(replace(campaign.declared.model, fitted_frames=True), seen, campaign.declared.noise)
    assert np.isfinite(left_out_squares(fitted, seen)).all()


@pytest.mark.parametrize(("shift", "loses"), [(-1.0, False), (0.1, False), (0.5, True)])
def test_a_loss_is_certain_beyond_the_standard_error_of_the_difference(shift, loses):
    others = np.abs(np.random.default_rng(1).normal(3.0, 0.2, 25))
    off = np.random.default_rng(2).normal(0.0, 1.0, 25)
    off = (off - off.mean()) / off.std(ddof=1)
    assert certain_loss(others + off + shift, others) is loses


def test_without_anything_to_fit_errors_are_the_residuals(kuka):
    campaign = planted(kuka, {}, seed=5, poses=6)
    bare = fit(replace(campaign.declared.model, effects=()), campaign.observations, campaign.declared.noise)
    assert bare.held.size == 0
    squares, cluster = (bare.residual[:, :3] ** 2).sum(axis=1), campaign.observations.cluster
    np.testing.assert_allclose(
        left_out_squares(bare, campaign.observations), np.bincount(cluster, squares) / np.bincount(cluster)
    )


def loaded_in(robot, loaded, poses=24):
    """A fit of joint compliances twice the nominal ones to poses of which only some carry a load, and its observations."""
    targets = [Target(name, robot.chain.end_effector.name, None) for name in "AB"]
    model = made_model(robot.chain, targets, compliance=robot.compliance, identified=True)
    states = made_states(6, poses, seed=1)
    states = replace(states, wrench=np.where(loaded[:, None], states.wrench, 0.0))
    estimate = replace(made_estimate(model, (0,), seed=2), coefficients=(2.0 * robot.compliance,))
    seen = with_noise(seen_exactly(model, estimate, states), np.random.default_rng(3))
    return fit(model, seen, NOISE), seen


def test_what_only_the_part_left_out_identifies_goes_back_to_where_fits_start(fanuc):
    part = np.arange(24) // 6
    fitted, seen = loaded_in(fanuc, part == 1)
    (found,) = fitted.estimate.coefficients
    assert not fitted.held[-6:].any() and found[0] > 1.9 * fanuc.compliance[0]
    for number, refit in enumerate(refits(fitted, seen, part)):
        (without,) = refit.estimate.coefficients
        if number == 1:
            np.testing.assert_allclose(without, fanuc.compliance, rtol=1e-12)
            from_nothing = fit(fitted.model, refit.rest, NOISE).estimate
            errors = [position_residuals(fitted.model, each, refit.left_out) for each in (refit.there, from_nothing)]
            np.testing.assert_allclose(*errors, atol=1e-2 * NOISE.position_m)
            assert np.abs(errors[0]).max() > 10 * NOISE.position_m
        else:
            assert without[0] > 1.9 * fanuc.compliance[0]


def test_a_step_that_equations_after_it_do_not_prove_is_followed_by_others(fanuc):
    """From an estimate far off, where what is linear about it says little of the rest."""
    part = np.arange(24) // 6
    fitted, seen = loaded_in(fanuc, np.ones(24, bool))
    off = stepped(fitted.model, fitted.estimate, np.where(np.arange(len(fitted.held)) < 6, 0.3, 0.0))
    far = evaluated(fitted.model, seen, NOISE, off)
    for refit, again in zip(refits(far, seen, part), refits(fitted, seen, part), strict=True):
        errors = [position_residuals(fitted.model, each.there, refit.left_out) for each in (refit, again)]
        np.testing.assert_allclose(*errors, atol=1e-3 * NOISE.position_m)


def test_a_target_that_only_the_part_left_out_shows_is_placed_as_from_nothing(fanuc):
    part = np.arange(24) // 6
    fitted, seen = loaded_in(fanuc, np.ones(24, bool))
    kept = (seen.target != 1) | (part[seen.state] == 2)
    some = replace(seen, state=seen.state[kept], target=seen.target[kept], position=seen.position[kept])
    some = replace(some, rotation=None if seen.rotation is None else seen.rotation[kept])
    fitted = fit(fitted.model, some, NOISE, fitted.estimate)
    refit = list(refits(fitted, some, part))[2]
    from_nothing = fit(fitted.model, refit.rest, NOISE).estimate
    np.testing.assert_array_equal(refit.estimate.target_offset[1], from_nothing.target_offset[1])
    assert np.abs(refit.estimate.target_offset[1] - fitted.estimate.target_offset[1]).max() > 1e-3
