"""Fits: known parameters come back, errors are those of statsmodels and of repetition, and what cannot be told is named."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from planted import two_loads_a_pose
from scipy.linalg import block_diag
from scipy.stats import chi2, kstest
from support import OTHER_CHAINS, chain_of
from synthetic import NOISE, candidate_on, made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import ON_THE_WAY, _Parts, fit, fit_frames, identifiable, solve_identifiable
from elastocal.fitting.model import circumstances, linearize, parameters, residuals, stepped
from elastocal.fitting.noise import Noise, reading_covariances

TARGETS = Target("A", "6DoF", None), Target("B", "3DoF", None)


def model_of(robot, *keys, targets=TARGETS[:1], **options):
    effects = tuple(candidate_on(robot.chain, key) for key in keys)
    return made_model(robot.chain, targets, effects=effects, compliance=robot.compliance, **options)


def names_held(found):
    return [f"{owner} {p.name}" for (owner, p), held in zip(found.parameters, found.held, strict=True) if held]


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize(
    "keys",
    [
        (),
        ("joint_offset@2", "joint_offset@3", "joint_offset@5"),
        ("link_weight@3", "compensator_torque@2", "transmission_ratio@4"),
        ("base_compliance[rocking]", "joint_tilt@3", "stiffening@2"),
        ("lost_motion@2",),
        ("hysteresis@2", "frame_drift", "thermal_growth[temperature]"),
    ],
    ids=lambda keys: "+".join(keys) or "frames alone",
)
def test_noiseless_readings_give_back_every_parameter(fanuc, keys, rows):
    model = model_of(fanuc, *keys, targets=TARGETS, rows=rows)
    true = made_estimate(model, (0, 1), seed=1)
    seen = seen_exactly(model, true, made_states(6, 40, seed=2, sessions=2))
    found = fit(model, seen, NOISE)
    assert names_held(found) == []
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)
    for owner in ("frame_position", "target_offset", "frame_rotation", "target_rotation"):
        np.testing.assert_allclose(getattr(found.estimate, owner), getattr(true, owner), rtol=0, atol=1e-8)
    deviation = np.sqrt(np.diag(found.covariance))
    order = [i for i, (owner, _) in enumerate(found.parameters) if not owner.startswith(("frame ", "target "))]
    values = [
        np.concatenate([*(part for pair in zip(e.coefficients, e.shapes, strict=True) for part in pair), []])
        for e in (found.estimate, true)
    ]
    # The last step is a thousandth of a standard error at most; the next one would be its square.
    assert (np.abs(values[0] - values[1]) <= 1e-4 * deviation[order] + 1e-12 * np.abs(values[1])).all()
    assert (found.weights == 1.0).all()


@pytest.mark.parametrize("taper", [0.05, 0.3, 0.5])
def test_the_taper_of_a_link_comes_back_where_the_readings_show_it(fanuc, taper):
    """Turns and shifts of its far end go with it differently; close to its end, too."""
    model = model_of(fanuc, "link_elasticity@2", targets=TARGETS, rows=6)
    true = made_estimate(model, seed=1)
    true = replace(true, coefficients=(np.array([3e-7, 3e-7]),), shapes=(np.array([taper]),))
    found = fit(model, seen_exactly(model, true, made_states(6, 40, seed=2, force=2000.0)), NOISE)
    assert names_held(found) == []
    np.testing.assert_allclose(found.estimate.shapes[0], taper, rtol=1e-4)
    np.testing.assert_allclose(found.estimate.coefficients[0], 3e-7, rtol=1e-4)


def test_compliances_are_identified(fanuc):
    model = model_of(fanuc, identified=True)
    true = replace(made_estimate(model, seed=3), coefficients=(np.array([1.2, 0.5, 0.6, 3.0, 2.5, 2.0]) * 1e-6,))
    seen = seen_exactly(model, true, made_states(6, 30, seed=4))
    found = fit(model, seen, NOISE)
    deviation = np.sqrt(np.diag(found.covariance)[-6:])
    assert (np.abs(found.estimate.coefficients[0] - true.coefficients[0]) < 1e-3 * deviation).all()
    np.testing.assert_allclose(found.estimate.coefficients[0], true.coefficients[0], rtol=1e-5)


@pytest.mark.parametrize("name", OTHER_CHAINS)
def test_frames_and_targets_are_fitted_on_other_chains(name):
    chain = chain_of(OTHER_CHAINS[name])
    model = made_model(chain)
    true = made_estimate(model, seed=5)
    noise = replace(NOISE, joint_rad=np.zeros(chain.coordinates))
    found = fit(model, seen_exactly(model, true, made_states(chain.coordinates, 30, seed=6, force=50.0)), noise)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)


@pytest.fixture(scope="module")
def noisy(fanuc):
    """A model with springs, an offset and two targets, fitted to readings with joint noise, repeats and two sessions."""
    model = model_of(fanuc, "joint_offset@3", targets=TARGETS, identified=True)
    true = made_estimate(model, (0, 1), seed=7)
    states = made_states(6, 40, seed=8, sessions=2)
    states.repeats[:] = np.random.default_rng(9).integers(1, 4, 40)
    noise = Noise("repeats", 60e-6, 60e-6, 1e-6 * np.array([20.0, 20, 20, 30, 30, 30]))
    seen = seen_exactly(model, true, states)
    line = linearize(model, true, seen, circumstances(model, true, states))
    covariance = reading_covariances(noise, line.coordinate_jacobian[..., :6].reshape(40, 2, 3, 6), 3)
    covariance /= states.repeats[:, None, None]
    # In base axes; the readings are in those of their session.
    factor = np.linalg.cholesky(covariance)

    def drawn(rng):
        errors = (factor @ rng.standard_normal((40, 6, 1))).reshape(80, 3)
        frames = true.frame_rotation[states.session[seen.state]]
        return replace(seen, position=seen.position + (frames @ errors[..., None])[..., 0])

    return model, true, noise, covariance, drawn


def test_estimate_and_covariance_are_those_of_statsmodels_gls(noisy):
    model, _, noise, _, drawn = noisy
    seen = drawn(np.random.default_rng(10))
    found = fit(model, seen, noise)
    line = linearize(model, found.estimate, seen, circumstances(model, found.estimate, seen.states))
    blocks = reading_covariances(noise, line.coordinate_jacobian[..., :6].reshape(40, 2, 3, 6), 3)
    sigma = block_diag(*(blocks / seen.states.repeats[:, None, None]))
    root = np.repeat(1 / np.sqrt(found.weights), 3)
    sigma = root[:, None] * sigma * root
    scale = np.array([p.plausible for _, p in found.parameters])
    reference = sm.GLS(line.residual.ravel(), line.sensitivities.reshape(240, -1) * scale, sigma=sigma).fit()
    expected = reference.normalized_cov_params * np.outer(scale, scale)
    deviation = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found.covariance / np.outer(deviation, deviation), expected / np.outer(deviation, deviation), atol=2e-3
    )
    # At the estimate nothing is left to step.
    assert (np.abs(reference.params * scale) < 5e-3 * deviation).all()
    assert not found.held.any()


def test_spread_over_data_sets_is_the_standard_error(noisy):
    model, true, noise, _, drawn = noisy
    sets = 200
    listed = parameters(model, true)
    own = [i for i, (owner, _) in enumerate(listed) if not owner.startswith(("frame ", "target "))]
    deviations, squares = np.empty((sets, len(own))), np.empty(sets)
    for number in range(sets):
        found = fit(model, drawn(np.random.default_rng((11, number))), noise, start=true)
        error = np.concatenate(found.estimate.coefficients) - np.concatenate(true.coefficients)
        covariance = found.covariance[np.ix_(own, own)]
        deviations[number] = error / np.sqrt(np.diag(covariance))
        squares[number] = error @ np.linalg.solve(covariance, error)
    low, high = np.sqrt(chi2.ppf([1e-4, 1 - 1e-4], sets) / sets)
    spread = np.sqrt((deviations**2).mean(axis=0))
    # Huber's weights cost some per mille of what an unweighted fit would tell.
    assert ((low < spread) & (spread < 1.02 * high)).all(), spread
    assert (np.abs(deviations.mean(axis=0)) < 4 / np.sqrt(sets)).all()
    assert kstest(squares, chi2(len(own)).cdf).pvalue > 1e-3


def test_weighted_residual_has_unit_mean_square(noisy):
    model, _, noise, _, drawn = noisy
    seen = drawn(np.random.default_rng(12))
    found = fit(model, seen, noise)
    freedom = found.residual.size - (~found.held).sum()
    mean_square = (found.whitened(found.residual) ** 2).sum() / freedom
    low, high = chi2.ppf([1e-3, 1 - 1e-3], freedom) / freedom
    assert 0.95 * low < mean_square < high


@pytest.mark.parametrize(
    ("key", "held"),
    [
        ("joint_offset@1", ["joint_offset@1 offset"]),
        # To positions of one target, a turn of the last joint is a shift of the target.
        ("joint_offset@6", ["joint_offset@6 offset"]),
        ("link_geometry@6", [f"link_geometry@6 {name}" for name in ("dx", "dy", "dz", "rx", "ry", "rz")]),
    ],
)
def test_what_the_frame_or_the_target_makes_as_well_is_held_and_named(fanuc, key, held):
    model = model_of(fanuc, key, "joint_offset@3")
    true = made_estimate(model, seed=13)
    seen = with_noise(seen_exactly(model, true, made_states(6, 40, seed=14)), np.random.default_rng(15))
    found = fit(model, seen, NOISE)
    assert names_held(found) == held
    assert not found.estimate.coefficients[0].any()
    assert not found.covariance[found.held].any() and not found.covariance[:, found.held].any()
    # It is not shrunk towards zero by a penalty: without it the fit is the very same.
    without = fit(model_of(fanuc, "joint_offset@3"), seen, NOISE)
    np.testing.assert_allclose(found.estimate.coefficients[1], without.estimate.coefficients[0], rtol=1e-9)
    np.testing.assert_allclose(found.covariance[~found.held][:, ~found.held], without.covariance, rtol=1e-6, atol=1e-22)


def test_what_the_data_can_tell_is_not_shrunk(fanuc):
    """A hundred times its plausible size, an offset still comes back whole."""
    model = model_of(fanuc, "joint_offset@3")
    true = replace(made_estimate(model, seed=16), coefficients=(np.array([0.1]),))
    found = fit(model, seen_exactly(model, true, made_states(6, 30, seed=17)), NOISE)
    np.testing.assert_allclose(found.estimate.coefficients[0], 0.1, rtol=1e-8)


def test_identified_compliance_and_force_scale_cannot_both_be_told(fanuc):
    model = model_of(fanuc, "force_scale", identified=True)
    true = made_estimate(model, seed=18)
    seen = with_noise(seen_exactly(model, true, made_states(6, 30, seed=19)), np.random.default_rng(20))
    assert names_held(fit(model, seen, NOISE)) == ["force_scale scale"]


def test_two_names_of_one_thing_leave_the_later_one_held(fanuc):
    model = model_of(fanuc, "joint_dependent_stiffness@2", "compensator_stiffness@2")
    true = made_estimate(model, seed=21)
    seen = with_noise(seen_exactly(model, true, made_states(6, 30, seed=22, force=2000.0)), np.random.default_rng(23))
    assert names_held(fit(model, seen, NOISE)) == ["compensator_stiffness@2 cos_1q", "compensator_stiffness@2 sin_1q"]


def test_outliers_get_little_weight_and_do_little_harm(fanuc):
    model = model_of(fanuc, "joint_offset@3")
    true = made_estimate(model, seed=24)
    clean = with_noise(seen_exactly(model, true, made_states(6, 60, seed=25)), np.random.default_rng(26))
    moved = clean.position.copy()
    moved[[3, 20, 41]] += [[0.02, 0, 0], [0, -0.02, 0], [0.01, 0.01, 0.01]]
    found = fit(model, replace(clean, position=moved), NOISE)
    before = fit(model, clean, NOISE)
    assert (found.weights[[3, 20, 41]] < 0.02).all()
    assert np.median(np.delete(found.weights, [3, 20, 41])) == 1.0
    deviation = np.sqrt(before.covariance[-1, -1])
    shift = np.abs(found.estimate.coefficients[0] - before.estimate.coefficients[0])
    assert shift < 2 * deviation
    # Without weights the three would have moved it by far more.
    line = linearize(model, before.estimate, clean, circumstances(model, before.estimate, clean.states))
    pulled = before.covariance @ np.einsum("mrp,mr->p", line.sensitivities, moved - clean.position) / NOISE.position_m**2
    assert np.abs(pulled[-1]) > 3 * shift


def test_series_with_a_prior_is_at_its_most_probable_values(fanuc):
    model = model_of(fanuc, "transmission_harmonic@3[orders 3-6]", "joint_offset@2")
    true = made_estimate(model, seed=42)
    seen = with_noise(seen_exactly(model, true, made_states(6, 60, seed=43)), np.random.default_rng(44))
    found = fit(model, seen, NOISE)
    line = linearize(model, found.estimate, seen, circumstances(model, found.estimate, seen.states))
    left = found.whitened(line.sensitivities).reshape(180, -1)
    precision = np.array([0.0 if p.prior_std is None else p.prior_std**-2 for _, p in found.parameters])
    assert np.count_nonzero(precision) == 8
    expected = np.linalg.inv(left.T @ left + np.diag(precision))
    deviation = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found.covariance / np.outer(deviation, deviation), expected / np.outer(deviation, deviation), atol=1e-3
    )
    # The pull of the data and the pull of the prior balance.
    values = np.zeros(len(precision))
    values[precision > 0] = found.estimate.coefficients[0]
    pull = left.T @ found.whitened(found.residual).ravel() - precision * values
    assert (np.abs(expected @ pull) < 5e-3 * deviation).all()
    assert (np.abs(precision * values * deviation) > 1e-3).any()


def test_frames_of_other_observations_are_fitted_and_nothing_else(fanuc):
    model = model_of(fanuc, "joint_offset@3", "lost_motion@2")
    true = made_estimate(model, seed=36)
    fitted = fit(model, seen_exactly(model, true, made_states(6, 40, seed=37)), NOISE)
    elsewhere = made_estimate(model, (0,), seed=38)
    elsewhere = replace(elsewhere, coefficients=true.coefficients, shapes=true.shapes)
    found = fit_frames(fitted, model, seen_exactly(model, elsewhere, made_states(6, 25, seed=39)), NOISE)
    for ours, theirs in zip(found.coefficients, fitted.estimate.coefficients, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_allclose(found.frame_position, elsewhere.frame_position, rtol=0, atol=1e-7)
    np.testing.assert_allclose(found.target_offset, elsewhere.target_offset, rtol=0, atol=1e-7)


def test_solution_is_that_of_numpy_where_all_can_be_told():
    rng = np.random.default_rng(41)
    left, right = 100 * rng.standard_normal((50, 6)), rng.standard_normal(50)
    step, covariance, held = solve_identifiable(left, right, np.full(6, 0.5))
    np.testing.assert_allclose(step, np.linalg.lstsq(left, right)[0], rtol=1e-10)
    np.testing.assert_allclose(covariance, np.linalg.inv(left.T @ left), rtol=1e-10)
    assert not held.any()


def test_solution_with_a_prior_is_that_of_numpy_with_a_row_for_each_prior():
    rng = np.random.default_rng(45)
    left, right, present = 10 * rng.standard_normal((8, 6)), rng.standard_normal(8), rng.standard_normal(6)
    penalty = np.array([0.0, 0.0, 4.0, 9.0, 25.0, 1.0])
    root = np.diag(np.sqrt(penalty))
    rows, ends = np.concatenate([left, root]), np.concatenate([right, -root @ present])
    step, covariance, held = solve_identifiable(left, right, np.full(6, 2.0), False, penalty, present)
    np.testing.assert_allclose(step, np.linalg.lstsq(rows, ends)[0], rtol=1e-9)
    np.testing.assert_allclose(covariance, np.linalg.inv(rows.T @ rows), rtol=1e-9, atol=1e-15)
    assert not held.any()


def test_parameter_is_held_where_its_standard_error_would_exceed_its_plausible_size():
    left = np.diag([1.0, 1.0, 1.0])
    # Unit variance rows: each standard error is one.
    held = solve_identifiable(left, np.ones(3), np.array([1.1, 0.9, 5.0]))[2]
    np.testing.assert_array_equal(held, [False, True, False])


def test_parameters_are_held_given_those_before_them():
    gram = 1e4 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(identifiable(gram, np.zeros(3, bool), np.zeros(3, bool)), [True, False, True])
    np.testing.assert_array_equal(identifiable(gram, np.array([True, False, False]), np.zeros(3, bool)), [False, True, True])


# Both can be told, one after the other; together the first is told worse than the other, to which it is bound.
BOUND = np.linalg.inv(np.array([[4.0, 1.9], [1.9, 0.95]]))


def test_a_shape_is_given_up_before_the_parameter_that_it_is_bound_to():
    nobody = np.zeros(2, bool)
    np.testing.assert_array_equal(identifiable(BOUND, nobody, np.array([False, True])), [True, False])
    np.testing.assert_array_equal(identifiable(BOUND, nobody, nobody), [False, True])


def test_a_shape_that_is_bound_to_nothing_is_kept():
    gram = np.diag([9.0, 0.0, 0.0, 4.0])
    gram[1:3, 1:3] = BOUND
    nobody = np.zeros(4, bool)
    np.testing.assert_array_equal(identifiable(gram, nobody, np.arange(4) == 3), [True, False, True, True])
    # A shape is no better than others where it is what can be told worst.
    worst = np.linalg.inv(np.array([[0.95, 1.9], [1.9, 4.0]]))
    np.testing.assert_array_equal(identifiable(worst, nobody[:2], np.array([False, True])), [True, False])


@pytest.mark.parametrize("half_play", [1e-4, 3e-4, 1e-3])
def test_a_law_that_is_nearly_a_straight_line_keeps_its_coefficient_and_not_its_shape(fanuc, half_play):
    """Play that the load never crosses but a little: half the play over the torque is all that shows."""
    model = model_of(fanuc, "lost_motion@2")
    (play,) = model.effects
    taken_up = 0.98 * play.shapes[0].highest
    true = made_estimate(model, seed=46)
    true = replace(true, coefficients=(np.array([half_play]),), shapes=(np.array([taken_up]),))
    states = made_states(6, 60, seed=47, force=taken_up / 8.0)
    seen = with_noise(seen_exactly(model, true, states), np.random.default_rng(48))
    found = fit(model, seen, NOISE)
    assert names_held(found) == ["lost_motion@2 torque"]
    (value,), (torque,) = found.estimate.coefficients[0], found.estimate.shapes[0]
    number = [owner for owner, _ in found.parameters].index("lost_motion@2")
    deviation = np.sqrt(found.covariance[number, number])
    # Given the torque; of the straight line within four standard errors.
    assert value > 5 * deviation
    assert abs(value / torque - half_play / taken_up) < 4 * deviation / torque


def bent(fanuc, seed, shape, key="thermal_growth[time]"):
    """Noisy readings of a law with a shape somewhere in its range, and the model that made them."""
    model = model_of(fanuc, key)
    true = made_estimate(model, seed=seed)
    true = replace(true, shapes=(np.array([shape]),))
    seen = seen_exactly(model, true, made_states(6, 30, seed=seed, force=300.0))
    return model, with_noise(seen, np.random.default_rng(seed))


def robust_objective(found):
    """Huber's, of all observations of a fit without a prior, by the library's own norm."""
    rows = found.model.rows
    norm = sm.robust.norms.HuberT(np.sqrt(chi2.ppf(0.99, rows) / rows))
    return rows * norm.rho(np.sqrt((found.whitener.apply(found.residual) ** 2).mean(axis=1))).sum()


@pytest.mark.parametrize(("seed", "lag"), [(3, 1500.0), (24, 900.0), (25, 1500.0), (11, 20000.0)])
def test_steps_that_do_not_help_are_halved_until_the_fit_converges(fanuc, seed, lag, monkeypatch):
    model, seen = bent(fanuc, seed, lag)
    found = fit(model, seen, NOISE)
    assert found.converged
    monkeypatch.setattr("elastocal.fitting.least_squares._HALVINGS", 0)
    whole = fit(model, seen, NOISE)
    assert not whole.converged
    assert robust_objective(found) < robust_objective(whole) - 0.01


def test_fit_that_converged_is_at_a_minimum_of_its_objective(fanuc):
    model, seen = bent(fanuc, 3, 1500.0)
    found = fit(model, seen, NOISE)
    deviation = np.sqrt(np.diag(found.covariance))
    for number, size in enumerate(deviation):
        for sign in (-0.1, 0.1):
            moved = stepped(model, found.estimate, sign * size * np.eye(len(deviation))[number])
            residual = residuals(model, moved, seen, circumstances(model, moved, seen.states))
            assert robust_objective(replace(found, residual=residual)) > robust_objective(found)


@pytest.mark.parametrize(("seed", "lag", "end"), [(4, 8000.0, 36000.0), (8, 3000.0, 900.0)])
def test_fit_converges_at_the_end_of_the_range_of_a_shape(fanuc, seed, lag, end):
    model, seen = bent(fanuc, seed, lag)
    found = fit(model, seen, NOISE)
    assert found.converged and found.estimate.shapes[0][0] == end
    # The others are where they are best given that end: held there they do not move.
    frozen = replace(model.effects[0], shapes=(), displacement=lambda around: model.effects[0].displacement(around, end))
    without = replace(model, effects=(frozen,))
    start = replace(found.estimate, shapes=(np.zeros(0),))
    again = fit(without, seen, NOISE, start)
    deviation = np.sqrt(again.covariance[-1, -1])
    assert abs(again.estimate.coefficients[0][0] - found.estimate.coefficients[0][0]) < 2e-3 * deviation


def test_a_fit_on_the_way_stops_within_a_tenth_of_a_standard_error_of_where_it_would_end(fanuc, monkeypatch):
    """After fewer linearisations."""
    model = model_of(fanuc, "joint_offset@3", "link_weight@2", "stiffening@2")
    true = made_estimate(model, seed=61, size=3.0)
    seen = with_noise(seen_exactly(model, true, made_states(6, 60, seed=62)), np.random.default_rng(63))
    linearized, count = _Parts.linearize, []

    def counted(readings, estimate):
        count.append(1)
        return linearized(readings, estimate)

    monkeypatch.setattr(_Parts, "linearize", counted)
    whole = fit(model, seen, NOISE)
    needed = len(count)
    count.clear()
    some = fit(model, seen, NOISE, settled=ON_THE_WAY)
    assert some.converged and len(count) < needed
    moved = np.concatenate(some.estimate.coefficients) - np.concatenate(whole.estimate.coefficients)
    deviation = np.sqrt(np.diag(whole.covariance))[-len(moved) :]
    assert (np.abs(moved) <= ON_THE_WAY * deviation).all() and moved.any()


def test_outliers_lose_weight_from_the_first_step_of_a_fit_that_starts_from_another_one(fanuc):
    """One that starts where it ends stays there, in one step."""
    model = model_of(fanuc, "joint_offset@3")
    clean = with_noise(
        seen_exactly(model, made_estimate(model, seed=24), made_states(6, 60, seed=25)), np.random.default_rng(26)
    )
    moved = clean.position.copy()
    moved[[3, 20, 41]] += 0.02
    seen = replace(clean, position=moved)
    found = fit(model, seen, NOISE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("elastocal.fitting.least_squares._STEPS", 1)
        again = fit(model, seen, NOISE, found.estimate, reweighted=True)
        anew = fit(model, seen, NOISE, found.estimate)
    deviation = np.sqrt(found.covariance[-1, -1])
    off = [abs(each.estimate.coefficients[0][0] - found.estimate.coefficients[0][0]) / deviation for each in (again, anew)]
    assert again.converged and off[0] < 2e-3
    assert not anew.converged and off[1] > 0.1


@pytest.mark.parametrize("joint_rad", [0.0, 2e-5])
def test_a_fit_of_more_states_than_are_kept_is_the_same_and_keeps_no_jacobian(fanuc, monkeypatch, joint_rad):
    model = model_of(fanuc, "joint_offset@3", "stiffening@2", targets=TARGETS)
    seen = with_noise(
        seen_exactly(model, made_estimate(model, seed=64), two_loads_a_pose(6, 20, seed=65)), np.random.default_rng(66)
    )
    noise = replace(NOISE, joint_rad=np.full(6, joint_rad))
    kept = fit(model, seen, noise)
    monkeypatch.setattr("elastocal.fitting.least_squares._MOST_STATES", 10)
    monkeypatch.setattr("elastocal.fitting.least_squares._MOST_AT_ONCE", 16)
    monkeypatch.setattr("elastocal.fitting.least_squares._MOST_HELD", 16 * 180)
    found = fit(model, seen, noise)
    assert kept.joint_jacobian is not None and found.joint_jacobian is None and found.circumstances is None
    deviation = np.sqrt(np.diag(kept.covariance))
    values = [np.concatenate(each.estimate.coefficients) for each in (kept, found)]
    assert (np.abs(values[0] - values[1]) < 2e-3 * deviation[-len(values[0]) :]).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviation, rtol=1e-4)
    parts = [list(each.sensitivities(seen)) for each in (kept, found)]
    assert len(parts[1]) > 1
    for number in (1, 2):
        one, other = (np.concatenate([part[number] for part in each]) for each in parts)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.abs(one).max())


def test_fit_says_when_it_ran_out_of_steps(fanuc, monkeypatch):
    model, seen = bent(fanuc, 3, 1500.0)
    monkeypatch.setattr("elastocal.fitting.least_squares._STEPS", 3)
    assert not fit(model, seen, NOISE).converged


def test_ordinary_fits_converge(fanuc):
    model = model_of(fanuc, "joint_offset@3", "link_weight@2", "hysteresis@4")
    seen = with_noise(
        seen_exactly(model, made_estimate(model, seed=61), made_states(6, 30, seed=62)), np.random.default_rng(63)
    )
    assert fit(model, seen, NOISE).converged


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("seed", range(6))
def test_fit_converges_where_readings_share_an_error_and_the_model_misses_far_more_than_the_noise(fanuc, seed, rows):
    """As on a real robot with a good tracker: three reflectors, joints that repeat badly, a law of gravity that is left out."""
    targets = tuple(Target(name, "6DoF", None) for name in "ABC")
    true = model_of(fanuc, "joint_offset@2", "joint_offset@3", "link_geometry@3", "link_weight@2", targets=targets, rows=rows)
    states = replace(made_states(6, 24, seed=(70, seed)), repeats=np.full(24, 10))
    estimate = made_estimate(true, seed=seed, size=1.0)
    seen = with_noise(seen_exactly(true, estimate, states), np.random.default_rng((71, seed)), 20e-6, 20e-6)
    model = replace(true, effects=true.effects[:-1])
    noise = Noise("declared", 6e-6, 6e-6, 1e-6 * np.array([40.0, 15, 15, 1, 45, 220]))
    found = fit(model, seen, noise)
    # In standard deviations.
    assert np.sqrt((found.whitener.apply(found.residual) ** 2).mean()) > 5.0
    assert found.converged
    again = fit(model, seen, noise, found.estimate)
    moved = np.concatenate(again.estimate.coefficients) - np.concatenate(found.estimate.coefficients)
    deviation = np.sqrt(np.diag(again.covariance))[-len(moved) :]
    assert (np.abs(moved) <= 0.1 * deviation).all()


@pytest.mark.parametrize("rows", [3, 6])
def test_a_step_goes_by_the_slope_of_what_it_is_judged_by(fanuc, rows):
    """Errors that differ much by direction, and residuals far beyond them: central differences of the weighted squares."""
    model = model_of(fanuc, "joint_offset@2", "link_geometry@3", targets=TARGETS, rows=rows)
    estimate = made_estimate(model, seed=80)
    exact = seen_exactly(model, estimate, made_states(6, 12, seed=81))
    seen = with_noise(exact, np.random.default_rng(82), 2e-3, 2e-3)
    noise = Noise("declared", 5e-6, 1e-5, 1e-6 * np.array([40.0, 15, 15, 30, 45, 220]))
    plausible = np.array([parameter.plausible for _, parameter in parameters(model, estimate)])
    readings = _Parts(model, seen, noise, circumstances(model, estimate, seen.states), plausible)
    readings.linearize(estimate)
    readings.whiten()
    weights = np.random.default_rng(83).uniform(0.3, 1.0, len(seen))
    gram, along = readings.normal_equations(weights)
    for number, unit in enumerate(np.diag(1e-2 / np.sqrt(np.diag(gram)))):
        ends = [readings.squares(weights, stepped(model, estimate, sign * unit * plausible)) for sign in (-1, 1)]
        size = unit[number]
        # Of what the residual and the sensitivity could make at most.
        assert (ends[0] - ends[1]) / (4 * size) == pytest.approx(
            along[number], abs=2e-5 * np.sqrt(gram[number, number] * readings.squares(weights))
        )


def test_an_error_of_the_pose_counts_once_for_all_its_readings(fanuc):
    """Two loads and two targets a pose: estimate and covariance are those of statsmodels with the covariance written out."""
    model = model_of(fanuc, "joint_offset@3", targets=TARGETS, identified=True)
    states = two_loads_a_pose(6, 15, seed=60)
    seen = seen_exactly(model, made_estimate(model, seed=61), states)
    noise = replace(NOISE, joint_rad=1e-6 * np.array([20.0, 20, 20, 30, 30, 30]), pose_rad=1e-4)
    found = fit(model, with_noise(seen, np.random.default_rng(62)), noise)
    line = linearize(model, found.estimate, seen, found.circumstances)
    jacobian = line.coordinate_jacobian[..., :6].reshape(-1, 6)
    state, pose = np.repeat(seen.state, 3), np.repeat(seen.cluster, 3)
    sigma = (jacobian * noise.joint_rad**2) @ jacobian.T * (state[:, None] == state)
    sigma += noise.position_m**2 * np.eye(len(sigma)) + noise.pose_rad**2 * (jacobian @ jacobian.T) * (pose[:, None] == pose)
    root = np.repeat(1 / np.sqrt(found.weights), 3)
    scale = np.array([p.plausible for _, p in found.parameters])
    left = line.sensitivities.reshape(len(sigma), -1) * scale
    reference = sm.GLS(found.residual.ravel(), left, sigma=root[:, None] * sigma * root).fit()
    expected = reference.normalized_cov_params * np.outer(scale, scale)
    deviation = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found.covariance / np.outer(deviation, deviation), expected / np.outer(deviation, deviation), atol=5e-3
    )
    assert found.converged and (np.abs(reference.params * scale) / deviation).max() < 5e-3
    # The offset is known by the poses alone, so much worse than their many readings would tell.
    without = fit(model, replace(seen), replace(noise, pose_rad=0.0))
    assert found.covariance[-1, -1] > 2 * without.covariance[-1, -1]
