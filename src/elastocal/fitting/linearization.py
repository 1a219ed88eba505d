"""Sensitivities of the measurements: the Jacobian of the chain times the displacement of its coordinates per parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects import declared_weight
from elastocal.effects.conditions import Conditions, with_springs, with_total
from elastocal.fitting.displacement import displaced_coordinates, joint_compliances, mass_corrections, with_springs_of
from elastocal.fitting.prediction import differences, measured_in_base, target_points
from elastocal.mechanics.motion import motion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.effects.protocol import Candidate, Displacing
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Relative step of the central difference in a shape parameter.
_SHAPE_STEP = 1e-4
# Of the forward difference in what loads the springs, in plausible sizes: laws of gears bend little over that.
_SPRING_STEP = 1e-4
# Parameters on which the laws of other effects depend: they turn a wrench into angles, or are part of the load.
_SPRINGS = ("joint_compliance", declared_weight.EFFECT)


@dataclass(frozen=True)
class Linearization:
    """A model about an estimate, for M observations.

    Attributes
    ----------
    residual : ndarray (M, rows)
        Measured less predicted, base axes, m and rad.
    coordinate_jacobian : ndarray (M, rows, C)
        Of each target with respect to the coordinates of the sites.
    sensitivities : ndarray (M, rows, P)
        With respect to `parameters`.
    conditions : Conditions
        Where the robot has yielded to, by this estimate.
    """

    residual: np.ndarray
    coordinate_jacobian: np.ndarray
    sensitivities: np.ndarray
    conditions: Conditions


def linearize(model: Model, estimate: Estimate, observations: Observations, conditions: Conditions) -> Linearization:
    """Residuals of a model and their sensitivities.

    Sensitivities are analytic, but for shapes (central differences) and for what springs do by way of other effects (forward
    differences).

    Parameters
    ----------
    model, estimate, observations, conditions
        As in `predict`.

    Returns
    -------
    Linearization
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
    columns = []
    if model.fitted_frames:
        at_base = jacobian[..., list(model.sites.base)]
        for session in estimate.sessions:
            in_session = observations.states.session[observations.state] == session
            columns.append(at_base * in_session[:, None, None])
    for index, target in enumerate(model.targets):
        if target.offset_m is None:
            columns.append(_target_columns(rotation, observations.target == index, rows))
    for effect, values, shapes in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        if effect.effect in _SPRINGS:
            laws = _spring_laws(effect, model, estimate, around)
        else:
            laws = effect.displacement(around, *shapes)
        columns.append(_columns(laws, jacobian, observations.state))
        columns.append(_shape_columns(effect, values, shapes, around, jacobian, observations.state))
    # The observations of each column lie side by side here, too.
    sensitivities = np.empty((sum(part.shape[2] for part in columns), rows, count))
    first = 0
    for part in columns:
        sensitivities[first : first + part.shape[2]] = part.transpose(2, 1, 0)
        first += part.shape[2]
    return Linearization(residual, jacobian, sensitivities.transpose(2, 1, 0), replace(around, motion=moved))


def effect_columns(
    effects: Iterable[tuple[Displacing, Iterable[float]]],
    conditions: Conditions,
    coordinate_jacobian: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """Sensitivities of the measurements to the linear parameters of effects.

    Parameters
    ----------
    effects : sequence of (Displacing, sequence of float)
        With their shape parameters.
    conditions : Conditions
    coordinate_jacobian : ndarray (M, rows, C)
    state : ndarray (M,)
        State of each observation.

    Returns
    -------
    ndarray (M, rows, D)
    """
    laws = [law for effect, shapes in effects for law in effect.displacement(conditions, *shapes)]
    return _columns(laws, coordinate_jacobian, state)


def _columns(laws: Sequence[Mapping[int, np.ndarray]], coordinate_jacobian: np.ndarray, state: np.ndarray) -> np.ndarray:
    # The observations of each column lie side by side.
    columns = np.zeros((len(laws), coordinate_jacobian.shape[1], len(state)))
    jacobian = coordinate_jacobian.transpose(2, 1, 0)
    for column, law in zip(columns, laws, strict=True):
        for coordinate, values in law.items():
            column += jacobian[coordinate] * values[state]
    return columns.transpose(2, 1, 0)


def _target_columns(rotation: np.ndarray, mask: np.ndarray, rows: int) -> np.ndarray:
    """Shift of a target along the axes of its measuring point and, for poses, its turn about them."""
    columns = np.zeros((len(mask), rows, rows))
    for first in range(0, rows, 3):
        columns[mask, first : first + 3, first : first + 3] = rotation[mask]
    return columns


def _shape_columns(
    effect: Candidate, values: np.ndarray, shapes: np.ndarray, conditions: Conditions, jacobian: np.ndarray, state: np.ndarray
) -> np.ndarray:
    columns = np.zeros((*jacobian.shape[:2], len(shapes)))
    for number in range(len(shapes)):
        shape = effect.shapes[number]
        step = _SHAPE_STEP * max(abs(shapes[number]), shape.lowest, 0.1 * shape.highest)
        sides = []
        for sign in (1, -1):
            moved = shapes.copy()
            moved[number] += sign * step
            sides.append(effect_columns([(effect, moved)], conditions, jacobian, state) @ values)
        columns[..., number] = (sides[0] - sides[1]) / (2 * step)
    return columns


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
