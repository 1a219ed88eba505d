"""What shall be measured and how well, and what one configuration contributes to the parameters of the robot's model.

The model is the one that a campaign declares: offsets of the joints, lengths and angles of the links, joint compliances where
loads are measured, the errors of declared masses, and where tracker and reflectors are, if unknown. Sensitivities are those of
the fit itself, at the robot file's values.

Standard deviations of a sensor are half of what its maker permits as the largest error, which a tracker's manual calls typical
[1]; the angles of its probe are from [2].

[1] Hexagon, Leica Absolute Tracker AT500 User Manual, section 2.8: transverse error at most 15 um + 6 um/m, typical results
    half of that.
[2] Hexagon, data sheet of the Leica T-Mac: rotation angles to 0.01 deg, which is 18 um at 100 mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import nominal_forward
from elastocal.application.frames import BASE, ROBOT, scope_about, subtract_placement
from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import declared_candidates
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.fitting.displacement import conditions
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import Estimate, Model
from elastocal.fitting.observations import Observations, States
from elastocal.fitting.parameters import parameters
from elastocal.mechanics.sites import sites_of

if TYPE_CHECKING:
    from elastocal.mechanics.robot import Robot

GEOMETRY = ("joint_offset", "link_geometry")
# States that are linearized at once: their Jacobians stay in the processor's cache.
_AT_ONCE = 1000
# Half of 15 um + 6 um/m at 7.5 m.
_TRACKER_M = 30e-6


@dataclass(frozen=True)
class Sensor:
    """Standard deviations of one component of a measurement; no orientation where positions are measured only.

    `words`: which instrument it stands for.
    """

    words: str
    position_m: float
    orientation_rad: float | None


_TRACKER = "half of MPE 15 µm + 6 µm/m"
# By what is measured.
SENSORS = {
    "position": Sensor(f"laser tracker and reflector at 7.5 m, {_TRACKER} (Leica AT500)", _TRACKER_M, None),
    "pose": Sensor(
        f"laser tracker and 6DoF probe, {_TRACKER} at 7.5 m and of 0.01° (Leica T-Mac)", _TRACKER_M, math.radians(0.01) / 2
    ),
}


@dataclass(frozen=True)
class Survey:
    """What is measured in each configuration.

    `targets`: all are read under each load. `unknown_base`: whether the tracker's frame is fitted. `measured`: one of
    "position", "pose". `shares`: shares of the force of a configuration under which it is read; (0,) without loads.
    `position_m`, `orientation_rad`: standard deviation of each component of a measurement.
    """

    robot: Robot
    targets: tuple[Target, ...]
    unknown_base: bool
    measured: str
    shares: tuple[float, ...]
    position_m: float
    orientation_rad: float

    @property
    def rows(self) -> int:
        """Numbers in a measurement of one target."""
        return 6 if self.measured == "pose" else 3

    @property
    def numbers(self) -> int:
        """Numbers that are measured in one configuration."""
        return len(self.shares) * len(self.targets) * self.rows

    @property
    def loaded(self) -> bool:
        """Whether any reading is under a load."""
        return any(self.shares)


def model_of(survey: Survey) -> tuple[Model, Estimate]:
    """The model that a campaign of this survey declares, at the values of the robot file."""
    robot, sites = survey.robot, sites_of(survey.robot)
    springs = (joint_compliance(sites),) if survey.loaded else ()
    weight = (declared_weight(sites),) if sites.masses else ()
    effects = (*springs, *weight, *declared_candidates(GEOMETRY, sites))
    model = Model(sites, survey.targets, survey.unknown_base, survey.rows, robot.compliance, effects)
    count = len(survey.targets)
    estimate = Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array([target.offset_m or (0.0, 0.0, 0.0) for target in survey.targets]),
        np.broadcast_to(np.eye(3), (count, 3, 3)).copy(),
        tuple(robot.compliance if e.effect == "joint_compliance" else np.zeros(len(e.parameters)) for e in effects),
        tuple(np.zeros(0) for _ in effects),
    )
    return model, estimate


def information(survey: Survey, reported_angles: np.ndarray, force: np.ndarray) -> np.ndarray:
    """What each configuration contributes, in units of the plausible size of each of the `parameters` of its model.

    `reported_angles` (N, n): rad. `force` (N, 3): N, base axes, at the last measuring point; read at each of the shares.
    Returns rows (N, k, P): whitened sensitivities of the k numbers measured in each; information is ``rows.T @ rows``.
    """
    model, estimate = model_of(survey)
    named = parameters(model, estimate)
    deviation = np.repeat([survey.position_m, survey.orientation_rad], 3)[: survey.rows]
    scale = np.array([parameter.plausible for _, parameter in named]) / deviation[:, None]
    numbers = survey.numbers
    found = np.empty((len(reported_angles), numbers, len(named)))
    at_once = max(_AT_ONCE // len(survey.shares), 1)
    for start in range(0, len(reported_angles), at_once):
        part = slice(start, start + at_once)
        seen = observe(survey, reported_angles[part], force[part])
        line = linearize(model, estimate, seen, conditions(model, estimate, seen.states))
        found[part] = (line.sensitivities * scale).reshape(-1, numbers, len(named))
    return found


def accuracy_rows(survey: Survey, reported_angles: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Sensitivities of where the end effector is, in the units of `information`, as `accuracy` counts them.

    Where the base is unknown, less its best placement over these configurations; where the offset of the reflectors on the end
    effector is, less the best constant offset there. Base and reflectors themselves do not move the robot.

    `reported_angles` (N, n): where it shall be known, rad. `force` (N, 3): under which it works there, N, base axes. Returns
    (N, 3, P): m, per plausible size of each parameter.
    """
    alone = replace(survey, shares=(1.0,) if survey.loaded else (0.0,))
    end = survey.robot.chain.end_effector
    there = [target for target in survey.targets if target.point == end.name]
    model, estimate = model_of(replace(alone, targets=(Target("end effector", end.name, end.offset_m),)))
    bare = replace(model, fitted_frames=False)
    seen = observe(replace(alone, targets=bare.targets), reported_angles, force)
    moved = linearize(bare, estimate, seen, conditions(bare, estimate, seen.states)).sensitivities[:, :3]
    plausible = [parameter.plausible for _, parameter in parameters(bare, estimate)]
    moved = np.concatenate([moved, np.zeros_like(moved)], axis=1) * plausible
    position, rotation = nominal_forward(survey.robot, reported_angles)
    offset = bool(there) and all(target.offset_m is None for target in there)
    scope = replace(scope_about(position), frame=ROBOT if survey.unknown_base else BASE, offset_removed=offset)
    rows = subtract_placement(scope, position, rotation, moved)[:, :3]
    # Behind the parameters of base and reflectors.
    found = np.zeros((len(rows), 3, len(parameters(*model_of(survey)))))
    found[..., -len(plausible) :] = rows
    return found


def observe(survey: Survey, reported_angles: np.ndarray, force: np.ndarray) -> Observations:
    """Every target under every share of the load of each configuration, in this order."""
    loads, targets = len(survey.shares), len(survey.targets)
    angles = np.repeat(survey.robot.model_angles(reported_angles), loads, axis=0)
    wrench = np.zeros((len(angles), 6))
    wrench[:, :3] = (force[:, None] * np.array(survey.shares)[:, None]).reshape(-1, 3)
    count = len(angles)
    nothing = np.zeros(count, int)
    states = States(nothing, np.arange(count) // loads, np.arange(count) % loads, angles, wrench, nothing + 1)
    state = np.repeat(np.arange(count), targets)
    nowhere = np.zeros((len(state), 3)), np.broadcast_to(np.eye(3), (len(state), 3, 3))
    return Observations(states, state, np.tile(np.arange(targets), count), nowhere[0], nowhere[1] if survey.rows == 6 else None)
