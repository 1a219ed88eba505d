"""A physical robot with its tracker and load cell: all that is true of it, and what a tracker without noise would read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from elastocal_proof.plant.arm import Arm
from elastocal_proof.plant.instruments import LoadCell, Tracker
from elastocal_proof.plant.machine import Equilibrium, Machine, Structure, StructureLaw, equilibrium, machine_of
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.weights import declared_masses, off_the_line, on_stretches, true_masses

_REFERENCE_C = 20.0
# Of what is random about the drives, by the seed of what is done.
_EACH_APPROACH, _EACH_POSE = 11, 13


@dataclass(frozen=True)
class Schedule:
    """What is done with a robot, S states in the order of time.

    `angle` (S, n): as the controller believes, rad. `force`, `lever` (S, 3): as the load cell shall show it, N, and from the
    flange's origin to where it acts, m; base axes. `pose`, `load`, `repeat` (S,) of int. `approach` (S,) of int: number of the
    move that led there. `sense` (S, n) of int: in which each joint moved last. `previous` (S,) of int: state before, where only
    the load was changed; -1 after a move. `time_s` (S,). `training` (S,) of bool: not held out for the test.
    """

    angle: np.ndarray
    force: np.ndarray
    lever: np.ndarray
    pose: np.ndarray
    load: np.ndarray
    repeat: np.ndarray
    approach: np.ndarray
    sense: np.ndarray
    previous: np.ndarray
    time_s: np.ndarray
    training: np.ndarray
    seed: int

    @property
    def shown_wrench(self) -> np.ndarray:
        """What the campaign says of the load, (S, 6), N, N m."""
        return np.concatenate([self.force, np.cross(self.lever, self.force)], axis=1)


# What a drive errs by, (S,), rad, or a structural coordinate, rad or m, by what was done.
DriveLaw = Callable[[Schedule], np.ndarray]
# What a gear turns by beyond its linear spring, (S,), rad: by what was done and the torques on all gears (S, n), N m, now and
# before the external load came on.
GearLaw = Callable[[Schedule, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Warmth:
    """How the robot warms up: the thermometer on a motor first, the castings after it.

    `motor_s`, `lag_s`: time constant of the thermometer, dT_m = rise (1 - exp(-t / T_m)), and by which the castings follow it.
    """

    rise_K: float = 10.0
    motor_s: float = 3000.0
    lag_s: float = 1200.0

    def shown(self, time_s: np.ndarray) -> np.ndarray:
        """Temperature (S,) that is logged at times (S,), °C."""
        return _REFERENCE_C - self.rise_K * np.expm1(-time_s / self.motor_s)

    def of_castings(self, time_s: np.ndarray) -> np.ndarray:
        """By how much the links are warmer than 20 °C at times (S,), K: the logged rise behind a first-order lag."""
        fast, slow = self.lag_s, self.motor_s
        rest = (slow * np.exp(-time_s / slow) - fast * np.exp(-time_s / fast)) / (slow - fast)
        return self.rise_K * (1.0 - rest)


@dataclass(frozen=True)
class PhysicalRobot:
    """All that is true of a robot and its instruments; the default is faultless.

    `compliance` (n,): the gears' own, rad/(N m). `drives`, `gears`: errors of angle and laws beside the linear springs, each of
    a joint from 0. `structure_laws` (str, callable): laws of structural springs by the start of their names. `offsets` (str,
    callable): by what structural coordinates are off, beside what their springs do. `gradient_per_K` (float, float): further
    expansion of the column and of the flange; in between it changes evenly from stretch to stretch. No defects, as every arm
    has them: `repeatability_rad` (n,): each approach ends a little elsewhere; `pose_rad` (n,): an error of the angles common to
    all measurements of a pose.
    """

    arm: Arm
    compliance: np.ndarray
    structure: Structure = field(default_factory=Structure)
    gears: tuple[tuple[int, GearLaw], ...] = ()
    drives: tuple[tuple[int, DriveLaw], ...] = ()
    structure_laws: tuple[StructureLaw, ...] = ()
    offsets: tuple[tuple[str, DriveLaw], ...] = ()
    expansion_per_K: float = 0.0
    gradient_per_K: tuple[float, float] = (0.0, 0.0)
    warmth: Warmth = field(default_factory=Warmth)
    cell: LoadCell = field(default_factory=LoadCell)
    tracker: Tracker = field(default_factory=Tracker)
    repeatability_rad: tuple[float, ...] = ()
    pose_rad: tuple[float, ...] = ()


def specimen(arm: Arm, seed: int, spread: float = 0.15, weighs: bool = True, off_line_m: float = 0.0) -> PhysicalRobot:
    """One faultless robot of a series: other gears than the robot file says, and other weights.

    `spread`: largest share by which a gear is softer or stiffer, evenly drawn. `weighs`: False: an arm whose controller takes
    care of its weight. `off_line_m`: by how much centres of mass lie off the lines of their links at most, across each, beyond
    what is declared.
    """
    compliance = arm.compliance * stream(seed, "specimen").uniform(1.0 - spread, 1.0 + spread, arm.joints)
    masses = true_masses(declared_masses(arm), stream(seed, "weights")) if weighs else ()
    if off_line_m:
        masses = off_the_line(masses, arm, off_line_m, stream(seed, "centres off the line"))
    structure = Structure(masses=on_stretches(masses, arm), gravity_m_s2=arm.gravity_m_s2)
    return PhysicalRobot(arm, compliance, structure)


def seen_poses(robot: PhysicalRobot, schedule: Schedule, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Poses of all targets as a tracker without noise reads them.

    `start` (S, n): deflections of the gears of a robot that differs little; saves time. Returns `position` (S, targets, 3): m,
    base frame; targets as in ``robot.arm.points``; `rotation` (S, targets, 3, 3).
    """
    rest = at_rest(robot, schedule, start)[1]
    return robot.tracker.seen(rest.position, rest.rotation, schedule.time_s, schedule.angle[:, -1])


def read_poses(
    robot: PhysicalRobot, schedule: Schedule, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses of all targets with the noise of the robot's tracker, the same whenever they are asked for; as `Tracker.read`."""
    return robot.tracker.read(*seen_poses(robot, schedule, start), stream(schedule.seed, "readings"))


def at_rest(robot: PhysicalRobot, schedule: Schedule, start: np.ndarray | None = None) -> tuple[Machine, Equilibrium]:
    """The arm in equilibrium; arguments as of `seen_poses`."""
    machine = machine_of(robot.arm, robot.structure)
    drive, growth, offsets = driven(robot, schedule, machine)
    facing = np.broadcast_to(np.eye(3), (len(drive), 3, 3))
    if robot.cell.in_flange:
        coordinates = np.zeros((len(drive), machine.model.nq))
        coordinates[:, machine.drive] = drive
        facing = machine.forces(coordinates, growth)[2][:, -1]
    wrench = robot.cell.felt(schedule.force, schedule.lever, facing)

    def gear_deflection(torque: np.ndarray, unloaded: np.ndarray) -> np.ndarray:
        turn = robot.compliance * torque
        for joint, law in robot.gears:
            turn[:, joint] += law(schedule, torque, unloaded)
        return turn

    return machine, equilibrium(machine, drive, wrench, growth, gear_deflection, robot.structure_laws, offsets, start)


def driven(robot: PhysicalRobot, schedule: Schedule, machine: Machine) -> tuple[np.ndarray, np.ndarray, dict[int, np.ndarray]]:
    """Where the drives really stand (S, n), rad; relative growth of all lengths of each stretch (S, n + 1); and by what
    structural coordinates are off, (S,) by their places."""
    drive = schedule.angle.copy()
    for joint, law in robot.drives:
        drive[:, joint] += law(schedule)
    for sigma, number, group in (
        (robot.repeatability_rad, _EACH_APPROACH, schedule.approach),
        (robot.pose_rad, _EACH_POSE, schedule.pose),
    ):
        if any(sigma):
            draws = np.random.default_rng([schedule.seed, number])
            drive += np.array(sigma) * draws.standard_normal((int(group.max()) + 1, robot.arm.joints))[group]
    per_kelvin = robot.expansion_per_K + np.linspace(*robot.gradient_per_K, robot.arm.joints + 1)
    growth = robot.warmth.of_castings(schedule.time_s)[:, None] * per_kelvin
    offsets: dict[int, np.ndarray] = {}
    for name, law in robot.offsets:
        index = machine.springs[name]
        offsets[index] = offsets.get(index, 0.0) + law(schedule)
    return drive, growth, offsets
