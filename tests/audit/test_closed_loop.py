"""Tables of the closed loop and of plans from their files."""

import json

import pytest
from made_audits import failed
from made_proofs import audited_proofs, made_proofs

from elastocal.audit import closed_loop


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("closed_loop")
    made_proofs(folder)
    return audited_proofs(folder)


def test_tables_as_the_pipeline_makes_them_hold(run):
    found = [
        *closed_loop.moved(run, "results/closed_loop/kuka.parquet", "kuka"),
        *closed_loop.cases(run, "reports/closed_loop/cases.csv"),
        *closed_loop.together(run, "reports/closed_loop/closed_loop.csv"),
        *closed_loop.goals(run, "reports/closed_loop/goals.csv"),
        *closed_loop.gains(run, "reports/planning/gains.csv"),
    ]
    assert failed(found) == [] and len(found) > 20


def test_a_plan_that_is_worth_something_else_than_its_file_says_is_found(run):
    path = run.folder / "results/planning/ur10.json"
    before = path.read_text()
    path.write_text(json.dumps(json.loads(before) | {"planned_mm": 0.2}))
    found = failed(closed_loop.gains(run, "reports/planning/gains.csv"))
    path.write_text(before)
    assert found == ["figures of ur10"]
