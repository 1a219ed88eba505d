"""Every number that the text of the study's report states follows from its tables, with its standard error."""

import json

import numpy as np
import pandas as pd
import pytest
from made_study_tables import comparison, facts, metrics, per_dataset


def test_facts_can_be_written_as_json():
    assert json.loads(json.dumps(facts(), allow_nan=False)) == facts()


def test_cells_within_are_those_of_tables_2_to_4_at_no_more_than_the_accepted_distance():
    found = facts()
    assert (found["accepted_z"], found["cells"], found["within"], found["within_percent"]) == ("2.5", "7", "3", "43")
    assert found["by_table"] == [
        {"table": "2", "cells": "3", "within": "1"},
        {"table": "3", "cells": "1", "within": "1"},
        {"table": "4", "cells": "3", "within": "1"},
    ]


def test_every_cell_outside_is_listed_with_what_could_explain_it():
    found = facts()
    assert [list(row.values()) for row in found["outside"]] == [
        ["Table 2: deviation_mean", "kuka", "", "1.1", "1.000 ± 0.020", "-5.0", "a"],
        ["Table 2: deviation_max", "other", "", "3", "", "", "a"],
        ["Table 4: k_sigma_20", "kuka", "6DoF", "1.5", "1.80 ± 0.10", "+3.0", "c"],
        ["Table 4: n_dev_2_um", "fanuc", "6DoF", "30", "not reached", "", "d"],
    ]
    # A letter that no cell refers to is not explained.
    assert list(found["explanations"]) == ["a", "c", "d"]


def test_a_cell_of_table_3_outside_refers_to_its_own_explanation():
    table = comparison()
    table.loc[table.table == "3", "z"] = -2.6
    found = facts(comparison=table)
    assert [row["why"] for row in found["outside"]] == ["a", "a", "b", "c", "d"] and "1/ĉ" in found["explanations"]["b"]


def test_figures_of_the_papers_text_that_are_not_studied_are_marked():
    assert facts()["text_figures"] == [
        {"figure": "deviation ratio", "paper": "4", "ours": "3.90 ± 0.10", "interpretation": "R8"},
        {"figure": "share with links", "paper": "92", "ours": "not studied", "interpretation": ""},
    ]


def test_table_2_is_compared_with_single_data_sets_of_the_robots_that_were_studied():
    # One data set has 1.05 +- 0.05 mm, so that the printed 1.1 mm is one standard deviation above.
    expected = {"robot": "kuka", "quantity": "mean", "paper": "1.100", "all": "1.000", "one": "1.05 ± 0.05", "z": "-1.0"}
    assert facts()["one_set"] == [expected]


def test_a_robot_has_its_best_and_its_worst_strategy_with_deviations_in_micrometres():
    kuka, fanuc = facts()["robots"]
    assert (kuka["title"], fanuc["title"]) == ("Kuka", "Fanuc")
    assert (kuka["best"], kuka["worst"]) == ("2DoF+6DoF", "6DoF")
    assert (kuka["dev_classical"], kuka["dev_best"], kuka["dev_worst"]) == ("2.00 ± 0.10", "0.500 ± 0.025", "2.00 ± 0.10")
    # 2 of 1000 um are left.
    assert kuka["share"] == "99.8"
    # Replicates of 4 and 4.4.
    assert kuka["ratio"] == "4.00 ± 0.28"


def test_strategies_that_differ_by_rounding_alone_are_the_first_one_listed():
    table = metrics()
    table["deviation"] = 2e-6 * np.where(table.strategy == "6DoF", 1.0, 1 - 1e-9)
    assert {robot["best"] for robot in facts(metrics=table)["robots"]} == {"6DoF"}


def test_the_error_of_one_data_set_is_that_of_the_noise_and_the_length_of_the_tables():
    kuka = facts()["robots"][0]
    assert (kuka["single_classical"], kuka["single_best"]) == ("54.00 ± 0.50", "36.00 ± 0.50")
    assert (kuka["p95_classical"], kuka["p95_best"]) == ("90.0 ± 1.2", "60.0 ± 1.2")
    assert kuka["hidden"] == "27.0"
    assert (kuka["efficiency_best"], kuka["efficiency_worst"]) == ("50.0 ± 1.2", "23.3 ± 1.2")
    assert kuka["lowest_efficiency"] == "6DoF"


@pytest.mark.parametrize(
    "scale, lengths", [(1.0, ("20", "20")), (0.75, ("20", "10")), (0.4, ("10", "10")), (1.2, (None, "20"))]
)
def test_repeatability_is_reached_at_the_fewest_configurations_whose_rms_is_within_it(scale, lengths):
    table = per_dataset()
    kuka = facts(per_dataset=table.assign(rms_um=scale * table.rms_um))["robots"][0]
    assert facts()["repeatability_um"] == "60"
    assert (kuka["repeatable_classical"], kuka["repeatable_best"]) == (lengths[0] or "more than all", lengths[1])


def test_the_largest_noise_has_its_own_figures_at_the_length_of_the_tables():
    noisiest = metrics(500.0, 0.012, 0.4)
    noisiest.loc[noisiest.length == 10, ["nonpositive_share", "relative_spread"]] = 0.9
    kuka = facts(noisiest=noisiest)["robots"][0]
    assert (kuka["noisiest_um"], kuka["noisiest_nonpositive"], kuka["noisiest_spread"]) == ("500", "1.2", "40")


def test_elastic_links_and_solvers_are_worded():
    found = facts()
    assert found["extended"] == [
        {
            "strategy": "6DoF",
            "initial_mean_mm": "1.234 ± 0.011",
            "residual_mean_um": "366",
            "share_compensated_percent": "70.00 ± 0.50",
        }
    ]
    (solver,) = found["solvers"]
    assert [*solver.values()] == ["kuka", "6DoF", "2DoF+6DoF", "2e-03", "0e+00", "2e-04"]
    assert facts(extended=pd.DataFrame(columns=["robot", "strategy"]))["extended"] == []
