"""Which configurations a cell allows: boxes that the arm keeps out of, and a tracker that must see its targets.

Links are capsules of one radius about the line of the chain: coarse, on the safe side for slender arms. The column before joint
1 stands where it stands and is in no one's way.
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
# Radius of the links over the length of the chain stretched out: 0.1 m on an arm of 2.5 m.
RADIUS_SHARE = 0.04
# Links this many radii around a target carry it, and do not hide it.
_CARRIER = 2.5


@dataclass(frozen=True)
class Cell:
    """What stands around the robot.

    `boxes` (3, 2): lower and upper corner by axis, base axes, m. `tracker_m` (3,): where the tracker stands, base axes; None
    where nothing hides its targets. `radius_m`: of the links.
    """

    boxes: tuple[np.ndarray, ...]
    tracker_m: np.ndarray | None
    radius_m: float


def find_allowed(cell: Cell, robot: Robot, targets: tuple[Target, ...], reported_angles: np.ndarray) -> dict[str, np.ndarray]:
    """Whether each configuration is allowed, by what might forbid it.

    `reported_angles` (N, n): rad. Returns (N,) of bool: "boxes": no link in a box. "sight": the tracker sees every target.
    """
    angles = robot.model_angles(reported_angles)
    links = link_points(robot, angles)
    found = {"boxes": np.ones(len(angles), bool), "sight": np.ones(len(angles), bool)}
    for box in cell.boxes:
        inside = ((links > box[:, 0] - cell.radius_m) & (links < box[:, 1] + cell.radius_m)).all(axis=-1)
        found["boxes"] &= ~inside.any(axis=0)
    if cell.tracker_m is not None:
        for target in targets:
            at, turned = poses_of_points(robot.chain, angles, [robot.chain.point(target.point)])
            seen = at[0] + (turned[0] @ np.array(target.offset_m or (0.0, 0.0, 0.0)))
            found["sight"] &= ~_find_hidden(links, seen, cell.tracker_m, cell.radius_m)
    return found


def link_points(robot: Robot, angles: np.ndarray) -> np.ndarray:
    """Points along the moving links. `angles` (N, n): of the chain, rad. Returns (K, N, 3): m, base axes."""
    transforms = robot.chain.transforms
    first = next(place for place, transform in enumerate(transforms) if transform.coordinate is not None)
    ends = [first, *(place + 1 for place in range(first, len(transforms)) if transforms[place].kind == "T")]
    at, _ = poses_of_points(robot.chain, angles, [MeasuringPoint("end of a link", place) for place in ends])
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    # An arm without lengths behind its first joint is a point.
    return np.concatenate([one + share * (other - one) for one, other in pairwise(at)]) if len(at) > 1 else at


def _find_hidden(links: np.ndarray, target: np.ndarray, tracker: np.ndarray, radius: float) -> np.ndarray:
    """Whether any link lies in the line of sight, ndarray of bool (N,)."""
    sight = tracker - target
    length = np.linalg.norm(sight, axis=-1)
    along = sight / np.maximum(length, np.finfo(float).tiny)[:, None]
    from_target = links - target
    ahead = (from_target * along).sum(axis=-1).clip(0.0, length)
    aside = np.linalg.norm(from_target - ahead[..., None] * along, axis=-1)
    carriers = np.linalg.norm(from_target, axis=-1) < _CARRIER * radius
    return ((aside < radius) & ~carriers).any(axis=0)
