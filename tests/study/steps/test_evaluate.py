"""Metrics, replicates and accuracy of one strategy from its identified compliances."""

import numpy as np
from made_study_blocks import (
    evaluated_in_one_block,
    judge,
)


def make_same_estimates(robot, factors, sets=12):
    """The identified table of data sets that all give the same compliances: this factor of the nominal ones at each length."""
    lengths = len(factors)
    table = {"data_set": np.repeat(np.arange(sets), lengths), "length": np.tile(np.arange(1, lengths + 1), sets)}
    return table | {f"c{j + 1}": np.tile(c * np.array(factors), sets) for j, c in enumerate(robot.compliance)}


def test_metrics_of_compliances_that_are_all_too_large_by_a_quarter(kuka):
    metrics, replicates, accuracy = evaluated_in_one_block(
        make_same_estimates(kuka, (2.0, 1.25)), judge(kuka), (0, 1), "stiffness", 10, [2]
    )
    # k / k0 - 1 = 1 / 1.25 - 1 = -20 % in each of six joints, of which two are fixed in the last stage; twice as soft, -50 %.
    assert metrics["length"].tolist() == [1, 2]
    for joint in range(1, 7):
        np.testing.assert_allclose(metrics[f"delta_k_{joint}"], [-50.0, -20.0], rtol=1e-12)
        ratio = metrics[f"compliance_{joint}"] / kuka.compliance[joint - 1]
        np.testing.assert_allclose(ratio, [2.0, 1.25], rtol=1e-12)
        np.testing.assert_allclose(accuracy[f"relative_error_{joint}"], [25.0], rtol=1e-12)
    np.testing.assert_allclose(metrics["k_sigma"], [-300.0, -120.0], rtol=1e-12)
    np.testing.assert_allclose(metrics["k_sigma_fixed_joints"], [-100.0, -40.0], rtol=1e-12)
    # All data sets are alike: which of them a replicate draws makes no difference.
    np.testing.assert_allclose(metrics["k_sigma_std_error"], 0.0, atol=1e-10)
    assert metrics["trustworthy"].all() and not metrics["nonpositive_share"].any()
    assert replicates["replicate"].tolist() == np.repeat(range(1, 11), 2).tolist()
    np.testing.assert_allclose(replicates["k_sigma"], np.tile([-300.0, -120.0], 10), rtol=1e-12)
