"""Hypotheses on the declared model: terms that it may lack, and their prior.

A term is one candidate of the catalogue with given values of its shapes; its columns
share one scale. Terms of one mechanism at one location (joint, link, band of orders)
that differ in their shape are variants, of which a model holds one at most. A term of
the mechanism `OTHER` is a discrepancy, which competes for effects that the catalogue
does not have (see `discrepancy`).
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln, logit, logsumexp

from elastocal.effects.catalogue import list_effects

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.diagnosis.discrepancy import Discrepancy
    from elastocal.diagnosis.settings import Settings
    from elastocal.effects.protocol import Candidate

OTHER = "other"
# Its name beside a mechanism of the catalogue.
RELATED = "a related mechanism"
# Mechanism of the terms of single rows or poses that are wrong (see `contamination`).
GROSS_ERROR = "gross error"
# Mechanism of their competitors that act at one end of a variable of the state (see
# `local_effects`).
LOCAL_EFFECT = "local effect"


@dataclass(frozen=True)
class ModelTerm:
    """One basis of displacements at one location: a candidate, or a discrepancy.

    Attributes
    ----------
    mechanism : name of the effect, or `OTHER`
    location : where it acts; equal for variants of one mechanism at one location
    candidate : None for a discrepancy
    shapes : values of the candidate's shapes
    columns : (d,) int, in the sufficient statistics; each is the sensitivity times the
        plausible size
    sizes : (d,), plausible sizes of the parameters
    signs : (d,) int, sign that physics gives each parameter, 0 if it may have either
    log_prior : logarithm of its share among the variants at its location
    discrepancy : None for a candidate
    at_declared_masses : whether a law that is not linear in the load is evaluated at the
        masses of the robot file instead of those that were fitted
    smallest : index in the grid of scales of the smallest one that the measurements
        could show
    largest : index of the largest one that the term may have; -1 for the last
    """

    mechanism: str
    location: tuple[int | str, ...]
    candidate: Candidate | None
    shapes: tuple[float, ...]
    columns: np.ndarray
    sizes: np.ndarray
    signs: np.ndarray
    log_prior: float = 0.0
    discrepancy: Discrepancy | None = None
    smallest: int = 0
    largest: int = -1
    at_declared_masses: bool = False

    @property
    def slot(self) -> tuple[str, tuple[int | str, ...], str]:
        """Key that no two terms of a model share.

        Variants at one location exclude each other; discrepancies with different inputs
        do not.
        """
        name = self.discrepancy.name if self.discrepancy else ""
        return self.mechanism, self.location, name


@dataclass(frozen=True)
class ModelPrior:
    """Prior probability of every model, a set of terms.

    A mechanism is present with a small probability. Given that, the number of its
    locations is geometric, and all sets of the same number of locations are equally
    likely, which corrects for multiplicity (Scott and Berger, Annals of Statistics
    2010). Gross errors are independent accidents: each has the same prior odds, however
    many there are.

    If mechanisms were independent, the probability that none acts would be a product
    over the catalogue, and would fall with every mechanism that is added to it. It is
    therefore a setting of its own.

    Attributes
    ----------
    log_odds : by mechanism, (L + 1,) for a mechanism with L locations: log prior odds
        of one given set of k locations against its absence
    log_odds_of_any : what these log odds lack in every model that has a mechanism
    """

    log_odds: dict[str, np.ndarray]
    log_odds_of_any: float

    def correct_for_nothing(self, terms: Iterable[ModelTerm]) -> float:
        """Correction of the log odds of a model for the prior probability of nothing."""
        is_any = any(term.mechanism != GROSS_ERROR for term in terms)
        return self.log_odds_of_any if is_any else 0.0

    def compute_log_odds(self, terms: Iterable[ModelTerm]) -> float:
        """Log prior odds of a model against the declared model alone."""
        terms = list(terms)
        locations = Counter(term.mechanism for term in terms)
        log_shares = sum(term.log_prior for term in terms)
        by_mechanism = [
            self.log_odds[mechanism][count] for mechanism, count in locations.items()
        ]
        return float(log_shares + sum(by_mechanism))

    def log_odds_change(self, term: ModelTerm, count: int) -> float:
        """Change of the log prior odds when a term joins a model that has its mechanism
        at `count` locations."""
        log_odds = self.log_odds[term.mechanism]
        return term.log_prior + float(log_odds[count + 1] - log_odds[count])


def get_presence_probability(mechanism: str, settings: Settings) -> float:
    """Look up the prior probability of a mechanism, at any of its locations."""
    special_probabilities = {
        "link_weight": settings.gravity_probability,
        OTHER: settings.other_probability,
        LOCAL_EFFECT: settings.other_probability,
    }
    return special_probabilities.get(mechanism, settings.mechanism_probability)


def build_model_prior(terms: Sequence[ModelTerm], settings: Settings) -> ModelPrior:
    """Build the prior of all models that some terms can form."""
    slots = {term.slot for term in terms}
    log_odds: dict[str, np.ndarray] = {}
    for mechanism, locations in Counter(mechanism for mechanism, *_ in slots).items():
        counts = np.arange(1, locations + 1)
        if mechanism == GROSS_ERROR:
            odds = logit(settings.gross_error_probability)
            log_odds[mechanism] = odds * np.arange(locations + 1)
            continue
        geometric = counts * np.log(settings.further_location)
        log_sets = (
            gammaln(locations + 1)
            - gammaln(counts + 1)
            - gammaln(locations - counts + 1)
        )
        presence = logit(get_presence_probability(mechanism, settings))
        log_odds[mechanism] = np.append(
            0.0, presence + geometric - logsumexp(geometric) - log_sets
        )
    return ModelPrior(log_odds, _compute_log_odds_of_any(settings))


def _compute_log_odds_of_any(settings: Settings) -> float:
    """Log of the factor between the prior odds that any mechanism acts and those of
    independent mechanisms, of which the catalogue may have any number."""
    log_of_none = len(list_effects()) * np.log1p(-settings.mechanism_probability)
    log_of_none += np.log1p(-settings.other_probability)
    log_odds_of_none = log_of_none - np.log(-np.expm1(log_of_none))
    return float(log_odds_of_none - logit(settings.nothing_probability))


def build_terms(
    shape_values: Iterable[tuple[Candidate, Sequence[tuple[float, ...]]]],
    discrepancies: Sequence[Discrepancy],
    settings: Settings,
    *,
    has_masses: bool = False,
) -> tuple[ModelTerm, ...]:
    """Build the terms of candidates and discrepancies, in the order of their columns.

    Parameters
    ----------
    shape_values : candidates, each with the values of its shapes that are tried
    discrepancies : discrepancies
    settings : settings of the diagnosis
    has_masses : whether the robot file states masses
    """
    shape_values = list(shape_values)
    terms: list[ModelTerm] = []
    first_column = 0
    variants = Counter(
        (candidate.effect, candidate.location) for candidate, _ in shape_values
    )
    for candidate, values in shape_values:
        count = variants[candidate.effect, candidate.location]
        evaluations = list_mass_evaluations(candidate, has_masses=has_masses)
        for at_declared_masses in evaluations:
            of_candidate = _build_candidate_terms(
                candidate, values, count * len(evaluations), first_column, settings
            )
            terms += [
                replace(term, at_declared_masses=at_declared_masses)
                for term in of_candidate
            ]
            first_column += len(values) * len(candidate.parameters)
    kinds = Counter(discrepancy.kind for discrepancy in discrepancies)
    for discrepancy in discrepancies:
        # All kinds are equally likely, and so are all locations of a kind.
        share = len(discrepancies) / len(kinds) / kinds[discrepancy.kind]
        features = discrepancy.features
        terms.append(
            ModelTerm(
                OTHER,
                discrepancy.location,
                candidate=None,
                shapes=(),
                columns=np.arange(first_column, first_column + features),
                sizes=np.ones(features),
                signs=np.zeros(features, int),
                log_prior=float(np.log(share)),
                discrepancy=discrepancy,
                largest=len(settings.scales) - 1,
            )
        )
        first_column += features
    return tuple(terms)


def list_mass_evaluations(
    candidate: Candidate, *, has_masses: bool
) -> tuple[bool, ...]:
    """List at which masses a candidate is evaluated: fitted (False) or declared (True).

    A law that is not linear in the load depends on the torque, and a fit without the
    effect distorts the masses until they explain a part of it. The masses of the robot
    file have no such error, but their own; so both are equally probable beforehand.
    """
    return (False, True) if has_masses and candidate.nonlinear_in_load else (False,)


def _build_candidate_terms(
    candidate: Candidate,
    shape_values: Sequence[tuple[float, ...]],
    variants: int,
    first_column: int,
    settings: Settings,
) -> list[ModelTerm]:
    """Terms of one candidate, one for each value of its shapes.

    `variants`: number of candidates and evaluations that share the probability of the
    location.
    """
    parameters = candidate.parameters
    sizes = np.array(
        [p.plausible * p.order**-settings.harmonic_decay for p in parameters]
    )
    signs = np.array([p.sign for p in parameters])
    largest_scale = min((p.most for p in parameters), default=np.inf)
    shares = np.ones(1)
    if len(shape_values) > 1:
        # Each tabulated value of a shape represents the part of the range that is
        # closest to it.
        shares = candidate.shapes[0].shares([value for (value,) in shape_values])
    log_shares = np.log(shares / variants).tolist()
    terms = []
    for shapes, log_share in zip(shape_values, log_shares, strict=True):
        columns = np.arange(first_column, first_column + len(parameters))
        first_column += len(parameters)
        terms.append(
            ModelTerm(
                candidate.effect,
                candidate.location,
                candidate,
                shapes,
                columns,
                sizes,
                signs,
                log_share,
                largest=bisect_right(settings.scales, largest_scale) - 1,
            )
        )
    return terms
