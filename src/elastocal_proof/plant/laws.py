"""What defects do, those of the catalogue and others, as functions of robot, size,
draws of details, and joints from 0.

Laws are those of machines rather than of regressions: a dead band with edges, a
stiffness that steps, a hysteresis with a history; none is the catalogue's formula where
a machine would do otherwise. `kinds` names them and says where they can be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from elastocal_proof.plant.arm import LinkMass
from elastocal_proof.plant.multibody import (
    SEGMENTS,
    TaperedTube,
    compute_typical_gravity_torque,
    find_distinguishable_weights,
)
from elastocal_proof.plant.simulated_robot import (
    Motion,
    Schedule,
    SimulatedRobot,
    compute_casting_warming,
)

Draws = np.random.Generator
# The defective robot, and those parameters that the catalogue's law of this effect has
# in common with what was done, by the catalogue's names; exactly or to first order in
# the size.
DefectiveRobot = tuple[SimulatedRobot, dict[str, float]]
TURN = 2 * np.pi
# Radius of a bearing, how thick a link is, and the reach of an arm on which a usual
# load turns with its whole force.
_BEARING_M = 0.15
_LINK_M = 0.25
_HEAVY_REACH_M = 2.5
# In the first half of the training poses, with repeats and without, at a state in 25 s.
_KNOCKED_S = (700.0, 2000.0)
_HISTORY_STEPS = 48
_RIGID = TaperedTube(np.inf, np.inf)


def add_laws(
    robot: SimulatedRobot, part: str, *laws: tuple[int | str, Callable[..., Any]]
) -> SimulatedRobot:
    """With further laws of "drives", "gears" or "springs"."""
    changes: dict[str, Any] = {part: (*getattr(robot, part), *laws)}
    return replace(robot, **changes)


def change_part(robot: SimulatedRobot, part: str, **changes: Any) -> SimulatedRobot:
    """With another "structure", "tracker" or "cell"."""
    return replace(robot, **{part: replace(getattr(robot, part), **changes)})


def add_gear_law(
    robot: SimulatedRobot, joint: int, law: Callable[[Schedule, np.ndarray], np.ndarray]
) -> SimulatedRobot:
    """With a law of the torque on this joint alone."""
    return add_laws(
        robot, "gears", (joint, lambda done, torque, _: law(done, torque[:, joint]))
    )


def add_drive_law(
    robot: SimulatedRobot, joint: int, law: Callable[[np.ndarray], np.ndarray]
) -> SimulatedRobot:
    """With an error of this joint's drive by the angles of all joints."""
    return add_laws(robot, "drives", (joint, lambda done: law(done.angle)))


def draw_direction(draws: Draws) -> np.ndarray:
    vector = draws.standard_normal(3)
    return vector / np.linalg.norm(vector)


def name_components(
    start: str, vector: Iterable[float], axes: Iterable[str] = "xyz"
) -> dict[str, float]:
    return {f"{start}{axis}": value for axis, value in zip(axes, vector, strict=True)}


def draw_sign(draws: Draws) -> float:
    return float(draws.choice([-1.0, 1.0]))


def compute_typical_torque_Nm(robot: SimulatedRobot, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque on a joint as its gear is made for: that of the weight it carries, and of
    a kilonewton at a heavy arm."""
    arm = robot.arm
    structure = robot.structure
    load = (
        (1500.0 if joint < arm.joints - 3 else 450.0)
        * arm.load_share
        * min(1.0, arm.reach_m / _HEAVY_REACH_M)
    )
    return load + float(
        compute_typical_gravity_torque(arm, structure.masses, structure.gravity_m_s2)[
            joint
        ]
    )


# Geometry and weight


def joint_offset(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    size = size * draw_sign(draws)
    return add_laws(robot, "drives", (joint, lambda _: size)), {"offset": size}


def link_geometry(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A wrong vector, and a wrong turn of as many milliradians as it has
    millimetres."""
    vector = size * draw_direction(draws)
    turn = size * draw_direction(draws)
    link = joint + 1
    # The catalogue counts along the axes at the far end of the link.
    parameters = name_components(
        "d", robot.arm.links[link].rotation.T @ vector
    ) | name_components("r", turn)
    return change_part(
        robot,
        "structure",
        geometry_errors=robot.structure.geometry_errors | {link: (vector, turn)},
    ), parameters


def link_weight(
    robot: SimulatedRobot, size: float, draws: Draws, *joints: int
) -> DefectiveRobot:
    """Weight of the upper arm or the forearm, beside its line, or of all links as
    declared, by the joints that it turns."""
    link = find_distinguishable_weights(robot.arm).get(
        tuple(joint + 1 for joint in joints)
    )
    if link is not None:
        along = draws.uniform(0.25, 0.6)
        aside = draws.uniform(-0.06, 0.06, 3)
        heavy = LinkMass(
            link,
            size,
            tuple(along * robot.arm.links[link].vector_m + aside),
            along=along,
        )
        return change_part(
            robot, "structure", masses=(*robot.structure.masses, heavy)
        ), {}
    kilograms = {mass.link: mass.mass_kg for mass in robot.arm.masses if mass.link > 1}
    return scale_declared_masses(robot, size / sum(kilograms.values()), draws, 2)[0], {}


def scale_declared_masses(
    robot: SimulatedRobot, size: float, draws: Draws, first_link: int = 1
) -> DefectiveRobot:
    """All links behind the column heavier by one share than the robot file says."""
    more = [
        replace(mass, mass_kg=size * mass.mass_kg)
        for mass in robot.arm.masses
        if mass.link >= first_link
    ]
    return change_part(robot, "structure", masses=(*robot.structure.masses, *more)), {
        "share": size
    }


def payload(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    centre = 0.15 * draw_direction(draws)
    heavier = change_part(
        robot, "structure", payload=LinkMass(robot.arm.joints, size, tuple(centre))
    )
    return heavier, {"mass": size} | name_components("moment_", size * centre)


def compensator_torque(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A coil spring whose pull the controller does not know."""
    anchor = (-draws.uniform(0.25, 0.4), 0.0, -draws.uniform(0.1, 0.3))
    crank = (draws.uniform(0.12, 0.22), 0.0, draws.uniform(-0.08, 0.08))
    return change_part(
        robot, "structure", compensator=(anchor, crank, size, draws.uniform(0.2, 0.35))
    ), {}


# Transmission


def add_sinusoids(
    robot: SimulatedRobot,
    joint: int,
    orders: ArrayLike,
    sizes: ArrayLike,
    phases: np.ndarray,
) -> DefectiveRobot:
    """Teeth and eccentric wheels: the sum of sizes sin(orders q + phases); orders need
    not be whole."""
    return add_drive_law(
        robot,
        joint,
        lambda q: (
            np.sin(np.outer(q[:, joint], np.array(orders)) + phases) @ np.array(sizes)
        ),
    ), {}


def transmission_harmonic(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """An eccentric wheel that turns with the joint: an order of 1 or 2 but for creep,
    and half as much of its double."""
    order = draws.choice([1, 2]) * draws.uniform(0.98, 1.02)
    phases = draws.uniform(0, TURN, 2)
    return add_sinusoids(
        robot,
        joint,
        (order, 2 * order if order < 1.5 else order / 2),
        (size, 0.5 * size),
        phases,
    )


def motor_eccentricity(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A wheel on the motor's shaft: once and twice a turn of the motor, which is no
    whole number of turns of the joint."""
    order = robot.arm.gear_ratio[joint]
    return add_sinusoids(
        robot,
        joint,
        (order, 2.0 * order),
        (size, 0.4 * size),
        draws.uniform(0, TURN, 2),
    )


def transmission_order(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A planet or a cage: an order between two integers, and a quarter as much of its
    double; some twenty poses can show it."""
    order = draws.integers(2, 5) + draws.uniform(0.25, 0.75)
    return add_sinusoids(
        robot,
        joint,
        (order, 2.0 * order),
        (size, 0.25 * size),
        draws.uniform(0, TURN, 2),
    )


def short_waves(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Teeth of a motor's pinion: of orders far above what the poses of a campaign can
    resolve."""
    return add_sinusoids(
        robot,
        joint,
        draws.uniform(45.0, 120.0, 3),
        [size / np.sqrt(3)] * 3,
        draws.uniform(0, 6.28, 3),
    )


def transmission_ratio(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Of the joint's own ratio, or what the joint before it turns along."""
    of = joint if joint == 0 else joint - int(draws.integers(2))
    size = size * draw_sign(draws)
    return add_drive_law(robot, joint, lambda q: size * q[:, of]), {
        f"per_q{of + 1}": size
    }


def bearing_runout(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """The axis of a joint moves to and fro once a turn across it and twice across both:
    circling, it would be another link."""
    phases = draws.uniform(0, TURN, (2, 2))
    number = joint + 1
    bearings = robot.structure.bearings

    def runout(
        order: int, size: float, phase: float
    ) -> Callable[[Schedule, np.ndarray], np.ndarray]:
        return lambda done, _: size * np.cos(order * done.angle[:, joint] - phase)

    laws = [
        (f"{motion}{number}_{which}", runout(which + 1, largest, phases[place, which]))
        for place, (motion, largest) in enumerate(
            (("shift", size), ("tilt", size / _BEARING_M))
        )
        for which in range(2)
    ]
    return add_laws(
        change_part(robot, "structure", bearings={number: (0.0, 0.0)} | bearings),
        "springs",
        *laws,
    ), {}


def cable_pull(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A hose wound by its joint and the one before pulls in proportion to the product
    of the two angles."""
    size = size * draw_sign(draws)
    return add_drive_law(
        robot, joint, lambda q: size * q[:, joint - 1] * q[:, joint]
    ), {}


def two_angles(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A gear whose wave goes once round as its own joint and the one behind it turn, in
    step or against each other."""
    sense = draw_sign(draws)
    phase = draws.uniform(0, TURN)
    return add_drive_law(
        robot,
        joint,
        lambda q: size * np.sin(q[:, joint] + sense * q[:, joint + 1] + phase),
    ), {}


def slipping_zero(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A coupling that slips a little at three of ten moves: a random walk from approach
    to approach, numbered in time."""

    def walk(done: Schedule) -> np.ndarray:
        sizes, whether = (
            np.random.default_rng([done.seed, 7, part]) for part in range(2)
        )
        number = int(done.approach.max()) + 1
        return np.cumsum(
            size * sizes.standard_normal(number) * (whether.random(number) < 0.3)
        )[done.approach]

    return add_laws(robot, "drives", (joint, walk)), {}


# Elasticity


def link_elasticity(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A tapered tube that also shears and stretches, as a thin-walled one of a quarter
    metre does."""
    bending = 1.0 / size
    gyration = 0.25**2 / 8.0
    axial = bending / gyration
    tube = TaperedTube(
        bending, 0.77 * bending, axial, 0.5 * axial / 2.6, draws.uniform(0.1, 0.35)
    )
    return change_part(
        robot, "structure", tubes=robot.structure.tubes | {joint + 1: tube}
    ), {}


def stiffening_link(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A bolted link whose flanges open with the cube of the bending moment; without it
    the link is rigid."""
    rigid = change_part(
        robot, "structure", tubes=robot.structure.tubes | {joint + 1: _RIGID}
    )
    return add_laws(
        rigid,
        "springs",
        (f"link{joint + 1}_bend", lambda _, moment: size * moment**3 / SEGMENTS),
    ), {}


def joint_tilt(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    values = size * draws.uniform(0.4, 1.0, 2)
    across = [
        axis
        for axis, part in zip("xyz", robot.arm.axes[joint], strict=True)
        if abs(part) < 0.5
    ]
    bearings = robot.structure.bearings | {joint + 1: tuple(values)}
    return change_part(robot, "structure", bearings=bearings), name_components(
        "tilt_about_", values, across
    )


def base_compliance(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """Anchor bolts: the two tilts and the two shifts differ a little."""
    uneven = draws.uniform(0.85, 1.15, 4)
    horizontal = 0.2 * size
    vertical = 0.1 * size
    base = (
        horizontal * uneven[0],
        horizontal * uneven[1],
        vertical,
        size * uneven[2],
        size * uneven[3],
        0.0,
    )
    return change_part(robot, "structure", base=base), {"vertical": vertical}


def foot_slip(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """A foot between its bolts: it shifts by a clearance as soon as the push exceeds
    friction, and no further."""
    friction = draws.uniform(100.0, 300.0) * robot.arm.load_share

    def slip(_: Schedule, push: np.ndarray) -> np.ndarray:
        return (
            size
            * np.sign(push)
            * np.clip((np.abs(push) - friction) / friction, 0.0, 1.0)
        )

    return add_laws(
        change_part(robot, "structure", base=(0.0,) * 6),
        "springs",
        ("base_x", slip),
        ("base_y", slip),
    ), {}


def flange_flexibility(
    robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """A tool changer between flange and target: it turns in three directions, and
    shifts by a tenth of a metre's lever."""
    turns = size * draws.uniform(0.4, 1.0, 3)
    shifts = 0.01 * size * draws.uniform(0.4, 1.0, 3)
    flange = np.array(robot.structure.flange or (0.0,) * 6) + np.concatenate(
        [shifts, turns]
    )
    return change_part(robot, "structure", flange=tuple(flange)), name_components(
        "shift_", shifts
    ) | name_components("turn_", turns)


# Gears under torque


def cross_compliance(
    robot: SimulatedRobot, size: float, draws: Draws, one: int, other: int
) -> DefectiveRobot:
    """Two gears in one housing: theta_i = c tau_j, theta_j = c tau_i."""
    size = size * draw_sign(draws)
    coupled = (
        (one, lambda _, torque, __: size * torque[:, other]),
        (other, lambda _, torque, __: size * torque[:, one]),
    )
    return add_laws(robot, "gears", *coupled), {"compliance": size}


def modulate_stiffness(
    of: Callable[[int], int],
    robot: SimulatedRobot,
    size: float,
    draws: Draws,
    joint: int,
) -> DefectiveRobot:
    """The stiffness, not the compliance, is a cosine of an angle: theta = c (1 / (1 + e
    cos(q_of - phase)) - 1) tau."""
    c = robot.compliance[joint]
    other = of(joint)
    phase = draws.uniform(0, TURN)
    return add_gear_law(
        robot,
        joint,
        lambda done, tau: (
            c * (1 / (1 + size * np.cos(done.angle[:, other] - phase)) - 1) * tau
        ),
    ), {}


def compensator_stiffness(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Stiffness that a coil spring adds at the shoulder, whose torque the controller
    has taken care of.

    With anchor at distance a, crank at L and free length s0, s^2 = a^2 + L^2 - 2 a L
    cos(u), u = q - u0, the spring stores k (s - s0)^2 / 2, whose second derivative is
    k_c = k a L [cos u (1 - s0/s) + (a L sin^2 u) s0 / s^3]. theta = (1 / (1/c + k_c) -
    c) tau.
    """
    anchor = draws.uniform(0.3, 0.5)
    crank = draws.uniform(0.15, 0.22)
    free = draws.uniform(0.15, 0.3)
    zero = draws.uniform(-np.pi, np.pi)
    compliance = robot.compliance[joint]
    product = anchor * crank

    def turn(done: Schedule, torque: np.ndarray) -> np.ndarray:
        u = done.angle[:, joint] - zero
        s = np.sqrt(anchor**2 + crank**2 - 2.0 * product * np.cos(u))
        more = (
            size
            * product
            * (np.cos(u) * (1.0 - free / s) + product * np.sin(u) ** 2 * free / s**3)
        )
        return (1.0 / (1.0 / compliance + more) - compliance) * torque

    return add_gear_law(robot, joint, turn), {}


def stiffening(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Teeth that come to bear one after another, each a third: theta = - sum_k d
    sign(tau) max(|tau| - tau_k, 0)."""
    at = compute_typical_torque_Nm(robot, joint) * np.sort(draws.uniform(0.1, 0.8, 3))
    drop = size * robot.compliance[joint] / 3
    return add_gear_law(
        robot,
        joint,
        lambda _, tau: (
            -np.sign(tau) * drop * np.maximum(np.abs(tau)[:, None] - at, 0).sum(axis=1)
        ),
    ), {}


def lost_motion(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Play, of a gap 2 D, between flanks that only a seal's weak spring bridges: theta
    = D clip(tau / tau_t, -1, 1)."""
    closing = compute_typical_torque_Nm(robot, joint) * draws.uniform(0.02, 0.1)
    return add_gear_law(
        robot, joint, lambda _, torque: size * np.clip(torque / closing, -1.0, 1.0)
    ), {"half_play": size}


def hysteresis(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Friction that remembers, theta = -h z, with z by the Bouc-Wen model over a torque
    tau_h; see `wound`.

    An arm that came in the sense s stays behind its drive, z = s with all of its
    friction wound up; the catalogue counts the half width along the approach. h / tau_h
    must be less than the gear's compliance, or the arm would recede from a push.
    """
    over = compute_typical_torque_Nm(robot, joint) * draws.uniform(2.0, 6.0)

    def turn(done: Schedule, torque: np.ndarray, unloaded: np.ndarray) -> np.ndarray:
        z = done.sense[:, joint].astype(float)
        now = torque[:, joint]
        fresh = done.previous < 0
        z[fresh] = integrate_bouc_wen(
            z[fresh], (now - unloaded[:, joint])[fresh] / over
        )
        # A state follows one of a smaller number, so that in order each finds its past
        # done.
        for state in np.flatnonzero(~fresh):
            before = done.previous[state]
            z[state] = integrate_bouc_wen(
                z[before : before + 1], (now[state : state + 1] - now[before]) / over
            )[0]
        return -size * z

    return add_laws(robot, "gears", (joint, turn)), {"half_width": -size}


def integrate_bouc_wen(z: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Friction z (S,) of the Bouc-Wen model [1] after the torque, over tau_h, has
    changed steadily by `change` (S,).

    dz = dx (1 - z^2 (sign(z dx) + 1) / 2): unloading starts along the straight line of
    slope 1. By the midpoint method.

    [1] Wen, Y.-K., Method for random vibration of hysteretic systems, Journal of the Engineering Mechanics Division ASCE 102,
        1976.
    """
    step = change / _HISTORY_STEPS

    def slope(z: np.ndarray) -> np.ndarray:
        return 1.0 - z**2 * (0.5 * np.sign(z * step) + 0.5)

    for _ in range(_HISTORY_STEPS):
        z = np.clip(z + step * slope(z + 0.5 * step * slope(z)), -1.0, 1.0)
    return z


def cable_transmission(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Cables of a length that changes as they wind, over the next pulley: theta = s
    (tau (1 + f q / pi) + tau_o / 2)."""
    winding = draws.uniform(0.4, 0.8) * draw_sign(draws)

    def turn(done: Schedule, torque: np.ndarray, _: np.ndarray) -> np.ndarray:
        free = 1.0 + winding * done.angle[:, joint] / np.pi
        return size * (torque[:, joint] * free + 0.5 * torque[:, joint + 1])

    return add_laws(robot, "gears", (joint, turn)), {}


def asymmetric_gear(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Flanks of unlike shape: theta = k tau^2, alike for both signs of the torque."""
    size = size * draw_sign(draws)
    return add_gear_law(robot, joint, lambda _, torque: size * torque**2), {}


def warm_softening(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A gear that softens as it warms: theta = c r (T - 20 °C) tau."""
    softer = size * robot.compliance[joint]
    return add_gear_law(
        robot,
        joint,
        lambda done, torque: softer * compute_casting_warming(done.time_s) * torque,
    ), {}


# Load cell, tracker and warmth


def set_instrument_error(
    part: str, field: str, robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """An error of the tracker or of the cell that is one number; a scale is
    comparable."""
    return change_part(robot, part, **{field: size}), {
        "scale": size
    } if field == "scale" else {}


def add_load_cell_error(
    error: str, start: str, robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """An error in a frame that is drawn, of a cell at a location that is drawn.

    The catalogue's laws leave the moment as stated; those of a cell in the pull are not
    comparable.
    """
    vector = size * draw_direction(draws)
    cell = robot.cell
    # What is felt beyond what is shown is minus the bias of the display.
    errors = cell.errors | {error: -vector if error == "bias" else vector}
    # In the flange's axes or not, beside the errors of the load cell that are so
    # already.
    in_flange = (*cell.in_flange, error) if draws.integers(2) else cell.in_flange
    mount = cell.mount if error == "shift" else ("pull", "flange")[draws.integers(2)]
    comparable = error == "shift" or mount != "pull"
    return change_part(
        robot, "cell", errors=errors, in_flange=in_flange, mount=mount
    ), name_components(start, vector) if comparable else {}


def frame_drift(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """A stand that settles over hours: after t hours it has moved by a rate times T (1
    - exp(-t / T))."""
    shift = tuple(size * draw_direction(draws))
    turn = tuple(0.5 * size * draw_direction(draws))
    settling_h = draws.uniform(3.0, 8.0)
    drift = Motion(
        shift,
        turn,
        lambda time_s: -settling_h * np.expm1(-(time_s / 3600.0) / settling_h),
    )
    return change_part(robot, "tracker", drift=drift), {}


def setup_step(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """The tracker's stand is knocked between two rows: a shift, and a turn about the
    stand of as much at three metres."""
    after_s = draws.uniform(*_KNOCKED_S)
    shift = tuple(size * draw_direction(draws))
    turn = tuple(size / 3.0 * draw_direction(draws))
    return change_part(
        robot,
        "tracker",
        move=Motion(shift, turn, lambda time_s: (time_s > after_s).astype(float)),
    ), {}


def nest_eccentricity(
    robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    turns = robot.arm.links[-1].rotation.T @ robot.arm.axes[-1]
    return change_part(robot, "tracker", nest=(size, int(np.argmax(np.abs(turns))))), {}


def temperature_gradient(
    robot: SimulatedRobot, size: float, draws: Draws, *joints: int
) -> DefectiveRobot:
    """Motors at the foot and a cold tip, beside what the arm grows on average; or a
    link that is warmer on one side."""
    arm = robot.arm
    size = size * draw_sign(draws)
    if not joints:
        share = np.linspace(1.0, -1.0, arm.joints + 1)
        return thermal_growth(
            robot,
            size * (share[[0, -1]] - share @ arm.lengths_m / arm.lengths_m.sum()),
            draws,
        )
    link = joints[0] + 1
    about = draws.uniform(0, TURN)
    bend = size * arm.lengths_m[link] / _LINK_M / SEGMENTS

    def warm(per_kelvin: float) -> Callable[[Schedule, np.ndarray], np.ndarray]:
        return lambda done, _: per_kelvin * compute_casting_warming(done.time_s)

    laws = [
        (f"link{link}_bend{which}", warm(bend * part))
        for which, part in enumerate((np.cos(about), np.sin(about)))
    ]
    return add_laws(
        change_part(robot, "structure", tubes={link: _RIGID} | robot.structure.tubes),
        "springs",
        *laws,
    ), {}


def thermal_growth(
    robot: SimulatedRobot, size: np.ndarray | float, draws: Draws
) -> DefectiveRobot:
    """The castings follow the thermometer with a lag, which the catalogue's law by
    temperature does not know."""
    return replace(
        robot, expansion_per_K=tuple(np.array(robot.expansion_per_K) + size)
    ), {}
