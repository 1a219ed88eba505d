"""Cells of the study's tables, followed back to the files that they come from, by pandas alone.

Each function makes a table again, or those of its columns that follow from files; every cell of these columns is compared.
Columns that are left are named in the finding.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

from elastocal.audit import paper_figures, rankings
from elastocal.audit.estimates import points_of
from elastocal.audit.findings import ROUNDING, Finding, compared, held

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from elastocal.audit.audited import Audited

# Tables are written with nine digits.
_NINE_DIGITS = 5.1e-9
# Percentages and differences of what agrees to rounding, in the units of the tables.
_ZERO = 1e-7
# Of a normal distribution: 95 % within.
_QUANTILE = 1.96


def table1(run: Audited) -> pd.DataFrame:
    """Compliances of the robot files."""
    rows = {name: run.robots[name]["compliance_urad_per_Nm"] for name in run.reduced}
    return pd.DataFrame([{"robot": name} | {f"c{j}": c for j, c in enumerate(row, 1)} for name, row in rows.items()])


def table2(run: Audited) -> pd.DataFrame:
    """Deflections before calibration, from results/initial and results/weights."""
    rows = []
    for robot in run.configuration["robots"]:
        frame, weights = run.table(f"results/initial/{robot}.parquet"), run.table(f"results/weights/{robot}.parquet")
        counts = weights[weights["members"] == "data sets"].pivot(index="replicate", columns="number", values="count")
        # Data sets are of one size: weights are those of their configurations.
        drawn = np.array(
            [[np.average(frame[name], weights=each) for name in ("mean", "mean_square")] for each in counts.to_numpy()]
        )
        mean, square = frame["mean"].mean(), frame["mean_square"].mean()
        single: dict[str, pd.Series] = {
            "mean": frame["mean"],
            "std": (frame["mean_square"] - frame["mean"] ** 2) ** 0.5,
            "max": frame["maximum"],
        }
        row: dict[str, Any] = {
            "robot": robot,
            "mean_mm": mean,
            "std_mm": np.sqrt(square - mean**2),
            "max_mm": frame["maximum"].max(),
        }
        row["mean_mm_std_error"] = drawn[:, 0].std(ddof=1)
        row["std_mm_std_error"] = np.sqrt(drawn[:, 1] - drawn[:, 0] ** 2).std(ddof=1)
        for name, values in single.items():
            row |= {f"{name}_mm_one_set": values.mean(), f"{name}_mm_one_set_std": values.std(ddof=1)}
        rows.append({name: value if name == "robot" else 1e3 * value for name, value in row.items()})
    return pd.DataFrame(rows)


def table3(run: Audited) -> pd.DataFrame:
    """Compliances by the classical strategy, from results/metrics."""
    tables, rows = run.configuration["tables"], []
    for robot in run.reduced:
        frame = run.cell("metrics", robot, tables["classical_strategy"]).set_index("length")
        at, row = frame.loc[tables["length"]], {"robot": robot}
        for j in range(1, run.arm(robot).joints + 1):
            row |= {f"c{j}": 1e6 * at[f"compliance_{j}"], f"c{j}_std_error": 1e6 * at[f"compliance_{j}_std_error"]}
        rows.append(row)
    return pd.DataFrame(rows)


def table4(run: Audited) -> pd.DataFrame:
    """Strategies side by side, from results/metrics and results/replicates."""
    tables, rows = run.configuration["tables"], []
    length = tables["length"]
    for key, strategy in run.strategies.items():
        for robot in run.reduced:
            frame = run.cell("metrics", robot, key)
            at = frame.set_index("length").loc[length]
            drawn = run.cell("replicates", robot, key)
            row: dict[str, Any] = {"strategy": strategy["name"], "robot": robot}
            for suffix in ("", "_fixed_joints"):
                name, limit = f"k_sigma{suffix}", tables["k_sigma_limit_percent"]
                row[f"k_sigma_{length}_percent{suffix}"] = at[name]
                row[f"k_sigma_{length}_percent{suffix}_std_error"] = at[f"{name}_std_error"]
                reached = f"n_k_sigma_{limit:g}_percent{suffix}"
                row[reached], row[f"{reached}_std_error"] = _reached(frame, drawn, name, limit)
            row |= {f"dev_{length}_um": 1e6 * at["deviation"], f"dev_{length}_um_std_error": 1e6 * at["deviation_std_error"]}
            limit = tables["deviation_limit_um"]
            reached = f"n_dev_{limit:g}_um"
            row[reached], row[f"{reached}_std_error"] = _reached(frame, drawn, "deviation", 1e-6 * limit)
            rows.append(row)
    return pd.DataFrame(rows)


def _reached(frame: pd.DataFrame, drawn: pd.DataFrame, name: str, limit: float) -> tuple[float, float]:
    """First length at which a score is at most its limit, and its standard error over replicates, continued as 1 / length."""

    def first(values: np.ndarray) -> float:
        below = np.flatnonzero(np.abs(values) <= limit)
        return float(below[0] + 1) if len(below) else np.inf

    lengths = []
    for _, some in drawn.groupby("replicate"):
        values = some.sort_values("length")[name].to_numpy()
        reached = first(values)
        lengths.append(reached if np.isfinite(reached) else len(values) * max(abs(values[-1]) / limit, 1.0))
    return first(frame.sort_values("length")[name].to_numpy()), float(np.std(lengths, ddof=1))


def extended_table(run: Audited) -> pd.DataFrame:
    """What the reduced model leaves, from results/metrics and results/replicates."""
    rows, length = [], run.configuration["tables"]["length"]
    for robot in run.extended:
        for key, strategy in run.strategies.items():
            at = run.cell("metrics", robot, key).set_index("length").loc[length]
            drawn = run.cell("replicates", robot, key)
            drawn = drawn[drawn["length"] == length]
            rows.append(
                {
                    "strategy": strategy["name"],
                    "robot": robot,
                    "initial_mean_mm": 1e3 * at["initial_deviation"],
                    "initial_mean_mm_std_error": 1e3 * at["initial_deviation_std_error"],
                    "residual_mean_um": 1e6 * at["deviation"],
                    "residual_mean_um_std_error": 1e6 * at["deviation_std_error"],
                    "share_compensated_percent": 100 * (1 - at["deviation"] / at["initial_deviation"]),
                    "share_compensated_percent_std_error": (100 * (1 - drawn["deviation"] / drawn["initial_deviation"])).std(
                        ddof=1
                    ),
                }
            )
    return pd.DataFrame(rows)


def per_dataset(run: Audited) -> pd.DataFrame:
    """Accuracy of one data set beside its bound, from results/accuracy and results/bounds."""
    rows = []
    for robot in run.configuration["robots"]:
        bounds = run.table(f"results/bounds/{robot}.parquet").set_index(["points", "length"])["rms_per_noise"]
        for noise_um in run.configuration["noise_um"]:
            for key, strategy in run.strategies.items():
                points = "+".join(sorted(points_of(strategy)))
                for _, at in run.cell("accuracy", robot, key, noise_um).iterrows():
                    row = {"strategy": strategy["name"], "robot": robot, "noise_um": float(noise_um), "ds": at["length"]}
                    row |= {f"{name}_um": 1e6 * at[name] for name in ("mean", "rms", "p95", "max")}
                    row |= {f"{name}_um_std_error": 1e6 * at[f"{name}_std_error"] for name in ("mean", "rms", "p95", "max")}
                    row["crlb_rms_um"] = bounds[points, int(at["length"])] * noise_um
                    row["efficiency"] = (row["crlb_rms_um"] / row["rms_um"]) ** 2 if noise_um else np.nan
                    row["efficiency_std_error"] = 2 * row["efficiency"] * row["rms_um_std_error"] / row["rms_um"]
                    for j in range(1, run.arm(robot).joints + 1):
                        for error in ("", "_std_error"):
                            row[f"relative_error_{j}_percent{error}"] = at[f"relative_error_{j}{error}"]
                    rows.append(row)
    return pd.DataFrame(rows)


def solvers(run: Audited) -> pd.DataFrame:
    """How far the solvers lie apart, from results/solvers."""
    rows: list[dict[str, Any]] = []
    stated = _keyed(run.table("reports/tables/solvers.csv"), ("robot", "strategy"))["closest_strategy"].to_dict()
    for robot in run.reduced:
        frame = run.table(f"results/solvers/{robot}.parquet").sort_values("data_set")
        names = list(dict.fromkeys(frame["strategy"]))
        linear, exact = (
            {name: frame[frame["strategy"] == name].filter(like=solver).to_numpy() for name in names}
            for solver in ("equation_11", "gauss_newton")
        )
        for name in names:
            row: dict[str, Any] = {"robot": robot, "strategy": name, "between_solvers": _apart(linear[name], exact[name])}
            apart = pd.Series({other: _apart(exact[name], exact[other]) for other in names if other != name})
            row["closest_strategy"] = closest = _closest(stated.get(f"{robot}|{name}"), apart) if len(apart) else name
            row |= {"gauss_newton_difference": _apart(exact[name], exact[closest])}
            rows.append(row | {"equation_11_difference": _apart(linear[name], linear[closest])})
    return pd.DataFrame(rows)


def budget(run: Audited) -> pd.DataFrame:
    """Sets of points, from results/budget."""
    rows, length = [], run.configuration["tables"]["length"]
    for robot in run.reduced:
        frame = run.table(f"results/budget/{robot}.parquet")
        for points, names in run.configuration["questions"]["point_sets"].items():
            for count in sorted({length, 2 * length // len(names)}):
                at = frame[(frame["points"] == points) & (frame["length"] == count)]
                if len(at):
                    rms, error = _root_mean(at["mean_square"])
                    row = {
                        "robot": robot,
                        "points": points,
                        "configurations": count,
                        "measurements_per_configuration": len(names),
                    }
                    row |= {"crlb_rms_um": 1e6 * np.sqrt(at["bound"].mean()), "rms_um": 1e6 * rms, "std_error_um": 1e6 * error}
                    rows.append(row)
    return pd.DataFrame(rows)


def budget_pairs(run: Audited) -> pd.DataFrame:
    """Sets of points against the first one at as many measurements, from results/budget."""
    rows, length, sets = [], run.configuration["tables"]["length"], run.configuration["questions"]["point_sets"]
    first = next(iter(sets))
    for robot in run.reduced:
        frame = run.table(f"results/budget/{robot}.parquet").set_index(["points", "length"]).sort_values("data_set")
        for points, names in sets.items():
            keys = (points, 2 * length // len(names)), (first, 2 * length // len(sets[first]))
            if points == first or any(key not in frame.index for key in keys):
                continue
            ours, theirs = (frame.loc[[key]]["mean_square"].to_numpy() for key in keys)
            roots = [np.sqrt(each.mean()) for each in (ours, theirs)]
            row: dict[str, Any] = {"robot": robot, "points": points, "against": first}
            row |= {"measurements": keys[0][1] * len(names)}
            row |= {"configurations": keys[0][1], "configurations_against": keys[1][1]}
            row["difference_um"] = 1e6 * (roots[0] - roots[1])
            row["difference_um_std_error"] = 1e6 * stats.sem(ours / (2 * roots[0]) - theirs / (2 * roots[1]))
            rows.append(row | dict(zip(("ratio", "ratio_low", "ratio_high"), _ratio(ours, theirs), strict=True)))
    return pd.DataFrame(rows) if rows else pd.DataFrame(columns=["robot", "points"])


def configurations_needed(run: Audited) -> pd.DataFrame:
    """How many configurations reach an accuracy for good, from results/budget."""
    rows, questions = [], run.configuration["questions"]
    for robot in run.reduced:
        frame = run.table(f"results/budget/{robot}.parquet")
        for points, names in questions["point_sets"].items():
            mine = frame[frame["points"] == points]
            if mine.empty:
                continue
            # A length at which some data set determines nothing reaches no accuracy.
            by_length = mine.groupby("length")
            rms = by_length["mean_square"].agg(lambda some: np.sqrt(some.mean(skipna=False)))
            error = by_length["mean_square"].agg(lambda some: some.sem(skipna=False)) / (2 * rms)
            bound = np.sqrt(by_length["bound"].mean())
            curves = {"": rms, "_low": rms - _QUANTILE * error, "_high": rms + _QUANTILE * error, "_by_bound": bound}
            for accuracy in questions["accuracies_um"]:
                row = {"robot": robot, "points": points, "accuracy_um": accuracy}
                row |= {f"configurations{name}": _for_good(1e6 * curve, accuracy) for name, curve in curves.items()}
                rows.append(row | {"measurements": row["configurations"] * len(names)})
    return pd.DataFrame(rows)


def _for_good(curve: pd.Series, limit: float) -> float:
    """Length from which on a curve stays at its limit or below."""
    missed = curve.index[~(curve <= limit)]
    needed = float(missed[-1] + 1) if len(missed) else float(curve.index[0])
    return needed if needed <= curve.index[-1] else np.inf


def ladder(run: Audited) -> pd.DataFrame:
    """Errors by number of link springs, from results/ladder."""
    rows = []
    for robot in run.extended:
        frame = run.table(f"results/ladder/{robot}.parquet")
        for (noise, length), cell in frame.groupby(["noise", "length"]):
            parts = {str(springs): some for springs, some in cell.groupby("link_springs")}
            for springs, some in (parts | {"by cross-validation": cell[cell["chosen"]]}).items():
                rms, error = _root_mean(some["mean_square"])
                row = {"robot": robot, "noise_um": round(1e6 * float(str(noise)), 6), "length": length, "link_springs": springs}
                row |= {"rms_um": 1e6 * rms, "rms_um_std_error": 1e6 * error}
                counted = some["added_link"].value_counts().sort_index()
                row["usual_link"] = counted.idxmax() if springs.isdigit() and springs != "0" else np.nan
                rows.append(row | {"chosen_percent": 100 * some["chosen"].mean() if springs.isdigit() else np.nan})
    return pd.DataFrame(rows)


def designs(run: Audited) -> pd.DataFrame:
    """Designs, from results/designs."""
    parts = []
    for robot in run.reduced:
        frame = run.table(f"results/designs/{robot}.parquet").copy()
        for name in ("rms", "low", "high"):
            frame[f"{name}_um"] = 1e6 * frame.pop(name)
        parts.append(frame.assign(robot=robot))
    return pd.concat(parts)


def observability(run: Audited) -> pd.DataFrame:
    """Rank correlations, from results/observability, by pandas."""
    rows = []
    for robot in run.reduced:
        frame = run.table(f"results/observability/{robot}.parquet")
        ranked, sets = frame.corr("spearman"), len(frame)
        for index in ("O1", "O2", "O3", "O4", "O5", "bound"):
            row: dict[str, Any] = {"robot": robot, "index": index}
            for name, column in (("bound", "bound"), ("error", "mean_square")):
                row[f"rank_correlation_with_{name}"] = found = float(ranked[column].to_dict()[index])
                row[f"rank_correlation_with_{name}_std_error"] = (1 - found**2) / np.sqrt(sets - 1)
            rows.append(row)
    return pd.DataFrame(rows)


def places(run: Audited) -> pd.DataFrame:
    """A second target at each place, from results/places."""
    rows = []
    for robot in run.reduced:
        for key, cell in run.table(f"results/places/{robot}.parquet").groupby(["joints", "along", "side"], sort=False):
            row = {"robot": robot} | dict(zip(("joints", "along_m", "side"), key, strict=True))
            pair = cell["bound"].to_numpy(), cell["bound_end_effector"].to_numpy()
            row |= dict(zip(("ratio", "ratio_low", "ratio_high"), _ratio(*pair), strict=True))
            rows.append(row | {f"seen_{name}_percent": 100 * cell[name].mean() for name in ("turned", "fixed")})
    return pd.DataFrame(rows)


def geometry(run: Audited) -> pd.DataFrame:
    """Geometry and compliances, from results/geometry."""
    parts = []
    for robot in run.reduced:
        frame = run.table(f"results/geometry/{robot}.parquet")
        part = frame.rename(columns={f"compliance_{name}": f"compliance_{name}_percent" for name in ("noise", "leak")})
        part = part.assign(robot=robot, rms_um=1e6 * np.sqrt(frame["noise"] ** 2 + frame["leak"] ** 2))
        for name in ("noise", "leak"):
            part[f"{name}_um"], part[f"zero_{name}_urad"] = 1e6 * frame[name], 1e6 * frame[f"zero_{name}"]
        parts.append(part)
    return pd.concat(parts)


def weighting(run: Audited) -> pd.DataFrame:
    """What equal weights cost, from results/weighting."""
    parts = []
    for robot in run.reduced:
        frame = run.table(f"results/weighting/{robot}.parquet")
        scaled = {f"{name}_um": 1e6 * frame[name] for name in ("per_metre", "equal", "weighted")}
        parts.append(frame[["orientation_ratio"]].assign(robot=robot, ratio=frame["equal"] / frame["weighted"], **scaled))
    return pd.concat(parts)


def tubes(run: Audited) -> pd.DataFrame:
    """Other diameters, from results/tubes."""
    rows = []
    for robot in run.extended:
        for diameter, cell in run.table(f"results/tubes/{robot}.parquet").groupby("diameter", sort=False):
            single: dict[str, pd.Series] = {
                "mean": cell["mean"],
                "std": (cell["mean_square"] - cell["mean"] ** 2) ** 0.5,
                "max": cell["maximum"],
            }
            row: dict[str, Any] = {"robot": robot, "diameter_mm": 1e3 * float(str(diameter))}
            for name, values in single.items():
                row |= {f"{name}_mm": 1e3 * values.mean(), f"{name}_mm_between": 1e3 * values.std(ddof=1)}
            left, error = _root_mean(cell["left"])
            rows.append(row | {"left_um": 1e6 * left, "left_um_std_error": 1e6 * error})
    return pd.DataFrame(rows)


def _closest(stated: str | None, apart: pd.Series) -> str:
    """The closest strategy; of several that are one estimator, to rounding, the one that is stated."""
    return str(stated if stated is not None and stated in apart and apart[stated] <= apart.min() + ROUNDING else apart.idxmin())


def _apart(values: np.ndarray, others: np.ndarray) -> float:
    """Largest relative difference."""
    return float(np.max(np.abs(values - others) / np.abs(others)))


def _root_mean(squares: pd.Series) -> tuple[float, float]:
    """Root of a mean and its standard error by the delta method."""
    values = squares.to_numpy(float)
    root = float(np.sqrt(values.mean()))
    return root, float(stats.sem(values) / (2 * root))


def _ratio(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float, float]:
    """Ratio of two roots of means of pairs, with its 95 % interval on the logarithm."""
    ratio = float(np.sqrt(ours.mean() / theirs.mean()))
    error = _QUANTILE * float(stats.sem(ours / ours.mean() - theirs / theirs.mean())) / 2
    return ratio, ratio * np.exp(-error), ratio * np.exp(error)


# By the name of the table: what makes it again, and the columns that name a row.
TABLES: Mapping[str, tuple[Any, tuple[str, ...]]] = {
    "table1": (table1, ("robot",)),
    "table2": (table2, ("robot",)),
    "table3": (table3, ("robot",)),
    "table4": (table4, ("strategy", "robot")),
    "extended": (extended_table, ("strategy", "robot")),
    "per_dataset": (per_dataset, ("strategy", "robot", "noise_um", "ds")),
    "solvers": (solvers, ("robot", "strategy")),
    "budget": (budget, ("robot", "points", "configurations")),
    "budget_pairs": (budget_pairs, ("robot", "points")),
    "configurations_needed": (configurations_needed, ("robot", "points", "accuracy_um")),
    "ladder": (ladder, ("robot", "noise_um", "length", "link_springs")),
    "designs": (designs, ("robot", "joint_range", "design", "configurations")),
    "observability": (observability, ("robot", "index")),
    "places": (places, ("robot", "joints", "along_m", "side")),
    "geometry": (geometry, ("robot", "estimator")),
    "weighting": (weighting, ("robot", "orientation_ratio", "per_metre_um")),
    "tubes": (tubes, ("robot", "diameter_mm")),
    "strategy_scores": (rankings.strategy_scores, ("robot", "metric", "strategy")),
    "strategy_pairs": (rankings.strategy_pairs, ("robot", "metric", "strategy", "other")),
    "comparison": (paper_figures.comparison, ("table", "robot", "strategy", "quantity")),
    "expectations": (paper_figures.expectations, ("robot", "strategy", "quantity")),
}


def table(run: Audited, file: str, name: str) -> list[Finding]:
    """Every cell of a table that follows from files."""
    if name not in TABLES:
        return []
    make, keys = TABLES[name]
    stored, again = run.table(file), make(run)
    # Names of rows as texts, numbers with the digits of the file.
    left, right = (_keyed(frame, keys) for frame in (stored, again))
    odd = sorted(set(right.index) ^ set(left.index))[:1]
    twice = left.index[left.index.duplicated()].tolist()[:1]
    note = f"row {(odd + twice)[0]} is {'there twice' if not odd else 'in only one of both'}" if odd or twice else ""
    found = [held(file, "rows", "pandas", not note, note, len(right))]
    if note:
        return found
    left = left.loc[right.index]
    columns = [column for column in left.columns if column in right.columns and column not in keys]
    for column in columns:
        if pd.api.types.is_numeric_dtype(right[column]) and not pd.api.types.is_bool_dtype(right[column]):
            one = compared(file, f"column {column}", "pandas", left[column], right[column], _NINE_DIGITS, _ZERO, right[column])
        else:
            texts = (frame[column].fillna("").astype(str) for frame in (left, right))
            off = [
                f"{name}: {here!r}, expected {there!r}"
                for name, here, there in zip(right.index, *texts, strict=True)
                if here != there
            ]
            one = held(file, f"column {column}", "pandas", not off, ", ".join(off[:1]), len(right))
        found.append(one)
    followed = len(right) * len(columns)
    rest = [column for column in stored.columns if column not in (*columns, *keys)] if len(stored) else []
    words = f"{followed} of {len(stored) * (len(columns) + len(rest))} cells followed" + (
        f"; not {', '.join(rest)}" if rest else ""
    )
    return [*found, Finding(file, words, "counting", followed, 0.0)]


def printed(run: Audited, file: str, name: str, ending: str) -> list[Finding]:
    """Values of a table for people against those of its CSV, to the digits that are printed."""
    source = run.table(f"reports/tables/{name}.csv")
    columns = [column for column in source.columns if not column.endswith("_std_error")]
    lines = (run.folder / file).read_text("utf-8").splitlines()
    if ending == "md":
        rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:] if line.startswith("|")]
    else:
        rows = [[cell.strip() for cell in line.removesuffix(r"\\").split("&")] for line in lines if line.endswith(r"\\")][1:]
    shown = [row for row in rows if len(row) == len(columns)]
    if len(shown) != len(source):
        return [held(file, "rows", "counting", False, f"found {len(shown)}, expected {len(source)}")]
    off = [
        f"{column}: {text}"
        for row, (_, values) in zip(shown, source.iterrows(), strict=True)
        for column, text in zip(columns, row, strict=True)
        if not _says(text, values[column])
    ]
    checked = f"values as in {name}.csv, to the digits shown"
    return [held(file, checked, "pandas", not off, ", ".join(off[:3]), len(source) * len(columns))]


def _says(text: str, value: str | float) -> bool:
    if isinstance(value, str):
        return re.sub(r"\\", "", text) == value
    number = float(value)
    if np.isnan(number) or np.isinf(number):
        return text in ("", "not reached")
    shown = re.split(r"\s*(?:±|\$\\pm\$)\s*", text)[0]
    decimals = len(shown.partition("e")[0].partition(".")[2])
    exponent = int(shown.partition("e")[2] or 0)
    digits = max(10.0 ** (exponent - decimals), 0.0)
    # Three digits of a number without error.
    return abs(float(shown) - number) <= 0.5000001 * digits


def _keyed(frame: pd.DataFrame, keys: Iterable[str]) -> pd.DataFrame:
    names = ["|".join(_text(value) for value in row) for row in frame[list(keys)].itertuples(index=False)]
    return frame.assign(**{"row": names}).set_index("row")


def _text(value: str | float) -> str:
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else f"{float(value):.6g}"


CHECKS = (
    (re.compile(r"reports/tables/(\w+)\.csv"), table),
    (re.compile(r"reports/tables/(table\d)\.(md|tex)"), printed),
)
