"""The sheet that is filled in: its rows, and a campaign that the reader takes once it is filled."""

import numpy as np
import pytest
import yaml
from analysed_robots import ROBOTS
from made_surveys import made_candidates, made_survey

from elastocal.application.planning.plan import choose_plan
from elastocal.application.planning.sheet import REPEATED_POSES, REPEATS, campaign_document, sheet
from elastocal.campaigns.reading import read_campaign
from elastocal_proof.blind.rehearsal import filled_sheet, hidden_robot


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
