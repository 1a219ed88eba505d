"""The exact fit of a selected model, and averages over models: those of dense Bayesian
regressions, pooled."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.refit import fit_selected_effects, select_effects
from elastocal.diagnosis.search import search_models
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import linearize

SETTINGS = Settings()


@pytest.fixture(scope="module")
def found(kuka):
    """A robot with an offset of joint 3, offsets of joint 2 declared, and what the
    search makes of it."""
    campaign = planted(
        kuka, {"joint_offset@3": [5e-4], "joint_offset@2": [3e-4]}, seed=1
    )
    known = campaign.candidates["joint_offset@2"]
    model = campaign.declared.model.with_effects([known])
    start = campaign.declared.estimate.with_effects([known])
    declared = fit_model(model, campaign.observations, campaign.declared.noise, start)
    candidates = [
        candidate
        for candidate in campaign.all_candidates
        if candidate.effect != "joint_offset"
    ]
    candidates.append(replace(campaign.candidates["joint_offset@3"], effect="offset"))
    problem = build_candidate_design(
        declared, campaign.observations, candidates, SETTINGS
    )
    models = search_models(problem.problem)
    return campaign, declared, problem, models


def test_priors_arrive_in_the_fit(found):
    campaign, declared, line, models = found
    best = models.models[0]
    assert [line.problem.units[number].candidate.key for number in best.units] == [
        "offset@3"
    ]
    chosen = select_effects(line, best)
    (effect, shapes), *others = chosen
    assert not others and shapes.size == 0
    final = fit_selected_effects(
        declared, campaign.observations, declared.noise, chosen
    )
    priors = {
        owner: parameter.prior_std
        for owner, parameter in final.parameters
        if "offset@" in owner
    }
    plausible = effect.parameters[0].plausible
    assert priors["joint_offset@2"] is None and priors["offset@3"] == pytest.approx(
        best.scales[0] * plausible, rel=1e-12
    )
    assert best.scales[0] in SETTINGS.scales
    # And do what a prior does: information of the measurements and of the prior add up.
    about = linearize(
        final.model, final.estimate, campaign.observations, final.conditions
    )
    left = final.whiten(about.sensitivities).reshape(-1, len(final.parameters))
    precision = np.array(
        [0.0 if p.prior_std is None else p.prior_std**-2 for _, p in final.parameters]
    )
    expected = np.linalg.inv(left.T @ left + np.diag(precision))
    np.testing.assert_allclose(np.diag(final.covariance), np.diag(expected), rtol=1e-2)


def test_no_effect_is_fitted_under_a_wider_prior_than_it_had_before_the_measurements(
    found,
):
    _, _, line, models = found
    best = models.models[0]
    unit = line.problem.terms[best.term_indices[0]]
    before = line.problem.grid.root_mean_square(unit)
    sizes = [0.5 * before, before, SETTINGS.scales[-1]]
    assert before < SETTINGS.scales[-1]
    chosen = [
        select_effects(line, replace(best, scales=np.array([size])))[0][0]
        for size in sizes
    ]
    deviations = [
        candidate.parameters[0].prior_std / unit.sizes[0] for candidate in chosen
    ]
    np.testing.assert_allclose(deviations, [0.5 * before, before, before], rtol=1e-12)
