"""Find measurements that name the wrong place: a ball that was in the other socket.

Nominal kinematics suffice, because the distance between sockets is larger than the
errors of a robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.counting import format_count
from elastocal.data_checks.placement import IMPLAUSIBLE_M, root_mean_square
from elastocal.data_checks.protocol import Fault, Value
from elastocal.fitting.least_squares import compute_nominal_poses
from elastocal.fitting.model import build_declared_model
from elastocal.fitting.observations import separate_measurements
from elastocal.measuring.point import POINT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Campaign

# A measurement belongs to another place if that place is nearer by this factor. The
# sockets of MUKCa are 50 mm apart. The nominal models of the nine arms measured in them
# are off by up to 26 mm; the wrong socket is then 1.7 times as far away. Five exchanged
# rows are detected in each of the 70 files.
_CLOSER = 1.6
# The diagnosis rejects single wrong measurements. At least this many measurements of a
# place, and at least this share of them, mean that the ball was moved to another socket
# but the recording still named the first one.
_FEWEST_ROWS = 3
_SMALLEST_SHARE = 0.1
# Number of steps of the reweighted fit, and the distance, m, below which all
# measurements have the same weight.
_STEPS = 30
_SMALLEST_M = 1e-3


@dataclass(frozen=True)
class _Touches:
    """N measurements of places.

    Attributes
    ----------
    position, rotation : (N, 3) and (N, 3, 3), nominal poses of the measuring points.
    target, place_index : (N,) int arrays; a place is one feature of one session.
    places : (G, 2) int array, session and feature of each place.
    """

    position: np.ndarray
    rotation: np.ndarray
    target: np.ndarray
    place_index: np.ndarray
    places: np.ndarray


def find_swapped_places(campaign: Campaign) -> list[Fault]:
    """Find a place whose measurements often fit another place of the same session.

    Returns at most one fault, for the place with the most such measurements.
    """
    channels = campaign.measuring.channels
    is_point = all(
        channel.kind is POINT and channel.component is None for channel in channels
    )
    if not channels or not is_point:
        return []
    return report_swapped(_compare_places(_locate_touches(campaign)), campaign)


def report_swapped(comparison: PlaceComparison, campaign: Campaign) -> list[Fault]:
    """Report the place with the most measurements that fit another place, if there are
    enough of them."""
    is_swapped = comparison.find_swapped()
    sizes = np.bincount(comparison.place_index)
    counts = np.bincount(comparison.place_index[is_swapped], minlength=len(sizes))
    worst = int(np.argmax(counts))
    if counts[worst] < max(_FEWEST_ROWS, _SMALLEST_SHARE * sizes[worst]):
        return []
    rows = is_swapped & (comparison.place_index == worst)
    fitting = int(np.bincount(comparison.nearest[rows]).argmax())
    names = [
        campaign.measuring.features[comparison.places[place_index, 1]].name
        for place_index in (worst, fitting)
    ]
    session = int(comparison.places[worst, 0])
    detail = _describe(names, session, campaign.measurements.row[rows])
    value = Value("measurements", float(counts[worst]), "–")
    evidence = (
        root_mean_square(comparison.from_named[rows]),
        root_mean_square(comparison.from_nearest[rows]),
    )
    return [Fault("swapped_places", (), detail, (value,), evidence)]


@dataclass(frozen=True)
class PlaceComparison:
    """Distances of N measurements from G places.

    Attributes
    ----------
    place_index : (N,) int array, the place that the row names.
    places : (G, 2) int array, session and feature of each place.
    from_named : (N,) array, distance from the place that the row names, m.
    from_nearest : (N,) array, distance from the nearest other place of the same session,
        m; infinite if there is none.
    nearest : (N,) int array, index of this other place.
    """

    place_index: np.ndarray
    places: np.ndarray
    from_named: np.ndarray
    from_nearest: np.ndarray
    nearest: np.ndarray

    @classmethod
    def of(
        cls,
        place_index: np.ndarray,
        places: np.ndarray,
        distance: np.ndarray,
        is_comparable: np.ndarray,
    ) -> PlaceComparison:
        """Compare each measurement with the place that it names and with the others.

        Parameters
        ----------
        place_index, places : as attributes.
        distance : (N, G) array, of each measurement from each place, m.
        is_comparable : (N, G) bool array, places that the measurement may be of.
        """
        rows = np.arange(len(distance))
        is_other = is_comparable.copy()
        is_other[rows, place_index] = False
        others = np.where(is_other, distance, np.inf)
        return cls(
            place_index=place_index,
            places=places,
            from_named=distance[rows, place_index],
            from_nearest=others.min(axis=1),
            nearest=others.argmin(axis=1),
        )

    def find_swapped(self) -> np.ndarray:
        """Find the measurements (N,) that fit another place much better than theirs."""
        is_closer = _CLOSER * self.from_nearest < self.from_named
        return (self.from_named > IMPLAUSIBLE_M) & is_closer


def _compare_places(touches: _Touches) -> PlaceComparison:
    """Compare each measurement with the place that it names and with the others."""
    places, position = _fit_places(touches)
    distance = np.linalg.norm(position[:, None] - places, axis=2)
    session = touches.places[:, 0]
    has_same_session = session[touches.place_index][:, None] == session
    return PlaceComparison.of(
        touches.place_index, touches.places, distance, has_same_session
    )


def _describe(names: Sequence[str], session: int, rows: Sequence[int]) -> str:
    """Describe the measurements of one place that fit another, in a sentence.

    `names` are those of the named place and of the fitting one; `rows` are those of the
    measurements in the table.
    """
    named, fitting = names
    return (
        f"{format_count(len(rows), 'measurement')} of {named} in session {session} (rows"
        f" {min(rows)} to {max(rows)}) fit {fitting}, as if the place had been changed and"
        " the name had not"
    )


def _locate_touches(campaign: Campaign) -> _Touches:
    """Compute nominal poses of the measuring points, and group the places."""
    measurements = campaign.measurements
    position, rotation = _compute_target_poses(campaign)
    assert measurements.channel is not None
    channels = campaign.measuring.channels
    feature = np.array([channel.feature for channel in channels], int)
    session = measurements.session
    if campaign.frame == "base":
        # Places in the base frame stay the same from session to session.
        session = np.zeros(len(measurements), int)
    keys = np.column_stack([session, feature[measurements.channel]])
    first, place_index = group_equal_rows(keys)
    return _Touches(position, rotation, measurements.target, place_index, keys[first])


def _compute_target_poses(campaign: Campaign) -> tuple[np.ndarray, np.ndarray]:
    """Compute nominal positions (N, 3), m, and rotations (N, 3, 3) of the targets in the
    base frame; a target with an unknown offset is on its measuring point."""
    position, rotation = compute_nominal_poses(
        build_declared_model(campaign), separate_measurements(campaign.measurements)
    )
    offsets_m = [target.offset_m or (0.0, 0.0, 0.0) for target in campaign.targets]
    offset_m = np.array(offsets_m)[campaign.measurements.target]
    return position + (rotation @ offset_m[..., None])[..., 0], rotation


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
    offset_columns = _list_offset_columns(touches)
    weight = np.ones(len(touches.position))
    position = touches.position
    places = np.zeros((len(touches.places), 3))
    for _ in range(_STEPS):
        mean_position = _average_places(touches.position, weight, touches.place_index)
        mean_columns = _average_places(offset_columns, weight, touches.place_index)
        scale = np.sqrt(weight)[:, None]
        design = (offset_columns - mean_columns[touches.place_index]) * scale[..., None]
        response = (touches.position - mean_position[touches.place_index]) * scale
        offsets = np.linalg.lstsq(
            design.reshape(response.size, -1), -response.ravel(), rcond=None
        )[0]
        position = touches.position + offset_columns @ offsets
        places = mean_position + mean_columns @ offsets
        distance = np.linalg.norm(position - places[touches.place_index], axis=1)
        weight = 1.0 / np.maximum(distance, _SMALLEST_M)
    return places, position


def _list_offset_columns(touches: _Touches) -> np.ndarray:
    """Derivatives (N, 3, 3 T) of the positions in the offsets of the T targets."""
    count = len(touches.position)
    target_count = touches.target.max() + 1
    columns = np.zeros((count, 3, target_count, 3))
    columns[np.arange(count), :, touches.target] = touches.rotation
    return columns.reshape(count, 3, 3 * target_count)


def _average_places(
    values: np.ndarray, weight: np.ndarray, place_index: np.ndarray
) -> np.ndarray:
    """Weighted means (G, ...) of values (N, ...) over the measurements of each place."""
    by_row = (-1, *[1] * (values.ndim - 1))
    total = np.bincount(place_index, weight)
    sums = np.zeros((len(total), *values.shape[1:]))
    np.add.at(sums, place_index, weight.reshape(by_row) * values)
    return np.asarray(sums / total.reshape(by_row))
