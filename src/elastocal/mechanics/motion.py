"""How a chain moves all that lies behind its joints: poses of points, their Jacobians and the forces of wrenches from one walk.

Arrays are component first, with the configurations behind.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import blocks, cross, place_point, store_pose, walk

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain, MeasuringPoint


@dataclass(frozen=True)
class Motion:
    """Poses of some points of a chain, and how each transform that moves would move everything behind it; component first.

    `position` (T, 3, S): m, base frame. `rotation` (T, 3, 3, S). `twist` (6, K, S): for each moving transform, in the order of
    their coordinates, the velocity of what lies behind it, per unit of the coordinate: of the body's point at the base's
    origin, then the angular one (the spatial twist [1]). `place`, `coordinate` (K,) of int: how many transforms come before
    each, and the coordinate that moves it.

    [1] Murray, R. M., Li, Z. and Sastry, S. S., A Mathematical Introduction to Robotic Manipulation, section 3.4, CRC Press,
        1994.
    """

    position: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray
    place: np.ndarray
    coordinate: np.ndarray

    def jacobian(self, after: int, position: np.ndarray, rows: int = 6, chosen: slice | np.ndarray = slice(None)) -> np.ndarray:
        """Geometric Jacobian of points behind so many transforms of the chain.

        `position` (3, S'): where the points are, m. `rows`: linear velocities alone, or also angular ones. `chosen` (S',) of
        int: configuration of each. Returns (rows, C, S').
        """
        twist = self.twist[..., chosen]
        angular, moved = twist[3:], np.empty_like(twist[:rows])
        cross(angular, position, moved[:3])
        moved[:3] += twist[:3]
        moved[3:] = angular[: rows - 3]
        return self._behind_none(moved, after)

    def generalized_forces(self, after: int, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """Force or torque on each coordinate by a wrench on what lies behind so many transforms of the chain.

        `force`, `moment` (3, S): the moment about the base's origin. Returns (C, S).
        """
        on_each = np.einsum("ik...,i...->k...", self.twist, np.concatenate([force, moment]))
        return self._behind_none(on_each, after)

    def by_coordinate(self, values: np.ndarray) -> np.ndarray:
        """Values (..., K', S) of the transforms of the first coordinates, or of all, summed for each: (..., C', S)."""
        if self._one_each:
            return values
        coordinate = self.coordinate[: values.shape[-2]]
        out = np.zeros((*values.shape[:-2], coordinate[-1] + 1, values.shape[-1]))
        np.add.at(out, (..., coordinate, slice(None)), values)  # type: ignore[arg-type]  # The stubs know no slices here.
        return out

    def _behind_none(self, values: np.ndarray, after: int) -> np.ndarray:
        """By coordinate, without transforms behind a place of the chain."""
        behind = self.place >= after
        if behind.any():
            values[..., behind, :] = 0.0
        return self.by_coordinate(values)

    @cached_property
    def _one_each(self) -> bool:
        return len(np.unique(self.coordinate)) == len(self.coordinate)


def motion(chain: Chain, coordinates: np.ndarray, points: Sequence[MeasuringPoint]) -> Motion:
    """Poses of several measuring points and the twist of every transform that moves, in one walk along the chain.

    `coordinates` (S, C): rad and m.
    """
    components = np.ascontiguousarray(np.asarray(coordinates, float).T)
    size = components.shape[1]
    walked = chain.transforms
    position, rotation = np.empty((len(points), 3, size)), np.empty((len(points), 3, 3, size))
    moving = sorted((t.coordinate, place) for place, t in enumerate(walked) if t.coordinate is not None)
    axis, origin = np.empty((2, 3, len(moving), size))
    for part in blocks(size):
        frames = walk(chain, components[:, part], len(walked))
        for number, point in enumerate(points):
            store_pose(place_point(frames, point), position[number, :, part], rotation[number, :, :, part])
        for column, (_, place) in enumerate(moving):
            axes, origin[:, column, part] = frames[place]
            axis[:, column, part] = axes[walked[place].axis]
    driven, places = np.array(moving, int).T
    signs = np.array([walked[place].sign for place in places])[:, None]
    if (signs < 0).any():
        axis *= signs
    twist = np.empty((6, len(moving), size))
    twist[3:] = axis
    cross(origin, axis, twist[:3])
    shifts = np.array([walked[place].kind == "T" for place in places], bool)
    twist[:3, shifts], twist[3:, shifts] = axis[:, shifts], 0.0
    return Motion(position, rotation, twist, places, driven)
