"""How many springs pay (RQ1): the ladder of models in each data set of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.ladder import ladder, products_of, spring_columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.study.steps.in_memory import StudyInMemory

FOLDS = 5


def ladder_blocks(study: StudyInMemory, lengths: Sequence[int], noises: Sequence[float]) -> Iterator[dict[str, np.ndarray]]:
    """Models with more and more link springs, in each data set of the study of the tables.

    `study`: of a robot with links; the noise of its size is not looked at. `lengths`: configurations from which to identify.
    `noises`: standard deviations, the same number in m and rad. Yields columns of one block of the ladder table: a noise and a
    length in one block of data sets.
    """
    robot, tests = study.robot, study.tests()
    judged = products_of(spring_columns(robot, tests)[:, :, :3], study.deflections(tests)[..., :3])
    longest, count = max(lengths), len(robot.links)
    for sets in study.blocks():
        drawn = study.experiments(sets, longest)
        columns, ideal, normal = (
            spring_columns(robot, drawn),
            study.deflections(drawn),
            study.noise(sets, configurations=longest),
        )
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
                    "mean_square": errors.ravel() / study.size.tests,
                }
