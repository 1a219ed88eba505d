"""Defects that the catalogue has, and those that it has not, as functions of robot, size, draws of details, and joints from 0.

Laws are those of machines rather than of regressions: a dead band with edges, a stiffness that steps, a hysteresis with a
history; none is the catalogue's formula where a machine would do otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from elastocal_proof.plant.kinds import (
    OUTSIDE,
    Applied,
    Draws,
    each_joint,
    each_link,
    each_pair,
    joints_from,
    kind,
    nowhere,
    shoulder,
    weighed,
    weighing_links,
)
from elastocal_proof.plant.machine import Compensator, Mass, TaperedTube, on_stretches, usual_gravity_torque
from elastocal_proof.plant.physical_robot import Motion, PhysicalRobot, Schedule, SpringLaw, warmth_of_castings

TURN = 2 * np.pi
# Radius of a bearing, how thick a link is, and the reach of an arm on which a usual load turns with its whole force.
_BEARING_M, _LINK_M, _HEAVY_REACH_M = 0.15, 0.25, 2.5
# In the first half of the training poses, with repeats and without, at a state in 25 s.
_KNOCKED_S = (700.0, 2000.0)
_HISTORY_STEPS = 48


def added(robot: PhysicalRobot, part: str, *laws: tuple[int | str, Callable[..., np.ndarray]]) -> PhysicalRobot:
    """With further laws of "drives", "gears" or "springs"."""
    changes: dict[str, Any] = {part: (*getattr(robot, part), *laws)}
    return replace(robot, **changes)


def changed(robot: PhysicalRobot, part: str, **changes: Any) -> PhysicalRobot:
    """With another "structure", "tracker" or "cell"."""
    return replace(robot, **{part: replace(getattr(robot, part), **changes)})


def geared(robot: PhysicalRobot, joint: int, law: Callable[[Schedule, np.ndarray], np.ndarray]) -> PhysicalRobot:
    """With a law of the torque on this joint alone."""
    return added(robot, "gears", (joint, lambda done, torque, _: law(done, torque[:, joint])))


def direction(draws: Draws) -> np.ndarray:
    vector = draws.standard_normal(3)
    return vector / np.linalg.norm(vector)


def named(start: str, vector: Iterable[float], axes: Iterable[str] = "xyz") -> dict[str, float]:
    return {f"{start}{axis}": value for axis, value in zip(axes, vector, strict=True)}


def sign(draws: Draws) -> float:
    return float(draws.choice([-1.0, 1.0]))


def waving(robot: PhysicalRobot, joint: int, *waves: tuple[float, float, float]) -> Applied:
    """Teeth and eccentric wheels: the sum of a_k sin(k q + phase_k); `waves`: order k, perhaps no integer, a_k, phase_k."""

    def turn(done: Schedule) -> np.ndarray:
        q = done.angle[:, joint]
        return sum((size * np.sin(order * q + phase) for order, size, phase in waves), np.zeros_like(q))

    return added(robot, "drives", (joint, turn)), {}


def stiff_by_angle(robot: PhysicalRobot, joint: int, of: int, size: float, phase: float) -> Applied:
    """The stiffness, not the compliance, is a cosine of an angle: theta = c (1 / (1 + e cos(q_of - phase)) - 1) tau."""
    c = robot.compliance[joint]
    return geared(robot, joint, lambda done, tau: c * (1 / (1 + size * np.cos(done.angle[:, of] - phase)) - 1) * tau), {}


def usual_torque_Nm(robot: PhysicalRobot, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque on a joint as its gear is made for: that of the weight it carries, and of a kilonewton at a heavy arm."""
    arm, structure = robot.arm, robot.structure
    load = (1500.0 if joint < arm.joints - 3 else 450.0) * arm.load_share * min(1.0, arm.reach_m / _HEAVY_REACH_M)
    return load + float(usual_gravity_torque(arm, structure.masses, structure.gravity_m_s2)[joint])


def wrong_cell(field: str, start: str, robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """An error in a frame that is drawn, of a cell at a location that is drawn.

    The catalogue's laws leave the moment as stated; those of a cell in the pull are not comparable.
    """
    vector, error = size * direction(draws), field.partition("_")[0]
    # What is felt beyond what is shown is minus the bias of the display.
    changes: dict[str, Any] = {field: tuple(-vector if error == "bias" else vector)}
    # In the flange's axes or not, beside the errors of the load cell that are so already.
    changes["in_flange"] = (*robot.cell.in_flange, error) if draws.integers(2) else robot.cell.in_flange
    if error != "shift":
        changes["mount"] = ("pull", "flange")[draws.integers(2)]
    return changed(robot, "cell", **changes), named(start, vector) if changes.get("mount") != "pull" else {}


# Geometry


@kind("joint_offset", "rad", 3e-4, each_joint)
def joint_offset(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    size = size * sign(draws)
    return added(robot, "drives", (joint, lambda done: np.full(len(done.angle), size))), {"offset": size}


@kind("link_geometry", "m", 3e-4, each_joint)
def link_geometry(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A wrong vector, and a wrong turn of as many milliradians as it has millimetres."""
    vector, turn, old = size * direction(draws), size * direction(draws), robot.structure
    vectors, turns = old.wrong_vectors_m | {joint + 1: tuple(vector)}, old.wrong_turns | {joint + 1: tuple(turn)}
    # The catalogue counts along the axes at the far end of the link.
    parameters = named("d", robot.arm.stretches[joint + 1].rotation.T @ vector) | named("r", turn)
    return changed(robot, "structure", wrong_vectors_m=vectors, wrong_turns=turns), parameters


# A wrong wavelength, at which the frame of the base was measured too.
kind("tracker_scale", "1", 2e-5, nowhere)(lambda robot, size, draws: (changed(robot, "tracker", scale=size), {"scale": size}))
# Gravity


@kind("link_weight", "kg", 100.0, weighed, scale=(0.0, 1.0))
def link_weight(robot: PhysicalRobot, size: float, draws: Draws, *joints: int) -> Applied:
    """Weight of the upper arm or the forearm, beside its line, or of all links as declared, by the joints that it turns."""
    arm, old = robot.arm, robot.structure.masses
    link = weighing_links(arm).get(tuple(joint + 1 for joint in joints))
    if link is not None:
        along, aside = draws.uniform(0.25, 0.6), tuple(draws.uniform(-0.06, 0.06, 3))
        return changed(robot, "structure", masses=(*old, Mass(link, size, along, aside))), {}
    masses = [mass for mass in on_stretches(arm.masses, arm) if mass.stretch > 1]
    total = sum(mass.mass_kg for mass in masses)
    more = [replace(mass, mass_kg=size * mass.mass_kg / total) for mass in masses]
    return changed(robot, "structure", masses=(*old, *more)), {}


@kind("declared_masses", "1", 0.3, nowhere)
def heavier_than_declared(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """All links behind the column heavier by one share than the robot file says."""
    declared = [mass for mass in on_stretches(robot.arm.masses, robot.arm) if mass.stretch]
    more = [replace(mass, mass_kg=size * mass.mass_kg) for mass in declared]
    return changed(robot, "structure", masses=(*robot.structure.masses, *more)), {"share": size}


@kind("payload", "kg", 25.0, nowhere, scale=(0.0, 1.0))
def payload(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    centre = 0.15 * direction(draws)
    heavier = changed(robot, "structure", payload=Mass(robot.arm.joints, size, 1.0, tuple(centre)))
    return heavier, {"mass": size} | named("moment_", size * centre)


@kind("compensator_torque", "N/m", 1e5, shoulder)
def compensator_torque(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A coil spring whose pull the controller does not know."""
    anchor = (-draws.uniform(0.25, 0.4), 0.0, -draws.uniform(0.1, 0.3))
    crank = (draws.uniform(0.12, 0.22), 0.0, draws.uniform(-0.08, 0.08))
    return changed(robot, "structure", compensator=Compensator(anchor, crank, size, draws.uniform(0.2, 0.35))), {}


# Transmission


@kind("transmission_harmonic", "rad", 8e-5, each_joint)
def transmission_harmonic(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """An eccentric wheel that turns with the joint: an order of 1 or 2 but for creep, and half as much of its double."""
    order, phases = draws.choice([1, 2]) * draws.uniform(0.98, 1.02), draws.uniform(0, TURN, 2)
    other = 2 * order if order < 1.5 else order / 2
    return waving(robot, joint, (order, size, phases[0]), (other, 0.5 * size, phases[1]))


@kind("transmission_ratio", "rad/rad", 3e-4, each_joint)
def transmission_ratio(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Of the joint's own ratio, or what the joint before it turns along."""
    of = joint if joint == 0 else joint - int(draws.integers(2))
    size = size * sign(draws)
    return added(robot, "drives", (joint, lambda done: size * done.angle[:, of])), {f"per_q{of + 1}": size}


@kind("bearing_runout", "m", 3e-5, each_joint)
def bearing_runout(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """The axis of a joint moves to and fro once a turn across it and twice across both: circling, it would be another link."""
    phases, old, number = draws.uniform(0, TURN, 4), robot.structure, joint + 1

    def runout(order: int, size: float, phase: float) -> SpringLaw:
        return lambda done, _: size * np.cos(order * done.angle[:, joint] - phase)

    laws = []
    for which, order in enumerate((1, 2)):
        laws.append((f"shift{number}_{which}", runout(order, size, phases[which])))
        laws.append((f"tilt{number}_{which}", runout(order, size / _BEARING_M, phases[2 + which])))
    tilt = old.tilt | {number: old.tilt.get(number, (0.0, 0.0))}
    return added(changed(robot, "structure", loose=tuple({*old.loose, number}), tilt=tilt), "springs", *laws), {}


@kind("motor_eccentricity", "rad", 6e-5, each_joint)
def motor_eccentricity(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A wheel on the motor's shaft: once and twice a turn of the motor, which is no whole number of turns of the joint."""
    order, phases = robot.arm.gear_ratio[joint], draws.uniform(0, TURN, 2)
    return waving(robot, joint, (order, size, phases[0]), (2.0 * order, 0.4 * size, phases[1]))


@kind("transmission_order", "rad", 8e-5, each_joint)
def transmission_order(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A planet or a cage: an order between two integers, and a quarter as much of its double; some twenty poses can show it."""
    order, phases = draws.integers(2, 5) + draws.uniform(0.25, 0.75), draws.uniform(0, TURN, 2)
    return waving(robot, joint, (order, size, phases[0]), (2.0 * order, 0.25 * size, phases[1]))


# Elasticity


@kind("link_elasticity", "1/(N m^2)", 1e-7, each_link, scale=(1.0, 0.0))
def link_elasticity(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A tapered tube that also shears and stretches, as a thin-walled one of a quarter metre does."""
    bending, gyration = 1.0 / size, 0.25**2 / 8.0
    axial = bending / gyration
    tube = TaperedTube(bending, 0.77 * bending, axial, 0.5 * axial / 2.6, draws.uniform(0.1, 0.35))
    return changed(robot, "structure", tubes=robot.structure.tubes | {joint + 1: tube}), {}


@kind("joint_tilt", "rad/(N m)", 2e-7, each_joint, scale=(1.0, 0.0))
def joint_tilt(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    values = size * draws.uniform(0.4, 1.0, 2)
    across = [axis for axis, part in zip("xyz", robot.arm.axes[joint], strict=True) if abs(part) < 0.5]
    tilt = robot.structure.tilt | {joint + 1: tuple(values)}
    return changed(robot, "structure", tilt=tilt), named("tilt_about_", values, across)


@kind("base_compliance", "rad/(N m)", 6e-8, nowhere, scale=(1.0, 0.0))
def base_compliance(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """Anchor bolts: the two tilts and the two shifts differ a little."""
    uneven, horizontal, vertical = draws.uniform(0.85, 1.15, 4), 0.2 * size, 0.1 * size
    base = (horizontal * uneven[0], horizontal * uneven[1], vertical, size * uneven[2], size * uneven[3], 0.0)
    return changed(robot, "structure", base=base), {"vertical": vertical}


@kind("cross_compliance", "rad/(N m)", 8e-8, each_pair, scale=(1.0, 0.0))
def cross_compliance(robot: PhysicalRobot, size: float, draws: Draws, one: int, other: int) -> Applied:
    """Two gears in one housing: theta_i = c tau_j, theta_j = c tau_i."""
    size = size * sign(draws)
    coupled = ((one, lambda _, torque, __: size * torque[:, other]), (other, lambda _, torque, __: size * torque[:, one]))
    return added(robot, "gears", *coupled), {"compliance": size}


kind("joint_dependent_stiffness", "1", 0.1, each_joint, largest=0.8)(
    lambda robot, size, draws, joint: stiff_by_angle(robot, joint, joint, size, draws.uniform(0, TURN))
)


@kind("compensator_stiffness", "N/m", 3e6, shoulder)
def compensator_stiffness(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Stiffness that a coil spring adds at the shoulder, whose torque the controller has taken care of.

    With anchor at distance a, crank at L and free length s0, s^2 = a^2 + L^2 - 2 a L cos(u), u = q - u0, the spring stores
    k (s - s0)^2 / 2, whose second derivative is k_c = k a L [cos u (1 - s0/s) + (a L sin^2 u) s0 / s^3].
    theta = (1 / (1/c + k_c) - c) tau.
    """
    anchor, crank, free = draws.uniform(0.3, 0.5), draws.uniform(0.15, 0.22), draws.uniform(0.15, 0.3)
    zero, compliance, product = draws.uniform(-np.pi, np.pi), robot.compliance[joint], anchor * crank

    def turn(done: Schedule, torque: np.ndarray) -> np.ndarray:
        u = done.angle[:, joint] - zero
        s = np.sqrt(anchor**2 + crank**2 - 2.0 * product * np.cos(u))
        more = size * product * (np.cos(u) * (1.0 - free / s) + product * np.sin(u) ** 2 * free / s**3)
        return (1.0 / (1.0 / compliance + more) - compliance) * torque

    return geared(robot, joint, turn), {}


@kind("flange_flexibility", "rad/(N m)", 2e-7, nowhere, scale=(1.0, 0.0))
def flange_flexibility(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """A tool changer between flange and target: it turns in three directions, and shifts by a tenth of a metre's lever."""
    turns, shifts = size * draws.uniform(0.4, 1.0, 3), 0.01 * size * draws.uniform(0.4, 1.0, 3)
    flange = np.array(robot.structure.flange or (0.0,) * 6) + np.concatenate([shifts, turns])
    return changed(robot, "structure", flange=tuple(flange)), named("shift_", shifts) | named("turn_", turns)


# Gearboxes


@kind("stiffening", "1", 0.3, each_joint, largest=0.95)
def stiffening(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Teeth that come to bear one after another, each a third: theta = - sum_k d sign(tau) max(|tau| - tau_k, 0)."""
    starts = usual_torque_Nm(robot, joint) * np.sort(draws.uniform(0.1, 0.8, 3))
    drop = size * robot.compliance[joint] / 3

    def turn(_: Schedule, torque: np.ndarray) -> np.ndarray:
        return -np.sign(torque) * drop * np.maximum(np.abs(torque)[:, None] - starts, 0.0).sum(axis=1)

    return geared(robot, joint, turn), {}


@kind("lost_motion", "rad", 7e-5, each_joint)
def lost_motion(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Play, of a gap 2 D, between flanks that only a seal's weak spring bridges: theta = D clip(tau / tau_t, -1, 1)."""
    closing = usual_torque_Nm(robot, joint) * draws.uniform(0.02, 0.1)
    return geared(robot, joint, lambda _, torque: size * np.clip(torque / closing, -1.0, 1.0)), {"half_play": size}


@kind("hysteresis", "rad", 5e-5, each_joint, needs=("approach",))
def hysteresis(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Friction that remembers, theta = -h z, with z by the Bouc-Wen model over a torque tau_h; see `wound`.

    An arm that came in the sense s stays behind its drive, z = s with all of its friction wound up; the catalogue counts the
    half width along the approach. h / tau_h must be less than the gear's compliance, or the arm would recede from a push.
    """
    over = usual_torque_Nm(robot, joint) * draws.uniform(2.0, 6.0)

    def turn(done: Schedule, torque: np.ndarray, unloaded: np.ndarray) -> np.ndarray:
        z, now = done.sense[:, joint].astype(float), torque[:, joint]
        fresh = done.previous < 0
        z[fresh] = wound(z[fresh], (now - unloaded[:, joint])[fresh] / over)
        # A state follows one of a smaller number, so that in order each finds its past done.
        for state in np.flatnonzero(~fresh):
            before = done.previous[state]
            z[state] = wound(z[before : before + 1], (now[state : state + 1] - now[before]) / over)[0]
        return -size * z

    return added(robot, "gears", (joint, turn)), {"half_width": -size}


def wound(z: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Friction z (S,) of the Bouc-Wen model [1] after the torque, over tau_h, has changed steadily by `change` (S,).

    dz = dx (1 - z^2 (sign(z dx) + 1) / 2): unloading starts along the straight line of slope 1. By the midpoint method.

    [1] Wen, Y.-K., Method for random vibration of hysteretic systems, Journal of the Engineering Mechanics Division ASCE 102,
        1976.
    """
    step = change / _HISTORY_STEPS

    def slope(z: np.ndarray) -> np.ndarray:
        return 1.0 - z**2 * (0.5 * np.sign(z * step) + 0.5)

    for _ in range(_HISTORY_STEPS):
        z = np.clip(z + step * slope(z + 0.5 * step * slope(z)), -1.0, 1.0)
    return z


# Load


kind("force_scale", "1", 0.02, nowhere, largest=0.1)(
    lambda robot, size, draws: (changed(robot, "cell", scale=1.0 / (1.0 + size) - 1.0), {"scale": size})
)
kind("force_misalignment", "rad", 0.02, nowhere)(partial(wrong_cell, "turn_rad", "about_"))
kind("force_bias", "N", 20.0, nowhere, scale=(0.0, 1.0))(partial(wrong_cell, "bias_N", "along_"))
kind("application_point", "m", 0.02, nowhere)(partial(wrong_cell, "shift_m", "shift_"))

# Drift


@kind("frame_drift", "m/h", 1e-4, nowhere, needs=("time",))
def frame_drift(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """A stand that settles over hours: after t hours it has moved by a rate times T (1 - exp(-t / T))."""
    shift, turn, settling_h = tuple(size * direction(draws)), tuple(0.5 * size * direction(draws)), draws.uniform(3.0, 8.0)
    drift = Motion(shift, turn, lambda time_s: -settling_h * np.expm1(-(time_s / 3600.0) / settling_h))
    return changed(robot, "tracker", drift=drift), {}


# The castings follow the thermometer with a lag, which the catalogue's law by temperature does not know.
kind("thermal_growth", "1/K", 1.2e-5, nowhere, needs=("temperature",))(
    lambda robot, size, draws: (replace(robot, expansion_per_K=size), {})
)


@kind("setup_step", "m", 1e-3, nowhere)
def setup_step(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """The tracker's stand is knocked between two rows: a shift, and a turn about the stand of as much at three metres."""
    after_s, shift, turn = draws.uniform(*_KNOCKED_S), tuple(size * direction(draws)), tuple(size / 3.0 * direction(draws))
    return changed(robot, "tracker", move=Motion(shift, turn, lambda time_s: (time_s > after_s).astype(float))), {}


@kind("temperature_gradient", "1/K", 1.2e-5, lambda arm: [(), *each_link(arm)], needs=("temperature",))
def temperature_gradient(robot: PhysicalRobot, size: float, draws: Draws, *joints: int) -> Applied:
    """Motors at the foot and a cold tip, beside what the arm grows on average; or a link that is warmer on one side."""
    arm, size = robot.arm, size * sign(draws)
    if not joints:
        share = np.linspace(1.0, -1.0, arm.joints + 1)
        mean = share @ arm.lengths_m / arm.lengths_m.sum()
        return replace(robot, gradient_per_K=tuple(np.array(robot.gradient_per_K) + size * (share[[0, -1]] - mean))), {}
    link, about = joints[0] + 1, draws.uniform(0, TURN)
    pieces, tubes = robot.structure.segments, {link: TaperedTube(np.inf, np.inf)} | robot.structure.tubes
    bend = size * arm.lengths_m[link] / _LINK_M / pieces

    def warm(per_kelvin: float) -> SpringLaw:
        return lambda done, _: per_kelvin * warmth_of_castings(done.time_s)

    parts = [warm(bend * np.cos(about)), warm(bend * np.sin(about))]
    laws = [(f"link{link}_{piece}_bend{which}", parts[which]) for piece in range(pieces) for which in range(2)]
    return added(changed(robot, "structure", tubes=tubes), "springs", *laws), {}


@kind("nest_eccentricity", "m", 1e-4, nowhere)
def nest_eccentricity(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    turns = robot.arm.stretches[-1].rotation.T @ robot.arm.axes[-1]
    return changed(robot, "tracker", nest=(size, int(np.argmax(np.abs(turns))))), {}


# Outside of the catalogue


@kind(OUTSIDE + "cable_pull", "rad/rad^2", 1e-4, joints_from(3))
def cable_pull(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A hose wound by its joint and the one before pulls in proportion to the product of the two angles."""
    size = size * sign(draws)
    return added(robot, "drives", (joint, lambda done: size * done.angle[:, joint - 1] * done.angle[:, joint])), {}


@kind(OUTSIDE + "two_angles", "rad", 2e-4, joints_from(2))
def two_angles(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A gear whose wave goes once round as its own joint and the one behind it turn, in step or against each other."""
    sense, phase = sign(draws), draws.uniform(0, TURN)

    def turn(done: Schedule) -> np.ndarray:
        return size * np.sin(done.angle[:, joint] + sense * done.angle[:, joint + 1] + phase)

    return added(robot, "drives", (joint, turn)), {}


@kind(OUTSIDE + "cable_transmission", "rad/(N m)", 1e-7, joints_from(2), scale=(1.0, 0.0))
def cable_transmission(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Cables of a length that changes as they wind, over the next pulley: theta = s (tau (1 + f q / pi) + tau_o / 2)."""
    winding = draws.uniform(0.4, 0.8) * sign(draws)

    def turn(done: Schedule, torque: np.ndarray, _: np.ndarray) -> np.ndarray:
        free = 1.0 + winding * done.angle[:, joint] / np.pi
        return size * (torque[:, joint] * free + 0.5 * torque[:, joint + 1])

    return added(robot, "gears", (joint, turn)), {}


@kind(OUTSIDE + "asymmetric_gear", "rad/(N m)^2", 1e-10, each_joint, scale=(1.0, -1.0))
def asymmetric_gear(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Flanks of unlike shape: theta = k tau^2, alike for both signs of the torque."""
    size = size * sign(draws)
    return geared(robot, joint, lambda _, torque: size * torque**2), {}


@kind(OUTSIDE + "slipping_zero", "rad", 5e-5, each_joint)
def slipping_zero(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A coupling that slips a little at three of ten moves: a random walk from approach to approach, numbered in time."""

    def walk(done: Schedule) -> np.ndarray:
        sizes, whether = (np.random.default_rng([done.seed, 7, part]) for part in range(2))
        number = int(done.approach.max()) + 1
        return np.cumsum(size * sizes.standard_normal(number) * (whether.random(number) < 0.3))[done.approach]

    return added(robot, "drives", (joint, walk)), {}


@kind(OUTSIDE + "warm_softening", "1/K", 0.01, each_joint)
def warm_softening(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A gear that softens as it warms: theta = c r (T - 20 °C) tau."""
    softer = size * robot.compliance[joint]
    return geared(robot, joint, lambda done, torque: softer * warmth_of_castings(done.time_s) * torque), {}


# A parallel rod: the stiffness of the shoulder depends on the angle of the elbow, or the other way round.
kind(OUTSIDE + "foreign_angle_stiffness", "1", 0.15, lambda arm: [(2,), (3,)], largest=0.8)(
    lambda robot, size, draws, joint: stiff_by_angle(robot, joint, 3 - joint, size, draws.uniform(0, TURN))
)


@kind(OUTSIDE + "stiffening_link", "rad/(N m)^3", 1e-13, each_link, scale=(1.0, -2.0))
def stiffening_link(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A bolted link whose flanges open with the cube of the bending moment; without it the link is rigid."""
    pieces = robot.structure.segments
    rigid = changed(robot, "structure", tubes=robot.structure.tubes | {joint + 1: TaperedTube(np.inf, np.inf)})
    names = [f"link{joint + 1}_{piece}_bend" for piece in range(pieces)]
    return added(rigid, "springs", *((name, lambda _, moment: size * moment**3 / pieces) for name in names)), {}


@kind(OUTSIDE + "foot_slip", "m", 8e-5, nowhere)
def foot_slip(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """A foot between its bolts: it shifts by a clearance as soon as the push exceeds friction, and no further."""
    friction = draws.uniform(100.0, 300.0) * robot.arm.load_share

    def slip(_: Schedule, push: np.ndarray) -> np.ndarray:
        return size * np.sign(push) * np.clip((np.abs(push) - friction) / friction, 0.0, 1.0)

    return added(changed(robot, "structure", base=(0.0,) * 6), "springs", ("base_x", slip), ("base_y", slip)), {}


kind(OUTSIDE + "refraction", "1/m", 2e-6, nowhere)(
    lambda robot, size, draws: (changed(robot, "tracker", refraction_per_m=size), {})
)
kind(OUTSIDE + "cell_crosstalk", "1/N", 5e-5, nowhere, scale=(0.0, -1.0))(
    lambda robot, size, draws: (changed(robot, "cell", crosstalk_per_N=size), {})
)


@kind(OUTSIDE + "short_waves", "rad", 8e-5, each_joint)
def short_waves(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Teeth of a motor's pinion: of orders far above what the poses of a campaign can resolve."""
    orders, phases = draws.uniform(45.0, 120.0, 3), draws.uniform(0, 6.28, 3)
    return waving(robot, joint, *zip(orders, [size / np.sqrt(3)] * 3, phases, strict=True))
