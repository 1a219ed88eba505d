"""Tables of bad rows from their files."""

import pandas as pd
import pytest
from made_audits import failed
from made_proofs import audited_proofs, made_proofs

from elastocal.audit import bad_rows

CASES, SUMMARY = "reports/bad_rows/cases.csv", "reports/bad_rows/summary.csv"


@pytest.fixture
def run(tmp_path):
    made_proofs(tmp_path)
    return audited_proofs(tmp_path)


def test_tables_as_the_pipeline_makes_them_hold(run):
    found = [*bad_rows.cases(run, CASES), *bad_rows.rates(run, SUMMARY)]
    assert failed(found) == [] and len(found) == 8


def test_a_slip_that_is_not_in_the_table_is_found(run):
    path = run.folder / CASES
    pd.read_csv(path).iloc[1:].to_csv(path, index=False)
    assert failed(bad_rows.cases(run, CASES)) == ["every slip once"]


def test_a_rate_of_other_slips_is_found(run):
    path = run.folder / SUMMARY
    table = pd.read_csv(path)
    table.loc[table["quantity"] == "row named", "rate"] *= 0.99
    table.to_csv(path, index=False)
    assert failed(bad_rows.rates(run, SUMMARY)) == ["row named, with limits"]
