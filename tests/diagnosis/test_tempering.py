"""Odds between hypotheses are tempered by how far their laws may be off."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.model_averaging import compute_explained_squares
from elastocal.diagnosis.search import Posterior, ScoredModel
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.tempering import compute_power, temper_hypotheses
from elastocal.diagnosis.verdict import Hypothesis

SETTINGS = Settings()
TERMS = (make_term("a", (1,), 0), make_term("b", (1,), 1), make_term(OTHER, (1,), 2))
HYPOTHESES = (
    Hypothesis(("a",), 0.89, 0),
    Hypothesis((), 0.06, 1),
    Hypothesis(("b",), 0.04, 2),
    Hypothesis(("a", "b"), 0.01, 3),
)


def temper(size, **changes):
    """Temper the hypotheses where the first mechanism acts with some size; return them
    by their mechanisms, and the problem with its most probable model."""
    rows = make_rows()
    rows = replace(rows, residual=rows.expected + size * rows.candidates[:, 0])
    problem, _ = make_problem(rows, TERMS, replace(SETTINGS, **changes))
    best = ScoredModel((0,), 9.0, np.ones(1), 0.0)
    posterior = Posterior((best,), np.ones(1))
    tempered = temper_hypotheses(problem, posterior, HYPOTHESES)
    return {entry.mechanisms: entry.probability for entry in tempered}, problem, best


def test_an_effect_that_is_barely_seen_has_its_evidence_in_full():
    assert compute_power(0.0, 0.2, 0.3) == 1.0
    probabilities, *_ = temper(1.0, confusable_share=0.0)
    assert probabilities == pytest.approx(
        {entry.mechanisms: entry.probability for entry in HYPOTHESES}
    )


def test_the_power_halves_the_evidence_where_the_departure_has_one_relative_entropy():
    squares = 2.0 / (0.3 * 0.2**2)
    assert compute_power(squares, 0.2, 0.3) == pytest.approx(0.5)


def test_odds_between_laws_fall_with_the_size_of_the_effect_and_nothing_keeps_its_own():
    previous = HYPOTHESES[0].probability / HYPOTHESES[2].probability
    for size in (1.0, 10.0, 100.0):
        probabilities, problem, best = temper(size)
        assert sum(probabilities.values()) == pytest.approx(1.0)
        assert probabilities[()] == pytest.approx(0.06)
        # Mechanisms of the same prior probability: the odds are raised to the power.
        squares = compute_explained_squares(problem, best)["a"]
        power = compute_power(
            squares, SETTINGS.law_tolerance, SETTINGS.confusable_share
        )
        odds = probabilities["a",] / probabilities["b",]
        assert odds == pytest.approx((0.89 / 0.04) ** power)
        assert odds < previous
        previous = odds
        # A further mechanism beside the leading one is no other law for the same.
        assert probabilities["a", "b"] / probabilities["a",] == pytest.approx(
            0.01 / 0.89
        )


def test_nothing_is_tempered_if_nothing_can_be_missing():
    nothing = (Hypothesis((), 1.0, 0),)
    rows = make_rows()
    problem, _ = make_problem(rows, TERMS)
    posterior = Posterior((ScoredModel((), 0.0, np.ones(0), 0.0),), np.ones(1))
    assert temper_hypotheses(problem, posterior, nothing) == nothing
