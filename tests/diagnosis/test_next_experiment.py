"""The next experiment is within reach, and resolves what measurements can resolve."""

import json
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term
from planted import planted, two_loads_a_pose

from elastocal.diagnosis.alarm import Alarm
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.next_experiment import (
    DATA_AT_FAULT,
    NOT_DISTINGUISHABLE,
    NOTHING_AMBIGUOUS,
    HypothesisPair,
    build_planned_observations,
    compute_coefficient_posteriors,
    compute_resolution_probability,
    compute_whitened_rows,
    draw_candidate_experiments,
    propose_experiment,
    select_experiments,
)
from elastocal.diagnosis.search import ScoredModel, search_models
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import conclude

# An unknown mechanism is improbable, so that the candidates alone compete.
SETTINGS = Settings(pose_steps=(0.0, 2.0), other_features=6, other_probability=0.02)
RAISED = Alarm(0.002, 10.0, raised=True)
ELASTIC = ("link_elasticity", "base_compliance", "joint_tilt")


def design_of(campaign, keys):
    """The design of a campaign in which only some candidates compete."""
    return build_candidate_design(
        campaign.declared,
        campaign.observations,
        [campaign.candidates[key] for key in keys],
        SETTINGS,
    )


def diagnosed(campaign, robot, keys):
    """A diagnosis in which only some candidates compete."""
    robot = replace(robot, joint_limits=np.clip(robot.joint_limits, -2.0, 2.0))
    design = design_of(campaign, keys)
    posterior = search_models(design.problem)
    evidence = SimpleNamespace(
        design=design,
        posterior=posterior,
        alarm=RAISED,
        conclusion=conclude(design.problem, posterior, RAISED),
    )
    case = SimpleNamespace(
        observations=campaign.observations, campaign=SimpleNamespace(robot=robot)
    )
    return SimpleNamespace(case=case, evidence=evidence, final=campaign.declared)


def keys_starting_with(campaign, *starts):
    return [key for key in campaign.candidates if key.startswith(starts)]


@pytest.fixture(scope="module")
def ambiguous(kuka):
    """A nonlinear link in eight poses, which the tilt of a joint explains as well."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(
        kuka, {"link_elasticity@2": (3.9e-8, 5.2e-8)}, seed=3, poses=8, states=states
    )
    return diagnosed(campaign, kuka, keys_starting_with(campaign, *ELASTIC))


def test_every_pose_of_the_proposal_adds_separation(ambiguous):
    table, experiment = propose_experiment(ambiguous, np.random.default_rng(0))
    assert (np.diff(table["separation"]) > 0).all()
    assert (np.diff(table["resolved"]) > 0).all()
    assert experiment.poses == 10
    assert experiment.reason == ""
    assert experiment.separation == table["separation"][-1]
    assert set(table["point"]) == {"3DoF 6DoF"}
    effect = " + ".join(experiment.best) + " or " + " + ".join(experiment.nearest)
    assert set(table["effect"]) == {effect}


def test_the_proposal_is_within_the_limits_in_the_angles_of_the_controller(ambiguous):
    table, experiment = propose_experiment(ambiguous, np.random.default_rng(0))
    assert max(np.abs(table[f"q{joint}"]).max() for joint in range(1, 7)) <= 2.0
    robot = replace(ambiguous.case.campaign.robot, reported_offset=np.full(6, 0.1))
    case = SimpleNamespace(
        observations=ambiguous.case.observations, campaign=SimpleNamespace(robot=robot)
    )
    shifted, shifted_experiment = propose_experiment(
        SimpleNamespace(**vars(ambiguous) | {"case": case}), np.random.default_rng(0)
    )
    np.testing.assert_allclose(shifted["q3"], table["q3"] - 0.1)
    assert shifted_experiment == experiment


def test_no_pose_is_proposed_for_an_exact_alias(kuka):
    """The same displacement has two names."""
    campaign = planted(
        kuka, {"compensator_torque@2": (1e-4, 1e-4, 5e-5, 5e-5)}, poses=15
    )
    diagnosis = diagnosed(
        campaign, kuka, ["compensator_torque@2", "transmission_harmonic@2[orders 1-2]"]
    )
    table, experiment = propose_experiment(diagnosis, np.random.default_rng(0), 4)
    mechanisms = {*experiment.best}.union(*experiment.indistinguishable)
    assert mechanisms >= {"compensator_torque", "transmission_harmonic"}
    document = json.loads(json.dumps(asdict(experiment), allow_nan=False))
    assert document["reason"] == NOT_DISTINGUISHABLE
    assert document["poses"] == 0
    assert document["separation"] is None
    assert document["resolved"] is None
    assert list(table)[:4] == ["effect", "pose", "point", "q1"]
    assert not any(map(len, table.values()))


def test_an_alias_does_not_keep_other_hypotheses_from_being_distinguished(kuka):
    """The promise leaves the alias of a tilt aside; the tilt is then distinguished from
    the link elasticity."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(
        kuka, {"joint_tilt@2": (1e-7, 1e-7)}, seed=3, poses=8, states=states
    )
    # The alias acts at every joint; otherwise the tilt of several joints would have no
    # alias.
    aliases = [
        replace(campaign.candidates[key], effect="twin")
        for key in keys_starting_with(campaign, "joint_tilt")
    ]
    candidates = campaign.candidates | {alias.key: alias for alias in aliases}
    keys = keys_starting_with(campaign, *ELASTIC) + [alias.key for alias in aliases]
    diagnosis = diagnosed(replace(campaign, candidates=candidates), kuka, keys)
    table, experiment = propose_experiment(diagnosis, np.random.default_rng(0), 6)
    assert sorted([experiment.best, *experiment.indistinguishable]) == [
        ("joint_tilt",),
        ("twin",),
    ]
    assert len(table["pose"]) == 6
    assert experiment.separation > 2


def make_certain(diagnosis, alternatives):
    """A diagnosis whose best hypothesis is certain, with the alternatives that it states
    for the mechanism of this hypothesis."""
    conclusion = diagnosis.evidence.conclusion
    best = conclusion.best.mechanisms
    hypotheses = tuple(
        replace(entry, probability=1.0 if entry.mechanisms == best else 1e-9)
        for entry in conclusion.hypotheses
    )
    certain = replace(
        conclusion,
        hypotheses=tuple(sorted(hypotheses, key=lambda entry: -entry.probability)),
        best=next(entry for entry in hypotheses if entry.mechanisms == best),
        alternatives={best[0]: alternatives},
    )
    evidence = SimpleNamespace(**vars(diagnosis.evidence) | {"conclusion": certain})
    return SimpleNamespace(**vars(diagnosis) | {"evidence": evidence})


def test_an_alternative_that_is_stated_is_distinguished_however_improbable(ambiguous):
    best = ambiguous.evidence.conclusion.best.mechanisms
    alternative = next(
        entry.mechanisms
        for entry in ambiguous.evidence.conclusion.hypotheses
        if len(entry.mechanisms) == 1 and entry.mechanisms not in (best, ("other",))
    )
    stream = np.random.default_rng(0)
    _, experiment = propose_experiment(make_certain(ambiguous, alternative), stream)
    assert experiment.nearest == alternative
    _, experiment = propose_experiment(make_certain(ambiguous, ()), stream)
    assert experiment.reason == NOTHING_AMBIGUOUS


def test_nothing_is_proposed_if_nothing_is_ambiguous(kuka):
    # With this many poses, an additional unknown effect has less probability than an
    # unambiguous diagnosis may leave open.
    campaign = planted(kuka, {"joint_offset@3": (2e-3,)}, poses=40)
    diagnosis = diagnosed(campaign, kuka, ["joint_offset@3", "payload"])
    _, experiment = propose_experiment(diagnosis, np.random.default_rng(0))
    assert experiment.reason == NOTHING_AMBIGUOUS
    without_evidence = SimpleNamespace(**vars(diagnosis) | {"evidence": None})
    _, experiment = propose_experiment(without_evidence, np.random.default_rng(0))
    assert experiment.reason == DATA_AT_FAULT


@pytest.fixture(scope="module")
def planned(kuka):
    """A campaign, and its own joint angles and loads planned as experiments."""
    states = replace(two_loads_a_pose(6, 6, 1), temperature_c=None)
    campaign = planted(kuka, {}, states=states)
    observations = build_planned_observations(
        campaign.declared.model, states, states.joint_angles[::2], states.wrench[1::2]
    )
    return campaign, states, observations


def test_an_experiment_is_measured_at_every_target_without_its_load_and_under_it(
    planned,
):
    _, states, observations = planned
    np.testing.assert_array_equal(observations.states.wrench, states.wrench)
    np.testing.assert_array_equal(observations.states.joint_angles, states.joint_angles)
    np.testing.assert_array_equal(observations.target, np.tile([0, 1], len(states)))
    assert set(observations.states.approach.ravel()) == {-1.0, 1.0}
    assert observations.states.temperature_c is None
    assert set(observations.states.time_s) == {states.time_s[-1]}


def test_the_measurements_of_an_experiment_have_an_error_in_common(planned):
    campaign, _, observations = planned
    keys = keys_starting_with(campaign, "lost_motion@2", "joint_tilt@3", "payload")
    design = design_of(campaign, keys)
    columns = np.concatenate(
        [term.columns for term in design.terms if term.mechanism == "joint_tilt"]
    )
    independent = compute_whitened_rows(design, observations, columns, 0.0)
    correlated = compute_whitened_rows(design, observations, columns, 2e-4)
    # Sensitivities to the declared parameters are those of the campaign, because none
    # depends on the approach, which alone differs.
    declared = design.products.declared_count
    expected = design.rows.declared @ design.products.basis_transform
    np.testing.assert_allclose(
        independent[..., :declared].reshape(-1, declared),
        expected.reshape(-1, declared),
        rtol=1e-6,
        atol=1e-6,
    )
    experiments, numbers, _ = independent.shape
    jacobians = design.rows.jacobian.reshape(experiments, numbers, -1)
    for rows, correlated_rows, J in zip(
        independent, correlated, jacobians, strict=True
    ):
        covariance = np.eye(numbers) + 4e-8 * J @ J.T
        np.testing.assert_allclose(
            correlated_rows.T @ correlated_rows,
            rows.T @ np.linalg.solve(covariance, rows),
            rtol=1e-6,
            atol=1e-6,
        )


def test_experiments_have_the_loads_of_the_campaign_scaled_up_to_the_payload(kuka):
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    draws = np.random.default_rng(0)
    force = np.linspace(100.0, 800.0, len(states))
    direction = np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.0])
    loaded = replace(states, wrench=force[:, None] * direction)
    robot = replace(kuka, payload_kg=200.0)
    _, wrench = draw_candidate_experiments(loaded, robot, 40, draws)
    # The weight of the rated payload, at the lever of the campaign's loads.
    weight = 200.0 * 9.80665 * direction
    np.testing.assert_allclose(wrench, np.tile(weight, (40, 1)))
    unloaded = replace(states, wrench=0.0 * states.wrench)
    _, wrench = draw_candidate_experiments(unloaded, kuka, 3, draws)
    assert not wrench.any()


TERMS = (
    make_term("offset", (1,), 0),
    make_term("tilt", (1,), [2, 3]),
    make_term("sag", (2,), [4, 5]),
)
# Columns of the terms; column 1 of the statistics belongs to none.
COLUMNS = np.array([0, 2, 3, 4, 5])


@pytest.mark.parametrize("factor", [1.0, 1.7])
def test_posteriors_are_those_of_dense_generalized_least_squares(factor):
    """At the pose error of the leading model, for declared parameters with their
    priors.

    A larger noise widens every standard deviation and leaves the means.
    """
    rows = make_rows(1, prior=0.5)
    problem, products = make_problem(rows, TERMS, tau=np.array([0.0, 0.4]))
    models = [
        ScoredModel((0, 2), 0.5, np.array([0.5, 2.0]), 0.4),
        ScoredModel((1,), 1.0, np.array([1.5]), 0.0),
    ]
    design = SimpleNamespace(problem=problem, products=products)
    posteriors = compute_coefficient_posteriors(design, COLUMNS, models, factor)
    declared = rows.declared.shape[1]
    for (mean, covariance), model in zip(posteriors, models, strict=True):
        columns, deviations = problem.scaled_columns(model.term_indices, model.scales)
        expected_mean, precision = dense_posterior(rows, columns, deviations, 0.4)
        indices = declared + np.searchsorted(COLUMNS, columns)
        np.testing.assert_allclose(mean[indices], expected_mean, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(
            covariance[np.ix_(indices, indices)],
            factor**2 * np.linalg.inv(precision),
            rtol=1e-8,
        )
        assert not np.delete(mean, [*range(declared), *indices]).any()
        assert not np.delete(covariance, [*range(declared), *indices], axis=0).any()


def dense_posterior(rows, columns, deviations, pose_error_rad):
    """Mean and precision of the coefficients of some columns, worked out densely."""
    covariance = rows.marginal_covariance(pose_error_rad)
    W = rows.candidates[:, columns]
    precision = W.T @ np.linalg.solve(covariance, W) + np.diag(deviations**-2.0)
    score = W.T @ np.linalg.solve(covariance, rows.residual - rows.expected)
    return np.linalg.solve(precision, score), precision


def made_pair(rng, size=5):
    """Two normal distributions of coefficients, each without one of them."""
    distributions = []
    for absent in (0, 1):
        root = rng.standard_normal((size, size))
        mean = rng.standard_normal(size)
        root[absent] = 0.0
        mean[absent] = 0.0
        distributions.append((mean, root @ root.T))
    return distributions


def test_experiments_in_turn_separate_as_both_together_by_eight_bhattacharyya_distances():
    rng = np.random.default_rng(0)
    first, second = made_pair(rng)
    experiments = rng.standard_normal((2, 3, 5))
    rows = experiments.reshape(6, 5)
    covariances = [np.eye(6) + rows @ C @ rows.T for _, C in (first, second)]
    average = sum(covariances) / 2
    difference = rows @ (first[0] - second[0])
    log_dets = [np.linalg.slogdet(C)[1] for C in (average, *covariances)]
    expected = (
        difference @ np.linalg.solve(average, difference)
        + 4 * log_dets[0]
        - 2 * log_dets[1]
        - 2 * log_dets[2]
    )
    pair = HypothesisPair.of(first, second)
    assert pair.separation_gains(rows[None])[0] == pytest.approx(expected)
    in_turn = pair.condition_on(experiments[0]).condition_on(experiments[1])
    assert in_turn.separation == pytest.approx(expected)


def joint_separations(pairs, rows):
    """Separation of each pair by some experiments (E, R, U) together."""
    together = rows.reshape(1, -1, rows.shape[2])
    return [pair.separation_gains(together)[0] for pair in pairs]


def test_selected_experiments_separate_the_nearest_pair_more_than_random_ones():
    rng = np.random.default_rng(1)
    first, second, third = (*made_pair(rng), made_pair(rng)[1])
    pairs = [HypothesisPair.of(first, second), HypothesisPair.of(first, third)]
    rows = 0.3 * rng.standard_normal((40, 3, 5))
    chosen, separations = select_experiments(pairs, np.ones(2), rows, 4)
    assert len(set(chosen)) == 4
    assert (np.diff(separations, axis=0) > 0).all()
    np.testing.assert_allclose(separations[-1], joint_separations(pairs, rows[chosen]))
    random_choices = [rng.choice(40, 4, replace=False) for _ in range(50)]
    random_separations = [
        min(joint_separations(pairs, rows[choice])) for choice in random_choices
    ]
    assert separations[-1].min() > np.quantile(random_separations, 0.98)


def test_a_separation_of_16_gives_the_right_one_odds_of_19_to_1_in_nine_cases_of_ten():
    assert compute_resolution_probability(16.0) == pytest.approx(0.9, abs=0.005)
    assert compute_resolution_probability(0.0) < 1e-9
    # Log Bayes factors of two predictions of the same covariance.
    factors = 16.0 / 2 + 4.0 * np.random.default_rng(0).standard_normal(100_000)
    assert (factors > np.log(19.0)).mean() == pytest.approx(
        compute_resolution_probability(16.0), abs=0.005
    )
