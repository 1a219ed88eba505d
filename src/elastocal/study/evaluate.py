"""Step 4: the metrics of one strategy from its identified compliances."""

import numpy as np

from elastocal.evaluation import (
    accuracy_sums,
    accuracy_table,
    average,
    bootstrap_test_weights,
    bootstrap_weights,
    metrics_table,
    replicates_table,
)
from elastocal.metrics import make_judge
from elastocal.study.columns import data_sets, to_deflections, to_experiments


def judge_from(robot, test_experiments, test_deflections, wrench_at):
    """Score sheet from the tables of the test configurations; see `metrics.make_judge`."""
    return make_judge(robot, to_experiments(test_experiments), to_deflections(test_deflections), wrench_at)


def evaluated(identified_blocks, judge, key, seed, first_stage_joints, method, deviation_of, replicates, lengths):
    """Tables of metrics, bootstrap replicates and accuracy of one strategy.

    Parameters
    ----------
    identified_blocks : iterable of dict
        Blocks of the identified table.
    judge : Judge
    key : str
        Name of the robot's file.
    seed : int
    first_stage_joints : sequence of int
    method, deviation_of
        Readings R7 and R8, see `evaluation.average`.
    replicates : int
    lengths : sequence of int
        For the accuracy of one data set.

    Returns
    -------
    metrics, replicates, accuracy : dict of str to ndarray
    """
    joints, evaluated_rows, sums = len(judge.reference), np.asarray(lengths) - 1, []

    def weighted():
        """Estimates with their weights, one pass for both views of them."""
        for block in identified_blocks:
            sets = data_sets(block)
            compliance = np.stack([block[f"c{j + 1}"].reshape(len(sets), -1) for j in range(joints)], axis=-1)
            sums.append(accuracy_sums(compliance[:, evaluated_rows], judge))
            yield compliance, bootstrap_weights(seed, key, sets, replicates)

    tests = bootstrap_test_weights(seed, key, len(judge.initial_errors), replicates)
    averages = average(weighted(), judge, method, deviation_of, tests)
    return (
        metrics_table(averages, judge.reference, first_stage_joints),
        replicates_table(averages, judge.reference, first_stage_joints),
        accuracy_table(sum(sums), lengths),
    )
