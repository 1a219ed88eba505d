"""The study against the paper's printed figures: every distance is where the table has it, and none where there is none."""

import numpy as np
import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries, row_labels
from made_study_tables import comparison, expectations
from matplotlib.colors import to_hex

from elastocal.figures.against_paper import scores, table2_samples
from elastocal.figures.style import PALETTE

TITLES = {"kuka": "Kuka", "fanuc": "Fanuc"}
INITIAL = pd.DataFrame({"mean": np.linspace(1e-3, 2e-3, 101), "maximum": np.linspace(5e-3, 7e-3, 101)})
INITIAL["mean_square"] = INITIAL["mean"] ** 2 + np.linspace(1e-4, 3e-4, 101) ** 2
PRINTED = pd.DataFrame(
    [("2", "kuka", "deviation_mean", 1.7), ("2", "kuka", "deviation_max", 6.5), ("3", "kuka", "deviation_std", 0.9)],
    columns=["table", "robot", "quantity", "value"],
)


def find_points(axis, marker):
    """Points with a marker: x, row, and whether they are filled with the colour of a difference."""
    return [
        (float(x), float(y), to_hex(line.get_markerfacecolor()).upper() == PALETTE[1])
        for line in axis.lines
        if line.get_marker() == marker
        for x, y in line.get_xydata()
    ]


def test_each_printed_figure_of_table_4_stands_among_the_studies_of_its_robot():
    figure = scores(comparison(), expectations(), TITLES)
    heads = [axis.get_title() for axis in figure.axes[:3]]
    assert heads == ["$k_\\Sigma$ at 20 (%)", "dev at 20 (µm)", "length until 2 µm"]
    assert row_labels(figure.axes[0]) == ["6DoF"]
    k_sigma, dev, _ = figure.axes[:3]
    # After Holm's correction the first differs and the second does not.
    assert find_points(k_sigma, "D") == [(1.5, 0.0, True)] and find_points(dev, "D") == [(1.0, 0.0, False)]
    assert [x for x, *_ in find_points(dev, "o")] == [1.2] and [x for x, *_ in find_points(dev, "|")] == [1.22]
    assert find_points(figure.axes[5], "D") == [(30.0, 0.0, False)]


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
