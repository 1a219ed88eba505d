"""The search, on problems small enough for all models to be enumerated, and the alarm:
its statistic and its power."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit

from elastocal.diagnosis.discrepancy import NEIGHBOURS
from elastocal.diagnosis.evidence import evaluate_model, log_sum_exp
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.search import search_models
from elastocal.diagnosis.settings import Settings

TAU = [0.0, 0.3, 0.9]
# Two laws at one location, two mechanisms at three and two locations, and the
# competitor.
UNITS = (
    made_unit("offset", (1,), 0),
    made_unit("offset", (2,), 1),
    made_unit("offset", (3,), 2),
    made_unit("tilt", (1,), [3, 4]),
    made_unit("tilt", (2,), 5, log_prior=np.log(0.5)),
    made_unit("tilt", (2,), 6, log_prior=np.log(0.5)),
    made_unit(OTHER, (1,), [7, 8, 9]),
)
SIGNALS = {
    "nothing": {},
    "one": {0: 0.8},
    "a faint one": {0: 0.45},
    "one mechanism everywhere": {0: 0.7, 1: -0.6, 2: 0.7},
    "two mechanisms": {1: 0.8, 3: 0.8, 4: 0.3},
}


def problem_of(signal, seed=0, settings=None):
    rows = made_rows(seed, poses=14, candidates=10)
    moved = sum(
        size * rows.candidates[:, column] for column, size in SIGNALS[signal].items()
    )
    return made_problem(
        replace(rows, residual=rows.residual + moved), UNITS, settings, TAU
    )[0]


def cancelling(size, units):
    """The problem of a campaign with so much of three columns that nearly cancel: no
    single one of them shows.

    A search of it extends but the best model once.
    """
    rows = made_rows(3, poses=14, candidates=6)
    common = 30 * np.random.default_rng(4).standard_normal(len(rows.pose))
    candidates = rows.candidates.copy()
    candidates[:, :3] += np.outer(common, [1, 1, -2])
    rows = replace(
        rows,
        candidates=candidates,
        residual=rows.residual + size * candidates[:, :3].sum(axis=1),
    )
    return made_problem(rows, units, replace(Settings(), beam=1, patience=1), TAU)[0]


def enumerated(problem):
    """Posterior probability of every model, each evaluated in full."""
    odds = {}
    for size in range(len(problem.terms) + 1):
        for model in combinations(range(len(problem.terms)), size):
            units = [problem.terms[number] for number in model]
            if len({unit.slot for unit in units}) < size:
                continue
            found = evaluate_model(
                problem.statistics,
                units,
                problem.grid,
                problem.log_pose,
                np.full(size, 0.1),
            )
            odds[model] = found.log_evidence + problem.prior.compute_log_odds(units)
    values = np.array(list(odds.values()))
    return dict(zip(odds, np.exp(values - log_sum_exp(values)), strict=True))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("signal", SIGNALS)
def test_posterior_is_that_of_all_models(signal, seed):
    """To 0.02 in every probability, and models that were not met hold less than 2 %
    together."""
    problem = problem_of(signal, seed)
    expected = enumerated(problem)
    found = search_models(problem)
    assert found.probabilities.sum() == pytest.approx(1.0)
    mine = dict(
        zip(
            (model.term_indices for model in found.models),
            found.probabilities,
            strict=True,
        )
    )
    assert len(mine) == len(found.models)
    assert all(
        abs(mine.get(model, 0.0) - probability) < 0.02
        for model, probability in expected.items()
    )
    assert (
        sum(probability for model, probability in expected.items() if model not in mine)
        < 0.02
    )
    assert set(mine) <= set(expected)


def test_laws_of_the_competitor_at_one_location_join_in_one_model():
    rows = made_rows(poses=14)
    laws = (
        made_unit(OTHER, (1,), [0, 1]),
        made_unit(OTHER, (1,), [2, 3], law=NEIGHBOURS),
    )
    rows = replace(
        rows, residual=rows.residual + 0.8 * rows.candidates[:, :4].sum(axis=1)
    )
    assert search_models(made_problem(rows, laws, tau=TAU)[0]).models[
        0
    ].term_indices == (0, 1)


def test_a_search_that_knows_a_good_model_finds_it_whatever_leads_there():
    """Of mechanisms at one location each: no single one of them shows, nor any two."""
    units = [
        made_unit(name, (1,), column, candidate=SimpleNamespace(key=name))
        for column, name in enumerate("abc")
    ]
    problem = cancelling(
        1.5, [*units, made_unit("d", (1,), 3), made_unit("e", (1,), 4)]
    )
    best = max(search_models(problem, keys).models[0].log_odds for keys in ((), ("a",)))
    # What is known and not tested is no matter.
    found = search_models(problem, {"a", "b", "c", "gone"})
    assert (
        found.models[0].term_indices == (0, 1, 2)
        and found.models[0].log_odds > best + 5
    )
