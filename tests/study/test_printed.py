"""How printed figures lie among studies, against Student's distribution by hand and statsmodels."""

import numpy as np
import pytest
from made_studies import studies_of
from scipy import stats
from statsmodels.api import OLS
from statsmodels.stats.multitest import multipletests

from elastocal.study.printed import Predicted, holm, predict_scatter

VALUES = np.array([1.0, 1.2, 0.8, 1.1, 0.9])


def test_a_p_value_is_that_of_one_more_study():
    """By regression: a dummy of its own takes up the study that is judged (statsmodels)."""
    dummy = np.append(np.zeros(5), 1.0)
    fitted = OLS(np.append(VALUES, 1.5), np.column_stack([np.ones(6), dummy])).fit()
    assert Predicted(VALUES, False, 0.0).p_value(1.5) == pytest.approx(fitted.pvalues[1], rel=1e-9)
    assert Predicted(VALUES, False, 0.0).p_value(float(VALUES.mean())) == pytest.approx(1.0)


def test_p_values_of_further_studies_are_uniform():
    """2,000 of them: the share below a tenth has a standard error of 0.7 %."""
    rng = np.random.default_rng(3)
    drawn = rng.standard_normal((2000, 17))
    found = np.array([Predicted(row[:-1], False, 0.0).p_value(row[-1]) for row in drawn])
    assert (found < 0.1).mean() == pytest.approx(0.1, abs=0.025)
    assert stats.kstest(found, "uniform").pvalue > 0.001


def test_a_density_is_one_in_all_and_a_rounded_figure_is_less_certain():
    sharp, rounded = Predicted(VALUES, False, 0.0), Predicted(VALUES, False, 2.0)
    grid = np.arange(-10, 10, 0.04)
    assert np.exp([sharp.log_density(x) for x in grid]).sum() * 0.04 == pytest.approx(1.0, abs=0.01)
    assert rounded.p_value(1.5) > sharp.p_value(1.5)


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
