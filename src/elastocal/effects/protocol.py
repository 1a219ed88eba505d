"""The parts of an effect of the catalogue: candidates, each with named parameters and
the displacements that they cause.

An effect is a function that `effect` decorates. The catalogue finds it in any module of
this package, and by an entry point in other installed packages; no other code knows the
effects by name.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import cleandoc
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import (
        Callable,
        Collection,
        Iterable,
        Iterator,
        Mapping,
        Sequence,
    )
    from typing import Any

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.sizes import Size
    from elastocal.mechanics.sites import Sites

    # Displacements of each parameter, by the coordinate of the sites that they move:
    # ndarray (S,), per unit of the parameter.
    Displacements = list[dict[int, np.ndarray]]
    # From the conditions and one value of each shape.
    Law = Callable[..., Displacements]
    # The locations on a robot at which an effect can act, each as the arguments that
    # the effect's function takes for it.
    Places = Callable[[Sites], Iterable[tuple[Any, ...]]]
    Candidates = Iterator["Candidate"]
    # From the effect, the sites and the arguments of one location.
    Listing = Callable[..., Candidates]
    # From the conditions and one value of each shape: one deviation of a joint, ndarray
    # (S,), for each parameter.
    Turns = Callable[..., Iterable[np.ndarray]]


# Needs of laws that depend on the load on the joints.
LOADED_JOINTS = frozenset({"load", "load on the joints"})
WAVES = {"cos": np.cos, "sin": np.sin}


def load_behind(sites: Sites, joints: int) -> frozenset[str]:
    """List the needs of a structure that yields to the load behind so many joints.

    The usual weight of an arm whose masses are not declared loads columns and rails.
    Behind a joint that turns, the effect `link_weight` models that weight instead.
    """
    if all(sites.prismatic[:joints]):
        return frozenset({"load"})
    return LOADED_JOINTS


@dataclass(frozen=True)
class Parameter:
    """One linear unknown of an effect.

    Attributes
    ----------
    name, unit : as tables and reports have them; SI units.
    plausible : magnitude that such an effect can reach on a real robot. A parameter
        that the data cannot distinguish from zero even at this size is not estimated.
    prior_std : standard deviation of a normal prior about zero, for series whose terms
        the data distinguish only in part, as in ridge regression (Hoerl and Kennard
        1970); reported with the estimate. None, as nearly everywhere, for no prior.
    sign : sign that physics gives such an effect, 0 for either.
    order : order of a harmonic, with which its plausible size falls; 1 elsewhere.
    sized : whether the prior was estimated from the measurements.
    most : multiple of the plausible size that a search allows for.
    lowest : lowest value that physics allows beside the sign, such as minus the declared
        mass for the error of a mass.
    """

    name: str
    unit: str
    plausible: float
    prior_std: float | None = None
    sign: int = 0
    order: int = 1
    sized: bool = False
    most: float = np.inf
    lowest: float = -np.inf

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that physics allows."""
        lowest = max(self.lowest, 0.0) if self.sign > 0 else self.lowest
        return lowest, 0.0 if self.sign < 0 else np.inf


@dataclass(frozen=True)
class Shape:
    """One unknown in which an effect is not linear.

    Attributes
    ----------
    name, unit : as tables and reports have them.
    start : value at which a search starts.
    lowest, highest : range in which the law keeps its meaning.
    tried : how many evenly spaced values a search must try lest it step over the law; 1
        for the start alone; 0 if a few values in geometric series suffice.
    """

    name: str
    unit: str
    start: float
    lowest: float
    highest: float
    tried: int = 0

    def values(self, few: int) -> np.ndarray:
        """Values from which a search starts, ndarray.

        These are the values that must be tried, or else `few` inner values of a
        geometric series over the range.
        """
        if self.tried == 1:
            return np.array([self.start])
        if self.tried:
            return np.linspace(self.lowest, self.highest, self.tried)
        return np.geomspace(self.lowest, self.highest, few + 2)[1:-1]

    def between(self, below: float, above: float, count: int) -> np.ndarray:
        """Values inside an interval, spaced as those that a search tries, ndarray
        (count,)."""
        spaced = np.linspace if self.tried else np.geomspace
        return spaced(below, above, count + 2)[1:-1]

    def shares(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """Share of the range that each value represents, ndarray of sum one: the part
        of the range that is closest to it (its Voronoi cell)."""
        scale = (lambda value: value) if self.tried else np.log
        points = scale(np.asarray(values, float))
        low = scale(self.lowest)
        high = scale(self.highest)
        order = np.argsort(points)
        midpoints = 0.5 * (points[order][1:] + points[order][:-1])
        edges = np.concatenate([[low], np.clip(midpoints, low, high), [high]])
        shares = np.empty(len(points))
        shares[order] = np.diff(edges) / (edges[-1] - edges[0])
        return shares


@dataclass(frozen=True)
class Candidate:
    """One way in which one effect can act on a robot.

    Candidates of one effect at one location are variants of its law, of which only one
    can be true.

    Attributes
    ----------
    effect, family : names of the effect and of the kind of its physics.
    joints : joints that are concerned, from 1; empty if the effect belongs to none.
    detail : name of the variant, if an effect has several for these joints.
    parameters : unknowns in which the displacement is linear.
    displacement : ``displacement(conditions, *shapes)`` gives for each parameter a
        dictionary from a coordinate of the sites to its displacement per unit, ndarray
        (S,). It may depend on the total loads of the coordinates that it displaces, of
        no others.
    needs : what the data must have, see `conditions.find_offered_needs`.
    shapes : unknowns in which the displacement is not linear.
    distinct_angles : how many different angles of its joints the law needs to be
        distinguishable from a smooth one.
    location_name : name of the location if the joints do not determine it: a column, a
        band of orders.
    of_setup : whether the effect belongs to where tracker and robot stood in one
        campaign, and is not carried over to another one.
    turning : joints, from 1, on whose angles the law depends if it belongs to no joint.
    fixed : whether the displacement per unit depends on the joint angles alone, neither
        on loads or compliances nor on the deflected pose, so that no step of a fit
        changes it.
    nonlinear_in_load : whether the law is no linear function of the load, so that it
        depends on where the load changes its sign or reaches a threshold.
    """

    effect: str
    family: str
    joints: tuple[int, ...]
    detail: str
    parameters: tuple[Parameter, ...]
    displacement: Law
    needs: frozenset[str] = frozenset()
    shapes: tuple[Shape, ...] = ()
    distinct_angles: int = 0
    location_name: str = ""
    of_setup: bool = False
    turning: tuple[int, ...] = ()
    fixed: bool = False
    nonlinear_in_load: bool = False

    @property
    def location(self) -> tuple[int | str, ...]:
        """Where the effect acts: its joints, and the name of the location if they do
        not determine it."""
        if self.location_name:
            return (*self.joints, self.location_name)
        return self.joints

    @cached_property
    def key(self) -> str:
        """Unique name, such as ``link_weight@2`` or ``transmission_harmonic@1[orders
        3-12]``."""
        joints = f"@{'+'.join(map(str, self.joints))}" if self.joints else ""
        detail = f"[{self.detail}]" if self.detail else ""
        return f"{self.effect}{joints}{detail}"


def moved_and_turned(shift: float, turn: float, per: str = "") -> tuple[Parameter, ...]:
    """Make the parameters of a shift along and a rotation about each axis.

    Parameters
    ----------
    shift, turn : plausible sizes, m and rad.
    per : end of the units, such as ``/h``.
    """
    quantities = (("d", "m", shift), ("r", "rad", turn))
    return tuple(
        Parameter(f"{letter}{axis}", unit + per, size)
        for letter, unit, size in quantities
        for axis in "xyz"
    )


def declare_with_prior(
    candidate: Candidate, effect: str, std: Sequence[float], **options: Any
) -> Candidate:
    """Make the candidate of an error within the uncertainty of what is declared.

    It acts as a candidate of the catalogue and is part of the declared model.

    Parameters
    ----------
    candidate : candidate of the catalogue.
    effect : name of the effect within the declared model.
    std : standard deviation of the normal prior of each parameter.
    options : further fields of the candidate.
    """
    parameters = tuple(
        replace(parameter, plausible=deviation, prior_std=deviation)
        for parameter, deviation in zip(candidate.parameters, std, strict=True)
    )
    return replace(
        candidate,
        effect=effect,
        family="declared",
        detail="",
        parameters=parameters,
        **options,
    )


def require_unique(names: Sequence[str]) -> None:
    """Refuse two candidates of one name: tables could not distinguish them.

    Raises ValueError.
    """
    duplicates = [name for name, count in Counter(names).items() if count > 1]
    if duplicates:
        raise ValueError(f"candidates of one name: {', '.join(duplicates)}")


@dataclass(frozen=True)
class Effect:
    """One effect of the catalogue.

    Attributes
    ----------
    name, doc : name and docstring of the function `listed`.
    family, words, formula, moves_robot, part, detail_words, parameter_words, at : as
        `effect` has them.
    sizes : sizes by quantity.
    listed : the decorated function, which yields the candidates at one location.
    """

    name: str
    family: str
    words: str
    doc: str
    sizes: Mapping[str, Size]
    listed: Listing
    at: Places
    moves_robot: bool = True
    part: str = "joint"
    formula: str = ""
    detail_words: Mapping[str, str] = field(default_factory=dict)
    parameter_words: Mapping[str, str] = field(default_factory=dict)

    def candidates(self, sites: Sites) -> list[Candidate]:
        """List every way in which the effect can act on this robot."""
        return [
            candidate
            for arguments in self.at(sites)
            for candidate in self.listed(self, sites, *arguments)
        ]

    def candidate(
        self,
        joints: tuple[int, ...],
        parameters: Iterable[Parameter],
        law: Law,
        needs: Collection[str] = (),
        **options: Any,
    ) -> Candidate:
        """Make a `Candidate` of this effect; `options` are further fields of it."""
        detail = options.pop("detail", "")
        return Candidate(
            self.name,
            self.family,
            joints,
            detail,
            tuple(parameters),
            law,
            frozenset(needs),
            **options,
        )

    def of_joint(
        self,
        joint: int,
        parameters: Iterable[Parameter],
        turns: Turns,
        *needs: Any,
        **options: Any,
    ) -> Candidate:
        """Make a candidate that moves one joint alone.

        Parameters
        ----------
        joint : from 0.
        turns : ``turns(conditions, *shapes)`` gives the deviation of the joint per unit
            of each parameter, ndarrays (S,).
        needs, options : as in `candidate`.
        """
        return self.candidate(
            (joint + 1,),
            parameters,
            lambda *arguments: [{joint: turn} for turn in turns(*arguments)],
            *needs,
            **options,
        )

    def size(self, quantity: str, sites: Sites, *joints: int) -> float:
        """Size of a quantity of this effect on an arm, see `Size.on`."""
        return self.sizes[quantity].on(sites, *joints)

    def parameters(
        self,
        quantity: str,
        names: Iterable[str],
        unit: str,
        sites: Sites,
        *joints: int,
        over: float = 1.0,
    ) -> tuple[Parameter, ...]:
        """Make parameters of one quantity, with its size and sign.

        Parameters
        ----------
        quantity : key of `sizes`.
        names, unit : of the parameters.
        joints : as of `Size.on`.
        over : by which the size is divided.
        """
        size = self.size(quantity, sites, *joints) / over
        stated = self.sizes[quantity]
        return tuple(
            Parameter(name, unit, size, sign=stated.sign, most=stated.most)
            for name in names
        )


def _act_once(sites: Sites) -> list[tuple[()]]:
    return [()]


def effect(
    family: str, words: str, *sizes: Size, at: Places = _act_once, **options: Any
) -> Callable[[Listing], Effect]:
    """Make an effect of a function that yields its candidates at one location.

    The function is called ``name(entry, sites, *arguments)``, with the effect itself,
    the robot's sites and the arguments of one location. Keys and tables call the effect
    by the name of the function. Its docstring has the physics, the formula with units
    and the source.

    Parameters
    ----------
    family : kind of its physics, such as elastic or gearbox.
    words : its physical name, which precedes "of joint 2" or stands alone.
    sizes : sizes of its quantities.
    at : ``at(sites)`` lists the locations; without it there is one without arguments.
    options : ``formula``, the formula for print, in TeX; ``moves_robot``, False if the
        effect changes only the measurements, so that the robot's tasks do not feel it;
        ``part``, "link" if its joints stand for the links behind them; ``detail_words``
        and ``parameter_words``, if the detail of a candidate or the name of a parameter
        says too little.
    """

    def make_effect(listed: Listing) -> Effect:
        return Effect(
            listed.__name__,
            family,
            words,
            cleandoc(listed.__doc__ or ""),
            {size.quantity: size for size in sizes},
            listed,
            at,
            **options,
        )

    return make_effect


def waves(angle: np.ndarray, *orders: float) -> list[np.ndarray]:
    """Cosine and sine of multiples of an angle (S,), order by order, as ndarrays
    (S,)."""
    return [wave(order * angle) for order in orders for wave in WAVES.values()]


def every_joint(sites: Sites) -> list[tuple[int]]:
    """List all joints, from 0, one a location."""
    return [(joint,) for joint in range(sites.joints)]


def turning_joints(sites: Sites) -> list[tuple[int]]:
    """List the revolute joints, from 0, one a location."""
    return [(joint,) for joint in range(sites.joints) if not sites.prismatic[joint]]


def small_form(whole: Candidate, detail: str, kept: slice) -> Candidate:
    """Make the variant of a candidate that has only some of its parameters."""

    def law(conditions: Conditions, *shapes: float) -> Displacements:
        return whole.displacement(conditions, *shapes)[kept]

    return replace(
        whole, detail=detail, parameters=whole.parameters[kept], displacement=law
    )


def effect_of(key: str) -> str:
    """Name of the effect in the key of a candidate."""
    return key.split("@")[0].split("[")[0]
