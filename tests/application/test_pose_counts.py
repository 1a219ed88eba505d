"""One rule says before and after the measuring how many poses are enough."""

import pytest

from elastocal.application.pose_counts import count_needed_poses, warn_of_few_poses
from elastocal.diagnosis.settings import Settings


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_numbers_are_in_proportion_to_the_effective_parameters(factor):
    numbers = 300
    effective = factor * numbers / Settings().numbers_a_parameter
    assert count_needed_poses(20, numbers, effective) == 20 * factor
    warnings = warn_of_few_poses(20, numbers, 50, effective, ["position"])
    assert len(warnings) == (factor > 1.0)
    if warnings:
        assert "Measure about 40 poses" in warnings[0]


@pytest.mark.parametrize(
    ("kinds", "is_advised"),
    [
        (["position"], True),
        (["pose"], False),
        (["board"], False),
        (["point"], False),
        (["position", "plane"], False),
    ],
)
def test_orientations_are_advised_only_where_they_can_be_added(kinds, is_advised):
    (warning,) = warn_of_few_poses(20, 100, 50, 40.0, kinds)
    assert ("orientations too" in warning) == is_advised
    assert "or declare fewer errors" in warning
