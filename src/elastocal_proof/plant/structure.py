"""What an arm is made of beside its drives: masses, tubes, bearings, foot, gravity compensator, and wrong dimensions."""

from dataclasses import dataclass, field

import numpy as np
from scipy.constants import g as standard_gravity


@dataclass(frozen=True)
class TaperedTube:
    """An elastic link: a thin-walled tube that gets thinner towards its far end.

    `bending_Nm2`, `torsion_Nm2`: E I and G J at its near end. `axial_N`, `shear_N`: E A and k G A; inf where the link does not
    stretch or shear. `taper`: share of the diameter that is lost at the far end; E I and G J go with its third power, E A and k
    G A with itself.
    """

    bending_Nm2: float
    torsion_Nm2: float
    axial_N: float = np.inf
    shear_N: float = np.inf
    taper: float = 0.0


@dataclass(frozen=True)
class Mass:
    """A weight on a stretch.

    `stretch`: 0 is the column, n the flange. `along`: where on the stretch, 0 at its near end, 1 at its far end. `aside_m`: and
    how far off the line, in the frame at the near end.
    """

    stretch: int
    mass_kg: float
    along: float = 0.5
    aside_m: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Compensator:
    """A coil spring from the carousel to the upper arm.

    `anchor_m`: fixed end, from the shoulder, in the frame that turns with joint 1. `crank_m`: moving end, from the shoulder, in
    the frame of the upper arm. `stiffness_N_per_m`, `free_length_m`: pull = stiffness (length - free length).
    """

    anchor_m: tuple[float, ...]
    crank_m: tuple[float, ...]
    stiffness_N_per_m: float
    free_length_m: float


@dataclass(frozen=True)
class Structure:
    """Everything of an arm that its robot file does not declare. The default is an arm of drives alone.

    `base`: compliances of the foot along x, y, z (m/N) and about x, y, z (rad/(N m)). `flange`: compliances between the last
    stretch and the flange along x, y, z (m/N) and about x, y, z (rad/(N m)) of its frame. `tilt` (float, float): of a joint,
    from 1: compliances across its axis, rad/(N m), in the order of the remaining axes. `loose`: joints, from 1, whose bearings
    let the arm shift across the axis, by what `PhysicalRobot.offsets` say. `tubes`: elastic stretches. `segments`: into how
    many rigid pieces an elastic stretch is cut. `payload`: its place counts from the flange: ``aside_m`` in the flange's frame.
    `wrong_vectors_m`, `wrong_turns`: of a stretch: by how much its vector and its far end's rotation vector (rad) differ from
    the robot file. `gravity_m_s2`: in the axes of the base.
    """

    base: tuple[float, ...] | None = None
    flange: tuple[float, ...] | None = None
    tilt: dict[int, tuple[float, float]] = field(default_factory=dict)
    loose: tuple[int, ...] = ()
    tubes: dict[int, TaperedTube] = field(default_factory=dict)
    segments: int = 6
    masses: tuple[Mass, ...] = ()
    payload: Mass | None = None
    compensator: Compensator | None = None
    wrong_vectors_m: dict[int, tuple[float, ...]] = field(default_factory=dict)
    wrong_turns: dict[int, tuple[float, ...]] = field(default_factory=dict)
    gravity_m_s2: tuple[float, ...] = (0.0, 0.0, -standard_gravity)
