"""Which configurations a cell allows: keep-out boxes, a floor, the robot's own column,
and a tracker's line of sight.

Links are capsules of one radius about the line of the chain. This is coarse, and on the
safe side for slender arms. The column before joint 1 does not move; only forearm and
hand can hit it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.inverse_kinematics import compute_reach_m
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import compute_point_poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.campaigns.campaign import Target
    from elastocal.mechanics.robot import Robot

# Sample points along each stretch of the chain.
_SAMPLES = 8
# Radii of the links and of the column over the length of the stretched chain: 0.1 and
# 0.25 m on an arm of 2.5 m.
RADIUS_SHARE = 0.04
COLUMN_SHARE = 0.1
# Sample points within this many radii of a target belong to the link that carries it,
# and do not hide it.
_CARRIER_RADII = 2.5


@dataclass(frozen=True)
class Cell:
    """Surroundings of the robot; lengths in m, base axes.

    Attributes
    ----------
    boxes : arrays (3, 2) with lower and upper corner by axis.
    tracker_m : (3,) position of the tracker; None if nothing hides its targets.
    radius_m : radius of the links.
    floor_m : height that targets and all links from the elbow on stay above; None for no
        floor.
    column_m : radius of a cylinder about the first revolute axis, up to the next one, if
        the axis is vertical; 0 for no column.
    """

    boxes: tuple[np.ndarray, ...]
    tracker_m: np.ndarray | None
    radius_m: float
    floor_m: float | None = None
    column_m: float = 0.0


def build_cell(
    robot: Robot,
    boxes: Sequence[np.ndarray] = (),
    tracker_m: np.ndarray | None = None,
    floor_m: float = 0.0,
) -> Cell:
    """Build the cell of a robot, whose radii are shares of its reach; other arguments as
    of `Cell`."""
    reach_m = compute_reach_m(robot)
    radius_m = RADIUS_SHARE * reach_m
    return Cell(tuple(boxes), tracker_m, radius_m, floor_m, COLUMN_SHARE * reach_m)


def check_configurations(
    cell: Cell, robot: Robot, targets: tuple[Target, ...], reported_angles: np.ndarray
) -> dict[str, np.ndarray]:
    """Check configurations against each constraint of a cell.

    Parameters
    ----------
    cell, robot : the cell and the robot in it.
    targets : targets that the tracker must see.
    reported_angles : (N, n) joint angles as the controller reports them, rad.

    Returns
    -------
    (N,) bool by constraint, true if it is met: "boxes", "floor" and "column" if nothing
    is inside, "sight" if the tracker sees every target.
    """
    angles = robot.model_angles(reported_angles)
    links = sample_links(robot, angles)
    forearm_joint = min(_find_first_revolute(robot) + 2, robot.joints - 1)
    forearm = sample_links(robot, angles, forearm_joint)
    is_clear = np.ones(len(angles), bool)
    is_above_floor = np.ones(len(angles), bool)
    is_seen = np.ones(len(angles), bool)
    for box in cell.boxes:
        is_clear &= _is_outside_box(links, box, cell.radius_m)
    if cell.floor_m is not None:
        is_above_floor &= (forearm[..., 2] > cell.floor_m + cell.radius_m).all(axis=0)
    for target in targets:
        position = _locate_target(robot, target, angles)
        if cell.floor_m is not None:
            is_above_floor &= position[:, 2] > cell.floor_m
        if cell.tracker_m is not None:
            is_seen &= ~_is_hidden(links, position, cell.tracker_m, cell.radius_m)
    return {
        "boxes": is_clear,
        "floor": is_above_floor,
        "column": _is_outside_column(cell, robot, angles, forearm),
        "sight": is_seen,
    }


def sample_links(robot: Robot, angles: np.ndarray, joint: int = 0) -> np.ndarray:
    """Sample points along the links from a joint on.

    Parameters
    ----------
    robot : the robot, taken as rigid.
    angles : (N, n) angles of the chain, rad.
    joint : number of the joint, from 0.

    Returns
    -------
    (K, N, 3) points, m, base axes.
    """
    transforms = robot.chain.transforms
    first = _find_joint_indices(robot)[joint]
    ends = [first]
    for index in range(first, len(transforms)):
        if transforms[index].kind == "T":
            ends.append(index + 1)
    corners = _locate_points(robot, angles, ends)
    if len(corners) == 1:
        # An arm without lengths behind the joint is a point.
        return corners
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    return np.concatenate(
        [start + share * (end - start) for start, end in pairwise(corners)]
    )


def _find_first_revolute(robot: Robot) -> int:
    """Find the first joint that is not prismatic; 0 if all are."""
    for joint, is_prismatic in enumerate(robot.chain.prismatic):
        if not is_prismatic:
            return joint
    return 0


def _find_joint_indices(robot: Robot) -> list[int]:
    """Find the indices of the joints among the transforms of the chain."""
    return [
        index
        for index, transform in enumerate(robot.chain.transforms)
        if transform.coordinate is not None
    ]


def _locate_points(robot: Robot, angles: np.ndarray, indices: list[int]) -> np.ndarray:
    """Locate the chain before transforms with the given indices, (K, N, 3), m."""
    points = [MeasuringPoint("end of a link", index) for index in indices]
    return compute_point_poses(robot.chain, angles, points)[0]


def _locate_target(robot: Robot, target: Target, angles: np.ndarray) -> np.ndarray:
    """Locate a target, (N, 3), m; an unknown offset counts as zero."""
    point = robot.chain.point(target.point)
    position, rotation = compute_point_poses(robot.chain, angles, [point])
    return position[0] + rotation[0] @ np.array(target.offset_m or (0.0, 0.0, 0.0))


def _is_outside_box(links: np.ndarray, box: np.ndarray, radius: float) -> np.ndarray:
    """Whether all links are outside a box, (N,) bool."""
    inside = (links > box[:, 0] - radius) & (links < box[:, 1] + radius)
    return np.asarray(~inside.all(axis=-1).any(axis=0))


def _is_outside_column(
    cell: Cell, robot: Robot, angles: np.ndarray, forearm: np.ndarray
) -> np.ndarray:
    """Whether the forearm (K, N, 3) is outside the column below the shoulder, (N,)
    bool."""
    joint = _find_first_revolute(robot)
    indices = _find_joint_indices(robot)
    is_vertical = robot.chain.transforms[indices[joint]].axis == 2
    if not cell.column_m or joint + 2 >= robot.joints or not is_vertical:
        return np.ones(len(angles), bool)
    foot, shoulder = _locate_points(robot, angles, indices[joint : joint + 2])
    distance = np.linalg.norm((forearm - foot)[..., :2], axis=-1)
    is_beside = distance > cell.column_m + cell.radius_m
    is_above = forearm[..., 2] > shoulder[:, 2] + cell.radius_m
    return (is_beside | is_above).all(axis=0)


def _is_hidden(
    links: np.ndarray, target: np.ndarray, tracker: np.ndarray, radius: float
) -> np.ndarray:
    """Whether any link lies in the line of sight to a target (N, 3), (N,) bool."""
    sight = tracker - target
    length = np.linalg.norm(sight, axis=-1)
    direction = sight / np.maximum(length, np.finfo(float).tiny)[:, None]
    from_target = links - target
    projection = (from_target * direction).sum(axis=-1).clip(0.0, length)
    perpendicular = from_target - projection[..., None] * direction
    in_the_way = np.linalg.norm(perpendicular, axis=-1) < radius
    carries = np.linalg.norm(from_target, axis=-1) < _CARRIER_RADII * radius
    return (in_the_way & ~carries).any(axis=0)
