"""Audit of the study's data and estimates: random numbers by numpy's Philox generator,
deflections by pinocchio, least squares by numpy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.finished_run import (
    ROUNDING,
    Finding,
    FinishedRun,
    compare,
    open_philox_stream,
    require_each_once,
)

# Absolute tolerance of deflections, m and rad: they are differences of positions of
# some metres, and lose their digits.
_DEFLECTION_TOLERANCE = 1e-14
# A design with a larger condition number does not determine the compliances (equation
# 11 in double precision).
_LARGEST_CONDITION = 1e7
# Up to this condition number the rounding error of least squares, which is the
# condition number times that of a double (2e-16), is below `ROUNDING`.
_WELL_CONDITIONED = 1e4
_STREAM = "numpy's Philox stream"


def check_experiments(run: FinishedRun, file: str, robot: str) -> Iterator[Finding]:
    """Joint angles and wrenches of sampled data sets from their random streams."""
    settings = run.configuration
    use = "identification"
    sets = settings["data_sets"]
    count = settings["configurations"]
    if "/test/" in file:
        use = "test"
        sets = 1
        count = settings["test_configurations"]
    numbering = require_each_once(
        run.table(file), data_set=range(sets), configuration=range(count)
    )
    yield numbering
    if not numbering.holds:
        return
    stored = run.experiments(robot, use)
    for data_set in run.pick(file, sets):
        drawn = _draw_experiments(run, robot, use, int(data_set), count)
        for name, values, expected in zip(
            ("joint angles", "wrenches"), stored, drawn, strict=True
        ):
            checked = f"{name}, data set {data_set}"
            yield compare(checked, _STREAM, values[data_set], expected)


def _draw_experiments(
    run: FinishedRun, robot: str, use: str, data_set: int, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw joint angles (count, n) and wrenches (count, 6) of a data set; `use` is
    "identification" or "test"."""
    settings = run.configuration
    arm = run.arm(robot)
    low, high = -np.pi, np.pi
    if settings["interpretations"]["joint_range"] == "limits":
        low, high = np.deg2rad(run.robots[robot]["joint_limits_deg"]).T
    stream = open_philox_stream(run.seed, robot, f"{use}/joint angles", data_set)
    angles = low + (high - low) * stream.random((count, arm.joints))
    stream = open_philox_stream(run.seed, robot, f"{use}/force", data_set)
    force = stream.standard_normal((count, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    force *= settings["loading"]["force_N"]
    lever = np.array(settings["loading"]["offset_m"], float)
    if settings["interpretations"]["offset_frame"] == "tool":
        end = arm.points[-1]
        lever = np.array([arm.pose(arm.extend(q), end)[1] @ lever for q in angles])
    return angles, np.concatenate([force, np.cross(lever, force)], axis=1)


def check_ideal_deflections(
    run: FinishedRun, file: str, robot: str
) -> Iterator[Finding]:
    """Deflections of sampled rows by pinocchio's exact kinematics, tubes by
    Castigliano's theorem."""
    arm = run.arm(robot)
    angles, wrenches = run.experiments(
        robot, "test" if "/test/" in file else "identification"
    )
    sets, count = angles.shape[:2]
    for point in arm.points:
        deflections = run.deflections(file, point)
        yield compare(
            f"data sets and configurations of {point}",
            "counting",
            deflections.shape,
            (sets, count, 6),
            0.0,
        )
        rows = run.pick(f"{file} {point}", sets * count)
        indices = [divmod(int(row), count) for row in rows]
        expected = [
            _deflect_point(arm, angles[index], wrenches[index], point, run.at(point))
            for index in indices
        ]
        yield compare(
            f"deflection of {point}, {len(rows)} rows",
            "pinocchio",
            deflections.reshape(-1, 6)[rows],
            expected,
            absolute=_DEFLECTION_TOLERANCE,
        )


def _deflect_point(
    arm: Arm,
    angles: np.ndarray,
    wrench: np.ndarray,
    point: str,
    application: tuple[Any, ...],
) -> list[float]:
    """Deflection of a measuring point, m and rad.

    Parameters
    ----------
    arm : arm whose springs yield
    angles : (n,) array, rad
    wrench : (6,) array
    point : name of the measuring point
    application : where the wrench acts, as `Arm.deflect` takes it
    """
    position_0, rotation_0 = arm.pose(arm.extend(angles), point)
    coordinates, _ = arm.deflect(arm.springs, angles, wrench, 1, *application)
    position, rotation = arm.pose(coordinates, point)
    return [*(position - position_0), *pin.log3(rotation @ rotation_0.T)]


def check_measured_deflections(
    run: FinishedRun, file: str, robot: str, noise_um: str
) -> Iterator[Finding]:
    """Measured deflections of sampled data sets: the ideal ones and noise from its
    stream."""
    for point in run.arm(robot).points:
        ideal = run.deflections(f"data/simulated/{robot}/ideal.parquet", point)
        measured = run.deflections(file, point)
        yield compare(
            f"data sets and configurations of {point}",
            "counting",
            measured.shape,
            ideal.shape,
            0.0,
        )
        for data_set in run.pick(f"{file} {point}", len(ideal)):
            stream = open_philox_stream(run.seed, robot, f"noise/{point}", data_set)
            noise = 1e-6 * float(noise_um) * stream.standard_normal(ideal.shape[1:])
            yield compare(
                f"measured deflection of {point}, data set {data_set}",
                _STREAM,
                measured[data_set],
                ideal[data_set] + noise,
            )


def solve_staged(
    stages: Sequence[Mapping[str, Any]],
    regressors: Mapping[str, np.ndarray],
    joints: int,
) -> tuple[np.ndarray, float]:
    """Solve the stages of a strategy by pseudo-inverses.

    Parameters
    ----------
    stages : stages of the strategy, with joints and measuring points
    regressors : (rows, joints) arrays, of each measuring point
    joints : number of joints

    Returns
    -------
    gain : (joints, rows of all points) array
        Compliances are the gain times the measurements, in the order of `regressors`.
    condition : largest condition number of a stage
    """
    ends = np.cumsum([0, *map(len, regressors.values())])
    units = dict(zip(regressors, np.split(np.eye(ends[-1]), ends[1:-1]), strict=True))
    gain = np.zeros((joints, ends[-1]))
    condition = 1.0
    for stage in stages:
        identified = np.array(stage["joints"], int) - 1
        held = np.array(stage.get("held", []), int) - 1
        matrix = np.concatenate([regressors[name] for name in stage["points"]])
        measurements = np.concatenate([units[name] for name in stage["points"]])
        columns = matrix[:, identified]
        corrected = measurements - matrix[:, held] @ gain[held]
        gain[identified] = np.linalg.pinv(columns) @ corrected
        condition = max(condition, float(np.linalg.cond(columns)))
    return gain, condition


def check_estimates(
    run: FinishedRun, file: str, robot: str, strategy: str, noise_um: str
) -> Iterator[Finding]:
    """Compliances of sampled data sets and lengths (equation 11); what does not
    determine them has none."""
    frame = run.table(file)
    settings = run.configuration
    yield require_each_once(
        frame,
        data_set=range(settings["data_sets"]),
        length=range(1, settings["configurations"] + 1),
    )
    stages = run.strategies[strategy]["stages"]
    measured = f"data/simulated/{robot}/{noise_um}um/measured.parquet"
    for number in run.pick(file, len(frame)):
        row = frame.iloc[number]
        data_set = int(row["data_set"])
        length = int(row["length"])
        expected, condition = _estimate(run, robot, stages, measured, data_set, length)
        yield compare(
            f"compliances of data set {data_set}, length {length}",
            "numpy on pinocchio",
            row.filter(regex=r"^compliance_\d+$"),
            expected,
            ROUNDING * max(1.0, condition / _WELL_CONDITIONED),
        )


def _estimate(
    run: FinishedRun,
    robot: str,
    stages: Sequence[Mapping[str, Any]],
    measured: str,
    data_set: int,
    length: int,
) -> tuple[np.ndarray, float]:
    """Estimate the compliances (n,) of a data set from its first configurations.

    They are not a number if the measurements do not determine them. Also returns the
    condition number.
    """
    arm = run.arm(robot)
    angles, wrenches = run.experiments(robot, "identification")
    components = 6 if run.configuration["interpretations"]["measured"] == "pose" else 3
    regressors = {}
    deflections = []
    for name in dict.fromkeys(name for stage in stages for name in stage["points"]):
        matrices = [
            arm.regressor(q, wrench, name, *run.at(name))[:components]
            for q, wrench in zip(
                angles[data_set, :length], wrenches[data_set, :length], strict=True
            )
        ]
        regressors[name] = np.concatenate(matrices)
        deflection = run.deflections(measured, name)[data_set, :length, :components]
        deflections.append(deflection.ravel())
    gain, condition = solve_staged(stages, regressors, arm.joints)
    compliances = gain @ np.concatenate(deflections)
    determined = condition < _LARGEST_CONDITION and all(
        components * length * len(stage["points"]) >= len(stage["joints"])
        for stage in stages
    )
    return compliances if determined else np.nan * compliances, condition


CHECKS = {
    "data/simulated/{robot}/experiments.parquet": check_experiments,
    "data/simulated/{robot}/test/experiments.parquet": check_experiments,
    "data/simulated/{robot}/ideal.parquet": check_ideal_deflections,
    "data/simulated/{robot}/test/ideal.parquet": check_ideal_deflections,
    "data/simulated/{robot}/{noise_um}um/measured.parquet": check_measured_deflections,
    "results/identified/{robot}/{noise_um}um/{strategy}.parquet": check_estimates,
}
