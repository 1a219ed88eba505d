"""The loop closed on the plant: a robot with a hidden defect is measured, diagnosed,
commanded by the result, measured again.

Each wanted pose, which nobody's model has seen, is commanded five times: as the robot
file has the arm, by a calibration of the geometry alone, by the declared model
(geometry and springs), by the model that the diagnosis found, and by the plant itself,
which leaves noise and repeatability. Beside it stands what is stated of the corrected
robot's accuracy.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from elastocal.application.accuracy import predict_errors
from elastocal.application.calibrated import calibrate_by_fit, compute_nominal_poses
from elastocal.application.compensation import find_joint_targets
from elastocal.application.frames import (
    ROBOT,
    Scope,
    compute_placement_columns,
    fit_placement,
)
from elastocal.campaigns.reading import read_robot
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import apply_regression, remove_gross_errors
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import declared_candidates
from elastocal.effects.catalogue import list_effects as catalogue
from elastocal.exchange.target_path import OK
from elastocal.fitting.model import build_declared_model
from elastocal.fitting.noise import fit_declared_model
from elastocal.fitting.observations import select_states
from elastocal.io.data_frames import read_frame, write_csv
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import write_table
from elastocal.loop.whole import build_calibrated_robot, read_cases
from elastocal.mechanics.kinematics import compute_jacobians, compute_pose_differences
from elastocal.random_streams import open_stream as analysis_stream
from elastocal.validation.conformity import decide_conformity
from elastocal_proof.blind import schemas
from elastocal_proof.blind.folders import write_blind_campaign
from elastocal_proof.blind.rehearsal import (
    ERRORS_OF_GEOMETRY,
    build_hidden_robot,
    draw_milling_path,
    misplace_base,
    move_robot,
)
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
# Of what an accuracy is stated: random poses without and with load together, and a
# path.
STATED_PARTS = {"random": (UNLOADED, LOADED), MILLING: (MILLING,)}
# Wanted poses of each part.
_POSES = 40
_PATH = 60
# Share of the joint limits from which they are drawn: what a cell uses.
_REACH = 0.8
# Of the force of milling over the usual one, and of its path over the reach of the arm:
# 0.5 m on one of 2.5 m.
_MILLING_SHARE = 0.5
_PATH_SHARE = 0.2
# Newton's steps on the plant: each leaves a hundredth or less.
_STEPS = 5
CAMPAIGN = Design(declared=ERRORS_OF_GEOMETRY)
# Tolerances that a shop floor asks for, evenly on the logarithm: some robots keep them
# and some do not.
_TOLERANCES_M = (1.5e-5, 6e-5)
_RISK = 0.05
_REPLICATES = 2000
# The goal where the effect was named: so many times what the true model leaves.
GOAL = 1.2
_CASE = ["robot", "effect", "seed"]
# Verdicts under which one model stands for the robot.
_SETTLED = ("named", "adequate")
_STATED = ("rms_m", "rms_bound_m", "worst_m", "worst_bound_m", "form_m", "left_out_m")


@dataclass(frozen=True)
class WantedPoses:
    """Poses that a robot shall reach.

    `part` (N,) of str. `position`, `rotation` (N, 3), (N, 3, 3): m, base axes. `wrench`
    (N, 6). `start` (N, n): joint angles of the rigid robot, as the controller shows
    them, rad.
    """

    part: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    wrench: np.ndarray
    start: np.ndarray


@dataclass(frozen=True)
class DiagnosedRobot:
    """A robot with one hidden defect, as its analyst knows it, what was fitted and what
    was not, and what it shall reach."""

    plant: SimulatedRobot
    declared: Robot
    training: Case
    held_out: Case
    found: Diagnosis
    wanted: WantedPoses


def list_hidden_effects(
    robot_file: str | Path, seed: int, each: int
) -> Iterator[tuple[str, int]]:
    """Hidden effects and seeds of all cases on one robot, `each` of every effect that
    the loop can be closed with.

    These move the robot, need no covariate, such as the approach, which no path states,
    and can be on this arm.
    """
    arm = build_hidden_robot(robot_file, seed)[0].arm
    known = catalogue()
    for effect, kind in sorted(KINDS.items()):
        moves = (
            effect in known
            and known[effect].moves_robot
            and not kind.needs
            and kind.locations(arm)
        )
        for number in range(each if moves and effect not in ERRORS_OF_GEOMETRY else 0):
            yield (
                effect,
                int(
                    open_simulation_stream(
                        seed, f"closed loop {Path(robot_file).stem} {effect} {number}"
                    ).integers(2**31)
                ),
            )


def measure_robot(
    robot_file: Path, effect: str, seed: int, frame: str = "base", slips: bool = False
) -> DiagnosedRobot:
    """Measure and diagnose one robot.

    `effect`: hidden, of plausible size at a joint that is drawn, beside errors of
    geometry, gears and weights. `slips`: whether the base is a little tilted against
    where it is declared, and the beam was lost in one fitted row.
    """
    plant = build_hidden_robot(robot_file, seed, [effect])[0]
    design = replace(CAMPAIGN, frame=frame)
    draws = open_simulation_stream(seed, "lost beam")
    if slips:
        plant = misplace_base(plant, seed)
    schedule = draw_schedule(plant.arm, design, seed)

    def lost(table: Table) -> tuple[Table, list[Blunder]]:
        kind = str(draws.choice(["zeros", "held_point"]))
        fitted = design.poses - design.held_out
        tries = iter(lambda: add_blunders(table, plant, schedule, kind, 1, draws), None)
        return next(
            (bad, slip)
            for bad, slip in tries
            if table["pose"][slip[0]["rows"][0]] < fitted
        )

    with tempfile.TemporaryDirectory() as folder:
        slipped = lost if slips else None
        write_blind_campaign(
            folder,
            "closed_loop",
            robot_file,
            plant,
            design,
            schedule,
            plant.arm.masses,
            slipped,
        )
        training, held_out = read_cases(folder, robot_file.parent)
    robot = training.campaign.robot
    return DiagnosedRobot(
        plant,
        robot,
        training,
        held_out,
        diagnose(training, Settings(), seed),
        draw_wanted_poses(robot, plant, seed),
    )


def draw_wanted_poses(robot: Robot, plant: SimulatedRobot, seed: int) -> WantedPoses:
    """Poses of all parts that a robot shall reach: random ones without and under load,
    and a path of milling."""
    draws = open_simulation_stream(seed, "wanted poses")
    low, high = robot.joint_limits.T
    force = get_typical_force_N(plant.arm)
    angles = low + (high - low) * (
        0.5 + _REACH * (draws.random((2 * _POSES, robot.joints)) - 0.5)
    )
    shown = robot.reported_angles(angles)
    direction = draws.standard_normal((_POSES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    path = draw_milling_path(robot, _PATH_SHARE * plant.arm.reach_m, _PATH, draws)
    along = np.gradient(path[0], axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # Half against the feed and the rest upwards off the part.
    process = (
        force
        * _MILLING_SHARE
        * (-np.sqrt(0.5) * along + np.sqrt(0.5) * np.array([0.0, 0.0, 1.0]))
    )
    forces = np.concatenate([np.zeros((_POSES, 3)), force * direction, process])
    random = (*compute_nominal_poses(robot, shown), shown)
    position, rotation, start = (
        np.concatenate(both) for both in zip(random, path, strict=True)
    )
    part = np.repeat(PARTS, (_POSES, _POSES, _PATH))
    return WantedPoses(
        part, position, rotation, np.pad(forces, ((0, 0), (0, 3))), start
    )


def run_closed_loop(
    robot_file: Path, effect: str, seed: int, slips: bool = False
) -> dict[str, np.ndarray]:
    """One robot, from campaign to corrected targets that were measured; arguments as of
    `measure`, base declared.

    Returns one row for each wanted pose and model, columns as `schemas.build_closed_loop_schema` has
    them.
    """
    made = measure_robot(robot_file, effect, seed, slips=slips)
    robot, wanted, count = made.declared, made.wanted, len(made.wanted.part)
    models = {
        GEOMETRY: calibrate_by_fit(
            _geometry(made.training, made.found), replace(robot, masses=())
        ),
        DECLARED: calibrate_by_fit(made.found.declared, robot),
        DIAGNOSED: _corrected(made, seed),
    }
    # Commands, the errors that a model states, and whether a pose could be corrected.
    commanded = {UNCORRECTED: (wanted.start, np.zeros(count), np.ones(count, bool))}
    for name, model in models.items():
        targets = find_joint_targets(
            model, wanted.position, wanted.rotation, wanted.wrench, wanted.start
        )
        stated = predict_errors(
            model, targets.joint_angles, wanted.wrench, draws=0
        ).error_m
        commanded[name] = targets.joint_angles, stated, targets.status == OK
    commanded[PLANT] = _by_plant(made, seed)
    rows = [
        _moved(made, commands, seed)
        | {"model": name, "predicted_std_m": stated, "corrected": good}
        for name, (commands, stated, good) in commanded.items()
    ]
    named = effect in {
        entry["name"] for entry in made.found.document["effects"] if entry["adopted"]
    }
    head = {
        "effect": effect,
        "seed": seed,
        "verdict": made.found.document["verdict"],
        "named": named,
    }
    return {
        name: np.concatenate(
            [np.broadcast_to((head | row)[name], count) for row in rows]
        )
        for name in (*head, *rows[0])
    }


def _corrected(made: DiagnosedRobot, seed: int) -> CalibratedRobot:
    """The robot as the diagnosis corrects it."""
    part = remove_gross_errors(made.found, made.held_out)[1]
    return build_calibrated_robot(
        made.found, part, apply_regression(made.found, part, seed)
    )


def _geometry(case: Case, found: Diagnosis) -> Fit:
    """A calibration of the geometry alone: a rigid arm, fitted to where no load acts
    but its weight."""
    campaign = case.campaign
    rigid = replace(
        campaign.robot, masses=(), compliance=np.zeros(campaign.robot.joints)
    )
    bare = build_declared_model(replace(campaign, robot=rigid, compliance="nominal"))
    model = bare.with_effects(
        declared_candidates(campaign.declared, bare.sites, "closed loop")
    )
    unloaded = np.asarray(~case.observations.states.wrench.any(axis=1))
    return fit_declared_model(
        model, select_states(case.observations, unloaded), found.declared.noise
    )


def _by_plant(
    made: DiagnosedRobot, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Commands by Newton's method on the plant without its chance, which states no
    error, and whether they succeed."""
    robot = made.declared
    wanted = made.wanted
    certain = replace(made.plant, repeatability_rad=())
    commands = wanted.start.copy()
    inverse = np.linalg.pinv(
        compute_jacobians(
            robot.chain, robot.model_angles(commands), robot.chain.end_effector
        )
    )

    def off() -> np.ndarray:
        return compute_pose_differences(
            wanted.position,
            wanted.rotation,
            *move_robot(certain, commands, wanted.wrench, seed),
        )

    for _ in range(_STEPS):
        commands = robot.reported_angles(
            robot.model_angles(commands) + (inverse @ off()[..., None])[..., 0]
        )
    return (
        commands,
        np.zeros(len(commands)),
        np.linalg.norm(off()[:, :3], axis=1) < 1e-6,
    )


def _moved(made: DiagnosedRobot, commands: np.ndarray, seed: int) -> dict[str, Any]:
    """What the robot does with its commands, with chance of its own."""
    wanted = made.wanted
    position, rotation = move_robot(made.plant, commands, wanted.wrench, seed + 1)
    read, _ = made.plant.tracker.read(
        position[:, None],
        rotation[:, None],
        open_simulation_stream(seed, "measured again"),
    )
    return {
        "part": wanted.part,
        "pose": np.arange(len(wanted.part)),
        **{f"q{joint}": column for joint, column in enumerate(commands.T, 1)},
        "reached_error_m": np.linalg.norm(position - wanted.position, axis=1),
        "measured_error_m": np.linalg.norm(read[:, 0] - wanted.position, axis=1),
    }


def compare_stated_accuracy(
    robot_file: Path, effect: str, seed: int, frame: str
) -> list[dict[str, Any]]:
    """For each of `STATED_OF` what is predicted, bounded and decided of one corrected
    robot's error, and what the plant's is.

    In the base's frame where the campaign knew it, else after the best rigid placement
    over the random poses.
    """
    made = measure_robot(robot_file, effect, seed, frame)
    plant = made.plant
    wanted = made.wanted
    calibrated = _corrected(made, seed)
    targets = find_joint_targets(
        calibrated, wanted.position, wanted.rotation, wanted.wrench, wanted.start
    )
    good = targets.status == OK
    off = (
        move_robot(plant, targets.joint_angles, wanted.wrench, seed + 1)[0]
        - wanted.position
    )
    if frame != "base":
        over = good & (wanted.part != MILLING)
        columns = compute_placement_columns(
            Scope(ROBOT, wanted.position[over].mean(axis=0)),
            wanted.position,
            wanted.rotation,
        )
        field = np.concatenate([off, np.zeros_like(off)], axis=1)[..., None]
        off = (
            field
            - columns
            @ fit_placement(
                columns[over], field[over], np.repeat([True, True, False, False], 3)
            )
        )[:, :3, 0]
    tolerance = float(
        np.exp(
            open_simulation_stream(seed, "tolerance").uniform(*np.log(_TOLERANCES_M))
        )
    )
    rows = []
    for part, members in STATED_PARTS.items():
        mine = good & np.isin(wanted.part, members)
        prediction = predict_errors(
            calibrated, targets.joint_angles[mine], wanted.wrench[mine]
        )
        stated = prediction.summarize(part)
        distance = np.linalg.norm(off[mine], axis=1)
        decided = decide_conformity(prediction.rms_m, tolerance, _RISK)
        rows.append(
            {
                "robot": robot_file.stem,
                "effect": effect,
                "seed": seed,
                "frame": frame,
                "part": part,
            }
            | {"verdict": made.found.document["verdict"], "poses": stated.poses}
            | {name: getattr(stated, name) for name in _STATED}
            | {
                "true_rms_m": float(np.sqrt((distance**2).mean())),
                "true_worst_m": float(distance.max()),
            }
            | {"tolerance_m": tolerance, "decision": decided.decision}
        )
    return rows


def close_loop(job: Any) -> None:
    """All cases of the closed loop on one robot, as one table."""
    robot = Path(job.input.robot)
    asked = job.params
    blocks = (
        run_closed_loop(robot, *case, slips=asked.slips)
        for case in list_hidden_effects(robot, asked.seed, asked.each)
    )
    write_table(
        job.output.moved,
        schemas.build_closed_loop_schema(read_robot(robot).joints),
        blocks,
        describe_provenance(asked, **job.wildcards),
    )


def state_accuracy(job: Any) -> None:
    """What is stated of the accuracy of each robot of the closed loop, beside the
    truth."""
    robot = Path(job.input.robot)
    frame = job.wildcards.frame
    rows = [
        row
        for case in list_hidden_effects(robot, job.params.seed, job.params.each)
        for row in compare_stated_accuracy(robot, *case, frame)
    ]
    write_csv(job.output.stated, pd.DataFrame(rows))


def compute_case_errors(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """RMS errors of each case and part, of rows of `closed_loop` by robot.

    Columns: the measured RMS of each model (m), the same as the robot reached it,
    without the tracker's noise (``.._reached``), that of the model found over that of
    the true one (``over_floor``), and ``calibration``: mean square error reached over
    mean square predicted. Poses that some model could not correct are left out for all.
    """
    frame = pd.concat(
        [table.assign(robot=robot) for robot, table in tables.items()],
        ignore_index=True,
    )
    frame = frame[frame.groupby([*_CASE, "part", "pose"])["corrected"].transform("all")]
    key = [*_CASE, "verdict", "named", "part", "model"]
    columns = ["measured_error_m", "reached_error_m", "predicted_std_m"]
    means = (
        (frame[columns] ** 2)
        .groupby([frame[name] for name in key])
        .mean()
        .unstack("model")
    )
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
    """`case_errors` together, with 95 % limits by a bootstrap over cases: one row for
    each robot (and "all"), part and model.

    ``reached_mm`` is without the tracker's noise.
    """
    rows = []
    for robot in (*dict.fromkeys(errors["robot"]), "all"):
        for part in PARTS:
            mine = errors[
                (errors["part"] == part)
                & ((errors["robot"] == robot) | (robot == "all"))
            ]
            draws = analysis_stream(seed, robot, f"closed loop {part}", 0).integers(
                len(mine), size=(_REPLICATES, len(mine))
            )

            def drawn(
                name: str, mine: pd.DataFrame = mine, draws: np.ndarray = draws
            ) -> tuple[float, np.ndarray]:
                squares = mine[name].to_numpy() ** 2
                return float(np.sqrt(squares.mean())), np.sqrt(
                    squares[draws].mean(axis=1)
                )

            floor = drawn(PLANT)
            for model in MODELS:
                (rms, many), (reached, many_reached) = (
                    drawn(model),
                    drawn(f"{model}_reached"),
                )
                row = {"robot": robot, "part": part, "model": model, "cases": len(mine)}
                row |= _with_limits("rms_mm", 1e3 * rms, 1e3 * many)
                row |= _with_limits("over_floor", rms / floor[0], many / floor[1])
                rows.append(
                    row | _with_limits("reached_mm", 1e3 * reached, 1e3 * many_reached)
                )
    return pd.DataFrame(rows)


def count_cases_within_goal(errors: pd.DataFrame) -> pd.DataFrame:
    """How many of `case_errors` are within `GOAL` of the floor, by part, where the
    effect was named and where not.

    Shares with 95 % limits [1]; medians of ``over_floor`` and of ``calibration``.

    [1] Wilson, E. B., Probable inference, the law of succession, and statistical inference, Journal of the American Statistical
        Association 22, 1927.
    """
    rows = []
    for part in PARTS:
        for named in (True, False):
            mine = errors[(errors["part"] == part) & (errors["named"] == named)]
            if len(mine):
                within = int((mine["over_floor"] <= GOAL).sum())
                low, high = proportion_confint(within, len(mine), method="wilson")
                rows.append(
                    {"part": part, "named": named, "cases": len(mine), "within": within}
                    | {
                        "share": within / len(mine),
                        "share_low": low,
                        "share_high": high,
                    }
                    | {
                        f"median_{name}": mine[name].median()
                        for name in ("over_floor", "calibration")
                    }
                )
    return pd.DataFrame(rows)


def compute_coverage(rows: pd.DataFrame) -> pd.DataFrame:
    """How often the truth is below the bounds of `stated_accuracy`, and denies a
    decision, with Clopper-Pearson intervals.

    One row for each frame (and all), part, kind of verdict (and all) and question, with
    the root of mean true over mean predicted squares.
    """
    settled = rows["verdict"].isin(_SETTLED)
    always = rows["verdict"].notna()
    questions = {
        "rms below its 95 % bound": (always, rows["true_rms_m"] <= rows["rms_bound_m"]),
        "worst below its 95 % bound": (
            always,
            rows["true_worst_m"] <= rows["worst_bound_m"],
        ),
        "pass that the truth denies": (
            rows["decision"] == "pass",
            rows["true_rms_m"] > rows["tolerance_m"],
        ),
        "fail that the truth denies": (
            rows["decision"] == "fail",
            rows["true_rms_m"] <= rows["tolerance_m"],
        ),
    }
    found = []
    for frame in ("base", "tracker", "all"):
        for part in STATED_PARTS:
            for verdict, chosen in (
                ("one model", settled),
                ("several, class, unexplained", ~settled),
                ("all", always),
            ):
                mine = (
                    chosen
                    & (rows["part"] == part)
                    & ((rows["frame"] == frame) | (frame == "all"))
                )
                squares = [
                    (rows.loc[mine, name] ** 2).mean()
                    for name in ("true_rms_m", "rms_m")
                ]
                for question, (asked, hit) in questions.items():
                    cases = int((mine & asked).sum())
                    hits = int((mine & asked & hit).sum())
                    low, high = (
                        proportion_confint(hits, cases, method="beta")
                        if cases
                        else (0.0, 1.0)
                    )
                    found.append(
                        {
                            "frame": frame,
                            "part": part,
                            "verdict": verdict,
                            "question": question,
                            "cases": cases,
                            "hits": hits,
                        }
                        | {"share": hits / max(cases, 1), "low": low, "high": high}
                        | {
                            "true_over_predicted": float(
                                np.sqrt(squares[0] / squares[1])
                            )
                        }
                    )
    return pd.DataFrame(found)


def _with_limits(name: str, value: float, drawn: np.ndarray) -> dict[str, float]:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return {name: float(value), f"{name}_low": float(low), f"{name}_high": float(high)}


def summarize_closed_loop(job: Any) -> None:
    """Errors of the closed loop: by case, and together with intervals."""
    joints = [read_robot(Path(robot)).joints for robot in job.input.robots]
    files = zip(job.params.robots, job.input.moved, joints, strict=True)
    errors = compute_case_errors(
        {
            robot: read_frame(path, schemas.build_closed_loop_schema(count))
            for robot, path, count in files
        }
    )
    write_csv(job.output.errors, errors)
    write_csv(job.output.summary, summarize_errors(errors, job.params.seed))
    write_csv(job.output.goals, count_cases_within_goal(errors))


def tabulate_coverage(job: Any) -> None:
    """How often stated accuracies hold: all cases, and their coverage with
    intervals."""
    rows = pd.concat(
        [pd.read_csv(path) for path in job.input.stated], ignore_index=True
    )
    write_csv(job.output.cases, rows)
    write_csv(job.output.coverage, compute_coverage(rows))
