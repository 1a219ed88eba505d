"""How many springs pay (RQ1): the ladder of models in each data set of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.ladder import ladder, products_of, spring_columns
from elastocal.study.simulation import measurement_noise, random_experiments, true_deflections
from elastocal.study.steps import SETS_PER_BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.interpretation import Interpretation, Size

FOLDS = 5


def ladder_blocks(
    robot: Robot,
    limits: np.ndarray,
    key: str,
    seed: int,
    interpretation: Interpretation,
    size: Size,
    lengths: Sequence[int],
    noises: Sequence[float],
) -> Iterator[dict[str, np.ndarray]]:
    """Models with more and more link springs, in each data set of the study of the tables.

    Parameters
    ----------
    robot : Robot
        With links.
    limits, key, seed, interpretation, size
        As in `repeat.repeated_blocks`; the noise of the size is not looked at.
    lengths : sequence of int
        Configurations from which to identify.
    noises : sequence of float
        Standard deviations, the same number in m and rad.

    Yields
    ------
    dict
        Columns of one block of the ladder table: a noise and a length in one block of data sets.
    """
    point, at = robot.chain.end_effector, interpretation.wrench_at
    tests = random_experiments(robot.chain, limits, seed, key, interpretation.loading, "test", [0], size.tests)
    judged = products_of(spring_columns(robot, tests)[:, :, :3], true_deflections(robot, tests, point, at)[..., :3])
    longest, count = max(lengths), len(robot.links)
    for first in range(0, size.data_sets, SETS_PER_BLOCK):
        sets = np.arange(first, min(first + SETS_PER_BLOCK, size.data_sets))
        drawn = random_experiments(robot.chain, limits, seed, key, interpretation.loading, "identification", sets, longest)
        columns, ideal = spring_columns(robot, drawn), true_deflections(robot, drawn, point, at)
        normal = measurement_noise(seed, key, point.name, sets, longest)
        for noise in noises:
            deflection = ideal + noise * normal
            for length in lengths:
                folds = [products_of(columns[:, fold:length:FOLDS], deflection[:, fold:length:FOLDS]) for fold in range(FOLDS)]
                found = ladder(folds, robot.joints, count)
                errors = np.stack(
                    [judged.squared_error(found.coefficients[:, springs]) for springs in range(count + 1)], axis=1
                )
                repeated = len(sets) * (count + 1)
                yield {
                    "noise": np.full(repeated, noise),
                    "length": np.full(repeated, length),
                    "data_set": np.repeat(sets, count + 1),
                    "link_springs": np.tile(np.arange(count + 1), len(sets)),
                    "added_link": np.concatenate([np.zeros((len(sets), 1), int), found.order + 1], axis=1).ravel(),
                    "chosen": (np.arange(count + 1) == found.chosen[:, None]).ravel(),
                    "mean_square": errors.ravel() / size.tests,
                }
