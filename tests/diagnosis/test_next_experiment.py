"""The next experiment: what is within reach, what it tells, and that it resolves what
measurements can resolve."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit
from planted import planted, two_loads_a_pose

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
from elastocal.diagnosis.search import Alarm, ScoredModel, search_models
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import conclude

SETTINGS = Settings(pose_steps=(0.0, 2.0), other_features=6)
RAISED = Alarm(0.002, 10.0, True)
ELASTIC = ("link_elasticity", "base_compliance", "joint_tilt")


def diagnosed(campaign, robot, keys):
    """A diagnosis in which only some candidates compete."""
    robot = replace(robot, joint_limits=np.clip(robot.joint_limits, -2.0, 2.0))
    line = build_candidate_design(
        campaign.declared,
        campaign.observations,
        [campaign.candidates[key] for key in keys],
        SETTINGS,
    )
    found = search_models(line.problem)
    conclusion = conclude(line.problem, found, RAISED)
    evidence = SimpleNamespace(
        linearized=line, posterior=found, alarm=RAISED, conclusion=conclusion
    )
    case = SimpleNamespace(
        observations=campaign.observations, campaign=SimpleNamespace(robot=robot)
    )
    return SimpleNamespace(case=case, evidence=evidence, final=campaign.declared)


def keys_like(campaign, *starts):
    return [key for key in campaign.candidates if key.startswith(starts)]


@pytest.fixture(scope="module")
def ambiguous(kuka):
    """A nonlinear link in eight poses, which the tilt of a joint explains as well."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(
        kuka, {"link_elasticity@2": (3.9e-8, 5.2e-8)}, seed=3, poses=8, states=states
    )
    return diagnosed(campaign, kuka, keys_like(campaign, *ELASTIC))


def test_the_proposal_is_within_reach_in_the_angles_of_the_controller(ambiguous, kuka):
    columns, facts = propose_experiment(ambiguous, np.random.default_rng(0))
    assert (np.diff(columns["separation"]) > 0).all() and (
        np.diff(columns["resolved"]) > 0
    ).all()
    assert (facts["poses"], facts["reason"], facts["separation"]) == (
        10,
        "",
        columns["separation"][-1],
    )
    assert max(
        np.abs(columns[f"q{joint}"]).max() for joint in range(1, 7)
    ) <= 2.0 and set(columns["point"]) == {"3DoF 6DoF"}
    reporting = replace(ambiguous.case.campaign.robot, reported_offset=np.full(6, 0.1))
    case = SimpleNamespace(
        observations=ambiguous.case.observations,
        campaign=SimpleNamespace(robot=reporting),
    )
    reported, same = propose_experiment(
        SimpleNamespace(**vars(ambiguous) | {"case": case}), np.random.default_rng(0)
    )
    np.testing.assert_allclose(reported["q3"], columns["q3"] - 0.1)
    assert same == facts and len(set(columns["effect"])) == 1
    assert (
        " or ".join(map(" + ".join, [facts["best"], facts["nearest"]]))
        == columns["effect"][0]
    )


def test_of_an_exact_alias_no_pose_is_asked_for(kuka):
    """The same law under two names."""
    names = ("compensator_torque", "transmission_harmonic")
    campaign = planted(
        kuka, {"compensator_torque@2": (1e-4, 1e-4, 5e-5, 5e-5)}, poses=15
    )
    diagnosis = diagnosed(
        campaign, kuka, ["compensator_torque@2", "transmission_harmonic@2[orders 1-2]"]
    )
    columns, facts = propose_experiment(diagnosis, np.random.default_rng(0), 4)
    assert {
        *facts["best"],
        *(name for each in facts["indistinguishable"] for name in each),
    } >= set(names)
    facts = json.loads(json.dumps(facts, allow_nan=False))
    stated = (facts["reason"], facts["poses"], facts["separation"], facts["resolved"])
    assert stated == (NOT_DISTINGUISHABLE, 0, None, None)
    assert list(columns)[:4] == ["effect", "pose", "point", "q1"] and not any(
        map(len, columns.values())
    )


def test_an_alias_does_not_keep_the_others_from_being_distinguished(kuka):
    """Beside its alias, which leaves the promise, a tilt is distinguished from the link
    that bends."""
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    campaign = planted(
        kuka, {"joint_tilt@2": (1e-7, 1e-7)}, seed=3, poses=8, states=states
    )
    # At every joint, or the tilt of several would not be what the alias of one is.
    alias = [
        replace(campaign.candidates[key], effect="twin")
        for key in keys_like(campaign, "joint_tilt")
    ]
    candidates = campaign.candidates | {each.key: each for each in alias}
    keys = [*keys_like(campaign, *ELASTIC), *(each.key for each in alias)]
    columns, facts = propose_experiment(
        diagnosed(replace(campaign, candidates=candidates), kuka, keys),
        np.random.default_rng(0),
        6,
    )
    assert sorted([facts["best"], *facts["indistinguishable"]]) == [
        ["joint_tilt"],
        ["twin"],
    ]
    assert len(columns["pose"]) == 6 and facts["separation"] > 2


def test_nothing_is_proposed_where_nothing_is_ambiguous(kuka):
    # So many poses that something unknown beside it has less than what is left open.
    campaign = planted(kuka, {"joint_offset@3": (2e-3,)}, poses=40)
    diagnosis = diagnosed(campaign, kuka, ["joint_offset@3", "payload"])
    assert (
        propose_experiment(diagnosis, np.random.default_rng(0))[1]["reason"]
        == NOTHING_AMBIGUOUS
    )
    quiet = SimpleNamespace(**vars(diagnosis) | {"evidence": None})
    assert (
        propose_experiment(quiet, np.random.default_rng(0))[1]["reason"]
        == DATA_AT_FAULT
    )


def test_an_entry_is_read_at_every_target_without_its_load_and_under_it_and_errs_together(
    kuka,
):
    states = replace(two_loads_a_pose(6, 6, 1), temperature_c=None)
    campaign = planted(kuka, {}, states=states)
    keys = keys_like(campaign, "lost_motion@2", "joint_tilt@3", "payload")
    line = build_candidate_design(
        campaign.declared,
        campaign.observations,
        [campaign.candidates[key] for key in keys],
        SETTINGS,
    )
    seen = build_planned_observations(
        campaign.declared.model, states, states.joint_angles[::2], states.wrench[1::2]
    )
    np.testing.assert_array_equal(seen.states.wrench, states.wrench)
    np.testing.assert_array_equal(seen.states.joint_angles, states.joint_angles)
    np.testing.assert_array_equal(seen.target, np.tile([0, 1], len(states)))
    assert (
        set(seen.states.approach.ravel()) == {-1.0, 1.0}
        and seen.states.temperature_c is None
    )
    assert set(seen.states.time_s) == {states.time_s[-1]}
    columns = np.concatenate(
        [unit.columns for unit in line.terms if unit.mechanism == "joint_tilt"]
    )
    own, together = (
        compute_whitened_rows(line, seen, columns, tau) for tau in (0.0, 2e-4)
    )
    # Sensitivities to the declared parameters as where the campaign was measured: its
    # own approach aside, by which none goes.
    np.testing.assert_allclose(
        own[..., : line.products.declared_count].reshape(
            -1, line.products.declared_count
        ),
        (line.rows.declared @ line.products.basis_transform).reshape(
            -1, line.products.declared_count
        ),
        rtol=1e-6,
        atol=1e-6,
    )
    jacobian = line.rows.jacobian.reshape(len(own), own.shape[1], -1)
    for one, other, J in zip(own, together, jacobian, strict=True):
        covariance = np.eye(len(one)) + 4e-8 * J @ J.T
        np.testing.assert_allclose(
            other.T @ other,
            one.T @ np.linalg.solve(covariance, one),
            rtol=1e-6,
            atol=1e-6,
        )


def test_entries_have_the_campaigns_loads_as_large_as_may_be(kuka):
    states = two_loads_a_pose(6, 8, (5, 3), 1500.0)
    draws = np.random.default_rng(0)
    size = np.linspace(100.0, 800.0, len(states))
    loaded = replace(
        states, wrench=size[:, None] * np.array([0.0, 0.0, 1.0, 0.0, 0.5, 0.0])
    )
    # The weight of the rated payload, at the lever of the campaign's loads.
    _, wrench = draw_candidate_experiments(
        loaded, replace(kuka, payload_kg=200.0), 40, draws
    )
    np.testing.assert_allclose(
        wrench, np.tile(200.0 * 9.80665 * np.array([0, 0, 1, 0, 0.5, 0]), (40, 1))
    )
    assert not draw_candidate_experiments(
        replace(states, wrench=0.0 * states.wrench), kuka, 3, draws
    )[1].any()


UNITS = (
    made_unit("offset", (1,), 0),
    made_unit("tilt", (1,), [2, 3]),
    made_unit("sag", (2,), [4, 5]),
)
# Of the columns of the problem's statistics those that are looked at: the units' own,
# without column 1.
COLUMNS = np.array([0, 2, 3, 4, 5])


@pytest.mark.parametrize("factor", [1.0, 1.7])
def test_posteriors_are_those_of_dense_generalized_least_squares_at_the_pose_error_of_the_leading_model(
    factor,
):
    """Declared parameters over their priors; a larger noise widens every deviation, and
    so leaves the means."""
    rows = made_rows(1, prior=0.5)
    problem, products = made_problem(rows, UNITS, tau=np.array([0.0, 0.4]))
    leading = ScoredModel((0, 2), 0.5, np.array([0.5, 2.0]), 0.4)
    other = ScoredModel((1,), 1.0, np.array([1.5]), 0.0)
    line = SimpleNamespace(problem=problem, products=products)
    covariance = rows.marginal_covariance(0.4)
    declared = rows.declared.shape[1]
    models = [leading, other]
    for (found, spread), model in zip(
        compute_coefficient_posteriors(line, COLUMNS, models, factor),
        models,
        strict=True,
    ):
        columns = np.concatenate([UNITS[n].columns for n in model.term_indices])
        deviation = np.repeat(
            model.scales, [len(UNITS[n].columns) for n in model.term_indices]
        )
        W = rows.candidates[:, columns]
        precision = W.T @ np.linalg.solve(covariance, W) + np.diag(deviation**-2.0)
        mean = np.linalg.solve(
            precision, W.T @ np.linalg.solve(covariance, rows.residual - rows.expected)
        )
        at = declared + np.searchsorted(COLUMNS, columns)
        np.testing.assert_allclose(found[at], mean, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(
            spread[np.ix_(at, at)], factor**2 * np.linalg.inv(precision), rtol=1e-8
        )
        without = np.setdiff1d(np.arange(declared, len(found)), at)
        assert not found[without].any() and not spread[without].any()


def made_pair(rng, size=5):
    """Two normal distributions of coefficients, of which each lacks one."""
    found = []
    for lacking in (0, 1):
        half = rng.standard_normal((size, size))
        mean = rng.standard_normal(size)
        half[lacking] = 0.0
        mean[lacking] = 0.0
        found.append((mean, half @ half.T))
    return found


def test_experiments_in_turn_separate_as_both_together_by_eight_bhattacharyya_distances():
    rng = np.random.default_rng(0)
    one, other = made_pair(rng)
    A = rng.standard_normal((2, 3, 5))
    rows = A.reshape(6, 5)
    spreads = [np.eye(6) + rows @ C @ rows.T for _, C in (one, other)]
    middle = sum(spreads) / 2
    off = rows @ (one[0] - other[0])
    log_dets = [np.linalg.slogdet(each)[1] for each in (middle, *spreads)]
    expected = (
        off @ np.linalg.solve(middle, off)
        + 4 * log_dets[0]
        - 2 * log_dets[1]
        - 2 * log_dets[2]
    )
    pairs = HypothesisPair.of(one, other)
    assert pairs.gained(rows[None])[0] == pytest.approx(expected)
    assert pairs.after(A[0]).after(A[1]).separation == pytest.approx(expected)


def test_the_experiments_chosen_separate_the_nearest_by_more_than_random_ones():
    rng = np.random.default_rng(1)
    first, second, third = (*made_pair(rng), made_pair(rng)[1])
    pairs = [HypothesisPair.of(first, second), HypothesisPair.of(first, third)]
    rows = 0.3 * rng.standard_normal((40, 3, 5))
    chosen, separations = select_experiments(pairs, np.ones(2), rows, 4)
    assert len(set(chosen)) == 4 and (np.diff(separations, axis=0) > 0).all()
    np.testing.assert_allclose(
        separations[-1],
        [pair.gained(rows[chosen].reshape(1, 12, 5))[0] for pair in pairs],
    )
    drawn_at_random = [rng.choice(40, 4, replace=False) for _ in range(50)]
    others = [
        min(pair.gained(rows[some].reshape(1, 12, 5))[0] for pair in pairs)
        for some in drawn_at_random
    ]
    assert separations[-1].min() > np.quantile(others, 0.98)


def test_a_separation_of_16_gives_the_right_one_odds_of_19_to_1_in_nine_cases_of_ten():
    assert (
        compute_resolution_probability(16.0) == pytest.approx(0.9, abs=0.005)
        and compute_resolution_probability(0.0) < 1e-9
    )
    # Log Bayes factors of two predictions of the same covariance.
    factors = 16.0 / 2 + 4.0 * np.random.default_rng(0).standard_normal(100_000)
    assert (factors > np.log(19.0)).mean() == pytest.approx(
        compute_resolution_probability(16.0), abs=0.005
    )
