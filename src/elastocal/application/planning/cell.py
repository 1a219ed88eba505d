"""Which configurations a cell allows: a floor, boxes and the robot's own column to keep
out of, and a tracker's line of sight.

Links are capsules of one radius about the line of the chain: coarse, on the safe side
for slender arms. The column before joint 1 stands where it stands and is in no one's
way but that of forearm and hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import poses_of_points

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Target
    from elastocal.mechanics.robot import Robot

# Points along each stretch of the chain that stand for it.
_SAMPLES = 8
# Radii of the links and of the column over the length of the chain stretched out: 0.1
# and 0.25 m on an arm of 2.5 m.
RADIUS_SHARE = 0.04
COLUMN_SHARE = 0.1
# Links this many radii around a target carry it, and do not hide it.
_CARRIER = 2.5


@dataclass(frozen=True)
class Cell:
    """What stands around the robot, base axes, m.

    `boxes` (3, 2): lower and upper corner by axis. `tracker_m` (3,): where the tracker
    stands; None where nothing hides its targets. `radius_m`: of the links. `floor_m`:
    height below which neither target nor anything from the elbow on may be; None for no
    floor. `column_m`: radius of a cylinder about the first axis that turns, up to the
    second, if it is vertical.
    """

    boxes: tuple[np.ndarray, ...]
    tracker_m: np.ndarray | None
    radius_m: float
    floor_m: float | None = None
    column_m: float = 0.0


def find_allowed(
    cell: Cell, robot: Robot, targets: tuple[Target, ...], reported_angles: np.ndarray
) -> dict[str, np.ndarray]:
    """Whether each configuration is allowed, by what might forbid it.

    `reported_angles` (N, n): rad. Returns (N,) of bool: "boxes", "floor", "column": all
    is outside; "sight": the tracker sees every target.
    """
    angles = robot.model_angles(reported_angles)
    radius = cell.radius_m
    links = sample_links(robot, angles)
    found = {
        name: np.ones(len(angles), bool)
        for name in ("boxes", "floor", "column", "sight")
    }
    for box in cell.boxes:
        inside = ((links > box[:, 0] - radius) & (links < box[:, 1] + radius)).all(
            axis=-1
        )
        found["boxes"] &= ~inside.any(axis=0)
    places = _joint_places(robot)
    turning = next(
        (joint for joint, slides in enumerate(robot.chain.prismatic) if not slides), 0
    )
    arm = sample_links(robot, angles, min(turning + 2, robot.joints - 1))
    if (
        cell.column_m
        and turning + 2 < robot.joints
        and robot.chain.transforms[places[turning]].axis == 2
    ):
        foot, shoulder = _points(robot, angles, places[turning : turning + 2])
        aside = np.linalg.norm((arm - foot)[..., :2], axis=-1)
        found["column"] &= (
            (aside > cell.column_m + radius) | (arm[..., 2] > shoulder[:, 2] + radius)
        ).all(axis=0)
    if cell.floor_m is not None:
        found["floor"] &= (arm[..., 2] > cell.floor_m + radius).all(axis=0)
    for target in targets:
        at, turned = poses_of_points(
            robot.chain, angles, [robot.chain.point(target.point)]
        )
        seen = at[0] + (turned[0] @ np.array(target.offset_m or (0.0, 0.0, 0.0)))
        if cell.floor_m is not None:
            found["floor"] &= seen[:, 2] > cell.floor_m
        if cell.tracker_m is not None:
            found["sight"] &= ~_find_hidden(links, seen, cell.tracker_m, radius)
    return found


def sample_links(robot: Robot, angles: np.ndarray, joint: int = 0) -> np.ndarray:
    """Points along the links from a joint on, from 0. `angles` (N, n): of the chain,
    rad. Returns (K, N, 3): m, base axes."""
    transforms = robot.chain.transforms
    first = _joint_places(robot)[joint]
    ends = [
        first,
        *(
            place + 1
            for place in range(first, len(transforms))
            if transforms[place].kind == "T"
        ),
    ]
    at = _points(robot, angles, ends)
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    # An arm without lengths behind that joint is a point.
    return (
        np.concatenate([one + share * (other - one) for one, other in pairwise(at)])
        if len(at) > 1
        else at
    )


def _joint_places(robot: Robot) -> list[int]:
    """Places of the joints among the transforms of the chain."""
    return [
        place
        for place, transform in enumerate(robot.chain.transforms)
        if transform.coordinate is not None
    ]


def _points(robot: Robot, angles: np.ndarray, places: list[int]) -> np.ndarray:
    """Where the chain is before some of its transforms, (K, N, 3)."""
    return poses_of_points(
        robot.chain,
        angles,
        [MeasuringPoint("end of a link", place) for place in places],
    )[0]


def _find_hidden(
    links: np.ndarray, target: np.ndarray, tracker: np.ndarray, radius: float
) -> np.ndarray:
    """Whether any link lies in the line of sight, ndarray of bool (N,)."""
    sight = tracker - target
    length = np.linalg.norm(sight, axis=-1)
    along = sight / np.maximum(length, np.finfo(float).tiny)[:, None]
    from_target = links - target
    ahead = (from_target * along).sum(axis=-1).clip(0.0, length)
    aside = np.linalg.norm(from_target - ahead[..., None] * along, axis=-1)
    carriers = np.linalg.norm(from_target, axis=-1) < _CARRIER * radius
    return ((aside < radius) & ~carriers).any(axis=0)
