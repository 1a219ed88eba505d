"""Measurements that this robot cannot have made, however the file is read: nothing can be traced in them.

Another robot than its file is the honest alternative: a link that is centimetres longer, or a joint that was mastered degrees
off, is an error of the robot, and no fault of what was measured.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.placement import (
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    at_targets,
    free_columns,
    placed,
    rms,
    robustly_placed,
    spread,
    trimmed_rms,
)
from elastocal.data_checks.protocol import Fault, Value
from elastocal.mechanics.chain import with_inserted

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.placement import Placement
    from elastocal.mechanics.chain import Chain

NAMES, FAMILY, AFTER = ("implausible_measurements",), "data", ("constant_columns", "alternatives", "shuffled_rows")

# Five times what no geometric error and no deflection makes.
_FARTHEST_M, _FARTHEST_RAD = 5 * IMPLAUSIBLE_M, 5 * IMPLAUSIBLE_RAD

_SIX = [("T", 0), ("T", 1), ("T", 2), ("R", 0), ("R", 1), ("R", 2)]
# Standard deviations of the place and of the turn of each link, m and rad, and how many of them an honest robot is off by.
_WIDE, _FARTHEST = np.array([0.03] * 3 + [0.1] * 3), 3.0
# What such a geometry leaves of a robot that bends and has gears.
_LEFT_M, _ROUNDS = 1e-3, 6


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
    if _explained_by_geometry(campaign, some):
        return []
    what = f"positions lie {away:.2g} m" if away >= _FARTHEST_M else f"orientations lie {turned:.2g} rad"
    detail = (
        f"{what} (RMS) from where the robot file puts them, and no other sense, unit, axis, frame or order of rows that was"
        " tried mends it: chain, zeros of the joints, measuring points and columns need a look"
    )
    parameters = (Value("RMS distance of positions", away, "m"), Value("RMS turn of orientations", turned, "rad"))
    return [Fault(NAMES[0], (), detail, parameters, (rms(placement.distance),) * 2, (), True)]


def _explained_by_geometry(campaign: Campaign, measurements: Measurements) -> bool:
    """Whether links shifted and turned within wide priors bring absurd measurements to where a robot may be off by.

    Maximum of the posterior by Gauss-Newton steps: behind each joint, and at the foot where frames are declared, a small shift
    and turn with a normal prior about zero, beside frames and targets that are fitted freely.
    """
    chain = campaign.robot.chain
    places = [place + 1 for place, t in enumerate(chain.transforms) if t.coordinate is not None and not chain.is_passive(place)]
    inserted = {place: _SIX for place in ([0] if campaign.frame == "base" else []) + places}
    extended, wide = with_inserted(chain, inserted), np.tile(_WIDE, len(inserted))
    values = np.zeros(len(wide))
    for _ in range(_ROUNDS):
        constants = dict(enumerate(values.tolist(), chain.coordinates))
        fixed = [
            replace(t, constant=constants[t.coordinate], coordinate=None) if t.coordinate in constants else t
            for t in extended.transforms
        ]
        arm = replace(extended, transforms=tuple(fixed), coordinates=chain.coordinates)
        placement = robustly_placed(replace(campaign, robot=replace(campaign.robot, chain=arm)), measurements)
        turned = 0.0 if placement.turn is None else trimmed_rms(placement.turn)
        if trimmed_rms(placement.distance) < IMPLAUSIBLE_M and turned < IMPLAUSIBLE_RAD:
            return bool((np.abs(values) <= _FARTHEST * wide).all())
        values = values + _step(campaign, measurements, extended, values, wide, placement)
    return False


def _step(
    campaign: Campaign,
    measurements: Measurements,
    extended: Chain,
    values: np.ndarray,
    wide: np.ndarray,
    placement: Placement,
) -> np.ndarray:
    """Gauss-Newton step of the shifts and turns that are inserted into a chain, ndarray (6 L,), m and rad."""
    angles = measurements.joint_angles
    coordinates = np.concatenate([angles, np.tile(values, (len(angles), 1))], axis=1)
    _, rotation, whole = at_targets(extended, coordinates, campaign, measurements, placement.estimate)
    jacobian = whole[..., angles.shape[1] :]
    free = free_columns(campaign, measurements, rotation, placement.predicted)
    columns = np.concatenate([jacobian * wide, *free], axis=-1) / _LEFT_M
    left = (placement.measured - placement.predicted) / _LEFT_M
    # Those that lie far from the others take no part, as in `robustly_placed`.
    kept = placement.distance <= np.quantile(placement.distance, 0.9)
    flat = columns[kept].reshape(-1, columns.shape[-1])
    prior = np.concatenate([np.ones(len(wide)), np.zeros(columns.shape[-1] - len(wide))])
    target = flat.T @ left[kept].ravel() - prior * np.pad(values / wide, (0, len(prior) - len(wide)))
    return wide * np.linalg.lstsq(flat.T @ flat + np.diag(prior), target, rcond=1e-14)[0][: len(wide)]
