"""Figures of the blind benchmark and their targets, counted as the plan says, and the
tables of its pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from elastocal.diagnosis.verdict import NAMED
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal.random_streams import open_stream
from elastocal_proof.blind.cases import PROOF, TUNED, Plan
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.locations import list_locations, tabulate_locations
from elastocal_proof.blind.power import compute_power
from elastocal_proof.blind.scores import (
    NONE,
    build_case_row,
    compute_rate,
    list_intervals,
)

Tables = Mapping[str, pd.DataFrame]
# An entry of the plan's ``figures``, and its target: words and limits.
Figure = Mapping[str, Any]
Target = Mapping[str, Any] | None

_RESAMPLES = 2000
# Resamples that are evaluated at once, which bounds the memory.
_BATCH = 200
# Held-out errors up to this ratio to the oracle's count as equal to them.
NEAR_ORACLE = 1.05
# Bins of the reliability diagram and of the calibration error.
_BINS = 10
# Cases of a bin below which its error is chance: the standard error is nine points.
_LEAST_BIN_CASES = 30
_LIMITS = ("target_low", "target_high", "power", "risk")
_RELIABILITY = ["group", "from", "to", "stated", "hits", "cases", "rate", "low", "high"]
_COUNTED = [
    "detected",
    "holds_truth",
    "named_right",
    "located",
    "wrong_name",
    "false_mechanism",
    "oracle_detected",
]


def select_targets(summary: pd.DataFrame) -> pd.DataFrame:
    """Select the figures that have a target from a summary, computed or read."""
    return summary[summary.target.fillna("").ne("")]


def iterate_rows(table: pd.DataFrame) -> Iterator[Any]:
    """Iterate over the rows of a table, whose attributes are its columns."""
    return table.itertuples()


def summarize_figures(
    plan: Plan,
    cases: pd.DataFrame,
    intervals: pd.DataFrame,
    seed: int,
    locations: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Compute every figure of the plan and compare it with its target.

    Rates have Clopper-Pearson intervals, of the effective number of cases if the figure
    names ``clusters``; ratios have percentile bootstrap intervals [1]_ over cases.

    Parameters
    ----------
    plan : mapping
        Contents of config/blind.yaml.
    cases, intervals : DataFrame
        Rows of `scores.build_case_row` and of `scores.list_intervals`.
    seed : int
        Seed of the bootstrap.
    locations : DataFrame, optional
        Rows of `locations.list_locations`.

    Returns
    -------
    DataFrame
        One row for each figure. ``target_low`` and ``target_high`` are the range of the
        target; ``holds`` is empty without a target or a case. ``power`` and ``risk``
        are the probabilities to reach the target at its acceptable and at its
        unacceptable rate, with the number of cases that there are.

    References
    ----------
    .. [1] Efron, B. and Tibshirani, R. J., An Introduction to the Bootstrap, section
       13.3, Chapman and Hall, 1993.
    """
    ratio = cases.after_rms_m / cases.oracle_rms_m
    cases = cases.assign(as_oracle=ratio <= NEAR_ORACLE)
    tables = {
        "cases": cases,
        "statements": cases[cases.stated.notna()],
        "intervals": intervals,
        "locations": tabulate_locations([]) if locations is None else locations,
    }
    rows = [
        row
        for figure in plan["figures"]
        for row in _list_figure_rows(plan, figure, tables, seed)
    ]
    # A table proves nothing if one of its robots was used for tuning.
    robots = PROOF if set(cases.robots) == {PROOF} else TUNED
    return pd.DataFrame(rows).assign(robots=robots)


def summarize_by_robot(
    plan: Plan, cases: pd.DataFrame, seed: int
) -> dict[str, pd.DataFrame]:
    """Call `summarize_figures` for each robot by itself, without intervals of
    parameters."""
    return {
        str(robot): summarize_figures(plan, rows, pd.DataFrame(), seed)
        for robot, rows in cases.groupby("robot")
    }


def _list_figure_rows(
    plan: Plan, figure: Figure, tables: Tables, seed: int
) -> Iterator[dict[str, Any]]:
    """List the rows of the summary that one entry of the plan asks for."""
    table = tables[figure.get("table", "cases")]
    if figure.get("table") in ("intervals", "locations") and table.empty:
        return
    selected = table.query(figure["of"]) if "of" in figure else table
    target = figure.get("target")
    if figure.get("each") == "hard":
        for setting, changes in plan["settings"].items():
            if changes.get("hard"):
                rows = selected[selected.setting == setting]
                words = figure["words"].format(setting=describe_setting(plan, setting))
                yield from _measure(figure, rows, words, target, seed)
    elif "by" in figure:
        shared = {key: figure[key] for key in ("clusters",) if key in figure}
        for level, rows in selected.groupby(figure["by"]):
            for entry in figure["parts"]:
                words = entry["words"].format(at=f"at {level:g}")
                target = None
                if level in entry.get("levels", [level]):
                    target = entry.get("target")
                yield from _measure(shared | entry, rows, words, target, seed)
    elif len(selected) or not figure.get("if_any"):
        yield from _measure(figure, selected, figure["words"], target, seed)


def describe_setting(plan: Plan, setting: str) -> str:
    """Name a setting of the cases in words."""
    changes = plan["settings"].get(setting, {})
    return str(changes.get("words", setting.replace("_", " ")))


def _measure(
    figure: Figure, rows: pd.DataFrame, words: str, target: Target, seed: int
) -> Iterator[dict[str, Any]]:
    """Compute a figure from its rows: a share, or its ``measure``."""
    measure = figure.get("measure")
    if measure is None:
        concerned = rows.query(figure["among"]) if "among" in figure else rows
        clusters = concerned[figure["clusters"]] if "clusters" in figure else None
        share = compute_rate(concerned[str(figure["hits"])], clusters)
        yield _describe_figure(words, share, target)
    elif measure == "calibration_error":
        yield _describe_figure(words, estimate_calibration(rows, seed), target)
    elif measure == "chance_calibration_error":
        yield _describe_figure(words, simulate_calibrated(rows, seed), target)
    elif measure == "largest_bin_error":
        yield _describe_figure(words, find_largest_bin_error(rows), target)
    elif measure == "chance_largest_bin_error":
        yield _describe_figure(words, simulate_largest_bin_error(rows, seed), target)
    elif measure == "removed":
        squares = [
            rows[name].to_numpy(float) ** 2
            for name in ("before_rms_m", "after_rms_m", "oracle_rms_m")
        ]
        before, after, best = squares
        draws = open_stream(seed, "blind", words, 0)
        share = _bootstrap((before - after, before - best), _divide_sums, draws)
        yield _describe_figure(words, share, target)
    elif measure in ("median_ratio", "mean_ratio"):
        ratios = (rows.after_rms_m / rows.oracle_rms_m).to_numpy()
        statistic = np.median if measure == "median_ratio" else np.mean
        draws = open_stream(seed, "blind", measure.replace("_", " "), 0)
        yield _describe_figure(words, _bootstrap((ratios,), statistic, draws), target)
    else:
        raise ValueError(f"no measure {measure!r}")


def _describe_figure(
    quantity: str, estimate: Mapping[str, Any], target: Target
) -> dict[str, Any]:
    """Describe an estimate with its interval, and whether the target is met."""
    if not target:
        limits = dict.fromkeys(_LIMITS, np.nan) | {"target": ""}
        return {"quantity": quantity, **estimate, **limits, "holds": None}
    low = target.get("low", 0.0)
    high = target.get("high", 1.0)
    holds = None
    if estimate["cases"]:
        holds = bool(low <= estimate["rate"] <= high)
    cases = int(estimate["cases"])
    limits = {
        "target": target["words"],
        "target_low": low,
        "target_high": high,
        "power": compute_power(target, cases, "acceptable"),
        "risk": compute_power(target, cases, "unacceptable"),
    }
    return {"quantity": quantity, **estimate, **limits, "holds": holds}


def _divide_sums(
    removed: np.ndarray, removable: np.ndarray, axis: int = -1
) -> np.ndarray:
    """Divide the sum that is removed by the sum that the oracle removes; if the oracle
    removes nothing, there is nothing to reach."""
    total = removable.sum(axis=axis)
    return removed.sum(axis=axis) / np.where(total > 0, total, np.nan)


def _bootstrap(
    samples: tuple[np.ndarray, ...],
    statistic: Callable[..., np.ndarray],
    draws: np.random.Generator,
) -> dict[str, Any]:
    """Compute a statistic with its percentile bootstrap interval of 95 % over cases."""
    cases = len(samples[0])
    value = float(statistic(*samples)) if cases else np.nan
    low = high = np.nan
    if cases > 1 and np.isfinite(value):
        low, high = bootstrap(
            samples,
            statistic,
            n_resamples=_RESAMPLES,
            batch=_BATCH,
            vectorized=True,
            paired=True,
            method="percentile",
            rng=draws,
        ).confidence_interval
    return _describe_estimate(cases, value, low, high)


def _describe_estimate(
    cases: int, value: float, low: float, high: float
) -> dict[str, Any]:
    """Describe an estimate with its interval like a rate, but without hits."""
    return {
        "hits": None,
        "cases": cases,
        "rate": value,
        "low": float(low),
        "high": float(high),
    }


def simulate_calibrated(rows: pd.DataFrame, seed: int) -> dict[str, Any]:
    """Simulate the mean expected calibration error of calibrated verdicts that state the
    same probabilities, by consistency resampling [1]_.

    References
    ----------
    .. [1] Bröcker, J. and Smith, L. A., Increasing the reliability of reliability
       diagrams, Weather and Forecasting 22, 2007.
    """
    cases = len(rows)
    probability = rows.stated.to_numpy(float)
    outcomes = _draw_calibrated(probability, "calibration error by chance", seed)
    replicates = compute_calibration_error(
        np.broadcast_to(probability, outcomes.shape), outcomes
    )
    mean = float(replicates.mean()) if cases else np.nan
    return _describe_estimate(cases, mean, np.nan, np.nan)


def _draw_calibrated(probability: np.ndarray, purpose: str, seed: int) -> np.ndarray:
    """Draw for each resample whether statements of these probabilities (n,) are correct,
    if they are calibrated: (resamples, n) bool."""
    draws = open_stream(seed, "blind", purpose, 0)
    return draws.random((_RESAMPLES, len(probability))) < probability


def compute_calibration_error(
    probability: np.ndarray, correct: np.ndarray
) -> np.ndarray:
    """Compute the expected calibration error [1]_ [2]_: the sum over bins of n_b / n
    |mean stated probability - share correct|.

    It is not 0 even for calibrated verdicts, because the shares of few cases scatter.

    Parameters
    ----------
    probability, correct : (..., n) arrays
        Stated probabilities, and whether the statements are correct.

    Returns
    -------
    (...,) array

    References
    ----------
    .. [1] Naeini, M. P., Cooper, G. F. and Hauskrecht, M., Obtaining well calibrated
       probabilities using Bayesian binning, AAAI Conference on Artificial Intelligence,
       2015.
    .. [2] Guo, C., Pleiss, G., Sun, Y. and Weinberger, K. Q., On calibration of modern
       neural networks, International Conference on Machine Learning, 2017.
    """
    cases = probability.shape[-1]
    if cases == 0:
        return np.full(probability.shape[:-1], np.nan)
    bins = _find_bins(probability)
    differences = probability - correct
    gaps = [
        np.abs((differences * (bins == number)).sum(axis=-1)) for number in range(_BINS)
    ]
    return sum(gaps) / cases


def compute_largest_bin_error(
    probability: np.ndarray, correct: np.ndarray
) -> np.ndarray:
    """Compute the largest difference between the mean stated probability and the share
    of correct statements among the bins with enough cases.

    Parameters
    ----------
    probability : (n,) array
        Stated probabilities.
    correct : (..., n) array
        Whether the statements are correct.

    Returns
    -------
    (...,) array
        Not a number if no bin has enough cases.
    """
    bins = _find_bins(probability)
    differences = probability - correct
    gaps = [
        np.abs(differences[..., bins == number].mean(axis=-1))
        for number in range(_BINS)
        if (bins == number).sum() >= _LEAST_BIN_CASES
    ]
    return np.max(gaps, axis=0) if gaps else np.full(correct.shape[:-1], np.nan)


def find_largest_bin_error(rows: pd.DataFrame) -> dict[str, Any]:
    """Find the largest error of a bin of stated cases. It has no interval;
    `simulate_largest_bin_error` says how large it is by chance."""
    error = compute_largest_bin_error(
        rows.stated.to_numpy(float), rows.correct.to_numpy(bool)
    )
    return _describe_estimate(len(rows), float(error), np.nan, np.nan)


def simulate_largest_bin_error(rows: pd.DataFrame, seed: int) -> dict[str, Any]:
    """Simulate the largest error of a bin of calibrated verdicts that state the same
    probabilities: its median and the range of 95 %."""
    probability = rows.stated.to_numpy(float)
    outcomes = _draw_calibrated(probability, "largest bin error by chance", seed)
    errors = compute_largest_bin_error(probability, outcomes)
    low, median, high = np.quantile(errors, [0.025, 0.5, 0.975]).tolist()
    return _describe_estimate(len(rows), median, low, high)


def estimate_calibration(rows: pd.DataFrame, seed: int) -> dict[str, Any]:
    """Estimate the expected calibration error of stated cases, with a basic bootstrap
    interval [1]_ of 95 % over cases.

    References
    ----------
    .. [1] Davison, A. C. and Hinkley, D. V., Bootstrap Methods and their Application,
       section 5.2, Cambridge University Press, 1997.
    """
    cases = len(rows)
    probability = rows.stated.to_numpy(float)
    correct = rows.correct.to_numpy(bool)
    error = float(compute_calibration_error(probability, correct))
    low = high = np.nan
    if cases > 1:
        draws = open_stream(seed, "blind", "calibration error", 0)
        resamples = draws.integers(cases, size=(_RESAMPLES, cases))
        replicates = compute_calibration_error(
            probability[resamples], correct[resamples]
        )
        # The interval is basic, because a resample is less calibrated than the sample,
        # by as much as the sample is less calibrated than the population.
        quantiles = np.quantile(replicates, [0.975, 0.025])
        low, high = np.maximum(2.0 * error - quantiles, 0.0)
    return _describe_estimate(cases, error, low, high)


def tabulate_reliability(cases: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the reliability diagram [1]_ for each group of cases and each bin that
    has a case.

    Further groups are ``all`` cases, those with an ``alarm``, whose verdict is about
    causes, and those with ``no alarm``, whose verdict is that nothing is missing.

    References
    ----------
    .. [1] Murphy, A. H. and Winkler, R. L., Reliability of subjective probability
       forecasts of precipitation and temperature, Applied Statistics 26, 1977.
    """
    stated = cases[cases.stated.notna()]
    rows_of_groups = {
        "all": stated,
        "alarm": stated[stated.detected],
        "no alarm": stated[~stated.detected],
        **{str(group): rows for group, rows in stated.groupby("group")},
    }
    points = []
    for group, rows in rows_of_groups.items():
        bins = _find_bins(rows.stated.to_numpy(float))
        for number in np.unique(bins).tolist():
            rows_of_bin = rows[bins == number]
            points.append(
                {
                    "group": group,
                    "from": number / _BINS,
                    "to": (number + 1) / _BINS,
                    "stated": rows_of_bin.stated.mean(),
                    **compute_rate(rows_of_bin.correct),
                }
            )
    return pd.DataFrame(points, columns=_RELIABILITY)


def _find_bins(probability: np.ndarray) -> np.ndarray:
    """Find the bin of each probability."""
    return np.clip((probability * _BINS).astype(int), 0, _BINS - 1)


def tabulate_rates(cases: pd.DataFrame) -> pd.DataFrame:
    """Tabulate shares of outcomes by group, truth, setting and level.

    The truth ``all`` combines all truths of a group, except those that the model
    absorbs.
    """
    combined = cases[cases.level_of == "retained"].assign(truth="all")
    groups = pd.concat([cases, combined]).groupby(
        ["group", "truth", "setting", "level"]
    )
    aggregates = {"level_of": "first", "case": "size"}
    shares = groups.agg(aggregates | dict.fromkeys(_COUNTED, "mean"))
    return shares.rename(columns={"case": "cases"}).reset_index()


def tabulate_mechanisms(cases: pd.DataFrame) -> pd.DataFrame:
    """Count what a verdict states, by true mechanism and level: the confusion table of
    mechanisms.

    Parameters
    ----------
    cases : DataFrame
        Rows of `scores.build_case_row`.

    Returns
    -------
    DataFrame
        One row for each true mechanism of the groups with one mechanism, its level, and
        each ``stated``: the mechanisms of the verdict, or its kind if it states none.
        ``alone``: without alternatives.
    """
    single = cases[cases.group.isin(("single", "outside"))]
    stated = single.found.where(single.found != NONE, single.verdict)
    table = single.assign(stated=stated, alone=single.verdict == NAMED)
    keys = ["group", "truth", "level", "stated", "alone"]
    return table.groupby(keys).size().rename("cases").reset_index()


def score_cases(job: Any) -> None:
    """Score the verdicts against the sealed ground truths."""
    plan = job.params.plan
    truths = load_ground_truth(job.input.sealed, job.input.manifest)
    verdicts: dict[str, Any] = {}
    for path in job.input.verdicts:
        verdicts |= {verdict["campaign"]: verdict for verdict in read_json(path)}
    oracles: dict[str, Any] = {}
    for path in job.input.oracles:
        oracles |= read_json(path)
    case_rows = []
    interval_rows = []
    location_rows = []
    for name, truth in truths.items():
        verdict = verdicts[name]
        case_rows.append(build_case_row(plan, truth, verdict, oracles[name]))
        interval_rows += list_intervals(truth, verdict)
        location_rows += list_locations(truth, verdict)
    cases = pd.DataFrame(case_rows)
    intervals = pd.DataFrame(interval_rows)
    locations = tabulate_locations(location_rows)
    cases.to_parquet(job.output.cases, index=False)
    intervals.to_parquet(job.output.intervals, index=False)
    locations.to_parquet(job.output.locations, index=False)
    write_csv(job.output.mechanisms, tabulate_mechanisms(cases))
    write_csv(job.output.rates, tabulate_rates(cases))
    write_csv(job.output.reliability, tabulate_reliability(cases))
    summary = summarize_figures(plan, cases, intervals, job.params.seed, locations)
    write_csv(job.output.summary, summary)
