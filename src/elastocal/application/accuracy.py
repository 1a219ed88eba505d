"""What is meant by the accuracy of a robot that is commanded by its calibrated model:
one definition for all commands.

The error at a pose is the real robot less the commanded model, in a frame (`frames`).
Predicted, it has four parts: what the uncertainty of the parameters leaves; the
repeatability of the joints and the error that each new pose has of its own; what the
form of the model leaves open, by what other models of the diagnosis predict, or
held-out poses where these show more; and all of what the fit ascribes to effects that
no command contains, such as hysteresis or a step of the set-up, for nothing shows that
they leave the robot alone. Where a regression on the remainder acts, the first two are
no smaller than poses left out of it say, and what is open of the form is in them unless
held-out poses show more. Nothing of the tracker's noise is in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import gammaincinv

from elastocal.application.calibrated import (
    Remainder,
    calibrate_by_model,
    compute_nominal_poses,
    compute_pose_sensitivities,
    move_to_end_effector,
    observations_of,
    predict_poses,
    regression_at,
    square_root,
)
from elastocal.application.frames import (
    BASE,
    FRAMES,
    ROBOT,
    Scope,
    compute_placement_columns,
    fit_placement,
    free_parts,
    root_mean_square,
)
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.noise import estimate_joint_repeatability
from elastocal.mechanics.kinematics import jacobians, pose_differences, poses
from elastocal.remainder.corrected import is_commanded

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import States
    from elastocal.remainder.regressions import Predictor

REGION = "the poses and loads that were fitted"
# Of every bound, one-sided, as GUM and JCGM 106 have it; and how sure held-out poses
# must be that a prediction is too small before they raise it: of honest campaigns one
# in twenty is.
CONFIDENCE = 0.95
# Robots drawn from what the fit leaves possible: so many tell a risk of 5 % to half a
# percent.
_DRAWS = 2000
_SEED = 1
# Square at the worst pose over the mean square of all, of an error of form: 7 to 9 on
# the plant.
_WORST_OF_FORM = 9.0
# Poses at a time, of so many draws.
_AT_ONCE = 200
# States of a campaign over which its accuracy is stated: more change no digit.
_MOST_STATES = 1000


@dataclass(frozen=True)
class Accuracy:
    """How large a predicted error is, of what, how surely; lengths in m, without the
    tracker's noise; `asdict` is its JSON.

    `frame`: "robot" or "base". `rms_m`, `worst_m`: root mean square over the poses, and
    at the worst of them; with one-sided confidence below `rms_bound_m`,
    `worst_bound_m`, None where nothing says so. `region`: which poses these are.
    `offset_removed`, `left_out`, `contradicted`: as in `frames.Scope`. Of `rms_m` are
    `left_out_m` by what is left out, `form_m` by what the form of the model leaves
    open, `repeated_m` by the repeatability of the joints and the error that each pose
    has of its own, `regression_m` by what a regression on the remainder leaves beyond
    parameters and repeatability. `fitted`: whether anything of the robot was; without,
    no error of 0 is one.
    """

    frame: str
    rms_m: float
    worst_m: float
    rms_bound_m: float | None
    worst_bound_m: float | None
    poses: int
    region: str
    offset_removed: bool = False
    left_out: list[str] = field(default_factory=list)
    left_out_m: float = 0.0
    form_m: float = 0.0
    contradicted: bool = False
    repeated_m: float = 0.0
    regression_m: float = 0.0
    confidence: float = CONFIDENCE
    fitted: bool = True


@dataclass(frozen=True)
class Prediction:
    """Predicted errors at N poses.

    `parameters_m`, `repeated_m` (N,): root mean square by the uncertainty of the
    parameters, and by what each approach and each pose has of its own. `regression_m`,
    `form_m` (N,): by what a regression leaves beyond both, and by the form of the
    model. `error_m` (N,): by all of these and by what is not commanded. `bound_m` (N,):
    below which each error is with `CONFIDENCE`. `rms_m`, `worst_m` (draws,): over the
    poses, of robots that the fit leaves possible.
    """

    parameters_m: np.ndarray
    repeated_m: np.ndarray
    regression_m: np.ndarray
    form_m: np.ndarray
    error_m: np.ndarray
    bound_m: np.ndarray
    rms_m: np.ndarray
    worst_m: np.ndarray
    scope: Scope

    def accuracy(self, region: str) -> Accuracy:
        """The statement over these poses, named in words."""
        scope = self.scope
        return Accuracy(
            frame=scope.frame,
            rms_m=root_mean_square(self.error_m),
            worst_m=root_mean_square(self.worst_m),
            rms_bound_m=float(np.quantile(self.rms_m, CONFIDENCE)),
            worst_bound_m=float(np.quantile(self.worst_m, CONFIDENCE)),
            poses=len(self.error_m),
            region=region,
            offset_removed=scope.offset_removed,
            left_out=list(scope.left_out),
            left_out_m=scope.left_out_m,
            form_m=root_mean_square(self.form_m),
            contradicted=scope.contradicted,
            repeated_m=root_mean_square(self.repeated_m),
            regression_m=root_mean_square(self.regression_m),
            fitted=bool(self.parameters_m.any()),
        )


def predict_errors(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    draws: int = _DRAWS,
) -> Prediction:
    """Predicted errors of the corrected robot where it is commanded to joint angles (N,
    n) under loads (N, 6).

    Drawn robots, most of the work, are for errors over all poses; where those of each
    pose are enough, none (0) need be.
    """
    scope = calibrated.scope
    robot = calibrated.robot
    root = square_root(calibrated.covariance)
    repeated = np.hypot(calibrated.noise.joint_rad, calibrated.noise.pose_rad)
    stream = np.random.default_rng(_SEED)
    drawn = stream.standard_normal((root.shape[1], draws))
    freedom = scope.repeated_freedom
    size = (
        np.sqrt(stream.gamma(0.5 * freedom, 2.0 / freedom, draws))
        if freedom
        else np.ones(draws)
    )
    total = np.zeros(draws)
    worst = np.zeros(draws)
    acts, stated = _by_regression(calibrated, reported_angles, wrench)
    parts = []
    more = np.zeros_like(stated)
    for start in range(0, len(reported_angles), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        angles = reported_angles[part]
        under = wrench[part]
        columns = compute_placement_columns(
            scope, *predict_poses(calibrated, angles, under)
        )
        moved = (
            compute_pose_sensitivities(calibrated, angles, under)
            - columns @ scope.absorbed
        ) @ root
        apart = (
            jacobians(robot.chain, robot.model_angles(angles), robot.chain.end_effector)
            * repeated
        )
        parts.append([each @ each.transpose(0, 2, 1) for each in (moved, apart)])
        known = np.trace((parts[-1][0] + parts[-1][1])[:, :3, :3], axis1=1, axis2=2)
        more[:, part] = np.maximum(stated[:, part] - known, 0.0)
        off = moved[:, :3] @ drawn + apart[:, :3] @ (
            size * stream.standard_normal((len(angles), apart.shape[2], draws))
        )
        if acts[part].any():
            off += np.sqrt(more[0, part] / 3.0)[:, None, None] * stream.standard_normal(
                off.shape
            )
        squares = (off**2).sum(axis=1)
        total += squares.sum(axis=0)
        worst = np.maximum(worst, squares.max(axis=0))
    covariances = [np.concatenate(each) for each in zip(*parts, strict=True)]
    ours, own = (
        np.diagonal(covariance, axis1=1, axis2=2) for covariance in covariances
    )
    left_out = scope.left_out_m**2
    form = np.where(acts & (not scope.contradicted), 0.0, scope.form_m**2)
    alike = (more[1] + form) / 3.0
    # An error of form is one law over all poses: what is open is how large it is.
    unknown = form.mean() * stream.standard_normal(draws) ** 2
    return Prediction(
        parameters_m=np.sqrt(ours[:, :3].sum(axis=1)),
        repeated_m=np.sqrt(own[:, :3].sum(axis=1)),
        regression_m=np.sqrt(more[0]),
        form_m=np.sqrt(form),
        error_m=np.sqrt((ours + own)[:, :3].sum(axis=1) + more[0] + left_out + form),
        bound_m=np.sqrt(
            quantile_of_length(
                (covariances[0] + covariances[1])[:, :3, :3]
                + alike[:, None, None] * np.eye(3)
            )
            ** 2
            + left_out
        ),
        rms_m=np.sqrt(total / len(reported_angles) + left_out + unknown),
        worst_m=np.sqrt(worst + scope.left_out_worst_m**2 + _WORST_OF_FORM * unknown),
        scope=scope,
    )


def _by_regression(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where a regression acts, (N,), and the squared error that it leaves there without
    the tracker's noise, (2, N), m²: on the average, and for intervals."""
    acts, asked = regression_at(calibrated, reported_angles, wrench)
    found = np.zeros((2, len(acts)))
    more = calibrated.remainder
    if more is not None and asked is not None:
        std = more.predictor.std(asked)
        for number, times in enumerate((more.typical, 1.0)):
            found[number, acts] = np.maximum(
                (times**2 * std**2 - more.sensor_m**2).sum(axis=1), 0.0
            )
    return acts, found


def quantile_of_length(covariance: np.ndarray) -> np.ndarray:
    """95 % quantile of the length of normal vectors of some covariances (N, 3, 3),
    ndarray (N,).

    By the gamma distribution that has the first two moments of the square [1].

    [1] Satterthwaite, F. E., An approximate distribution of estimates of variance
    components, Biometrics Bulletin 2, 1946.
    """
    mean = np.trace(covariance, axis1=1, axis2=2)
    variance = 2.0 * (covariance**2).sum(axis=(1, 2))
    safe = np.where(mean > 0.0, mean, 1.0)
    shape = np.where(mean > 0.0, safe**2 / np.where(variance > 0.0, variance, 1.0), 1.5)
    return np.sqrt(gammaincinv(shape, CONFIDENCE) * mean / shape)


def before_m(
    calibrated: CalibratedRobot,
    position: np.ndarray,
    rotation: np.ndarray,
    off: np.ndarray,
) -> np.ndarray:
    """How far an uncorrected robot misses poses, ndarray (N,), m.

    `off` (N, 6) is the pose less that of the calibrated robot, base axes; what a
    placement takes up is no error.
    """
    scope = calibrated.scope
    return np.linalg.norm(
        (
            off
            - compute_placement_columns(scope, position, rotation)
            @ scope.absorbed_before
        )[:, :3],
        axis=1,
    )


def compute_uncorrected_rms_m(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> float:
    """RMS error of the uncorrected robot at commands (N, n) under loads (N, 6), m, in
    the frame of the corrected one."""
    pose = predict_poses(calibrated, reported_angles, wrench)
    off = pose_differences(
        *compute_nominal_poses(calibrated.robot, reported_angles), *pose
    )
    return root_mean_square(before_m(calibrated, *pose, off))


def calibrate_on_case(
    case: Case,
    model: Model,
    estimate: Estimate,
    covariance: np.ndarray,
    noise: Noise,
    remainder: Remainder | None = None,
) -> CalibratedRobot:
    """A calibrated robot from a model that was fitted to a case, as
    `calibrate_by_model`, that knows what its errors mean.

    `remainder`: of `regression_on`. Where the sensor hides how well each joint repeats,
    all are taken to repeat alike, by what the repeats leave possible.
    """
    robot = case.campaign.robot
    states = case.observations.states
    freedom = 0.0
    if noise.source == "repeats" and not noise.joint_rad.any():
        alike, freedom = estimate_joint_repeatability(
            model, estimate, case.campaign.measurements
        )
        noise = replace(noise, joint_rad=np.full(robot.joints, alike))
    found = replace(
        calibrate_by_model(robot, model, estimate, covariance, noise),
        fitted=states,
        remainder=remainder,
    )
    scope = scope_of(found, model, estimate, covariance, states)
    return replace(found, scope=replace(scope, repeated_freedom=freedom))


def build_residual_model(
    case: Case, estimate: Estimate, predictor: Predictor, typical: float, noise_m: float
) -> Remainder | None:
    """A regression on what a model leaves of a case, for the end effector; none where
    no target was on it.

    `noise_m`: of the tracker, as the campaign knows it: where the model leaves
    something, the fit takes it for noise.
    """
    end = case.campaign.robot.chain.end_effector
    mine = [
        number
        for number, target in enumerate(case.campaign.targets)
        if target.point == end.name
    ]
    if not mine:
        return None
    place = min(
        estimate.target_offset[mine],
        key=lambda offset: float(np.linalg.norm(offset - end.offset_m)),
    )
    sensor = noise_m * float(np.sqrt((1.0 / case.observations.states.repeats).mean()))
    return Remainder(predictor, place, sensor, typical)


def scope_of(
    calibrated: CalibratedRobot,
    model: Model,
    estimate: Estimate,
    covariance: np.ndarray,
    states: States,
) -> Scope:
    """The scope of a fit with all of its effects to some states: in the base's frame
    where that was declared."""
    robot = calibrated.robot
    end = model.sites.chain.end_effector.name
    base = model.fitted_frames
    there = [target for target in model.targets if target.point == end]
    offset = bool(there) and all(target.offset_m is None for target in there)
    turn = bool(there) and all(target.rotation is None for target in there)
    free = free_parts(base, offset, turn and model.rows == 6)
    reported = robot.reported_angles(states.joint_angles)
    position, rotation = predict_poses(calibrated, reported, states.wrench)
    scope = Scope(ROBOT if base else BASE, position.mean(axis=0), offset_removed=offset)
    columns = compute_placement_columns(scope, position, rotation)
    before = pose_differences(
        *compute_nominal_poses(robot, reported), position, rotation
    )[..., None]

    def size(fields: np.ndarray) -> tuple[float, float]:
        squares = (
            (fields - columns @ fit_placement(columns, fields, free))[:, :3] ** 2
        ).sum(axis=(1, 2))
        return float(np.sqrt(squares.mean())), float(np.sqrt(squares.max()))

    sensitivities = compute_pose_sensitivities(calibrated, reported, states.wrench)
    absorbed, absorbed_before = (
        fit_placement(columns, fields, free) for fields in (sensitivities, before)
    )
    scope = replace(scope, absorbed=absorbed, absorbed_before=absorbed_before[:, 0])
    dropped = tuple(effect.key for effect in model.effects if not is_commanded(effect))
    if not dropped:
        return scope
    if model.row_span is None and states.row is not None:
        # Progress counts from the campaign's first row to its last, whichever of its
        # states are asked.
        model = replace(model, row_span=(int(states.row.min()), int(states.row.max())))
    epochs = [states]
    if not base:
        # Nobody places the base anew: also as if all of the campaign had been at its
        # end.
        row, time = (
            None if each is None else np.full_like(each, each.max())
            for each in (states.row, states.time_s)
        )
        epochs.append(replace(states, row=row, time_s=time))
    sizes = [size(_find_left_out(model, estimate, covariance, each)) for each in epochs]
    rms, worst = map(max, zip(*sizes, strict=True))
    return replace(scope, left_out=dropped, left_out_m=rms, left_out_worst_m=worst)


def select_campaign_commands(
    calibrated: CalibratedRobot,
) -> tuple[np.ndarray, np.ndarray]:
    """Commands (N, n) and loads (N, 6) of a campaign over which its accuracy is stated:
    all, or evenly some of very many."""
    states = calibrated.states
    chosen = np.unique(
        np.linspace(0, len(states) - 1, min(len(states), _MOST_STATES)).astype(int)
    )
    return calibrated.robot.reported_angles(states.joint_angles[chosen]), states.wrench[
        chosen
    ]


def predict_campaign_accuracy(calibrated: CalibratedRobot) -> Accuracy:
    """Predicted accuracy over the poses of a campaign: what it says of its robot as a
    whole."""
    return predict_errors(calibrated, *select_campaign_commands(calibrated)).accuracy(
        REGION
    )


def set_form_error(
    calibrated: CalibratedRobot, form_m: float, contradicted: bool = False
) -> CalibratedRobot:
    """A calibrated robot of which it is known how much the form of its model leaves
    open."""
    return replace(
        calibrated,
        scope=replace(calibrated.scope, form_m=form_m, contradicted=contradicted),
    )


def inflate_to_held_out_errors(
    calibrated: CalibratedRobot, held_out: Case, residual: np.ndarray, noise_m: float
) -> CalibratedRobot:
    """A calibrated robot whose predicted errors are as large as its held-out poses say,
    where these contradict them.

    `residual` (M, 3): what it leaves of them, m. `noise_m`: of the tracker in a
    coordinate.

    By the mean square over targets at the end effector: it must be larger than those of
    robots and of noise that are drawn as predicted. What it is more counts as error of
    the model's form. Nothing changes where the noise is not known.
    """
    end = calibrated.robot.chain.end_effector.name
    seen = held_out.observations
    states = held_out.observations.states
    mine = np.array([target.point == end for target in held_out.campaign.targets])[
        seen.target
    ]
    if calibrated.noise.source == "residual" or not mine.any():
        return calibrated
    state = seen.state[mine]
    found = predict_errors(
        calibrated, calibrated.robot.reported_angles(states.joint_angles), states.wrench
    )
    sensor = noise_m**2 / states.repeats[state]
    drawn = (
        sensor
        @ np.random.default_rng(_SEED).chisquare(3, (len(state), len(found.rms_m)))
        / len(state)
    )
    square = float((residual[mine] ** 2).sum(axis=1).mean())
    if (found.rms_m**2 + drawn < square).mean() <= CONFIDENCE:
        return calibrated
    known = (found.error_m[state] ** 2 - found.form_m[state] ** 2).mean()
    return set_form_error(
        calibrated,
        float(np.sqrt(square - 3.0 * sensor.mean() - known)),
        contradicted=True,
    )


def _find_left_out(
    model: Model, estimate: Estimate, covariance: np.ndarray, states: States
) -> np.ndarray:
    """What effects that are not commanded do to the end effector, (S, 6, 1 + D): all of
    it, and a factor of its covariance."""
    moved, values = move_to_end_effector(model, estimate)
    states = replace(states, session=np.zeros_like(states.session))
    kept = [is_commanded(effect) for effect in model.effects]
    commanded = tuple(
        value if moves else 0.0 * value
        for moves, value in zip(kept, estimate.coefficients, strict=True)
    )
    chain = model.sites.chain
    ends = []
    for each in (values, replace(values, coefficients=commanded)):
        coordinates = compute_displaced_coordinates(
            moved, each, evaluate_conditions(moved, each, states)
        )
        ends.append(poses(chain, coordinates, chain.end_effector))
    keys = {
        effect.key
        for effect, moves in zip(model.effects, kept, strict=True)
        if not moves
    }
    ours, theirs = (
        np.array([owner in keys for owner, _ in list_parameters(*each)])
        for each in ((moved, values), (model, estimate))
    )
    line = linearize(
        moved,
        values,
        observations_of(states),
        evaluate_conditions(moved, values, states),
    )
    spread = line.sensitivities[..., ours] @ square_root(
        covariance[np.ix_(theirs, theirs)]
    )
    return np.concatenate(
        [pose_differences(*ends[0], *ends[1])[..., None], spread], axis=2
    )


def format_accuracy(accuracy: Accuracy) -> str:
    """One sentence with everything that an accuracy statement has, the same wherever it
    stands."""
    offset = (
        " and of a constant offset at the end effector"
        if accuracy.offset_removed
        else ""
    )

    def value(size: float, bound: float | None) -> str:
        sure = (
            ""
            if bound is None
            else f" ({100 * accuracy.confidence:g} % sure: below {millimetres(bound)})"
        )
        return millimetres(size) + sure

    frame = FRAMES[accuracy.frame]
    frame = (
        frame[:-1] + offset + ")"
        if accuracy.frame == ROBOT
        else frame + (" (after" + offset[4:] + ")" if offset else "")
    )
    if not accuracy.fitted and not accuracy.form_m:
        return (
            f"No position error is predicted {frame}: nothing of the robot was fitted."
        )
    rms = value(accuracy.rms_m, accuracy.rms_bound_m)
    worst = value(accuracy.worst_m, accuracy.worst_bound_m)
    text = (
        f"Predicted position error of the corrected robot {frame}: {rms} RMS over {accuracy.region} "
        f"({accuracy.poses}), {worst} at the worst of them; the tracker's noise is not in it."
    )
    if accuracy.left_out:
        names = ", ".join(accuracy.left_out)
        text += f" {millimetres(accuracy.left_out_m)} of it stand for {names}, which no command contains."
    # What rounds to nothing is not said.
    if round(accuracy.form_m, 6):
        why = (
            "validation poses were missed by more than the fit says"
            if accuracy.contradicted
            else "other models fit as well"
        )
        text += f" {millimetres(accuracy.form_m)} of it stand for the form of the model: {why}."
    return text


def tabulate_errors(verdict: Mapping[str, Any]) -> list[list[str]]:
    """How far the robot is off before and after its correction: one table, the same in
    report and certificate.

    What is measured and what is predicted, over which poses and in which frame, are
    different errors; each row says which. Columns: which RMS error, of the uncorrected
    robot, of the corrected one; no row where the data are at fault. `verdict`: contents
    of verdict.json.
    """
    if not verdict.get("accuracy"):
        return []
    heldout = verdict["heldout"]
    measured = "measured at validation poses, noise included, after the best placement of the base"
    stated = Accuracy(**verdict["accuracy"])
    before = millimetres(verdict["uncorrected_m"])
    return [
        [
            measured,
            millimetres(heldout["uncalibrated"]["rms_m"]),
            millimetres(heldout["delivered"]["rms_m"]),
        ],
        [
            f"predicted over {stated.region}, {FRAMES[stated.frame]}",
            before,
            millimetres(stated.rms_m),
        ],
    ]


def millimetres(length_m: float) -> str:
    """A length as it is printed, to the micrometre, so that one error has one form
    everywhere."""
    return f"{1e3 * length_m:.3f} mm"
