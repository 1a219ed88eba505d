"""From a fit to a linear problem: columns are changes of exact predictions, and
coefficients count from zero."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from scipy.stats import chi2, ncx2

from elastocal.diagnosis.candidate_design import (
    build_candidate_design,
    find_smallest_detectable_sizes,
    refine_shapes,
)
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import compute_residuals

SETTINGS = Settings()
KEYS = (
    "joint_offset@2",
    "joint_offset@3",
    "joint_tilt@2",
    "link_elasticity@3",
    "payload",
    "link_geometry@4",
)


@pytest.fixture(scope="module")
def campaign(kuka):
    """A robot whose joint 3 stands half a milliradian off."""
    return planted(kuka, {"joint_offset@3": [5e-4]}, seed=1)


def problem_of(campaign, fitted=None, keys=KEYS, settings=SETTINGS):
    fitted = fitted or campaign.declared
    candidates = [campaign.candidates[key] for key in keys]
    return build_candidate_design(fitted, campaign.observations, candidates, settings)


def with_effect(campaign, key, values):
    """The declared fit's model and estimate with an effect of given size."""
    model = campaign.declared.model.with_effects([campaign.candidates[key]])
    start = campaign.declared.estimate.with_effects([campaign.candidates[key]])
    start.coefficients[-1][:] = values
    return model, start


def unit_of(found, key):
    return next(
        unit
        for unit in found.problem.terms
        if unit.candidate and unit.candidate.key == key
    )


@pytest.mark.parametrize("key", ["joint_offset@2", "joint_tilt@2", "link_elasticity@3"])
def test_a_column_is_the_change_of_the_exact_prediction_at_the_plausible_size(
    campaign, key
):
    """By W'My: the change of W'My is what the column itself has along W, where
    measurements move by what the effect does."""
    found = problem_of(campaign)
    fitted = campaign.declared
    unit = unit_of(found, key)
    step = np.zeros(len(unit.columns))
    step[0] = 1e-3
    model, moved = with_effect(campaign, key, step * unit.sizes)
    off = compute_residuals(model, moved, campaign.observations, fitted.conditions)
    # Robust weights of the fit stay as they are.
    pushed = replace(fitted, estimate=fitted.estimate)
    observations = replace(
        campaign.observations,
        position=campaign.observations.position + (fitted.residual - off),
    )
    after = build_candidate_design(
        pushed, observations, [campaign.candidates[k] for k in KEYS], SETTINGS
    )
    change = after.problem.statistics.score[0] - found.problem.statistics.score[0]
    expected = found.problem.statistics.gram[0][:, unit.columns] @ step
    np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max())


def test_a_problem_about_a_model_with_an_effect_is_the_one_about_the_model_without(
    campaign,
):
    """Coefficients count from zero, not from the fit: what the fit gives to a candidate
    is given back to the measurements."""
    model, start = with_effect(campaign, "joint_offset@3", [0.0])
    noise = campaign.declared.noise
    fitted = fit_model(model, campaign.observations, noise, start)
    assert abs(fitted.effect_values("joint_offset@3")[0][0]) > 4e-4
    keys = ("joint_offset@2", "joint_offset@3", "joint_offset@4")
    one = problem_of(
        campaign, replace(campaign.declared, weights=fitted.weights), keys
    ).problem.statistics
    other = problem_of(campaign, fitted, keys).problem.statistics
    np.testing.assert_allclose(other.gram[0][:3, :3], one.gram[0][:3, :3], rtol=1e-2)
    np.testing.assert_allclose(other.score[0][:3], one.score[0][:3], rtol=1e-2)
    assert one.score[0][1] / np.sqrt(one.gram[0][1, 1]) > 20


def test_the_smallest_size_is_the_first_that_would_be_found_with_a_power_of_a_half(
    campaign,
):
    """Non-centrality equal to the critical value of a chi-square of one degree of
    freedom, at each of the sizes."""
    problem = problem_of(campaign).problem
    gram = problem.statistics.gram.copy()
    scales = SETTINGS.scales
    units = [unit for unit in problem.terms if unit.candidate]
    critical = chi2.isf(SETTINGS.alarm_level / len(units), 1)
    assert ncx2.sf(critical, 1, critical) == pytest.approx(0.5, abs=0.01)
    largest = np.linalg.eigvalsh(gram[0][np.ix_(units[0].columns, units[0].columns)])[
        -1
    ]
    for place, scale in enumerate(scales):
        for factor, shown in ((1.01, place), (0.99, place + 1)):
            scaled = replace(
                problem.statistics, gram=gram * factor * critical / largest / scale**2
            )
            assert find_smallest_detectable_sizes(scaled, units, SETTINGS)[0] == shown


def test_the_shapes_of_the_best_candidates_are_looked_at_more_closely_about_the_best_value_of_each(
    campaign,
):
    """Of laws with a shape that is tried at several values, at a single one, and
    without one."""
    problem = problem_of(
        campaign,
        keys=(
            "setup_step",
            "thermal_growth[time]",
            "link_elasticity@3",
            "joint_offset@3",
        ),
    )
    sizes = {
        ("setup_step", 5): 30.0,
        ("setup_step", 6): 25.0,
        ("thermal_growth[time]", 1): 28.0,
        ("joint_offset@3", 0): 29.0,
    }
    alone = np.zeros(len(problem.problem.terms))
    for (key, place), size in sizes.items():
        numbers = [
            n
            for n, unit in enumerate(problem.problem.terms)
            if unit.candidate and unit.candidate.key == key
        ]
        alone[numbers[place]] = size
    tried = refine_shapes(problem, alone).tried
    found = {
        key: [value for (value,) in values]
        for key, (_, values) in tried.items()
        if values != problem.tried[key][1]
    }
    assert set(found) == {"setup_step", "thermal_growth[time]"}
    closer = np.linspace(5 / 12, 7 / 12, 9)[1:-1]
    np.testing.assert_allclose(
        found["setup_step"], np.unique(np.round([*np.arange(1, 12) / 12, *closer], 12))
    )
    lags = np.geomspace(900.0, 36000.0, 5)
    np.testing.assert_allclose(
        found["thermal_growth[time]"], np.geomspace(lags[1], lags[3], 9)
    )
