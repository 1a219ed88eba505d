"""The sheet of a plan has a row for each measurement that is to be made."""

import numpy as np
from made_surveys import make_candidates, make_survey

from elastocal.application.planning.plan import choose_plan
from elastocal.application.planning.sheet import (
    REPEATED_POSES,
    REPEATS,
    build_campaign_document,
    build_sheet,
)


def test_the_first_poses_are_repeated_and_nothing_is_measured_yet():
    survey = make_survey()
    plan = choose_plan(survey, make_candidates(survey, 300), 16, 5, 1)
    sheet = build_sheet(survey, plan)
    assert len(sheet) == 3 * 21 + 2 * (REPEATS - 1) * REPEATED_POSES
    assert sheet[["x", "y", "z"]].isna().all().all() and "rx" not in sheet
    repeated = set(sheet.loc[sheet["repeat"] > 0, "pose"])
    assert repeated == set(range(1, REPEATED_POSES + 1))
    unloaded = sheet.loc[sheet["load"] == 0, ["fx", "fy", "fz"]]
    np.testing.assert_allclose(unloaded, 0.0)
    document = build_campaign_document("cell", "robot.yaml", survey, plan)
    assert document["holdout"] == {"poses": [17, 18, 19, 20, 21]}
