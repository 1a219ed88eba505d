"""Everything that the report of the blind proof states, worded, from the tables of reports/blind/."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import pandas as pd

from elastocal.counting import counted, grouped
from elastocal.report.words import at_joints, listed, plain, words
from elastocal_proof.blind.case_rows import EXACT_ALIASES
from elastocal_proof.blind.cases import GEAR_GRAVITY, MOVED, SEVERAL_JOINTS, UNDECLARED, USUAL_DESIGN
from elastocal_proof.blind.confusion import CLASS_WITH, CLASS_WITHOUT
from elastocal_proof.blind.scores import NONE, PROOF, TUNED, leading
from elastocal_proof.blind.targets import BY_THE_BEST, OF_ALL_CASES, OVER_THE_BEST, setting_words, with_target, worded

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping
    from typing import Any

    from elastocal_proof.plant.campaigns import Design

_OUTSIDE = "outside:"
_GROUPS = {
    NONE: "no effect",
    "single": "one effect of the catalogue",
    "pair": "two effects of the catalogue",
    "outside": "one effect outside of the catalogue",
    "setting": "hard settings, with an effect and without",
    "sweep": "near relatives under other designs",
    SEVERAL_JOINTS: "one mechanism at several joints",
    GEAR_GRAVITY: "gear defects at joints that carry weight",
    MOVED: "set-ups that move between rows",
    UNDECLARED: "weight of all links, undeclared",
}
_VERDICTS_OUTSIDE = ("wrong name", "class", "several", "unexplained", "adequate")
_OUTCOMES_OF_RELATIVES = ("right", "class", "wrong", "other")
_ABSENT = "–"
_REACHED = {"True": "reached", "False": "missed"}


def blind_facts(tables: Mapping[str, pd.DataFrame], manifest: str, size: str, seed: int) -> dict[str, Any]:
    """Facts for the report of the blind proof.

    `tables`: ``summary``, ``settings``, ``power``, ``undetectable``, ``confusion``, ``cases``, ``follow_up`` and ``sweep`` of
    reports/blind/. `manifest`: contents of the manifest. `size`: of the benchmark. `seed`: of everything that is drawn. Returns
    JSON-serialisable; strings ready to print, lists for tables.
    """
    cases, summary = tables["cases"], worded(tables["summary"])
    robots = leading(cases.robots)
    return {
        "robots": {key: _robots(cases, key) for key in (PROOF, TUNED)},
        "proof": robots == PROOF,
        "verdict": reached_words(summary),
        "missed": [_missed(row) for row in _rows_of(_aimed(summary, robots)) if str(row.holds) == "False"],
        "protocol": {
            "cases": grouped(len(cases)),
            "size": size,
            "seed": str(seed),
            "truths": grouped(len(manifest.splitlines())),
            "digest": hashlib.sha256(manifest.encode()).hexdigest(),
            "levels": listed(f"{level:g}" for level in sorted(cases[cases.group == "single"].level.unique())),
            "outside": listed(
                words(name.removeprefix(_OUTSIDE)) for name in sorted(set(cases[cases.group == "outside"].truth))
            ),
        },
        "design": _design(USUAL_DESIGN),
        "aliases": listed(f"{words(effect)}{at_joints(effect, joints)}" for effect, joints in EXACT_ALIASES if joints),
        "counts": _counts(cases),
        "targets": {key: _targets(summary, key) for key in (PROOF, TUNED)},
        "further": {key: _further(summary, key) for key in (PROOF, TUNED)},
        "effects": _effects(tables["power"], robots),
        "outside": _outside(tables["confusion"], robots),
        "settings": _settings(tables["settings"], robots),
        "undetectable": _undetectable(tables["undetectable"], robots),
        "sweep": _sweep(tables["sweep"]),
        "follow_up": _follow_up(tables["follow_up"]),
    }


def target_rows(summary: pd.DataFrame, of_each: Mapping[str, pd.DataFrame]) -> list[dict[str, str]]:
    """Each quantity with a target as a row of words, beside what every robot has alone and what the best analyst finds.

    `summary`: of reports/blind/. `of_each`: of `targets.of_each_robot`, by what the robots are called.
    """
    summary = worded(summary)
    robots = leading(summary.robots)
    of_all = {row.quantity: row for row in _rows_of(summary[summary.robots == robots])}
    alone = {name: {row.quantity: row for row in _rows_of(worded(one))} for name, one in of_each.items()}
    rows = []
    for row in _rows_of(_aimed(summary, robots)):
        compared = row.quantity.removesuffix(OVER_THE_BEST)
        found, limit = of_all.get(OF_ALL_CASES.get(compared, compared), row), of_all.get(f"{compared}{BY_THE_BEST}")
        cells = {"quantity": found.quantity, "target": row.target, "outcome": _outcome(row)}
        cells |= {"robots together": _with_interval(found), "cases": _hits(found)}
        cells |= {name: _value(each[found.quantity]) if found.quantity in each else _ABSENT for name, each in alone.items()}
        if limit:
            cells["limit, on a sample"] = f"{_with_interval(limit)}, {_hits(limit)}"
            cells["found over limit, same sample"] = _with_interval(row)
        rows.append(cells)
    return rows


def _aimed(summary: pd.DataFrame, robots: str) -> pd.DataFrame:
    return with_target(summary[summary.robots == robots])


def _rows_of(table: pd.DataFrame) -> Iterator[Any]:
    """Rows of a table; their attributes are its columns."""
    return table.itertuples()


def _design(design: Design) -> dict[str, str]:
    return {
        "poses": f"{design.poses}",
        "held_out": f"{design.held_out}",
        "force": "1000 N (less in proportion on arms made for less than 140 kg)",
        "ladder": listed(f"{share:+g}".replace("-", "−") if share else "0" for share in design.ladder),
        "repeats": f"{design.repeats}",
        "repeated": f"{design.repeated_poses}",
    }


def _robots(cases: pd.DataFrame, key: str) -> str:
    names = sorted(set(cases[cases.robots == key].robot))
    return listed(names) if names else ""


def reached_words(summary: pd.DataFrame) -> str:
    """How many targets are reached; `summary`: of reports/blind/."""
    robots = leading(summary.robots)
    judged = _aimed(summary, robots).dropna(subset="holds")
    held = int((judged.holds.astype(str) == "True").sum())
    where = "the robots of the proof" if robots == PROOF else "robots on which the method was developed, which proves nothing"
    return f"{held} of {counted(len(judged), 'figure')} with a target reach it on {where}."


def _missed(row: Any) -> str:
    return f"{row.quantity}: {_with_interval(row)}, target {row.target}"


def _with_interval(row: Any) -> str:
    return f"{_value(row)} ({_interval(row)})"


def _outcome(row: Any) -> str:
    return _REACHED.get(str(row.holds), "no case")


def _value(row: Any) -> str:
    if pd.isna(row.rate):
        return _ABSENT
    return plain(row.rate, 4) if _is_ratio(row) else f"{100 * row.rate:.1f} %"


def _interval(row: Any) -> str:
    if pd.isna(row.low):
        return _ABSENT
    if _is_ratio(row):
        return f"{plain(row.low, 4)}–{plain(row.high, 4)}"
    return f"{100 * row.low:.1f}–{100 * row.high:.1f} %"


def _is_ratio(row: Any) -> bool:
    return row.quantity.startswith("held-out RMS after, over")


def _hits(row: Any) -> str:
    return grouped(int(row.cases)) if pd.isna(row.hits) else f"{grouped(int(row.hits))} of {grouped(int(row.cases))}"


def _targets(summary: pd.DataFrame, robots: str) -> list[list[str]]:
    return [
        [row.quantity, _hits(row), _value(row), _interval(row), row.target, _outcome(row)]
        for row in _rows_of(_aimed(summary, robots))
    ]


def _further(summary: pd.DataFrame, robots: str) -> list[list[str]]:
    mine = summary[(summary.robots == robots) & summary.target.fillna("").eq("")]
    return [[row.quantity, _hits(row), _value(row), _interval(row)] for row in _rows_of(mine)]


def _counts(cases: pd.DataFrame) -> dict[str, Any]:
    table = pd.crosstab(cases.group, cases.robot)
    heads = ["cases", *table.columns]
    rows = [[title, *(grouped(int(number)) for number in table.T[key])] for key, title in _GROUPS.items() if key in table.index]
    return {"heads": heads, "rows": [*rows, ["all", *(grouped(int(number)) for number in table.sum())]]}


def _effects(power: pd.DataFrame, robots: str) -> list[list[str]]:
    """Per effect at the largest level and the one before: what the heat map shows, with intervals and sizes."""
    mine = power[(power.robots == robots) & (power.group == "single") & (power.effect != "all")]
    rows = []
    for effect, part in mine.groupby("effect"):
        for row in part.sort_values("level").tail(2).to_dict("records"):
            rows.append(
                [
                    words(str(effect)),
                    f"{row['level']:g}" + (" raw" if row["level_of"] == "raw" else ""),
                    f"{row['cases']}",
                    _share(row, "detected"),
                    _share(row, "held"),
                    _share(row, "named"),
                    _share(row, "oracle_detected"),
                    f"{plain(row['signal_rms_um'])} µm",
                    f"{row['times_plausible']:.2f}",
                ]
            )
    return rows


def _share(row: Mapping[Hashable, Any], name: str) -> str:
    rate, low, high = (row[f"{name}{end}"] for end in ("", "_low", "_high"))
    return _ABSENT if pd.isna(rate) else f"{100 * rate:.0f} ({100 * low:.0f}–{100 * high:.0f})"


def _outside(confusion: pd.DataFrame, robots: str) -> list[list[str]]:
    """Verdicts on effects outside of the catalogue, in % of their cases at the largest size."""
    mine = confusion[(confusion.robots == robots) & confusion.truth.str.startswith(_OUTSIDE)]
    rows = []
    for truth, part in mine.groupby("truth"):
        counts = part.iloc[part.level.argmax()].drop(["robots", "settings", "truth"])
        level, counts = counts["level"], counts.drop("level").astype(float)
        verdicts = {
            "class": counts[CLASS_WITH] + counts[CLASS_WITHOUT],
            "several": counts["several"],
            "unexplained": counts["unexplained"],
            "adequate": counts["adequate"] + counts["not_testable"],
        }
        verdicts["wrong name"] = counts.sum() - sum(verdicts.values())
        shares = [f"{100 * verdicts[word] / counts.sum():.0f}" for word in _VERDICTS_OUTSIDE]
        rows.append([words(str(truth).removeprefix(_OUTSIDE)), f"{level:g}", f"{counts.sum():.0f}", *shares])
    return rows


def _settings(settings: pd.DataFrame, robots: str) -> list[list[str]]:
    mine = settings[settings.robots == robots]
    return [
        [
            setting_words(row.setting),
            row.kind + (f" at {row.level:g}" if row.level else ""),
            f"{row.cases}",
            f"{100 * row.rate:.0f} ({100 * row.low:.0f}–{100 * row.high:.0f})",
            _ABSENT if row.kind == "no effect" else f"{100 * row.held / row.cases:.0f}",
            f"{100 * row.wrong / row.cases:.0f}",
        ]
        for row in _rows_of(mine)
    ]


def _undetectable(undetectable: pd.DataFrame, robots: str) -> list[list[str]]:
    rows = []
    for row in _rows_of(undetectable[undetectable.robots == robots]):
        rows.append(
            [
                words(row.effect),
                setting_words(row.setting),
                f"{row.level:g}",
                row.reason,
                f"{row.hits} of {row.cases}",
                f"{100 * row.retained_share:.2g} %",
                f"{row.times_plausible:.2g}",
            ]
        )
    return rows


def _sweep(sweep: pd.DataFrame) -> list[list[str]]:
    return [
        [f"{row['angle_up_to_deg']:g}°", f"{row['cases']}", *(_share(row, name) for name in _OUTCOMES_OF_RELATIVES)]
        for row in sweep[sweep.pair == "all"].to_dict("records")
    ]


def _follow_up(follow_up: pd.DataFrame) -> list[list[str]]:
    return [
        [
            {PROOF: "proof", TUNED: "tuned on"}[row.robots],
            row.arm,
            f"{row.poses_added}",
            f"{row.cases}",
            f"{100 * row.right_name:.0f} %",
            f"{100 * row.low:.0f}–{100 * row.high:.0f} %",
        ]
        for row in _rows_of(follow_up)
    ]
