"""Pictures of arms, from the side and a little from above, show the values of their
tables and plans."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from drawn_figures import legend_entries
from made_loop_tables import CAMPAIGNS
from made_surveys import OPEN, make_candidates, make_survey

from elastocal.application.planning.cell import Cell
from elastocal.application.planning.plan import choose_plan
from elastocal.figures.arms import (
    draw_arm_with_errors,
    draw_plan,
    draw_poses,
    project_view,
)
from elastocal.verdict import ErrorSummary


@pytest.fixture
def table():
    rng = np.random.default_rng(1)
    columns = {f"q{joint}": rng.uniform(-1, 1, 12) for joint in range(1, 7)}
    columns |= {
        f"{stage}_d{axis}": size * rng.standard_normal(12)
        for stage, size in (("before", 1e-3), ("after", 1e-4))
        for axis in "xyz"
    }
    return (
        columns
        | {axis: rng.uniform(-2, 2, 12) for axis in "xyz"}
        | {"held_out": np.arange(12) % 3 == 0}
    )


def test_each_panel_has_its_errors_and_their_rms(table):
    heldout = replace(
        CAMPAIGNS["named"].heldout,
        before=ErrorSummary(1e-3, 1.23e-3, 2e-3, 3e-3),
        after=ErrorSummary(1e-4, 0.12e-3, 2e-4, 3e-4),
        poses=4,
        noise_floor_rms_m=0.105e-3,
    )
    figure = draw_arm_with_errors(analysed("kuka"), table, heldout)
    assert [axis.get_title(loc="left") for axis in figure.axes] == [
        "1.23 mm",
        "0.12 mm",
    ]
    for axis, stage in zip(figure.axes, ("before", "after"), strict=True):
        (arrows,) = [quiver for quiver in axis.collections if quiver.get_gid() == stage]
        errors = np.column_stack(
            [table[f"{stage}_d{component}"] for component in "xyz"]
        )[::3]
        drawn = np.column_stack([arrows.U, arrows.V])
        times = np.linalg.norm(drawn) / np.linalg.norm(project_view(errors))
        np.testing.assert_allclose(drawn, times * project_view(errors), atol=1e-12)
        assert times == pytest.approx(400)
    assert (
        "4 held-out poses" in figure.get_supxlabel()
        and "400 times" in figure.get_supxlabel()
    )


def test_the_arm_is_drawn_at_the_angles_of_the_chain(table):
    """The residuals table has angles of the chain, not those that the controller
    reports."""
    robot = analysed("kuka")
    turned = replace(robot, reported_offset=np.full(6, 0.5))
    lines = [
        draw_arm_with_errors(arm, table, CAMPAIGNS["named"].heldout).axes[0].lines
        for arm in (robot, turned)
    ]
    for line, of_turned in zip(*lines, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), of_turned.get_xydata())


def test_views_show_boxes_tracker_and_both_kinds_of_poses():
    survey = make_survey()
    plan = choose_plan(survey, make_candidates(survey, 300), 14, 4, 1)
    cell = Cell(
        (np.array([[1.0, 2.0], [0.0, 1.0], [0.0, 1.0]]),),
        np.array([3.0, 1.0, 1.0]),
        0.1,
    )
    figure = draw_plan(survey.robot, cell, plan)
    assert [axis.get_title() for axis in figure.axes] == [
        "from above",
        "from the side",
        "predicted accuracy",
    ]
    labels = legend_entries(figure)
    curves = ["random poses, median and 5 to 95 %", "this plan"]
    assert labels == ["to fit", "held out", "excluded", "tracker", "base", *curves]
    bare = draw_plan(survey.robot, OPEN, plan)
    assert legend_entries(bare) == ["to fit", "held out", "base", *curves]
    places = {"left": np.array([0.4, 0.1, 0.0]), "right": np.array([0.4, -0.1, 0.0])}
    without_tracker = draw_plan(survey.robot, OPEN, plan, places)
    labels = legend_entries(without_tracker)
    assert labels == ["to fit", "held out", "left", "right", "base", *curves]
    last = figure.axes[2].lines[-1].get_ydata()[-1]
    np.testing.assert_allclose(last, 1e3 * plan.accuracy_m[-1])


def test_every_pose_has_a_picture_with_its_number_and_pages_are_full():
    survey = make_survey()
    plan = choose_plan(survey, make_candidates(survey, 300), 55, 4, 1)
    pages = draw_poses(survey.robot, plan)
    titles = [
        axis.get_title(loc="left")
        for page in pages
        for axis in page.axes
        if axis.get_title(loc="left")
    ]
    assert titles == [
        *(str(pose) for pose in range(1, 56)),
        *(f"{pose} held out" for pose in range(56, 60)),
    ]
    assert len(pages) == 2
