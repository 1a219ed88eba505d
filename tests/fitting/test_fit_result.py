"""What is asked of a fit: its values by effect, whitened rows, and sensitivities in parts of whole poses."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import TARGETS, model_of
from planted import two_loads_a_pose
from synthetic import made_estimate, seen_exactly, with_noise

from elastocal.fitting import fit_result
from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise

# Of the sensor and of the joints, so that whitening takes a Jacobian.
NOISE = Noise("repeats", 60e-6, 40e-6, np.full(6, 2e-5))


@pytest.fixture(scope="module")
def fitted(fanuc):
    """Twelve poses with two loads and two targets each, and two measurements far off."""
    model = model_of(fanuc, "joint_offset@3", "stiffening@2", targets=TARGETS)
    seen = seen_exactly(model, made_estimate(model, seed=11), two_loads_a_pose(6, 12, seed=12))
    seen = with_noise(seen, np.random.default_rng(13))
    seen.position[[5, 20]] += 3e-3
    return fit(model, seen, NOISE), seen


def gathered(found, observations):
    """Plain and whitened sensitivities of all parts, and the observations of each."""
    parts = list(found.sensitivities(observations))
    plain, white = (np.concatenate([part[number] for part in parts]) for number in (1, 2))
    return plain, white, [np.arange(len(observations))[part[0]] for part in parts]


def test_values_are_those_of_the_effect_asked_for(fitted):
    found, _ = fitted
    values = {"coefficients": (np.array([0.25]), np.array([1.5])), "shapes": (np.zeros(0), np.array([300.0]))}
    made = replace(found, estimate=replace(found.estimate, **values))
    assert [part.tolist() for part in made.values_of("joint_offset@3")] == [[0.25], []]
    assert [part.tolist() for part in made.values_of("stiffening@2")] == [[1.5], [300.0]]
    with pytest.raises(ValueError, match="hysteresis"):
        made.values_of("hysteresis@1")


def test_whitened_sensitivities_are_the_plain_ones_weighted_and_whitened_as_in_the_fit(fitted):
    found, seen = fitted
    plain, white, _ = gathered(found, seen)
    assert found.weights[[5, 20]].max() < 0.2
    np.testing.assert_allclose(white, found.whitened(plain), rtol=1e-9, atol=1e-9 * np.abs(white).max())


def test_the_inverse_of_the_products_of_whitened_sensitivities_is_the_covariance(fitted):
    found, seen = fitted
    _, white, _ = gathered(found, seen)
    free = ~found.held
    rows = white.reshape(-1, len(free))[:, free]
    expected = np.linalg.inv(rows.T @ rows)
    deviation = np.sqrt(np.diag(expected))
    scaled = (found.covariance[np.ix_(free, free)] - expected) / np.outer(deviation, deviation)
    # The covariance is that of the last step, a thousandth of a standard error away.
    np.testing.assert_allclose(scaled, 0.0, atol=1e-3)
    assert not found.covariance[found.held].any()


@pytest.mark.parametrize("most", [1, 9, 10_000])
def test_parts_are_whole_poses_and_hold_each_observation_once(fitted, monkeypatch, most):
    found, seen = fitted
    whole = gathered(found, seen)
    monkeypatch.setattr(fit_result, "observations_at_once", lambda rows, columns: most)
    plain, white, members = gathered(found, seen)
    assert (len(members) > 1) == (most < len(seen))
    np.testing.assert_array_equal(np.concatenate(members), np.arange(len(seen)))
    poses = [set(seen.cluster[part]) for part in members]
    assert sum(map(len, poses)) == len(set().union(*poses)) == 12
    np.testing.assert_allclose(plain, whole[0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(white, whole[1], rtol=1e-9, atol=1e-9 * np.abs(white).max())
