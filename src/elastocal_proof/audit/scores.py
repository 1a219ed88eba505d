"""Audit of the results that follow from estimates: bootstrap weights, scores, tables of
the paper, and the errors of a campaign in its tables and verdict.

Every value of these files is computed again, by pandas and numpy, from the files that
the other modules check.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from elastocal_proof.audit.finished_run import (
    Finding,
    FinishedRun,
    compare,
    open_philox_stream,
    require,
)

# Relative tolerance of deviations, which are small differences of positions.
_DEVIATIONS = 1e-6
# Tables as CSV have nine digits.
_NINE_DIGITS = 1e-8
# Absolute tolerance of errors, m: they are differences of positions of some metres.
_POSITIONS_M = 1e-10
# A mean of stiffnesses loses digits where compliances are close to zero.
_MEAN_OF_INVERSES = 1e-7
_PANDAS = "pandas, numpy"
_MICRO = 1e6
_MILLI = 1e3
_COMPONENTS = ("dx", "dy", "dz")
# A number of a table for people, and its standard error.
_CELL = re.compile(r"(-?[\d.]+(?:e[+-]?\d+)?)(?: ± ([\d.]+(?:e[+-]?\d+)?))?")


def check_weights(run: FinishedRun, file: str, robot: str) -> Iterator[Finding]:
    """Every bootstrap weight from its random stream."""
    frame = run.table(file)
    replicates = run.configuration["evaluation"]["bootstrap_replicates"]
    sets = run.configuration["data_sets"]
    tests = run.configuration["test_configurations"]
    stream = "numpy's Philox stream"
    drawn = [
        open_philox_stream(run.seed, robot, "bootstrap", number).poisson(
            1.0, replicates
        )
        for number in range(sets)
    ]
    test_stream = open_philox_stream(run.seed, robot, "bootstrap of tests")
    test_counts = test_stream.poisson(1.0, (replicates, tests)).T
    for members, expected in (
        ("data sets", np.array(drawn)),
        ("test configurations", test_counts),
    ):
        rows = frame[frame["members"] == members]
        yield compare(f"weights of {members}", stream, rows["count"], expected, 0.0)


def check_initial(run: FinishedRun, file: str, robot: str) -> Iterator[Finding]:
    """Mean, mean square and largest deflection of every data set."""
    frame = run.table(file)
    end = run.arm(robot).points[-1]
    deflections = run.deflections(f"data/simulated/{robot}/ideal.parquet", end)
    lengths = np.linalg.norm(deflections[..., :3], axis=2)
    expected = {
        "mean": lengths.mean(axis=1),
        "mean_square": (lengths**2).mean(axis=1),
        "maximum": lengths.max(axis=1),
        "configurations": np.full(len(lengths), lengths.shape[1]),
    }
    for column, values in expected.items():
        yield compare(column, _PANDAS, frame[column], values)


def check_metrics(
    run: FinishedRun, file: str, robot: str, noise_um: str, strategy: str
) -> Iterator[Finding]:
    """Every averaged compliance with its standard error, every score, and deviations of
    sampled lengths."""
    frame = run.table(file)
    compliance = _average_estimates(run, robot, noise_um, strategy)
    true_compliance = _get_true_compliance(run, robot)
    error = 100.0 * (true_compliance / compliance - 1.0)
    fixed = np.array(_list_fixed_joints(run, strategy))
    quantities: dict[str, np.ndarray] = {}
    for joint in range(len(true_compliance)):
        quantities[f"compliance_{joint + 1}"] = compliance[..., joint]
        quantities[f"delta_k_{joint + 1}"] = error[..., joint]
    quantities["k_sigma"] = error.sum(axis=-1)
    quantities["k_sigma_fixed_joints"] = error[..., fixed].sum(axis=-1)
    for column, values in quantities.items():
        yield compare(column, _PANDAS, frame[column], values[0], _MEAN_OF_INVERSES)
        yield compare(
            f"standard error of {column}",
            _PANDAS,
            frame[f"{column}_std_error"],
            values[1:].std(axis=0, ddof=1),
            _MEAN_OF_INVERSES,
        )
    yield from _check_spread(run, frame, robot, noise_um, strategy)
    lengths = run.pick(file, compliance.shape[1])
    expected = _compute_deviations(run, robot, compliance[0, lengths])
    yield compare(
        "deviations of sampled lengths",
        "numpy on pinocchio",
        frame["deviation"].to_numpy()[lengths],
        expected.mean(axis=1),
        _DEVIATIONS,
    )
    replicates = run.table(_name_replicates(robot, noise_um, strategy))
    for column in ("deviation", "initial_deviation"):
        curves = replicates.groupby("length")[column].std(ddof=1)
        stated = frame[f"{column}_std_error"]
        yield compare(f"standard error of {column}", _PANDAS, stated, curves)


def _check_spread(
    run: FinishedRun, frame: pd.DataFrame, robot: str, noise_um: str, strategy: str
) -> Iterator[Finding]:
    """Shares of estimates that are not positive, their spread, and trusted lengths."""
    estimates = _read_estimates(run, robot, noise_um, strategy)
    nonpositive = (estimates <= 0).any(axis=2).mean(axis=0)
    spread = (estimates.std(axis=0) / np.abs(estimates.mean(axis=0))).max(axis=1)
    yield compare(
        "share that is not positive", _PANDAS, frame["nonpositive_share"], nonpositive
    )
    stated = frame["relative_spread"]
    yield compare("relative spread", _PANDAS, stated, spread, _MEAN_OF_INVERSES)
    trusted = (stated <= 0.25) & (frame["nonpositive_share"] == 0)
    yield compare("what is trusted", _PANDAS, frame["trustworthy"], trusted, 0.0)


def check_replicates(
    run: FinishedRun, file: str, robot: str, noise_um: str, strategy: str
) -> Iterator[Finding]:
    """Every stiffness score of every bootstrap replicate, and deviations of sampled
    ones."""
    frame = run.table(file)
    compliance = _average_estimates(run, robot, noise_um, strategy)[1:]
    error = 100.0 * (_get_true_compliance(run, robot) / compliance - 1.0)
    fixed = np.array(_list_fixed_joints(run, strategy))
    for column, values in (
        ("k_sigma", error.sum(axis=-1)),
        ("k_sigma_fixed_joints", error[..., fixed].sum(axis=-1)),
    ):
        yield compare(column, _PANDAS, frame[column], values, _MEAN_OF_INVERSES)
    weights = _read_weights(run, robot, "test configurations")[1:]
    rows = run.pick(file, len(frame))
    replicate, length = np.divmod(rows, compliance.shape[1])
    deviations = _compute_deviations(run, robot, compliance[replicate, length])
    drawn = weights[replicate]
    yield compare(
        "deviations of sampled replicates",
        "numpy on pinocchio",
        frame["deviation"].to_numpy()[rows],
        (deviations * drawn).sum(axis=1) / drawn.sum(axis=1),
        _DEVIATIONS,
    )
    initial = _compute_initial_errors(run, robot)
    expected = weights @ initial / weights.sum(axis=1)
    yield compare(
        "deviation before calibration",
        _PANDAS,
        frame["initial_deviation"],
        np.repeat(expected, compliance.shape[1]),
    )


def check_table1(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every compliance, from the robots' files."""
    for robot, row in run.table(file).set_index("robot").iterrows():
        stated = row.filter(regex=r"^compliance_\d+_urad_per_Nm$").dropna()
        expected = _MICRO * _get_true_compliance(run, str(robot))
        yield compare(f"compliances of {robot}", "robot file", stated, expected, 1e-9)


def check_table2(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every mean, spread and maximum, from the deflections of all data sets."""
    for name, row in run.table(file).set_index("robot").iterrows():
        robot = str(name)
        frame = run.table(f"results/initial/{robot}.parquet")
        weights = _read_weights(run, robot, "data sets")
        count = weights @ frame["configurations"]
        mean = weights @ (frame["configurations"] * frame["mean"]) / count
        square = weights @ (frame["configurations"] * frame["mean_square"]) / count
        std = np.sqrt(square - mean**2)
        one_std = np.sqrt(frame["mean_square"] - frame["mean"] ** 2)
        expected = {
            "mean_mm": mean[0],
            "mean_mm_std_error": mean[1:].std(ddof=1),
            "std_mm": std[0],
            "std_mm_std_error": std[1:].std(ddof=1),
            "max_mm": frame["maximum"].max(),
            "mean_mm_one_set": frame["mean"].mean(),
            "mean_mm_one_set_std": frame["mean"].std(),
            "std_mm_one_set": one_std.mean(),
            "std_mm_one_set_std": one_std.std(),
            "max_mm_one_set": frame["maximum"].mean(),
            "max_mm_one_set_std": frame["maximum"].std(),
        }
        values = _MILLI * np.array(list(expected.values()))
        stated = row[list(expected)]
        yield compare(f"row of {robot}", _PANDAS, stated, values, _NINE_DIGITS)


def check_table3(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every compliance and standard error, from the metrics."""
    tables = run.configuration["tables"]
    for name, row in run.table(file).set_index("robot").iterrows():
        cell = _read_cell(run, str(name), tables["classical_strategy"])
        metrics = cell.loc[tables["length"]]
        stated = row.dropna()
        expected = [
            _MICRO * metrics[column.replace("_urad_per_Nm", "")]
            for column in stated.index
        ]
        yield compare(f"row of {name}", "pandas", stated, expected, _NINE_DIGITS)


@dataclass(frozen=True)
class _TabulatedScore:
    """A score of Table 4.

    Attributes
    ----------
    column : column of the metrics
    factor : from the unit of the metrics to that of the table
    limit : in the unit of the table
    score, needed : columns of the table
    """

    column: str
    factor: float
    limit: float
    score: str
    needed: str


def check_table4(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every score at the tables' length, and the length from which on it stays within
    the limits, from the metrics."""
    length = run.configuration["tables"]["length"]
    scores = _list_tabulated_scores(run.configuration["tables"])
    for _, row in run.table(file).iterrows():
        cell = _read_cell(run, row["robot"], row["strategy_file"])
        expected: list[float] = []
        stated: list[float] = []
        for score in scores:
            expected += _compute_tabulated_score(score, cell, length)
            std_error = row[f"{score.score}_std_error"]
            stated += [row[score.score], std_error, row[score.needed]]
        name = f"row of {row['robot']}, {row['strategy']}"
        yield compare(name, "pandas", stated, expected, _NINE_DIGITS)


def _list_tabulated_scores(tables: Mapping[str, Any]) -> list[_TabulatedScore]:
    """List the scores of Table 4 by the settings of the tables."""
    length = tables["length"]
    percent = tables["k_sigma_limit_percent"]
    micrometres = tables["deviation_limit_um"]
    scores = [
        _TabulatedScore(
            f"k_sigma{end}",
            1.0,
            percent,
            f"k_sigma_{length}_percent{end}",
            f"n_k_sigma_{percent:g}_percent{end}",
        )
        for end in ("", "_fixed_joints")
    ]
    deviation = _TabulatedScore(
        "deviation",
        _MICRO,
        micrometres,
        f"dev_{length}_um",
        f"n_dev_{micrometres:g}_um",
    )
    return [*scores, deviation]


def _compute_tabulated_score(
    score: _TabulatedScore, cell: pd.DataFrame, length: int
) -> list[float]:
    """Compute a score, its standard error, and the length from which on it stays within
    its limit, which is infinite if the longest data set is beyond it."""
    curve = score.factor * cell[score.column]
    std_error = score.factor * cell[f"{score.column}_std_error"].loc[length]
    is_within = curve.abs() <= score.limit
    # From the longest data set backwards, all lengths up to the first one beyond.
    stays_within = is_within[::-1].cummin()
    lengths = stays_within.index[stays_within]
    kept_length = lengths.min() if len(lengths) else np.inf
    return [curve.loc[length], std_error, kept_length]


def check_table_for_people(
    run: FinishedRun, file: str, table: str
) -> Iterator[Finding]:
    """Every number of a table for people is that of the CSV beside it, rounded."""
    frame = run.table(f"reports/tables/{table}.csv")
    columns = [
        column
        for column in frame.select_dtypes("number").columns
        if not column.endswith("_std_error")
    ]
    values = frame[columns].to_numpy().ravel()
    cells = _read_printed_numbers((run.folder / file).read_text("utf-8"))
    finite = values[np.isfinite(values)]
    yield require(
        "numbers as in the CSV file",
        "counting",
        len(cells) == len(finite),
        f"{len(cells)} numbers for {len(finite)}",
        len(finite),
    )
    if len(cells) == len(finite):
        printed = np.array([float(text) for text in cells])
        places = np.array([_count_decimals(text) for text in cells])
        half_unit = 0.5 * 10.0**-places
        excess = np.abs(printed - finite) / half_unit
        worst = int(np.argmax(excess))
        yield require(
            "rounded values",
            "csv, float",
            excess.max() <= 1.0 + 1e-6,
            f"{cells[worst]} for {finite[worst]:.9g}",
            len(finite),
        )


def _read_printed_numbers(text: str) -> list[str]:
    """Read the first number of each cell of a table in Markdown or LaTeX, row by row,
    without the header and columns of names."""
    separator = "&" if "tabular" in text else "|"
    rows = [line for line in text.splitlines() if separator in line][1:]
    numbers = []
    for row in rows:
        for cell in row.strip(" |").removesuffix(r"\\").split(separator):
            match = _CELL.fullmatch(cell.strip())
            if match:
                numbers.append(match[1])
    return numbers


def _count_decimals(text: str) -> int:
    """Count the decimals of a printed number, negative for rounded tens."""
    mantissa, _, exponent = text.partition("e")
    return len(mantissa.partition(".")[2]) - int(exponent or 0)


def check_extended(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every deviation, and the share of it that calibration removes, from metrics and
    replicates."""
    for _, row in run.table(file).iterrows():
        expected = _compute_extended_row(run, row["robot"], row["strategy"])
        yield compare(
            f"row of {row['robot']}, {row['strategy']}",
            "pandas",
            row[list(expected)],
            list(expected.values()),
            _NINE_DIGITS,
        )


def _compute_extended_row(run: FinishedRun, robot: str, title: str) -> dict[str, float]:
    """Compute a row of the table of robots with elastic links, for a strategy by its
    title."""
    files = {entry["name"]: name for name, entry in run.strategies.items()}
    tables = run.configuration["tables"]
    length = tables["length"]
    metrics = _read_cell(run, robot, files[title]).loc[length]
    name = _name_replicates(robot, f"{tables['noise_um']:g}", files[title])
    replicates = run.table(name).query("length == @length")
    ratios = replicates["deviation"] / replicates["initial_deviation"]
    ratio = metrics["deviation"] / metrics["initial_deviation"]
    return {
        "initial_mean_mm": _MILLI * metrics["initial_deviation"],
        "initial_mean_mm_std_error": _MILLI * metrics["initial_deviation_std_error"],
        "residual_mean_um": _MICRO * metrics["deviation"],
        "residual_mean_um_std_error": _MICRO * metrics["deviation_std_error"],
        "share_compensated_percent": 100 * (1 - ratio),
        "share_compensated_percent_std_error": 100 * ratios.std(ddof=1),
    }


def check_errors(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Errors of the final model at fitted and held-out poses, from the residuals of
    every row."""
    final = run.table(file).iloc[-1]
    for group, prefix in (("fitted", "train"), ("held-out", "heldout")):
        expected = _summarize_residuals(run, campaign, "after", group)
        yield compare(
            f"errors of {group} poses, after",
            _PANDAS,
            final[[f"{prefix}_{quantity}" for quantity in expected]],
            list(expected.values()),
            _NINE_DIGITS,
            _POSITIONS_M,
        )


def check_verdict(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Held-out errors before and after, from the residuals of every row."""
    heldout = run.document(file)["heldout"]
    for name in ("before", "after"):
        expected = _summarize_residuals(run, campaign, name, "held-out")
        stated = [heldout[name][quantity] for quantity in expected]
        checked = f"errors of held-out poses, {name}"
        values = list(expected.values())
        yield compare(checked, _PANDAS, stated, values, absolute=_POSITIONS_M)


def _summarize_residuals(
    run: FinishedRun, campaign: str, name: str, group: str
) -> dict[str, float]:
    """Mean, root mean square and maximum of the errors of a model, m, at the poses of a
    group, "fitted" or "held-out".

    Gross errors are left out, and measurements averaged over their repeats.
    """
    frame = run.table(f"reports/loop/{campaign}/residuals.parquet")
    is_held_out = frame["held_out"].astype(bool)
    in_group = is_held_out if group == "held-out" else ~is_held_out
    rows = frame[in_group & ~frame["gross_error"].astype(bool)]
    columns = [f"{name}_{component}" for component in _COMPONENTS]
    states = rows.groupby(["session", "pose", "load", "target"])[columns].mean()
    lengths = np.linalg.norm(states, axis=1)
    return {
        "mean_m": float(lengths.mean()),
        "rms_m": float(np.sqrt((lengths**2).mean())),
        "max_m": float(lengths.max()),
    }


def _name_replicates(robot: str, noise_um: str, strategy: str) -> str:
    return f"results/replicates/{robot}/{noise_um}um/{strategy}.parquet"


def _read_cell(run: FinishedRun, robot: str, strategy: str) -> pd.DataFrame:
    """Read the metrics of a strategy on a robot at the tables' noise, by length."""
    noise_um = f"{run.configuration['tables']['noise_um']:g}"
    file = f"results/metrics/{robot}/{noise_um}um/{strategy}.parquet"
    return run.table(file).set_index("length")


def _read_estimates(
    run: FinishedRun, robot: str, noise_um: str, strategy: str
) -> np.ndarray:
    """Read the compliances (sets, lengths, n) of all data sets."""
    frame = run.table(f"results/identified/{robot}/{noise_um}um/{strategy}.parquet")
    sets = frame["data_set"].nunique()
    values = frame.filter(regex=r"^compliance_\d+$").to_numpy()
    return values.reshape(sets, -1, values.shape[1])


# Metrics and replicates of a cell are two files, which are checked one after the other
# for all cells: a megabyte each is kept.
@lru_cache(maxsize=100)
def _average_estimates(
    run: FinishedRun, robot: str, noise_um: str, strategy: str
) -> np.ndarray:
    """Average the stiffness, or compliance, of all data sets: compliances
    (1 + replicates, lengths, n), of which the first counts each data set once."""
    estimates = _read_estimates(run, robot, noise_um, strategy)
    weights = _read_weights(run, robot, "data sets")
    is_stiffness = run.configuration["interpretations"]["average"] == "stiffness"
    averaged = 1.0 / estimates if is_stiffness else estimates
    mean = np.einsum("rs,slj->rlj", weights, averaged, optimize=True)
    mean /= weights.sum(axis=1)[:, None, None]
    return 1.0 / mean if is_stiffness else mean


def _read_weights(run: FinishedRun, robot: str, members: str) -> np.ndarray:
    """Read the weights (1 + replicates, members), of which the first are one."""
    frame = run.table(f"results/weights/{robot}.parquet")
    rows = frame[frame["members"] == members]
    counts = rows.pivot(index="replicate", columns="number", values="count").to_numpy()
    return np.vstack([np.ones(counts.shape[1]), counts])


def _get_true_compliance(run: FinishedRun, robot: str) -> np.ndarray:
    """Compliances (n,) of a robot's file, rad/(N m)."""
    document: Mapping[str, Any] = run.robots[robot]
    return 1e-6 * np.array(document["compliance_urad_per_Nm"], float)


def _list_fixed_joints(run: FinishedRun, strategy: str) -> list[int]:
    """Indices of the joints that the last stage holds, or of all joints if it holds none
    (interpretation R10)."""
    stages = run.strategies[strategy]["stages"]
    identified = sorted({joint for stage in stages for joint in stage["joints"]})
    return [joint - 1 for joint in stages[-1].get("held") or identified]


def _compute_initial_errors(run: FinishedRun, robot: str) -> np.ndarray:
    """Position errors (tests,) without any model, m."""
    end = run.arm(robot).points[-1]
    file = f"data/simulated/{robot}/test/ideal.parquet"
    return np.linalg.norm(run.deflections(file, end)[0, :, :3], axis=1)


def _compute_deviations(
    run: FinishedRun, robot: str, compliance: np.ndarray
) -> np.ndarray:
    """Position errors (models, tests), m, of models (models, n) at the test
    configurations, linear in the error of the compliances (equation 15)."""
    regressors, offset = _predict_tests(run, robot)
    slope = regressors @ (compliance - _get_true_compliance(run, robot)).T
    return np.linalg.norm(slope.transpose(2, 0, 1) + offset, axis=2)


@lru_cache(maxsize=8)
def _predict_tests(run: FinishedRun, robot: str) -> tuple[np.ndarray, np.ndarray]:
    """Predict the test configurations of a robot, which all its cells share: matrices A
    (tests, 3, n), m per rad/(N m), and the error (tests, 3) of the model with the true
    joint compliances, m."""
    arm = run.arm(robot)
    end = arm.points[-1]
    angles, wrenches = run.experiments(robot, "test")
    springs = arm.build_springs(_get_true_compliance(run, robot), {})
    regressors = []
    predicted = []
    for q, wrench in zip(angles[0], wrenches[0], strict=True):
        at_rest, _ = arm.pose(arm.extend(q), end)
        coordinates, _ = arm.deflect(springs, q, wrench, 1, *run.at(end))
        deflected, _ = arm.pose(coordinates, end)
        predicted.append(deflected - at_rest)
        regressors.append(arm.regressor(q, wrench, end, *run.at(end))[:3])
    true_deflections = run.deflections(
        f"data/simulated/{robot}/test/ideal.parquet", end
    )
    return np.array(regressors), np.array(predicted) - true_deflections[0, :, :3]


CHECKS = {
    "results/weights/{robot}.parquet": check_weights,
    "results/initial/{robot}.parquet": check_initial,
    "results/metrics/{robot}/{noise_um}um/{strategy}.parquet": check_metrics,
    "results/replicates/{robot}/{noise_um}um/{strategy}.parquet": check_replicates,
    "reports/tables/table1.csv": check_table1,
    "reports/tables/table2.csv": check_table2,
    "reports/tables/table3.csv": check_table3,
    "reports/tables/table4.csv": check_table4,
    "reports/tables/{table}.md": check_table_for_people,
    "reports/tables/{table}.tex": check_table_for_people,
    "reports/tables/extended.csv": check_extended,
    "reports/loop/{campaign}/before_after.csv": check_errors,
    "reports/loop/{campaign}/verdict.json": check_verdict,
}
