"""How to evaluate (RQ4): what each strategy leaves of one data set, by several yardsticks on the same estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.metrics import make_judge, position_errors
from elastocal.study.uses import iso_9283, milling_path

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from elastocal.study.steps.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

# The quantile that is pooled, and over how much about it its density is taken.
_QUANTILE, _ABOUT = 0.95, 0.01


def use_blocks(
    study: StudyInMemory, strategies: Sequence[Strategy], uses: Mapping[str, Any]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Errors of the models of all data sets, strategy by strategy, from all configurations of a data set.

    `uses`: centre_m, edge_m, weight_N, path_m and cutting_N, see `uses`. Yields columns of one block of the uses table: one
    strategy; not a number for uses out of the robot's reach.
    """
    robot, at = study.robot, study.interpretation.wrench_at
    cube = iso_9283(robot, uses["centre_m"], uses["edge_m"], uses["weight_N"])
    path = milling_path(robot, uses["centre_m"], uses["path_m"], uses["cutting_N"])
    judges = [study.judge(), *(use and make_judge(robot, use, study.deflections(use), at) for use in (cube, path))]
    for strategy, blocks in study.estimates(strategies).items():
        models = np.concatenate([block[:, -1] for block in blocks])
        columns = _scores(*(position_errors(judge, models) if judge else _none(models) for judge in judges))
        yield {"strategy": strategy, "data_set": np.arange(study.size.data_sets), **columns}


def _none(models: np.ndarray) -> np.ndarray:
    """No errors at places that the robot does not reach."""
    return np.full((len(models), 1), np.nan)


def _scores(tests: np.ndarray, cube: np.ndarray, path: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of scores from errors (sets, places)."""
    low, pooled, high = np.quantile(tests, [_QUANTILE - _ABOUT, _QUANTILE, _QUANTILE + _ABOUT])
    slope = (high - low) / (2 * _ABOUT)
    return {
        "mean": tests.mean(axis=1),
        "mean_square": (tests**2).mean(axis=1),
        "p95": np.quantile(tests, _QUANTILE, axis=1),
        "pooled_p95": np.full(len(tests), pooled),
        "pooled_p95_influence": slope * ((tests > pooled).mean(axis=1) - (1 - _QUANTILE)),
        "iso_9283": cube.max(axis=1),
        "path_mean_square": (path**2).mean(axis=1),
        "path_max": path.max(axis=1),
    }
