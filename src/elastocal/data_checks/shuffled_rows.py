"""Positions beside the angles of other rows.

A row is out of place where it is absurdly far from the nominal robot as it stands, and where another place is not only better
but clearly nearer than chance would have it: among many points some point is always near.

Where frames are fitted, most rows must be in place; elsewhere all may be out of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from elastocal.data_checks.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    placed_by,
    rms,
    robust_sigma,
    robustly_placed,
    spread,
)
from elastocal.data_checks.protocol import Fault, Value
from elastocal.fitting.observations import state_clusters

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.placement import Placement

NAMES, FAMILY, AFTER = ("shuffled_rows",), "data", ("constant_columns", "alternatives")

# A row is out of place beyond so many robust standard deviations of the others, and back in place within so many.
_OUT_OF_PLACE, _IN_PLACE = 20.0, 5.0
# A place is no chance if it is so much nearer than other poses are to each other; so for this share of the rows.
_NO_CHANCE, _MOST = 0.25, 0.8
_FEWEST_ROWS = 2
# Places closer than this are one place.
_SAME_PLACE_M = 1e-3
# Rows in place tell how well rows in place fit, if they are so many.
_FEWEST_IN_PLACE = 10
# Orientations distinguish places as points at this distance from the target would, m.
_ARM_M = 0.5
# No robot nor tracker reaches so far.
_SESSIONS_APART_M = 1e5


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """Rows whose measured columns belong to other rows."""
    some = robustly_placed(campaign, spread(measurements))
    # One fit to some poses serves all: it only has to be good to a few centimetres.
    as_written = placed_by(campaign, measurements, some.estimate)
    if (as_written.distance > IMPLAUSIBLE_M).sum() < _FEWEST_ROWS:
        return []
    return _matched(measurements, as_written)


def _matched(measurements: Measurements, beside: Placement) -> list[Fault]:
    """The fault that some rows fit in the places of each other, as well as rows fit that are in place."""
    distance, level = beside.distance, IMPLAUSIBLE_M
    out = distance > IMPLAUSIBLE_M
    if (~out).sum() >= _FEWEST_IN_PLACE:
        sigma = robust_sigma(distance[~out], 3)
        out &= distance > _OUT_OF_PLACE * sigma
        # Loads move some targets much more than others.
        level = max(_IN_PLACE * sigma, 2.0 * np.quantile(distance[~out], 0.95), _SAME_PLACE_M)
    rows = np.flatnonzero(out)
    if len(rows) < _FEWEST_ROWS:
        return []
    predicted = _places(measurements, beside.predicted, beside.predicted_rotation)[rows]
    measured = _places(measurements, beside.measured, beside.measured_rotation)[rows]
    left, number = map(np.asarray, cKDTree(measured).query(predicted))
    source = rows[number]
    back = (left < level) & (left < _NO_CHANCE * _spacing(predicted)) & (source != rows)
    # Each measurement has one place: one that stands for many is no permutation.
    pose = state_clusters(measurements)
    taken = len(np.unique(pose[source[back]])), len(np.unique(pose[rows[back]]))
    if back.sum() < max(_FEWEST_ROWS, _MOST * len(rows)) or taken[0] < _MOST * taken[1]:
        return []
    before, after = rms(distance[rows]), rms(left[back])
    if after > before / FAR_BETTER:
        return []
    detail = f"{back.sum()} of {len(measurements)} rows fit with the measured columns of another one of them"
    concerned = tuple(sorted(measurements.row[rows[back]].tolist()))
    share = Value("share of the measurements", float(back.mean() * len(rows) / len(measurements)), "–")
    return [Fault(NAMES[0], (), detail, (share,), (before, after), concerned, True)]


def _places(measurements: Measurements, position: np.ndarray, rotation: np.ndarray | None) -> np.ndarray:
    """Positions and, where they are measured, orientations as points whose distances are in m, sessions far apart."""
    parts = [position, _SESSIONS_APART_M * measurements.session[:, None]]
    if rotation is not None:
        # A small angle changes the nine entries, taken together, by the square root of two times itself.
        parts.append(_ARM_M / np.sqrt(2) * rotation.reshape(len(rotation), 9))
    return np.concatenate(parts, axis=1)


def _spacing(points: np.ndarray) -> np.ndarray:
    """How far from each of some points (N, .) the next place of its session is, 0 where there is none, ndarray (N,), m."""
    # One of each place.
    places = points[np.unique(np.round(points / _SAME_PLACE_M), axis=0, return_index=True)[1]]
    near = np.reshape(cKDTree(places).query(points, k=min(4, len(places)))[0], (len(points), -1))
    other = np.where(near > 2 * _SAME_PLACE_M, near, np.inf).min(axis=1)
    return np.where(other < _SESSIONS_APART_M / 2, other, 0.0)
