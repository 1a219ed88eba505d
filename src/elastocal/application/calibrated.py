"""The robot as corrected: the final model of a diagnosis without what belongs to one
campaign's set-up and its instruments.

A command states joint angles and a load. What goes with the sense in which a joint is
approached, with time or temperature is in no command either, and counts as an error
that is left (`accuracy`).

All that uses it (`accuracy`, `compensation`, `exported`) asks the same of it: where it
comes to rest (`come_to_rest` and `regressed`, `forward`), how surely
(`pose_sensitivities` with its covariance, noise and scope), and where it was fitted
(`beyond_fitted`). Poses are those of the end effector's measuring point in the robot's
base frame: that of the chain, which the fit placed under the tracker. How far tool and
work frame are known is another matter, and in no figure here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.frames import (
    BASE,
    Scope,
    root_mean_square,
    subtract_placement,
)
from elastocal.campaigns.campaign import Target
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.observations import Observations, States, select_states
from elastocal.mechanics.kinematics import pose_differences, poses
from elastocal.remainder.corrected import beyond_regressed, inputs_of, is_commanded
from elastocal.validation.transfer import find_beyond_campaign, find_larger_loads

if TYPE_CHECKING:
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.mechanics.robot import Robot
    from elastocal.remainder.regressions import Inputs, Predictor

# States at a time: what a walk along all sites makes of them stays in the processor's
# cache.
_AT_ONCE = 1024
# Names of what costs something and is no effect of the catalogue.
SPRINGS = "joint_compliance"
REGRESSION = "regression"


@dataclass(frozen=True)
class Remainder:
    """A regression on what the model leaves, added to it where joints and loads were
    fitted.

    `place` (3,): of the target in the end effector's measuring point for which it was
    fitted, m. `sensor_m`: deviation of the tracker's noise in a coordinate of what it
    was fitted to, which its intervals contain. `typical`: see `corrected.spread_of`.
    """

    predictor: Predictor
    place: np.ndarray
    sensor_m: float
    typical: float


@dataclass(frozen=True)
class CalibratedRobot:
    """A robot and what a campaign found of it.

    `robot`: as its file declares it; `robot.model_angles(reported)` gives the angles of
    the chain. `model`: the final model with the effects that move the robot. Its one
    target is the end effector's measuring point. `estimate`: its values; the frame is
    the robot's base. `covariance` (P, P): of the parameters of the effects (linear,
    then shapes, effect by effect), marginal over frames, targets and all effects that
    are left out; zero where held. `noise`: of the campaign, with the repeatability of
    the joints. `scope`: what its errors mean. `fitted`: the campaign's states; None
    where they are not known. `remainder`: None where physics alone corrects.
    """

    robot: Robot
    model: Model
    estimate: Estimate
    covariance: np.ndarray
    noise: Noise
    scope: Scope
    fitted: States | None = None
    remainder: Remainder | None = None

    @property
    def states(self) -> States:
        """The campaign's states, of a robot that has them."""
        assert self.fitted is not None, (
            "a robot that was read from its export has no campaign"
        )
        return self.fitted


def calibrate_by_fit(fit: Fit, robot: Robot) -> CalibratedRobot:
    """A calibrated robot from the final fit of a diagnosis of that robot's campaign."""
    return calibrate_by_model(robot, fit.model, fit.estimate, fit.covariance, fit.noise)


def calibrate_by_model(
    robot: Robot, model: Model, estimate: Estimate, covariance: np.ndarray, noise: Noise
) -> CalibratedRobot:
    """A calibrated robot from a fitted model; `covariance` (P, P): of all its
    `parameters`."""
    kept = [
        number for number, effect in enumerate(model.effects) if is_commanded(effect)
    ]
    keys = {model.effects[number].key for number in kept}
    rows = np.flatnonzero(
        [owner in keys for owner, _ in list_parameters(model, estimate)]
    )
    bare, values = move_to_end_effector(model, estimate)
    bare = replace(bare, effects=tuple(model.effects[number] for number in kept))
    values = replace(
        values,
        coefficients=tuple(estimate.coefficients[number] for number in kept),
        shapes=tuple(estimate.shapes[number] for number in kept),
    )
    scope = Scope(BASE, np.zeros(3), np.zeros((12, len(rows))))
    return CalibratedRobot(
        robot, bare, values, covariance[np.ix_(rows, rows)], noise, scope
    )


def move_to_end_effector(model: Model, estimate: Estimate) -> tuple[Model, Estimate]:
    """A model with all its effects whose one target is the end effector's measuring
    point, in the robot's base frame."""
    end = model.sites.chain.end_effector
    target = Target("end effector", end.name, end.offset_m)
    values = replace(
        estimate,
        sessions=(0,),
        frame_rotation=np.eye(3)[None],
        frame_position=np.zeros((1, 3)),
        target_offset=np.array([end.offset_m]),
        target_rotation=np.eye(3)[None],
    )
    return replace(model, targets=(target,), fitted_frames=False, rows=6), values


def without(calibrated: CalibratedRobot, numbers: set[int]) -> CalibratedRobot:
    """A robot without some effects of its model, by their numbers there: their linear
    parameters are zero."""
    values = tuple(
        0.0 * v if number in numbers else v
        for number, v in enumerate(calibrated.estimate.coefficients)
    )
    return replace(
        calibrated, estimate=replace(calibrated.estimate, coefficients=values)
    )


def compute_effect_contributions(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> dict[str, float]:
    """RMS error in m over commands (N, n) under loads (N, 6) if one effect alone were
    left out of the correction, by effect.

    Compliances come after effects, and a regression on the remainder last. In the frame
    of the robot's scope: what a new placement of its base takes up is no error there.
    """
    pose = predict_poses(calibrated, reported_angles, wrench)
    costs = {}
    names = [effect.effect for effect in calibrated.model.effects]
    for name in dict.fromkeys(
        [*names, SPRINGS, *([REGRESSION] if calibrated.remainder else [])]
    ):
        other = without(
            calibrated, {number for number, each in enumerate(names) if each == name}
        )
        if name == REGRESSION:
            other = replace(calibrated, remainder=None)
        elif name not in names:
            # Compliances as declared are no effect of the model.
            other = replace(
                other,
                model=replace(
                    other.model, nominal_compliance=0.0 * other.model.nominal_compliance
                ),
            )
        apart = pose_differences(*pose, *predict_poses(other, reported_angles, wrench))[
            ..., None
        ]
        costs[name] = root_mean_square(
            subtract_placement(calibrated.scope, *pose, apart)[:, :3, 0]
        )
    return costs


def predict_poses(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Where the robot really is: exact poses of the end effector's measuring point.

    `reported_angles` (N, n): as the controller reports them, rad (m for prismatic
    joints). `wrench` (N, 6): N, N m, at the last measuring point's origin, base axes,
    beside the weights that the robot file declares; None for none. Returns position (N,
    3), m, and rotation (N, 3, 3), base axes.
    """
    wrench = np.zeros((len(reported_angles), 6)) if wrench is None else wrench
    position = np.empty((len(reported_angles), 3))
    rotation = np.empty((len(reported_angles), 3, 3))
    for part in parts(len(reported_angles)):
        _, position[part], rotation[part] = come_to_rest(
            calibrated, reported_angles[part], wrench[part]
        )
    return position + regressed(calibrated, reported_angles, wrench), rotation


def regressed(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Displacement of the end effector by the regression on the remainder, ndarray (N,
    3), m, base axes; 0 where none acts."""
    found = np.zeros((len(reported_angles), 3))
    acts, asked = regression_at(calibrated, reported_angles, wrench)
    if calibrated.remainder is not None and asked is not None:
        found[acts] = calibrated.remainder.predictor.mean(asked)
    return found


def regression_at(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> tuple[np.ndarray, Inputs | None]:
    """At which commands (N, n) a regression on the remainder is added, ndarray of bool
    (N,), and what it is shown there."""
    more = calibrated.remainder
    if more is None:
        return np.zeros(len(reported_angles), bool), None
    every = observations_of(states_of(calibrated, reported_angles, wrench))
    acts = ~beyond_regressed(calibrated.states, every.states.joint_angles, wrench)
    asked = inputs_of(calibrated.model, calibrated.estimate, select_states(every, acts))
    place = np.broadcast_to(more.place, (len(asked), 3))
    return acts, replace(asked, others=np.hstack([asked.others[:, :-3], place]))


def come_to_rest(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    near: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the robot yields to by its model: coordinates (N, C) of its sites, and
    position and rotation as by `forward`.

    `near` (N, C): coordinates at which the loads are taken, of states that differ
    little. Without, loads act where the robot has yielded to them, by the fixed-point
    iteration of `model.evaluate_conditions`.
    """
    fitted = (calibrated.model, calibrated.estimate)
    states = states_of(calibrated, reported_angles, wrench)
    coordinates = compute_displaced_coordinates(
        *fitted, evaluate_conditions(*fitted, states, near)
    )
    chain = calibrated.model.sites.chain
    return coordinates, *poses(chain, coordinates, chain.end_effector)


def compute_nominal_poses(
    robot: Robot, reported_angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the end effector of the robot file is, taken as rigid: position (N, 3), m,
    and rotation (N, 3, 3), base axes."""
    return poses(
        robot.chain, robot.model_angles(reported_angles), robot.chain.end_effector
    )


def compute_pose_sensitivities(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Displacement and rotation of the poses of `forward` by the parameters, ndarray
    (N, 6, P), m and rad, base axes."""
    model = calibrated.model
    estimate = calibrated.estimate
    found = np.zeros((len(reported_angles), 6, len(calibrated.covariance)))
    for part in parts(len(reported_angles)):
        seen = observations_of(
            states_of(calibrated, reported_angles[part], wrench[part])
        )
        found[part] = linearize(
            model, estimate, seen, evaluate_conditions(model, estimate, seen.states)
        ).sensitivities
    return found


def beyond_fitted(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    times: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Which commands (N, n) stand beyond the joint angles that were fitted, and which
    are loaded so many times more: (N,)."""
    joints = find_beyond_campaign(
        calibrated.states, calibrated.robot.model_angles(reported_angles), None
    )
    return joints, find_larger_loads(calibrated.states, wrench, times)


def states_of(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> States:
    """Commands, reported joint angles (N, n) and loads (N, 6), as states of the
    model."""
    nothing = np.zeros(len(reported_angles), int)
    angles = calibrated.robot.model_angles(np.asarray(reported_angles, float))
    return States(
        nothing, np.arange(len(nothing)), nothing, angles, wrench, nothing + 1
    )


def observations_of(states: States) -> Observations:
    """The end effector in each state, not measured."""
    count = len(states)
    nowhere = np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3))
    return Observations(states, np.arange(count), np.zeros(count, int), *nowhere)


def parts(count: int) -> list[slice]:
    """So many states in parts that fit the cache."""
    return [
        slice(start, min(start + _AT_ONCE, count))
        for start in range(0, count, _AT_ONCE)
    ]


def square_root(covariance: np.ndarray) -> np.ndarray:
    """A factor L (P, P) with L L' a covariance, singular where parameters are held.

    By the eigenvectors of the correlations: parameters in kilograms would drown those
    in radians per newton metre.
    """
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return deviation[:, None] * vectors * np.sqrt(values.clip(min=0.0))
