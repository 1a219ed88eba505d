"""What may be missing in a model: probabilities of hypotheses, candidates one by one, and which of them contribute alike."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from elastocal.effects.protocol import at_shapes
from elastocal.figures.style import PALETTE, ink_on, note, panels, styled
from elastocal.report.words import candidate_words, hypotheses_words

FAMILIES = dict(zip(("geometry", "gravity", "transmission", "elastic", "gearbox", "load", "drift"), PALETTE, strict=False))
# Hypotheses and candidates with a bar of their own.
_HYPOTHESES, _NAMED = 8, 15
_LEADING = 16
_LINE = 44
_REST_COLOUR = "#d9d9d9"
# Why nothing is tested where the data are at fault, as tables.candidate_columns notes it.
_AT_FAULT = "the measurements are at fault"


@styled
def probabilities(stated: Mapping[str, Any] | None, table: Mapping[str, np.ndarray]) -> Figure:
    """Posterior probabilities of the leading hypotheses, and Bayes factors of the leading candidates alone.

    `stated`: ``probabilities`` of a diagnosis; None where the data are at fault. `table`: columns of the candidates table.
    """
    order = rank_candidates(table)
    if stated is None or not len(order):
        return _note_nothing_tested(table)
    sets = stated["sets"][:_HYPOTHESES]
    labels = [textwrap.fill(_capital(words), _LINE) for words in hypotheses_words(sets)]
    values = [entry["probability"] for entry in sets]
    rest = 1.0 - sum(values)
    if rest > 0.001:
        labels, values = [*labels, "Everything else"], [*values, rest]
    named = order[:_NAMED]
    # Rows as high as their names are long.
    heights = np.array([0.75 + 0.65 * (label.count("\n") + 1) for label in labels])
    height_mm = 34 + 3.6 * heights.sum(), 22 + _row_mm(table["candidate"][named]) * len(named)
    figure, axes = panels(2, 1, sum(height_mm), height_ratios=height_mm)
    _bars(axes[0, 0], np.cumsum(heights) - heights / 2, heights.sum(), labels, values)
    _factors(axes[1, 0], table, named)
    present = [family for family in FAMILIES if family in set(table["family"][named])]
    handles = [Patch(color=FAMILIES[family], label=family) for family in present]
    if table["chosen"].any():
        handles.append(Patch(facecolor="none", edgecolor="black", linewidth=1.3, label="in the most probable model"))
    untestable = len(set(table["candidate"])) - len(order)
    words = f"{len(order)} candidate causes tested; {untestable} more cannot be tested with these measurements"
    figure.legend(handles=handles, title=words, loc="outside lower center", ncols=4)
    return figure


def _bars(axis: Axes, rows: np.ndarray, end: float, labels: Sequence[str], values: Sequence[float]) -> None:
    """Probabilities of hypotheses in percent."""
    colours = [_REST_COLOUR if label == "Everything else" else PALETTE[0] for label in labels]
    axis.barh(rows, 100 * np.array(values), height=0.9, color=colours, zorder=2)
    for row, value in zip(rows, values, strict=True):
        text = "<1 %" if value < 0.005 else ">99 %" if value >= 0.995 else f"{100 * value:.0f} %"
        axis.annotate(text, (100 * value, row), (3, 0), textcoords="offset points", va="center", fontsize=7.5)
    axis.set(yticks=rows, ylim=(end, 0), xlim=(0, 112), xticks=range(0, 101, 20), xlabel="posterior probability (%)")
    axis.set_yticklabels(labels, fontsize=7)
    axis.set_title("What is missing in the declared model", loc="left")
    axis.grid(visible=False, axis="y")


def _factors(axis: Axes, table: Mapping[str, np.ndarray], named: np.ndarray) -> None:
    """Bayes factors of single candidates, coloured by family."""
    factors, rows = table["log_bayes_factor"][named], np.arange(len(named))
    axis.barh(
        rows, factors, color=[FAMILIES.get(family, PALETTE[-1]) for family in table["family"][named]], height=0.62, zorder=2
    )
    chosen = table["chosen"][named].astype(bool)
    if chosen.any():
        style: dict[str, Any] = {"facecolor": "none", "edgecolor": "black", "linewidth": 1.3, "zorder": 3, "gid": "chosen"}
        axis.barh(rows[chosen], factors[chosen], height=0.62, **style)
    axis.set_xscale("function", functions=(_root, _square))
    low, high = min(factors.min(), 0.0), max(factors.max(), 2.0)
    axis.set(yticks=rows, ylim=(len(named) - 0.4, -0.6), xlim=(_square(1.04 * _root(low)), 1.06 * high))
    axis.set_xticks(_ticks(low, high))
    axis.set_xlabel("Bayes factor against the declared model\n(natural logarithm; above 0 it explains more)")
    axis.axvline(0, color="black", linewidth=0.8, zorder=4)
    axis.set_yticklabels([short_name(table["candidate"][index]) for index in named], fontsize=7, linespacing=0.9)
    axis.set_title("Each candidate cause alone", loc="left")
    axis.grid(visible=False, axis="y")


@styled
def confounding(table: Mapping[str, np.ndarray], pairs: Mapping[str, np.ndarray]) -> Figure:
    """Angles between the contributions of the leading candidates beyond the declared model.

    `table`: columns of the candidates table. `pairs`: columns of the confounding table.
    """
    known = set(pairs["one"]) | set(pairs["other"])
    order = [index for index in rank_candidates(table) if name_in_pairs(table, index) in known]
    shown = shortlist(order, table["chosen"])
    if not shown:
        return _note_nothing_tested(table)
    names = [table["candidate"][index] for index in shown]
    chosen = set(table["candidate"][table["chosen"].astype(bool)])
    angles = angle_matrix([name_in_pairs(table, index) for index in shown], pairs)
    count = len(names)
    figure, axes = panels(1, 1, 18 + _row_mm(names) * max(count, 6))
    axis = axes[0, 0]
    # Never black, so that the numbers can be read everywhere.
    colours = LinearSegmentedColormap.from_list("angles", ["#08306b", "#4292c6", "#c6dbef", "#ffffff"])
    image = axis.imshow(np.ma.masked_invalid(angles), cmap=colours, vmin=0, vmax=90, interpolation="nearest", aspect="auto")
    for row in range(count):
        for column in range(count):
            if row != column and np.isfinite(angles[row, column]):
                ink = ink_on(colours(angles[row, column] / 90))
                axis.text(column, row, f"{angles[row, column]:.0f}", ha="center", va="center", fontsize=7, color=ink)
    numbered = [f"{short_name(name)}  {number}" for number, name in enumerate(names, 1)]
    axis.set(xticks=range(count), yticks=range(count))
    axis.set_xticklabels(range(1, count + 1), fontsize=7)
    axis.set_yticklabels(numbered, fontsize=7, linespacing=0.9)
    axis.tick_params(length=0)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    for number, name in enumerate(names):
        if name in chosen:
            axis.get_yticklabels()[number].set(fontweight="bold", color=PALETTE[1])
            frame = Rectangle((-0.5, number - 0.5), count, 1, fill=False, edgecolor=PALETTE[1], linewidth=1.4, zorder=4)
            axis.add_patch(frame)
    bar = figure.colorbar(image, ax=axis, ticks=[0, 20, 45, 70, 90])
    bar.set_label("angle between the contributions (°)")
    if chosen & set(names):
        handle = Patch(facecolor="none", edgecolor=PALETTE[1], linewidth=1.4, label="in the most probable model")
        figure.legend(handles=[handle], loc="outside lower center")
    return figure


def rank_candidates(table: Mapping[str, np.ndarray]) -> np.ndarray:
    """Indices (tested,) of the tested candidates by falling Bayes factor; each at the best value of its shape."""
    tested = np.flatnonzero(np.isfinite(table["log_bayes_factor"]))
    order = tested[np.argsort(-table["log_bayes_factor"][tested], kind="stable")]
    _, first = np.unique(table["candidate"][order].astype(str), return_index=True)
    return order[np.sort(first)]


def shortlist(order: Sequence[int] | np.ndarray, chosen: np.ndarray, count: int = _LEADING) -> list[int]:
    """The first of an order, and those chosen whatever their place, as far as there is room; in the order."""
    wanted = [index for index in order if chosen[index]][:count]
    others = [index for index in order if not chosen[index]][: count - len(wanted)]
    kept = {*wanted, *others}
    return [index for index in order if index in kept]


def name_in_pairs(table: Mapping[str, np.ndarray], index: int) -> str:
    """Name of a candidate in the confounding table, which has it once for each value of its shape."""
    shape = table["shape"][index]
    return at_shapes(table["candidate"][index], [shape] if np.isfinite(shape) else [])


def angle_matrix(names: Sequence[str], pairs: Mapping[str, np.ndarray]) -> np.ndarray:
    """Angles between candidates as a symmetric matrix (names, names), zeros on its diagonal; not a number where unknown."""
    place = {name: number for number, name in enumerate(names)}
    angles = np.full((len(names), len(names)), np.nan)
    np.fill_diagonal(angles, 0.0)
    for one, other, angle in zip(pairs["one"], pairs["other"], pairs["angle_deg"], strict=True):
        if one in place and other in place:
            angles[place[one], place[other]] = angles[place[other], place[one]] = angle
    return angles


def short_name(key: str, longest: int = 80) -> str:
    """A candidate's key as words, in two lines where it is long and cut in the middle where it is very long."""
    words = _capital(candidate_words(key))
    words = words if len(words) <= longest else f"{words[: longest // 2]} … {words[-(longest // 2 - 2) :]}"
    return textwrap.fill(words, 48)


def _row_mm(names: Sequence[str]) -> float:
    """Height of a row in which every name fits."""
    return 5.6 if any("\n" in short_name(name) for name in names) else 4.3


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _note_nothing_tested(table: Mapping[str, np.ndarray]) -> Figure:
    count = len(set(table["candidate"]))
    if count and set(table["note"]) == {_AT_FAULT}:
        return note("The data are at fault: no cause in the robot was looked for.")
    return note(f"None of {count} candidate causes can be tested with these measurements.")


def _root(value: np.ndarray | float) -> np.ndarray:
    """Root that keeps the sign."""
    return np.sign(value) * np.sqrt(np.abs(value))


def _square(value: np.ndarray | float) -> np.ndarray:
    return np.sign(value) * np.square(value)


def _ticks(low: float, high: float) -> list[int]:
    """Round values, so far apart that their numbers do not touch on an axis of roots."""
    steps = [0, *(digit * 10**power for power in range(6) for digit in (1, 2, 5))]
    apart = 0.07 * (_root(high) - _root(low))
    kept: list[int] = []
    for step in sorted({*steps, *(-step for step in steps)}, key=abs):
        if low <= step <= high and all(abs(_root(step) - _root(other)) > apart for other in kept):
            kept.append(step)
    return sorted(kept)
