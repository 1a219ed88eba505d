"""Strategies judged in use, on the data sets of the pipeline."""

import numpy as np
import pandas as pd
import pytest
from made_studies import USUAL
from made_study_blocks import compliances, deflections_of, experiments_of, identified, judge

from elastocal.study.metrics import position_errors
from elastocal.study.steps.in_memory import Size, StudyInMemory
from elastocal.study.steps.uses import use_blocks

USES = {"centre_m": (1.6, 0.0, 1.0), "edge_m": 1.0, "weight_N": 1000, "path_m": 0.5, "cutting_N": 500}
NAMES = ("6DoF", "6DoF-after-3DoF", "3-6DoF-after-2DoF")


@pytest.fixture(scope="module")
def tables(kuka, strategies):
    study = StudyInMemory(kuka, "kuka", 1, USUAL, Size(data_sets=40, configurations=10, tests=30, noise=1e-5))
    blocks = use_blocks(study, [strategies[name] for name in NAMES], USES)
    return {block["strategy"]: pd.DataFrame(block) for block in blocks}


@pytest.mark.parametrize("name", NAMES)
def test_errors_are_those_of_the_pipelines_estimates(kuka, strategies, tables, name):
    experiments = experiments_of(kuka, 40, 10)
    table = identified(kuka, strategies[name], experiments, deflections_of(kuka, experiments, 1e-5))
    errors = position_errors(judge(kuka), compliances(table, 10))
    found = tables[strategies[name].name]
    np.testing.assert_allclose(found["mean"], errors.mean(axis=1), rtol=1e-6)
    np.testing.assert_allclose(found["mean_square"], (errors**2).mean(axis=1), rtol=1e-6)
    assert found.pooled_p95.unique() == pytest.approx([np.quantile(errors, 0.95)], rel=1e-6)


def test_influence_values_give_the_standard_error_of_the_pooled_percentile(tables):
    """Against the bootstrap over data sets, whose own error is 5 % with 200 replicates; the density is rough with 40 sets."""
    influence = tables["6DoF"].pooled_p95_influence
    assert abs(influence.mean()) < 0.2 * influence.std()
    assert 0.01 < influence.std() / np.sqrt(40) / tables["6DoF"].pooled_p95[0] < 0.2


def test_a_robot_that_does_not_reach_has_no_errors_there(kuka, strategies):
    study = StudyInMemory(kuka, "kuka", 1, USUAL, Size(data_sets=3, configurations=10, tests=30, noise=1e-5))
    (block,) = use_blocks(study, [strategies["6DoF"]], USES | {"centre_m": (9.0, 0.0, 1.0)})
    assert np.isnan(block["iso_9283"]).all() and np.isnan(block["path_max"]).all() and (block["mean"] > 0).all()
