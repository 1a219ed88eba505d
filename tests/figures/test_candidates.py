"""Hypotheses, candidates one by one, and which of them contribute alike: what is drawn is what the tables hold."""

from types import SimpleNamespace

import numpy as np
import pytest
from drawn_figures import assert_nothing_cut_off, row_labels, texts
from made_loop_tables import FAMILIES, candidate_table, confounding_table
from made_loop_tables import probabilities as stated
from matplotlib.colors import to_rgba
from synthetic import equipped

from elastocal.effects.catalogue import candidates_on
from elastocal.figures import candidates as drawn
from elastocal.figures.candidates import (
    angle_matrix,
    confounding,
    name_in_pairs,
    probabilities,
    rank_candidates,
    short_name,
    shortlist,
)
from elastocal.loop.diagnosis_tables import candidate_columns


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
    assert [text.get_text() for text in axis.texts] == ["94 %", "5 %", "<1 %", "1 %"]


def test_of_many_hypotheses_the_leading_have_bars_and_the_rest_has_one():
    sets = [({f"effect_{number}": []}, 0.1) for number in range(10)]
    axis = probabilities(stated(sets), candidate_table()).axes[0]
    assert [bar.get_width() for bar in axis.patches] == pytest.approx([10] * 8 + [20])


def test_leading_candidates_have_their_bayes_factor_in_the_colour_of_their_family():
    table = candidate_table()
    table["log_bayes_factor"][:2] = [40.0, 90.0]
    figure = probabilities(stated(), table)
    axis = figure.axes[1]
    assert row_labels(axis)[:2] == ["Effect 1 of joint 2", "Effect 2 of joint 3"]
    order = [1, 2, 3, 4, 5, 6, 7, 8, 0, 9, 10, 11, 12, 13, 14]
    bars = [bar for bar in axis.patches if bar.get_gid() != "chosen"]
    assert [bar.get_width() for bar in bars] == pytest.approx(table["log_bayes_factor"][order].tolist())
    assert [bar.get_facecolor() for bar in bars] == [to_rgba(drawn.FAMILIES[table["family"][index]]) for index in order]
    assert len({*drawn.FAMILIES.values()}) == len(FAMILIES)
    # The chosen one, which the smaller factor put on another row, is outlined there.
    (outlined,) = [bar for bar in axis.patches if bar.get_gid() == "chosen"]
    assert outlined.get_width() == 40.0
    assert any("30 candidate causes tested; 5 more cannot be tested" in text for text in texts(figure))
    assert {"in the most probable model", "geometry"} <= set(texts(figure))


def test_factors_below_and_above_one_stand_on_both_sides_of_zero():
    table = candidate_table(count=15, chosen=0)
    table["log_bayes_factor"][:15] = np.linspace(3, -6, 15)
    axis = probabilities(stated([({}, 1.0)]), table).axes[1]
    low, high = axis.get_xlim()
    assert low < -6 and high > 3 and 0 in axis.get_xticks() and min(axis.get_xticks()) < 0


def test_each_candidate_stands_once_at_its_best_shape():
    table = candidate_table()
    table["candidate"][3] = table["candidate"][1]
    assert 3 not in rank_candidates(table) and 1 in rank_candidates(table)
    assert rank_candidates(table)[0] == 0


def test_confounding_annotates_every_pair_and_marks_what_was_found():
    table = candidate_table(count=12)
    figure = confounding(table, confounding_table(table))
    numbers = [artist for artist in figure.axes[0].texts if artist.get_text().isdigit()]
    assert len(numbers) == 12 * 11
    bold = [label.get_text() for label in figure.axes[0].get_yticklabels() if label.get_fontweight() == "bold"]
    assert bold == ["Effect 0 of joint 1  1"]
    assert figure.axes[1].get_ylabel() == "angle between the contributions (°)"


def test_where_nothing_can_be_tested_the_figures_say_so():
    table = candidate_table(count=0, chosen=0)
    for figure in (probabilities(stated([({}, 1.0)]), table), confounding(table, confounding_table(table))):
        assert texts(figure) == ["None of 5 candidate causes can be tested with these measurements."]


def test_where_the_data_are_at_fault_the_figures_say_so(kuka):
    case = SimpleNamespace(candidates=candidates_on(equipped(kuka.chain)))
    table = candidate_columns(SimpleNamespace(evidence=None, case=case))
    table = {name: np.array(values) for name, values in table.items()}
    for figure in (probabilities(None, table), confounding(table, {"one": [], "other": [], "angle_deg": np.zeros(0)})):
        assert texts(figure) == ["The data are at fault: no cause in the robot was looked for."]


def test_a_single_candidate():
    table = candidate_table(count=1)
    assert_nothing_cut_off(probabilities(stated(), table))


def test_angles_between_candidates_are_symmetric_and_unknown_where_a_pair_is_missing():
    pairs = {"one": ["b", "c", "x"], "other": ["a", "b", "a"], "angle_deg": [30.0, 80.0, 5.0]}
    expected = [[0, 30, np.nan], [30, 0, 80], [np.nan, 80, 0]]
    np.testing.assert_array_equal(angle_matrix(["a", "b", "c"], pairs), expected)


def test_no_angle_is_written_for_a_pair_that_the_table_lacks():
    table = candidate_table(count=4)
    pairs = {name: values[:-1] for name, values in confounding_table(table).items()}
    figure = confounding(table, pairs)
    cells = {text.get_position(): float(text.get_text()) for text in figure.axes[0].texts}
    # Six pairs of four candidates, of which the last stands at 90 degrees.
    assert cells == {
        place: angle
        for (one, other), angle in zip(((0, 1), (0, 2), (1, 2), (0, 3), (1, 3)), (0, 18, 36, 54, 72), strict=True)
        for place in ((one, other), (other, one))
    }
    assert np.ma.count_masked(figure.axes[0].images[0].get_array()) == 2


def test_a_candidate_with_a_shape_is_named_by_its_value_in_the_table_of_pairs():
    table = candidate_table()
    assert name_in_pairs(table, 1) == "effect_1@2 44.7213" and name_in_pairs(table, 0) == "effect_0@1"


def test_a_very_long_name_keeps_its_beginning_and_its_end_in_two_lines():
    short = short_name("a" * 60 + "_" + "b" * 60)
    assert short.replace("\n", " ").startswith("A" + "a" * 30) and short.endswith("b" * 30) and "…" in short
    assert len(short) <= 82 and max(map(len, short.splitlines())) <= 48
    assert short_name("effect_1@2") == "Effect 1 of joint 2"


def test_a_shortlist_has_what_was_found_whatever_its_place_and_no_more_than_there_is_room_for():
    assert shortlist(list(range(30)), np.arange(30) == 25, 5) == [0, 1, 2, 3, 25]
    assert shortlist([4, 2, 0, 1, 3], np.array([True, True, True, True, False]), 2) == [2, 0]
    assert shortlist([4, 2], np.zeros(5, bool), 3) == [4, 2]


def test_a_probability_next_to_one_or_zero_is_not_rounded_to_it():
    axis = probabilities(stated([({"lost_motion": ["joint 3"]}, 0.9961), ({}, 0.0039)]), candidate_table(count=3)).axes[0]
    assert [text.get_text() for text in axis.texts] == [">99 %", "<1 %"]


@pytest.mark.parametrize("highest", [1.0, 40.0, 9000.0])
def test_marks_of_the_bayes_factors_are_rising_round_numbers_within_the_axis(highest):
    table = candidate_table(count=15)
    table["log_bayes_factor"][:15] = np.linspace(highest, -12, 15)
    axis = probabilities(stated(), table).axes[1]
    ticks, (low, high) = axis.get_xticks(), axis.get_xlim()
    assert list(ticks) == sorted(set(ticks)) and 0 in ticks and low <= ticks[0] and ticks[-1] <= high
    assert low < -12 and high > highest
    assert all(f"{abs(tick):.0e}"[0] in "0125" and float(f"{tick:.0e}") == tick for tick in ticks)
    places = axis.transData.transform(np.column_stack([ticks, np.zeros(len(ticks))]))[:, 0]
    assert np.diff(places).min() > 0.06 * axis.bbox.width
