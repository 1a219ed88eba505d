"""The search, on problems small enough for all models to be enumerated."""

import gc
import weakref
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term

from elastocal.diagnosis import search
from elastocal.diagnosis.discrepancy import NEIGHBOURS
from elastocal.diagnosis.evidence import (
    evaluate_extensions,
    evaluate_model,
    log_sum_exp,
)
from elastocal.diagnosis.hypotheses import GROSS_ERROR, OTHER
from elastocal.diagnosis.search import search_from_starts, search_models
from elastocal.diagnosis.settings import Settings

TAU = [0.0, 0.3, 0.9]
# Two mechanisms at three and two locations, one of them with two variants at one
# location, and a discrepancy.
TERMS = (
    make_term("offset", (1,), 0),
    make_term("offset", (2,), 1),
    make_term("offset", (3,), 2),
    make_term("tilt", (1,), [3, 4]),
    make_term("tilt", (2,), 5, log_prior=np.log(0.5)),
    make_term("tilt", (2,), 6, log_prior=np.log(0.5)),
    make_term(OTHER, (1,), [7, 8, 9]),
)
SIGNALS = {
    "nothing": {},
    "one": {0: 0.8},
    "a faint one": {0: 0.45},
    "one mechanism everywhere": {0: 0.7, 1: -0.6, 2: 0.7},
    "two mechanisms": {1: 0.8, 3: 0.8, 4: 0.3},
}


def problem_with_signal(name, seed=0):
    rows = make_rows(seed, poses=14, candidates=10)
    signal = sum(
        size * rows.candidates[:, column] for column, size in SIGNALS[name].items()
    )
    rows = replace(rows, residual=rows.residual + signal)
    problem, _ = make_problem(rows, TERMS, tau=TAU)
    return problem


def problem_with_cancelling_columns(size, terms):
    """A problem with a signal in three columns that nearly cancel, so that no single
    column shows it.

    Its search extends only the best model, and only once.
    """
    rows = make_rows(3, poses=14, candidates=6)
    common = 30 * np.random.default_rng(4).standard_normal(len(rows.pose))
    candidates = rows.candidates.copy()
    candidates[:, :3] += np.outer(common, [1, 1, -2])
    signal = size * candidates[:, :3].sum(axis=1)
    rows = replace(rows, candidates=candidates, residual=rows.residual + signal)
    settings = replace(Settings(), beam=1, patience=1)
    problem, _ = make_problem(rows, terms, settings, TAU)
    return problem


def enumerate_models(problem):
    """Posterior probability of every model, each evaluated in full."""
    log_odds = {}
    for size in range(len(problem.terms) + 1):
        for model in combinations(range(len(problem.terms)), size):
            terms = [problem.terms[number] for number in model]
            if len({term.slot for term in terms}) < size:
                continue
            evidence = evaluate_model(
                problem.statistics,
                terms,
                problem.grid,
                problem.log_pose,
                np.full(size, 0.1),
            )
            log_prior = problem.prior.compute_log_odds(terms)
            log_prior += problem.prior.correct_for_nothing(terms)
            log_odds[model] = evidence.log_evidence + log_prior
    values = np.array(list(log_odds.values()))
    return dict(zip(log_odds, np.exp(values - log_sum_exp(values)), strict=True))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("signal", SIGNALS)
def test_posterior_is_that_of_all_models(signal, seed):
    """To 0.02 in every probability; models that were not met hold less than 2 %
    together."""
    problem = problem_with_signal(signal, seed)
    expected = enumerate_models(problem)
    posterior = search_models(problem)
    assert posterior.probabilities.sum() == pytest.approx(1.0)
    models = [model.term_indices for model in posterior.models]
    probabilities = dict(zip(models, posterior.probabilities, strict=True))
    assert len(probabilities) == len(models)
    assert set(probabilities) <= set(expected)
    for model, probability in expected.items():
        assert abs(probabilities.get(model, 0.0) - probability) < 0.02
    not_met = sum(p for model, p in expected.items() if model not in probabilities)
    assert not_met < 0.02


def test_discrepancies_of_different_causes_at_one_location_join_in_one_model():
    rows = make_rows(poses=14)
    terms = (
        make_term(OTHER, (1,), [0, 1]),
        make_term(OTHER, (1,), [2, 3], law=NEIGHBOURS),
    )
    signal = 0.8 * rows.candidates[:, :4].sum(axis=1)
    rows = replace(rows, residual=rows.residual + signal)
    problem, _ = make_problem(rows, terms, tau=TAU)
    assert search_models(problem).models[0].term_indices == (0, 1)


def test_a_search_finds_a_good_model_that_it_is_told_even_if_no_step_leads_there():
    """The model has three mechanisms, of which no single one shows, nor any two."""
    terms = [
        make_term(name, (1,), column, candidate=SimpleNamespace(key=name))
        for column, name in enumerate("abc")
    ]
    terms += [make_term("d", (1,), 3), make_term("e", (1,), 4)]
    problem = problem_with_cancelling_columns(1.5, terms)
    best_untold = max(
        search_models(problem, keys).models[0].log_odds for keys in ((), ("a",))
    )
    # Keys that are not among the terms are ignored.
    best = search_models(problem, {"a", "b", "c", "gone"}).models[0]
    assert best.term_indices == (0, 1, 2)
    assert best.log_odds > best_untold + 5


def test_statistics_are_released_with_their_problem():
    """The largest arrays of a diagnosis would otherwise stay until Python looks for
    objects that refer to each other."""
    terms = tuple(make_term("offset", (n,), n) for n in range(8))
    problem, _ = make_problem(make_rows(5, poses=14, candidates=8), terms, tau=[0.0])
    search_models(problem)
    statistics = weakref.ref(problem.initial_search.statistics)
    gc.disable()
    del problem
    gc.enable()
    assert statistics() is None


def test_gross_errors_that_lead_are_added_in_few_steps():
    rows = make_rows(5, poses=14, candidates=8)
    candidates = rows.candidates.copy()
    candidates[:, :6] = 10.0 * np.eye(len(rows.pose))[:, 4:22:3]
    residual = rows.residual + candidates[:, :6].sum(axis=1)
    rows = replace(rows, candidates=candidates, residual=residual)
    terms = tuple(make_term(GROSS_ERROR, ("row", n), n) for n in range(6))
    terms += (make_term("offset", (1,), 6), make_term("offset", (2,), 7))
    problem, _ = make_problem(rows, terms, tau=[0.0])
    search = search_from_starts(problem, problem.initial_search, [()])
    wrong = tuple(range(6))
    assert search.find_best_model() == wrong
    posterior = search.weigh()
    expected = enumerate_models(problem)
    assert posterior.probabilities[0] == pytest.approx(expected[wrong], abs=0.01)
    grown = {len(model) for model in search.extended if set(model) < set(wrong)}
    assert grown < set(range(len(wrong)))


def test_sizes_of_the_pose_error_without_probability_do_not_matter(monkeypatch):
    """Models are extended at the sizes that are likely under them; a model in which a
    few sizes are likely gets the extensions that all sizes give it."""
    rows = make_rows(0, poses=40, candidates=10).drawn(np.random.default_rng(1), 2.0)
    signal = 3.0 * rows.candidates[:, 0] + 3.0 * rows.candidates[:, 1]
    rows = replace(rows, residual=rows.residual + signal)
    tau = [0.0, 0.5, 2.0, 8.0, 32.0]
    counts = []

    def evaluate_and_count(statistics, *arguments):
        counts.append(len(statistics.pose_error_rad))
        return evaluate_extensions(statistics, *arguments)

    monkeypatch.setattr(search, "evaluate_extensions", evaluate_and_count)
    monkeypatch.setattr(search, "NEGLIGIBLE_LOG_WEIGHT", -np.inf)
    found = search_models(make_problem(rows, TERMS, tau=tau)[0])
    fewest = min(counts)
    monkeypatch.setattr(search, "_NEGLIGIBLE_FOR_NEIGHBOURS", -np.inf)
    counts.clear()
    expected = search_models(make_problem(rows, TERMS, tau=tau)[0])
    assert fewest < min(counts)
    assert [model.term_indices for model in found.models] == [
        model.term_indices for model in expected.models
    ]
    assert found.probabilities == pytest.approx(expected.probabilities, abs=1e-9)


def test_a_term_that_explains_a_large_pose_error_is_evaluated_at_small_ones():
    """Without the term only large sizes are likely, and with it only small ones. The
    search drops sizes that no single term makes likely, hence the tolerance."""
    rows = make_rows(0, poses=40, candidates=2).drawn(np.random.default_rng(1), 0.5)
    draws = np.random.default_rng(2)
    by_pose = draws.standard_normal((40, rows.jacobian.shape[1]))
    candidates = rows.candidates.copy()
    candidates[:, 0] = (rows.jacobian * by_pose[rows.pose]).sum(axis=1)
    rows = replace(
        rows, candidates=candidates, residual=rows.residual + 50 * candidates[:, 0]
    )
    tau = [0.0, *(0.25 * 2.0 ** np.arange(10))]
    terms = (make_term("offset", (1,), 0), make_term("offset", (2,), 1))
    problem, _ = make_problem(rows, terms, tau=tau)
    found = problem.initial_search.duplicate()
    smallest, _ = found.evaluated[()].likely_pose_errors_rad
    assert found.evaluate((0,)).pose_error_rad < smallest / 2
    nothing, alone = (
        evaluate_model(
            problem.statistics,
            terms[:count],
            problem.grid,
            problem.log_pose,
            np.full(count, problem.settings.scale_center),
        ).log_evidence
        for count in (0, 1)
    )
    log_prior = problem.prior.compute_log_odds(terms[:1])
    assert found.log_odds[0,] == pytest.approx(alone - nothing + log_prior, abs=1e-3)


def test_a_model_is_evaluated_even_if_the_likely_sizes_of_its_neighbour_were_dropped():
    rows = make_rows(0, poses=40, candidates=2)
    terms = (make_term("offset", (1,), 0), make_term("offset", (2,), 1))
    found = make_problem(rows, terms, tau=TAU)[0].initial_search.duplicate()
    nothing = found.evaluated[()]
    found.evaluated[()] = replace(nothing, likely_pose_errors_rad=(64.0, 64.0))
    assert np.isfinite(found.evaluate((1,)).log_odds)
