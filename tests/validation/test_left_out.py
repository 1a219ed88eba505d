"""Errors of poses left out, without fitting again, are those of fits that were made again."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted

from elastocal.fitting.least_squares import fit
from elastocal.fitting.observations import select_states, state_clusters
from elastocal.fitting.tolerances import with_size
from elastocal.validation.held_out import position_residuals
from elastocal.validation.left_out import certain_loss, left_out_squares


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
