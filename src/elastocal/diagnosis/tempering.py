"""Probabilities of hypotheses whose laws are only nearly true.

No machine follows a modelled law exactly. Given enough measurements, the evidence then
decides between two wrong laws with any certainty. The coarsened posterior [1]_ asks
instead which law is true of data close to the measured ones. If the distance between
the two distributions, as relative entropy, is exponential with mean c for N
measurements together, its posterior is approximately that with the likelihood raised to
the power 1 / (1 + c).

A law that departs by the tolerance t from displacements of whitened squares S has the
relative entropy t^2 S / 2. Only a share of a departure looks like another law. So the
power depends on how large the effect is beside the noise: it is one for an effect that
is barely seen.

Whether anything is missing is no question of its law. So only the odds between
hypotheses that lack something are tempered, and "nothing" keeps its probability.

References
----------
.. [1] Miller, J. W. and Dunson, D. B., Robust Bayesian inference via coarsening,
   Journal of the American Statistical Association 114, 2019.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logit, logsumexp

from elastocal.diagnosis.hypotheses import get_presence_probability
from elastocal.diagnosis.model_averaging import compute_explained_squares

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.search import Posterior, SearchProblem
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.verdict import Hypothesis


def compute_power(squares: float, law_tolerance: float, confusable: float) -> float:
    """Compute the power of the likelihood.

    Parameters
    ----------
    squares
        Sum of squares of the whitened displacements that a model explains.
    law_tolerance
        Departure of a machine from its law, as a share of the displacements.
    confusable
        Share of the squares of a departure that looks like another law.
    """
    return 1.0 / (1.0 + 0.5 * confusable * law_tolerance**2 * squares)


def temper_hypotheses(
    problem: SearchProblem, posterior: Posterior, hypotheses: Sequence[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Temper the odds between the hypotheses by which something is missing.

    Parameters
    ----------
    problem
        The linearised problem.
    posterior
        Models with their probabilities.
    hypotheses
        Sets of mechanisms with the sums of these probabilities.

    Returns
    -------
    tuple of Hypothesis
        The most probable one first.
    """
    settings = problem.settings
    missing = [
        hypothesis
        for hypothesis in hypotheses
        if hypothesis.mechanisms and hypothesis.probability > 0.0
    ]
    if not missing:
        return tuple(hypotheses)
    best_model = next(model for model in posterior.models if model.term_indices)
    squares = sum(compute_explained_squares(problem, best_model).values())
    power = compute_power(squares, settings.law_tolerance, settings.confusable_share)
    probabilities = np.array([hypothesis.probability for hypothesis in missing])
    log_prior = np.array(
        [_compute_log_prior(hypothesis, settings) for hypothesis in missing]
    )
    log_evidence = np.log(probabilities) - log_prior
    log_odds = log_prior + power * log_evidence
    # A further mechanism beside those that lead is no other law for what these explain.
    # Therefore its odds stay those of the evidence.
    leader = int(np.argmax(probabilities))
    extends = [
        set(hypothesis.mechanisms) > set(missing[leader].mechanisms)
        for hypothesis in missing
    ]
    ratios = np.log(probabilities / probabilities[leader])
    log_odds = np.where(extends, log_odds[leader] + ratios, log_odds)
    shares = np.exp(log_odds - logsumexp(log_odds))
    tempered = [
        replace(hypothesis, probability=float(probabilities.sum() * share))
        for hypothesis, share in zip(missing, shares, strict=True)
    ]
    kept = [hypothesis for hypothesis in hypotheses if hypothesis not in missing]
    return tuple(sorted([*tempered, *kept], key=lambda entry: -entry.probability))


def _compute_log_prior(hypothesis: Hypothesis, settings: Settings) -> float:
    """Log prior odds of a set of mechanisms against its absence."""
    return sum(
        float(logit(get_presence_probability(name, settings)))
        for name in hypothesis.mechanisms
    )
