"""Pass, fail or undecided by the robots that a fit leaves possible."""

import numpy as np
import pytest

from elastocal.validation.conformity import FAIL, PASS, UNDECIDED, predicted_conformity


@pytest.mark.parametrize(("tolerance", "decision"), [(1.3e-4, PASS), (0.7e-4, FAIL), (1e-4, UNDECIDED)])
def test_a_prediction_is_decided_by_the_robots_that_it_leaves_possible(tolerance, decision):
    rms = 1e-4 * (1.0 + 0.1 * np.random.default_rng(1).standard_normal(4000))
    found = predicted_conformity(rms, 30, tolerance, 0.05)
    assert found.decision == decision and found.poses == 30
    assert found.limit_m == pytest.approx(1e-4 * (1.0 + 0.1 * 1.645), rel=0.01)
    assert found.risk_above == pytest.approx((rms > tolerance).mean(), abs=1e-3)
