"""Frames and targets of other measurements."""

import numpy as np
import pytest
from synthetic import made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.fitting.least_squares import fit, fit_frames
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import select_states
from elastocal.validation.held_out import position_errors
from elastocal.validation.placing import placed_estimate


@pytest.mark.parametrize("rows", [3, 6])
def test_a_session_that_the_fit_has_not_seen_gets_a_frame_of_its_own_and_nothing_else(rows, fanuc):
    model = made_model(fanuc.chain, rows=rows, compliance=fanuc.compliance)
    true = made_estimate(model, (2, 5, 7), seed=3)
    states = made_states(6, 45, seed=4)
    # So few in the new one that a target fitted to them would be another one.
    states.session[:] = np.repeat([2, 5, 7], [20, 3, 22])
    seen = with_noise(seen_exactly(model, true, states), np.random.default_rng(5))
    known = states.session != 5
    fitted = fit(model, select_states(seen, known), Noise("declared", 6e-5, 6e-5, np.zeros(6)))
    placed = placed_estimate(fitted, seen)
    there = fit_frames(fitted, model, select_states(seen, ~known), own_targets=False)
    np.testing.assert_array_equal(there.target_offset, fitted.estimate.target_offset)
    np.testing.assert_array_equal(placed.frame_position[1], there.frame_position[0])
    assert placed.sessions == (2, 5, 7)
    np.testing.assert_array_equal(placed.target_offset, fitted.estimate.target_offset)
    np.testing.assert_array_equal(placed.frame_position[[0, 2]], fitted.estimate.frame_position)
    np.testing.assert_allclose(placed.frame_position[1], true.frame_position[1], atol=4e-4)
    distance = position_errors(model, placed, seen).distance
    assert np.sqrt((distance[~known] ** 2).mean()) < 1.3 * np.sqrt(3) * 6e-5
    if rows == 6:
        turn = placed.frame_rotation[1].T @ true.frame_rotation[1]
        np.testing.assert_allclose(turn, np.eye(3), atol=2e-4)
    assert placed_estimate(fitted, select_states(seen, known)) is fitted.estimate
