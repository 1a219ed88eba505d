"""Cases with some bad rows."""

from dataclasses import replace

import numpy as np


def damaged(case, shifts_m):
    """Return a case with rows, by their indices, that are shifted along x."""
    measurements = case.campaign.measurements
    position = measurements.position.copy()
    for row, shift_m in shifts_m.items():
        position[row, 0] += shift_m
    campaign = replace(
        case.campaign, measurements=replace(measurements, position=position)
    )
    # Selecting all rows makes the observations of the case anew.
    return replace(case, campaign=campaign).select(np.ones(len(measurements), bool))
