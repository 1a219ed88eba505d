"""What the reports of the study show: rows of tables and numbers of its text, by
`study.txt`, from the tables of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.report.typesetting import render_sentences
from elastocal.study.ladder import CHOSEN
from elastocal.study.printed import SIGNIFICANCE_LEVEL
from elastocal.study.tables import (
    format_column_head,
    format_value,
    list_rows,
    merge_errors,
)
from elastocal.study.uses import METRICS, REFERENCE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.study.strategies import Strategy

# The repeatability that the paper names for both robots, in µm.
REPEATABILITY_UM = 60.0
# Designs in the order of the tables.
_DESIGNS = ("random", "D", "A", "I")
# Beyond so many configurations nothing is known of a length.
_LONGEST = 1000
_CONTINUED = "†"


def shorten_titles(titles: Mapping[str, str]) -> dict[str, str]:
    """Names for cells of tables: the first words of each title that distinguish it from
    others.

    A title that continues another one, as that of a robot with elastic links, keeps
    what it adds.
    """
    found = {}
    for robot, title in titles.items():
        base = min(
            (other for other in titles.values() if title.startswith(other)), key=len
        )
        words = base.split()
        others = [
            other.split() for other in titles.values() if not other.startswith(base)
        ]
        count = next(
            (
                n
                for n in range(1, len(words))
                if words[:n] not in [other[:n] for other in others]
            ),
            len(words),
        )
        found[robot] = " ".join(words[:count]) + title.removeprefix(base)
    return found


def collect_study_facts(
    tables: Mapping[str, pd.DataFrame],
    names: Mapping[str, str],
    robots: Sequence[str],
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    """Facts for the report of the study.

    `tables`: of the study, by the names that its rules give them. `names`: of all
    robots in cells of tables, by their keys. `robots`: keys of those without links.
    `settings`: ``noise_um``, ``length`` and ``configurations`` of the tables,
    ``classical`` and ``best`` strategy, all ``strategies``, ``accuracy_um``, and
    ``stated``, numbers of the configuration. Returns rows and paragraphs of `study.txt`
    under its headings, strings ready to print.
    """
    length = settings["length"]
    titles = [names[robot] for robot in robots]
    accuracy = settings["accuracy_um"]
    of = {
        name: frame.assign(robot=frame.robot.map(names)) if "robot" in frame else frame
        for name, frame in tables.items()
    }
    judged = of["comparison"][of["comparison"].p_holm.notna()]
    pairs = of["score_pairs"]
    of |= {
        "outside": judged[judged.p_value < SIGNIFICANCE_LEVEL],
        "printed": of["comparison"][of["comparison"].table == "2"],
        "turned": pairs[pairs.reversed & (pairs.metric != REFERENCE)].assign(
            size=lambda frame: (frame.ratio / frame.rms_ratio).abs()
        ),
    }
    of |= {
        name: of[name][of[name].accuracy_um == accuracy]
        for name in ("break_even", "needed")
    }

    def each(table: str, *columns: str) -> list[tuple[Any, ...]]:
        """Distinct values of columns of a table, in its order."""
        return list(
            dict.fromkeys(of[table][[*columns]].itertuples(index=False, name=None))
        )

    def at(table: str, **keys: Any) -> dict[str, Any] | None:
        """The first row of a table with these values."""
        found = of[table][
            np.logical_and.reduce(
                [of[table][name] == value for name, value in keys.items()]
            )
        ]
        return next(iter(_records(found)), None)

    facts = {
        "titles": titles,
        "classical": settings["classical"],
        "metric_count": len(METRICS),
        "repeatability_um": f"{REPEATABILITY_UM:g}",
        **{
            name: f"{settings[name]:g}"
            for name in ("noise_um", "length", "accuracy_um")
        },
        "stated": {name: f"{value:g}" for name, value in settings["stated"].items()},
        "cells": str(len(judged)),
        "differ": str(int((judged.p_holm < SIGNIFICANCE_LEVEL).sum())),
        "studies": str(int(of["joint"].studies.max())),
        "extended": merge_errors(of["extended"].drop(columns="robot"))
        .to_numpy()
        .tolist(),
        "strategies": [_stages(strategy) for strategy in settings["strategies"]],
    }
    helpers = {
        "format_value": format_value,
        "format_column_head": format_column_head,
        "format_ratio": format_ratio,
        "each": each,
        "at": at,
    }
    constants = {
        "infinity": np.inf,
        "metrics": METRICS,
        "chosen": CHOSEN,
        "designs": _DESIGNS,
        "reference": REFERENCE,
    }
    chosen = {
        "titles": titles,
        "size": length,
        "accuracy": accuracy,
        "favoured": settings["best"],
    }
    more = {
        "measured": _measured(of["studies"], settings["configurations"]),
        "figures": _figures(of["studies"]),
        "t": {name: _records(frame) for name, frame in of.items()},
    }
    return (
        render_sentences(
            "study.txt",
            classical=settings["classical"],
            **helpers,
            **constants,
            **chosen,
            **more,
        )
        | facts
    )


def format_paper_rows(
    beside: pd.DataFrame, names: Mapping[str, str], configurations: int
) -> list[dict[str, str]]:
    """Each figure that the paper prints beside ours, in words.

    `beside`: by `comparison.beside_paper`. `names`: of the robots by their keys.
    `configurations`: in a data set. Of ours stands the Monte Carlo standard deviation
    of a study of this size behind ±.
    """
    return [
        {
            "table": row["table"],
            "robot": names.get(row["robot"], ""),
            "strategy": row["strategy"] if isinstance(row["strategy"], str) else "",
            "quantity": format_column_head(row["quantity"]),
            "paper": f"{row['paper']:g}",
            "ours": "not studied"
            if np.isnan(row["ours"])
            else _continued(
                row["quantity"], row["ours"], row["mc_std"], configurations
            ),
        }
        for row in _records(beside)
    ]


def format_paper_tables(
    frames: Mapping[str, pd.DataFrame], names: Mapping[str, str], configurations: int
) -> dict[str, Any]:
    """The paper's tables of one study as rows of cells, heads first; lengths beyond a
    data set are marked."""
    found = {}
    for name, frame in frames.items():
        lengths = [
            column
            for column in map(str, frame)
            if column.startswith("n_") and not column.endswith("_std_error")
        ]
        beyond = {
            format_column_head(column): frame[column].between(
                configurations, np.inf, "neither"
            )
            for column in lengths
        }
        heads, *rows = list_rows(
            frame.assign(robot=frame.robot.map(names)) if "robot" in frame else frame
        )
        marks = [
            [
                _CONTINUED if head in beyond and beyond[head].iloc[row] else ""
                for head in heads
            ]
            for row in range(len(rows))
        ]
        found[name] = [
            heads,
            *(
                [f"{cell}{mark}" for cell, mark in zip(*each, strict=True)]
                for each in zip(rows, marks, strict=True)
            ),
        ]
    return found


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    rows: list[Any] = frame.to_dict("records")
    return rows


def format_ratio(row: Mapping[str, Any]) -> str:
    """A ratio of a row with its interval."""
    return f"{row['ratio']:.3f} ({row['ratio_low']:.3f} to {row['ratio_high']:.3f})"


def _continued(
    quantity: str,
    value: float,
    error: float,
    configurations: int,
    longest: float = np.inf,
) -> str:
    """A score with its error; a length beyond a data set, where the curve is continued
    as 1/n, is marked."""
    if not quantity.startswith("n_"):
        return format_value(value, error)
    if np.isfinite(longest) and value >= longest:
        return f"over {longest:g}{_CONTINUED}"
    text = (
        f"{value:.0f} ± {error:.0f}"
        if np.isfinite(longest)
        else format_value(value, error)
    )
    return text + (_CONTINUED if np.isfinite(value) and value > configurations else "")


def _measured(table: pd.DataFrame, configurations: int) -> list[dict[str, Any]]:
    """Table 4 over studies, a row for each estimator on each robot.

    Returns robot, strategy and the four figures of Table 4 by what is averaged, those
    of k_sigma over the fixed joints under "fixed".
    """
    rows = []
    seen = set()
    figures = _figures(table)[:4]
    fixed = [name.replace("k_sigma_", "k_sigma_fixed_joints_") for name in figures[:2]]
    for (robot, strategy), cells in table.groupby(["robot", "strategy"], sort=False):
        by = {row["average"]: row for row in _records(cells)}
        usual = by["stiffness"]
        # One estimator under another name; the fixed joints of its last stage are
        # fewer, perhaps.
        key = (robot, f"{usual[figures[2]]:.6g}")
        if key in seen and usual[fixed[0]] == usual[figures[0]]:
            continue
        seen.add(key)

        def cell(row: Mapping[str, Any], name: str) -> str:
            return _continued(
                name, row[name], row[f"{name}_std"], configurations, _LONGEST
            )

        found = {
            average: [cell(row, name) for name in figures]
            for average, row in by.items()
        }
        rows.append(
            {
                "robot": robot,
                "strategy": strategy,
                **found,
                "fixed": [cell(usual, name) for name in fixed],
            }
        )
    return rows


def _figures(table: pd.DataFrame) -> list[str]:
    """The four figures of Table 4 and the RMS error by their columns, whatever length
    and limits they have."""
    names = [
        name
        for name in table.columns
        if not name.endswith("_std") and "fixed_joints" not in name
    ]
    starts = ("k_sigma_", "n_k_sigma_", "dev_", "n_dev_", "rms_")
    return [next(name for name in names if name.startswith(start)) for start in starts]


def _stages(strategy: Strategy) -> list[str]:
    """What a strategy does, stage by stage: its name, and points measured → compliances
    identified."""

    def springs(joints: Sequence[int]) -> str:
        whole = len(joints) > 1 and [*joints] == [*range(joints[0], joints[-1] + 1)]
        return (
            f"c{joints[0] + 1}–c{joints[-1] + 1}"
            if whole
            else ", ".join(f"c{joint + 1}" for joint in joints)
        )

    stages = [
        f"{' and '.join(stage.points)} → {springs(stage.identified)}"
        + (f", {springs(stage.fixed)} fixed" if stage.fixed else "")
        for stage in strategy.stages
    ]
    return [strategy.name, "; then ".join(stages)]
