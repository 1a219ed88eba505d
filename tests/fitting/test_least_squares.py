"""Fits: known parameters come back, errors are those of statsmodels, outliers do little
harm, and steps converge."""

from dataclasses import replace

import numpy as np
import pytest
import statsmodels.api as sm
from fitted_models import (
    GANTRY_NOISES,
    TARGETS,
    build_model,
    compute_gantry_covariance,
    evaluate_waves,
    list_held_parameters,
    make_gantry_model,
    make_gantry_states,
    make_linear_law,
    observe_bent_law,
    observe_with_errors,
)
from planted import two_loads_a_pose
from scipy.linalg import block_diag
from scipy.stats import chi2
from support import chain_of
from synthetic import (
    NOISE,
    add_noise,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.campaigns.campaign import Target
from elastocal.fitting import least_squares
from elastocal.fitting.least_squares import (
    CONVERGENCE_TOLERANCE,
    fit_model,
    fit_placement,
    get_plausible_sizes,
    register_placement,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import LeastSquaresProblem


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
def test_noiseless_measurements_give_back_every_parameter(fanuc, keys, rows):
    model = build_model(fanuc, *keys, targets=TARGETS, rows=rows)
    true = make_estimate(model, (0, 1), seed=1)
    states = make_states(6, 40, seed=2, sessions=2)
    # Loads as large as such an arm carries, with which the measurements show where the
    # laws of a gear bend.
    states.wrench[:] *= 1.5
    found = fit_model(model, observe_exactly(model, true, states), NOISE)
    assert list_held_parameters(found) == []
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)
    for owner in (
        "frame_position",
        "target_offset",
        "frame_rotation",
        "target_rotation",
    ):
        np.testing.assert_allclose(
            getattr(found.estimate, owner), getattr(true, owner), rtol=0, atol=1e-8
        )
    deviation = np.sqrt(np.diag(found.covariance))
    order = [
        i
        for i, (owner, _) in enumerate(found.parameters)
        if not owner.startswith(("frame ", "target "))
    ]
    values = [
        np.concatenate(
            [
                *(
                    part
                    for pair in zip(e.coefficients, e.shapes, strict=True)
                    for part in pair
                ),
                [],
            ]
        )
        for e in (found.estimate, true)
    ]
    # The last step is a thousandth of a standard error at most; the next one would be
    # its square.
    assert (
        np.abs(values[0] - values[1])
        <= 1e-4 * deviation[order] + 1e-12 * np.abs(values[1])
    ).all()
    assert (found.weights == 1.0).all()


PRIORS = [None, None, 2e-5, 1e-3, 5e-6]


def linear_problem(noise, count=40, priors=PRIORS):
    """Observations of a linear law, none so far off that it loses weight; their design,
    data and covariance."""
    model = make_gantry_model(make_linear_law(len(priors), priors))
    states = make_gantry_states(count, 16)
    sigma = compute_gantry_covariance(states, noise)
    rng = np.random.default_rng(93)
    errors = np.linalg.cholesky(sigma) @ rng.uniform(-1.0, 1.0, 3 * count)
    left = evaluate_waves(states.joint_angles, len(priors)).reshape(3 * count, -1)
    right = left @ rng.normal(0, 3e-5, len(priors)) + errors
    return model, observe_with_errors(states, right.reshape(-1, 3)), left, right, sigma


def generalized_least_squares(left, right, sigma, priors):
    """Estimate and covariance by statsmodels, each prior as one more measurement of
    zero."""
    known = [n for n, prior in enumerate(priors) if prior is not None]
    rows = np.concatenate([left, np.eye(len(priors))[known]])
    whole = block_diag(sigma, *(np.array([[priors[n] ** 2]]) for n in known))
    found = sm.GLS(
        np.concatenate([right, np.zeros(len(known))]), rows, sigma=whole
    ).fit()
    return found.params, found.normalized_cov_params


@pytest.mark.parametrize("start", ["nothing", "the data alone", "far away"])
@pytest.mark.parametrize("kind", GANTRY_NOISES)
def test_a_linear_problem_has_the_generalized_least_squares_solution_with_its_priors(
    kind, start
):
    """Wherever the fit starts, the estimate that the data prefer without the priors
    among them."""
    noise = GANTRY_NOISES[kind]
    model, seen, left, right, sigma = linear_problem(noise)
    expected, covariance = generalized_least_squares(left, right, sigma, PRIORS)
    alone, _ = generalized_least_squares(left, right, sigma, [None] * 5)
    deviation = np.sqrt(np.diag(covariance))
    # Data and priors both count, or it would be no test of either.
    assert (np.abs(alone - expected) > deviation).any()
    nothing = make_estimate(model, size=0.0)
    begin = {"nothing": None, "the data alone": replace(nothing, coefficients=(alone,))}
    begin["far away"] = replace(
        nothing, coefficients=(np.array([1e-2, -1e-2, 5e-3, 0.0, -5e-3]),)
    )
    found = fit_model(model, seen, noise, begin[start])
    assert (
        found.converged
        and not found.unidentifiable.any()
        and (found.weights == 1.0).all()
    )
    np.testing.assert_allclose(
        found.estimate.coefficients[0] / deviation,
        expected / deviation,
        rtol=0,
        atol=1e-5,
    )
    np.testing.assert_allclose(
        found.covariance / np.outer(deviation, deviation),
        covariance / np.outer(deviation, deviation),
        atol=1e-7,
    )
    np.testing.assert_allclose(
        found.residual.ravel(),
        right - left @ expected,
        rtol=0,
        atol=1e-5 * noise.position_m,
    )


@pytest.mark.parametrize("plausible", [1e-8, 1.0])
def test_plausible_sizes_are_no_smaller_than_the_prior_and_the_start(
    plausible,
):
    model = make_gantry_model(make_linear_law(3, [None, 3e-6, None], plausible))
    start = replace(
        make_estimate(model, size=0.0), coefficients=(np.array([0.0, 0.0, -2e-7]),)
    )
    expected = [plausible, max(plausible, 3e-6), max(plausible, 2e-7)]
    np.testing.assert_array_equal(get_plausible_sizes(model, start), expected)


@pytest.mark.parametrize("long", [30, 60])
def test_a_fit_to_more_than_it_starts_from_is_that_to_all_of_them(long, monkeypatch):
    """From a few of them alone, or by way of some."""
    noise = GANTRY_NOISES["joints"]
    model, seen, left, right, sigma = linear_problem(noise, 60)
    expected, covariance = generalized_least_squares(left, right, sigma, PRIORS)
    for name, count in (
        ("START_SAMPLE_SIZE", 20),
        ("LARGE_FIT_SIZE", long),
        ("_INTERMEDIATE_SAMPLE_SIZE", 40),
    ):
        monkeypatch.setattr(f"elastocal.fitting.least_squares.{name}", count)
    fitted_to = []
    usual = least_squares.fit_robustly
    monkeypatch.setattr(
        least_squares,
        "fit_robustly",
        lambda *given, **how: fitted_to.append(len(given[1])) or usual(*given, **how),
    )
    found = fit_model(model, seen, noise)
    # Whole poses.
    assert fitted_to == [18, *([37] if long < 60 else []), 60]
    deviation = np.sqrt(np.diag(covariance))
    assert found.converged and len(found.residual) == 60
    np.testing.assert_allclose(
        found.estimate.coefficients[0] / deviation,
        expected / deviation,
        rtol=0,
        atol=1e-5,
    )


@pytest.mark.parametrize("rows", [3, 6])
def test_frames_are_fitted_to_targets_that_stay_as_they_were_found(fanuc, rows):
    """Exact measurements of the same targets from elsewhere give back the frame; others
    have their own."""
    model = build_model(
        fanuc, "joint_offset@3", "lost_motion@2", targets=TARGETS, rows=rows
    )
    true = make_estimate(model, seed=36)
    fitted = fit_model(
        model, observe_exactly(model, true, make_states(6, 40, seed=37)), NOISE
    )
    elsewhere = replace(
        make_estimate(model, seed=38),
        coefficients=true.coefficients,
        shapes=true.shapes,
    )
    found = fit_placement(
        fitted, model, observe_exactly(model, elsewhere, make_states(6, 10, seed=39))
    )
    for name in ("frame_position", "frame_rotation", "target_offset"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(elsewhere, name), rtol=0, atol=1e-7
        )
    for ours, theirs in zip(
        found.coefficients, fitted.estimate.coefficients, strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


def robust_objective(found):
    """Huber's, of all observations of a fit without a prior, by the library's own
    norm."""
    rows = found.model.rows
    norm = sm.robust.norms.HuberT(np.sqrt(chi2.ppf(0.99, rows) / rows))
    return (
        rows
        * norm.rho(
            np.sqrt((found.whitening.apply(found.residual) ** 2).mean(axis=1))
        ).sum()
    )


@pytest.mark.parametrize(("seed", "lag"), [(3, 1500.0), (24, 900.0), (25, 1500.0)])
def test_steps_that_do_not_help_are_halved_until_the_fit_converges(
    fanuc, seed, lag, monkeypatch
):
    model, seen = observe_bent_law(fanuc, seed, lag)
    found = fit_model(model, seen, NOISE)
    assert found.converged
    monkeypatch.setattr("elastocal.fitting.least_squares._MAX_HALVINGS", 0)
    whole = fit_model(model, seen, NOISE)
    assert not whole.converged
    assert robust_objective(found) < robust_objective(whole) - 0.01


@pytest.mark.parametrize(
    ("seed", "lag", "end"), [(4, 8000.0, 36000.0), (8, 3000.0, 900.0)]
)
def test_fit_converges_at_the_end_of_the_range_of_a_shape(fanuc, seed, lag, end):
    model, seen = observe_bent_law(fanuc, seed, lag)
    found = fit_model(model, seen, NOISE)
    assert found.converged and found.estimate.shapes[0][0] == end
    # The others are where they are best given that end: held there they do not move.
    frozen = replace(
        model.effects[0],
        shapes=(),
        displacement=lambda around: model.effects[0].displacement(around, end),
    )
    without = replace(model, effects=(frozen,))
    start = replace(found.estimate, shapes=(np.zeros(0),))
    again = fit_model(without, seen, NOISE, start)
    deviation = np.sqrt(again.covariance[-1, -1])
    assert (
        abs(again.estimate.coefficients[0][0] - found.estimate.coefficients[0][0])
        < 2e-3 * deviation
    )


WEAK = [None, 3e-5, None]

SENSOR = Noise("declared", 1e-4, 5e-5, np.zeros(3))


def with_outliers(rows, count=40):
    """Observations of a linear law, of which five are far off; design (S, 3, 3) and
    what is off, in positions and turns."""
    rng = np.random.default_rng(95)
    states = replace(make_gantry_states(count), repeats=np.ones(count, int))
    left = evaluate_waves(states.joint_angles, 3)
    off = 1e-4 * rng.standard_normal((count, 3)) + left @ [4e-5, -8e-5, 1e-4]
    off[[3, 11, 17, 30, 38]] += 1e-3 * np.array(
        [[1, 0, 0], [0, -2, 0], [0, 0, 3], [2, 2, 0], [5, 0, 0]]
    )
    turned = 5e-5 * rng.standard_normal((count, 3)) if rows == 6 else None
    model = make_gantry_model(make_linear_law(3, WEAK), rows=rows)
    return model, observe_with_errors(states, off, turned), left, off, turned


def distances(off, turned, left, values, factor):
    """Root mean square of what is left of each observation, in standard deviations of
    the noise taken."""
    parts = (
        [(off - left @ values) / 1e-4]
        if turned is None
        else [(off - left @ values) / 1e-4, turned / 5e-5]
    )
    return np.sqrt((np.concatenate(parts, axis=1) ** 2).mean(axis=1)) / factor


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("taken", [0.2, 0.7, 1.0, 3.0])
def test_weights_fall_with_the_distance_by_the_scale_of_the_errors_that_are_there(
    rows, taken
):
    """One up to the 99 % quantile, then its share; the scale is that of the median
    distance, but never below the noise."""
    model, seen, left, off, turned = with_outliers(rows)
    found = fit_model(model, seen, SENSOR.scaled(taken))
    far = distances(off, turned, left, found.estimate.coefficients[0], taken)
    scale = max(1.0, np.median(far) / np.sqrt(chi2.ppf(0.5, rows) / rows))
    assert (scale > 1.3) == (taken < 0.75)
    expected = np.minimum(1.0, np.sqrt(chi2.ppf(0.99, rows) / rows) * scale / far)
    assert found.converged and (expected < 1).sum() >= 3
    np.testing.assert_allclose(found.weights, expected, rtol=2e-3)
    # The estimate solves the equations of these weights; its covariance is their
    # inverse, or that of a small step before.
    weighted = (
        left.reshape(-1, 3) * np.repeat(found.weights, 3)[:, None] / (1e-4 * taken) ** 2
    )
    precision = weighted.T @ left.reshape(-1, 3) + np.diag([0.0, WEAK[1] ** -2, 0.0])
    values = np.linalg.solve(precision, weighted.T @ off.ravel())
    deviation = np.sqrt(np.diag(np.linalg.inv(precision)))
    np.testing.assert_allclose(
        found.estimate.coefficients[0] / deviation,
        values / deviation,
        rtol=0,
        atol=5e-3 * scale,
    )
    np.testing.assert_allclose(
        np.sqrt(np.diag(found.covariance)), deviation, rtol=CONVERGENCE_TOLERANCE
    )


def test_a_small_step_leaves_its_gram_matrix_to_the_next_one_and_the_fit_ends_where_it_would(
    monkeypatch,
):
    model, seen, *_ = with_outliers(6)
    taken_anew = []
    usual = LeastSquaresProblem.normal_equations
    found = []

    def counted(self, weights, known=None):
        taken_anew[-1] += known is None
        return usual(self, weights, known)

    monkeypatch.setattr(LeastSquaresProblem, "normal_equations", counted)
    for near in (0.3, 0.0):
        monkeypatch.setattr("elastocal.fitting.least_squares._REUSE_THRESHOLD", near)
        taken_anew.append(0)
        found.append(fit_model(model, seen, SENSOR))
    assert taken_anew[0] < taken_anew[1]
    (values,), (others,) = (each.estimate.coefficients for each in found)
    assert (
        np.abs(values - others).max()
        < 2 * CONVERGENCE_TOLERANCE * np.sqrt(np.diag(found[1].covariance)).max()
    )


@pytest.mark.parametrize("settled", [1e-3, 0.1])
@pytest.mark.parametrize("spread", [0.5, 5.0])
@pytest.mark.parametrize(
    ("share", "converged"), [(0.98, True), (-0.98, True), (1.02, False), (-1.02, False)]
)
def test_a_fit_has_converged_where_its_step_is_below_a_share_of_the_standard_error(
    spread, settled, share, converged, monkeypatch
):
    """Of measurements that scatter more than the noise, of their own standard error:
    all errors are of one size."""
    states = replace(make_gantry_states(30), repeats=np.ones(30, int))
    left = evaluate_waves(states.joint_angles, 1)[..., 0]
    off = 1e-4 * spread * np.random.default_rng(96).choice([-1.0, 1.0], (30, 3))
    model = make_gantry_model(make_linear_law(1))
    seen = observe_with_errors(states, off)
    best = (left * off).sum() / (left**2).sum()
    deviation = 1e-4 / np.sqrt((left**2).sum())
    # All distances are alike but for what the one parameter takes: their median is
    # their root mean square.
    scale = max(1.0, spread / np.sqrt(chi2.ppf(0.5, 3) / 3))
    start = replace(
        make_estimate(model, size=0.0),
        coefficients=(np.array([best + share * settled * scale * deviation]),),
    )
    monkeypatch.setattr("elastocal.fitting.least_squares._MAX_STEPS", 1)
    found = fit_model(
        model, seen, SENSOR, start, reweight_first_step=True, tolerance=settled
    )
    assert found.converged == converged
    # The last step is taken all the same: a linear problem is solved by it.
    assert found.estimate.coefficients[0][0] == pytest.approx(
        best, abs=1e-3 * settled * deviation
    )
    # One that starts anew gives all observations one weight first, and does not trust
    # that step.
    assert not fit_model(model, seen, SENSOR, start, tolerance=settled).converged


def unloaded(states):
    states.wrench[:] = 0.0
    return states


def assert_known(found, true, rows=3):
    for name in (
        "frame_position",
        "target_offset",
        "frame_rotation",
        *(["target_rotation"] if rows == 6 else []),
    ):
        np.testing.assert_allclose(
            getattr(found, name), getattr(true, name), rtol=0, atol=1e-6
        )


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("sessions", [(0,), (2, 5)])
@pytest.mark.parametrize(
    "seen_of", [2, 1], ids=["two targets", "one target, another without a measurement"]
)
def test_frames_and_targets_are_found_from_nothing(fanuc, rows, sessions, seen_of):
    """All measurements of a target may be held out: it stays where it was."""
    model = build_model(fanuc, targets=TARGETS, rows=rows)
    states = unloaded(make_states(6, 40, seed=1, sessions=len(sessions)))
    states.session[:] = np.array(sessions)[states.session]
    true = make_estimate(model, sessions, seed=2)
    seen = observe_exactly(model, true, states)
    mine = seen.target < seen_of
    rotation = None if seen.rotation is None else seen.rotation[mine]
    seen = replace(
        seen,
        state=seen.state[mine],
        target=seen.target[mine],
        position=seen.position[mine],
        rotation=rotation,
    )
    if seen_of == 1:
        true = replace(true, target_offset=true.target_offset * [[1], [0]])
        true.target_rotation[1] = np.eye(3)
    found = register_placement(model, seen)
    assert found.sessions == sessions
    assert_known(found, true, rows)


@pytest.mark.parametrize("fitted_frames", [False, True])
def test_a_known_mount_keeps_its_turn_and_an_unknown_one_is_found(fanuc, fitted_frames):
    targets = (
        Target("A", "6DoF", None, (0.1, -1.5, 0.2)),
        Target("B", "4DoF", (0.1, 0.0, 0.2), None),
    )
    model = make_model(fanuc.chain, targets, rows=6, fitted_frames=fitted_frames)
    states = unloaded(make_states(6, 15, seed=7))
    true = make_estimate(model, seed=8)
    found = register_placement(model, observe_exactly(model, true, states))
    assert_known(found, true, 6)
    np.testing.assert_array_equal(found.target_offset[1], (0.1, 0.0, 0.2))


def test_frame_is_no_reflection_where_all_points_lie_in_a_plane():
    model = make_model(
        chain_of("Tz(0.3) Rz(q1) Tx(0.5) Rz(q2) Tx(0.5) [end]"),
        (Target("A", "end", (0.0, 0.0, 0.0)),),
    )
    for seed in range(8):
        states = unloaded(make_states(2, 20, seed=seed))
        true = make_estimate(model, seed=seed + 10)
        assert_known(
            register_placement(model, observe_exactly(model, true, states)), true
        )


@pytest.mark.parametrize("joint_rad", [0.0, 2e-5])
def test_a_fit_of_more_states_than_are_kept_is_the_same_and_keeps_no_jacobian(
    fanuc, monkeypatch, joint_rad
):
    model = build_model(fanuc, "joint_offset@3", "stiffening@2", targets=TARGETS)
    seen = observe_exactly(
        model, make_estimate(model, seed=64), two_loads_a_pose(6, 20, seed=65)
    )
    seen = add_noise(seen, np.random.default_rng(66))
    seen.position[[5, 20]] += 3e-3
    noise = replace(NOISE, joint_rad=np.full(6, joint_rad))
    kept = fit_model(model, seen, noise)
    monkeypatch.setattr("elastocal.fitting.normal_equations._MAX_STATES_IN_MEMORY", 10)
    monkeypatch.setattr("elastocal.fitting.observations._MAX_SENSITIVITIES", 16 * 180)
    found = fit_model(model, seen, noise)
    assert (
        kept.joint_jacobian is not None
        and found.joint_jacobian is None
        and found.conditions is None
    )
    deviation = np.sqrt(np.diag(kept.covariance))
    values = [np.concatenate(each.estimate.coefficients) for each in (kept, found)]
    assert (np.abs(values[0] - values[1]) < 5e-3 * deviation[-len(values[0]) :]).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), deviation, rtol=1e-4)
    parts = [
        list(zip(*each.iterate_sensitivities(seen), strict=True))
        for each in (kept, found)
    ]
    assert len(parts[1][0]) > 1
    poses = [set(seen.cluster[part]) for part in parts[1][0]]
    assert sum(map(len, poses)) == len(set().union(*poses)) == 20
    for number in (1, 2):
        one, other = (np.concatenate(part[number]) for part in parts)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-5 * np.abs(one).max())
    monkeypatch.undo()
    for each in (kept, found):
        ((_, plain, white),) = each.iterate_sensitivities(seen)
        np.testing.assert_allclose(
            white, each.whiten(plain), rtol=0, atol=1e-5 * np.abs(white).max()
        )
