"""The study against the paper's printed figures: every distance is where the table has it, and none where there is none."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from matplotlib.colors import to_hex

from elastocal.figures.against_paper import scores, table2_samples
from elastocal.figures.style import PALETTE

COMPARED = pd.DataFrame(
    [
        ("1", "kuka", "c1", 9.9),
        ("2", "kuka", "deviation_mean", 1.5),
        ("2", "fanuc", "deviation_mean", -20.0),
        ("3", "kuka", "c1", np.nan),
        ("4", "kuka", "dev_20", 30.0),
        ("4", "kuka", "dev_20", -2.0),
        ("4", "fanuc", "k_sigma_20", 8.0),
        ("text", "kuka", "ratio", 3.3),
    ],
    columns=["table", "robot", "quantity", "z"],
)
INITIAL = pd.DataFrame({"mean": np.linspace(1e-3, 2e-3, 101), "maximum": np.linspace(5e-3, 7e-3, 101)})
INITIAL["mean_square"] = INITIAL["mean"] ** 2 + np.linspace(1e-4, 3e-4, 101) ** 2
PRINTED = pd.DataFrame(
    [("2", "kuka", "deviation_mean", 1.7), ("2", "kuka", "deviation_max", 6.5), ("3", "kuka", "deviation_std", 0.9)],
    columns=["table", "robot", "quantity", "value"],
)


def points(axis, *markers):
    return [
        (to_hex(line.get_color()).upper(), float(x), round(float(y), 6))
        for line in axis.lines
        if line.get_marker() in markers
        for x, y in line.get_xydata()
    ]


def test_each_printed_figure_of_tables_2_to_4_is_a_point_at_its_distance():
    (axis,) = scores(COMPARED).axes
    assert row_labels(axis) == ["Table 2: deviation_mean", "Table 4: dev_20", "Table 4: k_sigma_20"]
    # Robots stand side by side within a row, in colours of their own.
    assert points(axis, "o") == [(PALETTE[0], 1.5, -0.22), (PALETTE[0], -2.0, 0.78), (PALETTE[1], 8.0, 2.0)]


def test_a_distance_beyond_the_margin_is_an_arrow_at_the_margin_that_points_outwards():
    (axis,) = scores(COMPARED).axes
    assert points(axis, "<") == [(PALETTE[1], -8.0, 0.0)] and points(axis, ">") == [(PALETTE[0], 8.0, 0.78)]
    low, high = axis.get_xlim()
    assert low < -8 and high > 8


def test_the_accepted_distances_are_shaded_and_the_legend_names_the_robots():
    figure = scores(COMPARED)
    band = figure.axes[0].patches[0]
    assert (band.get_x(), band.get_x() + band.get_width()) == (-2.5, 2.5)
    assert legend_entries(figure) == ["kuka", "fanuc"]
    assert_nothing_cut_off(figure)


def test_samples_show_quartiles_and_nearly_the_whole_range_of_single_data_sets_in_millimetres():
    figure = table2_samples({"fanuc": INITIAL, "kuka": INITIAL}, PRINTED, {"fanuc": "Fanuc", "kuka": "Kuka"})
    expected = {"mean": (1.0, 2.0), "std": (0.1, 0.3), "max": (5.0, 7.0)}
    assert [axis.get_title() for axis in figure.axes] == [*expected]
    for axis, (low, high) in zip(figure.axes, expected.values(), strict=True):
        assert axis.get_xlabel() == "mm"
        whole, half, middle = axis.lines[:3]
        for line, shares in ((whole, (0.01, 0.99)), (half, (0.25, 0.75)), (middle, (0.5,))):
            assert list(line.get_xdata()) == pytest.approx([low + share * (high - low) for share in shares])
            assert set(line.get_ydata()) == {0}


def test_the_papers_figure_stands_in_the_row_of_its_robot_and_nowhere_where_none_is_printed():
    figure = table2_samples({"fanuc": INITIAL, "kuka": INITIAL}, PRINTED, {"fanuc": "Fanuc", "kuka": "Kuka"})
    diamonds = [
        [xy.tolist() for line in axis.lines if line.get_marker() == "D" for xy in line.get_xydata()] for axis in figure.axes
    ]
    assert diamonds == [[[1.7, 1.0]], [], [[6.5, 1.0]]]
    assert [row_labels(axis) for axis in figure.axes] == [["Fanuc", "Kuka"], ["", ""], ["", ""]]
    assert legend_entries(figure) == ["paper, Table 2"]
    assert_nothing_cut_off(figure)
