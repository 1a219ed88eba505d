"""What the reports of the study show: rows of tables and numbers of its text, by `study.txt`, from the tables of a run."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.report.typesetting import sentences
from elastocal.study.printed import LEVEL
from elastocal.study.question_tables import CHOSEN
from elastocal.study.ranks import REFERENCE
from elastocal.study.steps.simulated_designs import TEST_POSE
from elastocal.study.tables import column_head, list_rows, merge_errors, word_value

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.study.strategies import Strategy

# The repeatability that the paper names for both robots, in µm.
REPEATABILITY_UM = 60.0
# In the order in which they are shown.
METRIC_NAMES = {
    REFERENCE: "RMS of one data set",
    "mean_um": "mean of one data set",
    "p95_um": "p95 of one data set",
    "pooled_p95_um": "p95 pooled over data sets",
    "iso_9283_um": "largest at the ISO 9283 poses",
    "path_rms_um": "RMS on a milling path",
    "path_max_um": "largest on a milling path",
    "dev_um": "dev (equation 15)",
    "k_sigma_percent": "k_Σ of all joints",
    "k_sigma_percent_fixed_joints": "k_Σ of the fixed joints",
}
# Designs in the order of the tables, and numbers of configurations that count as few.
_DESIGNS, _FEW = ("random", "D", "A", "I", TEST_POSE), (2, 3, 4, 6, 8, 10)
# The paper's Table 2 in that of the study.
_DEVIATIONS = {"deviation_mean": "mean_mm", "deviation_std": "std_mm", "deviation_max": "max_mm"}
# Beyond so many configurations nothing is known of a length.
_LONGEST = 1000
_CONTINUED = "†"


def brief_names(titles: Mapping[str, str]) -> dict[str, str]:
    """Names for cells of tables: the first words of each title that distinguish it from others.

    A title that continues another one, as that of a robot with elastic links, keeps what it adds.
    """
    found = {}
    for robot, title in titles.items():
        base = min((other for other in titles.values() if title.startswith(other)), key=len)
        words, others = base.split(), [other.split() for other in titles.values() if not other.startswith(base)]
        count = next((n for n in range(1, len(words)) if words[:n] not in [other[:n] for other in others]), len(words))
        found[robot] = " ".join(words[:count]) + title.removeprefix(base)
    return found


def study_facts(
    tables: Mapping[str, pd.DataFrame], names: Mapping[str, str], robots: Sequence[str], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Facts for the report of the study.

    `tables`: of the study, by the names that its rules give them. `names`: of all robots in cells of tables, by their keys.
    `robots`: keys of those without links. `settings`: ``noise_um``, ``length`` and ``configurations`` of the tables,
    ``classical`` and ``best`` strategy, all ``strategies``, ``accuracy_um``, and ``stated``, numbers of the configuration.
    Returns rows and paragraphs of `study.txt` under its headings, strings ready to print.
    """
    length, limit, titles = settings["length"], settings["configurations"], [names[robot] for robot in robots]
    whole = {name: frame.assign(robot=frame.robot.map(names)) if "robot" in frame else frame for name, frame in tables.items()}
    of = {name: frame[frame.robot.isin(titles)] if "robot" in frame else frame for name, frame in whole.items()}
    judged = whole["comparison"][whole["comparison"].p_value.notna()]
    expectations = whole["expectations"][whole["expectations"].paper.notna()]
    plain = ("joint", "solvers", "stiffness", "geometry", "weighting")
    rows = {name: of[name] for name in plain} | {"outside": judged[judged.p_value < LEVEL], "expectations": expectations}
    rows |= {name: of[name][of[name].accuracy_um == settings["accuracy_um"]] for name in ("break_even", "needed")}
    rows["tubes"] = tables["tubes"]
    rows["claims"] = of["claims"].assign(found=_found(of["claims"], names))
    facts = {name: _records(frame) for name, frame in rows.items()} | {
        "measured": _measured(of["studies"], limit),
        "over_studies": [_over_studies(of["studies"], title, settings) for title in titles],
        "one_set": _one_set(tables, names),
        "extended": merge_errors(tables["extended"].drop(columns="robot")).to_numpy().tolist(),
        "strategies": [_stages(strategy) for strategy in settings["strategies"]],
        "ladder": _ladder(tables["ladder"]),
        "costs": {title: cheapest(of["costs"][of["costs"].robot == title]) for title in titles},
        "budget": _budget(of["budget"], of["pairs"], length),
        "simulated": _simulated(of["simulated"], length),
        "smallest": _smallest(of["simulated"], titles, settings["accuracy_um"]),
        "few": _few(of["few"]),
        "few_heads": [str(size) for size in _FEW if size in set(of["few"].configurations)],
        "kinds": _kinds(of["kinds"], titles, length),
        "places": [_records(of["places"][of["places"].robot == title]) for title in titles],
        "observability": _observability(of["observability"], titles),
        "scores": _scores(of["scores"]),
        "staged": _staged(of["scores"], titles),
        "metrics": _metrics(of["score_pairs"]),
        "summaries": _summaries(tables["ladder"], tables["pairs"]),
        "cells": len(judged),
        "differ": int((judged.p_holm < LEVEL).sum()),
        "studies": int(expectations.studies.max()) if len(expectations) else 0,
    }
    helpers = {"word_value": word_value, "column_head": column_head, "ratio": ratio_words}
    shown = {"noise_um": f"{settings['noise_um']:g}", "length": f"{length}", "repeatability_um": f"{REPEATABILITY_UM:g}"}
    more = {
        "classical": settings["classical"],
        "accuracy_um": f"{settings['accuracy_um']:g}",
        "metric_count": len(METRIC_NAMES),
    }
    stated = {name: ", ".join(f"{value:g}" for value in np.atleast_1d(values)) for name, values in settings["stated"].items()}
    said = sentences("study.txt", titles=titles, infinity=np.inf, **facts, **helpers)
    kept = {name: facts[name] for name in ("extended", "strategies", "few", "few_heads")} | {"titles": titles, "stated": stated}
    numbers = {name: str(facts[name]) for name in ("cells", "differ", "studies")}
    return said | kept | numbers | shown | more


def paper_rows(beside: pd.DataFrame, names: Mapping[str, str], configurations: int) -> list[dict[str, str]]:
    """Each figure that the paper prints beside ours, in words.

    `beside`: by `comparison.beside_paper`. `names`: of the robots by their keys. `configurations`: in a data set. Of ours
    stands the Monte Carlo standard deviation of a study of this size behind ±.
    """
    return [
        {
            "table": row.table,
            "robot": names.get(row.robot, ""),
            "strategy": row.strategy if isinstance(row.strategy, str) else "",
            "quantity": column_head(row.quantity),
            "paper": f"{row.paper:g}",
            "ours": "not studied" if np.isnan(row.ours) else _continued(row.quantity, row.ours, row.mc_std, configurations),
        }
        for row in beside.itertuples()
    ]


def paper_tables(frames: Mapping[str, pd.DataFrame], names: Mapping[str, str], configurations: int) -> dict[str, Any]:
    """The paper's tables of one study as rows of cells, heads first; lengths beyond a data set are marked."""
    found = {}
    for name, frame in frames.items():
        lengths = [column for column in frame if column.startswith("n_") and not column.endswith("_std_error")]
        beyond = {column_head(column): frame[column] > configurations for column in lengths}
        heads, *rows = list_rows(frame.assign(robot=frame.robot.map(names)) if "robot" in frame else frame)
        marks = [
            [_CONTINUED if head in beyond and beyond[head].iloc[row] else "" for head in heads] for row in range(len(rows))
        ]
        found[name] = [
            heads,
            *([f"{cell}{mark}" for cell, mark in zip(*each, strict=True)] for each in zip(rows, marks, strict=True)),
        ]
    return found


def ratio_words(row: Mapping[str, Any], name: str = "ratio", digits: int = 3) -> str:
    """A ratio of a row with its interval."""
    value, low, high = (f"{row[name + end]:.{digits}f}" for end in ("", "_low", "_high"))
    return f"{value} ({low} to {high})"


def _records(frame: pd.DataFrame) -> list[dict[Any, Any]]:
    return frame.to_dict("records")


def _continued(quantity: str, value: float, error: float, configurations: int, longest: float = np.inf) -> str:
    """A score with its error; a length beyond a data set, where the curve is continued as 1/n, is marked."""
    if not quantity.startswith("n_"):
        return word_value(value, error)
    if value >= longest:
        return f"over {longest:g}{_CONTINUED}"
    text = f"{value:.0f} ± {error:.0f}" if np.isfinite(longest) else word_value(value, error)
    return text + (_CONTINUED if np.isfinite(value) and value > configurations else "")


def _found(claims: pd.DataFrame, names: Mapping[str, str]) -> list[str]:
    """What studies find of each claim, once where both counts of joints say the same, and with names for the keys of robots."""
    both = [a if a == b else f"all joints: {a}; fixed joints: {b}" for a, b in zip(claims.literal, claims.ours, strict=True)]
    key = re.compile(rf"\b({'|'.join(map(re.escape, names))})\b")
    return [key.sub(lambda match: names[match[0]], text) for text in both]


def _measured(table: pd.DataFrame, configurations: int) -> list[dict[str, Any]]:
    """Table 4 over studies, a row for each estimator on each robot.

    Returns robot, strategy and the four figures of Table 4 under (measured, average), those of k_sigma over the fixed joints
    under "fixed".
    """
    rows, seen = [], set()
    for (robot, strategy), cells in table.groupby(["robot", "strategy"], sort=False):
        by = {(row["measured"], row["average"]): row for row in _records(cells)}
        figures = _figures(table)
        fixed = [name.replace("k_sigma_", "k_sigma_fixed_joints_") for name in figures[:2]]
        usual = by["pose", "stiffness"]
        # One estimator under another name; the fixed joints of its last stage are fewer, perhaps.
        key = (robot, f"{usual[figures[2]]:.6g}")
        if key in seen and usual[fixed[0]] == usual[figures[0]]:
            continue
        seen.add(key)

        def cell(row: Mapping[str, Any], name: str) -> str:
            return _continued(name, row[name], row[f"{name}_std"], configurations, _LONGEST)

        kinds = {f"{what} {average}": [cell(row, name) for name in figures] for (what, average), row in by.items()}
        rows.append({"robot": robot, "strategy": strategy, **kinds, "fixed": [cell(usual, name) for name in fixed]})
    return rows


def _figures(table: pd.DataFrame) -> list[str]:
    """The four figures of Table 4 by their columns, whatever length and limits they have."""
    names = [name for name in table.columns if not name.endswith("_std") and "fixed_joints" not in name]
    return [next(name for name in names if name.startswith(start)) for start in ("k_sigma_", "n_k_sigma_", "dev_", "n_dev_")]


def _over_studies(table: pd.DataFrame, robot: str, settings: Mapping[str, Any]) -> list[str]:
    """What studies say of the classical strategy and the best one.

    Returns the robot; dev, RMS and their ratio of the classical strategy; its dev over that of the best; dev of averaged
    compliances.
    """
    poses = table[(table.robot == robot) & (table.measured == "pose")].set_index(["strategy", "average"])
    usual, averaged = (poses.loc[(settings["classical"], average)] for average in ("stiffness", "compliance"))
    dev = _figures(table)[2]
    rms = next(name for name in table.columns if name.startswith("rms_") and not name.endswith("_std"))
    words = [word_value(row[name], row[f"{name}_std"]) for row, name in ((usual, dev), (usual, rms), (averaged, dev))]
    ratio = usual[dev] / poses.loc[(settings["best"], "stiffness")][dev]
    return [robot, words[0], words[1], f"{usual[rms] / usual[dev]:.1f}", f"{ratio:.2f}", words[2]]


def _one_set(tables: Mapping[str, pd.DataFrame], names: Mapping[str, str]) -> list[dict[str, Any]]:
    """The paper's Table 2 against the statistics of single data sets."""
    studied, figures = tables["table2"].set_index("robot"), tables["comparison"]
    figures = figures[(figures.table == "2") & figures.robot.isin(studied.index)]
    rows = []
    for row in _records(figures):
        column = _DEVIATIONS[row["quantity"]]
        mine = {end: studied.loc[row["robot"], f"{column}{end}"] for end in ("", "_one_set", "_one_set_std")}
        rows.append(
            {**row, "robot": names[row["robot"]], "all": mine[""], "one": mine["_one_set"], "std": mine["_one_set_std"]}
        )
    return rows


def _stages(strategy: Strategy) -> list[str]:
    """What a strategy does, stage by stage: its name, and points measured → compliances identified."""

    def springs(joints: Sequence[int]) -> str:
        numbers = [joint + 1 for joint in joints]
        whole = len(numbers) > 1 and numbers == [*range(numbers[0], numbers[-1] + 1)]
        return f"c{numbers[0]}–c{numbers[-1]}" if whole else ", ".join(f"c{number}" for number in numbers)

    stages = [
        f"{' and '.join(stage.points)} → {springs(stage.identified)}"
        + (f", {springs(stage.fixed)} fixed" if stage.fixed else "")
        for stage in strategy.stages
    ]
    return [strategy.name, "; then ".join(stages)]


def _ladder(ladder: pd.DataFrame) -> list[dict[str, Any]]:
    """What joints alone leave, what the best number of link springs would, and what cross-validation chooses."""
    rows = []
    for (noise, length), cell in ladder.groupby(["noise_um", "length"]):
        by = cell.set_index("link_springs")[["rms_um", "rms_um_std_error"]]
        best = str(by.drop(index=CHOSEN).rms_um.idxmin())
        rows.append({"noise": noise, "length": length, "springs": best, "of": [by.loc[name] for name in ("0", best, CHOSEN)]})
    return rows


def cheapest(costs: pd.DataFrame) -> list[tuple[str, float]]:
    """Sets of points of one robot, each with the cost of a configuration from which on it is the cheapest.

    `costs`: from `costs.cost_table`. A cost is linear in that of a configuration: sets that follow each other on the grid meet
    where their lines do.
    """
    lines = {}
    for points, cell in costs.groupby("points"):
        cell = cell.sort_values("configuration_cost")
        first, last = cell.iloc[0], cell.iloc[-1]
        slope = (last.cost - first.cost) / (last.configuration_cost - first.configuration_cost)
        lines[points] = (slope, first.cost - slope * first.configuration_cost)
    best = costs[costs.cheapest].sort_values("configuration_cost").points
    order = list(dict.fromkeys(best))
    meet = [(lines[b][1] - lines[a][1]) / (lines[a][0] - lines[b][0]) for a, b in pairwise(order)]
    return list(zip(order, [0.0, *meet], strict=True))


def _budget(budget: pd.DataFrame, pairs: pd.DataFrame, length: int) -> list[dict[str, Any]]:
    """Sets of points with as many configurations and with as many measurements, the latter against the end-effector alone."""
    rows = []
    for (robot, points), cell in budget.groupby(["robot", "points"], sort=False):
        many = 2 * length // int(cell.measurements_per_configuration.iloc[0])
        at = {size: _records(cell[cell.configurations == size])[:1] for size in (length, many)}
        against = pairs[(pairs.robot == robot) & (pairs.points == points)]
        rows.append(
            {
                "robot": robot,
                "points": points,
                "same": at[length],
                "many": many,
                "equal": at[many],
                "pair": _records(against)[:1],
            }
        )
    return rows


def _simulated(table: pd.DataFrame, length: int) -> list[dict[str, Any]]:
    """Simulated errors at one size by load and design."""
    rows = []
    for (robot, load), cell in table[table.configurations == length].groupby(["robot", "load"], sort=False):
        hidden = str(cell.unobservable.iloc[0])
        by = cell.set_index("design")
        there = "; ".join(f"{by.at_test_pose_um[name]:.0f}" for name in ("I", TEST_POSE))
        row = {"robot": robot, "load": load, "hidden": "none" if hidden in ("", "nan") else f"joint {hidden}", "there": there}
        rows.append(row | {"gain": by.gain["I"], "of": [by.loc[name] for name in _DESIGNS]})
    return rows


def _smallest(table: pd.DataFrame, titles: Sequence[str], accuracy_um: float) -> list[dict[str, Any]]:
    """The smallest simulated design within an accuracy on each robot, random loads, I-optimal."""
    within = table[(table.load == "random") & (table.design == "I") & (table.rms_um <= accuracy_um)].sort_values(
        "configurations"
    )
    return [{"robot": title, "first": _records(within[within.robot == title])[:1]} for title in titles]


def _few(table: pd.DataFrame) -> list[list[str]]:
    """RMS error from few configurations: robot, strategy, error of the nominal values in percent, and the errors.

    Strategies without a prior do not depend on the nominal values and have one row.
    """
    shown = table[table.configurations.isin(_FEW)]
    wide = shown.pivot_table(
        index=["robot", "strategy", "nominal_error_percent"], columns="configurations", values="rms_um", sort=False
    )
    rows = [
        [*map(str, key[:2]), f"{key[2]:g}", *(f"{value:.0f}" for value in values)]
        for key, values in zip(wide.index, wide.to_numpy(), strict=True)
    ]
    alike: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        alike.setdefault((*row[:2], *row[3:]), row)
    often = [(row[0], row[1]) for row in alike.values()]
    return [[*row[:2], "any" if often.count((row[0], row[1])) == 1 else row[2], *row[3:]] for row in alike.values()]


def _kinds(table: pd.DataFrame, titles: Sequence[str], length: int) -> list[dict[str, Any]]:
    """Error by what is measured: in as many configurations and with as many scalars."""
    rows = []
    for kind, part in table.groupby("kind", sort=False):
        cells = [part[part.robot == title] for title in titles]
        same = [_records(cell[cell.configurations == length])[0] for cell in cells]
        equal = [cell.iloc[[int(np.argmin(np.abs(cell.scalars - 6 * length)))]] for cell in cells]
        rows.append({"kind": kind, "same": same, "equal": [_records(cell)[0] for cell in equal]})
    return rows


def _observability(table: pd.DataFrame, titles: Sequence[str]) -> dict[str, list[Any]]:
    """Rank correlations of each index on each robot."""
    by = table.set_index(["index", "robot"])
    return {str(index): [by.loc[(index, title)] for title in titles] for index in dict.fromkeys(table["index"])}


def _scores(scores: pd.DataFrame) -> list[dict[str, Any]]:
    """Scores of each strategy on each robot by their names; those of which the robot reaches nothing are missing."""
    groups = scores.groupby(["robot", "strategy"], sort=False)
    return [
        {"robot": robot, "strategy": name, "of": cell.set_index("metric").to_dict("index")} for (robot, name), cell in groups
    ]


def _staged(scores: pd.DataFrame, titles: Sequence[str]) -> list[dict[str, Any]]:
    """RMS error of each strategy over that of the classical one, paired by data set, robot by robot."""
    by = scores[scores.metric == REFERENCE].set_index(["strategy", "robot"])
    return [
        {"strategy": name, "of": [by.loc[(name, title)] for title in titles]}
        for name in dict.fromkeys(by.index.get_level_values(0))
    ]


def _metrics(pairs: pd.DataFrame) -> dict[str, Any]:
    """How often metrics put two estimators in the other order than the RMS error of one data set does, and the worst pair."""
    turned = pairs[pairs.reversed & (pairs.metric != REFERENCE)]
    counts = {METRIC_NAMES[name]: int((turned.metric == name).sum()) for name in METRIC_NAMES if (turned.metric == name).any()}
    worst = _records(turned.iloc[[int((turned.ratio / turned.rms_ratio).abs().argmax())]]) if len(turned) else []
    example = [row | {"metric": METRIC_NAMES[row["metric"]]} for row in worst]
    return {"pairs": int((pairs.metric == REFERENCE).sum()), "counts": counts, "example": example}


def _summaries(ladder: pd.DataFrame, pairs: pd.DataFrame) -> dict[str, Any]:
    """Percent by which cross-validation's choice leaves more than the best number of link springs; ratios of sets of points."""
    chosen, groups = ladder.link_springs == CHOSEN, ["robot", "noise_um", "length"]
    excess = 100 * (ladder[chosen].groupby(groups).rms_um.first() / ladder[~chosen].groupby(groups).rms_um.min() - 1)
    ratios = {
        "worse": int((pairs.ratio_low > 1).sum()),
        "sets": len(pairs),
        "least": pairs.ratio.min(),
        "largest": pairs.ratio.max(),
    }
    return {"median": excess.median(), "most": excess.max(), **ratios}
