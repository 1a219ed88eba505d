"""Figure of a verified robot: the error of each target before the correction, as
predicted and as measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.figures.style import (
    MILLI,
    PALETTE,
    STAGES,
    add_legend_below,
    create_panels,
    label_decades,
    styled,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_HEIGHT_MM = 85
# Lower end of the axis as a share of the smallest shown error, and the smallest error
# that is shown, mm.
_BELOW = 0.7
_SMALLEST_MM = 1e-3


@styled
def draw_verification(
    table: pd.DataFrame, noise_m: float, tolerance_m: float | None
) -> Figure:
    """Draw the errors of each target on a logarithmic axis.

    Parameters
    ----------
    table
        Rows of `verification.Verification.table`.
    noise_m : float, m
        RMS length of the tracker's noise.
    tolerance_m : float or None, m
        Tolerance of the RMS error, if there is one.
    """
    figure, axes = create_panels(1, 1, _HEIGHT_MM)
    axis = axes[0, 0]
    number = table["target"].to_numpy()

    def convert_to_mm(column: str) -> np.ndarray:
        return np.maximum(MILLI * table[column].to_numpy(float), _SMALLEST_MM)

    before = convert_to_mm("predicted_error_before_m")
    predicted = convert_to_mm("predicted_error_after_m")
    measured = convert_to_mm("measured_error_m")
    axis.plot(number, before, ".", color=STAGES["before"][1], label="before, predicted")
    axis.plot(
        number, predicted, "_", color=PALETTE[2], label="corrected, predicted RMS"
    )
    axis.plot(
        number,
        MILLI * table["bound_with_noise_m"].to_numpy(float),
        "-",
        color=PALETTE[2],
        alpha=0.5,
        label="95 % bound with the tracker's noise",
    )
    axis.plot(
        number,
        measured,
        "o",
        color=STAGES["after"][1],
        markersize=3.5,
        label="corrected, measured",
    )
    noise_mm = MILLI * noise_m
    axis.axhline(noise_mm, color="black", ls=":", label="noise of the tracker alone")
    if tolerance_m is not None:
        axis.axhline(
            MILLI * tolerance_m,
            color=PALETTE[1],
            ls="--",
            label=f"tolerance {MILLI * tolerance_m:g} mm (RMS)",
        )
    lowest = min(predicted.min(), measured.min(), noise_mm or np.inf)
    axis.set(
        xlabel="target, as its row in targets.csv",
        ylabel="position error (mm)",
        yscale="log",
    )
    axis.set_ylim(bottom=_BELOW * lowest)
    label_decades(axis.yaxis)
    add_legend_below(figure, 3)
    return figure
