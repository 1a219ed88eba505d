"""Kinds, features and channels of the measurements of a campaign.

A channel is a kind of measurement of one feature. If all kinds of a campaign have the
same number of components, a row is one measurement with these components. Otherwise each
component is a measurement of its own, with its own channel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.errors import InputError, suggest_names
from elastocal.measuring.catalogue import list_kinds
from elastocal.measuring.protocol import UNKNOWN, Feature, Kind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_KEY = "features"
_DISTANCES = "distances"
# Upper bound on the places that are located by the distances between them.
_MOST_PLACES_BY_DISTANCES = 3


@dataclass(frozen=True)
class Channel:
    """One kind of measurement of one feature, or one component of it.

    Attributes
    ----------
    kind : the kind.
    feature : index of the feature; None if the kind has none.
    component : number of the component; None for all of them.
    """

    kind: Kind
    feature: int | None = None
    component: int | None = None

    @property
    def is_angle(self) -> bool:
        """Whether the measurement is one component of a rotation, rad."""
        return self.component is not None and self.component >= 3


@dataclass(frozen=True)
class MeasuringPlan:
    """Kinds, features and channels of a campaign.

    Attributes
    ----------
    kinds : kinds of its rows.
    features : objects that are touched, or against which the target is measured.
    channels : channels of its measurements; empty if every row is the pose or position
        of a target, which needs neither features nor components.
    rows : numbers in one measurement.
    camera : mounting of the camera that sees a board, as `measuring.board` names it;
        empty if not stated.
    """

    kinds: tuple[Kind, ...]
    features: tuple[Feature, ...] = ()
    channels: tuple[Channel, ...] = ()
    rows: int = 3
    camera: str = ""

    @property
    def has_orientations(self) -> bool:
        """Whether any row states an orientation."""
        return any(kind.numbers == 6 for kind in self.kinds)

    @property
    def is_tracked(self) -> bool:
        """Whether all measurements are positions or poses of an instrument, which has
        lengths of its own."""
        return {kind.name for kind in self.kinds} <= {"position", "pose"}

    @property
    def error(self) -> str:
        """What the length of a residual is, in words."""
        return " or ".join(dict.fromkeys(kind.error for kind in self.kinds))

    @property
    def states_places(self) -> bool:
        """Whether any row says where the target is in the frame of the session."""
        return any(kind.reads_poses for kind in self.kinds) or any(
            feature.stated.get("position_m", UNKNOWN) != UNKNOWN
            for feature in self.features
        )

    def shows_lengths(self, numbers: np.ndarray) -> bool:
        """Whether the measurements contain any length, so that they show a common scale of
        the robot. Contacts with features whose places and radii are unknown do not.

        `numbers` are the numbers (M, r) of all rows, m or rad, zero for a contact.
        """
        by_name = {kind.name: kind for kind in self.kinds}
        has_stated_length = any(
            by_name[feature.kind].states_length(feature) for feature in self.features
        )
        are_contacts = all(kind.is_contact for kind in self.kinds)
        return has_stated_length or not are_contacts or bool(numbers.any())

    def is_touch_alone(self, numbers: np.ndarray) -> bool:
        """Whether all rows are contacts with a single number, such as those with planes
        and spheres; `numbers` as in `shows_lengths`."""
        return all(
            kind.is_contact and kind.numbers == 1 for kind in self.kinds
        ) and not bool(numbers.any())

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns with the numbers of all kinds, in their order."""
        names = [name for kind in self.kinds for name in kind.columns]
        return tuple(dict.fromkeys(names))

    def find_channels(self, kind: Kind, feature: int | None) -> list[int]:
        """Indices of the channels of a row."""
        return [
            index
            for index, channel in enumerate(self.channels)
            if channel.kind is kind and channel.feature == feature
        ]


def parse_measuring(document: Mapping[str, Any], source: str) -> MeasuringPlan:
    """Parse kinds and features of ``campaign.yaml``.

    Raises
    ------
    InputError
        A kind is unknown, or a feature is not as its kind needs it.
    """
    available = list_kinds()
    measured = document["measured"]
    names = [measured] if isinstance(measured, str) else list(measured)
    for name in names:
        if name not in available:
            allowed = suggest_names(name, list(available))
            raise InputError(source, "measured", repr(name), allowed)
    kinds = tuple(available[name] for name in dict.fromkeys(names))
    features = _parse_features(document, kinds, source)
    numbers = {kind.numbers for kind in kinds}
    rows = numbers.pop() if len(numbers) == 1 else 1
    plan = MeasuringPlan(kinds, features, (), rows, document.get("camera", ""))
    if len(kinds) == 1 and kinds[0].reads_poses:
        return plan
    return replace(plan, channels=_list_channels(kinds, features, rows))


def _list_channels(
    kinds: Sequence[Kind], features: Sequence[Feature], rows: int
) -> tuple[Channel, ...]:
    """List the channels of every kind and feature, with components if rows have several
    numbers and a measurement has one."""
    channels: list[Channel] = []
    for kind in kinds:
        indices: list[int | None] = [None]
        if not kind.reads_poses:
            indices = [
                index
                for index, feature in enumerate(features)
                if feature.kind == kind.name
            ]
        for index in indices:
            if kind.numbers == rows:
                channels.append(Channel(kind, index))
            else:
                channels += [
                    Channel(kind, index, component) for component in range(kind.numbers)
                ]
    return tuple(channels)


def _parse_features(
    document: Mapping[str, Any], kinds: Sequence[Kind], source: str
) -> tuple[Feature, ...]:
    """Parse the features, each of a kind of the campaign."""
    with_features = [kind for kind in kinds if not kind.reads_poses]
    described = document.get(_KEY, {})
    by_name = {kind.name: kind for kind in with_features}
    features = []
    for name, keys in described.items():
        if not isinstance(name, str):
            allowed = "a name, in quotes if necessary"
            raise InputError(source, _KEY, f"the name {name!r}", allowed)
        stated = {key: value for key, value in keys.items() if key != "kind"}
        kind = keys.get("kind", with_features[0].name if len(by_name) == 1 else "")
        if kind not in by_name:
            allowed = (
                f"a kind of `measured` with features: {', '.join(by_name) or 'none'}"
            )
            raise InputError(source, f"{_KEY}.{name}.kind", repr(kind), allowed)
        features.append(Feature(name, kind, stated, source))
    features = _place_by_distances(document, features, source)
    for feature in features:
        by_name[feature.kind].check(feature)
    for kind in with_features:
        if all(feature.kind != kind.name for feature in features):
            allowed = f"a feature with kind: {kind.name}"
            raise InputError(source, _KEY, f"none of kind {kind.name}", allowed)
    return tuple(features)


def _place_by_distances(
    document: Mapping[str, Any], features: list[Feature], source: str
) -> list[Feature]:
    """Turn stated distances between two or three places into coordinates with standard
    deviations, in a frame with the first place at its origin."""
    distances = document.get(_DISTANCES, [])
    if not distances:
        return features
    if document["frame"] == "base":
        allowed = "frame: unknown, because distances say nothing of the base"
        raise InputError(source, _DISTANCES, "frame: base", allowed)
    names = [feature.name for feature in features if feature.kind == "point"]
    stated = _read_distances(distances, names, source)
    linked = set().union(*stated)
    names = [name for name in names if name in linked]
    pairs = [frozenset(pair) for pair in combinations(names, 2)]
    is_complete = all(pair in stated for pair in pairs)
    if len(names) > _MOST_PLACES_BY_DISTANCES or not is_complete:
        counts = f"{len(stated)} distances of {len(names)} places"
        allowed = "one of two places, or all three of three; otherwise state position_m"
        raise InputError(source, _DISTANCES, counts, allowed)
    coordinates, deviations = _trilaterate(*np.array([stated[p] for p in pairs]).T)
    if not np.isfinite(coordinates).all():
        problem = "three distances that no triangle has"
        raise InputError(source, _DISTANCES, problem, "distances of a triangle")
    placed = list(features)
    for index, feature in enumerate(features):
        if feature.name in names:
            corner = names.index(feature.name)
            placed[index] = _state_place(
                feature, coordinates[corner], deviations[corner]
            )
    return placed


def _read_distances(
    distances: Sequence[Mapping[str, Any]], places: Sequence[str], source: str
) -> dict[frozenset[str], tuple[float, float]]:
    """Read distances and their standard deviations, m, by the two places between which
    they were measured."""
    stated = {}
    for index, entry in enumerate(distances):
        for name in entry["between"]:
            if name not in places:
                where = f"{_DISTANCES}[{index}].between"
                allowed = suggest_names(name, places)
                raise InputError(source, where, repr(name), allowed)
        stated[frozenset(entry["between"])] = (entry["distance_m"], entry["std_m"])
    return stated


def _state_place(
    feature: Feature, position_m: np.ndarray, std_m: np.ndarray
) -> Feature:
    """State a place (3,) and its standard deviations (3,) in a feature without one."""
    if "position_m" in feature.stated:
        where = f"{_KEY}.{feature.name}.position_m"
        problem = "beside distances of this place"
        raise InputError(feature.source, where, problem, "one of them")
    keys = {"position_m": position_m.tolist(), "std_m": std_m.tolist()}
    return replace(feature, stated={**feature.stated, **keys})


def _trilaterate(
    distances: np.ndarray, deviations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (3, 3) of the places A, B, C, and their standard deviations, from the
    distances AB, AC, BC or AB alone. A is the origin, B on x, C in the plane of x and y;
    what this defines is exact. Not a number if no triangle has these distances.
    """
    coordinates = np.zeros((3, 3))
    variances = np.zeros((3, 3))
    along = distances[0]
    coordinates[1, 0] = along
    variances[1, 0] = deviations[0] ** 2
    if len(distances) == 3:
        to_first, to_second = distances[1:]
        x = (to_first**2 + along**2 - to_second**2) / (2.0 * along)
        square = to_first**2 - x**2
        y = np.sqrt(square) if square > 0.0 else np.nan
        slopes = np.array([1.0 - x / along, to_first / along, -to_second / along])
        coordinates[2, :2] = x, y
        variances[2, 0] = (slopes * deviations) @ (slopes * deviations)
        slopes = (np.array([0.0, to_first, 0.0]) - x * slopes) / y
        variances[2, 1] = (slopes * deviations) @ (slopes * deviations)
    return coordinates, np.sqrt(variances)
