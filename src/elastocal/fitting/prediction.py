"""What a model predicts: where the robot yields to under its loads and effects, poses of the targets, residuals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import MASS_PARAMETERS, at_coordinates, conditions_of, with_springs
from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.mechanics.kinematics import pose_differences, poses_of_points

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations, States
    from elastocal.mechanics.chain import MeasuringPoint

# Fixed-point iterations of the load at the displaced pose. Each shrinks what is left by deflection over reach, some 1 / 500 at
# 3 kN, from ten micrometres at the commanded pose.
_PASSES = 2


def conditions(model: Model, estimate: Estimate, states: States, coordinates: np.ndarray | None = None) -> Conditions:
    """What the effects of a model may depend on, in some states.

    By fixed-point iteration: loads at the displaced pose, then the displacement under these loads.

    `estimate`: its joint compliances and masses, where they are parameters, and where it takes the robot to, at which loads are
    taken. `coordinates` (S, C): where the robot has yielded to; found without.
    """
    compliance, corrections = joint_compliances(model, estimate), mass_corrections(model, estimate)
    around = conditions_of(model.sites, compliance, states, model.time_zero_s, corrections, model.row_span, coordinates)
    for _ in range(_PASSES if coordinates is None else 0):
        around = at_coordinates(around, displaced_coordinates(model, estimate, around))
    return around


def joint_compliances(model: Model, estimate: Estimate) -> np.ndarray:
    """Joint compliances of an estimate, ndarray (n,), rad/(N m): the identified ones where they are parameters."""
    return _values_of("joint_compliance", model, estimate, model.nominal_compliance)


def mass_corrections(model: Model, estimate: Estimate) -> np.ndarray:
    """By how much the declared masses of an estimate are off the robot file, ndarray (4 m,): see `Conditions`."""
    return _values_of(DECLARED_WEIGHT, model, estimate, np.zeros(MASS_PARAMETERS * len(model.sites.masses)))


def _values_of(name: str, model: Model, estimate: Estimate, otherwise: np.ndarray) -> np.ndarray:
    for effect, values in zip(model.effects, estimate.coefficients, strict=True):
        if effect.effect == name:
            return values
    return otherwise


def with_springs_of(model: Model, estimate: Estimate, conditions: Conditions) -> Conditions:
    """Conditions with the joint compliances and masses of an estimate, where they are parameters."""
    return with_springs(conditions, joint_compliances(model, estimate), mass_corrections(model, estimate))


def displaced_coordinates(model: Model, estimate: Estimate, conditions: Conditions) -> np.ndarray:
    """Coordinates of the sites in each state, ndarray (S, C): joint angles, springs under load and effects.

    Springs yield to the total load, the external one and the weight that the robot file declares.
    """
    around = with_springs_of(model, estimate, conditions)
    displaced = model.sites.chain.at(around.joint_angles)
    if not model.identifies_compliance:
        displaced[:, : model.sites.joints] += around.total[:, : model.sites.joints] * model.nominal_compliance
    for effect, values, shapes in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        # The errors of masses are part of the total load.
        if effect.effect != DECLARED_WEIGHT:
            displace(displaced, effect, values, shapes, around)
    return displaced


def displace(displaced: np.ndarray, effect: Candidate, values: np.ndarray, shapes: Iterable[float], around: Conditions) -> None:
    """Add what an effect does to the coordinates of the sites, ndarray (S, C), in place.

    `values` (D,): its linear parameters. `shapes` (F,): its shape parameters. `around`: of the S states.
    """
    if effect.fixed:
        for coordinate, (numbers, per_unit) in _fixed(effect, around).items():
            displaced[:, coordinate] += values[numbers] @ per_unit
        return
    for value, law in zip(values, effect.displacement(around, *shapes), strict=True):
        for coordinate, per_unit in law.items():
            displaced[:, coordinate] += value * per_unit


def laws_of(effect: Candidate, shapes: Iterable[float], around: Conditions) -> list[dict[int, np.ndarray]]:
    """Displacements per unit of each linear parameter of an effect, those that no step changes as they were found before."""
    if not effect.fixed:
        return effect.displacement(around, *shapes)
    laws: list[dict[int, np.ndarray]] = [{} for _ in effect.parameters]
    for coordinate, (numbers, per_unit) in _fixed(effect, around).items():
        for number, each in zip(numbers, per_unit, strict=True):
            laws[number][coordinate] = each
    return laws


def _fixed(effect: Candidate, around: Conditions) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """By coordinate: which parameters of an effect displace it, (k,) of int, and by how much per unit, (k, S)."""
    if effect.key not in around.of_angles:
        laws = effect.displacement(around)
        numbers = {c: np.array([n for n, law in enumerate(laws) if c in law]) for law in laws for c in law}
        found = {c: (some, np.array([laws[number][c] for number in some])) for c, some in numbers.items()}
        around.of_angles[effect.key] = found
    return around.of_angles[effect.key]


def predict(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> tuple[np.ndarray, np.ndarray]:
    """Exact poses of the targets, in base axes: positions (M, 3) and rotations (M, 3, 3).

    `conditions`: of the states of the observations.
    """
    coordinates = displaced_coordinates(model, estimate, conditions)
    position, rotation = poses_of_points(model.sites.chain, coordinates, target_points(model, estimate))
    seen = observations.target, observations.state
    return position[seen], rotation[seen] @ estimate.target_rotation[observations.target]


def target_points(model: Model, estimate: Estimate) -> list[MeasuringPoint]:
    """The targets as points of the kinematic chain, where an estimate has them."""
    points = [model.sites.chain.point(target.point) for target in model.targets]
    return [replace(point, offset_m=tuple(at)) for point, at in zip(points, estimate.target_offset, strict=True)]


def residuals(model: Model, estimate: Estimate, observations: Observations, conditions: Conditions) -> np.ndarray:
    """Measured less predicted, ndarray (M, rows): base axes, m and, where poses are measured, rad; arguments of `predict`."""
    return off_measured(estimate, observations, *predict(model, estimate, observations, conditions))


def off_measured(estimate: Estimate, observations: Observations, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Measured less predicted, as `residuals`, of poses (M, 3), (M, 3, 3) as by `predict`."""
    measured, turned = measured_in_base(estimate, observations)
    return measured - position if turned is None else pose_differences(measured, turned, position, rotation)


def measured_in_base(estimate: Estimate, observations: Observations) -> tuple[np.ndarray, np.ndarray | None]:
    """Measured positions (M, 3) and rotations (M, 3, 3), taken from the frames of the sessions into base axes."""
    session = np.searchsorted(estimate.sessions, observations.states.session[observations.state])
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    position = (into_base @ (observations.position - estimate.frame_position[session])[..., None])[..., 0]
    return position, None if observations.rotation is None else into_base @ observations.rotation
