"""Tables on studies and decisions that say something else than the files that they come from are found."""

import numpy as np
import pandas as pd
import pytest
from made_audits import CONFIGURATION, ROBOT, STRATEGY, failed, failed_table, made_run

from elastocal.study.costs import break_even_table, configurations_needed, cost_table
from elastocal.study.study_tables import measured_table
from elastocal_proof.audit import decisions, tables
from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.questions import estimate
from elastocal_proof.audit.scores import errors_of

SETS = {"one": ["hand"], "twice": ["hand", "hand"]}
LENGTHS = np.arange(1, 6)


@pytest.fixture
def run(tmp_path):
    for folder in ("reports/tables", "results/budget", "results/weights", "results/few", "results/studies/as_configured"):
        (tmp_path / folder).mkdir(parents=True)
    configuration = CONFIGURATION | {"questions": {"point_sets": SETS, "accuracies_um": [4.0]}, "switched": {}}
    configuration["tables"] = CONFIGURATION["tables"] | {"k_sigma_limit_percent": 1.0, "deviation_limit_um": 2.0}
    configuration["evaluation"] = CONFIGURATION["evaluation"] | {"studies": 2}
    return Audited(tmp_path, configuration, {"two": ROBOT}, {"hand": STRATEGY}, 4)


@pytest.fixture
def budget(run):
    """Mean squares of four data sets that fall as one over the length, and the weights of three replicates."""
    rows = [
        {"points": points, "data_set": k, "length": n, "mean_square": (1 + 0.1 * k) * 3e-11 / n / factor}
        for points, factor in (("one", 1.0), ("twice", 1.8))
        for k in range(4)
        for n in LENGTHS
    ]
    frame = pd.DataFrame(rows)
    frame.to_parquet(run.folder / "results/budget/two.parquet")
    weights = np.array([[1, 1, 1, 1], [2, 0, 1, 1], [0, 2, 2, 0], [1, 0, 0, 3]])
    drawn = [
        {"members": members, "number": k, "replicate": r, "count": weights[r, k]}
        for members in ("data sets", "test configurations")
        for r in (1, 2, 3)
        for k in range(4)
    ]
    pd.DataFrame(drawn).to_parquet(run.folder / "results/weights/two.parquet")
    return {"two": frame}, SETS, {"two": weights}


@pytest.mark.parametrize("accuracy", [0.5, 1.3, 2.0, 9.0])
def test_configurations_needed_are_interpolated_as_in_the_study(accuracy):
    squares = np.array([np.nan, 8.0, 4.5, 1.5, 1.0, 1.2])
    expected = configurations_needed(squares, accuracy)
    assert decisions.find_needed(pd.Series(squares), accuracy) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("column", "expected"), [("", []), ("ratio_high", ["column ratio_high"]), ("cost", ["column cost"])])
def test_costs_follow_from_the_budget(run, budget, column, expected):
    frames, sets, weights = budget
    table = cost_table(frames, sets, 4.0, weights)
    if column:
        table.loc[3, column] *= 1.001
    assert failed_table(run, decisions, "costs", table) == expected


@pytest.mark.parametrize(("factor", "expected"), [(1.0, []), (1.001, ["column break_even"])])
def test_a_break_even_follows_from_the_budget(run, budget, factor, expected):
    frames, sets, weights = budget
    table = break_even_table(frames, sets, [4.0], weights)
    table = table.assign(break_even=factor * table.break_even)
    assert failed_table(run, decisions, "break_even", table) == expected


@pytest.mark.parametrize(("factor", "expected"), [(1.0, []), (1.001, ["column dev_5_um"])])
def test_table_4_over_studies_follows_from_the_studies(run, factor, expected):
    names = [f"{name}{end}" for name in ("k_sigma", "k_sigma_fixed_joints", "deviation") for end in ("", "_mean_compliance")]
    rows = [
        {"robot": "two", "strategy": "hand alone", "study": study, "length": n, "mean_square": study / n}
        | {name: 1e-6 * (place + study) / n for place, name in enumerate(names, 1)}
        for study in (1, 2, 3)
        for n in LENGTHS
    ]
    frame = pd.DataFrame(rows)
    frame.drop(columns="robot").to_parquet(run.folder / "results/studies/as_configured/two.parquet")
    table = measured_table({"pose": frame}, 5, {"k_sigma": 1.0, "deviation": 2.0})
    table = table.assign(dev_5_um=factor * table.dev_5_um)
    assert failed_table(run, decisions, "table4_studies", table) == expected


@pytest.mark.parametrize(
    ("changed", "expected"),
    [({}, []), ({"below": 2}, ["column below"]), ({"below_p": 0.4}, ["column below_p"]), ({"differ": 0}, ["column differ"])],
)
def test_the_joint_test_counts_the_comparison_and_ranks_among_the_studies(run, changed, expected):
    p_values = [1e-4, 0.2, 0.6]
    comparison = pd.DataFrame({"table": ["3", "4", "4", "text"], "p_value": [*p_values, None]})
    comparison.to_csv(run.folder / "reports/tables/comparison.csv")
    row = {"joints": "fixed joints", "cells": 3, "differ": 1, "below": 1, "statistic": -2 * np.log(p_values).sum()}
    row |= {"below_p": 1 / 3, "statistic_p": 2 / 3, "studies": 2}
    assert failed_table(run, decisions, "joint_test", pd.DataFrame([row | changed])) == expected


@pytest.mark.parametrize(
    ("changed", "expected"), [({}, []), ({"p": 0.7}, ["column p"]), ({"verdict": "perhaps"}, ["column verdict"])]
)
def test_a_claim_that_is_an_order_has_the_share_of_studies_as_p(run, changed, expected):
    row = {"number": 1, "literal": "x", "ours": "best in 3 of 16 studies", "p": 4 / 17, "verdict": "holds in part"}
    assert failed_table(run, decisions, "claims", pd.DataFrame([row | changed])) == expected


@pytest.mark.parametrize("wrong", [False, True])
def test_few_configurations_are_estimated_again(run, wrong):
    made_run(run.folder)
    rows = []
    for data_set in range(4):
        error = (errors_of(run, "two", estimate(run, "two", "hand alone", data_set, 3)[None]) ** 2).mean()
        rows.append({"strategy": "hand alone", "data_set": data_set, "length": 3, "mean_square": error * (1 + 1e-3 * wrong)})
    pd.DataFrame(rows).to_parquet(run.folder / "results/few/two.parquet")
    assert bool(failed(decisions.few(run, "results/few/two.parquet", "two"))) == wrong


def test_every_table_of_decisions_has_a_name_of_its_own():
    assert not set(tables.TABLES) & set(decisions.TABLES)
