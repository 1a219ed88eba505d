"""A robot: its chain, the known properties of its elasticity, weight and gears, and
typical values for robots of its size."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain

# m/s² (ISO 80000-3), as scipy.constants.g, whose import takes a job of the study longer
# than its work.
STANDARD_GRAVITY = 9.80665
# Gravity of a robot on a level floor, base axes.
STANDING = (0.0, 0.0, -STANDARD_GRAVITY)
# Joint limits if none are known: controllers count revolute joints within one turn
# either way.
UNLIMITED_DEG = (-360.0, 360.0)
# Torsion of a robot's gear under its rated torque: 3 (cycloidal) to 7 arc minutes
# (strain wave) by the makers' catalogues.
_WIND_UP_RAD = 2e-3
# Compliance of a rack or a ball screw of a track, 50 N/µm.
_TRACK_M_PER_N = 2e-8
# Rated loads of arms of 1 to 3 m grow with the volume of the reach: 10 kg at 1.3 m, 165
# kg at 2.7 m.
_LOAD_KG_PER_M3 = 8.0
# Wrists are rated for a load whose centre is at least this far from the flange.
_SHORTEST_LEVER_M = 0.2


@dataclass(frozen=True)
class Tube:
    """A thick-walled tube of one material."""

    outer_diameter_m: float
    wall_m: float
    youngs_modulus_Pa: float
    shear_modulus_Pa: float


@dataclass(frozen=True)
class Link:
    """A rigid section of the chain between two joints, modelled as a tube.

    Attributes
    ----------
    after : number of transforms of the chain before its far end
    vector_m : from its near to its far end, in the frame of the chain there
    tube : cross-section and material
    """

    after: int
    vector_m: tuple[float, ...]
    tube: Tube


@dataclass(frozen=True)
class Mass:
    """The declared mass of a link.

    Attributes
    ----------
    link : number of the joint that carries the link, 0 for the column
    mass_kg : mass
    centre_m : centre of mass in the frame directly behind the joint, see `robot_file`
    relative_std : relative uncertainty of the mass and of each component of the centre
    """

    link: int
    mass_kg: float
    centre_m: tuple[float, ...]
    relative_std: float


@dataclass(frozen=True)
class Compensator:
    """A gravity compensator, "spring" or "gas", at a joint, counted from 1."""

    joint: int
    kind: str


@dataclass(frozen=True)
class Robot:
    """A robot as its file describes it, in SI units.

    Attributes
    ----------
    name : name of the robot
    chain : kinematic chain
    compliance : (n,) array
        Joint compliances, rad/(N m), of prismatic joints m/N; typical values if they
        are not known.
    joint_limits : (n, 2) array
        Rad, of prismatic joints m; one turn either way if they are not known.
    links : elastic links of the extended model; empty for the reduced model
    reported_matrix, reported_offset : (n, m) and (n,) arrays
        Joint angles from the m that the controller reports: q = matrix @ reported +
        offset (rad). There are fewer reported angles than joints, m < n, if joints of
        the chain follow others, such as the mimic joints of a URDF.
    masses : in the order of the links; empty if none are known
    gravity_m_s2 : base axes
    base_moves : bool
        Whether joints of the chain move the base, as those of a second arm do. The
        direction of gravity is then unknown, and weights are not modelled.
    gear_ratio : tuple, optional
        Turns of the motor for one turn of each joint, None for an unknown ratio.
    compensator : gravity compensator, if there is one
    payload_kg : rated load, if it is known
    joint_names : names of the joints elsewhere, such as in the robot's URDF file
    stated_command_names : names of the m reported joints, if they are not those of the
        joints
    compliance_known : bool
        Whether the compliances belong to the robot. If not, they are the scale of
        compliances to identify, see `estimate_typical_compliance`.
    """

    name: str
    chain: Chain
    compliance: np.ndarray
    joint_limits: np.ndarray
    links: tuple[Link, ...]
    reported_matrix: np.ndarray
    reported_offset: np.ndarray
    masses: tuple[Mass, ...] = ()
    gravity_m_s2: tuple[float, ...] = STANDING
    base_moves: bool = False
    gear_ratio: tuple[float | None, ...] | None = None
    compensator: Compensator | None = None
    payload_kg: float | None = None
    joint_names: tuple[str, ...] | None = None
    stated_command_names: tuple[str, ...] | None = None
    compliance_known: bool = True

    @property
    def joints(self) -> int:
        """Number of joints of the chain."""
        return self.chain.coordinates

    @property
    def commands(self) -> int:
        """Number of joint angles that the controller reports and is commanded."""
        return int(self.reported_matrix.shape[1])

    @property
    def has_followers(self) -> bool:
        """Whether joints of the chain follow others, and have no command of their
        own."""
        return self.commands < self.joints

    @property
    def command_names(self) -> tuple[str, ...] | None:
        """Names of the reported joints, if they are known."""
        if self.has_followers or self.stated_command_names:
            return self.stated_command_names
        return self.joint_names

    @property
    def leading_joints(self) -> np.ndarray:
        """Indices of m joints of the chain whose angles determine those of all joints,
        ndarray (m,) of int: the first ones that do. All joints lead unless some follow.
        """
        leading: list[int] = []
        for joint in range(self.joints):
            rows = self.reported_matrix[[*leading, joint]]
            if not self.has_followers or np.linalg.matrix_rank(rows) == len(rows):
                leading.append(joint)
        return np.array(leading)

    @property
    def prismatic_commands(self) -> tuple[bool, ...]:
        """Whether each reported joint is a translation, as its leading joint is."""
        prismatic = self.chain.prismatic
        return tuple(prismatic[joint] for joint in self.leading_joints)

    @property
    def is_coupled(self) -> np.ndarray:
        """Whether a joint follows others or is followed, (n,) bool array. A whole turn of
        such a joint is not an equivalent posture, because other joints move with it."""
        if not self.has_followers:
            return np.zeros(self.joints, bool)
        moves = self.reported_matrix != 0.0
        has_one_command = moves.sum(axis=1) == 1
        moves_one_joint = moves.sum(axis=0) == 1
        moves_alone = (moves & moves_one_joint).any(axis=1)
        return ~(has_one_command & moves_alone)

    def restrict_jacobians(self, jacobian: np.ndarray) -> np.ndarray:
        """Restrict Jacobians (..., 6, n) of the chain to motions that commands can
        bring about: their columns belong to orthonormal directions of such motions,
        (..., 6, m). Nothing changes unless joints follow others."""
        if not self.has_followers:
            return jacobian
        return jacobian @ self._motions

    def expand_steps(self, steps: np.ndarray) -> np.ndarray:
        """Expand steps (..., m) along the directions of `restrict_jacobians` to steps
        of all joints, (..., n)."""
        if not self.has_followers:
            return steps
        return steps @ self._motions.T

    @property
    def _motions(self) -> np.ndarray:
        """Orthonormal directions of the motions that commands bring about, (n, m)
        array."""
        return np.linalg.qr(self.reported_matrix)[0]

    def spread_angles(self, shares: np.ndarray, limits: np.ndarray) -> np.ndarray:
        """Find the joint angles (N, n) of the chain whose leading joints are at shares
        (N, m) of limits (n, 2), rad. Joints that follow may be beyond theirs."""
        leading = self.leading_joints
        low, high = limits[leading].T
        angles = low + (high - low) * shares
        if not self.has_followers:
            return angles
        shifted = angles - self.reported_offset[leading]
        reported = np.linalg.solve(self.reported_matrix[leading], shifted.T).T
        return self.model_angles(reported)

    def model_angles(self, reported: np.ndarray) -> np.ndarray:
        """Convert joint angles (..., m) that the controller reports to those of the
        chain (..., n), rad."""
        return reported @ self.reported_matrix.T + self.reported_offset

    def reported_angles(self, angles: np.ndarray) -> np.ndarray:
        """Convert joint angles (N, n) of the chain to those (N, m) that the controller
        reports, rad.

        If joints follow others, only `angles` that they can reach together have a
        command; for others it is that of the nearest ones.
        """
        shifted = angles - self.reported_offset
        if self.has_followers:
            return shifted @ np.linalg.pinv(self.reported_matrix).T
        return np.linalg.solve(self.reported_matrix, shifted.T).T


def set_target_offset(robot: Robot, offset_m: Sequence[float]) -> Robot:
    """Set the same target offset on every measuring point of a robot (T_tool,
    interpretation R5)."""
    points = tuple(
        replace(point, offset_m=tuple(offset_m)) for point in robot.chain.points
    )
    return replace(robot, chain=replace(robot.chain, points=points))


def estimate_typical_payload_kg(chain: Chain) -> float:
    """Estimate the rated load of an arm from its reach."""
    return _LOAD_KG_PER_M3 * float(_sum_lengths_behind(chain)[0]) ** 3


def estimate_typical_compliance(
    chain: Chain, payload_kg: float | None = None
) -> np.ndarray:
    """Estimate joint compliances (n,) from the size of an arm: two milliradians under
    the rated load at the longest lever.

    The published compliances of KUKA and FANUC robots of 165 kg are 0.5 to 5 times
    these values. Use them as a scale for identification, not to compute deflections.

    Parameters
    ----------
    chain : Chain
    payload_kg : float, optional
        Rated load; by default from `estimate_typical_payload_kg`.
    """
    if payload_kg is None:
        payload_kg = estimate_typical_payload_kg(chain)
    load_N = STANDARD_GRAVITY * payload_kg
    # Give a chain without lengths a lever as well, and a load of a kilogram.
    levers = np.maximum(_sum_lengths_behind(chain), _SHORTEST_LEVER_M)
    revolute = _WIND_UP_RAD / (max(load_N, STANDARD_GRAVITY) * levers)
    return np.where(chain.prismatic, _TRACK_M_PER_N, revolute)


def _sum_lengths_behind(chain: Chain) -> np.ndarray:
    """Sum the lengths of the chain behind each joint, ndarray (n,), m."""
    lengths = []
    joints = {}
    for index, transform in enumerate(chain.transforms):
        lengths.append(abs(transform.constant) if transform.kind == "T" else 0.0)
        joints[transform.coordinate] = index
    return np.array(
        [math.fsum(lengths[joints[joint] :]) for joint in range(chain.coordinates)]
    )
