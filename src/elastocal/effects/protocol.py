"""What an effect of the catalogue is: candidates, each with named parameters and the
displacements that they make.

An effect is a function of a module of this package that `effect` decorates. Nothing
else knows the effects by name: a new one, in a module of its own, is found by the
catalogue.
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

    # For each parameter, by coordinate of the sites, the displacement per unit of the
    # parameter, ndarray (S,).
    Displacements = list[dict[int, np.ndarray]]
    # From the conditions and a value of each of the shapes.
    Law = Callable[..., Displacements]
    # What tells each place on a robot where an effect acts; and its candidates, from
    # the effect, the sites and that of a place.
    Places = Callable[[Sites], Iterable[tuple[Any, ...]]]
    Candidates = Iterator["Candidate"]
    Listing = Callable[..., Candidates]
    Turns = Callable[..., Iterable[np.ndarray]]


# Needs of laws that go with the load on the joints.
LOADED_JOINTS = frozenset({"load", "load on the joints"})
WAVES = {"cos": np.cos, "sin": np.sin}


def load_behind(sites: Sites, joints: int) -> frozenset[str]:
    """Needs of the law of what yields to the load, behind so many joints.

    A weight that is only usual, not declared, loads columns and rails: behind a joint
    that turns `link_weight` has it.
    """
    return frozenset({"load"}) if all(sites.prismatic[:joints]) else LOADED_JOINTS


@dataclass(frozen=True)
class Parameter:
    """One unknown of an effect.

    `plausible`: magnitude that such an effect can reach on a real robot; one that the
    data cannot distinguish from zero even at this size is not estimated. `prior_std`:
    standard deviation of a normal prior about zero, for series whose terms the data
    distinguish only in part, as in ridge regression (Hoerl and Kennard 1970), reported
    with the estimate; None, as nearly everywhere, for no prior. `sign`: that such an
    effect has by its physics; 0 where it may have either. `order`: of a harmonic, whose
    plausible size falls with it; 1 elsewhere. `sized`: whether the prior was estimated
    from the measurements. `most`: times its plausible size that a search allows for.
    """

    name: str
    unit: str
    plausible: float
    prior_std: float | None = None
    sign: int = 0
    order: int = 1
    sized: bool = False
    most: float = np.inf


@dataclass(frozen=True)
class Shape:
    """An unknown in which the effect is not linear.

    `start`: where the search starts. `lowest`, `highest`: range in which the law keeps
    its meaning. `tried`: how many evenly spaced values a search must try lest it step
    over the law, one for the start alone; 0 where a few growing values will do.
    """

    name: str
    unit: str
    start: float
    lowest: float
    highest: float
    tried: int = 0

    def values(self, few: int) -> np.ndarray:
        """Values for a search to start from, ndarray: those that must be tried, or a
        few in geometric series in the range."""
        if self.tried == 1:
            return np.array([self.start])
        if self.tried:
            return np.linspace(self.lowest, self.highest, self.tried)
        return np.geomspace(self.lowest, self.highest, few + 2)[1:-1]

    def between(self, below: float, above: float, count: int) -> np.ndarray:
        """Values inside of an interval, evenly spaced as those that a search tries,
        ndarray (count,)."""
        return (np.linspace if self.tried else np.geomspace)(below, above, count + 2)[
            1:-1
        ]

    def shares(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """How much of the range each of some values stands for: the part nearest to it
        (Voronoi cell), ndarray of sum one."""
        scale = (lambda value: value) if self.tried else np.log
        places = scale(np.asarray(values, float))
        low = scale(self.lowest)
        high = scale(self.highest)
        order = np.argsort(places)
        inner = 0.5 * (places[order][1:] + places[order][:-1])
        edges = np.concatenate([[low], np.clip(inner, low, high), [high]])
        found = np.empty(len(places))
        found[order] = np.diff(edges) / (edges[-1] - edges[0])
        return found


@dataclass(frozen=True)
class Candidate:
    """One way in which one effect can act on this robot.

    `joints`: concerned, from 1; empty where the effect belongs to no joint. `detail`:
    which variant, where an effect has more than one for these joints. `parameters`: in
    which the displacement is linear. `displacement`: ``displacement(conditions,
    *shapes)`` gives for each parameter a dict from a coordinate of the sites to its
    displacement per unit, ndarray (S,). It may go with the total loads of the
    coordinates that it displaces, of no others. `needs`: what must be there, see
    `conditions.offered`. `distinct_angles`: how many different angles of its joints the
    law needs to be distinguishable from a smooth one. `location_name`: names the
    location beside the joints where these do not: a column, a band of orders.
    Candidates of one effect at one location are variants of its law, of which only one
    can hold. `of_setup`: whether it belongs to where tracker and robot stood in one
    campaign, and is not carried over to another. `turning`: joints with whose angles
    the law goes, from 1, where it belongs to no joint. `fixed`: whether the
    displacement per unit goes with the joint angles alone, not with loads, springs or
    where the robot yielded to, so that no step changes it.
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

    @property
    def location(self) -> tuple[int | str, ...]:
        """Where the effect acts: its joints, with the name of the location where they
        do not determine it."""
        return (*self.joints, self.location_name) if self.location_name else self.joints

    @cached_property
    def key(self) -> str:
        """Unique name, such as ``link_weight@2`` or ``transmission_harmonic@1[orders
        3-12]``."""
        where = "@" + "+".join(map(str, self.joints)) if self.joints else ""
        return f"{self.effect}{where}" + (f"[{self.detail}]" if self.detail else "")


def moved_and_turned(shift: float, turn: float, per: str = "") -> tuple[Parameter, ...]:
    """Parameters of a shift along and a turn about each axis, of plausible sizes in m
    and rad; `per` follows their units."""
    sizes = (("d", "m", shift), ("r", "rad", turn))
    return tuple(
        Parameter(f"{letter}{axis}", unit + per, size)
        for letter, unit, size in sizes
        for axis in "xyz"
    )


def require_unique(names: Sequence[str]) -> None:
    """Refuse two candidates of one name, a ValueError: in tables nothing would
    distinguish them."""
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"candidates of one name: {', '.join(twice)}")


@dataclass(frozen=True)
class Effect:
    """One effect of the catalogue, as `effect` makes it of the function `listed`; `doc`
    is the docstring of that."""

    name: str
    family: str
    words: str
    doc: str
    sizes: Mapping[str, Size]
    listed: Listing
    at: Places
    moves_robot: bool = True
    part: str = "joint"
    detail_words: Mapping[str, str] = field(default_factory=dict)
    parameter_words: Mapping[str, str] = field(default_factory=dict)

    def candidates(self, sites: Sites) -> list[Candidate]:
        """Where on this robot the effect can act."""
        return [
            candidate
            for place in self.at(sites)
            for candidate in self.listed(self, sites, *place)
        ]

    def candidate(
        self,
        joints: tuple[int, ...],
        parameters: Iterable[Parameter],
        law: Law,
        needs: Collection[str] = (),
        **more: Any,
    ) -> Candidate:
        """A `Candidate` of this effect; `more` as there."""
        detail = more.pop("detail", "")
        return Candidate(
            self.name,
            self.family,
            joints,
            detail,
            tuple(parameters),
            law,
            frozenset(needs),
            **more,
        )

    def of_joint(
        self,
        joint: int,
        parameters: Iterable[Parameter],
        turns: Turns,
        *needs: Any,
        **more: Any,
    ) -> Candidate:
        """A candidate that moves one joint alone, from 0, by ``turns(conditions,
        *shapes)``, one for each parameter."""
        return self.candidate(
            (joint + 1,),
            parameters,
            lambda *at: [{joint: turn} for turn in turns(*at)],
            *needs,
            **more,
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
        """Parameters of one quantity with its size, divided by `over`, and its sign;
        `joints` as of `Size.on`."""
        size = self.size(quantity, sites, *joints) / over
        line = self.sizes[quantity]
        return tuple(
            Parameter(name, unit, size, sign=line.sign, most=line.most)
            for name in names
        )


def effect(
    family: str, words: str, *sizes: Size, at: Places = lambda sites: [()], **more: Any
) -> Callable[[Listing], Effect]:
    """Make an effect of a function that yields its candidates, ``name(own, sites,
    *place)``, for each place on a robot.

    Keys and tables call it by the name of the function; its docstring has the physics,
    the formula with units and the source. `family`: kind of its physics, such as
    elastic or gearbox. `words`: its physical name in words that precede "of joint 2",
    or stand alone. `sizes`: of its quantities. `at`: ``at(sites)`` lists the places.
    `more`: `moves_robot`, False where it moves only what was measured of the robot, so
    that its tasks do not feel it; `part`, "link" if its joints stand for the links
    behind them; `detail_words` and `parameter_words`, if the detail of a candidate or
    the name of a parameter says too little.
    """

    def made(listed: Listing) -> Effect:
        by_quantity = {size.quantity: size for size in sizes}
        return Effect(
            listed.__name__,
            family,
            words,
            cleandoc(listed.__doc__ or ""),
            by_quantity,
            listed,
            at,
            **more,
        )

    return made


def waves(angle: np.ndarray, *orders: float) -> list[np.ndarray]:
    """Cosine and sine of so many times an angle (S,), order by order; list of ndarray
    (S,)."""
    return [wave(order * angle) for order in orders for wave in WAVES.values()]


def every_joint(sites: Sites) -> list[tuple[int]]:
    """Joints from 0, one a place."""
    return [(joint,) for joint in range(sites.joints)]


def turning_joints(sites: Sites) -> list[tuple[int]]:
    """The same of those that turn, for effects that have no meaning for prismatic
    ones."""
    return [(joint,) for joint in range(sites.joints) if not sites.prismatic[joint]]


def small_form(whole: Candidate, detail: str, kept: slice) -> Candidate:
    """Variant of a candidate that has some of its parameters."""

    def law(conditions: Conditions, *shapes: float) -> Displacements:
        return whole.displacement(conditions, *shapes)[kept]

    return replace(
        whole, detail=detail, parameters=whole.parameters[kept], displacement=law
    )


def effect_of(key: str) -> str:
    """Name of the effect in the key of a candidate."""
    return key.split("@")[0].split("[")[0]
