"""A proposal as a table for whoever drives the robot, and in words."""

import json
from dataclasses import replace

import numpy as np
import pytest
from open_alternatives import LADDER

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.proposal import (
    DATA_AT_FAULT,
    NOT_DISTINGUISHABLE,
    NOTHING_MISSING,
    Proposal,
    facts_of,
    sentence_of,
    table_of,
    without_poses,
    words,
)


def made(**changes):
    """Two poses of six joints, the second under a weight."""
    plain = Proposal(
        joint_angles=np.arange(12.0).reshape(2, 6) / 10,
        wrench=np.array([[0.0, 300.0, -400.0, 1.0, 2.0, 3.0], [0.0, 0.0, -980.665, 0.0, 0.0, 0.0]]),
        approach=np.array([[1.0, -1.0] * 3, [-1.0, 1.0] * 3]),
        reference_weight=np.array([False, True]),
        shares=(0.0, 1.0),
        points=("3DoF", "6DoF"),
        separation=np.array([4.25, 17.5]),
        resolved=np.array([0.3, 0.87]),
        present=1.5,
        poses_needed=3,
        best=("joint_tilt",),
        nearest=("link_elasticity", OTHER),
        indistinguishable=(),
        reason="",
    )
    return replace(plain, **changes)


def test_table_is_in_the_angles_of_the_controller(ambiguous, proposal, kuka):
    robot = replace(kuka, reported_matrix=np.diag([1.0, -1, 1, 1, 1, 1]), reported_offset=np.full(6, 0.1))
    table = table_of(proposal, robot)
    angles = table[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    np.testing.assert_allclose(angles @ robot.reported_matrix.T + robot.reported_offset, proposal.joint_angles)
    assert (table["load"] == 1).all() and (table["point"] == "3DoF 6DoF").all() and list(table["pose"]) == list(range(10))
    assert " or " in table["effect"][0] and table["separation_without"].nunique() == 1
    assert "10 further poses, each measured at 0, 1, -1 times its load, separate" in sentence_of(proposal)


def test_a_weight_is_asked_for_in_kilograms_where_it_hangs_and_nowhere_else(kuka):
    table = table_of(made(), kuka)
    assert table["reference_weight_kg"].tolist() == [0.0, pytest.approx(100.0)]
    assert "reference_weight_kg" not in table_of(made(reference_weight=np.zeros(2, bool)), kuka)


def test_wrenches_approaches_and_what_each_pose_adds_are_in_the_rows_of_their_poses(kuka):
    proposal = made()
    table = table_of(proposal, kuka)
    np.testing.assert_array_equal(table[["fx", "fy", "fz", "mx", "my", "mz"]], proposal.wrench)
    np.testing.assert_array_equal(table[[f"approach{joint}" for joint in range(1, 7)]], proposal.approach)
    assert table["separation"].tolist() == [4.25, 17.5] and table["resolved"].tolist() == [0.3, 0.87]
    assert table["separation_without"].tolist() == [1.5, 1.5]
    assert table["effect"][0] == "joint_tilt or link_elasticity with a related mechanism"
    assert not any(name.startswith("approach") for name in table_of(made(approach=None), kuka))
    unloaded = table_of(made(wrench=np.array([[0.0] * 6, [0.0] * 5 + [2.0]])), kuka)
    assert unloaded["load"].tolist() == [0, 1]


def test_alternatives_that_are_left_aside_are_in_the_table_as_in_the_sentence(kuka):
    proposal = made(indistinguishable=(("payload",), ("joint_tilt", "hysteresis")))
    assert set(table_of(proposal, kuka)["indistinguishable"]) == {"payload; joint_tilt and hysteresis"}
    sentence = sentence_of(proposal)
    assert f"joint_tilt and payload are {NOT_DISTINGUISHABLE}." in sentence
    assert f"Whether hysteresis acts beside joint_tilt is {NOT_DISTINGUISHABLE}." in sentence


@pytest.mark.parametrize(
    ("mechanisms", "expected"),
    [
        (("joint_tilt",), "joint_tilt"),
        (("payload", "link_weight"), "payload and link_weight"),
        (("joint_tilt", OTHER), "joint_tilt with a related mechanism"),
        ((OTHER,), "a mechanism that the catalogue lacks"),
    ],
)
def test_a_hypothesis_is_named_by_its_mechanisms(mechanisms, expected):
    assert words(mechanisms) == expected


def test_the_sentence_has_the_figures_after_all_poses_and_how_many_are_enough():
    sentence = sentence_of(made())
    assert sentence == (
        "2 further poses, each measured at 0, 1 times its load, separate joint_tilt from link_elasticity with a related "
        "mechanism by 17.5 and resolve the verdict at 19:1 with a probability of 87%; 90% needs 3 poses."
    )
    assert sentence_of(made(poses_needed=None)).endswith("90% needs more than 100 poses.")
    assert "measured at 0, 1, -1 times" in sentence_of(made(shares=LADDER))


@pytest.mark.parametrize("reason", [NOTHING_MISSING, DATA_AT_FAULT])
def test_without_poses_there_is_a_reason_and_an_empty_table_with_the_same_columns(reason, kuka):
    none = without_poses(6, ("joint_tilt",), (), reason)
    assert len(none) == 0 and sentence_of(none) == f"No further measurement is proposed: {reason}."
    facts = json.loads(json.dumps(facts_of(none), allow_nan=False))
    assert (facts["poses"], facts["separation"], facts["resolved"], facts["poses_needed"]) == (0, None, None, None)
    table, full = table_of(none, kuka), table_of(made(approach=None, reference_weight=np.zeros(2, bool)), kuka)
    assert table.empty and list(table.columns) == list(full.columns)
