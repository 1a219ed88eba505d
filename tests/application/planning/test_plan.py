"""A plan as a whole: better than chance, within the limits, and judged on poses that it
did not choose."""

from dataclasses import replace

import numpy as np
import pytest
from made_surveys import OPEN, make_candidates, make_survey

from elastocal.application.planning.plan import (
    Candidates,
    choose_plan,
    find_allowed_candidates,
)
from elastocal.campaigns.campaign import Target
from elastocal.errors import InputError
from elastocal.mechanics.robot_file import parse_robot


@pytest.fixture(scope="module")
def survey():
    return make_survey()


@pytest.fixture(scope="module")
def candidates(survey):
    return make_candidates(survey, 300)


def test_a_plan_is_better_than_random_designs(survey, candidates):
    plan = choose_plan(survey, candidates, 16, 5, 1)
    assert plan.accuracy_m[-1] < np.quantile(plan.random_m[:, -1], 0.5)
    assert (np.diff(plan.accuracy_m) <= 1e-12).all()


def test_no_fitted_pose_is_held_out(survey, candidates):
    plan = choose_plan(survey, candidates.select(np.arange(21)), 16, 5, 1)
    poses = np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles])
    assert len(np.unique(poses, axis=0)) == 21


@pytest.mark.parametrize(
    ("poses", "message"), [(2, "at least"), (298, "more candidates")]
)
def test_too_few_poses_or_candidates_are_refused(survey, candidates, poses, message):
    with pytest.raises(InputError, match=message):
        choose_plan(survey, candidates, poses, 5, 1)


def test_candidates_lie_within_the_limits_and_the_loads_pull_or_hang(
    survey, candidates
):
    low, high = survey.robot.joint_limits.T
    angles = survey.robot.model_angles(candidates.joint_angles)
    assert (angles >= low).all() and (angles <= high).all()
    np.testing.assert_allclose(np.linalg.norm(candidates.force, axis=1), 100.0)
    hanging = replace(survey, force_N=50.0, pulled=False)
    force = find_allowed_candidates(hanging, OPEN, 20, 1).force
    np.testing.assert_allclose(force, np.tile([0, 0, -50.0], (20, 1)), atol=1e-9)


@pytest.mark.parametrize(
    "target",
    [
        Target("foot", "elbow", (0.1, 0.0, 0.0)),
        Target("axis", "tool0", (0.0, 0.0, 0.0)),
    ],
)
def test_targets_that_no_joint_moves_are_refused(survey, target):
    robot = parse_robot(
        {
            "name": "t",
            "chain": "Tz(d1) [elbow] Rz(q1) [tool0]",
            "lengths_m": {"d1": 0.4},
        }
    )
    survey = replace(
        survey, robot=robot, targets=(target,), force_N=0.0, unknown_base=False
    )
    angles = np.linspace(-1.0, 1.0, 60)[:, None]
    with pytest.raises(InputError, match="no joint moves"):
        choose_plan(survey, Candidates(angles, np.zeros((60, 3))), 16, 5, 1)
