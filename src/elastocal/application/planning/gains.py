"""How many random poses it takes to know a robot as well as by a plan, and whether fits to simulated measurements agree."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.accuracy import remove_rigid_motion, root_mean_square
from elastocal.application.planning.criteria import Criterion, mean_squares
from elastocal.application.planning.exchange import choose_greedily, exchange_candidates, matrix_of
from elastocal.application.planning.plan import accuracy_curve, find_allowed_candidates
from elastocal.application.planning.survey import accuracy_rows, information, model_of, observe
from elastocal.fitting.displacement import conditions
from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise
from elastocal.fitting.parameters import parameters
from elastocal.fitting.prediction import predict

if TYPE_CHECKING:
    from elastocal.application.planning.cell import Cell
    from elastocal.application.planning.plan import Candidates, Loads
    from elastocal.application.planning.survey import Survey
    from elastocal.fitting.model import Estimate, Model

# Random orders of candidates, of so many poses, beside which a plan is put.
_ORDERS, _LONGEST = 60, 120
# Robots that are fitted, of each kind of design.
_ROBOTS = 12
# Of the plausible size: how far a robot is off its file.
_OFF = 0.3
_PLACES = 300
# Robots for each of which a plan is made anew, to see what not knowing it costs.
_UNKNOWN = 6


def gains(survey: Survey, cell: Cell, loads: Loads, poses: int, count: int, seed: int) -> dict[str, Any]:
    """A plan against random poses.

    `poses`: of the plan. `count`: of candidates. Returns ``planned_mm, random_mm`` with 5 and 95 % limits over random designs
    of as many poses; ``random_poses`` that it takes to be as good as the plan, with the same limits; ``fitted_planned_mm,
    fitted_random_mm``: errors over the workspace of models fitted to simulated measurements, RMS over robots, with
    ``fitted_ratio`` and its 95 % limits by a bootstrap over robots; ``robust_efficiency``: D-efficiency of the plan on robots
    that are off their file, beside plans made with full knowledge of each, the mean and the smallest.
    """
    draws = np.random.default_rng(seed)
    some = find_allowed_candidates(survey, cell, loads, count, seed)
    rows = information(survey, some.joint_angles, some.force).rows
    places = some.at(draws.permutation(len(rows))[:_PLACES])
    weight = mean_squares(accuracy_rows(survey, places.joint_angles, places.force))
    rule = Criterion(None)
    chosen = exchange_candidates(rows, choose_greedily(rows, poses, rule), rule)
    planned = _left(matrix_of(rows, chosen), weight)
    orders = [draws.choice(len(rows), _LONGEST, replace=False) for _ in range(_ORDERS)]
    curves = np.array([accuracy_curve(rows, order, weight) for order in orders])
    needed = np.array([np.argmax(curve <= planned) + 1 if (curve <= planned).any() else _LONGEST for curve in curves])
    found: dict[str, Any] = {"poses": poses, "planned_mm": 1e3 * planned}
    for name, values in (("random_mm", 1e3 * curves[:, poses - 1]), ("random_poses", needed)):
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        found |= {name: middle, f"{name}_low": low, f"{name}_high": high}
    errors = np.array(
        [
            [_fitted_error(survey, some.at(design), places, seed + robot) for design in (chosen, orders[robot][:poses])]
            for robot in range(_ROBOTS)
        ]
    )
    rms = np.sqrt((errors**2).mean(axis=0))
    again = np.sqrt((errors[draws.integers(_ROBOTS, size=(2000, _ROBOTS))] ** 2).mean(axis=1))
    low, high = np.quantile(again[:, 1] / again[:, 0], [0.025, 0.975])
    worth = [_worth_elsewhere(survey, some, chosen, seed + robot) for robot in range(_UNKNOWN)]
    return found | {
        "robust_efficiency": float(np.mean(worth)),
        "robust_efficiency_least": min(worth),
        "fitted_planned_mm": 1e3 * rms[0],
        "fitted_random_mm": 1e3 * rms[1],
        "fitted_ratio": rms[1] / rms[0],
        "fitted_ratio_low": low,
        "fitted_ratio_high": high,
    }


def _worth_elsewhere(survey: Survey, some: Candidates, chosen: list[int], seed: int) -> float:
    """D-efficiency of a plan on a robot that is off its file, over that of a plan that was made for this very robot."""
    model, nominal = model_of(survey)
    true = _off(model, nominal, np.random.default_rng(seed))
    rows, rule = information(survey, some.joint_angles, some.force, true).rows, Criterion(None)
    best = exchange_candidates(rows, choose_greedily(rows, len(chosen), rule), rule)
    apart = rule.value(matrix_of(rows, chosen)) - rule.value(matrix_of(rows, best))
    return float(np.exp(apart / rows.shape[2]))


def _left(matrix: np.ndarray, weight: np.ndarray) -> float:
    return float(np.sqrt(np.trace(np.linalg.solve(matrix, weight))))


def _fitted_error(survey: Survey, design: Candidates, places: Candidates, seed: int) -> float:
    """Error over the workspace of a model fitted to what one simulated robot shows in a design, RMS, m."""
    model, nominal = model_of(survey)
    draws = np.random.default_rng(seed)
    true = _off(model, nominal, draws)
    seen = observe(survey, design.joint_angles, design.force)
    position, rotation = predict(model, true, seen, conditions(model, true, seen.states))
    read = replace(seen, position=position + survey.position_m * draws.standard_normal(position.shape))
    if seen.rotation is not None:
        # Rotations are read without noise: the same for both designs.
        read = replace(read, rotation=rotation)
    noise = Noise("declared", survey.position_m, survey.orientation_rad, np.zeros(survey.robot.joints))
    fitted = fit(model, read, noise)
    alone = replace(survey, shares=(1.0,) if survey.loaded else (0.0,))
    there = observe(alone, places.joint_angles, places.force)
    position, rotation = predict(model, true, there, conditions(model, true, there.states))
    found = predict(model, fitted.estimate, there, conditions(model, fitted.estimate, there.states))[0]
    off = found - position
    if survey.unknown_base:
        unknown = survey.targets[0].offset_m is None
        off = remove_rigid_motion(off, position, rotation if unknown else None)
    return root_mean_square(off)


def _off(model: Model, nominal: Estimate, draws: np.random.Generator) -> Estimate:
    """A robot that is off its file."""
    sizes = {(owner, p.name): p.plausible for owner, p in parameters(model, nominal)}
    values = []
    for effect, value in zip(model.effects, nominal.coefficients, strict=True):
        step = _OFF * draws.standard_normal(len(value))
        plausible = np.array([sizes[effect.key, p.name] for p in effect.parameters])
        values.append(value * np.exp(step) if effect.effect == "joint_compliance" else value + step * plausible)
    return replace(nominal, coefficients=tuple(values))
