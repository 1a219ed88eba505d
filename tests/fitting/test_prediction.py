"""Predictions and residuals: what was added to exact measurements comes back, in base axes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, chain_of
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.linearization import linearize
from elastocal.fitting.prediction import conditions, residuals


def test_residual_is_what_was_added_to_the_measurements_seen_in_base_axes(full_case):
    model, estimate, seen = full_case
    around = conditions(model, estimate, seen.states)
    np.testing.assert_allclose(residuals(model, estimate, seen, around), 0.0, atol=1e-14)
    rng = np.random.default_rng(3)
    shift, turn = 1e-3 * rng.standard_normal((2, len(seen), 3))
    moved = replace(seen, position=seen.position + shift)
    if model.rows == 6:
        moved = replace(moved, rotation=Rotation.from_rotvec(turn).as_matrix() @ seen.rotation)
    into_base = estimate.frame_rotation[seen.states.session[seen.state] // 4].transpose(0, 2, 1)
    expected = [(into_base @ part[..., None])[..., 0] for part in (shift, turn)[: model.rows // 3]]
    found = residuals(model, estimate, moved, around)
    np.testing.assert_allclose(found, np.concatenate(expected, axis=1), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(linearize(model, estimate, moved, around).residual, found)


@pytest.mark.parametrize("name", OTHER_CHAINS)
def test_effects_at_zero_leave_the_declared_model(name):
    chain = chain_of(OTHER_CHAINS[name])
    model = made_model(chain, rows=6)
    estimate, states = made_estimate(model, seed=8), made_states(chain.coordinates, 4, seed=9)
    effects = tuple(candidates_on(model.sites).values())
    more, same = model.with_effects(effects), estimate.with_effects(effects)
    seen = seen_exactly(model, estimate, states)
    np.testing.assert_allclose(residuals(more, same, seen, conditions(more, same, states)), 0.0, atol=1e-14)
