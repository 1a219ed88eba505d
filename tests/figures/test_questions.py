"""Figures of the research questions: what is drawn is what the tables have."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from made_study_tables import TITLES, strategy_scores
from made_study_tables import budget as budget_frame
from made_study_tables import costs as costs_frame
from made_study_tables import designs as designs_frame
from made_study_tables import ladder as ladder_frame

from elastocal.figures.questions import budget, costs, designs, ladder, metrics


def test_the_ladder_has_a_line_for_each_length_in_the_panel_of_its_noise():
    table = pd.concat([ladder_frame(), ladder_frame().assign(length=40), ladder_frame().assign(noise_um=50.0)])
    figure = ladder(table)
    assert [axis.get_title() for axis in figure.axes] == ["noise 200 µm and µrad", "noise 50 µm and µrad"]
    first, second = figure.axes
    assert len(first.lines) == 2 and len(second.lines) == 1
    np.testing.assert_array_equal(first.lines[0].get_xydata(), [[0, 40], [1, 20]])
    assert legend_entries(figure) == ["20", "40"]
    assert_nothing_cut_off(figure)


def test_points_stand_in_their_row_with_both_budgets():
    figure = budget(budget_frame(), TITLES, 20)
    kuka = figure.axes[0]
    assert row_labels(kuka) == ["6DoF", "3+6DoF"] and kuka.get_title() == "Kuka"
    same, equal = [line for line in kuka.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(same.get_xydata(), [[79, -0.16], [57, 0.84]])
    np.testing.assert_allclose(equal.get_xydata(), [[52, 0.16], [57, 1.16]])
    assert set(legend_entries(figure)) == {"20 configurations each", "40 measurements each", "Cramér-Rao bound"}
    assert_nothing_cut_off(figure)


@pytest.mark.parametrize("robot", [0, 1])
def test_designs_have_a_line_each_and_the_wanted_accuracy(robot):
    figure = designs(designs_frame(), TITLES, 60.0, "limits")
    axis = figure.axes[robot]
    by = {line.get_label(): line.get_ydata() for line in axis.lines}
    assert list(by["random"]) == [200.0, 80.0] and list(by["I-optimal"]) == [88.0, 40.0]
    assert [line.get_ydata()[0] for line in axis.lines if line.get_label().startswith("_")] == [60.0]
    assert legend_entries(figure) == ["random", "A-optimal", "D-optimal", "I-optimal", "bound of all designs"]
    assert_nothing_cut_off(figure)


def test_metrics_have_a_row_each_and_strategies_stand_where_their_ratio_is():
    figure = metrics(strategy_scores(), TITLES, {"rms_um": "RMS", "k_sigma_percent_fixed_joints": "fixed joints"})
    kuka = figure.axes[0]
    assert row_labels(kuka) == ["RMS", "fixed joints"]
    one, other = [line for line in kuka.lines if line.get_marker() == "o"]
    assert one.get_xdata().tolist() == [1.0, 1.0] and other.get_xdata().tolist() == [1.2, 0.5]
    assert legend_entries(figure) == ["6DoF", "staged"]
    assert_nothing_cut_off(figure)


def test_costs_have_a_line_for_each_set_of_points_over_the_first():
    figure = costs(costs_frame(), TITLES, 60.0)
    kuka = figure.axes[0]
    assert kuka.get_title() == "Kuka" and "60 µm over that of 6DoF" in kuka.get_ylabel()
    np.testing.assert_allclose(kuka.lines[0].get_xydata(), [[0.1, 1.0], [1.0, 1.0]])
    assert legend_entries(figure) == ["6DoF", "3+6DoF"]
    assert_nothing_cut_off(figure)
