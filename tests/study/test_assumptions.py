"""Geometry and elasticity together: closed forms against simulated estimates and finite differences."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of
from made_study_blocks import compliances, deflections_of, experiments_of, identified, judge
from statsmodels.api import WLS
from support import random_loads

from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.elastostatics import with_tube
from elastocal.mechanics.kinematics import poses
from elastocal.study.assumptions import (
    AT_ONCE,
    DIFFERENCES,
    IN_TURN,
    NO_ELASTICITY,
    NO_GEOMETRY,
    diameter_for_mean_deflection,
    expected_errors,
    geometry_columns,
    geometry_rows,
    linear_estimators,
    noise_and_leak,
    tube_blocks,
    weighting_rows,
)
from elastocal.study.metrics import position_errors
from elastocal.study.simulation import true_deflections

NOISE = 1e-3


@pytest.fixture(scope="module")
def made():
    """Random columns of 4 geometric parameters and 2 compliances in 12 rows; moments by each estimator."""
    rng = np.random.default_rng(1)
    geometry, elasticity = rng.standard_normal((2, 12, 4)), rng.standard_normal((2, 12, 2))
    root = rng.standard_normal((9, 6))
    compliance, std, moment = np.array([0.5, 0.2]), np.array([0.1, 0.2, 0.1, 0.3]), root.T @ root
    model, estimators = linear_estimators(geometry, elasticity)
    truth = np.concatenate([std, compliance])
    found = {name: noise_and_leak(estimator, model, NOISE, truth, 4) for name, estimator in estimators.items()}
    return geometry, elasticity, compliance, std, moment, found


def test_columns_are_derivatives_by_joint_angles_and_lengths():
    text, lengths = "Tz(l1) Rz(q1) Tx(l2) Ry(q2) Tx(l3) [6DoF]", {"l1": 0.6, "l2": 0.3, "l3": 0.8}
    chain, angles = parse_chain(text, lengths, "x"), np.array([[0.3, -0.7]])
    columns = geometry_columns(chain, angles)[0]
    assert columns.shape == (6, 5)
    for place, name in enumerate(lengths):
        sides = [
            poses(changed, angles, changed.end_effector)[0][0]
            for changed in (parse_chain(text, lengths | {name: lengths[name] + step}, "x") for step in (1e-5, -1e-5))
        ]
        np.testing.assert_allclose(columns[:3, 2 + place], (sides[0] - sides[1]) / 2e-5, atol=1e-8)
    for joint in range(2):
        sides = [poses(chain, angles + step * np.eye(2)[joint], chain.end_effector)[0][0] for step in (1e-5, -1e-5)]
        np.testing.assert_allclose(columns[:3, joint], (sides[0] - sides[1]) / 2e-5, atol=1e-8)


def test_at_once_is_best_and_differences_have_twice_the_variance(made):
    _, elasticity, _, _, moment, found = made
    noise = {name: (moment * spread).sum() for name, (spread, _) in found.items()}
    assert noise[AT_ONCE] <= noise[IN_TURN] and noise[AT_ONCE] <= noise[DIFFERENCES]
    variances = [2 * NOISE**2 * np.diag(np.linalg.inv(columns.T @ columns)) for columns in elasticity]
    np.testing.assert_allclose(np.diag(found[DIFFERENCES][0])[4:], np.mean(variances, axis=0), rtol=1e-9)


def test_leaks_are_what_simulated_fits_without_the_other_make(made):
    """Fits without noise to 4,000 robots: their mean squares have an error of 3 %."""
    geometry, elasticity, compliance, std, _, found = made
    errors = np.random.default_rng(2).standard_normal((4000, 4)) * std
    squares = []
    for G, A in zip(geometry, elasticity, strict=True):
        loaded = errors @ G.T + A @ compliance
        fitted = np.linalg.lstsq(A, loaded.T, rcond=None)[0].T
        squares.append(((fitted - compliance) ** 2).mean(axis=0))
    np.testing.assert_allclose(np.diag(found[NO_GEOMETRY][1])[4:], np.mean(squares, axis=0), rtol=0.1)
    zeros = []
    for G, A in zip(geometry, elasticity, strict=True):
        fitted = np.linalg.lstsq(np.concatenate([G, G]), np.concatenate([np.zeros(12), A @ compliance]), rcond=None)[0]
        zeros.append(fitted[:2] ** 2)
    np.testing.assert_allclose(np.diag(found[NO_ELASTICITY][1])[:2], np.mean(zeros, axis=0), rtol=1e-9)


def test_the_prediction_is_judged_with_all_that_is_wrong_together(made):
    """The leak of geometry alone: all compliances are missed, each data set has its own joint zeros."""
    geometry, elasticity, compliance, _, moment, found = made
    total = []
    for G, A in zip(geometry, elasticity, strict=True):
        fitted = np.linalg.lstsq(np.concatenate([G, G]), np.concatenate([np.zeros(12), A @ compliance]), rcond=None)[0]
        wrong = np.concatenate([fitted, -compliance])
        total.append(wrong @ moment @ wrong)
    assert (moment * found[NO_ELASTICITY][1]).sum() == pytest.approx(np.mean(total), rel=1e-9)


@pytest.fixture(scope="module")
def made_of_weighting():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((5, 3))
    return rng.standard_normal((2, 30, 3)), rng.uniform(0.5, 4.0, (2, 30)), root.T @ root


def test_equal_weights_leave_what_simulated_least_squares_leave(made_of_weighting):
    """20,000 fits a data set: 1 % in the mean square."""
    regressor, deviation, moment = made_of_weighting
    squares = []
    for A, std in zip(regressor, deviation, strict=True):
        noise = std[:, None] * np.random.default_rng(2).standard_normal((30, 20_000))
        wrong = np.linalg.lstsq(A, noise, rcond=None)[0]
        squares.append((wrong * (moment @ wrong)).sum(axis=0).mean())
    assert expected_errors(regressor, deviation, moment)[0] == pytest.approx(np.sqrt(np.mean(squares)), rel=0.02)


def test_weights_of_the_noise_leave_the_covariance_of_weighted_least_squares(made_of_weighting):
    regressor, deviation, moment = made_of_weighting
    squares = [
        (moment * WLS(np.zeros(30), A, weights=std**-2.0).fit().normalized_cov_params).sum()
        for A, std in zip(regressor, deviation, strict=True)
    ]
    assert expected_errors(regressor, deviation, moment)[1] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_diameter_is_found_back_from_the_mean_that_it_causes(kuka_extended):
    loads, tube = random_loads(kuka_extended, 1, 20), kuka_extended.links[0].tube
    for diameter in (0.18, 0.31):
        robot = with_tube(kuka_extended, replace(tube, outer_diameter_m=diameter))
        deflection = true_deflections(robot, loads, robot.chain.end_effector, "end_effector")
        mean = np.linalg.norm(deflection[..., :3], axis=-1).mean()
        # The search stops at a micrometre.
        assert diameter_for_mean_deflection(kuka_extended, loads, mean) == pytest.approx(diameter, abs=3e-6)


def test_geometry_known_or_not(kuka):
    table = pd.DataFrame(geometry_rows(few_of(kuka), zero_rad=1e-3, length_m=5e-4)).set_index("estimator")
    assert len(table) == 5
    identified = table.loc[["at once", "compliances from differences"]]
    assert not identified.leak.any() and identified.noise["at once"] < identified.noise["compliances from differences"]
    # Millimetres by a robot that is off by milliradians.
    assert 1e-3 < table.leak["compliances from loaded poses alone"] < 1e-2
    assert table.zero_leak["compliances from loaded poses alone"] == pytest.approx(1e-3)


def test_the_equal_weights_of_the_paper_cost_nothing_in_the_papers_case_alone(kuka):
    table = weighting_rows(few_of(kuka), orientation_ratios=[0.2, 1.0], tracker_m=[4, 0, 1], per_metre=[0.0, 1e-4])
    ratio = table["equal"] / table["weighted"]
    np.testing.assert_array_equal(table["orientation_ratio"], [0.2, 1, 1, 1])
    np.testing.assert_array_equal(table["per_metre"], [0, 0, 0, 1e-4])
    assert ratio[[1, 2]] == pytest.approx([1, 1]) and (ratio[[0, 3]] > 1.05).all()


def test_thicker_tubes_bend_less_and_leave_less_to_what_joints_cannot_explain(kuka_extended):
    found = list(tube_blocks(few_of(kuka_extended), [0.8, 1.0, 1.25], 10))
    for name in ("mean", "maximum", "left"):
        assert np.all(np.diff([block[name].mean() for block in found]) < 0), name
    assert found[0]["diameter"][0] == pytest.approx(0.8 * kuka_extended.links[0].tube.outer_diameter_m)


def test_the_diameter_of_the_file_gives_the_deflections_and_errors_of_the_pipeline(kuka_extended, strategies):
    study = few_of(kuka_extended)
    study = replace(study, size=replace(study.size, noise=0.0))
    (block,) = tube_blocks(study, [1.0], 20)
    experiments = experiments_of(kuka_extended, 6, 20)
    deflections = deflections_of(kuka_extended, experiments)
    (end,) = deflections["6DoF"]
    size = np.sqrt(end["dx"] ** 2 + end["dy"] ** 2 + end["dz"] ** 2).reshape(6, 20)
    np.testing.assert_allclose(block["mean"], size.mean(axis=1), rtol=1e-9)
    models = compliances(identified(kuka_extended, strategies["6DoF"], experiments, deflections), 20)
    np.testing.assert_allclose(block["left"], (position_errors(judge(kuka_extended), models) ** 2).mean(axis=1), rtol=1e-6)
