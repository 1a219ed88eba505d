"""Posterior over models: extend the best, drop what is not needed, weigh all that were
met.

A model is a set of units. From the declared model on, and from each mechanism at all
its locations, the best few models met are extended by every unit and shrunk by each of
theirs: a beam search over the neighbours of shotgun stochastic search (Hans, Dobra and
West, JASA 2007). What lies in Occam's window (Madigan and Raftery, JASA 1994) is
evaluated in full.

Whether anything is missing at all is one Monte Carlo test (`alarm_of`). Its statistic
is the log of the average Bayes factor, over all units and all whole mechanisms, against
"nothing" (Good, The Bayes/non-Bayes compromise, JASA 1992); its null distribution that
of simulated measurements of the same design at the pose error that fits best, averaged
over anew each time: a parametric bootstrap (Davison and Hinkley, Bootstrap Methods,
1997, 4.2), without a correction for many tests. Sizes begin a step below those of the
posterior: what lies between may be seen. Where nothing is missing a Bayes factor
exceeds b with a probability of at most 1/b (Markov's inequality): where b is far beyond
the number of draws, none is made.
"""

from __future__ import annotations

from bisect import bisect
from collections import Counter
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import nlargest
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from elastocal.diagnosis.evidence import (
    ModelEvidence,
    SizeGrid,
    TermBlock,
    compute_pose_error_log_prior,
    evaluate_extensions,
    evaluate_model,
    log_likelihood,
    log_sum_exp,
)
from elastocal.diagnosis.hypotheses import (
    OTHER,
    ModelPrior,
    ModelTerm,
    build_model_prior,
)
from elastocal.diagnosis.statistics import (
    CrossProducts,
    SufficientStatistics,
    simulate_null_statistics,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from elastocal.diagnosis.settings import Settings

# Models below the best by more than this, in log odds, hold nothing.
_NEGLIGIBLE = 9.0
# A round that raises the best by less than this brings nothing.
_BETTER = 0.1
# Sizes of the pose error with less than this, in log probability, under all of so many
# good single units are left out.
NEGLIGIBLE_LOG_WEIGHT = -9.0
_TELLING_UNITS = 10
# Sizes with less than this under the best model met so far are left out from there on:
# what comes near to that model differs from it by a few units, which over a hundred
# orders of magnitude do not hang on.
_OUT_OF_QUESTION = -300.0
# Terms of Bayes factors that are in a cache at once.
_AT_ONCE = 10_000
# Steps of the grid of the pose error to either side that measurements simulated with
# one size can make likely.
_REACH = 2
# Bayes factor over the number of draws, the measurements' own included, beyond which
# none is made. The mean of one is that over the prior of the pose error; at the fitted
# one it is larger by at most the inverse of that one's prior probability.
_BEYOND_DRAWS = 1e4


@dataclass(frozen=True)
class SearchProblem:
    """Everything that a search needs."""

    statistics: SufficientStatistics
    terms: tuple[ModelTerm, ...]
    settings: Settings

    @cached_property
    def prior(self) -> ModelPrior:
        """Of all models that the units can form."""
        return build_model_prior(self.terms, self.settings)

    @cached_property
    def grid(self) -> SizeGrid:
        """Sizes of a unit."""
        return SizeGrid.from_settings(self.settings)

    @cached_property
    def blocks(self) -> list[TermBlock]:
        """Of all units."""
        return TermBlock.of(self.statistics, self.terms)

    @property
    def log_pose(self) -> np.ndarray:
        """Logarithm of the prior weight of each size of the pose error, ndarray
        (T,)."""
        return compute_pose_error_log_prior(
            self.statistics.pose_error_rad, self.settings
        )

    @cached_property
    def started(self) -> _Searcher:
        """A search that has met the declared model and each unit alone."""
        return _Searcher(self)

    def scaled_columns(
        self, numbers: Sequence[int], scales: Sequence[float] | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Columns of some units of given sizes, (D,), and the prior standard deviation
        of each, in plausible sizes."""
        columns = [self.terms[number].columns for number in numbers]
        return np.concatenate([np.zeros(0, int), *columns]), np.repeat(
            scales, [len(each) for each in columns]
        )

    def find_mode(self, model: ScoredModel) -> tuple[np.ndarray, np.ndarray, int]:
        """Columns of a model (D,), their most probable coefficients at its sizes, and
        the place of its pose error."""
        columns, deviations = self.scaled_columns(model.term_indices, model.scales)
        place = self.statistics.nearest(model.pose_error_rad)
        gram = self.statistics.at(slice(place, place + 1)).between(columns, columns)[0]
        inner = deviations[:, None] * gram * deviations + np.eye(len(columns))
        along = deviations * self.statistics.score[place, columns]
        return columns, deviations * solve_positive_definite(inner, along), place


@dataclass(frozen=True)
class ScoredModel:
    """One set of units, rising, with its posterior log odds against the declared model
    alone.

    `scales` (m,), `pose_error_rad`: most probable sizes of each unit, and of the error
    common to the measurements of a pose.
    """

    term_indices: tuple[int, ...]
    log_odds: float
    scales: np.ndarray
    pose_error_rad: float


@dataclass(frozen=True)
class Posterior:
    """Models in the order of their probability. `probabilities` (M,): "Nothing" among
    them."""

    models: tuple[ScoredModel, ...]
    probabilities: np.ndarray

    @property
    def empty_model(self) -> ScoredModel:
        """The declared model alone."""
        return next(model for model in self.models if not model.term_indices)


def solve_positive_definite(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of equations with a symmetric positive matrix, by Cholesky's factor; of
    none, at which LAPACK balks, nothing."""
    return lapack.dposv(matrix, right)[1] if len(matrix) else right


def screen_terms(problem: SearchProblem) -> tuple[ScoredModel, np.ndarray]:
    """The declared model alone, and each unit alone against it. Returns
    `log_bayes_factors` (number of units,)."""
    met = [problem.started.met[number,] for number in range(len(problem.terms))]
    return problem.started.measured[()], np.array(met) - problem.started.first


def search_models(problem: SearchProblem, known: Collection[str] = ()) -> Posterior:
    """Search the models. `known`: keys of the candidates of a good model, from which
    the search starts, too."""
    searcher = problem.started.again()
    units = problem.terms
    # Each mechanism at all its locations, and the model that is known, each with the
    # best variant at each place.
    mechanisms = dict.fromkeys(
        unit.mechanism for unit in units if unit.mechanism != OTHER
    )
    starts = [
        searcher.best_variants(
            n for n, unit in enumerate(units) if unit.mechanism == name
        )
        for name in mechanisms
    ]
    starts = [
        start for start in starts if 1 < len(start) <= problem.settings.largest_model
    ]
    starts.append(
        searcher.best_variants(
            n
            for n, unit in enumerate(units)
            if unit.candidate and unit.candidate.key in known
        )
    )
    for start in filter(None, starts):
        searcher.measure(start)
    searcher.grow()
    return searcher.weigh()


def select_pose_errors(
    statistics: SufficientStatistics, settings: Settings
) -> np.ndarray:
    """Which sizes of the pose error "nothing" makes likely, or smaller, (T,) of bool:
    what a model adds leaves no more to it.

    And up to `_REACH` steps beyond the most likely, for measurements that are simulated
    with that may look like more.

    `statistics`: of the declared model alone.
    """
    weights = SearchProblem(statistics, (), settings).started.empty.log_pose
    largest = max(
        np.flatnonzero(weights > weights.max() + NEGLIGIBLE_LOG_WEIGHT)[-1],
        np.argmax(weights) + _REACH,
    )
    return np.arange(len(weights)) <= largest


class _Searcher:
    """Models met so far with their approximate log odds, and the sizes at which they
    were met."""

    def __init__(self, problem: SearchProblem) -> None:
        self.problem, self.grid = problem, problem.grid
        self.statistics = problem.statistics
        self.log_pose = problem.log_pose
        self.blocks = problem.blocks
        self.weights = np.array([self.grid.of(unit) for unit in problem.terms]).reshape(
            -1, len(self.grid.scales)
        )
        self.first = np.array([problem.prior.added(unit, 0) for unit in problem.terms])
        numbers: dict[object, int] = {}
        self.places = np.array(
            [numbers.setdefault(unit.place, len(numbers)) for unit in problem.terms],
            int,
        )
        self.empty = self.evaluated((), ())
        self.met: dict[tuple[int, ...], float] = {(): 0.0}
        self.sizes: dict[tuple[int, ...], tuple[float, ...]] = {(): ()}
        self.measured: dict[tuple[int, ...], ScoredModel] = {}
        self.extended: set[tuple[int, ...]] = set()
        self.extend(())
        self.measure(())

    def again(self) -> _Searcher:
        """One that goes on from here, and leaves this one as it is."""
        found = copy(self)
        vars(found).update(
            {
                name: each.copy()
                for name, each in vars(self).items()
                if isinstance(each, dict | set)
            }
        )
        return found

    def evaluated(
        self, model: tuple[int, ...], start: Iterable[float]
    ) -> ModelEvidence:
        """Evidence of a model in full."""
        return evaluate_model(
            self.statistics,
            [self.problem.terms[n] for n in model],
            self.grid,
            self.log_pose,
            start,
        )

    def extend(self, model: tuple[int, ...]) -> None:
        """Meet a model with each single unit added."""
        if len(model) >= self.problem.settings.largest_model:
            return
        self.extended.add(model)
        units = self.problem.terms
        sizes = self.sizes[model]
        open_units = np.flatnonzero(~np.isin(self.places, self.places[list(model)]))
        if not len(open_units):
            return
        base = self.statistics.log_likelihood + self.log_pose
        given = self.problem.scaled_columns(model, sizes)
        before, by_pose_error = evaluate_extensions(
            self.statistics, base, given, self.blocks, self.grid
        )
        by_pose_error += self.weights
        found = log_sum_exp(by_pose_error, axis=0)
        total = log_sum_exp(found, axis=1)
        if not model:
            # Without the sizes of the pose error that neither "nothing" nor any good
            # single unit makes likely.
            weights = log_sum_exp(
                by_pose_error[:, np.argsort(-total)[:_TELLING_UNITS]], axis=2
            )
            weights = np.column_stack(
                [weights - log_sum_exp(weights, axis=0), self.empty.log_pose]
            )
            self.keep_pose_errors(
                np.flatnonzero((weights > NEGLIGIBLE_LOG_WEIGHT).any(axis=1))
            )
            self.empty = self.evaluated((), self.empty.scales)
        # What the sizes already in the model are worth as they are, against their
        # average: the same for all extensions.
        gained = (total + (self.met[model] - log_sum_exp(before))).tolist()
        prior = self.problem.prior
        mechanisms = Counter(units[n].mechanism for n in model)
        first = self.first.tolist()
        best = self.grid.scales[found.argmax(axis=1)].tolist()
        for number in open_units.tolist():
            count = mechanisms.get(units[number].mechanism)
            odds = gained[number] + (
                prior.added(units[number], count) if count else first[number]
            )
            place = bisect(model, number)
            key = (*model[:place], number, *model[place:])
            if odds > self.met.get(key, -np.inf):
                self.met[key] = odds
                self.sizes[key] = (*sizes[:place], best[number], *sizes[place:])

    def keep_pose_errors(self, kept: np.ndarray) -> None:
        """Go on with some of the sizes of the pose error alone; their statistics are
        copied where there are others."""
        if len(kept) < len(self.log_pose):
            self.statistics = self.statistics.at(kept)
            self.log_pose = self.log_pose[kept]
            self.blocks = [each.at(kept) for each in self.blocks]

    def measure(self, model: tuple[int, ...]) -> ScoredModel:
        """Meet a model as it is, in full, and what it would be without each of its
        units."""
        found = self.evaluated(
            model,
            self.sizes.get(model, (self.problem.settings.scale_center,) * len(model)),
        )
        units = self.problem.terms
        prior = self.problem.prior
        whole = prior.compute_log_odds(units[n] for n in model)
        counts = Counter(units[n].mechanism for n in model)
        odds = found.log_evidence - self.empty.log_evidence + whole
        self.met[model] = odds
        self.sizes[model] = tuple(found.scales.tolist())
        pose_error_rad = float(
            self.statistics.pose_error_rad[np.argmax(found.log_pose)]
        )
        self.measured[model] = ScoredModel(model, odds, found.scales, pose_error_rad)
        if odds == max(self.met.values()):
            self.keep_pose_errors(np.flatnonzero(found.log_pose > _OUT_OF_QUESTION))
        for place, number in enumerate(model):
            smaller = model[:place] + model[place + 1 :]
            if smaller not in self.met:
                left = found.without[place] - self.empty.log_evidence
                self.met[smaller] = (
                    left
                    + whole
                    - prior.added(units[number], counts[units[number].mechanism] - 1)
                )
                self.sizes[smaller] = (
                    self.sizes[model][:place] + self.sizes[model][place + 1 :]
                )
        return self.measured[model]

    def best_variants(self, numbers: Iterable[int]) -> tuple[int, ...]:
        """Of some units the best at each place, rising."""
        best: dict[tuple[str, tuple[int | str, ...], str], tuple[int]] = {}
        for number in numbers:
            place = self.problem.terms[number].place
            best[place] = max(
                best.get(place, (number,)), (number,), key=self.met.__getitem__
            )
        return tuple(sorted(number for (number,) in best.values()))

    def grow(self) -> None:
        """Extend the best models that have not been, in rounds, until rounds bring
        nothing better.

        There are as many as lead to the largest model and back at most: extensions are
        met at sizes of the others that they may not keep, and where they promise more
        than they hold something seems to get better without an end.
        """
        settings = self.problem.settings
        idle = 0
        rising = False
        for _ in range(2 * settings.largest_model):
            if idle >= settings.patience:
                break
            best = max(self.met.values())
            waiting = [
                m
                for m, odds in self.met.items()
                if m not in self.extended and odds > best - _NEGLIGIBLE
            ]
            if not waiting:
                break
            # While the best gets better, it alone is followed; where it does not, there
            # is time for others.
            for model in nlargest(
                1 if rising else settings.beam, waiting, key=self.met.__getitem__
            ):
                if model not in self.measured:
                    self.measure(model)
                self.extend(model)
            gained = max(self.met.values()) - best
            rising = gained > _BETTER
            idle = 0 if rising else idle + 1

    def weigh(self) -> Posterior:
        """Evaluate the best models in full."""
        best = max(self.met.values())
        good = [model for model, odds in self.met.items() if odds > best - _NEGLIGIBLE]
        order = nlargest(
            self.problem.settings.kept_models, good, key=self.met.__getitem__
        )
        models = [self.measured.get(model) or self.measure(model) for model in order]
        if () not in order:
            models.append(self.measured[()])
        models.sort(key=lambda model: -model.log_odds)
        odds = np.array([model.log_odds for model in models])
        return Posterior(tuple(models), np.exp(odds - log_sum_exp(odds)))


@dataclass(frozen=True)
class Alarm:
    """Outcome of the test; `statistic`: log of the average Bayes factor against
    "nothing"."""

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

    `pose_error_rad`: pose error of the declared model at which measurements are
    simulated.
    """
    settings = problem.settings
    statistics = problem.statistics
    # Sizes that draws of the fitted one can make likely: its own, and some to either
    # side.
    place = statistics.nearest(pose_error_rad)
    chosen = slice(max(place - _REACH, 0), place + _REACH + 1)
    statistics, base = (
        statistics.at(chosen),
        (statistics.log_likelihood + problem.log_pose)[chosen],
    )
    tested, log_priors = _alternatives(problem)
    of_others = TermBlock.of(statistics, tested[len(problem.terms) :])
    blocks = [each.at(chosen) for each in problem.blocks]
    blocks += [
        replace(each, numbers=each.numbers + len(problem.terms)) for each in of_others
    ]

    def average_bayes_factors(along: np.ndarray, squares: np.ndarray) -> np.ndarray:
        """Logarithms of N sets of measurements, ndarray (N,). `along` (T, K, N),
        `squares` (T, N)."""
        nothing = log_sum_exp(
            base[:, None] + log_likelihood(squares, statistics.degrees_of_freedom),
            axis=0,
        )
        total = np.full(len(nothing), -np.inf)
        variances = problem.grid.scales**2
        step = max(_AT_ONCE // (squares.size * len(variances)), 1)
        for block, (values, vectors) in ((block, block.axes) for block in blocks):
            for start in range(0, len(block.numbers), step):
                some = slice(start, start + step)
                units = [tested[number] for number in block.numbers[some].tolist()]
                # A step below the sizes of the posterior.
                firsts = [max(unit.smallest - 1, 0) for unit in units]
                sizes = slice(min(firsts), None)
                weights = [
                    problem.grid.between(first, unit.largest)[sizes]
                    for first, unit in zip(firsts, units, strict=True)
                ]
                widened = 1.0 + variances[sizes, None] * values[:, some, None]
                turned = (
                    vectors[:, some].swapaxes(-1, -2) @ along[:, block.columns[some]]
                ) ** 2
                left = (
                    squares[:, None, None] - (variances[sizes, None] / widened) @ turned
                )
                known = (
                    base[:, None, None]
                    - 0.5 * np.log(widened).sum(axis=3)
                    + np.array(weights)
                )
                known += log_priors[block.numbers[some], None]
                terms = (
                    log_likelihood(left, statistics.degrees_of_freedom)
                    + known[..., None]
                )
                total = np.logaddexp(total, log_sum_exp(terms, axis=(0, 1, 2)))
        return total - nothing

    statistic = float(
        average_bayes_factors(
            statistics.score[..., None], statistics.residual_squares[:, None]
        )[0]
    )
    reached = 0
    if statistic <= np.log(_BEYOND_DRAWS * (1 + settings.alarm_draws)):
        drawn = simulate_null_statistics(
            products,
            pose_error_rad,
            statistics.pose_error_rad,
            settings.alarm_draws,
            stream,
        )
        reached = int((average_bayes_factors(*drawn) >= statistic).sum())
    p_value = (1 + reached) / (1 + settings.alarm_draws)
    return Alarm(p_value, statistic, p_value <= settings.alarm_level)


def _alternatives(problem: SearchProblem) -> tuple[list[ModelTerm], np.ndarray]:
    """Every unit, and every mechanism with one law at all its locations in one size;
    with their log prior odds."""
    prior = problem.prior
    alternatives = list(problem.terms)
    log_priors = problem.started.first.tolist()
    laws: dict[tuple[str, str, tuple[float, ...]], list[ModelTerm]] = {}
    for unit in problem.terms:
        if unit.candidate:
            laws.setdefault(
                (unit.mechanism, unit.candidate.detail, unit.shapes), []
            ).append(unit)
    for units in laws.values():
        if len({unit.location for unit in units}) == len(units) > 1:
            columns = np.concatenate([unit.columns for unit in units])
            smallest = min(unit.smallest for unit in units)
            alternatives.append(replace(units[0], columns=columns, smallest=smallest))
            log_priors.append(
                prior.compute_log_odds(units) - (len(units) - 1) * units[0].log_prior
            )
    return alternatives, np.array(log_priors)
