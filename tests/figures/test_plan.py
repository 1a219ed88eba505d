"""The picture of a plan names what is in it."""

import numpy as np
from drawn_figures import legend_entries
from made_surveys import OPEN, made_candidates, made_survey

from elastocal.application.planning.cell import Cell
from elastocal.application.planning.plan import choose_plan
from elastocal.figures.plan import plan_picture, pose_pictures


def test_views_show_boxes_tracker_and_both_kinds_of_poses():
    survey = made_survey()
    plan = choose_plan(survey, made_candidates(survey, 300), 14, 4, "D", 1)
    cell = Cell((np.array([[1.0, 2.0], [0.0, 1.0], [0.0, 1.0]]),), np.array([3.0, 1.0, 1.0]), 0.1)
    figure = plan_picture(survey.robot, cell, plan)
    assert [axis.get_title() for axis in figure.axes] == ["from above", "from the side", "what each pose is worth"]
    labels = legend_entries(figure)
    assert labels == ["to fit", "held out", "kept out of", "tracker", "base"]
    bare = plan_picture(survey.robot, OPEN, plan)
    assert legend_entries(bare) == ["to fit", "held out", "base"]
    last = figure.axes[2].lines[-1].get_ydata()[-1]
    np.testing.assert_allclose(last, 1e3 * plan.accuracy_m[-1])


def test_every_pose_has_a_picture_with_its_number_and_pages_are_full():
    survey = made_survey()
    plan = choose_plan(survey, made_candidates(survey, 300), 55, 4, "D", 1)
    pages = pose_pictures(survey.robot, plan)
    titles = [axis.get_title(loc="left") for page in pages for axis in page.axes if axis.get_title(loc="left")]
    assert titles == [*(str(pose) for pose in range(1, 56)), *(f"{pose} held out" for pose in range(56, 60))]
    assert len(pages) == 2
