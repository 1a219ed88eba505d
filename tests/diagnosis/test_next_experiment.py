"""The next experiment: what is within reach, what it tells, and that it resolves what measurements can resolve."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit
from planted import planted, two_loads_a_pose
from scipy.stats import norm

from elastocal.campaigns.campaign import Target
from elastocal.diagnosis import next_experiment
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.next_experiment import (
    DATA_AT_FAULT,
    NOT_DISTINGUISHABLE,
    NOTHING_AMBIGUOUS,
    PROMISE_DRAWS,
    Alternative,
    Hypotheses,
    Instrument,
    alternatives_of,
    drawn,
    propose,
)
from elastocal.diagnosis.search import Alarm, Model, posterior
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import concluded

SETTINGS = Settings(pose_steps=(0.0, 2.0), other_features=6)
RAISED = Alarm(0.002, 10.0, True)
ELASTIC = ("link_elasticity", "base_compliance", "joint_tilt")


def diagnosed(campaign, robot, keys):
    """A diagnosis in which only some candidates compete."""
    robot = replace(robot, joint_limits=np.clip(robot.joint_limits, -2.0, 2.0))
    line = linearized(campaign.declared, campaign.observations, [campaign.candidates[key] for key in keys], SETTINGS)
    found = posterior(line.problem)
    conclusion = concluded(line.problem, found, RAISED)
    evidence = SimpleNamespace(linearized=line, posterior=found, alarm=RAISED, conclusion=conclusion)
    case = SimpleNamespace(observations=campaign.observations, campaign=SimpleNamespace(robot=robot))
    return SimpleNamespace(case=case, evidence=evidence, final=campaign.declared)


def pieces(diagnosis):
    """Models and instrument as `propose` makes them, without the error of a pose."""
    line = diagnosis.evidence.linearized
    kept, reason = next_experiment._ambiguous(diagnosis.evidence)
    assert not reason, reason
    units = tuple(line.problem.units[n] for n in sorted({n for _, model in kept for n in model.units}))
    noise = replace(line.about.noise, pose_rad=kept[0][1].pose_error_rad)
    instrument = Instrument(diagnosis.final, line, units, noise, diagnosis.case.observations.states)
    return alternatives_of(line, units, kept, 1.0), instrument


def keys_like(campaign, *starts):
    return [key for key in campaign.candidates if key.startswith(starts)]


@pytest.fixture(scope="module")
def ambiguous(kuka):
    """A nonlinear link in eight poses, which the tilt of a joint explains as well."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(kuka, {"link_elasticity@2": (3.9e-8, 5.2e-8)}, seed=3, poses=8, states=states)
    return diagnosed(campaign, kuka, keys_like(campaign, *ELASTIC))


def test_proposal_separates_more_than_random_poses_and_resolves_more(ambiguous, kuka):
    columns, facts = propose(ambiguous, np.random.default_rng(0))
    models, instrument = pieces(ambiguous)
    hypotheses, rng, found = Hypotheses(models, PROMISE_DRAWS, np.random.default_rng(2)), np.random.default_rng(3), []
    for _ in range(8):
        entries = drawn(instrument.states, ambiguous.case.campaign.robot, 10, rng)
        apart, _, resolved = hypotheses.promise(instrument.information(entries).sum(axis=0))
        found.append((apart[1:].min(), resolved))
    separation, resolved = np.mean(found, axis=0)
    assert columns["separation"][-1] > 1.4 * separation and columns["resolved"][-1] > resolved + 0.1, (separation, resolved)
    assert (np.diff(columns["separation"]) > -0.3).all() and columns["separation"][-1] > columns["separation"][0]
    assert (facts["poses"], facts["reason"], facts["separation"]) == (10, "", columns["separation"][-1])
    assert max(np.abs(columns[f"q{joint}"]).max() for joint in range(1, 7)) <= 2.0 and set(columns["point"]) == {"3DoF 6DoF"}
    # In the angles of the controller, and nothing else changes.
    reporting = replace(ambiguous.case.campaign.robot, reported_offset=np.full(6, 0.1))
    case = SimpleNamespace(observations=ambiguous.case.observations, campaign=SimpleNamespace(robot=reporting))
    reported, same = propose(SimpleNamespace(**vars(ambiguous) | {"case": case}), np.random.default_rng(0))
    np.testing.assert_allclose(reported["q3"], columns["q3"] - 0.1)
    assert (
        same == facts
        and len(set(columns["effect"])) == 1
        and " or ".join(map(" + ".join, [facts["best"]])) in columns["effect"][0]
    )


def test_of_an_exact_alias_no_pose_is_asked_for(kuka):
    """The same law under two names."""
    names = ("compensator_torque", "transmission_harmonic")
    campaign = planted(kuka, {"compensator_torque@2": (1e-4, 1e-4, 5e-5, 5e-5)}, poses=15)
    diagnosis = diagnosed(campaign, kuka, ["compensator_torque@2", "transmission_harmonic@2[orders 1-2]"])
    columns, facts = propose(diagnosis, np.random.default_rng(0), 4)
    assert {*facts["best"], *(name for each in facts["indistinguishable"] for name in each)} >= set(names)
    facts = json.loads(json.dumps(facts, allow_nan=False))
    stated = (facts["reason"], facts["poses"], facts["separation"], facts["resolved"])
    assert stated == (NOT_DISTINGUISHABLE, 0, None, None)
    assert list(columns)[:4] == ["effect", "pose", "point", "q1"] and not any(map(len, columns.values()))


def test_an_alias_does_not_keep_the_others_from_being_distinguished(kuka):
    """Beside its alias, which leaves the promise, a tilt is distinguished from the link that bends."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(kuka, {"joint_tilt@2": (1e-7, 1e-7)}, seed=3, poses=8, states=states)
    # At every joint, or the tilt of several would not be what the alias of one is.
    alias = [replace(campaign.candidates[key], effect="twin") for key in keys_like(campaign, "joint_tilt")]
    candidates = campaign.candidates | {each.key: each for each in alias}
    keys = [*keys_like(campaign, *ELASTIC), *(each.key for each in alias)]
    columns, facts = propose(diagnosed(replace(campaign, candidates=candidates), kuka, keys), np.random.default_rng(0), 6)
    assert sorted([facts["best"], *facts["indistinguishable"]]) == [["joint_tilt"], ["twin"]]
    assert len(columns["pose"]) == 6 and facts["separation"] > 2


def test_nothing_is_proposed_where_nothing_is_ambiguous(kuka):
    # So many poses that something unknown beside it has less than what is left open.
    campaign = planted(kuka, {"joint_offset@3": (2e-3,)}, poses=40)
    diagnosis = diagnosed(campaign, kuka, ["joint_offset@3", "payload"])
    assert propose(diagnosis, np.random.default_rng(0))[1]["reason"] == NOTHING_AMBIGUOUS
    quiet = SimpleNamespace(**vars(diagnosis) | {"evidence": None})
    assert propose(quiet, np.random.default_rng(0))[1]["reason"] == DATA_AT_FAULT


def test_information_in_the_campaigns_own_states_is_that_of_the_campaign(kuka, monkeypatch):
    # Without a time or rows: new states come after all of those.
    states = replace(two_loads_a_pose(6, 12, 1), time_s=None, temperature_c=None, row=np.ones(24, int))
    unknown = (Target("elbow", "3DoF", None), Target("hand", "6DoF", (0.1, 0.0, 0.0)))
    campaign = planted(kuka, {}, states=states, targets=unknown, fitted_frames=True)
    declared = replace(campaign.declared, weights=np.ones(len(campaign.observations)))
    keys = keys_like(campaign, "lost_motion@2", "joint_tilt@3", "hysteresis@4", "payload")
    line = linearized(declared, campaign.observations, [campaign.candidates[key] for key in keys], SETTINGS)
    made = Instrument(declared, line, line.problem.units, declared.noise, states)
    entries = states.joint_angles[::2], states.wrench[1::2]
    seen = made.observations(entries)
    # Each pose is read at every target without its load and under it, where the campaign ended.
    np.testing.assert_array_equal(seen.states.wrench, states.wrench)
    np.testing.assert_array_equal(seen.states.joint_angles, states.joint_angles)
    np.testing.assert_array_equal(seen.target, np.tile([0, 1], 24))
    assert set(seen.states.approach.ravel()) == {-1.0, 1.0} and seen.states.time_s is None
    own = replace(seen, states=replace(seen.states, approach=states.approach))
    monkeypatch.setattr(Instrument, "observations", lambda self, entries: own)
    information = made.information(entries)
    products = line.products
    columns, rows = np.concatenate([unit.columns for unit in made.units]), products.rows
    basis = rows.declared @ products.into_basis
    every = np.concatenate([basis, rows.candidates.dense()[..., columns] - basis @ products.projected[:, columns]], axis=-1)
    expected = np.tensordot(every, every, ((0, 1), (0, 1)))
    # Declared parameters that measurements do not show have their prior, of information one, and only rounding beside it.
    size = np.sqrt(np.diag(expected) + 1e-6)
    scaled = information.sum(axis=0) / np.outer(size, size)
    np.testing.assert_allclose(scaled, expected / np.outer(size, size), atol=1e-6)
    # Twice the noise, a quarter of the information.
    louder = replace(made, noise=made.noise.scaled(2.0)).information(entries)
    np.testing.assert_allclose(4 * louder, information, rtol=1e-9, atol=1e-10 * np.abs(information).max())


def test_entries_have_the_campaigns_loads_as_large_as_may_be(kuka):
    states, draws = two_loads_a_pose(6, 8, (5, 3), 1500.0), np.random.default_rng(0)
    size = np.linspace(100.0, 800.0, len(states))
    loaded = replace(states, wrench=size[:, None] * np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.0]))
    # The weight of the rated payload, at the lever of the campaign's loads.
    _, wrench = drawn(loaded, replace(kuka, payload_kg=200.0), 40, draws)
    np.testing.assert_allclose(wrench, np.tile(200.0 * 9.80665 * np.array([0, 0, 1, 0, 0.5, 0]), (40, 1)))
    assert not drawn(replace(states, wrench=0.0 * states.wrench), kuka, 3, draws)[1].any()


UNITS = (made_unit("offset", (1,), 0), made_unit("tilt", (1,), [2, 3]), made_unit("sag", (2,), [4, 5]))
# Of the columns of the problem's statistics those that are looked at, in their order: the units' own, without column 1.
COLUMNS = np.array([0, 2, 3, 4, 5])


@pytest.mark.parametrize("factor", [1.0, 1.7])
def test_alternatives_are_the_posteriors_of_dense_generalized_least_squares_at_the_pose_error_of_the_leading_model(factor):
    """Declared parameters over their priors; a larger noise widens every deviation, and so leaves the means."""
    rows = made_rows(1, prior=0.5)
    problem, products = made_problem(rows, UNITS, tau=np.array([0.0, 0.4]))
    models = [Model((0,), 2.0, np.array([0.5]), 0.4), Model((0, 2), 0.5, np.array([0.5, 2.0]), 0.4)]
    kept = [*((("offset",), model) for model in models), (("tilt",), Model((1,), 1.0, np.array([1.5]), 0.0))]
    line = SimpleNamespace(problem=problem, products=products)
    covariance, declared = rows.marginal_covariance(0.4), rows.declared.shape[1]
    for found, (name, model) in zip(alternatives_of(line, UNITS, kept, factor), kept, strict=True):
        columns = np.concatenate([UNITS[n].columns for n in model.units])
        deviation = np.repeat(model.scales, [len(UNITS[n].columns) for n in model.units])
        W = rows.candidates[:, columns]
        precision = W.T @ np.linalg.solve(covariance, W) + np.diag(deviation**-2.0)
        mean = np.linalg.solve(precision, W.T @ np.linalg.solve(covariance, rows.residual - rows.expected))
        at = declared + np.searchsorted(COLUMNS, columns)
        expected = np.zeros(declared + len(COLUMNS))
        expected[at] = mean
        np.testing.assert_allclose(found.mean[declared:], expected[declared:], rtol=1e-8, atol=1e-12)
        spread = np.linalg.inv(found.precision)[declared:, declared:]
        np.testing.assert_allclose(spread, factor**2 * np.linalg.inv(precision), rtol=1e-8)
        assert (found.name, found.columns.tolist()) == (name, [*range(declared), *at])


def alternative(columns, mean, precision, name="h0", weight=1.0):
    return Alternative((name,), np.log(weight), np.array(columns), np.array(mean, float), np.array(precision))


def test_misfits_are_log_densities_of_measurements_written_out_on_average_and_with_their_noise():
    """-2 ln p_j = ln |C| + off' C^-1 off with C = I + A_j P_j^-1 A_j', off = A u + e; on average tr C^-1 instead of e."""
    rng, models = np.random.default_rng(0), []
    for number, name in enumerate(["h0", "h1", "h1", "h0"]):
        mine, mean = np.sort(rng.choice(5, 2 + number % 3, replace=False)), np.zeros(5)
        half, mean[mine] = rng.standard_normal((len(mine), len(mine) + 2)), rng.standard_normal(len(mine))
        models.append(alternative(mine, mean, half @ half.T, name))
    hypotheses = Hypotheses(models, 1, rng)
    # One experiment of a single row, that tells one direction only; one of many.
    for A in (rng.standard_normal((rows, 5)) for rows in (1, 12)):
        noise = rng.standard_normal((4, len(A)))
        mean = hypotheses.misfits(np.array([A.T @ A]))[0]
        each = hypotheses.misfits(np.array([A.T @ A]), noise @ A)[0]
        for t, (truth, e) in enumerate(zip(hypotheses.truths, noise, strict=True)):
            for j, model in enumerate(models):
                mine = A[:, model.columns]
                C = np.eye(len(A)) + mine @ np.linalg.solve(model.precision, mine.T)
                off, log_det = A @ (truth - model.mean), np.linalg.slogdet(C)[1]
                expected = log_det + np.trace(np.linalg.inv(C)) - len(A) + off @ np.linalg.solve(C, off)
                assert mean[t, j] == pytest.approx(expected, rel=1e-9, abs=1e-9)
                expected = log_det + (off + e) @ np.linalg.solve(C, off + e) - e @ e
                assert each[t, j] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("separation", [2.0, 2 * np.log(19.0), 16.2])
def test_of_two_fixed_hypotheses_entropy_and_promise_are_those_of_normal_log_factors(separation):
    """Entropy sum of w_i ln (1 + w_j / w_i exp(-separation / 8)); a log factor of mean lambda / 2 and variance lambda."""
    weights, information = (0.7, 0.3), 0.5 * separation * np.eye(2)
    known = [alternative([0, 1], m, 1e12 * np.eye(2), n, w) for m, n, w in zip(np.eye(2), ("h0", "h1"), weights, strict=True)]
    hypotheses, close = Hypotheses(known, 1000, np.random.default_rng(0)), np.exp(-separation / 8)
    expected = 0.7 * np.log1p(0.3 / 0.7 * close) + 0.3 * np.log1p(0.7 / 0.3 * close)
    np.testing.assert_allclose(hypotheses.entropy_left(information[None]), expected, rtol=1e-4)
    apart, often, resolved = hypotheses.promise(information)
    # At 5 standard errors: false once in a million.
    error = np.sqrt((0.7**2 + 0.3**2) / 1000)
    assert abs(apart[1] / 2 - separation / 2) < 5 * np.sqrt(separation) * error
    reached = norm.cdf((separation / 2 - np.log(19)) / np.sqrt(separation))
    assert abs(often[1] - reached) < 5 * 0.5 * error
    # The prior counts in what is resolved.
    beside = [np.log(19) - sign * np.log(0.7 / 0.3) for sign in (1, -1)]
    share = np.dot(weights, [norm.cdf((separation / 2 - least) / np.sqrt(separation)) for least in beside])
    assert abs(resolved - share) < 5 * 0.5 * error
