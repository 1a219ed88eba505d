"""The alarm: its level by simulation on problems in which nothing is missing, and its power."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit
from scipy.stats import binom

from elastocal.diagnosis.evidence import evaluate, log_sum_exp
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.search import alarm_of
from elastocal.diagnosis.settings import Settings

UNITS = (
    made_unit("offset", (1,), 0),
    made_unit("offset", (2,), 1),
    made_unit("tilt", (1,), [2, 3], signs=1),
    made_unit(OTHER, (1,), [4, 5, 6]),
)
# Of 300 problems. More alarms than this come once in a thousand times at the level; at twice the level there are more with a
# probability of 0.96, at half of it fewer than the other bound with one of 0.46.
PROBLEMS, LEVEL = 300, 0.1
FEWEST, MOST = binom.ppf(1e-3, PROBLEMS, LEVEL), binom.isf(1e-3, PROBLEMS, LEVEL)


def p_values(drawn):
    """Of simulated measurements, each at the pose error that they make most probable."""
    settings = replace(Settings(), alarm_draws=99, alarm_level=LEVEL)
    found = []
    for number in range(PROBLEMS):
        rng = np.random.default_rng((1, number))
        problem, products = made_problem(drawn(rng), UNITS, settings)
        nothing = evaluate(problem.statistics, [], problem.grid, problem.log_pose, [])
        tau = problem.statistics.pose_error_rad[np.argmax(nothing.log_pose)]
        found.append(alarm_of(problem, products, tau, rng).p_value)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("tau", [0.0, 0.5])
def test_alarms_come_as_often_as_the_level_says(tau):
    rows = made_rows(2, poses=10, candidates=8)
    found = p_values(lambda rng: rows.drawn(rng, tau))
    assert FEWEST <= (found <= LEVEL).sum() <= MOST, (found <= LEVEL).mean()


def signalled(size):
    rows = made_rows(5, candidates=8)
    return made_problem(replace(rows, residual=rows.residual + size * rows.candidates[:, 2:4] @ [1.0, 1.0]), UNITS)


def test_statistic_rises_and_p_value_falls_with_the_size_of_what_is_missing():
    sizes = [0.0, 0.3, 0.6, 1.2, 2.4]
    found = [alarm_of(*signalled(size), 0.0, np.random.default_rng(6)) for size in sizes]
    assert (np.diff([one.statistic for one in found[1:]]) > 0).all() and found[-1].statistic > found[0].statistic
    assert (np.diff([one.p_value for one in found[1:]]) <= 0).all()
    assert found[-1].raised and found[-1].p_value == 1 / 500
    assert not found[0].raised


@pytest.mark.parametrize("smallest", [0, 1, 2, 4])
def test_statistic_is_the_log_of_the_prior_weighted_bayes_factors(smallest):
    """Of all models of one unit, each averaged over its sizes and pose errors; signs of physics do not count.

    Sizes begin a step below the smallest.
    """
    problem, products = signalled(0.3)
    problem = replace(problem, units=(*problem.units[:2], replace(problem.units[2], smallest=smallest), *problem.units[3:]))
    found = alarm_of(problem, products, 0.0, np.random.default_rng(7))
    # The sizes of the pose error that draws at zero can make likely: zero and the two next.
    some = problem.statistics.at(np.arange(3))
    log_pose = problem.log_pose[:3]
    unsigned = [
        replace(unit, signs=np.zeros(len(unit.columns), int), smallest=max(unit.smallest - 1, 0)) for unit in problem.units
    ]
    nothing = evaluate(some, [], problem.grid, log_pose, []).log_evidence
    total = [
        evaluate(some, [unit], problem.grid, log_pose, [0.1]).log_evidence - nothing + problem.prior.log_odds_of([unit])
        for unit in unsigned
    ]
    assert found.statistic == pytest.approx(log_sum_exp(np.array(total)), abs=1e-6)


def test_a_mechanism_counts_at_all_its_locations_at_once_too():
    """With one law at each; of two laws each, and only of those that are at every location once."""
    candidates = {detail: SimpleNamespace(detail=detail) for detail in ("", "two slopes")}
    units = (
        made_unit("stiffening", (1,), 0, candidate=candidates[""], smallest=1),
        made_unit("stiffening", (2,), [1, 2], candidate=candidates[""]),
        made_unit("stiffening", (1,), 3, candidate=candidates["two slopes"]),
        made_unit("payload", (), 4, candidate=candidates[""]),
    )
    problem, products = made_problem(made_rows(5, candidates=8), units)
    found = alarm_of(problem, products, 0.0, np.random.default_rng(7))
    some, log_pose, grid = problem.statistics.at(np.arange(3)), problem.log_pose[:3], problem.grid
    whole = replace(units[0], columns=np.arange(3), signs=np.zeros(3, int), sizes=np.ones(3), smallest=0)
    tested = [(replace(unit, smallest=max(unit.smallest - 1, 0)), [unit]) for unit in units] + [(whole, list(units[:2]))]
    nothing = evaluate(some, [], grid, log_pose, []).log_evidence
    total = [
        evaluate(some, [unit], grid, log_pose, [0.1]).log_evidence - nothing + problem.prior.log_odds_of(members)
        for unit, members in tested
    ]
    assert found.statistic == pytest.approx(log_sum_exp(np.array(total)), abs=1e-6)
