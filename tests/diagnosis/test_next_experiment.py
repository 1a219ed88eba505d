"""The next experiment: it promises what measurements bring on average, and resolves an exact alias where that is possible."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from planted import planted, two_loads_a_pose
from scipy.stats import ks_2samp, multivariate_normal
from synthetic import seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.diagnosis import new_states, next_experiment
from elastocal.diagnosis.alarm import Alarm
from elastocal.diagnosis.alternatives import members_of
from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.next_experiment import propose
from elastocal.diagnosis.promise import PROMISE_DRAWS, Promise, separation_resolved
from elastocal.diagnosis.proposal import DATA_AT_FAULT, NOTHING_AMBIGUOUS, facts_of, sentence_of, table_of
from elastocal.diagnosis.search import posterior
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import concluded
from elastocal.fitting.least_squares import fit
from elastocal.fitting.observations import Observations, States
from elastocal.fitting.parameters import stepped

SETTINGS = Settings(pose_steps=(0.0, 2.0), other_features=6)
RAISED = Alarm(0.002, 10.0, True)


def diagnosed(campaign, robot, keys, declared=None):
    """A diagnosis in which only some candidates compete."""
    declared = declared or campaign.declared
    line = linearized(declared, campaign.observations, [campaign.candidates[key] for key in keys], SETTINGS)
    found = posterior(line.problem)
    conclusion = concluded(line.problem, found, RAISED)
    evidence = SimpleNamespace(linearized=line, posterior=found, alarm=RAISED, conclusion=conclusion)
    case = SimpleNamespace(observations=campaign.observations, campaign=SimpleNamespace(robot=robot))
    return SimpleNamespace(case=case, evidence=evidence, final=declared)


def limits(robot):
    return np.clip(robot.joint_limits, -2.0, 2.0)


def pieces(diagnosis, robot, ladder=None):
    """Models, instrument and reach as `propose` makes them."""
    evidence = diagnosis.evidence
    kept, reason = next_experiment._ambiguous(evidence, SETTINGS)
    assert not reason, reason
    numbers = sorted({n for models in kept.values() for model in models for n in model.units})
    states = diagnosis.case.observations.states
    reach = new_states.reach_of(states, robot, limits(robot), ladder, False)
    lead = kept[evidence.conclusion.best.mechanisms][0]
    noise = replace(evidence.linearized.about.noise, pose_rad=lead.pose_error_rad)
    made = evidence.linearized, diagnosis.final, numbers, noise, states, reach, ladder is None
    instrument = new_states.instrument_of(*made)
    return members_of(evidence, kept, instrument, lead, 1.0), instrument, reach


ELASTIC = ("link_elasticity", "base_compliance", "joint_tilt")
LADDER = (0.0, 1.0, -1.0)


def keys_like(campaign, *starts):
    return [key for key in campaign.candidates if key.startswith(starts)]


@pytest.fixture(scope="module")
def ambiguous(kuka):
    """A nonlinear link in eight poses, which the tilt of a joint explains as well."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(kuka, {"link_elasticity@2": (3e-8, 3e-8)}, seed=3, poses=8, states=states)
    return diagnosed(campaign, kuka, keys_like(campaign, *ELASTIC)), campaign


@pytest.fixture(scope="module")
def proposal(ambiguous, kuka):
    return propose(ambiguous[0], limits(kuka), SETTINGS, np.random.default_rng(0), 10, LADDER)


def test_information_in_the_campaigns_own_states_is_that_of_the_campaign(kuka):
    # Without a time or rows: new states come after all of those.
    states = replace(two_loads_a_pose(6, 12, 1), time_s=None, temperature_c=None, row=np.ones(24, int))
    unknown = (Target("elbow", "3DoF", None), Target("hand", "6DoF", (0.1, 0.0, 0.0)))
    campaign = planted(kuka, {}, states=states, targets=unknown, fitted_frames=True)
    declared = replace(campaign.declared, weights=np.ones(len(campaign.observations)))
    keys = keys_like(campaign, "lost_motion@2", "joint_tilt@3", "hysteresis@4", "payload")
    line = linearized(declared, campaign.observations, [campaign.candidates[key] for key in keys], SETTINGS)
    problem = line.problem
    numbers = range(len(problem.units))
    reach = replace(new_states.reach_of(states, kuka, limits(kuka), None, False), shares=(1.0,), free=False)
    made = new_states.instrument_of(line, declared, numbers, declared.noise, states, reach, False)
    entries = new_states.Entries(states.joint_angles, states.wrench, states.approach[:, None], np.zeros(len(states), bool))
    total = made.information(entries, [0, 1]).sum(axis=0)
    at = np.concatenate([np.arange(line.products.declared), line.products.declared + made.columns])
    expected = line.products.white_gram[np.ix_(at, at)]
    # Declared parameters that measurements do not show have their prior, of information one, and only rounding beside it.
    size = np.sqrt(np.diag(expected) + 1e-6)
    np.testing.assert_allclose(total / np.outer(size, size), expected / np.outer(size, size), atol=1e-6)


def test_promised_separation_is_twice_the_mean_log_bayes_factor_of_simulated_measurements(ambiguous, kuka):
    """Measurements row by row and their normal densities, against the promise from information alone; 2,000 draws of each."""
    members, instrument, reach = pieces(ambiguous[0], kuka)
    rng = np.random.default_rng(0)
    targets = list(range(len(instrument.model.targets)))
    entries = new_states.drawn(reach, 30, rng)
    rows = instrument.rows(entries, targets).reshape(-1, instrument.unknowns)
    promise = Promise(members, rng)
    information = instrument.information(entries, targets).sum(axis=0)
    simulated = promise.log_factors(information)
    promised = promise.separations(simulated)
    densities = []
    for columns, mean, precision in zip(members.columns, members.means, members.precisions, strict=True):
        mine = rows[:, columns]
        covariance = np.eye(len(rows)) + mine @ np.linalg.solve(precision, mine.T)
        densities.append(multivariate_normal(rows @ mean, covariance))
    draws, hypotheses = 2000, len(members.names)
    logs = np.empty((hypotheses, draws, hypotheses))
    for source in range(hypotheses):
        mine = np.flatnonzero(members.hypothesis == source)
        weight = np.exp(members.log_weights[mine])
        models = rng.choice(mine, draws, p=weight / weight.sum())
        truths = np.concatenate([members.drawn(model, 1, rng) for model in models])
        measurements = truths @ rows.T + rng.standard_normal((draws, len(rows)))
        each = np.column_stack([density.logpdf(measurements) for density in densities]) + members.log_weights
        for h in range(hypotheses):
            these = members.hypothesis == h
            logs[source, :, h] = log_sum_exp(each[:, these], axis=1) - log_sum_exp(members.log_weights[these])
    weights = np.array([np.exp(members.log_weights[members.hypothesis == h]).sum() for h in range(hypotheses)])
    for h in range(1, hypotheses):
        for_best, against = logs[0, :, 0] - logs[0, :, h], logs[h, :, h] - logs[h, :, 0]
        mine = simulated[promise.hypothesis == 0]
        assert ks_2samp(for_best, mine[:, 0] - mine[:, h]).pvalue > 1e-3
        mean = 2 * (weights[0] * for_best.mean() + weights[h] * against.mean()) / (weights[0] + weights[h])
        spread = 2 * max(for_best.std(), against.std())
        often = (weights[0] * (for_best > np.log(19)).mean() + weights[h] * (against > np.log(19)).mean()) / weights[
            [0, h]
        ].sum()
        error = spread * np.sqrt(1 / draws + 1 / PROMISE_DRAWS)
        # The smaller of both is stated; of a share of 1,200 draws, the separation that belongs to it is as sure as its slope.
        share = np.sqrt(often * (1 - often) * (1 / draws + 1 / PROMISE_DRAWS)) + 1e-3
        low, high = (separation_resolved(np.clip(often + 4 * side * share, 0, 1 - 1e-9)) for side in (-1, 1))
        assert min(mean - 4 * error, low) <= promised[h] <= min(mean + 4 * error, high), (h, promised, mean, often)


def test_resolved_as_often_as_promised_by_the_whole_engine(ambiguous, proposal, kuka):
    """Exact kinematics, a new fit and a new posterior for 50 experiments.

    A share that is lower by 0.25 than promised is seen with 95 %.
    """
    diagnosis, campaign = ambiguous
    members, instrument, _ = pieces(diagnosis, kuka, LADDER)
    members = members.without([h for h, name in enumerate(members.names) if name in proposal.indistinguishable])
    rng, count, resolved = np.random.default_rng(1), 50, []
    models = rng.choice(len(members.means), count, p=np.exp(members.log_weights))
    for model in models:
        seen = carried_out(diagnosis, campaign, proposal, members, instrument, model, rng)
        declared = fit(campaign.declared.model, seen, campaign.declared.noise, campaign.declared.estimate)
        anew = diagnosed(replace(campaign, declared=declared, observations=seen), kuka, keys_like(campaign, *ELASTIC))
        found = {h.mechanisms: h.probability for h in anew.evidence.conclusion.hypotheses}
        right = members.names[members.hypothesis[model]]
        resolved.append(found.get(right, 0.0) >= 0.95 * sum(found.get(name, 0.0) for name in members.names))
    promised = proposal.resolved[-1]
    assert 0.3 < promised < 0.9
    assert abs(np.mean(resolved) - promised) < 3 * np.sqrt(promised * (1 - promised) / count), (np.mean(resolved), promised)


def test_stated_separation_is_that_of_two_fixed_hypotheses_resolved_as_often():
    rng = np.random.default_rng(0)
    for separation, often in ((2 * np.log(19), 0.5), (16.2, 0.9), (21.0, 0.95)):
        factors = separation / 2 + np.sqrt(separation) * rng.standard_normal(200_000)
        assert abs((factors >= np.log(19)).mean() - often) < 0.005
        assert abs(separation_resolved(often) - separation) < 0.2


def test_proposal_separates_half_as_much_again_as_random_poses_and_resolves_more(ambiguous, proposal, kuka):
    members, instrument, reach = pieces(ambiguous[0], kuka, LADDER)
    members = members.without([h for h, name in enumerate(members.names) if name in proposal.indistinguishable])
    promise, rng, found = Promise(members, np.random.default_rng(2)), np.random.default_rng(3), []
    for _ in range(8):
        entries = new_states.drawn(reach, 10, rng)
        total = instrument.information(entries, range(instrument.own)).sum(axis=0)
        logs = promise.log_factors(total)
        found.append((promise.separations(logs)[1:].min(), promise.resolved(logs)))
    separation, resolved = np.mean(found, axis=0)
    assert proposal.separation[-1] > 1.5 * separation and proposal.resolved[-1] > resolved + 0.1, (separation, resolved)
    assert (np.diff(proposal.separation) > -0.3).all() and proposal.separation[-1] > proposal.separation[0]


def test_proposal_is_within_reach(ambiguous, proposal, kuka):
    low, high = limits(kuka).T
    assert ((proposal.joint_angles >= low) & (proposal.joint_angles <= high)).all()
    largest = np.linalg.norm(ambiguous[1].observations.states.wrench[:, :3], axis=1).max()
    np.testing.assert_allclose(np.linalg.norm(proposal.wrench[:, :3], axis=1), largest)
    assert proposal.shares == LADDER and proposal.approach is None and not proposal.reference_weight.any()
    assert proposal.points == ("3DoF", "6DoF")


def test_weights_up_to_the_rated_payload_are_considered(ambiguous, kuka):
    states = ambiguous[1].observations.states
    heavy = new_states.reach_of(states, replace(kuka, payload_kg=2000.0), limits(kuka), LADDER, False)
    assert heavy.largest_N == pytest.approx(2000 * 9.80665)
    assert new_states.reach_of(states, replace(kuka, payload_kg=1.0), limits(kuka), LADDER, False).largest_N < 1e4


def test_loads_that_always_hang_stay_vertical(ambiguous, kuka):
    states = ambiguous[1].observations.states
    hanging = np.zeros_like(states.wrench)
    hanging[1::2, 2] = -800.0
    reach = new_states.reach_of(replace(states, wrench=hanging), kuka, limits(kuka), None, False)
    assert reach.shares == (0.0, 1.0)
    found = new_states.drawn(reach, 50, np.random.default_rng(0))
    near = new_states.near(reach, found, 2, 0.3, np.random.default_rng(0))
    for wrench in (found.wrench, near.wrench):
        assert (wrench[:, 2] < 0).all() and not wrench[:, [0, 1, 3, 4, 5]].any()


def test_a_reference_weight_shows_what_the_load_cell_cannot(kuka):
    """Force scale and compliances of all joints do the same under loads that only the cell knows."""
    campaign = planted(kuka, {"force_scale": (0.02,)}, poses=15, identified=False)
    line = linearized(campaign.declared, campaign.observations, [campaign.candidates["force_scale"]], SETTINGS)
    reach = new_states.reach_of(campaign.observations.states, kuka, limits(kuka), None, True)
    made = line, campaign.declared, [0], campaign.declared.noise, campaign.observations.states, reach, False
    instrument = new_states.instrument_of(*made)
    entries = new_states.drawn(reach, 80, np.random.default_rng(0))
    assert 5 < entries.weighed.sum() < 40
    assert not entries.wrench[entries.weighed][:, [0, 1, 3, 4, 5]].any() and (entries.wrench[entries.weighed, 2] < 0).all()
    told = instrument.information(entries, [0, 1])[:, -1, -1]
    assert (told[~entries.weighed] > 0).all() and not told[entries.weighed].any()


def test_an_exact_alias_is_said_to_be_none_that_measuring_helps(kuka):
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


def test_an_alias_does_not_keep_the_others_from_being_told(kuka):
    """Beside an alias, which leaves the promise, a tilt is told from the link that nonlinear_parameters."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(kuka, {"link_elasticity@2": (3e-8, 3e-8)}, seed=3, poses=8, states=states)
    # At every joint, or the tilt of several would not be what the alias of one is.
    alias = [replace(campaign.candidates[key], effect="twin") for key in keys_like(campaign, "joint_tilt")]
    candidates = campaign.candidates | {each.key: each for each in alias}
    keys = [*keys_like(campaign, *ELASTIC), *(each.key for each in alias)]
    diagnosis = diagnosed(replace(campaign, candidates=candidates), kuka, keys)
    found = propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0), 6, LADDER)
    assert ("twin",) in found.indistinguishable or (found.best == ("twin",) and ("joint_tilt",) in found.indistinguishable)
    assert len(found) == 6 and found.separation[-1] > 2


def test_nothing_is_proposed_where_nothing_is_ambiguous(kuka):
    # So many poses that something unknown beside it has less than what is left open.
    campaign = planted(kuka, {"joint_offset@3": (2e-3,)}, poses=40)
    diagnosis = diagnosed(campaign, kuka, ["joint_offset@3", "payload"])
    assert propose(diagnosis, limits(kuka), SETTINGS, np.random.default_rng(0)).reason == NOTHING_AMBIGUOUS
    quiet = SimpleNamespace(**vars(diagnosis) | {"evidence": None})
    assert propose(quiet, limits(kuka), SETTINGS, np.random.default_rng(0)).reason == DATA_AT_FAULT


def test_table_is_in_the_angles_of_the_controller(ambiguous, proposal, kuka):
    robot = replace(kuka, reported_matrix=np.diag([1.0, -1, 1, 1, 1, 1]), reported_offset=np.full(6, 0.1))
    table = table_of(proposal, robot)
    angles = table[[f"q{joint}" for joint in range(1, 7)]].to_numpy()
    np.testing.assert_allclose(angles @ robot.reported_matrix.T + robot.reported_offset, proposal.joint_angles)
    assert (table["load"] == 1).all() and (table["point"] == "3DoF 6DoF").all() and list(table["pose"]) == list(range(10))
    assert " or " in table["effect"][0] and table["separation_without"].nunique() == 1
    assert "10 further poses, each read at 0, 1, -1 times its load, separate" in sentence_of(proposal)


def test_further_targets_at_unknown_places_tell_only_beyond_their_offsets(kuka):
    """A campaign with unknown target offsets: those of further targets are unknown as well, and start without information."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    targets = (Target("hand", "6DoF", None),)
    campaign = planted(kuka, {"link_elasticity@2": (3e-8, 3e-8)}, seed=3, poses=8, states=states, targets=targets)
    diagnosis = diagnosed(campaign, kuka, keys_like(campaign, *ELASTIC))
    kept = list(range(len(diagnosis.evidence.linearized.problem.units)))
    reach = new_states.reach_of(states, kuka, limits(kuka), None, False)
    made = diagnosis.evidence.linearized, campaign.declared, kept, campaign.declared.noise, states, reach, True
    instrument = new_states.instrument_of(*made)
    further = len(list(instrument.extra_points))
    assert further == len(kuka.chain.points) - 1 and instrument.added.sum() == 3 * further
    entries = new_states.drawn(reach, 5, np.random.default_rng(0))
    every = instrument.information(entries, range(1 + further)).sum(axis=0)
    own = instrument.information(entries, [0]).sum(axis=0)
    added = slice(len(every) - 3 * further, None)
    assert not own[added].any() and (np.diag(every)[added] > 0).all()
    # With its offset open, a target that is read once more tells no more than how it moves from pose to pose.
    one = instrument.information(entries.at([0]), [1])[0]
    rank = np.linalg.matrix_rank(one, hermitian=True, tol=1e-9 * np.linalg.norm(one))
    assert rank <= 3 * len(reach.shares)


def carried_out(diagnosis, campaign, proposal, members, instrument, model, rng):
    """The campaign with measurements of what was proposed, from coefficients that the posterior of one model allows."""
    line, (truth,) = diagnosis.evidence.linearized, members.drawn(model, 1, rng)
    products, declared = line.products, line.products.declared
    contributions = truth[declared:]
    step = products.into_basis @ (truth[:declared] - products.projected[:, instrument.columns] @ contributions)
    estimate = stepped(line.about.model, line.about.estimate, step)
    values = contributions * instrument.sizes
    start = np.cumsum([0, *(len(candidate.parameters) for candidate, _ in instrument.laws)])
    there = [n for n in range(len(instrument.laws)) if values[start[n] : start[n + 1]].any()]
    effects = [instrument.laws[n][0] for n in there]
    true = estimate.with_effects(effects)
    for place, n in enumerate(there, len(estimate.coefficients)):
        true.coefficients[place][:] = values[start[n] : start[n + 1]]
    states = instrument.observations(entries_of(proposal), range(len(campaign.declared.model.targets))).states
    seen = with_noise(seen_exactly(line.about.model.with_effects(effects), true, states), rng)
    return together(campaign.observations, seen)


def together(first, more):
    """Two sets of observations as one; the poses of the second are others."""
    rows = first.states.row.max() + 1 + np.arange(len(more.states))
    moved = replace(more.states, pose=more.states.pose + first.states.pose.max() + 1, row=rows)
    pairs = zip(vars(first.states).items(), vars(moved).values(), strict=True)
    states = States(**{name: None if mine is None else np.concatenate([mine, new]) for (name, mine), new in pairs})
    return Observations(
        states,
        np.concatenate([first.state, more.state + len(first.states)]),
        np.concatenate([first.target, more.target]),
        np.concatenate([first.position, more.position]),
        None,
    )


def entries_of(proposal):
    approach = np.ones((len(proposal), len(proposal.shares), proposal.joint_angles.shape[1]))
    return new_states.Entries(proposal.joint_angles, proposal.wrench, approach, proposal.reference_weight)
