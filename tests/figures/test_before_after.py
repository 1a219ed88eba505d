"""Bars of the errors on held-out poses: as long as the table says, with their intervals."""

import numpy as np
import pytest
from drawn_figures import row_labels
from made_loop_tables import step_rows

from elastocal.figures.before_after import METRICS, before_after


def test_bars_for_every_model_and_measure():
    steps = step_rows()
    figure = before_after(steps, 5e-5)
    assert [axis.get_title() for axis in figure.axes] == ["mean", "RMS", "95th percentile", "maximum"]
    assert {axis.get_xlabel() for axis in figure.axes} == {"error (µm)"}
    for axis, metric in zip(figure.axes, ("mean", "rms", "p95", "max"), strict=True):
        assert [bar.get_width() for bar in axis.patches] == pytest.approx([1e6 * step[f"heldout_{metric}_m"] for step in steps])
        assert len([line for line in axis.lines if line.get_gid() == "interval"]) == len(steps)
        assert len([line for line in axis.lines if line.get_gid() == "open interval"]) == (len(steps) if metric == "p95" else 0)
        assert len([line for line in axis.lines if line.get_gid() == "noise floor"]) == 1


def lines_of(axis, gid):
    return [line.get_xydata().tolist() for line in axis.lines if line.get_gid() == gid]


def test_an_interval_reaches_from_end_to_end_is_open_above_or_is_not_drawn():
    steps = step_rows(effects=())
    mean, _, p95, largest = before_after(steps).axes
    for step, (one, other) in zip(steps, lines_of(mean, "interval"), strict=True):
        assert [one[0], other[0]] == pytest.approx([1e6 * step["heldout_mean_m_low"], 1e6 * step["heldout_mean_m_high"]])
    # Of few poses the 95th percentile has no upper end: its line ends at the value, where an arrow points on.
    for step, (_, end), (arrow,) in zip(steps, lines_of(p95, "interval"), lines_of(p95, "open interval"), strict=True):
        assert end[0] == arrow[0] == pytest.approx(1e6 * step["heldout_p95_m"])
    assert np.isnan([x for line in lines_of(largest, "interval") for x, _ in line]).all()


def test_errors_on_fitted_poses_are_diamonds_in_the_row_of_their_model():
    steps = step_rows()
    for axis, metric in zip(before_after(steps).axes, METRICS, strict=True):
        diamonds = [line.get_xydata()[0].tolist() for line in axis.lines if line.get_marker() == "D"]
        rows = [bar.get_y() + bar.get_height() / 2 for bar in axis.patches]
        expected = [[1e6 * step[f"train_{metric}_m"], row] for step, row in zip(steps, rows, strict=True)]
        assert diamonds == [pytest.approx(point) for point in expected]


def test_models_stand_from_top_to_bottom_in_the_order_of_the_table():
    axis = before_after(step_rows()).axes[0]
    assert row_labels(axis) == ["frames and targets", "declared model", "with lost motion\n(backlash)"]
    assert axis.get_yticks().tolist() == sorted(axis.get_yticks()) and axis.get_ylim()[0] > axis.get_ylim()[1]


@pytest.mark.parametrize("floor_m, scale", [(1.3e-5, "linear"), (None, "linear"), (1.1e-5, "log")])
def test_the_axis_is_logarithmic_where_the_smallest_would_be_lost_beside_the_largest(floor_m, scale):
    for axis in before_after(step_rows(effects=()), floor_m).axes:
        assert axis.get_xscale() == scale
        low, high = axis.get_xlim()
        drawn = [bar.get_width() for bar in axis.patches] + ([1e6 * floor_m] if floor_m else [])
        assert low < min(drawn) and high > max(drawn)
