"""The next experiment: it promises what measurements bring on average, and resolves an exact alias where that is possible."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from open_alternatives import LADDER, SETTINGS, diagnosed, limits, pieces
from planted import planted

from elastocal.diagnosis import new_states
from elastocal.diagnosis.alternatives import Promise
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.next_experiment import (
    DATA_AT_FAULT,
    NOT_DISTINGUISHABLE,
    NOTHING_AMBIGUOUS,
    Proposal,
    facts_of,
    propose,
    sentence_of,
    table_of,
)


def test_proposal_separates_half_as_much_again_as_random_poses_and_resolves_more(ambiguous, proposal, kuka):
    models, instrument, reach = pieces(ambiguous[0], kuka, LADDER)
    models = [model for model in models if model.name not in proposal.indistinguishable]
    promise, rng, found = Promise(models, np.random.default_rng(2)), np.random.default_rng(3), []
    for _ in range(8):
        entries = new_states.drawn(reach, 10, rng)
        total = instrument.information(entries, range(instrument.own)).sum(axis=0)
        logs = promise.log_factors(total)
        found.append((promise.separations(logs)[1:].min(), promise.resolved(logs)))
    separation, resolved = np.mean(found, axis=0)
    assert proposal.separation[-1] > 1.5 * separation and proposal.resolved[-1] > resolved + 0.1, (separation, resolved)
    assert (np.diff(proposal.separation) > -0.3).all() and proposal.separation[-1] > proposal.separation[0]


def test_of_an_exact_alias_no_pose_is_asked_for(kuka):
    """The same law under two names; nothing tells them apart, and no pose is asked for."""
    names = ("compensator_torque", "transmission_harmonic")
    campaign = planted(kuka, {"compensator_torque@2": (1e-4, 1e-4, 5e-5, 5e-5)}, poses=15)
    diagnosis = diagnosed(campaign, kuka, ["compensator_torque@2", "transmission_harmonic@2[orders 1-2]"])
    found = propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0), 4)
    assert found.reason == "not distinguishable with this robot and tracker" and not len(found)
    assert {found.best, *found.indistinguishable} >= {(name,) for name in names}
    assert names[0] in sentence_of(found) and sentence_of(found).endswith("tracker.")
    assert json.loads(json.dumps(facts_of(found), allow_nan=False))["reason"] == found.reason
    table = table_of(found, kuka)
    assert table.empty and list(table.columns[:5]) == ["effect", "pose", "load", "point", "q1"]


def test_nothing_is_proposed_where_nothing_is_ambiguous(kuka):
    # So many poses that something unknown beside it has less than what is left open.
    campaign = planted(kuka, {"joint_offset@3": (2e-3,)}, poses=40)
    diagnosis = diagnosed(campaign, kuka, ["joint_offset@3", "payload"])
    assert propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0)).reason == NOTHING_AMBIGUOUS
    quiet = SimpleNamespace(**vars(diagnosis) | {"evidence": None})
    assert propose(quiet, limits(kuka), SETTINGS, np.random.default_rng(0)).reason == DATA_AT_FAULT


def made(weighed=(False, True), **changes):
    """Two poses of six joints, the second under a weight."""
    wrench = np.array([[0.0, 300.0, -400.0, 1.0, 2.0, 3.0], [0.0, 0.0, -980.665, 0.0, 0.0, 0.0]])
    plain = Proposal(
        best=("joint_tilt",),
        nearest=("link_elasticity", OTHER),
        entries=new_states.Entries(np.arange(12.0).reshape(2, 6) / 10, wrench, None, np.array(weighed)),
        senses=np.array([[1.0, -1.0] * 3, [-1.0, 1.0] * 3]),
        shares=(0.0, 1.0),
        points=("3DoF", "6DoF"),
        separation=np.array([4.25, 17.5]),
        resolved=np.array([0.3, 0.87]),
        present=1.5,
        poses_needed=3,
    )
    return replace(plain, **changes)


def test_rows_of_the_table_are_poses_in_the_angles_of_the_controller_with_their_loads_approaches_and_what_they_add(kuka):
    robot = replace(kuka, reported_matrix=np.diag([1.0, -1, 1, 1, 1, 1]), reported_offset=np.full(6, 0.1))
    proposal = made()
    table = table_of(proposal, robot)
    angles = table[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    np.testing.assert_allclose(angles @ robot.reported_matrix.T + robot.reported_offset, proposal.entries.joint_angles)
    np.testing.assert_array_equal(table[["fx", "fy", "fz", "mx", "my", "mz"]], proposal.entries.wrench)
    np.testing.assert_array_equal(table[[f"approach{joint}" for joint in range(1, 7)]], proposal.senses)
    assert table["separation"].tolist() == [4.25, 17.5] and table["resolved"].tolist() == [0.3, 0.87]
    assert table["separation_without"].tolist() == [1.5, 1.5] and list(table["pose"]) == [0, 1]
    assert (table["load"] == 1).all() and (table["point"] == "3DoF 6DoF").all()
    assert table["effect"][0] == "joint_tilt or link_elasticity with a related mechanism"
    assert table["reference_weight_kg"].tolist() == [0.0, pytest.approx(100.0)]
    bare = table_of(made((False, False), senses=None), kuka)
    assert not any(name.startswith(("approach", "reference")) for name in bare)
    # Where nothing is asked for, the table has the same columns.
    assert list(table_of(Proposal(("joint_tilt",), reason=DATA_AT_FAULT), kuka).columns) == list(bare.columns)


def test_the_sentence_has_the_figures_after_all_poses_and_what_is_left_aside(kuka):
    assert sentence_of(made()) == (
        "2 further poses, each measured at 0, 1 times its load, separate joint_tilt from link_elasticity with a related "
        "mechanism by 17.5 and resolve the verdict at 19:1 with a probability of 87%; 90% needs 3 poses."
    )
    proposal = made(poses_needed=None, indistinguishable=(("payload",), ("joint_tilt", "hysteresis"), (OTHER,)))
    sentence = sentence_of(proposal)
    assert "90% needs more than 100 poses." in sentence
    assert f"joint_tilt and payload, a mechanism that the catalogue lacks are {NOT_DISTINGUISHABLE}." in sentence
    assert f"Whether hysteresis acts beside joint_tilt is {NOT_DISTINGUISHABLE}." in sentence
    aside = "payload; joint_tilt and hysteresis; a mechanism that the catalogue lacks"
    assert set(table_of(proposal, kuka)["indistinguishable"]) == {aside}


def test_without_poses_there_is_a_reason_and_no_figure():
    none = Proposal((), reason=DATA_AT_FAULT)
    facts = json.loads(json.dumps(facts_of(none), allow_nan=False))
    assert facts["sentence"] == f"No further measurement is proposed: {DATA_AT_FAULT}."
    assert (facts["poses"], facts["separation"], facts["resolved"], facts["poses_needed"]) == (0, None, None, None)
