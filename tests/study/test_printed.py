"""How printed figures lie among studies, against Student's distribution by hand and
statsmodels."""

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


def test_a_p_value_is_that_of_one_more_study():
    """By regression: a dummy of its own takes up the study that is judged
    (statsmodels)."""
    dummy = np.append(np.zeros(5), 1.0)
    fitted = OLS(np.append(VALUES, 1.5), np.column_stack([np.ones(6), dummy])).fit()
    assert StudyScatter(VALUES, False, 0.0).p_value(1.5) == pytest.approx(
        fitted.pvalues[1], rel=1e-9
    )
    assert StudyScatter(VALUES, False, 0.0).p_value(
        float(VALUES.mean())
    ) == pytest.approx(1.0)
    # A rounded figure is less certain.
    assert StudyScatter(VALUES, False, 2.0).p_value(1.5) > StudyScatter(
        VALUES, False, 0.0
    ).p_value(1.5)


def test_the_figures_of_tables_3_and_4_are_found_with_their_units():
    frame = studies_of()
    expected = {"c1": 22.0, "k_sigma_20": 0.55, "dev_20": 1.1}
    for quantity, mean in expected.items():
        assert predict_scatter(frame, "arm", "A", quantity, 20).mean == pytest.approx(
            mean
        )
    assert predict_scatter(
        frame, "arm", "A", "k_sigma_20", 20, fixed_joints=False
    ).mean == pytest.approx(1.1)
    lengths = predict_scatter(frame, "arm", "A", "n_dev_2_um", 20)
    assert lengths.logarithmic and lengths.mean == pytest.approx(
        (10 * 11 * 12) ** (1 / 3)
    )
    # In configurations, as far as a logarithm is straight.
    assert lengths.std == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(
    ("robot", "strategy", "quantity"),
    [("other", "A", "c1"), ("arm", "B", "c1"), ("arm", "A", "ratio")],
)
def test_what_the_studies_do_not_have_is_not_predicted(robot, strategy, quantity):
    assert predict_scatter(studies_of(), robot, strategy, quantity, 20) is None


def test_holm_corrects_for_those_that_are_there():
    p_values = np.random.default_rng(1).random(9) ** 4
    expected = np.append(multipletests(p_values, method="holm")[1], np.nan)
    np.testing.assert_allclose(
        correct_by_holm(np.append(p_values, np.nan)), expected, rtol=1e-12
    )
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
    fixed, whole = build_joint_table(
        studies_of(biases=BIASES), print_figures(0.5 * 22 / 20, 22 / 20), 20
    ).to_dict("records")
    assert fixed["cells"] == 2 and fixed["below"] == 0 and fixed["studies"] == 8
    assert fixed["statistic_p"] > 0.3 and fixed["below_p"] == 1.0
    assert whole["below"] == 1 and whole["statistic_p"] == pytest.approx(1 / 9)


def test_the_p_value_is_a_rank_and_no_smaller_than_one_over_the_studies():
    (fixed, _) = build_joint_table(
        studies_of(biases=BIASES), print_figures(5.0, 5.0), 20
    ).to_dict("records")
    assert fixed["below"] == fixed["differ"] == 2 and fixed[
        "statistic_p"
    ] == pytest.approx(1 / 9)
    assert (
        fixed["statistic"]
        > fixed["statistic_studies_largest"]
        >= fixed["statistic_studies_median"]
    )
    assert np.isfinite(fixed["statistic"])
