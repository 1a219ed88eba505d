"""The figure of a certificate: each line is there, and nothing is cut off."""

import numpy as np
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from made_certificates import made_document

from elastocal.figures.certificate import budget_bars


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
