"""Changes of a plan are compared in the same sense of accuracy."""

from dataclasses import replace

import pytest
from made_surveys import make_candidates, make_survey

from elastocal.application.planning.improvements import compare_improvements
from elastocal.campaigns.campaign import Target

REFLECTORS = "three reflectors on 6DoF, 0.1 m apart"
PLAIN = replace(make_survey(), force_N=0.0)


def compare(survey):
    candidates = make_candidates(survey, 120)
    return compare_improvements(
        survey, candidates.select(slice(20)), candidates.select(slice(20, 120))
    )


@pytest.mark.parametrize("offset_m", [None, (0.0, 0.0, 0.1)])
def test_every_change_makes_the_robot_more_accurate(offset_m):
    survey = replace(PLAIN, targets=(Target("T", "6DoF", offset_m, offset_std_m=2e-4),))
    accuracy_m = compare(survey)
    assert {REFLECTORS, "orientations beside positions", "twice as many poses"} == (
        accuracy_m.keys() - {""}
    )
    now_m = accuracy_m.pop("")
    assert all(error_m < now_m for error_m in accuracy_m.values())


def test_more_poses_help_little_if_the_tool_is_badly_known():
    """Its offset is the same in all poses."""
    known = Target("T", "6DoF", (0.0, 0.0, 0.1), offset_std_m=2e-4)
    accuracy_m = compare(replace(PLAIN, targets=(known,)))
    assert accuracy_m["twice as many poses"] > 0.9 * accuracy_m[""]
    assert accuracy_m[REFLECTORS] < 0.8 * accuracy_m[""]


def test_only_what_is_missing_is_compared():
    survey = make_survey(measured="pose")
    targets = tuple(Target(name, "6DoF", (0.0, 0.0, 0.1)) for name in "AB")
    assert set(compare(replace(survey, targets=targets))) == {"", "twice as many poses"}
