"""The pictures of the league show every data set, method and mechanism once."""

import pandas as pd
import pytest
from drawn_figures import legend_entries, row_labels
from made_leagues import make_results

from elastocal_proof.figures.league import draw_mechanisms, draw_method_errors
from elastocal_proof.league.methods import Method
from elastocal_proof.league.table import compare_methods

METHODS = {
    name: Method("geometry", words=f"{name} in words")
    for name in ("geometry", "half", "process")
}


@pytest.fixture(scope="module")
def table():
    return compare_methods(
        make_results(), {"A robot": ["one"], "Another": ["two"]}, "geometry", 1
    )


def test_each_split_has_a_panel_and_each_method_a_mark_in_the_legend(table):
    figure = draw_method_errors(table, METHODS)
    assert [axis.get_title() for axis in figure.axes] == [
        "random poses",
        "blocks of joint space",
        "another session",
    ]
    assert legend_entries(figure) == [f"{name} in words" for name in METHODS]
    assert row_labels(figure.axes[0]) == ["one\n30 poses", "two\n40 poses"]
    assert len(draw_method_errors(table[table["split"] == "blocks"], METHODS).axes) == 1


def mechanisms(probability):
    row = {"robot": "A robot", "data": "one", "probability": probability, "share": 0.4}
    return pd.DataFrame(
        [
            row | {"mechanism": "link_weight"},
            row | {"mechanism": "payload", "probability": 0.1},
        ]
    )


def test_mechanisms_that_are_nowhere_probable_are_left_out():
    figure = draw_mechanisms(mechanisms(0.9))
    labels = row_labels(figure.axes[0])
    assert len(labels) == 1 and "40 %" in [
        text.get_text() for text in figure.axes[0].texts
    ]
    assert "No data set" in draw_mechanisms(mechanisms(0.3)).axes[0].texts[0].get_text()
