"""Measurements that this robot cannot have made, however the file is read: nothing can be traced in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.data_checks.geometry import explained_by_geometry
from elastocal.data_checks.placement import IMPLAUSIBLE_M, IMPLAUSIBLE_RAD, placed, rms, robustly_placed, spread, trimmed_rms
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements

NAMES, FAMILY, AFTER = ("implausible_measurements",), "data", ("constant_columns", "alternatives", "shuffled_rows")

# Five times what no geometric error and no deflection makes.
_FARTHEST_M, _FARTHEST_RAD = 5 * IMPLAUSIBLE_M, 5 * IMPLAUSIBLE_RAD


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """Measurements absurdly far from the nominal robot, for a reason that no other fault names.

    Returns one, or none.
    """
    some = spread(measurements)
    # Nearly all campaigns are done with the first, which takes a sixth of the time.
    for place in (placed, robustly_placed):
        placement = place(campaign, some)
        away = trimmed_rms(placement.distance)
        turned = 0.0 if placement.turn is None else trimmed_rms(placement.turn)
        if away < _FARTHEST_M and turned < _FARTHEST_RAD:
            return []
    if explained_by_geometry(campaign, some):
        return []
    what = f"positions lie {away:.2g} m" if away >= _FARTHEST_M else f"orientations lie {turned:.2g} rad"
    detail = (
        f"{what} (RMS) from where the robot file puts them, and no other sense, unit, axis, frame or order of rows that was"
        " tried mends it: chain, zeros of the joints, measuring points and columns need a look"
    )
    parameters = (Value("RMS distance of positions", away, "m"), Value("RMS turn of orientations", turned, "rad"))
    return [Fault(NAMES[0], (), detail, parameters, (rms(placement.distance),) * 2, (), True)]
