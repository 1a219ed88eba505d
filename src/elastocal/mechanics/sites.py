"""Where a robot can deviate from its chain: small displacements at the base, at each joint and at the far end of each link.

Every physical effect moves the robot through some of these coordinates, the virtual joints of the virtual joint method (see
`elastostatics`), whether a spring yields in them or an error of geometry is one. The chain that holds them all gives exact
poses, and its Jacobian the sensitivity of a measured point to each of them.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import SIX, Chain, MeasuringPoint, Transform, with_inserted
from elastocal.mechanics.kinematics import Motion, motion, poses
from elastocal.mechanics.robot import STANDING, Compensator, Mass, Robot, usual_compliance, usual_payload_kg

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

# Below this a link is a point.
_SHORTEST_M = 1e-6
_MASS_OVER_RATED = 6.0


@dataclass(frozen=True)
class Sites:
    """A chain with every coordinate in which the robot can deviate.

    `chain`: coordinates 0..n-1 are the joints as before. All others are zero in the nominal robot. `joints`: n. `base`: tx
    Ty Tz Rx Ry Rz of the foot, base axes. `tilt`: for each joint Rx Ry Rz just behind it, in the frame that turns with it.
    `link_end`: for each link 0..n Tx Ty Tz Rx Ry Rz at its far end, in the frame of the chain there. Link 0 is the column
    before joint 1, link n the flange behind the last joint. `joint_axes`: 0, 1, 2 for a joint about x, y, z of its frame.
    `link_vectors_m` (n + 1, 3): from the near to the far end of each link, in the frame of its far end. `link_rotations`
    (n + 1, 3, 3): from the frame there to that at its near end: fixed rotations between two joints. `joint_signs`: sense
    in which each joint turns about its axis, +1 or -1. `prismatic`: which joints shift along their axis instead; theirs are
    metres and newtons. `masses`: what the links weigh, where the robot file says so. `gravity_m_s2`: base axes.
    `payload_kg`: as in `Robot`. `compliance` (n,): of the joints as in `Robot`, usual ones of rigid joints: the scale of
    what yields beside them. `usual_weight`: whether the structure, but no joint, bears the weight of `usual_masses`: where
    no masses and no loads are known of an arm that slides.
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

    def far_end(self, link: int) -> MeasuringPoint:
        """The far end of a link, 0 for the column, as a measuring point."""
        return MeasuringPoint("far end", self._behind(self.link_end[link][-1]))

    def body(self, link: int) -> MeasuringPoint:
        """The frame in which the centre of mass of a link is stated: behind its joint, or the foot for the column."""
        return MeasuringPoint("body", self._behind(self.tilt[link - 1][-1] if link else self.base[-1]))

    def _behind(self, coordinate: int) -> int:
        return 1 + next(place for place, t in enumerate(self.chain.transforms) if t.coordinate == coordinate)

    @cached_property
    def followed(self) -> tuple[MeasuringPoint, ...]:
        """Points whose motion gives the load on the coordinates: the end, the far ends of links 0..n, and what has a mass."""
        end = MeasuringPoint("end", self.chain.end_effector.after)
        far_ends = [self.far_end(link) for link in range(self.joints + 1)]
        return (end, *far_ends, *(self.body(mass.link) for mass in self.masses))

    @cached_property
    def usual_masses(self) -> np.ndarray:
        """Masses at the far ends of links 0..n, where none are declared, ndarray (n + 1,), kg.

        Arms weigh six times what they carry; by length, half of each link at either end.
        """
        lengths = np.linalg.norm(self.link_vectors_m[1:], axis=1)
        rated = usual_payload_kg(self.chain) if self.payload_kg is None else self.payload_kg
        halves = 0.5 * _MASS_OVER_RATED * rated * lengths / max(lengths.sum(), _SHORTEST_M)
        return np.append(0.0, halves) + np.append(halves, 0.0)

    @property
    def down(self) -> np.ndarray:
        """Unit vector along gravity, base axes."""
        return np.array(self.gravity_m_s2) / np.linalg.norm(self.gravity_m_s2)

    @property
    def shoulder(self) -> int | None:
        """Index of the first joint that the weight of its links can turn, or None."""
        loaded = (j for j in range(self.joints) if self.carried_links(j))
        return next(loaded, None)

    def carried_links(self, joint: int) -> list[int]:
        """Links with a length behind a joint, from 0, whose weight can turn it, as numbers from 1."""
        links = [k for k in range(joint + 1, self.joints + 1) if np.linalg.norm(self.link_vectors_m[k]) > _SHORTEST_M]
        return [k for k in links if self._longest_levers[k, joint] > _SHORTEST_M]

    def longest_weight_torque_Nm(self, joint: int) -> float:  # noqa: N802 - units in names keep their case
        """Torque on a joint, from 0, by all declared masses behind it, each at the longest lever of the middle of its link."""
        levers, gravity = self._longest_levers[:, joint], np.linalg.norm(self.gravity_m_s2)
        behind = [mass for mass in self.masses if mass.link > joint]
        return float(sum(mass.mass_kg * gravity * 0.5 * (levers[mass.link - 1] + levers[mass.link]) for mass in behind))

    def transverse_axes(self, link: int) -> list[int]:
        """The two axes of the frame at the far end of a link that are least along it."""
        return sorted(np.argsort(np.abs(self.link_vectors_m[link]), kind="stable")[:2].tolist())

    def moment_turns(self, link: int, axis: int, joint: int) -> bool:
        """Whether a first moment along an axis of the frame at the far end of a link can turn a joint, from 0."""
        return bool(self._largest_turns[link, axis, joint] > _SHORTEST_M)

    @cached_property
    def _at_random(self) -> Motion:
        """Motion of the far ends of all links over some poses."""
        coordinates = self.chain.at(np.random.default_rng(0).uniform(-np.pi, np.pi, (16, self.joints)))
        return motion(self.chain, coordinates, [self.far_end(link) for link in range(self.joints + 1)])

    @cached_property
    def _longest_levers(self) -> np.ndarray:
        """Of the weight of each link on each joint over some poses, ndarray (n + 1, n), m."""
        return np.array([self._largest(link, self.down, position) for link, position in enumerate(self._at_random.position)])

    @cached_property
    def _largest_turns(self) -> np.ndarray:
        """Torque on each joint by a unit moment along each axis of each link over some poses, ndarray (n + 1, 3, n)."""
        each = enumerate(self._at_random.rotation)
        return np.array([[self._largest(link, 0.0 * self.down, axis) for axis in axes.swapaxes(0, 1)] for link, axes in each])

    def _largest(self, link: int, force: np.ndarray, arm: np.ndarray) -> np.ndarray:
        """Torque on each joint, (n,), by a force (3,) at the base's origin and a unit weight at the end of an arm (3, S)."""
        moment = np.cross(arm, self.down[:, None], axis=0)
        forces = np.broadcast_to(force[:, None], moment.shape)
        return np.abs(self._at_random.generalized_forces(self.far_end(link).after, forces, moment)[: self.joints]).max(axis=1)


def sites_of(holder: Robot | Chain) -> Sites:
    """Put a site at the foot, behind each joint and at the far end of each link.

    `holder`: a robot gives what is known of its masses, gears and gravity as well; a chain alone is a weightless arm on a
    floor.
    """
    if not isinstance(holder, Robot):
        return _sites_of(holder, compliance=tuple(usual_compliance(holder).tolist()))
    usual = usual_compliance(holder.chain, holder.payload_kg)
    known = {name: getattr(holder, name) for name in ("masses", "gravity_m_s2", "gear_ratio", "compensator", "payload_kg")}
    return _sites_of(
        holder.chain, compliance=tuple(np.where(holder.compliance > 0.0, holder.compliance, usual).tolist()), **known
    )


# Every part of a diagnosis asks for the sites of its robot; what a run has to do with are a few robots.
@lru_cache(maxsize=64)
def _sites_of(chain: Chain, **known: Any) -> Sites:
    inserted: dict[int, list[tuple[str, int]]] = defaultdict(list)
    # A point at the end of a link is moved by the link's end; one inside a link is not.
    places = [index for index, transform in enumerate(chain.transforms) if transform.coordinate is not None]
    joints, links = [chain.transforms[place] for place in places], []
    for start, end in zip([0, *(place + 1 for place in places)], [*places, len(chain.transforms)], strict=True):
        inserted[start] += SIX[3:] if start else SIX
        inserted[end] += SIX
        links.append(_link(chain.transforms[start:end]))
    n = len(joints)
    # Along the chain: six of the foot, six of the end of a link, three of the joint behind it, and so on.
    ends = [range(n + 6 + 9 * link, n + 12 + 9 * link) for link in range(n + 1)]
    vectors, rotations = (np.array(part) for part in zip(*links, strict=True))
    return Sites(
        with_inserted(chain, inserted),
        n,
        tuple(range(n, n + 6)),
        tuple(tuple(range(end.stop, end.stop + 3)) for end in ends[:-1]),
        tuple(tuple(end) for end in ends),
        tuple(joint.axis for joint in joints),
        vectors,
        rotations,
        tuple(joint.sign for joint in joints),
        chain.prismatic,
        **known,
    )


def _link(fixed: Sequence[Transform]) -> tuple[np.ndarray, np.ndarray]:
    """Vector along fixed transforms in the frame at their end, and rotation from that frame to the one at their start."""
    end = MeasuringPoint("end", len(fixed))
    position, rotation = poses(Chain(tuple(fixed), (end,), 1), np.zeros((1, 1)), end)
    return rotation[0].T @ position[0], rotation[0]
