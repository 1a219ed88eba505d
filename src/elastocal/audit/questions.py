"""The research questions' files: data sets drawn again from their streams, estimated by statsmodels, judged by pinocchio.

Of places on the arm only the end-effector's part is worked out again; the rest is held against what must be true of it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import statsmodels.api as sm

from elastocal.audit.estimates import points_of, staged
from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.scores import averaged, error_rows, errors_of, moment
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

# Estimates of single data sets on exact deflections, whose least squares lose digits.
_CLOSE = 1e-6


def drawn(
    run: Audited,
    robot: str,
    data_set: int,
    count: int,
    diameter: float = 1.0,
    purpose: str = "identification",
    joint_range: str = "",
) -> tuple[list[Any], list[Any]]:
    """Joint angles and wrenches of a data set from its streams, whether or not a file has them."""
    arm, settings = run.arm(robot, diameter), run.configuration
    low, high = np.full(arm.joints, -np.pi), np.full(arm.joints, np.pi)
    if (joint_range or settings["interpretations"]["joint_range"]) == "limits":
        low, high = np.deg2rad(run.robots[robot]["joint_limits_deg"]).T
    total = settings["configurations"]
    # A stream gives the first configurations whatever their number.
    turns = numbers(run.seed, robot, f"{purpose}/joint angles", data_set).random((max(count, total), arm.joints))[:count]
    normal = numbers(run.seed, robot, f"{purpose}/force", data_set).standard_normal((max(count, total), 3))[:count]
    angles = low + (high - low) * turns
    force = settings["loading"]["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
    lever = np.array(settings["loading"]["offset_m"], float)
    wrenches = []
    for q, f in zip(angles, force, strict=True):
        in_tool = settings["interpretations"]["offset_frame"] == "tool"
        arm_of_force = arm.pose(arm.unloaded(q), arm.end_effector)[1] @ lever if in_tool else lever
        wrenches.append(np.concatenate([f, np.cross(arm_of_force, f)]))
    return list(angles), wrenches


def simulated(
    run: Audited, robot: str, data_set: int, count: int, stream: str, diameter: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Regressors (rows, n) and measured deflections (rows,) of a point in a data set; `stream` is the point, perhaps /again."""
    arm, noise = run.arm(robot, diameter), 1e-6 * run.configuration["tables"]["noise_um"]
    point = stream.removesuffix("/again")
    angles, wrenches = drawn(run, robot, data_set, count, diameter)
    pairs = list(zip(angles, wrenches, strict=True))
    matrix = np.array([arm.regressor(q, w, point, run.wrench_at)[: run.rows] for q, w in pairs])
    exact = np.array([arm.deflection(q, w, point, run.wrench_at) for q, w in pairs])
    random = numbers(run.seed, robot, f"noise/{stream}", data_set).standard_normal((count, 6))
    return matrix.reshape(-1, arm.joints), (exact + noise * random)[:, : run.rows].ravel()


def mean_square(run: Audited, robot: str, compliance: np.ndarray) -> float:
    """Mean square position error of a model on the test configurations, m^2."""
    return float((errors_of(run, robot, compliance[None]) ** 2).mean())


def budget(run: Audited, file: str, robot: str) -> list[Finding]:
    """Errors and bounds of sampled sets of points, data sets and lengths."""
    frame, questions = run.table(file), run.configuration["questions"]
    there = {name: points for name, points in questions["point_sets"].items() if set(points) <= set(run.arm(robot).points)}
    sets, lengths = run.configuration["data_sets"], run.configuration["configurations"]
    found = [compared(file, "rows of each set of points", "counting", [len(frame)], [len(there) * sets * lengths], 0.0)]
    noise, joints = 1e-6 * run.configuration["tables"]["noise_um"], run.arm(robot).joints
    for place in run.picked(file, len(frame), 3):
        row = frame.iloc[place]
        points, length = there[row["points"]], int(row["length"])
        if run.rows * length * len(points) < joints or np.isnan(row["mean_square"]):
            continue
        read = [name + "/again" * (name in points[:k]) for k, name in enumerate(points)]
        pairs = [simulated(run, robot, int(row["data_set"]), length, name) for name in read]
        matrix, right = (np.concatenate(each) for each in zip(*pairs, strict=True))
        compliance = sm.OLS(right, matrix).fit().params
        at = f"{row['points']}, data set {row['data_set']}, length {length}"
        found.append(
            compared(
                file,
                f"error, {at}",
                "statsmodels on pinocchio",
                row["mean_square"],
                mean_square(run, robot, compliance),
                _CLOSE,
            )
        )
        least = noise**2 * np.trace(moment(run, robot) @ np.linalg.inv(matrix.T @ matrix))
        found.append(compared(file, f"bound, {at}", "pinocchio", row["bound"], least, _CLOSE))
    return found


def observability(run: Audited, file: str, robot: str) -> list[Finding]:
    """Observability indices, bounds and errors of sampled data sets."""
    frame, arm, tables = run.table(file), run.arm(robot), run.configuration["tables"]
    found = [
        compared(file, "data sets, each once", "counting", frame["data_set"], np.arange(run.configuration["data_sets"]), 0.0)
    ]
    length = tables["length"]
    for place in run.picked(file, len(frame), 3):
        row = frame.iloc[place]
        matrix, right = simulated(run, robot, int(row["data_set"]), length, arm.end_effector)
        values = np.linalg.svd(matrix * arm.compliance, compute_uv=False)
        expected = [
            np.prod(values) ** (1 / len(values)) / np.sqrt(length),
            values[-1] / values[0],
            values[-1],
            values[-1] ** 2 / values[0],
            1 / (1 / values).sum(),
        ]
        at = f"data set {int(row['data_set'])}"
        for number, one in enumerate(expected, 1):
            found.append(compared(file, f"O{number}, {at}", "numpy's singular values", row[f"O{number}"], one, _CLOSE))
        least = (1e-6 * tables["noise_um"]) ** 2 * np.trace(moment(run, robot) @ np.linalg.inv(matrix.T @ matrix))
        found.append(compared(file, f"bound, {at}", "pinocchio", row["bound"], least, _CLOSE))
        error = mean_square(run, robot, sm.OLS(right, matrix).fit().params)
        found.append(compared(file, f"error, {at}", "statsmodels on pinocchio", row["mean_square"], error, _CLOSE))
    return found


def uses(run: Audited, file: str, robot: str) -> list[Finding]:
    """Errors on the test configurations: of all data sets from the identified compliances, of sampled rows by statsmodels."""
    frame, length = run.table(file), run.configuration["tables"]["length"]
    rows = len(run.strategies) * run.configuration["data_sets"]
    found = [compared(file, "strategies and data sets", "counting", [len(frame)], [rows], 0.0)]
    for place in run.picked(file, len(frame), 3):
        row = frame.iloc[place]
        strategy = run.strategy_named[row["strategy"]]
        pairs = {name: simulated(run, robot, int(row["data_set"]), length, name) for name in points_of(strategy)}
        matrices, rights = ({name: pair[k] for name, pair in pairs.items()} for k in (0, 1))
        compliance = staged(strategy, matrices, rights, run.arm(robot).joints)[0]
        errors = errors_of(run, robot, compliance[None])[0]
        expected = [errors.mean(), (errors**2).mean(), np.quantile(errors, 0.95)]
        at = f"{row['strategy']}, data set {row['data_set']}"
        for name, one in zip(("mean", "mean_square", "p95"), expected, strict=True):
            found.append(compared(file, f"{name}, {at}", "statsmodels on pinocchio", row[name], one, _CLOSE))
    path = frame.dropna(subset="path_max")
    ordered = bool((path["path_mean_square"] <= path["path_max"] ** 2 * (1 + 1e-12)).all())
    found.append(
        held(file, "mean square below the largest", "pandas", ordered, "a mean square above the square of the largest")
    )
    for key, strategy in run.strategies.items():
        mine = frame[frame["strategy"] == strategy["name"]].sort_values("data_set")
        identified = run.cell("identified", robot, key)
        compliance = identified[identified["length"] == length].sort_values("data_set").filter(regex=r"^c\d+$").to_numpy(float)
        if np.isnan(compliance).any():
            continue
        for name, scores in _pooled(errors_of(run, robot, compliance)).items():
            checked, by = f"{name} of all data sets, {strategy['name']}", "numpy on the identified compliances"
            found.append(compared(file, checked, by, mine[name], scores, _CLOSE))
    return found


def _pooled(errors: np.ndarray) -> dict[str, np.ndarray]:
    """Scores of every data set from its errors (sets, tests), its part in the quantile of all errors among them.

    A quantile moves with a data set by the share of its errors beyond it less that of all, over the density there, which is the
    share between two quantiles on either side over their distance (Bahadur's representation).
    """
    before, pooled, behind = np.quantile(errors, [0.94, 0.95, 0.96])
    beyond = (errors > pooled).mean(axis=1)
    return {
        "mean": errors.mean(axis=1),
        "mean_square": (errors**2).mean(axis=1),
        "p95": np.quantile(errors, 0.95, axis=1),
        "pooled_p95": np.full(len(errors), pooled),
        "pooled_p95_influence": (beyond - 0.05) * (behind - before) / 0.02,
    }


def tubes(run: Audited, file: str, robot: str) -> list[Finding]:
    """Deflections of sampled data sets with tubes of other diameters, and what joint springs alone leave."""
    frame, settings = run.table(file), run.configuration
    factors, outer = settings["questions"]["tube_factors"], run.robots[robot]["links"]["tubes"][0]["outer_diameter_m"]
    sets = settings["data_sets"]
    found = [compared(file, "diameters", "counting", frame["diameter"], np.repeat(outer * np.array(factors), sets), 1e-12)]
    for place in run.picked(file, len(frame), 2):
        row, factor = frame.iloc[place], factors[place // sets]
        arm = run.arm(robot, factor)
        angles, wrenches = drawn(run, robot, int(row["data_set"]), settings["configurations"], factor)
        moved = [
            np.linalg.norm(arm.deflection(q, w, arm.end_effector, run.wrench_at)[:3])
            for q, w in zip(angles, wrenches, strict=True)
        ]
        expected = [np.mean(moved), np.mean(np.square(moved)), np.max(moved)]
        at = f"tube of {row['diameter']:.4g} m, data set {int(row['data_set'])}"
        for name, one in zip(("mean", "mean_square", "maximum"), expected, strict=True):
            found.append(compared(file, f"{name}, {at}", "pinocchio", row[name], one, 1e-8))
    return found


def weighting(run: Audited, file: str, robot: str) -> list[Finding]:
    """Equal weights against those of the noise, in a sampled row, by the sandwich over some data sets."""
    frame, settings, arm = run.table(file), run.configuration, run.arm(robot)
    length, tracker = settings["tables"]["length"], np.array(settings["questions"]["tracker_m"])
    noise, row = 1e-6 * settings["tables"]["noise_um"], frame.iloc[int(run.picked(file, len(frame), 1)[0])]
    at = f"ratio {row['orientation_ratio']:g}, {row['per_metre']:g} per metre"
    best = bool((frame["weighted"] <= frame["equal"] * (1 + 1e-12)).all())
    found = [held(file, "weights of the noise are never worse", "Aitken's theorem", best, "equal weights are better in a row")]
    slope = error_rows(run, robot)[0]
    weighted = np.einsum("tki,tkj->ij", slope, slope) / len(slope)
    sums = np.zeros(2)
    for data_set in range(settings["data_sets"]):
        angles, wrenches = drawn(run, robot, data_set, length)
        rows, spread = [], []
        for q, w in zip(angles, wrenches, strict=True):
            rows.append(arm.regressor(q, w, arm.end_effector, run.wrench_at))
            # Without the tool's offset: the tracker sees the end-effector.
            away = np.linalg.norm(arm.pose(arm.unloaded(q), arm.end_effector)[0] - tracker)
            spread.append(np.repeat([np.hypot(noise, row["per_metre"] * away), row["orientation_ratio"] * noise], 3))
        matrix, deviation = np.concatenate(rows), np.concatenate(spread)
        inverse = np.linalg.pinv(matrix)
        white = np.linalg.pinv(matrix / deviation[:, None])
        sums += [np.trace(weighted @ (inverse * deviation**2) @ inverse.T), np.trace(weighted @ white @ white.T)]
    expected = np.sqrt(sums / settings["data_sets"])
    found.append(compared(file, f"errors, {at}", "pinocchio", row[["equal", "weighted"]], expected, _CLOSE))
    return found


def places(run: Audited, file: str, robot: str) -> list[Finding]:
    """Bounds of the end-effector alone, in sampled data sets; shares, and what a second target can do."""
    frame, arm, tables = run.table(file), run.arm(robot), run.configuration["tables"]
    shares = frame[["turned", "fixed"]].to_numpy()
    found = [
        held(
            file,
            "shares lie between 0 and 1",
            "pandas",
            bool(((shares >= 0) & (shares <= 1)).all()),
            "one outside",
            shares.size,
        )
    ]
    seen = bool((frame["fixed"] <= frame["turned"] + 1e-12).all())
    found.append(held(file, "a turned reflector is seen as often as a fixed one", "pandas", seen, "one less often", len(frame)))
    sets = frame["data_set"].nunique()
    length, noise = tables["length"], 1e-6 * tables["noise_um"]
    for data_set in run.picked(file, sets, 2):
        # Twice as many configurations than the second target shares.
        angles, wrenches = drawn(run, robot, int(data_set), 2 * length)
        rows = [arm.regressor(q, w, arm.end_effector, run.wrench_at)[: run.rows] for q, w in zip(angles, wrenches, strict=True)]
        matrix = np.concatenate(rows)
        least = noise**2 * np.trace(moment(run, robot) @ np.linalg.inv(matrix.T @ matrix))
        stored = frame[frame["data_set"] == data_set]["bound_end_effector"]
        found.append(
            compared(
                file, f"bound of the end-effector, data set {data_set}", "pinocchio", stored, [least] * len(stored), _CLOSE
            )
        )
        half = np.concatenate(rows[:length])
        alone = noise**2 * np.trace(moment(run, robot) @ np.linalg.inv(half.T @ half))
        helps = bool((frame[frame["data_set"] == data_set]["bound"] <= alone * (1 + 1e-9)).all())
        found.append(
            held(file, f"a second target never harms, data set {data_set}", "pinocchio", helps, "one does", len(stored))
        )
    return found


def studies(run: Audited, file: str, interpretation: str, robot: str) -> list[Finding]:
    """Scores of a sampled further study at its shortest lengths, drawn, estimated and averaged again."""
    frame, arm, settings = run.table(file), run.arm(robot), run.configuration
    count = len(run.strategies) * settings["configurations"]
    sizes = frame.groupby("study").size()
    found = [compared(file, "strategies and lengths of each study", "counting", sizes, [count] * len(sizes), 0.0)]
    if interpretation != "as_configured":
        return found
    # One study of all data sets at one length: longer ones would take minutes.
    rows = frame[(frame["length"] <= _SHORT) & frame["k_sigma"].notna()]
    for place in run.picked(file, len(rows), 1):
        row = rows.iloc[place]
        strategy, length = run.strategy_named[row["strategy"]], int(row["length"])
        first = int(row["study"]) * settings["data_sets"]
        estimates = []
        for data_set in range(first, first + settings["data_sets"]):
            pairs = {name: simulated(run, robot, data_set, length, name) for name in points_of(strategy)}
            matrices, rights = ({name: pair[k] for name, pair in pairs.items()} for k in (0, 1))
            estimates.append(staged(strategy, matrices, rights, arm.joints)[0])
        mean = averaged(np.array(estimates), settings["interpretations"]["average"])
        at = f"{row['strategy']}, study {row['study']}, length {length}"
        stored = [row[f"compliance_{j + 1}"] for j in range(arm.joints)]
        found.append(compared(file, f"averaged compliances, {at}", "statsmodels on pinocchio", stored, mean, _CLOSE))
        sums = 100 * (arm.compliance / mean - 1).sum()
        found.append(compared(file, f"k_sigma, {at}", "numpy", row["k_sigma"], sums, 0.0, 1e-4))
    return found


_SHORT = 5
CHECKS = (
    (re.compile(r"results/budget/([^/]+)\.parquet"), budget),
    (re.compile(r"results/observability/([^/]+)\.parquet"), observability),
    (re.compile(r"results/uses/([^/]+)\.parquet"), uses),
    (re.compile(r"results/tubes/([^/]+)\.parquet"), tubes),
    (re.compile(r"results/weighting/([^/]+)\.parquet"), weighting),
    (re.compile(r"results/places/([^/]+)\.parquet"), places),
    (re.compile(r"results/studies/([^/]+)/([^/]+)\.parquet"), studies),
)
