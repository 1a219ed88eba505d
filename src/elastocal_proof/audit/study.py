"""The study's data and estimates: random numbers by numpy's Philox, deflections by
pinocchio, least squares by numpy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from elastocal_proof.audit.finished_run import (
    ROUNDING,
    Finding,
    FinishedRun,
    compare,
    open_philox_stream,
    require_each_once,
)

# Deflections are differences of positions of metres; so much is lost of their digits
# (m, rad).
_DIGITS = 1e-14
# Beyond this a design counts as one that does not determine the compliances (equation
# 11 in double precision).
_LARGEST_CONDITION = 1e7
# Least squares lose digits by the condition number times those of a double (2e-16),
# here up to this condition number.
_EXACT_UP_TO = 1e4
_STREAM = "numpy's Philox stream"


def check_experiments(run: FinishedRun, file: str, robot: str) -> Iterator[Finding]:
    """Joint angles and wrenches of sampled data sets from their random streams."""
    settings = run.configuration
    read = run.configuration["interpretations"]
    arm = run.arm(robot)
    use = "identification"
    sets = settings["data_sets"]
    count = settings["configurations"]
    if "/test/" in file:
        sets = 1
        count = settings["test_configurations"]
        use = "test"
    numbered = require_each_once(
        run.table(file), data_set=range(sets), configuration=range(count)
    )
    yield numbered
    low = np.full(arm.joints, -np.pi)
    high = np.full(arm.joints, np.pi)
    if read["joint_range"] == "limits":
        low, high = np.deg2rad(run.robots[robot]["joint_limits_deg"]).T
    for data_set in run.pick(file, sets) if numbered.holds else ():
        turns = open_philox_stream(
            run.seed, robot, f"{use}/joint angles", data_set
        ).random((count, arm.joints))
        normal = open_philox_stream(
            run.seed, robot, f"{use}/force", data_set
        ).standard_normal((count, 3))
        angles = low + (high - low) * turns
        force = settings["loading"]["force_N"] * normal
        force /= np.linalg.norm(normal, axis=1)[:, None]
        lever = np.tile(np.array(settings["loading"]["offset_m"], float), (count, 1))
        if read["offset_frame"] == "tool":
            turned = [arm.pose(arm.extend(q), arm.points[-1])[1] for q in angles]
            lever = np.einsum("kij,kj->ki", turned, lever)
        wrenches = np.concatenate([force, np.cross(lever, force)], axis=1)
        for name, found, expected in zip(
            ("joint angles", "wrenches"),
            run.experiments(robot, use == "test"),
            (angles, wrenches),
            strict=True,
        ):
            yield compare(
                f"{name}, data set {data_set}", _STREAM, found[data_set], expected
            )


def check_ideal_deflections(
    run: FinishedRun, file: str, robot: str
) -> Iterator[Finding]:
    """Deflections of sampled rows by pinocchio's exact kinematics, tubes by
    Castigliano's theorem."""
    arm, (angles, wrench) = run.arm(robot), run.experiments(robot, "/test/" in file)
    sets, count = angles.shape[:2]
    for point in arm.points:
        there = run.deflections(file, point)
        yield compare(
            f"data sets and configurations of {point}",
            "counting",
            there.shape,
            (sets, count, 6),
            0.0,
        )
        rows = [
            divmod(int(row), count) for row in run.pick(f"{file} {point}", sets * count)
        ]
        exact = []
        for row in rows:
            position_0, rotation_0 = arm.pose(arm.extend(angles[row]), point)
            coordinates, _ = arm.loaded(
                arm.springs, angles[row], wrench[row], 1, *run.at(point)
            )
            position, rotation = arm.pose(coordinates, point)
            exact.append(
                np.concatenate(
                    [position - position_0, pin.log3(rotation @ rotation_0.T)]
                )
            )
        stored = np.array([there[row] for row in rows])
        yield compare(
            f"deflection of {point}, {len(rows)} rows",
            "pinocchio",
            stored,
            exact,
            absolute=_DIGITS,
        )


def check_measured_deflections(
    run: FinishedRun, file: str, robot: str, noise_um: str
) -> Iterator[Finding]:
    """Measured deflections of sampled data sets: the ideal ones and noise from its
    stream."""
    for point in run.arm(robot).points:
        clean, noisy = (
            run.deflections(name, point)
            for name in (f"data/simulated/{robot}/ideal.parquet", file)
        )
        yield compare(
            f"data sets and configurations of {point}",
            "counting",
            noisy.shape,
            clean.shape,
            0.0,
        )
        for data_set in run.pick(f"{file} {point}", len(clean)):
            drawn = open_philox_stream(
                run.seed, robot, f"noise/{point}", data_set
            ).standard_normal(clean.shape[1:])
            expected = clean[data_set] + 1e-6 * float(noise_um) * drawn
            yield compare(
                f"measured deflection of {point}, data set {data_set}",
                _STREAM,
                noisy[data_set],
                expected,
            )


def solve_staged(
    stages: Sequence[Mapping[str, Any]],
    regressors: Mapping[str, np.ndarray],
    joints: int,
) -> tuple[np.ndarray, float]:
    """What each measurement adds to the compliances, (joints, rows), and the worst
    condition number, by pseudo-inverses.

    `regressors` (rows, joints): of each measuring point; measurements are in their
    order.
    """
    ends = np.cumsum([0, *map(len, regressors.values())])
    units = dict(zip(regressors, np.split(np.eye(ends[-1]), ends[1:-1]), strict=True))
    gain = np.zeros((joints, ends[-1]))
    condition = 1.0
    for stage in stages:
        identified, taken = (
            np.array(stage.get(key, []), int) - 1 for key in ("joints", "held")
        )
        matrix, read = (
            np.concatenate([each[name] for name in stage["points"]])
            for each in (regressors, units)
        )
        gain[identified] = np.linalg.pinv(matrix[:, identified]) @ (
            read - matrix[:, taken] @ gain[taken]
        )
        condition = max(condition, float(np.linalg.cond(matrix[:, identified])))
    return gain, condition


def check_estimates(
    run: FinishedRun, file: str, robot: str, strategy: str, noise_um: str
) -> Iterator[Finding]:
    """Compliances of sampled data sets and lengths (equation 11); what does not
    determine them has none."""
    frame = run.table(file)
    settings = run.configuration
    arm = run.arm(robot)
    stages = run.strategies[strategy]["stages"]
    numbered = {
        "data_set": range(settings["data_sets"]),
        "length": range(1, settings["configurations"] + 1),
    }
    yield require_each_once(frame, **numbered)
    rows = 6 if settings["interpretations"]["measured"] == "pose" else 3
    points = dict.fromkeys(name for stage in stages for name in stage["points"])
    for row in (frame.iloc[place] for place in run.pick(file, len(frame))):
        data_set = int(row["data_set"])
        length = int(row["length"])
        loads = [each[data_set, :length] for each in run.experiments(robot)]
        matrices = {
            name: np.concatenate(
                [
                    arm.regressor(*load, name, *run.at(name))[:rows]
                    for load in zip(*loads, strict=True)
                ]
            )
            for name in points
        }
        gain, condition = solve_staged(stages, matrices, arm.joints)
        enough = all(
            rows * length * len(stage["points"]) >= len(stage["joints"])
            for stage in stages
        )
        lost = 1.0 if enough and condition < _LARGEST_CONDITION else np.nan
        noisy = f"data/simulated/{robot}/{noise_um}um/measured.parquet"
        seen = np.concatenate(
            [
                run.deflections(noisy, name)[data_set, :length, :rows].ravel()
                for name in points
            ]
        )
        words = f"of data set {data_set}, length {length}"
        allowed = ROUNDING * max(1.0, condition / _EXACT_UP_TO)
        given = row.filter(regex=r"^compliance_\d+$")
        yield compare(
            f"compliances {words}",
            "numpy on pinocchio",
            given,
            lost * gain @ seen,
            allowed,
        )


CHECKS = {
    "data/simulated/{robot}/experiments.parquet": check_experiments,
    "data/simulated/{robot}/test/experiments.parquet": check_experiments,
    "data/simulated/{robot}/ideal.parquet": check_ideal_deflections,
    "data/simulated/{robot}/test/ideal.parquet": check_ideal_deflections,
    "data/simulated/{robot}/{noise_um}um/measured.parquet": check_measured_deflections,
    "results/identified/{robot}/{noise_um}um/{strategy}.parquet": check_estimates,
}
