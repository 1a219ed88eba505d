"""Cross-validation over blocks and sessions: refits without the part, and nothing of the part in them."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from synthetic import NOISE, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.fitting.least_squares import fit
from elastocal.fitting.observations import select_states
from elastocal.validation.held_out import position_errors, summary
from elastocal.validation.splits import cross_validated, split_rows, splits_of


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


def test_errors_are_those_of_a_fit_to_the_rest(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=16)
    seen, fitted = campaign.observations, campaign.declared
    part = np.arange(16).repeat(2) // 4
    found = cross_validated(fitted, seen, part)
    for number in range(4):
        rest, left = (select_states(seen, mask) for mask in (part != number, part == number))
        refit = fit(fitted.model, rest, fitted.noise)
        expected = position_errors(fitted.model, refit.estimate, left).distance
        np.testing.assert_allclose(found.distance[part[seen.state] == number], expected, rtol=1e-9)
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
