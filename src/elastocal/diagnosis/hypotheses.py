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

    `log_odds`: of each mechanism. `log_counts` (L + 1,): logarithm of the probability of one given set of k locations of a
    mechanism that has L, given that it is there.
    """

    log_odds: dict[str, float]
    log_counts: dict[str, np.ndarray]

    def log_odds_of(self, units: Iterable[Unit]) -> float:
        """Logarithm of the prior odds of a model against "nothing"."""
        units = list(units)
        total = sum(unit.log_prior for unit in units)
        for mechanism, count in Counter(unit.mechanism for unit in units).items():
            total += self.log_odds[mechanism] + self.log_counts[mechanism][count]
        return float(total)

    def added(self, unit: Unit, count: int) -> float:
        """Change of the log prior odds when a unit joins a model that has its mechanism at `count` locations."""
        counts = self.log_counts[unit.mechanism]
        change = counts[count + 1] - counts[count] if count else self.log_odds[unit.mechanism] + counts[1]
        return unit.log_prior + change


def prior_of(units: Sequence[Unit], settings: Settings) -> Prior:
    """Prior of all models that units can form."""
    odds: dict[str, float] = {}
    counts: dict[str, np.ndarray] = {}
    special = {"link_weight": settings.gravity_probability, OTHER: settings.other_probability}
    for mechanism in dict.fromkeys(unit.mechanism for unit in units):
        odds[mechanism] = float(logit(special.get(mechanism, settings.mechanism_probability)))
        locations = len({unit.place for unit in units if unit.mechanism == mechanism})
        numbers = np.arange(1, locations + 1)
        geometric = numbers * np.log(settings.further_location)
        sets = gammaln(locations + 1) - gammaln(numbers + 1) - gammaln(locations - numbers + 1)
        counts[mechanism] = np.concatenate([[0.0], geometric - logsumexp(geometric) - sets])
    return Prior(odds, counts)


def units_of(tested: Sequence[tuple[Candidate, Sequence[float]]], laws: Sequence[Law], settings: Settings) -> tuple[Unit, ...]:
    """Units of candidates and of the competitor's laws, numbered in the order of their columns.

    `tested` (Candidate, sequence of float): with shape values.
    """
    start = 0
    units: list[Unit] = []
    tried: dict[str, tuple[Candidate, list[tuple[float, ...]]]] = {}
    for candidate, shapes in tested:
        tried.setdefault(candidate.key, (candidate, []))[1].append(tuple(float(shape) for shape in shapes))
    variants = Counter((candidate.effect, candidate.location) for candidate, _ in tried.values())
    shares = {key: _shares_of_shapes(*values) for key, values in tried.items()}
    for candidate, shapes in tested:
        values = tuple(float(shape) for shape in shapes)
        log_share = float(np.log(shares[candidate.key][values] / variants[candidate.effect, candidate.location]))
        columns = np.arange(start, start + len(candidate.parameters))
        sizes = np.array([p.plausible * p.order**-settings.harmonic_decay for p in candidate.parameters])
        signs = np.array([parameter.sign for parameter in candidate.parameters])
        largest = bisect_right(settings.scales, min((p.most for p in candidate.parameters), default=np.inf)) - 1
        units.append(
            Unit(candidate.effect, candidate.location, candidate, values, columns, sizes, signs, log_share, largest=largest)
        )
        start += len(columns)
    kinds = Counter((bool(law.location), law.name) for law in laws)
    for law in laws:
        count = law.features
        # Kinds of laws are equally likely, and of each its locations.
        log_share = float(np.log(len(laws) / len(kinds) / kinds[bool(law.location), law.name]))
        whole = np.arange(start, start + count), np.ones(count), np.zeros(count, int)
        units.append(Unit(OTHER, law.location, None, (), *whole, log_share, law=law, largest=len(settings.scales) - 1))
        start += count
    require_unique([unit.key for unit in units])
    return tuple(units)


def _shares_of_shapes(candidate: Candidate, values: Sequence[tuple[float, ...]]) -> dict[tuple[float, ...], float]:
    """Prior share of each shape of a candidate: of the range of what bends it, the part nearest to it."""
    shares = np.ones(1) if len(values) == 1 else candidate.shapes[0].shares([value for (value,) in values])
    return dict(zip(values, shares.tolist(), strict=True))
