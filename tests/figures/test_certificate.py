"""Figures of a certificate: each panel and each line is there, and nothing is cut off."""

from dataclasses import replace

import numpy as np
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from made_certificates import made_document
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.contour import ContourSet

from elastocal.application.certificate import WorkspaceErrors
from elastocal.figures.certificate import budget_bars, workspace_map


def errors(seed, count=2000):
    rng = np.random.default_rng(seed)
    corrected = rng.uniform(1e-5, 3e-5, count)
    position = rng.uniform([-2, -2, 0], [2, 2, 2], (count, 3))
    return WorkspaceErrors(
        np.zeros((count, 6)),
        position,
        rng.uniform(1e-3, 2e-3, count),
        corrected,
        2 * corrected,
        position[:, 2] > 1.5,
        np.zeros(count, bool),
    )


def test_each_load_has_a_row_and_what_lies_outside_is_hatched():
    figure = workspace_map([errors(1), errors(2)], [0.0, 150.0], 2e-4)
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles == ["uncorrected, no load", "corrected, no load", "uncorrected, 150 N hanging", "corrected, 150 N hanging"]
    hatched = [patch for patch in figure.axes[0].patches if patch.get_hatch()]
    assert hatched and min(patch.get_y() for patch in hatched) > 1.3
    assert_nothing_cut_off(figure)


def test_where_a_regression_corrects_has_dots():
    made = errors(1)
    figure = workspace_map([replace(made, regressed=made.position[:, 2] < 1.0)], [0.0], 2e-4)
    dotted = [[patch for patch in axis.patches if patch.get_hatch() == "...."] for axis in figure.axes[:2]]
    assert not dotted[0] and dotted[1] and max(patch.get_y() for patch in dotted[1]) < 1.0
    assert any("regression" in entry for entry in legend_entries(figure))


def test_before_and_after_are_one_quantity_on_one_scale_with_the_tolerance_as_a_contour():
    """Each on a scale of its own, the correction of a robot looked as if it had made things worse."""
    made = errors(3)
    lower = replace(made, uncorrected_m=np.full(2000, 1e-3), corrected_m=np.where(made.position[:, 2] > 1, 3e-4, 1e-4))
    figure = workspace_map([lower], [0.0], 2e-4)
    before, after = figure.axes[:2]
    (left,), (right,) = ([one for one in axis.collections if isinstance(one, QuadMesh)] for axis in (before, after))
    assert left.norm is right.norm and isinstance(left.norm, LogNorm)
    np.testing.assert_allclose(left.get_array().compressed(), 1.0)
    assert right.get_array().min() >= 0.1 - 1e-12 and right.get_array().max() <= 0.3 + 1e-12
    contours = [[one for one in axis.collections if isinstance(one, ContourSet)] for axis in (before, after)]
    assert not contours[0] and abs(np.concatenate([p.vertices for p in contours[1][0].get_paths()])[:, 1] - 1).max() < 0.1


def test_the_budget_has_a_bar_for_each_line_that_is_not_zero_the_largest_first_from_zero_on():
    budget = made_document()["budget"]
    figure = budget_bars(budget, [line["name"] for line in budget], 2e-4, 1.5e-4)
    axis = figure.axes[0]
    assert row_labels(axis) == [
        "uncorrected",
        "joint_compliance",
        "lost_motion",
        "noise of the tracker alone",
        "uncertainty of the parameters",
    ]
    np.testing.assert_allclose([patch.get_width() for patch in axis.patches], [1.5, 1.0, 0.2, 0.15, 0.02])
    assert axis.get_xscale() == "linear" and axis.get_xlim()[0] == 0.0
    assert "tolerance 0.2 mm" in legend_entries(figure)
    assert_nothing_cut_off(figure)
