"""Columns of a design are changes of exact predictions, and its coefficients count from
zero."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted
from scipy.stats import chi2, ncx2

from elastocal.diagnosis.candidate_design import (
    build_candidate_design,
    explain_untestable,
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


def design_of(campaign, fitted=None, keys=KEYS, observations=None):
    """The design of some candidates about a fit, by default that of the declared
    model."""
    return build_candidate_design(
        fitted or campaign.declared,
        observations or campaign.observations,
        [campaign.candidates[key] for key in keys],
        SETTINGS,
    )


def with_effect(campaign, key, values):
    """The declared fit's model and estimate with an effect of given size."""
    model = campaign.declared.model.with_effects([campaign.candidates[key]])
    estimate = campaign.declared.estimate.with_effects([campaign.candidates[key]])
    estimate.coefficients[-1][:] = values
    return model, estimate


def terms_of(design, key):
    """Terms of one candidate, by their index in the problem."""
    return {
        number: term
        for number, term in enumerate(design.problem.terms)
        if term.candidate and term.candidate.key == key
    }


@pytest.mark.parametrize("key", ["joint_offset@2", "joint_tilt@2", "link_elasticity@3"])
def test_a_column_is_the_change_of_the_exact_prediction_at_the_plausible_size(
    campaign, key
):
    """If the measurements change by what the effect does, the score changes by the
    products of its column with all columns."""
    design = design_of(campaign)
    fitted = campaign.declared
    (term,) = terms_of(design, key).values()
    step = np.zeros(len(term.columns))
    step[0] = 1e-3
    model, estimate = with_effect(campaign, key, step * term.sizes)
    residual = compute_residuals(
        model, estimate, campaign.observations, fitted.conditions
    )
    displacement = fitted.residual - residual
    # The robust weights of the fit stay as they are.
    displaced = replace(
        campaign.observations, position=campaign.observations.position + displacement
    )
    statistics = design.problem.statistics
    changed = design_of(campaign, observations=displaced).problem.statistics
    change = changed.score[0] - statistics.score[0]
    expected = statistics.gram[0][:, term.columns] @ step
    np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max())


def test_a_problem_about_a_model_with_an_effect_is_the_one_about_the_model_without(
    campaign,
):
    """Coefficients count from zero, not from the fit: the contribution that the fit has
    of a candidate is given back to the measurements."""
    model, estimate = with_effect(campaign, "joint_offset@3", [0.0])
    noise = campaign.declared.noise
    fitted = fit_model(model, campaign.observations, noise, estimate)
    assert abs(fitted.effect_values("joint_offset@3")[0][0]) > 4e-4
    keys = ("joint_offset@2", "joint_offset@3", "joint_offset@4")
    declared = replace(campaign.declared, weights=fitted.weights)
    about_declared = design_of(campaign, declared, keys).problem.statistics
    about_fitted = design_of(campaign, fitted, keys).problem.statistics
    gram = about_declared.gram[0][:3, :3]
    score = about_declared.score[0][:3]
    np.testing.assert_allclose(about_fitted.gram[0][:3, :3], gram, rtol=1e-2)
    np.testing.assert_allclose(about_fitted.score[0][:3], score, rtol=1e-2)
    assert score[1] / np.sqrt(gram[1, 1]) > 20


def test_an_effect_that_stays_as_fitted_is_neither_given_back_nor_fitted_again(
    campaign,
):
    key = "joint_offset@3"
    model, estimate = with_effect(campaign, key, [0.0])
    noise = campaign.declared.noise
    fitted = fit_model(model, campaign.observations, noise, estimate)
    design = build_candidate_design(
        fitted,
        campaign.observations,
        [campaign.candidates[key]],
        SETTINGS,
        fixed_keys=frozenset({key}),
    )
    rows = design.whitened.rows
    np.testing.assert_allclose(rows.residual, fitted.whiten(fitted.residual))
    assert rows.declared.shape[2] == len(fitted.parameters) - 1
    statistics = design.problem.statistics
    standard_errors = statistics.score[0][0] / np.sqrt(statistics.gram[0][0, 0])
    assert abs(standard_errors) < 5


def test_a_design_without_rows_keeps_its_results(campaign):
    design = design_of(campaign)
    assert design.problem.initial_search.log_odds
    released = design.without_rows
    assert released.problem.statistics is design.problem.statistics
    assert released.problem.terms is design.problem.terms
    # The first search has statistics and models of its own, which nothing needs.
    assert "initial_search" not in vars(released.problem)
    assert released.pose_std_error_rad == design.pose_std_error_rad
    assert released.untestable == design.untestable
    assert len(released.products.rows.residual) == 0


def test_the_smallest_size_is_the_first_that_would_be_found_with_a_power_of_a_half(
    campaign,
):
    """The non-centrality is then the critical value of a chi-square of one degree of
    freedom, at each of the scales."""
    problem = design_of(campaign).problem
    terms = [term for term in problem.terms if term.candidate]
    critical = chi2.isf(SETTINGS.detection_level / len(terms), 1)
    assert ncx2.sf(critical, 1, critical) == pytest.approx(0.5, abs=0.01)
    gram = problem.statistics.gram.copy()
    columns = terms[0].columns
    largest = np.linalg.eigvalsh(gram[0][np.ix_(columns, columns)])[-1]
    for index, scale in enumerate(SETTINGS.scales):
        for factor, expected in ((1.01, index), (0.99, index + 1)):
            scaled = replace(
                problem.statistics, gram=gram * factor * critical / largest / scale**2
            )
            smallest = find_smallest_detectable_sizes(scaled, terms, SETTINGS)
            assert smallest[0] == expected


def test_the_shapes_of_the_best_candidates_are_refined_about_the_best_value_of_each(
    campaign,
):
    """For candidates with a shape that is tried at several values, at a single one, and
    without a shape."""
    keys = ("setup_step", "thermal_growth[time]", "link_elasticity@3", "joint_offset@3")
    design = design_of(campaign, keys=keys)
    log_bayes_factors = np.zeros(len(design.problem.terms))
    for key, variant, value in (
        ("setup_step", 5, 30.0),
        ("setup_step", 6, 25.0),
        ("thermal_growth[time]", 1, 28.0),
        ("joint_offset@3", 0, 29.0),
    ):
        number = list(terms_of(design, key))[variant]
        log_bayes_factors[number] = value
    refined = {}
    for key, (_, values) in refine_shapes(design, log_bayes_factors).tried.items():
        if values != design.tried[key][1]:
            refined[key] = np.ravel(values)
    assert set(refined) == {"setup_step", "thermal_growth[time]"}
    closer = np.linspace(5 / 12, 7 / 12, 9)[1:-1]
    expected_steps = np.unique(np.round([*np.arange(1, 12) / 12, *closer], 12))
    np.testing.assert_allclose(refined["setup_step"], expected_steps)
    lags = np.geomspace(900.0, 36000.0, 5)
    expected_lags = np.geomspace(lags[1], lags[3], 9)
    np.testing.assert_allclose(refined["thermal_growth[time]"], expected_lags)


def test_without_any_load_the_load_on_the_joints_is_no_further_reason(campaign):
    lost_motion = campaign.candidates["lost_motion@2"]
    angles = np.zeros((3, 6))
    reason = explain_untestable(lost_motion, frozenset(), angles)
    assert reason == "no load in the data"
    only_weight = explain_untestable(lost_motion, frozenset({"load"}), angles)
    assert only_weight == "no load on the joints in the data"
