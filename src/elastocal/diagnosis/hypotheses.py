"""Mechanisms at locations: what a model might lack, as units of columns that share one size.

A unit is one candidate of the catalogue with given shape values. Units of one mechanism at one location (joint, link, band of
orders) that differ in their law are variants, of which a model holds one at most.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln, logit, logsumexp

from elastocal.effects.protocol import Candidate, at_shapes, require_unique

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.diagnosis.other import Law
    from elastocal.diagnosis.settings import Settings

OTHER = "other"


@dataclass(frozen=True)
class Unit:
    """One law at one location.

    `mechanism`: name of the effect, or `OTHER`. `location`: where it acts; equal for variants of one mechanism at one location.
    `candidate`: None for `OTHER`. `columns` (d,) of int: its columns in the sufficient statistics. `sizes` (d,): plausible size
    of each parameter: a column is the sensitivity times this. `signs` (d,) of int: sign that physics gives each parameter, 0
    where it may have either. `log_prior`: logarithm of its share among the variants at its location. `law`: of `OTHER`.
    `smallest`: place in the grid of sizes of the smallest that the measurements could show. `largest`: of the largest that such
    an effect may have; -1 for the last.
    """

    mechanism: str
    location: tuple[int | str, ...]
    candidate: Candidate | None
    shapes: tuple[float, ...]
    columns: np.ndarray
    sizes: np.ndarray
    signs: np.ndarray
    log_prior: float = 0.0
    law: Law | None = None
    smallest: int = 0
    largest: int = -1

    @property
    def key(self) -> str:
        """Unique name: key of the candidate, with the shape values."""
        name = self.candidate.key if self.candidate else f"{OTHER}{list(self.location)} {self.law.name if self.law else ''}"
        return at_shapes(name, self.shapes)

    @property
    def place(self) -> tuple[str, tuple[int | str, ...], str]:
        """What no two units of a model share: variants at one location exclude each other, laws of `OTHER` do not."""
        return self.mechanism, self.location, self.law.name if self.law else ""


@dataclass(frozen=True)
class Prior:
    """Prior probability of every model: a set of units.

    A mechanism is there with a small probability; given that, the number of its locations is geometric and all sets of so many
    locations are equally likely, which allows for their multiplicity (Scott and Berger, Annals of Statistics 2010).

    `log_odds` (L + 1,): of each mechanism, which has L locations, those of one given set of k of them against its absence.
    """

    log_odds: dict[str, np.ndarray]

    def log_odds_of(self, units: Iterable[Unit]) -> float:
        """Logarithm of the prior odds of a model against "nothing"."""
        units = list(units)
        counts = Counter(unit.mechanism for unit in units)
        shares = sum(unit.log_prior for unit in units)
        return float(shares + sum(self.log_odds[mechanism][count] for mechanism, count in counts.items()))

    def added(self, unit: Unit, count: int) -> float:
        """Change of the log prior odds when a unit joins a model that has its mechanism at `count` locations."""
        odds = self.log_odds[unit.mechanism]
        return unit.log_prior + float(odds[count + 1] - odds[count])


def prior_of(units: Sequence[Unit], settings: Settings) -> Prior:
    """Prior of all models that units can form."""
    special, found = {"link_weight": settings.gravity_probability, OTHER: settings.other_probability}, dict[str, np.ndarray]()
    for mechanism in dict.fromkeys(unit.mechanism for unit in units):
        locations = len({unit.place for unit in units if unit.mechanism == mechanism})
        numbers = np.arange(1, locations + 1)
        geometric = numbers * np.log(settings.further_location)
        sets = gammaln(locations + 1) - gammaln(numbers + 1) - gammaln(locations - numbers + 1)
        there = logit(special.get(mechanism, settings.mechanism_probability))
        found[mechanism] = np.append(0.0, there + geometric - logsumexp(geometric) - sets)
    return Prior(found)


def units_of(
    tried: Iterable[tuple[Candidate, Sequence[tuple[float, ...]]]], laws: Sequence[Law], settings: Settings
) -> tuple[Unit, ...]:
    """Units of candidates, with values of their shapes, and of the competitor's laws, in the order of their columns."""
    start, units, tried = 0, list[Unit](), list(tried)
    variants = Counter((candidate.effect, candidate.location) for candidate, _ in tried)
    for candidate, values in tried:
        sizes = np.array([p.plausible * p.order**-settings.harmonic_decay for p in candidate.parameters])
        signs = np.array([parameter.sign for parameter in candidate.parameters])
        largest = bisect_right(settings.scales, min((p.most for p in candidate.parameters), default=np.inf)) - 1
        # Of the range of what bends a candidate, each shape has the part nearest to it.
        shares = np.ones(1) if len(values) == 1 else candidate.shapes[0].shares([value for (value,) in values])
        for shapes, log_share in zip(values, np.log(shares / variants[candidate.effect, candidate.location]), strict=True):
            columns = np.arange(start, start + len(sizes))
            law = candidate.effect, candidate.location, candidate, shapes, columns, sizes, signs
            units.append(Unit(*law, float(log_share), largest=largest))
            start += len(sizes)
    kinds = Counter((bool(law.location), law.name) for law in laws)
    for law in laws:
        # Kinds of laws are equally likely, and of each its locations.
        log_share = float(np.log(len(laws) / len(kinds) / kinds[bool(law.location), law.name]))
        whole = np.arange(start, start + law.features), np.ones(law.features), np.zeros(law.features, int)
        units.append(Unit(OTHER, law.location, None, (), *whole, log_share, law=law, largest=len(settings.scales) - 1))
        start += law.features
    require_unique([unit.key for unit in units])
    return tuple(units)
