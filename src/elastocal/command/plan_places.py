"""Options of `elastocal plan` for measurements without a tracker: where features roughly
are, and within which bounds they can be measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.planning.reaching import SetUp, orient_mount
from elastocal.errors import InputError, find_text_fault, suggest_names
from elastocal.measuring.board import BESIDE_ROBOT, ON_ROBOT
from elastocal.measuring.catalogue import list_kinds
from elastocal.measuring.protocol import SHORTEST_DIRECTION

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Target
    from elastocal.measuring.protocol import Kind
    from elastocal.mechanics.robot import Robot

# Kinds of a laser tracker, which sees targets anywhere and needs no place.
TRACKED = ("position", "pose")
# Bound on a coordinate of a place, m, and on the size of a limit.
_FARTHEST_M = 100.0
_LARGEST_LIMIT = 360.0
# Names of the last keys of a place that together are a direction.
_DIRECTION = ("nx", "ny", "nz")


@dataclass(frozen=True)
class PlaceOptions:
    """Options as they were given: the kind, --place, --limit and --camera."""

    measured: str
    places: Iterable[str]
    limits: Iterable[str]
    camera: str


def _refuse_options(options: Mapping[str, Any], allowed: str) -> None:
    """Refuse options that do not belong to the kind of measurement."""
    for name, value in options.items():
        if value:
            raise InputError(name, "", "beside this kind of measurement", allowed)


def read_kind(measured: str) -> Kind:
    """Return the kind of --measured; refuse one that has no plans."""
    kinds = {
        name: kind
        for name, kind in list_kinds().items()
        if name in TRACKED or kind.place_keys
    }
    if measured not in kinds or kinds[measured].sensor is None:
        finding = (
            f"{measured!r}, which has no plans"
            if measured in list_kinds()
            else (repr(measured))
        )
        allowed = suggest_names(measured, list(kinds))
        raise InputError("--measured", "", finding, allowed)
    return kinds[measured]


def read_setup(
    options: PlaceOptions,
    tracker_options: Mapping[str, Any],
    robot: Robot,
    targets: Sequence[Target],
) -> SetUp | None:
    """Read what measures a robot without a tracker, and where it roughly stands.

    Parameters
    ----------
    options : what was stated of the kind.
    tracker_options : values of the options that only a tracker has, by their names.
    robot : the nominal robot.
    targets : the targets, whose offsets are rough.

    Returns
    -------
    None for a tracker.

    Raises
    ------
    InputError
        Names the option, what was found and what is allowed.
    """
    kind = read_kind(options.measured)
    if kind.name in TRACKED:
        place_options = {"--place": options.places, "--limit": options.limits}
        _refuse_options(place_options, "a kind without a tracker in --measured")
        return None
    _refuse_options(tracker_options, f"--measured {' or '.join(TRACKED)}")
    places = dict(_read_place(kind, text) for text in options.places)
    if not places or (kind.reads_poses and len(places) > 1):
        keys = ",".join(kind.place_keys)
        count = "one" if kind.reads_poses else "one for each feature, at least one"
        finding = f"{len(places)} places" if places else "no place"
        raise InputError("--place", "", finding, f"NAME={keys}: {count}")
    if len(targets) != 1:
        allowed = f"one, because {kind.name} measures one"
        raise InputError("--target", "", f"{len(targets)} targets", allowed)
    (target,) = targets
    mount_m = np.array(target.offset_m or (0.0, 0.0, 0.0))
    rotation = orient_mount(kind, robot.chain, robot.chain.point(target.point), mount_m)
    camera = ON_ROBOT if options.camera == "on-robot" else BESIDE_ROBOT
    limits = _read_limits(kind, options.limits)
    return SetUp(
        kind, places, target.point, mount_m, rotation, {**limits, "camera": camera}
    )


def _read_place(kind: Kind, text: str) -> tuple[str, np.ndarray]:
    """Read ``NAME=x,y,z,..``; numbers with defaults may be left out."""
    name, _, listed = text.partition("=")
    name = name.strip()
    if not name or find_text_fault(name):
        raise InputError("--place", "", repr(text), "NAME=x,y,z with a printable name")
    required = [key for key, default in kind.place_keys.items() if default is None]
    numbers = _read_numbers(listed)
    counts = {len(required), len(kind.place_keys)}
    if len(numbers) not in counts or not (np.abs(numbers) <= _FARTHEST_M).all():
        keys = ",".join(kind.place_keys)
        allowed = f"{name}={keys}, each up to {_FARTHEST_M:g} m"
        raise InputError("--place", "", repr(text), allowed)
    defaults = list(kind.place_keys.values())[len(numbers) :]
    place = np.array([*numbers, *defaults], float)
    if tuple(kind.place_keys)[-3:] == _DIRECTION:
        length = np.linalg.norm(place[-3:])
        if length < SHORTEST_DIRECTION:
            raise InputError("--place", "", repr(text), "a direction, not 0,0,0")
        place[-3:] /= length
    return name, place


def _read_numbers(text: str) -> np.ndarray:
    """Read numbers that are separated by commas; none if any is no number."""
    try:
        numbers = np.array([float(cell) for cell in text.split(",")])
    except ValueError:
        return np.zeros(0)
    return numbers if np.isfinite(numbers).all() else np.zeros(0)


def _read_limits(kind: Kind, texts: Iterable[str]) -> dict[str, float]:
    """Read ``KEY=NUMBER`` in place of the limits of a kind."""
    limits = {name: float(value) for name, value in kind.limits.items()}
    for text in texts:
        name, _, stated = text.partition("=")
        if name not in limits:
            listed = ", ".join(f"{key}={value:g}" for key, value in limits.items())
            raise InputError(
                "--limit", "", repr(name), listed or f"none of {kind.name}"
            )
        numbers = _read_numbers(stated)
        if len(numbers) != 1 or not 0.0 < numbers[0] <= _LARGEST_LIMIT:
            allowed = f"{name}=NUMBER, above 0 and up to {_LARGEST_LIMIT:g}"
            raise InputError("--limit", "", repr(text), allowed)
        limits[name] = float(numbers[0])
    return limits
