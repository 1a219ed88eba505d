"""A corrected path: joint targets for a file of wanted poses, with the error and the
status of each, as a table and in sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import (
    DRAWS,
    ErrorPrediction,
    compute_uncorrected_errors,
    predict_errors,
)
from elastocal.application.calibrated import (
    find_extrapolated,
    predict_residual_displacements,
)
from elastocal.application.compensation import (
    Correction,
    LargeStep,
    find_joint_targets,
    find_large_steps,
)
from elastocal.application.frames import root_mean_square
from elastocal.application.statements import format_accuracy, format_millimetres
from elastocal.counting import format_count, format_integer, list_first
from elastocal.errors import InputError
from elastocal.exchange.target_path import NO_BOUND, OK, TargetPath
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.mechanics.robot import Robot

# Loads above this multiple of the fitted ones get no error bound, because a stiffness
# that was fitted as a constant need not be constant there.
LOAD_FACTOR_WITH_BOUND = 2.0
# Number of lines of a file that a message names.
_LINES_NAMED = 5


@dataclass(frozen=True)
class Outcome:
    """Which wanted poses of a file are corrected.

    Attributes
    ----------
    poses : all N poses of the file.
    status : (N,) of str, "ok" or why a pose is not corrected.
    """

    poses: TargetPath
    status: np.ndarray

    @property
    def is_corrected(self) -> np.ndarray:
        """(N,) bool, poses that are corrected."""
        return np.asarray(self.status == OK)

    def describe_failures(self) -> str:
        """Name the first few lines that are not corrected, with the reasons; empty if
        there are none."""
        failures = [
            f"line {self.poses.lines[row]} is {self.status[row]}"
            for row in np.flatnonzero(~self.is_corrected)
        ]
        return list_first(failures, _LINES_NAMED)


@dataclass(frozen=True)
class CorrectedPath:
    """Joint targets for N wanted poses, all of which are reached, and their errors.

    Attributes
    ----------
    calibrated : the robot.
    outcome : all poses of the file, of which these N are corrected.
    wanted : the poses.
    wrench : (N, 6) loads, N and N m; zero if the file has none.
    correction : joint targets.
    uncorrected_error_m, uncorrected_turn_rad : (N,) predicted errors of position and
        orientation of uncorrected targets.
    prediction : predicted errors of the corrected targets; without those of simulated
        robots over all targets if some have no bound.
    is_extrapolated : (N,) bool, joint angles or loads beyond those that were fitted.
    status : (N,) of str, "ok" or why no error bound is stated.
    large_steps : joints that move too far between targets, if the caller allowed them.
    """

    calibrated: CalibratedRobot
    outcome: Outcome
    wanted: TargetPath
    wrench: np.ndarray
    correction: Correction
    uncorrected_error_m: np.ndarray
    uncorrected_turn_rad: np.ndarray
    prediction: ErrorPrediction
    is_extrapolated: np.ndarray
    status: np.ndarray
    large_steps: list[LargeStep]

    def __repr__(self) -> str:
        before = format_millimetres(root_mean_square(self.uncorrected_error_m))
        after = format_millimetres(root_mean_square(self.prediction.error_m))
        return (
            f"<CorrectedPath: {len(self.status)} targets; predicted position error"
            f" {before} RMS before the correction, {after} after>"
        )

    @property
    def has_bound(self) -> np.ndarray:
        """(N,) bool, targets with an error bound."""
        return np.asarray(self.status == OK)

    @property
    def table(self) -> pd.DataFrame:
        """Joint targets and their errors, see `tabulate_targets`."""
        return tabulate_targets(self)

    @property
    def count(self) -> str:
        """Number of targets in words."""
        return format_count(len(self.wanted), "target")

    @property
    def share(self) -> str:
        """Number of targets in words, of those in the file if these are more."""
        all_poses = len(self.outcome.poses)
        if len(self.wanted) == all_poses:
            return self.count
        number = format_integer(len(self.wanted))
        return f"{number} of {format_count(all_poses, 'target')}"


def correct_path(
    calibrated: CalibratedRobot,
    wanted: TargetPath,
    source: str | Path,
    *,
    allow_large_steps: bool = False,
    partial: bool = False,
) -> CorrectedPath:
    """Correct the targets of a path and predict their errors.

    Parameters
    ----------
    calibrated : the robot.
    wanted : the poses.
    source : file of the poses, for messages.
    allow_large_steps : whether joints may move farther from target to target than
        `compute_allowed_steps`.
    partial : whether poses that cannot be corrected are left out. Then a step goes from
        the pose before them to the pose behind them.

    Raises
    ------
    InputError
        A pose is not reached, or not in the stated posture; or a step is too large.
    """
    wrench = wanted.load
    correction = find_joint_targets(
        calibrated, wanted.position, wanted.rotation, wrench, wanted.start
    )
    outcome = Outcome(wanted, correction.status)
    is_corrected = outcome.is_corrected
    if not is_corrected.all():
        _check_outcome(outcome, source, partial=partial)
        wanted = wanted.select(is_corrected)
        wrench = wrench[is_corrected]
        correction = correction.select(is_corrected)
    commands = correction.joint_angles
    large_steps = find_large_steps(
        calibrated.robot, wanted.position, wanted.rotation, commands
    )
    if large_steps and not allow_large_steps:
        raise InputError(
            source,
            "",
            _describe_large_steps(calibrated.robot, wanted, large_steps, 1),
            "intermediate targets, another posture, or --allow-large-steps",
        )
    outside, overloaded = find_extrapolated(calibrated, commands, wrench)
    _, without_bound = find_extrapolated(
        calibrated, commands, wrench, LOAD_FACTOR_WITH_BOUND
    )
    status = correction.status.astype(object)
    status[outside] = f"{NO_BOUND}joints outside the fitted range"
    status[without_bound] = (
        f"{NO_BOUND}loads beyond {LOAD_FACTOR_WITH_BOUND:g} times the measured ones"
    )
    has_gaps = bool((outside | without_bound).any())
    return CorrectedPath(
        calibrated,
        outcome,
        wanted,
        wrench,
        correction,
        *compute_uncorrected_errors(
            calibrated, wanted.position, wanted.rotation, correction.error_before
        ),
        # Without a bound at each target none is stated over all of them.
        predict_errors(calibrated, commands, wrench, 0 if has_gaps else DRAWS),
        outside | overloaded,
        status,
        large_steps,
    )


def _check_outcome(outcome: Outcome, source: str | Path, *, partial: bool) -> None:
    """Refuse a path with poses that cannot be corrected, or one without any other."""
    if partial and outcome.is_corrected.any():
        return
    allowed = (
        "poses that the robot reaches within its limits, in the posture that q1..qn"
        " state if any"
    )
    if not partial:
        allowed += "; --partial leaves out those that it does not reach"
    raise InputError(source, "", outcome.describe_failures(), allowed)


def _describe_large_steps(
    robot: Robot, wanted: TargetPath, steps: list[LargeStep], most: int
) -> str:
    """Name the first few steps with their lines in the file."""
    sentences = []
    for step in steps:
        line = f"line {wanted.lines[step.row]}: joint {step.joint + 1}"
        if robot.chain.prismatic[step.joint]:
            sentences.append(
                f"{line} shifts by {1e3 * step.size:.0f} mm,"
                f" {1e3 * step.allowed:.0f} allowed"
            )
        else:
            sentences.append(
                f"{line} turns by {math.degrees(step.size):.1f} degrees,"
                f" {math.degrees(step.allowed):.1f} allowed"
            )
    return list_first(sentences, most)


def tabulate_targets(path: CorrectedPath) -> pd.DataFrame:
    """Tabulate joint targets, their errors, and the wanted poses and loads.

    Returns columns ``q1..qn`` (rad, as the controller reports them), predicted errors in
    m and rad, ``status``, ``x .. rz``, ``fx .. mz`` and ``q1_uncorrected ..``. There is a
    row for each pose of the file; one that is not corrected has its pose and status
    alone.
    """
    import pandas as pd

    correction = path.correction
    prediction = path.prediction
    commands = pd.DataFrame(correction.joint_angles).rename(
        columns=lambda joint: f"q{joint + 1}"
    )
    uncorrected = pd.DataFrame(correction.uncorrected).rename(
        columns=lambda joint: f"q{joint + 1}_uncorrected"
    )
    no_bound = [status.startswith(NO_BOUND) for status in path.status]
    errors = {
        "predicted_error_before_m": path.uncorrected_error_m,
        "predicted_error_after_m": prediction.error_m,
        "predicted_bound_m": np.where(no_bound, np.nan, prediction.bound_m),
        "predicted_std_m": np.sqrt(
            prediction.parameters_m**2
            + prediction.repeated_m**2
            + prediction.regression_m**2
        ),
        "predicted_orientation_error_before_rad": path.uncorrected_turn_rad,
        "predicted_orientation_error_after_rad": prediction.orientation_rad,
        "repeatability_m": prediction.repeated_m,
        "outside_range": path.is_extrapolated,
        "status": path.status,
    }
    outcome = path.outcome
    rows = pd.Index(np.flatnonzero(outcome.is_corrected))
    tables = [
        table.set_axis(rows).reindex(range(len(outcome.poses)))
        for table in (commands, pd.DataFrame(errors), uncorrected)
    ]
    tables.insert(2, _tabulate_poses(outcome.poses))
    targets = pd.concat(tables, axis=1)
    return targets.fillna({"status": pd.Series(outcome.status)})


def _tabulate_poses(poses: TargetPath) -> pd.DataFrame:
    """Tabulate wanted poses and their loads, ``x .. rz`` and ``fx .. mz``."""
    import pandas as pd
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_matrix(poses.rotation).as_rotvec()
    return pd.DataFrame(
        np.hstack([poses.position, rotation, poses.load]),
        columns=["x", "y", "z", "rx", "ry", "rz", *WRENCH_NAMES],
    )


def describe_path_accuracy(path: CorrectedPath) -> list[str]:
    """State the accuracy over the targets with a bound, corrected and uncorrected; no
    sentence if there are none."""
    has_bound = path.has_bound
    if not has_bound.any():
        return []
    prediction = path.prediction
    if not has_bound.all():
        prediction = predict_errors(
            path.calibrated,
            path.correction.joint_angles[has_bound],
            path.wrench[has_bound],
        )
    region = "the targets" if has_bound.all() else "the targets with a bound"
    rms = format_millimetres(root_mean_square(path.uncorrected_error_m[has_bound]))
    turn_before = _format_milliradians(path.uncorrected_turn_rad[has_bound])
    turn_after = _format_milliradians(prediction.orientation_rad)
    return [
        format_accuracy(prediction.summarize(region)),
        f"uncorrected they would be missed by {rms} RMS",
        f"predicted orientation error there: {turn_before} RMS uncorrected, {turn_after}"
        " corrected, by the parameters and the repeatability",
    ]


def _format_milliradians(angles_rad: np.ndarray) -> str:
    """Format the root mean square of angles (N,)."""
    return f"{1e3 * root_mean_square(angles_rad):.3f} mrad"


def describe_regression(path: CorrectedPath, regression: str) -> str:
    """Say how many targets the regression on the residuals corrects, and by how much.

    `regression` is its name in words.
    """
    displacements = predict_residual_displacements(
        path.calibrated, path.correction.joint_angles, path.wrench
    )
    lengths_m = np.linalg.norm(displacements, axis=1)
    size = "nothing"
    if lengths_m.any():
        rms = root_mean_square(lengths_m[lengths_m > 0.0])
        size = f"{format_millimetres(rms)} RMS"
    return (
        f"a {regression} on the residuals of the model corrects"
        f" {format_integer((lengths_m > 0.0).sum())} of {path.count} by {size}"
    )


def describe_path_warnings(path: CorrectedPath) -> list[str]:
    """Describe poses that are not corrected, large steps, targets without an error
    bound, extrapolation, and orientations that the correction does not improve."""
    warnings = []
    failures = path.outcome.describe_failures()
    if failures:
        warnings.append(f"not corrected: {failures}")
    before_rad = root_mean_square(path.uncorrected_turn_rad)
    after_rad = root_mean_square(path.prediction.orientation_rad)
    if after_rad > before_rad:
        warnings.append(
            "the uncertainty of the corrected orientations exceeds their error without"
            " the correction: measure orientations, or several reflectors that are not on"
            " one line"
        )
    if path.large_steps:
        robot = path.calibrated.robot
        warnings.append(
            _describe_large_steps(robot, path.wanted, path.large_steps, _LINES_NAMED)
        )
    if not path.has_bound.all():
        warnings.append(
            f"no bound is stated for {format_integer((~path.has_bound).sum())} of"
            f" {path.count}: beyond {LOAD_FACTOR_WITH_BOUND:g} times the measured loads"
            " or outside the fitted range of joints"
        )
    if path.is_extrapolated.any():
        warnings.append(
            f"{format_integer(path.is_extrapolated.sum())} of {path.count} lie beyond the poses"
            " or loads of the campaign: their predicted errors are extrapolated"
        )
    return warnings


def describe_program(path: CorrectedPath, campaign: str) -> list[str]:
    """Return the remarks of a robot program with these targets: robot, campaign, day,
    largest load, tool, and poses of the path that it lacks."""
    robot = path.calibrated.robot
    end = robot.chain.end_effector
    force = math.sqrt((path.wrench[:, :3] ** 2).sum(axis=1).max())
    moment = math.sqrt((path.wrench[:, 3:] ** 2).sum(axis=1).max())
    load = "none beside what the robot file states"
    if force or moment:
        load = f"force up to {force:.4g} N, moment up to {moment:.4g} N m"
    offset = ", ".join(f"{1e3 * value:.4g}" for value in end.offset_m)
    failures = path.outcome.describe_failures()
    left_out = [f"left out of the path: {failures}"] if failures else []
    return [
        f"robot: {robot.name}",
        f"campaign: {campaign}",
        f"date: {date.today().isoformat()}",
        f"load: {load}",
        f"tool: {end.name}, target offset {offset} mm",
        *left_out,
    ]
