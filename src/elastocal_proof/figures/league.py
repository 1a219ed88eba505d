"""Draw the figures of the benchmark: the errors of all methods on unseen poses, and the
effects of real robots."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import (
    FixedLocator,
    NullFormatter,
    NullLocator,
    StrMethodFormatter,
)

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.figures.style import PALETTE, create_panels, draw_note, save, styled
from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import read_frame, write_csv
from elastocal.io.origin import Origin
from elastocal.report.words import name_data_set, name_effect
from elastocal_proof.league.methods import RANDOM, Method
from elastocal_proof.league.schemas import ENTRIES, MECHANISMS
from elastocal_proof.league.table import (
    compare_methods,
    format_league_page,
    summarize_mechanisms,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SPLITS = {
    "random": "random poses",
    "blocks": "blocks of joint space",
    "session": "another session",
}
_MARKERS = "osD^vP*X"
_TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
# Vertical distance between the marks of two methods, in rows.
_MARK_DISTANCE = 0.1
# Area of a circle that stands for the whole error, in square points. The share has a
# lower bound, so that the smallest circle can be seen.
_WHOLE_AREA = 420.0
_MIN_DRAWN_SHARE = 0.004
# A smaller share is not written under its circle.
_MIN_WRITTEN_SHARE = 0.005
# A mechanism is drawn if its probability reaches this value in some data set.
_MIN_PROBABILITY = 0.5
_UNKNOWN = "not in the catalogue"


@styled
def draw_method_errors(table: pd.DataFrame, methods: Mapping[str, Method]) -> Figure:
    """Draw the RMS of every method relative to that of geometry alone.

    Each split has a panel, and each data set a row.
    """
    names = list(dict.fromkeys(table["data"]))
    splits = [split for split in _SPLITS if split in set(table["split"])]
    figure, axes = create_panels(1, len(splits), 30 + 11 * len(names), sharey=True)
    for axis, split in zip(axes[0], splits, strict=True):
        _draw_ratios(axis, table[table["split"] == split], names, methods)
        axis.set_title(_SPLITS[split])
    figure.supxlabel(
        "RMS error at held-out poses, divided by that of geometry alone"
        " (95 % intervals over poses)",
        fontsize=8,
    )
    labels = [_label_data_set(table, name) for name in names]
    axes[0, 0].set_yticks(range(len(names)), labels)
    axes[0, 0].set_ylim(len(names) - 0.5, -0.5)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3
    )
    return figure


def _draw_ratios(
    axis: Axes, table: pd.DataFrame, names: list[str], methods: Mapping[str, Method]
) -> None:
    """Draw ratios of RMS with their intervals, one row for each data set in `names`."""
    for number, (name, method) in enumerate(methods.items()):
        rows = table[table["method"] == name]
        offset = _MARK_DISTANCE * (number - 0.5 * (len(methods) - 1))
        ratio = rows["ratio"].to_numpy()
        axis.errorbar(
            ratio,
            np.array([names.index(data) for data in rows["data"]]) + offset,
            xerr=np.abs(rows[["ratio_low", "ratio_high"]].to_numpy().T - ratio),
            ls="none",
            ms=3.5,
            lw=1.0,
            label=method.words or name,
            color=PALETTE[number % len(PALETTE)],
            marker=_MARKERS[number % len(_MARKERS)],
        )
    axis.axvline(1.0, color="#4d4d4d", lw=0.8)
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(FixedLocator(_TICKS))
    axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.grid(axis="y", visible=False)
    for row in range(1, len(names)):
        axis.axhline(row - 0.5, color="#e4e4e4", lw=0.6)


@styled
def draw_mechanisms(table: pd.DataFrame) -> Figure:
    """Draw the mechanisms of each data set as circles.

    The area of a circle is the share of the error, its colour the probability.
    """
    strongest = table.groupby("mechanism")["probability"].transform("max")
    shown = table[strongest >= _MIN_PROBABILITY]
    if shown.empty:
        return draw_note(
            "No data set shows a mechanism of the catalogue with a probability of one"
            " half."
        )
    shares = shown.groupby("mechanism")["share"].sum().sort_values(ascending=False)
    mechanisms = list(shares.index)
    names = list(dict.fromkeys(table["data"]))
    figure, axes = create_panels(1, 1, 34 + 12 * len(mechanisms))
    axis = axes[0, 0]
    columns = [names.index(name) for name in shown["data"]]
    rows = [mechanisms.index(name) for name in shown["mechanism"]]
    areas = _WHOLE_AREA * np.clip(shown["share"].to_numpy(), _MIN_DRAWN_SHARE, 1.0)
    circles = axis.scatter(
        columns,
        rows,
        areas,
        shown["probability"],
        cmap="viridis_r",
        vmin=0.0,
        vmax=1.0,
        lw=0.4,
        ec="#4d4d4d",
        zorder=3,
    )
    for centre, share, area in zip(
        zip(columns, rows, strict=True), shown["share"], areas, strict=True
    ):
        if share >= _MIN_WRITTEN_SHARE:
            # Below its circle, so that no neighbour hides it.
            axis.annotate(
                f"{100 * share:.0f} %",
                centre,
                (0.0, -0.5 * float(np.sqrt(area)) - 1.0),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=7,
            )
    axis.set_xticks(
        range(len(names)),
        [name_data_set(name) for name in names],
        rotation=30,
        ha="right",
    )
    axis.set_yticks(
        range(len(mechanisms)),
        [_UNKNOWN if name == OTHER else name_effect(name) for name in mechanisms],
    )
    axis.set_xlim(-0.5, len(names) - 0.2)
    axis.set_ylim(len(mechanisms) - 0.5, -0.5)
    figure.colorbar(circles, ax=axis, label="probability (mean over folds)", shrink=0.8)
    figure.suptitle(
        "Circle: share of the squared residual of geometry alone, in units of the noise"
    )
    return figure


def _label_data_set(table: pd.DataFrame, name: str) -> str:
    """Name of a data set with its number of poses, if all of them were predicted."""
    label = name_data_set(name)
    poses = table.loc[(table["data"] == name) & (table["split"] == "random"), "poses"]
    return f"{label}\n{poses.iloc[0]} poses" if len(poses) else label


def tabulate_league(job: Any) -> None:
    """Write the benchmark as tables, a page and figures."""
    params = job.params
    output = job.output
    methods = {name: Method(**fields) for name, fields in params.methods.items()}
    entries = {
        tuple(key): read_frame(path, ENTRIES)
        for key, path in zip(params.entered, job.input.entries, strict=True)
    }
    diagnosed = [data for data, split in params.rounds if split == RANDOM]
    mechanisms_of = {
        data: read_frame(path, MECHANISMS)
        for data, path in zip(diagnosed, job.input.mechanisms, strict=True)
    }
    table = compare_methods(entries, params.robots, params.reference, params.seed)
    mechanisms = summarize_mechanisms(mechanisms_of, params.robots, params.folds)
    write_csv(output.league, table)
    write_csv(output.mechanisms, mechanisms)
    page = format_league_page(table, mechanisms, methods, params.missing)
    write_text(output.page, page)
    for name, file in params.missing.items():
        print(
            f"left out of the benchmark: {name}, because ELASTOCAL_DATA lacks {file}",
            file=sys.stderr,
        )
    errors = draw_method_errors(table, methods)
    circles = draw_mechanisms(mechanisms)
    origin = Origin(**job.config["origin"])
    save(errors, output.picture_pdf, output.picture_png, origin)
    save(circles, output.mechanisms_pdf, output.mechanisms_png, origin)
