"""Figures of a campaign: residuals as arrows, errors by model, hypotheses and candidates,
and the contributions to the error."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from elastocal.counting import format_count, list_first
from elastocal.figures.style import (
    MILLI,
    PALETTE,
    STAGES,
    add_legend_below,
    create_panels,
    draw_note,
    label_decades,
    styled,
)
from elastocal.io.storage import Columns, Row
from elastocal.report.words import (
    capitalize_first,
    choose_length_unit,
    format_candidate,
    format_hypotheses,
    format_probability,
    name_data_set,
    spell_out_names,
)
from elastocal.verdict import MechanismSet, Probabilities

# Above this number of states, only one state is drawn in each cell of a square grid
# with this number of columns.
_MAX_ARROWS = 320
_GRID_COLUMNS = 18
# Length of the arrow of a large residual, as a share of the workspace.
_ARROW_SHARE = 0.13
# The views of the workspace: the axes that are drawn to the right and upwards.
VIEWS = {"from the side": [0, 2], "from above": [0, 1]}

METRICS = {"mean": "mean", "rms": "RMS", "p95": "95th percentile", "max": "maximum"}
# Colour and label of each kind of model.
MODEL_STYLES = {
    "frames": ("#b9b9b9", "before"),
    "declared": (PALETTE[1], "declared model"),
    "effect": STAGES["after"][::-1],
    "kept": ("#777777", "before, kept"),
}
# Above this ratio of the largest to the smallest error, the axis is logarithmic, because
# the smallest bars would be invisible on a linear one.
_MAX_LINEAR_RATIO = 25
# Characters in a line of a model's label, and the effects that it names.
_MODEL_LABEL_WIDTH = 26
_NAMED_EFFECTS = 3
_DIAMOND_STYLE: dict[str, Any] = {
    "linestyle": "",
    "marker": "D",
    "color": "white",
    "markeredgecolor": "black",
    "markersize": 3.4,
}
_INTERVAL_STYLE: dict[str, Any] = {"color": "black", "linewidth": 1.1}
_NOISE_STYLE: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 1.2}
FAMILY_COLOURS = dict(
    zip(
        ("geometry", "gravity", "transmission", "elastic", "gearbox", "load", "drift"),
        PALETTE,
        strict=False,
    )
)
# Numbers of hypotheses and candidates that get a bar of their own.
_SHOWN_HYPOTHESES = 8
_SHOWN_CANDIDATES = 15
_ALL_ELSE = "Everything else"
# The smallest probability of all further hypotheses that gets a bar.
_SMALLEST_SHOWN_PROBABILITY = 0.001
# Characters in a line of a hypothesis' label, of a candidate's label, and in the longest
# name of a candidate.
_HYPOTHESIS_LABEL_WIDTH = 44
_CANDIDATE_LABEL_WIDTH = 48
_LONGEST_NAME = 80
# Height of a row with one line of text, and of each further line.
_ROW_MM = 4.6
_LINE_MM = 3.0
# Note of every candidate if the data are at fault, see `tables.candidate_rows`.
_AT_FAULT = "the measurements are at fault"
# Outline of the candidates of the most probable model.
_CHOSEN_STYLE: dict[str, Any] = {
    "facecolor": "none",
    "edgecolor": "black",
    "linewidth": 1.3,
}
# Contributions that remain after the best correction of the robot.
_RESIDUAL_CONTRIBUTIONS = (
    "uncertainty of the parameters",
    "repeatability",
    "form of the model",
    "not commanded",
    "left by the regression",
)
TRACKER = "tracker"
# Colour and label of each kind of contribution to an error budget.
_CONTRIBUTION_STYLES = {
    "before": ("#b9b9b9", "before calibration"),
    "effect": (PALETTE[0], "error if this alone is uncorrected"),
    "residual": (PALETTE[2], "remaining after correction"),
    TRACKER: ("#ffffff", "instrument noise (single measurement)"),
}


@dataclass(frozen=True)
class _States:
    """Measured states, repeats averaged.

    Attributes
    ----------
    positions : (N, 3) array, m
    residuals : dict of (N, 3) arrays, m
        Residuals by stage, before and after.
    """

    positions: np.ndarray
    residuals: dict[str, np.ndarray]


@dataclass(frozen=True)
class _ArrowScale:
    """Scale of the arrows: a residual of `largest_m` is drawn `length_m` long."""

    largest_m: float
    length_m: float


@styled
def draw_residual_arrows(table: Columns, arm: np.ndarray | None = None) -> Figure:
    """Draw residuals as arrows at the measured positions, from the side and from above.

    Repeats are averaged. If there are many states, one state of each cell of a grid is
    drawn.

    Parameters
    ----------
    table
        Columns of the residuals table.
    arm : (K, 3) array, m
        Corners of the robot in one pose; drawn behind the arrows.
    """
    residuals = _prepare_residuals(table)
    extent = residuals.extent
    height_mm = 26 + float(np.clip(66 * extent[1:].max() / extent[0], 40, 56))
    figure, axes = create_panels(1, 2, height_mm)
    for axis, view in zip(axes[0], VIEWS, strict=True):
        _draw_view(axis, residuals, arm, view)
    _draw_scale_arrow(axes[0, 1], residuals.scale)
    explanation = "each arrow: mean of the repeats"
    if residuals.cell_m is not None:
        explanation = (
            f"one state of each cell of {1e3 * residuals.cell_m:g} mm, that of the"
            " middle residual"
        )
    figure.legend(
        handles=_list_stage_handles(residuals),
        title=explanation,
        loc="outside lower center",
        ncols=2,
    )
    return figure


def draw_residual_view(
    axis: Axes, table: Columns, arm: np.ndarray | None, view: str
) -> None:
    """Draw residuals as arrows in one view, with a legend.

    Parameters
    ----------
    axis
        Axes on which to draw.
    table, arm
        As of `draw_residual_arrows`.
    view
        A key of `VIEWS`.
    """
    residuals = _prepare_residuals(table)
    _draw_view(axis, residuals, arm, view)
    _draw_scale_arrow(axis, residuals.scale)
    axis.legend(handles=_list_stage_handles(residuals), fontsize=7)


@dataclass(frozen=True)
class _Residuals:
    """Residuals that are drawn.

    Attributes
    ----------
    states
        States with their positions and residuals.
    extent : (3,) array
        Extent of the positions, m.
    scale
        Scale of the arrows.
    cell_m
        Width of the cells of which one state is drawn, m; None if all are drawn.
    """

    states: _States
    extent: np.ndarray
    scale: _ArrowScale
    cell_m: float | None

    @property
    def sizes(self) -> np.ndarray:
        """(S,) lengths of the residuals before, m."""
        return np.linalg.norm(self.states.residuals["before"], axis=1)


def _prepare_residuals(table: Columns) -> _Residuals:
    """Average repeats, and choose the scale of the arrows and the cells."""
    states = _average_repeats(table)
    sizes = np.linalg.norm(states.residuals["before"], axis=1)
    largest_m = max(np.quantile(sizes, 0.95), 1e-9)
    extent = np.maximum(np.ptp(states.positions, axis=0), 1e-3)
    scale = _ArrowScale(largest_m, _ARROW_SHARE * extent.max())
    cell_m = None
    if len(sizes) > _MAX_ARROWS:
        cell_m = _choose_cell_size(extent.max())
    return _Residuals(states, extent, scale, cell_m)


def _draw_view(
    axis: Axes, residuals: _Residuals, arm: np.ndarray | None, view: str
) -> None:
    """Draw arrows and arm in one view, a key of `VIEWS`."""
    states = residuals.states
    sizes = residuals.sizes
    coordinates = VIEWS[view]
    drawn = np.arange(len(sizes))
    if residuals.cell_m is not None:
        drawn = select_median_states(
            states.positions[:, coordinates], sizes, residuals.cell_m
        )
    _draw_arrows(axis, states, drawn, coordinates, residuals.scale)
    _draw_robot(axis, arm, coordinates)
    axis.set_title(view, loc="left")
    axis.set(xlabel="x (m)", ylabel=f"{'xyz'[coordinates[1]]} (m)", aspect="equal")
    axis.margins(0.06)
    axis.set_anchor("N")
    axis.set_axisbelow(True)


def _list_stage_handles(residuals: _Residuals) -> list[Line2D]:
    """List the entries of a legend of the stages that are drawn."""
    return [
        Line2D([], [], color=STAGES[stage][1], linewidth=2, label=STAGES[stage][0])
        for stage in _list_stages(residuals.states)
    ]


def _average_repeats(table: Columns) -> _States:
    """Mean position and residuals of each state and target."""
    keys = ["held_out", "session", "pose", "load", "target"]
    before = ["before_dx", "before_dy", "before_dz"]
    after = ["after_dx", "after_dy", "after_dz"]
    names = [*keys, *"xyz", *before, *after]
    frame = pd.DataFrame({name: table[name] for name in names})
    means = frame.groupby(keys, dropna=False, observed=True).mean()
    residuals = {"before": means[before].to_numpy(), "after": means[after].to_numpy()}
    return _States(means[[*"xyz"]].to_numpy(), residuals)


def _list_stages(states: _States) -> list[str]:
    """The stages to draw: only the first if no effect changed a residual."""
    before, after = (states.residuals[stage] for stage in STAGES)
    if np.allclose(before, after, rtol=0, atol=1e-9):
        return [*STAGES][:1]
    return [*STAGES]


def _choose_cell_size(extent_m: float) -> float:
    """Side of a cell in m, rounded up to one digit so that the figure can state it."""
    side = extent_m / _GRID_COLUMNS
    digit = 10.0 ** np.floor(np.log10(side))
    return float(np.ceil(side / digit) * digit)


def select_median_states(
    positions: np.ndarray, sizes: np.ndarray, side: float
) -> np.ndarray:
    """Select the state with the median residual in each cell of a square grid.

    Parameters
    ----------
    positions : (N, 2) array, m
    sizes : (N,) array
        Sizes of the residuals.
    side : float, m
        Side of a cell.

    Returns
    -------
    (cells,) array of int
        One index for each cell that is not empty.
    """
    cells = np.floor(positions / side).astype(int)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    order = np.lexsort((sizes, cell.ravel()))
    counts = np.bincount(cell.ravel())
    return order[np.cumsum(counts) - counts + (counts - 1) // 2]


def _draw_arrows(
    axis: Axes, states: _States, drawn: np.ndarray, view: list[int], scale: _ArrowScale
) -> None:
    """Draw the residuals of some states in one view, stage over stage."""
    starts = states.positions[drawn][:, view]
    for order, stage in enumerate(_list_stages(states)):
        residuals = states.residuals[stage][drawn][:, view]
        tips = starts + residuals * scale.length_m / scale.largest_m
        arrows = axis.quiver(
            *starts.T,
            *(tips - starts).T,
            angles="xy",
            scale_units="xy",
            scale=1,
            color=STAGES[stage][1],
            width=0.006 - 0.0025 * order,
            headwidth=3.2,
            headlength=4,
            headaxislength=3.6,
            minlength=0.3,
        )
        arrows.set(zorder=3 + order, gid=stage)
        axis.update_datalim(tips)


def _draw_robot(axis: Axes, arm: np.ndarray | None, view: list[int]) -> None:
    """Draw the arm, if there is one, and mark the base."""
    if arm is not None:
        axis.plot(
            *arm[:, view].T,
            color="#c8c8c8",
            linewidth=6,
            zorder=1,
            solid_capstyle="round",
            solid_joinstyle="round",
            gid="arm",
        )
    axis.plot(0, 0, "+", color="black", markersize=8, gid="base")
    axis.annotate("base", (0, 0), (4, 4), textcoords="offset points", fontsize=7)


def _draw_scale_arrow(axis: Axes, scale: _ArrowScale) -> None:
    """Draw an arrow of a round length next to the title."""
    digit = 10.0 ** np.floor(np.log10(scale.largest_m))
    limit = scale.largest_m * (1 + 1e-9)
    shown_m = max(step for step in (1, 2, 5) if step * digit <= limit) * digit
    factor, unit = choose_length_unit(shown_m)
    # A quiver key needs a quiver; this one stays invisible.
    arrow = axis.quiver(
        [0],
        [0],
        [0],
        [0],
        angles="xy",
        scale_units="xy",
        scale=1,
        color="black",
        width=0.006,
        minlength=0,
    )
    axis.quiverkey(
        arrow,
        0.88,
        1.035,
        shown_m * scale.length_m / scale.largest_m,
        f"{factor * shown_m:g} {unit}",
        labelpos="W",
        coordinates="axes",
        fontproperties={"size": 8},
    )
    arrow.set_visible(False)


@styled
def draw_before_after(
    steps: Sequence[Row], noise_floor_m: float | None = None
) -> Figure:
    """Draw bars of the errors on held-out poses, one row for each model.

    Parameters
    ----------
    steps
        Rows of before_after.csv.
    noise_floor_m : float, m
        RMS error that the noise alone leaves.
    """
    lines = sum(_label_model(step["step"]).count("\n") + 1 for step in steps)
    height_mm = 30 + 4.0 * lines + 4.5 * len(steps)
    figure, axes = create_panels(1, len(METRICS), height_mm, sharey=True)
    for axis, metric in zip(axes[0], METRICS, strict=True):
        draw_model_errors(axis, steps, metric, noise_floor_m)
    handles = _explain_model_bars({step["kind"] for step in steps})
    if noise_floor_m:
        label = "RMS of the noise alone"
        handles.append(Line2D([], [], label=label, **_NOISE_STYLE))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def draw_model_errors(
    axis: Axes, steps: Sequence[Row], metric: str, noise_floor_m: float | None = None
) -> None:
    """Draw bars of one error on held-out poses, one row for each model.

    Parameters
    ----------
    axis
        Axes on which to draw.
    steps, noise_floor_m
        As of `draw_before_after`.
    metric
        A key of `METRICS`.
    """
    labels = [_label_model(step["step"]) for step in steps]
    heights = 0.55 + 0.45 * np.array([label.count("\n") + 1 for label in labels])
    rows = np.cumsum(heights) - heights / 2
    factor, unit = choose_length_unit(_collect_errors(steps, "heldout").max())
    _draw_model_bars(axis, steps, metric, rows, factor)
    if noise_floor_m:
        axis.axvline(factor * noise_floor_m, gid="noise floor", **_NOISE_STYLE)
    axis.set(title=METRICS[metric], xlabel=f"error ({unit})")
    _scale_error_axis(axis, _find_logarithmic_range(steps, noise_floor_m), factor)
    axis.grid(visible=False, axis="y")
    axis.set_axisbelow(True)
    axis.set(yticks=rows, ylim=(heights.sum(), 0))
    axis.set_yticklabels(labels, fontsize=7.5)


def _scale_error_axis(
    axis: Axes, logarithmic_range: tuple[float, float] | None, factor: float
) -> None:
    """Scale an axis of errors; `factor` converts m to the unit of the axis."""
    if logarithmic_range is None:
        axis.set_xlim(0, None)
        return
    smallest, largest = logarithmic_range
    axis.set_xscale("log")
    axis.set_xlim(0.5 * factor * smallest, 1.6 * factor * largest)
    axis.xaxis.set_major_formatter("{x:g}")


def _find_logarithmic_range(
    steps: Sequence[Row], noise_floor_m: float | None
) -> tuple[float, float] | None:
    """Smallest and largest error in m for a logarithmic axis; None if a linear one shows
    all errors."""
    held_out = _collect_errors(steps, "heldout")
    bars = held_out[held_out > 0]
    if noise_floor_m:
        bars = np.append(bars, noise_floor_m)
    if bars.max() <= _MAX_LINEAR_RATIO * bars.min():
        return None
    return bars.min(), max(held_out.max(), _collect_errors(steps, "train").max())


def _label_model(step: str) -> str:
    """The effects of a model in words, in lines that fit next to the bars; the end of a
    long list is left out."""
    effects = spell_out_names(step).split(", ")
    return textwrap.fill(list_first(effects, _NAMED_EFFECTS), _MODEL_LABEL_WIDTH)


def _collect_errors(steps: Sequence[Row], poses: str) -> np.ndarray:
    """Errors (models, metrics) in m on the held-out or the training poses."""
    columns = [f"{poses}_{metric}_m" for metric in METRICS]
    return np.array([itemgetter(*columns)(step) for step in steps])


def _draw_model_bars(
    axis: Axes,
    steps: Sequence[Row],
    metric: str,
    rows: np.ndarray,
    factor: float,
) -> None:
    """Draw each model's error by one metric with its interval, and a diamond for the
    error on fitted poses; `factor` converts m to the unit of the axis."""
    for row, step in zip(rows, steps, strict=True):
        key = f"heldout_{metric}_m"
        colour = MODEL_STYLES[step["kind"]][0]
        axis.barh(row, factor * step[key], height=0.42, color=colour)
        interval = [factor * step[f"{key}_low"], factor * step[f"{key}_high"]]
        axis.plot(interval, [row, row], gid="interval", **_INTERVAL_STYLE)
        axis.plot(factor * step[f"train_{metric}_m"], row, **_DIAMOND_STYLE)


def _explain_model_bars(kinds: set[str]) -> list[Artist]:
    """Entries of the legend for bars of these kinds of models."""
    bars = [
        Patch(color=color, label=label)
        for kind, (color, label) in MODEL_STYLES.items()
        if kind in kinds
    ]
    return [
        *bars,
        Line2D([], [], label="95 % interval over poses", **_INTERVAL_STYLE),
        Line2D([], [], label="on fitted poses", **_DIAMOND_STYLE),
    ]


@styled
def draw_errors_by_campaign(table: pd.DataFrame) -> Figure:
    """Draw root mean square errors with their intervals, one row for each campaign.

    Parameters
    ----------
    table
        ``campaign``, ``poses``, and ``before_rms_mm``, ``before_rms_low_mm``,
        ``before_rms_high_mm``, the same for after; in mm.
    """
    rows = np.arange(len(table))[::-1]
    figure, axes = create_panels(1, 1, 24 + 6 * len(table))
    axis = axes[0, 0]
    after = table["after_rms_mm"]
    axis.hlines(rows, after, table["before_rms_mm"], color="#c8c8c8", lw=2.5, zorder=1)
    for stage, (label, color) in STAGES.items():
        rms, low, high = (
            table[f"{stage}_rms{end}_mm"].to_numpy(float)
            for end in ("", "_low", "_high")
        )
        # An interval without an upper bound is drawn up to the value.
        span = [rms - low, np.where(np.isfinite(high), high - rms, 0.0)]
        axis.errorbar(
            rms,
            rows,
            xerr=span,
            fmt="o",
            color=color,
            ms=4,
            lw=1.2,
            capsize=2,
            label=label,
            zorder=2,
        )
    axis.set_yticks(rows, _name_campaigns(table))
    axis.set(
        xscale="log",
        xlabel="RMS position error of held-out poses (mm), with 95 % intervals",
    )
    label_decades(axis.xaxis)
    axis.grid(visible=False, axis="y")
    add_legend_below(figure, 2)
    return figure


def _name_campaigns(table: pd.DataFrame) -> pd.Series:
    """Names of campaigns as people write them.

    Two sessions of one campaign are distinguished by their numbers of poses.
    """
    names = table["campaign"].map(name_data_set)
    poses = table["poses"].map(lambda count: format_count(count, "pose"))
    return names.where(~names.duplicated(keep=False), names + ", " + poses)


@styled
def draw_probabilities(posterior: Probabilities | None, table: Columns) -> Figure:
    """Draw the posterior probabilities of the leading hypotheses, and the Bayes factors
    of the leading candidates alone.

    Parameters
    ----------
    posterior
        ``probabilities`` of a diagnosis; None if the data are at fault.
    table
        Columns of the candidates table.
    """
    ranked = rank_candidates(table)
    candidate_count = len(set(table["candidate"]))
    if posterior is None or not len(ranked):
        if candidate_count and set(table["note"]) == {_AT_FAULT}:
            return draw_note("The data are at fault: no cause in the robot was tested.")
        return draw_note(
            f"None of {candidate_count} candidate causes can be tested with these "
            "measurements."
        )
    shown = ranked[:_SHOWN_CANDIDATES]
    hypotheses = _list_hypotheses(posterior.sets[:_SHOWN_HYPOTHESES])
    names = [shorten_candidate_name(table["candidate"][index]) for index in shown]
    upper_heights = _compute_row_heights([label for label, _ in hypotheses])
    lower_heights = _compute_row_heights(names)
    sizes = [34 + upper_heights.sum(), 22 + lower_heights.sum()]
    figure, axes = create_panels(2, 1, sum(sizes), height_ratios=sizes)
    _draw_hypotheses(axes[0, 0], hypotheses, upper_heights)
    rows = _label_rows(axes[1, 0], names, lower_heights)
    _draw_factors(axes[1, 0], table, shown, rows)
    families = set(table["family"][shown])
    handles = [
        Patch(color=colour, label=family)
        for family, colour in FAMILY_COLOURS.items()
        if family in families
    ]
    if _find_chosen(table, shown).any():
        handles.append(Patch(label="in the most probable model", **_CHOSEN_STYLE))
    title = (
        f"{len(ranked)} candidate causes tested; {candidate_count - len(ranked)} more "
        "cannot be tested with these measurements"
    )
    figure.legend(handles=handles, title=title, loc="outside lower center", ncols=4)
    return figure


def draw_hypotheses(axis: Axes, posterior: Probabilities) -> None:
    """Draw the posterior probabilities of the leading hypotheses on given axes."""
    hypotheses = _list_hypotheses(posterior.sets[:_SHOWN_HYPOTHESES])
    heights_mm = _compute_row_heights([label for label, _ in hypotheses])
    _draw_hypotheses(axis, hypotheses, heights_mm)


def _list_hypotheses(sets: Sequence[MechanismSet]) -> list[tuple[str, float]]:
    """Label and probability of each hypothesis, then of all others together."""
    labels = [
        textwrap.fill(capitalize_first(hypothesis), _HYPOTHESIS_LABEL_WIDTH)
        for hypothesis in format_hypotheses(sets)
    ]
    values = [hypothesis.probability for hypothesis in sets]
    hypotheses = [*zip(labels, values, strict=True)]
    remaining = 1.0 - sum(values)
    if remaining > _SMALLEST_SHOWN_PROBABILITY:
        hypotheses.append((_ALL_ELSE, remaining))
    return hypotheses


def _draw_hypotheses(
    axis: Axes, hypotheses: Sequence[tuple[str, float]], heights_mm: np.ndarray
) -> None:
    """Draw a bar for each hypothesis with its probability in words."""
    labels = [label for label, _ in hypotheses]
    values = [probability for _, probability in hypotheses]
    colours = [PALETTE[0] if label != _ALL_ELSE else "#d9d9d9" for label in labels]
    rows = _label_rows(axis, labels, heights_mm)
    widths = 100 * np.array(values)
    axis.barh(rows, widths, height=0.62 * heights_mm, color=colours, zorder=2)
    for row, value in zip(rows, values, strict=True):
        axis.annotate(
            format_probability(value),
            (100 * value, row),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axis.set(
        xlim=(0, 112), xticks=range(0, 101, 20), xlabel="posterior probability (%)"
    )
    axis.set_title("Effects that the declared model lacks", loc="left")


def _draw_factors(
    axis: Axes, table: Columns, shown: np.ndarray, rows: np.ndarray
) -> None:
    """Draw the Bayes factors of single candidates, coloured by family."""
    factors = table["log_bayes_factor"][shown]
    chosen = _find_chosen(table, shown)
    colours = [
        FAMILY_COLOURS.get(family, PALETTE[-1]) for family in table["family"][shown]
    ]
    axis.barh(rows, factors, color=colours, height=2.6, zorder=2)
    if chosen.any():
        axis.barh(
            rows[chosen],
            factors[chosen],
            height=2.6,
            zorder=3,
            gid="chosen",
            **_CHOSEN_STYLE,
        )
    low = min(factors.min(), 0.0)
    high = max(factors.max(), 2.0)
    _set_square_root_scale(axis, low, high)
    axis.set_xlim(1.08 * low, 1.06 * high)
    axis.set_xlabel(
        "natural logarithm of the Bayes factor against the declared model\n"
        "(square-root scale; above 0 the candidate explains more)"
    )
    axis.axvline(0, color="black", linewidth=0.8, zorder=4)
    axis.set_title("Each candidate cause alone", loc="left")


def _find_chosen(table: Columns, shown: np.ndarray) -> np.ndarray:
    """Find the shown candidates that the most probable model contains, whatever the
    value of their shape parameter there: (shown,) array of bool."""
    names = table["candidate"].astype(str)
    return np.isin(names[shown], names[table["chosen"].astype(bool)])


def _set_square_root_scale(axis: Axes, low: float, high: float) -> None:
    """Scale the x axis by square roots, which keep small values visible beside large
    ones; negative values are mirrored. The ticks are about evenly spaced."""
    axis.set_xscale(
        "function",
        functions=(
            lambda x: np.sign(x) * np.sqrt(np.abs(x)),
            lambda x: np.sign(x) * np.square(x),
        ),
    )
    roots = np.linspace(-np.sqrt(-low), np.sqrt(high), 7)
    ticks = {_round_to_tick(root * abs(root)) for root in roots} | {0.0}
    axis.set_xticks(sorted(tick for tick in ticks if low <= tick <= high))
    axis.xaxis.set_major_formatter("{x:g}")


def _round_to_tick(value: float) -> float:
    """Round a value to 1, 2 or 5 times a power of ten, by its logarithm."""
    if value == 0.0:
        return 0.0
    decade = 10.0 ** np.floor(np.log10(abs(value)))
    factors = np.array([1.0, 2.0, 5.0, 10.0])
    nearest = np.argmin(np.abs(np.log(abs(value) / (factors * decade))))
    return float(np.sign(value) * factors[nearest] * decade)


def _compute_row_heights(labels: Sequence[str]) -> np.ndarray:
    """Heights (N,) in mm of rows that labels of one or more lines need."""
    return np.array([_ROW_MM + _LINE_MM * label.count("\n") for label in labels])


def _label_rows(
    axis: Axes, labels: Sequence[str], heights_mm: np.ndarray
) -> np.ndarray:
    """Label rows from the top, on an axis with one unit a millimetre; returns the
    middles of the rows."""
    rows = np.cumsum(heights_mm) - heights_mm / 2
    axis.set(yticks=rows, ylim=(heights_mm.sum(), 0))
    axis.set_yticklabels(labels, fontsize=7, linespacing=1.0)
    axis.grid(visible=False, axis="y")
    return rows


def rank_candidates(table: Columns) -> np.ndarray:
    """Rank the tested candidates by falling Bayes factor.

    Of a candidate with a shape parameter, only its best value counts. Returns indices
    (tested,) into the candidates table.
    """
    tested = np.flatnonzero(np.isfinite(table["log_bayes_factor"]))
    order = tested[np.argsort(-table["log_bayes_factor"][tested], kind="stable")]
    _, first = np.unique(table["candidate"][order].astype(str), return_index=True)
    return order[np.sort(first)]


def shorten_candidate_name(key: str) -> str:
    """Word a candidate's key, in two lines if it is long; the middle of a very long name
    is left out."""
    name = capitalize_first(format_candidate(key))
    if len(name) > _LONGEST_NAME:
        half = _LONGEST_NAME // 2
        name = f"{name[:half]} … {name[-(half - 2) :]}"
    return textwrap.fill(name, _CANDIDATE_LABEL_WIDTH)


@styled
def draw_budget_bars(
    budget: Sequence[Row],
    names: Sequence[str],
    tolerance_m: float,
    tracker_m: float,
) -> Figure:
    """Draw the contributions to an error budget as bars against the tolerance, the
    largest first.

    Parameters
    ----------
    budget
        Contributions: ``name``, ``rms_m``.
    names
        The contributions in words.
    tolerance_m : float, m
    tracker_m : float, m
        RMS position error that the tracker's noise alone shows.
    """
    tracker = {"name": TRACKER, "rms_m": tracker_m}
    pairs = [*zip(names, budget, strict=True), ("noise of the tracker alone", tracker)]
    shown = [(name, entry) for name, entry in pairs if entry["rms_m"] > 0.0]
    shown.sort(key=lambda pair: -pair[1]["rms_m"])
    figure, axes = create_panels(1, 1, 26 + 6.5 * len(shown))
    axis = axes[0, 0]
    for row, (_, entry) in enumerate(shown):
        _draw_contribution(axis, row, entry)
    tolerance_mm = MILLI * tolerance_m
    tolerance_line = axis.axvline(
        tolerance_mm,
        color=PALETTE[1],
        ls="--",
        zorder=0,
        label=f"tolerance {tolerance_mm:g} mm",
    )
    largest_mm = max(MILLI * shown[0][1]["rms_m"], tolerance_mm)
    _set_square_root_scale(axis, 0.0, largest_mm)
    # Room for the number beside the longest bar.
    axis.set(
        xlim=(0, 1.4 * largest_mm),
        xlabel="predicted RMS position error (mm, square-root scale)",
    )
    axis.set_yticks(range(len(shown)), [name for name, _ in shown])
    axis.invert_yaxis()
    axis.grid(visible=False, axis="y")
    kinds = {_classify_contribution(entry["name"]) for _, entry in shown}
    handles: list[Artist] = [
        Patch(
            facecolor=color,
            edgecolor="black" if kind == TRACKER else color,
            linewidth=0.6,
            label=label,
        )
        for kind, (color, label) in _CONTRIBUTION_STYLES.items()
        if kind in kinds
    ]
    handles.append(tolerance_line)
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _classify_contribution(name: str) -> str:
    """Kind of a contribution, a key of `_CONTRIBUTION_STYLES`."""
    if name in _CONTRIBUTION_STYLES:
        return name
    if name in _RESIDUAL_CONTRIBUTIONS:
        return "residual"
    return "effect"


def _draw_contribution(axis: Axes, row: int, entry: Row) -> None:
    """Draw the bar of one contribution with its value in mm."""
    kind = _classify_contribution(entry["name"])
    size_mm = MILLI * entry["rms_m"]
    axis.barh(
        row,
        size_mm,
        height=0.6,
        color=_CONTRIBUTION_STYLES[kind][0],
        edgecolor="black" if kind == TRACKER else None,
        linewidth=0.6,
    )
    axis.annotate(
        f"{size_mm:.3f}",
        (size_mm, row),
        (4, 0),
        textcoords="offset points",
        va="center",
        fontsize=7,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )
