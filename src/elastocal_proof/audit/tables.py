"""Cells of the study's tables, followed back to the files that they come from: each table as rows of formulas over these."""

from __future__ import annotations

import re
from collections import defaultdict
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import special, stats
from statsmodels.stats.multitest import multipletests

from elastocal_proof.audit.estimates import points_of
from elastocal_proof.audit.findings import NINE_DIGITS, Finding, compare_columns, require
from elastocal_proof.audit.scores import weights_of

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Iterator, Mapping

    from elastocal_proof.audit.audited import Audited

    _Rows = Iterator[dict[Any, Any]]

_REFERENCE = "config/paper/reference.csv"
# Percentages and differences of what agrees to rounding, in the units of the tables.
_ZERO = 1e-7
# Of what is worked out of cells with nine digits, of which others are subtracted.
_OF_DIGITS = 1e-6
# Of a normal distribution: 95 % within.
_QUANTILE = 1.96
# The last digit that the paper prints of everything but lengths.
_DIGIT = 1e-3


def find_groups(run: Audited, robots: Iterable[str], kind: str, *by: str) -> Iterator[tuple[dict[str, Any], pd.DataFrame]]:
    """Rows of files of the robots that go together, with what names them."""
    for robot in robots:
        for key, cell in run.table(f"results/{kind}/{robot}.parquet").groupby([*by], sort=False, observed=True):
            yield {"robot": robot} | dict(zip(by, key, strict=True)), cell


def _cells(run: Audited, robots: list[str]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Every robot and strategy: names of the robot and of the strategy's file, and the row's head."""
    for key, document in run.strategies.items():
        yield from ((robot, key, {"strategy": document["name"], "strategy_file": key, "robot": robot}) for robot in robots)


def _at(run: Audited, robot: str, key: str) -> Any:
    """Metrics at the length of the tables."""
    return run.cell("metrics", robot, key).set_index("length").loc[run.configuration["tables"]["length"]]


def _with_error(head: str, at: Any, name: str, factor: float) -> dict[str, float]:
    """A figure with its standard error in another unit."""
    return {f"{head}{end}": factor * at[f"{name}{end}"] for end in ("", "_std_error")}


def _single_sets(frame: pd.DataFrame) -> pd.DataFrame:
    """Deflections of single data sets, mm."""
    spread = (frame["mean_square"] - frame["mean"] ** 2) ** 0.5
    return 1e3 * pd.DataFrame({"mean_mm": frame["mean"], "std_mm": spread, "max_mm": frame["maximum"]})


def find_root_mean(squares: pd.Series, head: str = "rms_um", error: str = "rms_um_std_error") -> dict[str, float]:
    """Root of a mean and its standard error by the delta method, µm."""
    root = np.sqrt(squares.mean())
    return {head: 1e6 * root, error: 1e6 * stats.sem(squares) / (2 * root)}


def _ratio(ours: pd.Series, theirs: pd.Series) -> dict[str, float]:
    """Ratio of two roots of means of pairs, with its 95 % interval on the logarithm."""
    error = _QUANTILE * stats.sem(ours / ours.mean() - theirs / theirs.mean()) / 2
    ratio = np.sqrt(ours.mean() / theirs.mean())
    return {"ratio": ratio, "ratio_low": ratio * np.exp(-error), "ratio_high": ratio * np.exp(error)}


def table1(run: Audited) -> _Rows:
    for robot in run.reduced:
        yield {"robot": robot} | {f"c{j}": c for j, c in enumerate(run.robots[robot]["compliance_urad_per_Nm"], 1)}


def table2(run: Audited) -> _Rows:
    for robot in run.configuration["robots"]:
        frame, weights = run.table(f"results/initial/{robot}.parquet"), weights_of(run, robot)[0]
        # Data sets are of one size: weights are those of their configurations.
        means, single = 1e3 * frame["mean"].to_numpy(), _single_sets(frame)
        drawn = [weights @ values / weights.sum(axis=1) for values in (means, 1e6 * frame["mean_square"].to_numpy())]
        row = {
            "robot": robot,
            "mean_mm": means.mean(),
            "std_mm": np.sqrt(1e6 * frame["mean_square"].mean() - means.mean() ** 2),
        }
        row |= {"max_mm": single["max_mm"].max(), "mean_mm_std_error": drawn[0].std(ddof=1)}
        row["std_mm_std_error"] = np.sqrt(drawn[1] - drawn[0] ** 2).std(ddof=1)
        yield row | dict(single.mean().add_suffix("_one_set")) | dict(single.std().add_suffix("_one_set_std"))


def table3(run: Audited) -> _Rows:
    for robot in run.reduced:
        at = _at(run, robot, run.configuration["tables"]["classical_strategy"])
        figures = (_with_error(f"c{j}", at, f"compliance_{j}", 1e6) for j in range(1, run.arm(robot).joints + 1))
        yield {"robot": robot} | {name: value for each in figures for name, value in each.items()}


def table4(run: Audited) -> _Rows:
    tables = run.configuration["tables"]
    length, percent, microns = (tables[name] for name in ("length", "k_sigma_limit_percent", "deviation_limit_um"))
    # Score, factor to its unit, columns of its value and of the length at which it reaches a limit.
    columns = [("deviation", 1e6, f"dev_{length}_um", f"n_dev_{microns:g}_um", microns)]
    for end in ("", "_fixed_joints"):
        reached = f"n_k_sigma_{percent:g}_percent{end}"
        columns.append((f"k_sigma{end}", 1.0, f"k_sigma_{length}_percent{end}", reached, percent))
    for robot, key, row in _cells(run, run.reduced):
        frame, drawn = (run.cell(kind, robot, key).sort_values("length") for kind in ("metrics", "replicates"))
        for name, factor, value, reached, limit in columns:
            row |= _with_error(value, _at(run, robot, key), name, factor)
            first = reach(frame[name], limit / factor)
            lengths = [reach(curve, limit / factor) for _, curve in drawn.groupby("replicate")[name]]
            row |= {reached: first if first <= len(frame) else np.inf, f"{reached}_std_error": np.std(lengths, ddof=1)}
        yield row


def reach(curve: pd.Series, limit: float) -> float:
    """First length from 1 at which a score is at most its limit; past the last one it is continued as 1 over the length."""
    below = np.flatnonzero(curve.abs() <= limit)
    return float(below[0] + 1) if len(below) else len(curve) * max(abs(curve.iloc[-1]) / limit, 1.0)


def extended(run: Audited) -> _Rows:
    length, share = run.configuration["tables"]["length"], "share_compensated_percent"
    for robot, key, head in _cells(run, run.extended):
        at, drawn = _at(run, robot, key), run.cell("replicates", robot, key).groupby("length").get_group(length)
        stated, again = (100 * (1 - each["deviation"] / each["initial_deviation"]) for each in (at, drawn))
        row = (
            head
            | {share: stated, f"{share}_std_error": np.std(again, ddof=1)}
            | _with_error("residual_mean_um", at, "deviation", 1e6)
        )
        yield row | _with_error("initial_mean_mm", at, "initial_deviation", 1e3)


def per_dataset(run: Audited) -> _Rows:
    for robot, key, head in _cells(run, run.configuration["robots"]):
        bounds = run.table(f"results/bounds/{robot}.parquet").set_index(["points", "length"])["rms_per_noise"]
        points = "+".join(sorted(points_of(run.strategies[key])))
        for noise in run.configuration["noise_um"]:
            for at in run.cell("accuracy", robot, key, noise).to_dict("records"):
                row = head | {"noise_um": float(noise), "ds": at["length"], "crlb_rms_um": bounds[points, at["length"]] * noise}
                for name in ("mean", "rms", "p95", "max"):
                    row |= _with_error(f"{name}_um", at, name, 1e6)
                row["efficiency"] = (row["crlb_rms_um"] / row["rms_um"]) ** 2 if noise else np.nan
                row["efficiency_std_error"] = 2 * row["efficiency"] * row["rms_um_std_error"] / row["rms_um"]
                for j in range(1, run.arm(robot).joints + 1):
                    row |= _with_error(f"relative_error_{j}_percent", at, f"relative_error_{j}", 1.0)
                yield row


def budget(run: Audited) -> _Rows:
    length, sets = run.configuration["tables"]["length"], run.configuration["questions"]["point_sets"]
    for head, at in find_groups(run, run.reduced, "budget", "points", "length"):
        count = len(sets[head["points"]])
        row = head | {"configurations": head["length"], "measurements_per_configuration": count}
        row |= {"crlb_rms_um": 1e6 * np.sqrt(at["bound"].mean())} | find_root_mean(at["mean_square"], error="std_error_um")
        if head["length"] in (length, 2 * length // count):
            yield row


def ladder(run: Audited) -> _Rows:
    for head, cell in find_groups(run, run.extended, "ladder", "noise", "length"):
        head |= {"noise_um": round(1e6 * head["noise"], 6)}
        for springs, some in cell.groupby("link_springs"):
            row = head | {"link_springs": str(springs), "chosen_percent": 100 * some["chosen"].mean()}
            yield (
                row | {"usual_link": some["added_link"].mode()[0] if springs else np.nan} | find_root_mean(some["mean_square"])
            )
        row = head | {"link_springs": "by cross-validation", "usual_link": np.nan, "chosen_percent": np.nan}
        yield row | find_root_mean(cell["mean_square"][cell["chosen"]])


def observability(run: Audited) -> _Rows:
    for robot in run.reduced:
        ranked: Any = run.table(f"results/observability/{robot}.parquet").corr("spearman", numeric_only=True)
        for index in ("O1", "O2", "O3", "O4", "O5", "bound"):
            row: dict[str, Any] = {"robot": robot, "index": index}
            for name, column in (("bound", "bound"), ("error", "mean_square")):
                row[f"rank_correlation_with_{name}"] = found = ranked.loc[index, column]
                error = (1 - found**2) / np.sqrt(run.configuration["data_sets"] - 1)
                row[f"rank_correlation_with_{name}_std_error"] = error
            yield row


def places(run: Audited) -> _Rows:
    for head, cell in find_groups(run, run.reduced, "places", "joints", "along", "side"):
        row = head | {"along_m": head["along"]} | _ratio(cell["bound"], cell["bound_end_effector"])
        yield row | {f"seen_{name}_percent": 100 * cell[name].mean() for name in ("turned", "fixed")}


_PARTS, _SIZES = ("noise", "leak"), ("per_metre", "equal", "weighted")
_SHARES = ("first_order", "loaded", "by_k_c", "bias", "k_sigma")
# Tables that have a row for each row of the files of robots: columns that name a row, and columns by formulas over the file's.
_FORMULAS: Mapping[str, tuple[tuple[str, ...], Mapping[str, str]]] = {
    "designs": (
        ("robot", "joint_range", "design", "configurations"),
        {f"{name}_um": f"1e6 * {name}" for name in ("rms", "low", "high")},
    ),
    "geometry": (
        ("robot", "estimator"),
        {"rms_um": "1e6 * (noise ** 2 + leak ** 2) ** 0.5"}
        | {f"{name}_um": f"1e6 * {name}" for name in _PARTS}
        | {f"zero_{name}_urad": f"1e6 * zero_{name}" for name in _PARTS}
        | {f"compliance_{name}_percent": f"compliance_{name}" for name in _PARTS},
    ),
    "weighting": (
        ("robot", "orientation_ratio", "per_metre_um"),
        {"ratio": "equal / weighted"} | {f"{name}_um": f"1e6 * {name}" for name in _SIZES},
    ),
    "stiffness": (
        ("robot", "force_N"),
        {"force_N": "force", "softest_N_per_um": "1e-6 * softest"} | {f"{name}_percent": name for name in _SHARES},
    ),
    "starts": (("robot", "start"), {}),
}


def by_formulas(run: Audited, name: str) -> _Rows:
    for robot in run.reduced:
        frame = run.table(f"results/{name}/{robot}.parquet").assign(robot=robot)
        further: dict[str, Any] = {column: frame.eval(formula) for column, formula in _FORMULAS[name][1].items()}
        yield from frame.assign(**further).to_dict("records")


def tubes(run: Audited) -> _Rows:
    for head, cell in find_groups(run, run.extended, "tubes", "diameter"):
        single = _single_sets(cell)
        row = head | {"diameter_mm": 1e3 * head["diameter"]} | find_root_mean(cell["left"], "left_um", "left_um_std_error")
        yield row | dict(single.mean()) | dict(single.std().add_suffix("_between"))


# Metrics by the file, its column, by which power of the mean of the column, and the factor to their units.
_METRICS = {
    **{f"{name}_um": ("uses", name, 1.0, 1e6) for name in ("mean", "p95", "iso_9283", "path_max", "pooled_p95")},
    **{f"{head}_um": ("uses", name, 0.5, 1e6) for head, name in (("rms", "mean_square"), ("path_rms", "path_mean_square"))},
    **{f"k_sigma_percent{end}": ("metrics", f"k_sigma{end}", 1.0, 1.0) for end in ("", "_fixed_joints")},
    "dev_um": ("metrics", "deviation", 1.0, 1e6),
}


def strategy_scores(run: Audited) -> _Rows:
    classical = run.strategies[run.configuration["tables"]["classical_strategy"]]["name"]
    for robot in run.reduced:
        uses = run.table(f"results/uses/{robot}.parquet").groupby("strategy")
        metrics = pd.DataFrame({name: _at(run, robot, key) for name, key in run.keys.items()}).T
        for metric, (file, column, power, factor) in _METRICS.items():
            means = uses[column].agg(lambda some: some.mean(skipna=False)) if file == "uses" else metrics[column]
            values = factor * means.astype(float) ** power
            # Strategies that are one estimator agree to six digits, and share a rank.
            ranks: Any = values.abs().map("{:.6g}".format).astype(float).rank(method="min")
            for name, value in values.dropna().items():
                row = {"robot": robot, "metric": metric, "strategy": name, "value": value, "rank": ranks[name]}
                yield row | {"ratio": value / values[classical]}


def strategy_pairs(run: Audited) -> _Rows:
    keys = ["robot", "metric", "strategy", "other"]
    stated = run.table("reports/tables/strategy_pairs.csv").set_index(keys).to_dict("index")
    scores = run.table("reports/tables/strategy_scores.csv").set_index(["robot", "metric", "strategy"])["value"]
    for robot, metric in dict.fromkeys(zip(*(scores.index.get_level_values(name) for name in keys[:2]), strict=True)):
        names = scores[robot, "rms_um"].map("{:.6g}".format).drop_duplicates().index
        for pair in combinations(names, 2):
            row = defaultdict(lambda: 1.0, stated.get((robot, metric, *pair), {}))
            apart = row["ratio_low"] > 1 and row["rms_ratio_high"] < 1, row["ratio_high"] < 1 and row["rms_ratio_low"] > 1
            again = dict(zip(keys, (robot, metric, *pair), strict=True)) | {"reversed": any(apart)}
            for head, by in (("ratio", metric), ("rms_ratio", "rms_um")):
                ratio = scores[robot, by, pair[0]] / scores[robot, by, pair[1]]
                # Intervals are symmetric in the logarithm.
                again |= {head: ratio, f"{head}_high": ratio**2 / row[f"{head}_low"]}
            yield again


def find_p_value(mean: float, std: float, count: int, printed: float, digit: float) -> float:
    """Two-sided p value of one more study at a figure that is printed to a digit, by the incomplete beta function.

    Studies of one size lie about their mean by Student's distribution; rounding adds the variance of a uniform distribution.
    """
    square = (printed - mean) ** 2 / (std**2 * (count + 1) / count + digit**2 / 12)
    return float(special.betainc((count - 1) / 2, 0.5, (count - 1) / (count - 1 + square)))


def comparison(run: Audited) -> _Rows:
    stated = run.table("reports/tables/comparison.csv")
    printed = pd.read_csv(run.folder / _REFERENCE, dtype={"table": str}, keep_default_na=False)
    p_values, corrected = stated["p_value"].dropna(), pd.Series(np.nan, stated.index)
    corrected[p_values.index] = multipletests(p_values, method="holm")[1]
    names = ["table", "robot", "strategy", "quantity"]
    ours = stated.assign(p_holm=corrected).fillna(dict.fromkeys(names, "")).set_index(names).to_dict("index")
    for row in printed.assign(paper=printed["value"].astype(float)).drop(columns="value").to_dict("records"):
        mine, row["p_value"] = ours.get(tuple(row[name] for name in names), {}), pd.NA
        row["ours"], row["mc_std"] = _ours(run, row)
        known = mine and mine["mc_std"] > 0 and np.isfinite(mine["ours"])
        row["z"] = (mine["ours"] - row["paper"]) / mine["mc_std"] if known else np.nan
        if mine and row["table"] in ("3", "4") and row["robot"] in run.reduced and not row["quantity"].startswith("n_"):
            count = run.table(f"results/studies/as_configured/{row['robot']}.parquet")["study"].nunique()
            figures = mine["studies_mean"], mine["studies_std"]
            row["p_value"] = find_p_value(*figures, count, row["paper"], _DIGIT) if count > 1 else np.nan
        yield row | {"p_holm": mine.get("p_holm")}


def _ours(run: Audited, row: Mapping[Any, Any]) -> tuple[Any, Any]:
    """Our value of a printed figure and its Monte Carlo error from our table; NA of figures of the text."""
    number, column = row["table"], row["quantity"]
    if number == "text":
        return pd.NA, pd.NA
    column = {"k_sigma_20": "k_sigma_20_percent", "dev_20": "dev_20_um"}.get(column, re.sub("deviation_(.*)", r"\1_mm", column))
    column += "_fixed_joints" * ("k_sigma" in column)
    table, names = run.table(f"reports/tables/table{number}.csv"), ["robot", "strategy"] if number == "4" else ["robot"]
    rows = table[(table[names] == [row[name] for name in names]).all(axis=1)]
    if rows.empty or column not in rows:
        return np.nan, 0.0 if number == "1" else np.nan
    # Inputs have no error, nor has a maximum.
    return rows[column].iloc[0], rows.get(f"{column}_std_error", pd.Series([0.0])).iloc[0]


def expectations(run: Audited) -> _Rows:
    length = run.configuration["tables"]["length"]
    stated = run.table("reports/tables/expectations.csv").set_index(["robot", "strategy", "quantity"]).to_dict("index")
    columns = {f"k_sigma_{length}_percent{end}": (f"k_sigma{end}", 1.0) for end in ("", "_fixed_joints")}
    columns[f"dev_{length}_um"] = ("deviation", 1e6)
    for robot, key, head in _cells(run, run.reduced):
        closed = run.cell("expected", robot, key).set_index("length").loc[length]
        for quantity, (column, factor) in columns.items():
            row = stated.get((robot, head["strategy"], quantity), {"studies": 0, "paper": np.nan})
            mean, std, count, paper = (row.get(name, np.nan) for name in ("studies_mean", "studies_std", "studies", "paper"))
            p_value = find_p_value(mean, std, count, paper, _DIGIT) if count > 1 and np.isfinite(paper) else np.nan
            yield head | {"quantity": quantity, "expected": factor * closed[column], "p_value": p_value}


# What makes each table again, and the columns that name a row.
TABLES: Mapping[str, tuple[Callable[[Audited], _Rows], tuple[str, ...]]] = {
    **{name: (make, ("robot",)) for name, make in (("table1", table1), ("table2", table2), ("table3", table3))},
    **{name: (make, ("strategy", "robot")) for name, make in (("table4", table4), ("extended", extended))},
    "per_dataset": (per_dataset, ("strategy", "robot", "noise_um", "ds")),
    "budget": (budget, ("robot", "points", "configurations")),
    "ladder": (ladder, ("robot", "noise_um", "length", "link_springs")),
    "observability": (observability, ("robot", "index")),
    "places": (places, ("robot", "joints", "along_m", "side")),
    "tubes": (tubes, ("robot", "diameter_mm")),
    "strategy_scores": (strategy_scores, ("robot", "metric", "strategy")),
    "strategy_pairs": (strategy_pairs, ("robot", "metric", "strategy", "other")),
    "comparison": (comparison, ("table", "robot", "strategy", "quantity")),
    "expectations": (expectations, ("robot", "strategy", "quantity")),
    **{name: (partial(by_formulas, name=name), keys) for name, (keys, _) in _FORMULAS.items()},
}

_OF_CELLS = (strategy_pairs, comparison, expectations)


def tables(run: Audited, file: str, table: str) -> Iterator[Finding]:
    """Every cell of a table of the study that follows from files."""
    if table in TABLES:
        yield from follow_cells(run, file, *TABLES[table], of_cells=_OF_CELLS)


def follow_cells(
    run: Audited,
    file: str,
    make: Callable[[Audited], _Rows],
    keys: Iterable[str],
    of_cells: Container[Callable[[Audited], _Rows]],
) -> Iterator[Finding]:
    """A table beside its rows made again; those in `of_cells` are made of cells with nine digits."""
    rows = [*make(run)]
    again = pd.DataFrame(rows) if rows else pd.DataFrame(columns=[*keys])
    digits = (_OF_DIGITS, _OF_DIGITS) if make in of_cells else (NINE_DIGITS, _ZERO)
    yield from compare_columns(run.table(file), again, keys, "pandas and scipy", *digits)


def printed_tables(run: Audited, file: str, number: str) -> Iterator[Finding]:
    """Values of a table for people against those of its CSV, to the digits that are printed."""
    source = run.table(f"reports/tables/table{number}.csv")
    columns = [name for name in map(str, source) if not name.endswith("_std_error") and name != "strategy_file"]
    lines, off = (run.folder / file).read_text("utf-8").splitlines(), []
    if file.endswith("md"):
        rows = [line.strip("|").split("|") for line in lines[2:] if line.startswith("|")]
    else:
        rows = [line.removesuffix(r"\\").split("&") for line in lines if line.endswith(r"\\")][1:]
    shown = [row for row in rows if len(row) == len(columns)]
    yield require("rows", "counting", len(shown) == len(source), f"found {len(shown)}, expected {len(source)}", len(source))
    for row, values in zip(shown, source.to_dict("records"), strict=False):
        off += [f"{name}: {text}" for name, text in zip(columns, row, strict=True) if not _agrees(text.strip(), values[name])]
    yield require(f"values as in table{number}.csv, to the digits shown", "pandas", not off, ", ".join(off[:3]), source.size)


def _agrees(text: str, value: str | float) -> bool:
    if isinstance(value, str):
        return text.replace("\\", "") == value
    if not np.isfinite(value):
        return text in ("", "not reached")
    shown = re.split(r"\s*(?:±|\$\\pm\$)\s*", text)[0]
    mantissa, _, exponent = shown.partition("e")
    return abs(float(shown) - value) <= 0.5000001 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


CHECKS = {
    "reports/tables/{table}.csv": tables,
    "reports/tables/table{number}.md": printed_tables,
    "reports/tables/table{number}.tex": printed_tables,
}
