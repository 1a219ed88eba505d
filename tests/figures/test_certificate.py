"""Figures of a certificate: each panel and each line is there, and nothing is cut off."""

import numpy as np
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from made_certificates import made_document

from elastocal.application.certificate.workspace import WorkspaceErrors
from elastocal.figures.certificate import budget_bars, workspace_map


def errors(seed, count=2000):
    rng = np.random.default_rng(seed)
    position = rng.uniform([-2, -2, 0], [2, 2, 2], (count, 3))
    return WorkspaceErrors(
        np.zeros((count, 6)), position, rng.uniform(1e-3, 2e-3, count), rng.uniform(1e-5, 3e-5, count), position[:, 2] > 1.5
    )


def test_each_load_has_a_row_and_what_lies_outside_is_hatched():
    figure = workspace_map([errors(1), errors(2)], [0.0, 150.0])
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles == ["uncorrected, no load", "corrected, no load", "uncorrected, 150 N hanging", "corrected, 150 N hanging"]
    hatched = [patch for patch in figure.axes[0].patches if patch.get_hatch()]
    assert hatched and min(patch.get_y() for patch in hatched) > 1.3
    assert_nothing_cut_off(figure)


def test_the_budget_has_a_bar_for_each_line_that_is_not_zero():
    budget = made_document()["budget"]
    figure = budget_bars(budget, [line["name"] for line in budget], 2e-4)
    axis = figure.axes[0]
    assert row_labels(axis) == ["uncorrected", "joint_compliance", "lost_motion", "uncertainty of the parameters"]
    np.testing.assert_allclose([patch.get_width() for patch in axis.patches], [1.5, 1.0, 0.2, 0.02])
    assert "tolerance 0.2 mm" in legend_entries(figure)
    assert_nothing_cut_off(figure)
