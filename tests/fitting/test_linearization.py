"""Sensitivities by central differences of the model's own exact residuals."""

from dataclasses import replace

import numpy as np
from synthetic import NOISE, candidate_on, made_estimate, made_model, made_states, seen_exactly, slopes, small_steps

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import fit
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import parameters
from elastocal.fitting.prediction import conditions


def test_sensitivities_are_central_differences_of_the_residuals(full_case):
    model, estimate, seen = full_case
    around = conditions(model, estimate, seen.states)
    steps = np.diag(small_steps(model, estimate))
    expected = slopes(model, estimate, seen, around, steps)
    found = linearize(model, estimate, seen, around).sensitivities @ steps
    assert found.shape == expected.shape == (24, model.rows, len(parameters(model, estimate)))
    largest = np.abs(expected).max(axis=(0, 1))
    assert (largest > 0).all()
    np.testing.assert_allclose(found / largest, expected / largest, rtol=0, atol=1e-5)


def test_a_mount_of_unknown_turn_and_a_known_one_at_an_unknown_place_have_their_sensitivities(fanuc):
    targets = Target("turned", "6DoF", (0.1, 0.0, 0.2), None), Target("placed", "3DoF", None, (0.3, -1.0, 0.2))
    model = made_model(fanuc.chain, targets, rows=6)
    estimate, states = made_estimate(model, seed=1), made_states(6, 8, seed=2)
    seen = seen_exactly(model, estimate, states)
    around, steps = conditions(model, estimate, states), np.diag(small_steps(model, estimate))
    found = linearize(model, estimate, seen, around).sensitivities @ steps
    expected = slopes(model, estimate, seen, around, steps)
    assert found.shape == expected.shape == (16, 6, 12) and (np.abs(expected).max(axis=(0, 1)) > 0).all()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_the_place_of_a_jump_has_no_slope_where_a_row_is_within_a_step_of_it(fanuc):
    model = made_model(fanuc.chain, effects=[candidate_on(fanuc.chain, "setup_step")])
    states = made_states(6, 9, seed=3)
    seen = seen_exactly(model, made_estimate(model, seed=4), states)
    # A row at a half lies on the other side of the jump a step further on.
    estimate = replace(made_estimate(model, seed=5), shapes=(np.array([0.5 - 1e-6]),))
    line = linearize(model, estimate, seen, conditions(model, estimate, states))
    assert not line.sensitivities[..., -1].any() and line.sensitivities[..., -2].any()
    found = fit(model, seen, NOISE, estimate)
    assert found.held[-1] and found.estimate.shapes[0] == estimate.shapes[0] and found.converged
