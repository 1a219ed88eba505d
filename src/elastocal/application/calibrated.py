"""The calibrated robot: the final model of a diagnosis without the effects that belong
to the set-up of one campaign or to its instruments.

A command states joint angles and a load. Effects of the approach direction, of time or
of temperature are in no command either, and count as errors of the corrected robot
(`accuracy`).

`accuracy`, `compensation` and `exported` ask it the same questions: where it comes to
rest (`predict_poses`), how certain that is (`compute_pose_sensitivities` with its
covariance, noise and scope), and which commands are extrapolations
(`find_extrapolated`). Poses are those of the end effector's measuring point in the
robot's base frame: the frame of the chain, which the fit placed in the tracker's frame.
The uncertainty of tool and work frames is not included.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.frames import (
    BASE,
    PLACEMENT_PARAMETERS,
    Scope,
    root_mean_square,
    subtract_placement,
)
from elastocal.campaigns.campaign import Target
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.observations import Observations, States, select_states
from elastocal.mechanics.kinematics import compute_pose_differences, compute_poses
from elastocal.residual_model.regressions import list_regressions
from elastocal.residual_model.selection import (
    build_inputs,
    find_beyond_regression,
    is_commanded,
)
from elastocal.validation.transfer import find_beyond_campaign, find_larger_loads

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.mechanics.robot import Robot
    from elastocal.residual_model.regressions import Inputs, Predictor
    from elastocal.verdict import RegressionChoice

# States at a time, so that the intermediate results of a walk along all sites stay in
# the processor's cache.
_CHUNK = 1024
# Names of contributions that are no effects of the catalogue.
SPRINGS = "joint_compliance"
REGRESSION = "regression"


@dataclass(frozen=True)
class ResidualModel:
    """A regression on the residuals of the model, which is added within the fitted range
    of joints and loads.

    Attributes
    ----------
    predictor : the regression.
    target_offset_m : (3,) offset of the target for which it was fitted, in the frame of
        the end effector's measuring point.
    sensor_m : standard deviation of the tracker's noise in a coordinate of the fitted
        data, which the regression's intervals contain.
    typical : factor from the width of intervals to RMS errors, see
        `corrected.spread_of`.
    choice : how it was chosen; None if unknown.
    """

    predictor: Predictor
    target_offset_m: np.ndarray
    sensor_m: float
    typical: float
    choice: RegressionChoice | None = None

    @property
    def uses_jacobian(self) -> bool:
        """Whether the regression needs the Jacobian among its inputs. An unknown one
        may."""
        name = "" if self.choice is None else self.choice.regression
        regression = list_regressions().get(name)
        return regression is None or regression.uses_jacobian


@dataclass(frozen=True)
class CampaignFit:
    """The whole fit behind a calibrated robot.

    Attributes
    ----------
    model, estimate : fit with all its effects, frames and targets.
    covariance : (P, P) covariance of all its `list_parameters`.
    observations : measurements that were fitted.
    """

    model: Model
    estimate: Estimate
    covariance: np.ndarray
    observations: Observations


@dataclass(frozen=True)
class CalibratedRobot:
    """A robot with the model that a campaign has identified.

    Attributes
    ----------
    robot : as its file declares it; `robot.model_angles` converts angles of the
        controller to those of the chain.
    model : the final model with the effects that move the robot. Its only target is the
        end effector's measuring point.
    estimate : values of its parameters; the frame is the robot's base.
    covariance : (P, P) covariance of the parameters of the effects (linear, then
        nonlinear, effect by effect), marginal over frames, targets and all effects that
        are left out; zero for fixed parameters.
    noise : of the campaign, with the repeatability of the joints.
    scope : meaning of its errors.
    fitted : states of the campaign; None if unknown.
    residual_model : None if no regression corrects the residuals.
    fit : the whole fit; None if unknown.
    """

    robot: Robot
    model: Model
    estimate: Estimate
    covariance: np.ndarray
    noise: Noise
    scope: Scope
    fitted: States | None = None
    residual_model: ResidualModel | None = None
    fit: CampaignFit | None = None

    @property
    def states(self) -> States:
        """The campaign's states, which must be known."""
        assert self.fitted is not None, (
            "a robot that was read from its export has no campaign"
        )
        return self.fitted


def calibrate_by_fit(fit: Fit, robot: Robot) -> CalibratedRobot:
    """Build a calibrated robot from the final fit of a diagnosis of its campaign."""
    return calibrate_by_model(robot, fit.model, fit.estimate, fit.covariance, fit.noise)


def calibrate_by_model(
    robot: Robot, model: Model, estimate: Estimate, covariance: np.ndarray, noise: Noise
) -> CalibratedRobot:
    """Build a calibrated robot from a fitted model.

    Parameters
    ----------
    robot : as its file declares it.
    model, estimate : fitted model.
    covariance : (P, P) covariance of all its `parameters`.
    noise : of the campaign.
    """
    kept = [
        number for number, effect in enumerate(model.effects) if is_commanded(effect)
    ]
    keys = {model.effects[number].key for number in kept}
    rows = np.flatnonzero(
        [owner in keys for owner, _ in list_parameters(model, estimate)]
    )
    end_model, end_estimate = move_to_end_effector(model, estimate)
    end_model = replace(
        end_model, effects=tuple(model.effects[number] for number in kept)
    )
    end_estimate = replace(
        end_estimate,
        coefficients=tuple(estimate.coefficients[number] for number in kept),
        shapes=tuple(estimate.shapes[number] for number in kept),
    )
    scope = Scope(BASE, np.zeros(3), np.zeros((PLACEMENT_PARAMETERS, len(rows))))
    kept_covariance = covariance[np.ix_(rows, rows)]
    return CalibratedRobot(
        robot, end_model, end_estimate, kept_covariance, noise, scope
    )


def move_to_end_effector(model: Model, estimate: Estimate) -> tuple[Model, Estimate]:
    """Return a model with the same effects whose only target is the end effector's
    measuring point, measured in the robot's base frame."""
    end = model.sites.chain.end_effector
    target = Target("end effector", end.name, end.offset_m)
    end_estimate = replace(
        estimate,
        sessions=(0,),
        frame_rotation=np.eye(3)[None],
        frame_position=np.zeros((1, 3)),
        target_offset=np.array([end.offset_m]),
        target_rotation=np.eye(3)[None],
    )
    end_model = replace(
        model, targets=(target,), fitted_frames=False, rows=6, base_std_m=0.0
    )
    return end_model, end_estimate


def zero_coefficients(estimate: Estimate, effects: set[int]) -> Estimate:
    """Set the linear parameters of effects, by their numbers in the model, to zero."""
    coefficients = tuple(
        0.0 * values if number in effects else values
        for number, values in enumerate(estimate.coefficients)
    )
    return replace(estimate, coefficients=coefficients)


def remove_effects(calibrated: CalibratedRobot, effects: set[int]) -> CalibratedRobot:
    """Return a robot without effects, by their numbers in its model."""
    return replace(calibrated, estimate=zero_coefficients(calibrated.estimate, effects))


def compute_effect_contributions(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> dict[str, float]:
    """Compute the RMS error that a correction without one effect would have.

    Parameters
    ----------
    calibrated : the robot; its scope says which placement is free in each comparison.
    reported_angles, wrench : (N, n) commands, rad, and (N, 6) loads, N and N m.

    Returns
    -------
    RMS errors in m: by effect, then by the joint compliances, last by the regression on
    the residuals if there is one.
    """
    pose = predict_poses(calibrated, reported_angles, wrench)
    effect_names = [effect.effect for effect in calibrated.model.effects]
    reduced = {name: _without_effect(calibrated, name) for name in effect_names}
    if SPRINGS not in reduced:
        reduced[SPRINGS] = _without_declared_springs(calibrated)
    if calibrated.residual_model:
        reduced[REGRESSION] = replace(calibrated, residual_model=None)
    contributions = {}
    for name, robot in reduced.items():
        reduced_pose = predict_poses(robot, reported_angles, wrench)
        differences = compute_pose_differences(*pose, *reduced_pose)[..., None]
        errors = subtract_placement(calibrated.scope, *pose, differences)
        contributions[name] = root_mean_square(errors[:, :3, 0])
    return contributions


def _without_effect(calibrated: CalibratedRobot, name: str) -> CalibratedRobot:
    effects = enumerate(calibrated.model.effects)
    return remove_effects(
        calibrated, {number for number, effect in effects if effect.effect == name}
    )


def _without_declared_springs(calibrated: CalibratedRobot) -> CalibratedRobot:
    """Remove compliances that are declared, and so are no effect of the model."""
    compliance = 0.0 * calibrated.model.nominal_compliance
    model = replace(calibrated.model, nominal_compliance=compliance)
    return replace(calibrated, model=model)


def predict_poses(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Predict the real poses of the end effector's measuring point.

    Parameters
    ----------
    calibrated : the robot.
    reported_angles : (N, n) joint angles as the controller reports them, rad (m for
        prismatic joints).
    wrench : (N, 6) loads in addition to the weights that the robot file declares, N and
        N m, at the last measuring point's origin, base axes; None for no loads.

    Returns
    -------
    Position (N, 3), m, and rotation (N, 3, 3), base axes.
    """
    count = len(reported_angles)
    wrench = np.zeros((count, 6)) if wrench is None else wrench
    position = np.empty((count, 3))
    rotation = np.empty((count, 3, 3))
    for chunk in split_into_chunks(count):
        _, position[chunk], rotation[chunk] = find_equilibrium(
            calibrated, reported_angles[chunk], wrench[chunk]
        )
    displacement = predict_residual_displacements(calibrated, reported_angles, wrench)
    return position + displacement, rotation


def predict_residual_displacements(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Predict the displacement of the end effector by the regression on the residuals.

    Returns (N, 3), m, base axes; 0 at commands where it is not added. Arguments as in
    `predict_poses`.
    """
    displacements = np.zeros((len(reported_angles), 3))
    active, inputs = select_regression_inputs(calibrated, reported_angles, wrench)
    if calibrated.residual_model is not None and inputs is not None:
        displacements[active] = calibrated.residual_model.predictor.mean(inputs)
    return displacements


def select_regression_inputs(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> tuple[np.ndarray, Inputs | None]:
    """Select the commands at which the regression on the residuals is added.

    Returns (N,) bool and the inputs of the regression at these commands; None for the
    inputs if there is no regression. Arguments as in `predict_poses`.
    """
    residual_model = calibrated.residual_model
    if residual_model is None:
        return np.zeros(len(reported_angles), bool), None
    observations = build_observations(build_states(calibrated, reported_angles, wrench))
    active = ~find_beyond_regression(
        calibrated.states, observations.states.joint_angles, wrench
    )
    inputs = build_inputs(
        calibrated.model,
        calibrated.estimate,
        select_states(observations, active),
        with_jacobian=residual_model.uses_jacobian,
    )
    offset_m = np.broadcast_to(residual_model.target_offset_m, (len(inputs), 3))
    covariates = np.hstack([inputs.covariates[:, :-3], offset_m])
    inputs = replace(inputs, covariates=covariates)
    return active, inputs


def find_equilibrium(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    nearby_coordinates: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where the robot comes to rest under loads, by its physical model alone.

    Parameters
    ----------
    calibrated, reported_angles, wrench : as in `predict_poses`.
    nearby_coordinates : (N, C) coordinates of nearly the same states, at which the loads
        are evaluated. None evaluates the loads at the deflected pose, by the fixed-point
        iteration of `model.evaluate_conditions`.

    Returns
    -------
    Coordinates (N, C) of the sites, and position and rotation as in `predict_poses`.
    """
    model = calibrated.model
    estimate = calibrated.estimate
    states = build_states(calibrated, reported_angles, wrench)
    around = evaluate_conditions(model, estimate, states, nearby_coordinates)
    coordinates = compute_displaced_coordinates(model, estimate, around)
    chain = model.sites.chain
    return coordinates, *compute_poses(chain, coordinates, chain.end_effector)


def compute_nominal_poses(
    robot: Robot, reported_angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the poses of the rigid robot of the file.

    Returns position (N, 3), m, and rotation (N, 3, 3) of the end effector's measuring
    point, base axes, at angles (N, n) as the controller reports them.
    """
    return compute_poses(
        robot.chain, robot.model_angles(reported_angles), robot.chain.end_effector
    )


def compute_pose_sensitivities(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Compute the derivatives of the poses by the parameters of the effects.

    Returns (N, 6, P): displacement and rotation, m and rad, base axes. Arguments as in
    `predict_poses`.
    """
    blocks = generate_pose_sensitivities(calibrated, reported_angles, wrench)
    return fill_from_blocks(
        (len(reported_angles), 6, len(calibrated.covariance)), blocks
    )


def generate_pose_sensitivities(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> Iterator[np.ndarray]:
    """Generate the result of `compute_pose_sensitivities` in blocks of consecutive
    poses, so that not all of them are in memory at once."""
    model = calibrated.model
    estimate = calibrated.estimate
    for chunk in split_into_chunks(len(reported_angles)):
        states = build_states(calibrated, reported_angles[chunk], wrench[chunk])
        around = evaluate_conditions(model, estimate, states)
        linearization = linearize(model, estimate, build_observations(states), around)
        yield linearization.sensitivities


def find_extrapolated(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    load_factor: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Find commands (N, n) and loads (N, 6) beyond the campaign.

    Returns (N,) bool of joint angles outside the fitted range, and (N,) bool of loads
    larger than `load_factor` times the fitted ones.
    """
    angles = calibrated.robot.model_angles(reported_angles)
    joints = find_beyond_campaign(calibrated.states, angles, None)
    return joints, find_larger_loads(calibrated.states, wrench, load_factor)


def build_states(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> States:
    """Build states of the model from commands (N, n), rad, and loads (N, 6)."""
    zeros = np.zeros(len(reported_angles), int)
    angles = calibrated.robot.model_angles(np.asarray(reported_angles, float))
    return States(zeros, np.arange(len(zeros)), zeros, angles, wrench, zeros + 1)


def build_observations(states: States) -> Observations:
    """Build observations of the end effector in each state, without measured values."""
    count = len(states)
    return Observations(
        states,
        np.arange(count),
        np.zeros(count, int),
        np.zeros((count, 3)),
        np.broadcast_to(np.eye(3), (count, 3, 3)),
    )


def fill_from_blocks(
    shape: tuple[int, ...], blocks: Iterable[np.ndarray]
) -> np.ndarray:
    """Fill an array of this shape from blocks of its consecutive rows, of which only one
    is in memory beside it."""
    filled = np.empty(shape)
    first = 0
    for block in blocks:
        last = first + len(block)
        filled[first:last] = block
        first = last
    return filled


def split_into_chunks(count: int, size: int = _CHUNK) -> list[slice]:
    """Split a number of rows into slices of at most `size`."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
