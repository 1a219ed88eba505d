"""Defects: all that can be wrong with a physical robot, named as in the catalogue, or
``outside:...`` where it is not there.

A defect has one size, which scales it, and a seed, from which its other details
(directions, phases, thresholds) are drawn; they do not change with the size.
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
from elastocal_proof.plant.simulated_robot import SimulatedRobot, open_simulation_stream

OUTSIDE = "outside:"
Location = tuple[int, ...]


@dataclass(frozen=True)
class Kind:
    """What all defects of one name have in common.

    `unit`: of the size. `plausible`: a size such as real robots have. `locations`:
    joints at which it can be on an arm, from 1. `apply`: of robot, size, draws of the
    details, and joints from 0. `needs`: covariates without which the catalogue cannot
    see it. `largest`: size beyond which the law means nothing. `scale`: powers of how
    soft an arm is and of how large its loads are, with which the plausible size goes.
    """

    unit: str
    plausible: float
    locations: Callable[[Arm], list[Location]]
    apply: Callable[..., laws.DefectiveRobot]
    needs: tuple[str, ...] = ()
    largest: float = np.inf
    scale: tuple[float, float] = (0.0, 0.0)

    def scale_plausible_size(self, arm: Arm) -> float:
        """A size such as this arm may have; `plausible` is a heavy one's."""
        return (
            self.plausible
            * arm.softness ** self.scale[0]
            * arm.load_share ** self.scale[1]
        )


def _nowhere(arm: Arm) -> list[Location]:
    return [()]


def _joints(first: int, behind: int = 0) -> Callable[[Arm], list[Location]]:
    """From one joint on, all that have so many behind them."""
    return lambda arm: [(joint,) for joint in range(first, arm.joints + 1 - behind)]


def _shoulder(arm: Arm) -> list[Location]:
    """Where a gravity compensator can be, on arms that have one."""
    return [(2,)] if arm.compensated else []


_SOFT = (1.0, 0.0)
_LOAD = (0.0, 1.0)
KINDS: dict[str, Kind] = {
    "joint_offset": Kind("rad", 3e-4, _joints(1), laws.joint_offset),
    "link_geometry": Kind("m", 3e-4, _joints(1), laws.link_geometry),
    # A wrong wavelength, at which the frame of the base was measured too.
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
    "transmission_harmonic": Kind("rad", 8e-5, _joints(1), laws.transmission_harmonic),
    "transmission_ratio": Kind("rad/rad", 3e-4, _joints(1), laws.transmission_ratio),
    "bearing_runout": Kind("m", 3e-5, _joints(1), laws.bearing_runout),
    "motor_eccentricity": Kind("rad", 6e-5, _joints(1), laws.motor_eccentricity),
    "transmission_order": Kind("rad", 8e-5, _joints(1), laws.transmission_order),
    "link_elasticity": Kind(
        "1/(N m^2)", 1e-7, list_flexible_links, laws.link_elasticity, scale=_SOFT
    ),
    "joint_tilt": Kind("rad/(N m)", 2e-7, _joints(1), laws.joint_tilt, scale=_SOFT),
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
        _joints(1),
        partial(laws.modulate_stiffness, lambda joint: joint),
        largest=0.8,
    ),
    "compensator_stiffness": Kind("N/m", 3e6, _shoulder, laws.compensator_stiffness),
    "flange_flexibility": Kind(
        "rad/(N m)", 2e-7, _nowhere, laws.flange_flexibility, scale=_SOFT
    ),
    "stiffening": Kind("1", 0.3, _joints(1), laws.stiffening, largest=0.95),
    "lost_motion": Kind("rad", 7e-5, _joints(1), laws.lost_motion),
    "hysteresis": Kind("rad", 5e-5, _joints(1), laws.hysteresis, needs=("approach",)),
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
        "rad/(N m)^2", 1e-10, _joints(1), laws.asymmetric_gear, scale=(1.0, -1.0)
    ),
    OUTSIDE + "slipping_zero": Kind("rad", 5e-5, _joints(1), laws.slipping_zero),
    OUTSIDE + "warm_softening": Kind("1/K", 0.01, _joints(1), laws.warm_softening),
    # A parallel rod: the stiffness of the shoulder depends on the angle of the elbow,
    # or the other way round.
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
    OUTSIDE + "short_waves": Kind("rad", 8e-5, _joints(1), laws.short_waves),
}


@dataclass(frozen=True)
class Defect:
    """One thing that is wrong with a robot.

    `effect`: a key of `KINDS`. `joints`: from 1, one of its locations; empty where it
    belongs to none. `size`: in the unit of its kind, up to its largest. `seed`: of its
    details.
    """

    effect: str
    joints: Location
    size: float
    seed: int = 0

    def on(self, robot: SimulatedRobot) -> laws.DefectiveRobot:
        """The robot with it, and those of its parameters that are comparable."""
        draws = open_simulation_stream(self.seed, f"details of {self.effect}")
        return KINDS[self.effect].apply(
            robot, self.size, draws, *(joint - 1 for joint in self.joints)
        )


def apply_defects(
    robot: SimulatedRobot, defects: Iterable[Defect], times: float = 1.0
) -> SimulatedRobot:
    """A robot with defects, one after another, each so many times as large."""
    for defect in defects:
        robot = replace(defect, size=times * defect.size).on(robot)[0]
    return robot


def draw_defect(effect: str, arm: Arm, seed: int) -> Defect:
    """A defect of plausible size at a location that is drawn."""
    locations = KINDS[effect].locations(arm)
    drawn = open_simulation_stream(seed, f"place of {effect}").integers(len(locations))
    return Defect(
        effect, locations[drawn], KINDS[effect].scale_plausible_size(arm), seed
    )
