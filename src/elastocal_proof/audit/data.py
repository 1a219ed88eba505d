"""Simulated data: random numbers from their streams, deflections by pinocchio, noise by its distribution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from elastocal_proof.audit.audited import COMPONENTS
from elastocal_proof.audit.findings import Finding, compare, require, require_each_once
from elastocal_proof.audit.streams import draw, numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal_proof.audit.audited import Audited

# A right file fails a test of its noise by chance in one of a million audits.
_BY_CHANCE = 1e-6
# Deflections are differences of positions of metres; so much is lost of their digits (m, rad).
_DIGITS = 1e-14
_STREAM = "numpy's Philox stream"


def experiments(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Joint angles and wrenches of sampled data sets from their random streams."""
    settings, test = run.configuration, "/test/" in file
    sets, count = (1, settings["test_configurations"]) if test else (settings["data_sets"], settings["configurations"])
    numbered = require_each_once(run.table(file), data_set=range(sets), configuration=range(count))
    yield numbered
    for data_set in run.pick(file, sets) if numbered.holds else ():
        again = draw(run, robot, data_set, count, "test" if test else "identification")
        for name, stored, expected in zip(("joint angles", "wrenches"), run.experiments(robot, test), again, strict=True):
            yield compare(f"{name}, data set {data_set}", _STREAM, stored[data_set], expected)


def ideal(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Deflections of sampled rows by pinocchio's exact kinematics; their linear part by MuJoCo's Jacobians."""
    arm, (angles, wrench) = run.arm(robot), run.experiments(robot, "/test/" in file)
    sets, count = angles.shape[:2]
    for point in arm.points:
        there = run.deflections(file, point)
        whole = there.shape == (sets, count, 6)
        yield require(f"data sets and configurations of {point}", "counting", whole, f"found {there.shape[:2]}", sets * count)
        if not whole:
            return
        rows = [divmod(int(row), count) for row in run.pick(f"{file} {point}", sets * count)]
        loads = [(angles[row], wrench[row], point, run.wrench_at) for row in rows]
        stored = np.array([there[row] for row in rows])
        exact = [arm.deflection(*load) for load in loads]
        yield compare(f"deflection of {point}, {len(rows)} rows", "pinocchio", stored, exact, absolute=_DIGITS)
        if arm.coordinates == arm.joints:
            linear = [arm.mujoco_regressor(*load) @ arm.compliance for load in loads]
            # What equation 9 leaves out is the square of the springs' turns (some 1e-3 rad) times the reach (some 3 m).
            turned = max(np.abs(arm.springs @ arm.torques(*load)).sum() for load in loads)
            yield compare(f"linear deflection of {point}", "MuJoCo", stored, linear, absolute=5.0 * turned**2)


def measured(run: Audited, file: str, robot: str, noise_um: str) -> Iterator[Finding]:
    """Noise of sampled data sets from its stream; the noise of all rows by its distribution."""
    scale = 1e-6 * float(noise_um)
    for point in run.arm(robot).points:
        clean, noisy = (run.deflections(name, point) for name in (f"data/simulated/{robot}/ideal.parquet", file))
        yield require(f"rows of {point}", "counting", clean.shape == noisy.shape, f"found {noisy.shape}", len(clean))
        if clean.shape != noisy.shape:
            return
        for data_set in run.pick(f"{file} {point}", len(clean), 3):
            drawn = numbers(run.seed, robot, f"noise/{point}", data_set).standard_normal(clean.shape[1:])
            checked = f"measured deflection of {point}, data set {data_set}"
            yield compare(checked, _STREAM, noisy[data_set], clean[data_set] + scale * drawn)
        for name, column in zip(COMPONENTS, (noisy - clean).reshape(-1, 6).T, strict=True) if scale else ():
            chance = float(stats.kstest(column / scale, "norm").pvalue)
            note = f"p = {chance:.2g} that it is normal noise of {noise_um} µm"
            checked = f"distribution of the noise of {point}, {name}"
            yield require(checked, "scipy's Kolmogorov-Smirnov test", chance > _BY_CHANCE, note, len(column))


def weights(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """How often data sets and test configurations count in bootstrap replicates."""
    settings, frame = run.configuration, run.table(file)
    replicates = settings["evaluation"]["bootstrap_replicates"]
    sets, tests = settings["data_sets"], settings["test_configurations"]
    counts = {}
    for name, size in (("data sets", sets), ("test configurations", tests)):
        rows = frame[frame["members"] == name]
        numbered = require_each_once(rows, number=range(size), replicate=range(1, replicates + 1))
        yield numbered
        if not numbered.holds:
            return
        counts[name] = rows["count"].to_numpy().reshape(size, replicates)
    for data_set in run.pick(file, sets):
        drawn = numbers(run.seed, robot, "bootstrap", data_set).poisson(1.0, replicates)
        yield compare(f"weights of data set {data_set}", _STREAM, counts["data sets"][data_set], drawn, 0.0)
    drawn = numbers(run.seed, robot, "bootstrap of tests").poisson(1.0, (replicates, tests))
    yield compare("weights of test configurations", _STREAM, counts["test configurations"], drawn.T, 0.0)


def initial(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Deflection before calibration of every data set, from the ideal deflections."""
    moved = run.deflections(f"data/simulated/{robot}/ideal.parquet", run.arm(robot).end_effector)[..., :3]
    size = np.linalg.norm(moved, axis=-1)
    expected = {"mean": size.mean(axis=1), "mean_square": (size**2).mean(axis=1), "maximum": size.max(axis=1)}
    for name, values in ({"configurations": np.full(*size.shape)} | expected).items():
        yield compare(f"{name.replace('_', ' ')} of every data set", "numpy", run.table(file)[name], values)


CHECKS = {
    "data/simulated/{robot}/experiments.parquet": experiments,
    "data/simulated/{robot}/test/experiments.parquet": experiments,
    "data/simulated/{robot}/ideal.parquet": ideal,
    "data/simulated/{robot}/test/ideal.parquet": ideal,
    "data/simulated/{robot}/{noise_um}um/measured.parquet": measured,
    "results/weights/{robot}.parquet": weights,
    "results/initial/{robot}.parquet": initial,
}
