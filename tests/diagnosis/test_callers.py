"""The rules of the workflow come to the same verdict as one function call, and a
diagnosis lists all its candidates."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from loop_scripts import ANALYSIS, Files, run_loop
from made_folders import PLAN, make_folder, make_table

from elastocal.loop.diagnosis_tables import tabulate_candidates
from elastocal.loop.whole import diagnose_folder

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = ROOT / "config" / "robots"
SEED = 1


@pytest.fixture(scope="module")
def folders_and_verdicts(kuka, tmp_path_factory):
    """Two campaigns and their verdicts. In one, joint 3 stands a milliradian beyond the
    angle that it reports; in the other nothing is missing, so that the p-value of the
    alarm depends on the seed."""
    results = {}
    for verdict, offset in (("class", 1e-3), ("adequate", 0.0)):
        folder = tmp_path_factory.mktemp(verdict) / "made"
        table = make_table(kuka, "made", plan=PLAN, offset_of_joint_3=offset)
        folder = make_folder(folder, kuka, table=table)
        document = diagnose_folder(folder.as_posix(), ROBOTS.as_posix(), SEED)
        document = json.loads(json.dumps(document, allow_nan=False))
        assert document["verdict"] == verdict
        results[verdict] = folder, document
    effects = results["class"][1]["effects"]
    assert [effect["name"] for effect in effects] == ["joint_offset"]
    p_value = results["adequate"][1]["probabilities"]["alarm_p_value"]
    assert 0.02 < p_value < 0.98
    return results


def assert_equal_documents(first, second, path="verdict"):
    """Compare documents. Numbers may differ by as much as a converged fit does, a
    thousandth of a standard error."""
    types = {type(first), type(second)}
    assert len(types) == 1 or types <= {int, float}, path
    if isinstance(first, dict):
        assert list(first) == list(second), path
        for key in first:
            assert_equal_documents(first[key], second[key], f"{path}.{key}")
    elif isinstance(first, list):
        assert len(first) == len(second), path
        for number, pair in enumerate(zip(first, second, strict=True)):
            assert_equal_documents(*pair, f"{path}[{number}]")
    elif isinstance(first, float):
        assert first == pytest.approx(second, rel=1e-3, abs=1e-9), path
    else:
        assert first == second, path


@pytest.mark.parametrize("verdict", ["class", "adequate"])
def test_rules_with_tables_between_the_steps_come_to_the_same_verdict(
    verdict, folders_and_verdicts, tmp_path
):
    folder, expected = folders_and_verdicts[verdict]
    run_loop(folder, ROBOTS, tmp_path, ANALYSIS)
    by_rules = json.loads(Path(Files(tmp_path).verdict).read_text(encoding="utf-8"))
    # Only the rules propose the next experiment.
    del by_rules["next_experiment"]
    assert_equal_documents(by_rules, expected)


def test_the_table_lists_every_candidate_as_tested_or_with_a_reason(diagnosis):
    table = pd.DataFrame(tabulate_candidates(diagnosis))
    assert set(table["candidate"]) == set(diagnosis.case.candidates)
    is_tested = np.isfinite(table["log_bayes_factor"])
    assert (is_tested == (table["note"] == "")).all()
    assert is_tested.any()
    assert not is_tested.all()
    assert (np.diff(table["log_bayes_factor"][is_tested]) <= 0).all()
    assert (table["probability"][is_tested] >= 0).all()
    chosen = table[table["chosen"]]
    assert chosen["candidate"].tolist() == ["joint_offset@3"]
    assert chosen["probability"].iloc[0] > 0.9
    families = [diagnosis.case.candidates[key].family for key in table["candidate"]]
    assert table["family"].tolist() == families
