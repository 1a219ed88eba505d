"""Simulated data: random numbers from their streams, deflections by pinocchio, noise by its distribution."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from elastocal.audit.audited import COMPONENTS
from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

# A right file fails a test of its noise by chance in one of a million audits.
_BY_CHANCE = 1e-6
# Deflections are differences of positions of metres; so much is lost of their digits (m, rad).
_DIGITS = 1e-14


def experiments(run: Audited, file: str, robot: str, test: str) -> list[Finding]:
    """Joint angles and wrenches of sampled data sets from their random streams, and counts.

    `test`: ``/test`` of the configurations that judge, else empty.
    """
    settings, arm = run.configuration, run.arm(robot)
    frame, loading = run.table(file), settings["loading"]
    sets = 1 if test else settings["data_sets"]
    count = settings["test_configurations" if test else "configurations"]
    numbered = frame[["data_set", "configuration"]].to_numpy()
    expected = np.stack([np.repeat(np.arange(sets), count), np.tile(np.arange(count), sets)], axis=1)
    found = [compared(file, "data sets and configurations, each once", "counting", numbered, expected, 0.0)]
    if not found[0].holds:
        return found
    angles, wrench = run.experiments(robot, bool(test))
    low, high = np.full(arm.joints, -np.pi), np.full(arm.joints, np.pi)
    if settings["interpretations"]["joint_range"] == "limits":
        low, high = np.deg2rad(run.robots[robot]["joint_limits_deg"]).T
    purpose = "test" if test else "identification"
    for data_set in run.picked(file, sets):
        turns = numbers(run.seed, robot, f"{purpose}/joint angles", data_set).random((count, arm.joints))
        normal = numbers(run.seed, robot, f"{purpose}/force", data_set).standard_normal((count, 3))
        force = loading["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
        lever = np.tile(np.array(loading["offset_m"], float), (count, 1))
        if settings["interpretations"]["offset_frame"] == "tool":
            lever = np.stack(
                [arm.pose(arm.unloaded(q), arm.end_effector)[1] @ one for q, one in zip(angles[data_set], lever, strict=True)]
            )
        where = f"data set {data_set}"
        drawn = low + (high - low) * turns
        found.append(compared(file, f"joint angles, {where}", "numpy's Philox stream", angles[data_set], drawn))
        both = np.concatenate([force, np.cross(lever, force)], axis=1)
        found.append(compared(file, f"wrenches, {where}", "numpy's Philox stream", wrench[data_set], both))
    return found


def ideal(run: Audited, file: str, robot: str, test: str) -> list[Finding]:
    """Deflections of sampled rows by pinocchio's exact kinematics; their linear part by MuJoCo's Jacobians.

    `file`, `robot`, `test`: as in `experiments`.
    """
    arm, (angles, wrench) = run.arm(robot), run.experiments(robot, bool(test))
    sets, count = angles.shape[:2]
    found = []
    for point in arm.points:
        there = run.deflections(file, point)
        if there.shape != (sets, count, 6):
            note = f"found {there.shape[:2]}, expected {(sets, count)}"
            return [held(file, f"data sets and configurations of {point}", "counting", False, note)]
        rows = [divmod(int(row), count) for row in run.picked(f"{file} {point}", sets * count)]
        stored = np.array([there[row] for row in rows])
        exact = [arm.deflection(angles[row], wrench[row], point, run.wrench_at) for row in rows]
        found.append(compared(file, f"deflection of {point}, {len(rows)} rows", "pinocchio", stored, exact, absolute=_DIGITS))
        if arm.coordinates == arm.joints:
            linear = [arm.mujoco_regressor(angles[row], wrench[row], point, run.wrench_at) @ arm.compliance for row in rows]
            # What equation 9 leaves out is the square of the springs' turns (some 1e-3 rad) times the reach (some 3 m).
            turned = [np.abs(arm.springs @ arm.torques(angles[row], wrench[row], point, run.wrench_at)).sum() for row in rows]
            bound = 5.0 * float(np.max(turned)) ** 2
            found.append(compared(file, f"linear deflection of {point}", "MuJoCo", stored, linear, absolute=bound))
    return found


def measured(run: Audited, file: str, robot: str, noise_um: str) -> list[Finding]:
    """Noise of sampled data sets from its stream; the noise of all rows by its distribution."""
    scale, found = 1e-6 * float(noise_um), []
    for point in run.arm(robot).points:
        clean, noisy = (run.deflections(name, point) for name in (f"data/simulated/{robot}/ideal.parquet", file))
        if clean.shape != noisy.shape:
            return [held(file, f"rows of {point}", "counting", False, f"found {noisy.shape}, expected {clean.shape}")]
        for data_set in run.picked(f"{file} {point}", len(clean), 3):
            drawn = numbers(run.seed, robot, f"noise/{point}", data_set).standard_normal(clean.shape[1:])
            expected = clean[data_set] + scale * drawn
            checked = f"measured deflection of {point}, data set {data_set}"
            found.append(compared(file, checked, "numpy's Philox stream", noisy[data_set], expected))
        if scale > 0:
            for name, column in zip(COMPONENTS, ((noisy - clean) / scale).reshape(-1, 6).T, strict=True):
                chance = float(stats.kstest(column, "norm").pvalue)
                note = f"p = {chance:.2g} that it is normal noise of {noise_um} µm"
                checked = f"distribution of the noise of {point}, {name}"
                found.append(held(file, checked, "scipy's Kolmogorov-Smirnov test", chance > _BY_CHANCE, note, len(column)))
    return found


def weights(run: Audited, file: str, robot: str) -> list[Finding]:
    """How often data sets and test configurations count in sampled bootstrap replicates."""
    settings, frame = run.configuration, run.table(file)
    replicates = settings["evaluation"]["bootstrap_replicates"]
    members, tests = settings["data_sets"], settings["test_configurations"]
    sizes = {"data sets": members, "test configurations": tests}
    found = []
    for name, size in sizes.items():
        rows = frame[frame["members"] == name]
        expected = np.stack([np.repeat(np.arange(size), replicates), np.tile(np.arange(1, replicates + 1), size)], axis=1)
        found.append(compared(file, f"{name}, each once a replicate", "counting", rows[["number", "replicate"]], expected, 0.0))
    if not all(each.holds for each in found):
        return found
    counts = frame[frame["members"] == "data sets"]["count"].to_numpy().reshape(members, replicates)
    for data_set in run.picked(file, members):
        drawn = numbers(run.seed, robot, "bootstrap", data_set).poisson(1.0, replicates)
        found.append(compared(file, f"weights of data set {data_set}", "numpy's Philox stream", counts[data_set], drawn, 0.0))
    of_tests = frame[frame["members"] == "test configurations"]["count"].to_numpy().reshape(tests, replicates)
    drawn = numbers(run.seed, robot, "bootstrap of tests", 0).poisson(1.0, (replicates, tests))
    found.append(compared(file, "weights of test configurations", "numpy's Philox stream", of_tests, drawn.T, 0.0))
    return found


def initial(run: Audited, file: str, robot: str) -> list[Finding]:
    """Deflection before calibration of every data set, from the ideal deflections."""
    frame = run.table(f"data/simulated/{robot}/ideal.parquet")
    rows = frame[frame["point"] == run.arm(robot).end_effector]
    size = np.sqrt((rows[list(COMPONENTS[:3])] ** 2).sum(axis=1))
    grouped = size.groupby(rows["data_set"])
    expected = np.stack([grouped.size(), grouped.mean(), (size**2).groupby(rows["data_set"]).mean(), grouped.max()], axis=1)
    stored = run.table(file)[["configurations", "mean", "mean_square", "maximum"]]
    names = ("configurations", "mean", "mean square", "maximum")
    return [
        compared(file, f"{name} of every data set", "pandas", stored.iloc[:, column], expected[:, column])
        for column, name in enumerate(names)
    ]


# Which check is for which file; groups of the pattern are its arguments.
CHECKS = (
    (re.compile(r"data/simulated/([^/]+)((?:/test)?)/experiments\.parquet"), experiments),
    (re.compile(r"data/simulated/([^/]+)((?:/test)?)/ideal\.parquet"), ideal),
    (re.compile(r"data/simulated/([^/]+)/([^/]+)um/measured\.parquet"), measured),
    (re.compile(r"results/weights/([^/]+)\.parquet"), weights),
    (re.compile(r"results/initial/([^/]+)\.parquet"), initial),
)
