"""Calibrated robots from fits to a campaign, with the meaning of their errors: which
placement is free, and which effects of the fit are in no command."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import (
    CampaignFit,
    ResidualModel,
    calibrate_by_model,
    compute_nominal_poses,
    generate_pose_sensitivities,
    predict_poses,
)
from elastocal.application.frames import (
    BASE,
    ROBOT,
    Scope,
    compute_placement_columns,
    fit_placement_to_blocks,
    select_free_parameters,
)
from elastocal.application.left_out import LeftOutEffects, is_left_out
from elastocal.fitting.model import (
    compute_residuals,
    evaluate_conditions,
    list_parameters,
    place_in_session,
    predict,
)
from elastocal.fitting.noise import estimate_joint_repeatability
from elastocal.mechanics.kinematics import compute_pose_differences

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.campaigns.campaign import Target
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import States
    from elastocal.mechanics.robot import Robot
    from elastocal.residual_model.regressions import Predictor
    from elastocal.verdict import RegressionChoice


def calibrate_on_case(
    case: Case,
    model: Model,
    estimate: Estimate,
    covariance: np.ndarray,
    noise: Noise,
    residual_model: ResidualModel | None = None,
) -> CalibratedRobot:
    """Build a calibrated robot, with its scope, from a model that was fitted to a case.

    If the tracker's noise hides how well each joint repeats, all joints get the same
    repeatability, which is the one that the repeats do not rule out.

    Parameters
    ----------
    case : the measurements that were fitted.
    model, estimate : fitted model.
    covariance : (P, P) covariance of all its `list_parameters`.
    noise : of the campaign.
    residual_model : result of `build_residual_model`.
    """
    robot = case.campaign.robot
    dof = 0.0
    if noise.source == "repeats" and not noise.joint_rad.any():
        repeatability_rad, dof = estimate_joint_repeatability(
            model, estimate, case.campaign.measurements
        )
        noise = replace(noise, joint_rad=np.full(robot.joints, repeatability_rad))
    fit = CampaignFit(model, estimate, covariance, case.observations)
    if model.measuring is not None:
        fit = _leave_features(fit)
    return calibrate_by_campaign_fit(robot, fit, noise, residual_model, dof)


def _leave_features(fit: CampaignFit) -> CampaignFit:
    """Return the fit as if positions had been measured where the features were touched.

    A corrected robot needs no features; its covariance is marginal over them.
    """
    model = fit.model
    estimate = fit.estimate
    owners = [owner for owner, _ in list_parameters(model, estimate)]
    kept = np.array([not owner.startswith("feature ") for owner in owners], bool)
    observations = fit.observations
    conditions = evaluate_conditions(model, estimate, observations.states)
    position, rotation = predict(model, estimate, observations, conditions)
    if model.rows > 1:
        residual = compute_residuals(model, estimate, observations, conditions)
        position = position + residual[:, :3]
    placed = place_in_session(estimate, observations, position, rotation)
    covariance = fit.covariance[np.ix_(kept, kept)]
    plan = model.measuring
    knows_base = plan is None or plan.states_places
    has_unknown_base = not model.has_frame_parameters and not knows_base
    if has_unknown_base:
        # Features in unknown places do not locate the base; its axes are a convention.
        frames = 6 * len(estimate.sessions)
        covariance = np.pad(covariance, ((frames, 0), (frames, 0)))
    return CampaignFit(
        replace(
            model,
            measuring=None,
            rows=6 if model.has_orientations else 3,
            fitted_frames=model.fitted_frames or has_unknown_base,
        ),
        replace(estimate, features=()),
        covariance,
        replace(
            observations,
            position=placed.position,
            rotation=placed.rotation if model.has_orientations else None,
            channel=None,
            spread=None,
        ),
    )


def calibrate_by_campaign_fit(
    robot: Robot,
    fit: CampaignFit,
    noise: Noise,
    residual_model: ResidualModel | None,
    repeatability_dof: float,
) -> CalibratedRobot:
    """Build a calibrated robot, with its scope, from the whole fit of a campaign.

    Parameters
    ----------
    robot : as its file declares it.
    fit : fit with all its effects.
    noise : of the campaign, with the repeatability of the joints.
    residual_model : result of `build_residual_model`.
    repeatability_dof : as in `Scope`.
    """
    parts = (fit.model, fit.estimate, fit.covariance)
    states = fit.observations.states
    calibrated = replace(
        calibrate_by_model(robot, *parts, noise),
        fitted=states,
        residual_model=residual_model,
        fit=fit,
    )
    scope = determine_scope(calibrated, *parts, states)
    scope = replace(scope, repeatability_dof=repeatability_dof)
    return replace(calibrated, scope=scope)


def build_residual_model(
    case: Case,
    estimate: Estimate,
    predictor: Predictor,
    choice: RegressionChoice,
    noise_m: float,
) -> ResidualModel | None:
    """Build the residual model of the end effector from a regression.

    Parameters
    ----------
    case, estimate : fitted campaign.
    predictor : regression on the residuals of the fit.
    choice : how it was chosen.
    noise_m : the tracker's noise as the campaign knows it. The fit is no source of it,
        because it takes residuals that the regression explains for noise.

    Returns
    -------
    None if no target is on the end effector.
    """
    end_effector = case.campaign.robot.chain.end_effector
    targets = _find_targets_on(case.campaign.targets, end_effector.name)
    if not targets:
        return None
    offset_m = min(
        estimate.target_offset[targets],
        key=lambda offset: float(np.linalg.norm(offset - end_effector.offset_m)),
    )
    repeats = case.observations.states.repeats
    sensor_m = noise_m * float(np.sqrt((1.0 / repeats).mean()))
    assert choice.spread is not None, "no regression was chosen"
    typical = choice.spread.typical
    return ResidualModel(predictor, offset_m, sensor_m, typical, choice)


def _find_targets_on(targets: Sequence[Target], point: str) -> list[int]:
    """Find the numbers of the targets on a measuring point."""
    return [number for number, target in enumerate(targets) if target.point == point]


def set_form_error(
    calibrated: CalibratedRobot, form_m: float, *, contradicted: bool = False
) -> CalibratedRobot:
    """Return a robot with another model-form error; arguments as in `Scope`."""
    scope = replace(calibrated.scope, form_m=form_m, contradicted=contradicted)
    return replace(calibrated, scope=scope)


def determine_scope(
    calibrated: CalibratedRobot,
    model: Model,
    estimate: Estimate,
    covariance: np.ndarray,
    states: States,
) -> Scope:
    """Determine the meaning of the errors of a robot from its fit.

    Errors are stated in the base frame if the campaign declares it, else after the best
    placement of the base.

    Parameters
    ----------
    calibrated : the robot as it is commanded.
    model, estimate, covariance : fit with all its effects, also those in no command.
    states : states of the campaign.
    """
    robot = calibrated.robot
    commands = robot.reported_angles(states.joint_angles)
    position, rotation = predict_poses(calibrated, commands, states.wrench)
    end_effector = model.sites.chain.end_effector.name
    scope = Scope(
        ROBOT if model.fitted_frames else BASE,
        position.mean(axis=0),
        offset_removed=is_offset_fitted(model.targets, end_effector),
    )
    placement = _Placement(
        compute_placement_columns(scope, position, rotation),
        select_free_parameters(
            base=model.fitted_frames,
            offset=scope.offset_removed,
            rotation=_is_rotation_fitted(model),
        ),
    )
    sensitivities = generate_pose_sensitivities(calibrated, commands, states.wrench)
    before = compute_pose_differences(
        *compute_nominal_poses(robot, commands), position, rotation
    )
    scope = replace(
        scope,
        absorbed=placement.fit(sensitivities),
        absorbed_before=placement.fit([before[..., None]])[:, 0],
    )
    return _add_left_out_effects(scope, placement, model, estimate, covariance, states)


@dataclass(frozen=True)
class _Placement:
    """A placement over the poses of a campaign.

    Attributes
    ----------
    columns : (N, 6, 12) result of `compute_placement_columns`.
    free : (12,) bool, parameters that are free.
    """

    columns: np.ndarray
    free: np.ndarray

    def fit(self, fields: Iterable[np.ndarray]) -> np.ndarray:
        """Fit the placement to fields in blocks of poses, (n, 6, K) each, as
        `fit_placement_to_blocks`."""
        return fit_placement_to_blocks(self.columns, fields, self.free)


def _is_rotation_fitted(model: Model) -> bool:
    """Whether poses are measured and the rotation of every target on the end effector is
    unknown."""
    numbers = _find_targets_on(model.targets, model.sites.chain.end_effector.name)
    is_unknown = all(model.targets[number].rotation is None for number in numbers)
    return bool(numbers) and is_unknown and model.rows == 6


def _add_left_out_effects(
    scope: Scope,
    placement: _Placement,
    model: Model,
    estimate: Estimate,
    covariance: np.ndarray,
    states: States,
) -> Scope:
    """Add the effects that are in no command to a scope."""
    left_out = tuple(effect.key for effect in model.effects if is_left_out(effect))
    if not left_out:
        return scope
    effects = LeftOutEffects.from_fit(model, estimate, covariance, states)
    fields = effects.generate_fields(effects.states)
    effects = replace(effects, absorbed=placement.fit(fields))
    return replace(scope, left_out=left_out, left_out_effects=effects)


def is_offset_fitted(targets: Sequence[Target], end_effector: str) -> bool:
    """Whether the offset of every target on the end effector is unknown, so that a
    constant offset there is no error."""
    numbers = _find_targets_on(targets, end_effector)
    return bool(numbers) and all(targets[number].offset_m is None for number in numbers)
