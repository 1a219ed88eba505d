"""Each regression of the catalogue finds the deviations that it describes, and states
its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from made_remainders import NOISE_M, SMOOTH_M, made_inputs, smooth
from sklearn.linear_model import Ridge

from elastocal.residual_model import regressions
from elastocal.residual_model.regressions import REGRESSIONS, Inputs


def fit_first_setting(name, inputs, residual):
    regression = REGRESSIONS[name]
    return next(regression.fit(inputs, residual, regression.settings, 1))


def build_reference_columns(inputs, orders):
    """The columns of ridge harmonics, built again: the Jacobian, and the column of each
    joint times sine and cosine of the multiples of its angle."""
    columns = [inputs.jacobian[:, :, column] for column in range(3)]
    for order in range(1, orders + 1):
        for wave in (np.sin, np.cos):
            columns += [
                inputs.jacobian[:, :, joint]
                * wave(order * inputs.joint_angles[:, [joint]])
                for joint in range(2)
            ]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(("orders", "count"), [(1, 700), (4, 700), (8, 9)])
def test_ridge_harmonics_have_the_penalty_of_ridge_regression_in_each_setting(
    orders, count
):
    """With more observations than a chunk holds, and with fewer rows than columns."""
    inputs, residual = made_inputs(count, seed=1)
    unseen, _ = made_inputs(30, seed=2)
    columns = build_reference_columns(inputs, orders).reshape(3 * count, -1)
    penalty = 0.3
    reference = Ridge(
        alpha=penalty * (columns**2).sum(axis=0).mean(), fit_intercept=False
    ).fit(columns, residual.ravel())
    settings = [
        {"orders": orders, "penalty": 3.0},
        {"orders": orders, "penalty": penalty},
        {"orders": 6, "penalty": penalty},
    ]
    predictors = list(regressions.fit_ridge_harmonics(inputs, residual, settings, 1))
    np.testing.assert_allclose(
        predictors[1].mean(unseen).ravel(),
        build_reference_columns(unseen, orders).reshape(90, -1) @ reference.coef_,
        rtol=1e-8,
        atol=1e-12,
    )


@pytest.mark.parametrize("pair", [(0, 2), (1, 3)])
def test_two_joints_finds_the_pair_of_a_deviation_and_does_not_follow_noise(pair):
    inputs, _ = made_inputs(120, seed=1, joints=4)
    unseen, _ = made_inputs(60, seed=2, joints=4)

    def deviate(inputs):
        first, second = inputs.joint_angles[:, pair].T
        waves = np.sin(first + 0.3) * np.sin(second - 1.0)
        return 3e-4 * inputs.jacobian[:, :, 1] * waves[:, None]

    noise = np.random.default_rng(3).normal(0.0, NOISE_M, (120, 3))
    predicted = fit_first_setting("two_joints", inputs, deviate(inputs) + noise)
    from_noise = fit_first_setting("two_joints", inputs, noise)
    errors = predicted.mean(unseen) - deviate(unseen)
    assert np.sqrt((errors**2).mean()) < 0.7 * NOISE_M
    assert np.sqrt((from_noise.mean(unseen) ** 2).mean()) < 0.7 * NOISE_M


def test_trees_follow_a_step_and_a_seed_repeats_itself():
    inputs, _ = made_inputs(300, seed=1)
    unseen, _ = made_inputs(300, seed=2)

    def step(inputs):
        return 1e-3 * np.repeat(np.sign(inputs.joint_angles[:, :1]), 3, axis=1)

    first, second = (
        fit_first_setting("extra_trees", inputs, step(inputs)) for _ in range(2)
    )
    np.testing.assert_array_equal(first.mean(unseen), second.mean(unseen))
    assert np.isnan(first.std(unseen)).all()
    assert np.sqrt(((first.mean(unseen) - step(unseen)) ** 2).mean()) < 3e-4


def test_a_process_predicts_within_the_noise_with_intervals_that_grow_outside():
    process = fit_first_setting("gaussian_process", *made_inputs(150, seed=1))
    unseen, _ = made_inputs(400, seed=2, width=1.3)
    errors = process.mean(unseen) - smooth(unseen.joint_angles)
    assert np.sqrt((errors**2).mean()) < NOISE_M
    measured = errors + np.random.default_rng(3).normal(0.0, NOISE_M, errors.shape)
    # 1,200 coordinates: the share inside has a standard error of 0.6 %.
    assert 0.92 < (np.abs(measured) < 1.96 * process.std(unseen)).mean() < 0.98
    near, far = (
        Inputs(np.full((1, 2), angle), np.zeros((1, 3)), np.zeros((1, 3, 3)))
        for angle in (0.0, 40.0)
    )
    assert (process.std(far) > 5 * process.std(near)).all()
    # Far from all poses it predicts the mean of the residuals, with a standard deviation
    # as large as theirs.
    assert (process.std(far) > 0.5 * SMOOTH_M).all()
    assert (np.abs(process.mean(far)) < SMOOTH_M).all()
    nothing = unseen.select(slice(0))
    assert process.mean(nothing).shape == process.std(nothing).shape == (0, 3)


def test_a_process_with_few_inducing_points_learns_from_all_observations(monkeypatch):
    """With a tenth of the points, the error stays below half of the error of a process
    that knows only these observations."""
    inputs, residual = made_inputs(400, seed=1)
    unseen, _ = made_inputs(300, seed=2, width=1.3)
    rms = {}
    monkeypatch.setattr(regressions, "_CHUNK", 150)
    for points, count in ((400, 400), (40, 400), (40, 40)):
        monkeypatch.setattr(regressions, "_MAX_INDUCING_POINTS", points)
        process = fit_first_setting(
            "gaussian_process", inputs.select(slice(count)), residual[:count]
        )
        errors = process.mean(unseen) - smooth(unseen.joint_angles)
        rms[points, count] = np.sqrt((errors**2).mean())
    assert rms[40, 400] < 0.5 * rms[40, 40]
    assert rms[40, 400] < 3.0 * rms[400, 400]


@pytest.mark.parametrize("name", list(REGRESSIONS))
def test_a_regression_without_queries_predicts_no_rows(name):
    """A path may have no target within the range of the regression."""
    inputs, residual = made_inputs(60, seed=1)
    predictor = fit_first_setting(name, inputs, residual)
    nowhere = inputs.select(np.zeros(60, bool))
    assert predictor.mean(nowhere).shape == (0, 3)
    assert predictor.std(nowhere).shape == (0, 3)


@pytest.mark.parametrize("name", ["ridge_harmonics", "two_joints"])
def test_inputs_with_parts_are_fitted_as_the_same_observations_at_once(name):
    """The cross-validation adds up the Gram matrices of folds."""
    inputs, residual = made_inputs(700, seed=1, joints=4)
    unseen, _ = made_inputs(30, seed=2, joints=4)
    parts = [inputs.select(slice(0, 600)), inputs.select(slice(600, 700))]
    joined = replace(inputs, parts=tuple(parts))
    # Parts that were fitted before have stored matrices.
    for part, rows in zip(parts, np.split(residual, [600]), strict=True):
        fit_first_setting(name, part, rows)
    at_once, of_parts = (
        fit_first_setting(name, fitted, residual).mean(unseen)
        for fitted in (inputs, joined)
    )
    np.testing.assert_allclose(of_parts, at_once, rtol=1e-9, atol=1e-15)
