"""The log odds of a diagnosis follow from the columns that its document has."""

import json

import numpy as np
from analysed_robots import ROBOTS
from made_folders import make_folder, make_table

from elastocal.loop.traced_evidence import trace_evidence
from elastocal.loop.whole import read_cases
from elastocal_proof.audit.probabilities import TracedEvidence


def trace(robot, table, folder):
    training, _ = read_cases(make_folder(folder, robot, table=table), ROBOTS)
    return trace_evidence(training, 1)


def test_log_odds_follow_from_the_traced_columns(kuka, tmp_path):
    table = make_table(kuka, "made", offset_of_joint_3=5e-4)
    document = json.loads(json.dumps(trace(kuka, table, tmp_path / "offset")))
    evidence = TracedEvidence(document)
    best = evidence.models[:3]
    (nothing,) = [model for model in evidence.models if not model["terms"]]
    base = evidence.compute_log_evidence(nothing)
    odds = [
        evidence.compute_log_evidence(model) - base + evidence.compute_log_prior(model)
        for model in best
    ]
    stated = [model["log_odds"] - nothing["log_odds"] for model in best]
    np.testing.assert_allclose(odds, stated, atol=0.1)
    names = [term["mechanism"] for term in evidence.list_terms(best[0])]
    assert names == ["joint_offset"]


def test_data_at_fault_have_no_evidence(kuka, tmp_path):
    table = make_table(kuka, "made")
    table["q3"] = -table["q3"]
    assert trace(kuka, table, tmp_path / "sense") == {}
