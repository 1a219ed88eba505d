"""Closed loop on the simulated robot: a robot with a hidden effect is measured,
diagnosed, commanded by the result and measured again.

Each wanted pose, which no model was fitted to, is commanded five times: as the robot
file describes the arm, by a calibration of the geometry alone, by the declared model
(geometry and joint compliances), by the model of the diagnosis, and by the simulated
robot itself, which leaves only noise and repeatability. The stated accuracy of the
corrected robot is compared with its true errors.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import calibrate_by_fit, compute_nominal_poses
from elastocal.application.compensation import find_joint_targets
from elastocal.application.frames import (
    BASE,
    ROBOT,
    Scope,
    compute_placement_columns,
    fit_placement,
    select_free_parameters,
)
from elastocal.application.verification import (
    CommandedTargets,
    compare_targets,
    compute_measured_errors,
)
from elastocal.campaigns.holdout import number_configurations
from elastocal.campaigns.measurements import name_joint_columns
from elastocal.campaigns.reading import read_robot
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import apply_regression, remove_gross_errors
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import declared_candidates, list_effects
from elastocal.exchange.target_path import OK
from elastocal.fitting.model import build_declared_model
from elastocal.fitting.noise import fit_declared_model
from elastocal.fitting.observations import select_states
from elastocal.io.data_frames import read_frame, write_csv
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import write_table
from elastocal.loop.whole import build_calibrated_robot, read_cases
from elastocal.mechanics.kinematics import compute_jacobians, compute_pose_differences
from elastocal.random_streams import open_stream
from elastocal.validation.conformity import decide_conformity
from elastocal_proof.blind import schemas
from elastocal_proof.blind.folders import Experiment, write_blind_campaign
from elastocal_proof.blind.rehearsal import (
    ERRORS_OF_GEOMETRY,
    build_hidden_robot,
    draw_milling_path,
    misplace_base,
    move_robot,
)
from elastocal_proof.blind.scores import compute_rate
from elastocal_proof.plant.campaigns import (
    Blunder,
    Design,
    Table,
    add_blunders,
    draw_schedule,
    get_typical_force_N,
)
from elastocal_proof.plant.kinds import KINDS
from elastocal_proof.plant.simulated_robot import open_simulation_stream

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from typing import Any

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.mechanics.robot import Robot
    from elastocal_proof.plant.simulated_robot import SimulatedRobot

UNCORRECTED = "uncorrected"
GEOMETRY = "geometry"
DECLARED = "declared"
DIAGNOSED = "found"
PLANT = "true"
MODELS = (UNCORRECTED, GEOMETRY, DECLARED, DIAGNOSED, PLANT)
UNLOADED = "unloaded"
LOADED = "loaded"
MILLING = "milling"
PARTS = (UNLOADED, LOADED, MILLING)
# An accuracy is stated for the random poses, without and with load together, and for
# the path.
STATED_PARTS = {"random": (UNLOADED, LOADED), MILLING: (MILLING,)}
# Wanted poses of each random part, and of the path.
_POSES = 40
_PATH = 60
# Share of the joint ranges that a cell uses, in which random poses are drawn.
_RANGE_SHARE = 0.8
# Milling force over the usual force, and length of the path over the reach of the arm:
# 0.5 m on an arm of 2.5 m.
_MILLING_SHARE = 0.5
_PATH_SHARE = 0.2
# Newton steps on the simulated robot; each reduces the error at least a hundredfold.
_STEPS = 5
CAMPAIGN = Design(declared=ERRORS_OF_GEOMETRY)
# Range of tolerances, uniform on a logarithmic scale. Shop floors ask for such
# tolerances, and only some of the robots meet them.
_TOLERANCES_M = (1.5e-5, 6e-5)
_RISK = 0.05
_REPLICATES = 2000
# Goal if the effect was named: at most this ratio of the RMS error to that of the
# simulated robot's own model.
GOAL = 1.2
_CASE = ["robot", "effect", "seed"]
# Verdicts with a single model of the robot.
_ONE_MODEL = ("named", "adequate")
_STATED = ("rms_m", "rms_bound_m", "worst_m", "worst_bound_m", "form_m", "left_out_m")


@dataclass(frozen=True)
class WantedPoses:
    """Poses that a robot shall reach.

    Attributes
    ----------
    part : (N,) array of str
        Part of the test, of `PARTS`.
    position, rotation : (N, 3) and (N, 3, 3) arrays
        Poses of the end effector, m, base axes.
    wrench : (N, 6) array
        Load at each pose.
    start : (N, n) array
        Reported joint angles of the rigid robot, rad.
    """

    part: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    wrench: np.ndarray
    start: np.ndarray


@dataclass(frozen=True)
class DiagnosedRobot:
    """A robot with one hidden effect, after its diagnosis.

    Attributes
    ----------
    plant : SimulatedRobot
        The simulated robot.
    training, held_out : Case
        Fitted and held-out measurements.
    diagnosis : Diagnosis
        Diagnosis of the fitted measurements.
    wanted : WantedPoses
        Poses that the robot shall reach.
    """

    plant: SimulatedRobot
    training: Case
    held_out: Case
    diagnosis: Diagnosis
    wanted: WantedPoses


class _Commands(NamedTuple):
    """Commands for the wanted poses.

    Attributes
    ----------
    angles : (N, n) array
        Reported joint angles, rad.
    predicted_std_m : (N,) array
        RMS errors that the model states.
    corrected : (N,) bool array
        Whether the pose could be corrected.
    """

    angles: np.ndarray
    predicted_std_m: np.ndarray
    corrected: np.ndarray


def list_hidden_effects(
    robot_file: str | Path, seed: int, each: int
) -> Iterator[tuple[str, int]]:
    """List hidden effects and seeds of all cases on one robot, `each` cases per effect.

    The effects move the robot, are possible on this arm and need no covariate, because
    a path states none, such as the approach direction.
    """
    arm = build_hidden_robot(robot_file, seed)[0].arm
    catalogue = list_effects()
    for effect, kind in sorted(KINDS.items()):
        if (
            effect not in catalogue
            or effect in ERRORS_OF_GEOMETRY
            or not catalogue[effect].moves_robot
            or kind.needs
            or not kind.locations(arm)
        ):
            continue
        for number in range(each):
            purpose = f"closed loop {Path(robot_file).stem} {effect} {number}"
            yield effect, int(open_simulation_stream(seed, purpose).integers(2**31))


def measure_robot(
    robot_file: Path,
    effect: str,
    seed: int,
    *,
    frame: str = "base",
    slips: bool = False,
) -> DiagnosedRobot:
    """Measure and diagnose one robot.

    Parameters
    ----------
    robot_file : path
        Robot file of which the robot is a specimen.
    effect : str
        Hidden effect, of plausible size at a joint that is drawn. The robot also has
        errors of geometry, gears and weights.
    seed : int
        Seed of the robot, of its measurements and of its diagnosis.
    frame : str
        "base" or "tracker": frame of the measurements.
    slips : bool
        Whether the base is slightly tilted against its declaration and the beam was
        lost in one fitted row.
    """
    plant = build_hidden_robot(robot_file, seed, [effect])[0]
    if slips:
        plant = misplace_base(plant, seed)
    design = replace(CAMPAIGN, frame=frame)
    experiment = Experiment(plant, design, draw_schedule(plant.arm, design, seed))
    with tempfile.TemporaryDirectory() as folder:
        write_blind_campaign(
            folder,
            "closed_loop",
            robot_file,
            experiment,
            plant.arm.masses,
            partial(_lose_beam, experiment) if slips else None,
        )
        training, held_out = read_cases(folder, robot_file.parent)
    diagnosis = diagnose(training, Settings(), seed)
    wanted = draw_wanted_poses(training.campaign.robot, plant, seed)
    return DiagnosedRobot(plant, training, held_out, diagnosis, wanted)


def _lose_beam(experiment: Experiment, table: Table) -> tuple[Table, list[Blunder]]:
    """Lose the beam of the tracker in one row of the fitted poses."""
    design = experiment.design
    schedule = experiment.schedule
    draws = open_simulation_stream(schedule.seed, "lost beam")
    kind = str(draws.choice(["zeros", "held_point"]))
    while True:
        damaged, slips = add_blunders(table, experiment.robot, schedule, kind, 1, draws)
        if table["pose"][slips[0]["rows"][0]] < design.poses - design.held_out:
            return damaged, slips


def draw_wanted_poses(robot: Robot, plant: SimulatedRobot, seed: int) -> WantedPoses:
    """Draw the poses that a robot shall reach: random ones without and under load, and
    a milling path."""
    draws = open_simulation_stream(seed, "wanted poses")
    low, high = robot.joint_limits.T
    shares = draws.random((2 * _POSES, robot.joints)) - 0.5
    angles = robot.reported_angles(low + (high - low) * (0.5 + _RANGE_SHARE * shares))
    random_poses = (*compute_nominal_poses(robot, angles), angles)
    load_direction = draws.standard_normal((_POSES, 3))
    load_direction /= np.linalg.norm(load_direction, axis=1, keepdims=True)
    path = draw_milling_path(robot, _PATH_SHARE * plant.arm.reach_m, _PATH, draws)
    feed = np.gradient(path[0], axis=0)
    feed /= np.linalg.norm(feed, axis=1, keepdims=True)
    # One half of the process force acts against the feed, the other half lifts the tool
    # off the workpiece.
    process_direction = -np.sqrt(0.5) * feed + np.sqrt(0.5) * np.array([0.0, 0.0, 1.0])
    force = get_typical_force_N(plant.arm)
    forces = [
        np.zeros((_POSES, 3)),
        force * load_direction,
        force * _MILLING_SHARE * process_direction,
    ]
    return WantedPoses(
        np.repeat(PARTS, (_POSES, _POSES, _PATH)),
        np.concatenate([random_poses[0], path[0]]),
        np.concatenate([random_poses[1], path[1]]),
        np.pad(np.concatenate(forces), ((0, 0), (0, 3))),
        np.concatenate([random_poses[2], path[2]]),
    )


def run_closed_loop(
    robot_file: Path, effect: str, seed: int, *, slips: bool = False
) -> dict[str, np.ndarray]:
    """Run the loop for one robot, from its campaign to measurements of its corrected
    targets.

    Parameters
    ----------
    robot_file, effect, seed, slips
        As for `measure_robot`; the measurements are in the base frame.

    Returns
    -------
    dict
        One row for each wanted pose and model, with the columns of
        `schemas.CLOSED_LOOP`.
    """
    robot = measure_robot(robot_file, effect, seed, slips=slips)
    diagnosis = robot.diagnosis
    wanted = robot.wanted
    count = len(wanted.part)
    declared_robot = robot.training.campaign.robot
    weightless = replace(declared_robot, masses=())
    geometry = calibrate_by_fit(_fit_geometry(robot.training, diagnosis), weightless)
    declared = calibrate_by_fit(diagnosis.declared, declared_robot)
    commands = {
        UNCORRECTED: _Commands(wanted.start, np.zeros(count), np.ones(count, bool)),
        GEOMETRY: _correct(geometry, wanted),
        DECLARED: _correct(declared, wanted),
        DIAGNOSED: _correct(_calibrate(robot, seed), wanted),
        PLANT: _correct_by_plant(robot, seed),
    }
    verdict = diagnosis.verdict
    case: dict[str, Any] = {
        "effect": effect,
        "seed": seed,
        "verdict": verdict.verdict,
        "named": any(
            entry.name == effect and entry.adopted for entry in verdict.effects
        ),
    }
    rows = [
        case
        | _measure_again(robot, model_commands.angles, seed)
        | {
            "model": model,
            "predicted_std_m": model_commands.predicted_std_m,
            "corrected": model_commands.corrected,
        }
        for model, model_commands in commands.items()
    ]
    columns = {}
    for name in rows[0]:
        values = [np.broadcast_to(row[name], count) for row in rows]
        columns[name] = np.concatenate(values)
    return columns


def _calibrate(robot: DiagnosedRobot, seed: int) -> CalibratedRobot:
    """Return the robot as its diagnosis corrects it."""
    diagnosis = robot.diagnosis
    held_out = remove_gross_errors(diagnosis, robot.held_out)[1]
    delivered = apply_regression(diagnosis, held_out, seed)
    return build_calibrated_robot(diagnosis, held_out, delivered)


def _fit_geometry(case: Case, diagnosis: Diagnosis) -> Fit:
    """Calibrate the geometry alone: fit a rigid arm to the measurements without a load
    other than its weight."""
    campaign = case.campaign
    robot = campaign.robot
    rigid = replace(robot, masses=(), compliance=np.zeros(robot.joints))
    bare = build_declared_model(replace(campaign, robot=rigid, compliance="nominal"))
    model = bare.with_effects(
        declared_candidates(campaign.declared, bare.sites, "closed loop")
    )
    unloaded = np.asarray(~case.observations.states.wrench.any(axis=1))
    return fit_declared_model(
        model, select_states(case.observations, unloaded), diagnosis.declared.noise
    )


def _correct(model: CalibratedRobot, wanted: WantedPoses) -> _Commands:
    """Correct the commands by a model."""
    targets = find_joint_targets(
        model, wanted.position, wanted.rotation, wanted.wrench, wanted.start
    )
    prediction = predict_errors(model, targets.joint_angles, wanted.wrench, draws=0)
    return _Commands(targets.joint_angles, prediction.error_m, targets.status == OK)


def _correct_by_plant(robot: DiagnosedRobot, seed: int) -> _Commands:
    """Correct the commands by Newton's method on the simulated robot without its random
    errors; it states no error."""
    declared = robot.training.campaign.robot
    wanted = robot.wanted
    deterministic = replace(robot.plant, repeatability_rad=())
    angles = wanted.start.copy()
    inverse = np.linalg.pinv(
        compute_jacobians(
            declared.chain, declared.model_angles(angles), declared.chain.end_effector
        )
    )

    def compute_pose_errors() -> np.ndarray:
        poses = move_robot(deterministic, angles, wanted.wrench, seed)
        return compute_pose_differences(wanted.position, wanted.rotation, *poses)

    for _ in range(_STEPS):
        steps = (inverse @ compute_pose_errors()[..., None])[..., 0]
        angles = declared.reported_angles(declared.model_angles(angles) + steps)
    remaining_m = np.linalg.norm(compute_pose_errors()[:, :3], axis=1)
    return _Commands(angles, np.zeros(len(angles)), remaining_m < 1e-6)


def _measure_again(
    robot: DiagnosedRobot, angles: np.ndarray, seed: int
) -> dict[str, Any]:
    """Command the robot, with new random errors, and measure it."""
    wanted = robot.wanted
    position, rotation = move_robot(robot.plant, angles, wanted.wrench, seed + 1)
    measured, _ = robot.plant.tracker.read(
        position[:, None],
        rotation[:, None],
        open_simulation_stream(seed, "measured again"),
    )
    return {
        "part": wanted.part,
        "pose": np.arange(len(wanted.part)),
        **name_joint_columns(angles),
        "reached_error_m": np.linalg.norm(position - wanted.position, axis=1),
        "measured_error_m": np.linalg.norm(measured[:, 0] - wanted.position, axis=1),
    }


def compare_stated_accuracy(
    robot_file: Path, effect: str, seed: int, frame: str
) -> list[dict[str, Any]]:
    """Compare the stated accuracy of one corrected robot with its true errors.

    Parameters
    ----------
    robot_file, effect, seed, frame
        As for `measure_robot`. If the campaign did not know the base frame, errors are
        counted after the best rigid placement over the random poses.

    Returns
    -------
    list of dict
        For each of `STATED_PARTS` the predicted error, its bounds, the decision about
        a tolerance, and the true error.
    """
    robot = measure_robot(robot_file, effect, seed, frame=frame)
    wanted = robot.wanted
    calibrated = _calibrate(robot, seed)
    commands = find_joint_targets(
        calibrated, wanted.position, wanted.rotation, wanted.wrench, wanted.start
    )
    angles = commands.joint_angles
    corrected = commands.status == OK
    moved = _move_and_measure(robot, angles, seed)
    errors = moved.position - wanted.position
    if frame != "base":
        random_poses = corrected & (wanted.part != MILLING)
        errors = _subtract_placement(wanted, errors, random_poses)
    tolerance_m = _draw_tolerance_m(seed)
    rows = []
    for part in STATED_PARTS:
        chosen = corrected & np.isin(wanted.part, STATED_PARTS[part])
        prediction = predict_errors(calibrated, angles[chosen], wanted.wrench[chosen])
        accuracy = prediction.summarize(part)
        distance = np.linalg.norm(errors[chosen], axis=1)
        rows.append(
            {
                "robot": robot_file.stem,
                "effect": effect,
                "seed": seed,
                "frame": frame,
                "part": part,
                "verdict": robot.diagnosis.verdict.verdict,
                "poses": accuracy.poses,
                **{name: getattr(accuracy, name) for name in _STATED},
                "true_rms_m": float(np.sqrt((distance**2).mean())),
                "true_worst_m": float(distance.max()),
                "tolerance_m": tolerance_m,
                "decision": decide_conformity(
                    prediction.rms_m, tolerance_m, _RISK
                ).decision,
            }
            | _verify(calibrated, wanted, moved, chosen, tolerance_m)
        )
    return rows


def _draw_tolerance_m(seed: int) -> float:
    """Draw the tolerance that a case must keep, m."""
    stream = open_simulation_stream(seed, "tolerance")
    return float(np.exp(stream.uniform(*np.log(_TOLERANCES_M))))


@dataclass(frozen=True)
class _Moved:
    """Where the simulated robot came to rest at N commands.

    Attributes
    ----------
    angles : (N, n) array
        Commands, rad.
    position, measured : (N, 3) arrays
        Reached and measured positions, m, base axes.
    """

    angles: np.ndarray
    position: np.ndarray
    measured: np.ndarray


def _move_and_measure(robot: DiagnosedRobot, angles: np.ndarray, seed: int) -> _Moved:
    """Command the robot, with new random errors, and measure it."""
    position, rotation = move_robot(robot.plant, angles, robot.wanted.wrench, seed + 1)
    stream = open_simulation_stream(seed, "verification")
    measured, _ = robot.plant.tracker.read(position[:, None], rotation[:, None], stream)
    return _Moved(angles, position, measured[:, 0])


def _verify(
    calibrated: CalibratedRobot,
    wanted: WantedPoses,
    moved: _Moved,
    chosen: np.ndarray,
    tolerance_m: float,
) -> dict[str, Any]:
    """Verify a corrected robot as `elastocal verify` does, and state its true error in
    the same frame; `chosen` are the poses that are verified, (N,) of bool."""
    targets = _collect_targets(wanted, moved, chosen)
    reached = replace(targets, measured=moved.position[chosen])
    offset_m = (0.0, 0.0, 0.0)
    comparison = compare_targets(calibrated, targets, offset_m)
    true_errors = compute_measured_errors(
        reached, offset_m, base_known=calibrated.scope.frame == BASE
    )
    measured_rms_m = comparison.measured_rms_m
    decision = decide_conformity(measured_rms_m, tolerance_m, _RISK)
    return {
        "prediction_held": comparison.prediction.held,
        "verified_true_rms_m": float(np.sqrt(true_errors.mean_square)),
        "verified_bound_m": float(np.quantile(measured_rms_m, 1.0 - _RISK)),
        "verified_decision": decision.decision,
    }


def _collect_targets(
    wanted: WantedPoses, moved: _Moved, chosen: np.ndarray
) -> CommandedTargets:
    """Collect some measured targets; errors that were stated for single ones are not
    compared."""
    angles = moved.angles[chosen]
    count = len(angles)
    not_stated = np.full(count, np.nan)
    return CommandedTargets(
        usable=np.ones(count, bool),
        joint_angles=angles,
        wrench=wanted.wrench[chosen],
        position=wanted.position[chosen],
        rotation=wanted.rotation[chosen],
        before_m=not_stated,
        after_m=not_stated,
        bound_m=not_stated,
        number=np.arange(1, count + 1),
        measured=moved.measured[chosen],
        repeats=np.ones(count, int),
        configuration=number_configurations(angles, np.arange(count)),
    )


def _subtract_placement(
    wanted: WantedPoses, errors: np.ndarray, fitted: np.ndarray
) -> np.ndarray:
    """Subtract the base placement that fits the position errors (N, 3) of some poses
    best, `fitted` (N,) bool, from the errors of all poses."""
    scope = Scope(ROBOT, wanted.position[fitted].mean(axis=0))
    columns = compute_placement_columns(scope, wanted.position, wanted.rotation)
    field = np.concatenate([errors, np.zeros_like(errors)], axis=1)[..., None]
    free = select_free_parameters(base=True, offset=False)
    placement = fit_placement(columns[fitted], field[fitted], free)
    residual: np.ndarray = (field - columns @ placement)[:, :3, 0]
    return residual


def close_loop(job: Any) -> None:
    """Run all cases of the closed loop on one robot, into one table."""
    robot = Path(job.input.robot)
    params = job.params
    blocks = (
        run_closed_loop(robot, *case, slips=params.slips)
        for case in list_hidden_effects(robot, params.seed, params.each)
    )
    write_table(
        job.output.moved,
        schemas.CLOSED_LOOP.for_joints(read_robot(robot).joints),
        blocks,
        describe_provenance(params, **job.wildcards),
    )


def state_accuracy(job: Any) -> None:
    """Compare stated with true accuracies for all cases on one robot."""
    robot = Path(job.input.robot)
    frame = job.wildcards.frame
    rows = [
        row
        for case in list_hidden_effects(robot, job.params.seed, job.params.each)
        for row in compare_stated_accuracy(robot, *case, frame)
    ]
    write_csv(job.output.stated, pd.DataFrame(rows))


def compute_case_errors(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Compute the RMS errors of each case and part.

    Poses that some model could not correct are left out for all models.

    Parameters
    ----------
    tables : mapping
        Rows of `run_closed_loop`, by robot.

    Returns
    -------
    DataFrame
        Measured RMS error of each model (m); the same as the robot reached it, without
        the tracker's noise (``.._reached``); ``over_floor``, the error of the diagnosed
        model over that of the simulated robot's own; and ``calibration``, mean square
        error reached over mean square predicted.
    """
    frame = pd.concat(
        [table.assign(robot=robot) for robot, table in tables.items()],
        ignore_index=True,
    )
    pose = frame.groupby([*_CASE, "part", "pose"])
    frame = frame[pose["corrected"].transform("all")]
    columns = ["measured_error_m", "reached_error_m", "predicted_std_m"]
    keys = [frame[name] for name in (*_CASE, "verdict", "named", "part", "model")]
    means = (frame[columns] ** 2).groupby(keys).mean().unstack("model")
    measured, reached, predicted = (means[name] for name in columns)
    errors = np.sqrt(measured[[*MODELS]]).join(
        np.sqrt(reached[[*MODELS]]).add_suffix("_reached")
    )
    errors = errors.assign(
        calibration=reached[DIAGNOSED] / predicted[DIAGNOSED],
        over_floor=errors[DIAGNOSED] / errors[PLANT],
    )
    return errors.rename_axis(columns=None).reset_index()


def summarize_errors(errors: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Summarize `compute_case_errors`, with 95 % limits by a bootstrap over cases.

    Returns one row for each robot (and "all"), part and model; ``reached_mm`` is
    without the tracker's noise.
    """
    rows = []
    for robot, part in product((*dict.fromkeys(errors["robot"]), "all"), PARTS):
        of_robot = (errors["robot"] == robot) | (robot == "all")
        selected = errors[(errors["part"] == part) & of_robot]
        cases = len(selected)
        draws = open_stream(seed, robot, f"closed loop {part}", 0).integers(
            cases, size=(_REPLICATES, cases)
        )
        floor, floor_replicates = _bootstrap_rms(selected[PLANT], draws)
        for model in MODELS:
            rms, replicates = _bootstrap_rms(selected[model], draws)
            reached, reached_replicates = _bootstrap_rms(
                selected[f"{model}_reached"], draws
            )
            ratios = replicates / floor_replicates
            rows.append(
                {"robot": robot, "part": part, "model": model, "cases": cases}
                | _limit("rms_mm", 1e3 * rms, 1e3 * replicates)
                | _limit("over_floor", rms / floor, ratios)
                | _limit("reached_mm", 1e3 * reached, 1e3 * reached_replicates)
            )
    return pd.DataFrame(rows)


def _bootstrap_rms(values: pd.Series, draws: np.ndarray) -> tuple[float, np.ndarray]:
    """Compute the root mean square of values (N,), and of their resamples by `draws`
    (R, N)."""
    squares = values.to_numpy() ** 2
    return float(np.sqrt(squares.mean())), np.sqrt(squares[draws].mean(axis=1))


def _limit(name: str, value: float, replicates: np.ndarray) -> dict[str, float]:
    """Describe a value with its 95 % percentile interval."""
    low, high = np.quantile(replicates, [0.025, 0.975])
    return {name: float(value), f"{name}_low": float(low), f"{name}_high": float(high)}


def count_cases_within_goal(errors: pd.DataFrame) -> pd.DataFrame:
    """Count the cases of `compute_case_errors` within `GOAL` of the floor, by part and
    by whether the effect was named.

    Shares have 95 % limits [1]_; there are also the medians of ``over_floor`` and of
    ``calibration``.

    References
    ----------
    .. [1] Wilson, E. B., Probable inference, the law of succession, and statistical
       inference, Journal of the American Statistical Association 22, 1927.
    """
    rows = []
    for part, named in product(PARTS, (True, False)):
        selected = errors[(errors["part"] == part) & (errors["named"] == named)]
        cases = len(selected)
        if not cases:
            continue
        within = int((selected["over_floor"] <= GOAL).sum())
        low, high = proportion_confint(within, cases, method="wilson")
        rows.append(
            {
                "part": part,
                "named": named,
                "cases": cases,
                "within": within,
                "share": within / cases,
                "share_low": low,
                "share_high": high,
                "median_over_floor": selected["over_floor"].median(),
                "median_calibration": selected["calibration"].median(),
            }
        )
    return pd.DataFrame(rows)


def compute_coverage(rows: pd.DataFrame) -> pd.DataFrame:
    """Count how often the true error is below its stated bound, and how often it
    contradicts a decision.

    Parameters
    ----------
    rows : DataFrame
        Rows of `compare_stated_accuracy`.

    Returns
    -------
    DataFrame
        One row for each frame (and all), part, kind of verdict (and all) and question,
        with Clopper-Pearson intervals and the root of the ratio of mean true to mean
        predicted squares.
    """
    one_model = rows["verdict"].isin(_ONE_MODEL)
    verdicts = {
        "one model": one_model,
        "several, class, unexplained": ~one_model,
        "all": rows["verdict"].notna(),
    }
    questions = _answer_questions(rows)
    counts = []
    for frame, part, verdict in product(
        ("base", "tracker", "all"), STATED_PARTS, verdicts
    ):
        of_frame = (rows["frame"] == frame) | (frame == "all")
        selected = verdicts[verdict] & (rows["part"] == part) & of_frame
        squares = rows.loc[selected, ["true_rms_m", "rms_m"]] ** 2
        ratio = np.sqrt(squares["true_rms_m"].mean() / squares["rms_m"].mean())
        for question, (concerned, hits) in questions.items():
            rate = compute_rate(hits[selected & concerned])
            counts.append(
                {
                    "frame": frame,
                    "part": part,
                    "verdict": verdict,
                    "question": question,
                    "cases": rate["cases"],
                    "hits": rate["hits"],
                    "share": rate["hits"] / max(rate["cases"], 1),
                    "low": rate["low"],
                    "high": rate["high"],
                    "true_over_predicted": float(ratio),
                }
            )
    return pd.DataFrame(counts)


def _answer_questions(
    rows: pd.DataFrame,
) -> dict[str, tuple[pd.Series[bool], pd.Series[bool]]]:
    """The rows that each question of the coverage concerns, and those that count as
    hits."""
    all_rows = rows["verdict"].notna()
    within = rows["true_rms_m"] <= rows["tolerance_m"]
    return {
        "rms below its 95 % bound": (
            all_rows,
            rows["true_rms_m"] <= rows["rms_bound_m"],
        ),
        "worst below its 95 % bound": (
            all_rows,
            rows["true_worst_m"] <= rows["worst_bound_m"],
        ),
        "pass that the truth denies": (rows["decision"] == "pass", ~within),
        "fail that the truth denies": (rows["decision"] == "fail", within),
        "prediction called wrong": (all_rows, ~rows["prediction_held"].astype(bool)),
        "rms below its 95 % bound as measured": (
            all_rows,
            rows["verified_true_rms_m"] <= rows["verified_bound_m"],
        ),
        "pass as measured that the truth denies": (
            rows["verified_decision"] == "pass",
            rows["verified_true_rms_m"] > rows["tolerance_m"],
        ),
    }


def summarize_closed_loop(job: Any) -> None:
    """Tabulate the errors of the closed loop by case, and together with intervals."""
    tables = {}
    for robot, table_path, robot_file in zip(
        job.params.robots, job.input.moved, job.input.robots, strict=True
    ):
        joints = read_robot(Path(robot_file)).joints
        schema = schemas.CLOSED_LOOP.for_joints(joints)
        tables[robot] = read_frame(table_path, schema)
    errors = compute_case_errors(tables)
    write_csv(job.output.errors, errors)
    write_csv(job.output.summary, summarize_errors(errors, job.params.seed))
    write_csv(job.output.goals, count_cases_within_goal(errors))


def tabulate_coverage(job: Any) -> None:
    """Tabulate stated and true accuracies of all cases, and their coverage."""
    rows = pd.concat(
        [pd.read_csv(path) for path in job.input.stated], ignore_index=True
    )
    write_csv(job.output.cases, rows)
    write_csv(job.output.coverage, compute_coverage(rows))
