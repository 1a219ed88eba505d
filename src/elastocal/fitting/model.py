"""What the measurements are modelled by, all that this leaves open as one vector of
parameters, and what it predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import Campaign, assemble_campaign, build_measurements
from elastocal.effects.catalogue import candidates_on, declared_candidates
from elastocal.effects.conditions import (
    MASS_PARAMETERS,
    conditions_of,
    offered,
    with_springs,
)
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import DECLARED_WEIGHT, declared_weight
from elastocal.effects.protocol import Candidate, Parameter, moved_and_turned
from elastocal.fitting.observations import (
    Observations,
    average_repeats,
    remove_outlying_repeats,
)
from elastocal.mechanics.kinematics import motion, pose_differences, poses_of_points
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.mechanics.sites import Sites, sites_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from elastocal.campaigns.campaign import Target
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.observations import States
    from elastocal.mechanics.chain import MeasuringPoint

# Frames and targets may be anywhere in a workshop.
_ANYWHERE_M = 1.0
_ANYWHERE_RAD = 1.0
# Fixed-point iterations of the load at the displaced pose. Each shrinks what is left by
# deflection over reach, some 1 / 500 at 3 kN, from ten micrometres at the commanded
# pose.
_PASSES = 2
# Effects on which the laws of others depend: they turn a wrench into angles, or are
# part of the load.
LOAD_EFFECTS = ("joint_compliance", DECLARED_WEIGHT)


@dataclass(frozen=True)
class Model:
    """What is taken to make the measurements: nominal robot, frames, targets and any
    set of effects.

    `targets`: as in the campaign; offsets and rotations that they do not have are
    fitted. `fitted_frames`: whether the placement of the base is unknown, one for each
    session. `rows`: 3 where positions are measured, 6 where poses are.
    `nominal_compliance` (n,): rad/(N m). `effects`: joint compliances, where they are
    identified, and errors of declared masses, where there are any, among them.
    `time_zero_s`: from which effects count the time: the first measurement to be
    fitted. `row_span` (int, int): first and last row of the measurements to be fitted,
    between which the campaign made its progress. `compliance_known`: whether the
    nominal compliances are those of the robot file; else they are usual ones, or 0 of
    joints taken as rigid.
    """

    sites: Sites
    targets: tuple[Target, ...]
    fitted_frames: bool
    rows: int
    nominal_compliance: np.ndarray
    effects: tuple[Candidate, ...] = ()
    time_zero_s: float = 0.0
    row_span: tuple[int, int] | None = None
    compliance_known: bool = True

    @property
    def identifies_compliance(self) -> bool:
        """Whether the joint compliances are parameters."""
        return any(effect.effect == "joint_compliance" for effect in self.effects)

    @property
    def nominal_coefficients(self) -> tuple[np.ndarray, ...]:
        """Where a fit starts: joint compliances at their nominal values, all else at
        zero."""
        nominal = self.nominal_compliance
        effects = self.effects
        return tuple(
            nominal.copy()
            if e.effect == "joint_compliance"
            else np.zeros(len(e.parameters))
            for e in effects
        )

    @property
    def fitted_target_components(self) -> list[tuple[int, slice]]:
        """Targets that are fitted, and which of shift and turn (x, y, z, rx, ry, rz)
        are."""
        ends = [
            (0 if t.offset_m is None else 3, self.rows if t.rotation is None else 3)
            for t in self.targets
        ]
        return [
            (number, slice(first, last))
            for number, (first, last) in enumerate(ends)
            if first < last
        ]

    def available_inputs(self, states: States) -> frozenset[str]:
        """What effects may need that some states and the campaign have: see
        `Candidate.needs`."""
        return offered(self.sites, states) | (
            frozenset() if self.fitted_frames else {"declared base"}
        )

    def with_effects(self, effects: Iterable[Candidate]) -> Model:
        """The same model with more effects."""
        return replace(self, effects=(*self.effects, *effects))


@dataclass(frozen=True)
class Estimate:
    """Values of everything that a model leaves open.

    `frame_rotation`, `frame_position` (K, 3, 3), (K, 3): placement of the base in the
    frame of each session. `target_offset`, `target_rotation` (T, 3), (T, 3, 3): each
    target in the frame of its measuring point, m. `coefficients`: linear parameters of
    each effect. `shapes`: shape parameters of each effect.
    """

    sessions: tuple[int, ...]
    frame_rotation: np.ndarray
    frame_position: np.ndarray
    target_offset: np.ndarray
    target_rotation: np.ndarray
    coefficients: tuple[np.ndarray, ...] = ()
    shapes: tuple[np.ndarray, ...] = ()

    def with_effects(self, effects: Sequence[Candidate]) -> Estimate:
        """The same estimate with more effects, all of them at zero."""
        return replace(
            self,
            coefficients=(
                *self.coefficients,
                *(np.zeros(len(effect.parameters)) for effect in effects),
            ),
            shapes=(
                *self.shapes,
                *(
                    np.array([shape.start for shape in effect.shapes])
                    for effect in effects
                ),
            ),
        )


def build_declared_model(
    campaign: Campaign, effects: Iterable[Candidate] = ()
) -> Model:
    """The model that a campaign declares, with its declared effects."""
    sites = sites_of(campaign.robot)
    measurements = campaign.measurements
    # Under an arm whose first joint turns, a base that yields and the sag of that arm
    # are one thing until weights are known.
    unknown = not sites.masses and not measurements.wrench.any()
    sites = replace(sites, usual_weight=sites.prismatic[0] and unknown)
    springs = (joint_compliance(sites),) if campaign.compliance == "identify" else ()
    weight = (declared_weight(sites),) if sites.masses else ()
    return Model(
        sites,
        campaign.targets,
        campaign.frame == "tracker",
        6 if campaign.measured == "pose" else 3,
        campaign.robot.compliance,
        (*springs, *weight, *effects),
        0.0 if measurements.time_s is None else float(measurements.time_s.min()),
        (int(measurements.row.min()), int(measurements.row.max()))
        if len(measurements)
        else None,
        campaign.robot.compliance_known,
    )


def list_parameters(model: Model, estimate: Estimate) -> list[tuple[str, Parameter]]:
    """Everything that is fitted, in the order of the sensitivities.

    Returns (str, Parameter): what it belongs to ("frame 0", "target A", the key of an
    effect) and the parameter.
    """
    found = []
    placed = moved_and_turned(_ANYWHERE_M, _ANYWHERE_RAD)
    if model.fitted_frames:
        found += [
            (f"frame {session}", parameter)
            for session in estimate.sessions
            for parameter in placed
        ]
    for number, parts in model.fitted_target_components:
        found += [
            (f"target {model.targets[number].name}", parameter)
            for parameter in placed[parts]
        ]
    for effect in model.effects:
        found += [(effect.key, parameter) for parameter in effect.parameters]
        found += [
            (effect.key, Parameter(s.name, s.unit, s.highest - s.lowest))
            for s in effect.shapes
        ]
    return found


def find_placement_parameters(owners: Iterable[str]) -> np.ndarray:
    """Which of some owners of parameters are frames and targets, ndarray of bool."""
    return np.array([owner.startswith(("frame ", "target ")) for owner in owners], bool)


def get_parameter_bounds(model: Model, estimate: Estimate) -> np.ndarray:
    """Lowest and highest value of each of the `parameters`, ndarray (P, 2): the ranges
    of shapes, infinite for all others."""
    ranges = {
        (effect.key, shape.name): (shape.lowest, shape.highest)
        for effect in model.effects
        for shape in effect.shapes
    }
    return np.array(
        [
            ranges.get((o, p.name), (-np.inf, np.inf))
            for o, p in list_parameters(model, estimate)
        ]
    ).reshape(-1, 2)


def find_nonlinear_parameters(model: Model, estimate: Estimate) -> np.ndarray:
    """Which of the `parameters` are shapes, which alone have limits, ndarray of bool
    (P,)."""
    shapes = [
        shape
        for effect in model.effects
        for shape in (False,) * len(effect.parameters) + (True,) * len(effect.shapes)
    ]
    return np.array(
        [False] * (len(list_parameters(model, estimate)) - len(shapes)) + shapes, bool
    )


def get_parameter_values(model: Model, estimate: Estimate) -> np.ndarray:
    """Present values of the `parameters`, ndarray (P,); frames and targets are fitted
    by steps and count as zero."""
    effects = [
        part
        for pair in zip(estimate.coefficients, estimate.shapes, strict=True)
        for part in pair
    ]
    return np.concatenate(
        [
            np.zeros(len(list_parameters(model, estimate)) - sum(map(len, effects))),
            *effects,
        ]
    )


def apply_step(model: Model, estimate: Estimate, step: np.ndarray) -> Estimate:
    """An estimate after a step (P,) of all `parameters`; shapes stay in their
    ranges."""

    def take(count: int) -> np.ndarray:
        nonlocal step
        taken = step[:count]
        step = step[count:]
        return taken

    frame_rotation = estimate.frame_rotation.copy()
    frame_position = estimate.frame_position.copy()
    if model.fitted_frames:
        for number in range(len(estimate.sessions)):
            shift = take(3)
            turn = take(3)
            frame_position[number] += frame_rotation[number] @ shift
            frame_rotation[number] = (
                frame_rotation[number] @ Rotation.from_rotvec(turn).as_matrix()
            )
    target_offset = estimate.target_offset.copy()
    target_rotation = estimate.target_rotation.copy()
    for number, parts in model.fitted_target_components:
        moved = np.zeros(6)
        moved[parts] = take(parts.stop - parts.start)
        target_offset[number] += moved[:3]
        target_rotation[number] = (
            Rotation.from_rotvec(moved[3:]).as_matrix() @ target_rotation[number]
        )
    coefficients = []
    shapes = []
    for effect, values, shape in zip(
        model.effects, estimate.coefficients, estimate.shapes, strict=True
    ):
        coefficients.append(values + take(len(values)))
        ends = np.array(
            [(each.lowest, each.highest) for each in effect.shapes]
        ).reshape(-1, 2)
        shapes.append(np.clip(shape + take(len(shape)), *ends.T))
    placed = frame_rotation, frame_position, target_offset, target_rotation
    return Estimate(estimate.sessions, *placed, tuple(coefficients), tuple(shapes))


def evaluate_conditions(
    model: Model,
    estimate: Estimate,
    states: States,
    coordinates: np.ndarray | None = None,
) -> Conditions:
    """What the effects of a model may depend on, in some states: loads at the displaced
    pose, by fixed-point iteration.

    `coordinates` (S, C): where the robot has yielded to; found without.
    """
    springs = (
        get_joint_compliances(model, estimate),
        get_mass_corrections(model, estimate),
    )
    around = conditions_of(
        model.sites,
        springs[0],
        states,
        model.time_zero_s,
        springs[1],
        model.row_span,
        coordinates,
    )
    for _ in range(_PASSES if coordinates is None else 0):
        displaced = compute_displaced_coordinates(model, estimate, around)
        around = replace(
            around, motion=motion(model.sites.chain, displaced, model.sites.followed)
        )
    return around


def get_joint_compliances(model: Model, estimate: Estimate) -> np.ndarray:
    """Joint compliances of an estimate, ndarray (n,), rad/(N m): the identified ones
    where they are parameters."""
    return _values_of("joint_compliance", model, estimate, model.nominal_compliance)


def get_mass_corrections(model: Model, estimate: Estimate) -> np.ndarray:
    """By how much the declared masses of an estimate are off the robot file, ndarray (4
    m,): see `Conditions`."""
    return _values_of(
        DECLARED_WEIGHT,
        model,
        estimate,
        np.zeros(MASS_PARAMETERS * len(model.sites.masses)),
    )


def update_springs_and_masses(
    model: Model, estimate: Estimate, around: Conditions
) -> Conditions:
    """Conditions with the springs and the masses of an estimate."""
    return with_springs(
        around,
        get_joint_compliances(model, estimate),
        get_mass_corrections(model, estimate),
    )


def _values_of(
    name: str, model: Model, estimate: Estimate, otherwise: np.ndarray
) -> np.ndarray:
    for effect, values in zip(model.effects, estimate.coefficients, strict=True):
        if effect.effect == name:
            return values
    return otherwise


def compute_displaced_coordinates(
    model: Model, estimate: Estimate, conditions: Conditions
) -> np.ndarray:
    """Coordinates of the sites in each state, ndarray (S, C): joint angles, springs
    under load and effects.

    Springs yield to the total load, the external one and the weight that the robot file
    declares.
    """
    around = update_springs_and_masses(model, estimate, conditions)
    # Component first, as kinematics look at them.
    displaced = np.zeros((model.sites.chain.coordinates, len(around.joint_angles))).T
    displaced[:, : model.sites.joints] = (
        around.joint_angles + around.total[:, : model.sites.joints] * around.compliance
    )
    effects = zip(model.effects, estimate.coefficients, estimate.shapes, strict=True)
    for coordinate, by in sum_displacements(
        (each for each in effects if each[0].effect not in LOAD_EFFECTS), around
    ).items():
        displaced[:, coordinate] += by
    return displaced


def sum_displacements(
    effects: Iterable[tuple[Candidate, np.ndarray, Iterable[float]]], around: Conditions
) -> dict[int, np.ndarray]:
    """What effects, with their linear parameters (D,) and their shapes (F,), do
    together to each coordinate, (S,)."""
    displaced: dict[int, np.ndarray] = {}
    for effect, values, shapes in effects:
        for value, law in zip(
            values, evaluate_basis_functions(effect, shapes, around), strict=True
        ):
            for coordinate, per_unit in law.items():
                by = value * per_unit
                displaced[coordinate] = (
                    np.add(displaced[coordinate], by, out=by)
                    if coordinate in displaced
                    else by
                )
    return displaced


def evaluate_basis_functions(
    effect: Candidate, shapes: Iterable[float], around: Conditions
) -> list[dict[int, np.ndarray]]:
    """Displacements per unit of each linear parameter of an effect, those that no step
    changes as they were found before."""
    if not effect.fixed:
        return effect.displacement(around, *shapes)
    if effect.key not in around.of_angles:
        around.of_angles[effect.key] = effect.displacement(around)
    return around.of_angles[effect.key]


def predict(
    model: Model, estimate: Estimate, observations: Observations, around: Conditions
) -> tuple[np.ndarray, np.ndarray]:
    """Exact poses of the targets, in base axes: positions (M, 3) and rotations (M, 3,
    3); `around`: of their states."""
    coordinates = compute_displaced_coordinates(model, estimate, around)
    position, rotation = poses_of_points(
        model.sites.chain, coordinates, locate_targets(model, estimate)
    )
    seen = observations.target, observations.state
    return position[seen], rotation[seen] @ estimate.target_rotation[
        observations.target
    ]


def locate_targets(model: Model, estimate: Estimate) -> list[MeasuringPoint]:
    """The targets as points of the kinematic chain, where an estimate has them."""
    points = [model.sites.chain.point(target.point) for target in model.targets]
    return [
        replace(point, offset_m=tuple(at))
        for point, at in zip(points, estimate.target_offset, strict=True)
    ]


def compute_residuals(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> np.ndarray:
    """Measured less predicted, ndarray (M, rows): base axes, m and, where poses are
    measured, rad; arguments of `predict`."""
    return subtract_prediction(
        estimate, observations, *predict(model, estimate, observations, conditions)
    )


def subtract_prediction(
    estimate: Estimate,
    observations: Observations,
    position: np.ndarray,
    rotation: np.ndarray,
) -> np.ndarray:
    """Measured less predicted, as `residuals`, of poses (M, 3), (M, 3, 3) as by
    `predict`."""
    measured, turned = transform_to_base(estimate, observations)
    return (
        measured - position
        if turned is None
        else pose_differences(measured, turned, position, rotation)
    )


def transform_to_base(
    estimate: Estimate, observations: Observations
) -> tuple[np.ndarray, np.ndarray | None]:
    """Measured positions (M, 3) and rotations (M, 3, 3), taken from the frames of the
    sessions into base axes."""
    session = np.searchsorted(
        estimate.sessions, observations.states.session[observations.state]
    )
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    position = (
        into_base
        @ (observations.position - estimate.frame_position[session])[..., None]
    )[..., 0]
    return (
        position,
        None if observations.rotation is None else into_base @ observations.rotation,
    )


@dataclass(frozen=True)
class Case:
    """A campaign ready to be fitted.

    `campaign`: its measurements are those to fit. `observations`: their repeats
    averaged, without the outlying ones. `model`: as declared. `candidates`: everything
    that the model might lack.
    """

    campaign: Campaign
    observations: Observations
    model: Model
    candidates: dict[str, Candidate]

    def select(self, kept: np.ndarray) -> Case:
        """The same without some of the measurements; ndarray of bool (N,)."""
        some = replace(
            self.campaign, measurements=self.campaign.measurements.select(kept)
        )
        return replace(
            self,
            campaign=some,
            observations=average_repeats(remove_outlying_repeats(some.measurements)),
        )


def build_case(
    descriptions: Mapping[str, Any], columns: Mapping[str, np.ndarray]
) -> Case:
    """Put a campaign together from its description, as step 1 writes it, and the
    columns of its measurements table."""
    source = descriptions["source"]
    robot = robot_from_document(descriptions["robot"], source)
    campaign = assemble_campaign(
        descriptions["campaign"], robot, build_measurements(columns), source
    )
    sites = sites_of(campaign.robot)
    model = build_declared_model(
        campaign, declared_candidates(campaign.declared, sites, source)
    )
    candidates = {
        key: c
        for key, c in candidates_on(sites).items()
        if c.effect not in campaign.declared
    }
    return Case(
        campaign,
        average_repeats(remove_outlying_repeats(campaign.measurements)),
        model,
        candidates,
    )
