"""How printed figures lie among studies, against Student's distribution by hand and
statsmodels."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_studies import studies_of
from statsmodels.api import OLS
from statsmodels.stats.multitest import multipletests

from elastocal.study.printed import (
    StudyScatter,
    build_joint_table,
    correct_by_holm,
    predict_scatter,
)

VALUES = np.array([1.0, 1.2, 0.8, 1.1, 0.9])


def figure_of(quantity, robot="arm", strategy="A"):
    return SimpleNamespace(robot=robot, strategy=strategy, quantity=quantity)


def test_a_p_value_is_that_of_one_more_study():
    """By regression (statsmodels): a dummy variable absorbs the study that is judged."""
    dummy = np.append(np.zeros(5), 1.0)
    regressors = np.column_stack([np.ones(6), dummy])
    fitted = OLS(np.append(VALUES, 1.5), regressors).fit()
    exact = StudyScatter(VALUES, logarithmic=False, digit=0.0)
    assert exact.compute_p_value(1.5) == pytest.approx(fitted.pvalues[1], rel=1e-9)
    assert exact.compute_p_value(float(VALUES.mean())) == pytest.approx(1.0)
    # A rounded figure is less certain.
    rounded = StudyScatter(VALUES, logarithmic=False, digit=2.0)
    assert rounded.compute_p_value(1.5) > exact.compute_p_value(1.5)


def test_the_figures_of_tables_3_and_4_have_their_units():
    studies = studies_of()
    expected = {"c1": 22.0, "k_sigma_20": 0.55, "dev_20": 1.1}
    for quantity, mean in expected.items():
        scatter = predict_scatter(studies, figure_of(quantity), 20)
        assert scatter.mean == pytest.approx(mean)
    all_joints = predict_scatter(
        studies, figure_of("k_sigma_20"), 20, fixed_joints=False
    )
    assert all_joints.mean == pytest.approx(1.1)
    lengths = predict_scatter(studies, figure_of("n_dev_2_um"), 20)
    geometric_mean = (10 * 11 * 12) ** (1 / 3)
    assert lengths.logarithmic and lengths.mean == pytest.approx(geometric_mean)
    # In configurations; the tolerance is the curvature of the logarithm.
    assert lengths.std == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(
    ("robot", "strategy", "quantity"),
    [("other", "A", "c1"), ("arm", "B", "c1"), ("arm", "A", "ratio")],
)
def test_figures_that_the_studies_lack_are_not_predicted(robot, strategy, quantity):
    figure = figure_of(quantity, robot, strategy)
    assert predict_scatter(studies_of(), figure, 20) is None


def test_holm_corrects_for_the_number_of_p_values_that_exist():
    p_values = np.random.default_rng(1).random(9) ** 4
    expected = np.append(multipletests(p_values, method="holm")[1], np.nan)
    corrected = correct_by_holm(np.append(p_values, np.nan))
    np.testing.assert_allclose(corrected, expected, rtol=1e-12)
    assert np.isnan(correct_by_holm(np.array([np.nan]))).all()


BIASES = tuple(20.0 + 0.5 * k for k in range(8))


def print_figures(k_sigma, dev):
    rows = [
        ("4", "arm", "A", "k_sigma_20", k_sigma),
        ("4", "arm", "A", "dev_20", dev),
        ("2", "arm", "", "deviation_mean", 1.0),
    ]
    return pd.DataFrame(
        rows, columns=["table", "robot", "strategy", "quantity", "value"]
    )


def test_a_paper_like_the_studies_lies_among_them():
    # k_sigma over the fixed joints is half of that over all.
    printed = print_figures(0.5 * 22 / 20, 22 / 20)
    table = build_joint_table(studies_of(biases=BIASES), printed, 20)
    fixed_joints, all_joints = table.to_dict("records")
    assert fixed_joints["cells"] == 2
    assert fixed_joints["below"] == 0
    assert fixed_joints["studies"] == 8
    assert fixed_joints["statistic_p"] > 0.3
    assert fixed_joints["below_p"] == 1.0
    assert all_joints["below"] == 1
    assert all_joints["statistic_p"] == pytest.approx(1 / 9)


def test_the_p_value_is_a_rank_and_at_least_one_over_the_number_of_studies():
    table = build_joint_table(studies_of(biases=BIASES), print_figures(5.0, 5.0), 20)
    fixed_joints, _ = table.to_dict("records")
    assert fixed_joints["below"] == fixed_joints["differ"] == 2
    assert fixed_joints["statistic_p"] == pytest.approx(1 / 9)
    largest = fixed_joints["statistic_studies_largest"]
    assert fixed_joints["statistic"] > largest
    assert largest >= fixed_joints["statistic_studies_median"]
    assert np.isfinite(fixed_joints["statistic"])
