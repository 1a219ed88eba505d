"""Every number that the text of the study's report states follows from its tables, with its standard error."""

import numpy as np
import pandas as pd
import pytest
from made_study_tables import comparison, facts, per_dataset

from elastocal.report.answers import beside_rows


def test_figures_that_differ_are_those_below_the_level_after_correction():
    found = facts()
    names = ("level", "cells", "differ", "below", "below_expected")
    assert [found[name] for name in names] == ["5", "5", "1", "2", "0.2"]
    assert found["by_table"] == [
        {"table": "2", "cells": "1", "differ": "0"},
        {"table": "3", "cells": "1", "differ": "0"},
        {"table": "4", "cells": "3", "differ": "1"},
    ]


def test_every_figure_below_the_level_before_correction_is_listed_beside_the_studies():
    assert [list(row.values()) for row in facts()["outside"]] == [
        ["Table 4: k_Σ at 20 (%)", "kuka", "6DoF", "1.5", "1.75 ± 0.10", "0.0004", "0.002"],
        ["Table 4: dev at 20 (µm)", "kuka", "6DoF", "1", "1.200 ± 0.080", "0.04", "0.16"],
    ]


def test_expectations_are_listed_where_the_paper_prints_a_figure():
    found = facts()
    assert found["studies"] == "16"
    assert [list(row.values()) for row in found["expectations"]] == [
        ["kuka", "6DoF", "k_Σ at 20 (%), fixed joints", "1.80", "1.75 ± 0.10", "1.500", "0.0004"],
        ["kuka", "6DoF", "dev at 20 (µm)", "1.22", "1.20 ± 0.08", "1.000", "0.04"],
    ]


def test_table_2_is_compared_with_single_data_sets_of_the_robots_that_were_studied():
    expected = {"robot": "kuka", "quantity": "mean", "paper": "1.100", "all": "1.000", "one": "1.05 ± 0.05", "p": "0.31"}
    assert facts()["one_set"] == [expected]


def test_a_figure_for_which_the_study_was_fitted_has_no_p_value():
    table = comparison()
    table.loc[table.table == "2", "p_value"] = np.nan
    assert facts(comparison=table)["one_set"][0]["p"] == "fitted"


def test_a_robot_has_its_best_and_its_worst_strategy_with_deviations_in_micrometres():
    kuka, fanuc = facts()["robots"]
    assert (kuka["title"], fanuc["title"]) == ("Kuka", "Fanuc")
    assert (kuka["best"], kuka["worst"]) == ("2DoF+6DoF", "6DoF")
    assert (kuka["dev_classical"], kuka["dev_best"], kuka["dev_worst"]) == ("2.00 ± 0.10", "0.500 ± 0.025", "2.00 ± 0.10")
    # 2 of 1000 um are left.
    assert kuka["share"] == "99.8"
    # Replicates of 4 and 4.4.
    assert kuka["ratio"] == "4.00 ± 0.28"


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


def test_a_printed_figure_stands_beside_ours_and_its_difference_in_standard_deviations():
    columns = ["table", "robot", "strategy", "quantity", "paper", "ours", "mc_std", "z"]
    rows = [("4", "kuka", "6DoF", "dev_20", 8.386, 9.03, 1.15, 0.56), ("1", "kuka", np.nan, "c1", 0.54, np.nan, 0.0, np.nan)]
    scored, without = beside_rows(pd.DataFrame(rows, columns=columns), {"kuka": "KUKA"})
    assert scored["ours"] == "9.0 ± 1.1" and scored["differs"] == "+0.6" and scored["robot"] == "KUKA"
    assert (without["ours"], without["differs"], without["strategy"]) == ("not studied", "", "")
