"""A competitor for effects that the catalogue does not have: smooth random displacements of each joint and of the base.

A displacement is a random function of a few inputs, an approximate Gaussian process: the principal components over the states
of a campaign (Karhunen-Loeve) of a sum of random Fourier features [1] with normal coefficients. Such a discrepancy [2] should
leave to the model what the model explains [3]: what is constant of it, or at a joint straight in its angle, is taken off, for a
zero offset, a frame that is fitted and a transmission ratio have names. A function of everything at once would fit nothing
better than chance does, so that each law has the inputs of one cause, as terms of an additive Gaussian process have [4]: a
joint's own angle, torque and approach; the angles of the joints beside it; time and temperature; the load on the base along
each of its axes; the place of the end. Half of the features are multiplied by the load, so that they vanish without it. Alone
it means that the residual is *unexplained*; beside a mechanism, that a *related* one acts. It names nothing and is not used to
predict.

[1] Rahimi, A. and Recht, B., Random features for large-scale kernel machines, Advances in Neural Information Processing Systems
    20, 2007.
[2] Kennedy, M. C. and O'Hagan, A., Bayesian calibration of computer models, Journal of the Royal Statistical Society B 63,
    2001.
[3] Plumlee, M., Bayesian calibration of inexact computer models, Journal of the American Statistical Association 112, 2017.
[4] Duvenaud, D., Nickisch, H. and Rasmussen, C. E., Additive Gaussian processes, Advances in Neural Information Processing
    Systems 24, 2011.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.random_streams import stream

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from elastocal.effects.conditions import Conditions

    _Waves = Callable[[Conditions], np.ndarray]

# Deviations that no machine would hide: joints about an arc minute, the base a tenth of a millimetre and of a milliradian.
JOINT_RAD, BASE_M, BASE_RAD = 2e-4, 1e-4, 1e-4
# Length scales of the features in units of the inputs, which are of size one: from smooth to as many waves as poses can show.
_LENGTH_SCALES = (0.7, 3.0)
OWN, NEIGHBOURS, TIME, FORCE, PLACE = "own", "neighbours", "time", "force", "place"
SHIFT, TURN = "shift", "turn"
_AT_A_JOINT, _AT_THE_BASE = (OWN, NEIGHBOURS, TIME), (FORCE, TIME, PLACE)
# Of so many random features the principal components are taken, at a joint as many as the settings say.
_DRAWN, _BASE_FEATURES = 64, 6
# Inputs that differ by less, in SI units or of their largest value, differ by rounding.
_ROUNDING = 1e-9
_SEED = 2007


@dataclass(frozen=True)
class Competitor:
    """One law at one location.

    `location`: joint counted from 1; empty for the base. `law`: by what it goes: "own", "neighbours" or "time" at a joint;
    "force", "time" or "place" at the base. `motion`: joints turn; the base does either.
    """

    location: tuple[int, ...]
    law: str
    motion: str = TURN

    @property
    def name(self) -> str:
        """Distinguishes the laws of one location."""
        return self.law if self.location else f"{self.law} {self.motion}"


def competitors(campaign: Conditions) -> list[Competitor]:
    """Laws of which a campaign has inputs, at each joint and at the base."""
    joints = range(campaign.sites.joints)
    every = [Competitor((joint + 1,), law) for joint in joints for law in _AT_A_JOINT]
    every += [Competitor((), law, motion) for law in _AT_THE_BASE for motion in (SHIFT, TURN)]
    return [
        each for each in every if any(_inputs(campaign, each, at, campaign).shape[1] for at in _coordinates(campaign, each))
    ]


@dataclass(frozen=True)
class Law:
    """Random displacements by one law, in the shape of a candidate: per unit of their coefficients in plausible sizes.

    `size`: rad or m. `parts` (int, callable): a coordinate that is displaced, and its waves (S, some) by the states.
    `features`: how many displacements these are.
    """

    size: float
    parts: tuple[tuple[int, _Waves], ...]
    features: int

    def displacement(self, around: Conditions) -> list[dict[int, np.ndarray]]:
        """For each feature a displacement of one coordinate in some states, list of dict of int to ndarray (S,)."""
        return [{coordinate: self.size * wave} for coordinate, waves in self.parts for wave in waves(around).T]


def law_of(competitor: Competitor, campaign: Conditions, features: int) -> Law:
    """Draw the displacements by one law.

    `campaign`: over whose states they are the principal ones, and of whose states what has a name is taken off. `features`: at
    a joint.
    """
    location = competitor.location
    draws = stream(_SEED, f"{OTHER} {competitor.law}", "random Fourier features", location[0] if location else 0)
    size = JOINT_RAD if location else BASE_M if competitor.motion == SHIFT else BASE_RAD
    count = features if location else _BASE_FEATURES
    largest_load = np.abs(_load(campaign, location)).max(initial=0.0)
    parts = []
    for coordinate in _coordinates(campaign, competitor):
        waves = _waves(competitor, campaign, coordinate, largest_load, draws)
        parts.append((coordinate, _principal(waves, waves(campaign), count)))
    return Law(size, tuple(parts), count * len(parts))


def _principal(waves: _Waves, seen: np.ndarray, count: int) -> _Waves:
    """So many principal components of waves, half of them of the half that goes with the load; `seen`: over a campaign."""
    axes = np.zeros((2 * _DRAWN, count))
    free = count - count // 2
    for drawn, kept in ((slice(_DRAWN), slice(free)), (slice(_DRAWN, None), slice(free, None))):
        _, found = np.linalg.eigh(seen[:, drawn].T @ seen[:, drawn])
        axes[drawn, kept] = found[:, ::-1][:, : axes[drawn, kept].shape[1]]
    return lambda around: waves(around) @ axes


def _coordinates(around: Conditions, competitor: Competitor) -> list[int]:
    """Coordinates of the sites that a law displaces."""
    if competitor.location:
        return [competitor.location[0] - 1]
    return list(around.sites.base[:3] if competitor.motion == SHIFT else around.sites.base[3:])


def _waves(
    competitor: Competitor, campaign: Conditions, coordinate: int, largest_load: float, draws: np.random.Generator
) -> _Waves:
    """Random functions (S, 2 * drawn) of the inputs of a law without their part that has a name; without an input zero.

    Each half has a variance of about one half; the second goes with the load.
    """
    known = _inputs(campaign, competitor, coordinate, campaign)
    drawn = [_drawn(known.shape[1], draws) for _ in range(2)]
    frequency, phase = (np.concatenate(each, axis=-1) for each in zip(*drawn, strict=True))
    size = np.sqrt(1.0 / _DRAWN) if known.shape[1] else 0.0
    named = _named_part(competitor, campaign, size * np.cos(known @ frequency + phase))

    def waves(around: Conditions) -> np.ndarray:
        found = size * np.cos(_inputs(around, competitor, coordinate, campaign) @ frequency + phase) - named(around)
        if largest_load > _ROUNDING:
            found[:, _DRAWN:] *= (_load(around, competitor.location) / largest_load)[:, None]
        return found

    return waves


def _drawn(inputs: int, draws: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (inputs, drawn) and phases of random Fourier features."""
    low, high = np.log(_LENGTH_SCALES)
    lengths = np.exp(draws.uniform(low, high, _DRAWN))
    return draws.standard_normal((inputs, _DRAWN)) / lengths, draws.uniform(0, 2 * np.pi, _DRAWN)


def _named_part(competitor: Competitor, campaign: Conditions, waves: np.ndarray) -> Callable[[Conditions], np.ndarray]:
    """What is constant in waves (S, count) over a campaign, and at a joint what goes straight with its angle; for any states.

    A zero offset, a transmission ratio, a frame that is fitted: the catalogue has names for these.
    """
    mean = waves.mean(axis=0)
    if not competitor.location or competitor.law == TIME:
        return lambda around: mean
    joint = competitor.location[0] - 1
    center = campaign.joint_angles[:, joint].mean()
    off = campaign.joint_angles[:, joint] - center
    squares = off @ off
    slope = off @ waves / squares if squares > _ROUNDING else np.zeros_like(mean)
    return lambda around: mean + np.outer(around.joint_angles[:, joint] - center, slope)


def _inputs(around: Conditions, competitor: Competitor, coordinate: int, campaign: Conditions) -> np.ndarray:
    """Inputs of a law for one of its coordinates, each of size about one, ndarray (S, D).

    Angles as points of a circle, all about their mean. What is constant or absent in the campaign is left out.
    """
    parts = [_scaled(value(around), value(campaign)) for value in _INPUTS[competitor.law](coordinate, campaign)]
    return np.concatenate([np.zeros((len(around.joint_angles), 0)), *parts], axis=1)


def _scaled(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    known, values = (np.reshape(each, (len(each), -1)).astype(float) for each in (known, values))
    spread = np.abs(known - known.mean(axis=0)).max(axis=0, initial=0.0)
    differ = spread > _ROUNDING * np.maximum(np.abs(known).max(axis=0, initial=0.0), 1.0)
    return ((values - known.mean(axis=0)) / np.where(differ, spread, 1.0))[:, differ]


def _angles(joints: Iterable[int]) -> list[Callable[[Conditions], np.ndarray]]:
    """Points of a circle for some joints, counted from 0."""
    return [partial(_on_circle, wave, joint) for joint in joints for wave in (np.cos, np.sin)]


def _on_circle(wave: Callable[[np.ndarray], np.ndarray], joint: int, around: Conditions) -> np.ndarray:
    return wave(around.joint_angles[:, joint])


def _own(joint: int, campaign: Conditions) -> list[Callable[[Conditions], np.ndarray]]:
    approach = [lambda around: around.approach[:, joint]] if campaign.approach is not None else []
    return [*_angles([joint]), lambda around: around.total[:, joint], *approach]


def _neighbours(joint: int, campaign: Conditions) -> list[Callable[[Conditions], np.ndarray]]:
    beside = [other for other in (joint - 1, joint, joint + 1) if 0 <= other < campaign.sites.joints]
    return [*_angles(beside), lambda around: around.total[:, joint]]


def _time(coordinate: int, campaign: Conditions) -> list[Callable[[Conditions], np.ndarray]]:
    names = ("time_s", "temperature_c", "progress")
    return [attrgetter(name) for name in names if getattr(campaign, name) is not None]


def _force(coordinate: int, campaign: Conditions) -> list[Callable[[Conditions], np.ndarray]]:
    return [lambda around: around.total[:, coordinate]]


def _place(coordinate: int, campaign: Conditions) -> list[Callable[[Conditions], np.ndarray]]:
    return [lambda around: around.motion.position[0].T]


_INPUTS = {OWN: _own, NEIGHBOURS: _neighbours, TIME: _time, FORCE: _force, PLACE: _place}


def _load(around: Conditions, location: tuple[int, ...]) -> np.ndarray:
    """Torque on the joint, or force on the base, ndarray (S,)."""
    return around.total[:, location[0] - 1] if location else np.linalg.norm(around.wrench[:, :3], axis=1)
