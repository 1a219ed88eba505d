"""What every effect of the catalogue is: candidates, each with named parameters and the displacements that they make.

An effect is a module of this package with

- ``NAME``, by which keys and tables call it, and ``FAMILY``, the kind of its physics, such as elastic or gearbox;
- ``WORDS``, its physical name in words that precede "of joint 2", or stand alone where it has no joint;
  ``DETAIL_WORDS`` and ``PARAMETER_WORDS``, if the detail of a candidate or the name of a parameter alone says too little;
  ``PART = "link"``, if its joints stand for the links behind them;
- ``MOVES_ROBOT``, whether it moves the robot, so that its tasks feel it, or only what was measured of it: instruments, targets,
  the set-up;
- ``candidates(sites)``, which lists where on this robot the effect can act.

Nothing else knows the effects by name: a new module is a new effect.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from typing import Concatenate

    from elastocal.effects.conditions import Conditions
    from elastocal.mechanics.sites import Sites

    # For each parameter, by coordinate of the sites, the displacement per unit of the parameter, ndarray (S,).
    Displacements = list[dict[int, np.ndarray]]
    # From the conditions and a value of each of the shapes.
    Law = Callable[Concatenate[Conditions, ...], Displacements]


# Needs of laws that go with the load on the joints.
LOADED_JOINTS = frozenset({"load", "load on the joints"})


def load_behind(sites: Sites, joints: int) -> frozenset[str]:
    """Needs of the law of what yields to the load, behind so many joints.

    A weight that is only usual, not declared, loads columns and rails: behind a joint that turns, what yields to it and how
    much weighs on the joint are one thing, for which `link_weight` has the masses free.
    """
    return frozenset({"load"}) if all(sites.prismatic[:joints]) else LOADED_JOINTS


class Displacing(Protocol):
    """Whatever displaces coordinates of the sites: a candidate, or a law that is none."""

    @property
    def displacement(self) -> Law:
        """By the conditions and a value of each of the shapes."""


@dataclass(frozen=True)
class Parameter:
    """One unknown of an effect.

    `plausible`: magnitude that such an effect can reach on a real robot; one that the data cannot distinguish from zero even at
    this size is not estimated. `prior_std`: standard deviation of a normal prior about zero, for series whose terms the data
    distinguish only in part, as in ridge regression [1]. None, as nearly everywhere, for no prior. Reported with the estimate.
    `sign`: that such an effect has by its physics; 0 where it may have either. `order`: of a harmonic, whose plausible size
    falls with it; 1 elsewhere. `sized`: whether the prior's standard deviation was estimated from the measurements, not known
    beforehand. `most`: times its plausible size that a search allows for.

    [1] A. E. Hoerl and R. W. Kennard, Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12, 1970.
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

    `start`: where the search starts. `lowest`, `highest`: range in which the law keeps its meaning. `tried`: how many evenly
    spaced values a search must try lest it step over the law, one for the start alone; 0 where a few values of growing size
    will do.
    """

    name: str
    unit: str
    start: float
    lowest: float
    highest: float
    tried: int = 0

    def values(self, few: int) -> np.ndarray:
        """Values for a search to start from, ndarray: those that must be tried, or a few in geometric series in the range."""
        if self.tried == 1:
            return np.array([self.start])
        if self.tried:
            return np.linspace(self.lowest, self.highest, self.tried)
        return np.geomspace(self.lowest, self.highest, few + 2)[1:-1]

    def between(self, below: float, above: float, count: int) -> np.ndarray:
        """Values inside of an interval, evenly spaced as those that a search tries, ndarray (count,)."""
        return (np.linspace if self.tried else np.geomspace)(below, above, count + 2)[1:-1]

    def shares(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """How much of the range each of some values stands for: the part nearest to it (Voronoi cell), ndarray of sum one."""
        scale = (lambda value: value) if self.tried else np.log
        places = scale(np.asarray(values, float))
        order = np.argsort(places)
        inner = 0.5 * (places[order][1:] + places[order][:-1])
        edges = np.concatenate(
            [[scale(self.lowest)], np.clip(inner, scale(self.lowest), scale(self.highest)), [scale(self.highest)]]
        )
        found = np.empty(len(places))
        found[order] = np.diff(edges) / (edges[-1] - edges[0])
        return found


@dataclass(frozen=True)
class Candidate:
    """One way in which one effect can act on this robot.

    `joints`: joints concerned, counted from 1; empty where the effect belongs to no joint. `detail`: which variant, where
    an effect has more than one for these joints. `parameters`: in which the displacement is linear. `displacement`:
    ``displacement(conditions, *shapes)`` gives for each parameter a dict from a coordinate of the sites to its displacement
    per unit of the parameter, ndarray (S,). It may go with the total loads of the coordinates that it displaces, of no
    others. `needs`: what must be there, see `Model.offered`: "load", "load on the joints", "external load", "approach",
    "time", "temperature", "declared base". `distinct_angles`: how many different angles of its joints the law needs to be
    distinguishable from a smooth one. `of_setup`: whether it belongs to where tracker and robot stood in one campaign, and
    is not carried over to another. `location_name`: names the location beside the joints where these do not: a column, a
    band of orders. Candidates of one effect at one location are variants of its law, of which only one can hold. `turning`:
    joints with whose angles the law goes, counted from 1, where it belongs to no joint. `fixed`: whether the displacement per
    unit goes with the joint angles alone, not with loads, springs or where the robot yielded to, so that no step changes it.
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
        """Where the effect acts: its joints, with the name of the location where they do not determine it."""
        return (*self.joints, self.location_name) if self.location_name else self.joints

    @cached_property
    def key(self) -> str:
        """Unique name, such as ``link_weight@2`` or ``transmission_harmonic@1[orders 3-12]``."""
        where = "@" + "+".join(map(str, self.joints)) if self.joints else ""
        return f"{self.effect}{where}" + (f"[{self.detail}]" if self.detail else "")


def moved_and_turned(shift: float, turn: float, per: str = "") -> tuple[Parameter, ...]:
    """Parameters of a shift along and a turn about each axis, of plausible sizes in m and rad; `per` follows their units."""
    sizes = (("d", "m", shift), ("r", "rad", turn))
    return tuple(Parameter(f"{letter}{axis}", unit + per, size) for letter, unit, size in sizes for axis in "xyz")


def at_shapes(key: str, shapes: Iterable[float]) -> str:
    """Unique name of a candidate at values of its shapes: with all the digits of each."""
    return key + "".join(f" {float(shape)!r}" for shape in shapes)


def require_unique(names: Sequence[str]) -> None:
    """Refuse two candidates of one name, a ValueError: in tables nothing would distinguish them."""
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"candidates of one name: {', '.join(twice)}")


class Effect(Protocol):
    """A module of this package that is an effect, with what each of them has."""

    NAME: str
    FAMILY: str
    WORDS: str
    MOVES_ROBOT: bool

    def candidates(self, sites: Sites) -> list[Candidate]:
        """Where on this robot the effect can act."""
        ...


def needed(values: np.ndarray | None) -> np.ndarray:
    """What states need not have, for a law whose candidate names it among its needs.

    `values` (S,), (S, n). Returns (S,), (S, n): the same.
    """
    if values is None:
        raise TypeError("states without what the law of a candidate needs")
    return values


def effect_of(key: str) -> str:
    """Name of the effect in the key of a candidate."""
    return key.split("@")[0].split("[")[0]


def per_joint(sites: Sites, make: Callable[[int], Candidate], prismatic: bool = False) -> list[Candidate]:
    """Candidates of an effect that acts on one joint at a time: ``make(joint index from 0)`` for each.

    `prismatic`: whether the effect has a meaning for prismatic joints; most of them are about what turns.
    """
    return [make(joint) for joint in range(sites.joints) if prismatic or not sites.prismatic[joint]]
