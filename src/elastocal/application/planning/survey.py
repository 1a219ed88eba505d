"""Planned measurements in each configuration, their accuracy, and their information
about the parameters of the robot.

The model is the one that a campaign declares: offsets of the joints, lengths and angles
of the links, joint compliances if loads are measured, errors of declared masses, and the
placement of base and targets if they are unknown. Sensitivities are those of the fit
itself, at the values of the robot file.

Without a tracker, the places of features are unknown too, and are fitted with the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import (
    calibrate_by_model,
    compute_nominal_poses,
    compute_pose_sensitivities,
    split_into_chunks,
)
from elastocal.application.frames import BASE, ROBOT, Scope, subtract_placement
from elastocal.application.scope import is_offset_fitted
from elastocal.campaigns.campaign import APPLICATION_POINT_STD_M, GEOMETRY
from elastocal.effects.catalogue import declared_candidates
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_application_point, declared_weight
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    Estimate,
    Model,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import compute_whitening
from elastocal.fitting.observations import Observations, States
from elastocal.fitting.sensor_noise import ShapedNoise, compute_sensor_roots
from elastocal.measuring.catalogue import list_kinds
from elastocal.measuring.channels import parse_measuring
from elastocal.mechanics.sites import build_sites

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.application.planning.reaching import SetUp
    from elastocal.campaigns.campaign import Target
    from elastocal.effects.protocol import Parameter
    from elastocal.measuring.channels import MeasuringPlan
    from elastocal.mechanics.robot import Robot

# States that are linearized at once, so that their Jacobians stay in the processor's
# cache.
_CHUNK = 1000


@dataclass(frozen=True)
class Survey:
    """Planned measurements in each configuration, and their accuracy.

    Attributes
    ----------
    robot : the robot.
    targets : all of them are measured under each load.
    unknown_base : whether the tracker's frame is fitted.
    measured : name of the kind of measurement.
    position_m, orientation_rad : standard deviation of each component of a measurement.
    force_N : force of the load, 0 for none.
    pulled : whether the load pulls in any direction; else it is a hanging weight.
    setup : what measures the robot if it is no tracker; None for a tracker.
    """

    robot: Robot
    targets: tuple[Target, ...]
    unknown_base: bool
    measured: str
    position_m: float
    orientation_rad: float
    force_N: float = 0.0
    pulled: bool = False
    setup: SetUp | None = None

    @property
    def rows(self) -> int:
        """Numbers in a measurement of one target."""
        return list_kinds()[self.measured].numbers

    @property
    def plan(self) -> MeasuringPlan | None:
        """Kinds, features and channels as a campaign of this survey has them; None if
        rows refer to no feature."""
        if self.setup is None or not self.setup.has_features:
            return None
        features = {
            name: {"kind": self.measured, **self.setup.kind.state_place(place)}
            for name, place in self.setup.places.items()
        }
        document = {"measured": self.measured, "frame": BASE, "features": features}
        return parse_measuring(document, "--place")

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares of the force under which each configuration is measured."""
        if not self.loaded:
            return (0.0,)
        return (0.0, 1.0, -1.0) if self.pulled else (0.0, 1.0)

    @property
    def numbers(self) -> int:
        """Numbers that are measured in one configuration."""
        return len(self.shares) * len(self.targets) * self.rows

    @property
    def loaded(self) -> bool:
        """Whether any measurement is under a load."""
        return self.force_N > 0.0

    @property
    def hanging(self) -> bool:
        """Whether the load is a hanging weight."""
        return self.loaded and not self.pulled

    @property
    def frame(self) -> str:
        """Frame in which the accuracy is stated, a key of `frames.FRAMES`."""
        return ROBOT if self.unknown_base or self.setup else BASE

    @property
    def offset_removed(self) -> bool:
        """Whether a constant offset at the end effector is no error, because that of
        its targets is fitted."""
        end_effector = self.robot.chain.end_effector.name
        return is_offset_fitted(self.targets, end_effector)

    def draw_forces(self, count: int, stream: np.random.Generator) -> np.ndarray:
        """Draw a force for each of N configurations, (N, 3), N, base axes."""
        if self.pulled:
            direction = stream.standard_normal((count, 3))
        else:
            direction = np.array([self.robot.gravity_m_s2] * count)
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        return self.force_N * direction / length


def declare_model(survey: Survey) -> tuple[Model, Estimate]:
    """Build the model that a campaign of this survey declares, at the values of the robot
    file."""
    robot = survey.robot
    sites = build_sites(robot)
    effects = tuple(declared_candidates(GEOMETRY, sites))
    if sites.masses:
        effects = (declared_weight(sites), *effects)
    if survey.loaded:
        point_error = declared_application_point(sites, APPLICATION_POINT_STD_M)
        effects = (joint_compliance(sites), point_error, *effects)
    model = Model(
        sites,
        survey.targets,
        survey.unknown_base,
        survey.rows,
        robot.compliance,
        effects,
        measuring=survey.plan,
        shaped_noise=_shape_noise(survey),
    )
    coefficients = []
    for effect in effects:
        is_compliance = effect.effect == "joint_compliance"
        zeros = np.zeros(len(effect.parameters))
        coefficients.append(robot.compliance if is_compliance else zeros)
    offsets = [target.offset_m or (0.0, 0.0, 0.0) for target in survey.targets]
    estimate = Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array(offsets),
        np.broadcast_to(np.eye(3), (len(offsets), 3, 3)).copy(),
        tuple(coefficients),
        tuple(np.zeros(0) for _ in effects),
    )
    if survey.setup is not None:
        estimate = _place_setup(survey.setup, estimate)
    return model, estimate


def _place_setup(setup: SetUp, estimate: Estimate) -> Estimate:
    """Place target, frame of the session and features where they roughly are."""
    origin, axes = setup.locate_session()
    values: tuple[np.ndarray, ...] = ()
    if setup.has_features:
        values = tuple(map(setup.kind.convert_place, setup.places.values()))
    return replace(
        estimate,
        frame_rotation=axes.T[None],
        frame_position=-(axes.T @ origin)[None],
        target_offset=setup.mount_m[None],
        target_rotation=setup.mount_rotation[None],
        features=values,
    )


def _shape_noise(survey: Survey) -> ShapedNoise | None:
    """Shape the noise of a kind that says how it depends on the pose, in groups of errors
    with the standard deviation of a coordinate or of a rotation."""
    setup = survey.setup
    if setup is None or setup.has_features:
        return None
    somewhere = np.ones((1, 3)), np.eye(3)[None]
    shape = setup.kind.shape_noise(*somewhere, setup.options)
    if shape is None:
        return None
    factors = np.full(shape.groups.max() + 1, survey.orientation_rad)
    factors[shape.groups[:3]] = survey.position_m
    return ShapedNoise(setup.kind, setup.options, factors, survey.position_m)


def compute_information_rows(
    survey: Survey,
    reported_angles: np.ndarray,
    force: np.ndarray,
    place_index: np.ndarray | None = None,
) -> np.ndarray:
    """Compute the whitened sensitivities of the measurements in each configuration.

    Parameters
    ----------
    survey : what is measured.
    reported_angles : (N, n) joint angles as the controller reports them, rad.
    force : (N, 3) full load at the last measuring point, N, base axes.
    place_index : (N,) int, place of the set-up that is measured; None for a tracker.

    Returns
    -------
    (N, k, P) derivatives of the k numbers that are measured in each configuration, over
    their standard deviations, by the `list_parameters` of the model in units of their
    plausible sizes. The information matrix is ``rows.T @ rows``.
    """
    model, estimate = declare_model(survey)
    plausible = [
        parameter.plausible for _, parameter in list_parameters(model, estimate)
    ]
    noise = _state_noise(survey)
    count = len(reported_angles)
    rows = np.empty((count, survey.numbers, len(plausible)))
    for chunk in split_into_chunks(count, max(_CHUNK // len(survey.shares), 1)):
        observations = build_observations(
            survey,
            reported_angles[chunk],
            force[chunk],
            None if place_index is None else place_index[chunk],
        )
        around = evaluate_conditions(model, estimate, observations.states)
        linearization = linearize(model, estimate, observations, around)
        roots = compute_sensor_roots(model, estimate, observations, noise)
        whitening = compute_whitening(observations, None, noise, roots)
        scaled = whitening.apply(linearization.sensitivities) * plausible
        rows[chunk] = scaled.reshape(-1, survey.numbers, len(plausible))
    return rows


def _state_noise(survey: Survey) -> Noise:
    """State the noise of the sensor; joints repeat exactly."""
    return Noise(
        "declared",
        survey.position_m,
        survey.orientation_rad,
        np.zeros(survey.robot.joints),
    )


def compute_accuracy_rows(
    survey: Survey,
    reported_angles: np.ndarray,
    force: np.ndarray,
    *,
    offset_removed: bool | None = None,
) -> np.ndarray:
    """Compute the sensitivities of the end effector's position, as `accuracy` counts it.

    If the base is unknown, its best placement over these configurations is subtracted;
    if the offset of the targets on the end effector is unknown, the best constant offset
    there is. The placement of base and targets itself does not move the robot.

    Parameters
    ----------
    survey : says what is unknown.
    reported_angles : (N, n) configurations at which the robot shall be accurate, rad.
    force : (N, 3) load under which it works there, N, base axes.
    offset_removed : whether a constant offset is no error; by default as the survey
        says.

    Returns
    -------
    (N, 3, P) derivatives by the parameters in units of their plausible sizes, m.
    """
    calibrated = _calibrate_exactly(survey)
    parameters = list_parameters(*declare_model(survey))
    wrench = np.hstack([force, np.zeros_like(force)])
    sensitivities = compute_pose_sensitivities(calibrated, reported_angles, wrench)
    position, rotation = compute_nominal_poses(survey.robot, reported_angles)
    if offset_removed is None:
        offset_removed = survey.offset_removed
    scope = Scope(survey.frame, position.mean(axis=0), offset_removed=offset_removed)
    commanded = list_parameters(calibrated.model, calibrated.estimate)
    plausible = np.array([parameter.plausible for _, parameter in commanded])
    residual = subtract_placement(scope, position, rotation, sensitivities * plausible)
    rows = np.zeros((len(sensitivities), 3, len(parameters)))
    rows[..., _find_commanded(parameters, commanded)] = residual[:, :3]
    return rows


def _find_commanded(
    parameters: list[tuple[str, Parameter]], commanded: list[tuple[str, Parameter]]
) -> np.ndarray:
    """Find which parameters (P,) commands contain. They contain neither the placement of
    base and targets nor the point of the load."""
    effects = {owner for owner, _ in commanded}
    return np.array([owner in effects for owner, _ in parameters])


def _calibrate_exactly(survey: Survey) -> CalibratedRobot:
    """Build the robot of the robot file, without errors, as a calibrated one."""
    model, estimate = declare_model(survey)
    # A robot that is corrected needs no features.
    model = replace(model, measuring=None, shaped_noise=None)
    count = len(list_parameters(model, estimate))
    covariance = np.zeros((count, count))
    return calibrate_by_model(
        survey.robot, model, estimate, covariance, _state_noise(survey)
    )


def build_observations(
    survey: Survey,
    reported_angles: np.ndarray,
    force: np.ndarray,
    place_index: np.ndarray | None = None,
) -> Observations:
    """Build observations without measured values: every target under every share of the
    load of each configuration, in this order.

    Arguments as in `compute_information_rows`.
    """
    states = _build_states(survey, reported_angles, force)
    count = len(states.pose)
    targets = len(survey.targets)
    state = np.repeat(np.arange(count), targets)
    position = np.zeros((len(state), min(survey.rows, 3)))
    rotation = np.broadcast_to(np.eye(3), (len(state), 3, 3))
    channel = None
    if survey.setup is not None:
        # A channel is one place, because all rows have the numbers of one kind.
        if survey.setup.has_features:
            channel = place_index
        else:
            position, rotation, _ = survey.setup.locate_targets(
                survey.robot, states.joint_angles
            )
    return Observations(
        states,
        state,
        np.tile(np.arange(targets), count),
        position,
        rotation if survey.rows == 6 else None,
        channel,
    )


def _build_states(
    survey: Survey, reported_angles: np.ndarray, force: np.ndarray
) -> States:
    """Build the states of each configuration under every share of the load."""
    loads = len(survey.shares)
    angles = np.repeat(survey.robot.model_angles(reported_angles), loads, axis=0)
    count = len(angles)
    wrench = np.zeros((count, 6))
    shares = np.array(survey.shares)[:, None]
    wrench[:, :3] = (force[:, None] * shares).reshape(-1, 3)
    zeros = np.zeros(count, int)
    pose = np.arange(count) // loads
    load = np.arange(count) % loads
    return States(zeros, pose, load, angles, wrench, zeros + 1)
