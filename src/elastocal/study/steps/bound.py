"""Step 4b: what the measurements of each strategy could give at best."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.bounds import squared_error_bounds
from elastocal.study.identification import prefix_information
from elastocal.study.metrics import Judge, error_moment
from elastocal.study.steps.columns import to_experiments
from elastocal.study.steps.design import Design

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from elastocal.mechanics.chain import Chain


def bound_blocks(
    experiment_blocks: Iterable[Mapping[str, np.ndarray]],
    chain: Chain,
    point_sets: Iterable[Iterable[str]],
    rows: int,
    wrench_at: str,
    judge: Judge,
) -> Iterator[dict[str, np.ndarray | str]]:
    """Cramér-Rao bound of the RMS end-effector error for each set of measuring points and each length.

    `experiment_blocks`: blocks of the experiments table. `rows`: 6 where poses are measured, 3 where positions are.
    `wrench_at`: one of "end_effector", "measuring_point". Yields columns of one block of the bounds table.
    """
    distinct = list(dict.fromkeys(tuple(sorted(points)) for points in point_sets))
    names = sorted({name for points in distinct for name in points})
    moment, sets = error_moment(judge), 0
    sums: dict[tuple[str, ...], np.ndarray] = dict.fromkeys(distinct, np.zeros(()))
    for block in experiment_blocks:
        regressors = Design(to_experiments(block), chain, names, rows, wrench_at).regressors
        information = {name: prefix_information(matrix) for name, matrix in regressors.items()}
        sets += regressors[names[0]].shape[-1]
        for points in distinct:
            sums[points] = sums[points] + squared_error_bounds(sum((information[p] for p in points), np.zeros(())), moment).sum(
                axis=1
            )
    for points, total in sums.items():
        yield {"points": "+".join(points), "length": np.arange(1, len(total) + 1), "rms_per_noise": np.sqrt(total / sets)}
