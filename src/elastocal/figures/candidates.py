"""Candidates of a search for what is missing: how far each stands out, and which of them make the same residual."""

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from elastocal.figures.style import PALETTE, note, panels, styled

FAMILIES = dict(zip(("geometry", "gravity", "transmission", "elastic", "gearbox", "load", "drift"), PALETTE, strict=False))
# As in selection.FAMILY_WISE_LEVEL, which a drawing job should not have to import all of the search for; a test compares them.
FAMILY_WISE_LEVEL = 0.03
# Of the smallest p-value that a double holds.
_FARTHEST = 308.0
_NAMED = 15
_LEADING = 20


@styled
def scree(table):
    """Candidates in the order in which they stand out at the first look.

    Parameters
    ----------
    table : dict of str to ndarray
        Columns of the candidates table.

    Returns
    -------
    matplotlib.figure.Figure
        The leading ones by name, and all of them by rank.
    """
    tested = np.isfinite(table["p_value"])
    order = leading(table)
    if not len(order):
        return _nothing_tested(table)
    strength = strengths(table)
    mark = family_wise_mark(strength[tested], table["p_family"][tested])
    named = order[:_NAMED]
    figure, axes = panels(1, 2, max(70, 34 + 4.1 * len(named)), width_ratios=(1.25, 1))
    left, right = axes[0]
    rows = np.arange(len(named))
    left.barh(rows, strength[named], color=_colours(table, named), height=0.62, zorder=2)
    for row, index in enumerate(named):
        if table["chosen"][index]:
            left.barh(row, strength[index], height=0.62, facecolor="none", edgecolor="black", linewidth=1.3, zorder=3)
        if strength[index] >= _FARTHEST:
            left.annotate(">", (strength[index], row), (2, 0), textcoords="offset points", va="center", fontsize=7.5)
    left.set(yticks=rows, ylim=(len(named) - 0.4, -0.6), title="the leading candidates")
    left.set_yticklabels([short_name(table["candidate"][index]) for index in named], fontsize=7)
    left.grid(visible=False, axis="y")
    ranks = np.arange(1, len(order) + 1)
    right.scatter(strength[order], ranks, s=14, c=_colours(table, order), zorder=3, linewidths=0)
    chosen = table["chosen"][order].astype(bool)
    right.scatter(strength[order][chosen], ranks[chosen], s=46, facecolors="none", edgecolors="black", linewidths=1.2, zorder=4)
    right.set(ylabel="rank", title=f"all {len(order)} tested")
    right.set_ylim(len(order) + 1, 0)
    right.yaxis.set_major_locator(MaxNLocator(8, integer=True, steps=[1, 2, 5, 10]))
    farthest = max(strength[order].max(initial=0.0), mark or 0.0, 2.0)
    for axis, apart in ((left, 0.13), (right, 0.2)):
        axis.set_xscale("function", functions=(lambda x: np.sqrt(np.clip(x, 0, None)), np.square))
        axis.set(xlim=(0, 1.06 * farthest), xticks=_ticks(farthest, apart), xlabel=r"$-\log_{10}$ p of the candidate alone")
        if mark is not None:
            axis.axvline(mark, color="black", linestyle="--", linewidth=1, zorder=5, gid="family-wise")
    _families_legend(figure, table, order, mark)
    return figure


@styled
def confounding(table, pairs):
    """Angles between what the leading candidates make beyond the declared model.

    Parameters
    ----------
    table : dict of str to ndarray
        Columns of the candidates table.
    pairs : dict of str to ndarray
        Columns of the confounding table.

    Returns
    -------
    matplotlib.figure.Figure
    """
    known = set(pairs["one"]) | set(pairs["other"])
    order = [index for index in leading(table) if name_in_pairs(table, index) in known]
    shown = shortlist(order, table["chosen"])
    if not shown:
        return _nothing_tested(table)
    names = [table["candidate"][index] for index in shown]
    chosen = set(table["candidate"][table["chosen"].astype(bool)])
    angles = angle_matrix([name_in_pairs(table, index) for index in shown], pairs)
    count = len(names)
    figure, axes = panels(1, 1, 18 + 4.2 * max(count, 6))
    axis = axes[0, 0]
    # Never black, so that the numbers can be read everywhere.
    colours = LinearSegmentedColormap.from_list("angles", ["#08306b", "#4292c6", "#c6dbef", "#ffffff"])
    image = axis.imshow(np.ma.masked_invalid(angles), cmap=colours, vmin=0, vmax=90, interpolation="nearest", aspect="auto")
    for row in range(count):
        for column in range(count):
            if row != column and np.isfinite(angles[row, column]):
                ink = "white" if angles[row, column] < 45 else "black"
                axis.text(column, row, f"{angles[row, column]:.0f}", ha="center", va="center", fontsize=6.5, color=ink)
    numbered = [f"{short_name(name)}  {number}" for number, name in enumerate(names, 1)]
    axis.set(xticks=range(count), yticks=range(count))
    axis.set_xticklabels(range(1, count + 1), fontsize=7)
    axis.set_yticklabels(numbered, fontsize=7)
    axis.tick_params(length=0)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    for label, name in zip(axis.get_yticklabels(), names, strict=True):
        if name in chosen:
            label.set(fontweight="bold", color=PALETTE[1])
    for number, name in enumerate(names):
        if name in chosen:
            axis.add_patch(_frame(number, count))
    bar = figure.colorbar(image, ax=axis, ticks=[0, 20, 45, 70, 90])
    bar.set_label("angle (°)")
    if chosen & set(names):
        handle = Patch(facecolor="none", edgecolor=PALETTE[1], linewidth=1.4, label="found in this campaign")
        figure.legend(handles=[handle], loc="outside lower center")
    return figure


def leading(table):
    """Indices of the candidates that were tested, those that stand out most first; each at the best value of its shape."""
    tested = np.flatnonzero(np.isfinite(table["p_value"]))
    statistic, gain = table["statistic"][tested], table["bic_gain"][tested]
    order = tested[np.lexsort((-statistic, -gain, table["p_value"][tested]))]
    _, first = np.unique(table["candidate"][order].astype(str), return_index=True)
    return order[np.sort(first)]


def shortlist(order, chosen, count=_LEADING):
    """The first of an order, and those chosen whatever their place, as far as there is room; in the order."""
    wanted = [index for index in order if chosen[index]][:count]
    others = [index for index in order if not chosen[index]][: count - len(wanted)]
    kept = {*wanted, *others}
    return [index for index in order if index in kept]


def strengths(table):
    """-log10 of the p-values; where a double cannot hold one, what the Bayesian criterion says that it is at least."""
    with np.errstate(divide="ignore", invalid="ignore"):
        strength = -np.log10(table["p_value"])
    # The criterion is twice the logarithm of the likelihood ratio less a penalty that outweighs the tail's polynomial.
    return np.where(strength < _FARTHEST, strength, np.maximum(table["bic_gain"] / (2 * np.log(10)), _FARTHEST))


def family_wise_mark(strength, p_family, level=FAMILY_WISE_LEVEL):
    """Strength that the strongest of all candidates reaches by chance in so many cases.

    Parameters
    ----------
    strength, p_family : ndarray (K,)
    level : float

    Returns
    -------
    float or None
        Half way between the last candidate beyond the level and the first within it; None where none lies on either side.
    """
    beyond, within = strength[p_family < level], strength[p_family >= level]
    if not len(beyond) or not len(within):
        return None
    return float((np.sqrt(beyond.min()) + np.sqrt(within.max())) ** 2 / 4)


def name_in_pairs(table, index):
    """Name of a candidate in the confounding table, which has it once for each value of its shape."""
    shape = table["shape"][index]
    return table["candidate"][index] + (f" {shape:.3g}" if np.isfinite(shape) else "")


def angle_matrix(names, pairs):
    """Angles between candidates as a symmetric matrix with zeros on its diagonal; not a number where unknown."""
    place = {name: number for number, name in enumerate(names)}
    angles = np.full((len(names), len(names)), np.nan)
    np.fill_diagonal(angles, 0.0)
    for one, other, angle in zip(pairs["one"], pairs["other"], pairs["angle_deg"], strict=True):
        if one in place and other in place:
            angles[place[one], place[other]] = angles[place[other], place[one]] = angle
    return angles


def short_name(key, longest=38):
    """A candidate's key as words, cut in the middle where it is very long."""
    words = key.replace("_", " ").replace("@", " ").replace("[", ", ").replace("]", "").replace(" ,", ",")
    return words if len(words) <= longest else f"{words[: longest // 2]} … {words[-(longest // 2 - 2) :]}"


def _nothing_tested(table):
    return note(f"None of {len(set(table['candidate']))} candidates can be tested with these data.")


def _colours(table, indices):
    return [FAMILIES.get(table["family"][index], PALETTE[-1]) for index in indices]


def _ticks(farthest, apart):
    steps = [0, *(digit * 10**power for power in range(-1, 6) for digit in (1, 2, 5))]
    shown = [step for step in steps if step <= 1.06 * farthest]
    kept = []
    for step in shown:
        # So far apart that their numbers do not touch, on an axis of square roots.
        if not kept or np.sqrt(step) - np.sqrt(kept[-1]) > apart * np.sqrt(farthest):
            kept.append(step)
    return kept


def _families_legend(figure, table, order, mark):
    present = [family for family in FAMILIES if family in set(table["family"][order])]
    handles = [Patch(color=FAMILIES[family], label=family) for family in present]
    if table["chosen"].any():
        handles.append(Patch(facecolor="none", edgecolor="black", linewidth=1.3, label="taken by the search"))
    if mark is not None:
        label = f"family-wise {100 * FAMILY_WISE_LEVEL:g} %"
        handles.append(Line2D([], [], color="black", linestyle="--", linewidth=1, label=label))
    untestable = len(set(table["candidate"])) - len(order)
    words = f"{len(order)} candidates tested, {untestable} more cannot be tested with these data"
    if mark is None:
        none = not len(order) or table["p_family"][order].min() >= FAMILY_WISE_LEVEL
        words += f"; {'none stands' if none else 'all stand'} out at the family-wise {100 * FAMILY_WISE_LEVEL:g} % level"
    figure.legend(handles=handles, title=words, loc="outside lower center", ncols=4, title_fontsize=7.5)


def _frame(number, count):
    return Rectangle((-0.5, number - 0.5), count, 1, fill=False, edgecolor=PALETTE[1], linewidth=1.4, zorder=4)
