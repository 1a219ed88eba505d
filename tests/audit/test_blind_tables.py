"""Rates of the blind proof by quantiles of the beta distribution."""

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from elastocal.audit.blind_tables import share


@pytest.mark.parametrize(("hits", "cases"), [(0, 5), (3, 7), (5, 5), (1, 200)])
def test_a_share_has_the_interval_of_clopper_and_pearson(hits, cases):
    found = share([True] * hits + [False] * (cases - hits))
    low, high = proportion_confint(hits, cases, 0.05, "beta")
    assert (found["hits"], found["cases"], found["rate"]) == (hits, cases, hits / cases)
    np.testing.assert_allclose([found["low"], found["high"]], np.nan_to_num([low, high]), atol=1e-12)


def test_no_case_says_nothing():
    found = share([])
    assert np.isnan(found["rate"]) and (found["low"], found["high"]) == (0.0, 1.0)
