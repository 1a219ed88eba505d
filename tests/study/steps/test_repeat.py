"""Further studies in memory: the same scores as the pipeline's steps give from the same data sets."""

from dataclasses import replace

import numpy as np
import pytest
from made_studies import USUAL, blocks_of
from made_study_blocks import deflections_of, evaluated_in_one_block, experiments_of, identified, judge


@pytest.fixture(scope="module")
def some(strategies):
    return [strategies[name] for name in ("6DoF", "6DoF-after-3DoF", "4-6DoF-after-3DoF")]


def test_each_study_has_a_block_for_each_strategy(kuka, some):
    blocks = blocks_of(kuka, some)
    names = [strategy.name for strategy in some]
    assert [(block["study"][0], block["strategy"]) for block in blocks] == [(n, name) for n in (1, 2) for name in names]
    assert (blocks[0]["length"] == np.arange(1, 6)).all()


@pytest.mark.parametrize("average", ["stiffness", "compliance", "median"])
def test_scores_are_those_of_the_pipeline_for_the_same_data_sets(kuka, some, average):
    """Study number 0, which is that of the pipeline."""
    found = blocks_of(kuka, some, replace(USUAL, average=average), studies=[0])
    experiments = experiments_of(kuka, sets=4, configurations=5)
    deflections, scores = deflections_of(kuka, experiments, 1e-5), judge(kuka)
    for strategy, block in zip(some, found, strict=True):
        table = identified(kuka, strategy, experiments, deflections)
        metrics = evaluated_in_one_block(table, scores, strategy.fixed_joints, average, 10, [5])[0]
        for name in ("compliance_1", "compliance_6", "k_sigma", "k_sigma_fixed_joints", "deviation"):
            np.testing.assert_allclose(block[name][1:], metrics[name][1:], rtol=1e-6, err_msg=name)


def test_averages_of_compliances_and_errors_of_single_data_sets_stand_beside_the_scores(kuka, some):
    (usual,) = blocks_of(kuka, some[:1], studies=[0])
    (plain,) = blocks_of(kuka, some[:1], replace(USUAL, average="compliance"), studies=[0])
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
        np.testing.assert_array_equal(usual[f"{name}_mean_compliance"][1:], plain[name][1:])
    # A sign averages out, a norm does not, and a single data set has all of its noise.
    assert (np.abs(usual["deviation_signed"][1:]) < plain["deviation"][1:]).all()
    assert (np.sqrt(usual["mean_square"][1:]) > usual["deviation_mean_compliance"][1:]).all()
