"""P values by the incomplete beta function against scipy's Student distribution and statsmodels' corrections."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student
from statsmodels.stats.multitest import multipletests

from elastocal.audit.paper_figures import further_one, reached, stepped_down


@pytest.mark.parametrize("printed", [0.9, 2.0, 7.0])
def test_a_further_study_is_as_far_out_as_student_says(printed):
    values = np.array([1.0, 2.0, 2.5, 4.0])
    scale = np.sqrt(values.var(ddof=1) * 1.25 + 0.3**2 / 12)
    expected = 2 * student.sf(abs(printed - values.mean()) / scale, 3)
    assert further_one(values, printed, 0.3) == pytest.approx(expected, rel=1e-12)


def test_one_study_tells_nothing_of_a_further_one():
    assert np.isnan(further_one(np.array([1.0]), 1.0, 0.0))


def test_corrected_p_values_are_those_of_statsmodels_and_keep_their_places():
    p_values = pd.Series([0.04, np.nan, 0.001, 0.5, 0.012, 0.012])
    expected = np.full(6, np.nan)
    expected[p_values.notna()] = multipletests(p_values.dropna(), method="holm")[1]
    np.testing.assert_allclose(stepped_down(p_values), expected)


@pytest.mark.parametrize(("limit", "length"), [(2.0, 3.0), (0.5, 8.0), (9.0, 1.0)])
def test_a_limit_that_is_not_reached_is_continued_as_one_over_the_length(limit, length):
    assert reached(np.array([8.0, -4.0, -2.0, 1.0]), limit) == length
