"""Where a robot can deviate from its chain: small displacements at the base, at each
joint and at the far end of each link.

Every physical effect moves the robot through some of these coordinates, the virtual
joints of the virtual joint method (see `elastostatics`), whether a spring yields in
them or an error of geometry is one. The chain that holds them all gives exact poses,
and its Jacobian the sensitivity of a measured point to each of them.
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

# Below this a link is a point.
_SHORTEST_M = 1e-6
_MASS_OVER_RATED = 6.0


@dataclass(frozen=True)
class Sites:
    """A chain with every coordinate in which the robot can deviate.

    `chain`: coordinates 0..n-1 are the joints as before. All others are zero in the
    nominal robot. `joints`: n. `base`: tx Ty Tz Rx Ry Rz of the foot, base axes.
    `tilt`: for each joint Rx Ry Rz just behind it, in the frame that turns with it.
    `link_end`: for each link 0..n Tx Ty Tz Rx Ry Rz at its far end, in the frame of the
    chain there. Link 0 is the column before joint 1, link n the flange behind the last
    joint. `joint_axes`: 0, 1, 2 for a joint about x, y, z of its frame.
    `link_vectors_m` (n + 1, 3): from the near to the far end of each link, in the frame
    of its far end. `link_rotations` (n + 1, 3, 3): from the frame there to that at its
    near end: fixed rotations between two joints. `joint_signs`: sense in which each
    joint turns about its axis, +1 or -1. `prismatic`: which joints shift along their
    axis instead; theirs are metres and newtons. `masses`: what the links weigh, where
    the robot file says so. `gravity_m_s2`: base axes. `payload_kg`: as in `Robot`.
    `compliance` (n,): of the joints as in `Robot`, usual ones of rigid joints: the
    scale of what yields beside them. `usual_weight`: whether the structure, but no
    joint, bears the weight of `usual_masses`: where no masses and no loads are known of
    an arm that slides.
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
    gear_ratio: tuple[float | None, ...] | None = None
    compensator: Compensator | None = None
    payload_kg: float | None = None
    compliance: tuple[float, ...] = ()
    usual_weight: bool = False

    @cached_property
    def followed(self) -> tuple[MeasuringPoint, ...]:
        """Points whose motion gives the load on the coordinates: the end, the far ends
        of links 0..n, and what has a mass.

        The centre of a mass is stated in the frame behind the joint of its link, of the
        column in that of the foot.
        """
        after = {
            t.coordinate: place for place, t in enumerate(self.chain.transforms, 1)
        }
        bodies = [
            self.tilt[mass.link - 1] if mass.link else self.base for mass in self.masses
        ]
        places = [
            self.chain.end_effector.after,
            *(after[moved[-1]] for moved in (*self.link_end, *bodies)),
        ]
        return tuple(MeasuringPoint("followed", place) for place in places)

    @cached_property
    def usual_masses(self) -> np.ndarray:
        """Masses at the far ends of links 0..n, where none are declared, ndarray (n +
        1,), kg.

        Arms weigh six times what they carry; by length, half of each link at either
        end.
        """
        lengths = np.linalg.norm(self.link_vectors_m[1:], axis=1)
        rated = (
            estimate_typical_payload_kg(self.chain)
            if self.payload_kg is None
            else self.payload_kg
        )
        halves = (
            0.5 * _MASS_OVER_RATED * rated * lengths / max(lengths.sum(), _SHORTEST_M)
        )
        return np.append(0.0, halves) + np.append(halves, 0.0)

    @property
    def shoulder(self) -> int | None:
        """Index of the first joint that the weight of its links can turn, or None."""
        return next(
            (joint for joint in range(self.joints) if self.carried_links(joint)), None
        )

    def carried_links(self, joint: int) -> list[int]:
        """Links with a length behind a joint, from 0, whose weight can turn it, as
        numbers from 1."""
        turned = self._weight_turns[:, 0, joint] > _SHORTEST_M
        long = np.linalg.norm(self.link_vectors_m, axis=1) > _SHORTEST_M
        return np.flatnonzero(turned & long).tolist()

    def longest_weight_torque_Nm(self, joint: int) -> float:  # noqa: N802 - units in names keep their case
        """Torque on a joint, from 0, by all declared masses behind it, each at the
        longest lever of the middle of its link."""
        levers = self._weight_turns[:, 0, joint]
        gravity = np.linalg.norm(self.gravity_m_s2)
        behind = [mass for mass in self.masses if mass.link > joint]
        return float(
            sum(
                mass.mass_kg
                * gravity
                * 0.5
                * (levers[mass.link - 1] + levers[mass.link])
                for mass in behind
            )
        )

    def transverse_axes(self, link: int) -> list[int]:
        """The two axes of the frame at the far end of a link that are least along
        it."""
        return sorted(
            np.argsort(np.abs(self.link_vectors_m[link]), kind="stable")[:2].tolist()
        )

    def moment_turns(self, link: int, axis: int, joint: int) -> bool:
        """Whether a first moment along an axis of the frame at the far end of a link
        can turn a joint, from 0."""
        return bool(self._weight_turns[link, 1 + axis, joint] > _SHORTEST_M)

    @cached_property
    def _weight_turns(self) -> np.ndarray:
        """Largest torque on each joint over some poses by a newton at the far end of
        each link, and by a newton metre each.

        ndarray (n + 1, 4, n): of a weight, then of first moments along the axes of the
        frame there.
        """
        coordinates = self.chain.at(
            np.random.default_rng(0).uniform(-np.pi, np.pi, (16, self.joints))
        )
        ends = self.followed[1 : self.joints + 2]
        found = np.empty((self.joints + 1, 4, self.joints))
        moved = compute_motion(self.chain, coordinates, ends)
        down = (np.array(self.gravity_m_s2) / np.linalg.norm(self.gravity_m_s2))[
            :, None
        ]
        for link, (end, position, rotation) in enumerate(
            zip(ends, moved.position, moved.rotation, strict=True)
        ):
            for number, arm in enumerate((position, *rotation.swapaxes(0, 1))):
                force = np.broadcast_to(0.0 * down if number else down, arm.shape)
                wrench = np.concatenate([force, np.cross(arm, down, axis=0)])
                found[link, number] = np.abs(
                    moved.generalized_forces(end.after, wrench, slice(self.joints))
                ).max(axis=1)
        return found


def build_sites(robot: Robot) -> Sites:
    """Put a site at the foot, behind each joint and at the far end of each link."""
    usual = estimate_typical_compliance(robot.chain, robot.payload_kg)
    compliance = tuple(
        np.where(robot.compliance > 0.0, robot.compliance, usual).tolist()
    )
    known = {
        name: getattr(robot, name)
        for name in (
            "masses",
            "gravity_m_s2",
            "gear_ratio",
            "compensator",
            "payload_kg",
        )
    }
    return _sites_of(robot.chain, compliance=compliance, **known)


# Every part of a diagnosis asks for the sites of its robot; what a run has to do with
# are a few robots.
@lru_cache(maxsize=64)
def _sites_of(chain: Chain, **known: Any) -> Sites:
    inserted: dict[int, list[tuple[str, int]]] = defaultdict(list)
    # A point at the end of a link is moved by the link's end; one inside a link is not.
    places = [
        index
        for index, transform in enumerate(chain.transforms)
        if transform.coordinate is not None
    ]
    joints = [chain.transforms[place] for place in places]
    vectors = []
    rotations = []
    for start, end in zip(
        [0, *(place + 1 for place in places)],
        [*places, len(chain.transforms)],
        strict=True,
    ):
        inserted[start] += SIX_DISPLACEMENTS[3:] if start else SIX_DISPLACEMENTS
        inserted[end] += SIX_DISPLACEMENTS
        # Along the fixed transforms of a link, and from the frame at their end to the
        # one at their start.
        fixed = chain.transforms[start:end]
        far = MeasuringPoint("far end", end - start)
        position, rotation = compute_poses(Chain(fixed, (far,), 1), np.zeros(1), far)
        vectors.append(rotation.T @ position)
        rotations.append(rotation)
    n = len(joints)
    # Along the chain: six of the foot, six of the end of a link, three of the joint
    # behind it, and so on.
    ends = [range(n + 6 + 9 * link, n + 12 + 9 * link) for link in range(n + 1)]
    return Sites(
        insert_coordinates(chain, inserted),
        n,
        tuple(range(n, n + 6)),
        tuple(tuple(range(end.stop, end.stop + 3)) for end in ends[:-1]),
        tuple(tuple(end) for end in ends),
        tuple(joint.axis for joint in joints),
        np.array(vectors),
        np.array(rotations),
        tuple(joint.sign for joint in joints),
        chain.prismatic,
        **known,
    )
