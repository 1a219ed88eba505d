"""List the defects of a simulated robot: named as in the catalogue, or ``outside:...``
if the catalogue does not have them.

A defect has one size, which scales it, and a seed, from which its other details
(directions, phases, thresholds) are drawn. The details do not change with the size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from elastocal_proof.plant import laws
from elastocal_proof.plant.arm import Arm
from elastocal_proof.plant.multibody import (
    find_distinguishable_weights,
    list_flexible_links,
)
from elastocal_proof.plant.simulated_robot import (
    SimulatedRobot,
    open_simulation_stream,
)

OUTSIDE = "outside:"
Location = tuple[int, ...]


@dataclass(frozen=True)
class Kind:
    """Common properties of all defects of one name.

    Attributes
    ----------
    unit
        Of the size.
    plausible
        A size that is realistic for a heavy robot.
    locations
        Lists the locations on an arm: tuples of joints, from 1.
    apply
        Law of the defect: from robot, size, draws of the details, and joints from 0.
    needs
        Covariates without which the catalogue cannot see the defect.
    largest
        Size beyond which the law is meaningless.
    scale
        Exponents of the arm's softness and of its load share in the plausible size.
    """

    unit: str
    plausible: float
    locations: Callable[[Arm], list[Location]]
    apply: Callable[..., laws.DefectiveRobot]
    needs: tuple[str, ...] = ()
    largest: float = np.inf
    scale: tuple[float, float] = (0.0, 0.0)

    def scale_plausible_size(self, arm: Arm) -> float:
        """Compute a size that is realistic for this arm."""
        softness_exponent, load_exponent = self.scale
        return (
            self.plausible
            * arm.softness**softness_exponent
            * arm.load_share**load_exponent
        )


def _nowhere(arm: Arm) -> list[Location]:
    """The only location of a defect that belongs to no joint."""
    return [()]


def _any_joint(arm: Arm) -> list[Location]:
    return [(joint,) for joint in range(1, arm.joints + 1)]


def _joints(first: int, behind: int) -> Callable[[Arm], list[Location]]:
    """All joints from `first` on that have at least `behind` joints behind them."""
    return lambda arm: [(joint,) for joint in range(first, arm.joints + 1 - behind)]


def _shoulder(arm: Arm) -> list[Location]:
    """The joint of a gravity compensator, on arms that have one."""
    return [(2,)] if arm.compensated else []


# Scale exponents: compliances grow with the softness of an arm, forces and masses with
# its load.
_SOFT = (1.0, 0.0)
_LOAD = (0.0, 1.0)
KINDS: dict[str, Kind] = {
    "joint_offset": Kind("rad", 3e-4, _any_joint, laws.joint_offset),
    "link_geometry": Kind("m", 3e-4, _any_joint, laws.link_geometry),
    # The wavelength of the laser is wrong, and the frame of the base was measured with
    # the same error.
    "tracker_scale": Kind(
        "1", 2e-5, _nowhere, partial(laws.set_instrument_error, "tracker", "scale")
    ),
    "link_weight": Kind(
        "kg",
        100.0,
        lambda arm: [*find_distinguishable_weights(arm)],
        laws.link_weight,
        scale=_LOAD,
    ),
    "declared_masses": Kind("1", 0.3, _nowhere, laws.scale_declared_masses),
    "payload": Kind("kg", 25.0, _nowhere, laws.payload, scale=_LOAD),
    "compensator_torque": Kind("N/m", 1e5, _shoulder, laws.compensator_torque),
    "transmission_harmonic": Kind("rad", 8e-5, _any_joint, laws.transmission_harmonic),
    "transmission_ratio": Kind("rad/rad", 3e-4, _any_joint, laws.transmission_ratio),
    "bearing_runout": Kind("m", 3e-5, _any_joint, laws.bearing_runout),
    "motor_eccentricity": Kind("rad", 6e-5, _any_joint, laws.motor_eccentricity),
    "transmission_order": Kind("rad", 8e-5, _any_joint, laws.transmission_order),
    "link_elasticity": Kind(
        "1/(N m^2)", 1e-7, list_flexible_links, laws.link_elasticity, scale=_SOFT
    ),
    "joint_tilt": Kind("rad/(N m)", 2e-7, _any_joint, laws.joint_tilt, scale=_SOFT),
    "base_compliance": Kind(
        "rad/(N m)", 6e-8, _nowhere, laws.base_compliance, scale=_SOFT
    ),
    "cross_compliance": Kind(
        "rad/(N m)",
        8e-8,
        lambda arm: [*combinations(range(1, arm.joints + 1), 2)],
        laws.cross_compliance,
        scale=_SOFT,
    ),
    "joint_dependent_stiffness": Kind(
        "1",
        0.1,
        _any_joint,
        partial(laws.modulate_stiffness, lambda joint: joint),
        largest=0.8,
    ),
    "compensator_stiffness": Kind("N/m", 3e6, _shoulder, laws.compensator_stiffness),
    "flange_flexibility": Kind(
        "rad/(N m)", 2e-7, _nowhere, laws.flange_flexibility, scale=_SOFT
    ),
    "stiffening": Kind("1", 0.3, _any_joint, laws.stiffening, largest=0.95),
    "lost_motion": Kind("rad", 7e-5, _any_joint, laws.lost_motion),
    "hysteresis": Kind("rad", 5e-5, _any_joint, laws.hysteresis, needs=("approach",)),
    "force_scale": Kind(
        "1",
        0.02,
        _nowhere,
        partial(laws.set_instrument_error, "cell", "scale"),
        largest=0.1,
    ),
    "force_misalignment": Kind(
        "rad", 0.02, _nowhere, partial(laws.add_load_cell_error, "turn", "about_")
    ),
    "force_bias": Kind(
        "N",
        20.0,
        _nowhere,
        partial(laws.add_load_cell_error, "bias", "along_"),
        scale=_LOAD,
    ),
    "application_point": Kind(
        "m", 0.02, _nowhere, partial(laws.add_load_cell_error, "shift", "shift_")
    ),
    "frame_drift": Kind("m/h", 1e-4, _nowhere, laws.frame_drift, needs=("time",)),
    "thermal_growth": Kind(
        "1/K", 1.2e-5, _nowhere, laws.thermal_growth, needs=("temperature",)
    ),
    "setup_step": Kind("m", 1e-3, _nowhere, laws.setup_step),
    "temperature_gradient": Kind(
        "1/K",
        1.2e-5,
        lambda arm: [(), *list_flexible_links(arm)],
        laws.temperature_gradient,
        needs=("temperature",),
    ),
    "nest_eccentricity": Kind("m", 1e-4, _nowhere, laws.nest_eccentricity),
    OUTSIDE + "cable_pull": Kind("rad/rad^2", 1e-4, _joints(3, 1), laws.cable_pull),
    OUTSIDE + "two_angles": Kind("rad", 2e-4, _joints(2, 1), laws.two_angles),
    OUTSIDE + "cable_transmission": Kind(
        "rad/(N m)", 1e-7, _joints(2, 1), laws.cable_transmission, scale=_SOFT
    ),
    OUTSIDE + "asymmetric_gear": Kind(
        "rad/(N m)^2", 1e-10, _any_joint, laws.asymmetric_gear, scale=(1.0, -1.0)
    ),
    OUTSIDE + "slipping_zero": Kind("rad", 5e-5, _any_joint, laws.slipping_zero),
    OUTSIDE + "warm_softening": Kind("1/K", 0.01, _any_joint, laws.warm_softening),
    # A parallel rod: the stiffness of the shoulder depends on the angle of the elbow,
    # or that of the elbow on the angle of the shoulder.
    OUTSIDE + "foreign_angle_stiffness": Kind(
        "1",
        0.15,
        lambda arm: [(2,), (3,)],
        partial(laws.modulate_stiffness, lambda joint: 3 - joint),
        largest=0.8,
    ),
    OUTSIDE + "stiffening_link": Kind(
        "rad/(N m)^3",
        1e-13,
        list_flexible_links,
        laws.stiffening_link,
        scale=(1.0, -2.0),
    ),
    OUTSIDE + "foot_slip": Kind("m", 8e-5, _nowhere, laws.foot_slip),
    OUTSIDE + "refraction": Kind(
        "1/m",
        2e-6,
        _nowhere,
        partial(laws.set_instrument_error, "tracker", "refraction_per_m"),
    ),
    OUTSIDE + "cell_crosstalk": Kind(
        "1/N",
        5e-5,
        _nowhere,
        partial(laws.set_instrument_error, "cell", "crosstalk_per_N"),
        scale=(0.0, -1.0),
    ),
    OUTSIDE + "short_waves": Kind("rad", 8e-5, _any_joint, laws.short_waves),
}


@dataclass(frozen=True)
class Defect:
    """A defect of a robot.

    Attributes
    ----------
    effect
        A key of `KINDS`.
    joints
        One of its locations, joints from 1; empty if it belongs to no joint.
    size
        In the unit of its kind, up to its largest size.
    seed
        Of its details.
    """

    effect: str
    joints: Location
    size: float
    seed: int = 0

    def on(self, robot: SimulatedRobot) -> laws.DefectiveRobot:
        """Return the defective robot and the comparable parameters of the defect."""
        draws = open_simulation_stream(self.seed, f"details of {self.effect}")
        joints = (joint - 1 for joint in self.joints)
        return KINDS[self.effect].apply(robot, self.size, draws, *joints)


def apply_defects(
    robot: SimulatedRobot, defects: Iterable[Defect], times: float = 1.0
) -> SimulatedRobot:
    """Apply defects one after another, each multiplied by `times`."""
    for defect in defects:
        robot = replace(defect, size=times * defect.size).on(robot)[0]
    return robot


def draw_defect(effect: str, arm: Arm, seed: int) -> Defect:
    """Draw the location of a defect of plausible size."""
    kind = KINDS[effect]
    locations = kind.locations(arm)
    index = open_simulation_stream(seed, f"place of {effect}").integers(len(locations))
    return Defect(effect, locations[index], kind.scale_plausible_size(arm), seed)
