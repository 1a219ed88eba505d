"""The exact fit of a selected model: its priors, its noise, and what is left of the residual."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted

from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.refit import fit_with_sizes, mean_square_left, remaining_noise, selected
from elastocal.diagnosis.search import posterior
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit
from elastocal.fitting.linearization import linearize

SETTINGS = Settings()


@pytest.fixture(scope="module")
def found(kuka):
    """A robot with an offset of joint 3, offsets of joint 2 declared, and what the search makes of it."""
    campaign = planted(kuka, {"joint_offset@3": [5e-4], "joint_offset@2": [3e-4]}, seed=1)
    known = campaign.candidates["joint_offset@2"]
    model = campaign.declared.model.with_effects([known])
    start = campaign.declared.estimate.with_effects([known])
    declared = fit(model, campaign.observations, campaign.declared.noise, start)
    candidates = [candidate for candidate in campaign.all_candidates if candidate.effect != "joint_offset"]
    candidates.append(replace(campaign.candidates["joint_offset@3"], effect="offset"))
    problem = linearized(declared, campaign.observations, candidates, SETTINGS)
    models = posterior(problem.problem)
    return campaign, declared, problem, models


def test_priors_arrive_in_the_fit(found):
    campaign, declared, line, models = found
    best = models.models[0]
    assert [line.problem.units[number].key for number in best.units] == ["offset@3"]
    chosen = selected(line, best)
    (effect, shapes), *others = chosen
    assert not others and shapes.size == 0
    final = fit_with_sizes(declared, campaign.observations, declared.noise, chosen)
    priors = {owner: parameter.prior_std for owner, parameter in final.parameters if "offset@" in owner}
    plausible = effect.parameters[0].plausible
    assert priors["joint_offset@2"] is None and priors["offset@3"] == pytest.approx(best.scales[0] * plausible, rel=1e-12)
    assert best.scales[0] in SETTINGS.scales
    # And do what a prior does: information of the measurements and of the prior add up.
    about = linearize(final.model, final.estimate, campaign.observations, final.conditions)
    left = final.whitened(about.sensitivities).reshape(-1, len(final.parameters))
    precision = np.array([0.0 if p.prior_std is None else p.prior_std**-2 for _, p in final.parameters])
    expected = np.linalg.inv(left.T @ left + np.diag(precision))
    np.testing.assert_allclose(np.diag(final.covariance), np.diag(expected), rtol=1e-2)


def test_no_effect_is_fitted_under_a_wider_prior_than_it_had_before_the_measurements(found):
    _, _, line, models = found
    best = models.models[0]
    unit = line.problem.units[best.units[0]]
    before = line.problem.grid.root_mean_square(unit)
    sizes = [0.5 * before, before, SETTINGS.scales[-1]]
    assert before < SETTINGS.scales[-1]
    chosen = [selected(line, replace(best, scales=np.array([size])))[0][0] for size in sizes]
    deviations = [candidate.parameters[0].prior_std / unit.sizes[0] for candidate in chosen]
    np.testing.assert_allclose(deviations, [0.5 * before, before, before], rtol=1e-12)


def test_mean_square_left_is_that_of_the_penalised_fit(found):
    """Least squares with the prior's rows beneath: their squares count, as they do in the evidence."""
    _, _, line, models = found
    problem, model = line.problem, models.models[0]
    statistics = problem.statistics
    place = int(np.argmin(np.abs(statistics.pose_error_rad - model.pose_error_rad)))
    columns = np.concatenate([problem.units[number].columns for number in model.units])
    deviations = np.repeat(model.scales, [len(problem.units[number].columns) for number in model.units])
    gram, along = statistics.gram[place][np.ix_(columns, columns)], statistics.along[place][columns]
    values = np.linalg.solve(gram + np.diag(deviations**-2.0), along)
    squares = statistics.squares[place] - 2 * values @ along + values @ gram @ values + (values**2 / deviations**2).sum()
    assert mean_square_left(problem, model) == pytest.approx(squares / statistics.freedom, rel=1e-9)
    # With everything that was planted in the model, noise is all that is left.
    assert 0.7 < mean_square_left(problem, model) < 1.3


@pytest.mark.parametrize("times", [0.5, 1.0, 4.0])
def test_remaining_noise_does_not_depend_on_the_noise_by_which_the_problem_was_whitened(found, times):
    """Where the residual exceeds the least noise, and else the least; measurements scatter by 1.3 and 0.65 of it."""
    _, declared, line, models = found
    problem, least = line.problem, declared.noise
    for spread in (1.3, 0.65):
        share = (spread / times) ** 2 / mean_square_left(problem, models.models[0])
        scaled = replace(
            problem.statistics, squares=share * problem.statistics.squares, along=share**0.5 * problem.statistics.along
        )
        left = remaining_noise(replace(problem, statistics=scaled), models.models[0], least.scaled(times), least)
        assert left.position_m == pytest.approx(max(spread, 1.0) * least.position_m)
        np.testing.assert_allclose(left.joint_rad, max(spread, 1.0) * least.joint_rad)
