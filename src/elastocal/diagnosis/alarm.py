"""Alarm: one Monte Carlo test whether the declared model lacks anything at all.

Its statistic is the log of the average Bayes factor against the declared model, over
all terms and all whole mechanisms (Good, The Bayes/non-Bayes compromise, JASA 1992).
The null distribution is that of simulated measurements of the same design at the pose
error that fits best, each averaged over pose errors anew: a parametric bootstrap
(Davison and Hinkley, Bootstrap Methods, 1997, 4.2). One test needs no correction for
many. The scales begin one step below those of the posterior, because an effect between
the two may be detectable.

If nothing is missing, a Bayes factor exceeds b with a probability of at most 1/b
(Markov's inequality). If b is far beyond the number of draws, no draw is made.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.evidence import TermBlock, log_likelihood, log_sum_exp
from elastocal.diagnosis.null_distribution import simulate_null_statistics
from elastocal.diagnosis.search import POSE_ERROR_REACH

if TYPE_CHECKING:
    from elastocal.diagnosis.hypotheses import ModelTerm
    from elastocal.diagnosis.search import SearchProblem
    from elastocal.diagnosis.statistics import CrossProducts

# Block size: this many terms of the average Bayes factor fit in the processor's cache.
_AT_ONCE = 10_000
# No draws are made if the Bayes factor is larger than this many times the number of
# draws, the measurements themselves included. Markov's inequality holds for the mean
# over the prior of the pose error. At its fitted size the mean is larger by at most the
# inverse of that size's prior probability, for which this factor leaves room.
_BEYOND_DRAWS = 1e4


@dataclass(frozen=True)
class Alarm:
    """Outcome of the test.

    Attributes
    ----------
    p_value : share of the draws that reach the statistic, the measurements included
    statistic : log of the average Bayes factor against the declared model
    raised : whether the declared model lacks something at the level of the settings
    """

    p_value: float
    statistic: float
    raised: bool


def run_alarm_test(
    problem: SearchProblem,
    products: CrossProducts,
    pose_error_rad: float,
    stream: np.random.Generator,
) -> Alarm:
    """Test whether the declared model lacks anything.

    Parameters
    ----------
    problem : statistics of the measurements, and terms
    products : products from which simulated measurements are drawn
    pose_error_rad : pose error of the declared model, with which to simulate
    stream : random numbers
    """
    draws = problem.settings.alarm_draws
    average = _AverageBayesFactor.about(problem, pose_error_rad)
    statistics = average.problem.statistics
    statistic = float(
        average.log_values(
            statistics.score[..., None], statistics.residual_squares[:, None]
        )[0]
    )
    reached = 0
    if statistic <= np.log(_BEYOND_DRAWS * (1 + draws)):
        score, residual_squares = simulate_null_statistics(
            products, pose_error_rad, statistics.pose_error_rad, draws, stream
        )
        simulated = average.log_values(score, residual_squares)
        reached = int((simulated >= statistic).sum())
    p_value = (1 + reached) / (1 + draws)
    return Alarm(p_value, statistic, p_value <= problem.settings.alarm_level)


@dataclass(frozen=True)
class _AverageBayesFactor:
    """The statistic of the test, for any number of data sets of one design.

    Attributes
    ----------
    problem : with statistics at T sizes of the pose error
    base : (T,), what each of them contributes by itself, with its prior
    alternatives : every term, and every whole mechanism
    log_priors : (number of alternatives,), their log prior odds
    blocks : the alternatives by their number of columns
    """

    problem: SearchProblem
    base: np.ndarray
    alternatives: list[ModelTerm]
    log_priors: np.ndarray
    blocks: list[TermBlock]

    @classmethod
    def about(
        cls, problem: SearchProblem, pose_error_rad: float
    ) -> _AverageBayesFactor:
        """The statistic at the sizes of the pose error that draws with the fitted one
        can make likely: that size, and some to either side."""
        index = problem.statistics.nearest(pose_error_rad)
        near = slice(max(index - POSE_ERROR_REACH, 0), index + POSE_ERROR_REACH + 1)
        statistics = problem.statistics.at(near)
        base = (problem.statistics.log_likelihood + problem.log_pose)[near]
        alternatives, log_priors = _list_alternatives(problem)
        single = len(problem.terms)
        blocks = [block.at(near) for block in problem.blocks]
        blocks += TermBlock.group(statistics, alternatives[single:], single)
        return cls(
            replace(problem, statistics=statistics),
            base,
            alternatives,
            log_priors,
            blocks,
        )

    def log_values(self, score: np.ndarray, residual_squares: np.ndarray) -> np.ndarray:
        """Log of the average Bayes factor of N data sets, (N,).

        Parameters
        ----------
        score : (T, K, N), as of `SufficientStatistics`
        residual_squares : (T, N)
        """
        likelihood = log_likelihood(
            residual_squares, self.problem.statistics.degrees_of_freedom
        )
        nothing = log_sum_exp(self.base[:, None] + likelihood, axis=0)
        total = np.full(len(nothing), -np.inf)
        step = max(
            _AT_ONCE // (residual_squares.size * len(self.problem.grid.scales)), 1
        )
        for block in self.blocks:
            for start in range(0, len(block.numbers), step):
                chosen = slice(start, start + step)
                terms = self._log_terms(block, chosen, score, residual_squares)
                total = np.logaddexp(total, log_sum_exp(terms, axis=(0, 1, 2)))
        return total - nothing

    def _log_terms(
        self,
        block: TermBlock,
        chosen: slice,
        score: np.ndarray,
        residual_squares: np.ndarray,
    ) -> np.ndarray:
        """Log joint densities (T, u, s, N) of u alternatives of a block at s scales."""
        numbers = block.numbers[chosen]
        alternatives = [self.alternatives[number] for number in numbers.tolist()]
        # One scale below the smallest one of the posterior.
        smallest = [max(term.smallest - 1, 0) for term in alternatives]
        scales = slice(min(smallest), None)
        log_weights = [
            self.problem.grid.log_weights_by_range[first, term.largest][scales]
            for first, term in zip(smallest, alternatives, strict=True)
        ]
        variances = self.problem.grid.scales[scales, None] ** 2
        widened = 1.0 + variances * block.eigenvalues[:, chosen, None]
        eigenvectors = block.eigenvectors[:, chosen].swapaxes(-1, -2)
        by_axis = (eigenvectors @ score[:, block.columns[chosen]]) ** 2
        squares = residual_squares[:, None, None] - (variances / widened) @ by_axis
        log_prior = (
            self.base[:, None, None]
            - 0.5 * np.log(widened).sum(axis=3)
            + np.array(log_weights)
        )
        log_prior += self.log_priors[numbers, None]
        likelihood = log_likelihood(squares, self.problem.statistics.degrees_of_freedom)
        return likelihood + log_prior[..., None]


def _list_alternatives(problem: SearchProblem) -> tuple[list[ModelTerm], np.ndarray]:
    """Every term, and every mechanism with one variant at all its locations in one
    scale; with their log prior odds."""
    alternatives = list(problem.terms)
    log_priors = problem.initial_search.single_term_log_prior.tolist()
    variants: dict[tuple[str, str, tuple[float, ...]], list[ModelTerm]] = {}
    for term in problem.terms:
        if term.candidate:
            variant = term.mechanism, term.candidate.detail, term.shapes
            variants.setdefault(variant, []).append(term)
    for terms in variants.values():
        locations = {term.location for term in terms}
        if len(locations) == len(terms) > 1:
            columns = np.concatenate([term.columns for term in terms])
            smallest = min(term.smallest for term in terms)
            alternatives.append(replace(terms[0], columns=columns, smallest=smallest))
            # One choice among the variants, not one at each location.
            repeated_choices = (len(terms) - 1) * terms[0].log_prior
            log_priors.append(problem.prior.compute_log_odds(terms) - repeated_choices)
    return alternatives, np.array(log_priors)
