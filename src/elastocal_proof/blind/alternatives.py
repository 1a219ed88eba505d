"""Mechanisms that the measurements of a blind case cannot distinguish from the true one.

How often can a mechanism be stated alone at all? An analyst who knows the true effect
and its joints asks of every other mechanism whether the measurements exclude it as the
only cause. Both are fitted together, and the test of the oracle decides whether the true
effect is needed beside the other mechanism. If it is not, the other one is an alternative:
it explains the measurements as well.

The other mechanism acts at as many joints as the true one, those at which it explains
most by itself, and may have any plausible size. The
test trusts all laws exactly, and it tests one mechanism at a time.
So a case without alternatives is one in which an analyst who trusts the laws can exclude every
other cause.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from elastocal_proof.blind.known_effects import (
    LEVEL,
    compute_wald_p_value,
    fit_scored_candidates,
    score_candidates,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations
    from elastocal_proof.blind.known_effects import ScoredCandidate


def find_alternatives(
    declared: Fit,
    observations: Observations,
    candidates: Iterable[Candidate],
    true_effect: Sequence[ScoredCandidate],
) -> list[str]:
    """Find the mechanisms beside which the true effect is not significant.

    Mechanisms that explain nothing by themselves are no alternatives.

    Parameters
    ----------
    declared
        Fit of the declared model.
    observations
        Measurements that it was fitted to.
    candidates
        All candidates of the catalogue.
    true_effect
        Candidates of the true mechanism, at their best shapes.

    Returns
    -------
    list of str
        Names of mechanisms.
    """
    name = true_effect[0].candidate.effect
    others = [candidate for candidate in candidates if candidate.effect != name]
    scored_others = score_candidates(declared, observations, others)
    true_candidates = [scored.candidate for scored in true_effect]
    joints = {candidate.joints for candidate in true_candidates}
    alternatives = []
    for mechanism, scored in _group_by_mechanism(scored_others.values()).items():
        selected = _select_locations(scored, len(joints))
        if not selected:
            continue
        fitted = fit_scored_candidates(declared, observations, true_effect, selected)
        if compute_wald_p_value(fitted, true_candidates) >= LEVEL:
            alternatives.append(mechanism)
    return alternatives


def _group_by_mechanism(
    scored_candidates: Iterable[ScoredCandidate],
) -> dict[str, list[ScoredCandidate]]:
    by_mechanism: dict[str, list[ScoredCandidate]] = defaultdict(list)
    for scored in scored_candidates:
        by_mechanism[scored.candidate.effect].append(scored)
    return by_mechanism


def _select_locations(
    scored_candidates: Iterable[ScoredCandidate], count: int
) -> list[ScoredCandidate]:
    """Select the best candidate at each of so many joints, or sets of joints, at which
    a mechanism explains most; only candidates that the data support."""
    best: dict[tuple[int, ...], ScoredCandidate] = {}
    for scored in sorted(scored_candidates, key=_get_score, reverse=True):
        if scored.log_bayes_factor > 0.0:
            best.setdefault(scored.candidate.joints, scored)
    return [*best.values()][:count]


def _get_score(scored: ScoredCandidate) -> float:
    return scored.log_bayes_factor
