"""Tables of the proofs as the pipeline makes them hold; what is altered in them is found."""

import json

import pandas as pd
import pytest
from made_audits import failed
from made_blind_documents import effect, truth, verdict
from made_proofs import audited_proofs, made_proofs
from statsmodels.stats.proportion import proportion_confint

from elastocal_proof.audit import proofs

ONE = truth(("joint_offset", 3))
TWO = truth(("joint_offset", 3), ("payload",))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("proofs")
    made_proofs(folder)
    return audited_proofs(folder)


@pytest.mark.parametrize(
    ("document", "stated", "expected"),
    [
        (ONE, verdict("named", effect("joint_offset", 3)), (True, True, True, True, False)),
        (ONE, verdict("named", effect("payload")), (True, False, False, False, True)),
        (ONE, verdict("class", effect("payload", alternatives=["joint_offset@3"])), (True, False, False, True, False)),
        (ONE, verdict("adequate"), (False, False, False, False, False)),
        (TWO, verdict("several", effect("payload"), effect("joint_offset", 3)), (True, True, False, True, False)),
        # One effect cannot stand for both.
        (
            TWO,
            verdict("several", effect("payload", alternatives=["joint_offset"]), effect("lost_motion", 2)),
            (True, 0, 0, 0, 0),
        ),
        (TWO, verdict("class", effect("payload", alternatives=["joint_offset"]), effect("payload")), (True, 0, 0, True, 0)),
    ],
)
def test_an_outcome(document, stated, expected):
    found = proofs.judge(document, stated)
    assert tuple(found[name] for name in ("detected", "exact", "named_right", "holds_truth", "wrong_name")) == expected


def test_a_misplaced_base_that_is_found_is_no_effect():
    found = proofs.judge(ONE | {"misplaced": {}}, verdict("several", effect("base_placement"), effect("joint_offset", 3)))
    assert (found["verdict"], found["named_right"]) == ("named", True)


@pytest.mark.parametrize(("hits", "cases"), [(3, 7), (1, 200)])
def test_a_rate_has_the_interval_of_clopper_and_pearson(tmp_path, hits, cases):
    """Without a hit it begins at none, and with nothing but hits it ends at all."""
    low, high = proportion_confint(hits, cases, 0.05, "beta")
    rows = [(hits, cases, hits / cases, low, high), (0, 0, None, 0.0, 1.0), (0, 5, 0.0, 0.0, 1 - 0.025**0.2)]
    table = pd.DataFrame([*rows, (5, 5, 1.0, 0.025**0.2, 1.0)], columns=["hits", "cases", "rate", "low", "high"])
    table.to_csv(tmp_path / "rates.csv", index=False)
    assert failed(proofs.rates(audited_proofs(tmp_path), "rates.csv")) == []
    table.assign(low=table["low"] * 1.01).to_csv(tmp_path / "rates.csv", index=False)
    assert failed(proofs.rates(audited_proofs(tmp_path), "rates.csv")) == ["column low"]


@pytest.mark.parametrize(
    ("words", "rate", "low", "high", "expected"),
    [
        ("upper limit below 4 %", 0.01, 0.0, 0.039, (0.0, 0.04, "True")),
        ("upper limit below 4 %", 0.01, 0.0, 0.041, (0.0, 0.04, "False")),
        ("at most 6 %", 0.07, 0.0, 1.0, (0.0, 0.06, "False")),
        ("at least 88 %, lower limit above 85 %", 0.9, 0.84, 1.0, (0.88, 1.0, "False")),
        ("92 to 98 %", 0.95, 0.9, 1.0, (0.92, 0.98, "True")),
        ("within 5 %", 1.04, 1.0, 1.1, (0.0, 1.05, "True")),
    ],
)
def test_a_target_is_the_range_of_its_words(words, rate, low, high, expected):
    found = proofs._target({"target": words, "rate": rate, "low": low, "high": high, "cases": 9})
    assert tuple(found.values()) == expected


def test_a_plan_that_is_worth_something_else_than_its_file_states_is_found(run):
    path = run.folder / "results/planning/ur10.json"
    before = path.read_text()
    path.write_text(json.dumps(json.loads(before) | {"planned_mm": 0.2}))
    found = failed(proofs.gains(run, "reports/planning/gains.csv"))
    path.write_text(before)
    assert found == ["column planned_mm"]


def test_another_seed_deals_other_folds(run):
    run.configuration["seed"] = 2
    found = failed(proofs.folds(run, "results/league/one/folds.parquet", "one"))
    run.configuration["seed"] = 1
    assert found == ["random folds"]


def test_entries_of_a_session_are_of_another_data_set(run):
    found = failed(proofs.entries(run, "results/league/one/random/half.parquet", "one", "session", "half"))
    assert found == ["another data set is predicted"]


def test_a_slip_that_is_not_in_the_table_is_found(run):
    path = run.folder / "reports/bad_rows/cases.csv"
    before = path.read_bytes()
    pd.read_csv(path).iloc[1:].to_csv(path, index=False)
    run.table.cache_clear()
    found = failed(proofs.bad_rows(run, "reports/bad_rows/cases.csv"))
    path.write_bytes(before)
    run.table.cache_clear()
    assert found == ["rows"]
