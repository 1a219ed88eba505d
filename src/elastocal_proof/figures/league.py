"""Pictures of the league: who predicts unseen poses best, and which effects real robots
have."""

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
from elastocal.report.words import name_effect
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
    from matplotlib.figure import Figure

_SPLITS = {
    "random": "random poses",
    "blocks": "blocks of joint space",
    "session": "another session",
}
_MARKERS = "osD^vP*X"
_TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
# Area of a circle that stands for the whole error, in square points.
_WHOLE = 420.0
# Mechanisms that no data set makes more probable than this are left out.
_LEAST_PROBABLE = 0.5
_UNKNOWN = "not in the catalogue"


@styled
def draw_method_errors(table: pd.DataFrame, methods: Mapping[str, Method]) -> Figure:
    """RMS of every method over that of geometry alone, a panel for each split, a row
    for each data set."""
    names = list(dict.fromkeys(table["data"]))
    splits = [split for split in _SPLITS if split in set(table["split"])]
    figure, axes = create_panels(1, len(splits), 30 + 11 * len(names), sharey=True)
    for axis, split in zip(axes[0], splits, strict=True):
        for number, (method, described) in enumerate(methods.items()):
            mine = table[(table["split"] == split) & (table["method"] == method)]
            place = np.array([names.index(name) for name in mine["data"]]) + 0.1 * (
                number - 0.5 * (len(methods) - 1)
            )
            ratio = mine["ratio"].to_numpy()
            limits = np.abs(mine[["ratio_low", "ratio_high"]].to_numpy().T - ratio)
            style = {
                "color": PALETTE[number % len(PALETTE)],
                "marker": _MARKERS[number % len(_MARKERS)],
            }
            axis.errorbar(
                ratio,
                place,
                xerr=limits,
                ls="none",
                ms=3.5,
                lw=1.0,
                label=described.words or method,
                **style,
            )
        axis.axvline(1.0, color="#4d4d4d", lw=0.8)
        axis.set_xscale("log")
        axis.xaxis.set_major_locator(FixedLocator(_TICKS))
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.grid(axis="y", visible=False)
        for line in range(1, len(names)):
            axis.axhline(line - 0.5, color="#e4e4e4", lw=0.6)
        axis.set_title(_SPLITS[split])
    figure.supxlabel(
        "RMS error on poses not seen, over that of geometry alone (95 % intervals over poses)",
        fontsize=8,
    )
    axes[0, 0].set_yticks(
        range(len(names)), [_with_size(table, name) for name in names]
    )
    axes[0, 0].set_ylim(len(names) - 0.5, -0.5)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


@styled
def draw_mechanisms(table: pd.DataFrame) -> Figure:
    """Mechanisms by data set: the area of a circle is the share of the error, its
    colour the probability."""
    strongest = table.groupby("mechanism")["probability"].max()
    kept = [name for name in strongest.index if strongest[name] >= _LEAST_PROBABLE]
    if not kept:
        return draw_note(
            "No data set shows a mechanism of the catalogue with a probability of one half."
        )
    order = (
        table[table["mechanism"].isin(kept)]
        .groupby("mechanism")["share"]
        .sum()
        .sort_values(ascending=False)
        .index
    )
    names = list(dict.fromkeys(table["data"]))
    figure, axes = create_panels(1, 1, 34 + 12 * len(order))
    axis = axes[0, 0]
    shown = table[table["mechanism"].isin(kept)]
    across = [names.index(name) for name in shown["data"]]
    down = [order.get_loc(name) for name in shown["mechanism"]]
    area = _WHOLE * np.clip(shown["share"].to_numpy(), 0.004, 1.0)
    drawn = axis.scatter(
        across,
        down,
        area,
        shown["probability"],
        cmap="viridis_r",
        vmin=0.0,
        vmax=1.0,
        lw=0.4,
        ec="#4d4d4d",
        zorder=3,
    )
    for x, y, share, size in zip(across, down, shown["share"], area, strict=True):
        if share >= 0.005:
            # Below its circle, where no neighbour hides it.
            place = (0.0, -0.5 * float(np.sqrt(size)) - 1.0)
            words = f"{100 * share:.0f} %"
            axis.annotate(
                words,
                (x, y),
                place,
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=7,
            )
    axis.set_xticks(
        range(len(names)),
        [name.replace("_", " ") for name in names],
        rotation=30,
        ha="right",
    )
    axis.set_yticks(
        range(len(order)),
        [_UNKNOWN if name == OTHER else name_effect(name) for name in order],
    )
    axis.set_xlim(-0.5, len(names) - 0.2)
    axis.set_ylim(len(order) - 0.5, -0.5)
    figure.colorbar(drawn, ax=axis, label="probability (mean over folds)", shrink=0.8)
    axis.set_title(
        "Circle: share of the squared error that geometry leaves, in units of the noise"
    )
    return figure


def _with_size(table: pd.DataFrame, name: str) -> str:
    poses = table.loc[(table["data"] == name) & (table["split"] == "random"), "poses"]
    return (
        f"{name.replace('_', ' ')}\n{poses.iloc[0]} poses"
        if len(poses)
        else name.replace("_", " ")
    )


def tabulate_league(job: Any) -> None:
    """The league as tables, a page and pictures: errors, and which mechanisms real
    robots have."""
    asked = job.params
    output = job.output
    origin = Origin(**job.config["origin"])
    methods = {name: Method(**described) for name, described in asked.methods.items()}
    keys = [tuple(key) for key in asked.entered]
    entries = {
        key: read_frame(path, ENTRIES)
        for key, path in zip(keys, job.input.entries, strict=True)
    }
    random = [data for data, split in asked.rounds if split == RANDOM]
    found = {
        data: read_frame(path, MECHANISMS)
        for data, path in zip(random, job.input.mechanisms, strict=True)
    }
    table = compare_methods(entries, asked.robots, asked.reference, asked.seed)
    mechanisms = summarize_mechanisms(found, asked.robots, asked.folds)
    for path, one in ((output.league, table), (output.mechanisms, mechanisms)):
        write_csv(path, one)
    page = format_league_page(table, mechanisms, methods, asked.missing)
    write_text(output.page, page)
    for name, file in asked.missing.items():
        print(
            f"left out of the league: {name}, as {file} is missing in ELASTOCAL_DATA",
            file=sys.stderr,
        )
    save(
        draw_method_errors(table, methods),
        output.picture_pdf,
        output.picture_png,
        origin,
    )
    save(
        draw_mechanisms(mechanisms),
        output.mechanisms_pdf,
        output.mechanisms_png,
        origin,
    )
