"""What the paper prints beside ours, followed back: comparison.csv and expectations.csv, by pandas and scipy alone.

Studies of one size lie about their mean by Student's distribution, so that a further one at a printed figure has a p value;
figures that are judged together have theirs corrected one after the other (Holm).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import special, stats

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

REFERENCE = "config/paper/reference.csv"
_STUDIES = "results/studies/as_configured"
# The last digit that the paper prints of lengths, and of everything else.
_WHOLE, _THIRD = 1.0, 1e-3
_INITIAL = {"deviation_mean": "mean_mm", "deviation_std": "std_mm", "deviation_max": "max_mm"}
_SCORES = {"k_sigma_20": "k_sigma_20_percent", "dev_20": "dev_20_um"}
_EXPECTED = {
    "k_sigma_{}_percent": ("k_sigma", "", 1.0),
    "k_sigma_{}_percent_fixed_joints": ("k_sigma_fixed_joints", "k_sigma_{}", 1.0),
    "dev_{}_um": ("deviation", "dev_{}", 1e6),
}


def reference(run: Audited) -> pd.DataFrame:
    """Figures of the paper; what belongs to no robot or strategy is an empty text."""
    return pd.read_csv(run.folder / REFERENCE, dtype={"table": str}, keep_default_na=False)


def comparison(run: Audited) -> pd.DataFrame:
    """Every printed figure beside ours, from the tables, the studies and the single data sets behind them."""
    rows = []
    for _, printed in reference(run).iterrows():
        row = {name: printed[name] for name in ("table", "robot", "strategy", "quantity", "unit")}
        row["paper"] = paper = float(printed["value"])
        ours, error = _ours(run, printed)
        row |= {"ours": ours, "mc_std": error}
        row["z"] = (ours - paper) / error if error > 0 and np.isfinite(ours) else np.nan
        rows.append(row | dict(zip(("studies_mean", "studies_std", "p_value"), _scatter(run, printed, paper), strict=True)))
    table = pd.DataFrame(rows)
    return table.assign(p_holm=stepped_down(table["p_value"]))


def expectations(run: Audited) -> pd.DataFrame:
    """Expectations in closed form beside further studies and the paper."""
    rows, length = [], run.configuration["tables"]["length"]
    printed = reference(run).query("table == '4'").set_index(["robot", "strategy", "quantity"])["value"]
    for robot in run.reduced:
        for key, strategy in run.strategies.items():
            studies = _studies(run, robot, strategy["name"])
            there = studies[studies["length"] == length]
            closed = run.cell("expected", robot, key).set_index("length").loc[length]
            for name, (column, cell, factor) in _EXPECTED.items():
                values, quantity = factor * there[column], cell.format(length)
                paper = float(printed.get((robot, strategy["name"], quantity), np.nan))
                row: dict[str, Any] = {"robot": robot, "strategy": strategy["name"], "quantity": name.format(length)}
                row |= {"expected": factor * closed[column], "studies": len(values), "paper": paper}
                row |= {"studies_mean": values.mean(), "studies_std": values.std(ddof=1)}
                row["p_value"] = further_one(values.to_numpy(), paper, _THIRD) if np.isfinite(paper) else np.nan
                rows.append(row)
    return pd.DataFrame(rows)


def further_one(values: np.ndarray, printed: float, digit: float) -> float:
    """Two-sided p value of one more study at a printed figure.

    `values` (k,): of k studies of the same size. `printed`: rounded to a digit, which adds the variance of a uniform
    distribution. Returns by the incomplete beta function, which Student's distribution is.
    """
    count = len(values)
    if count < 2:
        return np.nan
    square = (printed - values.mean()) ** 2 / (values.var(ddof=1) * (count + 1) / count + digit**2 / 12)
    return float(special.betainc((count - 1) / 2, 0.5, (count - 1) / (count - 1 + square)))


def stepped_down(p_values: pd.Series) -> pd.Series:
    """Holm's correction: the smallest of m times m, the next one times m - 1, and none below one before it.

    `p_values`: not a number where there is none.
    """
    ordered = p_values.dropna().sort_values()
    return (ordered * np.arange(len(ordered), 0, -1)).cummax().clip(upper=1.0).reindex(p_values.index)


def reached(curve: np.ndarray, limit: float) -> float:
    """First length from 1 at which a score is at most its limit; past the last one it is continued as 1 over the length."""
    below = np.flatnonzero(np.abs(curve) <= limit)
    return float(below[0] + 1) if len(below) else len(curve) * max(abs(float(curve[-1])) / limit, 1.0)


def _ours(run: Audited, printed: pd.Series) -> tuple[float, float]:
    """Our value of a printed figure and its Monte Carlo error."""
    number, quantity = printed["table"], printed["quantity"]
    if number == "text":
        return _TEXT[quantity](run)
    column = {"2": _INITIAL, "4": _SCORES}.get(number, {}).get(quantity, quantity)
    column = f"{column}_fixed_joints" if "k_sigma" in column else column
    table = run.table(f"reports/tables/table{number}.csv")
    here = table["robot"] == printed["robot"]
    if number == "4":
        here &= table["strategy"] == printed["strategy"]
    value, error = _value(table[here], column)
    # Inputs have no error, whether or not the study has the robot.
    return value, 0.0 if number == "1" else error


def _value(rows: pd.DataFrame, column: str) -> tuple[float, float]:
    """Value and error of the first row; a value without error, such as a maximum, has the error 0."""
    if rows.empty or column not in rows:
        return np.nan, np.nan
    first = rows.iloc[0]
    return float(first[column]), float(first.get(f"{column}_std_error", 0.0))


def _scatter(run: Audited, printed: pd.Series, paper: float) -> tuple[float, float, float]:
    """Mean, standard deviation and p value where one study, or one data set, stands beside many."""
    number, robot, quantity = (printed[name] for name in ("table", "robot", "quantity"))
    nothing = np.nan, np.nan, np.nan
    if number == "2" and robot in run.configuration["robots"]:
        single = run.table(f"results/initial/{robot}.parquet")
        of_one_set = {
            "deviation_mean": single["mean"].to_numpy(float),
            "deviation_std": (single["mean_square"] - single["mean"] ** 2).pow(0.5).to_numpy(float),
            "deviation_max": single["maximum"].to_numpy(float),
        }
        values = 1e3 * of_one_set[quantity]
        # The printed one among them: how many of all lie at least so far out, on the emptier side, twice.
        outside = min((values <= paper).sum(), (values >= paper).sum()) + 1
        p_value = min(1.0, 2 * outside / (len(values) + 1))
        # The tubes of the robot with elastic links were chosen for its mean.
        chosen = "links" in run.robots[robot] and quantity == "deviation_mean"
        return values.mean(), values.std(ddof=1), np.nan if chosen else p_value
    if number not in ("3", "4") or robot not in run.reduced:
        return nothing
    studies, length = _studies(run, robot, printed["strategy"]), run.configuration["tables"]["length"]
    if studies["study"].nunique() < 2:
        return nothing
    if quantity.startswith("n_"):
        column, limit = _limit(quantity)
        curves = studies.sort_values("length").groupby("study")[column]
        logarithms = np.log([reached(curve.to_numpy(), limit) for _, curve in curves])
        mean = float(stats.gmean(np.exp(logarithms)))
        p_value = further_one(logarithms, np.log(paper), _WHOLE / paper)
        return mean, mean * float(logarithms.std(ddof=1)), p_value
    if quantity.startswith("c"):
        column, at, factor = f"compliance_{quantity[1:]}", length, 1e6
    else:
        name, _, words = quantity.rpartition("_")
        column, factor = ("k_sigma_fixed_joints", 1.0) if name == "k_sigma" else ("deviation", 1e6)
        at = int(words)
    values = factor * studies.loc[studies["length"] == at, column].to_numpy()
    if len(values) < 2:
        return nothing
    return float(values.mean()), float(values.std(ddof=1)), further_one(values, paper, _THIRD)


def _limit(quantity: str) -> tuple[str, float]:
    """Score and limit of a length, such as n_dev_2_um."""
    limit = float(quantity.split("_")[-2])
    return ("deviation", 1e-6 * limit) if quantity.startswith("n_dev") else ("k_sigma_fixed_joints", limit)


def _studies(run: Audited, robot: str, strategy: str) -> pd.DataFrame:
    frame = run.table(f"{_STUDIES}/{robot}.parquet")
    return frame[frame["strategy"] == strategy]


def _largest_residual(run: Audited) -> tuple[float, float]:
    table = run.table("reports/tables/extended.csv")
    return _value(table.sort_values("residual_mean_um", ascending=False, kind="stable"), "residual_mean_um")


def _share_with_links(run: Audited) -> tuple[float, float]:
    table = run.table("reports/tables/extended.csv")
    return _value(table[table["strategy"] == "6DoF"], "share_compensated_percent")


def _share_without_links(run: Audited) -> tuple[float, float]:
    key = _key(run, "6DoF")
    if key is None or "kuka" not in run.configuration["robots"]:
        return np.nan, np.nan
    at, drawn = _at_length(run, "kuka", key)
    left = float(at["deviation"] / at["initial_deviation"])
    return 100 * (1 - left), 100 * float((drawn["deviation"] / drawn["initial_deviation"]).std(ddof=1))


def _smallest_ratio(run: Audited) -> tuple[float, float]:
    """By which factor the best strategy is better than 6DoF, on the robot on which it gains less."""
    found, classical = [], _key(run, "6DoF")
    table, length = run.table("reports/tables/table4.csv"), run.configuration["tables"]["length"]
    for robot, rows in table.groupby("robot"):
        best = _key(run, rows.sort_values(f"dev_{length}_um", kind="stable")["strategy"].iloc[0])
        if classical is None or best is None:
            return np.nan, np.nan
        (ours, replicated), (theirs, theirs_replicated) = (_at_length(run, str(robot), key) for key in (classical, best))
        ratios = replicated["deviation"].to_numpy() / theirs_replicated["deviation"].to_numpy()
        found.append((float(ours["deviation"] / theirs["deviation"]), float(np.std(ratios, ddof=1))))
    return min(found)


def _at_length(run: Audited, robot: str, key: str) -> tuple[pd.Series, pd.DataFrame]:
    """Scores and their replicates, in order, at the length of the tables."""
    length = run.configuration["tables"]["length"]
    drawn = run.cell("replicates", robot, key)
    row = run.cell("metrics", robot, key).set_index("length").loc[length]
    return row, drawn[drawn["length"] == length].sort_values("replicate")


def _key(run: Audited, name: str) -> str | None:
    """Name of the file of a strategy."""
    return next((key for key, strategy in run.strategies.items() if strategy["name"] == name), None)


_TEXT = {
    "residual_deviation_upper_bound": _largest_residual,
    "share_compensated_with_link_elasticity": _share_with_links,
    "share_compensated_joint_elasticity_only": _share_without_links,
    "best_over_6DoF_dev_ratio_min": _smallest_ratio,
}
