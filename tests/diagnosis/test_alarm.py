"""The alarm: its statistic is the average Bayes factor, and its power rises with the
signal."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit

from elastocal.diagnosis.alarm import run_alarm_test
from elastocal.diagnosis.evidence import evaluate_model, log_sum_exp
from elastocal.diagnosis.hypotheses import OTHER

ALARM_UNITS = (
    made_unit("offset", (1,), 0),
    made_unit("offset", (2,), 1),
    made_unit("tilt", (1,), [2, 3], signs=1),
    made_unit(OTHER, (1,), [4, 5, 6]),
)


def signalled(size):
    rows = made_rows(5, candidates=8)
    return made_problem(
        replace(
            rows, residual=rows.residual + size * rows.candidates[:, 2:4] @ [1.0, 1.0]
        ),
        ALARM_UNITS,
    )


def test_statistic_rises_and_p_value_falls_with_the_size_of_what_is_missing():
    sizes = [0.0, 0.3, 0.6, 1.2, 2.4]
    found = [
        run_alarm_test(*signalled(size), 0.0, np.random.default_rng(6))
        for size in sizes
    ]
    assert (np.diff([one.statistic for one in found[1:]]) > 0).all() and found[
        -1
    ].statistic > found[0].statistic
    assert (np.diff([one.p_value for one in found[1:]]) <= 0).all()
    assert found[-1].raised and found[-1].p_value == 1 / 500
    assert not found[0].raised


@pytest.mark.parametrize("smallest", [0, 2])
def test_statistic_is_the_log_of_the_prior_weighted_bayes_factors(smallest):
    """Of all models of one unit, each averaged over its sizes and pose errors; signs of
    physics do not count.

    Sizes begin a step below the smallest.
    """
    problem, products = signalled(0.3)
    problem = replace(
        problem,
        terms=(
            *problem.terms[:2],
            replace(problem.terms[2], smallest=smallest),
            *problem.terms[3:],
        ),
    )
    found = run_alarm_test(problem, products, 0.0, np.random.default_rng(7))
    # The sizes of the pose error that draws at zero can make likely: zero and the two
    # next.
    some = problem.statistics.at(np.arange(3))
    log_pose = problem.log_pose[:3]
    unsigned = [
        replace(
            unit,
            signs=np.zeros(len(unit.columns), int),
            smallest=max(unit.smallest - 1, 0),
        )
        for unit in problem.terms
    ]
    nothing = evaluate_model(some, [], problem.grid, log_pose, []).log_evidence
    total = [
        evaluate_model(some, [unit], problem.grid, log_pose, [0.1]).log_evidence
        - nothing
        + problem.prior.compute_log_odds([unit])
        for unit in unsigned
    ]
    assert found.statistic == pytest.approx(log_sum_exp(np.array(total)), abs=1e-6)


def test_a_mechanism_counts_at_all_its_locations_at_once_too():
    """With one law at each; of two laws each, and only of those that are at every
    location once."""
    candidates = {
        detail: SimpleNamespace(detail=detail) for detail in ("", "two slopes")
    }
    units = (
        made_unit(
            "stiffening",
            (1,),
            0,
            candidate=candidates[""],
            smallest=1,
            log_prior=np.log(0.5),
        ),
        made_unit(
            "stiffening", (2,), [1, 2], candidate=candidates[""], log_prior=np.log(0.5)
        ),
        made_unit("stiffening", (1,), 3, candidate=candidates["two slopes"]),
        made_unit("payload", (), 4, candidate=candidates[""]),
    )
    problem, products = made_problem(made_rows(5, candidates=8), units)
    found = run_alarm_test(problem, products, 0.0, np.random.default_rng(7))
    some = problem.statistics.at(np.arange(3))
    log_pose = problem.log_pose[:3]
    grid = problem.grid
    whole = replace(
        units[0],
        columns=np.arange(3),
        signs=np.zeros(3, int),
        sizes=np.ones(3),
        smallest=0,
    )
    tested = [
        (replace(unit, smallest=max(unit.smallest - 1, 0)), [unit]) for unit in units
    ] + [(whole, list(units[:2]))]
    nothing = evaluate_model(some, [], grid, log_pose, []).log_evidence
    total = [
        evaluate_model(some, [unit], grid, log_pose, [0.1]).log_evidence
        - nothing
        + problem.prior.compute_log_odds(members)
        for unit, members in tested
    ]
    # One choice among the variants, not one at each location.
    total[-1] -= np.log(0.5)
    assert found.statistic == pytest.approx(log_sum_exp(np.array(total)), abs=1e-6)
