"""The model of the measurements, its parameters as one vector, and its predictions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import Campaign
from elastocal.effects.conditions import (
    MASS_PARAMETERS,
    Timeline,
    build_conditions,
    find_offered_needs,
    replace_motion,
    replace_springs,
)
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.geometry import declared_base
from elastocal.effects.gravity import (
    DECLARED_WEIGHT,
    declared_application_point,
    declared_weight,
)
from elastocal.effects.protocol import Candidate, Parameter, moved_and_turned
from elastocal.fitting.features import (
    FittedFeature,
    SessionPoses,
    evaluate_channels,
    find_middle,
    get_feature_deviations,
    list_feature_parameters,
    list_fitted_features,
    move_features,
)
from elastocal.fitting.observations import (
    Observations,
    average_repeats,
    remove_outlying_repeats,
)
from elastocal.mechanics.kinematics import (
    compute_motion,
    compute_point_poses,
    compute_pose_differences,
)
from elastocal.mechanics.sites import PushedSession, Sites, build_sites

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from elastocal.campaigns.campaign import Target
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.observations import States
    from elastocal.fitting.sensor_noise import ShapedNoise
    from elastocal.measuring.channels import MeasuringPlan
    from elastocal.measuring.protocol import Prediction
    from elastocal.mechanics.chain import MeasuringPoint

# Plausible sizes of frames and targets, which may be anywhere in a workshop.
_PLACEMENT_M = 1.0
_PLACEMENT_RAD = 1.0
# Distance between the points by which a tracker is registered to a base: an error of
# them turns the base by itself over this length.
_REGISTRATION_SPAN_M = 1.0
# Fixed-point iterations of the load at the displaced pose. Each reduces the error by
# the ratio of deflection to reach, some 1 / 500 at 3 kN; the first error, that of the
# commanded pose, is ten micrometres.
LOAD_ITERATIONS = 2
# Effects that determine how other effects act: compliances turn a wrench into angles,
# masses are part of the load.
LOAD_EFFECTS = ("joint_compliance", DECLARED_WEIGHT)


@dataclass(frozen=True)
class Model:
    """Model of the measurements: nominal robot, frames, targets and any set of effects.

    Attributes
    ----------
    sites : Sites
    targets : tuple of Target
        As in the campaign; offsets and rotations that they do not have are fitted, and
        so are declared offsets that are not exact, with their priors.
    fitted_frames : bool
        Whether the placement of the base is unknown, one for each session.
    rows : int
        Numbers in a measurement: 3 if positions are measured, 6 if poses are; 1 if
        each number is a measurement of its own.
    nominal_compliance : (n,) array, rad/(N m)
    effects : tuple of Candidate
        Including joint compliances, if they are identified, and errors of declared
        masses, if there are any.
    time_zero_s : float
        From which effects count the time: the first measurement to be fitted.
    row_span : (int, int) or None
        First and last row of the measurements to be fitted, between which the campaign
        made its progress.
    compliance_known : bool
        Whether the nominal compliances are those of the robot file; otherwise they are
        usual ones, or 0 for joints that are taken as rigid.
    base_std_m : float
        Standard deviation of each coordinate of a declared base in each session, which
        is fitted with this prior; 0 if the base is exact or unknown.
    measuring : MeasuringPlan or None
        Kinds, features and channels of the campaign; None if every measurement is the
        position or pose of a target.
    shaped_noise : ShapedNoise or None
        Noise of a kind that differs between measurements and directions.
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
    base_std_m: float = 0.0
    measuring: MeasuringPlan | None = None
    shaped_noise: ShapedNoise | None = None

    @cached_property
    def fitted_features(self) -> list[FittedFeature]:
        """Features with fitted unknowns."""
        return list_fitted_features(self.measuring)

    @property
    def has_orientations(self) -> bool:
        """Whether orientations are measured."""
        if self.measuring is None:
            return self.rows == 6
        return self.measuring.has_orientations

    @property
    def has_frame_parameters(self) -> bool:
        """Whether the placements of the base are parameters, with or without priors."""
        return self.fitted_frames or self.base_std_m > 0.0

    @property
    def has_contact_vectors(self) -> bool:
        """Whether residuals are vectors of a measuring plan, such as from a ball to its
        socket, rather than vectors of a tracker or single numbers."""
        return self.measuring is not None and self.rows > 1

    @property
    def identifies_compliance(self) -> bool:
        """Whether the joint compliances are parameters."""
        return any(effect.effect == "joint_compliance" for effect in self.effects)

    @property
    def nominal_coefficients(self) -> tuple[np.ndarray, ...]:
        """Linear parameters at which a fit starts: nominal compliances, zero for all
        other effects."""
        return tuple(
            self.nominal_compliance.copy()
            if effect.effect == "joint_compliance"
            else np.zeros(len(effect.parameters))
            for effect in self.effects
        )

    @property
    def fitted_target_components(self) -> list[tuple[int, slice]]:
        """Indices of the targets that are fitted, each with its slice of the fitted
        components x, y, z, rx, ry, rz."""
        components = []
        for index, target in enumerate(self.targets):
            is_exact = target.offset_m is not None and not target.has_inexact_offset
            first = 3 if is_exact else 0
            last = 6 if self.has_orientations and target.rotation is None else 3
            if first < last:
                components.append((index, slice(first, last)))
        return components

    @property
    def has_unknown_targets(self) -> bool:
        """Whether any target has no declared offset, or no declared rotation although
        rotations are measured."""
        return any(
            target.offset_m is None
            or (self.has_orientations and target.rotation is None)
            for target in self.targets
        )

    def available_inputs(self, states: States) -> frozenset[str]:
        """Inputs of effects that states and campaign provide: see `Candidate.needs`."""
        inputs = find_offered_needs(self.sites, states)
        return inputs if self.fitted_frames else inputs | {"declared base"}

    def with_effects(self, effects: Iterable[Candidate]) -> Model:
        """Add effects."""
        return replace(self, effects=(*self.effects, *effects))


@dataclass(frozen=True)
class Estimate:
    """Values of all parameters of a model.

    Attributes
    ----------
    sessions : tuple of int, K of them
    frame_rotation, frame_position : (K, 3, 3) and (K, 3) arrays
        Placement of the base in the frame of each session.
    target_offset, target_rotation : (T, 3) and (T, 3, 3) arrays
        Each target in the frame of its measuring point, m.
    coefficients : tuple of arrays, linear parameters of each effect
    shapes : tuple of arrays, shape parameters of each effect
    features : tuple of arrays, values of each feature of the measuring plan
    """

    sessions: tuple[int, ...]
    frame_rotation: np.ndarray
    frame_position: np.ndarray
    target_offset: np.ndarray
    target_rotation: np.ndarray
    coefficients: tuple[np.ndarray, ...] = ()
    shapes: tuple[np.ndarray, ...] = ()
    features: tuple[np.ndarray, ...] = ()

    def with_effects(self, effects: Sequence[Candidate]) -> Estimate:
        """Add effects, all of them at zero."""
        coefficients = [np.zeros(len(effect.parameters)) for effect in effects]
        shapes = [_start_of_shapes(effect) for effect in effects]
        return replace(
            self,
            coefficients=(*self.coefficients, *coefficients),
            shapes=(*self.shapes, *shapes),
        )

    def index_sessions(self, observations: Observations) -> np.ndarray:
        """Find the index, 0 .. K-1, of the session of each observation, (M,) array."""
        return np.searchsorted(
            self.sessions, observations.states.session[observations.state]
        )


def _start_of_shapes(effect: Candidate) -> np.ndarray:
    return np.array([shape.start for shape in effect.shapes])


def build_declared_model(
    campaign: Campaign, effects: Iterable[Candidate] = ()
) -> Model:
    """Build the model that a campaign declares, with its declared effects."""
    sites = build_sites(campaign.robot)
    measurements = campaign.measurements
    # Without known weights, a compliant base under an arm that slides on its first
    # joint is indistinguishable from the sag of that arm.
    unknown_load = not sites.masses and not measurements.wrench.any()
    row_span = None
    if len(measurements):
        row_span = (int(measurements.row.min()), int(measurements.row.max()))
    sites = replace(
        sites,
        bears_typical_weight=sites.prismatic[0] and unknown_load,
        pushed_sessions=find_pushed_sessions(campaign, row_span),
    )
    own_effects = []
    if campaign.compliance == "identify":
        own_effects.append(joint_compliance(sites))
    if sites.masses:
        own_effects.append(declared_weight(sites))
    yields = campaign.compliance == "identify" or campaign.robot.compliance.any()
    if campaign.application_point_std_m and yields and measurements.wrench.any():
        own_effects.append(
            declared_application_point(sites, campaign.application_point_std_m)
        )
    if campaign.base_std_m:
        own_effects.append(declared_base(sites))
    time_s = measurements.time_s
    return Model(
        sites,
        campaign.targets,
        campaign.frame == "tracker",
        campaign.measuring.rows,
        campaign.robot.compliance,
        (*own_effects, *effects),
        0.0 if time_s is None else float(time_s.min()),
        row_span,
        campaign.robot.compliance_known,
        campaign.base_std_m,
        campaign.measuring if campaign.measuring.channels else None,
    )


def find_pushed_sessions(
    campaign: Campaign, row_span: tuple[int, int] | None
) -> tuple[PushedSession, ...]:
    """Find the sessions in which the target sits in a place, if all sessions are
    so."""
    if row_span is None or not all(
        kind.holds_target for kind in campaign.measuring.kinds
    ):
        return ()
    first, last = row_span
    length = max(last - first, 1)
    measurements = campaign.measurements
    pushed = []
    for session in np.unique(measurements.session).tolist():
        rows = measurements.row[measurements.session == session]
        start, end = (rows.min() - first) / length, (rows.max() - first) / length
        pushed.append(PushedSession(session, float(start), float(end)))
    return tuple(pushed)


def build_nominal_model(model: Model) -> Model:
    """Build the model of the robot that the user has *before* any calibration.

    It has the geometry of the robot file, and its springs only if the file states them:
    joints of unknown compliance are rigid, because typical compliances are a scale for
    identification and would bend under declared masses. Only unknown frames and targets
    are fitted; declared ones stay as declared. Every error that is called "before" is
    the error of this model.
    """
    compliance = model.nominal_compliance
    if not model.compliance_known:
        compliance = np.zeros_like(compliance)
    targets = tuple(replace(target, offset_std_m=0.0) for target in model.targets)
    return replace(
        model,
        targets=targets,
        effects=(),
        nominal_compliance=compliance,
        base_std_m=0.0,
    )


def list_parameters(model: Model, estimate: Estimate) -> list[tuple[str, Parameter]]:
    """List all fitted parameters in the order of the sensitivities.

    Returns
    -------
    list of (owner, parameter)
        The owner is "frame 0", "target A" or the key of an effect.
    """
    parameters = []
    components = moved_and_turned(_PLACEMENT_M, _PLACEMENT_RAD)
    if model.has_frame_parameters:
        frame_components = _describe_frame(model)
        for session in estimate.sessions:
            owner = f"frame {session}"
            parameters += [(owner, component) for component in frame_components]
    for index, fitted in model.fitted_target_components:
        target = model.targets[index]
        owner = f"target {target.name}"
        for component in components[fitted]:
            if component.unit == "m" and target.has_inexact_offset:
                component = replace(
                    component,
                    plausible=target.offset_std_m,
                    prior_std=target.offset_std_m,
                )
            parameters.append((owner, component))
    parameters += list_feature_parameters(model.fitted_features)
    for effect in model.effects:
        parameters += [(effect.key, parameter) for parameter in effect.parameters]
        for shape in effect.shapes:
            width = shape.highest - shape.lowest
            parameters.append((effect.key, Parameter(shape.name, shape.unit, width)))
    return parameters


def _describe_frame(model: Model) -> tuple[Parameter, ...]:
    """Describe the components of a frame; those of a declared base have priors."""
    if model.fitted_frames:
        return moved_and_turned(_PLACEMENT_M, _PLACEMENT_RAD)
    std_m = model.base_std_m
    return tuple(
        replace(component, prior_std=component.plausible)
        for component in moved_and_turned(std_m, std_m / _REGISTRATION_SPAN_M)
    )


def find_placement_parameters(owners: Iterable[str]) -> np.ndarray:
    """Find the owners that are frames, targets and features, bool array."""
    prefixes = ("frame ", "target ", "feature ")
    return np.array([owner.startswith(prefixes) for owner in owners], bool)


def get_parameter_bounds(model: Model, estimate: Estimate) -> np.ndarray:
    """Lowest and highest value of each parameter, (P, 2) array.

    Shapes have ranges, other parameters the signs of physics.
    """
    ranges = {
        (effect.key, shape.name): (shape.lowest, shape.highest)
        for effect in model.effects
        for shape in effect.shapes
    }
    bounds = [
        ranges.get((owner, parameter.name), parameter.bounds)
        for owner, parameter in list_parameters(model, estimate)
    ]
    return np.array(bounds).reshape(-1, 2)


def find_nonlinear_parameters(model: Model, estimate: Estimate) -> np.ndarray:
    """Find the parameters that are shapes, (P,) bool array."""
    of_effects: list[bool] = []
    for effect in model.effects:
        of_effects += [False] * len(effect.parameters) + [True] * len(effect.shapes)
    placement = len(list_parameters(model, estimate)) - len(of_effects)
    return np.array([False] * placement + of_effects, bool)


def get_parameter_values(model: Model, estimate: Estimate) -> np.ndarray:
    """Present values of the parameters, (P,) array.

    Frames and unknown targets are fitted by steps and count as zero. Declared bases and
    offsets that are not exact count from their declared values, as their priors do.
    """
    values = []
    if model.fitted_frames:
        values.append(np.zeros(6 * len(estimate.sessions)))
    elif model.base_std_m:
        turn = Rotation.from_matrix(estimate.frame_rotation).as_rotvec()
        values.append(np.hstack([estimate.frame_position, turn]).ravel())
    for index, fitted in model.fitted_target_components:
        target = model.targets[index]
        deviation = np.zeros(6)
        if target.has_inexact_offset:
            deviation[:3] = estimate.target_offset[index] - target.offset_m
        values.append(deviation[fitted])
    values += get_feature_deviations(model.fitted_features, estimate.features)
    for coefficients, shapes in zip(
        estimate.coefficients, estimate.shapes, strict=True
    ):
        values += [coefficients, shapes]
    return np.concatenate([np.zeros(0), *values])


def apply_step(model: Model, estimate: Estimate, step: np.ndarray) -> Estimate:
    """Apply a step (P,) of all parameters; shapes stay in their ranges."""
    components = iter(np.split(step, np.cumsum(_group_sizes(model, estimate))))
    placement = _move_placement(model, estimate, components)
    coefficients = []
    shapes = []
    for effect, values, shape_values in zip(
        model.effects, estimate.coefficients, estimate.shapes, strict=True
    ):
        coefficients.append(values + next(components))
        lowest = [shape.lowest for shape in effect.shapes]
        highest = [shape.highest for shape in effect.shapes]
        shapes.append(np.clip(shape_values + next(components), lowest, highest))
    return replace(placement, coefficients=tuple(coefficients), shapes=tuple(shapes))


def _move_placement(
    model: Model, estimate: Estimate, components: Iterator[np.ndarray]
) -> Estimate:
    """Move the frames and targets of an estimate by the next components of a step.

    A step states the turn of a base about its origin. Sockets close to each other hardly
    determine that turn, and far from them it bends the path of a fit. So the base turns
    about their middle, which differs by a shift to first order.
    """
    frame_rotation = estimate.frame_rotation.copy()
    frame_position = estimate.frame_position.copy()
    if model.has_frame_parameters:
        middle = find_middle(model.measuring, estimate.features)
        for number in range(len(estimate.sessions)):
            shift, turn = np.split(next(components), 2)
            rotation = estimate.frame_rotation[number]
            turned = Rotation.from_rotvec(turn).as_matrix()
            if middle is not None:
                in_base = rotation.T @ (middle - estimate.frame_position[number])
                shift = shift + np.cross(turn, in_base) + in_base - turned @ in_base
            frame_position[number] += rotation @ shift
            frame_rotation[number] = rotation @ turned
    target_offset = estimate.target_offset.copy()
    target_rotation = estimate.target_rotation.copy()
    for index, fitted in model.fitted_target_components:
        motion_of_target = np.zeros(6)
        motion_of_target[fitted] = next(components)
        target_offset[index] += motion_of_target[:3]
        rotation = Rotation.from_rotvec(motion_of_target[3:]).as_matrix()
        target_rotation[index] = rotation @ target_rotation[index]
    return replace(
        estimate,
        frame_rotation=frame_rotation,
        frame_position=frame_position,
        target_offset=target_offset,
        target_rotation=target_rotation,
        features=move_features(model.fitted_features, estimate.features, components),
    )


def _group_sizes(model: Model, estimate: Estimate) -> list[int]:
    """Numbers of parameters of each frame and target, and of the coefficients and the
    shapes of each effect."""
    sizes = [6] * len(estimate.sessions) if model.has_frame_parameters else []
    for _, fitted in model.fitted_target_components:
        sizes.append(fitted.stop - fitted.start)
    sizes += [len(entry.numbers) for entry in model.fitted_features]
    for effect in model.effects:
        sizes += [len(effect.parameters), len(effect.shapes)]
    return sizes


def evaluate_conditions(
    model: Model,
    estimate: Estimate,
    states: States,
    coordinates: np.ndarray | None = None,
) -> Conditions:
    """Evaluate the conditions of states on which the effects of a model depend.

    Loads act at the displaced pose, which is found by fixed-point iteration unless
    displaced `coordinates` (S, C) are given.
    """
    conditions = build_conditions(
        model.sites,
        get_joint_compliances(model, estimate),
        states,
        mass_corrections=get_mass_corrections(model, estimate),
        timeline=Timeline(model.time_zero_s, model.row_span),
        coordinates=coordinates,
    )
    if coordinates is not None:
        return conditions
    for _ in range(LOAD_ITERATIONS):
        displaced = compute_displaced_coordinates(model, estimate, conditions)
        motion = compute_motion(
            model.sites.chain, displaced, model.sites.tracked_points
        )
        conditions = replace_motion(conditions, motion)
    return conditions


def get_joint_compliances(model: Model, estimate: Estimate) -> np.ndarray:
    """Joint compliances of an estimate, (n,) array, rad/(N m).

    These are the identified ones if they are parameters, otherwise the nominal ones.
    """
    return _get_coefficients(
        "joint_compliance", model, estimate, model.nominal_compliance
    )


def get_mass_corrections(model: Model, estimate: Estimate) -> np.ndarray:
    """Errors of the declared masses in the robot file, (4 m,) array: see
    `Conditions`."""
    zero = np.zeros(MASS_PARAMETERS * len(model.sites.masses))
    return _get_coefficients(DECLARED_WEIGHT, model, estimate, zero)


def update_springs_and_masses(
    model: Model, estimate: Estimate, conditions: Conditions
) -> Conditions:
    """Update conditions to the compliances and masses of an estimate."""
    return replace_springs(
        conditions,
        get_joint_compliances(model, estimate),
        get_mass_corrections(model, estimate),
    )


def _get_coefficients(
    name: str, model: Model, estimate: Estimate, default: np.ndarray
) -> np.ndarray:
    """Linear parameters of the effect with this name."""
    for effect, values in zip(model.effects, estimate.coefficients, strict=True):
        if effect.effect == name:
            return values
    return default


def compute_displaced_coordinates(
    model: Model, estimate: Estimate, conditions: Conditions
) -> np.ndarray:
    """Compute the coordinates of the sites in each state, (S, C) array.

    They are the joint angles, displaced by springs and effects. Springs yield to the
    total load: the external one and the weight that the robot file declares.
    """
    conditions = update_springs_and_masses(model, estimate, conditions)
    joints = model.sites.joints
    # Coordinates are contiguous along the states, as kinematics reads them.
    shape = (model.sites.chain.coordinates, len(conditions.joint_angles))
    displaced = np.zeros(shape).T
    displaced[:, :joints] = (
        conditions.joint_angles + conditions.total[:, :joints] * conditions.compliance
    )
    other_effects = [
        (effect, values, shapes)
        for effect, values, shapes in zip(
            model.effects, estimate.coefficients, estimate.shapes, strict=True
        )
        if effect.effect not in LOAD_EFFECTS
    ]
    for coordinate, displacement in sum_displacements(
        other_effects, conditions
    ).items():
        displaced[:, coordinate] += displacement
    return displaced


def sum_displacements(
    effects: Iterable[tuple[Candidate, np.ndarray, Iterable[float]]],
    conditions: Conditions,
) -> dict[int, np.ndarray]:
    """Sum the displacements of each coordinate by effects, (S,) arrays.

    `effects` come with their linear parameters (D,) and their shapes (F,).
    """
    displacements: dict[int, np.ndarray] = {}
    for effect, values, shapes in effects:
        basis = evaluate_basis_functions(effect, shapes, conditions)
        for value, functions in zip(values, basis, strict=True):
            for coordinate, per_unit in functions.items():
                displacement = value * per_unit
                if coordinate in displacements:
                    displacements[coordinate] += displacement
                else:
                    displacements[coordinate] = displacement
    return displacements


def evaluate_basis_functions(
    effect: Candidate, shapes: Iterable[float], conditions: Conditions
) -> list[dict[int, np.ndarray]]:
    """Evaluate the displacements per unit of each linear parameter of an effect.

    Basis functions of the joint angles alone do not change from step to step; the
    conditions keep them.
    """
    if not effect.fixed:
        return effect.displacement(conditions, *shapes)
    return conditions.laws.get(effect.key, partial(effect.displacement, conditions))


def predict(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> tuple[np.ndarray, np.ndarray]:
    """Predict the exact poses of the targets in base axes.

    `conditions` are those of the states. Returns positions (M, 3) and rotations
    (M, 3, 3).
    """
    coordinates = compute_displaced_coordinates(model, estimate, conditions)
    position, rotation = compute_point_poses(
        model.sites.chain, coordinates, locate_targets(model, estimate)
    )
    indices = (observations.target, observations.state)
    target_rotation = estimate.target_rotation[observations.target]
    return position[indices], rotation[indices] @ target_rotation


def locate_targets(model: Model, estimate: Estimate) -> list[MeasuringPoint]:
    """Points of the kinematic chain at which an estimate has the targets."""
    points = [model.sites.chain.point(target.point) for target in model.targets]
    return [
        replace(point, offset_m=tuple(offset))
        for point, offset in zip(points, estimate.target_offset, strict=True)
    ]


def compute_residuals(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> np.ndarray:
    """Compute measured minus predicted values, (M, rows) array, base axes.

    Positions in m and, if poses are measured, rotation vectors in rad; single numbers
    of other kinds. Arguments are those of `predict`.
    """
    position, rotation = predict(model, estimate, observations, conditions)
    return subtract_prediction(model, estimate, observations, position, rotation)


def compute_residual_vectors(
    model: Model, estimate: Estimate, observations: Observations, conditions: Conditions
) -> np.ndarray:
    """Compute residuals as vectors, (M, 3) or (M, 6) array, base axes.

    A single number is a vector along the direction in which it was measured, such as the
    normal of a plane. Arguments are those of `predict`.
    """
    if model.measuring is None or model.rows > 1:
        return compute_residuals(model, estimate, observations, conditions)
    poses = predict(model, estimate, observations, conditions)
    prediction = predict_channels(model, estimate, observations, *poses)
    return prediction.residual * prediction.by_pose[:, 0, :3]


def subtract_prediction(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    position: np.ndarray,
    rotation: np.ndarray,
) -> np.ndarray:
    """Subtract predicted poses (M, 3), (M, 3, 3) from measured ones; see
    `compute_residuals`."""
    if model.measuring is not None:
        return predict_channels(
            model, estimate, observations, position, rotation
        ).residual
    measured, measured_rotation = transform_to_base(estimate, observations)
    if measured_rotation is None:
        return measured - position
    return compute_pose_differences(measured, measured_rotation, position, rotation)


def predict_channels(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    position: np.ndarray,
    rotation: np.ndarray,
) -> Prediction:
    """Predict the measurements of a measuring plan, with derivatives in the poses of the
    targets and in the features, from predicted poses (M, 3), (M, 3, 3); base axes."""
    assert model.measuring is not None
    poses = place_in_session(estimate, observations, position, rotation)
    return evaluate_channels(
        model.measuring,
        model.fitted_features,
        observations,
        poses,
        estimate.features,
    )


def place_in_session(
    estimate: Estimate,
    observations: Observations,
    position: np.ndarray,
    rotation: np.ndarray,
) -> SessionPoses:
    """Transform predicted poses (M, 3), (M, 3, 3) from base axes into the frames of the
    sessions of the observations."""
    session = estimate.index_sessions(observations)
    frame = estimate.frame_rotation[session]
    in_session = (frame @ position[..., None])[..., 0]
    in_session += estimate.frame_position[session]
    return SessionPoses(in_session, frame @ rotation, frame)


def transform_to_base(
    estimate: Estimate, observations: Observations
) -> tuple[np.ndarray, np.ndarray | None]:
    """Transform measurements from the frames of their sessions into base axes.

    Returns positions (M, 3), and rotations (M, 3, 3) or None.
    """
    session = estimate.index_sessions(observations)
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    relative = observations.position - estimate.frame_position[session]
    position = (into_base @ relative[..., None])[..., 0]
    if observations.rotation is None:
        return position, None
    return position, into_base @ observations.rotation


@dataclass(frozen=True)
class Case:
    """A campaign ready to be fitted.

    Attributes
    ----------
    campaign : Campaign, with the measurements to fit
    observations : Observations, averages of its repeats without outlying ones
    model : Model, as declared
    candidates : dict from key to effect that the model may lack
    """

    campaign: Campaign
    observations: Observations
    model: Model
    candidates: dict[str, Candidate]

    def select(self, kept: np.ndarray) -> Case:
        """Keep only some measurements, given as (N,) bool array."""
        measurements = self.campaign.measurements.select(kept)
        return replace(
            self,
            campaign=replace(self.campaign, measurements=measurements),
            observations=average_repeats(remove_outlying_repeats(measurements)),
        )
