"""A plan: which configurations to measure, in which order, which to repeat and to hold
out; what it is worth, and its sheet.

The model is the one that a campaign declares: offsets of the joints, lengths and angles
of the links, joint compliances where loads are measured, the errors of declared masses,
and where tracker and reflectors are, if unknown. Sensitivities are those of the fit
itself, at the robot file's values.

Standard deviations of a sensor are half of what its maker permits as the largest error,
which a tracker's manual calls typical [1]; the angles of its probe are from [2].

[1] Hexagon, Leica Absolute Tracker AT500 User Manual, section 2.8: transverse error at most 15 um + 6 um/m, typical results
    half of that.
[2] Hexagon, data sheet of the Leica T-Mac: rotation angles to 0.01 deg, which is 18 um at 100 mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.application.calibrated import (
    calibrate_by_model,
    compute_nominal_poses,
    compute_pose_sensitivities,
)
from elastocal.application.frames import BASE, ROBOT, Scope, subtract_placement
from elastocal.application.planning.cell import find_allowed
from elastocal.application.planning.designs import (
    Criterion,
    add_prior,
    choose_greedily,
    exchange_candidates,
    mean_squares,
)
from elastocal.campaigns.campaign import Target
from elastocal.campaigns.holdout import FEWEST_TRAINING_POSES
from elastocal.campaigns.measurements import DISPLAY_UNITS, TICK_COLUMN
from elastocal.counting import format_count
from elastocal.effects.catalogue import declared_candidates
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.errors import InputError
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    Estimate,
    Model,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import Observations, States
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.sites import sites_of

if TYPE_CHECKING:
    from elastocal.application.planning.cell import Cell
    from elastocal.mechanics.robot import Robot

GEOMETRY = ("joint_offset", "link_geometry")
# States that are linearized at once: their Jacobians stay in the processor's cache.
_AT_ONCE = 1000
# Half of 15 um + 6 um/m at 7.5 m.
_TRACKER_M = 30e-6
# Configurations over which the accuracy is averaged, of those that the cell allows.
_PLACES = 300
# Random designs beside which the plan is shown.
_RANDOM = 40
# Over the noise: what an offset of a joint of plausible size moves of a target that it
# moves only by rounding.
_LEAST_SEEN = 1e-6
# More are drawn than are asked for, since the cell forbids some; in words what forbids
# all.
_DRAWS = 4
_FORBIDDEN = {
    "boxes": "the boxes leave the arm no room",
    "floor": "forearm or target would be below the floor (--floor)",
    "column": "forearm or hand would be in the robot's own column",
    "sight": "the tracker sees the targets in none",
}
# From how many repeats of how many poses noise is estimated rather than declared: some
# sixty contrasts of positions.
REPEATED_POSES = 10
REPEATS = 4


_TRACKER = "half of MPE 15 µm + 6 µm/m"
# By what is measured: the instrument, and standard deviations of a coordinate (m) and
# of an angle (rad) that it reads.
SENSORS = {
    "position": (
        f"laser tracker and reflector at 7.5 m, {_TRACKER} (Leica AT500)",
        _TRACKER_M,
        0.0,
    ),
    "pose": (
        f"laser tracker and 6DoF probe, {_TRACKER} at 7.5 m and of 0.01° (Leica T-Mac)",
        _TRACKER_M,
        math.radians(0.005),
    ),
}


@dataclass(frozen=True)
class Survey:
    """What is measured in each configuration, and how well.

    `targets`: all are read under each load. `unknown_base`: whether the tracker's frame
    is fitted. `measured`: one of "position", "pose". `position_m`, `orientation_rad`:
    standard deviation of each component of a measurement. `force_N`: of the load, 0 for
    none; `pulled` in any direction, or a weight that hangs down.
    """

    robot: Robot
    targets: tuple[Target, ...]
    unknown_base: bool
    measured: str
    position_m: float
    orientation_rad: float
    force_N: float = 0.0
    pulled: bool = False

    @property
    def rows(self) -> int:
        """Numbers in a measurement of one target."""
        return 6 if self.measured == "pose" else 3

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares of the force under which each configuration is read."""
        return (
            ((0.0, 1.0, -1.0) if self.pulled else (0.0, 1.0)) if self.loaded else (0.0,)
        )

    @property
    def numbers(self) -> int:
        """Numbers that are measured in one configuration."""
        return len(self.shares) * len(self.targets) * self.rows

    @property
    def loaded(self) -> bool:
        """Whether any reading is under a load."""
        return self.force_N > 0.0

    def forces(self, count: int, draws: np.random.Generator) -> np.ndarray:
        """A force for each of some configurations, ndarray (N, 3), N, base axes."""
        direction = (
            draws.standard_normal((count, 3))
            if self.pulled
            else np.array([self.robot.gravity_m_s2] * count)
        )
        return (
            self.force_N * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        )


def model_of(survey: Survey) -> tuple[Model, Estimate]:
    """The model that a campaign of this survey declares, at the values of the robot
    file."""
    robot, sites = survey.robot, sites_of(survey.robot)
    springs = (joint_compliance(sites),) if survey.loaded else ()
    weight = (declared_weight(sites),) if sites.masses else ()
    effects = (*springs, *weight, *declared_candidates(GEOMETRY, sites))
    model = Model(
        sites,
        survey.targets,
        survey.unknown_base,
        survey.rows,
        robot.compliance,
        effects,
    )
    count = len(survey.targets)
    estimate = Estimate(
        (0,),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array([target.offset_m or (0.0, 0.0, 0.0) for target in survey.targets]),
        np.broadcast_to(np.eye(3), (count, 3, 3)).copy(),
        tuple(
            robot.compliance
            if e.effect == "joint_compliance"
            else np.zeros(len(e.parameters))
            for e in effects
        ),
        tuple(np.zeros(0) for _ in effects),
    )
    return model, estimate


def information(
    survey: Survey, reported_angles: np.ndarray, force: np.ndarray
) -> np.ndarray:
    """What each configuration contributes, in units of the plausible size of each of
    the `parameters` of its model.

    `reported_angles` (N, n): rad. `force` (N, 3): N, base axes, at the last measuring
    point; read at each of the shares. Returns rows (N, k, P): whitened sensitivities of
    the k numbers measured in each; information is ``rows.T @ rows``.
    """
    model, estimate = model_of(survey)
    named = list_parameters(model, estimate)
    deviation = np.repeat([survey.position_m, survey.orientation_rad], 3)[: survey.rows]
    scale = (
        np.array([parameter.plausible for _, parameter in named]) / deviation[:, None]
    )
    numbers = survey.numbers
    found = np.empty((len(reported_angles), numbers, len(named)))
    at_once = max(_AT_ONCE // len(survey.shares), 1)
    for start in range(0, len(reported_angles), at_once):
        part = slice(start, start + at_once)
        seen = observe(survey, reported_angles[part], force[part])
        line = linearize(
            model, estimate, seen, evaluate_conditions(model, estimate, seen.states)
        )
        found[part] = (line.sensitivities * scale).reshape(-1, numbers, len(named))
    return found


def accuracy_rows(
    survey: Survey, reported_angles: np.ndarray, force: np.ndarray
) -> np.ndarray:
    """Sensitivities of where the end effector is, in the units of `information`, as
    `accuracy` counts them.

    Where the base is unknown, less its best placement over these configurations; where
    the offset of the reflectors on the end effector is, less the best constant offset
    there. Base and reflectors themselves do not move the robot.

    `reported_angles` (N, n): where it shall be known, rad. `force` (N, 3): under which
    it works there, N, base axes. Returns (N, 3, P): m, per plausible size of each
    parameter.
    """
    model, estimate = model_of(survey)
    count = len(list_parameters(model, estimate))
    noise = Noise(
        "declared",
        survey.position_m,
        survey.orientation_rad,
        np.zeros(survey.robot.joints),
    )
    robot = calibrate_by_model(
        survey.robot, model, estimate, np.zeros((count, count)), noise
    )
    moved = compute_pose_sensitivities(
        robot, reported_angles, np.hstack([force, np.zeros_like(force)])
    )
    position, rotation = compute_nominal_poses(survey.robot, reported_angles)
    there = [
        target
        for target in survey.targets
        if target.point == survey.robot.chain.end_effector.name
    ]
    offset = bool(there) and all(target.offset_m is None for target in there)
    scope = Scope(
        ROBOT if survey.unknown_base else BASE,
        position.mean(axis=0),
        offset_removed=offset,
    )
    plausible = np.array(
        [
            parameter.plausible
            for _, parameter in list_parameters(robot.model, robot.estimate)
        ]
    )
    found = np.zeros((len(moved), 3, count))
    # Behind the parameters of base and reflectors.
    found[..., -len(plausible) :] = subtract_placement(
        scope, position, rotation, moved * plausible
    )[:, :3]
    return found


def observe(
    survey: Survey, reported_angles: np.ndarray, force: np.ndarray
) -> Observations:
    """Every target under every share of the load of each configuration, in this
    order."""
    loads = len(survey.shares)
    targets = len(survey.targets)
    angles = np.repeat(survey.robot.model_angles(reported_angles), loads, axis=0)
    wrench = np.zeros((len(angles), 6))
    wrench[:, :3] = (force[:, None] * np.array(survey.shares)[:, None]).reshape(-1, 3)
    count = len(angles)
    nothing = np.zeros(count, int)
    states = States(
        nothing,
        np.arange(count) // loads,
        np.arange(count) % loads,
        angles,
        wrench,
        nothing + 1,
    )
    state = np.repeat(np.arange(count), targets)
    nowhere = np.zeros((len(state), 3)), np.broadcast_to(np.eye(3), (len(state), 3, 3))
    return Observations(
        states,
        state,
        np.tile(np.arange(targets), count),
        nowhere[0],
        nowhere[1] if survey.rows == 6 else None,
    )


@dataclass(frozen=True)
class Candidates:
    """Configurations (N, n) as the controller reports them, rad, each with a force (N,
    3), N, base axes."""

    joint_angles: np.ndarray
    force: np.ndarray

    def at(self, chosen: np.ndarray | list[int]) -> Candidates:
        """Some of them."""
        return Candidates(self.joint_angles[chosen], self.force[chosen])


@dataclass(frozen=True)
class Plan:
    """What to measure: configurations that choose the parameters, in the order of a
    short tour; random ones that judge them.

    `accuracy_m` (poses,): RMS error of the end effector over the workspace that the
    parameters' uncertainty leaves, as `accuracy` counts it, with the first 1, 2, .. of
    the fitted ones, best first. `random_m` (designs, poses): the same with random
    configurations.
    """

    fitted: Candidates
    held_out: Candidates
    accuracy_m: np.ndarray
    random_m: np.ndarray


def find_allowed_candidates(
    survey: Survey, cell: Cell, count: int, seed: int
) -> Candidates:
    """Configurations within the limits that the cell allows.

    `count`: of candidates; fewer where the cell allows fewer. `seed`: of Halton's
    sequence, scrambled, and of the directions of the loads. Raises `InputError` where
    the cell allows none.
    """
    from scipy.stats import qmc

    robot = survey.robot
    low, high = robot.joint_limits.T
    shares = qmc.Halton(robot.joints, seed=seed).random(_DRAWS * count)
    reported = robot.reported_angles(low + (high - low) * shares)
    fine = find_allowed(cell, robot, survey.targets, reported)
    good = np.flatnonzero(np.all(list(fine.values()), axis=0))[:count]
    if not len(good):
        least = min(fine, key=lambda name: fine[name].mean())
        found = f"none of {format_count(len(reported), 'configuration')} allowed: {_FORBIDDEN[least]}"
        raise InputError("plan", least, found, "room for the arm and its targets")
    return Candidates(
        reported[good], survey.forces(len(good), np.random.default_rng(seed))
    )


def choose_plan(
    survey: Survey, some: Candidates, poses: int, held_out: int, seed: int
) -> Plan:
    """Choose configurations by the determinant of the information (D-optimal).

    `poses`, `held_out`: to fit, and to judge. Raises `InputError`: fewer candidates
    than poses, poses that measure fewer numbers than there are parameters or than a
    campaign has, or targets that no joint moves.
    """
    count = len(some.joint_angles)
    draws = np.random.default_rng(seed)
    if count < poses + held_out:
        found = f"{poses + held_out} of {format_count(count, 'allowed configuration')}"
        raise InputError("plan", "poses", found, f"at most {count}, or more candidates")
    listed = list_parameters(*model_of(survey))
    fewest = max(-(-len(listed) // survey.numbers), FEWEST_TRAINING_POSES)
    if poses < fewest:
        found = f"{poses}, which measure {format_count(poses * survey.numbers, 'number')} for {format_count(len(listed), 'parameter')}"
        raise InputError("plan", "poses", found, f"at least {fewest}")
    rows = information(survey, some.joint_angles, some.force)
    if (
        np.abs(
            rows[..., [owner.startswith("joint_offset") for owner, _ in listed]]
        ).max()
        < _LEAST_SEEN
    ):
        raise InputError(
            "plan",
            "targets",
            "targets that no joint moves",
            "a --target on what moves, off a lone axis",
        )
    places = some.at(draws.permutation(count)[:_PLACES])
    accuracy = accuracy_rows(survey, places.joint_angles, places.force)
    rule = Criterion(None)
    weight = mean_squares(accuracy)
    chosen = exchange_candidates(rows, choose_greedily(rows, poses, rule), rule)
    rest = np.setdiff1d(np.arange(count), chosen)
    judged = draws.choice(rest, held_out, replace=False)
    # The chosen, each that which lowers the error most.
    order = [
        chosen[place]
        for place in choose_greedily(rows[chosen], poses, Criterion(weight))
    ]
    random = np.array(
        [
            accuracy_curve(rows, draws.choice(count, poses, replace=False), weight)
            for _ in range(_RANDOM)
        ]
    )
    return Plan(
        some.at(tour(some.joint_angles, chosen)),
        some.at(tour(some.joint_angles, judged.tolist())),
        accuracy_curve(rows, order, weight),
        random,
    )


def tour(joint_angles: np.ndarray, chosen: list[int]) -> list[int]:
    """An order in which joints move little: nearest neighbour, then 2-opt [1] by the
    largest angle of a move.

    [1] Croes, G. A., A method for solving traveling-salesman problems, Operations
    Research 6, 1958.
    """
    if len(chosen) < 3:
        return list(chosen)
    at = joint_angles[chosen]
    far = np.abs(at[:, None] - at[None]).max(axis=-1)
    order = [0]
    left = set(range(1, len(chosen)))
    while left:
        order.append(min(left, key=lambda place: far[order[-1], place]))
        left.remove(order[-1])
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                after = far[order[j], order[j + 1]] if j + 1 < len(order) else 0.0
                new = far[order[i], order[j + 1]] if j + 1 < len(order) else 0.0
                if (
                    far[order[i - 1], order[j]] + new
                    < far[order[i - 1], order[i]] + after - 1e-12
                ):
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return [chosen[place] for place in order]


def accuracy_curve(
    rows: np.ndarray, order: list[int] | np.ndarray, weight: np.ndarray
) -> np.ndarray:
    """Accuracy with the first 1, 2, .. of some configurations, ndarray (len(order),),
    m."""
    each = rows[order].astype(float)
    totals = add_prior(np.cumsum(each.transpose(0, 2, 1) @ each, axis=0))
    return np.sqrt(
        np.trace(np.linalg.solve(totals, weight), axis1=1, axis2=2).clip(min=0.0)
    )


def build_sheet(survey: Survey, plan: Plan) -> pd.DataFrame:
    """Rows of measurements.csv.

    Returns ``pose`` (fitted ones first, from 1), ``load`` (0 without), ``repeat``,
    ``target``, ``done``, empty, ``q1_deg..qn_deg`` (``_mm`` of prismatic joints) as the
    controller shows them, ``q1..qn`` the same in rad (m), wrench (N, N m), and ``x, y,
    z`` and ``rx, ry, rz``, empty. The first poses are repeated, unloaded and under the
    first load: each repeat is a fresh approach.
    """
    rows = []
    configurations = [*zip(plan.fitted.joint_angles, plan.fitted.force, strict=True)]
    fitted = len(configurations)
    configurations += zip(plan.held_out.joint_angles, plan.held_out.force, strict=True)
    endings = ["mm" if slides else "deg" for slides in survey.robot.chain.prismatic]
    for pose, (angles, force) in enumerate(configurations, 1):
        # What is typed at the controller is what is planned.
        shown = {
            f"q{j}_{of}": round(q / DISPLAY_UNITS[of], 3) + 0.0
            for j, (q, of) in enumerate(zip(angles, endings, strict=True), 1)
        }
        exact = {
            name.partition("_")[0]: value * DISPLAY_UNITS[name.partition("_")[2]]
            for name, value in shown.items()
        }
        for repeat in range(REPEATS if pose <= min(REPEATED_POSES, fitted) else 1):
            for load, share in enumerate(survey.shares[: 2 if repeat else None]):
                # Nothing pulls where no load hangs: a share of zero has no sign.
                wrench = dict(
                    zip(
                        WRENCH_NAMES,
                        (*(share * force + 0.0), 0.0, 0.0, 0.0),
                        strict=True,
                    )
                )
                for target in survey.targets:
                    head: dict[str, Any] = {
                        "pose": pose,
                        "load": load,
                        "repeat": repeat,
                        "target": target.name,
                        TICK_COLUMN: "",
                    }
                    rows.append(head | shown | exact | wrench)
    empty = ["x", "y", "z", *(["rx", "ry", "rz"] if survey.measured == "pose" else [])]
    return pd.DataFrame(rows).assign(**dict.fromkeys(empty, np.nan))


def campaign_document(
    name: str, robot_file: str, survey: Survey, plan: Plan
) -> dict[str, Any]:
    """Contents of the campaign.yaml that goes with a sheet. `name`: of the campaign.
    `robot_file`: beside it."""
    fitted = len(plan.fitted.joint_angles)
    judged = len(plan.held_out.joint_angles)
    targets = {
        target.name: {
            "point": target.point,
            "offset_m": "unknown" if target.offset_m is None else list(target.offset_m),
        }
        for target in survey.targets
    }
    return {
        "campaign": name,
        "robot": robot_file,
        "measured": survey.measured,
        "frame": "tracker" if survey.unknown_base else "base",
        "targets": targets,
        "compliance": "identify" if survey.loaded else "nominal",
        "declared": list(GEOMETRY),
        "noise": {"position_m": survey.position_m}
        | (
            {"orientation_rad": survey.orientation_rad}
            if survey.measured == "pose"
            else {}
        ),
        "holdout": {"poses": list(range(fitted + 1, fitted + judged + 1))},
    }
