"""The figure of printed sockets shows the held-out poses and the errors of the verdict."""

from types import SimpleNamespace

import numpy as np
from drawn_figures import assert_nothing_cut_off

from elastocal.figures.sockets import draw_sockets


def test_held_out_points_are_drawn_and_the_errors_are_those_of_the_verdict():
    rng = np.random.default_rng(1)
    rows = 40
    columns = {
        f"{stage}_{axis}": scale * rng.standard_normal(rows)
        for stage, scale in (("before", 5e-3), ("after", 2e-4))
        for axis in ("dx", "dy", "dz")
    }
    held_out = np.arange(rows) % 2 == 0
    gross_error = np.arange(rows) == 0
    residuals = columns | {"held_out": held_out, "gross_error": gross_error}
    heldout = SimpleNamespace(
        before=SimpleNamespace(rms_m=8.7e-3), after=SimpleNamespace(rms_m=3.4e-4)
    )
    figure = draw_sockets(residuals, heldout)
    assert_nothing_cut_off(figure)
    _, before, after = figure.axes[:3]
    assert before.get_title() == "before: 8.7 mm RMS"
    assert after.get_title() == "after: 0.34 mm RMS"
    assert before.get_xlabel() == "x (mm), 19 held-out poses"
    drawn = before.get_lines()[-1].get_xydata()
    kept = held_out & ~gross_error
    expected = np.column_stack([columns["before_dx"], columns["before_dz"]])[kept]
    np.testing.assert_allclose(drawn, 1e3 * expected)
