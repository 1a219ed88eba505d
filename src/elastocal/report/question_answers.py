"""Numbers that the text states about the research questions beyond the paper's strategies, already worded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.report.answers import ratio_words, with_error, worded
from elastocal.study.ladder import CHOSEN
from elastocal.study.tables import word_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pandas as pd

    from elastocal.study.strategies import Strategy

_INDEX_NAMES = {
    "O1": "O1, geometric mean of singular values",
    "O2": "O2, inverse condition number",
    "O3": "O3, smallest singular value",
    "O4": "O4, noise amplification",
    "O5": "O5, harmonic mean",
    "bound": "the bound itself",
}
# Noise, then leak.
_GEOMETRY = {
    "robot": "{robot}",
    "estimator": "{estimator}",
    "rms": "{rms_um:.0f}",
    "noise": "{noise_um:.0f}",
    "leak": "{leak_um:.0f}",
    "compliance": "{compliance_noise_percent:.1f}; {compliance_leak_percent:.0f}",
    "zero": "{zero_noise_urad:.0f}; {zero_leak_urad:.0f}",
}
_WEIGHTING = {
    "robot": "{robot}",
    "orientation": "{orientation_ratio:g}",
    "range": "{per_metre_um:g}",
    "equal": "{equal_um:.1f}",
    "weighted": "{weighted_um:.1f}",
    "ratio": "{ratio:.2f}",
}


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


def strategy_rows(strategies: Sequence[Strategy]) -> list[dict[str, str]]:
    """What each strategy does, stage by stage.

    Returns name, stages.
    """
    rows = []
    for strategy in strategies:
        stages = []
        for stage in strategy.stages:
            fixed = f", {_joints(stage.fixed)} fixed" if stage.fixed else ""
            stages.append(f"{' and '.join(stage.points)} → {_joints(stage.identified)}{fixed}")
        rows.append({"name": strategy.name, "stages": "; then ".join(stages)})
    return rows


def ladder_rows(ladder: pd.DataFrame) -> list[dict[str, str]]:
    """What joints alone leave, what the best number of link springs would, and what cross-validation chooses.

    `ladder`: from `ladder.ladder_table`, of one robot. Returns noise, length, joints, best, springs, chosen.
    """
    rows = []
    for (noise, length), cell in ladder.groupby(["noise_um", "length"]):
        by = cell.set_index("link_springs")
        best = str(by.drop(index=CHOSEN).rms_um.idxmin())
        joints, left, chosen = (with_error(by.loc[springs], "rms_um") for springs in ("0", best, CHOSEN))
        row = {"noise": f"{noise:g}", "length": f"{length}", "joints": joints}
        rows.append(row | {"best": left, "springs": best, "chosen": chosen})
    return rows


def budget_rows(budget: pd.DataFrame, pairs: pd.DataFrame, length: int, robots: Iterable[str]) -> list[dict[str, str]]:
    """Sets of points with as many configurations and with as many measurements, the latter against the end-effector alone.

    `budget`, `pairs`: from `points`. `length`: configurations; the budget is twice as many measurements. Returns robot,
    points, same, configurations, equal, ratio.
    """
    rows = []
    for robot in robots:
        mine = budget[budget.robot == robot]
        for points in dict.fromkeys(mine.points):
            cell = mine[mine.points == points].set_index("configurations")
            many = 2 * length // int(cell.measurements_per_configuration.iloc[0])
            against = pairs[(pairs.robot == robot) & (pairs.points == points)]
            row = {"robot": robot, "points": points, "same": _at(cell, length), "configurations": f"{many}"}
            row |= {"equal": _at(cell, many), "ratio": ""}
            if len(against):
                row["ratio"] = ratio_words(against.iloc[0])
            rows.append(row)
    return rows


def needed_rows(needed: pd.DataFrame, accuracy_um: float, robots: Iterable[str]) -> list[dict[str, str]]:
    """How many random configurations reach an accuracy.

    `needed`: from `points.lengths_table`. Returns robot, points, configurations, bound, measurements.
    """
    rows = []
    for row in needed[(needed.accuracy_um == accuracy_um) & needed.robot.isin([*robots])].itertuples():
        low, high = _length(row.configurations_low), _length(row.configurations_high)
        found = {"robot": str(row.robot), "points": str(row.points)}
        found |= {"configurations": f"{_length(row.configurations)} ({low} to {high})"}
        rows.append(found | {"bound": _length(row.configurations_by_bound), "measurements": _length(row.measurements)})
    return rows


def design_facts(designs: pd.DataFrame, length: int, accuracy_um: float, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """What chosen configurations are worth, a dictionary for each robot.

    `designs`: from `designs.designs_table`. `length`: configurations at which designs are compared, where there is one
    of this size. Returns title, random, chosen and bound (µm) at the length, gain (a factor), efficiency (percent of the
    bound's variance), and chosen_needed: the smallest size of an I-optimal design within the accuracy.
    """
    found = []
    for robot, title in titles.items():
        mine = designs[designs.robot == robot]
        sizes = np.unique(mine.configurations)
        at = int(sizes[np.argmin(np.abs(sizes - length))])
        rms = mine[mine.configurations == at].set_index("design").rms_um
        chosen = mine[(mine.design == "I") & (mine.rms_um <= accuracy_um)].configurations
        row = {"title": title, "length": f"{at}", "random": f"{rms['random']:.1f}", "chosen": f"{rms['I']:.1f}"}
        row |= {"gain": f"{rms['random'] / rms['I']:.2f}", "efficiency": f"{100 * (rms['bound'] / rms['I']) ** 2:.0f}"}
        found.append(row | {"chosen_needed": f"{chosen.min()}" if len(chosen) else "more than all"})
    return found


def observability_rows(observability: pd.DataFrame, robots: Iterable[str]) -> list[dict[str, str]]:
    """Rank correlations of the indices, a row for each index.

    `observability`: from `designs.observability_table`. Returns index and, for each robot, its correlation with the
    bound and with the error.
    """
    rows = []
    for index, name in _INDEX_NAMES.items():
        row = {"index": name}
        for robot in robots:
            cell = observability[(observability.robot == robot) & (observability["index"] == index)].iloc[0]
            for against in ("bound", "error"):
                column = f"rank_correlation_with_{against}"
                row[f"{robot} {against}"] = f"{cell[column]:+.2f} ± {cell[f'{column}_std_error']:.2f}"
        rows.append(row)
    return rows


def geometry_rows(geometry: pd.DataFrame, robots: Iterable[str]) -> list[dict[str, str]]:
    """Estimators of geometry and compliances, from `assumptions.geometry_table`."""
    return worded(geometry[geometry.robot.isin([*robots])], _GEOMETRY)


def weighting_rows(weighting: pd.DataFrame, robots: Iterable[str]) -> list[dict[str, str]]:
    """What equal weights cost, from `assumptions.weighting_table`."""
    return worded(weighting[weighting.robot.isin([*robots])], _WEIGHTING)


def stated(settings: Mapping[str, float | Sequence[float]]) -> dict[str, str]:
    """Loads and places of the configuration as the text states them.

    `settings`: numbers, and points as lists of coordinates. Returns numbers as they are, coordinates with commas between them.
    """
    return {name: ", ".join(f"{value:g}" for value in np.atleast_1d(values)) for name, values in settings.items()}


def place_facts(places: pd.DataFrame, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """What a second target is worth on the arm, a dictionary for each robot.

    `places`: from `arm_points.places_table`. Returns title, least and largest: ratios with their intervals and where;
    better: places significantly better than further configurations; turned and fixed: largest percentages of configurations in
    which a target on a link is seen.
    """
    found = []
    for robot, title in titles.items():
        mine = places[places.robot == robot]
        ends = mine.iloc[int(mine.ratio.argmin())], mine.iloc[int(mine.ratio.argmax())]
        least, largest = (f"{end.ratio:.2f} ({end.ratio_low:.2f} to {end.ratio_high:.2f}; {_where(end)})" for end in ends)
        found.append(
            {
                "title": title,
                "least": least,
                "largest": largest,
                "better": str(int((mine.ratio_high < 1).sum())),
                "places": str(len(mine)),
                "turned": f"{mine.seen_turned_percent.max():.0f}",
                "fixed": f"{mine.seen_fixed_percent.max():.0f}",
            }
        )
    return found


def tube_rows(tubes: pd.DataFrame) -> list[dict[str, str]]:
    """Deflections and errors by the diameter of the tubes.

    `tubes`: from `assumptions.tubes_table`. Returns diameter, mean, std, max, left.
    """
    return [
        {
            "diameter": f"{row.diameter_mm:.0f}",
            **{name: f"{row[f'{name}_mm']:.2f} ± {row[f'{name}_mm_between']:.2f}" for name in ("mean", "std", "max")},
            "left": with_error(row, "left_um"),
        }
        for _, row in tubes.iterrows()
    ]


def _where(place: Any) -> str:
    return f"on the {place.side}" if place.side.startswith(("flange", "bar")) else f"behind joint {place.joints}"


def summaries(ladder: pd.DataFrame, pairs: pd.DataFrame, observability: pd.DataFrame) -> dict[str, str]:
    """What the tables say in a sentence each.

    `ladder`, `pairs`, `observability`: tables of these names. Returns excess_median and excess_largest: percent by which
    cross-validation's choice leaves more than the best number of link springs; sets, worse, least and largest: of the ratios to
    the first set of points at equal measurements, worse those whose interval lies above one; best_index: the index whose
    correlation with the bound is most negative over the robots; condition: that of O2.
    """
    excess = []
    for _, cell in ladder.groupby(["robot", "noise_um", "length"]):
        chosen = cell.link_springs == CHOSEN
        excess.append(100 * (cell.rms_um[chosen].iloc[0] / cell.rms_um[~chosen].min() - 1))
    correlation = observability[observability["index"] != "bound"].groupby("index").rank_correlation_with_bound.mean()
    return {
        "excess_median": f"{np.median(excess):.0f}" if excess else "",
        "excess_largest": f"{max(excess):.0f}" if excess else "",
        "sets": str(len(pairs)),
        "worse": str(int((pairs.ratio_low > 1).sum())),
        "least": f"{pairs.ratio.min():.2f}" if len(pairs) else "",
        "largest": f"{pairs.ratio.max():.2f}" if len(pairs) else "",
        "best_index": str(correlation.idxmin()),
        "condition": f"{correlation['O2']:+.2f}",
    }


def _at(cell: pd.DataFrame, configurations: int) -> str:
    if configurations not in cell.index:
        return ""
    found: Any = cell.loc[configurations]
    return word_value(found.rms_um, found.std_error_um)


def _length(value: Any) -> str:
    return "more than all" if np.isinf(value) else f"{value:.0f}"


def _joints(joints: Sequence[int]) -> str:
    numbers = [joint + 1 for joint in joints]
    whole = numbers == list(range(numbers[0], numbers[-1] + 1)) and len(numbers) > 1
    return f"c{numbers[0]}–c{numbers[-1]}" if whole else ", ".join(f"c{number}" for number in numbers)
