"""Is anything missing at all? One Monte Carlo test.

The statistic is the log of the average Bayes factor, over all units and all whole mechanisms, against "nothing": a Bayes factor
as the statistic of a test (Good, The Bayes/non-Bayes compromise, JASA 1992). Its null distribution is that of simulated
measurements of the same design, at the pose error that fits best, with the pose error averaged over anew in each draw; the
p-value counts how many draws reach the statistic of the measurements. With noise and pose error known that is exact; with a
fitted pose error it is a parametric bootstrap (Davison and Hinkley, Bootstrap Methods, 1997, 4.2). No Bonferroni correction and
no choice of a test: competitors that the measurements cannot show have a Bayes factor of one in every draw. Sizes begin a step
below those of the posterior: what lies between may be seen, and its probability does not matter to a test. Where nothing is
missing a Bayes factor has a mean of one, so that it exceeds b with a probability of at most 1/b (Markov's inequality): where b
is far beyond the number of draws none of them reaches it, and none is made.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.evidence import condition, log_likelihood, log_sum_exp
from elastocal.diagnosis.search import REACH, Problem
from elastocal.diagnosis.statistics import Products, Statistics, null_draws

if TYPE_CHECKING:
    from elastocal.diagnosis.hypotheses import Unit

# Bayes factor over the number of draws, the measurements' own included, beyond which none is made. The mean of one is that over
# the prior of the pose error; at the fitted one it is larger by at most the inverse of that one's prior probability.
_BEYOND_DRAWS = 1e4


@dataclass(frozen=True)
class Alarm:
    """Outcome of the test.

    `statistic`: log of the average Bayes factor against "nothing".
    """

    p_value: float
    statistic: float
    raised: bool


def alarm_of(problem: Problem, products: Products, pose_error_rad: float, stream: np.random.Generator) -> Alarm:
    """Test whether the declared model lacks anything.

    `pose_error_rad`: pose error of the declared model at which measurements are simulated.
    """
    settings, statistics = problem.settings, problem.statistics
    # Sizes that draws of the fitted one can make likely: its own, and some to either side.
    place = statistics.nearest(pose_error_rad)
    chosen = slice(max(place - REACH, 0), place + REACH + 1)
    statistics, log_pose = statistics.at(chosen), problem.log_pose[chosen]
    own = statistics.along[..., None], statistics.squares[:, None]
    statistic = float(_average_bayes_factors(problem, statistics, log_pose, *own)[0])
    reached = 0
    if statistic <= np.log(_BEYOND_DRAWS * (1 + settings.alarm_draws)):
        drawn = null_draws(products, pose_error_rad, statistics.pose_error_rad, settings.alarm_draws, stream)
        reached = int((_average_bayes_factors(problem, statistics, log_pose, *drawn) >= statistic).sum())
    p_value = (1 + reached) / (1 + settings.alarm_draws)
    return Alarm(p_value, statistic, p_value <= settings.alarm_level)


def _average_bayes_factors(
    problem: Problem, statistics: Statistics, log_pose: np.ndarray, along: np.ndarray, squares: np.ndarray
) -> np.ndarray:
    """Log of the average Bayes factor for N sets of measurements, ndarray (N,).

    `along` (T, K, N), `squares` (T, N).
    """
    grid, given_nothing = problem.grid, condition(statistics, np.zeros(0, int), np.zeros(0), log_pose)
    start = given_nothing.log_occam[:, None]
    nothing = log_sum_exp(start + log_likelihood(squares, statistics.freedom), axis=0)
    tested, log_priors = _alternatives(problem)
    total = np.full(len(nothing), -np.inf)
    for members, values, vectors, columns in given_nothing.blocks_of(tested, range(len(tested))):
        for place, number in enumerate(members):
            turned = (vectors[:, place].transpose(0, 2, 1) @ along[:, columns[place]]) ** 2
            unit = tested[number]
            first = max(unit.smallest - 1, 0)
            variances = grid.scales[first:, None] ** 2
            weights = grid.between(first, unit.largest)[first:]
            widened = 1.0 + variances * values[:, None, place]
            left = squares[:, None] - (variances / widened) @ turned
            known = weights + start - 0.5 * np.log(widened).sum(axis=2)
            terms = log_likelihood(left, statistics.freedom) + known[..., None]
            total = np.logaddexp(total, log_priors[number] + log_sum_exp(terms, axis=(0, 1)))
    return total - nothing


def _alternatives(problem: Problem) -> tuple[list[Unit], list[float]]:
    """Every unit, and every mechanism with one law at all its locations in one size; with their log prior odds."""
    prior = problem.prior
    alternatives, log_priors = list(problem.units), [prior.log_odds_of([unit]) for unit in problem.units]
    laws: dict[tuple[str, str, tuple[float, ...]], list[Unit]] = {}
    for unit in problem.units:
        if unit.candidate:
            laws.setdefault((unit.mechanism, unit.candidate.detail, unit.shapes), []).append(unit)
    for units in laws.values():
        if len({unit.location for unit in units}) == len(units) > 1:
            columns, smallest = np.concatenate([unit.columns for unit in units]), min(unit.smallest for unit in units)
            alternatives.append(replace(units[0], columns=columns, smallest=smallest))
            log_priors.append(prior.log_odds_of(units) - (len(units) - 1) * units[0].log_prior)
    return alternatives, log_priors
