"""How far each robot bends before any calibration (Table 2), data set by data set."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from elastocal.study.steps.columns import data_sets, to_deflections


def initial_blocks(ideal_blocks: Iterable[Mapping[str, np.ndarray]]) -> Iterator[dict[str, np.ndarray]]:
    """Statistics of the end-effector's displacement in each data set.

    `ideal_blocks`: blocks of the deflections table of the end-effector. Yields columns of one block of the initial table.
    """
    for block in ideal_blocks:
        displacement = np.linalg.norm(to_deflections(block)[..., :3], axis=-1)
        yield {
            "data_set": data_sets(block),
            "configurations": np.full(len(displacement), displacement.shape[1]),
            "mean": displacement.mean(axis=1),
            "mean_square": (displacement**2).mean(axis=1),
            "maximum": displacement.max(axis=1),
        }
