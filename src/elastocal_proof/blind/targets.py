"""The figures of the proof, each beside its target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from elastocal.random_streams import stream
from elastocal_proof.blind.calibration import calibration_error
from elastocal_proof.blind.cases import GEAR_GRAVITY, HARD, MOVED, SEVERAL_JOINTS, UNDECLARED
from elastocal_proof.blind.limit import COMPARED
from elastocal_proof.blind.rates import rate
from elastocal_proof.blind.scores import NONE, PROOF, TUNED, leading
from elastocal_proof.plant.defects import OUTSIDE

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Iterator

    _Key = tuple[str, Hashable]

_RESAMPLES = 2000
# Held-out errors this near to the oracle's count as its own.
WITHIN = 1.05
_SEVERAL_AT_ONCE = 200
_ALARMS = "false alarms, "
BY_THE_BEST, OVER_THE_BEST = ", by the best analyst", ", over the best analyst's, on the same cases"
# Of what is compared with the best analyst on a sample: the figure of all cases, where its words are others.
OF_ALL_CASES = {
    "right name alone at 50": "right name alone, exact aliases aside, at 50",
    "both of two effects at 50 each": "both of two effects, at 50 each",
    "both of two effects at 200 each": "both of two effects, at 200 each",
}
# Of settings whose names are no words.
_SETTINGS = {
    "pose_common_15urad": "errors common to a pose, 15 µrad",
    "force_3kN": "3 kN",
    "off_line_centres": "centres of mass off the line",
    **{f"outliers_{share}_percent": f"{share} % outliers" for share in (1, 2, 5)},
    "outliers_2_percent_far": "2 % outliers, farther off",
}
_SETTING_COLUMNS = ["robots", "setting", "kind", "level", *rate([]), "held", "named", "wrong"]


@dataclass(frozen=True)
class Target:
    """What a figure shall be.

    `low`, `high`: range in which it shall lie. `below`: what the whole interval of 95 % shall lie below, exclusively.
    """

    words: str
    low: float
    high: float
    below: float = np.inf


def _at_least(share: float) -> Target:
    return Target(f"at least {100 * share:g} %", share, 1.0)


def _at_most(share: float) -> Target:
    return Target(f"at most {100 * share:g} %", 0.0, share)


# As the issue sets them, by what is counted and the non-centrality.
_TARGETS: dict[_Key | None, Target] = {
    ("false alarms", 0.0): Target("upper limit below 4 %", 0.0, 0.04, below=0.04),
    ("false alarms", "hard"): _at_most(0.06),
    ("detected", 50.0): _at_least(0.98),
    ("held", 50.0): _at_least(0.97),
    ("named", 200.0): _at_least(0.95),
    (SEVERAL_JOINTS, 200.0): _at_least(0.95),
    (GEAR_GRAVITY, 200.0): _at_least(0.90),
    ("over the limit", None): Target("at least 95 % of the limit", 0.95, np.inf),
    ("outside", 200.0): _at_most(0.08),
    ("calibration", None): _at_most(0.03),
    ("credible", None): _at_least(0.95),
    ("ratio", None): Target("within 5 %", 0.0, WITHIN),
    ("worse", None): _at_most(0.01),
    ("coverage", None): Target("92 to 98 %", 0.92, 0.98),
}


def setting_words(setting: str) -> str:
    """A setting of the cases as people read it."""
    return _SETTINGS.get(setting, setting.replace("_", " "))


def worded(summary: pd.DataFrame) -> pd.DataFrame:
    """The summary as people read it: its quantities with their settings in words."""
    words = {f"{_ALARMS}{name.replace('_', ' ')}": f"{_ALARMS}{setting_words(name)}" for name in HARD}
    return summary.replace({"quantity": words})


def with_target(summary: pd.DataFrame) -> pd.DataFrame:
    """The figures that have a target, of a summary as it is made or as it is read."""
    return summary[summary.target.fillna("").ne("")]


def of_each_robot(cases: pd.DataFrame, statements: pd.DataFrame, seed: int) -> dict[str, pd.DataFrame]:
    """As `summarized`, of each robot of the leading kind by itself, by its name; without intervals of parameters."""
    mine = cases[cases.robots == leading(cases.robots)]
    return {
        str(name): summarized(part, pd.DataFrame(), statements[statements.robot == name], seed)
        for name, part in mine.groupby("robot")
    }


def summarized(cases: pd.DataFrame, intervals: pd.DataFrame, statements: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Every figure of the proof beside its target.

    `cases`: of `case_rows.case_row`. `intervals`: of `coverage.intervals_of`. `statements`: of `calibration.statements`.
    `seed`: of the bootstrap. Returns one row for each kind of robots and figure: rates with Clopper-Pearson intervals, ratios
    with percentile bootstrap intervals [1] over cases. ``target_low`` and ``target_high`` are the range that the target
    leaves; ``holds`` is empty where there is no target or no case.

    [1] Efron, B. and Tibshirani, R. J., An Introduction to the Bootstrap, section 13.3, Chapman and Hall, 1993.
    """
    rows: list[dict[str, Any]] = []
    for robots in (PROOF, TUNED):
        mine = cases[cases.robots == robots]
        if len(mine):
            of_these = intervals[intervals.robots == robots] if len(intervals) else intervals
            probable = statements[statements.robots == robots]
            found = (
                _of_cases(mine),
                _over_the_limit(mine, seed),
                _of_statements(probable, seed),
                _of_errors(mine, seed),
                _of_intervals(of_these),
            )
            rows += [{"robots": robots} | row for part in found for row in part]
    return pd.DataFrame(rows)


def by_setting(cases: pd.DataFrame) -> pd.DataFrame:
    """What the hard settings do to the verdicts.

    `cases`: of `case_rows.case_row`. Returns one row for each kind of robots, setting and kind of cases: without an effect
    (where a detection is a false alarm), with one, and with one that needs what was not recorded.
    """
    mine = cases[cases.group.isin(["setting", NONE])]
    kind = np.where(mine.truth == NONE, "no effect", np.where(mine.hidden, "hidden effect", "effect"))
    rows = []
    for keys, part in mine.assign(kind=kind).groupby(["robots", "setting", "kind"]):
        rows.append(
            dict(zip(("robots", "setting", "kind"), keys, strict=True))
            | {"level": part.level.max()}
            | rate(part.detected)
            | {"held": int(part.holds_truth.sum()), "named": int(part.named_right.sum()), "wrong": int(part.wrong_name.sum())}
        )
    return pd.DataFrame(rows, columns=_SETTING_COLUMNS)


def _of_cases(cases: pd.DataFrame) -> Iterator[dict[str, Any]]:
    none = cases[cases.group == NONE]
    yield _rated("false alarms with no effect", none.detected, ("false alarms", 0.0))
    hard = cases[(cases.group == "setting") & (cases.truth == NONE)]
    for setting in HARD:
        part = hard[hard.setting == setting]
        yield _rated(f"{_ALARMS}{setting.replace('_', ' ')}", part.detected, ("false alarms", "hard"))
    single = cases[cases.group == "single"]
    # What the model absorbs whatever its size is no question of level; a scale of the forces is an alias of the compliances, of
    # which weights that are known to a tenth leave next to nothing.
    alias = (single.level_of == "raw") | (single.truth == "force_scale")
    absorbed, visible = single[alias], single[~alias]
    for level, part in visible.groupby("level"):
        at, found, apart = f"at {level:g}", part[part.detected], part[~part.exact_alias]
        yield _rated(f"detected {at}", part.detected, ("detected", level))
        yield _rated(f"detected by the oracle {at}", part.oracle_detected, None)
        yield _rated(f"right name, or class with it, given detection, {at}", found.holds_truth, ("held", level))
        yield _rated(f"right name alone, exact aliases aside, {at}", apart.named_right, ("named", level))
        aliases = part[part.exact_alias]
        yield _rated(f"right name, or class with it, of exact aliases, {at}", aliases.holds_truth, None)
    if len(absorbed):
        yield _rated("detected though wholly absorbed (force scale)", absorbed.detected, None)
    for group, name in (
        (SEVERAL_JOINTS, "one mechanism at several joints: that one alone"),
        (GEAR_GRAVITY, "gear defect under declared gravity: right name alone"),
        (MOVED, "set-up that moves between rows: right name alone"),
        (UNDECLARED, "weight of all links, undeclared: right name alone"),
    ):
        for level, part in cases[cases.group == group].groupby("level"):
            yield _rated(f"{name}, at {level:g}", part.named_right, (group, level))
            yield _rated(f"{name.partition(':')[0]}: detected, at {level:g}", part.detected, None)
    for level, part in cases[cases.group == "outside"].groupby("level"):
        yield _rated(f"wrong single name, truth outside the catalogue, at {level:g}", part.wrong_name, ("outside", level))
        yield _rated(f"detected, truth outside the catalogue, at {level:g}", part.detected, None)
    for level, part in cases[cases.group == "pair"].groupby("level"):
        yield _rated(f"both of two effects, at {level:g} each", part.exact, ("pair", level))
        yield _rated(f"both of two effects, or classes with them, at {level:g} each", part.holds_truth, None)


def _over_the_limit(cases: pd.DataFrame, seed: int) -> Iterator[dict[str, Any]]:
    """What is found beside what the best analyst finds of the same cases."""
    sampled = cases[cases.limit_right.notna()]
    for (group, level), (ours, best, words) in COMPARED.items():
        part = sampled[(sampled.group == group) & (sampled.level == level)]
        yield _rated(f"{words}{BY_THE_BEST}", part[best] == 1.0, None)
        hits = part[ours].to_numpy(float), part[best].to_numpy(float)
        low, high = _bootstrapped(hits, _ratio_of_sums, stream(seed, "blind", f"{words} over the limit", 0))
        value = float(_ratio_of_sums(*hits)) if len(part) else np.nan
        row = {"hits": None, "cases": len(part), "rate": value, "low": low, "high": high}
        yield _named(f"{words}{OVER_THE_BEST}", row, ("over the limit", None))


def _of_errors(cases: pd.DataFrame, seed: int) -> Iterator[dict[str, Any]]:
    known = cases[cases.group.isin(["single", "pair"]) & cases.detected]
    ratio = (known.after_rms_m / known.oracle_rms_m).to_numpy()
    for name, statistic in (("median", np.median), ("mean", np.mean)):
        low, high = _bootstrapped((ratio,), statistic, stream(seed, "blind", f"{name} ratio", 0))
        value = float(statistic(ratio)) if len(ratio) else np.nan
        row = {"hits": None, "cases": len(ratio), "rate": value, "low": low, "high": high}
        yield _named(f"held-out RMS after, over the oracle's, {name}", row, ("ratio", None))
    yield _rated("held-out RMS after within 5 % of the oracle's", ratio <= WITHIN, None)
    # Most of a held-out RMS is noise, which no model removes: what the effect adds to the mean square is the sharper measure.
    single = cases[(cases.group == "single") & (cases.level_of == "retained")]
    for level, part in single.groupby("level"):
        before, after, best = (part[name].to_numpy() ** 2 for name in ("before_rms_m", "after_rms_m", "oracle_rms_m"))
        removed, removable = before - after, before - best
        low, high = _bootstrapped((removed, removable), _ratio_of_sums, stream(seed, "blind", f"removed at {level:g}", 0))
        row = {"hits": None, "cases": len(part), "rate": float(_ratio_of_sums(removed, removable)), "low": low, "high": high}
        yield _named(f"share of the oracle's fall of the held-out mean square that is reached, at {level:g}", row, None)
    adopted = cases[cases.adopted]
    yield _rated("effect adopted and held-out RMS worse by over two standard errors", adopted.worse, ("worse", None))


def _of_statements(statements: pd.DataFrame, seed: int) -> Iterator[dict[str, Any]]:
    error = calibration_error(statements, seed)
    chance = error.pop("by_chance")
    yield _named("stated probability of the most probable mechanisms: expected calibration error", error, ("calibration", None))
    row = {"hits": None, "cases": len(statements), "rate": chance, "low": np.nan, "high": np.nan}
    yield _named("the same of as many verdicts that are calibrated, on average", row, None)
    yield _rated("95 % sets of hypotheses that hold the truth", statements.held, ("credible", None))


def _of_intervals(intervals: pd.DataFrame) -> Iterator[dict[str, Any]]:
    if not len(intervals):
        return
    usual = intervals[intervals.setting == "usual"]
    springs = usual[usual.effect == "joint_compliance"]
    foreign = springs.truth.str.startswith(OUTSIDE)
    yield _rated("95 % intervals of effects' parameters", usual[usual.effect != "joint_compliance"].holds, ("coverage", None))
    for words, part, target in (
        ("no effect", springs.truth == NONE, ("coverage", None)),
        ("an effect, whatever was selected", (springs.truth != NONE) & ~foreign, ("coverage", None)),
        ("an effect outside of the catalogue", foreign, None),
    ):
        yield _rated(f"95 % intervals of joint compliances, {words}", springs[part].holds, target)


def _rated(name: str, hits: Iterable[bool], target: _Key | None) -> dict[str, Any]:
    return _named(name, rate(hits), target)


def _named(name: str, row: dict[str, Any], target: _Key | None) -> dict[str, Any]:
    aim = _TARGETS.get(target, Target("", np.nan, np.nan))
    judged = aim.words and row["cases"]
    holds = None
    if judged:
        holds = bool(aim.low <= row["rate"] <= aim.high and not row["high"] >= aim.below)
    return {"quantity": name} | row | {"target": aim.words, "target_low": aim.low, "target_high": aim.high, "holds": holds}


def _ratio_of_sums(removed: np.ndarray, removable: np.ndarray, axis: int = -1) -> np.ndarray:
    removable = removable.sum(axis=axis)
    # Where knowing the effect does not help there is nothing to reach.
    return removed.sum(axis=axis) / np.where(removable > 0, removable, np.nan)


def _bootstrapped(
    samples: tuple[np.ndarray, ...], statistic: Callable[..., np.ndarray], draws: np.random.Generator
) -> tuple[float, float]:
    """Interval of 95 % over cases."""
    if len(samples[0]) < 2 or not np.isfinite(statistic(*samples)):
        return np.nan, np.nan
    found = bootstrap(
        samples,
        statistic,
        n_resamples=_RESAMPLES,
        batch=_SEVERAL_AT_ONCE,
        vectorized=True,
        paired=True,
        method="percentile",
        rng=draws,
    ).confidence_interval
    return float(found.low), float(found.high)
