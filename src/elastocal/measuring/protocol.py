"""Interface of a kind of measurement, by which all kinds are treated alike.

A kind predicts its measurements from the pose of a target in the frame of the session and
from the unknowns of a feature: a place that is touched, a plane, an anchor. The engine
multiplies the derivative in the pose with the Jacobian of the chain and fits the
unknowns together with the robot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from elastocal.errors import InputError

# Sizes of unknowns that may be anywhere in a workshop, m and rad.
ANYWHERE_M = 1.0
ANYWHERE_RAD = 1.0
# Standard deviation of stated lengths whose standard deviation is left out, m: that of a
# caliper or a 3D print.
STATED_STD_M = 2e-4
# Upper bound on a stated standard deviation, m or rad; a larger one says nothing.
LARGEST_STD = 1.0
# A shorter vector has no direction.
SHORTEST_DIRECTION = 1e-9
UNKNOWN = "unknown"


@dataclass(frozen=True)
class Unknown:
    """One parameter of a feature that every fit estimates.

    Attributes
    ----------
    name, unit : as tables and reports have them; SI units.
    plausible : size that the parameter may have.
    prior_std : standard deviation of the normal prior about the declared value; None if
        nothing is declared, 0 if the declared value is exact and not fitted.
    """

    name: str
    unit: str
    plausible: float
    prior_std: float | None = None


@dataclass(frozen=True)
class Feature:
    """An object that is touched, or against which the target is measured.

    Attributes
    ----------
    name : name of the feature.
    kind : name of its kind of measurement.
    stated : other keys of the feature, checked by the kind.
    source : file of the campaign, for messages.
    """

    name: str
    kind: str
    stated: Mapping[str, Any] = field(default_factory=dict)
    source: str = "campaign.yaml"


@dataclass(frozen=True)
class Prediction:
    """Residuals of M measurements of one feature, and derivatives of the prediction.

    Attributes
    ----------
    residual : (M, r) array, measured minus predicted, m and rad.
    by_pose : (M, r, 6) array, derivative of the prediction in the position (m) and the
        rotation (rad) of the target, both in the axes of the session.
    by_unknowns : (M, r, K) array, derivative in the unknowns of the feature.
    """

    residual: np.ndarray
    by_pose: np.ndarray
    by_unknowns: np.ndarray


@dataclass(frozen=True)
class Sensor:
    """A measuring instrument.

    Attributes
    ----------
    description : the instrument, and where its noise is from.
    position_m, orientation_rad : standard deviation of a coordinate and of an angle.
    """

    description: str
    position_m: float
    orientation_rad: float = 0.0


@dataclass(frozen=True)
class NoiseShape:
    """Shape of the noise of M measurements of r numbers, whose sizes are estimated.

    Attributes
    ----------
    axes : (M, r, r) array, change of the residual by a unit of each independent error,
        in the axes of the session.
    sizes : (M, r) array, standard deviation of each error divided by that of its group.
    groups : (r,) int array, group of each error, 0 .. G-1. The standard deviation of
        each group is estimated.
    """

    axes: np.ndarray
    sizes: np.ndarray
    groups: np.ndarray


class Kind:
    """One kind of measurement. A subclass with the attributes below is all it needs.

    Attributes
    ----------
    name : value of ``measured`` and ``kind`` in campaign.yaml and measurements.csv.
    meaning : one line, what a row measures.
    error : noun for the length of a residual, as headlines and reports state it.
    numbers : numbers in a row: 1, 3 or 6. Several numbers are components of a vector
        in the axes of the session, m, followed by those of a rotation, rad.
    columns : columns that the user writes for a row.
    is_converted : whether measured poses must be converted to those of the target.
    touches : whether the columns may be left out, because contact means zero.
    holds_target : whether the target sits in a place, so that a push on the robot also
        pushes what stands there.
    keys : keys of a feature of this kind, each with its meaning; None if rows refer to
        no feature.
    sensor : the usual instrument, whose noise a plan assumes; None if there is none.
    place_keys : numbers that tell a plan where a feature roughly is, in base axes, each
        with its default; None if it must be stated. Empty if the kind has no plans
        without a tracker. Without features they describe the frame of the session: its
        origin, and the direction of its z.
    limits : bounds on the poses in which the kind can measure, with their defaults.
    """

    name: str
    meaning: str
    error: str = "residual"
    numbers: int
    columns: Sequence[str] = ()
    is_converted: bool = False
    touches: bool = False
    holds_target: bool = False
    keys: ClassVar[Mapping[str, str] | None] = None
    sensor: ClassVar[Sensor | None] = None
    place_keys: ClassVar[Mapping[str, float | None]] = {}
    limits: ClassVar[Mapping[str, float]] = {}

    @property
    def reads_poses(self) -> bool:
        """Whether a row is the pose or position of the target in the session's frame,
        or can be converted to it without any unknown."""
        return self.keys is None

    @property
    def is_contact(self) -> bool:
        """Whether a row states that the target touches, and the joint angles of the
        contact are what is measured."""
        return self.touches or not self.columns

    def check(self, feature: Feature) -> None:
        """Refuse a feature whose keys are not those of the kind, or not of their form."""
        keys = self.keys or {}
        for key in feature.stated:
            if key not in keys:
                allowed = ", ".join(keys) or "no key but kind"
                where = f"features.{feature.name}.{key}"
                raise InputError(feature.source, where, "an unknown key", allowed)
        self.unknowns(feature)

    def convert(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Convert measurements (N, 3), (N, 3, 3) to poses of the target in the session."""
        return position, rotation

    def refer_noise(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Add to the options what the shape of the noise takes from all measured poses
        (M, 3), (M, 3, 3) of a campaign, so that it is the same for a subset of them."""
        return dict(options)

    def shape_noise(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> NoiseShape | None:
        """Describe noise that is neither alike in all measurements nor in all
        directions, for measured poses (M, 3), (M, 3, 3) of the target."""
        return None

    def unknowns(self, feature: Feature) -> tuple[Unknown, ...]:
        """List the K unknowns of a feature, in the order of steps of a fit."""
        return ()

    def states_length(self, feature: Feature) -> bool:
        """Whether the feature states a length that shows a common scale of the robot."""
        return read_vector(feature, "position_m") is not None

    def locate(self, feature: Feature) -> np.ndarray | None:
        """Return where the target of every row is, (3,) m in the session, if the feature
        states it."""
        return None

    def find_middle(self, values: np.ndarray) -> np.ndarray | None:
        """Return the place (3,) m in the session about which all targets of a feature
        are, or None if they are apart from each other."""
        return None

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Find values of a feature from which a fit converges.

        Parameters
        ----------
        feature : the feature.
        position : (M, 3) array, m, nominal positions of the targets in the session.
        numbers : (M, r) array, measurements.

        Returns
        -------
        (V,) array, in the layout of `evaluate`
        """
        return np.zeros(0)

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict measurements from poses and from the values (V,) of their feature.

        Parameters
        ----------
        position, rotation : (M, 3) and (M, 3, 3) arrays, pose of the target in the
            frame of the session, m.
        numbers : (M, r) array, measurements.
        values : (V,) array.
        """
        raise NotImplementedError

    def state_place(self, place: np.ndarray) -> dict[str, Any]:
        """Return the keys of a feature of campaign.yaml that a place (K,) of a plan
        states."""
        return {}

    def convert_place(self, place: np.ndarray) -> np.ndarray:
        """Convert a place (K,), numbers of `place_keys`, to values (V,) of `evaluate`."""
        return place[:3]

    def aim(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> Prediction:
        """Predict numbers that are zero where a target can be measured.

        A plan moves the robot by Newton's method until they are, or until `check_poses`
        allows the pose. For a contact these are the residuals of the contact.

        Parameters
        ----------
        position, rotation : (M, 3) and (M, 3, 3) arrays, pose of the target in the frame
            of the session, m. The z axis of a tip is that of its shaft, out of it.
        place : (K,) array, numbers of `place_keys`.
        options : `limits`, and the keys ``camera`` of the campaign.
        """
        numbers = np.zeros((len(position), self.numbers))
        values = self.convert_place(place)
        return self.evaluate(position, rotation, numbers, values)

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check whether poses can be measured, apart from the contact.

        Returns (M,) bool by constraint, true if it is met. The name of a constraint says
        what is wrong otherwise. Arguments as in `aim`.
        """
        return {}

    def move(self, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Move the values (V,) of a feature by a step (K,) of its unknowns."""
        return values + step

    def state(self, values: np.ndarray) -> np.ndarray:
        """Return the absolute values of the unknowns (K,) of a feature, for tables."""
        return values

    def deviate(self, feature: Feature, values: np.ndarray) -> np.ndarray:
        """Return how far the unknowns (K,) are from their declared values; only those
        with a prior matter."""
        return np.zeros(len(self.unknowns(feature)))


def read_vector(feature: Feature, key: str) -> np.ndarray | None:
    """Read three numbers of a feature; None if they are unknown or left out."""
    stated = feature.stated.get(key, UNKNOWN)
    if stated == UNKNOWN:
        return None
    is_vector = isinstance(stated, list | tuple) and len(stated) == 3
    if not is_vector or not all(map(_is_number, stated)):
        raise refuse_key(feature, key, "unknown, or three numbers [x, y, z]")
    return np.array(stated, float)


def read_direction(feature: Feature, key: str) -> np.ndarray | None:
    """Read a direction of a feature as a unit vector; None if it is unknown."""
    direction = read_vector(feature, key)
    if direction is None:
        return None
    length = float(np.linalg.norm(direction))
    if length < SHORTEST_DIRECTION:
        raise refuse_key(feature, key, "a direction, not zero")
    return direction / length


def read_number(feature: Feature, key: str) -> float | None:
    """Read a number of a feature; None if it is unknown or left out."""
    stated = feature.stated.get(key, UNKNOWN)
    if stated == UNKNOWN:
        return None
    if not _is_number(stated):
        raise refuse_key(feature, key, "unknown, or a number")
    return float(stated)


def read_std(feature: Feature, key: str, count: int = 1) -> np.ndarray:
    """Read standard deviations (count,): one number for all, or one for each."""
    stated = feature.stated.get(key, STATED_STD_M)
    listed = stated if isinstance(stated, list | tuple) else [stated] * count
    is_valid = len(listed) == count and all(map(_is_number, listed))
    if not is_valid or not all(0.0 <= value <= LARGEST_STD for value in listed):
        noun = "a number" if count == 1 else f"a number, or {count} of them"
        allowed = f"{noun} from 0 (exact) to {LARGEST_STD:g}, in m or rad"
        raise refuse_key(feature, key, allowed)
    return np.array(listed, float)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def refuse_key(feature: Feature, key: str, allowed: str) -> InputError:
    """Return the error of one key of a feature."""
    where = f"features.{feature.name}.{key}"
    return InputError(feature.source, where, repr(feature.stated.get(key)), allowed)


def describe_point(
    feature: Feature, key: str = "position_m", std_key: str = "std_m"
) -> tuple[Unknown, ...]:
    """Describe the three coordinates of a point: unknown, or stated with priors."""
    if read_vector(feature, key) is None:
        return tuple(Unknown(name, "m", ANYWHERE_M) for name in "xyz")
    deviations = read_std(feature, std_key, 3).tolist()
    return tuple(
        Unknown(name, "m", std, std)
        for name, std in zip("xyz", deviations, strict=True)
    )


def deviate_point(
    feature: Feature, position: np.ndarray, key: str = "position_m"
) -> np.ndarray:
    """Return how far a point (3,), m, is from where it was stated; zero if it is
    unknown."""
    stated = read_vector(feature, key)
    return np.zeros(3) if stated is None else position - stated


def describe_number(feature: Feature, key: str, std_key: str) -> Unknown:
    """Describe one length of a feature: unknown, or stated with a prior."""
    name = key.removesuffix("_m")
    if read_number(feature, key) is None:
        return Unknown(name, "m", ANYWHERE_M)
    std = float(read_std(feature, std_key)[0])
    return Unknown(name, "m", std, std)


def check_approach(
    rotation: np.ndarray, normal: np.ndarray, largest_tilt_deg: float
) -> dict[str, np.ndarray]:
    """Check whether tips come from the side to which a normal points.

    Parameters
    ----------
    rotation : (M, 3, 3) array, whose z axes are those of the shafts, out of the tip.
    normal : (3,) or (M, 3) unit vectors out of what is touched.
    largest_tilt_deg : largest angle between shaft and normal.
    """
    cosine = -(rotation[:, :, 2] * normal).sum(axis=1)
    is_upright = cosine >= np.cos(np.radians(largest_tilt_deg))
    return {"the shaft of the tip is too oblique (tilt_deg)": is_upright}


def orient(direction: np.ndarray) -> np.ndarray:
    """Make a rotation (3, 3) whose z axis is a direction (3,)."""
    normal = direction / np.linalg.norm(direction)
    return np.column_stack([*span_plane(normal), normal])


def span_plane(normal: np.ndarray) -> np.ndarray:
    """Two unit vectors (2, 3) that span the plane with a unit normal (3,)."""
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def predict_along(
    residual: np.ndarray, direction: np.ndarray, by_unknowns: np.ndarray
) -> Prediction:
    """Make the prediction of scalar measurements with residuals (M,), m, whose gradients in
    the target's position are unit vectors (M, 3) or (3,); derivatives (M, K) in the
    unknowns."""
    by_pose = np.zeros((len(residual), 1, 6))
    by_pose[:, 0, :3] = direction
    return Prediction(residual[:, None], by_pose, by_unknowns[:, None])


def predict_position(residual: np.ndarray, by_unknowns: np.ndarray) -> Prediction:
    """Make the prediction of measurements of the target's position (M, 3), m, with
    derivatives (M, 3, K) in the unknowns."""
    by_pose = np.zeros((len(residual), 3, 6))
    by_pose[:, :, :3] = np.eye(3)
    return Prediction(residual, by_pose, by_unknowns)


def find_centre(position: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Find the centre (3,), m, of a sphere of unknown radius, algebraically.

    Parameters
    ----------
    position : (M, 3) array, m.
    height : (M,) array, m, such that the squared distances from the centre, less the
        squared heights, are equal.
    """
    columns = np.column_stack([2.0 * position, np.ones(len(position))])
    squares = (position**2).sum(axis=1) - height**2
    centre: np.ndarray = np.linalg.lstsq(columns, squares, rcond=None)[0][:3]
    return centre


def measure_distances(
    position: np.ndarray, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the distances (M,), m, of positions (M, 3) from a centre (3,), and the unit
    vectors (M, 3) from the centre to the positions."""
    from_centre = position - centre
    distance = np.linalg.norm(from_centre, axis=1)
    return distance, from_centre / distance[:, None]
