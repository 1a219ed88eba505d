"""Figures of the benchmark show every data set, method and mechanism once."""

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
    robots = {"A robot": ["one"], "Another": ["two"]}
    return compare_methods(make_results(), robots, "geometry", 1)


def test_each_split_has_a_panel_and_each_method_a_mark_in_the_legend(table):
    figure = draw_method_errors(table, METHODS)
    assert [axis.get_title() for axis in figure.axes] == [
        "random poses",
        "blocks of joint space",
        "another session",
    ]
    assert legend_entries(figure) == [f"{name} in words" for name in METHODS]
    assert row_labels(figure.axes[0]) == ["one\n30 poses", "two\n40 poses"]


def test_a_split_that_no_data_set_has_gets_no_panel(table):
    blocks = table[table["split"] == "blocks"]
    assert len(draw_method_errors(blocks, METHODS).axes) == 1


def draw_two_mechanisms(probability):
    """Figure of one mechanism with this probability, and an improbable one."""
    row = {"robot": "A robot", "data": "one", "share": 0.4}
    table = pd.DataFrame(
        [
            row | {"mechanism": "link_weight", "probability": probability},
            row | {"mechanism": "payload", "probability": 0.1},
        ]
    )
    return draw_mechanisms(table)


def read_texts(axis):
    return [text.get_text() for text in axis.texts]


def test_mechanisms_that_are_improbable_everywhere_are_left_out():
    axis = draw_two_mechanisms(0.9).axes[0]
    assert len(row_labels(axis)) == 1
    assert "40 %" in read_texts(axis)


def test_a_note_replaces_the_figure_if_no_mechanism_is_probable():
    axis = draw_two_mechanisms(0.3).axes[0]
    assert "No data set" in read_texts(axis)[0]
