"""Identified compliances and their covariances by statsmodels' ordinary least squares, stage by stage; iterations by scipy."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import statsmodels.api as sm
from scipy.optimize import least_squares

from elastocal.audit.findings import ROUNDING, SINGLE, Finding, compared

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from elastocal.audit.audited import Audited

# Beyond this a design counts as one that does not determine the compliances (equation 11 in double precision).
_LARGEST_CONDITION = 1e7
# Least squares lose digits by the condition number times those of a double (2e-16), here up to this condition number.
_EXACT_UP_TO = 1e4
# Gauss-Newton's own end, relative to the compliances.
_CONVERGED = 1e-6


def staged(
    strategy: Mapping[str, Any], regressors: Mapping[str, np.ndarray], deflections: Mapping[str, np.ndarray], joints: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Compliances by the stages of a strategy, their covariance for unit variance, the worst condition number.

    `strategy`: a strategy file. `regressors` (rows, joints): of each measuring point. `deflections` (rows,). Returns
    `compliance` (joints,); `covariance` (joints, joints).
    """
    names = list(regressors)
    starts = np.cumsum([0, *(len(regressors[name]) for name in names)])
    places = {name: np.arange(starts[k], starts[k + 1]) for k, name in enumerate(names)}
    compliance, gain, condition = np.full(joints, np.nan), np.zeros((joints, starts[-1])), 1.0
    for stage in strategy["stages"]:
        identified, taken = (np.array(stage.get(key, []), int) - 1 for key in ("joints", "held"))
        matrix = np.concatenate([regressors[name] for name in stage["points"]])
        right = np.concatenate([deflections[name] for name in stage["points"]])
        rows = np.concatenate([places[name] for name in stage["points"]])
        fit = sm.OLS(right - matrix[:, taken] @ compliance[taken], matrix[:, identified]).fit()
        compliance[identified] = fit.params
        passed_on = -matrix[:, taken] @ gain[taken]
        passed_on[np.arange(len(rows)), rows] += 1.0
        gain[identified] = fit.model.pinv_wexog @ passed_on
        condition = max(condition, float(np.linalg.cond(matrix[:, identified])))
    return compliance, gain @ gain.T, condition


def solvable(strategy: Mapping[str, Any], rows: int, length: int) -> bool:
    """Whether every stage has as many measurements as unknowns."""
    return all(rows * length * len(stage["points"]) >= len(stage["joints"]) for stage in strategy["stages"])


def points_of(strategy: Mapping[str, Any]) -> list[str]:
    """Measuring points that a strategy reads, each once."""
    return list(dict.fromkeys(name for stage in strategy["stages"] for name in stage["points"]))


def design(run: Audited, file: str, robot: str, key: str) -> list[Finding]:
    """Covariances and condition numbers of sampled data sets and lengths.

    `key`: name of the strategy's file.
    """
    frame, joints = run.table(file), run.arm(robot).joints
    found = [_numbered(run, file, frame)]
    covariances, conditions = [], []
    for row in _sampled(run, file, frame, key):
        _, spread, condition = _solved(run, robot, key, row, None)
        covariances.append((row.filter(like="cov_").to_numpy(float), spread[np.tril_indices(joints)]))
        conditions.append((row["condition"], condition))
    for stored, expected in covariances:
        found.append(compared(file, "covariance of a data set and length", "statsmodels", stored, expected, SINGLE))
    logarithms = np.log(np.reshape(conditions, (-1, 2)))
    found.append(compared(file, "condition numbers", "numpy's singular values", logarithms[:, 0], logarithms[:, 1], 0, SINGLE))
    return found


def identified(run: Audited, file: str, robot: str, noise_um: str, key: str) -> list[Finding]:
    """Compliances of sampled data sets and lengths; which of them there are."""
    frame, strategy = run.table(file), run.strategies[key]
    found = [_numbered(run, file, frame)]
    missing = frame.filter(regex=r"^c\d+$").isna().any(axis=1).to_numpy()
    lengths = frame["length"].to_numpy()
    short = np.array([not solvable(strategy, run.rows, int(length)) for length in range(1, lengths.max() + 1)])[lengths - 1]
    undetermined = ~(run.table(f"results/design/{robot}/{key}.parquet")["condition"] < _LARGEST_CONDITION).to_numpy()
    found.append(compared(file, "which prefixes determine the compliances", "counting", missing, short | undetermined, 0.0))
    exactly = run.configuration["identification"]["solver"] == "gauss_newton"
    start = 1e-6 * run.configuration["identification"]["start_urad_per_Nm"]
    for row in _sampled(run, file, frame, key):
        stored = row.filter(regex=r"^c\d+$").to_numpy(float)
        measured = f"data/simulated/{robot}/{noise_um}um/measured.parquet"
        checked = f"compliances of data set {int(row['data_set'])}, length {int(row['length'])}"
        if exactly:
            expected = _iterated(run, robot, key, row, measured, start)
            found.append(compared(file, checked, "scipy's least squares on pinocchio", stored, expected, _CONVERGED))
        else:
            expected, _, condition = _solved(run, robot, key, row, measured)
            allowed = ROUNDING * max(1.0, condition / _EXACT_UP_TO)
            found.append(compared(file, checked, "statsmodels on pinocchio", stored, expected, allowed))
    return found


def solvers(run: Audited, file: str, robot: str) -> list[Finding]:
    """Both solvers side by side, in sampled rows."""
    tables, frame = run.configuration["tables"], run.table(file)
    measured = f"data/simulated/{robot}/{tables['noise_um']:g}um/measured.parquet"
    start = 1e-6 * run.configuration["identification"]["start_urad_per_Nm"]
    keys = {document["name"]: key for key, document in run.strategies.items()}
    expected_rows = len(keys) * run.configuration["data_sets"]
    found = [compared(file, "strategies and data sets", "counting", [len(frame)], [expected_rows], 0.0)]
    for place in run.picked(file, len(frame), 2):
        row = frame.iloc[place].copy()
        row["length"], key = tables["length"], keys[row["strategy"]]
        linear, _, condition = _solved(run, robot, key, row, measured)
        exact = _iterated(run, robot, key, row, measured, start)
        checked = f"{row['strategy']}, data set {row['data_set']}"
        allowed = ROUNDING * max(1.0, condition / _EXACT_UP_TO)
        stored = [row.filter(like=name).to_numpy(float) for name in ("equation_11", "gauss_newton")]
        found.append(compared(file, f"equation 11, {checked}", "statsmodels on pinocchio", stored[0], linear, allowed))
        by = "scipy's least squares on pinocchio"
        found.append(compared(file, f"Gauss-Newton, {checked}", by, stored[1], exact, _CONVERGED))
    return found


def _numbered(run: Audited, file: str, frame: pd.DataFrame) -> Finding:
    sets, lengths = run.configuration["data_sets"], run.configuration["configurations"]
    expected = np.stack([np.repeat(np.arange(sets), lengths), np.tile(np.arange(1, lengths + 1), sets)], axis=1)
    stored = frame[["data_set", "length"]].to_numpy()
    return compared(file, "data sets and lengths, each once", "counting", stored, expected, 0.0)


def _sampled(run: Audited, file: str, frame: pd.DataFrame, key: str) -> list[pd.Series]:
    """Sampled rows whose prefixes are long enough."""
    rows = [frame.iloc[place] for place in run.picked(file, len(frame))]
    return [row for row in rows if solvable(run.strategies[key], run.rows, int(row["length"])) and row.notna().all()]


def _solved(run: Audited, robot: str, key: str, row: pd.Series, measured: str | None) -> tuple[np.ndarray, np.ndarray, float]:
    """`staged` for a row's data set and length; without measurements for the covariance alone."""
    strategy, data_set, length = run.strategies[key], int(row["data_set"]), int(row["length"])
    names = points_of(strategy)
    regressors = {name: run.stacked(robot, data_set, length, [name]) for name in names}
    if measured is None:
        right = {name: np.zeros(len(matrix)) for name, matrix in regressors.items()}
    else:
        right = {name: run.deflections(measured, name)[data_set, :length, : run.rows].ravel() for name in names}
    return staged(strategy, regressors, right, run.arm(robot).joints)


def _iterated(run: Audited, robot: str, key: str, row: pd.Series, measured: str, start: float) -> np.ndarray:
    """Nonlinear least squares on exact deflections, stage by stage."""
    arm, data_set, length = run.arm(robot), int(row["data_set"]), int(row["length"])
    angles, wrench = (each[data_set, :length] for each in run.experiments(robot))
    compliance = np.full(arm.joints, start)

    def differences(scaled: np.ndarray, joints: np.ndarray, points: Sequence[str]) -> np.ndarray:
        trial = compliance.copy()
        trial[joints] = 1e-6 * scaled
        rows = []
        for point in points:
            there = run.deflections(measured, point)[data_set, :length]
            here = [arm.deflection(q, w, point, run.wrench_at, trial) for q, w in zip(angles, wrench, strict=True)]
            rows.append((np.array(here) - there)[:, : run.rows].ravel())
        return 1e3 * np.concatenate(rows)

    for stage in run.strategies[key]["stages"]:
        joints = np.array(stage["joints"]) - 1
        fit = least_squares(
            differences,
            1e6 * compliance[joints],
            args=(joints, stage["points"]),
            xtol=1e-13,
            ftol=1e-15,
            gtol=1e-13,
            jac="3-point",
        )
        compliance[joints] = 1e-6 * fit.x
    return compliance


CHECKS = (
    (re.compile(r"results/design/([^/]+)/([^/]+)\.parquet"), design),
    (re.compile(r"results/identified/([^/]+)/([^/]+)um/([^/]+)\.parquet"), identified),
    (re.compile(r"results/solvers/([^/]+)\.parquet"), solvers),
)
