"""From a fit to what its errors mean: frame and freedoms, effects that no command contains, and what held-out poses say."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import BASE, ROBOT, Scope, find_absorbed, placement, predict_errors, scope_in
from elastocal.application.calibrated import (
    OperatingConditions,
    calibrate_by_model,
    forward,
    move_to_end_effector,
    moves_robot,
    nominal_forward,
    observations_of,
    pose_sensitivities,
    square_root,
)
from elastocal.fitting.displacement import conditions, displaced_coordinates
from elastocal.fitting.linearization import linearize
from elastocal.fitting.noise import hidden_repeatability
from elastocal.fitting.parameters import parameters
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.pose_differences import pose_differences
from elastocal.validation.held_out import position_residuals
from elastocal.validation.placing import placed

if TYPE_CHECKING:
    from elastocal.application.accuracy import Accuracy
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import States

REGION = "the poses and loads that were fitted"
# Of a campaign, over which its accuracy is stated: more change no digit.
_MOST_STATES = 1000
# How sure held-out poses must be that the prediction is too small before they raise it: of honest campaigns one in twenty is.
_SURE = 0.95
_SEED = 1


def calibrate_on_case(case: Case, model: Model, estimate: Estimate, covariance: np.ndarray, noise: Noise) -> CalibratedRobot:
    """A calibrated robot from a model that was fitted to a case, as `calibrate_by_model`, that knows what its errors mean.

    Where the sensor hides how well each joint repeats, all are taken to repeat alike, by what the repeats leave possible.
    """
    robot, freedom = case.campaign.robot, 0.0
    if noise.source == "repeats" and not noise.joint_rad.any():
        alike, freedom = hidden_repeatability(model, estimate, case.campaign.measurements)
        noise = replace(noise, joint_rad=np.full(robot.joints, alike))
    found = calibrate_by_model(robot, model, estimate, covariance, noise)
    scope = scope_of(found, model, estimate, covariance, case.observations.states)
    return replace(found, scope=replace(scope, repeated_freedom=freedom))


def scope_of(calibrated: CalibratedRobot, model: Model, estimate: Estimate, covariance: np.ndarray, states: States) -> Scope:
    """The scope of a fit with all of its effects to some states: in the base's frame where that was declared."""
    robot, end = calibrated.robot, model.sites.chain.end_effector.name
    there = [target for target in model.targets if target.point == end]
    offset, turn = (bool(there) and all(value is None for value in each) for each in
                    ([target.offset_m for target in there], [target.rotation for target in there]))  # fmt: skip
    free = np.repeat([model.fitted_frames, model.fitted_frames, offset, turn and model.rows == 6], 3)
    reported, operating = robot.reported_angles(states.joint_angles), conditions_in(calibrated, states)
    position, rotation = forward(calibrated, reported, operating)
    none = np.zeros((12, len(calibrated.covariance)))
    scope = Scope(ROBOT if model.fitted_frames else BASE, position.mean(axis=0), none, np.zeros(12), offset)
    columns = placement(scope, position, rotation)
    before = pose_differences(*nominal_forward(robot, reported), position, rotation)[..., None]

    def size(fields: np.ndarray) -> tuple[float, float]:
        squares = ((fields - columns @ find_absorbed(columns, fields, free))[:, :3] ** 2).sum(axis=(1, 2))
        return float(np.sqrt(squares.mean())), float(np.sqrt(squares.max()))

    unstated = []
    for name, without in (("time", "time_s"), ("temperature", "temperature_c"), ("approach", "approach")):
        if any(name in effect.needs for effect in calibrated.model.effects):
            other = forward(calibrated, reported, replace(operating, **{without: None}))
            unstated.append((name, *size(pose_differences(position, rotation, *other)[..., None])))
    scope = replace(
        scope,
        unstated=tuple(unstated),
        absorbed=find_absorbed(columns, pose_sensitivities(calibrated, reported, operating), free),
        absorbed_before=find_absorbed(columns, before, free)[:, 0],
    )
    dropped = tuple(effect.key for effect in model.effects if not moves_robot(effect))
    if not dropped:
        return scope
    if model.row_span is None and states.row is not None:
        # Progress counts from the campaign's first row to its last, whichever of its states are asked.
        model = replace(model, row_span=(int(states.row.min()), int(states.row.max())))
    rms, worst = 0.0, 0.0
    for some in _epochs(states, model.fitted_frames):
        found = size(_find_left_out(model, estimate, covariance, some))
        rms, worst = max(rms, found[0]), max(worst, found[1])
    return replace(scope, left_out=dropped, left_out_m=rms, left_out_worst_m=worst)


def conditions_in(calibrated: CalibratedRobot, states: States) -> OperatingConditions:
    """Those of states; senses of approach as the controller counts them."""
    back = np.linalg.inv(calibrated.robot.reported_matrix)
    approach = None if states.approach is None else np.sign(states.approach @ back.T)
    return OperatingConditions(states.wrench, approach, states.time_s, states.temperature_c)


def campaign_poses(calibrated: CalibratedRobot, states: States) -> tuple[np.ndarray, OperatingConditions]:
    """Commands (N, n) and conditions of a campaign over which its accuracy is stated: all, or evenly some of very many."""
    chosen = np.unique(np.linspace(0, len(states) - 1, min(len(states), _MOST_STATES)).astype(int))
    return calibrated.robot.reported_angles(states.joint_angles[chosen]), conditions_in(calibrated, states).part(chosen)


def campaign_accuracy(calibrated: CalibratedRobot, states: States) -> Accuracy:
    """Predicted accuracy over the poses of a campaign: what it says of its robot as a whole."""
    return predict_errors(calibrated, *campaign_poses(calibrated, states)).accuracy(REGION)


def set_form(calibrated: CalibratedRobot, form_m: float, contradicted: bool = False) -> CalibratedRobot:
    """A calibrated robot of which it is known how much the form of its model leaves open."""
    return replace(calibrated, scope=replace(scope_in(calibrated), form_m=form_m, contradicted=contradicted))


def judge_by_held_out(calibrated: CalibratedRobot, final: Fit, case: Case, held_out: Case) -> CalibratedRobot:
    """A calibrated robot whose predicted errors are as large as its held-out poses say, where these contradict them.

    By the mean square over targets at the end effector: it must be larger than those of robots and of noise that are drawn as
    predicted. What it is more counts as error of the model's form. Nothing changes where the noise is not known.
    """
    end = case.campaign.robot.chain.end_effector.name
    seen, states = held_out.observations, held_out.observations.states
    mine = np.array([target.point == end for target in held_out.campaign.targets])[seen.target]
    if final.noise.source == "residual" or not mine.any():
        return calibrated
    state = seen.state[mine]
    found = predict_errors(calibrated, calibrated.robot.reported_angles(states.joint_angles), conditions_in(calibrated, states))
    sensor = final.noise.position_m**2 / states.repeats[state]
    noise = sensor @ np.random.default_rng(_SEED).chisquare(3, (len(state), len(found.rms_m))) / len(state)
    square = float((position_residuals(*placed(final, case, held_out), seen)[mine] ** 2).sum(axis=1).mean())
    if (found.rms_m**2 + noise < square).mean() <= _SURE:
        return calibrated
    scope = scope_in(calibrated)
    known = (found.error_m[state] ** 2).mean() - scope.form_m**2
    return set_form(calibrated, float(np.sqrt(square - 3.0 * sensor.mean() - known)), contradicted=True)


def _epochs(states: States, placed_anew: bool) -> list[States]:
    """The campaign as it went and, where nobody places the base anew, as if all of it had been at its end."""
    if placed_anew:
        return [states]
    row, time = (None if each is None else np.full_like(each, each.max()) for each in (states.row, states.time_s))
    return [states, replace(states, row=row, time_s=time)]


def _find_left_out(model: Model, estimate: Estimate, covariance: np.ndarray, states: States) -> np.ndarray:
    """What effects that are not commanded do to the end effector, (S, 6, 1 + D): all of it, and a factor of its covariance."""
    whole = move_to_end_effector(model, estimate)
    states = replace(states, session=np.zeros_like(states.session))
    kept = [moves_robot(effect) for effect in model.effects]
    values = tuple(value if moves else 0.0 * value for moves, value in zip(kept, estimate.coefficients, strict=True))
    ends = [_end_effector(*each, states) for each in (whole, (whole[0], replace(whole[1], coefficients=values)))]
    keys = {effect.key for effect, moves in zip(model.effects, kept, strict=True) if not moves}
    ours, theirs = (np.array([owner in keys for owner, _ in parameters(*each)]) for each in (whole, (model, estimate)))
    line = linearize(*whole, observations_of(states), conditions(*whole, states))
    spread = line.sensitivities[..., ours] @ square_root(covariance[np.ix_(theirs, theirs)])
    return np.concatenate([pose_differences(*ends[0], *ends[1])[..., None], spread], axis=2)


def _end_effector(model: Model, estimate: Estimate, states: States) -> tuple[np.ndarray, np.ndarray]:
    chain = model.sites.chain
    return poses(chain, displaced_coordinates(model, estimate, conditions(model, estimate, states)), chain.end_effector)
