"""A fit of more than is held at once is the same."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import TARGETS, model_of
from planted import two_loads_a_pose
from synthetic import NOISE, made_estimate, seen_exactly, with_noise

from elastocal.fitting.least_squares import fit


@pytest.mark.parametrize("joint_rad", [0.0, 2e-5])
def test_a_fit_of_more_states_than_are_kept_is_the_same_and_keeps_no_jacobian(fanuc, monkeypatch, joint_rad):
    model = model_of(fanuc, "joint_offset@3", "stiffening@2", targets=TARGETS)
    seen = with_noise(
        seen_exactly(model, made_estimate(model, seed=64), two_loads_a_pose(6, 20, seed=65)), np.random.default_rng(66)
    )
    noise = replace(NOISE, joint_rad=np.full(6, joint_rad))
    kept = fit(model, seen, noise)
    monkeypatch.setattr("elastocal.fitting.memory._MOST_STATES", 10)
    monkeypatch.setattr("elastocal.fitting.memory._MOST_AT_ONCE", 16)
    monkeypatch.setattr("elastocal.fitting.memory._MOST_HELD", 16 * 180)
    found = fit(model, seen, noise)
    assert kept.joint_jacobian is not None and found.joint_jacobian is None and found.conditions is None
    deviation = np.sqrt(np.diag(kept.covariance))
    values = [np.concatenate(each.estimate.coefficients) for each in (kept, found)]
    assert (np.abs(values[0] - values[1]) < 2e-3 * deviation[-len(values[0]) :]).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviation, rtol=1e-4)
    parts = [list(each.sensitivities(seen)) for each in (kept, found)]
    assert len(parts[1]) > 1
    for number in (1, 2):
        one, other = (np.concatenate([part[number] for part in each]) for each in parts)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.abs(one).max())
