"""What the text states about studies and decisions, from tables with round figures."""

from made_study_tables import TITLES, few, joint, measured, simulated

from elastocal.report.decision_answers import (
    few_rows,
    joint_rows,
    measured_rows,
    simulated_design_rows,
    smallest_designs,
    study_facts,
)


def test_table_4_has_a_row_for_each_estimator_and_columns_for_each_kind():
    rows = measured_rows(measured(), TITLES)
    assert [(row["robot"], row["strategy"]) for row in rows][:2] == [("Kuka", "6DoF"), ("Kuka", "2DoF+6DoF")]
    assert rows[0]["pose stiffness 0"] == "4.00 ± 0.40" and rows[0]["fixed 0"] == "2.00 ± 0.40"
    assert rows[0]["pose compliance 2"] == "2.00 ± 0.80" and rows[0]["one reflector stiffness 1"] == "800 ± 20"


def test_the_classical_strategy_is_compared_with_the_best():
    found = study_facts(measured(), "kuka", "6DoF", "2DoF+6DoF")
    assert found["hidden"] == "10.0" and found["ratio"] == "4.00" and found["one_k"] == "40.00 ± 0.40"


def test_the_joint_test_states_ranks_among_studies():
    row = joint_rows(joint())[0]
    assert (row["below"], row["below_studies"], row["below_p"]) == ("9", "3 (to 7)", "0.06")
    assert (row["statistic"], row["statistic_studies"], row["statistic_p"]) == ("171", "120 (to 218)", "0.12")


def test_designs_are_given_by_load_with_what_is_not_observable():
    rows = simulated_design_rows(simulated(), 20, TITLES)
    assert [row["unobservable"] for row in rows[:2]] == ["none", "joint 1"]
    assert smallest_designs(simulated(), 60.0, TITLES)[0]["configurations"] == "20"
    assert smallest_designs(simulated(), 1.0, TITLES)[0]["configurations"] == "more than all"


def test_a_strategy_without_a_prior_has_one_row():
    rows = few_rows(few(), TITLES)
    told = [(row["strategy"], row["error"]) for row in rows[:3]]
    assert told == [("6DoF", "any"), ("6DoF shrunk", "10"), ("6DoF shrunk", "100")]
