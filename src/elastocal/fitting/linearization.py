"""Sensitivities of the measurements: the Jacobian of the chain times the displacement of its coordinates per parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import Conditions, with_springs, with_total
from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.fitting.displacement import (
    displaced_coordinates,
    joint_compliances,
    laws_of,
    mass_corrections,
    with_springs_of,
)
from elastocal.fitting.factored import Displacements, Factored
from elastocal.fitting.prediction import differences, measured_in_base, target_points
from elastocal.mechanics.kinematics import motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from elastocal.effects.protocol import Candidate, Displacing
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Relative step of the central difference in a shape parameter.
_SHAPE_STEP = 1e-4
# Of the forward difference in what loads the springs, in plausible sizes: laws of gears bend little over that.
_SPRING_STEP = 1e-4
# Parameters on which the laws of other effects depend: they turn a wrench into angles, or are part of the load.
_SPRINGS = ("joint_compliance", DECLARED_WEIGHT)


@dataclass(frozen=True)
class Linearization:
    """A model about an estimate, for M observations.

    `residual` (M, rows): measured less predicted, base axes, m and rad. `coordinate_jacobian` (M, rows, C): of each target with
    respect to the coordinates of the sites. `displacements`: what each of the P `parameters` does to the coordinates; nothing
    by those of targets. `target_columns` (M, rows, Q): sensitivities to the parameters of targets. `of_targets` (Q,) of int:
    which parameters these are. `state` (M,) of int: state of each observation. `conditions`: where the robot has yielded to, by
    this estimate.
    """

    residual: np.ndarray
    coordinate_jacobian: np.ndarray
    displacements: Displacements
    target_columns: np.ndarray
    of_targets: np.ndarray
    state: np.ndarray
    conditions: Conditions

    @cached_property
    def sensitivities(self) -> np.ndarray:
        """With respect to `parameters`, ndarray (M, rows, P)."""
        return self.sensitivities_to(np.ones(self.displacements.columns, bool))

    def sensitivities_to(self, kept: np.ndarray) -> np.ndarray:
        """With respect to some of the parameters, ndarray of bool (P,)."""
        found = Factored(self.displacements.of_columns(kept), self.coordinate_jacobian, self.state).dense()
        mine = kept[self.of_targets]
        found[..., (np.cumsum(kept) - 1)[self.of_targets[mine]]] = self.target_columns[..., mine]
        return found

    def moved_by(self, values: np.ndarray) -> np.ndarray:
        """By how much predictions move where parameters grow by some values (P,), those of targets left out; (M, rows)."""
        displacements = self.displacements
        moved = np.zeros((self.coordinate_jacobian.shape[2], displacements.values.shape[1]))
        np.add.at(moved, displacements.coordinate, values[displacements.column, None] * displacements.values)
        return (self.coordinate_jacobian @ moved.T[self.state, :, None])[..., 0]


def linearize(model: Model, estimate: Estimate, observations: Observations, conditions: Conditions) -> Linearization:
    """Residuals of a model and their sensitivities.

    Sensitivities are analytic, but for shapes (central differences) and for what springs do by way of other effects (forward
    differences).

    `model`, `estimate`, `observations`, `conditions`: as in `predict`.
    """
    around = with_springs_of(model, estimate, conditions)
    coordinates = displaced_coordinates(model, estimate, around)
    count, rows, chain, points = len(observations), model.rows, model.sites.chain, target_points(model, estimate)
    moved = motion(chain, coordinates, (*model.sites.followed, *points))
    position, rotation = np.empty((count, 3)), np.empty((count, 3, 3))
    # Component first, so that every effect's arithmetic runs along the observations.
    jacobian = np.empty((rows, chain.coordinates, count))
    for index, point in enumerate(points):
        seen = np.flatnonzero(observations.target == index)
        state, number = observations.state[seen], len(model.sites.followed) + index
        at = moved.position[number][:, state]
        position[seen], rotation[seen] = at.T, np.moveaxis(moved.rotation[number][..., state], -1, 0)
        jacobian[..., seen] = moved.jacobian(point.after, at, rows, state)
    residual = differences(
        measured_in_base(estimate, observations), position, rotation @ estimate.target_rotation[observations.target]
    )
    jacobian = np.moveaxis(jacobian, -1, 0)
    laws: list[Mapping[int, np.ndarray]] = []
    if model.fitted_frames:
        for session in estimate.sessions:
            in_session = (observations.states.session == session).astype(float)
            laws += [{coordinate: in_session} for coordinate in model.sites.base]
    columns = [_target_columns(rotation, rows, observations.target == index)[..., parts] for index, parts in model.fitted_parts]
    target_columns = np.concatenate([np.zeros((count, rows, 0)), *columns], axis=2)
    of_targets = len(laws) + np.arange(target_columns.shape[2])
    laws += [{} for _ in of_targets]
    for effect, values, shapes in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        laws += _spring_laws(effect, model, estimate, around) if effect.effect in _SPRINGS else laws_of(effect, shapes, around)
        laws += _shape_laws(effect, values, shapes, around)
    displacements = Displacements.of(laws, np.ones(len(laws)), len(observations.states))
    return Linearization(
        residual, jacobian, displacements, target_columns, of_targets, observations.state, replace(around, motion=moved)
    )


def effect_columns(
    effects: Iterable[tuple[Displacing, Iterable[float]]],
    conditions: Conditions,
    coordinate_jacobian: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """Sensitivities of the measurements to the linear parameters of effects.

    `effects` (Displacing, sequence of float): with their shape parameters. `coordinate_jacobian` (M, rows, C). `state` (M,):
    state of each observation. Returns (M, rows, D).
    """
    laws = [law for effect, shapes in effects for law in effect.displacement(conditions, *shapes)]
    displacements = Displacements.of(laws, np.ones(len(laws)), len(conditions.joint_angles))
    return Factored(displacements, coordinate_jacobian, state).dense()


def _target_columns(rotation: np.ndarray, rows: int, seen: np.ndarray) -> np.ndarray:
    """Shift of a target along the axes of its measuring point and, for poses, its turn about them, where it is seen."""
    columns = np.zeros((len(rotation), rows, rows))
    for first in range(0, rows, 3):
        columns[seen, first : first + 3, first : first + 3] = rotation[seen]
    return columns


def _shape_laws(
    effect: Candidate, values: np.ndarray, shapes: np.ndarray, conditions: Conditions
) -> Iterator[dict[int, np.ndarray]]:
    for number, shape in enumerate(effect.shapes):
        if shape.tried > 1:
            # A law that changes in jumps has no slope: a search finds its place, and a fit that took the jump of a row within a
            # step for one would go to and fro.
            yield {}
            continue
        step = _SHAPE_STEP * max(abs(shapes[number]), shape.lowest, 0.1 * shape.highest)
        sides = []
        for sign in (1, -1):
            moved = shapes.copy()
            moved[number] += sign * step
            sides.append(_displaced_by([(effect, values, moved)], conditions))
        above, below = sides
        yield {c: (above.get(c, 0.0) - below.get(c, 0.0)) / (2 * step) for c in {*above, *below}}


def _spring_laws(spring: Candidate, model: Model, estimate: Estimate, around: Conditions) -> list[dict[int, np.ndarray]]:
    """Displacements per unit of compliances or of errors of masses, with all that they do by way of other effects."""
    laws = spring.displacement(around)
    through = _through_compliance if spring.effect == "joint_compliance" else _through_load
    others = [found for found in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True) if through(found[0])]
    if not others:
        return laws
    present = _displaced_by(others, around)
    coordinates = sorted(present)
    steps = np.array([_SPRING_STEP * parameter.plausible for parameter in spring.parameters])
    if spring.effect == "joint_compliance":
        values, corrections = joint_compliances(model, estimate), mass_corrections(model, estimate)
        sprung: Iterator[Conditions] = (with_springs(around, values + row, corrections) for row in np.diag(steps))
    else:
        sprung = _with_each_correction(around, coordinates, steps)
    for law, step, changed in zip(laws, steps, sprung, strict=True):
        moved = _displaced_by(others, changed)
        for coordinate in coordinates:
            change = (moved[coordinate] - present[coordinate]) / step
            if change.any():
                law[coordinate] = law.get(coordinate, 0.0) + change
    return laws


def _with_each_correction(around: Conditions, coordinates: list[int], steps: np.ndarray) -> Iterator[Conditions]:
    """Conditions with one error of a mass after the other changed by a step, as loads on some coordinates have it."""
    total = around.total.T.copy()
    present = total[coordinates]
    for step, per_unit in zip(steps, around.gravity_of_corrections(coordinates), strict=True):
        total[coordinates] = present + step * per_unit
        yield with_total(around, total.T)


def _displaced_by(effects: Iterable[tuple[Candidate, np.ndarray, np.ndarray]], around: Conditions) -> dict[int, np.ndarray]:
    """What some effects do together to each coordinate that they displace."""
    displaced: dict[int, np.ndarray] = {}
    for effect, values, shapes in effects:
        for value, law in zip(values, effect.displacement(around, *shapes), strict=True):
            for coordinate, per_unit in law.items():
                displaced[coordinate] = displaced.get(coordinate, 0.0) + value * per_unit
    return displaced


def _through_compliance(effect: Candidate) -> bool:
    """Whether an effect is a load that the joint compliances turn into angles."""
    return effect.family in ("gravity", "load")


def _through_load(effect: Candidate) -> bool:
    """Whether an effect goes with the total load."""
    return "load" in effect.needs and effect.effect not in _SPRINGS
