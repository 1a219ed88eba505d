"""Apply defects to a simulated robot: defects of the catalogue, and others.

The functions of defects have the names of the catalogue's effects. Each takes the robot,
the size of the defect, random draws of its details, and joints that count from 0. It
returns the defective robot and those parameters, by the catalogue's names, that the
catalogue's law of this effect has in common with the simulated one, exactly or to first
order in the size.

The laws are those of machines rather than of regressions: a dead band with edges, a
stiffness that steps, a hysteresis with a history. A law has the formula of the catalogue
only if a machine behaves like it. `kinds` lists the defects and says where they can be.
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
DefectiveRobot = tuple[SimulatedRobot, dict[str, float]]
GearLaw = Callable[[Schedule, np.ndarray], np.ndarray]
TURN = 2 * np.pi
# Radius of a bearing, and thickness of a link.
_BEARING_RADIUS_M = 0.15
_LINK_THICKNESS_M = 0.25
# Torques on the gears of an arm: external loads on the main and the wrist joints of a
# heavy arm, and the reach from which they act with their full lever.
_MAIN_TORQUE_NM = 1500.0
_WRIST_TORQUE_NM = 450.0
_HEAVY_REACH_M = 2.5
# Range of the time at which the tracker is knocked: in the first half of the training
# poses, with repeats and without, if a state takes 25 s.
_KNOCK_TIMES_S = (700.0, 2000.0)
# Number of steps of the integration of the Bouc-Wen model.
_HYSTERESIS_STEPS = 48
_RIGID = TaperedTube(np.inf, np.inf)


def add_laws(
    robot: SimulatedRobot, part: str, *laws: tuple[int | str, Callable[..., Any]]
) -> SimulatedRobot:
    """Add laws to the robot's "drives", "gears" or "springs"."""
    changes: dict[str, Any] = {part: (*getattr(robot, part), *laws)}
    return replace(robot, **changes)


def change_part(robot: SimulatedRobot, part: str, **changes: Any) -> SimulatedRobot:
    """Change fields of the robot's "structure", "tracker" or "cell"."""
    return replace(robot, **{part: replace(getattr(robot, part), **changes)})


def add_gear_law(robot: SimulatedRobot, joint: int, law: GearLaw) -> SimulatedRobot:
    """Add a deflection of a gear that depends on the torque of its own joint only."""
    return add_laws(
        robot,
        "gears",
        (joint, lambda schedule, torque, _: law(schedule, torque[:, joint])),
    )


def add_drive_law(
    robot: SimulatedRobot, joint: int, law: Callable[[np.ndarray], np.ndarray]
) -> SimulatedRobot:
    """Add an error of a drive that depends on the angles of all joints."""
    return add_laws(robot, "drives", (joint, lambda schedule: law(schedule.angle)))


def draw_direction(draws: Draws) -> np.ndarray:
    """Draw a unit vector."""
    vector = draws.standard_normal(3)
    return vector / np.linalg.norm(vector)


def name_components(
    prefix: str, vector: Iterable[float], axes: Iterable[str] = "xyz"
) -> dict[str, float]:
    """Name the components of a vector by their axes."""
    return {f"{prefix}{axis}": value for axis, value in zip(axes, vector, strict=True)}


def draw_sign(draws: Draws) -> float:
    """Draw -1 or 1."""
    return float(draws.choice([-1.0, 1.0]))


def compute_typical_torque_Nm(robot: SimulatedRobot, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Compute the torque for which the gear of a joint is made: that of the weight that
    it carries, and of one kilonewton on a heavy arm."""
    arm = robot.arm
    structure = robot.structure
    heavy_torque = _MAIN_TORQUE_NM if joint < arm.joints - 3 else _WRIST_TORQUE_NM
    lever_share = min(1.0, arm.reach_m / _HEAVY_REACH_M)
    gravity_torque = compute_typical_gravity_torque(
        arm, structure.masses, structure.gravity_m_s2
    )
    return heavy_torque * arm.load_share * lever_share + float(gravity_torque[joint])


# Geometry and weight


def joint_offset(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A constant error of the joint's zero."""
    size = size * draw_sign(draws)
    return add_laws(robot, "drives", (joint, lambda _: size)), {"offset": size}


def link_geometry(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A wrong vector of a link, and a rotation of as many milliradians as the vector
    has millimetres."""
    vector = size * draw_direction(draws)
    turn = size * draw_direction(draws)
    link = joint + 1
    errors = robot.structure.geometry_errors | {link: (vector, turn)}
    # The catalogue counts along the axes at the far end of the link.
    shift = robot.arm.links[link].rotation.T @ vector
    parameters = name_components("d", shift) | name_components("r", turn)
    return change_part(robot, "structure", geometry_errors=errors), parameters


def link_weight(
    robot: SimulatedRobot, size: float, draws: Draws, *joints: int
) -> DefectiveRobot:
    """An additional mass: of the upper arm or the forearm, off the link axis; or of all
    links in proportion to the declared ones. The joints that it loads determine which."""
    loaded = tuple(joint + 1 for joint in joints)
    link = find_distinguishable_weights(robot.arm).get(loaded)
    if link is None:
        declared_kg = sum(
            {
                mass.link: mass.mass_kg for mass in robot.arm.masses if mass.link > 1
            }.values()
        )
        return scale_declared_masses(robot, size / declared_kg, draws, 2)[0], {}
    along = draws.uniform(0.25, 0.6)
    aside = draws.uniform(-0.06, 0.06, 3)
    centre = along * robot.arm.links[link].vector_m + aside
    mass = LinkMass(link, size, tuple(centre), along=along)
    masses = (*robot.structure.masses, mass)
    return change_part(robot, "structure", masses=masses), {}


def scale_declared_masses(
    robot: SimulatedRobot, size: float, draws: Draws, first_link: int = 1
) -> DefectiveRobot:
    """All links behind the column are heavier by the same share than declared."""
    excess = [
        replace(mass, mass_kg=size * mass.mass_kg)
        for mass in robot.arm.masses
        if mass.link >= first_link
    ]
    masses = (*robot.structure.masses, *excess)
    return change_part(robot, "structure", masses=masses), {"share": size}


def payload(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """An undeclared tool at the flange."""
    centre = 0.15 * draw_direction(draws)
    mass = LinkMass(robot.arm.joints, size, tuple(centre))
    parameters = {"mass": size} | name_components("moment_", size * centre)
    return change_part(robot, "structure", payload=mass), parameters


def compensator_torque(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A coil spring whose pull the controller does not know."""
    anchor = (-draws.uniform(0.25, 0.4), 0.0, -draws.uniform(0.1, 0.3))
    crank = (draws.uniform(0.12, 0.22), 0.0, draws.uniform(-0.08, 0.08))
    compensator = (anchor, crank, size, draws.uniform(0.2, 0.35))
    return change_part(robot, "structure", compensator=compensator), {}


# Transmission


def add_sinusoids(
    robot: SimulatedRobot,
    joint: int,
    orders: ArrayLike,
    amplitudes: ArrayLike,
    phases: np.ndarray,
) -> DefectiveRobot:
    """Add errors of teeth and eccentric wheels: the sum of amplitudes sin(orders q +
    phases). Orders need not be integers."""

    def wave(angles: np.ndarray) -> np.ndarray:
        sinusoids = np.sin(np.outer(angles[:, joint], np.array(orders)) + phases)
        return sinusoids @ np.array(amplitudes)

    return add_drive_law(robot, joint, wave), {}


def transmission_harmonic(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """An eccentric wheel that turns with the joint: order 1 or 2 apart from creep, and
    half the amplitude at its double or half."""
    order = draws.choice([1, 2]) * draws.uniform(0.98, 1.02)
    second_order = 2 * order if order < 1.5 else order / 2
    phases = draws.uniform(0, TURN, 2)
    return add_sinusoids(
        robot, joint, (order, second_order), (size, 0.5 * size), phases
    )


def motor_eccentricity(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A wheel on the motor's shaft: once and twice per turn of the motor, whose ratio to
    the joint is no integer."""
    order = robot.arm.gear_ratio[joint]
    phases = draws.uniform(0, TURN, 2)
    return add_sinusoids(robot, joint, (order, 2.0 * order), (size, 0.4 * size), phases)


def transmission_order(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A planet or a cage: an order between two integers, and a quarter of the amplitude
    at its double. Some twenty poses can resolve it."""
    order = draws.integers(2, 5) + draws.uniform(0.25, 0.75)
    phases = draws.uniform(0, TURN, 2)
    return add_sinusoids(
        robot, joint, (order, 2.0 * order), (size, 0.25 * size), phases
    )


def short_waves(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Teeth of a motor's pinion, of orders far above those that a campaign's poses can
    resolve."""
    orders = draws.uniform(45.0, 120.0, 3)
    phases = draws.uniform(0, 6.28, 3)
    return add_sinusoids(robot, joint, orders, [size / np.sqrt(3)] * 3, phases)


def transmission_ratio(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A wrong ratio of the joint, or a coupling to the joint before it."""
    source = joint if joint == 0 else joint - int(draws.integers(2))
    size = size * draw_sign(draws)
    law = add_drive_law(robot, joint, lambda angles: size * angles[:, source])
    return law, {f"per_q{source + 1}": size}


def bearing_runout(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """The joint's axis shifts and tilts to and fro, once a turn in one direction across
    it and twice in the other. If it circled, this would be another link."""
    phases = draws.uniform(0, TURN, (2, 2))
    number = joint + 1

    def runout(order: int, amplitude: float, phase: float) -> GearLaw:
        return lambda schedule, _: (
            amplitude * np.cos(order * schedule.angle[:, joint] - phase)
        )

    laws = []
    for k in range(2):
        shift = runout(k + 1, size, phases[0, k])
        tilt = runout(k + 1, size / _BEARING_RADIUS_M, phases[1, k])
        laws += [(f"shift{number}_{k}", shift), (f"tilt{number}_{k}", tilt)]
    bearings = {number: (0.0, 0.0)} | robot.structure.bearings
    robot = change_part(robot, "structure", bearings=bearings)
    return add_laws(robot, "springs", *laws), {}


def cable_pull(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A hose wound by its joint and the one before, which pulls in proportion to the
    product of the two angles."""
    size = size * draw_sign(draws)
    return add_drive_law(
        robot, joint, lambda angles: size * angles[:, joint - 1] * angles[:, joint]
    ), {}


def two_angles(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A gear whose wave depends on the sum or the difference of its own angle and the
    next one."""
    sense = draw_sign(draws)
    phase = draws.uniform(0, TURN)
    return add_drive_law(
        robot,
        joint,
        lambda angles: (
            size * np.sin(angles[:, joint] + sense * angles[:, joint + 1] + phase)
        ),
    ), {}


def slipping_zero(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A coupling that slips a little at three of ten moves: a random walk over the
    approaches in order of time."""

    def walk(schedule: Schedule) -> np.ndarray:
        size_draws = np.random.default_rng([schedule.seed, 7, 0])
        slip_draws = np.random.default_rng([schedule.seed, 7, 1])
        moves = int(schedule.approach.max()) + 1
        steps = size * size_draws.standard_normal(moves)
        return np.cumsum(steps * (slip_draws.random(moves) < 0.3))[schedule.approach]

    return add_laws(robot, "drives", (joint, walk)), {}


# Elasticity


def link_elasticity(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A tapered tube that also shears and stretches, like a thin-walled one of a
    quarter metre in diameter."""
    bending = 1.0 / size
    # Of a thin-walled tube of diameter d the squared radius of gyration is d^2 / 8.
    gyration = 0.25**2 / 8.0
    axial = bending / gyration
    taper = draws.uniform(0.1, 0.35)
    tube = TaperedTube(bending, 0.77 * bending, axial, 0.5 * axial / 2.6, taper)
    tubes = robot.structure.tubes | {joint + 1: tube}
    return change_part(robot, "structure", tubes=tubes), {}


def stiffening_link(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A bolted link whose flanges open with the cube of the bending moment; without the
    defect the link is rigid."""
    tubes = robot.structure.tubes | {joint + 1: _RIGID}
    robot = change_part(robot, "structure", tubes=tubes)
    law = (f"link{joint + 1}_bend", lambda _, moment: size * moment**3 / SEGMENTS)
    return add_laws(robot, "springs", law), {}


def joint_tilt(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A bearing that tilts under moments across the joint's axis."""
    compliances = size * draws.uniform(0.4, 1.0, 2)
    across = np.flatnonzero(np.abs(robot.arm.axes[joint]) < 0.5)
    bearings = robot.structure.bearings | {joint + 1: tuple(compliances)}
    parameters = name_components("tilt_about_", compliances, ("xyz"[k] for k in across))
    return change_part(robot, "structure", bearings=bearings), parameters


def base_compliance(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """Anchor bolts: the two tilts and the two horizontal shifts differ a little."""
    uneven = draws.uniform(0.85, 1.15, 4)
    horizontal = 0.2 * size
    vertical = 0.1 * size
    base = (*(horizontal * uneven[:2]), vertical, *(size * uneven[2:]), 0.0)
    return change_part(robot, "structure", base=base), {"vertical": vertical}


def foot_slip(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """A foot with clearance at its bolts: once the push exceeds friction, it shifts by
    the clearance and no further."""
    friction = draws.uniform(100.0, 300.0) * robot.arm.load_share

    def slip(_: Schedule, push: np.ndarray) -> np.ndarray:
        share = np.clip((np.abs(push) - friction) / friction, 0.0, 1.0)
        return size * np.sign(push) * share

    robot = change_part(robot, "structure", base=(0.0,) * 6)
    return add_laws(robot, "springs", ("base_x", slip), ("base_y", slip)), {}


def flange_flexibility(
    robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """A tool changer between flange and target, which turns about three axes and
    shifts by a lever of a tenth of a metre."""
    turns = size * draws.uniform(0.4, 1.0, 3)
    shifts = 0.01 * size * draws.uniform(0.4, 1.0, 3)
    flange = np.array(robot.structure.flange or (0.0,) * 6)
    flange = flange + np.concatenate([shifts, turns])
    parameters = name_components("shift_", shifts) | name_components("turn_", turns)
    return change_part(robot, "structure", flange=tuple(flange)), parameters


# Gears under torque


def cross_compliance(
    robot: SimulatedRobot, size: float, draws: Draws, first: int, second: int
) -> DefectiveRobot:
    """Two gears in one housing: theta_i = c tau_j, theta_j = c tau_i."""
    size = size * draw_sign(draws)
    laws = (
        (first, lambda _, torque, __: size * torque[:, second]),
        (second, lambda _, torque, __: size * torque[:, first]),
    )
    return add_laws(robot, "gears", *laws), {"compliance": size}


def modulate_stiffness(
    get_source: Callable[[int], int],
    robot: SimulatedRobot,
    size: float,
    draws: Draws,
    joint: int,
) -> DefectiveRobot:
    """The stiffness, not the compliance, is a cosine of the angle of a source joint:
    theta = c (1 / (1 + e cos(q_source - phase)) - 1) tau."""
    compliance = robot.compliance[joint]
    source = get_source(joint)
    phase = draws.uniform(0, TURN)

    def turn(schedule: Schedule, torque: np.ndarray) -> np.ndarray:
        stiffness_ratio = 1 + size * np.cos(schedule.angle[:, source] - phase)
        return compliance * (1 / stiffness_ratio - 1) * torque

    return add_gear_law(robot, joint, turn), {}


def compensator_stiffness(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Stiffness that a coil spring adds at the shoulder; the controller compensates its
    torque.

    Let the anchor be at distance a, the crank at L, the free length s0, u = q - u0 and
    s^2 = a^2 + L^2 - 2 a L cos(u). The spring stores k (s - s0)^2 / 2, whose second
    derivative is k_c = k a L [cos u (1 - s0/s) + (a L sin^2 u) s0 / s^3]. The gear
    yields theta = (1 / (1/c + k_c) - c) tau.
    """
    anchor = draws.uniform(0.3, 0.5)
    crank = draws.uniform(0.15, 0.22)
    free_length = draws.uniform(0.15, 0.3)
    zero = draws.uniform(-np.pi, np.pi)
    compliance = robot.compliance[joint]
    product = anchor * crank

    def turn(schedule: Schedule, torque: np.ndarray) -> np.ndarray:
        u = schedule.angle[:, joint] - zero
        s = np.sqrt(anchor**2 + crank**2 - 2.0 * product * np.cos(u))
        curvature = (
            np.cos(u) * (1.0 - free_length / s)
            + product * np.sin(u) ** 2 * free_length / s**3
        )
        stiffness = size * product * curvature
        return (1.0 / (1.0 / compliance + stiffness) - compliance) * torque

    return add_gear_law(robot, joint, turn), {}


def stiffening(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Three groups of teeth that come to bear one after another: theta = - sum_k d
    sign(tau) max(|tau| - tau_k, 0)."""
    thresholds = compute_typical_torque_Nm(robot, joint) * np.sort(
        draws.uniform(0.1, 0.8, 3)
    )
    drop = size * robot.compliance[joint] / 3

    def turn(_: Schedule, torque: np.ndarray) -> np.ndarray:
        excess = np.maximum(np.abs(torque)[:, None] - thresholds, 0)
        return -np.sign(torque) * drop * excess.sum(axis=1)

    return add_gear_law(robot, joint, turn), {}


def lost_motion(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Play of a gap 2 D between flanks that only the weak spring of a seal bridges:
    theta = D clip(tau / tau_t, -1, 1)."""
    closing = compute_typical_torque_Nm(robot, joint) * draws.uniform(0.02, 0.1)
    return add_gear_law(
        robot, joint, lambda _, torque: size * np.clip(torque / closing, -1.0, 1.0)
    ), {"half_play": size}


def hysteresis(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Friction with a memory, theta = -h z, where z follows the Bouc-Wen model over a
    torque tau_h; see `integrate_bouc_wen`.

    After an approach in direction s the arm lags behind its drive and all friction is
    wound up, z = s. The catalogue counts the half width along the approach. h / tau_h
    must be less than the gear's compliance, or the arm would recede from a push.
    """
    scale = compute_typical_torque_Nm(robot, joint) * draws.uniform(2.0, 6.0)

    def turn(
        schedule: Schedule, torque: np.ndarray, unloaded: np.ndarray
    ) -> np.ndarray:
        z = schedule.sense[:, joint].astype(float)
        load = torque[:, joint]
        moved = schedule.previous < 0
        change = (load - unloaded[:, joint])[moved] / scale
        z[moved] = integrate_bouc_wen(z[moved], change)
        # A state follows one of a smaller number, so the earlier state is known.
        for state in np.flatnonzero(~moved):
            previous = schedule.previous[state]
            change = (load[state : state + 1] - load[previous]) / scale
            z[state] = integrate_bouc_wen(z[previous : previous + 1], change)[0]
        return -size * z

    return add_laws(robot, "gears", (joint, turn)), {"half_width": -size}


def integrate_bouc_wen(z: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Integrate the Bouc-Wen model [1]_ by the midpoint method.

    dz = dx (1 - z^2 (sign(z dx) + 1) / 2): unloading starts along the straight line of
    slope 1.

    Parameters
    ----------
    z : (S,) array
        Friction before the change.
    change : (S,) array
        Steady change of the torque divided by tau_h.

    References
    ----------
    .. [1] Wen, Y.-K., Method for random vibration of hysteretic systems, Journal of the
       Engineering Mechanics Division ASCE 102, 1976.
    """
    step = change / _HYSTERESIS_STEPS

    def slope(z: np.ndarray) -> np.ndarray:
        return 1.0 - z**2 * (0.5 * np.sign(z * step) + 0.5)

    for _ in range(_HYSTERESIS_STEPS):
        z = np.clip(z + step * slope(z + 0.5 * step * slope(z)), -1.0, 1.0)
    return z


def cable_transmission(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Cables whose free length changes as they wind, over the next pulley: theta = s
    (tau (1 + f q / pi) + tau_next / 2)."""
    winding = draws.uniform(0.4, 0.8) * draw_sign(draws)

    def turn(schedule: Schedule, torque: np.ndarray, _: np.ndarray) -> np.ndarray:
        length_ratio = 1.0 + winding * schedule.angle[:, joint] / np.pi
        return size * (torque[:, joint] * length_ratio + 0.5 * torque[:, joint + 1])

    return add_laws(robot, "gears", (joint, turn)), {}


def asymmetric_gear(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """Flanks of different shape: theta = k tau^2, the same for both signs of tau."""
    size = size * draw_sign(draws)
    return add_gear_law(robot, joint, lambda _, torque: size * torque**2), {}


def warm_softening(
    robot: SimulatedRobot, size: float, draws: Draws, joint: int
) -> DefectiveRobot:
    """A gear that softens as it warms: theta = c r (T - 20 °C) tau."""
    softening = size * robot.compliance[joint]

    def turn(schedule: Schedule, torque: np.ndarray) -> np.ndarray:
        return softening * compute_casting_warming(schedule.time_s) * torque

    return add_gear_law(robot, joint, turn), {}


# Load cell, tracker and warmth


def set_instrument_error(
    part: str, field: str, robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """Set an error of the tracker or the cell that is one number. A scale is comparable
    with the catalogue."""
    parameters = {"scale": size} if field == "scale" else {}
    return change_part(robot, part, **{field: size}), parameters


def add_load_cell_error(
    error: str, prefix: str, robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """Add an error of a load cell whose frame and mounting are drawn.

    The catalogue's laws do not change the moment, so those of a cell in the line of the
    pull are not comparable.
    """
    vector = size * draw_direction(draws)
    cell = robot.cell
    # The catalogue's bias is applied minus displayed force.
    errors = cell.errors | {error: -vector if error == "bias" else vector}
    in_flange = (*cell.in_flange, error) if draws.integers(2) else cell.in_flange
    mount = cell.mount if error == "shift" else ("pull", "flange")[draws.integers(2)]
    robot = change_part(robot, "cell", errors=errors, in_flange=in_flange, mount=mount)
    comparable = error == "shift" or mount != "pull"
    return robot, name_components(prefix, vector) if comparable else {}


def frame_drift(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """A stand that settles over hours: after t hours it has moved by a rate times T (1
    - exp(-t / T))."""
    shift = tuple(size * draw_direction(draws))
    turn = tuple(0.5 * size * draw_direction(draws))
    settling_h = draws.uniform(3.0, 8.0)

    def settle(time_s: np.ndarray) -> np.ndarray:
        return -settling_h * np.expm1(-(time_s / 3600.0) / settling_h)

    return change_part(robot, "tracker", drift=Motion(shift, turn, settle)), {}


def setup_step(robot: SimulatedRobot, size: float, draws: Draws) -> DefectiveRobot:
    """The tracker's stand is knocked between two rows: a shift, and a rotation about the
    stand that moves a target at three metres by as much."""
    knock_time_s = draws.uniform(*_KNOCK_TIMES_S)
    shift = tuple(size * draw_direction(draws))
    turn = tuple(size / 3.0 * draw_direction(draws))
    move = Motion(shift, turn, lambda time_s: (time_s > knock_time_s).astype(float))
    return change_part(robot, "tracker", move=move), {}


def nest_eccentricity(
    robot: SimulatedRobot, size: float, draws: Draws
) -> DefectiveRobot:
    """A reflector that is not centred in its nest at the flange."""
    tool_axis = robot.arm.links[-1].rotation.T @ robot.arm.axes[-1]
    nest = (size, int(np.argmax(np.abs(tool_axis))))
    return change_part(robot, "tracker", nest=nest), {}


def temperature_gradient(
    robot: SimulatedRobot, size: float, draws: Draws, *joints: int
) -> DefectiveRobot:
    """Warm motors at the foot and a cold tip, in addition to the average growth of the
    arm; or one link that is warmer on one side."""
    arm = robot.arm
    size = size * draw_sign(draws)
    if not joints:
        profile = np.linspace(1.0, -1.0, arm.joints + 1)
        mean = profile @ arm.lengths_m / arm.lengths_m.sum()
        return thermal_growth(robot, size * (profile[[0, -1]] - mean), draws)
    link = joints[0] + 1
    phase = draws.uniform(0, TURN)
    bend = size * arm.lengths_m[link] / _LINK_THICKNESS_M / SEGMENTS

    def warm(bend_per_K: float) -> GearLaw:
        return lambda schedule, _: bend_per_K * compute_casting_warming(schedule.time_s)

    tubes = {link: _RIGID} | robot.structure.tubes
    return add_laws(
        change_part(robot, "structure", tubes=tubes),
        "springs",
        (f"link{link}_bend0", warm(bend * np.cos(phase))),
        (f"link{link}_bend1", warm(bend * np.sin(phase))),
    ), {}


def thermal_growth(
    robot: SimulatedRobot, size: np.ndarray | float, draws: Draws
) -> DefectiveRobot:
    """Castings that grow as they follow the thermometer with a lag, which the
    catalogue's law does not know."""
    expansion = tuple(np.array(robot.expansion_per_K) + size)
    return replace(robot, expansion_per_K=expansion), {}
