"""Single measurements far from where the declared model puts them, beside all others of their target.

They stop nothing: every fit gives them little weight. They are named so that somebody can look at them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.placement import (
    IMPLAUSIBLE_M,
    robust_sigma,
    robustly_placed,
    single_observations,
    spread,
    trimmed_rms,
)
from elastocal.data_checks.protocol import Fault, Value
from elastocal.effects.catalogue import declared_candidates
from elastocal.fitting.displacement import conditions
from elastocal.fitting.least_squares import ON_THE_WAY, fit
from elastocal.fitting.memory import observations_at_once
from elastocal.fitting.model import declared_model
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import averaged, part_at, parts_of, select_states, spread_poses
from elastocal.fitting.prediction import residuals

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements

NAMES, FAMILY, AFTER = ("outliers",), "data", ("constant_columns", "alternatives", "loads", "shuffled_rows", "implausible")

# Robust standard deviations of the measurements of one target.
_FAR = 8.0
# Where the model lacks something large residuals are many, and no outliers: nine measurements in ten are less than a third as
# far.
_BULK, _BEYOND_BULK = 0.9, 3.0
# Fewer measurements of a target do not tell its standard deviation.
_FEWEST = 20
# No sensor reads closer: smaller deviations are rounding.
_FINEST = 1e-5
# Measurements that a fit needs at most to tell which others are far from it.
_MOST_FITTED = 20_000
# All measurements count alike, whatever their noise.
_ALIKE = 1e-3


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """Measurements far from the declared model.

    Lengths of residuals against their robust standard deviation, see `placement.robust_sigma`.

    Parameters
    ----------
    campaign : Campaign
    measurements : Measurements

    Returns
    -------
    list of Fault
        One for all of them, or none.
    """
    if trimmed_rms(robustly_placed(campaign, spread(measurements)).distance) > IMPLAUSIBLE_M:
        # Where nothing fits, nothing stands apart.
        return []
    sites = declared_model(campaign).sites
    model = declared_model(campaign, declared_candidates(campaign.declared, sites))
    noise = Noise("declared", _ALIKE, _ALIKE, np.zeros(campaign.robot.joints))
    some = averaged(measurements)
    some = select_states(some, spread_poses(some, _MOST_FITTED))
    # An outlier is many standard deviations away: a tenth of a standard error in a parameter moves none across that line.
    estimate, single = fit(model, some, noise, settled=ON_THE_WAY).estimate, single_observations(measurements)
    residual = np.empty((len(measurements), model.rows))
    for states, seen in parts_of(single, observations_at_once(model.rows, 0)):
        part = part_at(single, states, seen)
        residual[seen] = residuals(model, estimate, part, conditions(model, estimate, part.states))
    far = np.zeros(len(measurements), bool)
    for target in np.unique(measurements.target):
        members = np.flatnonzero(measurements.target == target)
        if len(members) < _FEWEST:
            continue
        for first in range(0, model.rows, 3):
            distance = np.linalg.norm(residual[members, first : first + 3], axis=1)
            limit = max(_FAR * max(robust_sigma(distance, 3), _FINEST), _BEYOND_BULK * np.quantile(distance, _BULK))
            far[members] |= distance > limit
    if not far.any():
        return []
    count, rows = int(far.sum()), np.sort(measurements.row[far])
    several = (
        f"{count} of {len(measurements)} measurements lie" if count > 1 else f"one of {len(measurements)} measurements lies"
    )
    detail = f"{several} more than {_FAR:g} robust standard deviations from the declared model and counts little"
    detail = detail.replace("counts", "count") if count > 1 else detail
    share = Value("share of the measurements", count / len(measurements), "–")
    evidence = _rms(residual[:, :3]), _rms(residual[~far, :3])
    return [Fault(NAMES[0], (), detail, (share,), evidence, tuple(rows.tolist()), False)]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).sum(axis=1).mean()))
