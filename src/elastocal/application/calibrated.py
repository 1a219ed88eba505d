"""A calibrated robot: where its end effector comes to rest, for joint angles as the controller reports them and any load.

What a campaign found out about the robot, without what belongs to its tracker, reflectors, load cell and set-up. The end
effector is the last measuring point of the chain; poses are in base axes, as the fitted model has them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import Target
from elastocal.fitting.displacement import conditions, displaced_coordinates
from elastocal.fitting.linearization import linearize
from elastocal.fitting.memory import observations_at_once
from elastocal.fitting.model import Estimate
from elastocal.fitting.observations import Observations, States
from elastocal.fitting.parameters import parameters
from elastocal.mechanics.kinematics import poses

if TYPE_CHECKING:
    from typing import Any

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Model
    from elastocal.fitting.noise import Noise
    from elastocal.mechanics.robot import Robot

# Of an effect's needs those that a command may state or not.
COVARIATES = ("approach", "time", "temperature")
# Dimensions are stated at this temperature (ISO 1), and at it no effect of warmth acts.
_REFERENCE_C = 20.0
# States whose motion along the chain stays in the processor's cache.
STATES_AT_ONCE = 2000


@dataclass(frozen=True)
class CalibratedRobot:
    """A robot with what was found out about it.

    Attributes
    ----------
    robot : Robot
        As its file declares it.
    model : Model
        The fitted model, with effects of the robot alone.
    estimate : Estimate
        Its values; no frame and no target.
    covariance : ndarray (P, P)
        Of the effects' parameters, each effect's linear ones and then its shapes, whatever frames and targets are (marginal).
        Zero for parameters that were not identifiable.
    noise : Noise
        Of the campaign; its joint part is the repeatability.
    """

    robot: Robot
    model: Model
    estimate: Estimate
    covariance: np.ndarray
    noise: Noise

    def needing(self, covariate: str) -> list[str]:
        """Keys of the effects that go with one of the `COVARIATES`."""
        return [effect.key for effect in self.model.effects if covariate in effect.needs]


@dataclass(frozen=True)
class Commands:
    """What a robot is commanded, and under which load it stands; arrays of N.

    Attributes
    ----------
    joint_angles : ndarray (N, n)
        As the controller reports them, rad.
    wrench : ndarray (N, 6)
        External wrench at the origin of the last measuring point, base axes; N, N m.
    approach : ndarray (N, n) or None
        Sense in which each joint, as the model has it, is approached: -1, 0 (from either side) or +1; 0 without.
    time_s : ndarray (N,) or None
        As the campaign counts it; its first measurement without.
    temperature_c : ndarray (N,) or None
        20 °C without.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
    approach: np.ndarray | None = None
    time_s: np.ndarray | None = None
    temperature_c: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.joint_angles)

    def at(self, chosen: slice | np.ndarray) -> Commands:
        """Some of them."""
        some: dict[str, Any] = {name: None if value is None else value[chosen] for name, value in vars(self).items()}
        return Commands(**some)

    def with_angles(self, joint_angles: np.ndarray) -> Commands:
        """The same loads at other joint angles (N, n)."""
        return replace(self, joint_angles=joint_angles)


def unloaded(joint_angles: np.ndarray) -> Commands:
    """Commands without an external load.

    Parameters
    ----------
    joint_angles : ndarray (N, n)
        rad.

    Returns
    -------
    Commands
    """
    return Commands(joint_angles, np.zeros((len(joint_angles), 6)))


def calibrated_from(fitted: Fit, robot: Robot) -> CalibratedRobot:
    """What a fit says of the robot itself.

    Parameters
    ----------
    fitted : Fit
    robot : Robot
        As its file declares it.

    Returns
    -------
    CalibratedRobot
        Without effects of the set-up and of the instruments.
    """
    return calibrated_robot(robot, fitted.model, fitted.estimate, fitted.covariance, fitted.noise)


def calibrated_robot(robot: Robot, model: Model, estimate: Estimate, covariance: np.ndarray, noise: Noise) -> CalibratedRobot:
    """A robot from a fitted model.

    Parameters
    ----------
    robot : Robot
    model : Model
    estimate : Estimate
    covariance : ndarray (P, P)
        Of all `parameters` of the model.
    noise : Noise

    Returns
    -------
    CalibratedRobot
        As by `calibrated_from`.
    """
    owners = np.array([owner for owner, _ in parameters(model, estimate)], object)
    kept = [n for n, effect in enumerate(model.effects) if not (effect.of_setup or effect.of_instruments)]
    effects = tuple(model.effects[n] for n in kept)
    of_robot = np.isin(owners, [effect.key for effect in effects])
    end = model.sites.chain.end_effector
    about = replace(
        model, targets=(Target("end effector", end.name, tuple(end.offset_m)),), fitted_frames=False, rows=6, effects=effects
    )
    values = Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array([end.offset_m]),
        np.eye(3)[None],
        tuple(estimate.coefficients[n] for n in kept),
        tuple(estimate.shapes[n] for n in kept),
    )
    return CalibratedRobot(robot, about, values, covariance[np.ix_(of_robot, of_robot)], noise)


def forward(calibrated: CalibratedRobot, commands: Commands) -> tuple[np.ndarray, np.ndarray]:
    """Where the end effector comes to rest.

    Parameters
    ----------
    calibrated : CalibratedRobot
    commands : Commands

    Returns
    -------
    position : ndarray (N, 3)
        m, base axes.
    rotation : ndarray (N, 3, 3)
    """
    position, rotation = np.empty((len(commands), 3)), np.empty((len(commands), 3, 3))
    for part in _parts(len(commands), STATES_AT_ONCE):
        position[part], rotation[part] = end_effector(calibrated, coordinates_at_rest(calibrated, commands.at(part)))
    return position, rotation


def coordinates_at_rest(calibrated: CalibratedRobot, commands: Commands, near: np.ndarray | None = None) -> np.ndarray:
    """Where the robot yields to under its loads, as coordinates of its sites.

    Parameters
    ----------
    calibrated : CalibratedRobot
    commands : Commands
    near : ndarray (N, C), optional
        Coordinates at which the loads are taken: those of commands that differ little. Found by iteration without.

    Returns
    -------
    ndarray (N, C)
    """
    model, estimate, states = calibrated.model, calibrated.estimate, _states(calibrated, commands)
    return displaced_coordinates(model, estimate, conditions(model, estimate, states, near))


def end_effector(calibrated: CalibratedRobot, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position (N, 3), m, and rotation (N, 3, 3) of the end effector, base axes, at coordinates (N, C) of the sites."""
    chain = calibrated.model.sites.chain
    return poses(chain, coordinates, chain.end_effector)


def nominal_forward(robot: Robot, joint_angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the end effector of the robot file is, which is rigid.

    Parameters
    ----------
    robot : Robot
    joint_angles : ndarray (N, n)
        As the controller reports them, rad.

    Returns
    -------
    position, rotation : ndarray (N, 3), (N, 3, 3)
        As by `forward`.
    """
    return poses(robot.chain, robot.model_angles(joint_angles), robot.chain.end_effector)


def prediction_covariance(calibrated: CalibratedRobot, commands: Commands, at_rest: np.ndarray | None = None) -> np.ndarray:
    """What the uncertainty of the parameters leaves uncertain of the pose, by linear propagation (JCGM 100).

    Parameters
    ----------
    calibrated : CalibratedRobot
    commands : Commands
    at_rest : ndarray (N, C), optional
        As by `coordinates_at_rest`, where they are known.

    Returns
    -------
    ndarray (N, 6, 6)
        Of position (m) and orientation (rad), base axes.
    """
    model, estimate, count = calibrated.model, calibrated.estimate, len(calibrated.covariance)
    covariance = np.zeros((len(commands), 6, 6))
    if not count:
        return covariance
    spread = _square_root(calibrated.covariance)
    for part in _parts(len(commands), observations_at_once(6, count)):
        states = _states(calibrated, commands.at(part))
        here = Observations(
            states,
            np.arange(len(states)),
            np.zeros(len(states), int),
            np.zeros((len(states), 3)),
            np.broadcast_to(np.eye(3), (len(states), 3, 3)),
        )
        around = conditions(model, estimate, states, None if at_rest is None else at_rest[part])
        line = linearize(model, estimate, here, around)
        moved = line.sensitivities @ spread
        covariance[part] = moved @ moved.transpose(0, 2, 1)
    return covariance


def _square_root(covariance: np.ndarray) -> np.ndarray:
    """A factor L with L L' the covariance, singular where parameters were not identifiable."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(values.clip(min=0.0))


def _parts(count: int, at_once: int) -> list[slice]:
    return [slice(start, min(start + at_once, count)) for start in range(0, count, at_once)]


def _states(calibrated: CalibratedRobot, commands: Commands) -> States:
    count, nowhere = len(commands), np.zeros(len(commands))
    return States(
        session=np.zeros(count, int),
        pose=np.arange(count),
        load=np.zeros(count, int),
        joint_angles=calibrated.robot.model_angles(commands.joint_angles),
        wrench=commands.wrench,
        repeats=np.ones(count, int),
        approach=np.zeros(commands.joint_angles.shape) if commands.approach is None else commands.approach,
        time_s=nowhere + calibrated.model.time_zero_s if commands.time_s is None else commands.time_s,
        temperature_c=nowhere + _REFERENCE_C if commands.temperature_c is None else commands.temperature_c,
    )
