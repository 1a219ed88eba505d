"""Normal equations by central differences of the weighted squares."""

import numpy as np
import pytest
from fitted_models import TARGETS, model_of
from synthetic import made_estimate, made_states, seen_exactly, with_noise

from elastocal.fitting.displacement import conditions
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import Parts
from elastocal.fitting.parameters import parameters, stepped


@pytest.mark.parametrize("rows", [3, 6])
def test_a_step_goes_by_the_slope_of_what_it_is_judged_by(fanuc, rows):
    """Errors that differ much by direction, and residuals far beyond them: central differences of the weighted squares."""
    model = model_of(fanuc, "joint_offset@2", "link_geometry@3", targets=TARGETS, rows=rows)
    estimate = made_estimate(model, seed=80)
    exact = seen_exactly(model, estimate, made_states(6, 12, seed=81))
    seen = with_noise(exact, np.random.default_rng(82), 2e-3, 2e-3)
    noise = Noise("declared", 5e-6, 1e-5, 1e-6 * np.array([40.0, 15, 15, 30, 45, 220]))
    plausible = np.array([parameter.plausible for _, parameter in parameters(model, estimate)])
    measurements = Parts(model, seen, noise, conditions(model, estimate, seen.states), plausible)
    measurements.linearize(estimate)
    measurements.whiten()
    weights = np.random.default_rng(83).uniform(0.3, 1.0, len(seen))
    gram, along = measurements.normal_equations(weights)
    for number, unit in enumerate(np.diag(1e-2 / np.sqrt(np.diag(gram)))):
        ends = [measurements.squares(weights, stepped(model, estimate, sign * unit * plausible)) for sign in (-1, 1)]
        size = unit[number]
        # Of what the residual and the sensitivity could make at most.
        assert (ends[0] - ends[1]) / (4 * size) == pytest.approx(
            along[number], abs=2e-5 * np.sqrt(gram[number, number] * measurements.squares(weights))
        )
