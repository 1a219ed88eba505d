"""Find measurements that name the wrong place: a ball that was in the other socket.

Only nominal kinematics are needed, because sockets lie farther apart than a robot errs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.counting import format_count
from elastocal.data_checks.placement import IMPLAUSIBLE_M, root_mean_square
from elastocal.data_checks.protocol import Fault, Value
from elastocal.mechanics.kinematics import compute_poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Campaign

POINT = "point"
# A measurement belongs to another place if that one is nearer by this factor. Sockets of
# MUKCa are 50 mm apart. Of nine arms measured in them, nominal models are off by up to
# 26 mm, and the other socket is then 1.7 times as far away; five exchanged rows are named
# in each of the 70 files.
_CLOSER = 1.6
# Single wrong measurements are left to the diagnosis, which leaves them out; so many of a
# place, and this share of them, are a file that was not changed in time.
_FEWEST_ROWS = 3
_SMALLEST_SHARE = 0.1
# Steps of the reweighted fit, and the distance below which weights are equal.
_STEPS = 30
_SMALLEST_M = 1e-3


@dataclass(frozen=True)
class _Touches:
    """N measurements of places.

    Attributes
    ----------
    position, rotation : (N, 3) and (N, 3, 3), nominal poses of the measuring points.
    target, place : (N,) int arrays; a place is one feature of one session.
    label : session and feature of each place.
    """

    position: np.ndarray
    rotation: np.ndarray
    target: np.ndarray
    place: np.ndarray
    label: np.ndarray


def find_swapped_places(campaign: Campaign) -> list[Fault]:
    """Find places of whose measurements many fit another place of the same session.

    Returns at most one fault, of the place with most of them.
    """
    channels = campaign.measuring.channels
    is_point = all(
        channel.kind.name == POINT and channel.component is None for channel in channels
    )
    if not channels or not is_point:
        return []
    touches = _locate_touches(campaign)
    comparison = _compare_places(touches)
    is_swapped = (comparison.own > IMPLAUSIBLE_M) & (
        _CLOSER * comparison.other < comparison.own
    )
    sizes = np.bincount(touches.place)
    counts = np.bincount(touches.place[is_swapped], minlength=len(sizes))
    worst = int(np.argmax(counts))
    if counts[worst] < max(_FEWEST_ROWS, _SMALLEST_SHARE * sizes[worst]):
        return []
    rows = is_swapped & (touches.place == worst)
    found = int(np.bincount(comparison.nearest[rows]).argmax())
    names = [
        campaign.measuring.features[touches.label[number, 1]].name
        for number in (worst, found)
    ]
    session = int(touches.label[worst, 0])
    detail = _describe(names, session, campaign.measurements.row[rows])
    value = Value("measurements", float(counts[worst]), "–")
    evidence = (
        root_mean_square(comparison.own[rows]),
        root_mean_square(comparison.other[rows]),
    )
    return [Fault("swapped_places", (), detail, (value,), evidence)]


@dataclass(frozen=True)
class _Comparison:
    """Distances of N measurements from places.

    Attributes
    ----------
    own : (N,) from the place that is named, m.
    other : (N,) from the nearest other place of the same session, m; infinite if there
        is none.
    nearest : (N,) that other place.
    """

    own: np.ndarray
    other: np.ndarray
    nearest: np.ndarray


def _compare_places(touches: _Touches) -> _Comparison:
    """Compare each measurement with the place that it names and with the others."""
    places, position = _fit_places(touches)
    distance = np.linalg.norm(position[:, None] - places, axis=2)
    rows = np.arange(len(position))
    session = touches.label[:, 0]
    is_other = session[touches.place][:, None] == session
    is_other[rows, touches.place] = False
    others = np.where(is_other, distance, np.inf)
    return _Comparison(
        distance[rows, touches.place], others.min(axis=1), others.argmin(axis=1)
    )


def _describe(names: Sequence[str], session: int, rows: Sequence[int]) -> str:
    """Sentence on the measurements of a place in a session that fit another one."""
    name, other = names
    return (
        f"{format_count(len(rows), 'measurement')} of {name} in session {session} (rows"
        f" {min(rows)} to {max(rows)}) fit {other}, as if the place had been changed and"
        " the name had not"
    )


def _locate_touches(campaign: Campaign) -> _Touches:
    """Compute nominal poses of the measuring points, and group the places."""
    measurements = campaign.measurements
    channels = campaign.measuring.channels
    count = len(measurements)
    position = np.zeros((count, 3))
    rotation = np.zeros((count, 3, 3))
    chain = campaign.robot.chain
    for number, target in enumerate(campaign.targets):
        rows = measurements.target == number
        offset_m = target.offset_m or (0.0, 0.0, 0.0)
        point = replace(chain.point(target.point), offset_m=tuple(offset_m))
        position[rows], rotation[rows] = compute_poses(
            chain, measurements.joint_angles[rows], point
        )
    assert measurements.channel is not None
    feature = np.array([channel.feature for channel in channels], int)
    stays = campaign.frame == "base"
    session = np.zeros(count, int) if stays else measurements.session
    keys = np.column_stack([session, feature[measurements.channel]])
    first, place = group_equal_rows(keys)
    return _Touches(position, rotation, measurements.target, place, keys[first])


def _fit_places(touches: _Touches) -> tuple[np.ndarray, np.ndarray]:
    """Fit the offset of each target and the places by least absolute distances, which
    wrong measurements do not move [1]_.

    Returns
    -------
    places (G, 3) and positions of the targets (N, 3), m

    References
    ----------
    .. [1] Weiszfeld, Sur le point pour lequel la somme des distances de n points donnés
       est minimum, Tôhoku Mathematical Journal 43, 1937.
    """
    count = len(touches.place)
    targets = touches.target.max() + 1
    columns = np.zeros((count, 3, targets, 3))
    columns[np.arange(count), :, touches.target] = touches.rotation
    columns = columns.reshape(count, 3, 3 * targets)
    weight = np.ones(count)
    position = touches.position
    places = np.zeros((len(touches.label), 3))
    for _ in range(_STEPS):
        total = np.bincount(touches.place, weight)
        means = []
        for values in (touches.position, columns):
            sums = np.zeros((len(total), *values.shape[1:]))
            shaped = weight.reshape(-1, *[1] * (values.ndim - 1))
            np.add.at(sums, touches.place, shaped * values)
            means.append(sums / total.reshape(-1, *[1] * (values.ndim - 1)))
        scale = np.sqrt(weight)[:, None]
        design = (columns - means[1][touches.place]) * scale[..., None]
        response = (touches.position - means[0][touches.place]) * scale
        offsets = np.linalg.lstsq(
            design.reshape(3 * count, -1), -response.ravel(), rcond=None
        )[0]
        position = touches.position + columns @ offsets
        places = means[0] + means[1] @ offsets
        distance = np.linalg.norm(position - places[touches.place], axis=1)
        weight = 1.0 / np.maximum(distance, _SMALLEST_M)
    return places, position
