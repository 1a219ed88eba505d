"""Fits return the true parameters and the standard errors of statsmodels, tolerate
outliers, and converge."""

from dataclasses import dataclass, replace

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
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.elastic import joint_compliance
from elastocal.fitting import least_squares
from elastocal.fitting.least_squares import (
    CONVERGENCE_TOLERANCE,
    compute_negative_compliances,
    fit_model,
    fit_placement,
    get_plausible_sizes,
    register_placement,
)
from elastocal.fitting.model import Model, get_joint_compliances
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import LeastSquaresProblem
from elastocal.fitting.observations import Observations
from elastocal.mechanics.robot import Mass

MODULE = "elastocal.fitting.least_squares"


def list_effect_values(estimate):
    """Coefficients and shape parameters of all effects, in the order of the parameters
    of a fit."""
    values = []
    for coefficients, shapes in zip(
        estimate.coefficients, estimate.shapes, strict=True
    ):
        values += [*coefficients, *shapes]
    return np.array(values)


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
def test_noiseless_measurements_return_every_parameter(fanuc, keys, rows):
    model = build_model(fanuc, *keys, targets=TARGETS, rows=rows)
    true = make_estimate(model, (0, 1), seed=1)
    states = make_states(6, 40, seed=2, sessions=2)
    # The loads are as large as such an arm carries. Smaller ones do not show where the
    # stiffness of a gear changes.
    states.wrench[:] *= 1.5
    fit = fit_model(model, observe_exactly(model, true, states), NOISE)
    assert list_held_parameters(fit) == []
    np.testing.assert_allclose(fit.residual, 0.0, atol=1e-9)
    for owner in (
        "frame_position",
        "target_offset",
        "frame_rotation",
        "target_rotation",
    ):
        np.testing.assert_allclose(
            getattr(fit.estimate, owner), getattr(true, owner), rtol=0, atol=1e-8
        )
    of_effects = [
        not owner.startswith(("frame ", "target ")) for owner, _ in fit.parameters
    ]
    deviation = np.sqrt(np.diag(fit.covariance))[np.array(of_effects, bool)]
    true_values = list_effect_values(true)
    error = np.abs(list_effect_values(fit.estimate) - true_values)
    # The last step is at most a thousandth of a standard error; convergence is
    # quadratic, so the next step would be the square of that.
    assert (error <= 1e-4 * deviation + 1e-12 * np.abs(true_values)).all()
    assert (fit.weights == 1.0).all()


PRIORS = [None, None, 2e-5, 1e-3, 5e-6]


@dataclass(frozen=True)
class LinearProblem:
    """A linear estimation problem, written out.

    Attributes
    ----------
    model, observations
        The problem as the library takes it.
    design : ndarray (3 S, P)
    data : ndarray (3 S,)
        Positions minus commanded positions, m.
    covariance : ndarray (3 S, 3 S)
    """

    model: Model
    observations: Observations
    design: np.ndarray
    data: np.ndarray
    covariance: np.ndarray


def make_linear_problem(noise, count=40, priors=PRIORS):
    """Make observations of a linear law, none so far off that it loses weight."""
    model = make_gantry_model(make_linear_law(len(priors), priors))
    states = make_gantry_states(count, 16)
    covariance = compute_gantry_covariance(states, noise)
    rng = np.random.default_rng(93)
    errors = np.linalg.cholesky(covariance) @ rng.uniform(-1.0, 1.0, 3 * count)
    waves = evaluate_waves(states.joint_angles, len(priors))
    design = waves.reshape(3 * count, -1)
    data = design @ rng.normal(0, 3e-5, len(priors)) + errors
    observations = observe_with_errors(states, data.reshape(-1, 3))
    return LinearProblem(model, observations, design, data, covariance)


def generalized_least_squares(problem, priors):
    """Estimate and covariance by statsmodels, with each prior as one more measurement
    of zero."""
    with_prior = [number for number, prior in enumerate(priors) if prior is not None]
    design = np.concatenate([problem.design, np.eye(len(priors))[with_prior]])
    prior_blocks = [np.array([[priors[number] ** 2]]) for number in with_prior]
    covariance = block_diag(problem.covariance, *prior_blocks)
    data = np.concatenate([problem.data, np.zeros(len(with_prior))])
    solution = sm.GLS(data, design, sigma=covariance).fit()
    return solution.params, solution.normalized_cov_params


@pytest.mark.parametrize("start", ["nothing", "the data alone", "far away"])
@pytest.mark.parametrize("kind", GANTRY_NOISES)
def test_a_linear_problem_has_the_generalized_least_squares_solution_with_its_priors(
    kind, start
):
    """The solution does not depend on the start, even if that is the estimate of the
    data without the priors."""
    noise = GANTRY_NOISES[kind]
    problem = make_linear_problem(noise)
    expected, covariance = generalized_least_squares(problem, PRIORS)
    without_priors, _ = generalized_least_squares(problem, [None] * 5)
    deviation = np.sqrt(np.diag(covariance))
    # Both the data and the priors must matter, or the test would check neither.
    assert (np.abs(without_priors - expected) > deviation).any()
    zero = make_estimate(problem.model, size=0.0)
    far_away = np.array([1e-2, -1e-2, 5e-3, 0.0, -5e-3])
    starts = {
        "nothing": None,
        "the data alone": replace(zero, coefficients=(without_priors,)),
        "far away": replace(zero, coefficients=(far_away,)),
    }
    fit = fit_model(problem.model, problem.observations, noise, starts[start])
    assert fit.converged
    assert not fit.unidentifiable.any()
    assert (fit.weights == 1.0).all()
    np.testing.assert_allclose(
        fit.estimate.coefficients[0] / deviation,
        expected / deviation,
        rtol=0,
        atol=1e-5,
    )
    np.testing.assert_allclose(
        fit.covariance / np.outer(deviation, deviation),
        covariance / np.outer(deviation, deviation),
        atol=1e-7,
    )
    np.testing.assert_allclose(
        fit.residual.ravel(),
        problem.data - problem.design @ expected,
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


@pytest.mark.parametrize("large_fit_size", [30, 60])
def test_a_fit_that_starts_from_a_sample_ends_at_the_fit_to_all_observations(
    large_fit_size, monkeypatch
):
    """The fit goes from a small sample to all observations directly, or by way of an
    intermediate sample."""
    noise = GANTRY_NOISES["joints"]
    problem = make_linear_problem(noise, 60)
    expected, covariance = generalized_least_squares(problem, PRIORS)
    for name, count in (
        ("START_SAMPLE_SIZE", 20),
        ("LARGE_FIT_SIZE", large_fit_size),
        ("_INTERMEDIATE_SAMPLE_SIZE", 40),
    ):
        monkeypatch.setattr(f"{MODULE}.{name}", count)
    sample_sizes = []
    original = least_squares.fit_robustly

    def record_size(*arguments, **options):
        sample_sizes.append(len(arguments[1]))
        return original(*arguments, **options)

    monkeypatch.setattr(least_squares, "fit_robustly", record_size)
    fit = fit_model(problem.model, problem.observations, noise)
    # Samples consist of whole poses, so they are a little smaller than asked for.
    intermediate = [37] if large_fit_size < 60 else []
    assert sample_sizes == [18, *intermediate, 60]
    deviation = np.sqrt(np.diag(covariance))
    assert fit.converged
    assert len(fit.residual) == 60
    np.testing.assert_allclose(
        fit.estimate.coefficients[0] / deviation,
        expected / deviation,
        rtol=0,
        atol=1e-5,
    )


@pytest.mark.parametrize("rows", [3, 6])
def test_frames_and_targets_of_another_setup_are_fitted_and_effects_stay(fanuc, rows):
    """Exact measurements with the same effects and other frames and targets return
    these frames and targets."""
    model = build_model(
        fanuc, "joint_offset@3", "lost_motion@2", targets=TARGETS, rows=rows
    )
    true = make_estimate(model, seed=36)
    fit = fit_model(
        model, observe_exactly(model, true, make_states(6, 40, seed=37)), NOISE
    )
    elsewhere = replace(
        make_estimate(model, seed=38),
        coefficients=true.coefficients,
        shapes=true.shapes,
    )
    placed = fit_placement(
        fit, model, observe_exactly(model, elsewhere, make_states(6, 10, seed=39))
    )
    for name in ("frame_position", "frame_rotation", "target_offset"):
        np.testing.assert_allclose(
            getattr(placed, name), getattr(elsewhere, name), rtol=0, atol=1e-7
        )
    for coefficients, expected in zip(
        placed.coefficients, fit.estimate.coefficients, strict=True
    ):
        np.testing.assert_array_equal(coefficients, expected)


def compute_robust_objective(fit):
    """Huber's objective of a fit without a prior over all its observations, by the norm
    of statsmodels."""
    rows = fit.model.rows
    norm = sm.robust.norms.HuberT(np.sqrt(chi2.ppf(0.99, rows) / rows))
    whitened = fit.whitening.apply(fit.residual)
    return rows * norm.rho(np.sqrt((whitened**2).mean(axis=1))).sum()


@pytest.mark.parametrize(("seed", "lag"), [(3, 1500.0), (24, 900.0), (25, 1500.0)])
def test_steps_that_do_not_help_are_halved_until_the_fit_converges(
    fanuc, seed, lag, monkeypatch
):
    model, observations = observe_bent_law(fanuc, seed, lag)
    fit = fit_model(model, observations, NOISE)
    assert fit.converged
    monkeypatch.setattr(f"{MODULE}._MAX_HALVINGS", 0)
    with_full_steps = fit_model(model, observations, NOISE)
    assert not with_full_steps.converged
    objective = compute_robust_objective(fit)
    assert objective < compute_robust_objective(with_full_steps) - 0.01


@pytest.mark.parametrize(
    ("seed", "lag", "bound"), [(4, 8000.0, 36000.0), (8, 3000.0, 900.0)]
)
def test_fit_converges_at_a_bound_of_a_shape_parameter(fanuc, seed, lag, bound):
    model, observations = observe_bent_law(fanuc, seed, lag)
    fit = fit_model(model, observations, NOISE)
    assert fit.converged
    assert fit.estimate.shapes[0][0] == bound
    # The other parameters are optimal for a shape at its bound: a fit with the shape
    # fixed there does not move them.
    frozen = replace(
        model.effects[0],
        shapes=(),
        displacement=lambda conditions: model.effects[0].displacement(
            conditions, bound
        ),
    )
    start = replace(fit.estimate, shapes=(np.zeros(0),))
    refit = fit_model(replace(model, effects=(frozen,)), observations, NOISE, start)
    deviation = np.sqrt(refit.covariance[-1, -1])
    change = refit.estimate.coefficients[0][0] - fit.estimate.coefficients[0][0]
    assert abs(change) < 2e-3 * deviation


WEAK_PRIORS = [None, 3e-5, None]

SENSOR = Noise("declared", 1e-4, 5e-5, np.zeros(3))


@dataclass(frozen=True)
class OutlierProblem:
    """Observations of a linear law, five of which are far off.

    Attributes
    ----------
    model, observations
        The problem as the library takes it.
    design : ndarray (S, 3, 3)
    position_error : ndarray (S, 3)
        Measured minus commanded position, m.
    rotation_error : ndarray (S, 3) or None
        Rotation vector from the commanded to the measured orientation, rad.
    """

    model: Model
    observations: Observations
    design: np.ndarray
    position_error: np.ndarray
    rotation_error: np.ndarray | None

    def compute_distances(self, coefficients, noise_factor):
        """Root mean square of each observation's residual, in standard deviations of
        `SENSOR` times a factor."""
        whitened = [(self.position_error - self.design @ coefficients) / 1e-4]
        if self.rotation_error is not None:
            whitened.append(self.rotation_error / 5e-5)
        squares = np.concatenate(whitened, axis=1) ** 2
        return np.sqrt(squares.mean(axis=1)) / noise_factor


def make_outlier_problem(rows, count=40):
    """Make a problem with outliers, of positions (3 rows) or poses (6 rows)."""
    rng = np.random.default_rng(95)
    states = replace(make_gantry_states(count), repeats=np.ones(count, int))
    design = evaluate_waves(states.joint_angles, 3)
    position_error = 1e-4 * rng.standard_normal((count, 3))
    position_error = position_error + design @ [4e-5, -8e-5, 1e-4]
    position_error[[3, 11, 17, 30, 38]] += 1e-3 * np.array(
        [[1, 0, 0], [0, -2, 0], [0, 0, 3], [2, 2, 0], [5, 0, 0]]
    )
    rotation_error = 5e-5 * rng.standard_normal((count, 3)) if rows == 6 else None
    model = make_gantry_model(make_linear_law(3, WEAK_PRIORS), rows=rows)
    observations = observe_with_errors(states, position_error, rotation_error)
    return OutlierProblem(model, observations, design, position_error, rotation_error)


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("noise_factor", [0.2, 0.7, 1.0, 3.0])
def test_weights_fall_with_the_distance_relative_to_the_actual_scale_of_the_errors(
    rows, noise_factor
):
    """The weight is one up to the 99 % quantile and inversely proportional to the
    distance above it. The scale comes from the median distance, but is never below the
    noise."""
    problem = make_outlier_problem(rows)
    fit = fit_model(problem.model, problem.observations, SENSOR.scaled(noise_factor))
    distance = problem.compute_distances(fit.estimate.coefficients[0], noise_factor)
    scale = max(1.0, np.median(distance) / np.sqrt(chi2.ppf(0.5, rows) / rows))
    assert (scale > 1.3) == (noise_factor < 0.75)
    threshold = np.sqrt(chi2.ppf(0.99, rows) / rows) * scale
    weights = np.minimum(1.0, threshold / distance)
    assert fit.converged
    assert (weights < 1).sum() >= 3
    np.testing.assert_allclose(fit.weights, weights, rtol=2e-3)
    # The estimate solves the normal equations of these weights. Its covariance is their
    # inverse, or that of the equations before a last small step.
    design = problem.design.reshape(-1, 3)
    precision_of_rows = np.repeat(fit.weights, 3)[:, None] / (1e-4 * noise_factor) ** 2
    weighted = design * precision_of_rows
    precision = weighted.T @ design + np.diag([0.0, WEAK_PRIORS[1] ** -2, 0.0])
    coefficients = np.linalg.solve(
        precision, weighted.T @ problem.position_error.ravel()
    )
    deviation = np.sqrt(np.diag(np.linalg.inv(precision)))
    np.testing.assert_allclose(
        fit.estimate.coefficients[0] / deviation,
        coefficients / deviation,
        rtol=0,
        atol=5e-3 * scale,
    )
    np.testing.assert_allclose(
        np.sqrt(np.diag(fit.covariance)), deviation, rtol=CONVERGENCE_TOLERANCE
    )


def test_reusing_the_gram_matrix_after_a_small_step_does_not_change_where_the_fit_ends(
    monkeypatch,
):
    problem = make_outlier_problem(6)
    original = LeastSquaresProblem.normal_equations
    computed_anew = []

    def record_reuse(self, weights, known=None):
        computed_anew.append(known is None)
        return original(self, weights, known)

    monkeypatch.setattr(LeastSquaresProblem, "normal_equations", record_reuse)

    def fit_with_threshold(threshold):
        """Fit, and count the Gram matrices that the fit computes."""
        computed_anew.clear()
        monkeypatch.setattr(f"{MODULE}._REUSE_THRESHOLD", threshold)
        return fit_model(problem.model, problem.observations, SENSOR), sum(
            computed_anew
        )

    with_reuse, count_with_reuse = fit_with_threshold(0.3)
    without_reuse, count_without_reuse = fit_with_threshold(0.0)
    assert count_with_reuse < count_without_reuse
    (coefficients,) = with_reuse.estimate.coefficients
    (expected,) = without_reuse.estimate.coefficients
    deviation = np.sqrt(np.diag(without_reuse.covariance))
    change = np.abs(coefficients - expected).max()
    assert change < 2 * CONVERGENCE_TOLERANCE * deviation.max()


@pytest.mark.parametrize("tolerance", [1e-3, 0.1])
@pytest.mark.parametrize("spread", [0.5, 5.0])
@pytest.mark.parametrize(
    ("share", "converged"), [(0.98, True), (-0.98, True), (1.02, False), (-1.02, False)]
)
def test_a_fit_has_converged_if_its_step_is_below_a_share_of_the_standard_error(
    spread, tolerance, share, converged, monkeypatch
):
    """If measurements scatter more than the noise, the standard error grows with their
    scatter. All errors have the same size here."""
    states = replace(make_gantry_states(30), repeats=np.ones(30, int))
    design = evaluate_waves(states.joint_angles, 1)[..., 0]
    error = 1e-4 * spread * np.random.default_rng(96).choice([-1.0, 1.0], (30, 3))
    model = make_gantry_model(make_linear_law(1))
    observations = observe_with_errors(states, error)
    solution = (design * error).sum() / (design**2).sum()
    deviation = 1e-4 / np.sqrt((design**2).sum())
    # All distances are equal except for the share that the one parameter fits, so
    # their median is their root mean square.
    scale = max(1.0, spread / np.sqrt(chi2.ppf(0.5, 3) / 3))
    start = replace(
        make_estimate(model, size=0.0),
        coefficients=(np.array([solution + share * tolerance * scale * deviation]),),
    )
    monkeypatch.setattr(f"{MODULE}._MAX_STEPS", 1)
    monkeypatch.setattr(f"{MODULE}._NEGLIGIBLE_STEP", 0.0)
    fit = fit_model(
        model,
        observations,
        SENSOR,
        start,
        reweight_first_step=True,
        tolerance=tolerance,
    )
    assert fit.converged == converged
    # The last step is taken in any case, and it solves a linear problem.
    assert fit.estimate.coefficients[0][0] == pytest.approx(
        solution, abs=1e-3 * tolerance * deviation
    )
    # Without `reweight_first_step` a fit gives all observations the same weight first,
    # and that step does not count as convergence.
    unweighted = fit_model(model, observations, SENSOR, start, tolerance=tolerance)
    assert not unweighted.converged


@pytest.mark.parametrize(("std_errors", "converged"), [(0.009, True), (0.02, False)])
def test_a_fit_that_reaches_its_last_step_has_converged_if_that_step_is_negligible(
    std_errors, converged, monkeypatch
):
    states = replace(make_gantry_states(30), repeats=np.ones(30, int))
    model = make_gantry_model(make_linear_law(1))
    design = evaluate_waves(states.joint_angles, 1)[..., 0]
    deviation = 1e-4 / np.sqrt((design**2).sum())
    start = replace(
        make_estimate(model, size=0.0),
        coefficients=(np.array([std_errors * deviation]),),
    )
    observations = observe_with_errors(states, 0.0 * design)
    monkeypatch.setattr(f"{MODULE}._MAX_STEPS", 1)
    fit = fit_model(model, observations, SENSOR, start, reweight_first_step=True)
    assert fit.converged == converged


def remove_loads(states):
    """Set all loads of some states to zero, and return the states."""
    states.wrench[:] = 0.0
    return states


def assert_same_placement(estimate, true, rows=3):
    """Check that frames and targets agree with the true ones."""
    names = ["frame_position", "target_offset", "frame_rotation"]
    if rows == 6:
        names.append("target_rotation")
    for name in names:
        np.testing.assert_allclose(
            getattr(estimate, name), getattr(true, name), rtol=0, atol=1e-6
        )


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("sessions", [(0,), (2, 5)])
@pytest.mark.parametrize(
    "measured_targets",
    [2, 1],
    ids=["two targets", "one target, another without a measurement"],
)
def test_frames_and_targets_are_registered_without_a_start(
    fanuc, rows, sessions, measured_targets
):
    """All measurements of a target may be held out; this target keeps its place."""
    model = build_model(fanuc, targets=TARGETS, rows=rows)
    states = remove_loads(make_states(6, 40, seed=1, sessions=len(sessions)))
    states.session[:] = np.array(sessions)[states.session]
    true = make_estimate(model, sessions, seed=2)
    complete = observe_exactly(model, true, states)
    measured = complete.target < measured_targets
    observations = replace(
        complete,
        state=complete.state[measured],
        target=complete.target[measured],
        position=complete.position[measured],
        rotation=None if complete.rotation is None else complete.rotation[measured],
    )
    if measured_targets == 1:
        true = replace(true, target_offset=true.target_offset * [[1], [0]])
        true.target_rotation[1] = np.eye(3)
    estimate = register_placement(model, observations)
    assert estimate.sessions == sessions
    assert_same_placement(estimate, true, rows)


@pytest.mark.parametrize("fitted_frames", [False, True])
def test_a_known_mount_keeps_its_rotation_and_an_unknown_one_is_registered(
    fanuc, fitted_frames
):
    targets = (
        Target("A", "6DoF", None, (0.1, -1.5, 0.2)),
        Target("B", "4DoF", (0.1, 0.0, 0.2), None),
    )
    model = make_model(fanuc.chain, targets, rows=6, fitted_frames=fitted_frames)
    states = remove_loads(make_states(6, 15, seed=7))
    true = make_estimate(model, seed=8)
    estimate = register_placement(model, observe_exactly(model, true, states))
    assert_same_placement(estimate, true, 6)
    np.testing.assert_array_equal(estimate.target_offset[1], (0.1, 0.0, 0.2))


def test_a_frame_is_no_reflection_if_all_points_lie_in_a_plane():
    model = make_model(
        chain_of("Tz(0.3) Rz(q1) Tx(0.5) Rz(q2) Tx(0.5) [end]"),
        (Target("A", "end", (0.0, 0.0, 0.0)),),
    )
    for seed in range(8):
        states = remove_loads(make_states(2, 20, seed=seed))
        true = make_estimate(model, seed=seed + 10)
        estimate = register_placement(model, observe_exactly(model, true, states))
        assert_same_placement(estimate, true)


def observe_poses_with_outliers(model):
    """Observe 20 poses with two loads each, with noise and two outliers."""
    observations = observe_exactly(
        model, make_estimate(model, seed=64), two_loads_a_pose(6, 20, seed=65)
    )
    observations = add_noise(observations, np.random.default_rng(66))
    observations.position[[5, 20]] += 3e-3
    return observations


def assert_blocks_are_whole_poses(cluster, blocks, poses):
    """Check that there are several blocks, that no pose is in two of them, and that
    all poses are in one."""
    assert len(blocks) > 1
    poses_of_blocks = [set(cluster[block]) for block in blocks]
    count = sum(len(poses_of_block) for poses_of_block in poses_of_blocks)
    assert count == len(set().union(*poses_of_blocks)) == poses


def assert_close_to_largest(values, expected):
    """Check that two arrays agree to 5e-5 of the largest expected value."""
    np.testing.assert_allclose(
        values, expected, rtol=0, atol=5e-5 * np.abs(expected).max()
    )


@pytest.mark.parametrize("joint_rad", [0.0, 2e-5])
def test_a_fit_of_more_states_than_fit_in_memory_is_the_same_and_keeps_no_jacobian(
    fanuc, monkeypatch, joint_rad
):
    model = build_model(fanuc, "joint_offset@3", "stiffening@2", targets=TARGETS)
    observations = observe_poses_with_outliers(model)
    noise = replace(NOISE, joint_rad=np.full(6, joint_rad))
    in_memory = fit_model(model, observations, noise)
    assert in_memory.joint_jacobian is not None
    monkeypatch.setattr("elastocal.fitting.normal_equations._MAX_STATES_IN_MEMORY", 10)
    monkeypatch.setattr("elastocal.fitting.observations._MAX_SENSITIVITIES", 16 * 180)
    blockwise = fit_model(model, observations, noise)
    assert blockwise.joint_jacobian is None
    assert blockwise.conditions is None
    deviation = np.sqrt(np.diag(in_memory.covariance))
    coefficients = np.concatenate(in_memory.estimate.coefficients)
    change = np.abs(coefficients - np.concatenate(blockwise.estimate.coefficients))
    # The shape of the stiffening comes last.
    assert (change < 5e-3 * deviation[-len(coefficients) - 1 : -1]).all()
    np.testing.assert_allclose(
        np.sqrt(np.diag(blockwise.covariance)), deviation, rtol=1e-4
    )
    _, plain, white = zip(*in_memory.iterate_sensitivities(observations), strict=True)
    blocks, plain_blocks, white_blocks = zip(
        *blockwise.iterate_sensitivities(observations), strict=True
    )
    assert_blocks_are_whole_poses(observations.cluster, blocks, 20)
    assert_close_to_largest(np.concatenate(plain_blocks), np.concatenate(plain))
    assert_close_to_largest(np.concatenate(white_blocks), np.concatenate(white))
    monkeypatch.undo()
    for fit in (in_memory, blockwise):
        ((_, plain, white),) = fit.iterate_sensitivities(observations)
        np.testing.assert_allclose(
            white, fit.whiten(plain), rtol=0, atol=1e-5 * np.abs(white).max()
        )


def test_a_slow_linear_fixed_point_is_found_in_as_many_steps_as_it_has_unknowns():
    """Plain iteration would need 1,000 steps for the same error."""
    contraction = np.diag([0.99, 0.95, 0.5])
    fixed_point = np.array([[0.1, -0.2, 0.3]])
    rounds = []
    argument = np.zeros((1, 3))
    for _ in range(5):
        value = fixed_point + (argument - fixed_point) @ contraction
        rounds.append((argument, value))
        argument = least_squares._extrapolate_fixed_point(rounds)
    np.testing.assert_allclose(argument, fixed_point, atol=1e-9)


@pytest.mark.parametrize("offset_std_m", [1e-6, 2e-4])
def test_a_declared_offset_is_estimated_with_its_prior(kuka, offset_std_m):
    """The mean of the measured offsets and the prior have the weights of their
    variances, and the standard error is that of both together."""
    declared = (0.1, 0.0, 0.05)
    deviation = np.array([3e-4, -1e-4, 2e-4])
    target = Target("A", "6DoF", declared, offset_std_m=offset_std_m)
    model = make_model(kuka, (target,), fitted_frames=False)
    states = make_states(kuka.joints, 25)
    true = replace(
        make_estimate(model, size=0.0),
        target_offset=(np.array(declared) + deviation)[None],
    )
    observations = observe_exactly(model, true, states)
    noise = Noise("declared", 5e-5, 5e-5, np.zeros(6))
    fitted = fit_model(model, observations, noise)
    data_variance = noise.position_m**2 / len(observations)
    share = offset_std_m**2 / (offset_std_m**2 + data_variance)
    np.testing.assert_allclose(
        fitted.estimate.target_offset[0] - declared, share * deviation, rtol=1e-4
    )
    np.testing.assert_allclose(
        np.diag(fitted.covariance), share * data_variance, rtol=1e-4
    )


@pytest.mark.parametrize("base_std_m", [1e-5, 2e-4])
def test_sessions_with_a_declared_base_are_placed_within_their_prior(kuka, base_std_m):
    """A frame moves by the share that its prior and its measurements give it, and the
    offset of joint 3 is no longer biased by a session that was registered elsewhere."""
    target = Target("A", "6DoF", (0.1, 0.0, 0.05))
    exact = build_model(kuka, "joint_offset@3", targets=(target,), fitted_frames=False)
    states = make_states(kuka.joints, 40, sessions=2)
    true = make_estimate(exact, sessions=(0, 1), size=0.0)
    shift = np.array([[1e-4, 0.0, 0.0], [0.0, -1e-4, 2e-4]])
    observations = observe_exactly(exact, replace(true, frame_position=shift), states)
    noise = Noise("declared", 2e-6, 2e-6, np.zeros(6))
    fitted = fit_model(replace(exact, base_std_m=base_std_m), observations, noise)
    free = fit_model(replace(exact, base_std_m=1.0), observations, noise)
    np.testing.assert_allclose(free.estimate.frame_position, shift, atol=3e-6)
    np.testing.assert_allclose(fitted.estimate.frame_position, shift, atol=1e-5)
    assert (np.diag(fitted.covariance)[:12] < base_std_m**2).all()
    biased = fit_model(exact, observations, noise)
    assert abs(biased.estimate.coefficients[0][0]) > 2e-5
    assert abs(fitted.estimate.coefficients[0][0]) < 5e-6


def test_springs_stay_at_zero_where_loads_of_the_wrong_sign_would_make_them_negative(
    fanuc,
):
    """The other parameters are those of a fit without these springs."""
    model = build_model(fanuc, "joint_offset@3", targets=TARGETS)
    model = model.with_effects([joint_compliance(model.sites)])
    truth = make_estimate(model, seed=2)
    observations = observe_exactly(model, truth, make_states(6, 40, seed=2))
    states = observations.states
    turned = replace(observations, states=replace(states, wrench=-states.wrench))
    fitted = fit_model(model, turned, NOISE)
    compliance = get_joint_compliances(model, fitted.estimate)
    assert fitted.converged and (compliance >= 0).all()
    assert (compute_negative_compliances(fitted) > 3).sum() >= 3


def test_a_joint_without_any_compliance_still_bears_declared_masses(kuka):
    """A fit may start where physics keeps a spring at zero."""
    robot = replace(kuka, masses=(Mass(3, 200.0, (0.3, 0.0, 0.1), 0.1),))
    model = make_model(
        robot, TARGETS, compliance=np.zeros(6), identified=True, fitted_frames=False
    )
    share = candidates_on(model.sites)["declared_masses[all alike]"]
    model = model.with_effects([share])
    true = make_estimate(model, size=0.0)
    no_errors = np.zeros(len(model.effects[1].parameters))
    true = replace(true, coefficients=(kuka.compliance, no_errors, np.array([0.2])))
    observations = observe_exactly(model, true, make_states(6, 30, seed=2))
    fitted = fit_model(model, observations, NOISE)
    assert fitted.converged
    compliance = get_joint_compliances(fitted.model, fitted.estimate)
    np.testing.assert_allclose(compliance, kuka.compliance, rtol=0.05)


def test_a_parameter_counts_as_identified_by_the_same_share_everywhere():
    assert Settings().prior_share == least_squares.IDENTIFIED_SHARE
