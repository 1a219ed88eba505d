"""Tables of the blind proof from its cases: rates with Clopper-Pearson intervals, calibration, ratios by bootstrap, targets."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

from elastocal.audit.blind_cases import columns, intervals, proof_of
from elastocal.audit.findings import Finding, held
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from elastocal.audit.audited import Audited

_RESAMPLES, _BATCH, _BINS = 2000, 200, 10
_WITHIN = 1.05
_HARD = ("pose_common_15urad", "force_3kN", "off_line_centres", "outliers_2_percent", "bad_rows", "tilted_base")
_OF_THEIR_OWN = {
    "several_joints": "one mechanism at several joints: that one alone",
    "gear_gravity": "gear defect under declared gravity: right name alone",
    "moved": "set-up that moves between rows: right name alone",
    "undeclared": "weight of all links, undeclared: right name alone",
}
# What a figure shall be, by its words: in words, from, to, and what its whole interval lies above and below.
_TARGETS: dict[str, tuple[str, float, float, float, float]] = {
    "false alarms with no effect": ("upper limit below 4 %", 0.0, 0.04, -np.inf, 0.04),
    **{f"false alarms, {name.replace('_', ' ')}": ("at most 6 %", 0.0, 0.06, -np.inf, np.inf) for name in _HARD},
    "detected at 25": ("at least 82 %", 0.82, 1.0, -np.inf, np.inf),
    "detected at 50": ("at least 98 %", 0.98, 1.0, -np.inf, np.inf),
    "right name, or class with it, given detection, at 50": ("at least 97 %", 0.97, 1.0, -np.inf, np.inf),
    "right name alone, exact aliases aside, at 200": ("at least 95 %", 0.95, 1.0, -np.inf, np.inf),
    f"{_OF_THEIR_OWN['several_joints']}, at 200": ("at least 95 %", 0.95, 1.0, -np.inf, np.inf),
    f"{_OF_THEIR_OWN['gear_gravity']}, at 200": ("at least 90 %", 0.9, 1.0, -np.inf, np.inf),
    "both of two effects, at 200 each": ("at least 88 %, lower limit above 85 %", 0.88, 1.0, 0.85, np.inf),
    "both of two effects, at 50 each": ("at least 80 %", 0.8, 1.0, -np.inf, np.inf),
    "wrong single name, truth outside the catalogue, at 200": ("at most 8 %", 0.0, 0.08, -np.inf, np.inf),
    "stated probability of the most probable mechanisms: expected calibration error": (
        *("at most 3 %", 0.0, 0.03, -np.inf, np.inf),
    ),
    "95 % sets of hypotheses that hold the truth": ("at least 95 %", 0.95, 1.0, -np.inf, np.inf),
    "held-out RMS after, over the oracle's, median": ("within 5 %", 0.0, 1.05, -np.inf, np.inf),
    "held-out RMS after, over the oracle's, mean": ("within 5 %", 0.0, 1.05, -np.inf, np.inf),
    "effect adopted and held-out RMS worse by over two standard errors": ("at most 1 %", 0.0, 0.01, -np.inf, np.inf),
    "95 % intervals of effects' parameters": ("92 to 98 %", 0.92, 0.98, -np.inf, np.inf),
    "95 % intervals of joint compliances, no effect": ("92 to 98 %", 0.92, 0.98, -np.inf, np.inf),
    "95 % intervals of joint compliances, an effect, whatever was selected": ("92 to 98 %", 0.92, 0.98, -np.inf, np.inf),
}
# Of a table with nine digits, by what is worked out of another with nine.
_DIGITS = 1e-7
# Columns of cases.csv.
_NUMBERS = (
    *("level", "raw", "retained", "signal_rms_m", "signal_over_noise", "times_plausible", "before_rms_m", "after_rms_m"),
    *("noise_floor_rms_m", "reduction", "reduction_std_error", "oracle_p_value", "oracle_detected", "oracle_rms_m"),
)


def share(hits: Iterable[Any]) -> dict[str, float]:
    """How many of some cases, and the Clopper-Pearson interval of the share by quantiles of the beta distribution."""
    each = [bool(hit) for hit in hits]
    count, total = sum(each), len(each)
    low = float(stats.beta.ppf(0.025, count, total - count + 1)) if count else 0.0
    high = float(stats.beta.ppf(0.975, count + 1, total - count)) if count < total else 1.0
    rate = count / total if total else np.nan
    return {"hits": count, "cases": total, "rate": rate, "low": low, "high": high}


def _cases(run: Audited, file: str) -> pd.DataFrame:
    """Rows of cases.csv, among whose names "none" and nothing are words."""
    path = run.folder / file.rpartition("/")[0] / "cases.csv"
    return pd.read_csv(path, keep_default_na=False, na_values={name: [""] for name in _NUMBERS})


def _probabilities(run: Audited, file: str) -> pd.DataFrame:
    return run.table(file.rpartition("/")[0] + "/probabilities.csv")


def summary(run: Audited, file: str) -> list[Finding]:
    """Every figure of the proof beside its target."""
    stated, cases, statements = run.table(file), _cases(run, file), _probabilities(run, file)
    spans, rows = intervals(proof_of(run)), []
    for robots in ("proof", "tuned"):
        mine = cases[cases["robots"] == robots]
        if len(mine):
            parts = (
                _of_verdicts(mine),
                _of_statements(statements[statements["robots"] == robots], run.seed),
                _of_errors(mine, run.seed),
                _of_intervals(spans[spans["robots"] == robots]),
            )
            rows += [{"robots": robots} | _judged(name, row) for part in parts for name, row in part]
    return columns(file, stated, pd.DataFrame(rows), "pandas and scipy", _DIGITS)


def _judged(name: str, row: dict[str, Any]) -> dict[str, Any]:
    words, low, high, above, below = _TARGETS.get(name, ("", np.nan, np.nan, -np.inf, np.inf))
    row = {"quantity": name} | row | {"target": words, "target_low": low, "target_high": high, "holds": None}
    if words and row["cases"]:
        row["holds"] = bool(low <= row["rate"] <= high and row["low"] > above and row["high"] < below)
    return row


_Row = tuple[str, dict[str, Any]]


def _of_verdicts(cases: pd.DataFrame) -> Iterator[_Row]:
    yield "false alarms with no effect", share(cases.query("group == 'none'")["detected"])
    hard = cases.query("group == 'setting' and truth == 'none'")
    for setting in _HARD:
        yield f"false alarms, {setting.replace('_', ' ')}", share(hard[hard["setting"] == setting]["detected"])
    single = cases[cases["group"] == "single"]
    for level, part in single.query("level_of == 'retained'").groupby("level"):
        at = f"at {level:g}"
        plain = part[~part["exact_alias"]]
        yield f"detected {at}", share(part["detected"])
        yield f"detected by the oracle {at}", share(part["oracle_detected"])
        yield f"right name, or class with it, given detection, {at}", share(part[part["detected"]]["holds_truth"])
        yield f"right name alone, exact aliases aside, {at}", share(plain["named_right"])
        yield f"right name, or class with it, of exact aliases, {at}", share(part[part["exact_alias"]]["holds_truth"])
    absorbed = single[single["level_of"] == "raw"]
    if len(absorbed):
        yield "detected though wholly absorbed (force scale)", share(absorbed["detected"])
    for group, words in _OF_THEIR_OWN.items():
        for level, part in cases[cases["group"] == group].groupby("level"):
            yield f"{words}, at {level:g}", share(part["named_right"])
            yield f"{words.split(':')[0]}: detected, at {level:g}", share(part["detected"])
    for level, part in cases[cases["group"] == "outside"].groupby("level"):
        yield f"wrong single name, truth outside the catalogue, at {level:g}", share(part["wrong_name"])
        yield f"detected, truth outside the catalogue, at {level:g}", share(part["detected"])
    for level, part in cases[cases["group"] == "pair"].groupby("level"):
        yield f"both of two effects, at {level:g} each", share(part["exact"])
        yield f"both of two effects, or classes with them, at {level:g} each", share(part["holds_truth"])


def _of_statements(statements: pd.DataFrame, seed: int) -> Iterator[_Row]:
    stated, correct = statements["stated"].to_numpy(float), statements["correct"].to_numpy(float)
    count, error = len(statements), _calibration(stated, correct)
    low, high, chance = np.nan, np.nan, np.nan
    if count > 1:
        draws = numbers(seed, "blind", "calibration error", 0)
        chosen = draws.integers(count, size=(_RESAMPLES, count))
        again = [_calibration(stated[row], correct[row]) for row in chosen]
        # Davison and Hinkley's basic interval.
        low, high = (max(2 * error - float(end), 0.0) for end in np.quantile(again, [0.975, 0.025]))
        chance = float(np.mean([_calibration(stated, row < stated) for row in draws.random((_RESAMPLES, count))]))
    head = "stated probability of the most probable mechanisms: expected calibration error"
    yield head, {"hits": None, "cases": count, "rate": error, "low": low, "high": high}
    row = {"hits": None, "cases": count, "rate": chance, "low": np.nan, "high": np.nan}
    yield "the same of as many verdicts that are calibrated, on average", row
    yield "95 % sets of hypotheses that hold the truth", share(statements["held"])


def _calibration(stated: np.ndarray, correct: np.ndarray) -> float:
    """Mean distance of what is stated from how often it is so, over ten bins."""
    if not len(stated):
        return np.nan
    place = np.minimum((stated * _BINS).astype(int), _BINS - 1)
    return float(np.abs(np.bincount(place, stated - correct)).sum() / len(stated))


def _of_errors(cases: pd.DataFrame, seed: int) -> Iterator[_Row]:
    known = cases[cases["group"].isin(["single", "pair"]) & cases["detected"]]
    ratio = (known["after_rms_m"] / known["oracle_rms_m"]).to_numpy()
    for name, statistic in (("median", np.median), ("mean", np.mean)):
        row = _bootstrapped((ratio,), statistic, numbers(seed, "blind", f"{name} ratio", 0))
        yield f"held-out RMS after, over the oracle's, {name}", row
    yield "held-out RMS after within 5 % of the oracle's", share(ratio <= _WITHIN)
    for level, part in cases.query("group == 'single' and level_of == 'retained'").groupby("level"):
        squares = part[["before_rms_m", "after_rms_m", "oracle_rms_m"]].to_numpy() ** 2
        removed, removable = squares[:, 0] - squares[:, 1], squares[:, 0] - squares[:, 2]
        draws = numbers(seed, "blind", f"removed at {level:g}", 0)
        row = _bootstrapped((removed, removable), _reached, draws)
        yield f"share of the oracle's fall of the held-out mean square that is reached, at {level:g}", row
    adopted = cases[cases["adopted"]]
    yield "effect adopted and held-out RMS worse by over two standard errors", share(adopted["worse"])


def _reached(removed: np.ndarray, removable: np.ndarray, axis: int = -1) -> np.ndarray:
    whole = np.sum(removable, axis=axis)
    return np.sum(removed, axis=axis) / np.where(whole > 0, whole, np.nan)


def _bootstrapped(samples: tuple[np.ndarray, ...], statistic: Callable[..., Any], draws: np.random.Generator) -> dict[str, Any]:
    """A figure with scipy's percentile bootstrap interval over cases."""
    value = float(statistic(*samples)) if len(samples[0]) else np.nan
    row = {"hits": None, "cases": len(samples[0]), "rate": value, "low": np.nan, "high": np.nan}
    if len(samples[0]) > 1 and np.isfinite(value):
        options: dict[str, Any] = {"n_resamples": _RESAMPLES, "batch": _BATCH, "method": "percentile", "rng": draws}
        ends = stats.bootstrap(samples, statistic, vectorized=True, paired=True, **options).confidence_interval
        row |= {"low": float(ends.low), "high": float(ends.high)}
    return row


def _of_intervals(spans: pd.DataFrame) -> Iterator[_Row]:
    if not len(spans):
        return
    usual = spans[spans["setting"] == "usual"]
    springs, effects = (usual[mask] for mask in (usual["effect"] == "joint_compliance", usual["effect"] != "joint_compliance"))
    foreign = springs["truth"].str.startswith("outside:")
    yield "95 % intervals of effects' parameters", share(effects["holds"])
    head = "95 % intervals of joint compliances"
    yield f"{head}, no effect", share(springs[springs["truth"] == "none"]["holds"])
    yield f"{head}, an effect, whatever was selected", share(springs[(springs["truth"] != "none") & ~foreign]["holds"])
    yield f"{head}, an effect outside of the catalogue", share(springs[foreign]["holds"])


def reliability(run: Audited, file: str) -> list[Finding]:
    """What is stated against how often it is so, by bins."""
    statements, rows = _probabilities(run, file), []
    statements = statements.assign(bin=np.minimum((statements["stated"] * _BINS).astype(int), _BINS - 1))
    for robots in ("proof", "tuned"):
        mine = statements[statements["robots"] == robots]
        for group in ("all", *sorted(mine["group"].unique())):
            part = mine if group == "all" else mine[mine["group"] == group]
            for number, some in part.groupby("bin"):
                low = int(str(number))
                row = {"robots": robots, "group": group, "from": low / _BINS, "to": (low + 1) / _BINS}
                rows.append(row | {"stated": some["stated"].mean()} | share(some["correct"]))
    return columns(file, run.table(file), pd.DataFrame(rows), "pandas and scipy", _DIGITS)


def settings(run: Audited, file: str) -> list[Finding]:
    """What hard settings do to the verdicts."""
    cases = _cases(run, file)
    mine = cases[cases["group"].isin(["setting", "none"])].copy()
    mine["kind"] = np.where(mine["truth"] == "none", "no effect", np.where(mine["hidden"], "hidden effect", "effect"))
    rows = []
    for (robots, setting, kind), part in mine.groupby(["robots", "setting", "kind"]):
        row = {"robots": robots, "setting": setting, "kind": kind, "level": part["level"].max()} | share(part["detected"])
        named = {"held": "holds_truth", "named": "named_right", "wrong": "wrong_name"}
        rows.append(row | {name: part[column].sum() for name, column in named.items()})
    return columns(file, run.table(file), pd.DataFrame(rows), "pandas and scipy", _DIGITS)


def coverage(run: Audited, file: str) -> list[Finding]:
    """How often intervals hold the true value, by effect, parameter and level."""
    spans = intervals(proof_of(run)).query("setting == 'usual'")
    found = np.where(spans["right"], "compliance, effect found", "compliance, effect not found")
    kind = np.where(spans["truth"] == "none", "compliance, no effect", found)
    spans = spans.assign(kind=np.where(spans["effect"] == "joint_compliance", kind, "effect"))
    spans["level"] = [f"{level:g}" for level in spans["level"]]
    everything = spans[spans["kind"] == "effect"].assign(effect="all", comparable="all", parameter="all", level="all")
    whole = spans.assign(parameter="all")
    both = pd.concat([spans.assign(level="all"), whole, whole.assign(level="all"), everything])
    keys = ["robots", "kind", "effect", "comparable", "parameter", "level"]
    rows = [dict(zip(keys, key, strict=True)) | share(part["holds"]) for key, part in both.groupby(keys)]
    stated = pd.read_csv(run.folder / file, dtype={"level": str})
    return columns(file, stated, pd.DataFrame(rows), "pandas and scipy", _DIGITS)


def power(run: Audited, file: str) -> list[Finding]:
    """Detection by effect and size."""
    cases = _cases(run, file)
    parts = cases[cases["group"].isin(["single", "outside"])]
    visible = parts[parts["level_of"] == "retained"].assign(truth="all")
    rows = []
    for (robots, group, effect, level), part in pd.concat([parts, visible]).groupby(["robots", "group", "truth", "level"]):
        known = part["oracle_detected"].dropna()
        row = {"robots": robots, "group": group, "effect": effect, "level": level, "level_of": part["level_of"].iloc[0]}
        row |= {"cases": len(part), "oracle_cases": len(known)}
        columns_of = {"detected": part["detected"], "held": part["holds_truth"], "named": part["named_right"]}
        for name, hits in (columns_of | {"oracle_detected": known}).items():
            figures = share(hits)
            row |= {name: figures["rate"], f"{name}_low": figures["low"], f"{name}_high": figures["high"]}
        row["signal_rms_um"] = 1e6 * part["signal_rms_m"].median()
        rows.append(row | {name: part[name].median() for name in ("signal_over_noise", "times_plausible")})
    return columns(file, run.table(file), pd.DataFrame(rows), "pandas and scipy", _DIGITS)


def confusion(run: Audited, file: str) -> list[Finding]:
    """Ground truth against verdict, as counts."""
    stated, cases = run.table(file), _cases(run, file)
    apart = cases["group"].isin(["sweep", *_OF_THEIR_OWN])
    usual = np.where(cases["setting"] == "usual", "usual", "hard")
    cases["settings"] = np.where(apart, cases["group"], usual)
    cases["truth"] = np.where(cases["group"] == "pair", "pair", cases["truth"])
    keys = ["robots", "settings", "truth", "level"]
    rows = []
    for key, part in cases.groupby(keys):
        counts = dict.fromkeys(stated.columns.drop(keys), 0)
        for verdict, name, holds in zip(part["verdict"], part["found"], part["holds_truth"], strict=True):
            words = verdict
            if verdict == "named":
                words = name if name in counts else "named: fault of the data"
            elif verdict == "class":
                words = "class with the truth" if holds else "class without the truth"
            counts[words] += 1
        rows.append(dict(zip(keys, key, strict=True)) | counts)
    found = columns(file, stated, pd.DataFrame(rows))
    every = int(stated.drop(columns=keys).to_numpy().sum())
    return [*found, held(file, "every case once", "counting", every == len(cases), f"{every} of {len(cases)}", len(cases))]


CHECKS = tuple(
    (re.compile(rf"reports/blind/{name}\.csv"), check)
    for name, check in {
        "summary": summary,
        "reliability": reliability,
        "settings": settings,
        "coverage": coverage,
        "power": power,
        "confusion": confusion,
    }.items()
)
