"""The limit: what the best analyst finds, who knows the plant's laws, how often each mechanism occurs, and how large it is.

Of each mechanism at each location some defects are drawn as the plant draws them. With S (M, m) what their measurements show
after absorption, each of the non-centrality of the case, an unknown defect of that kind is taken for a random vector of the
second moments S S'/m: the residual is then normal with covariance I + S S'/m, and the most probable mechanism is the Bayes
rule of linear Gaussian models [1]. An alarm is the likelihood-ratio test of the average over all of them, which no test exceeds
on average [2], with its null distribution simulated.

[1] Bishop, C. M., Pattern Recognition and Machine Learning, chapter 3, Springer, 2006.
[2] Lehmann, E. L. and Romano, J. P., Testing Statistical Hypotheses, section 3.8, Springer, 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.settings import Settings
from elastocal_proof.blind.cases import NAMED, Case, absent_on, defects_of, yardstick_of
from elastocal_proof.plant.defects import Defect, with_defects
from elastocal_proof.plant.kinds import KINDS
from elastocal_proof.plant.random_numbers import stream

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from elastocal_proof.blind.cases import Plan
    from elastocal_proof.plant.physical_robot import PhysicalRobot
    from elastocal_proof.plant.sizing import Yardstick

# Of each kind at each location: as many as its details have directions, within a factor of two.
_DRAWS = 8
# Of the null distribution.
_NULL_DRAWS = 2000
# Part of the squares of a signal below which the declared model absorbs it whatever its size.
_ABSORBED = 1e-4


@dataclass(frozen=True)
class Signals:
    """What unit defects show in one campaign.

    `kinds`: of each location that anything can be seen of. `units` (M, locations, draws): of length one, after absorption.
    """

    kinds: tuple[str, ...]
    units: np.ndarray


def limit_of_sample(plan: Plan, truth: Mapping[str, Any], robots_folder: str | Path) -> dict[str, Any] | None:
    """As `limit`, of a case that is in the sample; None of others. `truth`: a sealed document."""
    stated, asked = truth["case"], plan["limit"]
    case = Case(**stated | {name: tuple(stated[name]) for name in ("effects", "levels")})
    drawn = stream(case.seed, "sample of the limit").random() < 1 / asked["one_in"]
    absorbed = any(defect["of"] == "raw" for defect in truth["defects"])
    compared = [case.group, *case.levels[:1]] in asked["of"]
    return limit(plan, case, robots_folder) if drawn and compared and not absorbed else None


def limit(plan: Plan, case: Case, robots_folder: str | Path) -> dict[str, Any]:
    """What the best analyst says of one case with one effect of the catalogue, or with two.

    Returns ``detected`` at the level of the diagnosis, ``mechanisms`` that are most probable, their ``probability``, ``right``.
    Sets of mechanisms are equally probable, and so are the locations of each.
    """
    robot = case.specimen(robots_folder)
    yardstick = yardstick_of(case, robot)
    bad = with_defects(robot, [defect for defect, _ in defects_of(case, robot, yardstick)])
    signals = signals_of(yardstick, robot, [kind for kind in NAMED if kind not in absent_on(plan, case.robot)], case.seed)
    sets, columns = _hypotheses(case, signals)
    residual = yardstick.residual(bad)
    flat = signals.units.reshape(len(residual), -1)
    gram, along = flat.T @ flat, flat.T @ residual
    draws = stream(case.seed, "null distribution of the limit")
    # Of noise alone, the products with all signals.
    values, vectors = np.linalg.eigh(gram)
    noise = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ draws.standard_normal((len(gram), _NULL_DRAWS))
    names, number, count = np.unique(sets, axis=0, return_inverse=True, return_counts=True)
    shares = -np.log(count[number] * len(names))
    factors = log_bayes_factors(gram, np.column_stack([along, noise]), columns, case.levels[0]) + shares[:, None]
    statistic = log_sum_exp(factors, axis=0)
    probability = np.bincount(number, np.exp(factors[:, 0] - statistic[0]))
    best = int(np.argmax(probability))
    exceeding = int((statistic[1:] >= statistic[0]).sum())
    return {
        "detected": (1 + exceeding) / (1 + _NULL_DRAWS) <= Settings().alarm_level,
        "mechanisms": names[best].tolist(),
        "probability": float(probability[best]),
        "right": names[best].tolist() == sorted(case.effects),
    }


def signals_of(yardstick: Yardstick, robot: PhysicalRobot, kinds: Iterable[str], seed: int) -> Signals:
    """Draw defects of each kind at each of its locations, and see what they show."""
    named, units = [], []
    for kind in kinds:
        size = KINDS[kind].plausible_on(robot.arm)
        for location in KINDS[kind].locations(robot.arm):
            drawn = stream(seed, f"limit {kind} {location}").integers(2**31, size=_DRAWS)
            shown = [with_defects(robot, [Defect(kind, location, size, int(number))]) for number in drawn]
            seen, left = zip(*(yardstick.seen_and_left(one) for one in shown), strict=True)
            remaining = np.linalg.norm(left, axis=1)
            visible = remaining**2 > _ABSORBED * np.linalg.norm(seen, axis=1) ** 2
            if visible.any():
                named.append(kind)
                # Gears that no torque of this campaign brings to where they yield show nothing: the others stand for these.
                some = np.resize(np.flatnonzero(visible), _DRAWS)
                units.append((np.array(left)[some] / remaining[some, None]).T)
    return Signals(tuple(named), np.stack(units, axis=1))


def log_bayes_factors(gram: np.ndarray, along: np.ndarray, columns: np.ndarray, level: float) -> np.ndarray:
    """Log Bayes factors against nothing of normal vectors with the second moments of some columns.

    `gram` (K, K): of all columns, of length one. `along` (K, N): products with N residuals. `columns` (H, m) of int: of each
    hypothesis, as many for each of its defects. `level`: mean square length of what a defect shows. Returns (H, N).
    """
    share = level / _DRAWS
    found = np.empty((len(columns), along.shape[1]))
    for part in np.array_split(np.arange(len(columns)), max(len(columns) // 1000, 1)):
        at = columns[part]
        inner = np.eye(at.shape[1]) + share * gram[at[:, :, None], at[:, None, :]]
        mine = along[at]
        gains = share * (mine * np.linalg.solve(inner, mine)).sum(axis=1)
        found[part] = 0.5 * gains - 0.5 * np.linalg.slogdet(inner)[1][:, None]
    return found


def _hypotheses(case: Case, signals: Signals) -> tuple[np.ndarray, np.ndarray]:
    """Sets of as many mechanisms as a case has, one for each location of each, and the columns of each."""
    kinds, locations = np.array(signals.kinds), np.arange(len(signals.kinds) * _DRAWS).reshape(-1, _DRAWS)
    chosen = np.array(list(combinations(range(len(kinds)), len(case.effects))))
    sets = np.sort(kinds[chosen], axis=1)
    distinct = [len(set(names)) == len(names) for names in sets]
    return sets[distinct], locations[chosen[distinct]].reshape(sum(distinct), -1)
