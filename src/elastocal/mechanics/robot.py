"""A robot: its chain, what is known of its elasticity, weight and gears, and what
robots of its size usually have."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain

# m/s² (ISO 80000-3), on a floor; as scipy.constants.g, whose import costs a job of the
# study more than its work.
STANDARD_GRAVITY = 9.80665
STANDING = (0.0, 0.0, -STANDARD_GRAVITY)
# Controllers count revolute joints within a turn either way.
UNLIMITED_DEG = (-360.0, 360.0)
# Gears of robots wind up by 3 (cycloidal) to 7 arc minutes (strain wave) under the
# torque that they are rated for, by their makers' catalogues.
_WIND_UP_RAD = 2e-3
# A rack or a ball screw of a track, 50 N/µm.
_TRACK_M_PER_N = 2e-8
# Rated loads of arms of 1 to 3 m grow with the volume that they reach: 10 kg with 1.3
# m, 165 kg with 2.7 m.
_LOAD_KG_PER_M3 = 8.0
# Wrists are rated for a load whose centre lies so far from the flange at least.
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
    """A rigid stretch of the chain between two joints, and the tube that it is taken
    for.

    `after`: transforms of the chain before its far end. `vector_m`: from its near end
    to that, in the frame of the chain there.
    """

    after: int
    vector_m: tuple[float, ...]
    tube: Tube


@dataclass(frozen=True)
class Mass:
    """What a link weighs, as its file declares it.

    `link`: carried by this joint; 0 for the column. `centre_m`: centre of mass in the
    frame directly behind the joint, see `robot_file`. `relative_std`: how well this is
    known: of the mass, and of each component of the centre.
    """

    link: int
    mass_kg: float
    centre_m: tuple[float, ...]
    relative_std: float


@dataclass(frozen=True)
class Compensator:
    """A gravity compensator, "spring" or "gas", beside a joint, counted from 1."""

    joint: int
    kind: str


@dataclass(frozen=True)
class Robot:
    """A robot as its file describes it, in SI units.

    `compliance` (n,): joint compliances, rad/(N m); of prismatic joints m/N. Usual ones
    where they are not known. `joint_limits` (n, 2): rad; of prismatic joints m. A turn
    either way where they are not known. `links`: elastic links of the extended model;
    empty for the reduced model. `reported_matrix`, `reported_offset` (n, n), (n,):
    joint angles from what the controller reports: q = matrix @ reported + offset (rad).
    `masses`: in the order of the links; empty where nothing is known. `gravity_m_s2`:
    base axes. `gear_ratio`: turns of the motor for one of the joint, None for joints
    where it is not known; None where no joint's is. `payload_kg`: rated. `joint_names`:
    what others call the joints, as in the URDF file that a robot comes from; None where
    they have no names. `compliance_known`: whether the compliances are the robot's;
    else they are a scale for what is to be identified, see `usual_values`.
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
    gear_ratio: tuple[float | None, ...] | None = None
    compensator: Compensator | None = None
    payload_kg: float | None = None
    joint_names: tuple[str, ...] | None = None
    compliance_known: bool = True

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.chain.coordinates

    def model_angles(self, reported: np.ndarray) -> np.ndarray:
        """The chain's joint angles (..., n) from those that the controller reports,
        rad."""
        return reported @ self.reported_matrix.T + self.reported_offset

    def reported_angles(self, angles: np.ndarray) -> np.ndarray:
        """Joint angles (N, n) as the controller reports them from the chain's, rad."""
        return np.linalg.solve(
            self.reported_matrix, (angles - self.reported_offset).T
        ).T


def set_target_offset(robot: Robot, offset_m: Sequence[float]) -> Robot:
    """A robot with the same target offset on every measuring point (T_tool,
    interpretation R5)."""
    points = tuple(
        replace(point, offset_m=tuple(offset_m)) for point in robot.chain.points
    )
    return replace(robot, chain=replace(robot.chain, points=points))


def estimate_typical_payload_kg(chain: Chain) -> float:
    """A rated load that suits the reach of an arm."""
    return _LOAD_KG_PER_M3 * float(_reach_behind(chain)[0]) ** 3


def estimate_typical_compliance(
    chain: Chain, payload_kg: float | None = None
) -> np.ndarray:
    """Joint compliances (n,) that suit the size of an arm: two milliradians under the
    rated load at the longest lever.

    The published ones of KUKA and FANUC robots of 165 kg are 0.5 to 5 times these: a
    scale for what is to be identified, no value to compute with. `payload_kg`: rated
    load; by `usual_payload_kg` without.
    """
    load_N = STANDARD_GRAVITY * (
        estimate_typical_payload_kg(chain) if payload_kg is None else payload_kg
    )
    levers = np.maximum(_reach_behind(chain), _SHORTEST_LEVER_M)
    # A chain without lengths has a lever all the same, and a load of a kilogram.
    return np.where(
        chain.prismatic,
        _TRACK_M_PER_N,
        _WIND_UP_RAD / (max(load_N, STANDARD_GRAVITY) * levers),
    )


def _reach_behind(chain: Chain) -> np.ndarray:
    """Lengths of the chain behind each joint, stretched out, ndarray (n,), m."""
    lengths = [abs(t.constant) if t.kind == "T" else 0.0 for t in chain.transforms]
    places = [
        next(p for p, t in enumerate(chain.transforms) if t.coordinate == joint)
        for joint in range(chain.coordinates)
    ]
    return np.array([math.fsum(lengths[place:]) for place in places])
