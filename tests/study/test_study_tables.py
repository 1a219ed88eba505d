"""Tables about many studies: made-up studies, by hand."""

import numpy as np
import pandas as pd
import pytest
from made_studies import studies_of

from elastocal.study.printed import predict_scatter
from elastocal.study.study_tables import expectations_table, interpretations_table

PRINTED = pd.DataFrame(
    [
        ("3", "arm", "A", "c1", 23.0),
        ("4", "arm", "A", "k_sigma_20", 0.6),
        ("4", "arm", "A", "dev_20", 1.0),
        ("4", "arm", "A", "n_dev_2_um", 11),
        ("4", "other", "A", "dev_20", 1.0),
    ],
    columns=["table", "robot", "strategy", "quantity", "value"],
)
SHIFTED = {"as_configured": studies_of(), "R4_other": studies_of(biases=(40.0, 40.4, 40.9))}


def test_expectations_stand_beside_studies_and_the_paper():
    expected = studies_of(biases=(21.0,)).drop(columns="study").assign(noise_um=200.0)
    table = expectations_table(studies_of(), expected, PRINTED, 20, ["A", "B"])
    assert table.quantity.tolist() == ["k_sigma_20_percent", "k_sigma_20_percent_fixed_joints", "dev_20_um"]
    assert table.expected.tolist() == pytest.approx([1.05, 0.525, 1.05])
    assert table.studies_mean.tolist() == pytest.approx([1.1, 0.55, 1.1]) and set(table.studies) == {3}
    assert table.studies_std.tolist() == pytest.approx([0.1, 0.05, 0.1])
    # The paper's count is taken for that of the fixed joints.
    np.testing.assert_array_equal(table.paper, [np.nan, 0.6, 1.0])
    assert table.p_value[2] == pytest.approx(predict_scatter(studies_of(), "arm", "A", "dev_20", 20).p_value(1.0))


def test_an_interpretation_that_predicts_the_paper_worse_has_the_lower_likelihood():
    table = interpretations_table(SHIFTED, PRINTED, 20, "as_configured", "A").set_index("interpretation")
    assert table.index.tolist() == ["as_configured", "R4_other", "R10_all_joints"]
    usual, other = table.loc["as_configured"], table.loc["R4_other"]
    assert (usual.log_likelihood, usual.log_likelihood_std_error, usual.cells, usual.differ) == (0.0, 0.0, 4, 0)
    assert other.log_likelihood < -5 and other.differ > 0
    groups = ["log_likelihood_table_3", "log_likelihood_k_sigma", "log_likelihood_dev", "log_likelihood_lengths"]
    assert other[groups].sum() == pytest.approx(other.log_likelihood)
    by_hand = [
        predict_scatter(frame, "arm", "A", "dev_20", 20).log_density(1.0)
        for frame in (SHIFTED["R4_other"], SHIFTED["as_configured"])
    ]
    assert other.log_likelihood_dev == pytest.approx(by_hand[0] - by_hand[1])
    assert (usual.dev_20_um_arm, other.k_sigma_20_percent_arm) == pytest.approx((1.1, 121.3 / 60))


def test_the_other_count_of_joints_moves_k_sigma_alone():
    row = interpretations_table(SHIFTED, PRINTED, 20, "as_configured", "A").iloc[-1]
    assert row.log_likelihood_k_sigma != 0 and row.log_likelihood_dev == row.log_likelihood_table_3 == 0


def test_the_error_of_a_likelihood_is_the_jackknife_over_studies_of():
    found = interpretations_table(SHIFTED, PRINTED.iloc[2:3], 20, "as_configured", "A").iloc[1]
    left = []
    for number in (1, 2, 3):
        some = [frame[frame.study != number] for frame in (SHIFTED["R4_other"], SHIFTED["as_configured"])]
        densities = [predict_scatter(frame, "arm", "A", "dev_20", 20).log_density(1.0) for frame in some]
        left.append(densities[0] - densities[1])
    assert found.log_likelihood_std_error == pytest.approx(np.sqrt(2 / 3 * ((left - np.mean(left)) ** 2).sum()))
