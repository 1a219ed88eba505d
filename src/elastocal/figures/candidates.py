"""What may be missing in a model: probabilities of hypotheses, and candidates one by one."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from elastocal.figures.style import PALETTE, note, panels, styled
from elastocal.report.words import candidate_words, capital, hypotheses_words, probability_words

FAMILIES = dict(zip(("geometry", "gravity", "transmission", "elastic", "gearbox", "load", "drift"), PALETTE, strict=False))
# Hypotheses and candidates with a bar of their own.
_HYPOTHESES, _NAMED = 8, 15
_REST = "Everything else"
# Letters in a line of a label, and in the longest label.
_LINE, _LONGEST = 44, 80
# Height of a row of one line, and of each further line.
_ROW_MM, _LINE_MM = 4.6, 3.0
# Why nothing is tested where the data are at fault, as tables.candidate_rows notes it.
_AT_FAULT = "the measurements are at fault"


@styled
def probabilities(stated: Mapping[str, Any] | None, table: Mapping[str, np.ndarray]) -> Figure:
    """Posterior probabilities of the leading hypotheses, and Bayes factors of the leading candidates alone.

    `stated`: ``probabilities`` of a diagnosis; None where the data are at fault. `table`: columns of the candidates table.
    """
    order = rank_candidates(table)
    if stated is None or not len(order):
        return _note_nothing_tested(table)
    sets, named = stated["sets"][:_HYPOTHESES], order[:_NAMED]
    labels = [textwrap.fill(capital(words), _LINE) for words in hypotheses_words(sets)]
    values = [entry["probability"] for entry in sets]
    if (rest := 1.0 - sum(values)) > 0.001:
        labels, values = [*labels, _REST], [*values, rest]
    names = [short_name(table["candidate"][index]) for index in named]
    upper, lower = _heights_mm(labels), _heights_mm(names)
    sizes = [34 + upper.sum(), 22 + lower.sum()]
    figure, axes = panels(2, 1, sum(sizes), height_ratios=sizes)
    colours = [PALETTE[0] if label != _REST else "#d9d9d9" for label in labels]
    rows = _label_rows(axes[0, 0], labels, upper)
    axes[0, 0].barh(rows, 100 * np.array(values), height=0.62 * upper, color=colours, zorder=2)
    for row, value in zip(rows, values, strict=True):
        place = {"xytext": (3, 0), "textcoords": "offset points", "va": "center", "fontsize": 7.5}
        axes[0, 0].annotate(probability_words(value), (100 * value, row), **place)
    axes[0, 0].set(xlim=(0, 112), xticks=range(0, 101, 20), xlabel="posterior probability (%)")
    axes[0, 0].set_title("What is missing in the declared model", loc="left")
    _factors(axes[1, 0], table, named, _label_rows(axes[1, 0], names, lower))
    present = [family for family in FAMILIES if family in set(table["family"][named])]
    handles = [Patch(color=FAMILIES[family], label=family) for family in present]
    if table["chosen"].any():
        handles.append(Patch(facecolor="none", edgecolor="black", linewidth=1.3, label="in the most probable model"))
    untestable = len(set(table["candidate"])) - len(order)
    words = f"{len(order)} candidate causes tested; {untestable} more cannot be tested with these measurements"
    figure.legend(handles=handles, title=words, loc="outside lower center", ncols=4)
    return figure


def _factors(axis: Axes, table: Mapping[str, np.ndarray], named: np.ndarray, rows: np.ndarray) -> None:
    """Bayes factors of single candidates, coloured by family."""
    factors, chosen = table["log_bayes_factor"][named], table["chosen"][named].astype(bool)
    colours = [FAMILIES.get(family, PALETTE[-1]) for family in table["family"][named]]
    axis.barh(rows, factors, color=colours, height=2.6, zorder=2)
    if chosen.any():
        style: dict[str, Any] = {"facecolor": "none", "edgecolor": "black", "linewidth": 1.3, "zorder": 3, "gid": "chosen"}
        axis.barh(rows[chosen], factors[chosen], height=2.6, **style)
    # Roots keep the small ones in sight; symmetric, since a factor may be below zero.
    axis.set_xscale("function", functions=(lambda x: np.sign(x) * np.sqrt(np.abs(x)), lambda x: np.sign(x) * np.square(x)))
    low, high = min(factors.min(), 0.0), max(factors.max(), 2.0)
    # Squares of evenly spaced roots.
    ends = np.linspace(-np.sqrt(-low), np.sqrt(high), 7)
    ticks = {float(f"{root * abs(root):.2g}") for root in ends} | {0.0}
    axis.set(xlim=(1.08 * low, 1.06 * high), xticks=sorted(tick for tick in ticks if low <= tick <= high))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.set_xlabel("Bayes factor against the declared model\n(natural logarithm; above 0 it explains more)")
    axis.axvline(0, color="black", linewidth=0.8, zorder=4)
    axis.set_title("Each candidate cause alone", loc="left")


def _heights_mm(labels: Sequence[str]) -> np.ndarray:
    """Heights of rows in which labels of one or more lines fit."""
    return np.array([_ROW_MM + _LINE_MM * label.count("\n") for label in labels])


def _label_rows(axis: Axes, labels: Sequence[str], heights_mm: np.ndarray) -> np.ndarray:
    """Label rows from above, in an axis whose unit is a millimetre; returns their middles."""
    rows = np.cumsum(heights_mm) - heights_mm / 2
    axis.set(yticks=rows, ylim=(heights_mm.sum(), 0))
    axis.set_yticklabels(labels, fontsize=7, linespacing=1.0)
    axis.grid(visible=False, axis="y")
    return rows


def rank_candidates(table: Mapping[str, np.ndarray]) -> np.ndarray:
    """Indices (tested,) of the tested candidates by falling Bayes factor; each at the best value of its shape."""
    tested = np.flatnonzero(np.isfinite(table["log_bayes_factor"]))
    order = tested[np.argsort(-table["log_bayes_factor"][tested], kind="stable")]
    _, first = np.unique(table["candidate"][order].astype(str), return_index=True)
    return order[np.sort(first)]


def short_name(key: str) -> str:
    """A candidate's key as words, in two lines where it is long and cut in the middle where it is very long."""
    words = capital(candidate_words(key))
    words = words if len(words) <= _LONGEST else f"{words[: _LONGEST // 2]} … {words[-(_LONGEST // 2 - 2) :]}"
    return textwrap.fill(words, 48)


def _note_nothing_tested(table: Mapping[str, np.ndarray]) -> Figure:
    count = len(set(table["candidate"]))
    if count and set(table["note"]) == {_AT_FAULT}:
        return note("The data are at fault: no cause in the robot was looked for.")
    return note(f"None of {count} candidate causes can be tested with these measurements.")
