"""Compliances that no robot has are named with their standard errors, and no others."""

import numpy as np
import pytest

from elastocal.data_checks.compliance_check import MOST_OFF_NOMINAL, MOST_OFF_USUAL, compliance_warnings

NOMINAL = 1e-6 * np.array([0.5, 1.0, 2.0])
ERROR = 0.02 * NOMINAL


@pytest.mark.parametrize("factor", [1 / (0.99 * MOST_OFF_NOMINAL), 0.5, 1.0, 2.0, 0.99 * MOST_OFF_NOMINAL])
def test_what_robots_have_is_no_warning(factor):
    assert compliance_warnings(factor * NOMINAL, ERROR, NOMINAL) == []


@pytest.mark.parametrize(
    ("factor", "words"),
    [(-1.0, "negative, nominal 1"), (9.8, "9.8 times nominal"), (1000.0, "1e+03 times"), (0.1, "0.1 times")],
)
def test_what_no_robot_has_is_named_with_its_standard_error(factor, words):
    (warning,) = compliance_warnings(NOMINAL * [1.0, factor, 1.0], ERROR, NOMINAL)
    assert "joint 2" in warning and words in warning and "± 0.02" in warning
    assert f"{factor:.3g} ±" in warning
    assert "joint 1" not in warning and "joint 3" not in warning and "by chance" not in warning


def test_beside_usual_values_only_what_is_off_by_orders_of_magnitude_is_named():
    assert compliance_warnings(0.9 * MOST_OFF_USUAL * NOMINAL, ERROR, NOMINAL, known=False) == []
    (warning,) = compliance_warnings(NOMINAL * [1.0, 1000.0, 1.0], ERROR, NOMINAL, known=False)
    assert "1e+03 times usual for such a robot" in warning
    (warning,) = compliance_warnings(NOMINAL * [1.0, -1.0, 1.0], ERROR, NOMINAL, known=False)
    assert "negative, usual for such a robot 1" in warning
