"""Facts that the reports of the study show: rows of tables and numbers of its text, by
`study.txt`, from the tables of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.report.typesetting import render_sentences
from elastocal.study.joint_test import SIGNIFICANCE_LEVEL
from elastocal.study.ladder import CHOSEN
from elastocal.study.tables import (
    format_column_head,
    format_value,
    list_rows,
    merge_errors,
)
from elastocal.study.uses import METRICS, REFERENCE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.io.data_frames import Frames
    from elastocal.io.storage import Row
    from elastocal.study.strategies import Strategy

# Repeatability that the paper states for both robots.
REPEATABILITY_UM = 60.0
# Designs in the order of the tables.
_DESIGNS = ("random", "D", "A", "I")
# Extrapolated lengths above this one are not stated.
_LONGEST_STATED = 1000
# Mark of a length beyond a data set.
_EXTRAPOLATED = "†"


def shorten_titles(titles: Mapping[str, str]) -> dict[str, str]:
    """Shorten titles for cells of tables to the first words that distinguish them.

    A title that continues another one, such as that of a robot with elastic links, keeps
    its addition.
    """
    names = {}
    for robot, title in titles.items():
        base = min(filter(title.startswith, titles.values()), key=len)
        alternatives = [
            alternative
            for alternative in titles.values()
            if not alternative.startswith(base)
        ]
        names[robot] = _shorten_title(base, alternatives) + title.removeprefix(base)
    return names


def _shorten_title(title: str, alternatives: Sequence[str]) -> str:
    """The fewest first words of a title with which no alternative begins."""
    parts = title.split()
    for count in range(1, len(parts)):
        beginning = parts[:count]
        if all(
            alternative.split()[:count] != beginning for alternative in alternatives
        ):
            return " ".join(beginning)
    return " ".join(parts)


class _Tables:
    """The tables of a run, as the template of the report queries them.

    Attributes
    ----------
    frames
        Tables with the robots' names for cells.
    records
        The same as lists of rows.
    """

    def __init__(self, frames: Frames) -> None:
        self.frames = frames
        self.records = {name: _list_records(frame) for name, frame in frames.items()}

    def list_distinct(self, table: str, *columns: str) -> list[tuple[Any, ...]]:
        """Distinct values of columns of a table, in its order."""
        rows = self.frames[table][[*columns]].itertuples(index=False, name=None)
        return list(dict.fromkeys(rows))

    def find_row(self, table: str, **values: Any) -> dict[str, Any] | None:
        """The first row of a table with these values."""
        frame = self.frames[table]
        matches = [frame[name] == value for name, value in values.items()]
        selected = frame[np.logical_and.reduce(matches)]
        return next(iter(_list_records(selected)), None)


def collect_study_facts(
    tables: Frames,
    names: Mapping[str, str],
    robots: Sequence[str],
    settings: Row,
) -> dict[str, Any]:
    """Collect the facts for the report of the study.

    Parameters
    ----------
    tables
        Of the study, by the names that its rules give them.
    names
        Names of all robots for cells of tables, by their keys.
    robots
        Keys of the robots without links.
    settings
        ``noise_um``, ``length`` and ``configurations`` of the tables, ``classical`` and
        ``best`` strategy, all ``strategies``, ``accuracy_um``, and ``stated``, numbers of
        the configuration.

    Returns
    -------
    dict
        Rows and paragraphs of `study.txt` under its headings, and strings ready to
        print.
    """
    queried = _Tables(_prepare_frames(tables, names, settings["accuracy_um"]))
    frames = queried.frames
    titles = [names[robot] for robot in robots]
    judged = frames["judged"]
    studies = frames["studies"]
    stated = {name: f"{value:g}" for name, value in settings["stated"].items()}
    extended = merge_errors(frames["extended"].drop(columns="robot"))
    sentences = render_sentences(
        "study.txt",
        format_value=format_value,
        format_column_head=format_column_head,
        format_ratio=format_ratio,
        list_distinct=queried.list_distinct,
        find_row=queried.find_row,
        tables=queried.records,
        infinity=np.inf,
        metrics=METRICS,
        chosen=CHOSEN,
        designs=_DESIGNS,
        reference=REFERENCE,
        titles=titles,
        size=settings["length"],
        accuracy=settings["accuracy_um"],
        classical=settings["classical"],
        favoured=settings["best"],
        estimators=_list_estimators(studies, settings["configurations"]),
        quantities=_find_table4_quantities(studies),
    )
    return {
        **sentences,
        "titles": titles,
        "classical": settings["classical"],
        "metric_count": len(METRICS),
        "repeatability_um": f"{REPEATABILITY_UM:g}",
        "noise_um": f"{settings['noise_um']:g}",
        "length": f"{settings['length']:g}",
        "accuracy_um": f"{settings['accuracy_um']:g}",
        "stated": stated,
        "cells": str(len(judged)),
        "differ": str(int((judged.p_corrected < SIGNIFICANCE_LEVEL).sum())),
        "studies": str(int(frames["joint"].studies.max())),
        "rejected": _is_rejected(frames["joint"]),
        "estimators_count": str(_count_estimators(frames["scores"])),
        "extended": extended.to_numpy().tolist(),
        "strategies": list(map(_describe_strategy, settings["strategies"])),
    }


def _prepare_frames(
    tables: Frames, names: Mapping[str, str], accuracy_um: float
) -> dict[str, pd.DataFrame]:
    """Name the robots in the tables, and add the selections that the report shows."""
    frames = {name: _name_robots(frame, names) for name, frame in tables.items()}
    comparison = frames["comparison"]
    judged = comparison[comparison.p_corrected.notna()]
    pairs = frames["score_pairs"]
    turned = pairs[pairs.reversed & (pairs.metric != REFERENCE)]
    size = (turned.ratio / turned.rms_ratio).abs()
    for name in ("break_even", "needed"):
        frame = frames[name]
        frames[name] = frame[frame.accuracy_um == accuracy_um]
    return frames | {
        "judged": judged,
        "outside": judged[judged.p_value < SIGNIFICANCE_LEVEL].sort_values(
            "p_corrected"
        ),
        "detectable": _summarize_detectable(judged),
        "printed": comparison[comparison.table == "2"],
        "turned": turned.assign(size=size),
    }


def _is_rejected(joint: pd.DataFrame) -> str:
    """Whether either joint test over the joints fixed in the last stage rejects."""
    first = joint.iloc[0]
    p_values = first[["largest_distance_p", "below_p"]].astype(float)
    return "yes" if (p_values < SIGNIFICANCE_LEVEL).any() else "no"


def _count_estimators(scores: pd.DataFrame) -> int:
    """Number of different estimators: strategies with different errors of one data set on
    the first robot."""
    rows = scores[(scores.robot == scores.robot.iloc[0]) & (scores.metric == REFERENCE)]
    return len({f"{value:.6g}" for value in rows.value})


def _summarize_detectable(judged: pd.DataFrame) -> pd.DataFrame:
    """Smallest differences that a figure alone and the family can detect, as shares
    of the studies' median: the median over the figures of each quantity."""
    median = judged.studies_median
    shares = pd.DataFrame(
        {
            "quantity": judged.quantity.where(
                ~judged.quantity.str.fullmatch(r"c\d+"), "compliances of Table 3"
            ),
            "low": 1 - judged.studies_low / median,
            "high": judged.studies_high / median - 1,
            "family_low": 1 - judged.unseen_low / median,
            "family_high": judged.unseen_high / median - 1,
        }
    )
    groups = shares.groupby("quantity", sort=False)
    return groups.median().join(groups.size().rename("figures")).reset_index()


def _name_robots(frame: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Replace the keys of robots by their names, in a table with robots."""
    if "robot" not in frame:
        return frame
    return frame.assign(robot=frame.robot.map(names))


def format_paper_rows(
    compared: pd.DataFrame, names: Mapping[str, str], configurations: int
) -> list[dict[str, str]]:
    """Format each figure that the paper prints next to ours, in words.

    Parameters
    ----------
    compared
        From `printed.compare_figures`.
    names
        Names of the robots by their keys.
    configurations : int
        In a data set.

    Returns
    -------
    list of dict
        Our value is followed by ± and the Monte Carlo standard deviation of a study of
        this size.
    """
    rows = []
    for row in _list_records(compared):
        ours = "not studied"
        if not np.isnan(row["ours"]):
            ours = _format_score(
                row["quantity"], row["ours"], row["mc_std"], configurations
            )
        rows.append(
            {
                "table": row["table"],
                "robot": names.get(row["robot"], ""),
                "strategy": row["strategy"] if isinstance(row["strategy"], str) else "",
                "quantity": format_column_head(row["quantity"]),
                "paper": f"{row['paper']:g}",
                "ours": ours,
            }
        )
    return rows


def format_pooled_deflections(table2: pd.DataFrame, names: Mapping[str, str]) -> str:
    """Format the deflections before calibration over all configurations of all data sets,
    mm, robot by robot."""
    return "; ".join(
        f"{names[row['robot']]} mean {row['mean_mm']:.3f}, std {row['std_mm']:.3f}, "
        f"max {row['max_mm']:.2f} mm"
        for row in _list_records(table2)
    )


def format_paper_tables(
    frames: Frames, names: Mapping[str, str], configurations: int
) -> dict[str, list[list[str]]]:
    """Format the paper's tables of one study as rows of cells, heads first.

    Lengths beyond a data set are marked.
    """
    tables = {}
    for name, frame in frames.items():
        rows = list_rows(_name_robots(frame, names))
        heads = rows[0]
        for column in map(str, frame):
            if column.startswith("n_") and not column.endswith("_std_error"):
                beyond = frame[column].between(configurations, np.inf, "neither")
                index = heads.index(format_column_head(column))
                for row in np.flatnonzero(beyond):
                    rows[1 + row][index] += _EXTRAPOLATED
        tables[name] = rows
    return tables


def _list_records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    rows: list[Any] = frame.to_dict("records")
    return rows


def format_ratio(row: Row) -> str:
    """Format a row's ratio with its interval."""
    return f"{row['ratio']:.3f} ({row['ratio_low']:.3f} to {row['ratio_high']:.3f})"


def _format_score(
    quantity: str, value: float, error: float, configurations: int
) -> str:
    """Format a score with its error; a length beyond a data set, where the curve is
    extrapolated as 1/n, is marked."""
    text = format_value(value, error)
    is_extrapolated = np.isfinite(value) and value > configurations
    if quantity.startswith("n_") and is_extrapolated:
        return text + _EXTRAPOLATED
    return text


def _format_median(row: Row, name: str, configurations: int) -> str:
    """Format a median over studies with its robust deviation.

    Lengths are whole numbers, marked beyond a data set; long ones are not stated.
    """
    value = row[name]
    error = row[f"{name}_std"]
    if not name.startswith("n_"):
        return format_value(value, error)
    if value >= _LONGEST_STATED:
        return f"over {_LONGEST_STATED:g}{_EXTRAPOLATED}"
    mark = _EXTRAPOLATED if value > configurations else ""
    return f"{value:.0f} ± {error:.0f}{mark}"


def _list_estimators(table: pd.DataFrame, configurations: int) -> list[dict[str, Any]]:
    """Rows of Table 4 over studies, one for each estimator on each robot.

    Returns
    -------
    list of dict
        robot, strategy, and the four quantities of Table 4 by what is averaged; those of
        k_sigma over the fixed joints under "fixed".
    """
    rows = []
    listed: dict[tuple[str, str], str] = {}
    quantities = _find_table4_quantities(table)[:4]
    k_sigma, _, deviation, _ = quantities
    fixed = [
        name.replace("k_sigma_", "k_sigma_fixed_joints_") for name in quantities[:2]
    ]
    for (robot, strategy), cells in table.groupby(["robot", "strategy"], sort=False):
        by_average = {row["average"]: row for row in _list_records(cells)}
        usual = by_average["stiffness"]
        # Leave out an estimator that is listed under another name, unless the joints
        # fixed in its last stage are fewer.
        key = (str(robot), f"{usual[deviation]:.6g}")
        name = str(strategy)
        first = listed.setdefault(key, name)
        if first != name:
            if usual[fixed[0]] == usual[k_sigma]:
                continue
            name = f"{name} (estimator: {first})"
        rows.append(
            {
                "robot": robot,
                "strategy": name,
                "fixed": _format_medians(usual, fixed, configurations),
                **_format_by_average(by_average, quantities, configurations),
            }
        )
    return rows


def _format_by_average(
    by_average: Mapping[str, Mapping[str, Any]],
    quantities: Sequence[str],
    configurations: int,
) -> dict[str, Any]:
    """Format the quantities of an estimator by what is averaged."""
    return {
        average: _format_medians(row, quantities, configurations)
        for average, row in by_average.items()
    }


def _format_medians(row: Row, names: Sequence[str], configurations: int) -> list[str]:
    """Format several medians of a row, see `_format_median`."""
    return [_format_median(row, name, configurations) for name in names]


def _find_table4_quantities(table: pd.DataFrame) -> list[str]:
    """Columns of the four quantities of Table 4 and the RMS error, for any length and
    limits."""
    names = [
        name
        for name in table.columns
        if not name.endswith("_std") and "fixed_joints" not in name
    ]
    quantities = []
    for start in ("k_sigma_", "n_k_sigma_", "dev_", "n_dev_", "rms_"):
        quantities.append(next(name for name in names if name.startswith(start)))
    return quantities


def _describe_strategy(strategy: Strategy) -> list[str]:
    """Name of a strategy, and its stages: points measured → compliances identified."""
    stages = []
    for stage in strategy.stages:
        points = " and ".join(stage.points)
        fixed = f", {_name_compliances(stage.fixed)} fixed" if stage.fixed else ""
        stages.append(f"{points} → {_name_compliances(stage.identified)}{fixed}")
    return [strategy.name, "; then ".join(stages)]


def _name_compliances(joints: Sequence[int]) -> str:
    """Names of the compliances of joints, as a range if they are consecutive."""
    names = [f"c{joint + 1}" for joint in joints]
    if len(joints) > 1 and [*joints] == [*range(joints[0], joints[-1] + 1)]:
        return f"{names[0]}–{names[-1]}"
    return ", ".join(names)
