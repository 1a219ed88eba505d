"""From a fit to a linear problem: columns are changes of exact predictions, and coefficients count from zero."""

from dataclasses import replace

import numpy as np
import pytest
from planted import HAND, planted, two_loads_a_pose
from scipy.stats import chi2, ncx2
from synthetic import NOISE, made_states

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.linearize import declared_geometry, lacking, linearized, shapes_tried
from elastocal.diagnosis.linearize import testable as which_are_testable
from elastocal.diagnosis.settings import Settings
from elastocal.fitting import fit
from elastocal.model import residuals

SETTINGS = Settings()
KEYS = ("joint_offset@2", "joint_offset@3", "joint_tilt@2", "link_elasticity@3", "payload", "link_geometry@4")


@pytest.fixture(scope="module")
def campaign(kuka):
    """A robot whose joint 3 stands half a milliradian off."""
    return planted(kuka, {"joint_offset@3": [5e-4]}, seed=1)


def problem_of(campaign, fitted=None, keys=KEYS, settings=SETTINGS):
    fitted = fitted or campaign.declared
    candidates = [campaign.candidates[key] for key in keys]
    return linearized(fitted, campaign.observations, candidates, settings)


def with_effect(campaign, key, values):
    """The declared fit's model and estimate with an effect of given size."""
    model = campaign.declared.model.with_effects([campaign.candidates[key]])
    start = campaign.declared.estimate.with_effects([campaign.candidates[key]])
    start.coefficients[-1][:] = values
    return model, start


def unit_of(found, key):
    return next(unit for unit in found.problem.units if unit.key == key)


@pytest.mark.parametrize("key", ["joint_offset@2", "joint_tilt@2", "link_elasticity@3"])
def test_a_column_is_the_change_of_the_exact_prediction_at_the_plausible_size(campaign, key):
    """By W'My: the change of W'My is what the column itself has along W, where readings move by what the effect does."""
    found, fitted = problem_of(campaign), campaign.declared
    unit = unit_of(found, key)
    step = np.zeros(len(unit.columns))
    step[0] = 1e-3
    model, moved = with_effect(campaign, key, step * unit.sizes)
    off = residuals(model, moved, campaign.observations, fitted.circumstances)
    # Robust weights of the fit stay as they are.
    pushed = replace(fitted, estimate=fitted.estimate)
    observations = replace(campaign.observations, position=campaign.observations.position + (fitted.residual - off))
    after = linearized(pushed, observations, [campaign.candidates[k] for k in KEYS], SETTINGS)
    change = after.problem.statistics.along[0] - found.problem.statistics.along[0]
    expected = found.problem.statistics.gram[0][:, unit.columns] @ step
    np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max())


def test_a_problem_about_a_model_with_an_effect_is_the_one_about_the_model_without(campaign):
    """Coefficients count from zero, not from the fit: what the fit gives to a candidate is given back to the readings."""
    model, start = with_effect(campaign, "joint_offset@3", [0.0])
    noise = campaign.declared.noise
    fitted = fit(model, campaign.observations, noise, start)
    assert abs(fitted.values_of("joint_offset@3")[0][0]) > 4e-4
    keys = ("joint_offset@2", "joint_offset@3", "joint_offset@4")
    one = problem_of(campaign, replace(campaign.declared, weights=fitted.weights), keys).problem.statistics
    other = problem_of(campaign, fitted, keys).problem.statistics
    np.testing.assert_allclose(other.gram[0][:3, :3], one.gram[0][:3, :3], rtol=1e-2)
    np.testing.assert_allclose(other.along[0][:3], one.along[0][:3], rtol=1e-2)
    assert one.along[0][1] / np.sqrt(one.gram[0][1, 1]) > 20


def test_an_effect_is_found_at_its_true_size(campaign):
    found = problem_of(campaign)
    unit, statistics = unit_of(found, "joint_offset@3"), found.problem.statistics
    gram, along = statistics.gram[0][np.ix_(unit.columns, unit.columns)], statistics.along[0][unit.columns]
    value = (along / gram[0]).item() * unit.sizes[0]
    assert value == pytest.approx(5e-4, abs=4 * unit.sizes[0] / np.sqrt(gram.item()))


@pytest.mark.parametrize(("offset", "size"), [(1e-4, 0.1), (1e-3, 1.0), (1e-2, 10.0)])
def test_declared_geometry_has_the_size_that_the_readings_make_most_probable(offset, size, kuka):
    keys = [f"joint_offset@{joint}" for joint in (2, 3, 4, 5)]
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    campaign = planted(kuka, {key: [sign * offset] for key, sign in zip(keys, signs, strict=True)}, seed=2)
    known = [campaign.candidates[key] for key in keys]
    model, start = campaign.declared.model.with_effects(known), campaign.declared.estimate.with_effects(known)
    fitted = fit(model, campaign.observations, campaign.declared.noise, start)
    # Springs of the joints have no size: they keep their wide priors.
    assert declared_geometry(model) == {"joint_offset"}
    found = linearized(fitted, campaign.observations, [campaign.candidates["payload"]], SETTINGS)
    assert found.declared_size == size
    assert size in SETTINGS.declared_sizes
    alone = linearized(campaign.declared, campaign.observations, [campaign.candidates["payload"]], SETTINGS)
    assert alone.declared_size == 1.0 and declared_geometry(campaign.declared.model) == set()


@pytest.mark.parametrize("share", [1.0, 0.1, 0.01])
def test_the_size_of_geometry_is_the_same_whatever_noise_was_taken(share, kuka):
    """Noise that is declared far too small must not make sizes small: they would be so many standard errors, not so many mm."""
    keys = [f"joint_offset@{joint}" for joint in (2, 3, 4, 5)]
    campaign = planted(kuka, {key: [1e-3 * (-1) ** n] for n, key in enumerate(keys)}, seed=2)
    known = [campaign.candidates[key] for key in keys]
    model, start = campaign.declared.model.with_effects(known), campaign.declared.estimate.with_effects(known)
    fitted = fit(model, campaign.observations, campaign.declared.noise.scaled(share), start)
    found = linearized(fitted, campaign.observations, [campaign.candidates["payload"]], SETTINGS)
    assert found.declared_size == 1.0


def test_the_competitor_is_at_every_joint_and_at_the_base_always(campaign):
    found = problem_of(campaign, keys=KEYS[:1])
    places = [unit.location for unit in found.problem.units if unit.mechanism == OTHER]
    assert places == [(1,), (2,), (3,), (4,), (5,), (6,), ()]


def test_candidates_without_their_covariate_are_untestable_with_the_reason(kuka):
    states = replace(two_loads_a_pose(6, 25, 3), time_s=None, temperature_c=None, approach=None)
    campaign = planted(kuka, {}, states=states)
    keys = ("frame_drift", "hysteresis@2", "thermal_growth[temperature]", "joint_offset@3")
    found = problem_of(campaign, keys=keys)
    assert set(found.untestable) == set(keys[:3])
    assert "approach" in found.untestable["hysteresis@2"] and "temperature" in found.untestable["thermal_growth[temperature]"]
    assert all(why.startswith("no ") and why.endswith("in the data") for why in found.untestable.values())
    tested = {unit.candidate.key for unit in found.problem.units if unit.candidate}
    assert tested == {"joint_offset@3"}


def test_too_few_angles_of_a_joint_test_no_harmonic_of_it(kuka):
    states = made_states(6, 30, seed=4)
    states.joint_angles[:, 3] = np.arange(30) % 3 * 0.4
    campaign = planted(kuka, {}, states=states, targets=HAND)
    candidate = campaign.candidates["transmission_harmonic@4[orders 1-2]"]
    told = lacking(candidate, campaign.declared.model.sites, states)
    assert told == f"3 angles of joint 4 where {candidate.distinct_angles} are needed"


def test_what_is_too_small_to_be_seen_at_its_plausible_size_is_untestable(kuka):
    """Readings a thousand times as noisy show no offset."""
    campaign = planted(kuka, {}, seed=5)
    loud = replace(campaign.declared, noise=NOISE.scaled(1e3))
    found = problem_of(campaign, loud, KEYS[:2])
    assert set(found.untestable.values()) == {"too small to be seen at its plausible size"}
    assert not any(unit.candidate for unit in found.problem.units)


def test_a_testable_unit_would_be_found_with_a_power_of_a_half(campaign):
    """Non-centrality equal to the critical value of a chi-square of one degree of freedom."""
    problem = problem_of(campaign).problem
    gram = problem.statistics.gram.copy()
    units = [unit for unit in problem.units if unit.candidate]
    critical = chi2.isf(SETTINGS.alarm_level / len(units), 1)
    assert ncx2.sf(critical, 1, critical) == pytest.approx(SETTINGS.testable_power, abs=0.01)
    for factor, expected in ((1.01, True), (0.99, False)):
        largest = np.linalg.eigvalsh(gram[0][np.ix_(units[0].columns, units[0].columns)])[-1]
        scaled = replace(problem.statistics, gram=gram * factor * critical / largest)
        assert which_are_testable(scaled, units, SETTINGS)[0] == expected


def test_shapes_are_tried_over_their_range_and_as_fitted(campaign):
    shaped = next(candidate for candidate in campaign.all_candidates if candidate.shapes)
    (shape,) = shaped.shapes
    tried = [value for (value,) in shapes_tried(shaped, campaign.declared)]
    assert tried == sorted(tried) and shape.lowest < tried[0] and tried[-1] < shape.highest
    model, start = with_effect(campaign, shaped.key, 0.0)
    fitted = replace(campaign.declared, model=model, estimate=start)
    assert shapes_tried(shaped, fitted) == [(shape.start,)]
    assert shapes_tried(campaign.candidates["joint_offset@3"], campaign.declared) == [()]


def test_the_prior_of_a_declared_parameter_is_kept(kuka):
    """An effect that is declared with a prior keeps it: it is projected off no further than its prior lets it be."""
    campaign = planted(kuka, {}, seed=6)
    stiff = campaign.candidates["joint_offset@2"]
    stiff = replace(stiff, parameters=tuple(replace(p, prior_std=1e-9) for p in stiff.parameters))
    model = campaign.declared.model.with_effects([stiff])
    fitted = fit(model, campaign.observations, campaign.declared.noise, campaign.declared.estimate.with_effects([stiff]))
    other = [campaign.candidates["joint_offset@2"]]
    held = linearized(fitted, campaign.observations, other, SETTINGS).problem.statistics
    free = linearized(campaign.declared, campaign.observations, other, SETTINGS).problem.statistics
    np.testing.assert_allclose(held.gram[0][0, 0], free.gram[0][0, 0], rtol=1e-3)
