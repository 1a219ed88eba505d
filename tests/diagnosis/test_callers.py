"""That the rules come to the verdict of the one call, and what a diagnosis is written
as."""

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
def both(kuka, tmp_path_factory):
    """Joint 3 stands a milliradian beyond what it reports; or nothing is missing, so
    that the seed is seen in the alarm."""
    found = {}
    for kind, offset in (("named", 1e-3), ("adequate", 0.0)):
        table = make_table(kuka, "made", plan=PLAN, offset_of_joint_3=offset)
        folder = make_folder(tmp_path_factory.mktemp(kind) / "made", kuka, table=table)
        verdict = as_json(diagnose_folder(folder.as_posix(), ROBOTS.as_posix(), SEED))
        assert verdict["verdict"] == kind
        found[kind] = folder, verdict
    assert [effect["name"] for effect in found["named"][1]["effects"]] == [
        "joint_offset"
    ]
    assert 0.02 < found["adequate"][1]["probabilities"]["alarm_p_value"] < 0.98
    return found


def as_json(document):
    return json.loads(json.dumps(document, allow_nan=False))


def same(one, other, path="verdict"):
    """Equal documents, numbers to what remains where a fit ends: a thousandth of a
    standard error."""
    assert type(one) is type(other) or {type(one), type(other)} <= {int, float}, path
    if isinstance(one, dict):
        assert list(one) == list(other), path
        for key in one:
            same(one[key], other[key], f"{path}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), path
        for number, pair in enumerate(zip(one, other, strict=True)):
            same(*pair, f"{path}[{number}]")
    elif isinstance(one, float):
        assert one == pytest.approx(other, rel=1e-3, abs=1e-9), path
    else:
        assert one == other, path


@pytest.mark.parametrize("kind", ["named", "adequate"])
def test_rules_come_to_the_same_verdict_with_their_tables_between_the_steps(
    kind, both, tmp_path
):
    folder, expected = both[kind]
    run_loop(folder, ROBOTS, tmp_path, ANALYSIS)
    by_rules = json.loads(Path(Files(tmp_path).verdict).read_text(encoding="utf-8"))
    # What to measure next is proposed by the rules alone, beside the verdict.
    del by_rules["next_experiment"]
    same(by_rules, expected)


def test_every_candidate_is_in_the_table_tested_or_with_a_reason(diagnosis):
    table = {
        name: column.to_numpy()
        for name, column in pd.DataFrame(tabulate_candidates(diagnosis)).items()
    }
    assert set(table["candidate"]) == set(diagnosis.case.candidates)
    tested = np.isfinite(table["log_bayes_factor"])
    assert (tested == (table["note"] == "")).all() and tested.any() and not tested.all()
    assert (np.diff(table["log_bayes_factor"][tested]) <= 0).all()
    assert (table["probability"][tested] >= 0).all()
    assert table["candidate"][table["chosen"]].tolist() == ["joint_offset@3"]
    assert table["probability"][table["chosen"]][0] > 0.9
    families = [diagnosis.case.candidates[key].family for key in table["candidate"]]
    assert table["family"].tolist() == families
