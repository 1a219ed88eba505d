"""Equations 12-15: closed forms, and the validation set against exact kinematics."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support import random_loads, without_tool

from elastocal.mechanics.elastostatics import (
    compute_exact_deflections,
    compute_joint_torques,
)
from elastocal.study.metrics import (
    compute_k_sigma,
    compute_mean_deviation,
    compute_position_errors,
    extrapolate_length,
    find_kept_length,
    make_validation_set,
)
from elastocal.study.simulation import compute_true_deflections

RELATIVE_ERRORS = np.array(
    [
        [0.01, -0.02, 0.03, -0.04, 0.05, -0.06],
        [-0.2, 0.1, 0.3, 0.1, -0.3, 0.2],
        [0.0] * 6,
    ]
)


def judge_of(robot, loads=None):
    loads = random_loads(robot, 1, 40) if loads is None else loads
    return make_validation_set(
        robot,
        loads,
        compute_true_deflections(
            robot, loads, robot.chain.end_effector, "end_effector"
        ),
    )


def exact_errors(robot, loads, compliance):
    """Position error of one model: pose by pose, without any linearisation."""
    end = robot.chain.end_effector
    torques = compute_joint_torques(
        robot.chain, loads.joint_angles, loads.wrench, without_tool(end)
    )
    predicted = compute_exact_deflections(
        robot.chain, loads.joint_angles, compliance * torques, end
    )
    truth = compute_true_deflections(robot, loads, end, "end_effector")
    return np.linalg.norm((predicted - truth)[..., :3], axis=-1).ravel()


def test_position_errors_are_those_of_the_exact_kinematics(robot):
    loads = random_loads(robot, 1, 40)
    models = robot.compliance * (1 + RELATIVE_ERRORS)
    errors_by_model = compute_position_errors(judge_of(robot, loads), models)
    assert errors_by_model.shape == (3, 40)
    for model, errors in zip(models[:2], errors_by_model, strict=False):
        expected = exact_errors(robot, loads, model)
        assert errors.mean() == pytest.approx(expected.mean(), rel=1e-3)
        # The prediction is linear; an error of up to a third of the compliance rotates the
        # joints by up to a milliradian more.
        np.testing.assert_allclose(errors, expected, rtol=0, atol=3e-3 * expected.max())
    # The tolerance is the root of the rounding error of squares of 1e-3 m.
    np.testing.assert_allclose(errors_by_model[2], 0, atol=1e-10)


def test_mean_deviation_counts_each_test_configuration_as_often_as_it_weighs(kuka):
    validation = judge_of(kuka)
    models = kuka.compliance * (1 + RELATIVE_ERRORS[[[0, 1], [1, 0]]])
    counts = np.random.default_rng(1).poisson(1.0, (2, 40))
    deviations = compute_mean_deviation(validation, models, counts)
    for group in range(2):
        expected = np.repeat(
            compute_position_errors(validation, models[group]), counts[group], axis=1
        ).mean(axis=1)
        np.testing.assert_allclose(deviations[group], expected, rtol=1e-12)


def test_k_sigma_is_the_signed_sum_over_all_joints_or_some():
    true_compliance = np.array([1.0, 2.0, 4.0])
    compliance = true_compliance / [1.01, 0.97, 1.05]
    assert compute_k_sigma(compliance, true_compliance) == pytest.approx(3.0, rel=1e-10)
    assert compute_k_sigma(compliance, true_compliance, [0, 1]) == pytest.approx(
        -2.0, rel=1e-10
    )
    np.testing.assert_allclose(
        compute_k_sigma(np.stack([compliance, true_compliance]), true_compliance),
        [3.0, 0.0],
        atol=1e-12,
    )


def test_undetermined_values_count_as_above_the_limit():
    lengths = [
        find_kept_length(np.array(values), 1.0)
        for values in ([np.nan, np.nan, 0.1], [np.nan] * 2, [np.inf, -1.0])
    ]
    assert lengths == [3, np.inf, 2]


@pytest.mark.parametrize(
    ("values", "length"),
    [
        ([0.9, 0.8, 0.7], 1),
        ([2.0, 0.9, 1.1, 0.8], 4),
        ([2.0, -0.9, -1.1, -0.8, 0.9], 4),
        ([2.0, 0.9, 1.1], np.inf),
        ([0.9, 0.8, np.nan], np.inf),
    ],
)
def test_a_score_that_leaves_its_limit_again_has_not_kept_it(values, length):
    """The caption of Table 4 promises the number of configurations from which on a score
    stays within its limit."""
    assert find_kept_length(np.array(values), 1.0) == length


@given(
    st.floats(0.1, 1e4),
    st.floats(1e-3, 1e3),
    st.sampled_from([-1.0, 1.0]),
    st.integers(1, 40),
)
def test_lengths_follow_a_bias_over_the_length_to_any_limit(bias, limit, sign, lengths):
    """The values are below the limit from the first whole length above bias / limit on;
    beyond the curve the extrapolated length is bias / limit."""
    values = sign * bias / np.arange(1, lengths + 1)
    crossing = bias / limit
    # If the crossing is exactly at a whole length, rounding decides.
    assume(abs(crossing - np.round(crossing)) > 1e-9 * crossing)
    whole = max(np.ceil(crossing), 1.0)
    reached = whole <= lengths
    assert find_kept_length(values, limit) == (whole if reached else np.inf)
    assert extrapolate_length(values, limit) == pytest.approx(
        whole if reached else crossing, rel=1e-12
    )
