"""What a second target is worth at every place of the arm, and how often a tracker sees it there."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from elastocal.figures.style import panels, styled

# Light to dark, so that it prints in grey.
_COLOURS = "viridis_r"


@styled
def arm_map(table: pd.DataFrame, outlines: Mapping[str, np.ndarray], titles: Mapping[str, str]) -> Figure:
    """Side views of the arms, each place coloured by the error with a target there, over that with none.

    `table`: from `question_tables.places_table`. `outlines` (K, 3): corners of each robot's arm in one posture, m. `titles`:
    name of each robot to draw, by its key.
    """
    figure, axes = panels(1, len(titles), 104, sharex=True, sharey=True)
    scale = Normalize(1.0, table.ratio.max())
    for axis, (robot, title) in zip(axes[0], titles.items(), strict=True):
        _draw_arm(axis, table[table.robot == robot], outlines[robot], scale)
        axis.set(title=title, xlabel="x (m)", aspect="equal")
        axis.margins(0.1, 0.06)
    axes[0, 0].set_ylabel("z (m)")
    # Room for words beside the flange.
    axes[0, 0].set_xlim(None, 1.0 + max(corners[:, 0].max() for corners in outlines.values()))
    label = "RMS error with a second target there\nover that of as many measurements of the end-effector"
    figure.colorbar(ScalarMappable(scale, _COLOURS), ax=axes[0].tolist(), location="bottom", aspect=50, shrink=0.7, label=label)
    return figure


def draw_links(axis: Axes, plane: np.ndarray) -> None:
    """The corners (K, 2) of an arm joined, behind all else."""
    style: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round", "gid": "arm"}
    axis.plot(*plane.T, color="#c8c8c8", linewidth=6, zorder=1, **style)


def _draw_arm(axis: Axes, cells: pd.DataFrame, corners: np.ndarray, scale: Normalize) -> None:
    plane = corners[:, [0, 2]]
    draw_links(axis, plane)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    on_links = cells[~cells.side.str.startswith("bar")]
    for joints, link in on_links.groupby("joints"):
        by_place = link.groupby("along_m").agg({"ratio": "mean", "seen_turned_percent": "max"})
        places = np.column_stack([np.interp(by_place.index, way, column) for column in plane.T])
        edge: dict[str, Any] = {"s": 34, "edgecolors": "black", "linewidths": 0.6, "zorder": 2}
        axis.scatter(places[:, 0], places[:, 1], c=by_place.ratio, cmap=_COLOURS, norm=scale, **edge)
        # One of a link tells of its neighbours.
        chosen = len(by_place) - 1 if joints == cells.joints.max() else len(by_place) // 2
        words = f"{by_place.ratio.iloc[chosen]:.2f}, seen {by_place.seen_turned_percent.iloc[chosen]:.0f} %"
        axis.annotate(words, places[chosen], (7, -9), textcoords="offset points", ha="left", va="center", fontsize=7)
