"""Shares of the outcomes against the angle between near relatives are stacked bars, a panel for each pair."""

import pandas as pd
import pytest
from drawn_figures import assert_nothing_cut_off, legend_entries
from matplotlib.colors import to_hex

from elastocal_proof.figures.sweep import sweep

OUTCOMES = ["right", "class", "wrong", "other"]


def of_bins(*rows):
    """The table of rows (pair, upper end of the bin, cases, shares of the outcomes)."""
    return pd.DataFrame(rows, columns=["pair", "angle_up_to_deg", "cases", *OUTCOMES])


TABLE = of_bins(
    ("all", 5.0, 4, 0.25, 0.5, 0.25, 0.0),
    ("all", 20.0, 2, 1.0, 0.0, 0.0, 0.0),
    ("link_weight / payload", 20.0, 2, 0.0, 0.0, 0.5, 0.5),
)


def test_outcomes_of_a_bin_are_stacked_from_the_right_name_upwards():
    figure = sweep(TABLE)
    bars = [(bar.get_x() + 0.4, bar.get_y(), bar.get_height()) for bar in figure.axes[0].patches]
    expected = [(0, 0, 0.25), (1, 0, 1), (0, 0.25, 0.5), (1, 1, 0), (0, 0.75, 0.25), (1, 1, 0), (0, 1, 0), (1, 1, 0)]
    assert bars == [pytest.approx(bar) for bar in expected]
    faces = [to_hex(bar.get_facecolor()) for bar in figure.axes[0].patches]
    assert len(set(faces)) == 4 and faces[::2] == faces[1::2]
    assert legend_entries(figure) == ["right name", "class that holds it", "wrong name", "other verdict"]


def test_each_pair_has_a_panel_in_which_a_bin_keeps_its_place():
    figure = sweep(TABLE)
    assert [axis.get_title() for axis in figure.axes] == ["all", "link weight /\npayload", "", ""]
    assert [axis.axison for axis in figure.axes] == [True, True, False, False]
    pair = figure.axes[1]
    assert {round(bar.get_x() + 0.4) for bar in pair.patches} == {1}
    assert [label.get_text() for label in pair.get_xticklabels()] == ["5", "20"]
    assert [(text.get_text(), text.get_position()[0]) for text in figure.axes[0].texts] == [("4", 0), ("2", 1)]
    assert pair.get_xlabel() == "angle up to (°)" and figure.axes[0].get_ylabel() == "share of cases"
    assert_nothing_cut_off(figure)
