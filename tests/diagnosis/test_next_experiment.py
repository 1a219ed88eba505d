"""The next experiment: what is within reach, what it tells, and that it resolves what measurements can resolve."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from open_alternatives import ELASTIC, LADDER, SETTINGS, diagnosed, keys_like, limits, pieces
from planted import planted, two_loads_a_pose

from elastocal.campaigns.campaign import Target
from elastocal.diagnosis import next_experiment, verdict
from elastocal.diagnosis.alternatives import Promise
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.next_experiment import (
    DATA_AT_FAULT,
    NOT_DISTINGUISHABLE,
    NOTHING_AMBIGUOUS,
    Entries,
    Proposal,
    drawn,
    facts_of,
    instrument_of,
    propose,
    shares_of,
    table_of,
)
from elastocal.diagnosis.statistics import rows_alike
from elastocal.diagnosis.verdict import mechanisms_of_models


def test_proposal_separates_more_than_random_poses_and_resolves_more(ambiguous, proposal, kuka):
    models, instrument = pieces(ambiguous[0])
    promise, rng, found = Promise(models, np.random.default_rng(2)), np.random.default_rng(3), []
    robot = replace(kuka, joint_limits=limits(kuka))
    for _ in range(8):
        logs = promise.log_factors(instrument.information(drawn(instrument.states, robot, LADDER, 10, rng)).sum(axis=0))
        found.append((promise.separations(logs)[1:].min(), promise.resolved(logs)))
    separation, resolved = np.mean(found, axis=0)
    assert proposal.separation[-1] > 1.4 * separation and proposal.resolved[-1] > resolved + 0.1, (separation, resolved)
    assert (np.diff(proposal.separation) > -0.3).all() and proposal.separation[-1] > proposal.separation[0]
    assert np.abs(proposal.entries.joint_angles).max() <= 2.0


def test_models_belong_to_the_hypothesis_that_they_state_and_not_to_that_of_their_parts(ambiguous, kuka, monkeypatch):
    """A model of a law beside a smooth error may state one alone, for all models of a hypothesis even."""

    def stated(problem, posterior):
        return [tuple(f"stated {name}" for name in names) for names in mechanisms_of_models(problem, posterior)]

    diagnosis, _ = ambiguous
    monkeypatch.setattr(verdict, "mechanisms_of_models", stated)
    monkeypatch.setattr(next_experiment, "mechanisms_of_models", stated)
    evidence = diagnosis.evidence
    hypotheses = verdict.hypotheses_of(evidence.linearized.problem, evidence.posterior)
    conclusion = replace(evidence.conclusion, hypotheses=hypotheses, best=hypotheses[0])
    found = SimpleNamespace(**vars(diagnosis) | {"evidence": SimpleNamespace(**vars(evidence) | {"conclusion": conclusion})})
    proposal = propose(found, limits(kuka), SETTINGS, np.random.default_rng(0), 4, LADDER)
    assert {*proposal.best, *proposal.nearest} <= {f"stated {name}" for name in ELASTIC}


def test_of_an_exact_alias_no_pose_is_asked_for(kuka):
    """The same law under two names."""
    names = ("compensator_torque", "transmission_harmonic")
    campaign = planted(kuka, {"compensator_torque@2": (1e-4, 1e-4, 5e-5, 5e-5)}, poses=15)
    diagnosis = diagnosed(campaign, kuka, ["compensator_torque@2", "transmission_harmonic@2[orders 1-2]"])
    found = propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0), 4)
    assert found.reason == NOT_DISTINGUISHABLE and not len(found)
    assert {found.best, *found.indistinguishable} >= {(name,) for name in names}
    facts = json.loads(json.dumps(facts_of(found), allow_nan=False))
    assert (facts["reason"], facts["poses"], facts["separation"], facts["resolved"]) == (found.reason, 0, None, None)
    table = table_of(found, kuka)
    assert table.empty and list(table.columns[:5]) == ["effect", "pose", "load", "point", "q1"]


def test_an_alias_does_not_keep_the_others_from_being_distinguished(kuka):
    """Beside its alias, which leaves the promise, a tilt is distinguished from the link that bends."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(kuka, {"joint_tilt@2": (1e-7, 1e-7)}, seed=3, poses=8, states=states)
    # At every joint, or the tilt of several would not be what the alias of one is.
    alias = [replace(campaign.candidates[key], effect="twin") for key in keys_like(campaign, "joint_tilt")]
    candidates = campaign.candidates | {each.key: each for each in alias}
    keys = [*keys_like(campaign, *ELASTIC), *(each.key for each in alias)]
    diagnosis = diagnosed(replace(campaign, candidates=candidates), kuka, keys)
    found = propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0), 6, LADDER)
    assert sorted([found.best, *found.indistinguishable]) == [("joint_tilt",), ("twin",)]
    assert len(found) == 6 and found.separation[-1] > 2


def test_nothing_is_proposed_where_nothing_is_ambiguous(kuka):
    # So many poses that something unknown beside it has less than what is left open.
    campaign = planted(kuka, {"joint_offset@3": (2e-3,)}, poses=40)
    diagnosis = diagnosed(campaign, kuka, ["joint_offset@3", "payload"])
    assert propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0)).reason == NOTHING_AMBIGUOUS
    quiet = SimpleNamespace(**vars(diagnosis) | {"evidence": None})
    assert propose(quiet, limits(kuka), SETTINGS, np.random.default_rng(0)).reason == DATA_AT_FAULT


def test_rows_of_the_table_are_poses_in_the_angles_of_the_controller_with_their_loads_and_what_they_add(kuka):
    robot = replace(kuka, reported_matrix=np.diag([1.0, -1, 1, 1, 1, 1]), reported_offset=np.full(6, 0.1))
    wrench = np.array([[0.0, 300.0, -400.0, 1.0, 2.0, 3.0], np.zeros(6)])
    entries = Entries(np.arange(12.0).reshape(2, 6) / 10, wrench, None)
    figures = {"separation": np.array([4.25, 17.5]), "resolved": np.array([0.3, 0.87])}
    told = {"nearest": ("link_elasticity", "other"), "indistinguishable": (("payload",), ("joint_tilt", "hysteresis"))}
    proposal = Proposal(("joint_tilt",), entries=entries, shares=(0.0, 1.0), points=("3DoF", "6DoF"), **figures, **told)
    table = table_of(proposal, robot)
    angles = table[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    np.testing.assert_allclose(angles @ robot.reported_matrix.T + robot.reported_offset, entries.joint_angles)
    np.testing.assert_array_equal(table[["fx", "fy", "fz", "mx", "my", "mz"]], wrench)
    assert table["separation"].tolist() == [4.25, 17.5] and table["resolved"].tolist() == [0.3, 0.87]
    assert list(table["pose"]) == [0, 1] and list(table["load"]) == [1, 0] and (table["point"] == "3DoF 6DoF").all()
    assert table["effect"][0] == "joint_tilt or link_elasticity + other"
    assert set(table["indistinguishable"]) == {"payload; joint_tilt + hysteresis"}


def test_information_in_the_campaigns_own_states_is_that_of_the_campaign(kuka):
    # Without a time or rows: new states come after all of those.
    states = replace(two_loads_a_pose(6, 12, 1), time_s=None, temperature_c=None, row=np.ones(24, int))
    unknown = (Target("elbow", "3DoF", None), Target("hand", "6DoF", (0.1, 0.0, 0.0)))
    campaign = planted(kuka, {}, states=states, targets=unknown, fitted_frames=True)
    declared = replace(campaign.declared, weights=np.ones(len(campaign.observations)))
    keys = keys_like(campaign, "lost_motion@2", "joint_tilt@3", "hysteresis@4", "payload")
    line = linearized(declared, campaign.observations, [campaign.candidates[key] for key in keys], SETTINGS)
    made = instrument_of(line, declared, range(len(line.problem.units)), declared.noise, states, (1.0,))
    total = made.information(Entries(states.joint_angles, states.wrench, states.approach[:, None])).sum(axis=0)
    rows = line.products.rows
    every = rows_alike(line.products, rows.declared, rows.candidates.dense()[..., made.columns], made.columns)
    expected = np.tensordot(every, every, ((0, 1), (0, 1)))
    # Declared parameters that measurements do not show have their prior, of information one, and only rounding beside it.
    size = np.sqrt(np.diag(expected) + 1e-6)
    np.testing.assert_allclose(total / np.outer(size, size), expected / np.outer(size, size), atol=1e-6)


def test_entries_have_the_directions_and_senses_of_the_campaigns_loads_and_are_as_large_as_may_be(kuka):
    states, draws = two_loads_a_pose(6, 8, (5, 3), 1500.0), np.random.default_rng(0)
    up, size = np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.0]), np.linspace(100.0, 800.0, len(states))
    sense = np.where(np.arange(len(states)) % 2, 1.0, -1.0)
    robot = replace(kuka, payload_kg=200.0)
    one, both, none = (replace(states, wrench=load[:, None] * up) for load in (size, size * sense, 0.0 * size))
    assert [shares_of(each) for each in (one, both, none)] == [(0.0, 1.0), (0.0, 1.0, -1.0), (1.0,)]
    for each, senses in ((one, {1.0}), (both, {-1.0, 1.0}), (none, {0.0})):
        found = drawn(each, robot, (1.0,), 40, draws)
        assert set(np.sign(found.wrench[:, 2])) == senses and not found.wrench[:, [0, 1, 3, 5]].any()
        # The weight of the rated payload, at the lever of the campaign's loads.
        expected = 200.0 * 9.80665 * np.abs(np.sign(found.wrench[:, 2]))
        np.testing.assert_allclose(np.linalg.norm(found.wrench[:, :3], axis=1), expected)
        np.testing.assert_allclose(found.wrench[:, 4], 0.5 * found.wrench[:, 2])
    free = drawn(states, kuka, (1.0,), 200, draws)
    assert np.linalg.svd(free.wrench[:, :3], compute_uv=False)[-1] > 0.5 * np.sqrt(200 / 3) * 1500.0
    assert drawn(replace(states, approach=None), kuka, (1.0,), 3, draws).approach is None
    assert set(drawn(states, kuka, LADDER, 9, draws).approach.ravel()) == {-1.0, 1.0}


def test_each_entry_is_read_at_every_share_and_target_where_the_campaign_ended(ambiguous):
    _, instrument = pieces(ambiguous[0])
    entries = drawn(instrument.states, ambiguous[0].case.campaign.robot, LADDER, 3, np.random.default_rng(5))
    seen = instrument.observations(entries)
    np.testing.assert_allclose(seen.states.wrench[:3], np.array(LADDER)[:, None] * entries.wrench[0])
    np.testing.assert_array_equal(seen.states.joint_angles, np.repeat(entries.joint_angles, 3, axis=0))
    np.testing.assert_array_equal(seen.states.approach, entries.approach.reshape(9, 6))
    own, targets = instrument.states, len(instrument.fitted.model.targets)
    assert set(seen.states.time_s) == {own.time_s.max()} and set(seen.states.temperature_c) == {own.temperature_c.mean()}
    np.testing.assert_array_equal(seen.target, np.tile(np.arange(targets), 9))
    # Many at once are each by itself; twice the noise, a quarter of the information.
    found = instrument.information(entries)
    each = [instrument.information(entries.at([number]))[0] for number in range(3)]
    np.testing.assert_allclose(found, each, rtol=1e-10, atol=1e-12 * np.abs(found).max())
    apart = replace(instrument, noise=replace(instrument.noise, pose_rad=0.0))
    louder = replace(apart, noise=apart.noise.scaled(2.0))
    expected = pytest.approx(apart.information(entries), rel=1e-9, abs=1e-10 * np.abs(found).max())
    assert 4 * louder.information(entries) == expected
