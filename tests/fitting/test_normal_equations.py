"""Normal equations agree with dense whitening, with finite differences and with closed
forms; parameters that the data do not identify are held and named."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
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
    observe_with_errors,
)
from synthetic import (
    NOISE,
    add_noise,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    apply_step,
    compute_residuals,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import (
    LeastSquaresProblem,
    ParameterScales,
    compute_whitening,
    find_identifiable_parameters,
    solve_normal_equations,
)
from elastocal.fitting.observations import Observations


def solve(design, residual, plausible, *, penalty, present):
    """Solve the normal equations of whitened sensitivities and residual.

    Returns the step, the covariance, and which parameters are unidentifiable.
    """
    scaled = design * plausible
    nothing = np.zeros(len(plausible), bool)
    solution = solve_normal_equations(
        scaled.T @ scaled,
        scaled.T @ residual,
        ParameterScales(plausible, penalty, nothing),
        present,
        nothing,
    )
    return solution.step, solution.covariance, solution.unidentifiable


def test_a_solution_with_priors_is_that_of_numpy_with_a_row_for_each_prior():
    rng = np.random.default_rng(45)
    design = 10 * rng.standard_normal((8, 6))
    residual = rng.standard_normal(8)
    present = rng.standard_normal(6)
    penalty = np.array([0.0, 0.0, 4.0, 9.0, 25.0, 1.0])
    prior_rows = np.diag(np.sqrt(penalty))
    rows = np.concatenate([design, prior_rows])
    right_hand_side = np.concatenate([residual, -prior_rows @ present])
    step, covariance, unidentifiable = solve(
        design, residual, np.full(6, 2.0), penalty=penalty, present=present
    )
    np.testing.assert_allclose(
        step, np.linalg.lstsq(rows, right_hand_side)[0], rtol=1e-9
    )
    np.testing.assert_allclose(
        covariance, np.linalg.inv(rows.T @ rows), rtol=1e-9, atol=1e-15
    )
    assert not unidentifiable.any()


def invert_covariance(*covariance):
    """Return the information matrix of a covariance, both in plausible sizes."""
    return np.linalg.inv(np.array(covariance))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("correlation", "identifiable"), [(0.49, [False, True]), (0.51, [True, False])]
)
def test_a_shape_gives_way_to_another_parameter_from_a_correlation_of_a_half_on(
    correlation, identifiable, sign
):
    """This holds for correlations of either sign. The other parameter has a standard
    error of 1.05 next to the shape, and is identifiable without it."""
    shared = sign * correlation * 1.05 * 0.5
    gram = invert_covariance([1.05**2, shared], [shared, 0.5**2])
    assert 1 / np.sqrt(gram[0, 0]) < 1.0
    np.testing.assert_array_equal(
        find_identifiable_parameters(gram, np.zeros(2, bool), np.array([False, True]))[
            0
        ],
        identifiable,
    )


@pytest.mark.parametrize(
    ("standard_error", "identifiable"), [(0.999, True), (1.001, False)]
)
@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_a_parameter_is_estimated_up_to_a_standard_error_of_its_plausible_size(
    standard_error, identifiable, correlation
):
    """A correlation with a better known parameter does not matter."""
    shared = 0.1 * standard_error * correlation
    gram = invert_covariance([0.01, shared], [shared, standard_error**2])
    np.testing.assert_array_equal(
        find_identifiable_parameters(gram, np.zeros(2, bool), np.zeros(2, bool))[0],
        [True, identifiable],
    )


@pytest.mark.parametrize(
    ("key", "held"),
    [
        ("joint_offset@1", ["joint_offset@1 offset"]),
        # A rotation of the last joint shifts the positions of a single target in the
        # same way as an offset of this target.
        ("joint_offset@6", ["joint_offset@6 offset"]),
        (
            "link_geometry@6",
            [
                f"link_geometry@6 {name}"
                for name in ("dx", "dy", "dz", "rx", "ry", "rz")
            ],
        ),
    ],
)
def test_an_effect_that_the_frame_or_the_target_can_imitate_is_held_and_named(
    fanuc, key, held
):
    model = build_model(fanuc, key, "joint_offset@3")
    true = make_estimate(model, seed=13)
    observations = add_noise(
        observe_exactly(model, true, make_states(6, 40, seed=14)),
        np.random.default_rng(15),
    )
    fit = fit_model(model, observations, NOISE)
    assert list_held_parameters(fit) == held
    assert not fit.estimate.coefficients[0].any()
    assert not fit.covariance[fit.unidentifiable].any()
    assert not fit.covariance[:, fit.unidentifiable].any()
    # The held parameters are not merely shrunk towards zero by a penalty: the fit is
    # the same as without them.
    without = fit_model(build_model(fanuc, "joint_offset@3"), observations, NOISE)
    np.testing.assert_allclose(
        fit.estimate.coefficients[1], without.estimate.coefficients[0], rtol=1e-9
    )
    np.testing.assert_allclose(
        fit.covariance[~fit.unidentifiable][:, ~fit.unidentifiable],
        without.covariance,
        rtol=1e-6,
        atol=1e-22,
    )


@pytest.mark.parametrize("roundings", [-2.0, 0.0, 2.0])
def test_information_of_the_plausible_size_alone_never_identifies_a_parameter(
    roundings,
):
    """This holds however the information of one is rounded."""
    gram = np.diag([50.0, 1.0 + roundings * np.finfo(float).eps, 3.0])
    nothing = np.zeros(3, bool)
    np.testing.assert_array_equal(
        find_identifiable_parameters(gram, nothing, nothing)[0], [True, False, True]
    )


def select_pivots(gram):
    """Go through the parameters in order, and keep those whose Schur complement after
    the kept ones exceeds one and the rounding."""
    kept = []
    for number, column in enumerate(gram.T):
        shared = column[kept]
        explained = shared @ np.linalg.solve(gram[np.ix_(kept, kept)], shared)
        schur_complement = gram[number, number] - explained
        if schur_complement > max(1.0, 1e-11 * gram[number, number]):
            kept.append(number)
    return kept


def test_the_parameters_of_a_singular_problem_are_selected_pivot_by_pivot():
    rng = np.random.default_rng(48)
    deficient_cases = 0
    for _ in range(200):
        size = int(rng.integers(2, 12))
        design = rng.standard_normal(
            (int(rng.integers(1, size + 4)), size)
        ) * 10.0 ** rng.uniform(-1, 3, size)
        gram = design.T @ design
        kept = select_pivots(gram)
        nothing = np.zeros(size, bool)
        identifiable = np.flatnonzero(
            find_identifiable_parameters(gram, nothing, nothing)[0]
        ).tolist()
        # A later parameter may take the information of its predecessors.
        assert set(identifiable) <= set(kept)
        if (np.diag(np.linalg.inv(gram[np.ix_(kept, kept)])) <= 1.0).all():
            assert identifiable == kept
            deficient_cases += len(kept) < size
    assert deficient_cases > 20


THREE_TARGETS = tuple(
    Target(name, point, (0.1, 0.05, 0.0))
    for name, point in (("A", "6DoF"), ("B", "3DoF"), ("C", "2DoF"))
)

JOINT_NOISE = Noise("repeats", 60e-6, 40e-6, 1e-6 * np.array([30.0, 40, 50, 60, 70, 0]))


@pytest.fixture(params=[3, 6], ids=["positions", "poses"])
def case(request, fanuc):
    """Observations of one to three targets a state, averaged over one to four repeats,
    and their joint Jacobian."""
    model = make_model(fanuc.chain, THREE_TARGETS, request.param, fitted_frames=False)
    states = make_states(6, 7, seed=1)
    states.repeats[:] = [1, 4, 2, 3, 1, 2, 4]
    complete = observe_exactly(model, make_estimate(model), states)
    kept = np.array([0, 1, 2, 4, 6, 7, 8, 9, 12, 13, 14, 17, 18, 19, 20])
    observations = Observations(
        states,
        complete.state[kept],
        complete.target[kept],
        complete.position[kept],
        None if complete.rotation is None else complete.rotation[kept],
    )
    estimate = make_estimate(model)
    conditions = evaluate_conditions(model, estimate, states)
    linearized = linearize(model, estimate, observations, conditions)
    return observations, linearized.coordinate_jacobian[..., :6]


def write_out_covariance(observations, jacobian, noise):
    """Write out the dense covariance of all rows from the meaning of the noise."""
    rows = observations.rows
    joint_part = jacobian.reshape(-1, 6) * noise.joint_rad
    pose_part = jacobian.reshape(-1, 6) * noise.pose_rad
    state = np.repeat(observations.state, rows)
    pose = np.repeat(observations.cluster, rows)
    sensor = np.tile(
        ([noise.position_m] * 3 + [noise.orientation_rad] * 3)[:rows],
        len(observations),
    )
    same_state = state[:, None] == state
    same_pose = pose[:, None] == pose
    single = (joint_part @ joint_part.T) * same_state + np.diag(sensor**2)
    # Repeats do not average the error that a pose has in common.
    averaged = single / observations.states.repeats[state]
    return averaged + (pose_part @ pose_part.T) * same_pose


@pytest.mark.parametrize("pose_rad", [0.0, 2e-5, 1e-3])
def test_whitened_rows_are_those_of_a_dense_factor_of_the_covariance(case, pose_rad):
    """Some poses have one state and some have two or three, which share the joint
    errors of the pose."""
    observations, jacobian = case
    observations = replace(
        observations,
        states=replace(observations.states, pose=np.array([0, 1, 1, 1, 2, 2, 3])),
    )
    noise = replace(JOINT_NOISE, pose_rad=pose_rad)
    covariance = write_out_covariance(observations, jacobian, noise)
    whitening = compute_whitening(observations, jacobian, noise)
    values = np.random.default_rng(2).standard_normal(
        (len(observations), observations.rows, 5)
    )
    whitened = whitening.apply(values).reshape(-1, 5)
    # A factor of a covariance is unique only up to a rotation of its rows, so compare
    # products of whitened columns.
    columns = values.reshape(-1, 5)
    expected = columns.T @ np.linalg.solve(covariance, columns)
    np.testing.assert_allclose(
        whitened.T @ whitened, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max()
    )
    identity = np.eye(len(covariance)).reshape(len(observations), observations.rows, -1)
    factor = whitening.apply(identity).reshape(covariance.shape)
    np.testing.assert_allclose(
        factor @ covariance @ factor.T, np.eye(len(covariance)), atol=1e-7
    )


def observe_several_loads(model, estimate):
    """Observe four poses under three loads each, with noise."""
    states = replace(
        make_states(6, 12, seed=88), pose=np.arange(12) // 3, load=np.arange(12) % 3
    )
    observations = observe_exactly(model, estimate, states)
    return add_noise(observations, np.random.default_rng(89))


def differentiate_squares(problem, weights, model, estimate, steps):
    """Half the fall of the weighted squares for each step, by central differences."""
    decreases = []
    for step in steps:
        behind = problem.squares(weights, apply_step(model, estimate, -1 * step))
        ahead = problem.squares(weights, apply_step(model, estimate, 1 * step))
        decreases.append((behind - ahead) / 4)
    return np.array(decreases)


@pytest.mark.parametrize("pose_rad", [0.0, 3e-5])
@pytest.mark.parametrize("offset", [None, (0.0, 0.0, 0.1)])
def test_factored_normal_equations_are_those_of_dense_columns(
    fanuc, offset, pose_rad, monkeypatch
):
    """Targets are fitted or known; joint errors belong to a state alone, or also to a
    pose that has several states."""
    model = build_model(
        fanuc,
        "joint_offset@2",
        "lost_motion@3",
        "link_geometry@3",
        targets=tuple(replace(target, offset_m=offset) for target in TARGETS),
        rows=6,
    )
    estimate = make_estimate(model, seed=87)
    observations = observe_several_loads(model, estimate)
    joint_rad = 1e-6 * np.array([40.0, 15, 15, 30, 45, 220])
    noise = Noise("declared", 5e-6, 1e-5, joint_rad, pose_rad=pose_rad)
    plausible = np.array(
        [parameter.plausible for _, parameter in list_parameters(model, estimate)]
    )
    weights = np.random.default_rng(90).uniform(0.3, 1.0, len(observations))

    def make_problem(columns_per_coordinate):
        """Linearize and whiten; the number decides between factors and columns."""
        monkeypatch.setattr(
            "elastocal.fitting.normal_equations._COLUMNS_PER_COORDINATE",
            columns_per_coordinate,
        )
        problem = LeastSquaresProblem(model, observations, noise, estimate, plausible)
        problem.linearize(estimate)
        problem.whiten()
        return problem

    gram, gradient = make_problem(0).normal_equations(weights)
    dense_problem = make_problem(1000)
    dense_gram, _ = dense_problem.normal_equations(weights)
    np.testing.assert_allclose(
        gram, dense_gram, rtol=1e-9, atol=1e-9 * np.abs(dense_gram).max()
    )
    # Products with the residual are half the fall of the squares with each parameter.
    scale = np.sqrt(np.diag(gram))
    steps = 1e-4 * np.diag(plausible / scale)
    decreases = differentiate_squares(dense_problem, weights, model, estimate, steps)
    np.testing.assert_allclose(
        decreases / 1e-4 * scale, gradient, atol=1e-5 * np.abs(gradient).max()
    )


@dataclass(frozen=True)
class WeightedProblem:
    """A linear problem of the gantry with weighted observations, written out.

    Attributes
    ----------
    error : ndarray (S, 3)
        Measured minus commanded positions, m.
    design : ndarray (S, 3, P)
    weights : ndarray (S,)
    inverse : ndarray (3 S, 3 S)
        Inverse of the covariance of the positions.
    """

    error: np.ndarray
    design: np.ndarray
    weights: np.ndarray
    inverse: np.ndarray

    @property
    def root_weights(self):
        return np.repeat(np.sqrt(self.weights), 3)

    def weigh_columns(self, plausible):
        """Weighted design in plausible sizes, ndarray (3 S, P)."""
        design = self.design.reshape(3 * len(self.error), -1)
        return self.root_weights[:, None] * design * plausible

    def weigh_residual(self, estimate):
        """Weighted residual of an estimate, ndarray (3 S,)."""
        residual = self.error - self.design @ estimate.coefficients[0]
        return self.root_weights * residual.ravel()

    def compute_squares(self, estimate):
        """Weighted and whitened sum of squares of an estimate."""
        residual = self.weigh_residual(estimate)
        return residual @ self.inverse @ residual

    def compute_distances(self, estimate):
        """Distance of each state by the covariance of this state alone, ndarray
        (S,)."""
        distances = []
        for state, error in enumerate(self.error):
            rows = slice(3 * state, 3 * state + 3)
            residual = error - self.design[state] @ estimate.coefficients[0]
            squares = residual @ self.inverse[rows, rows] @ residual
            distances.append(np.sqrt(squares / 3))
        return np.array(distances)


def write_out_problem(states, noise):
    """Draw errors and weights of the states, and write the linear problem out."""
    rng = np.random.default_rng(98)
    error = 1e-4 * rng.standard_normal((20, 3))
    weights = rng.uniform(0.2, 1.0, 20)
    return WeightedProblem(
        error,
        evaluate_waves(states.joint_angles, 3),
        weights,
        np.linalg.inv(compute_gantry_covariance(states, noise)),
    )


@pytest.mark.parametrize("poses_at_once", [None, 7])
@pytest.mark.parametrize("kind", GANTRY_NOISES)
def test_normal_equations_of_a_linear_problem_are_those_written_out(
    kind, poses_at_once, monkeypatch
):
    """Weights apply before the rows are whitened. The result is the same in blocks of
    whole poses as in one block."""
    if poses_at_once:
        monkeypatch.setattr(
            "elastocal.fitting.observations._MAX_SENSITIVITIES", 3 * 60 * poses_at_once
        )
    noise = GANTRY_NOISES[kind]
    states = make_gantry_states(20, 8)
    expected = write_out_problem(states, noise)
    observations = observe_with_errors(states, expected.error)
    plausible = np.array([0.1, 2.0, 0.5])
    model = make_gantry_model(make_linear_law(3))
    estimate = replace(
        make_estimate(model), coefficients=(np.array([1e-4, -2e-4, 3e-5]),)
    )
    problem = LeastSquaresProblem(model, observations, noise, estimate, plausible)
    blocks = len(problem.blocks)
    assert blocks == 1 if poses_at_once is None else blocks > 2
    problem.linearize(estimate)
    problem.whiten()
    gram, gradient = problem.normal_equations(expected.weights)
    columns = expected.weigh_columns(plausible)
    np.testing.assert_allclose(gram, columns.T @ expected.inverse @ columns, rtol=1e-9)
    np.testing.assert_allclose(
        gradient,
        columns.T @ expected.inverse @ expected.weigh_residual(estimate),
        rtol=1e-7,
    )
    assert problem.squares(expected.weights) == pytest.approx(
        expected.compute_squares(estimate), rel=1e-7
    )
    trial = replace(estimate, coefficients=(np.array([0.0, 1e-4, 0.0]),))
    assert problem.squares(expected.weights, trial) == pytest.approx(
        expected.compute_squares(trial), rel=1e-7
    )
    if kind != "poses":
        # Without an error of the pose every state is whitened by itself.
        np.testing.assert_allclose(
            problem.distance(), expected.compute_distances(estimate), rtol=1e-7
        )


def test_squares_of_a_trial_estimate_are_whitened_in_the_axes_of_the_current_estimate(
    fanuc,
):
    model = build_model(fanuc, targets=TARGETS)
    estimate = make_estimate(model, seed=3)
    observations = add_noise(
        observe_exactly(model, estimate, make_states(6, 9, seed=4)),
        np.random.default_rng(5),
    )
    problem = LeastSquaresProblem(
        model, observations, JOINT_NOISE, estimate, np.ones(12)
    )
    problem.linearize(estimate)
    problem.whiten()
    (block,) = problem.blocks
    step = np.array([0, 0, 0, 0.3, -0.2, 0.1, *[0.0] * 6])
    trial = apply_step(model, estimate, step)
    conditions = evaluate_conditions(model, trial, observations.states)
    residual = compute_residuals(model, trial, observations, conditions)
    in_current_axes = residual @ trial.frame_rotation[0].T @ estimate.frame_rotation[0]
    whitening = compute_whitening(observations, block.joint_jacobian, JOINT_NOISE)
    expected = (whitening.apply(in_current_axes) ** 2).sum()
    squares = problem.squares(np.ones(len(observations)), trial)
    assert squares == pytest.approx(expected, rel=1e-6)
    in_trial_axes = (block.whitening.apply(residual) ** 2).sum()
    assert squares != pytest.approx(in_trial_axes, rel=1e-3)
