"""Tests of the exact fit of a selected model: the priors of the selection are those of
the fit."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.refit import (
    estimate_sensor_noise,
    fit_selected_effects,
    select_effects,
)
from elastocal.diagnosis.search import search_models
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import linearize

SETTINGS = Settings()


@pytest.fixture(scope="module")
def search(kuka):
    """Campaign of a robot with zero errors of joints 2 and 3, of which that of joint 2
    is declared; the declared fit, the design of the candidates and the best model."""
    campaign = planted(
        kuka, {"joint_offset@3": [5e-4], "joint_offset@2": [3e-4]}, seed=1
    )
    declared_effect = campaign.candidates["joint_offset@2"]
    model = campaign.declared.model.with_effects([declared_effect])
    start = campaign.declared.estimate.with_effects([declared_effect])
    declared = fit_model(model, campaign.observations, campaign.declared.noise, start)
    candidates = [
        candidate
        for candidate in campaign.all_candidates
        if candidate.effect != "joint_offset"
    ]
    candidates.append(replace(campaign.candidates["joint_offset@3"], effect="offset"))
    design = build_candidate_design(
        declared, campaign.observations, candidates, SETTINGS
    )
    best = search_models(design.problem).models[0]
    return campaign, declared, design, best


def test_the_exact_fit_has_the_priors_of_the_selection(search):
    campaign, declared, design, best = search
    (index,) = best.term_indices
    assert design.problem.terms[index].candidate.key == "offset@3"
    effects = select_effects(design, best)
    ((effect, shapes),) = effects
    assert shapes.size == 0
    final = fit_selected_effects(
        declared, campaign.observations, declared.noise, effects
    )
    priors = {
        owner: parameter.prior_std
        for owner, parameter in final.parameters
        if "offset@" in owner
    }
    assert best.scales[0] in SETTINGS.scales
    assert priors["joint_offset@2"] is None
    assert priors["offset@3"] == pytest.approx(
        best.scales[0] * effect.parameters[0].plausible, rel=1e-12
    )
    # The covariance shows that the prior counts: the information of the measurements
    # and that of the prior add up.
    linear_model = linearize(
        final.model, final.estimate, campaign.observations, final.conditions
    )
    sensitivities = final.whiten(linear_model.sensitivities)
    rows = sensitivities.reshape(-1, len(final.parameters))
    prior_precision = np.array(
        [0.0 if p.prior_std is None else p.prior_std**-2 for _, p in final.parameters]
    )
    expected = np.linalg.inv(rows.T @ rows + np.diag(prior_precision))
    np.testing.assert_allclose(np.diag(final.covariance), np.diag(expected), rtol=1e-2)


def test_no_prior_of_the_fit_is_wider_than_before_the_measurements(search):
    _, _, design, best = search
    term = design.problem.terms[best.term_indices[0]]
    before = design.problem.grid.root_mean_square(term)
    assert before < SETTINGS.scales[-1]
    prior_stds = []
    for size in (0.5 * before, before, SETTINGS.scales[-1]):
        model = replace(best, scales=np.array([size]))
        ((effect, _),) = select_effects(design, model)
        prior_stds.append(effect.parameters[0].prior_std / term.sizes[0])
    np.testing.assert_allclose(prior_stds, [0.5 * before, before, before], rtol=1e-12)


@pytest.mark.parametrize(("scatter", "factor"), [(3.0, 3.0), (0.2, 1.0)])
def test_noise_from_the_sensor_alone_has_the_size_of_the_residual(
    search, scatter, factor
):
    """It is no smaller than the noise that was measured."""
    campaign, declared, _, _ = search
    noise = replace(declared.noise, joint_rad=np.full(6, 1e-4), pose_rad=1e-4)
    stream = np.random.default_rng(4)
    residual = stream.normal(0.0, scatter * noise.position_m, declared.residual.shape)
    fitted = replace(
        declared,
        noise=noise,
        residual=residual / np.sqrt(campaign.observations.states.repeats[0]),
        weights=np.ones_like(declared.weights),
    )
    estimated = estimate_sensor_noise(fitted, campaign.observations)
    assert estimated.position_m == pytest.approx(factor * noise.position_m, rel=0.15)
    assert not estimated.has_joint_error
