"""A physical robot with its tracker and load cell: all that is true of it, and what a
tracker without noise would read."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from elastocal_proof.plant.arm import Arm, draw_true_masses, to_rotation_matrix
from elastocal_proof.plant.multibody import (
    Equilibrium,
    MultibodyModel,
    Structure,
    build_model,
    solve_equilibrium,
)

_REFERENCE_C = 20.0
# A thermometer on a motor shows a rise by RISE (1 - exp(-t / MOTOR)); the castings
# follow it by a first-order lag.
_RISE_K = 10.0
_MOTOR_S = 3000.0
_LAG_S = 1200.0
_PULLS = 40
_SETTLED_N = 1e-9
# Largest share by which a gear of a specimen is softer or stiffer than the robot file
# says.
_SPREAD = 0.15


def open_simulation_stream(seed: int, purpose: str) -> np.random.Generator:
    """Random numbers for one purpose: numpy Generator that depends on the two alone."""
    digest = hashlib.sha256(f"plant/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))


@dataclass(frozen=True)
class Motion:
    """Of all measurements as one body, along and about the base axes, by its course
    over times (S,), s."""

    shift_m: tuple[float, ...]
    turn_rad: tuple[float, ...]
    course: Callable[[np.ndarray], np.ndarray] = np.ones_like


@dataclass(frozen=True)
class Tracker:
    """A laser tracker; the default only has noise.

    `sigma_m`, `sigma_m_per_m`: standard deviation of a coordinate is sigma_m +
    sigma_m_per_m * range. `stand_m`: where it stands, base frame. `frame_turn`:
    rotation vector of its own axes in the base's. `drift`, `misplaced`: of the base
    frame as the tracker has it, about its origin; `move`: of the stand, about itself.
    `refraction_per_m`: bent light: a target at range r is read at r + k r^2. `scale`: a
    wrong wavelength, at which the frame of the base was measured too: a target at x is
    read at (1 + s) x. `outliers`: share of the measurements that are off by
    `outlier_sigmas`. `nest`: (m, axis) of the flange's target whose centre circles
    twice a turn of the tool, e (cos 2 q_n, sin 2 q_n) across an axis of its frame: from
    the next axis to the one after that.
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
    nest: tuple[float, int] | None = None

    def seen(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        time_s: np.ndarray,
        tool_angle: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Poses (S, targets, 3), (S, targets, 3, 3) as read without noise, base frame,
        m; the flange's last."""
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
        base = np.zeros(3)
        sight = position - stand
        far = np.linalg.norm(sight, axis=-1, keepdims=True)
        position = (1.0 + self.scale) * position + self.refraction_per_m * far * sight
        for motion, about in (
            (self.drift, base),
            (self.move, stand),
            (self.misplaced, base),
        ):
            if motion is not None:
                course = motion.course(time_s)[:, None]
                turn = to_rotation_matrix(course * np.array(motion.turn_rad))
                position = (
                    np.einsum("sij,stj->sti", turn, position - about)
                    + about
                    + (course * motion.shift_m)[:, None]
                )
                rotation = turn[:, None] @ rotation
        return position, rotation

    def read(
        self, position: np.ndarray, rotation: np.ndarray, draws: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Poses as seen, with noise and outliers."""
        # A generator each, so that measurements that come later change none that are
        # there.
        chance, metres, radians = draws.spawn(3)
        sigma = self.sigma_at(position)[..., None]
        large = np.where(
            chance.random(position.shape[:2]) < self.outliers, self.outlier_sigmas, 1.0
        )[..., None]
        position = position + large * sigma * metres.standard_normal(position.shape)
        return position, to_rotation_matrix(
            large * self.sigma_rad * radians.standard_normal(position.shape)
        ) @ rotation

    def sigma_at(self, position: np.ndarray) -> np.ndarray:
        """Standard deviation (...) of a coordinate at positions (..., 3), m."""
        return self.sigma_m + self.sigma_m_per_m * np.linalg.norm(
            position - np.array(self.stand_m), axis=-1
        )

    def to_tracker_frame(
        self, position: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Poses of the base frame, positions (..., 3) in m and rotations (..., 3, 3),
        in the tracker's."""
        own = to_rotation_matrix(self.frame_turn)
        return (position - np.array(self.stand_m)) @ own, own.T @ rotation


@dataclass(frozen=True)
class LoadCell:
    """A cell between the pull and the flange, and where it pulls. The default is
    perfect.

    The experimenter pulls until the display shows what the plan says; a cell that errs
    makes the flange feel something else. So the campaign holds what was shown, and the
    arm deflects by what was felt. `scale`: felt = (1 + scale) shown. `errors`, each
    (3,): "turn", rotation vector by which the cell is mounted askew: it shows R(turn)^T
    felt; "bias", N, shown without a force; "shift", m: where the force really acts,
    from where the plan says. `crosstalk_per_N`: quadratic: shown x gets k F_y F_z, and
    so on round the axes. `in_flange`: which of the errors are fixed in the flange's
    axes rather than in the base's. `mount`: in the line of "pull" one number is
    measured: a force that is wrong acts at the same lever and brings a wrong moment.
    Between "flange" and tool six are: the forces may be wrong where the moments are
    right.
    """

    scale: float = 0.0
    errors: dict[str, ArrayLike] = field(default_factory=dict)
    crosstalk_per_N: float = 0.0
    in_flange: tuple[str, ...] = ()
    mount: str = "pull"

    def shown(self, felt: np.ndarray, flange_rotation: np.ndarray) -> np.ndarray:
        """Force on the display for the force that is felt, both (S, 3), N, base
        axes."""
        turn, bias = (self._in_base(name, flange_rotation) for name in ("turn", "bias"))
        askew = np.einsum("sji,sj->si", to_rotation_matrix(turn), felt)
        crossed = (
            self.crosstalk_per_N * np.roll(felt, -1, axis=1) * np.roll(felt, -2, axis=1)
        )
        return askew / (1.0 + self.scale) + bias + crossed

    def felt(
        self, force: np.ndarray, lever: np.ndarray, flange_rotation: np.ndarray
    ) -> np.ndarray:
        """Wrench on the flange (S, 6), which solves shown = cell(felt) by fixed-point
        iteration: what lacks is pulled more.

        `force` (S, 3): as shown, N; zeros where nothing pulls. `lever` (S, 3): from the
        flange's origin to where the plan lets the force act, m. All in base axes.
        """
        found = force.copy()
        for _ in range(_PULLS):
            missing = force - self.shown(found, flange_rotation)
            found += missing
            if np.abs(missing).max() < _SETTLED_N:
                break
        felt = np.where(force.any(axis=1, keepdims=True), found, 0.0)
        moment = np.cross(lever, felt if self.mount == "pull" else force)
        return np.concatenate(
            [felt, moment + np.cross(self._in_base("shift", flange_rotation), felt)],
            axis=1,
        )

    def _in_base(self, name: str, flange_rotation: np.ndarray) -> np.ndarray:
        """An error in base axes, (S, 3)."""
        error = np.array(self.errors.get(name, (0.0, 0.0, 0.0)))
        return (
            flange_rotation @ error
            if name in self.in_flange
            else np.tile(error, (len(flange_rotation), 1))
        )


@dataclass(frozen=True)
class Schedule:
    """What is done with a robot, S states in the order of time.

    `angle` (S, n): as the controller believes, rad. `force`, `lever` (S, 3): as the
    load cell shall show it, N, and from the flange's origin to where it acts, m; base
    axes. `pose`, `load`, `repeat` (S,) of int. `approach` (S,) of int: number of the
    move that led there. `sense` (S, n) of int: in which each joint moved last.
    `previous` (S,) of int: state before, where only the load was changed; -1 after a
    move. `time_s` (S,). `training` (S,) of bool: not held out for the test.
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
    """Of the thermometer at times (S,), °C."""
    return _REFERENCE_C - _RISE_K * np.expm1(-time_s / _MOTOR_S)


def compute_casting_warming(time_s: np.ndarray) -> np.ndarray:
    """By how much the links are warmer than 20 °C at times (S,), K."""
    rest = (
        _MOTOR_S * np.exp(-time_s / _MOTOR_S) - _LAG_S * np.exp(-time_s / _LAG_S)
    ) / (_MOTOR_S - _LAG_S)
    return _RISE_K * (1.0 - rest)


@dataclass(frozen=True)
class SimulatedRobot:
    """All that is true of a robot and its instruments; the default is faultless.

    `compliance` (n,): the gears' own, rad/(N m). Laws of what was done, each of a joint
    from 0: `drives`: what a drive errs by, (S,), rad; `gears`: what a gear turns by
    beyond its linear spring, (S,), rad, by the torques on all gears (S, n), N m, now
    and before the external load came on. `springs`: what a structural spring, by the
    start of its name, yields beyond its compliance, (S,), rad or m, by its force (S,),
    N m or N. `expansion_per_K`: of the column and of the flange; in between it changes
    evenly from stretch to stretch. No defects, as every arm has them:
    `repeatability_rad` (n,): each approach ends a little elsewhere; `pose_rad` (n,): an
    error of the angles common to all measurements of a pose.
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
    arm: Arm, seed: int, weighs: bool = True, off_line_m: float = 0.0
) -> SimulatedRobot:
    """One faultless robot of a series: other gears than the robot file says, and other
    weights, or none that it feels.

    `off_line_m`: by how much centres of mass lie off the lines of their links at most,
    across each, beyond what is declared.
    """
    compliance = arm.compliance * open_simulation_stream(seed, "specimen").uniform(
        1.0 - _SPREAD, 1.0 + _SPREAD, arm.joints
    )
    masses = (
        draw_true_masses(
            arm,
            open_simulation_stream(seed, "weights"),
            off_line_m,
            open_simulation_stream(seed, "centres off the line"),
        )
        if weighs
        else ()
    )
    return SimulatedRobot(
        arm, compliance, Structure(masses=masses, gravity_m_s2=arm.gravity_m_s2)
    )


def simulate_poses(
    robot: SimulatedRobot, schedule: Schedule, start: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Poses of all targets (S, targets, 3), (S, targets, 3, 3) as a tracker without
    noise reads them, base frame, m.

    `start` (S, n): deflections of the gears of a robot that differs little; saves time.
    """
    _, _, position, rotation = simulate_equilibrium(robot, schedule, start)[1]
    return robot.tracker.seen(
        position, rotation, schedule.time_s, schedule.angle[:, -1]
    )


def simulate_equilibrium(
    robot: SimulatedRobot, schedule: Schedule, start: np.ndarray | None = None
) -> tuple[MultibodyModel, Equilibrium]:
    """The arm, and its equilibrium as of `machine.solve_equilibrium`; arguments as of
    `seen_poses`."""
    machine = build_model(robot.arm, robot.structure)
    felt = partial(robot.cell.felt, schedule.force, schedule.lever)
    growth = compute_casting_warming(schedule.time_s)[:, None] * np.linspace(
        *robot.expansion_per_K, robot.arm.joints + 1
    )

    def gear_deflection(torque: np.ndarray, unloaded: np.ndarray) -> np.ndarray:
        turn = robot.compliance * torque
        for joint, law in robot.gears:
            turn[:, joint] += law(schedule, torque, unloaded)
        return turn

    springs = [(name, partial(law, schedule)) for name, law in robot.springs]
    return machine, solve_equilibrium(
        machine,
        compute_drive_angles(robot, schedule),
        felt,
        growth,
        gear_deflection,
        springs,
        start,
    )


def compute_drive_angles(robot: SimulatedRobot, schedule: Schedule) -> np.ndarray:
    """Where the drives really stand (S, n), rad."""
    drive = schedule.angle.copy()
    for joint, law in robot.drives:
        drive[:, joint] += law(schedule)
    # Each with random numbers of its own, by the seed of what is done.
    for sigma, number, group in (
        (robot.repeatability_rad, 11, schedule.approach),
        (robot.pose_rad, 13, schedule.pose),
    ):
        if any(sigma):
            draws = np.random.default_rng([schedule.seed, number])
            drive += (
                np.array(sigma)
                * draws.standard_normal((int(group.max()) + 1, robot.arm.joints))[group]
            )
    return drive
