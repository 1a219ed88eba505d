"""Sites where a robot can deviate from its chain: small displacements at the base, at
each joint and at the far end of each link.

Every physical effect moves the robot through some of these coordinates, the virtual
joints of the virtual joint method (see `elastostatics`), as the deflection of a spring
or as an error of geometry. The chain with all of them gives exact poses, and its
Jacobian the sensitivity of a measured point to each of them.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import (
    SIX_DISPLACEMENTS,
    Chain,
    MeasuringPoint,
    insert_coordinates,
)
from elastocal.mechanics.kinematics import compute_motion, compute_poses
from elastocal.mechanics.robot import (
    STANDING,
    Compensator,
    Mass,
    Robot,
    estimate_typical_compliance,
    estimate_typical_payload_kg,
)

if TYPE_CHECKING:
    from typing import Any

# A link shorter than this is a point, and a shorter lever turns no joint.
_SHORTEST_M = 1e-6
# Typical mass of an arm over its rated load.
_MASS_OVER_RATED = 6.0
# Random poses whose largest torque decides whether a weight can turn a joint.
_TORQUE_POSES = 16


@dataclass(frozen=True)
class PushedSession:
    """A session in which the robot sits in a place, so that a push on the robot may move
    what stands there.

    Attributes
    ----------
    session : number of the session.
    start, end : progress of the campaign at its first and at its last fitted row.
    """

    session: int
    start: float
    end: float


@dataclass(frozen=True)
class Sites:
    """A chain with every coordinate in which the robot can deviate.

    Link 0 is the column before joint 1, link n the flange behind the last joint.

    Attributes
    ----------
    chain : Chain
        Coordinates 0..n-1 are the joints of the robot. All others are zero in the
        nominal robot.
    joints : n
    base : tx Ty Tz Rx Ry Rz of the foot, base axes
    tilt : for each joint Rx Ry Rz just behind it, in the frame that turns with it
    link_end : for each link Tx Ty Tz Rx Ry Rz at its far end, in the chain's frame
    joint_axes : 0, 1, 2 for a joint about x, y, z of its frame
    link_vectors_m : (n + 1, 3) array
        From the near to the far end of each link, in the frame of its far end.
    link_rotations : (n + 1, 3, 3) array
        From the frame at the far end of each link to the one at its near end, that is,
        the fixed rotations between two joints.
    joint_signs : sense in which each joint turns about its axis, +1 or -1
    prismatic : whether each joint slides along its axis, in metres and newtons
    masses : of links, if the robot file states them
    gravity_m_s2 : base axes
    base_moves, gear_ratio, compensator, payload_kg : as in `Robot`
    compliance : n values
        As in `Robot`, with typical values for rigid joints: the scale of other elastic
        parts.
    bears_typical_weight : bool
        Whether the structure, but no joint, bears the weight of `typical_masses_kg`.
        This is so for an arm that slides if neither masses nor loads are known.
    pushed_sessions : sessions of the campaign in which the robot sits in a place
    """

    chain: Chain
    joints: int
    base: tuple[int, ...]
    tilt: tuple[tuple[int, ...], ...]
    link_end: tuple[tuple[int, ...], ...]
    joint_axes: tuple[int, ...]
    link_vectors_m: np.ndarray
    link_rotations: np.ndarray
    joint_signs: tuple[float, ...]
    prismatic: tuple[bool, ...]
    masses: tuple[Mass, ...] = ()
    gravity_m_s2: tuple[float, ...] = STANDING
    base_moves: bool = False
    gear_ratio: tuple[float | None, ...] | None = None
    compensator: Compensator | None = None
    payload_kg: float | None = None
    compliance: tuple[float, ...] = ()
    bears_typical_weight: bool = False
    pushed_sessions: tuple[PushedSession, ...] = ()

    @cached_property
    def tracked_points(self) -> tuple[MeasuringPoint, ...]:
        """Points whose motion gives the load on the coordinates: the end-effector, the
        far ends of links 0..n, and the body of each mass.

        The centre of a mass is stated in the frame behind the joint of its link, and
        the centre of the column in the frame of the foot.
        """
        after = {
            transform.coordinate: index
            for index, transform in enumerate(self.chain.transforms, 1)
        }
        bodies = [
            self.tilt[mass.link - 1] if mass.link else self.base for mass in self.masses
        ]
        positions = [after[site[-1]] for site in (*self.link_end, *bodies)]
        return tuple(
            MeasuringPoint("tracked", position)
            for position in (self.chain.end_effector.after, *positions)
        )

    @cached_property
    def typical_masses_kg(self) -> np.ndarray:
        """Masses (n + 1,) at the far ends of links 0..n for an arm without declared
        masses.

        The mass of the arm is a multiple of its rated load. The links share it by their
        lengths, with half of each link's mass at either end.
        """
        lengths = np.linalg.norm(self.link_vectors_m[1:], axis=1)
        rated_kg = self.payload_kg
        if rated_kg is None:
            rated_kg = estimate_typical_payload_kg(self.chain)
        total_length = max(lengths.sum(), _SHORTEST_M)
        halves = 0.5 * _MASS_OVER_RATED * rated_kg * lengths / total_length
        return np.append(0.0, halves) + np.append(halves, 0.0)

    @property
    def shoulder(self) -> int | None:
        """Index of the first joint that the weight of its links can turn, or None."""
        joints = (joint for joint in range(self.joints) if self.carried_links(joint))
        return next(joints, None)

    def carried_links(self, joint: int) -> list[int]:
        """Find the links that have a length and whose weight can turn a joint, given by
        its index."""
        can_turn = self._unit_load_torques[:, 0, joint] > _SHORTEST_M
        has_length = [self.has_length(link) for link in range(self.joints + 1)]
        return np.flatnonzero(can_turn & has_length).tolist()

    def has_length(self, link: int) -> bool:
        """Whether a link has a length; it has none between joints that coincide."""
        return bool(np.linalg.norm(self.link_vectors_m[link]) > _SHORTEST_M)

    def longest_weight_torque_Nm(self, joint: int) -> float:  # noqa: N802 - units in names keep their case
        """Estimate the largest torque on a joint, given by its index, by all declared
        masses behind it, each at the longest lever of the middle of its link."""
        levers = self._unit_load_torques[:, 0, joint]
        gravity = np.linalg.norm(self.gravity_m_s2)
        return float(
            sum(
                mass.mass_kg
                * gravity
                * 0.5
                * (levers[mass.link - 1] + levers[mass.link])
                for mass in self.masses
                if mass.link > joint
            )
        )

    def transverse_axes(self, link: int) -> list[int]:
        """Find the two axes of the frame at the far end of a link that are the most
        transverse to it."""
        by_share = np.argsort(np.abs(self.link_vectors_m[link]), kind="stable")
        return sorted(by_share[:2].tolist())

    def moment_turns(self, link: int, axis: int, joint: int) -> bool:
        """Whether a first moment along an axis of the frame at the far end of a link
        can turn a joint, given by its index."""
        return bool(self._unit_load_torques[link, 1 + axis, joint] > _SHORTEST_M)

    @cached_property
    def _unit_load_torques(self) -> np.ndarray:
        """Largest torque on each joint over some random poses by unit loads at the far
        end of each link, (n + 1, 4, n) array.

        The first load is a weight of one newton; the others are first moments of one
        newton metre along the axes of the frame there.
        """
        angles = np.random.default_rng(0).uniform(
            -np.pi, np.pi, (_TORQUE_POSES, self.joints)
        )
        link_ends = self.tracked_points[1 : self.joints + 2]
        motion = compute_motion(self.chain, self.chain.at(angles), link_ends)
        gravity = np.array(self.gravity_m_s2)
        down = (gravity / np.linalg.norm(gravity))[:, None]
        torques = np.empty((self.joints + 1, 4, self.joints))
        for link, end in enumerate(link_ends):
            axes = motion.rotation[link].swapaxes(0, 1)
            for number, lever in enumerate((motion.position[link], *axes)):
                # A first moment is a couple, without a force.
                force = np.broadcast_to(0.0 * down if number else down, lever.shape)
                wrench = np.concatenate([force, np.cross(lever, down, axis=0)])
                forces = motion.generalized_forces(
                    end.after, wrench, slice(self.joints)
                )
                torques[link, number] = np.abs(forces).max(axis=1)
        return torques


def build_sites(robot: Robot) -> Sites:
    """Insert a site at the foot, behind each joint and at the far end of each link."""
    typical = estimate_typical_compliance(robot.chain, robot.payload_kg)
    compliance = np.where(robot.compliance > 0.0, robot.compliance, typical)
    return _build_sites(
        robot.chain,
        masses=robot.masses,
        gravity_m_s2=robot.gravity_m_s2,
        base_moves=robot.base_moves,
        gear_ratio=robot.gear_ratio,
        compensator=robot.compensator,
        payload_kg=robot.payload_kg,
        compliance=tuple(compliance.tolist()),
    )


# Every stage of a diagnosis asks for the sites of its robot, and a run has few robots.
@lru_cache(maxsize=64)
def _build_sites(chain: Chain, **properties: Any) -> Sites:
    """Build sites from the chain and the properties of `Robot` that they take over."""
    indices = [
        index
        for index, transform in enumerate(chain.transforms)
        if transform.coordinate is not None
    ]
    joints = [chain.transforms[index] for index in indices]
    starts = [0, *(index + 1 for index in indices)]
    ends = [*indices, len(chain.transforms)]
    insertions: dict[int, list[tuple[str, int]]] = defaultdict(list)
    vectors = []
    rotations = []
    for start, end in zip(starts, ends, strict=True):
        # The end of a link moves a measuring point there, but none inside the link.
        insertions[start] += SIX_DISPLACEMENTS[3:] if start else SIX_DISPLACEMENTS
        insertions[end] += SIX_DISPLACEMENTS
        far_end = MeasuringPoint("far end", end - start)
        link = Chain(chain.transforms[start:end], (far_end,), 1)
        position, rotation = compute_poses(link, np.zeros(1), far_end)
        vectors.append(rotation.T @ position)
        rotations.append(rotation)
    n = len(joints)
    # Order along the chain: six coordinates of the foot, six of the end of a link,
    # three of the joint behind it, and so on.
    link_ends = [range(n + 6 + 9 * link, n + 12 + 9 * link) for link in range(n + 1)]
    return Sites(
        chain=insert_coordinates(chain, insertions),
        joints=n,
        base=tuple(range(n, n + 6)),
        tilt=tuple(tuple(range(end.stop, end.stop + 3)) for end in link_ends[:-1]),
        link_end=tuple(tuple(end) for end in link_ends),
        joint_axes=tuple(joint.axis for joint in joints),
        link_vectors_m=np.array(vectors),
        link_rotations=np.array(rotations),
        joint_signs=tuple(joint.sign for joint in joints),
        prismatic=chain.prismatic,
        **properties,
    )
