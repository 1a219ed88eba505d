"""Reliability diagram of the blind proof: how often what was stated with a probability is so."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.figures.style import note, panels, styled
from elastocal_proof.figures.blind_rates import LOOKS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@styled
def reliability_diagram(reliability: pd.DataFrame) -> Figure:
    """Shares of cases whose most probable set of mechanisms is true, against what was stated, and numbers of cases.

    `reliability`: of reports/blind/reliability.csv.
    """
    rows = reliability[reliability.group == "all"]
    if rows.empty:
        return note("No verdict of this run states a probability.")
    figure, axes = panels(2, 1, 118, height_ratios=(3, 1), sharex=True)
    shares, counts = axes[0, 0], axes[1, 0]
    shares.plot([0, 1], [0, 1], color="black", linewidth=0.8, linestyle=":")
    present = [robots for robots in LOOKS if robots in set(rows.robots)]
    for number, robots in enumerate(present):
        color, marker, label = LOOKS[robots]
        part = rows[rows.robots == robots]
        errors = [part.rate - part.low, part.high - part.rate]
        shares.errorbar(part.stated, part.rate, errors, color=color, marker=marker, markersize=4.5, linewidth=1.2, label=label)
        width = (part["to"] - part["from"]) * 0.8 / len(present)
        left = part["from"] + 0.1 * (part["to"] - part["from"]) + number * width
        counts.bar(left, part.cases, width, align="edge", color=color)
    shares.set(xlim=(0, 1), ylim=(0, 1), ylabel="share of cases in which it is true")
    counts.set(yscale="log", xlabel="stated probability of the most probable mechanisms", ylabel="cases")
    shares.legend(loc="upper left")
    return figure
