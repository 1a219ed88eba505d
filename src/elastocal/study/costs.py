"""What an accuracy costs (RQ2): a configuration takes time to go to, a measurement takes time to take.

In units of one measurement, n configurations with m measurements each cost n (r + m), where a configuration costs r. A set of
points that needs fewer configurations pays from the cost on at which both are equal: its break-even.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

MICRO = 1e6
# Costs of a configuration, in measurements, at which curves are given: from none to a robot that is loaded by hand.
_CONFIGURATION_COSTS = (0.0, *np.logspace(-2, 1.5, 43).round(4).tolist())


def configurations_needed(squares: np.ndarray, accuracy: float) -> np.ndarray:
    """Configurations after which the RMS error stays below an accuracy, a real number by interpolation of its logarithm.

    `squares` (..., lengths): mean square errors for the lengths 1, 2, 3 ... `accuracy`: in the units of their roots. Returns
    (...): infinite where the longest does not reach it.
    """
    excess = np.log(np.where(np.isnan(squares), np.inf, squares)) - 2 * np.log(accuracy)
    above = excess > 0
    last = excess.shape[-1] - 1 - np.argmax(above[..., ::-1], axis=-1)
    reached = ~above[..., -1]
    start = np.minimum(last, excess.shape[-1] - 2)[..., None]
    before, after = (np.take_along_axis(excess, start + k, -1)[..., 0] for k in (0, 1))
    with np.errstate(invalid="ignore"):
        share = np.where(np.isinf(before), 1.0, before / (before - after))
    between = np.exp(np.log1p(start[..., 0]) + share * np.log1p(1.0 / (start[..., 0] + 1.0)))
    return np.where(~above.any(axis=-1), 1.0, np.where(reached, between, np.inf))


def find_needed_by_set(
    frame: pd.DataFrame, point_sets: Mapping[str, Sequence[str]], accuracy_um: float, weights: np.ndarray
) -> dict[str, np.ndarray]:
    """Configurations needed by each set of points in each bootstrap replicate, the first of which is no replicate.

    `frame`: the budget table of one robot. `weights` (1 + replicates, sets): from `bootstrap.bootstrap_weights`.
    """
    found = {}
    for points in point_sets:
        mine = frame[frame.points == points]
        if len(mine):
            squares = mine.pivot(index="data_set", columns="length", values="mean_square").to_numpy()
            mean = weights @ squares / weights.sum(axis=1, keepdims=True)
            found[points] = configurations_needed(mean, accuracy_um / MICRO)
    return found


def break_even_table(
    frames: Mapping[str, pd.DataFrame],
    point_sets: Mapping[str, Sequence[str]],
    accuracies_um: Sequence[float],
    weights: Mapping[str, np.ndarray],
) -> pd.DataFrame:
    """From which cost of a configuration on each set of points is cheaper than the first one.

    `frames`: the budget table of each robot. `weights`: bootstrap weights of each robot's data sets. Returns robot,
    accuracy_um, points, against, configurations and configurations_against (real numbers), break_even in measurements with
    its 95 % interval (break_even_low, break_even_high); infinite where the set never pays.
    """
    rows = []
    against = next(iter(point_sets))
    for robot, frame in frames.items():
        for accuracy in accuracies_um:
            needed = find_needed_by_set(frame, point_sets, accuracy, weights[robot])
            if against not in needed:
                continue
            theirs, m = needed[against], len(point_sets[against])
            for points, ours in needed.items():
                if points == against or not (np.isfinite(ours[0]) and np.isfinite(theirs[0])):
                    continue
                with np.errstate(divide="ignore", invalid="ignore"):
                    even = (ours * len(point_sets[points]) - theirs * m) / (theirs - ours)
                even = np.where(ours < theirs, np.maximum(even, 0.0), np.inf)
                row: dict[str, Any] = {"robot": robot, "accuracy_um": accuracy, "points": points, "against": against}
                row |= {"configurations": ours[0], "configurations_against": theirs[0]}
                rows.append(row | _interval("break_even", even))
    names = ("robot", "accuracy_um", "points", "against", "configurations", "configurations_against")
    return pd.DataFrame(rows, columns=[*names, "break_even", "break_even_low", "break_even_high"])


def cost_table(
    frames: Mapping[str, pd.DataFrame],
    point_sets: Mapping[str, Sequence[str]],
    accuracy_um: float,
    weights: Mapping[str, np.ndarray],
) -> pd.DataFrame:
    """What an accuracy costs by each set of points over the first one, by the cost of a configuration.

    `frames`, `point_sets`, `weights`: as in `break_even_table`. Returns robot, points, configuration_cost, cost (in
    measurements), ratio to the first set with its 95 % interval (ratio_low, ratio_high), and whether the set is the cheapest.
    """
    rows = []
    against = next(iter(point_sets))
    for robot, frame in frames.items():
        needed = find_needed_by_set(frame, point_sets, accuracy_um, weights[robot])
        for each in _CONFIGURATION_COSTS:
            costs = {points: n * (each + len(point_sets[points])) for points, n in needed.items() if np.isfinite(n[0])}
            cheapest = min(costs, key=lambda points: costs[points][0], default="")
            for points, cost in costs.items():
                ratio = cost / costs[against] if against in costs else np.full_like(cost, np.nan)
                row: dict[str, Any] = {"robot": robot, "points": points, "configuration_cost": each, "cost": cost[0]}
                rows.append(row | _interval("ratio", ratio) | {"cheapest": points == cheapest})
    names = ("robot", "points", "configuration_cost", "cost", "ratio", "ratio_low", "ratio_high", "cheapest")
    return pd.DataFrame(rows, columns=[*names])


def _interval(name: str, values: np.ndarray) -> dict[str, float]:
    """A value, the first, with its 95 % interval over replicates."""
    low, high = np.quantile(values[1:], [0.025, 0.975], method="nearest")
    return {name: values[0], f"{name}_low": low, f"{name}_high": high}
