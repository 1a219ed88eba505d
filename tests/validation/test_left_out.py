"""A model without a part of the poses, by one step that is proved, is that of a fit to the rest from nothing."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from synthetic import NOISE, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import evaluated, fit
from elastocal.fitting.model import stepped
from elastocal.fitting.observations import select_states, state_clusters
from elastocal.fitting.tolerances import with_size
from elastocal.validation.held_out import position_errors, position_residuals, summary
from elastocal.validation.left_out import certain_loss, cross_validated, left_out_squares, refits, split_rows, splits_of


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


def of_sessions(robot, poses=24, sessions=3):
    """A fit with a frame for each session, and its observations."""
    model = made_model(robot.chain, compliance=robot.compliance, identified=True)
    states = made_states(6, poses, seed=1, sessions=sessions)
    estimate = made_estimate(model, tuple(range(sessions)), seed=2)
    estimate = replace(estimate, coefficients=(robot.compliance,))
    seen = with_noise(seen_exactly(model, estimate, states), np.random.default_rng(3))
    return fit(model, seen, NOISE), seen


def test_splits_part_whole_poses_by_joint_space_and_sessions(fanuc):
    _, seen = of_sessions(fanuc)
    found = {split.name: split for split in splits_of(seen.states)}
    assert list(found) == ["joint space", "session"]
    assert found["joint space"].labels == (1, 2, 3, 4) and found["session"].labels == (0, 1, 2)
    np.testing.assert_array_equal(found["session"].part, seen.states.session)
    two_loads = planted(fanuc, {}, poses=12).observations
    (split,) = splits_of(two_loads.states)
    assert split.name == "joint space"
    assert (np.bincount(two_loads.states.pose, split.part) == 2 * split.part[::2]).all()


def test_too_few_poses_have_no_split(fanuc):
    assert splits_of(planted(fanuc, {}, poses=6).observations.states) == []
    assert len(splits_of(planted(fanuc, {}, poses=7).observations.states)) == 1


def test_errors_are_those_of_a_fit_to_the_rest(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=16)
    seen, fitted = campaign.observations, campaign.declared
    part = np.arange(16).repeat(2) // 4
    found = cross_validated(fitted, seen, part)
    for number in range(4):
        rest, left = (select_states(seen, mask) for mask in (part != number, part == number))
        refit = fit(fitted.model, rest, fitted.noise)
        expected, mask = position_errors(fitted.model, refit.estimate, left).distance, part[seen.state] == number
        # A ten thousandth of what the rest leaves unsure of the prediction, and that is less than the noise.
        np.testing.assert_allclose(found.distance[mask], expected, atol=1e-4 * fitted.noise.position_m)
    np.testing.assert_array_equal(found.cluster, seen.cluster)


def test_measurements_of_a_part_do_not_reach_its_prediction(fanuc):
    """All measurements of one block a metre off move the errors of that block, and its prediction by nothing."""
    campaign = planted(fanuc, {}, poses=16)
    seen, fitted = campaign.observations, campaign.declared
    part = np.arange(16).repeat(2) // 4
    mask = part[seen.state] == 2
    moved = replace(seen, position=seen.position + mask[:, None] * [0.0, 0.0, 1.0])
    whole = fit(fitted.model, moved, fitted.noise)
    before, after = (cross_validated(replace(fitted, estimate=whole.estimate), of, part).distance for of in (seen, moved))
    np.testing.assert_allclose(after[mask], 1.0, atol=5 * before[mask].max())
    # The others are predicted from them, and do change.
    assert np.abs(after[~mask] - before[~mask]).max() > 1e-4


def test_a_session_left_out_is_placed_by_itself(fanuc):
    fitted, seen = of_sessions(fanuc)
    found = cross_validated(fitted, seen, seen.states.session)
    assert summary(found.distance)["rms_m"] == pytest.approx(np.sqrt(3) * NOISE.position_m, rel=0.25)


def test_rows_say_each_block_and_all_and_that_a_missing_effect_was_found(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=20)
    declared, added = campaign.declared, [campaign.candidates["joint_offset@3"]]
    model, start = declared.model.with_effects(added), declared.estimate.with_effects(added)
    final = fit(model, campaign.observations, declared.noise, start)
    rows = split_rows(declared, final, campaign.observations, 200, np.random.default_rng(1))
    assert [(row["split"], row["block"]) for row in rows] == [("joint space", block) for block in ("all", 1, 2, 3, 4)]
    assert [row["poses"] for row in rows] == [20, 5, 5, 5, 5]
    for row in rows:
        assert row["before_rms_m"] > 5 * row["after_rms_m"]
        assert row["after_rms_m_low"] < row["after_rms_m"] < row["after_rms_m_high"]
        assert 0.5 < row["reduction_low"] < row["reduction"] < row["reduction_high"] < 1
    pooled = np.mean([row["after_rms_m"] ** 2 for row in rows[1:]])
    assert rows[0]["after_rms_m"] ** 2 == pytest.approx(pooled)


def test_extrapolation_costs_more_than_what_random_poses_show(fanuc):
    """A harmonic of a joint that the model lacks looks like an offset near the fitted poses and not elsewhere."""
    campaign = planted(fanuc, {"transmission_harmonic@2[orders 1-2]": [1e-3, 0, 0, 0]}, poses=40)
    added = [campaign.candidates["joint_offset@2"]]
    declared = campaign.declared
    model, start = declared.model.with_effects(added), declared.estimate.with_effects(added)
    final = fit(model, campaign.observations, declared.noise, start)
    blocked = next(split.part for split in splits_of(campaign.observations.states))
    shuffled = np.random.default_rng(2).permutation(40).repeat(2) % 4
    of_blocks, of_random = (
        summary(cross_validated(final, campaign.observations, part).distance) for part in (blocked, shuffled)
    )
    assert of_blocks["rms_m"] > of_random["rms_m"]
