"""Facts about the research questions follow from their tables, with their intervals."""

from made_study_tables import ladder, question_facts

from elastocal.report.question_answers import ladder_rows


def test_the_ladder_names_the_best_number_of_springs_beside_what_was_chosen():
    (row,) = ladder_rows(ladder())
    assert [*row.values()] == ["200", "20", "40.00 ± 0.50", "20.00 ± 0.40", "1", "22.00 ± 0.50"]


def test_sets_of_points_have_both_budgets_and_a_ratio_where_they_are_compared():
    first, second = question_facts()["budget"][:2]
    assert [*first.values()] == ["kuka", "6DoF", "79.00 ± 0.50", "40", "52.00 ± 0.50", ""]
    assert [*second.values()] == ["kuka", "3+6DoF", "57.00 ± 0.50", "20", "57.00 ± 0.50", "1.100 (1.050 to 1.150)"]


def test_lengths_have_their_interval_and_say_where_they_are_not_reached():
    kuka, fanuc = question_facts()["needed"]
    assert [*kuka.values()] == ["kuka", "6DoF", "32 (30 to 34)", "32", "32"]
    assert fanuc["configurations"] == "more than all (90 to more than all)"


def test_places_are_summed_up_by_their_extremes_and_by_what_is_certain():
    kuka = question_facts()["places"][0]
    assert kuka["least"] == "1.05 (1.03 to 1.07; on the bar +y)" and kuka["largest"] == "1.42 (1.40 to 1.44; behind joint 1)"
    assert (kuka["better"], kuka["places"], kuka["turned"], kuka["fixed"]) == ("0", "4", "50", "15")
