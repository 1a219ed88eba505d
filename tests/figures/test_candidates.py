"""Hypotheses, and candidates one by one: what is drawn is what the tables hold."""

import pytest
from drawn_figures import texts
from made_loop_tables import candidate_table, plainly
from made_loop_tables import probabilities as stated

from elastocal.figures.candidates import probabilities


def test_each_hypothesis_has_a_bar_as_long_as_its_probability():
    figure = probabilities(stated(), candidate_table())
    axis = figure.axes[0]
    assert axis.get_xlabel() == "posterior probability (%)"
    named = [label.get_text().replace("\n", " ") for label in axis.get_yticklabels()]
    assert named == [
        "Lost motion (backlash) of joint 3",
        "Bearing tilt of joint 2",
        "Nothing is missing",
        "Everything else",
    ]
    assert [bar.get_width() for bar in axis.patches] == pytest.approx([94, 5, 0.4, 0.6])
    assert [plainly(text.get_text()) for text in axis.texts] == ["94 %", "5 %", "< 1 %", "1 %"]
    certain = probabilities(stated([({"lost_motion": ["joint 3"]}, 0.9961), ({}, 0.0039)]), candidate_table(count=3)).axes[0]
    assert [plainly(text.get_text()) for text in certain.texts] == ["> 99 %", "< 1 %"]


def test_of_many_hypotheses_the_leading_have_bars_and_the_rest_has_one():
    sets = [({f"effect_{number}": []}, 0.1) for number in range(10)]
    axis = probabilities(stated(sets), candidate_table()).axes[0]
    assert [bar.get_width() for bar in axis.patches] == pytest.approx([10] * 8 + [20])


def test_where_nothing_can_be_tested_the_figure_says_so():
    figure = probabilities(stated([({}, 1.0)]), candidate_table(count=0, chosen=0))
    assert texts(figure) == ["None of 5 candidate causes can be tested with these measurements."]
