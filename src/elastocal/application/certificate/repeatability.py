"""Pose repeatability as ISO 9283 has it, from repeats of the same states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import stdtrit

from elastocal.campaigns.groups import groups_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Measurements, Target

# ISO 9283 takes three standard deviations beyond the mean.
_DEVIATIONS = 3.0
# What it asks for (section 7.2.1): so many poses, each approached so often.
ISO_POSES, ISO_CYCLES = 5, 30
# Mean and standard deviation of the length of a vector of three standard normal components, which is of Maxwell's distribution.
_MEAN, _STD = float(np.sqrt(8.0 / np.pi)), float(np.sqrt(3.0 - 8.0 / np.pi))
_CONFIDENCE = 0.975


@dataclass(frozen=True)
class Repeatability:
    """Pose repeatability RP, pooled over the poses that were approached again.

    `position_interval_m`: 95 % interval over poses. `orientation_rad`: the same of angles; None where positions are measured.
    `approaches`, `poses`: approaches and poses behind it.
    """

    position_m: float
    position_interval_m: tuple[float, float]
    orientation_rad: float | None
    approaches: int
    poses: int


def repeatability(measurements: Measurements, targets: Sequence[Target], point: str) -> Repeatability | None:
    """Repeatability of the end effector.

    ISO 9283:1998, section 7.2.2 [1]: mean distance of the attained positions from their barycentre plus three standard
    deviations of these distances; here pooled over poses of few repeats, whose distances count by sqrt(k / (k - 1)) for the
    degree of freedom that the barycentre takes. The interval is by the jackknife over poses on the logarithm. What the sensor
    scatters is in it.

    `point`: measuring point of the end effector; all targets count where none sits on it. Returns None without two poses that
    were approached again.

    [1] ISO 9283:1998, Manipulating industrial robots - Performance criteria and related test methods.
    """
    there = np.array([target.point == point for target in targets])[measurements.target]
    some = measurements.select(there) if there.any() else measurements
    key = np.column_stack([some.session, some.pose, some.load, some.target])
    if some.approach is not None:
        key = np.column_stack([key, some.approach])
    group = groups_of(key)[1]
    count = np.bincount(group)
    repeated = count[group] > 1
    if not repeated.any():
        return None
    some, group = some.select(repeated), group[repeated]
    scale = np.sqrt(count[group] / (count[group] - 1.0))
    means = np.stack([np.bincount(group, column) for column in some.position.T], axis=1)[group] / count[group][:, None]
    distance = scale * np.linalg.norm(some.position - means, axis=1)
    pose = groups_of(np.column_stack([some.session, some.pose]))[1]
    if pose.max() < 1:
        return None
    value, interval = _pool(distance, pose)
    angle = None
    if some.rotation_vector is not None:
        turns = Rotation.from_rotvec(some.rotation_vector)
        off = (turns * turns[_first_of(group)].inv()).as_rotvec()
        middle = np.stack([np.bincount(group, column) for column in off.T], axis=1)[group] / count[group][:, None]
        angle = _pool(scale * np.linalg.norm(off - middle, axis=1), pose)[0]
    approaches = len(np.unique(np.column_stack([some.session, some.pose, some.load, some.repeat]), axis=0))
    return Repeatability(value, interval, angle, approaches, int(pose.max()) + 1)


def of_sensor(position_m: float) -> float:
    """Repeatability that a sensor's noise alone shows, m, by its standard deviation in one coordinate."""
    return (_MEAN + _DEVIATIONS * _STD) * position_m


def _first_of(group: np.ndarray) -> np.ndarray:
    """Index of the first member of the group of each, ndarray (N,)."""
    _, first, inverse = np.unique(group, return_index=True, return_inverse=True)
    return first[inverse]


def _pool(distance: np.ndarray, pose: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Mean plus three standard deviations, and its interval by leaving out one pose after the other."""
    count = np.bincount(pose).astype(float)
    sums, squares = np.bincount(pose, distance), np.bincount(pose, distance**2)
    total, many = sums.sum(), count.sum()

    def figure(sums: np.ndarray, squares: np.ndarray, many: np.ndarray) -> np.ndarray:
        mean = sums / many
        return mean + _DEVIATIONS * np.sqrt(((squares - many * mean**2) / (many - 1.0)).clip(min=0.0))

    value = float(figure(total, squares.sum(), many))
    left = np.log(figure(total - sums, squares.sum() - squares, many - count))
    poses = len(count)
    error = np.sqrt((poses - 1.0) / poses * ((left - left.mean()) ** 2).sum())
    reach = stdtrit(poses - 1, _CONFIDENCE) * error
    return value, (float(value * np.exp(-reach)), float(value * np.exp(reach)))
