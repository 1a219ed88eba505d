"""What a regression is shown, and what it and a model together leave of poses that neither has seen."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from made_remainders import SMOOTH_M, smoothly_wrong_cases
from synthetic import made_estimate, made_model, made_states, seen_exactly

import elastocal.remainder
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import conditions, predict, target_points
from elastocal.fitting.noise import Noise
from elastocal.mechanics.kinematics import poses
from elastocal.remainder.corrected import Plan, corrected, fitted_again, inputs_of, regressions, remainder_facts
from elastocal.validation.held_out import position_errors
from elastocal.validation.placing import placed

NOISE = Noise("declared", 2e-5, 2e-5, np.zeros(6))
CONSTANT = """
import numpy as np

from elastocal.remainder.protocol import Prediction

NAME, WORDS, SETTINGS = "constant", "constant", ({},)


def fitted(inputs, residual, settings, seed):
    mean = residual.mean(axis=0)
    for _ in settings:
        yield lambda there: Prediction(np.tile(mean, (len(there), 1)))
"""
PLAN = Plan("gaussian_process", blocks=False, within_range=False, seed=1)


@pytest.fixture(scope="module")
def made(kuka, config_folder, tmp_path_factory):
    case, held_out = smoothly_wrong_cases(tmp_path_factory.mktemp("corrected"), kuka, config_folder / "robots", poses=90)
    return case, held_out, fit(case.model, case.observations, NOISE)


def rms(values):
    return np.sqrt((values**2).sum(axis=-1).mean())


def test_a_smooth_remainder_is_predicted_and_its_intervals_hold(made):
    case, held_out, fitted = made
    before = rms(position_errors(*placed(fitted, case, held_out), held_out.observations).distance[:, None])
    found = corrected(PLAN, fitted, case, held_out)
    assert before > 0.8 * SMOOTH_M and rms(found.residual) < 0.5 * before
    # 45 poses, three coordinates each: a standard error of 2 to 3 %.
    assert (np.abs(found.residual) < 1.96 * found.std).mean() > 0.87


def test_outside_the_range_nothing_is_corrected_where_that_is_asked_for(made):
    case, held_out, fitted = made
    angles = held_out.observations.states.joint_angles.copy()
    angles[:5, 1] += 9.0
    moved = replace(held_out.observations, states=replace(held_out.observations.states, joint_angles=angles))
    beyond = replace(held_out, observations=moved)
    plain = corrected(PLAN, fitted, case, beyond)
    careful = corrected(replace(PLAN, within_range=True), fitted, case, beyond)
    seen = np.isin(moved.state, np.arange(5))
    assert careful.outside[seen].all()
    alone = rms(position_errors(*placed(fitted, case, beyond), moved).distance[careful.outside][:, None])
    np.testing.assert_allclose(rms(careful.residual[careful.outside]), alone)
    np.testing.assert_array_equal(careful.residual[~careful.outside], plain.residual[~careful.outside])
    assert (careful.std[seen] > 1.5 * np.median(careful.std[~careful.outside], axis=0)).all()


def test_another_campaign_has_its_frame_fitted_to_what_both_leave(made, kuka, config_folder, tmp_path):
    """A tracker that stands elsewhere: what the regression predicts turns with it."""
    case, _, fitted = made
    _, other = smoothly_wrong_cases(tmp_path, kuka, config_folder / "robots", poses=60, seed=5, frame="tracker")
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = replace(other.observations, position=other.observations.position @ turn.T + [0.5, 0.2, -1.0])
    other = replace(other, observations=moved, campaign=replace(other.campaign, name="elsewhere"))
    alone = position_errors(*placed(fitted, case, other), moved).distance
    found = corrected(PLAN, fitted, case, other)
    assert rms(found.residual) < 0.7 * np.sqrt((alone**2).mean())


@pytest.mark.parametrize(("blocks", "regression"), [(False, "ridge_harmonics"), (True, "gaussian_process")])
def test_regressions_are_tuned_on_the_training_poses_alone(made, blocks, regression):
    """Held-out poses that are nonsense change neither a setting nor what is predicted of them."""
    case, held_out, fitted = made
    plan = Plan(regression, blocks, within_range=False, seed=1)
    nonsense = replace(held_out.observations, position=held_out.observations.position + 1.0)
    one, other = (
        corrected(plan, fitted, case, replace(held_out, observations=seen)) for seen in (held_out.observations, nonsense)
    )
    assert one.chosen.setting == other.chosen.setting is not None
    np.testing.assert_allclose(other.residual, one.residual + 1.0, atol=1e-9)


def test_the_jacobian_is_that_of_each_target_and_its_place_is_shown(fanuc):
    model = made_model(fanuc.chain, rows=3, compliance=fanuc.compliance)
    estimate = made_estimate(model, (0,), seed=3)
    seen = seen_exactly(model, estimate, made_states(6, 9, seed=4))
    inputs = inputs_of(model, estimate, seen)
    step, joint = 1e-6, 2
    for number, point in enumerate(target_points(model, estimate)):
        mask = seen.target == number
        ends = []
        for sign in (-1.0, 1.0):
            coordinates = np.zeros((mask.sum(), model.sites.chain.coordinates))
            coordinates[:, :6] = seen.states.joint_angles[seen.state[mask]]
            coordinates[:, joint] += sign * step
            ends.append(poses(model.sites.chain, coordinates, point)[0])
        np.testing.assert_allclose(inputs.jacobian[mask, :, joint], (ends[1] - ends[0]) / (2 * step), atol=1e-8)
        np.testing.assert_array_equal(inputs.others[mask, -3:], np.tile(estimate.target_offset[number], (mask.sum(), 1)))


def test_what_effects_of_the_model_do_may_be_taken_back_but_for_what_tasks_know_nothing_of(fanuc):
    """Columns are the slopes of predictions in usual sizes; thermal growth has none, nor has what moves no robot."""
    chosen = [("transmission_harmonic", (2,)), ("thermal_growth", ()), ("link_weight", (3,)), ("tracker_scale", ())]
    plain = made_model(fanuc.chain, rows=3, compliance=fanuc.compliance)
    known = {(each.effect, each.joints): each for each in candidates_on(plain.sites).values()}
    model = plain.with_effects([known[key] for key in chosen])
    estimate = made_estimate(plain, (0,), seed=3).with_effects(model.effects[-4:])
    seen = seen_exactly(plain, made_estimate(plain, (0,), seed=3), made_states(6, 9, seed=4))
    timed = replace(seen.states, time_s=np.arange(9.0), temperature_c=np.full(9, 21.0))
    seen, slopes = replace(seen, states=timed), []
    for number in (-4, -2):
        for which, parameter in enumerate(model.effects[number].parameters):
            values = [each.copy() for each in estimate.coefficients]
            values[number][which] = 1e-3 * parameter.plausible
            moved = replace(estimate, coefficients=tuple(values))
            ends = [predict(model, each, seen, conditions(model, each, seen.states))[0] for each in (estimate, moved)]
            slopes.append(1e3 * (ends[1] - ends[0]))
    beside = inputs_of(model, estimate, seen).jacobian[:, :, plain.sites.chain.coordinates :]
    size = np.abs(slopes).max()
    np.testing.assert_allclose(beside, 1e3 * np.stack(slopes, axis=2), atol=1e3 * 0.02 * size)


def test_a_correction_knows_neither_time_nor_temperature(fanuc):
    model = made_model(fanuc.chain, rows=3, compliance=fanuc.compliance)
    estimate = made_estimate(model, (0,), seed=3)
    seen = seen_exactly(model, estimate, made_states(6, 9, seed=4))
    timed = replace(seen, states=replace(seen.states, time_s=np.arange(9.0), temperature_c=np.full(9, 21.0)))
    np.testing.assert_array_equal(inputs_of(model, estimate, timed).others, inputs_of(model, estimate, seen).others)


def test_beyond_the_loads_that_were_fitted_nothing_is_corrected(made):
    case, held_out, fitted = made
    states = held_out.observations.states
    loaded = replace(states, wrench=states.wrench + np.eye(6)[2])
    held_out = replace(held_out, observations=replace(held_out.observations, states=loaded))
    found = corrected(replace(PLAN, within_range=True), fitted, case, held_out)
    assert found.outside.all() and found.chosen.regression is not None
    alone = position_errors(*placed(fitted, case, held_out), held_out.observations).distance
    np.testing.assert_allclose(np.linalg.norm(found.residual, axis=1), alone)


@pytest.mark.parametrize("regression", ["gaussian_process", "extra_trees", "two_joints"])
def test_a_regression_comes_back_from_what_is_written_of_it(made, regression):
    case, held_out, fitted = made
    found = corrected(replace(PLAN, regression=regression), fitted, case, held_out)
    assert found.chosen.regression is not None
    facts = remainder_facts(found, fitted, fitted, case, held_out, np.random.default_rng(1))
    back = fitted_again(json.loads(json.dumps(facts)), fitted.model, fitted.estimate, case.observations)
    inputs = inputs_of(fitted.model, fitted.estimate, held_out.observations)
    one, other = found.chosen.predictor(inputs), back(inputs)
    np.testing.assert_allclose(other.mean, one.mean, atol=1e-9)
    np.testing.assert_allclose(other.std, one.std, rtol=1e-6)


@pytest.fixture
def one_more(tmp_path, monkeypatch):
    (tmp_path / "constant.py").write_text(CONSTANT, encoding="utf-8")
    monkeypatch.setattr(elastocal.remainder, "__path__", [*elastocal.remainder.__path__, str(tmp_path)])
    regressions.cache_clear()
    yield
    regressions.cache_clear()
    sys.modules.pop("elastocal.remainder.constant", None)


def test_the_catalogue_has_every_module_with_a_name():
    assert set(regressions()) == {"extra_trees", "gaussian_process", "ridge_harmonics", "two_joints"}


def test_a_file_more_is_a_regression_more(one_more):
    assert "constant" in regressions()


def test_shares_add_up_and_the_reduction_is_that_of_the_errors(kuka, config_folder, tmp_path):
    case, held_out = smoothly_wrong_cases(tmp_path, kuka, config_folder / "robots", poses=100)
    declared = fit(case.model, case.observations, NOISE)
    plan = Plan("gaussian_process", blocks=False, within_range=True, seed=1)

    def told(plan):
        found = corrected(plan, declared, case, held_out)
        return remainder_facts(found, declared, declared, case, held_out, np.random.default_rng(1))

    facts = told(plan)
    assert facts["physics"] == 0.0
    assert facts["regression_share"] + facts["left"] == pytest.approx(1.0)
    assert facts["regression_share"] > 0.5
    low, high = facts["reduction_ci95"]
    assert low < 1.0 - np.sqrt(facts["left"]) < high
    assert 0.85 < facts["covered"] <= 1.0 and facts["half_width_m"]["within"] > 3e-5
    assert facts["rms_ci95_m"][0] < facts["errors"]["rms_m"] < facts["rms_ci95_m"][1]
    # Trees state no deviations of their own: those of poses left out.
    assert told(replace(plan, regression="extra_trees"))["covered"] > 0.85
