"""Unaltered simulated data and estimates hold; an error of each kind does not."""

import numpy as np
import pytest
from made_audits import altered, failed

from elastocal_proof.audit.study import (
    check_estimates,
    check_experiments,
    check_ideal_deflections,
    check_measured_deflections,
    solve_staged,
)

EXPERIMENTS = "data/simulated/two/experiments.parquet"
IDEAL = "data/simulated/two/ideal.parquet"
MEASURED = "data/simulated/two/100um/measured.parquet"
IDENTIFIED = "results/identified/two/100um/hand.parquet"


def find_failures(run):
    for cache in (run.table, run.experiments, run.deflections):
        cache.cache_clear()
    checks = [
        *check_experiments(run, EXPERIMENTS, "two"),
        *check_ideal_deflections(run, IDEAL, "two"),
        *check_measured_deflections(run, MEASURED, "two", "100"),
    ]
    return failed([*checks, *check_estimates(run, IDENTIFIED, "two", "hand", "100")])


@pytest.mark.parametrize(
    ("file", "column", "change", "expected"),
    [
        (EXPERIMENTS, "q2", lambda v: v + 1e-6, "joint angles, data set 1"),
        (EXPERIMENTS, "fy", lambda v: -v, "wrenches, data set 1"),
        (
            EXPERIMENTS,
            "data_set",
            lambda v: v - 1,
            "each data set and configuration once",
        ),
        (IDEAL, "dz", lambda v: v + 1e-8, "deflection of hand, 20 rows"),
        (MEASURED, "rx", lambda v: v + 1e-8, "measured deflection of hand, data set 1"),
        (
            IDENTIFIED,
            "compliance_1",
            lambda v: 1.0001 * v,
            "compliances of data set 1, length 3",
        ),
        (
            IDENTIFIED,
            "compliance_2",
            lambda v: np.nan,
            "compliances of data set 1, length 3",
        ),
    ],
)
def test_unaltered_data_and_estimates_hold_and_an_altered_value_does_not(
    run, file, column, change, expected
):
    assert find_failures(run) == []
    with altered(run.folder, file, (column, 7), change):
        assert expected in find_failures(run)


def test_errors_of_a_stage_reach_the_next_one():
    """c1 = y1 and c2 = y2 - c1, so that its variance is 2."""
    stages = [
        {"points": ["a"], "joints": [1]},
        {"points": ["b"], "joints": [2], "held": [1]},
    ]
    gain, _ = solve_staged(
        stages, {"a": np.array([[1.0, 0.0]]), "b": np.array([[1.0, 1.0]])}, 2
    )
    np.testing.assert_allclose(gain @ [3.0, 5.0], [3.0, 2.0])
    np.testing.assert_allclose(gain @ gain.T, [[1, -1], [-1, 2]], atol=1e-12)
