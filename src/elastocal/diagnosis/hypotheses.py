"""Mechanisms at locations: what a model might lack, as units of columns that share one size.

A unit is one candidate of the catalogue with given shape values. Units of one mechanism at one location (joint, link, band of
orders) that differ in their law are variants, of which a model holds one at most.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, logsumexp

OTHER = "other"


@dataclass(frozen=True)
class Unit:
    """One law at one location.

    Attributes
    ----------
    mechanism : str
        Name of the effect, or `OTHER`.
    location : tuple
        Where it acts; equal for variants of one mechanism at one location.
    candidate : Candidate or None
        None for `OTHER`.
    shapes : tuple of float
    columns : ndarray of int (d,)
        Its columns in the sufficient statistics.
    sizes : ndarray (d,)
        Plausible size of each parameter: a column is the sensitivity times this.
    signs : ndarray of int (d,)
        Sign that physics gives each parameter, 0 where it may have either.
    log_prior : float
        Logarithm of its share among the variants at its location.
    """

    mechanism: str
    location: tuple
    candidate: object
    shapes: tuple
    columns: np.ndarray
    sizes: np.ndarray
    signs: np.ndarray
    log_prior: float = 0.0

    @property
    def key(self):
        """Unique name: key of the candidate, with the shape values."""
        name = self.candidate.key if self.candidate else f"{OTHER}{list(self.location)}"
        return name + "".join(f" {shape:.3g}" for shape in self.shapes)


@dataclass(frozen=True)
class Prior:
    """Prior probability of every model: a set of units.

    A mechanism is there with a small probability; given that, the number of its locations is geometric and all sets of so many
    locations are equally likely.

    Attributes
    ----------
    log_odds : dict of str to float
        Of each mechanism.
    log_counts : dict of str to ndarray (L + 1,)
        Logarithm of the probability of one given set of k locations of a mechanism that has L, given that it is there.
    """

    log_odds: dict
    log_counts: dict

    def log_odds_of(self, units):
        """Logarithm of the prior odds of a model against "nothing".

        Parameters
        ----------
        units : iterable of Unit

        Returns
        -------
        float
        """
        units = list(units)
        total = sum(unit.log_prior for unit in units)
        for mechanism in {unit.mechanism for unit in units}:
            count = sum(unit.mechanism == mechanism for unit in units)
            total += self.log_odds[mechanism] + self.log_counts[mechanism][count]
        return float(total)

    def added(self, unit, count):
        """Change of the log prior odds when a unit joins a model that has its mechanism at `count` locations."""
        counts = self.log_counts[unit.mechanism]
        change = counts[count + 1] - counts[count] if count else self.log_odds[unit.mechanism] + counts[1]
        return unit.log_prior + change


def prior_of(units, settings):
    """Prior of all models that units can form.

    Parameters
    ----------
    units : sequence of Unit
    settings : Settings

    Returns
    -------
    Prior
    """
    odds, counts = {}, {}
    for mechanism in dict.fromkeys(unit.mechanism for unit in units):
        probability = settings.gravity_probability if mechanism == "link_weight" else settings.mechanism_probability
        odds[mechanism] = float(np.log(probability / (1.0 - probability)))
        locations = len({unit.location for unit in units if unit.mechanism == mechanism})
        numbers = np.arange(1, locations + 1)
        geometric = numbers * np.log(settings.further_location)
        geometric -= logsumexp(geometric)
        sets = gammaln(locations + 1) - gammaln(numbers + 1) - gammaln(locations - numbers + 1)
        counts[mechanism] = np.concatenate([[0.0], geometric - sets])
    return Prior(odds, counts)


def units_of(tested, features, settings):
    """Units of candidates and of the competitor, numbered in the order of their columns.

    Parameters
    ----------
    tested : sequence of (Candidate, sequence of float)
        With shape values.
    features : sequence of (tuple, int)
        Location and number of columns of each unit of `OTHER`.
    settings : Settings

    Returns
    -------
    tuple of Unit
    """
    start, units, laws = 0, [], {}
    for candidate, _ in tested:
        laws.setdefault((candidate.effect, candidate.location), []).append(candidate.key)
    for candidate, shapes in tested:
        keys = laws[candidate.effect, candidate.location]
        share = 1.0 / len(set(keys)) / keys.count(candidate.key)
        columns = np.arange(start, start + len(candidate.parameters))
        values = tuple(float(shape) for shape in shapes)
        sizes = np.array([p.plausible * p.order**-settings.harmonic_decay for p in candidate.parameters])
        signs = np.array([parameter.sign for parameter in candidate.parameters])
        log_share = float(np.log(share))
        units.append(Unit(candidate.effect, candidate.location, candidate, values, columns, sizes, signs, log_share))
        start += len(columns)
    for location, count in features:
        columns = np.arange(start, start + count)
        units.append(Unit(OTHER, location, None, (), columns, np.ones(count), np.zeros(count, int)))
        start += count
    return tuple(units)
