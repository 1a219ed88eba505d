"""Score tests: against the classic tests of statsmodels, and what they say where nothing and where something is missing."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from planted import planted as planted_campaign
from planted import two_loads_a_pose
from scipy.linalg import block_diag, inv, sqrtm
from scipy.stats import binom
from synthetic import NOISE, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting import fit
from elastocal.model import effect_columns, linearize
from elastocal.screening import absorbed, cross_validated_gains, directions, leverage_adjusted, score

TARGET = (Target("A", "6DoF", None),)
REPLICATES = 199


@pytest.fixture(scope="module")
def base(fanuc):
    """A small campaign with two loads a pose: model, its true values, readings without noise, all candidates."""
    model = made_model(fanuc.chain, TARGET, compliance=fanuc.compliance)
    states = made_states(6, 60, seed=1)
    # Each pose is loaded twice.
    states.pose[:] = np.arange(60) // 2
    states.load[:] = 1 + np.arange(60) % 2
    states.joint_angles[:] = states.joint_angles[states.pose * 2]
    states.approach[:] = states.approach[states.pose * 2]
    true = made_estimate(model, seed=2)
    return model, true, seen_exactly(model, true, states), list(candidates_on(model.sites).values())


def drawn(base, number, planted=None, size=0.0):
    """Readings with noise, maybe with an effect, and the base model fitted to them."""
    model, true, seen, _ = base
    if planted is not None:
        effects = model.with_effects((planted,)), true.with_effects((planted,))
        effects[1].coefficients[0][0] = size
        seen = seen_exactly(*effects, seen.states)
    noisy = with_noise(seen, np.random.default_rng((3, number)))
    return fit(model, noisy, NOISE, start=true), noisy


def named(base, *keys):
    by_key = {candidate.key: candidate for candidate in base[3]}
    return [by_key[key] for key in keys]


@pytest.fixture(scope="module")
def nothing_missing(base):
    """Sixty campaigns that lack nothing: their directions and scores."""
    found = []
    for number in range(60):
        fitted, seen = drawn(base, number)
        one = directions(fitted, seen, base[3])
        found.append((one, score(one, REPLICATES, np.random.default_rng((4, number)))))
    return found


def whitened_rows(fitted, seen, candidate):
    """Residual, sensitivities of the model and of a candidate, whitened: as a textbook would have them."""
    around = fitted.circumstances
    line = linearize(fitted.model, fitted.estimate, seen, around)
    made = effect_columns([(candidate, [s.start for s in candidate.shapes])], around, line.coordinate_jacobian, seen.state)
    size = np.array([p.plausible for p in candidate.parameters])
    rows = [fitted.whitened(part) for part in (line.residual, line.sensitivities[..., ~fitted.held], made * size)]
    return rows[0].ravel(), rows[1].reshape(rows[0].size, -1), rows[2].reshape(rows[0].size, -1)


@pytest.mark.parametrize("key", ["joint_offset@2", "base_compliance", "link_elasticity@3", "link_weight@2", "stiffening@3"])
@pytest.mark.parametrize("planted", [False, True])
def test_statistic_is_that_of_the_added_variable_tests_of_statsmodels(base, key, planted):
    (candidate,) = named(base, key)
    fitted, seen = drawn(base, 100, candidate if planted else None, 0.5 * candidate.parameters[0].plausible)
    found = directions(fitted, seen, [candidate])
    scores = score(found, 19, np.random.default_rng(5))
    right, model, made = whitened_rows(fitted, seen, candidate)
    small, large = sm.OLS(right, model).fit(), sm.OLS(right, np.concatenate([model, made], axis=1)).fit()
    _, p_value, freedom = large.compare_f_test(small)
    assert freedom == scores.parameters[0] == made.shape[1]
    np.testing.assert_allclose(scores.p_value[0], p_value, rtol=1e-6, atol=1e-300)
    # Without a constant in the model, n times the uncentred share that the columns explain.
    lagrange = len(right) * scores.statistic[0] / (found.residual @ found.residual)
    np.testing.assert_allclose(lagrange, large.compare_lm_test(small, demean=False)[0], rtol=1e-6)
    np.testing.assert_allclose(scores.statistic[0], small.ssr - large.ssr, rtol=1e-6)
    np.testing.assert_allclose(scores.bic_gain[0], small.bic - large.bic, rtol=1e-6, atol=1e-6)


def test_statistic_of_an_effect_without_noise_is_its_noncentrality(base):
    model, true, _, _ = base
    for candidate in named(base, "joint_offset@3", "stiffening@2", "cross_compliance@2+3", "force_scale"):
        fitted = fit(model, base[2], NOISE, start=true)
        (planted,) = directions(fitted, base[2], [candidate]).noncentrality
        size = candidate.parameters[0].plausible * np.sqrt(1.0 / planted)
        effects = model.with_effects((candidate,)), true.with_effects((candidate,))
        effects[1].coefficients[0][0] = size
        seen = seen_exactly(*effects, base[2].states)
        found = directions(fit(model, seen, NOISE, start=true), seen, [candidate])
        # One standard deviation is far below what an effect does to its own Jacobian.
        np.testing.assert_allclose(score(found, 9, np.random.default_rng(0)).statistic, 1.0, rtol=0.01)


def test_no_more_false_alarms_than_one_in_twenty(nothing_missing):
    smallest = np.array([scores.p_family.min() for _, scores in nothing_missing])
    assert (smallest <= 0.05).sum() <= binom.ppf(0.99, 60, 0.05)
    # Nor is it a test that never says anything.
    for level in (0.3, 0.5, 0.7):
        low, high = binom.ppf([0.001, 0.999], 60, level)
        assert low <= (smallest <= level).sum() <= high, (level, (smallest <= level).mean())


def test_p_values_of_single_candidates_are_uniform_where_nothing_is_missing(nothing_missing):
    values = np.concatenate([scores.p_value for _, scores in nothing_missing])
    # Candidates of one campaign have much in common: a wide band.
    assert 0.03 < (values <= 0.05).mean() < 0.075
    assert 0.44 < values.mean() < 0.56


def test_family_p_values_keep_the_order_and_are_never_below_the_single_ones(nothing_missing):
    for _, scores in nothing_missing[:10]:
        order = np.argsort(scores.p_value)
        assert (np.diff(scores.p_family[order]) >= 0).all()
        assert (scores.p_family >= 1 / (REPLICATES + 1)).all()
        assert scores.p_family.min() > scores.p_value.min()


@pytest.mark.parametrize("key", ["joint_offset@3", "hysteresis@2", "cross_compliance@2+3", "stiffening@2", "lost_motion@3"])
def test_planted_effect_of_noncentrality_100_is_found(base, key):
    (candidate,) = named(base, key)
    fitted, seen = drawn(base, 200)
    there = directions(fitted, seen, [candidate])
    size = candidate.parameters[0].plausible * np.sqrt(100.0 / there.noncentrality.max())
    fitted, seen = drawn(base, 201, candidate, size)
    found = directions(fitted, seen, base[3])
    scores = score(found, 499, np.random.default_rng(6))
    planted = [index for index, (one, _) in enumerate(found.candidates) if one.key == key]
    assert scores.p_family[planted].min() <= 0.01
    assert scores.statistic[planted].max() > 50
    # It, or another name of the same thing, is the best of all.
    best = max(range(len(found.columns)), key=lambda index: scores.bic_gain[index])
    cosines = [np.linalg.svd(found.columns[best].T @ found.columns[index])[1][0] for index in planted]
    assert best in planted or max(cosines) > 0.7
    gain, error = max(zip(*cross_validated_gains(found, planted, 5), strict=True))
    assert gain > 2 * error > 0


def test_gain_is_negative_in_the_mean_where_nothing_is_missing(nothing_missing):
    for key in ("joint_offset@3", "joint_tilt@2", "link_weight@3"):
        gains = []
        for found, _ in nothing_missing:
            index = next(i for i, (candidate, _) in enumerate(found.candidates) if candidate.key == key)
            gains.append(cross_validated_gains(found, [index], 5)[0][0])
        assert np.mean(gains) < 0, key
        assert np.mean(np.array(gains) > 0) < 0.5


def test_gain_is_that_of_fits_without_each_fold(base):
    (candidate,) = named(base, "link_weight@2")
    fitted, seen = drawn(base, 300, candidate, candidate.parameters[0].plausible)
    found = directions(fitted, seen, [candidate])
    both = np.concatenate([found.model, found.columns[0]], axis=1)
    per_row = np.zeros(len(found.residual))
    for fold in range(5):
        out = found.cluster % 5 == fold
        for basis, sign in ((found.model, 1), (both, -1)):
            values = np.linalg.lstsq(basis[~out], found.residual[~out])[0]
            per_row[out] += sign * (found.residual[out] - basis[out] @ values) ** 2
    (gain,), (error,) = cross_validated_gains(found, [0], 5)
    np.testing.assert_allclose(gain, per_row.sum(), rtol=1e-5)
    per_pose = np.array([per_row[found.cluster == pose].sum() for pose in range(30)])
    np.testing.assert_allclose(error, np.sqrt(30) * per_pose.std(ddof=1), rtol=1e-5)


def test_directions_are_orthonormal_and_off_the_model(base):
    fitted, seen = drawn(base, 400)
    found = directions(fitted, seen, base[3])
    np.testing.assert_allclose(found.model.T @ found.model, np.eye(9), atol=1e-12)
    np.testing.assert_allclose(found.model.T @ found.residual, 0.0, atol=1e-9)
    assert found.residual_freedom == 180 - 9
    for columns in found.columns:
        np.testing.assert_allclose(columns.T @ columns, np.eye(columns.shape[1]), atol=1e-6)
        np.testing.assert_allclose(found.model.T @ columns, 0.0, atol=1e-8)
    np.testing.assert_array_equal(found.cluster, np.arange(180) // 6)
    assert (found.retained <= 1 + 1e-12).all() and (found.retained >= 0.1).all()


def test_frame_that_is_not_quite_settled_does_not_matter(base):
    fitted, seen = drawn(base, 408)
    moved = replace(fitted, estimate=replace(fitted.estimate, frame_position=fitted.estimate.frame_position + 1e-5))
    one, other = (directions(f, seen, named(base, "joint_offset@2")) for f in (fitted, moved))
    np.testing.assert_allclose(other.residual, one.residual, rtol=0, atol=1e-8)


def test_what_the_model_fits_already_is_not_tested_and_said_so(base):
    fitted, seen = drawn(base, 401)
    found = directions(fitted, seen, named(base, "joint_offset@1", "joint_offset@6", "joint_offset@2"))
    assert [candidate.key for candidate, _ in found.candidates] == ["joint_offset@2"]
    assert set(found.untestable) == {"joint_offset@1", "joint_offset@6"}
    assert set(found.untestable.values()) == {"what it makes is fitted by the model already"}


def test_what_is_too_small_for_the_noise_is_not_tested_and_said_so(base):
    model, true, seen, _ = base
    loud = replace(NOISE, position_m=0.1, orientation_rad=0.1)
    noisy = with_noise(seen, np.random.default_rng(7), position_m=0.1)
    found = directions(fit(model, noisy, loud, start=true), noisy, named(base, "joint_offset@2"))
    assert found.untestable == {"joint_offset@2": "too small to be seen"} and found.candidates == ()
    assert all(len(values) == 0 for values in vars(score(found, 9, np.random.default_rng(0))).values())


@pytest.mark.parametrize(
    ("key", "missing", "reason"),
    [
        ("joint_tilt@2", "wrench", "no load in the data"),
        ("hysteresis@2", "approach", "no approach in the data"),
        ("frame_drift", "time_s", "no time in the data"),
        ("thermal_growth[temperature]", "temperature_c", "no temperature in the data"),
    ],
)
def test_effect_is_not_tested_without_what_it_needs(base, key, missing, reason):
    fitted, seen = drawn(base, 402)
    value = np.zeros((60, 6)) if missing == "wrench" else None
    without = replace(seen, states=replace(seen.states, **{missing: value}))
    assert directions(fitted, without, named(base, key)).untestable == {key: reason}
    assert key not in directions(fitted, seen, named(base, key)).untestable


def test_harmonics_need_four_angles_a_period(base):
    fitted, seen = drawn(base, 403)
    found = directions(fitted, seen, named(base, *(f"transmission_harmonic@3[orders {o}]" for o in ("1-2", "3-6", "7-12"))))
    assert [candidate.detail for candidate, _ in found.candidates] == ["orders 1-2", "orders 3-6"]
    assert found.untestable == {"transmission_harmonic@3[orders 7-12]": "30 angles of joint 3 where 48 are needed"}


def test_shape_parameters_are_tried_over_their_range(base):
    fitted, seen = drawn(base, 404)
    found = directions(fitted, seen, named(base, "lost_motion@2"))
    tried = [values[0] for _, values in found.candidates]
    (torque,) = found.candidates[0][0].shapes
    assert len(tried) == 3 and all(torque.lowest < value < torque.highest for value in tried)
    np.testing.assert_allclose(tried[1], np.sqrt(torque.lowest * torque.highest))


def test_residuals_are_given_back_what_fitting_took(base):
    """(I - H_pp)^(-1/2) r_p, written out."""
    fitted, seen = drawn(base, 405)
    found = directions(fitted, seen, named(base, "joint_offset@2"))
    hat = found.model @ found.model.T
    blocks = []
    for pose in range(30):
        rows = np.flatnonzero(found.cluster == pose)
        blocks.append(inv(sqrtm(np.eye(len(rows)) - hat[np.ix_(rows, rows)])))
    np.testing.assert_allclose(leverage_adjusted(found), block_diag(*blocks).real @ found.residual, rtol=1e-6, atol=1e-9)


def test_absorbing_a_candidate_is_testing_the_larger_model(base):
    winner, other, alias = named(base, "joint_dependent_stiffness@2", "joint_offset@3", "compensator_stiffness@2")
    fitted, seen = drawn(base, 406, winner, 2e-7)
    found = directions(fitted, seen, [winner, other, alias])
    after = absorbed(found, 0)
    # Nothing is left of the other name of the winner.
    assert [candidate.key for candidate, _ in after.candidates] == [other.key]
    model = found.model.shape[1]
    assert after.model.shape[1] == model + 2 and after.residual_freedom == found.residual_freedom - 2
    right, columns, made = whitened_rows(fitted, seen, other)
    columns = np.concatenate([columns, whitened_rows(fitted, seen, winner)[2]], axis=1)
    small, large = sm.OLS(right, columns).fit(), sm.OLS(right, np.concatenate([columns, made], axis=1)).fit()
    scores = score(after, 9, np.random.default_rng(0))
    np.testing.assert_allclose(scores.statistic, small.ssr - large.ssr, rtol=1e-6)
    np.testing.assert_allclose(scores.p_value, large.compare_f_test(small)[1], rtol=1e-6)


def test_scores_do_not_hang_on_the_other_candidates_but_for_the_family(base):
    fitted, seen = drawn(base, 407)
    some = directions(fitted, seen, named(base, "joint_offset@2", "joint_tilt@3"))
    alone = directions(fitted, seen, named(base, "joint_tilt@3"))
    both, one = (score(d, REPLICATES, np.random.default_rng(8)) for d in (some, alone))
    np.testing.assert_allclose(both.p_value[1], one.p_value[0], rtol=1e-9)
    assert both.p_family[1] >= one.p_family[0]


def approached_in_two_poses(seed):
    """States of twenty poses, two of which were approached from a side that is known."""
    states = two_loads_a_pose(6, 20, (5, seed))
    return replace(states, approach=states.approach * np.isin(states.pose, (3, 11))[:, None])


@pytest.mark.parametrize("size", [1e-4, 3e-4])
@pytest.mark.parametrize("seed", [0, 2])
def test_an_effect_of_two_poses_in_twenty_stands_out(seed, size, fanuc):
    """Their signs turned, two poses look like themselves in every second replicate."""
    campaign = planted_campaign(fanuc, {"hysteresis@2": [size]}, seed, states=approached_in_two_poses(seed))
    found = directions(campaign.declared, campaign.observations, campaign.all_candidates)
    scores = score(found, REPLICATES, np.random.default_rng(9))
    index = [candidate.key for candidate, _ in found.candidates].index("hysteresis@2")
    assert scores.p_family[index] == 1 / (REPLICATES + 1)
    # Nor does all stand out where one does.
    assert scores.p_family.max() > 0.3


def test_effects_of_two_poses_in_twenty_raise_no_more_false_alarms(fanuc):
    smallest = []
    for number in range(60):
        campaign = planted_campaign(fanuc, {}, 500 + number, states=approached_in_two_poses(number))
        found = directions(campaign.declared, campaign.observations, campaign.all_candidates)
        assert "hysteresis@2" in {candidate.key for candidate, _ in found.candidates}
        smallest.append(score(found, 99, np.random.default_rng((10, number))).p_family.min())
    smallest = np.array(smallest)
    assert (smallest <= 0.05).sum() <= binom.ppf(0.99, 60, 0.05)
    for level in (0.3, 0.5, 0.7):
        low, high = binom.ppf([0.001, 0.999], 60, level)
        assert low <= (smallest <= level).sum() <= high, (level, (smallest <= level).mean())
