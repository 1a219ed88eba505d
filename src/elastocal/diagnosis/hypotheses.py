"""Mechanisms at locations: what a model might lack, as units of columns that share one
size.

A unit is one candidate of the catalogue with given shape values. Units of one mechanism
at one location (joint, link, band of orders) that differ in their law are variants, of
which a model holds one at most.

A unit of `OTHER` is a competitor for effects that the catalogue does not have: random
displacements of a joint or the base. A displacement is a random function of a few
inputs, an approximate Gaussian process: principal components over the states of a
campaign of random Fourier features (Rahimi and Recht, NIPS 2007). Such a discrepancy
(Kennedy and O'Hagan, JRSS B 2001) should leave to the model what the model explains
(Plumlee, JASA 2017): what is constant of it, or at a joint straight in its angle, is
taken off; what comes with time at a joint begins at nothing; what goes by the place of
the end keeps its constant part. Each law has the inputs of one cause, as terms of an
additive Gaussian process have (Duvenaud et al., NIPS 2011): a joint's own angle, torque
and approach; the angles beside it; time and temperature; the load on the base; the
place of the end. At a joint each acts in proportion to the load or without it: what
yields turns nothing that is not loaded. Alone it means that what is left is
*unexplained*; beside a mechanism, that a *related* one acts. It names nothing and is
not used to predict.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln, logit, logsumexp

from elastocal.effects.protocol import Candidate
from elastocal.random_streams import open_stream

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from elastocal.diagnosis.settings import Settings
    from elastocal.effects.conditions import Conditions

    _Waves = Callable[[Conditions], np.ndarray]

OTHER = "other"
# Deviations that no machine would hide: joints about an arc minute, the base a tenth of
# a millimetre and of a milliradian.
JOINT_RAD = 2e-4
BASE_M = 1e-4
BASE_RAD = 1e-4
# Length scales of the features in units of the inputs, which are of size one: from
# smooth to as many waves as poses can show.
_LENGTH_SCALES = (0.7, 3.0)
OWN = "own"
NEIGHBOURS = "neighbours"
TIME = "time"
FORCE = "force"
PLACE = "place"
SHIFT = "shift"
TURN = "turn"
UNDER_LOAD = " under load"
# Of so many random features the principal components are taken, at a joint as many as
# the settings say.
_DRAWN = 64
_BASE_FEATURES = 6
# Inputs that differ by less, in SI units or of their largest value, differ by rounding.
_ROUNDING = 1e-9
_SEED = 2007


@dataclass(frozen=True)
class Discrepancy:
    """Random displacements by one cause at one location, in the shape of a candidate:
    per unit of their coefficients.

    `location`: joint counted from 1; empty for the base. `name`: distinguishes the laws
    of one location. `size`: rad or m. `parts` (int, callable): a coordinate that is
    displaced, and its waves (S, some) by the states. `features`: how many displacements
    these are.
    """

    location: tuple[int, ...]
    name: str
    size: float
    parts: tuple[tuple[int, _Waves], ...]
    features: int

    def displacement(self, around: Conditions) -> list[dict[int, np.ndarray]]:
        """For each feature a displacement of one coordinate in some states, list of
        dict of int to ndarray (S,)."""
        return [
            {coordinate: self.size * wave}
            for coordinate, waves in self.parts
            for wave in waves(around).T
        ]


@dataclass(frozen=True)
class ModelTerm:
    """One law at one location: a candidate, or a law of `OTHER`.

    `location`: where it acts; equal for variants of one mechanism at one location.
    `columns` (d,) of int: in the sufficient statistics, each the sensitivity times
    `sizes` (d,), plausible ones. `signs` (d,) of int: that physics gives each
    parameter, 0 where it may have either. `log_prior`: logarithm of its share among the
    variants at its location. `smallest`, `largest`: places in the grid of the smallest
    size that the measurements could show, and of the largest that it may have; -1: the
    last.
    """

    mechanism: str
    location: tuple[int | str, ...]
    candidate: Candidate | None
    shapes: tuple[float, ...]
    columns: np.ndarray
    sizes: np.ndarray
    signs: np.ndarray
    log_prior: float = 0.0
    law: Discrepancy | None = None
    smallest: int = 0
    largest: int = -1

    @property
    def place(self) -> tuple[str, tuple[int | str, ...], str]:
        """What no two units of a model share: variants at one location exclude each
        other, laws of `OTHER` do not."""
        return self.mechanism, self.location, self.law.name if self.law else ""


@dataclass(frozen=True)
class ModelPrior:
    """Prior probability of every model: a set of units.

    A mechanism is there with a small probability; given that, the number of its
    locations is geometric and all sets of so many locations are equally likely, which
    allows for their multiplicity (Scott and Berger, Annals of Statistics 2010).

    `log_odds` (L + 1,): of each mechanism, which has L locations, those of one given
    set of k of them against its absence.
    """

    log_odds: dict[str, np.ndarray]

    def compute_log_odds(self, units: Iterable[ModelTerm]) -> float:
        """Logarithm of the prior odds of a model against "nothing"."""
        units = list(units)
        counts = Counter(unit.mechanism for unit in units)
        shares = sum(unit.log_prior for unit in units)
        return float(
            shares
            + sum(
                self.log_odds[mechanism][count] for mechanism, count in counts.items()
            )
        )

    def added(self, unit: ModelTerm, count: int) -> float:
        """Change of the log prior odds when a unit joins a model that has its mechanism
        at `count` locations."""
        odds = self.log_odds[unit.mechanism]
        return unit.log_prior + float(odds[count + 1] - odds[count])


def build_model_prior(units: Sequence[ModelTerm], settings: Settings) -> ModelPrior:
    """Prior of all models that units can form."""
    special = {
        "link_weight": settings.gravity_probability,
        OTHER: settings.other_probability,
    }
    found = dict[str, np.ndarray]()
    for mechanism, locations in Counter(
        mechanism for mechanism, *_ in {unit.place for unit in units}
    ).items():
        numbers = np.arange(1, locations + 1)
        geometric = numbers * np.log(settings.further_location)
        sets = (
            gammaln(locations + 1)
            - gammaln(numbers + 1)
            - gammaln(locations - numbers + 1)
        )
        there = logit(special.get(mechanism, settings.mechanism_probability))
        found[mechanism] = np.append(
            0.0, there + geometric - logsumexp(geometric) - sets
        )
    return ModelPrior(found)


def build_terms(
    tried: Iterable[tuple[Candidate, Sequence[tuple[float, ...]]]],
    laws: Sequence[Discrepancy],
    settings: Settings,
) -> tuple[ModelTerm, ...]:
    """Units of candidates, with values of their shapes, and of the competitor's laws,
    in the order of their columns."""
    start = 0
    units = list[ModelTerm]()
    tried = list(tried)
    variants = Counter((candidate.effect, candidate.location) for candidate, _ in tried)
    for candidate, values in tried:
        sizes = np.array(
            [
                p.plausible * p.order**-settings.harmonic_decay
                for p in candidate.parameters
            ]
        )
        signs = np.array([parameter.sign for parameter in candidate.parameters])
        largest = (
            bisect_right(
                settings.scales,
                min((p.most for p in candidate.parameters), default=np.inf),
            )
            - 1
        )
        # Of the range of what bends a candidate, each shape has the part nearest to it.
        shares = (
            np.ones(1)
            if len(values) == 1
            else candidate.shapes[0].shares([value for (value,) in values])
        )
        for shapes, log_share in zip(
            values,
            np.log(shares / variants[candidate.effect, candidate.location]),
            strict=True,
        ):
            columns = np.arange(start, start + len(sizes))
            where = candidate.effect, candidate.location
            units.append(
                ModelTerm(
                    *where,
                    candidate,
                    shapes,
                    columns,
                    sizes,
                    signs,
                    float(log_share),
                    largest=largest,
                )
            )
            start += len(sizes)
    kinds = Counter((bool(law.location), law.name) for law in laws)
    for law in laws:
        # Kinds of laws are equally likely, and of each its locations.
        log_share = float(
            np.log(len(laws) / len(kinds) / kinds[bool(law.location), law.name])
        )
        whole = (
            np.arange(start, start + law.features),
            np.ones(law.features),
            np.zeros(law.features, int),
        )
        units.append(
            ModelTerm(
                OTHER,
                law.location,
                None,
                (),
                *whole,
                log_share,
                law=law,
                largest=len(settings.scales) - 1,
            )
        )
        start += law.features
    return tuple(units)


def build_discrepancies(campaign: Conditions, features: int) -> list[Discrepancy]:
    """Laws of which a campaign has inputs, at each joint and at the base.

    `campaign`: over whose states displacements are the principal ones, and of whose
    states what has a name is taken off. `features`: at a joint.
    """
    sites = campaign.sites
    whole = [
        (f" {SHIFT}", BASE_M, list(sites.base[:3])),
        (f" {TURN}", BASE_RAD, list(sites.base[3:])),
    ]
    # What bends the ray to a target shifts it one way, wherever a frame that is placed
    # wrongly would shift it every way.
    along = [
        (f" {SHIFT} {axis}", BASE_M, [at])
        for axis, at in zip("xyz", sites.base[:3], strict=True)
    ]
    half = _BASE_FEATURES // 2
    places: list[
        tuple[tuple[int, ...], str, str, float, list[int], dict[bool, int]]
    ] = [
        *(
            ((j + 1,), cause, words, JOINT_RAD, [j], {loaded: features})
            for j in range(sites.joints)
            for cause in (OWN, NEIGHBOURS, TIME)
            for loaded, words in ((False, ""), (True, UNDER_LOAD))
            if not loaded or np.abs(campaign.total[:, j]).max(initial=0.0) > _ROUNDING
        ),
        *(((), FORCE, *motion, {False: half, True: half}) for motion in whole),
        *(((), TIME, *motion, {False: _BASE_FEATURES}) for motion in whole),
        *(
            ((), PLACE, *motion, {False: _BASE_FEATURES})
            for motion in (*along, whole[1])
        ),
    ]
    found = []
    for location, cause, words, size, coordinates, counts in places:
        inputs = {
            coordinate: _inputs(campaign, cause, coordinate)
            for coordinate in coordinates
        }
        if any(each(campaign).size for each in inputs.values()):
            name = f"{cause}{words}"
            draws = open_stream(
                _SEED,
                f"other {name}",
                "random Fourier features",
                location[0] if location else 0,
            )
            parts = tuple(
                (
                    at,
                    _principal(
                        campaign,
                        each,
                        (cause, at, location),
                        draws,
                        loaded,
                        count,
                        1.0 / len(counts),
                    ),
                )
                for at, each in inputs.items()
                for loaded, count in counts.items()
            )
            found.append(
                Discrepancy(
                    location, name, size, parts, sum(counts.values()) * len(inputs)
                )
            )
    return found


def _inputs(campaign: Conditions, cause: str, coordinate: int) -> _Waves:
    """What one coordinate goes by in some states, each of size about one in a campaign,
    less what does not differ there."""

    def plain(around: Conditions) -> np.ndarray:
        """In its own units, angles as points of a circle, ndarray (S, D)."""
        if cause == TIME:
            known = [
                each
                for each in (around.time_s, around.temperature_c, around.progress)
                if each is not None
            ]
        elif cause == FORCE:
            known = [around.total[:, coordinate]]
        elif cause == PLACE:
            known = list(around.motion.position[0])
        else:
            joints = (
                slice(coordinate, coordinate + 1)
                if cause == OWN
                else slice(max(coordinate - 1, 0), coordinate + 2)
            )
            known = [
                wave(angle)
                for angle in around.joint_angles[:, joints].T
                for wave in (np.cos, np.sin)
            ]
            known.append(around.total[:, coordinate])
            if cause == OWN and around.approach is not None:
                known.append(around.approach[:, coordinate])
        return np.array(known, float).reshape(len(known), len(around.joint_angles)).T

    known = plain(campaign)
    center = known.mean(axis=0)
    spread = np.abs(known - center).max(axis=0, initial=0.0)
    differ = spread > _ROUNDING * np.maximum(
        np.abs(known).max(axis=0, initial=0.0), 1.0
    )
    return lambda around: (plain(around) - center)[:, differ] / spread[differ]


def _principal(
    campaign: Conditions,
    inputs: _Waves,
    what: tuple[str, int, tuple[int, ...]],
    draws: np.random.Generator,
    loaded: bool,
    count: int,
    variance: float,
) -> _Waves:
    """So many principal components (S, count) of random functions of the inputs of such
    a variance, in proportion to the load or without it, less what has a name in the
    catalogue. `what`: cause, coordinate and location."""
    cause, coordinate, location = what
    known = inputs(campaign)
    low, high = np.log(_LENGTH_SCALES)
    lengths = np.exp(draws.uniform(low, high, _DRAWN))
    frequency = draws.standard_normal((known.shape[1], _DRAWN)) / lengths
    phase = draws.uniform(0, 2 * np.pi, _DRAWN)
    size = np.sqrt(2.0 * variance / _DRAWN) if known.shape[1] else 0.0
    random = size * np.cos(known @ frequency + phase)
    straight = cause in (OWN, NEIGHBOURS) and not loaded
    angle = campaign.joint_angles[:, coordinate if straight else 0]
    # Of what is taken off: the first in time of a joint, or all.
    first = np.argmin(known[:, -1]) if location and cause == TIME else slice(None)
    mean = (
        np.zeros(_DRAWN)
        if cause == PLACE
        else random[first].reshape(-1, _DRAWN).mean(axis=0)
    )
    center = angle.mean()
    squares = ((angle - angle.mean()) ** 2).sum()
    slope = (
        (angle - center) @ random / squares
        if straight and squares > _ROUNDING
        else np.zeros_like(mean)
    )
    largest = max(np.abs(_load(campaign, location)).max(initial=0.0), _ROUNDING)

    def waves(around: Conditions, random: np.ndarray) -> np.ndarray:
        found = random - mean
        if straight:
            found -= np.outer(around.joint_angles[:, coordinate] - center, slope)
        return found * (_load(around, location) / largest)[:, None] if loaded else found

    seen = waves(campaign, random)
    _, vectors = np.linalg.eigh(seen.T @ seen)
    axes = vectors[:, ::-1][:, :count]
    return lambda around: (
        waves(around, size * np.cos(inputs(around) @ frequency + phase)) @ axes
    )


def _load(around: Conditions, location: tuple[int, ...]) -> np.ndarray:
    """Torque on the joint, or force on the base, ndarray (S,)."""
    return (
        around.total[:, location[0] - 1]
        if location
        else np.linalg.norm(around.wrench[:, :3], axis=1)
    )
