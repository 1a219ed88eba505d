"""Folds and entries of a league, and its table."""

import pytest
from made_audits import failed
from made_proofs import audited_proofs, made_proofs

from elastocal.audit import league


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("league")
    made_proofs(folder)
    return audited_proofs(folder)


def test_a_league_as_the_pipeline_makes_it_holds(run):
    found = [
        *league.folds(run, "results/league/one/folds.parquet", "one"),
        *league.entries(run, "results/league/one/random/half.parquet", "one", "random"),
        *league.table(run, "reports/league/small/league.csv", "small"),
        *league.mechanism_table(run, "reports/league/small/mechanisms.csv", "small"),
    ]
    assert failed(found) == [] and len(found) > 20


def test_another_seed_deals_other_folds(run):
    run.configuration["seed"] = 2
    found = failed(league.folds(run, "results/league/one/folds.parquet", "one"))
    run.configuration["seed"] = 1
    assert found == ["random folds"]


def test_entries_of_a_session_are_of_another_data_set(run):
    found = league.entries(run, "results/league/one/random/half.parquet", "one", "session")
    assert failed(found) == ["another data set is predicted"]
