"""Metrics, replicates, accuracies, bounds and expectations from the files before them, by pandas and pinocchio."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from elastocal.audit.estimates import points_of
from elastocal.audit.findings import ROUNDING, SINGLE, Finding, compared, held

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.audit.audited import Audited

# From when on the mean of 1/c does not exist in practice (docs/study.md).
_TRUSTED_SPREAD = 0.25
# Lengths of a file of metrics whose scores are worked out again.
_LENGTHS = 3


@cache
def error_rows(run: Audited, robot: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What judges a model: on each test configuration the regressor of positions, its offset, and the deflection.

    Returns `slope` (tests, 3, n): by which compliances move the predicted position, m per rad/(N m); `offset` (tests, 3): exact
    prediction at the true compliances less the true position, m; `deflection` (tests, 3).
    """
    arm, (angles, wrench) = run.arm(robot), run.experiments(robot, test=True)
    file = f"data/simulated/{robot}/test/ideal.parquet"
    truth = run.deflections(file, arm.end_effector)[0, :, :3]
    slope = np.array([run.regressor(robot, 0, k, arm.end_effector, True)[:3] for k in range(len(truth))])
    exact = [
        arm.deflection(q, w, arm.end_effector, run.wrench_at, arm.compliance)[:3]
        for q, w in zip(angles[0], wrench[0], strict=True)
    ]
    return slope, np.array(exact) - truth, truth


def errors_of(run: Audited, robot: str, compliance: np.ndarray) -> np.ndarray:
    """Position errors (models, tests) in m of models (models, n)."""
    slope, offset, _ = error_rows(run, robot)
    moved = np.einsum("tij,mj->mti", slope, compliance - run.arm(robot).compliance) + offset
    return np.linalg.norm(moved, axis=-1)


def moment(run: Audited, robot: str) -> np.ndarray:
    """Mean over the test configurations of A'A of the position, (n, n)."""
    slope = error_rows(run, robot)[0]
    return np.einsum("tki,tkj->ij", slope, slope) / len(slope)


def fixed_joints(strategy: Mapping[str, Any]) -> np.ndarray:
    """Joints that the paper's k_sigma counts alone (interpretation R10), from 0."""
    last = strategy["stages"][-1]
    every = sorted({joint for stage in strategy["stages"] for joint in stage["joints"]})
    return np.array(last.get("held") or every) - 1


def averaged(compliance: np.ndarray, method: str, weights: np.ndarray | None = None) -> np.ndarray:
    """Equation 12 over data sets (sets, n), each as often as its weight says."""
    counted = np.ones(len(compliance)) if weights is None else weights
    if method == "median":
        return np.median(np.repeat(compliance, counted.astype(int), axis=0), axis=0)
    values = compliance if method == "compliance" else 1.0 / compliance
    mean = np.average(values, axis=0, weights=counted)
    return mean if method == "compliance" else 1.0 / mean


def metrics(run: Audited, file: str, robot: str, noise_um: str, key: str) -> list[Finding]:
    """Equations 12 to 15 at sampled lengths, from the identified compliances; standard errors from the replicates."""
    frame, arm = run.table(file).set_index("length"), run.arm(robot)
    lengths, replicates = run.configuration["configurations"], run.configuration["evaluation"]["bootstrap_replicates"]
    found = [compared(file, "lengths, each once", "counting", frame.index, np.arange(1, lengths + 1), 0.0)]
    drawn = run.table(f"results/replicates/{robot}/{noise_um}um/{key}.parquet")
    for length in 1 + run.picked(file, lengths, _LENGTHS):
        row, at = frame.loc[length], f"length {length}"
        compliance = _of_length(run, robot, noise_um, key, length)
        if np.isnan(compliance).any():
            # A score of data sets of which one determines nothing exists for none.
            found.append(held(file, f"no scores, {at}", "pandas", bool(np.isnan(row["k_sigma"])), "a number"))
            continue
        mean, errors = _mean_and_deviation(run, robot, compliance)
        relative = 100 * (arm.compliance / mean - 1)
        stored = [row[f"compliance_{j + 1}"] for j in range(arm.joints)]
        found.append(compared(file, f"averaged compliances, {at}", "pandas", stored, mean))
        stored = [row[f"delta_k_{j + 1}"] for j in range(arm.joints)]
        # A difference of two nearly equal numbers, in percent.
        found.append(compared(file, f"delta_k, {at}", "pandas", stored, relative, 0.0, 100 * ROUNDING))
        sums = [relative.sum(), relative[fixed_joints(run.strategies[key])].sum()]
        found.append(
            compared(file, f"k_sigma, {at}", "pandas", row[["k_sigma", "k_sigma_fixed_joints"]], sums, 0.0, 600 * ROUNDING)
        )
        size = np.linalg.norm(error_rows(run, robot)[2], axis=1).mean()
        found.append(
            compared(file, f"deviation, {at}", "pinocchio", row[["deviation", "initial_deviation"]], [errors, size], 1e-8)
        )
        scaled = compliance / arm.compliance
        spread = float((scaled.std(axis=0) / np.abs(scaled.mean(axis=0))).max())
        share = float((compliance <= 0).any(axis=1).mean())
        trusted = share == 0 and spread <= _TRUSTED_SPREAD
        expected = [share, spread, trusted]
        names = ["nonpositive_share", "relative_spread", "trustworthy"]
        # A spread of noise-free estimates is a root of rounding.
        found.append(compared(file, f"whether to be trusted, {at}", "pandas", row[names].astype(float), expected, 1e-6, 1e-7))
        there = drawn[drawn["length"] == length]
        for name in ("k_sigma", "k_sigma_fixed_joints", "deviation", "initial_deviation"):
            checked = f"standard error of {name}, {at}"
            found.append(compared(file, checked, "pandas", row[f"{name}_std_error"], there[name].std(ddof=1), 1e-6, 1e-12))
        weights = _weights(run, robot)[0]
        again = [averaged(compliance, run.configuration["interpretations"]["average"], each) for each in weights]
        stored = [row[f"compliance_{j + 1}_std_error"] for j in range(arm.joints)]
        expected = np.std(again, axis=0, ddof=1)
        found.append(compared(file, f"standard errors of compliances, {at}", "numpy", stored, expected, 1e-6, 1e-17))
        count = compared(file, f"replicates, {at}", "counting", [len(there)], [replicates], 0.0)
        found.append(count)
    return found


def replicates(run: Audited, file: str, robot: str, noise_um: str, key: str) -> list[Finding]:
    """Scores of sampled bootstrap replicates."""
    frame, arm, read = run.table(file), run.arm(robot), run.configuration["interpretations"]
    drawn, lengths = run.configuration["evaluation"]["bootstrap_replicates"], run.configuration["configurations"]
    expected_index = np.stack([np.repeat(np.arange(1, drawn + 1), lengths), np.tile(np.arange(1, lengths + 1), drawn)], axis=1)
    found = [
        compared(file, "replicates and lengths, each once", "counting", frame[["replicate", "length"]], expected_index, 0.0)
    ]
    of_sets, of_tests = _weights(run, robot)
    size = np.linalg.norm(error_rows(run, robot)[2], axis=1)
    for place in run.picked(file, len(frame)):
        row = frame.iloc[place]
        number, length = int(row["replicate"]) - 1, int(row["length"])
        compliance = _of_length(run, robot, noise_um, key, length)
        if np.isnan(compliance).any():
            continue
        mean = averaged(compliance, read["average"], of_sets[number])
        relative = 100 * (arm.compliance / mean - 1)
        if read["deviation_of"] == "averaged_model":
            deviation = np.average(errors_of(run, robot, mean[None])[0], weights=of_tests[number])
        else:
            deviation = np.average(errors_of(run, robot, compliance).mean(axis=1), weights=of_sets[number])
        expected = [relative.sum(), relative[fixed_joints(run.strategies[key])].sum()]
        at = f"replicate {number + 1}, length {length}"
        stored = row[["k_sigma", "k_sigma_fixed_joints"]]
        found.append(compared(file, f"k_sigma, {at}", "pandas", stored, expected, 0.0, 600 * ROUNDING))
        expected = [deviation, np.average(size, weights=of_tests[number])]
        stored = row[["deviation", "initial_deviation"]]
        found.append(compared(file, f"deviation, {at}", "pinocchio", stored, expected, 1e-8))
    return found


def accuracy(run: Audited, file: str, robot: str, noise_um: str, key: str) -> list[Finding]:
    """What one data set gives, at a sampled length."""
    frame, arm = run.table(file), run.arm(robot)
    lengths = run.configuration["evaluation"]["lengths"]
    found = [compared(file, "evaluated lengths", "counting", frame["length"], lengths, 0.0)]
    for place in run.picked(file, len(frame), 1):
        row = frame.iloc[place]
        at = f"length {int(row['length'])}"
        compliance = _of_length(run, robot, noise_um, key, int(row["length"]))
        if np.isnan(compliance).any():
            continue
        errors = errors_of(run, robot, compliance)
        rank = int(np.ceil(0.95 * errors.shape[1])) - 1
        scores = [
            errors.mean(),
            np.sqrt((errors**2).mean()),
            np.sort(errors, axis=1)[:, rank].mean(),
            errors.max(axis=1).mean(),
        ]
        found.append(
            compared(file, f"errors of one data set, {at}", "pinocchio", row[["mean", "rms", "p95", "max"]], scores, 1e-8)
        )
        squares = (errors**2).mean(axis=1)
        error = squares.std() / np.sqrt(len(squares) - 1) / (2 * np.sqrt(squares.mean()))
        found.append(
            compared(file, f"standard error of the RMS error, {at}", "numpy", row["rms_std_error"], error, 1e-5, 1e-15)
        )
        relative = 100 * np.sqrt((((compliance - arm.compliance) / arm.compliance) ** 2).mean(axis=0))
        stored = [row[f"relative_error_{j + 1}"] for j in range(arm.joints)]
        found.append(compared(file, f"relative errors of compliances, {at}", "pandas", stored, relative, 1e-8))
    return found


def bounds(run: Audited, file: str, robot: str) -> list[Finding]:
    """Cramér-Rao bounds of sampled sets of points and lengths, by pinocchio."""
    frame, sets = run.table(file), run.configuration["data_sets"]
    most = run.configuration["configurations"]
    names = {"+".join(sorted(points_of(strategy))) for strategy in run.strategies.values()}
    found = [held(file, "sets of measuring points", "counting", set(frame["points"]) == names, f"{set(frame['points'])}")]
    found.append(compared(file, "lengths of each", "counting", frame.groupby("points").size(), [most] * len(names), 0.0))
    weighted = moment(run, robot)
    rows = frame[np.isfinite(frame["rms_per_noise"]) & (frame["length"] <= _SHORT)]
    for place in run.picked(file, len(rows), 2):
        row = rows.iloc[place]
        total = 0.0
        for data_set in range(sets):
            matrix = run.stacked(robot, data_set, int(row["length"]), row["points"].split("+"))
            total += float(np.trace(weighted @ np.linalg.inv(matrix.T @ matrix)))
        checked = f"bound of {row['points']}, length {int(row['length'])}"
        found.append(compared(file, checked, "pinocchio", row["rms_per_noise"], np.sqrt(total / sets), 1e-6))
    return found


# A bound is a mean over all data sets: of longer ones it would take minutes.
_SHORT = 12


def expected(run: Audited, file: str, robot: str, noise_um: str, key: str) -> list[Finding]:
    """Expectations in closed form at sampled lengths, from the covariances of the design."""
    frame, arm, read = run.table(file), run.arm(robot), run.configuration["interpretations"]
    covariances, sets = run.table(f"results/design/{robot}/{key}.parquet"), run.configuration["data_sets"]
    found = [compared(file, "lengths, each once", "counting", frame["length"], np.arange(1, len(frame) + 1), 0.0)]
    slope, offset, _ = error_rows(run, robot)
    for place in run.picked(file, len(frame), _LENGTHS):
        row = frame.iloc[place]
        length = int(row["length"])
        free = _noise_free(run, robot, key, length)
        spread = np.zeros((arm.joints, arm.joints))
        rows = covariances[covariances["length"] == length].filter(like="cov_").astype(float).mean().to_numpy()
        if np.isnan(row["k_sigma"]) or np.isnan(rows).any() or np.isnan(free).any():
            continue
        spread[np.tril_indices(arm.joints)] = (1e-6 * float(noise_um)) ** 2 * rows
        spread += np.tril(spread, -1).T
        mean = free / (1 + np.diag(spread) / free**2) if read["average"] == "stiffness" else free
        scatter = spread / sets if read["deviation_of"] == "averaged_model" else spread
        error = slope @ (mean - arm.compliance) + offset
        within = np.einsum("tki,ij,tlj->tkl", slope, scatter, slope)
        square = (error**2).sum(axis=1) + np.trace(within, axis1=1, axis2=2)
        variance = 2 * (within**2).sum(axis=(1, 2)) + 4 * np.einsum("tk,tkl,tl->t", error, within, error)
        with np.errstate(divide="ignore", invalid="ignore"):
            shape = square**2 / variance
            # Mean of the root of a gamma variable; its limit where nothing scatters.
            ratio = np.where(shape > 1e4, 1 - 0.125 / shape, np.exp(gammaln(shape + 0.5) - gammaln(shape)) / np.sqrt(shape))
        deviation = float((np.sqrt(square) * ratio).mean())
        stored = [row[f"compliance_{j + 1}"] for j in range(arm.joints)]
        found.append(compared(file, f"expected compliances, length {length}", "pandas", stored, mean, SINGLE))
        checked = f"expected deviation, length {length}"
        found.append(compared(file, checked, "Satterthwaite's gamma, scipy", row["deviation"], deviation, 1e-4))
    return found


def _noise_free(run: Audited, robot: str, key: str, length: int) -> np.ndarray:
    file = f"results/identified/{robot}/0um/{key}.parquet"
    if not run.there(file):
        return run.arm(robot).compliance
    compliance = _of_length(run, robot, "0", key, length)
    return averaged(compliance, run.configuration["interpretations"]["average"])


def _of_length(run: Audited, robot: str, noise_um: str, key: str, length: int) -> np.ndarray:
    """Identified compliances (sets, n) of one length."""
    frame = run.table(f"results/identified/{robot}/{noise_um}um/{key}.parquet")
    return frame[frame["length"] == length].filter(regex=r"^c\d+$").to_numpy(float)


def _mean_and_deviation(run: Audited, robot: str, compliance: np.ndarray) -> tuple[np.ndarray, float]:
    read = run.configuration["interpretations"]
    mean = averaged(compliance, read["average"])
    models = mean[None] if read["deviation_of"] == "averaged_model" else compliance
    return mean, float(errors_of(run, robot, models).mean())


@cache
def _weights(run: Audited, robot: str) -> tuple[np.ndarray, np.ndarray]:
    """Weights of data sets and of test configurations, (replicates, members) each."""
    frame = run.table(f"results/weights/{robot}.parquet")
    found = [
        frame[frame["members"] == name].pivot(index="replicate", columns="number", values="count").to_numpy()
        for name in ("data sets", "test configurations")
    ]
    return found[0], found[1]


_CELL = r"([^/]+)/([^/]+)um/([^/]+)\.parquet"
CHECKS = (
    (re.compile(rf"results/metrics/{_CELL}"), metrics),
    (re.compile(rf"results/replicates/{_CELL}"), replicates),
    (re.compile(rf"results/accuracy/{_CELL}"), accuracy),
    (re.compile(r"results/bounds/([^/]+)\.parquet"), bounds),
    (re.compile(rf"results/expected/{_CELL}"), expected),
)
