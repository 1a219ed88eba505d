"""Step 4: the metrics of one strategy from its identified compliances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.evaluation import (
    accuracy_sums,
    accuracy_table,
    average,
    metrics_table,
    replicates_table,
)
from elastocal.study.metrics import Judge, make_judge
from elastocal.study.steps.columns import data_sets, to_deflections, to_experiments
from elastocal.study.steps.weights import to_weights

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.mechanics.robot import Robot


def judge_from(
    robot: Robot, test_experiments: Mapping[str, np.ndarray], test_deflections: Mapping[str, np.ndarray], wrench_at: str
) -> Judge:
    """Score sheet from the tables of the test configurations; see `metrics.make_judge`."""
    return make_judge(robot, to_experiments(test_experiments), to_deflections(test_deflections), wrench_at)


def evaluate_strategy(
    identified_blocks: Iterable[Mapping[str, np.ndarray]],
    weight_blocks: Iterable[Mapping[str, np.ndarray]],
    test_weights: Mapping[str, np.ndarray],
    judge: Judge,
    fixed_joints: Sequence[int],
    method: str,
    deviation_of: str,
    lengths: Sequence[int],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Tables of metrics, bootstrap replicates and accuracy of one strategy.

    `identified_blocks`: blocks of the identified table. `weight_blocks`: blocks of the weights table for the same data sets.
    `test_weights`: the block of the weights table for the test configurations. `method`, `deviation_of`: interpretations R7 and
    R8, see `evaluation.average`. `lengths`: for the accuracy of one data set.
    """
    joints, evaluated_rows = len(judge.reference), np.asarray(lengths) - 1
    sums: list[np.ndarray] = []

    def weigh() -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Estimates with their weights, one pass for both views of them."""
        for block, counts in zip(identified_blocks, weight_blocks, strict=True):
            sets = data_sets(block)
            compliance = np.stack([block[f"c{j + 1}"].reshape(len(sets), -1) for j in range(joints)], axis=-1)
            sums.append(accuracy_sums(compliance[:, evaluated_rows], judge))
            yield compliance, to_weights(counts)

    averages = average(weigh(), judge, method, deviation_of, to_weights(test_weights))
    return (
        metrics_table(averages, judge.reference, fixed_joints),
        replicates_table(averages, judge.reference, fixed_joints),
        accuracy_table(sum(sums, np.zeros(())), lengths),
    )
