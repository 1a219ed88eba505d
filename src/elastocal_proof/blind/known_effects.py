"""Score and test effects that an analyst knows: what the oracle and the search for
alternatives have in common.

References
----------
.. [1] Wald, A., Tests of statistical hypotheses concerning several parameters when the
   number of observations is large, Transactions of the American Mathematical Society 54,
   1943.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.stats import chi2

from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.refit import fit_selected_effects
from elastocal.diagnosis.search import screen_terms
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.noise import set_prior_std

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations

# Level of the tests of the oracle.
LEVEL = 0.05


class ScoredCandidate(NamedTuple):
    """A candidate at its best shapes.

    Attributes
    ----------
    log_bayes_factor
        Of the declared model with this candidate against the declared model.
    candidate
        The candidate; its coefficients have no prior.
    shapes
        Values of its shapes.
    shrunk
        The same candidate with priors that are as wide as all its sizes together make
        them before the measurements.
    """

    log_bayes_factor: float
    candidate: Candidate
    shapes: tuple[float, ...]
    shrunk: Candidate


def score_candidates(
    declared: Fit, observations: Observations, candidates: Sequence[Candidate]
) -> dict[str, ScoredCandidate]:
    """Score the candidates that the data can test, each at its best shapes, by key.

    Parameters
    ----------
    declared
        Fit of the declared model.
    observations
        Measurements that it was fitted to.
    candidates
        Candidates of the catalogue.
    """
    design = build_candidate_design(declared, observations, candidates, Settings())
    if not design.terms:
        return {}
    problem = design.problem
    _, log_bayes_factors = screen_terms(problem)
    best_terms: dict[str, int] = {}
    for index, term in enumerate(problem.terms):
        if term.candidate is None:
            continue
        best_index = best_terms.setdefault(term.candidate.key, index)
        if log_bayes_factors[index] > log_bayes_factors[best_index]:
            best_terms[term.candidate.key] = index
    scored = {}
    for key, index in best_terms.items():
        term = problem.terms[index]
        candidate = term.candidate
        assert candidate is not None
        prior_std = problem.grid.root_mean_square(term) * term.sizes
        scored[key] = ScoredCandidate(
            float(log_bayes_factors[index]),
            candidate,
            term.shapes,
            set_prior_std(candidate, prior_std),
        )
    return scored


def fit_scored_candidates(
    declared: Fit,
    observations: Observations,
    free: Iterable[ScoredCandidate],
    shrunk: Iterable[ScoredCandidate] = (),
) -> Fit:
    """Fit the declared model with candidates without priors, and with others that have
    priors, from their best shapes."""
    candidates = [(scored.candidate, scored.shapes) for scored in free]
    candidates += [(scored.shrunk, scored.shapes) for scored in shrunk]
    effects = tuple(
        (candidate, np.array(shapes, float)) for candidate, shapes in candidates
    )
    return fit_selected_effects(declared, observations, declared.noise, effects)


def compute_wald_p_value(fitted: Fit, candidates: Sequence[Candidate]) -> float:
    """Compute the p-value of all coefficients of some candidates at once.

    The Wald statistic [1]_ has the covariance of the fit at its shapes. A fitted shape
    counts as one more degree of freedom. The p-value is 1 if the data identify none of
    the coefficients.

    Parameters
    ----------
    fitted
        A fit with these candidates, and possibly others.
    candidates
        What is tested.
    """
    linear: list[int] = []
    shapes: list[int] = []
    for candidate in candidates:
        indices = fitted.parameter_indices(candidate.key).tolist()
        linear += indices[: len(candidate.parameters)]
        shapes += indices[len(candidate.parameters) :]
    identified = np.flatnonzero(~fitted.unidentifiable)
    is_tested = np.isin(identified, linear)
    if not is_tested.any():
        return 1.0
    values = np.concatenate(
        [fitted.effect_values(candidate.key)[0] for candidate in candidates]
    )[np.isin(linear, identified)]
    information = np.linalg.inv(fitted.covariance[np.ix_(identified, identified)])
    is_shape = np.isin(identified, shapes)
    covariance = np.linalg.inv(information[np.ix_(~is_shape, ~is_shape)])
    tested_without_shapes = is_tested[~is_shape]
    statistic = values @ np.linalg.solve(
        covariance[np.ix_(tested_without_shapes, tested_without_shapes)], values
    )
    return float(chi2.sf(statistic, is_tested.sum() + is_shape.sum()))
