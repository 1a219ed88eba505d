"""Metrics, replicates, accuracies, bounds and expectations from the files before them, by numpy, scipy and pinocchio."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from elastocal_proof.audit.estimates import of_length, points_of
from elastocal_proof.audit.findings import ROUNDING, SINGLE, Finding, compare, require, require_each_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from typing import Any

    from elastocal_proof.audit.audited import Audited

# From when on the mean of 1/c does not exist in practice (docs/study.md).
_TRUSTED_SPREAD = 0.25
# Lengths of a file whose scores are worked out again.
_LENGTHS = 3
# Sums of differences of nearly equal numbers, in percent.
_PERCENT = 600 * ROUNDING
# A bound is a mean over all data sets: of longer ones it would take minutes.
_SHORT = 12
_SCORES = ("k_sigma", "k_sigma_fixed_joints", "deviation", "initial_deviation")


@cache
def judge_on(run: Audited, robot: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What judges a model: on each test configuration the regressor of positions, its offset, and the deflection.

    Returns `slope` (tests, 3, n): by which compliances move the predicted position, m per rad/(N m); `offset` (tests, 3): exact
    prediction at the true compliances less the true position, m; `deflection` (tests, 3).
    """
    arm, (angles, wrench) = run.arm(robot), run.experiments(robot, test=True)
    end, truth = arm.end_effector, run.deflections(f"data/simulated/{robot}/test/ideal.parquet", arm.end_effector)[0, :, :3]
    slope = np.array([run.regressor(robot, 0, k, end, True)[:3] for k in range(len(truth))])
    pairs = zip(angles[0], wrench[0], strict=True)
    exact = [arm.deflection(q, w, end, run.wrench_at, arm.compliance)[:3] for q, w in pairs]
    return slope, np.array(exact) - truth, truth


def errors_of(run: Audited, robot: str, compliance: np.ndarray) -> np.ndarray:
    """Position errors (models, tests) in m of models (models, n)."""
    slope, offset, _ = judge_on(run, robot)
    return np.linalg.norm(np.einsum("tij,mj->mti", slope, compliance - run.arm(robot).compliance) + offset, axis=-1)


def moment(run: Audited, robot: str) -> np.ndarray:
    """Mean over the test configurations of A'A of the position, (n, n)."""
    slope = judge_on(run, robot)[0]
    return np.einsum("tki,tkj->ij", slope, slope) / len(slope)


def fixed_joints(strategy: Mapping[str, Any]) -> np.ndarray:
    """Joints that the paper's k_sigma counts alone (interpretation R10), from 0."""
    every = sorted({joint for stage in strategy["stages"] for joint in stage["joints"]})
    return np.array(strategy["stages"][-1].get("held") or every) - 1


def average(compliance: np.ndarray, method: str, weights: np.ndarray | None = None) -> np.ndarray:
    """Equation 12 over data sets (sets, n), each as often as its weight says."""
    counted = np.ones(len(compliance), int) if weights is None else weights
    if method == "median":
        return np.median(np.repeat(compliance, counted.astype(int), axis=0), axis=0)
    power = 1.0 if method == "compliance" else -1.0
    return np.average(compliance**power, axis=0, weights=counted) ** power


def _score(
    run: Audited, robot: str, strategy: str, compliance: np.ndarray, of_sets: np.ndarray, of_tests: np.ndarray
) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """Averaged compliances, relative stiffness errors in percent and the scores, with weights of data sets and tests."""
    read, truth = run.configuration["interpretations"], run.arm(robot).compliance
    mean = average(compliance, read["average"], of_sets)
    if read["deviation_of"] == "averaged_model":
        deviation = np.average(errors_of(run, robot, mean[None])[0], weights=of_tests)
    else:
        deviation = np.average(errors_of(run, robot, compliance).mean(axis=1), weights=of_sets)
    relative = 100 * (truth / mean - 1)
    size = np.average(np.linalg.norm(judge_on(run, robot)[2], axis=1), weights=of_tests)
    return mean, relative, [relative.sum(), relative[fixed_joints(run.strategies[strategy])].sum(), deviation, size]


def metrics(run: Audited, file: str, robot: str, noise_um: str, strategy: str) -> Iterator[Finding]:
    """Equations 12 to 15 at sampled lengths, from the identified compliances; standard errors from the replicates."""
    frame, arm = run.table(file), run.arm(robot)
    yield require_each_once(frame, length=range(1, run.configuration["configurations"] + 1))
    drawn = run.table(f"results/replicates/{robot}/{noise_um}um/{strategy}.parquet")
    of_sets, of_tests = weights_of(run, robot)
    for row in run.pick_rows(file, frame, _LENGTHS):
        at, compliance = f"length {row['length']:g}", _identified(run, robot, noise_um, strategy, row["length"])
        if np.isnan(compliance).any():
            # A score of data sets of which one determines nothing exists for none.
            yield require(f"no scores, {at}", "numpy", np.isnan(row["k_sigma"]), "a number")
            continue
        ones = np.ones(len(compliance)), np.ones(of_tests.shape[1])
        mean, relative, scores = _score(run, robot, strategy, compliance, *ones)
        yield compare(f"averaged compliances, {at}", "numpy", row.filter(regex=r"compliance_\d+$"), mean)
        yield compare(f"delta_k, {at}", "numpy", row.filter(regex=r"delta_k_\d+$"), relative, 0.0, _PERCENT)
        yield compare(f"k_sigma, {at}", "numpy", row[[*_SCORES[:2]]], scores[:2], 0.0, _PERCENT)
        yield compare(f"deviation, {at}", "pinocchio", row[[*_SCORES[2:]]], scores[2:], 1e-8)
        scaled = compliance / arm.compliance
        spread, share = (scaled.std(axis=0) / np.abs(scaled.mean(axis=0))).max(), (compliance <= 0).any(axis=1).mean()
        stored = row[["nonpositive_share", "relative_spread", "trustworthy"]].astype(float)
        trusted = share == 0 and spread <= _TRUSTED_SPREAD
        # A spread of noise-free estimates is a root of rounding.
        yield compare(f"whether to be trusted, {at}", "numpy", stored, [share, spread, trusted], 1e-6, 1e-7)
        there = drawn[drawn["length"] == row["length"]]
        yield compare(f"replicates, {at}", "counting", [len(there)], [len(of_sets)], 0.0)
        for name in _SCORES:
            error = there[name].std(ddof=1)
            yield compare(f"standard error of {name}, {at}", "pandas", row[f"{name}_std_error"], error, 1e-6, 1e-12)
        again = [average(compliance, run.configuration["interpretations"]["average"], each) for each in of_sets]
        stored = row.filter(regex=r"compliance_\d+_std_error$")
        yield compare(f"standard errors of compliances, {at}", "numpy", stored, np.std(again, axis=0, ddof=1), 1e-6, 1e-17)


def replicates(run: Audited, file: str, robot: str, noise_um: str, strategy: str) -> Iterator[Finding]:
    """Scores of sampled bootstrap replicates."""
    frame, (of_sets, of_tests) = run.table(file), weights_of(run, robot)
    lengths = range(1, run.configuration["configurations"] + 1)
    yield require_each_once(frame, replicate=range(1, len(of_sets) + 1), length=lengths)
    for row in run.pick_rows(file, frame):
        compliance, number = _identified(run, robot, noise_um, strategy, row["length"]), int(row["replicate"]) - 1
        if not np.isnan(compliance).any():
            *_, scores = _score(run, robot, strategy, compliance, of_sets[number], of_tests[number])
            at = f"replicate {number + 1}, length {row['length']:g}"
            yield compare(f"k_sigma, {at}", "numpy", row[[*_SCORES[:2]]], scores[:2], 0.0, _PERCENT)
            yield compare(f"deviation, {at}", "pinocchio", row[[*_SCORES[2:]]], scores[2:], 1e-8)


def accuracy(run: Audited, file: str, robot: str, noise_um: str, strategy: str) -> Iterator[Finding]:
    """What one data set gives, at a sampled length."""
    frame, truth = run.table(file), run.arm(robot).compliance
    yield compare("evaluated lengths", "counting", frame["length"], run.configuration["evaluation"]["lengths"], 0.0)
    for row in run.pick_rows(file, frame, 1):
        at, compliance = f"length {row['length']:g}", _identified(run, robot, noise_um, strategy, row["length"])
        if np.isnan(compliance).any():
            continue
        errors = errors_of(run, robot, compliance)
        squares, rank = (errors**2).mean(axis=1), int(np.ceil(0.95 * errors.shape[1])) - 1
        rms, p95 = np.sqrt(squares.mean()), np.sort(errors, axis=1)[:, rank].mean()
        stored, expected = row[["mean", "rms", "p95", "max"]], [errors.mean(), rms, p95, errors.max(axis=1).mean()]
        yield compare(f"errors of one data set, {at}", "pinocchio", stored, expected, 1e-8)
        error = squares.std() / np.sqrt(len(squares) - 1) / (2 * rms)
        yield compare(f"standard error of the RMS error, {at}", "numpy", row["rms_std_error"], error, 1e-5, 1e-15)
        relative = 100 * np.sqrt(((compliance / truth - 1) ** 2).mean(axis=0))
        stored = row.filter(regex=r"relative_error_\d+$")
        yield compare(f"relative errors of compliances, {at}", "numpy", stored, relative, 1e-8)


def bounds(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Cramér-Rao bounds of sampled sets of points and lengths, by pinocchio."""
    frame, sets = run.table(file), run.configuration["data_sets"]
    names = {"+".join(sorted(points_of(strategy))) for strategy in run.strategies.values()}
    counts, most = frame.groupby("points").size(), run.configuration["configurations"]
    yield require("sets of measuring points", "counting", set(counts.index) == names, f"{set(counts.index)}", len(names))
    yield compare("lengths of each", "counting", counts, [most] * len(names), 0.0)
    rows = frame[np.isfinite(frame["rms_per_noise"]) & (frame["length"] <= _SHORT)]
    for row in run.pick_rows(file, rows, 2):
        matrices = [run.regressors(robot, data_set, row["length"], row["points"].split("+")) for data_set in range(sets)]
        total = sum(np.trace(moment(run, robot) @ np.linalg.inv(matrix.T @ matrix)) for matrix in matrices)
        checked = f"bound of {row['points']}, length {row['length']}"
        yield compare(checked, "pinocchio", row["rms_per_noise"], np.sqrt(total / sets), 1e-6)


def expected(run: Audited, file: str, robot: str, noise_um: str, strategy: str) -> Iterator[Finding]:
    """Expectations in closed form at sampled lengths, from the covariances of the design."""
    frame, arm, read = run.table(file), run.arm(robot), run.configuration["interpretations"]
    covariances = run.table(f"results/design/{robot}/{strategy}.parquet").groupby("length")
    yield require_each_once(frame, length=range(1, len(frame) + 1))
    slope, offset, _ = judge_on(run, robot)
    triangle, free = np.tril_indices(arm.joints), arm.compliance
    for row in run.pick_rows(file, frame[frame["k_sigma"].notna()], _LENGTHS):
        length = int(row["length"])
        if run.has(f"results/identified/{robot}/0um/{strategy}.parquet"):
            free = average(_identified(run, robot, "0", strategy, length), read["average"])
        spread = np.zeros((arm.joints, arm.joints))
        of_length = covariances.get_group(length).filter(like="cov_").to_numpy(float)
        spread[triangle] = (1e-6 * float(noise_um)) ** 2 * of_length.mean(axis=0)
        if np.isnan(spread).any() or np.isnan(free).any():
            continue
        spread += np.tril(spread, -1).T
        mean = free / (1 + np.diag(spread) / free**2) if read["average"] == "stiffness" else free
        scatter = spread / len(of_length) if read["deviation_of"] == "averaged_model" else spread
        error = slope @ (mean - arm.compliance) + offset
        within = np.einsum("tki,ij,tlj->tkl", slope, scatter, slope)
        square = (error**2).sum(axis=1) + np.trace(within, axis1=1, axis2=2)
        variance = 2 * (within**2).sum(axis=(1, 2)) + 4 * np.einsum("tk,tkl,tl->t", error, within, error)
        with np.errstate(divide="ignore", invalid="ignore"):
            shape = square**2 / variance
            # Mean of the root of a gamma variable; its limit where nothing scatters.
            ratio = np.where(shape > 1e4, 1 - 0.125 / shape, np.exp(gammaln(shape + 0.5) - gammaln(shape)) / np.sqrt(shape))
        stored = row.filter(regex=r"compliance_\d+$")
        yield compare(f"expected compliances, length {length}", "numpy", stored, mean, SINGLE)
        deviation = float((np.sqrt(square) * ratio).mean())
        checked = f"expected deviation, length {length}"
        yield compare(checked, "Satterthwaite's gamma, scipy", row["deviation"], deviation, 1e-4)


def _identified(run: Audited, robot: str, noise_um: str, strategy: str, length: float) -> np.ndarray:
    """Identified compliances (sets, n) of one length."""
    return of_length(run.table(f"results/identified/{robot}/{noise_um}um/{strategy}.parquet"), int(length))


@cache
def weights_of(run: Audited, robot: str) -> tuple[np.ndarray, np.ndarray]:
    """Weights of data sets and of test configurations, (replicates, members) each."""
    frame = run.table(f"results/weights/{robot}.parquet")
    of_sets, of_tests = (
        frame[frame["members"] == name].pivot(index="replicate", columns="number", values="count").to_numpy()
        for name in ("data sets", "test configurations")
    )
    return of_sets, of_tests


CHECKS = {
    "results/metrics/{robot}/{noise_um}um/{strategy}.parquet": metrics,
    "results/replicates/{robot}/{noise_um}um/{strategy}.parquet": replicates,
    "results/accuracy/{robot}/{noise_um}um/{strategy}.parquet": accuracy,
    "results/bounds/{robot}.parquet": bounds,
    "results/expected/{robot}/{noise_um}um/{strategy}.parquet": expected,
}
