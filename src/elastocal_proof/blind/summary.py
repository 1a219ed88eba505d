"""The figures of the proof, each beside its target: one counter for all that the plan
lists, and the tables of its pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal.random_streams import open_stream
from elastocal_proof.blind.cases import PROOF, TUNED, Plan
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.scores import build_case_row, compute_rate, list_intervals

Tables = Mapping[str, pd.DataFrame]
Figure = Mapping[str, Any]

_RESAMPLES = 2000
_SEVERAL_AT_ONCE = 200
# Held-out errors this near to the oracle's count as its own.
NEAR_ORACLE = 1.05
_BINS = 10
BY_THE_BEST = ", by the best analyst"
OVER_THE_BEST = ", over the best analyst's, on the same cases"
_RELIABILITY = ["group", "from", "to", "stated", "hits", "cases", "rate", "low", "high"]
_COUNTED = ["detected", "holds_truth", "named_right", "wrong_name", "oracle_detected"]


def select_targets(summary: pd.DataFrame) -> pd.DataFrame:
    """The figures that have a target, of a summary as it is made or as it is read."""
    return summary[summary.target.fillna("").ne("")]


def iterate_rows(table: pd.DataFrame) -> Iterator[Any]:
    """Rows of a table; their attributes are its columns."""
    return table.itertuples()


def summarize_figures(
    plan: Plan, cases: pd.DataFrame, intervals: pd.DataFrame, seed: int
) -> pd.DataFrame:
    """Every figure of the plan beside its target, of rows of `scores.build_case_row` and
    `scores.list_intervals`.

    Rates have Clopper-Pearson intervals, ratios percentile bootstrap intervals [1] over
    cases. ``target_low`` and ``target_high`` are the range that the target leaves;
    ``holds`` is empty where there is no target or no case.

    [1] Efron, B. and Tibshirani, R. J., An Introduction to the Bootstrap, section 13.3,
    Chapman and Hall, 1993.
    """
    cases = cases.assign(
        as_oracle=cases.after_rms_m / cases.oracle_rms_m <= NEAR_ORACLE
    )
    tables = {
        "cases": cases,
        "statements": cases[cases.stated.notna()],
        "intervals": intervals,
    }
    rows = [
        row
        for figure in plan["figures"]
        for row in _counted(plan, figure, tables, seed)
    ]
    # Where one robot is of those that were tuned on, the whole proves nothing.
    return pd.DataFrame(rows).assign(
        robots=PROOF if set(cases.robots) == {PROOF} else TUNED
    )


def summarize_by_robot(
    plan: Plan, cases: pd.DataFrame, seed: int
) -> dict[str, pd.DataFrame]:
    """As `summarize`, of each robot by itself, by its name; without intervals of
    parameters."""
    return {
        str(name): summarize_figures(plan, part, pd.DataFrame(), seed)
        for name, part in cases.groupby("robot")
    }


def _counted(
    plan: Plan, figure: Figure, tables: Tables, seed: int
) -> Iterator[dict[str, Any]]:
    """Rows of one entry of the plan's figures."""
    table = tables[figure.get("table", "cases")]
    if figure.get("table") == "intervals" and not len(table):
        return
    chosen = table.query(figure["of"]) if "of" in figure else table
    if figure.get("each") == "hard":
        for name, changes in plan["settings"].items():
            if changes.get("hard"):
                part = chosen[chosen.setting == name]
                yield from _measured(
                    figure,
                    part,
                    figure["words"].format(setting=describe_setting(plan, name)),
                    True,
                    seed,
                )
    elif "by" in figure:
        for level, part in chosen.groupby(figure["by"]):
            for entry in figure["parts"]:
                judged = level in entry.get("levels", [level])
                yield from _measured(
                    entry, part, entry["words"].format(at=f"at {level:g}"), judged, seed
                )
    elif len(chosen) or not figure.get("if_any"):
        yield from _measured(figure, chosen, figure["words"], True, seed)


def describe_setting(plan: Plan, setting: str) -> str:
    """A setting of the cases as people read it."""
    return str(
        plan["settings"].get(setting, {}).get("words", setting.replace("_", " "))
    )


def _measured(
    figure: Figure, part: pd.DataFrame, words: str, judged: bool, seed: int
) -> Iterator[dict[str, Any]]:
    target = figure.get("target") if judged else None
    measure = figure.get("measure")
    if measure is None:
        among = part.query(figure["among"]) if "among" in figure else part
        yield _row(words, compute_rate(among[str(figure["hits"])]), target)
    elif measure == "over_limit":
        sampled = part[part.limit_right.notna()]
        yield _row(
            f"{words}{BY_THE_BEST}",
            compute_rate(sampled[str(figure["best"])] == 1.0),
            None,
        )
        hits = (
            sampled[figure["hits"]].to_numpy(float),
            sampled[figure["best"]].to_numpy(float),
        )
        found = _bootstrapped(
            hits,
            _ratio_of_sums,
            open_stream(seed, "blind", f"{words} over the limit", 0),
        )
        yield _row(f"{words}{OVER_THE_BEST}", found, target)
    elif measure == "calibration_error":
        yield _row(words, estimate_calibration(part, seed), target)
    elif measure in ("median_ratio", "mean_ratio"):
        ratio = (part.after_rms_m / part.oracle_rms_m).to_numpy()
        name, statistic = (
            ("median", np.median) if measure == "median_ratio" else ("mean", np.mean)
        )
        yield _row(
            words,
            _bootstrapped(
                (ratio,), statistic, open_stream(seed, "blind", f"{name} ratio", 0)
            ),
            target,
        )
    else:
        raise ValueError(f"no measure {measure!r}")


def _row(
    words: str, found: Mapping[str, Any], target: Mapping[str, Any] | None
) -> dict[str, Any]:
    aim = {"words": "", "low": np.nan, "high": np.nan} | (
        {"low": 0.0, "high": 1.0} | dict(target) if target else {}
    )
    holds = None
    if target and found["cases"]:
        holds = bool(
            aim["low"] <= found["rate"] <= aim["high"]
            and not found["high"] >= aim.get("below", np.inf)
        )
    ends = {
        "target": aim["words"],
        "target_low": aim["low"],
        "target_high": aim["high"],
        "holds": holds,
    }
    return {"quantity": words} | dict(found) | ends


def _ratio_of_sums(
    removed: np.ndarray, removable: np.ndarray, axis: int = -1
) -> np.ndarray:
    removable = removable.sum(axis=axis)
    # Where knowing the effect does not help there is nothing to reach.
    return removed.sum(axis=axis) / np.where(removable > 0, removable, np.nan)


def _bootstrapped(
    samples: tuple[np.ndarray, ...],
    statistic: Callable[..., np.ndarray],
    draws: np.random.Generator,
) -> dict[str, Any]:
    """A statistic with its interval of 95 % over cases."""
    value = float(statistic(*samples)) if len(samples[0]) else np.nan
    low = high = np.nan
    if len(samples[0]) > 1 and np.isfinite(value):
        how: dict[str, Any] = {
            "n_resamples": _RESAMPLES,
            "batch": _SEVERAL_AT_ONCE,
            "vectorized": True,
            "paired": True,
            "rng": draws,
        }
        low, high = bootstrap(
            samples, statistic, method="percentile", **how
        ).confidence_interval
    return {
        "hits": None,
        "cases": len(samples[0]),
        "rate": value,
        "low": float(low),
        "high": float(high),
    }


def compute_calibration_error(
    probability: np.ndarray, correct: np.ndarray
) -> np.ndarray:
    """Expected calibration error [1] [2] (...,) of (..., n): sum over bins of n_b / n
    |mean stated - share correct|.

    Even of verdicts that are calibrated it is not 0, for the share of few cases
    scatters.

    [1] Naeini, M. P., Cooper, G. F. and Hauskrecht, M., Obtaining well calibrated probabilities using Bayesian binning, AAAI
        Conference on Artificial Intelligence, 2015.
    [2] Guo, C., Pleiss, G., Sun, Y. and Weinberger, K. Q., On calibration of modern neural networks, International Conference
        on Machine Learning, 2017.
    """
    probability, correct = np.broadcast_arrays(
        np.asarray(probability, float), np.asarray(correct, float)
    )
    if probability.shape[-1] == 0:
        return np.full(probability.shape[:-1], np.nan)
    which = _bin_of(probability)
    return (
        sum(
            np.abs(((probability - correct) * (which == b)).sum(axis=-1))
            for b in range(_BINS)
        )
        / probability.shape[-1]
    )


def estimate_calibration(rows: pd.DataFrame, seed: int) -> dict[str, Any]:
    """The expected calibration error of stated cases, with a basic bootstrap interval
    [1] of 95 % over cases.

    [1] Davison, A. C. and Hinkley, D. V., Bootstrap Methods and their Application, section 5.2, Cambridge University Press,
        1997.
    """
    probability = rows.stated.to_numpy(float)
    correct = rows.correct.to_numpy(bool)
    error = float(compute_calibration_error(probability, correct))
    low = np.nan
    high = np.nan
    if len(rows) > 1:
        picked = open_stream(seed, "blind", "calibration error", 0).integers(
            len(rows), size=(_RESAMPLES, len(rows))
        )
        again = compute_calibration_error(probability[picked], correct[picked])
        # The basic interval: a resample of a calibrated sample is less calibrated, by
        # what the sample is already.
        low, high = np.maximum(2.0 * error - np.quantile(again, [0.975, 0.025]), 0.0)
    return {
        "hits": None,
        "cases": len(rows),
        "low": float(low),
        "high": float(high),
        "rate": error,
    }


def tabulate_reliability(cases: pd.DataFrame) -> pd.DataFrame:
    """Data of the reliability diagram [1], for each group of cases, or ``all``, and bin
    that has a case.

    [1] Murphy, A. H. and Winkler, R. L., Reliability of subjective probability forecasts of precipitation and temperature,
        Applied Statistics 26, 1977.
    """
    rows = cases[cases.stated.notna()]
    found = []
    for group in ("all", *sorted(set(rows.group))):
        part = rows if group == "all" else rows[rows.group == group]
        which = _bin_of(part.stated.to_numpy(float))
        for number in sorted(set(which.tolist())):
            inside = part[which == number]
            ends = {
                "from": number / _BINS,
                "to": (number + 1) / _BINS,
                "stated": inside.stated.mean(),
            }
            found.append({"group": group} | ends | compute_rate(inside.correct))
    return pd.DataFrame(found, columns=_RELIABILITY)


def _bin_of(probability: np.ndarray) -> np.ndarray:
    return np.clip((np.asarray(probability) * _BINS).astype(int), 0, _BINS - 1)


def tabulate_rates(cases: pd.DataFrame) -> pd.DataFrame:
    """Shares of what came of the cases, by group, truth, setting and level.

    Also for ``all`` truths of a group together but those of which the model absorbs
    everything.
    """
    together = cases[cases.level_of == "retained"].assign(truth="all")
    grouped = pd.concat([cases, together]).groupby(
        ["group", "truth", "setting", "level"]
    )
    shares = grouped.agg(
        {"level_of": "first", "case": "size"} | dict.fromkeys(_COUNTED, "mean")
    )
    return shares.rename(columns={"case": "cases"}).reset_index()


def score_cases(job: Any) -> None:
    """The sealed ground truth against the verdicts."""
    plan = job.params.plan
    truths = load_ground_truth(job.input.sealed, job.input.manifest)
    verdicts = {
        verdict["campaign"]: verdict
        for path in job.input.verdicts
        for verdict in read_json(path)
    }
    oracles = {
        name: found
        for path in job.input.oracles
        for name, found in read_json(path).items()
    }
    cases = pd.DataFrame(
        [
            build_case_row(plan, truth, verdicts[name], **oracles[name])
            for name, truth in truths.items()
        ]
    )
    intervals = pd.DataFrame(
        [
            row
            for name, truth in truths.items()
            for row in list_intervals(plan, truth, verdicts[name])
        ]
    )
    write_csv(job.output.cases, cases)
    write_csv(job.output.intervals, intervals)
    write_csv(job.output.rates, tabulate_rates(cases))
    write_csv(job.output.reliability, tabulate_reliability(cases))
    write_csv(
        job.output.summary, summarize_figures(plan, cases, intervals, job.params.seed)
    )
