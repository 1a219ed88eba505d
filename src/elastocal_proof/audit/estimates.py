"""Identified compliances and their covariances by statsmodels' ordinary least squares, stage by stage; iterations by scipy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import statsmodels.api as sm
from scipy.optimize import least_squares

from elastocal_proof.audit.findings import ROUNDING, SINGLE, Finding, compare, require_each_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal_proof.audit.audited import Audited

# Beyond this a design counts as one that does not determine the compliances (equation 11 in double precision).
_LARGEST_CONDITION = 1e7
# Least squares lose digits by the condition number times those of a double (2e-16), here up to this condition number.
_EXACT_UP_TO = 1e4
# Gauss-Newton's own end, relative to the compliances.
_CONVERGED = 1e-6
_LINEAR, _ITERATED = "statsmodels on pinocchio", "scipy's least squares on pinocchio"


def solve_staged(
    strategy: Mapping[str, Any], regressors: Mapping[str, np.ndarray], deflections: Mapping[str, np.ndarray], joints: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """Compliances (joints,) by the stages of a strategy, their covariance for unit variance, the worst condition number.

    `regressors` (rows, joints), `deflections` (rows,): of each measuring point.
    """
    ends = np.cumsum([0, *map(len, regressors.values())])
    places = {name: np.arange(*ends[k : k + 2]) for k, name in enumerate(regressors)}
    compliance, gain, condition = np.full(joints, np.nan), np.zeros((joints, ends[-1])), 1.0
    for stage in strategy["stages"]:
        identified, taken = (np.array(stage.get(key, []), int) - 1 for key in ("joints", "held"))
        matrix, right, rows = (
            np.concatenate([each[name] for name in stage["points"]]) for each in (regressors, deflections, places)
        )
        fit = sm.OLS(right - matrix[:, taken] @ compliance[taken], matrix[:, identified]).fit()
        compliance[identified] = fit.params
        passed_on = -matrix[:, taken] @ gain[taken]
        passed_on[np.arange(len(rows)), rows] += 1.0
        gain[identified] = fit.model.pinv_wexog @ passed_on
        condition = max(condition, float(np.linalg.cond(matrix[:, identified])))
    return compliance, gain @ gain.T, condition


def points_of(strategy: Mapping[str, Any]) -> list[str]:
    """Measuring points that a strategy reads, each once."""
    return list(dict.fromkeys(name for stage in strategy["stages"] for name in stage["points"]))


def of_length(frame: pd.DataFrame, length: int) -> np.ndarray:
    """Identified compliances (sets, n) of one length, in the order of the data sets."""
    return frame[frame["length"] == length].sort_values("data_set").filter(regex=r"^c\d+$").to_numpy(float)


def design(run: Audited, file: str, robot: str, strategy: str) -> Iterator[Finding]:
    """Covariances and condition numbers of sampled data sets and lengths."""
    frame, triangle = run.table(file), np.tril_indices(run.arm(robot).joints)
    yield _require_prefixes(run, frame)
    for row in _sample(run, file, frame, strategy):
        _, spread, condition = _solve(run, robot, strategy, row, None)
        stored = row.filter(like="cov_").to_numpy(float)
        yield compare("covariance of a data set and length", "statsmodels", stored, spread[triangle], SINGLE)
        stored = np.log(row["condition"])
        yield compare("condition number", "numpy's singular values", stored, np.log(condition), 0, SINGLE)


def identified(run: Audited, file: str, robot: str, noise_um: str, strategy: str) -> Iterator[Finding]:
    """Compliances of sampled data sets and lengths; which of them there are."""
    frame, measured = run.table(file), f"data/simulated/{robot}/{noise_um}um/measured.parquet"
    yield _require_prefixes(run, frame)
    missing = frame.filter(regex=r"^c\d+$").isna().any(axis=1)
    short = ~frame["length"].map(lambda length: _is_solvable(run, strategy, length))
    undetermined = ~(run.table(f"results/design/{robot}/{strategy}.parquet")["condition"] < _LARGEST_CONDITION)
    yield compare("which prefixes determine the compliances", "counting", missing, short | undetermined, 0.0)
    for row in _sample(run, file, frame, strategy):
        stored = row.filter(regex=r"^c\d+$")
        checked = f"compliances of data set {int(row['data_set'])}, length {int(row['length'])}"
        if run.configuration["identification"]["solver"] == "gauss_newton":
            yield compare(checked, _ITERATED, stored, _iterate(run, robot, strategy, row, measured), _CONVERGED)
        else:
            expected, _, condition = _solve(run, robot, strategy, row, measured)
            yield compare(checked, _LINEAR, stored, expected, ROUNDING * max(1.0, condition / _EXACT_UP_TO))


def solvers(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Equation 11 and Gauss-Newton side by side, in sampled rows."""
    tables, frame = run.configuration["tables"], run.table(file)
    measured = f"data/simulated/{robot}/{tables['noise_um']:g}um/measured.parquet"
    rows = len(run.keys) * run.configuration["data_sets"]
    yield compare("strategies and data sets", "counting", [len(frame)], [rows], 0.0)
    for row in run.pick_rows(file, frame.assign(length=tables["length"]), 2):
        strategy, checked = run.keys[row["strategy"]], f"{row['strategy']}, data set {row['data_set']}"
        linear, _, condition = _solve(run, robot, strategy, row, measured)
        allowed = ROUNDING * max(1.0, condition / _EXACT_UP_TO)
        yield compare(f"equation 11, {checked}", _LINEAR, row.filter(like="equation_11"), linear, allowed)
        exact = _iterate(run, robot, strategy, row, measured)
        yield compare(f"Gauss-Newton, {checked}", _ITERATED, row.filter(like="gauss_newton"), exact, _CONVERGED)


def _require_prefixes(run: Audited, frame: pd.DataFrame) -> Finding:
    lengths = range(1, run.configuration["configurations"] + 1)
    return require_each_once(frame, data_set=range(run.configuration["data_sets"]), length=lengths)


def _is_solvable(run: Audited, strategy: str, length: int) -> bool:
    """Whether every stage has as many measurements as unknowns."""
    stages = run.strategies[strategy]["stages"]
    return all(run.rows * length * len(stage["points"]) >= len(stage["joints"]) for stage in stages)


def _sample(run: Audited, file: str, frame: pd.DataFrame, strategy: str) -> list[pd.Series]:
    """Sampled rows whose prefixes are long enough."""
    rows = run.pick_rows(file, frame)
    return [row for row in rows if _is_solvable(run, strategy, int(row["length"])) and row.notna().all()]


def _solve(run: Audited, robot: str, key: str, row: pd.Series, measured: str | None) -> tuple[np.ndarray, np.ndarray, float]:
    """`solve_staged` for a row's data set and length; without measurements for the covariance alone."""
    strategy, data_set, length = run.strategies[key], int(row["data_set"]), int(row["length"])
    matrices = {name: run.regressors(robot, data_set, length, [name]) for name in points_of(strategy)}
    right = {name: np.zeros(len(matrix)) for name, matrix in matrices.items()}
    if measured is not None:
        right = {name: run.deflections(measured, name)[data_set, :length, : run.rows].ravel() for name in matrices}
    return solve_staged(strategy, matrices, right, run.arm(robot).joints)


def _iterate(run: Audited, robot: str, key: str, row: pd.Series, measured: str) -> np.ndarray:
    """Nonlinear least squares on exact deflections, stage by stage."""
    arm, data_set, length = run.arm(robot), int(row["data_set"]), int(row["length"])
    angles, wrench = (each[data_set, :length] for each in run.experiments(robot))
    compliance = np.full(arm.joints, 1e-6 * run.configuration["identification"]["start_urad_per_Nm"])

    def differences(scaled: np.ndarray, joints: np.ndarray, points: Sequence[str]) -> np.ndarray:
        trial = compliance.copy()
        trial[joints] = 1e-6 * scaled
        rows = []
        for point in points:
            here = [arm.deflection(q, w, point, run.wrench_at, trial) for q, w in zip(angles, wrench, strict=True)]
            rows.append((here - run.deflections(measured, point)[data_set, :length])[:, : run.rows].ravel())
        return 1e3 * np.concatenate(rows)

    ends: dict[str, Any] = {"xtol": 1e-13, "ftol": 1e-15, "gtol": 1e-13, "jac": "3-point"}
    for stage in run.strategies[key]["stages"]:
        joints = np.array(stage["joints"]) - 1
        fit = least_squares(differences, 1e6 * compliance[joints], args=(joints, stage["points"]), **ends)
        compliance[joints] = 1e-6 * fit.x
    return compliance


CHECKS = {
    "results/design/{robot}/{strategy}.parquet": design,
    "results/identified/{robot}/{noise_um}um/{strategy}.parquet": identified,
    "results/solvers/{robot}.parquet": solvers,
}
