"""Strategies over the data set length: lines, bands and bars are the tables' figures in micrometres and per cent."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from matplotlib.colors import same_color

from elastocal.figures.strategies import (
    accuracy_of_one_data_set,
    bias_and_accuracy,
    noise_impact,
    over_studies,
    stiffness_errors,
)
from elastocal.figures.style import PALETTE

LENGTHS = np.arange(1, 6)
ORDER = ["6DoF", "2DoF+6DoF"]
TITLES = {"kuka": "Kuka KR 270", "fanuc": "Fanuc R-2000"}


def metrics_of(robot, strategy, size, noise_um=200.0, untrusted=0):
    frame = pd.DataFrame({"robot": robot, "strategy": strategy, "noise_um": noise_um, "length": LENGTHS})
    for name, scale in (("k_sigma", 1.0), ("k_sigma_fixed_joints", 0.5), ("deviation", 1e-6)):
        frame[name], frame[f"{name}_std_error"] = scale * size / LENGTHS, 0.1 * scale * size / LENGTHS
    return frame.assign(trustworthy=untrusted < LENGTHS)


METRICS = pd.concat([metrics_of(robot, name, 10.0 * n) for robot in TITLES for n, name in enumerate(ORDER, 1)])
PAPER = "the paper's Table 4"
PRINTED = pd.DataFrame(
    [
        ("4", "kuka", "2DoF+6DoF", "k_sigma_4", 2.2),
        ("4", "kuka", "2DoF+6DoF", "n_k_sigma_3_percent", 5.0),
        ("4", "kuka", "6DoF", "dev_4", 6.0),
        ("4", "fanuc", "6DoF", "dev_4", 7.0),
        ("3", "kuka", "6DoF", "c4", 8.0),
    ],
    columns=["table", "robot", "strategy", "quantity", "value"],
)
PER_DATASET = pd.DataFrame(
    [
        {"robot": robot, "strategy": name, "ds": ds, "rms_um": 100.0 * n / ds, "rms_um_std_error": 3.0 * n}
        | {"crlb_rms_um": 80.0 / ds, "mean_um": 90.0 * n / ds, "p95_um": 150.0 * n / ds, "efficiency": (0.8 / n) ** 2}
        for robot in TITLES
        for n, name in enumerate(ORDER, 1)
        for ds in (5, 20)
    ]
)


def band(collection):
    """Lower and upper edge of a filled band at each length."""
    vertices = collection.get_paths()[0].vertices
    return {
        x: (vertices[vertices[:, 0] == x, 1].min(), vertices[vertices[:, 0] == x, 1].max()) for x in np.unique(vertices[:, 0])
    }


def test_noise_levels_are_lines_in_micrometres_that_are_thick_only_where_they_are_trustworthy():
    frame = pd.concat([metrics_of("kuka", "6DoF", size, noise, 2) for size, noise in ((100.0, 50.0), (200.0, 100.0))])
    frame = pd.concat([frame, metrics_of("kuka", "2DoF+6DoF", 7.0), metrics_of("fanuc", "6DoF", 7.0)])
    figure = noise_impact(frame, "6DoF", {"kuka": "Kuka KR 270"})
    axis, linear = figure.axes
    assert (axis.get_yscale(), linear.get_yscale()) == ("log", "linear") and len(linear.lines) == 4
    for index, size in enumerate((100.0, 200.0)):
        thin, thick = axis.lines[2 * index : 2 * index + 2]
        np.testing.assert_allclose(thin.get_xydata(), np.column_stack([LENGTHS, size / LENGTHS]))
        np.testing.assert_allclose(thick.get_xydata(), np.column_stack([LENGTHS[2:], size / LENGTHS[2:]]))
        assert thin.get_linewidth() < thick.get_linewidth() and thin.get_color() == thick.get_color() == PALETTE[index]
        # A tenth either way, as a factor.
        assert band(axis.collections[index])[4] == pytest.approx((np.exp(-0.1) * size / 4, np.exp(0.1) * size / 4))
    assert len(axis.lines) == 4 and axis.get_title() == "Kuka KR 270"
    assert (linear.get_xlabel(), axis.get_ylabel()) == ("configurations in the data set", "dev, equation 15 (µm)")
    assert legend_entries(figure) == ["50", "100"]
    assert_nothing_cut_off(figure)


def test_stiffness_errors_stand_under_both_counts_of_joints_with_their_limit():
    figure = stiffness_errors(METRICS, PRINTED, "Kuka KR 270", "kuka", ORDER, 3.0)
    whole, first = figure.axes
    for axis, scale in ((whole, 1.0), (first, 0.5)):
        one, other, limit = axis.lines[:3]
        np.testing.assert_allclose(one.get_ydata(), 10 * scale / LENGTHS)
        np.testing.assert_allclose(other.get_ydata(), 20 * scale / LENGTHS)
        assert band(axis.collections[1])[2] == pytest.approx((9 * scale, 11 * scale))
        assert list(limit.get_ydata()) == [3.0, 3.0] and [text.get_text() for text in axis.texts] == ["3 %"]
    assert "all joints" in whole.get_title() and "fixed in the last stage" in first.get_title()
    assert whole.get_ylabel() == r"$k_\Sigma$ (%)"
    assert legend_entries(figure) == [*ORDER, PAPER]
    assert_nothing_cut_off(figure)
    # Both counts are those of the fixed joints in the paper: its score at 4 configurations, and where it reaches 3 %.
    marks = [line for line in first.lines if line.get_marker() == "D"]
    assert len(whole.lines) == 3 and [line.get_xydata().tolist() for line in marks] == [[[4, 2.2]], [[5, 3]]]
    assert marks[0].get_color() == first.lines[1].get_color()


def test_bias_and_accuracy_puts_the_averaged_model_below_the_error_of_one_data_set():
    figure = bias_and_accuracy(METRICS, PER_DATASET, TITLES, ORDER, 60.0)
    assert [axis.get_title() for axis in figure.axes] == [*TITLES.values()]
    for axis in figure.axes:
        for index in range(2):
            rms, bound, averaged = axis.lines[3 * index : 3 * index + 3]
            assert rms.get_xydata().tolist() == [[5, 20.0 * (index + 1)], [20, 5.0 * (index + 1)]]
            assert bound.get_xydata().tolist() == [[5, 16], [20, 4]]
            np.testing.assert_allclose(averaged.get_xydata(), np.column_stack([LENGTHS[1:], 10 * (index + 1) / LENGTHS[1:]]))
            assert band(axis.collections[index])[5] == pytest.approx((18 * (index + 1), 30 * (index + 1)))
    assert figure.axes[0].get_ylabel() == "end-effector error (µm)"
    ends = ("one data set, RMS", "Cramér-Rao bound, RMS", "dev of the paper")
    assert legend_entries(figure) == [f"{name}: {end}" for name in ORDER for end in ends]


def test_bars_of_one_data_set_stand_in_the_given_order_with_bound_error_and_efficiency():
    figure = accuracy_of_one_data_set(PER_DATASET, TITLES, ORDER[::-1], 20)
    for axis in figure.axes:
        # The first of the order is on top.
        assert [(bar.get_y() + bar.get_height() / 2, bar.get_width()) for bar in axis.patches] == [(1.0, 10.0), (0.0, 5.0)]
        assert all(same_color(bar.get_facecolor(), PALETTE[5]) for bar in axis.patches)
        (marks,) = [line for line in axis.lines if line.get_marker() == "|"]
        assert marks.get_xydata().tolist() == [[4, 1], [4, 0]]
        spans = [path.vertices[:, 0].tolist() for path in axis.collections[0].get_paths()]
        assert spans == [[4.0, 16.0], [2.0, 8.0]]
        assert [text.get_text() for text in axis.texts] == ["16 %", "64 %"]
        assert axis.get_xlabel() == "RMS end-effector error (µm)"
    assert row_labels(figure.axes[0]) == ORDER[::-1]
    assert legend_entries(figure) == ["Cramér-Rao bound", "RMS error"] and "20 configurations" in figure.get_suptitle()
    assert_nothing_cut_off(figure)


def test_studies_are_drawn_as_their_mean_and_one_estimator_once():
    parts = [
        metrics_of(robot, name, size * (1 + 0.1 * study)).assign(study=study)
        for robot in TITLES
        for name, size in (("6DoF", 20.0), ("6DoF again", 20.0), ("2DoF+6DoF", 10.0))
        for study in (0, 1, 2)
    ]
    figure = over_studies(pd.concat(parts), PRINTED, TITLES, ["6DoF", "6DoF again", "2DoF+6DoF"])
    deviation = figure.axes[2]
    lines = [line for line in deviation.lines if line.get_marker() != "D"]
    assert len(lines) == 2 and "6DoF again" not in legend_entries(figure)
    np.testing.assert_allclose(lines[0].get_ydata(), 22.0 / LENGTHS, rtol=1e-9)
    assert_nothing_cut_off(figure)
