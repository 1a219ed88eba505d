"""Configurations in which a robot without a tracker can be measured: contacts with
sockets, planes and spheres, and views of a board.

Newton's method moves random configurations, with steps of least norm, until the kind of
measurement allows their poses. The directions in which it leaves a configuration alone
stay random, so that the arm touches in many postures and orientations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.measuring.board import BESIDE_ROBOT
from elastocal.measuring.protocol import orient
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import (
    compute_point_poses,
    compute_poses_and_jacobians,
)

if TYPE_CHECKING:
    from elastocal.measuring.protocol import Kind, Prediction
    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Robot

# Upper bound on the steps of Newton's method, and on the motion of a joint in a step, rad
# or m; a configuration that needs more is dropped.
_MOST_STEPS = 40
_LARGEST_STEP = 0.3
# A contact is found if it is this close, m: far below the play of a socket.
_CLOSE_M = 1e-7
# Shorter lengths of a chain have no direction.
_SHORTEST_M = 1e-6
# How far contacts stay within the limits of a joint, rad or m, and at most which share of
# its range: a person who leads an arm needs some room.
_LIMIT_MARGIN = 0.05
_LIMIT_SHARE = 0.02
# Singular values below this share of the largest count as zero: near a singularity a
# step would be long.
_SINGULAR_SHARE = 1e-3


@dataclass(frozen=True)
class SetUp:
    """Set-up of a measurement without a tracker: its kind and its approximate places.

    Attributes
    ----------
    kind : kind of all measurements.
    places : numbers (K,) of its `place_keys` by name, base axes; directions have length
        one. One feature each, or the frame of the session if the kind has none.
    point : name of the measuring point with the target.
    mount_m, mount_rotation : (3,) and (3, 3), rough pose of the target in its frame.
    options : `limits` of the kind, and the keys ``camera`` of the campaign.
    """

    kind: Kind
    places: Mapping[str, np.ndarray]
    point: str
    mount_m: np.ndarray
    mount_rotation: np.ndarray
    options: Mapping[str, Any]

    @property
    def has_features(self) -> bool:
        """Whether each row refers to a feature; otherwise to the frame of the session."""
        return not self.kind.reads_poses

    def find_viewpoint(self) -> np.ndarray | None:
        """Find the camera beside the robot, (3,) m, whose line of sight to the target the
        arm may hide; None for others."""
        if self.has_features or self.options["camera"] != BESIDE_ROBOT:
            return None
        return self.locate_session()[0]

    def locate_session(self) -> tuple[np.ndarray, np.ndarray]:
        """Locate the frame of the session in the base, (3,) m and (3, 3). It is the base
        itself if there are features, and otherwise the frame of the board."""
        if self.has_features:
            return np.zeros(3), np.eye(3)
        (place,) = self.places.values()
        return place[:3], orient(place[3:])

    def locate_targets(
        self, robot: Robot, angles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Locate the target in the frame of the session.

        Parameters
        ----------
        robot : the nominal robot.
        angles : (N, n) angles of the chain, rad.

        Returns
        -------
        position, rotation : (N, 3), m, and (N, 3, 3)
        jacobian : (N, 6, m), twist by the motions that commands bring about, session axes
        """
        point = replace(robot.chain.point(self.point), offset_m=tuple(self.mount_m))
        position, rotation, jacobian = compute_poses_and_jacobians(
            robot.chain, angles, point
        )
        jacobian = robot.restrict_jacobians(jacobian)
        origin, axes = self.locate_session()
        in_session = axes.T
        halves = [in_session @ jacobian[:, :3], in_session @ jacobian[:, 3:]]
        return (
            (position - origin) @ axes,
            in_session @ rotation @ self.mount_rotation,
            np.concatenate(halves, axis=1),
        )


def orient_mount(
    kind: Kind, chain: Chain, point: MeasuringPoint, mount_m: np.ndarray
) -> np.ndarray:
    """Orient a target, (3, 3), so that its z axis leads away from the arm: from the
    measuring point to a tip, else on from the last link."""
    if kind.is_contact and mount_m.any():
        return orient(mount_m)
    return orient(find_outward_direction(chain, point))


def find_outward_direction(chain: Chain, point: MeasuringPoint) -> np.ndarray:
    """Find the direction (3,) of the last length before a measuring point, in its frame;
    z if there is none."""
    indices = range(point.after, -1, -1)
    points = [MeasuringPoint(point.name, index) for index in indices]
    coordinates = np.zeros((1, chain.coordinates))
    position, rotation = compute_point_poses(chain, coordinates, points)
    lengths = position[0, 0] - position[:, 0]
    is_apart = np.linalg.norm(lengths, axis=1) > _SHORTEST_M
    if not is_apart.any():
        return np.array([0.0, 0.0, 1.0])
    last = lengths[np.argmax(is_apart)]
    direction: np.ndarray = rotation[0, 0].T @ last / np.linalg.norm(last)
    return direction


def reach_places(
    setup: SetUp, robot: Robot, angles: np.ndarray, place_index: np.ndarray
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Move configurations to where the kind can measure.

    Parameters
    ----------
    setup, robot : what measures the robot.
    angles : (N, n) angles of the chain, rad.
    place_index : (N,) int, index of the place of each configuration.

    Returns
    -------
    angles : (N, n)
    checks : (N,) bool by constraint, true if it is met
    """
    moved = angles.copy()
    names = list(setup.places)
    checks: dict[str, np.ndarray] = {}
    for index, name in enumerate(names):
        members = np.flatnonzero(place_index == index)
        of_place = _reach_place(setup, robot, angles[members], setup.places[name])
        moved[members] = of_place[0]
        for constraint, is_met in of_place[1].items():
            checks.setdefault(constraint, np.zeros(len(angles), bool))
            checks[constraint][members] = is_met
    return moved, checks


def _reach_place(
    setup: SetUp, robot: Robot, angles: np.ndarray, place: np.ndarray
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Move configurations (N, n) to one place; results as of `reach_places`."""
    low, high = robot.joint_limits.T
    margin = np.minimum(_LIMIT_MARGIN, _LIMIT_SHARE * (high - low))
    low = low + margin
    high = high - margin
    moved = angles.copy()
    active = np.arange(len(angles))
    for _ in range(_MOST_STEPS):
        position, rotation, jacobian = setup.locate_targets(robot, moved[active])
        aimed = setup.kind.aim(position, rotation, place, setup.options)
        is_reached = _find_reached(setup, position, rotation, place, aimed)
        steps = _find_steps(aimed, jacobian)[~is_reached]
        active = active[~is_reached]
        if not len(active):
            break
        moved[active] += robot.expand_steps(steps)
        if not robot.has_followers:
            moved[active] = moved[active].clip(low, high)
    position, rotation, _ = setup.locate_targets(robot, moved)
    checks = setup.kind.check_poses(position, rotation, place, setup.options)
    if setup.kind.is_contact:
        aimed = setup.kind.aim(position, rotation, place, setup.options)
        checks["the arm does not reach it"] = _is_close(aimed)
    return moved, checks


def _find_reached(
    setup: SetUp,
    position: np.ndarray,
    rotation: np.ndarray,
    place: np.ndarray,
    aimed: Prediction,
) -> np.ndarray:
    """Find configurations that need no further step, (N,) bool: in contact, or allowed."""
    if setup.kind.is_contact:
        return _is_close(aimed)
    checks = setup.kind.check_poses(position, rotation, place, setup.options)
    return np.all(list(checks.values()), axis=0)


def _is_close(aimed: Prediction) -> np.ndarray:
    return np.abs(aimed.residual).max(axis=1) < _CLOSE_M


def _find_steps(aimed: Prediction, jacobian: np.ndarray) -> np.ndarray:
    """Find the steps of least norm (N, m) that bring predictions to zero, shortened to
    the largest step."""
    slopes = aimed.by_pose @ jacobian
    inverse = np.linalg.pinv(slopes, rcond=_SINGULAR_SHARE)
    steps = (inverse @ aimed.residual[..., None])[..., 0]
    largest = np.abs(steps).max(axis=1, keepdims=True)
    return steps * np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, _CLOSE_M))
