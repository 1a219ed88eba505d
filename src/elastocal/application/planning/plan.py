"""A plan: which configurations to measure, in which order, which to repeat and which to hold out; and what it is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.bound import best_value, efficiency
from elastocal.application.planning.cell import find_allowed
from elastocal.application.planning.criteria import Criterion, criterion, mean_squares
from elastocal.application.planning.exchange import add_prior, choose_greedily, exchange_candidates, matrix_of
from elastocal.application.planning.survey import accuracy_rows, count_parameters, information
from elastocal.campaigns.holdout import FEWEST_TRAINING_POSES
from elastocal.counting import counted
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.survey import Survey

# Configurations over which the accuracy is averaged, of those that the cell allows.
_PLACES = 300
# Random designs beside which the plan is shown.
_RANDOM = 40
# Over the noise: what an offset of a joint of plausible size moves of a target that it moves only by rounding.
_LEAST_SEEN = 1e-6
# More are drawn than are asked for, since the cell forbids some.
_DRAWS = 4


@dataclass(frozen=True)
class Loads:
    """With what the robot is loaded.

    `force_N`: 0 for none. `pulled`: by a pull in any direction; otherwise by a weight that hangs down.
    """

    force_N: float
    pulled: bool

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares of the force at which each configuration is read."""
        if not self.force_N:
            return (0.0,)
        return (0.0, 1.0, -1.0) if self.pulled else (0.0, 1.0)

    def forces(self, count: int, down: np.ndarray, draws: np.random.Generator) -> np.ndarray:
        """A force for each configuration, ndarray (N, 3), N, base axes."""
        if not self.pulled:
            return np.tile(self.force_N * down, (count, 1))
        direction = draws.standard_normal((count, 3))
        return self.force_N * direction / np.linalg.norm(direction, axis=1, keepdims=True)


@dataclass(frozen=True)
class Candidates:
    """Configurations among which a plan is made.

    `joint_angles` (N, n): as the controller reports them, rad. `force` (N, 3): N, base axes.
    """

    joint_angles: np.ndarray
    force: np.ndarray

    def at(self, chosen: np.ndarray | list[int]) -> Candidates:
        """Some of them."""
        return Candidates(self.joint_angles[chosen], self.force[chosen])


@dataclass(frozen=True)
class Plan:
    """What to measure.

    `fitted`, `held_out`: configurations that choose the parameters, in the order of a short tour; those that judge them, which
    are random. `efficiency`: share of the best possible design's worth that the fitted ones are sure to have, by the criterion.
    `accuracy_m` (poses,): root mean square error of the end effector over the workspace that the parameters' uncertainty
    leaves, as `accuracy` counts it, with the first 1, 2, .. of them, best first. `random_m` (designs, poses): the same with
    random configurations.
    """

    fitted: Candidates
    held_out: Candidates
    efficiency: float
    accuracy_m: np.ndarray
    random_m: np.ndarray


def find_allowed_candidates(survey: Survey, cell: Cell, loads: Loads, count: int, seed: int) -> Candidates:
    """Configurations within the limits that the cell allows.

    `count`: of candidates; fewer where the cell allows fewer. `seed`: of Halton's sequence, scrambled, and of the directions of
    the loads. Raises `InputError` where the cell allows none.
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
        words = {"boxes": "the boxes leave the arm no room", "sight": "the tracker sees the targets in none"}[least]
        found = f"none of {counted(len(reported), 'configuration')} allowed: {words}"
        raise InputError("plan", least, found, "room for the arm and its targets")
    down = np.array(robot.gravity_m_s2) / np.linalg.norm(robot.gravity_m_s2)
    return Candidates(reported[good], loads.forces(len(good), down, np.random.default_rng(seed)))


def choose_plan(survey: Survey, some: Candidates, poses: int, held_out: int, kind: str, seed: int) -> Plan:
    """Choose configurations.

    `poses`, `held_out`: to fit, and to judge. `kind`: one of "D", "A", "I". Raises `InputError`: fewer candidates than poses,
    poses that measure fewer numbers than there are parameters, or targets that no joint moves.
    """
    count, draws = len(some.joint_angles), np.random.default_rng(seed)
    if count < poses + held_out:
        found = f"{poses + held_out} of {counted(count, 'allowed configuration')}"
        raise InputError("plan", "poses", found, f"at most {count}, or more candidates")
    if poses < fewest_poses(survey):
        numbers = poses * survey.numbers
        found = f"{poses}, which measure {counted(numbers, 'number')} for {counted(count_parameters(survey), 'parameter')}"
        raise InputError("plan", "poses", found, f"at least {fewest_poses(survey)}")
    seen = information(survey, some.joint_angles, some.force)
    rows = seen.rows
    if np.abs(rows[..., [owner.startswith("joint_offset") for owner, _ in seen.names]]).max() < _LEAST_SEEN:
        raise InputError("plan", "targets", "targets that no joint moves", "a --target on what moves, off a lone axis")
    places = some.at(draws.permutation(count)[:_PLACES])
    accuracy = accuracy_rows(survey, places.joint_angles, places.force)
    rule, weight = criterion(kind, accuracy), mean_squares(accuracy)
    # A design by determinants is found fast and good by all criteria: a start for the exchange.
    chosen = exchange_candidates(rows, choose_greedily(rows, poses, Criterion(None)), rule)
    worth = efficiency(rule, matrix_of(rows, chosen), best_value(rows, poses, rule, chosen))
    rest = np.setdiff1d(np.arange(count), chosen)
    judged = draws.choice(rest, held_out, replace=False)
    # The chosen, each that which lowers the error most.
    order = [chosen[place] for place in choose_greedily(rows[chosen], poses, Criterion(weight))]
    random = np.array([accuracy_curve(rows, draws.choice(count, poses, replace=False), weight) for _ in range(_RANDOM)])
    return Plan(
        some.at(tour(some.joint_angles, chosen)),
        some.at(tour(some.joint_angles, judged.tolist())),
        worth,
        accuracy_curve(rows, order, weight),
        random,
    )


def fewest_poses(survey: Survey) -> int:
    """Poses that measure as many numbers as there are parameters, and as a campaign must have."""
    return max(-(-count_parameters(survey) // survey.numbers), FEWEST_TRAINING_POSES)


def count_needed_poses(curve_m: np.ndarray, accuracy_m: float) -> int | None:
    """Fewest poses whose curve is at or below an accuracy; None where all of them are not enough."""
    enough = np.flatnonzero(curve_m <= accuracy_m)
    return int(enough[0]) + 1 if len(enough) else None


def tour(joint_angles: np.ndarray, chosen: list[int]) -> list[int]:
    """An order in which joints move little: nearest neighbour, then 2-opt [1] by the largest angle of a move.

    [1] Croes, G. A., A method for solving traveling-salesman problems, Operations Research 6, 1958.
    """
    if len(chosen) < 3:
        return list(chosen)
    at = joint_angles[chosen]
    far = np.abs(at[:, None] - at[None]).max(axis=-1)
    order, left = [0], set(range(1, len(chosen)))
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
                if far[order[i - 1], order[j]] + new < far[order[i - 1], order[i]] + after - 1e-12:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return [chosen[place] for place in order]


def accuracy_curve(rows: np.ndarray, order: list[int] | np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Accuracy with the first 1, 2, .. of some configurations, ndarray (len(order),), m."""
    each = rows[order].astype(float)
    totals = add_prior(np.cumsum(each.transpose(0, 2, 1) @ each, axis=0))
    return np.sqrt(np.trace(np.linalg.solve(totals, weight), axis1=1, axis2=2).clip(min=0.0))
