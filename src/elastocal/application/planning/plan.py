"""A plan: which configurations to measure, in which order, and how accurate a robot will
be that is corrected by their fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.inverse_kinematics import find_beyond_limits
from elastocal.application.planning.cell import check_configurations
from elastocal.application.planning.designs import (
    Criterion,
    add_prior,
    choose_greedily,
    compute_mean_gram,
    count_effective_parameters,
    exchange_candidates,
)
from elastocal.application.planning.reaching import reach_places
from elastocal.application.planning.survey import (
    compute_accuracy_rows,
    compute_information_rows,
    declare_model,
)
from elastocal.campaigns.holdout import FEWEST_TRAINING_POSES
from elastocal.counting import format_count
from elastocal.errors import InputError
from elastocal.fitting.model import list_parameters

if TYPE_CHECKING:
    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.reaching import SetUp
    from elastocal.application.planning.survey import Survey
    from elastocal.mechanics.robot import Robot

# Number of allowed configurations over which the accuracy is averaged.
_WORKSPACE = 300
# Number of random designs with which the plan is compared.
_RANDOM_DESIGNS = 40
# Whitened sensitivity to a joint offset of plausible size below which a target moves by
# rounding only.
_SMALLEST_SENSITIVITY = 1e-6
# Configurations drawn for each candidate that is wanted, because the cell forbids some.
_DRAWS_PER_CANDIDATE = 4
# What to tell the user if a constraint of the cell forbids all configurations.
_FORBIDDEN = {
    "boxes": "the boxes leave the arm no room",
    "floor": "forearm or target would be below the floor (--floor)",
    "column": "forearm or hand would be in the robot's own column",
    "sight": "the tracker or camera sees the targets in none",
}
# Largest angle (rad, or m) of a move below which an exchange in a tour is rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Candidates:
    """N configurations with a load each.

    Attributes
    ----------
    joint_angles : (N, n) as the controller reports them, rad.
    force : (N, 3) full load, N, base axes.
    place_index : (N,) int, place of the set-up that is measured in each; None for a tracker.
    """

    joint_angles: np.ndarray
    force: np.ndarray
    place_index: np.ndarray | None = None

    def select(self, chosen: np.ndarray | list[int] | slice) -> Candidates:
        """Select configurations by their numbers."""
        place_index = None if self.place_index is None else self.place_index[chosen]
        return Candidates(self.joint_angles[chosen], self.force[chosen], place_index)


@dataclass(frozen=True)
class Plan:
    """What to measure, and the accuracy that it gives.

    Attributes
    ----------
    fitted : configurations for the fit, in the order of a short tour.
    held_out : random configurations that judge the result.
    accuracy_m : (poses,) RMS error of the end effector over the workspace by the
        uncertainty of the parameters, as `accuracy` counts it, with the first 1, 2, ..
        of the fitted configurations, best first.
    random_m : (designs, poses) the same for random configurations.
    parameters : number of parameters of the declared model.
    effective_parameters : how many of them the fitted configurations determine.
    """

    fitted: Candidates
    held_out: Candidates
    accuracy_m: np.ndarray
    random_m: np.ndarray
    parameters: int
    effective_parameters: float


def find_allowed_candidates(
    survey: Survey, cell: Cell, count: int, seed: int
) -> Candidates:
    """Find configurations within the joint limits that the cell allows.

    Parameters
    ----------
    survey, cell : robot, targets and loads, and what is around them.
    count : number of candidates; there are fewer if the cell allows fewer.
    seed : of the scrambled Halton sequence and of the directions of the loads.

    Raises
    ------
    InputError
        The cell allows no configuration.
    """
    from scipy.stats import qmc

    robot = survey.robot
    halton = qmc.Halton(robot.commands, seed=seed)
    shares = halton.random(_DRAWS_PER_CANDIDATE * count)
    angles = robot.spread_angles(shares, robot.joint_limits)
    place_index = None
    if survey.setup is not None:
        angles, place_index = _find_measurable(survey.setup, robot, angles)
    is_within = ~find_beyond_limits(robot, angles).any(axis=1)
    angles = angles[is_within]
    place_index = None if place_index is None else place_index[is_within]
    reported = robot.reported_angles(angles)
    checks = check_configurations(cell, robot, survey.targets, reported)
    allowed = np.flatnonzero(np.all(list(checks.values()), axis=0))[:count]
    if not len(allowed):
        strictest = min(checks, key=lambda name: checks[name].mean())
        total = format_count(len(reported), "configuration")
        raise InputError(
            "plan",
            strictest,
            f"none of {total} allowed: {_FORBIDDEN[strictest]}",
            "room for the arm and its targets",
        )
    forces = survey.draw_forces(len(allowed), np.random.default_rng(seed))
    return Candidates(
        reported[allowed], forces, None if place_index is None else place_index[allowed]
    )


def _find_measurable(
    setup: SetUp, robot: Robot, angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find configurations in which a set-up can measure near random ones (N, n).

    Returns angles (M, n) of the chain, rad, and the index (M,) of the place that is
    measured in each.

    Raises `InputError`: there are none at some place.
    """
    place_index = np.arange(len(angles)) % len(setup.places)
    moved, checks = reach_places(setup, robot, angles, place_index)
    is_measurable = np.all(list(checks.values()), axis=0)
    for index, name in enumerate(setup.places):
        of_place = place_index == index
        if not is_measurable[of_place].any():
            strictest = min(checks, key=lambda check: checks[check][of_place].mean())
            total = format_count(int(of_place.sum()), "configuration")
            raise InputError(
                "plan",
                f"--place {name}",
                f"none of {total}: {strictest}",
                "another place",
            )
    return moved[is_measurable], place_index[is_measurable]


def choose_plan(
    survey: Survey, candidates: Candidates, poses: int, held_out: int, seed: int
) -> Plan:
    """Choose configurations by the determinant of the information (D-optimal).

    Parameters
    ----------
    survey : what is measured.
    candidates : configurations to choose from.
    poses, held_out : numbers of poses to fit, and to judge the result.
    seed : of all random choices.

    Raises
    ------
    InputError
        There are fewer candidates than poses; the poses measure fewer numbers than there
        are parameters, or are fewer than a campaign needs; or no joint moves a target.
    """
    count = len(candidates.joint_angles)
    stream = np.random.default_rng(seed)
    owners = [owner for owner, _ in list_parameters(*declare_model(survey))]
    _check_counts(survey, len(owners), count, poses, held_out)
    rows = compute_information_rows(
        survey, candidates.joint_angles, candidates.force, candidates.place_index
    )
    _check_sensitivity(rows, owners)
    workspace = candidates.select(stream.permutation(count)[:_WORKSPACE])
    accuracy_rows = compute_accuracy_rows(
        survey, workspace.joint_angles, workspace.force
    )
    weight = compute_mean_gram(accuracy_rows)
    d_optimal = Criterion(None)
    chosen = exchange_candidates(
        rows, choose_greedily(rows, poses, d_optimal), d_optimal
    )
    remaining = np.setdiff1d(np.arange(count), chosen)
    judging = stream.choice(remaining, held_out, replace=False)
    # Order the chosen configurations by how much each reduces the error.
    order = choose_greedily(rows[chosen], poses, Criterion(weight))
    best_first = [chosen[index] for index in order]
    random_designs = [
        stream.choice(count, poses, replace=False) for _ in range(_RANDOM_DESIGNS)
    ]
    return Plan(
        candidates.select(order_by_motion(candidates.joint_angles, chosen)),
        candidates.select(order_by_motion(candidates.joint_angles, judging.tolist())),
        compute_accuracy_curve(rows, best_first, weight),
        np.array(
            [compute_accuracy_curve(rows, design, weight) for design in random_designs]
        ),
        len(owners),
        count_effective_parameters(rows, chosen),
    )


def _check_counts(
    survey: Survey, parameter_count: int, candidates: int, poses: int, held_out: int
) -> None:
    """Refuse more poses than candidates, and fewer than the parameters need."""
    if candidates < poses + held_out:
        total = format_count(candidates, "allowed configuration")
        raise InputError(
            "plan",
            "poses",
            f"{poses + held_out} of {total}",
            f"at most {candidates}, or more candidates",
        )
    needed = -(-parameter_count // survey.numbers)
    fewest = max(needed, FEWEST_TRAINING_POSES)
    if poses < fewest:
        numbers = format_count(poses * survey.numbers, "number")
        raise InputError(
            "plan",
            "poses",
            f"{poses}, which measure {numbers} for"
            f" {format_count(parameter_count, 'parameter')}",
            f"at least {fewest}",
        )


def _check_sensitivity(rows: np.ndarray, owners: list[str]) -> None:
    """Refuse targets that do not move by the offset of any joint."""
    is_offset = [owner.startswith("joint_offset") for owner in owners]
    if np.abs(rows[..., is_offset]).max() < _SMALLEST_SENSITIVITY:
        raise InputError(
            "plan",
            "targets",
            "targets that no joint moves",
            "a --target on a moving link, away from the axis of a single joint",
        )


def order_by_motion(joint_angles: np.ndarray, chosen: list[int]) -> list[int]:
    """Order configurations so that the joints move little.

    The order is that of the nearest neighbour, improved by 2-opt [1] on the largest
    angle of each move.

    Parameters
    ----------
    joint_angles : (N, n) configurations, rad.
    chosen : numbers of those to be ordered.

    References
    ----------
    .. [1] Croes, G. A., A method for solving traveling-salesman problems, Operations
       Research 6, 1958.
    """
    if len(chosen) < 3:
        return list(chosen)
    angles = joint_angles[chosen]
    distance = np.abs(angles[:, None] - angles[None]).max(axis=-1)
    order = [0]
    unvisited = set(range(1, len(chosen)))
    while unvisited:
        current = distance[order[-1]]
        order.append(min(unvisited, key=current.__getitem__))
        unvisited.remove(order[-1])
    end = np.zeros(len(order))
    improved = True
    while improved:
        improved = False
        for first in range(1, len(order) - 1):
            for last in range(first + 1, len(order)):
                before = distance[order[first - 1]]
                after = distance[order[last + 1]] if last + 1 < len(order) else end
                reversed_length = before[order[last]] + after[order[first]]
                length = before[order[first]] + after[order[last]]
                if reversed_length < length - _ROUNDING:
                    order[first : last + 1] = order[first : last + 1][::-1]
                    improved = True
    return [chosen[index] for index in order]


def compute_accuracy_curve(
    rows: np.ndarray, order: list[int] | np.ndarray, weight: np.ndarray
) -> np.ndarray:
    """Compute the accuracy with the first 1, 2, .. configurations of an order.

    Parameters
    ----------
    rows : (N, k, P) rows of all candidates.
    order : numbers of the configurations.
    weight : (P, P) mean Gram matrix of the sensitivities in the workspace, m^2.

    Returns
    -------
    (len(order),) RMS errors, m.
    """
    ordered = rows[order].astype(float)
    information = add_prior(np.cumsum(ordered.transpose(0, 2, 1) @ ordered, axis=0))
    mean_square = np.trace(np.linalg.solve(information, weight), axis1=1, axis2=2)
    return np.sqrt(mean_square.clip(min=0.0))
