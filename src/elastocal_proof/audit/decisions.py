"""Studies over again and decisions: tables on claims, joint test, costs, few configurations, kinds of measurements and designs.

Data sets of few configurations and of kinds of measurements are drawn again from their streams and estimated by statsmodels.
"""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import statsmodels.api as sm
from scipy.stats import median_abs_deviation
from statsmodels.stats.multitest import multipletests

from elastocal.counting import spell_count
from elastocal_proof.audit.findings import Finding, compare, require
from elastocal_proof.audit.questions import estimate, simulate
from elastocal_proof.audit.scores import errors_of, judge_on, weights_of
from elastocal_proof.audit.tables import find_groups, find_root_mean, follow_cells, reach

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from elastocal_proof.audit.audited import Audited

    _Rows = Iterator[dict[Any, Any]]

_USUAL = "as_configured"
# Estimates of single data sets on exact deflections; models of second order against the exact kinematics.
_CLOSE, _FIRST_ORDER = 1e-6, 1e-3
_LEVEL = 0.05
# Monte Carlo standard errors: one value in 30,000 is further off by chance.
_SIGMAS = 4.0
_VERDICTS = {"holds", "holds in part", "does not hold"}


def table4_studies(run: Audited) -> _Rows:
    length, limits = run.configuration["tables"]["length"], run.configuration["tables"]
    of = {"pose": _USUAL} | {
        spell_count(len(some["reflectors_m"]), "reflector"): name
        for name, some in run.configuration["switched"].items()
        if "reflectors_m" in some
    }
    percent, microns = limits["k_sigma_limit_percent"], limits["deviation_limit_um"]
    columns = [("k_sigma", 1.0, percent, "percent"), ("k_sigma_fixed_joints", 1.0, percent, "percent")]
    for measured, name in of.items():
        for robot in run.reduced:
            for strategy, cell in run.table(f"results/studies/{name}/{robot}.parquet").groupby("strategy", observed=True):
                there, studies = (
                    cell[cell["length"] == length],
                    [mine.sort_values("length") for _, mine in cell.groupby("study")],
                )
                for average, end in (("stiffness", ""), ("compliance", "_mean_compliance")):
                    row = {"robot": robot, "strategy": strategy, "strategy_file": run.keys[str(strategy)]}
                    row |= {"measured": measured, "average": average}
                    for column, factor, limit, unit in (*columns, ("deviation", 1e6, microns, "um")):
                        head = column.replace("deviation", "dev")
                        lengths = [reach(mine[f"{column}{end}"], limit / factor) for mine in studies]
                        row |= _middle(f"{head}_{length}_{unit}", factor * there[f"{column}{end}"])
                        row |= _middle(f"n_{head}_{limit:g}_{unit}", lengths)
                    yield row | _middle(f"rms_{length}_um", 1e6 * np.sqrt(there["mean_square"]))


def _middle(name: str, values: Any) -> dict[str, float]:
    """Median and robust standard deviation."""
    return {name: np.median(values), f"{name}_std": 1.4826 * median_abs_deviation(values)}


def joint_test(run: Audited) -> _Rows:
    """Of the count of joints that the comparison has; ranks are held against what a rank can be."""
    stated = run.table("reports/tables/joint_test.csv").set_index("joints")
    compared = run.table("reports/tables/comparison.csv")
    p_values = compared.loc[compared["table"].isin(["3", "4"]), "p_value"].dropna().to_numpy()
    below, statistic = int((p_values < _LEVEL).sum()), -2 * np.log(p_values).sum()
    differ = int((multipletests(p_values, method="holm")[1] < _LEVEL).sum()) if len(p_values) else 0
    for joints, row in stated.iterrows():
        again = {"joints": joints, "studies": run.configuration["evaluation"]["studies"]}
        for name in ("below", "statistic"):
            # The share of studies, the paper among them, that are as far out.
            ranks = (1 + np.arange(row["studies"] + 1)) / (row["studies"] + 1)
            again[f"{name}_p"] = ranks[np.argmin(np.abs(ranks - row[f"{name}_p"]))]
        if joints == "fixed joints" and len(p_values):
            again |= {"cells": len(p_values), "differ": differ, "below": below, "statistic": statistic}
        yield {name: pd.NA for name in ("cells", "differ", "below", "statistic")} | again


def claims(run: Audited) -> _Rows:
    """Where a claim is an order, p follows from the studies in which it holds; verdicts are among three."""
    for row in run.table("reports/tables/claims.csv").to_dict("records"):
        counted = re.search(r"(\d+) of (\d+) studies", str(row["ours"]))
        known = bool(counted) and np.isfinite(row["p"])
        verdict = row["verdict"] if row["verdict"] in _VERDICTS or row["literal"] == "not studied" else f"one of {_VERDICTS}"
        p_value = (1 + int(counted[1])) / (1 + int(counted[2])) if counted and known else pd.NA
        yield {"number": row["number"], "p": p_value, "verdict": verdict}


def find_needed(squares: pd.Series, accuracy_m: float) -> float:
    """Configurations from which on the root of a mean square (by length from 1) stays within an accuracy, interpolated."""
    above = np.flatnonzero(~(squares.to_numpy() <= accuracy_m**2))
    if not len(above):
        return 1.0
    last = int(above[-1]) + 1
    if last == len(squares):
        return np.inf
    ends = np.log(squares.to_numpy()[[last, last - 1]])
    if np.isnan(ends[1]):
        return float(last + 1)
    return float(np.exp(np.interp(2 * np.log(accuracy_m), ends, np.log([last + 1, last]))))


def _needed(run: Audited, robot: str, accuracy_um: float) -> dict[str, np.ndarray]:
    """Configurations that each set of points needs: of all data sets, then of each bootstrap replicate."""
    frame, found = run.table(f"results/budget/{robot}.parquet"), {}
    of_sets = weights_of(run, robot)[0]
    for points, cell in frame.groupby("points", observed=True, sort=False):
        squares = cell.pivot(index="data_set", columns="length", values="mean_square")
        means = [squares.mean(skipna=False)]
        means += [pd.Series(weights @ squares.to_numpy() / weights.sum(), squares.columns) for weights in of_sets]
        found[str(points)] = np.array([find_needed(mean, 1e-6 * accuracy_um) for mean in means])
    return found


def _interval(name: str, values: np.ndarray) -> dict[str, float]:
    """A value with its 95 % interval over replicates."""
    low, high = np.quantile(values[1:], [0.025, 0.975], method="nearest")
    return {name: values[0], f"{name}_low": low, f"{name}_high": high}


def costs(run: Audited) -> _Rows:
    sets, stated = run.configuration["questions"]["point_sets"], run.table("reports/tables/costs.csv")
    for robot, cell in stated.groupby("robot"):
        needed = _needed(run, str(robot), run.configuration["questions"]["accuracies_um"][0])
        usual = next(iter(sets))
        for cost in cell["configuration_cost"].unique():
            total = {points: n * (cost + len(sets[points])) for points, n in needed.items() if np.isfinite(n[0])}
            least = min(values[0] for values in total.values())
            for points, values in total.items():
                row = {"robot": robot, "points": points, "configuration_cost": cost, "cost": values[0]}
                ratio = values / total[usual] if usual in total else np.full_like(values, np.nan)
                yield row | _interval("ratio", ratio) | {"cheapest": values[0] == least}


def break_even(run: Audited) -> _Rows:
    sets, usual = run.configuration["questions"]["point_sets"], next(iter(run.configuration["questions"]["point_sets"]))
    for robot in run.reduced:
        for accuracy in run.configuration["questions"]["accuracies_um"]:
            needed = _needed(run, robot, accuracy)
            for points, ours in needed.items():
                theirs = needed[usual]
                if points != usual and np.isfinite([ours[0], theirs[0]]).all():
                    with np.errstate(divide="ignore", invalid="ignore"):
                        even = (ours * len(sets[points]) - theirs * len(sets[usual])) / (theirs - ours)
                    row = {"robot": robot, "accuracy_um": accuracy, "points": points, "against": usual}
                    row |= {"configurations": ours[0], "configurations_against": theirs[0]}
                    yield row | _interval("break_even", np.where(ours < theirs, even.clip(0), np.inf))


def few_configurations(run: Audited) -> _Rows:
    for head, cell in find_groups(run, run.reduced, "few", "nominal_error", "strategy", "length"):
        row = {"robot": head["robot"], "nominal_error_percent": 100 * head["nominal_error"], "strategy": head["strategy"]}
        squares = cell["mean_square"]
        row |= {"configurations": head["length"]} | find_root_mean(squares)
        yield row | {"median_um": 1e6 * np.sqrt(np.median(squares))}


def measurement_kinds(run: Audited) -> _Rows:
    length = run.configuration["tables"]["length"]
    for head, cell in find_groups(run, run.reduced, "kinds", "kind", "scalars", "length"):
        if head["length"] in (length, 6 * length // head["scalars"]):
            row = {"robot": head["robot"], "kind": head["kind"], "scalars_per_configuration": head["scalars"]}
            row |= {"configurations": head["length"], "scalars": head["length"] * head["scalars"]}
            yield row | find_root_mean(cell["mean_square"])


def simulated_designs(run: Audited, sizes: str) -> _Rows:
    for robot in run.reduced:
        frame = run.table(f"results/simulated_designs/{sizes}/{robot}.parquet")
        random = frame[frame["design"] == "random"].set_index(["load", "configurations"])["rms"]
        for row in frame.to_dict("records"):
            again = {"robot": robot} | {name: row[name] for name in ("load", "design", "configurations", "unobservable")}
            again |= {"rms_um": 1e6 * row["rms"], "rms_um_std_error": 1e6 * row["std_error"]}
            gain = random[row["load"], row["configurations"]] / row["rms"]
            yield again | {"at_test_pose_um": 1e6 * row["there"], "gain": gain}


# What makes each table again, and the columns that name a row.
TABLES: Mapping[str, tuple[Callable[[Audited], _Rows], tuple[str, ...]]] = {
    "table4_studies": (table4_studies, ("robot", "strategy", "measured", "average")),
    "joint_test": (joint_test, ("joints",)),
    "claims": (claims, ("number",)),
    "costs": (costs, ("robot", "points", "configuration_cost")),
    "break_even": (break_even, ("robot", "accuracy_um", "points")),
    "few_configurations": (few_configurations, ("robot", "nominal_error_percent", "strategy", "configurations")),
    "measurement_kinds": (measurement_kinds, ("robot", "kind", "configurations")),
    **{
        f"simulated_designs_{sizes}": (partial(simulated_designs, sizes=sizes), ("robot", "load", "design", "configurations"))
        for sizes in ("few", "every")
    },
}


def tables(run: Audited, file: str, table: str) -> Iterator[Finding]:
    """Every cell of a table on studies and decisions that follows from files."""
    if table in TABLES:
        yield from follow_cells(run, file, *TABLES[table], of_cells=(joint_test, claims))


def few(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Errors of sampled data sets by strategies without a prior; a prior never leaves a data set without an estimate."""
    frame = run.table(file)
    without = frame[frame["strategy"].isin(run.keys) & frame["mean_square"].notna()]
    for row in run.pick_rows(file, without, 3):
        found = estimate(run, robot, row["strategy"], int(row["data_set"]), int(row["length"]))
        error = (errors_of(run, robot, found[None]) ** 2).mean()
        checked = f"error, {row['strategy']}, data set {row['data_set']}, length {row['length']}"
        yield compare(checked, "statsmodels on pinocchio", row["mean_square"], error, _CLOSE)
    shrunk = frame[~frame["strategy"].isin(run.keys)]
    yield require("shrunk estimates exist", "pandas", shrunk["mean_square"].notna().all(), "one does not", len(shrunk))


def kinds(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Errors of sampled data sets by poses."""
    frame, end = run.table(file), run.arm(robot).end_effector
    for row in run.pick_rows(file, frame[(frame["kind"] == "pose") & frame["mean_square"].notna()], 3):
        matrix, right = simulate(run, robot, int(row["data_set"]), int(row["length"]), end)
        error = (errors_of(run, robot, sm.OLS(right, matrix).fit().params[None]) ** 2).mean()
        checked = f"error by poses, data set {row['data_set']}, length {row['length']}"
        yield compare(checked, "statsmodels on pinocchio", row["mean_square"], error, _CLOSE)


def stiffness_columns(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Stiffness without load and the first order, on the test configurations; what a load changes grows with the load."""
    frame, arm = run.table(file).sort_values("force"), run.arm(robot)
    slope, _, moved = judge_on(run, robot)
    usual = frame[frame["force"] == run.configuration["loading"]["force_N"]]
    for row in usual.to_dict("records"):
        first = slope @ arm.compliance
        apart = 100 * np.linalg.norm(first - moved, axis=1).mean() / np.linalg.norm(moved, axis=1).mean()
        yield compare("first order against the exact kinematics", "pinocchio", row["first_order"], apart, _FIRST_ORDER, 1e-3)
    grows = (frame[["first_order", "loaded", "by_k_c"]].diff().dropna() > 0).to_numpy().all()
    yield require("what a load changes grows with it", "pandas", grows, "it does not", len(frame))


def start_columns(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Starts are those configured, and none is off from itself."""
    frame = run.table(file)
    configured = 1e-6 * np.array(run.configuration["questions"]["starts_urad_per_Nm"])
    yield compare("starts", "counting", frame["start"], configured, 1e-12)
    yield require("the first start is no distance from itself", "pandas", not frame["difference"].iloc[0], "it is some")
    shares = frame["unsettled"].between(0, 1).all()
    yield require("shares lie between 0 and 1", "pandas", shares, "one outside", len(frame))


def _exceeds(ours: pd.Series, error: pd.Series, theirs: pd.Series, their_error: pd.Series) -> pd.Series:
    """Where a simulated value is above another by more than its Monte Carlo error."""
    return ours - theirs > _SIGMAS * np.hypot(error, their_error)


def _by_load(*values: pd.Series) -> Iterator[list[pd.Series]]:
    """Series of each load by increasing size."""
    for load in values[0].index.unique("load"):
        yield [each.xs(load).sort_index() for each in values]


def simulated(run: Audited, file: str, sizes: str, robot: str) -> Iterator[Finding]:
    """Chosen configurations are better than random ones where they are judged, and more are better than fewer."""
    frame = run.table(file)
    by = frame.pivot(index=["load", "configurations"], columns="design", values=["rms", "std_error"])
    ours, random = ((by["rms", design], by["std_error", design]) for design in ("I", "random"))
    better = not _exceeds(*ours, *random).any()
    yield require("I-optimal configurations leave less than random ones", "pandas", better, "some leave more", len(by))
    falls = not any(_exceeds(*each, *(values.shift() for values in each)).any() for each in _by_load(*ours))
    yield require("more I-optimal configurations leave less", "pandas", falls, "some leave more", len(by))
    wanted = run.configuration["questions"]["simulated_designs"]["sizes"][sizes]
    yield compare("sizes", "counting", sorted(frame["configurations"].unique()), sorted(wanted), 0.0)


CHECKS = {
    "reports/tables/{table}.csv": tables,
    "results/few/{robot}.parquet": few,
    "results/kinds/{robot}.parquet": kinds,
    "results/stiffness/{robot}.parquet": stiffness_columns,
    "results/starts/{robot}.parquet": start_columns,
    "results/simulated_designs/{sizes}/{robot}.parquet": simulated,
}
