"""Facts about the research questions follow from their tables, with their intervals."""

from made_study_tables import designs, ladder, observability, pairs, question_facts

from elastocal.report.question_answers import brief_names, design_facts, ladder_rows, strategy_rows, summaries
from elastocal.study.strategies import Stage, Strategy


def test_names_are_as_brief_as_tells_robots_apart_and_keep_what_a_longer_one_adds():
    titles = {"kuka": "KUKA KR 270", "extended": "KUKA KR 270 with elastic links", "fanuc": "FANUC R-2000iC/165F"}
    assert brief_names(titles) == {"kuka": "KUKA", "extended": "KUKA with elastic links", "fanuc": "FANUC"}
    assert brief_names(titles | {"large": "KUKA KR 500"})["kuka"] == "KUKA KR 270"
    assert brief_names({"one": "Robot", "other": "Robot"}) == {"one": "Robot", "other": "Robot"}


def test_a_strategy_is_told_stage_by_stage_with_the_numbers_of_its_joints():
    stages = (Stage(("3DoF", "6DoF"), (0, 1, 2)), Stage(("6DoF",), (3, 5), fixed=(0,)))
    assert strategy_rows([Strategy("x", stages)]) == [
        {"name": "x", "stages": "3DoF and 6DoF → c1–c3; then 6DoF → c4, c6, c1 fixed"}
    ]


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


def test_designs_are_compared_at_the_size_nearest_to_the_length():
    some = designs()[designs().joint_range == "limits"]
    kuka = design_facts(some, 19, 60.0, {"kuka": "Kuka"})[0]
    compared = {"title": "Kuka", "length": "20", "random": "80.0", "chosen": "40.0", "gain": "2.00"}
    assert kuka == compared | {"efficiency": "81", "chosen_needed": "20"}
    assert design_facts(some, 20, 1.0, {"kuka": "Kuka"})[0]["chosen_needed"] == "more than all"


def test_places_are_summed_up_by_their_extremes_and_by_what_is_certain():
    kuka = question_facts()["places"][0]
    assert kuka["least"] == "1.05 (1.03 to 1.07; on the bar +y)" and kuka["largest"] == "1.42 (1.40 to 1.44; behind joint 1)"
    assert (kuka["better"], kuka["places"], kuka["turned"], kuka["fixed"]) == ("0", "4", "50", "15")


def test_loads_and_places_are_stated_as_the_configuration_has_them():
    assert question_facts()["stated"]["tracker_m"] == "4, 0, 1.5" and question_facts()["stated"]["force_N"] == "1000"


def test_tubes_have_the_scatter_between_data_sets():
    (row,) = question_facts()["tubes"]
    assert [*row.values()] == ["248", "1.75 ± 0.12", "1.19 ± 0.10", "5.73 ± 0.83", "459.7 ± 1.1"]


def test_summaries_count_what_is_certain():
    found = summaries(ladder(), pairs(), observability())
    assert (found["excess_median"], found["excess_largest"]) == ("10", "10")
    # The interval of the second ratio holds one.
    assert (found["sets"], found["worse"], found["least"], found["largest"]) == ("2", "1", "1.03", "1.10")
    assert (found["best_index"], found["condition"]) == ("O1", "+0.30")


def test_assumptions_are_worded_with_noise_and_leak():
    found = question_facts()
    assert [*found["geometry"][0].values()] == ["kuka", "at once", "500", "300", "400", "8.2; 70", "32; 0"]
    assert [*found["weighting"][0].values()] == ["kuka", "3", "50", "150.0", "100.0", "1.50"]
