"""A plan as a whole: better than chance, within the cell, and judged on poses that it did not choose."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from analysed_robots import ROBOTS
from made_surveys import OPEN, PULL, made_candidates, made_survey

from elastocal.application.planning.cell import Cell
from elastocal.application.planning.plan import (
    REPEATED_POSES,
    REPEATS,
    Candidates,
    Loads,
    campaign_document,
    choose_plan,
    find_allowed_candidates,
    sheet,
    tour,
)
from elastocal.campaigns.campaign import Target
from elastocal.campaigns.reading import read_campaign
from elastocal.errors import InputError
from elastocal.mechanics.robot_file import robot_from_document
from elastocal_proof.blind.rehearsal import filled_sheet, hidden_robot


@pytest.fixture(scope="module")
def survey():
    return made_survey()


@pytest.fixture(scope="module")
def some(survey):
    return made_candidates(survey, 300)


@pytest.mark.parametrize("kind", ["D", pytest.param("A", marks=pytest.mark.slow), "I"])
def test_a_plan_is_better_than_random_designs(survey, some, kind):
    plan = choose_plan(survey, some, 16, 5, kind, 1)
    assert plan.accuracy_m[-1] < np.quantile(plan.random_m[:, -1], 0.5)
    assert 0.2 < plan.efficiency <= 1.0
    assert (np.diff(plan.accuracy_m) <= 1e-12).all()


def test_candidates_lie_within_the_limits_and_the_loads_pull_or_hang(survey, some):
    robot = survey.robot
    low, high = robot.joint_limits.T
    angles = robot.model_angles(some.joint_angles)
    assert (angles >= low).all() and (angles <= high).all()
    np.testing.assert_allclose(np.linalg.norm(some.force, axis=1), 100.0)
    hung = find_allowed_candidates(survey, OPEN, Loads(50.0, False), 20, 1)
    np.testing.assert_allclose(hung.force, np.tile([0, 0, -50.0], (20, 1)))
    assert Loads(0.0, False).shares == (0.0,) and PULL.shares == (0.0, 1.0, -1.0)


def test_a_tracker_inside_of_the_robot_is_refused(survey):
    inside = Cell((), np.array([0.0, 0.0, 0.13]), 0.02)
    with pytest.raises(InputError, match="sees the targets in none"):
        find_allowed_candidates(survey, inside, PULL, 50, 1)


def test_too_few_poses_are_refused_with_how_many_it_takes(survey, some):
    with pytest.raises(InputError, match="at least"):
        choose_plan(survey, some, 2, 5, "D", 1)
    with pytest.raises(InputError, match="more candidates"):
        choose_plan(survey, some, 298, 5, "D", 1)


def test_targets_that_no_joint_moves_are_refused(survey, some):
    document = {"name": "turntable", "chain": "Tz(d1) [elbow] Rz(q1) [tool0]", "lengths_m": {"d1": 0.4}}
    robot = robot_from_document(document)
    for target in (Target("foot", "elbow", (0.1, 0.0, 0.0)), Target("axis", "tool0", (0.0, 0.0, 0.0))):
        still = replace(survey, robot=robot, targets=(target,), shares=(0.0,), unknown_base=False)
        turns = Candidates(np.linspace(-1.0, 1.0, 60)[:, None], np.zeros((60, 3)))
        with pytest.raises(InputError, match="no joint moves"):
            choose_plan(still, turns, 16, 5, "D", 1)


def test_a_tour_is_no_longer_than_the_order_in_which_poses_were_drawn():
    angles = np.random.default_rng(3).random((15, 6))
    order = tour(angles, list(range(15)))

    def length(places):
        return np.abs(np.diff(angles[places], axis=0)).max(axis=1).sum()

    assert sorted(order) == list(range(15))
    assert length(order) < 0.8 * length(list(range(15)))
    assert tour(angles, [4, 2]) == [4, 2]


@pytest.fixture(scope="module")
def planned():
    """A survey, its plan and its sheet."""
    survey = made_survey()
    plan = choose_plan(survey, made_candidates(survey, 300), 14, 4, "D", 1)
    return survey, plan, sheet(survey, plan)


def test_each_state_of_each_pose_is_a_row_and_the_first_poses_are_repeated(planned):
    table = planned[2]
    assert len(table) == 3 * 18 + 2 * (REPEATS - 1) * REPEATED_POSES
    assert table[["x", "y", "z"]].isna().all().all() and "rx" not in table
    assert set(table.loc[table["repeat"] > 0, "pose"]) == set(range(1, REPEATED_POSES + 1))
    np.testing.assert_allclose(table.loc[table["load"] == 0, ["fx", "fy", "fz"]], 0.0)


def test_a_filled_sheet_is_a_campaign_that_holds_out_its_random_poses(planned, tmp_path):
    survey, plan, table = planned
    document = campaign_document("cell", "ur10", survey, plan)
    (tmp_path / "campaign.yaml").write_text(yaml.safe_dump(document))
    robot, _ = hidden_robot(ROBOTS / "ur10.yaml", 1, ["payload"])
    filled_sheet(table, document, robot, 1).to_csv(tmp_path / "measurements.csv", index=False)
    campaign = read_campaign(tmp_path, ROBOTS)
    assert campaign.holdout["poses"] == [15, 16, 17, 18]
    assert campaign.targets[0].offset_m is None
    assert len(np.unique(campaign.measurements.pose)) == 18
