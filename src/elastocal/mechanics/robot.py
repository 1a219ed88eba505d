"""A robot: its chain, and what is known of its elasticity, its weight and its gears."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, overload

import numpy as np

from elastocal.mechanics.chain import Chain

if TYPE_CHECKING:
    from collections.abc import Sequence

# m/s² (ISO 80000-3), on a floor; as scipy.constants.g, whose import costs a job of the study more than its work.
STANDARD_GRAVITY = 9.80665
STANDING = (0.0, 0.0, -STANDARD_GRAVITY)


@dataclass(frozen=True)
class Tube:
    """A thick-walled tube of one material.

    Attributes
    ----------
    outer_diameter_m, wall_m : float
        Outer diameter and wall thickness.
    youngs_modulus_Pa, shear_modulus_Pa : float
        Material.
    """

    outer_diameter_m: float
    wall_m: float
    youngs_modulus_Pa: float
    shear_modulus_Pa: float


@dataclass(frozen=True)
class Link:
    """A rigid stretch of the chain between two joints, and the tube that it is taken for.

    Attributes
    ----------
    after : int
        How many transforms of the chain come before its far end.
    vector_m : tuple of float
        From its near to its far end, in the frame of the chain there.
    tube : Tube
    """

    after: int
    vector_m: tuple[float, ...]
    tube: Tube


@dataclass(frozen=True)
class Mass:
    """What a link weighs, as its file declares it.

    Attributes
    ----------
    link : int
        Carried by this joint; 0 for the column.
    mass_kg : float
    centre_m : tuple of float
        Centre of mass in the frame directly behind the joint, see `robot_file`.
    relative_std : float
        How well this is known: of the mass, and of each component of the centre.
    """

    link: int
    mass_kg: float
    centre_m: tuple[float, ...]
    relative_std: float


@dataclass(frozen=True)
class Compensator:
    """A gravity compensator beside a joint.

    Attributes
    ----------
    joint : int
        From 1.
    kind : {"spring", "gas"}
    """

    joint: int
    kind: str


@dataclass(frozen=True)
class Robot:
    """A robot as its file describes it, in SI units.

    Attributes
    ----------
    name : str
    chain : Chain
    compliance : ndarray (n,)
        Joint compliances, rad/(N m); of prismatic joints m/N. Usual ones where they are not known.
    joint_limits : ndarray (n, 2)
        rad; of prismatic joints m. A turn either way where they are not known.
    links : tuple of Link
        Elastic links of the extended model; empty for the reduced model.
    reported_matrix, reported_offset : ndarray (n, n), (n,)
        Joint angles from what the controller reports: q = matrix @ reported + offset (rad).
    masses : tuple of Mass
        In the order of the links; empty where nothing is known.
    gravity_m_s2 : tuple of float
        Base axes.
    gear_ratio : tuple of float or None
        Turns of the motor for one of the joint, None for joints where it is not known; None where no joint's is.
    compensator : Compensator or None
    payload_kg : float or None
        Rated.
    joint_names : tuple of str or None
        What others call the joints, as in the URDF file that a robot comes from; None where they have no names.
    compliance_known : bool
        Whether the compliances are the robot's; else they are a scale for what is to be identified, see `usual_values`.
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

    @property
    def counts_each_joint(self) -> bool:
        """Whether the controller counts each joint by itself, in either sense and in steps of its own size."""
        return bool(np.allclose(np.abs(self.reported_matrix), np.eye(self.joints), atol=0.0))

    def model_angles(self, reported: np.ndarray) -> np.ndarray:
        """The chain's joint angles from those that the controller reports.

        Parameters
        ----------
        reported : ndarray (..., n)
            rad.

        Returns
        -------
        ndarray (..., n)
        """
        return reported @ self.reported_matrix.T + self.reported_offset

    def reported_angles(self, angles: np.ndarray) -> np.ndarray:
        """Joint angles as the controller reports them from the chain's.

        Parameters
        ----------
        angles : ndarray (N, n)
            rad.

        Returns
        -------
        ndarray (N, n)
        """
        return np.linalg.solve(self.reported_matrix, (angles - self.reported_offset).T).T


def with_rigid_joints(robot: Robot) -> Robot:
    """A robot whose joints do not yield, whatever it weighs: what is left of one without known compliances.

    Parameters
    ----------
    robot : Robot

    Returns
    -------
    Robot
        Without masses, which turn nothing.
    """
    return replace(robot, compliance=np.zeros(robot.joints), masses=(), compliance_known=False)


@overload
def with_target_offset(holder: Chain, offset_m: Sequence[float]) -> Chain: ...


@overload
def with_target_offset(holder: Robot, offset_m: Sequence[float]) -> Robot: ...


def with_target_offset(holder: Chain | Robot, offset_m: Sequence[float]) -> Chain | Robot:
    """A chain, or the robot around it, with the same target offset on every measuring point (T_tool, interpretation R5).

    Parameters
    ----------
    holder : Chain or Robot
    offset_m : sequence of float

    Returns
    -------
    Chain or Robot
    """
    if isinstance(holder, Robot):
        return replace(holder, chain=with_target_offset(holder.chain, offset_m))
    return replace(holder, points=tuple(replace(p, offset_m=tuple(offset_m)) for p in holder.points))
