"""A simulated robot with its tracker and load cell: all its true properties, and the
poses that a tracker without noise would read."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from elastocal_proof.plant.arm import (
    Arm,
    LinkMass,
    draw_true_masses,
    to_rotation_matrix,
)
from elastocal_proof.plant.multibody import (
    Equilibrium,
    EquilibriumProblem,
    MultibodyModel,
    Structure,
    build_model,
    solve_equilibrium,
)

# The thermometer on a motor shows a rise by RISE (1 - exp(-t / MOTOR)). The castings
# follow it with a first-order lag.
_REFERENCE_C = 20.0
_TEMPERATURE_RISE_K = 10.0
_MOTOR_TIME_S = 3000.0
_CASTING_LAG_S = 1200.0
# Upper bound on the corrections of a pull, and the error of the displayed force below
# which no correction is needed.
_MAX_PULLS = 40
_FORCE_TOLERANCE_N = 1e-9
# Largest relative difference of a specimen's joint compliance from the robot file.
_COMPLIANCE_SPREAD = 0.15


def open_simulation_stream(seed: int, purpose: str) -> np.random.Generator:
    """Open a stream of random numbers that depends on the seed and the purpose only."""
    digest = hashlib.sha256(f"plant/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))


@dataclass(frozen=True)
class Motion:
    """Motion of all measurements as one rigid body.

    Attributes
    ----------
    shift_m, turn_rad
        Along and about the base axes.
    course
        Share of the motion at times (S,), s; constant by default.
    """

    shift_m: tuple[float, ...]
    turn_rad: tuple[float, ...]
    course: Callable[[np.ndarray], np.ndarray] = np.ones_like


@dataclass(frozen=True)
class Tracker:
    """A laser tracker; the default has noise and no other error.

    Attributes
    ----------
    sigma_m, sigma_m_per_m
        The standard deviation of a coordinate is sigma_m + sigma_m_per_m * range.
    sigma_rad
        Standard deviation of a rotation.
    stand_m
        Position of the stand, base frame.
    frame_turn
        Rotation vector of the tracker's own axes in the base's, rad.
    drift, misplaced
        Motions of the base frame as the tracker has it, about its origin.
    move
        Motion of the stand, about itself.
    refraction_per_m
        Bent light: a target at range r is read at r + k r^2.
    scale
        Wrong wavelength, with which the frame of the base was measured too: a target at
        x is read at (1 + s) x.
    outliers, outlier_sigmas
        Share of the measurements whose noise is larger, and how many times it is.
    reflectors_m
        (targets, 3): displacements of the targets from their declared places, in the
        axes of their measuring points; empty if all are where they are declared.
    nest
        Eccentricity (m, axis) of the flange's reflector nest. The target's centre
        circles twice per turn of the tool, e (cos 2 q_n, sin 2 q_n) across an axis of
        the flange's frame: from the next axis to the one after that.
    """

    sigma_m: float = 60e-6
    sigma_m_per_m: float = 0.0
    sigma_rad: float = 60e-6
    stand_m: tuple[float, ...] = (6.0, -2.0, 1.5)
    frame_turn: tuple[float, ...] = (0.0, 0.0, 0.0)
    drift: Motion | None = None
    move: Motion | None = None
    misplaced: Motion | None = None
    refraction_per_m: float = 0.0
    scale: float = 0.0
    outliers: float = 0.0
    outlier_sigmas: float = 8.0
    reflectors_m: tuple[tuple[float, ...], ...] = ()
    nest: tuple[float, int] | None = None

    def observe(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        time_s: np.ndarray,
        tool_angle: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the poses that the tracker would read without noise, base frame.

        Parameters
        ----------
        position, rotation : (S, targets, 3) and (S, targets, 3, 3) arrays
            True poses of the targets, the flange's last, m.
        time_s, tool_angle : (S,) arrays
            Time and angle of the last joint, rad.
        """
        if self.reflectors_m:
            displacement = np.array(self.reflectors_m)
            position = position + np.einsum("stij,tj->sti", rotation, displacement)
        if self.nest:
            radius, axis = self.nest
            circle = np.stack(
                [
                    np.zeros_like(tool_angle),
                    np.cos(2 * tool_angle),
                    np.sin(2 * tool_angle),
                ],
                axis=-1,
            )
            position = position.copy()
            position[:, -1] += radius * np.einsum(
                "sij,sj->si", rotation[:, -1], np.roll(circle, axis, axis=-1)
            )
        stand = np.array(self.stand_m)
        sight = position - stand
        distance = np.linalg.norm(sight, axis=-1, keepdims=True)
        refraction = self.refraction_per_m * distance * sight
        position = (1.0 + self.scale) * position + refraction
        origin = np.zeros(3)
        for motion, centre in (
            (self.drift, origin),
            (self.move, stand),
            (self.misplaced, origin),
        ):
            if motion is None:
                continue
            course = motion.course(time_s)[:, None]
            turn = to_rotation_matrix(course * np.array(motion.turn_rad))
            turned = np.einsum("sij,stj->sti", turn, position - centre)
            position = turned + centre + (course * motion.shift_m)[:, None]
            rotation = turn[:, None] @ rotation
        return position, rotation

    def read(
        self, position: np.ndarray, rotation: np.ndarray, draws: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Add noise and outliers to observed poses."""
        # Three generators, so that further measurements do not change the noise of the
        # earlier ones.
        outlier_draws, position_draws, rotation_draws = draws.spawn(3)
        is_outlier = outlier_draws.random(position.shape[:2]) < self.outliers
        factor = np.where(is_outlier, self.outlier_sigmas, 1.0)[..., None]
        sigma_m = self.sigma_at(position)[..., None]
        position_noise = position_draws.standard_normal(position.shape)
        rotation_noise = rotation_draws.standard_normal(position.shape)
        turn = to_rotation_matrix(factor * self.sigma_rad * rotation_noise)
        return position + factor * sigma_m * position_noise, turn @ rotation

    def sigma_at(self, position: np.ndarray) -> np.ndarray:
        """Standard deviation (...) of a coordinate at positions (..., 3), m."""
        distance = np.linalg.norm(position - np.array(self.stand_m), axis=-1)
        return self.sigma_m + self.sigma_m_per_m * distance

    def to_tracker_frame(
        self, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Transform positions (..., 3), m, and rotations (..., 3, 3) from the base
        frame to the tracker's."""
        axes = to_rotation_matrix(self.frame_turn)
        return (position - np.array(self.stand_m)) @ axes, axes.T @ rotation


@dataclass(frozen=True)
class LoadCell:
    """A load cell, and the point where it pulls; the default is perfect.

    The experimenter pulls until the display shows the planned force. If the cell errs,
    the force on the flange is a different one. The campaign therefore records the
    displayed force, while the arm deflects under the applied one.

    Attributes
    ----------
    scale
        Applied force = (1 + scale) displayed force.
    errors
        (3,) each. "turn": rotation vector of a misaligned cell, which displays R(turn)^T
        times the applied force. "bias": displayed without a force, N. "shift": from the
        planned to the true point of application, m.
    crosstalk_per_N
        Quadratic: the displayed x component gets k F_y F_z, and so on cyclically.
    in_flange
        Names of the errors that are fixed in the flange's axes rather than the base's.
    mount
        A cell in the line of the "pull" measures one number, so a wrong force acts at
        the same lever and brings a wrong moment. Between "flange" and tool it measures
        six, and forces may be wrong while moments are right.
    """

    scale: float = 0.0
    errors: dict[str, ArrayLike] = field(default_factory=dict)
    crosstalk_per_N: float = 0.0
    in_flange: tuple[str, ...] = ()
    mount: str = "pull"

    def compute_displayed_force(
        self, applied: np.ndarray, flange_rotation: np.ndarray
    ) -> np.ndarray:
        """Compute the displayed from the applied force, both (S, 3), N, base axes."""
        turn = self._get_error("turn", flange_rotation)
        misaligned = np.einsum("sji,sj->si", to_rotation_matrix(turn), applied)
        crosstalk = (
            self.crosstalk_per_N
            * np.roll(applied, -1, axis=1)
            * np.roll(applied, -2, axis=1)
        )
        bias = self._get_error("bias", flange_rotation)
        return misaligned / (1.0 + self.scale) + bias + crosstalk

    def compute_applied_wrench(
        self, force: np.ndarray, lever: np.ndarray, flange_rotation: np.ndarray
    ) -> np.ndarray:
        """Compute the wrench (S, 6) on the flange for which the cell displays a force.

        Fixed-point iteration: the experimenter pulls harder by the missing force.

        Parameters
        ----------
        force : (S, 3) array
            Displayed force, N, base axes; zeros if nothing pulls.
        lever : (S, 3) array
            From the flange's origin to the planned point of application, m, base axes.
        flange_rotation : (S, 3, 3) array
            Axes of the flange in the base frame.
        """
        applied = force.copy()
        for _ in range(_MAX_PULLS):
            missing = force - self.compute_displayed_force(applied, flange_rotation)
            applied += missing
            if np.abs(missing).max() < _FORCE_TOLERANCE_N:
                break
        applied = np.where(force.any(axis=1, keepdims=True), applied, 0.0)
        moment = np.cross(lever, applied if self.mount == "pull" else force)
        shift = self._get_error("shift", flange_rotation)
        return np.concatenate([applied, moment + np.cross(shift, applied)], axis=1)

    def _get_error(self, name: str, flange_rotation: np.ndarray) -> np.ndarray:
        """An error in base axes, (S, 3)."""
        error = np.array(self.errors.get(name, (0.0, 0.0, 0.0)))
        if name in self.in_flange:
            return flange_rotation @ error
        return np.tile(error, (len(flange_rotation), 1))


@dataclass(frozen=True)
class Schedule:
    """What an experimenter does with a robot of n joints, S states in order of time.

    Attributes
    ----------
    angle : (S, n) array
        Joint angles as the controller reports them, rad.
    force, lever : (S, 3) arrays
        Force that the load cell shall display, N, and vector from the flange's origin
        to its point of application, m; base axes.
    pose, load, repeat : (S,) int arrays
        Numbers of the pose, of its load, and of the repeat.
    approach : (S,) int array
        Number of the move that led to the state.
    sense : (S, n) int array
        Direction in which each joint moved last, -1 or 1.
    previous : (S,) int array
        Preceding state if only the load was changed; -1 after a move.
    time_s : (S,) array
        Time of the measurement.
    training : (S,) bool array
        False for held-out poses.
    seed : int
        Seed of all random numbers of the campaign.
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


def compute_logged_temperature(time_s: np.ndarray) -> np.ndarray:
    """Compute the thermometer's reading at times (S,), °C."""
    return _REFERENCE_C - _TEMPERATURE_RISE_K * np.expm1(-time_s / _MOTOR_TIME_S)


def compute_casting_warming(time_s: np.ndarray) -> np.ndarray:
    """Compute how much warmer than 20 °C the links are at times (S,), K."""
    remaining = (
        _MOTOR_TIME_S * np.exp(-time_s / _MOTOR_TIME_S)
        - _CASTING_LAG_S * np.exp(-time_s / _CASTING_LAG_S)
    ) / (_MOTOR_TIME_S - _CASTING_LAG_S)
    return _TEMPERATURE_RISE_K * (1.0 - remaining)


@dataclass(frozen=True)
class SimulatedRobot:
    """All true properties of a robot and its instruments; the default is faultless.

    Attributes
    ----------
    arm : Arm
        As its robot file describes it.
    compliance : (n,) array
        True compliances of the gears, rad/(N m).
    structure : Structure
        Other elasticity, weights and geometry errors.
    gears : tuple of (joint, law)
        Rotation of a gear beyond its linear spring, (S,), rad, from the schedule and
        the torques on all gears, (S, n), N m, now and before the external load was
        applied. Joints count from 0.
    drives : tuple of (joint, law)
        Error of a drive, (S,), rad, from the schedule.
    springs : tuple of (prefix, law)
        Deflection of structural springs, by the first letters of their names, beyond
        their compliance, (S,), rad or m, from the schedule and their force (S,), N m or
        N.
    expansion_per_K : tuple
        Thermal expansion of the column and of the flange; it varies linearly from link
        to link.
    cell, tracker
        Instruments.
    repeatability_rad : (n,) tuple
        Standard deviation of the angles from approach to approach. Like the next one,
        this is no defect: all arms have it.
    pose_rad : (n,) tuple
        Standard deviation of the error of the angles that all measurements of a pose
        share.
    """

    arm: Arm
    compliance: np.ndarray
    structure: Structure = field(default_factory=Structure)
    gears: tuple[
        tuple[int, Callable[[Schedule, np.ndarray, np.ndarray], np.ndarray]], ...
    ] = ()
    drives: tuple[tuple[int, Callable[[Schedule], np.ndarray]], ...] = ()
    springs: tuple[tuple[str, Callable[[Schedule, np.ndarray], np.ndarray]], ...] = ()
    expansion_per_K: tuple[float, float] = (0.0, 0.0)
    cell: LoadCell = field(default_factory=LoadCell)
    tracker: Tracker = field(default_factory=Tracker)
    repeatability_rad: tuple[float, ...] = ()
    pose_rad: tuple[float, ...] = ()


def draw_specimen(
    arm: Arm, seed: int, *, weighs: bool = True, off_line_m: float = 0.0
) -> SimulatedRobot:
    """Draw a faultless robot of a series, whose gears and weights differ from the file.

    Parameters
    ----------
    arm, seed
        Robot file and seed of the specimen.
    weighs
        False for an arm without weight.
    off_line_m
        Largest undeclared offset of a centre of mass from the line of its link, in each
        direction across.
    """
    compliance = arm.compliance * open_simulation_stream(seed, "specimen").uniform(
        1.0 - _COMPLIANCE_SPREAD, 1.0 + _COMPLIANCE_SPREAD, arm.joints
    )
    masses: tuple[LinkMass, ...] = ()
    if weighs:
        masses = draw_true_masses(
            arm,
            open_simulation_stream(seed, "weights"),
            off_line_m,
            open_simulation_stream(seed, "centres off the line"),
        )
    structure = Structure(masses=masses, gravity_m_s2=arm.gravity_m_s2)
    return SimulatedRobot(arm, compliance, structure)


def simulate_poses(
    robot: SimulatedRobot, schedule: Schedule, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate the poses that a tracker without noise reads.

    Parameters
    ----------
    robot, schedule
        The robot, and the S states into which it is brought.
    start : (S, n) array, optional
        Deflections of the gears of a similar robot, from which the iteration starts;
        saves time.

    Returns
    -------
    position, rotation : (S, targets, 3) and (S, targets, 3, 3) arrays
        All targets, m, base frame.
    """
    equilibrium = simulate_equilibrium(robot, schedule, start)[1]
    return robot.tracker.observe(
        equilibrium.position,
        equilibrium.rotation,
        schedule.time_s,
        schedule.angle[:, -1],
    )


def simulate_equilibrium(
    robot: SimulatedRobot, schedule: Schedule, start: np.ndarray | None = None
) -> tuple[MultibodyModel, Equilibrium]:
    """Build the arm's model and find where it comes to rest in each state.

    Parameters are those of `simulate_poses`.
    """
    expansion = np.linspace(*robot.expansion_per_K, robot.arm.joints + 1)

    def gear_deflection(torque: np.ndarray, unloaded: np.ndarray) -> np.ndarray:
        turn = robot.compliance * torque
        for joint, law in robot.gears:
            turn[:, joint] += law(schedule, torque, unloaded)
        return turn

    problem = EquilibriumProblem(
        drive=compute_drive_angles(robot, schedule),
        growth=compute_casting_warming(schedule.time_s)[:, None] * expansion,
        applied_wrench=partial(
            robot.cell.compute_applied_wrench, schedule.force, schedule.lever
        ),
        gear_deflection=gear_deflection,
        spring_laws=[(name, partial(law, schedule)) for name, law in robot.springs],
    )
    model = build_model(robot.arm, robot.structure)
    return model, solve_equilibrium(model, problem, start)


def compute_drive_angles(robot: SimulatedRobot, schedule: Schedule) -> np.ndarray:
    """Compute the true angles (S, n) of the drives, rad."""
    drive = schedule.angle.copy()
    for joint, law in robot.drives:
        drive[:, joint] += law(schedule)
    # The second number separates the two streams of random numbers.
    for sigma_rad, stream_number, group in (
        (robot.repeatability_rad, 11, schedule.approach),
        (robot.pose_rad, 13, schedule.pose),
    ):
        if any(sigma_rad):
            draws = np.random.default_rng([schedule.seed, stream_number])
            shape = (int(group.max()) + 1, robot.arm.joints)
            drive += np.array(sigma_rad) * draws.standard_normal(shape)[group]
    return drive
