"""Further studies, against the pipeline of the first one; Table 4 over them, by hand."""

from dataclasses import replace

import numpy as np
import pytest
from made_studies import USUAL, blocks_of, studies_of
from made_study_blocks import deflections_of, evaluated_in_one_block, experiments_of, identified, judge

from elastocal.study.repeated import over_studies_table


@pytest.fixture(scope="module")
def some(strategies):
    return [strategies[name] for name in ("6DoF", "6DoF-after-3DoF", "4-6DoF-after-3DoF")]


def test_each_study_has_a_block_for_each_strategy(kuka, some):
    blocks = blocks_of(kuka, some)
    names = [strategy.name for strategy in some]
    assert [(block["study"][0], block["strategy"]) for block in blocks] == [(n, name) for n in (1, 2) for name in names]
    assert (blocks[0]["length"] == np.arange(1, 6)).all()


@pytest.mark.parametrize("average", ["stiffness", "compliance"])
def test_scores_are_those_of_the_pipeline_for_the_same_data_sets(kuka, some, average):
    """Study number 0, which is that of the pipeline."""
    found = blocks_of(kuka, some, replace(USUAL, average=average), studies=[0])
    experiments = experiments_of(kuka, sets=4, configurations=5)
    deflections, scores = deflections_of(kuka, experiments, 1e-5), judge(kuka)
    for strategy, block in zip(some, found, strict=True):
        table = identified(kuka, strategy, experiments, deflections)
        metrics = evaluated_in_one_block(table, scores, strategy.fixed_joints, average, 10)[0]
        for name in ("compliance_1", "compliance_6", "k_sigma", "k_sigma_fixed_joints", "deviation"):
            np.testing.assert_allclose(block[name][1:], metrics[name][1:], rtol=1e-6, err_msg=name)


def test_averages_of_compliances_and_errors_of_single_data_sets_stand_beside_the_scores(kuka, some):
    (usual,) = blocks_of(kuka, some[:1], studies=[0])
    (plain,) = blocks_of(kuka, some[:1], replace(USUAL, average="compliance"), studies=[0])
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
        np.testing.assert_array_equal(usual[f"{name}_mean_compliance"][1:], plain[name][1:])
    # A single data set has all of its noise.
    assert (np.sqrt(usual["mean_square"][1:]) > usual["deviation_mean_compliance"][1:]).all()


def test_table_4_over_studies_is_their_median_with_a_spread_that_one_outlier_does_not_move():
    """Biases of 20, 22 and 24, then one far out, over the length: percent and µm."""
    frame = studies_of(biases=(20.0, 22.0, 24.0, 22.0, 900.0)).assign(mean_square=25e-12)
    for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
        frame[f"{name}_mean_compliance"] = frame[name] / 10
    usual, averaged = over_studies_table(frame, 20, {"k_sigma": 2.0, "deviation": 4.0}).to_dict("records")
    assert [usual["average"], averaged["average"]] == ["stiffness", "compliance"]
    assert usual["dev_20_um"] == pytest.approx(1.1) and usual["dev_20_um_std"] == pytest.approx(1.4826 * 0.1)
    assert (usual["n_k_sigma_2_percent"], usual["n_k_sigma_fixed_joints_2_percent"], usual["n_dev_4_um"]) == (11, 6, 6)
    assert averaged["k_sigma_20_percent"] == pytest.approx(0.11) and usual["rms_20_um"] == pytest.approx(5.0)
