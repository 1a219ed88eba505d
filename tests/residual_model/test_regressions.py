"""Each regression of the catalogue finds what it is made for, and says how sure it
is."""

import numpy as np
import pytest
from made_remainders import NOISE_M, SMOOTH_M, made_inputs, smooth
from sklearn.linear_model import Ridge

from elastocal.residual_model import regressions
from elastocal.residual_model.regressions import REGRESSIONS, Inputs


def fitted(name, inputs, residual):
    return next(
        REGRESSIONS[name].fitted(inputs, residual, REGRESSIONS[name].settings, 1)
    )


def columns(inputs, orders):
    """Columns written down anew: the Jacobian, and that of a joint times sine and
    cosine of its angle's multiples."""
    found = [inputs.jacobian[:, :, j] for j in range(3)]
    for order in range(1, orders + 1):
        for wave in (np.sin, np.cos):
            found += [
                inputs.jacobian[:, :, j] * wave(order * inputs.joint_angles[:, [j]])
                for j in range(2)
            ]
    return np.stack(found, axis=-1)


@pytest.mark.parametrize("orders", [1, 4])
def test_the_penalty_is_that_of_ridge_regression_and_settings_do_not_mix(orders):
    """Of more observations than are looked at at once."""
    (inputs, residual), (there, _) = made_inputs(700, seed=1), made_inputs(30, seed=2)
    waves = columns(inputs, orders).reshape(2100, -1)
    penalty = 0.3
    alone = Ridge(
        alpha=penalty * (waves**2).sum(axis=0).mean(), fit_intercept=False
    ).fit(waves, residual.ravel())
    settings = [
        {"orders": each, "penalty": other}
        for each, other in ((orders, 3.0), (orders, penalty), (6, penalty))
    ]
    found = list(regressions.fit_ridge_harmonics(inputs, residual, settings, 1))[
        1
    ].mean(there)
    np.testing.assert_allclose(
        found.ravel(),
        columns(there, orders).reshape(90, -1) @ alone.coef_,
        rtol=1e-8,
        atol=1e-12,
    )


@pytest.mark.parametrize("pair", [(0, 2), (1, 3)])
def test_a_deviation_by_two_angles_is_found_among_all_pairs_and_noise_is_not_followed(
    pair,
):
    (inputs, _), (there, _) = (
        made_inputs(120, seed=1, joints=4),
        made_inputs(60, seed=2, joints=4),
    )

    def off(some):
        one, other = some.joint_angles[:, pair].T
        return (
            3e-4
            * some.jacobian[:, :, 1]
            * (np.sin(one + 0.3) * np.sin(other - 1.0))[:, None]
        )

    noise = np.random.default_rng(3).normal(0.0, NOISE_M, (120, 3))
    found, nothing = (
        fitted("two_joints", inputs, each).mean(there)
        for each in (off(inputs) + noise, noise)
    )
    assert np.sqrt(((found - off(there)) ** 2).mean()) < 0.7 * NOISE_M
    assert np.sqrt((nothing**2).mean()) < 0.7 * NOISE_M


def test_trees_follow_a_step_and_a_seed_repeats_itself():
    (inputs, _), (there, _) = made_inputs(300, seed=1), made_inputs(300, seed=2)

    def step(some):
        return 1e-3 * np.repeat(np.sign(some.joint_angles[:, :1]), 3, axis=1)

    first, second = (fitted("extra_trees", inputs, step(inputs)) for _ in range(2))
    np.testing.assert_array_equal(first.mean(there), second.mean(there))
    assert np.isnan(first.std(there)).all()
    assert np.sqrt(((first.mean(there) - step(there)) ** 2).mean()) < 3e-4


def test_a_process_predicts_within_the_noise_and_its_intervals_hold_and_grow_outside_up_to_the_size_of_the_residuals():
    process = fitted("gaussian_process", *made_inputs(150, seed=1))
    there, _ = made_inputs(400, seed=2, width=1.3)
    off = process.mean(there) - smooth(there.joint_angles)
    assert np.sqrt((off**2).mean()) < NOISE_M
    measured = off + np.random.default_rng(3).normal(0.0, NOISE_M, off.shape)
    # 1,200 coordinates: the share inside has a standard error of 0.6 %.
    assert 0.92 < (np.abs(measured) < 1.96 * process.std(there)).mean() < 0.98
    near, far = (
        Inputs(np.full((1, 2), angle), np.zeros((1, 3)), np.zeros((1, 3, 3)))
        for angle in (0.0, 40.0)
    )
    assert (process.std(far) > 5 * process.std(near)).all()
    # There it says the mean of the residuals, and that it may be wrong by all that they
    # vary.
    assert (process.std(far) > 0.5 * SMOOTH_M).all() and (
        np.abs(process.mean(far)) < SMOOTH_M
    ).all()
    none = there.select(slice(0))
    assert process.mean(none).shape == process.std(none).shape == (0, 3)


def test_a_process_with_values_at_few_places_still_learns_from_all_observations(
    monkeypatch,
):
    """A tenth of the places: the error stays half of that of a process that knows these
    observations alone."""
    (inputs, residual), (there, _), found = (
        made_inputs(400, seed=1),
        made_inputs(300, seed=2, width=1.3),
        {},
    )
    monkeypatch.setattr(regressions, "_AT_ONCE", 150)
    for most, count in ((400, 400), (40, 400), (40, 40)):
        monkeypatch.setattr(regressions, "_MOST", most)
        process = fitted(
            "gaussian_process", inputs.select(slice(count)), residual[:count]
        )
        found[most, count] = np.sqrt(
            ((process.mean(there) - smooth(there.joint_angles)) ** 2).mean()
        )
    assert (
        found[40, 400] < 0.5 * found[40, 40] and found[40, 400] < 3.0 * found[400, 400]
    )
