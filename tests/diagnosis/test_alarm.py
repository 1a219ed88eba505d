"""The alarm: its statistic is the average Bayes factor, and its power rises with the
signal."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term

from elastocal.diagnosis.alarm import run_alarm_test
from elastocal.diagnosis.evidence import evaluate_model, log_sum_exp
from elastocal.diagnosis.hypotheses import OTHER

TERMS = (
    make_term("offset", (1,), 0),
    make_term("offset", (2,), 1),
    make_term("tilt", (1,), [2, 3], signs=1),
    make_term(OTHER, (1,), [4, 5, 6]),
)


def problem_with_tilt(size):
    """A problem whose tilt has both coefficients of a given size, and its products."""
    rows = make_rows(5, candidates=8)
    signal = size * rows.candidates[:, 2:4] @ [1.0, 1.0]
    return make_problem(replace(rows, residual=rows.residual + signal), TERMS)


def test_statistic_rises_and_p_value_falls_with_the_size_of_the_missing_effect():
    sizes = [0.0, 0.3, 0.6, 1.2, 2.4]
    alarms = [
        run_alarm_test(*problem_with_tilt(size), 0.0, np.random.default_rng(6))
        for size in sizes
    ]
    statistics = [alarm.statistic for alarm in alarms]
    assert (np.diff(statistics[1:]) > 0).all()
    assert statistics[-1] > statistics[0]
    assert (np.diff([alarm.p_value for alarm in alarms[1:]]) <= 0).all()
    assert alarms[-1].raised
    assert alarms[-1].p_value == 1 / 500
    assert not alarms[0].raised


def log_average_bayes_factor(problem, alternatives):
    """Log of the sum of Bayes factors times prior odds, each evaluated on its own.

    `alternatives`: terms, each with its log prior odds. The sizes of the pose error are
    those that draws without a pose error can make likely: zero and the two next.
    """
    statistics = problem.statistics.at(np.arange(3))
    log_pose = problem.log_pose[:3]

    def log_evidence(terms):
        scales = [0.1] * len(terms)
        return evaluate_model(
            statistics, terms, problem.grid, log_pose, scales
        ).log_evidence

    nothing = log_evidence([])
    log_odds = [
        log_evidence([term]) - nothing + log_prior for term, log_prior in alternatives
    ]
    return log_sum_exp(np.array(log_odds))


def one_scale_below(term):
    """A term whose scales begin one step earlier, as the alarm's do."""
    return replace(term, smallest=max(term.smallest - 1, 0))


@pytest.mark.parametrize("smallest", [0, 2])
def test_statistic_is_the_log_of_the_prior_weighted_bayes_factors(smallest):
    """Of all models of one term, each averaged over its scales and pose errors.

    Signs that physics gives do not count, and the scales begin one step below the
    smallest one.
    """
    problem, products = problem_with_tilt(0.3)
    terms = list(problem.terms)
    terms[2] = replace(terms[2], smallest=smallest)
    problem = replace(problem, terms=tuple(terms))
    alarm = run_alarm_test(problem, products, 0.0, np.random.default_rng(7))
    alternatives = [
        (
            replace(one_scale_below(term), signs=np.zeros(len(term.columns), int)),
            problem.prior.compute_log_odds([term]),
        )
        for term in problem.terms
    ]
    expected = log_average_bayes_factor(problem, alternatives)
    assert alarm.statistic == pytest.approx(expected, abs=1e-6)


def test_a_mechanism_also_counts_as_a_whole_with_one_variant_at_all_its_locations():
    """Only variants that are at every location once form a whole mechanism."""
    plain = SimpleNamespace(detail="")
    two_slopes = SimpleNamespace(detail="two slopes")
    half = np.log(0.5)
    terms = (
        make_term("stiffening", (1,), 0, candidate=plain, smallest=1, log_prior=half),
        make_term("stiffening", (2,), [1, 2], candidate=plain, log_prior=half),
        make_term("stiffening", (1,), 3, candidate=two_slopes),
        make_term("payload", (), 4, candidate=plain),
    )
    problem, products = make_problem(make_rows(5, candidates=8), terms)
    alarm = run_alarm_test(problem, products, 0.0, np.random.default_rng(7))
    whole = replace(
        terms[0],
        columns=np.arange(3),
        signs=np.zeros(3, int),
        sizes=np.ones(3),
        smallest=0,
    )
    alternatives = [
        (one_scale_below(term), problem.prior.compute_log_odds([term]))
        for term in terms
    ]
    # One choice among the variants, not one at each location.
    log_prior = problem.prior.compute_log_odds(terms[:2]) - half
    alternatives.append((whole, log_prior))
    expected = log_average_bayes_factor(problem, alternatives)
    assert alarm.statistic == pytest.approx(expected, abs=1e-6)
