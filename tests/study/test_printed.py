"""How printed figures lie among studies, against Student's distribution by hand and statsmodels."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_metrics import metrics_of, replicates_of
from made_studies import studies_of
from statsmodels.api import OLS
from statsmodels.stats.multitest import multipletests

from elastocal.study.printed import OurResults, Predicted, beside_paper, comparison_table, holm, joint_table, predict_scatter
from elastocal.study.tables import table4

VALUES = np.array([1.0, 1.2, 0.8, 1.1, 0.9])


def test_a_p_value_is_that_of_one_more_study():
    """By regression: a dummy of its own takes up the study that is judged (statsmodels)."""
    dummy = np.append(np.zeros(5), 1.0)
    fitted = OLS(np.append(VALUES, 1.5), np.column_stack([np.ones(6), dummy])).fit()
    assert Predicted(VALUES, False, 0.0).p_value(1.5) == pytest.approx(fitted.pvalues[1], rel=1e-9)
    assert Predicted(VALUES, False, 0.0).p_value(float(VALUES.mean())) == pytest.approx(1.0)


def test_a_rounded_figure_is_less_certain():
    assert Predicted(VALUES, False, 2.0).p_value(1.5) > Predicted(VALUES, False, 0.0).p_value(1.5)


def test_the_figures_of_tables_3_and_4_are_found_with_their_units():
    frame = studies_of()
    expected = {"c1": 22.0, "k_sigma_20": 0.55, "dev_20": 1.1}
    for quantity, mean in expected.items():
        assert predict_scatter(frame, "arm", "A", quantity, 20).mean == pytest.approx(mean)
    assert predict_scatter(frame, "arm", "A", "k_sigma_20", 20, fixed_joints=False).mean == pytest.approx(1.1)
    lengths = predict_scatter(frame, "arm", "A", "n_dev_2_um", 20)
    assert lengths.logarithmic and lengths.mean == pytest.approx((10 * 11 * 12) ** (1 / 3))
    # In configurations, as far as a logarithm is straight.
    assert lengths.std == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(("robot", "strategy", "quantity"), [("other", "A", "c1"), ("arm", "B", "c1"), ("arm", "A", "ratio")])
def test_what_the_studies_do_not_have_is_not_predicted(robot, strategy, quantity):
    assert predict_scatter(studies_of(), robot, strategy, quantity, 20) is None


def test_holm_corrects_for_those_that_are_there():
    p_values = np.random.default_rng(1).random(9) ** 4
    expected = np.append(multipletests(p_values, method="holm")[1], np.nan)
    np.testing.assert_allclose(holm(np.append(p_values, np.nan)), expected, rtol=1e-12)
    assert np.isnan(holm(np.array([np.nan]))).all()


BIASES = tuple(20.0 + 0.5 * k for k in range(8))


def print_figures(k_sigma, dev):
    rows = [("4", "arm", "A", "k_sigma_20", k_sigma), ("4", "arm", "A", "dev_20", dev), ("2", "arm", "", "deviation_mean", 1.0)]
    return pd.DataFrame(rows, columns=["table", "robot", "strategy", "quantity", "value"])


def test_a_paper_like_the_studies_lies_among_them():
    # k_sigma over the fixed joints is half of that over all.
    fixed, whole = joint_table(studies_of(biases=BIASES), print_figures(0.5 * 22 / 20, 22 / 20), 20).to_dict("records")
    assert fixed["cells"] == 2 and fixed["below"] == 0 and fixed["studies"] == 8
    assert fixed["statistic_p"] > 0.3 and fixed["below_p"] == 1.0
    assert whole["below"] == 1 and whole["statistic_p"] == pytest.approx(1 / 9)


def test_the_p_value_is_a_rank_and_no_smaller_than_one_over_the_studies():
    (fixed, _) = joint_table(studies_of(biases=BIASES), print_figures(5.0, 5.0), 20).to_dict("records")
    assert fixed["below"] == fixed["differ"] == 2 and fixed["statistic_p"] == pytest.approx(1 / 9)
    assert fixed["statistic"] > fixed["statistic_studies_largest"] >= fixed["statistic_studies_median"]
    assert np.isfinite(fixed["statistic"])


PRINTED = ["table", "robot", "strategy", "quantity", "unit", "value"]


def ours(metrics, replicates):
    columns = {"robot": ["arm"], "mean_mm": [1.0], "mean_mm_std_error": [0.1]}
    staged = table4(metrics, replicates, ["arm"], ["A"], 200.0, 20, 1.0, 2.0)
    empty = pd.DataFrame({"strategy": [], "residual_mean_um": [], "share_compensated_percent": []})
    tables = {
        "table1": pd.DataFrame({"robot": ["arm"], "compliance_1_urad_per_Nm": [0.54]}),
        "table2": pd.DataFrame(columns),
        "table3": pd.DataFrame(
            {"robot": ["arm"], "compliance_1_urad_per_Nm": [0.53], "compliance_1_urad_per_Nm_std_error": [0.01]}
        ),
        "table4": staged,
        "extended": empty,
    }
    return OurResults(tables, metrics, replicates, 200.0, 20)


def judged(beside):
    """Among further studies, and single data sets with deviations of 0.90, 0.91 ... 1.10 mm."""
    initial = pd.DataFrame({"mean": np.linspace(0.9e-3, 1.1e-3, 21), "maximum": np.linspace(3e-3, 4e-3, 21)})
    initial["mean_square"] = 2 * initial["mean"] ** 2
    return comparison_table(beside, studies_of(), {"arm": initial, "kuka_extended": initial}, 20)


def test_comparison_has_a_row_for_each_printed_figure_and_scores_the_difference():
    reference = pd.DataFrame(
        [
            ("1", "arm", "", "c1", "um_per_N", 0.6),
            ("2", "arm", "", "deviation_mean", "mm", 0.8),
            ("3", "arm", "6DoF", "c1", "um_per_N", 0.54),
            ("4", "arm", "A", "k_sigma_20", "percent", 1.5),
            ("4", "arm", "A", "dev_20", "um", 1.0),
            ("4", "other", "A", "dev_20", "um", 1.0),
            ("text", "arm", "", "residual_deviation_upper_bound", "um", 366.0),
        ],
        columns=["table", "robot", "strategy", "quantity", "unit", "value"],
    )
    table = judged(beside_paper(reference, ours(metrics_of("A", 40.0), replicates_of("A", 40.0))))
    assert (
        table[["table", "robot", "strategy", "quantity", "unit", "paper"]].to_numpy().tolist() == reference.to_numpy().tolist()
    )
    assert table.ours[[0, 1, 2, 3, 4]].tolist() == pytest.approx([0.54, 1.0, 0.53, 1.0, 2.0])
    assert table.z[[1, 2, 3, 4]].tolist() == pytest.approx([2.0, -1.0, -1.0, 1.0])
    assert table.interpretation[0] == "R1: an input" and table.interpretation[3] == "R7, R10: joints fixed in the last stage"
    # Below all 21 single data sets but none; among the studies of `studies_of`, which have half of 1.1 %.
    assert table.studies_mean[[1, 3, 4]].tolist() == pytest.approx([1.0, 0.55, 1.1])
    assert table.p_value[1] == pytest.approx(2 / 22) and table.p_value[4] > table.p_value[3]
    assert (
        (table.p_holm >= table.p_value)[[3, 4]].all()
        and table.p_holm[[0, 1, 2, 5, 6]].isna().all()
        and table.p_value[[0, 2, 5, 6]].isna().all()
    )
    assert table.ours[[5, 6]].isna().all() and table.z[[0, 5, 6]].isna().all()


def compare(results, *printed):
    return judged(beside_paper(pd.DataFrame([printed], columns=PRINTED), results)).iloc[0]


@pytest.fixture
def results():
    return ours(metrics_of("A", 40.0), replicates_of("A", 40.0))


def add_extended(results):
    extended = {
        "strategy": ["3+6DoF comb", "6DoF", "6DoF after 3DoF"],
        "residual_mean_um": [310.0, 350.0, 290.0],
        "residual_mean_um_std_error": [1.0, 4.0, 2.0],
        "share_compensated_percent": [91.0, 90.0, 92.0],
        "share_compensated_percent_std_error": [0.1, 0.5, 0.2],
    }
    return replace(results, tables=results.tables | {"extended": pd.DataFrame(extended)})


def test_figures_of_the_text_stand_beside_the_largest_left_by_any_strategy_and_the_shares_compensated(results):
    results = replace(
        add_extended(results), metrics=metrics_of("6DoF", 400.0, "kuka"), replicates=replicates_of("6DoF", 400.0, "kuka")
    )
    # 400 / 20 = 20 um of 1 mm; replicates of 18, 20 and 22 um.
    expected = {
        "residual_deviation_upper_bound": (366.0, 350.0, 4.0),
        "share_compensated_with_link_elasticity": (91.0, 90.0, 0.5),
        "share_compensated_joint_elasticity_only": (97.6, 98.0, 0.2),
    }
    for quantity, (printed, value, spread) in expected.items():
        row = compare(results, "text", "", "", quantity, "", printed)
        assert (row.ours, row.mc_std, row.z) == pytest.approx((value, spread, (value - printed) / spread)), quantity


def test_the_smallest_ratio_is_of_the_robot_that_gains_least_from_its_best_strategy(results):
    biases = {("arm", "6DoF"): 40.0, ("arm", "A"): 20.0, ("arm", "B"): 30.0}
    biases |= {("other", "6DoF"): 40.0, ("other", "A"): 36.0, ("other", "B"): 25.0}
    metrics = pd.concat([metrics_of(strategy, bias, robot) for (robot, strategy), bias in biases.items()])
    spreads = {name: (0.1, 0.0, -0.1) if name[1] == "B" else (-0.1, 0.0, 0.1) for name in biases}
    replicates = pd.concat(
        [replicates_of(strategy, bias, robot, spreads[robot, strategy]) for (robot, strategy), bias in biases.items()]
    )
    table = table4(metrics, replicates, ["arm", "other"], ["6DoF", "A", "B"], 200.0, 20, 1.0, 2.0)
    results = replace(results, tables=results.tables | {"table4": table}, metrics=metrics, replicates=replicates)
    row = compare(results, "text", "", "", "best_over_6DoF_dev_ratio_min", "", 1.5)
    # 40 / 20 for the arm by A, 40 / 25 for the other one by B.
    assert row.ours == pytest.approx(1.6)
    assert row.mc_std == pytest.approx(np.std([1.6 * 0.9 / 1.1, 1.6, 1.6 * 1.1 / 0.9], ddof=1))
