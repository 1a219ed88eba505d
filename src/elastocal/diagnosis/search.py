"""Posterior over models: a beam search that extends the best models by single terms,
drops terms that are not needed, and weighs all models that it met.

A model is a set of terms. From the declared model on, and from each mechanism at all
its locations, the best few models met so far are extended by every term and shrunk by
each of theirs: a beam search over the neighbourhoods of shotgun stochastic search
(Hans, Dobra and West, JASA 2007). The models in Occam's window (Madigan and Raftery,
JASA 1994) are evaluated in full.
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
    log_sum_exp,
)
from elastocal.diagnosis.hypotheses import (
    GROSS_ERROR,
    OTHER,
    ModelPrior,
    ModelTerm,
    build_model_prior,
)
from elastocal.diagnosis.statistics import SufficientStatistics

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from elastocal.diagnosis.settings import Settings

    TermSet = tuple[int, ...]
    # Terms, pose error and scales of a model; its columns and coefficients at the index
    # of that pose error.
    ModelKey = tuple[TermSet, float, tuple[float, ...]]
    Mode = tuple[np.ndarray, np.ndarray, int]

# Occam's window in log odds: models this far below the best one hold no probability
# that is reported.
_OCCAM_WINDOW = 9.0
# A round counts as an improvement if it raises the best log odds by more than this.
_BETTER = 0.1
# Sizes of the pose error are dropped if their log weight is below this under the
# declared model and under each of the best single terms, of which this many count.
NEGLIGIBLE_LOG_WEIGHT = -9.0
_TELLING_TERMS = 10
# Sizes of the pose error with a log weight below this under the best model met so far
# are dropped for the rest of the search. Models that come near to the best one differ
# from it by a few terms, which cannot make up for a hundred orders of magnitude.
_HOPELESS_LOG_WEIGHT = -300.0
# Below this log weight under a model, a size of the pose error counts for nothing under
# its neighbours, which have one term more or less.
_NEGLIGIBLE_FOR_NEIGHBOURS = -40.0
# A model is evaluated at the sizes that are likely under its neighbour, and at further
# ones as long as their log weight may be above this.
_NEGLIGIBLE_FURTHER = -25.0
# Steps in the grid of the pose error, to either side of its size, that measurements
# simulated with this size can make likely.
POSE_ERROR_REACH = 2


@dataclass(frozen=True)
class SearchProblem:
    """Everything that a search needs: statistics of the data, and terms to choose from.

    What is derived from them is computed when it is first asked for.
    """

    statistics: SufficientStatistics
    terms: tuple[ModelTerm, ...]
    settings: Settings

    @cached_property
    def prior(self) -> ModelPrior:
        """Prior of all models that the terms can form."""
        return build_model_prior(self.terms, self.settings)

    @cached_property
    def grid(self) -> SizeGrid:
        """Scales of a term."""
        return SizeGrid.from_settings(self.settings)

    @cached_property
    def blocks(self) -> list[TermBlock]:
        """The terms by their number of columns."""
        return TermBlock.group(self.statistics, self.terms)

    @property
    def log_pose(self) -> np.ndarray:
        """Log prior weight (T,) of each size of the pose error."""
        return compute_pose_error_log_prior(
            self.statistics.pose_error_rad, self.settings
        )

    @cached_property
    def initial_search(self) -> BeamSearch:
        """A search that has met the declared model and each single term.

        It refers to a copy of this problem: objects that refer to each other are
        released late, and with them the statistics of former searches.
        """
        return BeamSearch(replace(self), self.blocks)

    def scaled_columns(
        self, numbers: Sequence[int], scales: Sequence[float] | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Columns (D,) of some terms of given scales, and the prior standard deviation
        (D,) of each, in plausible sizes."""
        columns = [self.terms[number].columns for number in numbers]
        widths = [len(of_term) for of_term in columns]
        return np.concatenate([np.zeros(0, int), *columns]), np.repeat(scales, widths)

    def find_mode(self, model: ScoredModel) -> Mode:
        """Find the most probable coefficients of a model at its scales.

        Returns
        -------
        columns : (D,) int
        coefficients : (D,), in plausible sizes
        pose_error_index : index of the model's pose error
        """
        key = model.term_indices, model.pose_error_rad, tuple(model.scales.tolist())
        if key not in self._modes:
            self._modes[key] = self._compute_mode(model)
        return self._modes[key]

    @cached_property
    def _modes(self) -> dict[ModelKey, Mode]:
        """Modes that have been asked for."""
        return {}

    def _compute_mode(self, model: ScoredModel) -> Mode:
        columns, deviations = self.scaled_columns(model.term_indices, model.scales)
        index = self.statistics.nearest(model.pose_error_rad)
        gram = self.statistics.at(slice(index, index + 1)).gram_blocks(columns)[0]
        precision = deviations[:, None] * gram * deviations + np.eye(len(columns))
        score = deviations * self.statistics.score[index, columns]
        scaled = solve_positive_definite(precision, score)
        return columns, deviations * scaled, index


@dataclass(frozen=True)
class ScoredModel:
    """One set of terms, evaluated in full.

    Attributes
    ----------
    term_indices : indices of its m terms, rising
    log_odds : posterior log odds against the declared model alone
    scales : (m,), most probable scale of each term
    pose_error_rad : most probable error that the measurements of a pose have in common
    likely_pose_errors_rad : smallest and largest size of it that has any probability
    """

    term_indices: TermSet
    log_odds: float
    scales: np.ndarray
    pose_error_rad: float
    likely_pose_errors_rad: tuple[float, float] = (0.0, np.inf)


@dataclass(frozen=True)
class Posterior:
    """Models, the most probable first, among them the declared model alone.

    Attributes
    ----------
    models : M models
    probabilities : (M,)
    """

    models: tuple[ScoredModel, ...]
    probabilities: np.ndarray

    @property
    def empty_model(self) -> ScoredModel:
        """The declared model alone."""
        return next(model for model in self.models if not model.term_indices)


def solve_positive_definite(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve equations with a symmetric positive matrix by Cholesky's method.

    LAPACK rejects empty systems; their solution is empty.
    """
    return lapack.dposv(matrix, right)[1] if len(matrix) else right


def screen_terms(problem: SearchProblem) -> tuple[ScoredModel, np.ndarray]:
    """Return the declared model alone, and the log Bayes factor of each single term
    against it (number of terms,)."""
    search = problem.initial_search
    log_odds = [search.log_odds[number,] for number in range(len(problem.terms))]
    return search.evaluated[()], np.array(log_odds) - search.single_term_log_prior


def search_models(
    problem: SearchProblem, known_keys: Collection[str] = ()
) -> Posterior:
    """Search the models.

    Parameters
    ----------
    problem : statistics and terms
    known_keys : keys of the candidates of a good model, at which the search starts, too
    """
    search = problem.initial_search.duplicate()
    terms = problem.terms
    # Start at each mechanism with the best variant at each of its locations.
    mechanisms = dict.fromkeys(
        term.mechanism for term in terms if term.mechanism != OTHER
    )
    starts = []
    for mechanism in mechanisms:
        numbers = (n for n, term in enumerate(terms) if term.mechanism == mechanism)
        start = search.choose_best_variants(numbers)
        if 1 < len(start) <= problem.settings.largest_model:
            starts.append(start)
    numbers = (
        n
        for n, term in enumerate(terms)
        if term.candidate and term.candidate.key in known_keys
    )
    starts.append(search.choose_best_variants(numbers))
    for start in starts:
        if start:
            search.evaluate(start)
    search.grow()
    return search.weigh()


def search_from_starts(
    problem: SearchProblem, search: BeamSearch, starts: Iterable[TermSet]
) -> BeamSearch:
    """Search the models of a problem from several starts, each by itself, and return a
    search that has met all their models beside those that `search` had met.

    Single additions and deletions may not lead from one good model to another: between
    many gross errors and the one effect that explains them all, every model is worse
    than both.
    """
    merged = search.duplicate()
    for start in starts:
        from_start = problem.initial_search.duplicate()
        # The neighbours of a model that another start led to are known.
        from_start.extended |= merged.extended
        from_start.evaluate(start)
        # The declared model has been extended already.
        from_start.add_gross_errors(start)
        from_start.grow()
        merged.absorb(from_start)
    return merged


def select_pose_errors(
    statistics: SufficientStatistics, settings: Settings
) -> np.ndarray:
    """Select sizes of the pose error, (T,) bool, that can matter for any model.

    These are all sizes up to the largest one that the declared model alone makes
    likely, because whatever a model adds leaves less to the pose error. Simulated
    measurements may show more of it, so that the selection reaches at least a few steps
    beyond the most likely size.

    Parameters
    ----------
    statistics : of the declared model alone
    settings : settings of the diagnosis
    """
    problem = SearchProblem(statistics, (), settings)
    weights = problem.initial_search.empty_evidence.log_pose_posterior
    largest_likely = np.flatnonzero(weights > weights.max() + NEGLIGIBLE_LOG_WEIGHT)[-1]
    largest = max(largest_likely, np.argmax(weights) + POSE_ERROR_REACH)
    return np.arange(len(weights)) <= largest


class BeamSearch:
    """A search over sets of terms, with all models that it has met.

    Parameters
    ----------
    problem : statistics and terms
    blocks : the terms by their number of columns

    Attributes
    ----------
    statistics : those of the problem, at the sizes of the pose error that remain likely
    single_term_log_prior : (number of terms,), log prior odds of each single term
    empty_evidence : of the declared model alone
    log_odds : approximate posterior log odds of each model that was met
    scales : scale of each term at which the log odds were obtained
    neighbours : the model with one term more or less by which a model was met
    evaluated : models that were evaluated in full
    extended : models that were extended by every term
    """

    def __init__(self, problem: SearchProblem, blocks: list[TermBlock]) -> None:
        self.problem = problem
        self.statistics = problem.statistics
        self.single_term_log_prior = np.array(
            [problem.prior.log_odds_change(term, 0) for term in problem.terms]
        )
        self._log_pose = problem.log_pose
        self._blocks = blocks
        self._log_weights = np.array(
            [problem.grid.log_weights_of(term) for term in problem.terms]
        ).reshape(-1, len(problem.grid.scales))
        self._has_gross_errors = any(
            term.mechanism == GROSS_ERROR for term in problem.terms
        )
        slots: dict[object, int] = {}
        self._slots = np.array(
            [slots.setdefault(term.slot, len(slots)) for term in problem.terms], int
        )
        self.log_odds: dict[TermSet, float] = {(): 0.0}
        self.scales: dict[TermSet, tuple[float, ...]] = {(): ()}
        self.neighbours: dict[TermSet, TermSet] = {}
        self.evaluated: dict[TermSet, ScoredModel] = {}
        self.extended: set[TermSet] = set()
        self.empty_evidence, _ = self._evaluate_in_full((), ())
        self.extend(())
        self.evaluate(())

    def duplicate(self) -> BeamSearch:
        """A search that continues from here and leaves this one as it is."""
        duplicate = copy(self)
        duplicate.log_odds = self.log_odds.copy()
        duplicate.scales = self.scales.copy()
        duplicate.neighbours = self.neighbours.copy()
        duplicate.evaluated = self.evaluated.copy()
        duplicate.extended = self.extended.copy()
        return duplicate

    def absorb(self, search: BeamSearch) -> None:
        """Take over the models that another search of the same problem has met."""
        for model, log_odds in search.log_odds.items():
            if log_odds > self.log_odds.get(model, -np.inf):
                self.log_odds[model] = log_odds
                self.scales[model] = search.scales[model]
        self.neighbours |= search.neighbours
        self.evaluated |= search.evaluated
        self.extended |= search.extended

    def extend(self, model: TermSet) -> None:
        """Meet a model with each single term added."""
        if len(model) >= self.problem.settings.largest_model:
            return
        self.extended.add(model)
        # Terms of a slot exclude each other.
        open_terms = np.flatnonzero(~np.isin(self._slots, self._slots[list(model)]))
        if not len(open_terms):
            return
        likely = self._select_likely_pose_errors(model)
        statistics = self.statistics.at(likely)
        before, by_pose_error = evaluate_extensions(
            statistics,
            statistics.log_likelihood + self._log_pose[likely],
            self.problem.scaled_columns(model, self.scales[model]),
            [block.at(likely).select(open_terms) for block in self._blocks],
            self.problem.grid,
        )
        by_pose_error += self._log_weights[open_terms]
        by_scale = log_sum_exp(by_pose_error, axis=0)
        if not model:
            self._drop_unlikely_pose_errors(by_pose_error, by_scale)
        log_evidence = float(log_sum_exp(before))
        self._meet_extensions(model, open_terms, log_evidence, by_scale)

    def _select_likely_pose_errors(self, model: TermSet) -> slice:
        """Select the sizes of the pose error that are likely under a model, or under
        the neighbour by which it was met if it has not been evaluated.

        These are all sizes if neither has been evaluated, or if the search has dropped
        the likely ones since.
        """
        evaluated = self.evaluated.get(model) or self.evaluated.get(
            self.neighbours.get(model, model)
        )
        sizes = self.statistics.pose_error_rad
        smallest, largest = (0.0, np.inf)
        if evaluated is not None:
            smallest, largest = evaluated.likely_pose_errors_rad
        first = int(np.searchsorted(sizes, smallest))
        stop = int(np.searchsorted(sizes, largest, "right"))
        return slice(first, stop) if first < stop else slice(0, len(sizes))

    def _drop_unlikely_pose_errors(
        self, by_pose_error: np.ndarray, by_scale: np.ndarray
    ) -> None:
        """Drop the sizes of the pose error that neither the declared model nor any good
        single term makes likely.

        Parameters
        ----------
        by_pose_error : (T, number of terms, S), log evidence with each single term
        by_scale : (number of terms, S), its sum over T
        """
        if self._has_gross_errors:
            # As long as gross errors are in the data, they look like a pose error.
            return
        best_terms = np.argsort(-log_sum_exp(by_scale, axis=1))[:_TELLING_TERMS]
        weights = log_sum_exp(by_pose_error[:, best_terms], axis=2)
        weights = np.column_stack(
            [
                weights - log_sum_exp(weights, axis=0),
                self.empty_evidence.log_pose_posterior,
            ]
        )
        self._keep_pose_errors((weights > NEGLIGIBLE_LOG_WEIGHT).any(axis=1))
        self.empty_evidence, _ = self._evaluate_in_full((), ())

    def _meet_extensions(
        self,
        model: TermSet,
        open_terms: np.ndarray,
        log_evidence: float,
        by_scale: np.ndarray,
    ) -> None:
        """Record a model with each open term added, if it was not met with better odds.

        Parameters
        ----------
        model : terms
        open_terms : indices of the terms that may join
        log_evidence : of the model at the scales at which it was met
        by_scale : (number of open terms, S), log evidence with each of these added
        """
        terms = self.problem.terms
        # The model's own scales count as fixed here, as they are not averaged over. The
        # difference is the same for all extensions.
        gains = log_sum_exp(by_scale, axis=1) + (self.log_odds[model] - log_evidence)
        best_scales = self.problem.grid.scales[by_scale.argmax(axis=1)].tolist()
        first_location = self.single_term_log_prior[open_terms].tolist()
        locations = Counter(terms[n].mechanism for n in model)
        scales = self.scales[model]
        for number, gain, best_scale, log_prior in zip(
            open_terms.tolist(),
            gains.tolist(),
            best_scales,
            first_location,
            strict=True,
        ):
            count = locations.get(terms[number].mechanism)
            if count:
                log_prior = self.problem.prior.log_odds_change(terms[number], count)
            index = bisect(model, number)
            larger = (*model[:index], number, *model[index:])
            log_odds = gain + log_prior
            if log_odds > self.log_odds.get(larger, -np.inf):
                self.log_odds[larger] = log_odds
                self.scales[larger] = (
                    *scales[:index],
                    best_scale,
                    *scales[index:],
                )
                self.neighbours[larger] = model

    def _keep_pose_errors(self, kept: np.ndarray | np.bool_) -> None:
        """Continue with some of the sizes of the pose error only, (T,) bool.

        Their statistics are copied if they are not consecutive.
        """
        indices = np.flatnonzero(kept)
        if len(indices) < len(self._log_pose):
            self.statistics = self.statistics.at(indices)
            self._log_pose = self._log_pose[indices]
            self._blocks = [block.at(indices) for block in self._blocks]

    def _evaluate_in_full(
        self, model: TermSet, start: Iterable[float]
    ) -> tuple[ModelEvidence, np.ndarray]:
        """Evaluate a model at the sizes of the pose error that can be likely under it;
        these sizes come second."""
        terms = [self.problem.terms[n] for n in model]
        likely = self._select_likely_pose_errors(model)
        while True:
            statistics = self.statistics.at(likely)
            evidence = evaluate_model(
                statistics, terms, self.problem.grid, self._log_pose[likely], start
            )
            wider = self._widen(likely, evidence.log_pose_posterior)
            if wider == likely:
                return evidence, statistics.pose_error_rad
            likely = wider
            start = evidence.scales

    def _widen(self, sizes: slice, log_weights: np.ndarray) -> slice:
        """Add the next size of the pose error at each end of consecutive ones, unless
        its weight is negligible.

        The log weights fall faster and faster from their peak on, so that the next one
        is at most where a line through the last two leads.
        """
        first = sizes.start
        stop = sizes.stop
        # A single size has no slope: both ends are open.
        slopes = np.diff(log_weights) if len(log_weights) > 1 else np.zeros(1)
        least = log_weights.max() + _NEGLIGIBLE_FURTHER
        if log_weights[0] - slopes[0] > least:
            first = max(first - 1, 0)
        if log_weights[-1] + slopes[-1] > least:
            stop = min(stop + 1, len(self._log_pose))
        return slice(first, stop)

    def evaluate(self, model: TermSet) -> ScoredModel:
        """Evaluate a model in full, and meet it without each of its terms."""
        default_scales = (self.problem.settings.scale_center,) * len(model)
        evidence, sizes = self._evaluate_in_full(
            model, self.scales.get(model, default_scales)
        )
        terms = self.problem.terms
        log_prior = self.problem.prior.compute_log_odds(terms[n] for n in model)
        log_odds = evidence.log_evidence - self.empty_evidence.log_evidence + log_prior
        log_weights = evidence.log_pose_posterior
        likely = sizes[log_weights > log_weights.max() + _NEGLIGIBLE_FOR_NEIGHBOURS]
        scored = ScoredModel(
            model,
            log_odds,
            evidence.scales,
            float(sizes[np.argmax(log_weights)]),
            (float(likely[0]), float(likely[-1])),
        )
        self.log_odds[model] = log_odds
        self.scales[model] = tuple(evidence.scales.tolist())
        self.evaluated[model] = scored
        is_best = log_odds == max(self.log_odds.values())
        if is_best and len(sizes) == len(self._log_pose):
            self._keep_pose_errors(log_weights > _HOPELESS_LOG_WEIGHT)
        self._meet_smaller_models(model, evidence, log_prior)
        return scored

    def _meet_smaller_models(
        self, model: TermSet, evidence: ModelEvidence, log_prior: float
    ) -> None:
        """Record a model without each of its terms, if that was not met yet."""
        terms = self.problem.terms
        locations = Counter(terms[n].mechanism for n in model)
        scales = self.scales[model]
        for index, number in enumerate(model):
            smaller = model[:index] + model[index + 1 :]
            if smaller not in self.log_odds:
                term = terms[number]
                gain = evidence.without[index] - self.empty_evidence.log_evidence
                log_prior_change = self.problem.prior.log_odds_change(
                    term, locations[term.mechanism] - 1
                )
                self.log_odds[smaller] = gain + log_prior - log_prior_change
                self.scales[smaller] = scales[:index] + scales[index + 1 :]
                self.neighbours[smaller] = model

    def choose_best_variants(self, numbers: Iterable[int]) -> TermSet:
        """Of some terms, choose the best single one of each slot; rising indices."""
        best: dict[object, int] = {}
        for number in numbers:
            slot = self.problem.terms[number].slot
            present = best.setdefault(slot, number)
            if self.log_odds[number,] > self.log_odds[present,]:
                best[slot] = number
        return tuple(sorted(best.values()))

    def grow(self) -> None:
        """Extend the best models in rounds until rounds bring no improvement.

        The number of rounds is bounded by the way to the largest model and back.
        Extensions are met at scales of the other terms that they may not keep. If such
        a model promises more than it holds, the rounds would seem to improve for ever.
        """
        settings = self.problem.settings
        idle_rounds = 0
        is_rising = False
        for _ in range(2 * settings.largest_model):
            if idle_rounds >= settings.patience:
                break
            best = max(self.log_odds.values())
            waiting = [
                model for model in self._occams_window() if model not in self.extended
            ]
            if not waiting:
                break
            # Extend only the best model while it keeps improving. Once it stops, spend
            # the remaining rounds on its competitors, too.
            width = 1 if is_rising else settings.beam
            for model in nlargest(width, waiting, key=self.log_odds.__getitem__):
                if model not in self.evaluated:
                    self.evaluate(model)
                self.extend(model)
                self.add_gross_errors(model)
            is_rising = max(self.log_odds.values()) - best > _BETTER
            idle_rounds = 0 if is_rising else idle_rounds + 1

    def add_gross_errors(self, model: TermSet) -> None:
        """Evaluate an extended model with all gross errors together that each gain more
        than any effect would.

        A growing model would add them one after the other. They are of different
        measurements, so that they gain about as much together.
        """
        if not self._has_gross_errors:
            return
        terms = self.problem.terms
        extensions = {
            number: larger
            for number in range(len(terms))
            if (larger := tuple(sorted((*model, number)))) in self.log_odds
        }
        by_effects = [
            self.log_odds[larger]
            for number, larger in extensions.items()
            if terms[number].mechanism != GROSS_ERROR
        ]
        least = max([self.log_odds[model], *by_effects]) + _BETTER
        gross = [
            number
            for number, larger in extensions.items()
            if terms[number].mechanism == GROSS_ERROR and self.log_odds[larger] > least
        ]
        if not gross:
            return
        # Rows of a pose that is wrong as a whole would be explained twice.
        best = max(gross, key=lambda number: self.log_odds[extensions[number]])
        scales = dict(zip(model, self.scales[model], strict=True))
        for number in gross:
            if terms[number].location[0] == terms[best].location[0]:
                larger = extensions[number]
                scales[number] = self.scales[larger][larger.index(number)]
        together = tuple(sorted(scales))
        is_small = len(together) <= self.problem.settings.largest_model
        if is_small and together not in self.log_odds:
            self.scales[together] = tuple(scales[number] for number in together)
            self.evaluate(together)

    def _occams_window(self) -> list[TermSet]:
        """Models whose log odds are close enough to the best ones met so far."""
        least = max(self.log_odds.values()) - _OCCAM_WINDOW
        return [model for model, log_odds in self.log_odds.items() if log_odds > least]

    def find_best_model(self) -> TermSet:
        """Find the most probable model met, evaluated in full."""
        while True:
            best = max(self.log_odds, key=self.log_odds.__getitem__)
            if best in self.evaluated:
                return best
            self.evaluate(best)

    def weigh(self) -> Posterior:
        """Evaluate the best models in full, and return their probabilities."""
        best = nlargest(
            self.problem.settings.kept_models,
            self._occams_window(),
            key=self.log_odds.__getitem__,
        )
        models = [self.evaluated.get(model) or self.evaluate(model) for model in best]
        if () not in best:
            models.append(self.evaluated[()])
        models = [self._correct_for_nothing(model) for model in models]
        models.sort(key=lambda model: -model.log_odds)
        log_odds = np.array([model.log_odds for model in models])
        probabilities = np.exp(log_odds - log_sum_exp(log_odds))
        return Posterior(tuple(models), probabilities)

    def _correct_for_nothing(self, model: ScoredModel) -> ScoredModel:
        """Correct the log odds of a model for the prior probability of nothing, which
        is the same for all models with a mechanism, so that the search needs none."""
        terms = [self.problem.terms[number] for number in model.term_indices]
        correction = self.problem.prior.correct_for_nothing(terms)
        return replace(model, log_odds=model.log_odds + correction)
