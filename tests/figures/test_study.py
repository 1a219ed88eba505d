"""Figures of the study draw lines, bands, bars and marks at the values of the tables, in
their units."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from matplotlib.colors import to_hex

from elastocal.figures.study import (
    draw_deviations,
    draw_multiverse,
    draw_noise_impact,
    draw_scores,
    draw_stiffness_errors,
)
from elastocal.figures.style import PALETTE

LENGTHS = np.arange(1, 6)
TITLES = {"kuka": "Kuka", "fanuc": "Fanuc"}
ORDER = ["6DoF", "2DoF+6DoF"]


def metrics_of(robot, strategy, size, noise_um=200.0, untrusted=0):
    frame = pd.DataFrame(
        {"robot": robot, "strategy": strategy, "noise_um": noise_um, "length": LENGTHS}
    )
    for name, scale in (
        ("k_sigma", 1.0),
        ("k_sigma_fixed_joints", 0.5),
        ("deviation", 1e-6),
    ):
        frame[name] = scale * size / LENGTHS
        frame[f"{name}_std_error"] = 0.1 * scale * size / LENGTHS
    return frame.assign(trustworthy=untrusted < LENGTHS)


METRICS = pd.concat(
    [
        metrics_of(robot, name, 10.0 * n)
        for robot in TITLES
        for n, name in enumerate(ORDER, 1)
    ]
)
PAPER = "the paper's Table 4; marks at\nthe same length are spread"
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


def band(collection):
    """Lower and upper edge of a filled band at each length."""
    vertices = collection.get_paths()[0].vertices
    return {
        x: (
            vertices[vertices[:, 0] == x, 1].min(),
            vertices[vertices[:, 0] == x, 1].max(),
        )
        for x in np.unique(vertices[:, 0])
    }


def test_noise_levels_are_lines_in_micrometres_and_thick_where_they_are_trustworthy():
    frame = pd.concat(
        [
            metrics_of("kuka", "6DoF", size, noise, 2)
            for size, noise in ((100.0, 50.0), (200.0, 100.0))
        ]
    )
    frame = pd.concat(
        [frame, metrics_of("kuka", "2DoF+6DoF", 7.0), metrics_of("fanuc", "6DoF", 7.0)]
    )
    figure = draw_noise_impact(frame, "6DoF", {"kuka": "Kuka"})
    axis, linear = figure.axes
    assert (axis.get_yscale(), linear.get_yscale()) == ("log", "linear") and len(
        linear.lines
    ) == 4
    for index, size in enumerate((100.0, 200.0)):
        thin, thick = axis.lines[2 * index : 2 * index + 2]
        np.testing.assert_allclose(
            thin.get_xydata(), np.column_stack([LENGTHS, size / LENGTHS])
        )
        np.testing.assert_allclose(
            thick.get_xydata(), np.column_stack([LENGTHS[2:], size / LENGTHS[2:]])
        )
        assert (
            thin.get_linewidth() < thick.get_linewidth()
            and thin.get_color() == thick.get_color() == PALETTE[index]
        )
        # The band is a factor of a tenth upwards and downwards.
        assert band(axis.collections[index])[4] == pytest.approx(
            (np.exp(-0.1) * size / 4, np.exp(0.1) * size / 4)
        )
    assert len(axis.lines) == 4 and axis.get_title() == "Kuka"
    assert (linear.get_xlabel(), axis.get_ylabel()) == (
        "configurations in the data set",
        "dev, equation 15 (µm)",
    )
    assert legend_entries(figure) == ["50", "100"]
    assert_nothing_cut_off(figure)


def test_stiffness_errors_have_a_panel_for_each_count_of_joints_with_their_limit():
    figure = draw_stiffness_errors(METRICS, PRINTED, "Kuka", "kuka", ORDER, 3.0)
    all_joints, fixed_joints = figure.axes
    for axis, scale in ((all_joints, 1.0), (fixed_joints, 0.5)):
        first_curve, second_curve, limit = axis.lines[:3]
        np.testing.assert_allclose(first_curve.get_ydata(), 10 * scale / LENGTHS)
        np.testing.assert_allclose(second_curve.get_ydata(), 20 * scale / LENGTHS)
        assert band(axis.collections[1])[2] == pytest.approx((9 * scale, 11 * scale))
        assert list(limit.get_ydata()) == [3.0, 3.0] and [
            text.get_text() for text in axis.texts
        ] == ["3 %"]
    assert (
        "all joints" in all_joints.get_title()
        and "fixed in the last stage" in fixed_joints.get_title()
    )
    assert all_joints.get_ylabel() == r"$k_\Sigma$ (%)"
    assert legend_entries(figure) == [*ORDER, PAPER]
    assert_nothing_cut_off(figure)
    # The paper's score at 4 configurations, and the length from which on it is within 3 %,
    # stand beside the curves of either count of joints.
    for axis in (all_joints, fixed_joints):
        marks = find_diamonds(axis)
        assert [line.get_xydata().tolist() for line in marks] == [[[4, 2.2]], [[5, 3]]]
        assert marks[0].get_color() == axis.lines[1].get_color()


def find_diamonds(axis):
    """Diamonds that are at a point, without the one of the legend."""
    lines = [line for line in axis.lines if line.get_marker() == "D"]
    return [line for line in lines if len(line.get_xdata())]


def test_names_of_one_estimator_share_a_line_and_printed_scores_stand_side_by_side():
    names = ["6DoF", "6DoF after 3DoF", "comb"]
    metrics = pd.concat(
        [
            metrics_of("kuka", name, size)
            for name, size in zip(names, (100.0, 100.0, 50.0), strict=True)
        ]
    )
    printed = pd.DataFrame(
        [("4", "kuka", name, "dev_4", 20.0) for name in names],
        columns=["table", "robot", "strategy", "quantity", "value"],
    )
    figure = draw_deviations(metrics, printed, "Kuka", "kuka", names, 2.0)
    (axis,) = figure.axes
    assert legend_entries(figure) == ["6DoF,\n6DoF after 3DoF", "comb", PAPER]
    marks = find_diamonds(axis)
    positions = [float(line.get_xdata()[0]) for line in marks]
    assert np.diff(positions).min() > 1
    assert np.mean(positions) == pytest.approx(4.0)
    assert marks[0].get_color() == marks[1].get_color() != marks[2].get_color()


def find_points(axis, marker):
    """Points with a marker: x, row, and whether they are filled with the colour of a
    difference."""
    return [
        (float(x), float(y), to_hex(line.get_markerfacecolor()).upper() == PALETTE[1])
        for line in axis.lines
        if line.get_marker() == marker
        for x, y in line.get_xydata()
    ]


def test_each_printed_figure_of_table_4_is_drawn_with_the_studies_of_its_robot():
    columns = ["robot", "quantity", "paper", "studies_median", "p_corrected"]
    rows = [
        ("kuka", "k_sigma_20", 1.5, 1.75, 0.002),
        ("kuka", "dev_20", 1.0, 1.2, 0.16),
    ]
    table = pd.DataFrame(
        [*rows, ("fanuc", "n_dev_2_um", 30.0, 110.0, 0.18)], columns=columns
    )
    median = table.studies_median
    table = table.assign(
        studies_low=0.9 * median,
        studies_high=1.2 * median,
        unseen_low=0.8 * median,
        unseen_high=1.5 * median,
    )
    figure = draw_scores(table.assign(table="4", strategy="6DoF"), TITLES)
    heads = [axis.get_title() for axis in figure.axes[:3]]
    assert heads == [
        "$k_\\Sigma$ at 20 (%)",
        "dev at 20 (µm)",
        "configurations\nfor 2 µm",
    ]
    assert row_labels(figure.axes[0]) == ["6DoF"]
    k_sigma, dev, _ = figure.axes[:3]
    # After the correction the first differs and the second does not.
    assert find_points(k_sigma, "D") == [(1.5, 0.0, True)] and find_points(
        dev, "D"
    ) == [(1.0, 0.0, False)]
    # The median with the narrow and the wide range.
    assert [x for x, *_ in find_points(dev, "o")] == [1.2, 1.2]
    assert find_points(figure.axes[5], "D") == [(30.0, 0.0, False)]


def test_each_interpretation_has_the_median_factor_between_the_paper_and_both_readings():
    columns = [
        *("interpretation", "table", "quantity"),
        *("paper", "ours", "other", "change_percent"),
    ]
    rows = [
        ("R10", "4", "k_sigma_20", 1.0, 1.1, 2.2, 100.0),
        ("R10", "4", "k_sigma_20", 2.0, 1.0, 8.0, 700.0),
        ("R3", "4", "k_sigma_20", 1.0, 1.0, 1.0, 0.0),
        ("R3", "2", "deviation_mean", 1.0, 0.8, 1.6, 100.0),
    ]
    figure = draw_multiverse(pd.DataFrame(rows, columns=columns))
    k_sigma, table2 = figure.axes
    assert [axis.get_title() for axis in figure.axes] == [
        "$k_\\Sigma$ at 20 (%)",
        "Table 2",
    ]
    assert row_labels(k_sigma) == ["R3", "R10"]
    ours, other = k_sigma.lines[:2]
    # Medians of logarithms: of 1.1 and 2, and of 2.2 and 4.
    np.testing.assert_allclose(ours.get_xdata(), [1.0, np.sqrt(2.2)])
    np.testing.assert_allclose(other.get_xdata(), [1.0, np.sqrt(8.8)])
    np.testing.assert_allclose(table2.lines[1].get_xdata(), [1.6, np.nan])
    assert_nothing_cut_off(figure)
