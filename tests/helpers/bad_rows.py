"""Cases with some bad rows."""

from dataclasses import replace

import numpy as np


def damaged(case, shifts):
    """A case with some of its rows shifted along x, by their places."""
    measurements = case.campaign.measurements
    position = measurements.position.copy()
    for place, shift in shifts.items():
        position[place, 0] += shift
    campaign = replace(
        case.campaign, measurements=replace(measurements, position=position)
    )
    return replace(case, campaign=campaign).select(np.ones(len(measurements), bool))
