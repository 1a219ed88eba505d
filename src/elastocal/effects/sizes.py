"""How large effects of real robots are, in units of the arm on which they act: the table of priors in docs/method.md.

A size is what such an effect reaches; most are a tenth of it. What yields is sized by the compliance of its own joint, what is
cut by the length of the arm, loads by the rated one: a light arm yields a hundred times as much as a heavy one, and no size in
micrometres or microradians suits both. An instrument and the place where it stands have sizes of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.effects.full_load import full_torque_Nm, rated_kg
from elastocal.effects.protocol import Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from elastocal.mechanics.sites import Sites

ABSOLUTE, JOINT, PER_LENGTH, STIFFEST = (
    "itself",
    "joint's compliance",
    "joint's compliance over 1 m",
    "stiffest joint's compliance",
)
SHIFT, REACH, TORQUE = (
    "stiffest joint's compliance times the square of the reach",
    "reach",
    "joint's turn under its full torque",
)
RATED, LOAD, SAG = "rated load", "weight of the rated load", "joint's compliance times the rated load"
# A carriage that slides turns by its compliance over the square of its length.
_CARRIAGE_M, _SHORTEST_REACH_M = 0.3, 0.3


@dataclass(frozen=True)
class Size:
    """One line of the table.

    `share`: size in the unit of the arm `of`; of what is sized by itself, in the SI unit of the parameter. `sign`: that physics
    gives, 0 for either. `most`: times the size that a bad case reaches: once where the size is one that makers inspect for,
    since what exceeds it is not delivered; several times where it rests on a unit of the arm that is a guess itself, on
    wear, or on what people do.
    """

    effect: str
    quantity: str
    share: float
    of: str
    reason: str
    sign: int = 0
    most: float = 3.0


SIZES = tuple(
    Size(*line)
    for line in (
        ("joint_tilt", "tilt", 1.0, JOINT, "bearings tilt as much as gears turn (Klimchik et al. 2015)", 1),
        ("cross_compliance", "coupling", 0.3, JOINT, "of the geometric mean, beyond which a joint would give energy back"),
        ("joint_dependent_stiffness", "variation", 0.3, JOINT, "teeth and rollers in mesh vary by a third"),
        ("compensator_stiffness", "variation", 0.3, JOINT, "a compensator is an order softer than its gear"),
        ("stiffening", "lost beyond", 0.5, JOINT, "of gears' compliance half goes once all teeth bear", -1),
        ("flange_flexibility", "turn", 0.1, JOINT, "a bolted joint is ten times as stiff as a wrist's gear", 1),
        ("flange_flexibility", "shift", 1e-2, SHIFT, "the same at a tenth of the reach", 1),
        ("link_elasticity", "1/EI", 1.0, PER_LENGTH, "a link bends as much as the gear before it turns", 1),
        ("base_compliance", "tilt", 0.3, STIFFEST, "a foundation is stiffer than what it bears", 1),
        ("base_compliance", "shift", 0.01, SHIFT, "the same at a fifth of the reach", 1),
        ("joint_offset", "turn", 1e-3, ABSOLUTE, "mastering by marks; measured robots have up to 10 mrad"),
        ("joint_offset", "shift", 4e-4, REACH, "as links"),
        ("link_geometry", "length", 4e-4, REACH, "tolerances of castings: a millimetre of 2.5 m"),
        ("link_geometry", "turn", 1e-3, ABSOLUTE, "a millimetre a metre"),
        ("transmission_ratio", "per turn", 1e-3, ABSOLUTE, "a parameter mistyped in its fourth digit"),
        (
            "transmission_harmonic",
            "amplitude",
            2e-4,
            ABSOLUTE,
            "gears are inspected for an arc minute (their catalogues)",
            0,
            1.0,
        ),
        (
            "transmission_order",
            "amplitude",
            2e-4,
            ABSOLUTE,
            "as whole orders: larger waves are another mechanism's, as a torque's",
            0,
            1.0,
        ),
        ("motor_eccentricity", "amplitude", 5e-5, ABSOLUTE, "milliradians at the motor, over a ratio of a hundred"),
        ("bearing_runout", "shift", 5e-5, ABSOLUTE, "slewing bearings run out by hundredths of a millimetre"),
        ("bearing_runout", "wobble", 5e-5, ABSOLUTE, "the same over the diameter of the bearing"),
        ("hysteresis", "turn", 1e-4, ABSOLUTE, "a third of an arc minute"),
        ("hysteresis", "shift", 2e-5, ABSOLUTE, "the nut of a spindle"),
        ("lost_motion", "play", 1e-4, ABSOLUTE, "a third of an arc minute", 1),
        ("compensator_torque", "turn", 0.3, TORQUE, "a compensator bears a third of the weight"),
        ("link_weight", "mass", 1.5, RATED, "an arm weighs six times what it carries, a quarter of it at the end of a link"),
        ("link_weight", "mass of one joint", 1.5, SAG, "the same, by the joint's turn"),
        ("payload", "mass", 0.15, RATED, "a cable package or a forgotten gripper"),
        ("force_bias", "force", 0.01, LOAD, "accuracy class of load cells that suit the arm"),
        ("force_scale", "scale", 0.02, ABSOLUTE, "a load cell that was calibrated long ago"),
        ("force_misalignment", "turn", 0.02, ABSOLUTE, "a sensor mounted by eye: a degree"),
        ("application_point", "shift", 0.01, REACH, "a hook or a screw beside the point that was meant"),
        ("tracker_scale", "scale", 2e-5, ABSOLUTE, "20 K or 70 hPa of air that were not entered"),
        ("nest_eccentricity", "shift", 5e-5, ABSOLUTE, "a worn nest of a reflector"),
        ("base_placement", "shift", 5e-4, ABSOLUTE, "a tracker registers to 0.05 to 0.3 mm, unless a step goes wrong"),
        ("base_placement", "turn", 3e-4, ABSOLUTE, "the same over the reflectors' distance"),
        ("frame_drift", "shift an hour", 2e-4, ABSOLUTE, "a tripod on a warming floor"),
        ("frame_drift", "turn an hour", 1e-4, ABSOLUTE, "the same over its height"),
        ("setup_step", "shift", 5e-4, ABSOLUTE, "a stand that is knocked"),
        ("setup_step", "turn", 2e-4, ABSOLUTE, "the same over its height"),
        ("thermal_growth", "expansion", 3e-5, ABSOLUTE, "aluminium, and a little more for the gears", 1),
        ("thermal_growth", "final growth", 3e-4, ABSOLUTE, "10 K of it"),
        ("temperature_gradient", "curvature a kelvin", 2e-5, ABSOLUTE, "steel, half of the warmth across 0.3 m"),
        ("temperature_gradient", "curvature", 1.5e-4, ABSOLUTE, "8 K of it"),
    )
)
_BY_NAME = {(size.effect, size.quantity): size for size in SIZES}


def size_of(effect: str, quantity: str, sites: Sites, *joints: int) -> float:
    """Size that an effect reaches on an arm, in the SI unit of its parameter.

    `joints`: from 0, by whose compliance it is sized: of several the geometric mean; needed where the table says so.
    """
    size = _BY_NAME[effect, quantity]
    return size.share * _UNITS[size.of](sites, joints)


def sized(
    effect: str, quantity: str, names: Iterable[str], unit: str, sites: Sites, *joints: int, over: float = 1.0
) -> tuple[Parameter, ...]:
    """Parameters of one quantity with its size, divided by `over`, and its sign; `joints` as in `size_of`."""
    size, line = size_of(effect, quantity, sites, *joints) / over, _BY_NAME[effect, quantity]
    return tuple(Parameter(name, unit, size, sign=line.sign, most=line.most) for name in names)


def reach_m(sites: Sites) -> float:
    """Length of the arm outstretched."""
    return max(float(np.linalg.norm(sites.link_vectors_m[1:], axis=1).sum()), _SHORTEST_REACH_M)


def _turning(sites: Sites) -> np.ndarray:
    """Compliance of each joint as one that turns, ndarray (n,), rad/(N m)."""
    return np.where(sites.prismatic, _CARRIAGE_M**-2.0, 1.0) * sites.compliance


def _of_joints(sites: Sites, joints: tuple[int, ...]) -> float:
    return float(np.exp(np.log(_turning(sites)[list(joints)]).mean()))


_UNITS: dict[str, Callable[[Sites, tuple[int, ...]], float]] = {
    ABSOLUTE: lambda sites, joints: 1.0,
    JOINT: _of_joints,
    PER_LENGTH: _of_joints,
    STIFFEST: lambda sites, joints: float(_turning(sites).min()),
    SHIFT: lambda sites, joints: float(_turning(sites).min()) * reach_m(sites) ** 2,
    REACH: lambda sites, joints: reach_m(sites),
    TORQUE: lambda sites, joints: _of_joints(sites, joints) * full_torque_Nm(sites, joints[0]),
    RATED: lambda sites, joints: rated_kg(sites),
    LOAD: lambda sites, joints: rated_kg(sites) * standard_gravity,
    SAG: lambda sites, joints: _of_joints(sites, joints) * rated_kg(sites),
}
