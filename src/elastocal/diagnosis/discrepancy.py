"""Discrepancies: random displacements of a joint or the base, which compete for effects
that the catalogue does not have.

A discrepancy is a random function of a few inputs, an approximate Gaussian process:
principal components, over the states of a campaign, of random Fourier features (Rahimi
and Recht, NIPS 2007). Such a model discrepancy (Kennedy and O'Hagan, JRSS B 2001)
should leave to the model what the model explains (Plumlee, JASA 2017). Therefore its
mean is removed, and at a joint its part that is linear in the joint angle. A
discrepancy with time at a joint begins at zero instead, and one that depends on the
position of the end keeps its mean.

Each discrepancy has the inputs of one cause, like the terms of an additive Gaussian
process (Duvenaud et al., NIPS 2011): a joint's own angle, torque and approach; the
angles of the joint and its neighbours; time and temperature; the load on the base; the
position of the end. At a joint each acts either in proportion to the load or without
it, because compliance does not move a joint that bears no load.

A discrepancy alone means that the residual is *unexplained*; in a model with a
mechanism it means that a *related* mechanism acts. It has no name and is not used to
predict.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.random_streams import open_stream

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.effects.conditions import Conditions

    # Values (S, F) of some features in some states.
    StateFunction = Callable[[Conditions], np.ndarray]

# Displacements that no machine would hide: about an arc minute at the joints, a tenth
# of a millimetre and of a milliradian at the base.
JOINT_RAD = 2e-4
BASE_M = 1e-4
BASE_RAD = 1e-4
# Names of the causes, of the motions of the base, and of discrepancies that act in
# proportion to the load.
OWN = "own"
NEIGHBOURS = "neighbours"
TIME = "time"
FORCE = "force"
PLACE = "place"
SHIFT = "shift"
TURN = "turn"
UNDER_LOAD = " under load"
# Range of the length scales of the features, for inputs of size one: from smooth to as
# many waves as the poses can show.
_LENGTH_SCALES = (0.7, 3.0)
# Number of random features from which the principal components are computed, and number
# of components at the base; at a joint the settings state it.
_RANDOM_FEATURES = 64
_BASE_FEATURES = 6
# Inputs whose spread is below this, in SI units or relative to their largest value,
# differ by rounding only.
_ROUNDING = 1e-9
_SEED = 2007


@dataclass(frozen=True)
class Discrepancy:
    """Random displacements by one cause at one location.

    Attributes
    ----------
    location : joint counted from 1; empty for the base
    name : distinguishes the discrepancies of one location
    size : standard deviation of the displacement, rad or m
    components : displaced coordinates, each with its random functions of the states
    features : total number of displacements
    """

    location: tuple[int, ...]
    name: str
    size: float
    components: tuple[tuple[int, StateFunction], ...]
    features: int

    @property
    def kind(self) -> tuple[bool, str]:
        """Key that the discrepancies of one name at all joints share."""
        return bool(self.location), self.name

    def displacement(self, conditions: Conditions) -> list[dict[int, np.ndarray]]:
        """For each feature, the displacement (S,) of one coordinate in some states."""
        return [
            {coordinate: self.size * wave}
            for coordinate, functions in self.components
            for wave in functions(conditions).T
        ]


@dataclass(frozen=True)
class _Kind:
    """What a discrepancy acts on, before its random functions are drawn.

    `features_by_load`: number of principal components in proportion to the load (True)
    and without it (False). Other fields as of `Discrepancy`.
    """

    location: tuple[int, ...]
    cause: str
    suffix: str
    size: float
    coordinates: list[int]
    features_by_load: dict[bool, int]

    @property
    def name(self) -> str:
        """Name of the discrepancy."""
        return f"{self.cause}{self.suffix}"


def build_discrepancies(campaign: Conditions, features: int) -> list[Discrepancy]:
    """Build the discrepancies for whose inputs a campaign has different values, at each
    joint and at the base.

    Parameters
    ----------
    campaign : states over which the principal components are computed, and over which
        the parts that the catalogue names are removed
    features : number of principal components at a joint
    """
    discrepancies = []
    for kind in [*_joint_kinds(campaign, features), *_base_kinds(campaign)]:
        inputs = {
            coordinate: _Inputs.standardised(campaign, kind.cause, coordinate)
            for coordinate in kind.coordinates
        }
        if not any(of_coordinate.varies.any() for of_coordinate in inputs.values()):
            continue
        joint = kind.location[0] if kind.location else 0
        draws = open_stream(
            _SEED, f"other {kind.name}", "random Fourier features", joint
        )
        components = tuple(
            (
                coordinate,
                _draw_functions(campaign, of_coordinate, kind, draws, loaded=loaded),
            )
            for coordinate, of_coordinate in inputs.items()
            for loaded in kind.features_by_load
        )
        count = sum(kind.features_by_load.values()) * len(inputs)
        discrepancies.append(
            Discrepancy(kind.location, kind.name, kind.size, components, count)
        )
    return discrepancies


def _joint_kinds(campaign: Conditions, features: int) -> list[_Kind]:
    """Discrepancies of the joints, in proportion to the load only if there is one."""
    kinds = []
    for index in range(campaign.sites.joints):
        is_loaded = np.abs(campaign.total[:, index]).max(initial=0.0) > _ROUNDING
        for cause in (OWN, NEIGHBOURS, TIME):
            for loaded in (False, True) if is_loaded else (False,):
                suffix = UNDER_LOAD if loaded else ""
                kinds.append(
                    _Kind(
                        (index + 1,),
                        cause,
                        suffix,
                        JOINT_RAD,
                        [index],
                        {loaded: features},
                    )
                )
    return kinds


def _base_kinds(campaign: Conditions) -> list[_Kind]:
    """Discrepancies of the base, its shifts and its turns apart."""
    base = campaign.sites.base
    shift = (f" {SHIFT}", BASE_M, list(base[:3]))
    turn = (f" {TURN}", BASE_RAD, list(base[3:]))
    # Refraction shifts a target in one direction only; a misplaced frame can shift it
    # in any direction.
    shifts_along_axes = [
        (f" {SHIFT} {axis}", BASE_M, [coordinate])
        for axis, coordinate in zip("xyz", base[:3], strict=True)
    ]
    half = _BASE_FEATURES // 2
    unloaded = {False: _BASE_FEATURES}
    kinds = [
        *(
            _Kind((), FORCE, *motion, {False: half, True: half})
            for motion in (shift, turn)
        ),
        *(_Kind((), TIME, *motion, unloaded) for motion in (shift, turn)),
        *(_Kind((), PLACE, *motion, unloaded) for motion in (*shifts_along_axes, turn)),
    ]
    return kinds


@dataclass(frozen=True)
class _Inputs:
    """Inputs of one coordinate's discrepancy, each of size about one in a campaign.

    Attributes
    ----------
    cause, coordinate : what they are
    center, spread : (D,), mean and largest deviation from it in the campaign
    varies : (D,) bool, inputs that differ in the campaign; the others are dropped
    """

    cause: str
    coordinate: int
    center: np.ndarray
    spread: np.ndarray
    varies: np.ndarray

    @classmethod
    def standardised(cls, campaign: Conditions, cause: str, coordinate: int) -> _Inputs:
        """Inputs that are centred and scaled over the states of a campaign."""
        values = _raw_inputs(campaign, cause, coordinate)
        center = values.mean(axis=0)
        spread = np.abs(values - center).max(axis=0, initial=0.0)
        largest = np.abs(values).max(axis=0, initial=0.0)
        varies = spread > _ROUNDING * np.maximum(largest, 1.0)
        return cls(cause, coordinate, center, spread, varies)

    def evaluate(self, conditions: Conditions) -> np.ndarray:
        """Values (S, D') of the inputs that vary, in some states."""
        deviation = _raw_inputs(conditions, self.cause, self.coordinate) - self.center
        return deviation[:, self.varies] / self.spread[self.varies]


def _raw_inputs(conditions: Conditions, cause: str, coordinate: int) -> np.ndarray:
    """Inputs (S, D) of a cause in their own units, angles as points of a circle."""
    inputs: list[np.ndarray]
    if cause == TIME:
        clocks = (conditions.time_s, conditions.temperature_c, conditions.progress)
        inputs = [values for values in clocks if values is not None]
    elif cause == FORCE:
        inputs = [conditions.total[:, coordinate]]
    elif cause == PLACE:
        inputs = list(conditions.motion.position[0])
    else:
        reach = 0 if cause == OWN else 1
        joints = slice(max(coordinate - reach, 0), coordinate + reach + 1)
        inputs = [
            wave(angle)
            for angle in conditions.joint_angles[:, joints].T
            for wave in (np.cos, np.sin)
        ]
        inputs.append(conditions.total[:, coordinate])
        if cause == OWN and conditions.approach is not None:
            inputs.append(conditions.approach[:, coordinate])
    states = len(conditions.joint_angles)
    return np.array(inputs, float).reshape(len(inputs), states).T


def _draw_functions(
    campaign: Conditions,
    inputs: _Inputs,
    kind: _Kind,
    draws: np.random.Generator,
    *,
    loaded: bool,
) -> StateFunction:
    """Draw random functions of some inputs: the principal components, over a campaign,
    of random Fourier features without the parts that the catalogue names."""
    waves = _draw_waves(inputs, kind, draws)
    remove_named_parts = _fit_named_parts(
        waves(campaign), campaign, inputs, kind.location, loaded=loaded
    )
    features = remove_named_parts(waves(campaign), campaign)
    _, vectors = np.linalg.eigh(features.T @ features)
    axes = vectors[:, ::-1][:, : kind.features_by_load[loaded]]
    return lambda conditions: remove_named_parts(waves(conditions), conditions) @ axes


def _draw_waves(
    inputs: _Inputs, kind: _Kind, draws: np.random.Generator
) -> StateFunction:
    """Draw Fourier features (S, F) whose sum over features and loads has unit
    variance."""
    count = int(inputs.varies.sum())
    low, high = np.log(_LENGTH_SCALES)
    lengths = np.exp(draws.uniform(low, high, _RANDOM_FEATURES))
    frequency = draws.standard_normal((count, _RANDOM_FEATURES)) / lengths
    phase = draws.uniform(0, 2 * np.pi, _RANDOM_FEATURES)
    variance = 1.0 / len(kind.features_by_load)
    amplitude = np.sqrt(2.0 * variance / _RANDOM_FEATURES) if count else 0.0
    return lambda conditions: (
        amplitude * np.cos(inputs.evaluate(conditions) @ frequency + phase)
    )


def _fit_named_parts(
    features: np.ndarray,
    campaign: Conditions,
    inputs: _Inputs,
    location: tuple[int, ...],
    *,
    loaded: bool,
) -> Callable[[np.ndarray, Conditions], np.ndarray]:
    """Fit the parts of features that the catalogue names: mean, or start, and the part
    linear in the joint angle.

    Parameters
    ----------
    features : (S, F), their values in the campaign
    campaign : its states
    inputs : inputs of the features
    location : joint counted from 1; empty for the base
    loaded : whether the features are in proportion to the load

    Returns
    -------
    Function that removes these parts from features (S, F) in some states, and makes the
    features proportional to the load if they are so
    """
    mean = features.mean(axis=0)
    if inputs.cause == PLACE:
        mean = np.zeros(_RANDOM_FEATURES)
    elif inputs.cause == TIME and location:
        # What time brings a joint begins at zero.
        mean = features[np.argmin(inputs.evaluate(campaign)[:, -1])]
    if loaded:
        largest = max(np.abs(_load(campaign, location)).max(initial=0.0), _ROUNDING)
        return lambda features, conditions: (
            (features - mean) * (_load(conditions, location) / largest)[:, None]
        )
    if inputs.cause not in (OWN, NEIGHBOURS):
        return lambda features, conditions: features - mean
    angle = campaign.joint_angles[:, inputs.coordinate]
    center = angle.mean()
    squares = ((angle - center) ** 2).sum()
    slope = np.zeros(_RANDOM_FEATURES)
    if squares > _ROUNDING:
        slope = (angle - center) @ features / squares
    return lambda features, conditions: (
        features
        - mean
        - np.outer(conditions.joint_angles[:, inputs.coordinate] - center, slope)
    )


def _load(conditions: Conditions, location: tuple[int, ...]) -> np.ndarray:
    """Torque on the joint, or force on the base, (S,)."""
    if location:
        return conditions.total[:, location[0] - 1]
    return np.linalg.norm(conditions.wrench[:, :3], axis=1)
