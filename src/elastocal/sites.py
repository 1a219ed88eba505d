"""Where a robot can deviate from its chain: small displacements at the base, at each joint and at the far end of each link.

Every physical effect moves the robot through some of these coordinates. The chain that holds them all gives exact poses, and
its Jacobian the sensitivity of a measured point to each of them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from elastocal.kinematics import poses, poses_and_jacobians, poses_and_jacobians_of_points
from elastocal.robot import Chain, MeasuringPoint, Transform

# Below this a link is a point.
_SHORTEST_M = 1e-6


@dataclass(frozen=True)
class Sites:
    """A chain with every coordinate in which the robot can deviate.

    Attributes
    ----------
    chain : Chain
        Coordinates 0..n-1 are the joints as before. All others are zero in the nominal robot.
    joints : int
        n.
    base : tuple of int
        Tx Ty Tz Rx Ry Rz of the foot, base axes.
    tilt : tuple of tuple of int
        For each joint Rx Ry Rz just behind it, in the frame that turns with it.
    link_end : tuple of tuple of int
        For each link 0..n Tx Ty Tz Rx Ry Rz at its far end, in the frame of the chain there. Link 0 is the column before joint
        1, link n the flange behind the last joint.
    joint_axes : tuple of int
        0, 1, 2 for a joint about x, y, z of its frame.
    link_vectors_m : ndarray (n + 1, 3)
        From the near to the far end of each link, in the frame of its far end.
    """

    chain: Chain
    joints: int
    base: tuple
    tilt: tuple
    link_end: tuple
    joint_axes: tuple
    link_vectors_m: np.ndarray

    def lever_of_weight(self, joint_angles, joint, link):
        """Torque on a joint per newton of weight at the far end of a link.

        Parameters
        ----------
        joint_angles : ndarray (..., n)
            rad.
        joint : int
            From 0.
        link : int
            0 is the column.

        Returns
        -------
        ndarray (...,)
            N m / N.
        """
        coordinates = np.zeros((*np.shape(joint_angles)[:-1], self.chain.coordinates))
        coordinates[..., : self.joints] = joint_angles
        return -poses_and_jacobians(self.chain, coordinates, self.far_end(link))[2][..., 2, joint]

    def far_end(self, link):
        """The far end of a link, 0 for the column, as a measuring point."""
        last = self.link_end[link][-1]
        place = next(place for place, transform in enumerate(self.chain.transforms) if transform.coordinate == last)
        return MeasuringPoint("far end", place + 1)

    @property
    def shoulder(self):
        """Index of the first joint that the weight of its links can turn, or None."""
        loaded = (j for j in range(self.joints) if self.carried_links(j))
        return next(loaded, None)

    def carried_links(self, joint):
        """Links with a length behind a joint whose weight can turn it, as numbers from 1.

        Parameters
        ----------
        joint : int
            From 0.

        Returns
        -------
        list of int
        """
        links = [k for k in range(joint + 1, self.joints + 1) if np.linalg.norm(self.link_vectors_m[k]) > _SHORTEST_M]
        return [k for k in links if self._longest_levers[k, joint] > _SHORTEST_M]

    @cached_property
    def _longest_levers(self):
        """Of the weight of each link on each joint over some poses, ndarray (n + 1, n), m."""
        coordinates = np.zeros((16, self.chain.coordinates))
        coordinates[:, : self.joints] = np.random.default_rng(0).uniform(-np.pi, np.pi, (16, self.joints))
        far_ends = [self.far_end(link) for link in range(self.joints + 1)]
        jacobians = poses_and_jacobians_of_points(self.chain, coordinates, far_ends)[2]
        return np.abs(jacobians[:, :, 2, : self.joints]).max(axis=1)


def sites_of(chain):
    """Put a site at the foot, behind each joint and at the far end of each link.

    Parameters
    ----------
    chain : Chain
        Of revolute joints.

    Returns
    -------
    Sites
    """
    springs = _Springs(chain.coordinates)
    base = springs.add("TTTRRR")
    tilt, link_end, axes, vectors, moved, start = [], [], [], [], {}, 0
    # A point at the end of a link is moved by the link's end; one inside a link is not.
    for index, transform in enumerate((*chain.transforms, None)):
        if transform is None or transform.coordinate is not None:
            link_end.append(springs.add("TTTRRR"))
            vectors.append(_link_vector(chain.transforms[start:index]))
        moved[index] = len(springs.transforms)
        if transform is None:
            break
        springs.transforms.append(transform)
        if transform.coordinate is not None:
            tilt.append(springs.add("RRR"))
            axes.append(transform.axis)
            start = index + 1
    points = tuple(MeasuringPoint(p.name, moved[p.after], p.offset_m) for p in chain.points)
    extended = Chain(tuple(springs.transforms), points, springs.count)
    return Sites(extended, chain.coordinates, base, tuple(tilt), tuple(link_end), tuple(axes), np.array(vectors))


class _Springs:
    """Transforms so far, and the number of coordinates that they use."""

    def __init__(self, count):
        self.transforms, self.count = [], count

    def add(self, kinds):
        first = self.count
        for number, kind in enumerate(kinds):
            self.transforms.append(Transform(kind, number % 3, 0.0, first + number))
        self.count += len(kinds)
        return tuple(range(first, self.count))


def _link_vector(fixed):
    """Vector along fixed transforms, in the frame at their end."""
    end = MeasuringPoint("end", len(fixed))
    position, rotation = poses(Chain(tuple(fixed), (end,), 1), np.zeros((1, 1)), end)
    return rotation[0].T @ position[0]
