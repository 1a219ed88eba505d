"""From a fit to a linear problem: columns are changes of exact predictions, and coefficients count from zero."""

from dataclasses import replace

import numpy as np
import pytest
from planted import HAND, planted, two_loads_a_pose
from scipy.stats import chi2, ncx2
from synthetic import NOISE, made_states

from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.linearize import lacking, linearized, shapes_looked_at_closely, shapes_tried, smallest_shown
from elastocal.diagnosis.other import laws_of
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import residuals

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


def fitted_at(campaign, key, *shapes):
    """The declared fit with an effect of no size, of given shapes or of those that a fit starts from."""
    model, start = with_effect(campaign, key, 0.0)
    if shapes:
        start.shapes[-1][:] = shapes
    return replace(campaign.declared, model=model, estimate=start)


def unit_of(found, key):
    return next(unit for unit in found.problem.units if unit.candidate and unit.candidate.key == key)


@pytest.mark.parametrize("key", ["joint_offset@2", "joint_tilt@2", "link_elasticity@3"])
def test_a_column_is_the_change_of_the_exact_prediction_at_the_plausible_size(campaign, key):
    """By W'My: the change of W'My is what the column itself has along W, where measurements move by what the effect does."""
    found, fitted = problem_of(campaign), campaign.declared
    unit = unit_of(found, key)
    step = np.zeros(len(unit.columns))
    step[0] = 1e-3
    model, moved = with_effect(campaign, key, step * unit.sizes)
    off = residuals(model, moved, campaign.observations, fitted.conditions)
    # Robust weights of the fit stay as they are.
    pushed = replace(fitted, estimate=fitted.estimate)
    observations = replace(campaign.observations, position=campaign.observations.position + (fitted.residual - off))
    after = linearized(pushed, observations, [campaign.candidates[k] for k in KEYS], SETTINGS)
    change = after.problem.statistics.along[0] - found.problem.statistics.along[0]
    expected = found.problem.statistics.gram[0][:, unit.columns] @ step
    np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max())


def test_a_problem_about_a_model_with_an_effect_is_the_one_about_the_model_without(campaign):
    """Coefficients count from zero, not from the fit: what the fit gives to a candidate is given back to the measurements."""
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


def test_the_competitor_acts_by_all_its_laws_of_which_the_campaign_has_inputs_and_that_show(campaign):
    loud = {unit.key for unit in problem_of(campaign, keys=KEYS[:1]).problem.units if unit.mechanism == OTHER}
    quiet = replace(campaign.declared, noise=campaign.declared.noise.scaled(0.01))
    found = problem_of(campaign, quiet, KEYS[:1])
    assert loud < {unit.key for unit in found.problem.units}
    against = [unit.law for unit in found.problem.units if unit.mechanism == OTHER]
    laws = laws_of(campaign.declared.conditions, SETTINGS.other_features)
    assert [(law.location, law.name) for law in against] == [(law.location, law.name) for law in laws]
    assert {each.location for each in against} == {(1,), (2,), (3,), (4,), (5,), (6,), ()}
    columns = [len(unit.columns) for unit in found.problem.units if unit.mechanism == OTHER and unit.location]
    assert set(columns) == {SETTINGS.other_features}


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


@pytest.mark.parametrize(
    ("key", "joint", "angles"),
    [("transmission_harmonic@4[orders 1-2]", 4, 3), *(("nest_eccentricity", 6, n) for n in (3, 7, 8))],
)
def test_too_few_angles_of_a_joint_test_no_law_that_goes_by_them(kuka, key, joint, angles):
    """Nor of the last joint a nest, a law that belongs to no joint."""
    states = made_states(6, 30, seed=4)
    states.joint_angles[:, joint - 1] = np.arange(30) % angles * 0.4
    campaign = planted(kuka, {}, states=states, targets=HAND)
    told = lacking(campaign.candidates[key], campaign.declared.model.offered(states), states.joint_angles)
    assert told == ("" if angles == 8 else "too few different angles of a joint")


def test_what_is_too_small_to_be_seen_at_any_size_is_untestable(kuka):
    """Measurements ten thousand times as noisy show no offset."""
    campaign = planted(kuka, {}, seed=5)
    loud = replace(campaign.declared, noise=NOISE.scaled(1e4))
    found = problem_of(campaign, loud, KEYS[:2])
    assert set(found.untestable.values()) == {"too small to be seen at any size that such an effect has"}
    assert not any(unit.candidate for unit in found.problem.units)


def test_the_smallest_size_is_the_first_that_would_be_found_with_a_power_of_a_half(campaign):
    """Non-centrality equal to the critical value of a chi-square of one degree of freedom, at each of the sizes."""
    problem = problem_of(campaign).problem
    gram, scales = problem.statistics.gram.copy(), SETTINGS.scales
    units = [unit for unit in problem.units if unit.candidate]
    critical = chi2.isf(SETTINGS.alarm_level / len(units), 1)
    assert ncx2.sf(critical, 1, critical) == pytest.approx(0.5, abs=0.01)
    largest = np.linalg.eigvalsh(gram[0][np.ix_(units[0].columns, units[0].columns)])[-1]
    for place, scale in enumerate(scales):
        for factor, shown in ((1.01, place), (0.99, place + 1)):
            scaled = replace(problem.statistics, gram=gram * factor * critical / largest / scale**2)
            assert smallest_shown(scaled, units, SETTINGS)[0] == shown


def test_shapes_are_tried_over_their_range_and_as_fitted(campaign):
    shaped = next(candidate for candidate in campaign.all_candidates if candidate.shapes and not candidate.shapes[0].tried)
    (shape,) = shaped.shapes
    tried = [value for (value,) in shapes_tried(shaped, campaign.declared)]
    assert len(tried) == 3 and tried == sorted(tried) and shape.lowest < tried[0] and tried[-1] < shape.highest
    assert shapes_tried(shaped, fitted_at(campaign, shaped.key)) == [(shape.start,)]
    assert shapes_tried(campaign.candidates["joint_offset@3"], campaign.declared) == [()]


@pytest.mark.parametrize("when", [0.63, 1 / 12, 0.9])
def test_a_step_that_was_fitted_is_tried_close_to_where_it_was_within_its_range(campaign, when):
    """Itself among them, or the fit could only become worse; each of its values has a share of the prior."""
    step = campaign.candidates["setup_step"]
    tried = [value for (value,) in shapes_tried(step, fitted_at(campaign, "setup_step", when))]
    (shape,) = step.shapes
    assert np.isclose(tried, when).any() and len(tried) >= 4
    assert min(tried) >= shape.lowest and max(tried) <= shape.highest
    assert np.ptp(tried) < 0.5 / 12
    assert (shape.shares(tried) > 0).all()


def test_the_shapes_of_the_best_candidates_are_looked_at_more_closely_about_the_best_value_of_each(campaign):
    """Of laws with a shape that is tried at several values, at a single one, and without one."""
    problem = problem_of(campaign, keys=("setup_step", "thermal_growth[time]", "link_elasticity@3", "joint_offset@3")).problem
    sizes = {("setup_step", 5): 30.0, ("setup_step", 6): 25.0, ("thermal_growth[time]", 1): 28.0, ("joint_offset@3", 0): 29.0}
    alone = np.zeros(len(problem.units))
    for (key, place), size in sizes.items():
        numbers = [n for n, unit in enumerate(problem.units) if unit.candidate and unit.candidate.key == key]
        alone[numbers[place]] = size
    found = {key: [value for (value,) in values] for key, values in shapes_looked_at_closely(problem, alone).items()}
    assert set(found) == {"setup_step", "thermal_growth[time]"}
    closer = np.linspace(5 / 12, 7 / 12, 9)[1:-1]
    np.testing.assert_allclose(found["setup_step"], np.unique(np.round([*np.arange(1, 12) / 12, *closer], 12)))
    lags = np.geomspace(900.0, 36000.0, 5)
    np.testing.assert_allclose(found["thermal_growth[time]"], np.geomspace(lags[1], lags[3], 9))


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
