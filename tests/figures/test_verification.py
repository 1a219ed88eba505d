"""The figure of a verification shows each target before, predicted and measured."""

import numpy as np
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries
from made_verifications import TOLERANCE_M, make_table

from elastocal.figures.verification import draw_verification


@pytest.mark.parametrize("tolerance_m", [None, TOLERANCE_M])
def test_every_target_has_its_errors_in_millimetres(tolerance_m):
    table = make_table()
    figure = draw_verification(table, 1e-4, tolerance_m)
    (axis,) = figure.axes
    lines = {line.get_label(): line for line in axis.lines}
    measured = lines["corrected, measured"]
    np.testing.assert_allclose(measured.get_ydata(), 1e3 * table["measured_error_m"])
    np.testing.assert_array_equal(measured.get_xdata(), table["target"])
    before = lines["before, predicted"].get_ydata()
    np.testing.assert_allclose(before, 1.5)
    has_tolerance = "tolerance 0.2 mm (RMS)" in legend_entries(figure)
    assert has_tolerance == (tolerance_m is not None)
    assert_nothing_cut_off(figure)
