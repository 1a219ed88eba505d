"""The research questions' files: data sets drawn again from their streams, estimated by statsmodels, judged by pinocchio.

Of places on the arm only the end-effector's part is worked out again; the rest is held against what must be true of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import statsmodels.api as sm

from elastocal_proof.audit.estimates import of_length, points_of, solve_staged
from elastocal_proof.audit.findings import Finding, compare, require, require_each_once
from elastocal_proof.audit.scores import average, errors_of, moment
from elastocal_proof.audit.streams import draw, numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from elastocal_proof.audit.audited import Audited

# Estimates of single data sets on exact deflections, whose least squares lose digits.
_CLOSE = 1e-6
_BY = "statsmodels on pinocchio"
# Further studies at longer lengths would take minutes.
_SHORT = 5


def simulate(run: Audited, robot: str, data_set: int, count: int, stream: str) -> tuple[np.ndarray, np.ndarray]:
    """Regressors (rows, n) and measured deflections (rows,) of a point in a data set; `stream` is the point, perhaps /again."""
    arm, point, pairs = run.arm(robot), stream.removesuffix("/again"), zip(*draw(run, robot, data_set, count), strict=True)
    loads = [(*pair, point, run.wrench_at) for pair in pairs]
    matrix = np.array([arm.regressor(*load)[: run.rows] for load in loads])
    random = numbers(run.seed, robot, f"noise/{stream}", data_set).standard_normal((count, 6))
    measured = np.array([arm.deflection(*load) for load in loads]) + run.noise_m * random
    return matrix.reshape(-1, arm.joints), measured[:, : run.rows].ravel()


def estimate(run: Audited, robot: str, strategy: str, data_set: int, length: int) -> np.ndarray:
    """Compliances by a strategy, named as printed, from a data set drawn again."""
    document = run.strategies[run.keys[strategy]]
    pairs = {name: simulate(run, robot, data_set, length, name) for name in points_of(document)}
    matrices, rights = ({name: pair[k] for name, pair in pairs.items()} for k in (0, 1))
    return solve_staged(document, matrices, rights, run.arm(robot).joints)[0]


def _compare_worth(
    run: Audited, robot: str, at: str, row: pd.Series, matrix: np.ndarray, right: np.ndarray
) -> Iterator[Finding]:
    """Mean square error and Cramér-Rao bound of a data set."""
    error = (errors_of(run, robot, sm.OLS(right, matrix).fit().params[None]) ** 2).mean()
    yield compare(f"error, {at}", _BY, row["mean_square"], error, _CLOSE)
    yield compare(f"bound, {at}", "pinocchio", row["bound"], _bound(run, robot, matrix), _CLOSE)


def _bound(run: Audited, robot: str, matrix: np.ndarray) -> float:
    """Least mean square position error, m^2."""
    return float(run.noise_m**2 * np.trace(moment(run, robot) @ np.linalg.inv(matrix.T @ matrix)))


def budget(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Errors and bounds of sampled sets of points, data sets and lengths."""
    frame, arm, sets = run.table(file), run.arm(robot), run.configuration["questions"]["point_sets"]
    there = {name: points for name, points in sets.items() if set(points) <= set(arm.points)}
    rows = len(there) * run.configuration["data_sets"] * run.configuration["configurations"]
    yield compare("rows of each set of points", "counting", [len(frame)], [rows], 0.0)
    for row in run.pick_rows(file, frame, 3):
        points, length, data_set = there[row["points"]], int(row["length"]), int(row["data_set"])
        if run.rows * length * len(points) < arm.joints or np.isnan(row["mean_square"]):
            continue
        read = [name + "/again" * (name in points[:k]) for k, name in enumerate(points)]
        pairs = [simulate(run, robot, data_set, length, name) for name in read]
        both = (np.concatenate(each) for each in zip(*pairs, strict=True))
        yield from _compare_worth(run, robot, f"{row['points']}, data set {data_set}, length {length}", row, *both)


def observability(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Observability indices, bounds and errors of sampled data sets."""
    frame, arm, length = run.table(file), run.arm(robot), run.configuration["tables"]["length"]
    yield require_each_once(frame, data_set=range(run.configuration["data_sets"]))
    for row in run.pick_rows(file, frame, 3):
        matrix, right = simulate(run, robot, int(row["data_set"]), length, arm.end_effector)
        values, at = np.linalg.svd(matrix * arm.compliance, compute_uv=False), f"data set {int(row['data_set'])}"
        size, largest, least = np.prod(values) ** (1 / len(values)) / np.sqrt(length), values[0], values[-1]
        expected = [size, least / largest, least, least**2 / largest, 1 / (1 / values).sum()]
        stored = row[[f"O{number}" for number in range(1, 6)]]
        yield compare(f"O1 to O5, {at}", "numpy's singular values", stored, expected, _CLOSE, scale=expected)
        yield from _compare_worth(run, robot, at, row, matrix, right)


def uses(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Errors on the test configurations: of all data sets from the identified compliances, of sampled rows by statsmodels."""
    frame, length = run.table(file), run.configuration["tables"]["length"]
    rows = len(run.strategies) * run.configuration["data_sets"]
    yield compare("strategies and data sets", "counting", [len(frame)], [rows], 0.0)
    for row in run.pick_rows(file, frame, 3):
        compliance = estimate(run, robot, row["strategy"], int(row["data_set"]), length)
        expected = _pool(errors_of(run, robot, compliance[None]))
        names = ["mean", "mean_square", "p95"]
        checked, scale = f"errors, {row['strategy']}, data set {row['data_set']}", [expected[name] for name in names]
        yield compare(checked, _BY, row[names], scale, _CLOSE, scale=scale)
    path = frame.dropna(subset="path_max")
    ordered = (path["path_mean_square"] <= path["path_max"] ** 2 * (1 + 1e-12)).all()
    yield require(
        "mean square below the largest", "pandas", ordered, "a mean square above the square of the largest", len(path)
    )
    for name, key in run.keys.items():
        mine = frame[frame["strategy"] == name].sort_values("data_set")
        compliance = of_length(run.cell("identified", robot, key), length)
        pooled = {} if np.isnan(compliance).any() else _pool(errors_of(run, robot, compliance))
        for score, values in pooled.items():
            checked = f"{score} of all data sets, {name}"
            yield compare(checked, "numpy on the identified compliances", mine[score], values, _CLOSE)


def _pool(errors: np.ndarray) -> dict[str, np.ndarray]:
    """Scores of every data set from its errors (sets, tests), its part in the quantile of all errors among them.

    A quantile moves with a data set by the share of its errors beyond it less that of all, over the density there, which is the
    share between two quantiles on either side over their distance (Bahadur's representation).
    """
    before, pooled, behind = np.quantile(errors, [0.94, 0.95, 0.96])
    return {
        "mean": errors.mean(axis=1),
        "mean_square": (errors**2).mean(axis=1),
        "p95": np.quantile(errors, 0.95, axis=1),
        "pooled_p95": np.full(len(errors), pooled),
        "pooled_p95_influence": ((errors > pooled).mean(axis=1) - 0.05) * (behind - before) / 0.02,
    }


def tubes(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Deflections of sampled data sets with tubes of other diameters."""
    frame, settings = run.table(file), run.configuration
    factors, outer = settings["questions"]["tube_factors"], run.robots[robot]["links"]["tubes"][0]["outer_diameter_m"]
    expected = np.repeat(outer * np.array(factors), settings["data_sets"])
    yield compare("diameters", "counting", frame["diameter"], expected, 1e-12)
    for row in run.pick_rows(file, frame, 2):
        data_set, factor = int(row["data_set"]), factors[int(np.argmin(np.abs(outer * np.array(factors) - row["diameter"])))]
        arm, pairs = (
            run.arm(robot, factor),
            zip(*draw(run, robot, data_set, settings["configurations"], diameter=factor), strict=True),
        )
        moved = np.linalg.norm([arm.deflection(*pair, arm.end_effector, run.wrench_at)[:3] for pair in pairs], axis=1)
        scale = [moved.mean(), (moved**2).mean(), moved.max()]
        checked, stored = f"tube of {row['diameter']:.4g} m, data set {data_set}", row[["mean", "mean_square", "maximum"]]
        yield compare(checked, "pinocchio", stored, scale, 1e-8, scale=scale)


def weighting(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Equal weights against those of the noise, in a sampled row, by the sandwich over all data sets."""
    frame, settings, arm = run.table(file), run.configuration, run.arm(robot)
    best = (frame["weighted"] <= frame["equal"] * (1 + 1e-12)).all()
    yield require("weights of the noise are never worse", "Aitken's theorem", best, "equal weights are better", len(frame))
    for row in run.pick_rows(file, frame, 1):
        sums = np.zeros(2)
        for data_set in range(settings["data_sets"]):
            rows, spread = [], []
            for q, w in zip(*draw(run, robot, data_set, settings["tables"]["length"]), strict=True):
                rows.append(arm.regressor(q, w, arm.end_effector, run.wrench_at))
                # Without the tool's offset: the tracker sees the end-effector.
                away = np.linalg.norm(arm.pose(arm.extend(q), arm.end_effector)[0] - settings["questions"]["tracker_m"])
                position = np.hypot(run.noise_m, row["per_metre"] * away)
                spread.append(np.repeat([position, row["orientation_ratio"] * run.noise_m], 3))
            matrix, deviation = np.concatenate(rows), np.concatenate(spread)
            for k, gain in enumerate((np.linalg.pinv(matrix) * deviation, np.linalg.pinv(matrix / deviation[:, None]))):
                sums[k] += np.trace(moment(run, robot) @ gain @ gain.T)
        at = f"ratio {row['orientation_ratio']:g}, {row['per_metre']:g} per metre"
        yield compare(f"errors, {at}", "pinocchio", row[["equal", "weighted"]], np.sqrt(sums / settings["data_sets"]), _CLOSE)


def places(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Bounds of the end-effector alone, in sampled data sets; shares, and what a second target can do."""
    frame, arm, length = run.table(file), run.arm(robot), run.configuration["tables"]["length"]
    shares = frame[["turned", "fixed"]].to_numpy()
    within = ((shares >= 0) & (shares <= 1)).all()
    yield require("shares lie between 0 and 1", "pandas", within, "one outside", shares.size)
    seen = (shares[:, 1] <= shares[:, 0] + 1e-12).all()
    yield require("a turned reflector is seen as often as a fixed one", "pandas", seen, "one less often", len(frame))
    for data_set in run.pick(file, frame["data_set"].nunique(), 2):
        # Twice as many configurations as the second target shares.
        pairs = zip(*draw(run, robot, int(data_set), 2 * length), strict=True)
        rows = np.concatenate([arm.regressor(*pair, arm.end_effector, run.wrench_at)[: run.rows] for pair in pairs])
        mine = frame[frame["data_set"] == data_set]
        least, alone = np.full(len(mine), _bound(run, robot, rows)), _bound(run, robot, rows[: len(rows) // 2])
        checked = f"bound of the end-effector, data set {data_set}"
        yield compare(checked, "pinocchio", mine["bound_end_effector"], least, _CLOSE)
        helps = (mine["bound"] <= alone * (1 + 1e-9)).all()
        yield require(f"a second target never harms, data set {data_set}", "pinocchio", helps, "one does", len(mine))


def studies(run: Audited, file: str, interpretation: str, robot: str) -> Iterator[Finding]:
    """Sums of stiffness errors; scores of a sampled further study at its shortest lengths, drawn and estimated again."""
    frame, settings = run.table(file), run.configuration
    sizes, sets = frame.groupby("study").size(), settings["data_sets"]
    expected = np.full(len(sizes), len(run.strategies) * settings["configurations"])
    yield compare("strategies and lengths of each study", "counting", sizes, expected, 0.0)
    known = frame[frame["k_sigma"].notna()]
    sums = 100 * (run.arm(robot).compliance / known.filter(regex=r"compliance_\d+$") - 1).sum(axis=1)
    yield compare("k_sigma of the averaged compliances", "numpy", known["k_sigma"], sums, _CLOSE, 1e-6, sums)
    rows = frame[(frame["length"] <= _SHORT) & frame["k_sigma"].notna() & (interpretation == "as_configured")]
    for row in run.pick_rows(file, rows, 1) if len(rows) else ():
        length, first = int(row["length"]), int(row["study"]) * sets
        estimates = [estimate(run, robot, row["strategy"], data_set, length) for data_set in range(first, first + sets)]
        mean = average(np.array(estimates), settings["interpretations"]["average"])
        at = f"{row['strategy']}, study {row['study']}, length {length}"
        yield compare(f"averaged compliances, {at}", _BY, row.filter(regex=r"compliance_\d+$"), mean, _CLOSE)
        sums = 100 * (run.arm(robot).compliance / mean - 1).sum()
        yield compare(f"k_sigma, {at}", "numpy", row["k_sigma"], sums, 0.0, 1e-4)


CHECKS = {
    "results/budget/{robot}.parquet": budget,
    "results/observability/{robot}.parquet": observability,
    "results/uses/{robot}.parquet": uses,
    "results/tubes/{robot}.parquet": tubes,
    "results/weighting/{robot}.parquet": weighting,
    "results/places/{robot}.parquet": places,
    "results/studies/{interpretation}/{robot}.parquet": studies,
}
