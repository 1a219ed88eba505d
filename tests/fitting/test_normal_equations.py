"""Normal equations: whitened by a dense factor, by differences, in closed form; what
cannot be told is held and named."""

from dataclasses import replace

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


def solved(
    left, right, plausible, *, frozen=False, penalty=0.0, present=0.0, nonlinear=False
):
    """Solve the normal equations of whitened sensitivities and residual.

    Returns the step, the covariance, and which parameters are unidentifiable.
    """
    scaled = left * plausible
    frozen, penalty, present, nonlinear = (
        np.broadcast_to(values, len(plausible))
        for values in (frozen, penalty, present, nonlinear)
    )
    solution = solve_normal_equations(
        scaled.T @ scaled,
        scaled.T @ right,
        ParameterScales(plausible, penalty, nonlinear),
        present,
        frozen,
    )
    return solution.step, solution.covariance, solution.unidentifiable


def test_solution_with_a_prior_is_that_of_numpy_with_a_row_for_each_prior():
    rng = np.random.default_rng(45)
    left = 10 * rng.standard_normal((8, 6))
    right = rng.standard_normal(8)
    present = rng.standard_normal(6)
    penalty = np.array([0.0, 0.0, 4.0, 9.0, 25.0, 1.0])
    root = np.diag(np.sqrt(penalty))
    rows = np.concatenate([left, root])
    ends = np.concatenate([right, -root @ present])
    step, covariance, held = solved(
        left, right, np.full(6, 2.0), penalty=penalty, present=present
    )
    np.testing.assert_allclose(step, np.linalg.lstsq(rows, ends)[0], rtol=1e-9)
    np.testing.assert_allclose(
        covariance, np.linalg.inv(rows.T @ rows), rtol=1e-9, atol=1e-15
    )
    assert not held.any()


def informed(*covariance):
    """Information whose inverse is a covariance, in plausible sizes."""
    return np.linalg.inv(np.array(covariance))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("correlation", "kept"), [(0.49, [False, True]), (0.51, [True, False])]
)
def test_a_shape_is_given_up_for_another_from_a_correlation_of_a_half_on(
    correlation, kept, sign
):
    """Of either sign. The other has a standard error of 1.05 beside the shape, and is
    told without it."""
    shared = sign * correlation * 1.05 * 0.5
    gram = informed([1.05**2, shared], [shared, 0.5**2])
    assert 1 / np.sqrt(gram[0, 0]) < 1.0
    np.testing.assert_array_equal(
        find_identifiable_parameters(gram, np.zeros(2, bool), np.array([False, True]))[
            0
        ],
        kept,
    )


@pytest.mark.parametrize(("error", "kept"), [(0.999, True), (1.001, False)])
@pytest.mark.parametrize("beside", [0.0, 0.6])
def test_a_standard_error_of_the_plausible_size_is_the_largest_that_is_estimated(
    error, kept, beside
):
    """Alone as beside another parameter that is known better."""
    gram = informed([0.01, 0.1 * error * beside], [0.1 * error * beside, error**2])
    np.testing.assert_array_equal(
        find_identifiable_parameters(gram, np.zeros(2, bool), np.zeros(2, bool))[0],
        [True, kept],
    )


@pytest.mark.parametrize(
    ("key", "held"),
    [
        ("joint_offset@1", ["joint_offset@1 offset"]),
        # To positions of one target, a turn of the last joint is a shift of the target.
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
def test_what_the_frame_or_the_target_makes_as_well_is_held_and_named(fanuc, key, held):
    model = build_model(fanuc, key, "joint_offset@3")
    true = make_estimate(model, seed=13)
    seen = add_noise(
        observe_exactly(model, true, make_states(6, 40, seed=14)),
        np.random.default_rng(15),
    )
    found = fit_model(model, seen, NOISE)
    assert list_held_parameters(found) == held
    assert not found.estimate.coefficients[0].any()
    assert (
        not found.covariance[found.unidentifiable].any()
        and not found.covariance[:, found.unidentifiable].any()
    )
    # It is not shrunk towards zero by a penalty: without it the fit is the very same.
    without = fit_model(build_model(fanuc, "joint_offset@3"), seen, NOISE)
    np.testing.assert_allclose(
        found.estimate.coefficients[1], without.estimate.coefficients[0], rtol=1e-9
    )
    np.testing.assert_allclose(
        found.covariance[~found.unidentifiable][:, ~found.unidentifiable],
        without.covariance,
        rtol=1e-6,
        atol=1e-22,
    )


@pytest.mark.parametrize("off", [-2.0, 0.0, 2.0])
def test_a_prior_of_the_plausible_size_alone_identifies_nothing_however_it_rounds(off):
    gram = np.diag([50.0, 1.0 + off * np.finfo(float).eps, 3.0])
    none = np.zeros(3, bool)
    np.testing.assert_array_equal(
        find_identifiable_parameters(gram, none, none)[0], [True, False, True]
    )


def test_kept_are_those_of_one_pivot_after_the_other_where_ranks_are_deficient():
    rng = np.random.default_rng(48)
    given_up = 0
    for _ in range(200):
        size = int(rng.integers(2, 12))
        left = rng.standard_normal(
            (int(rng.integers(1, size + 4)), size)
        ) * 10.0 ** rng.uniform(-1, 3, size)
        gram = left.T @ left
        kept = []
        for number in range(size):
            before = gram[kept, number]
            rest = gram[number, number] - before @ np.linalg.solve(
                gram[np.ix_(kept, kept)], before
            )
            if rest > max(1.0, 1e-11 * gram[number, number]):
                kept.append(number)
        none = np.zeros(size, bool)
        found = np.flatnonzero(
            find_identifiable_parameters(gram, none, none)[0]
        ).tolist()
        # Those that come later may take what told their predecessors.
        assert set(found) <= set(kept)
        if (np.diag(np.linalg.inv(gram[np.ix_(kept, kept)])) <= 1.0).all():
            assert found == kept
            given_up += len(kept) < size
    assert given_up > 20


THREE = tuple(
    Target(name, point, (0.1, 0.05, 0.0))
    for name, point in (("A", "6DoF"), ("B", "3DoF"), ("C", "2DoF"))
)

OF_JOINTS = Noise("repeats", 60e-6, 40e-6, 1e-6 * np.array([30.0, 40, 50, 60, 70, 0]))


@pytest.fixture(params=[3, 6], ids=["positions", "poses"])
def case(request, fanuc):
    """Observations of one to three targets a state, averaged over one to four repeats,
    and their Jacobian."""
    model = make_model(fanuc.chain, THREE, request.param, fitted_frames=False)
    states = make_states(6, 7, seed=1)
    states.repeats[:] = [1, 4, 2, 3, 1, 2, 4]
    whole = observe_exactly(model, make_estimate(model), states)
    kept = np.array([0, 1, 2, 4, 6, 7, 8, 9, 12, 13, 14, 17, 18, 19, 20])
    rotation = None if whole.rotation is None else whole.rotation[kept]
    seen = Observations(
        states, whole.state[kept], whole.target[kept], whole.position[kept], rotation
    )
    estimate = make_estimate(model)
    jacobian = linearize(
        model, estimate, seen, evaluate_conditions(model, estimate, states)
    ).coordinate_jacobian[..., :6]
    return seen, jacobian


def dense_covariance(seen, jacobian, noise):
    """Covariance of all rows, written out from what the noise means."""
    rows = seen.rows
    joints = jacobian.reshape(-1, 6) * noise.joint_rad
    common = jacobian.reshape(-1, 6) * noise.pose_rad
    state = np.repeat(seen.state, rows)
    pose = np.repeat(seen.cluster, rows)
    sensor = np.tile(
        ([noise.position_m] * 3 + [noise.orientation_rad] * 3)[:rows], len(seen)
    )
    one = (joints @ joints.T) * (state[:, None] == state) + np.diag(sensor**2)
    # What a pose has in common no repeat averages.
    return one / seen.states.repeats[state] + (common @ common.T) * (
        pose[:, None] == pose
    )


@pytest.mark.parametrize("pose_rad", [0.0, 2e-5, 1e-3])
def test_whitened_rows_are_those_of_a_dense_cholesky_factor(case, pose_rad):
    """Poses of one state and of three, which share an error of the joints where there
    is one."""
    seen, jacobian = case
    seen = replace(
        seen, states=replace(seen.states, pose=np.array([0, 1, 1, 1, 2, 2, 3]))
    )
    noise = replace(OF_JOINTS, pose_rad=pose_rad)
    covariance = dense_covariance(seen, jacobian, noise)
    values = np.random.default_rng(2).standard_normal((len(seen), seen.rows, 5))
    found = compute_whitening(seen, jacobian, noise).apply(values).reshape(-1, 5)
    # A factor of a covariance is unique but for the order of its rows: what is whitened
    # has the same products.
    expected = values.reshape(-1, 5).T @ np.linalg.solve(
        covariance, values.reshape(-1, 5)
    )
    np.testing.assert_allclose(
        found.T @ found, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max()
    )
    identity = np.eye(len(covariance)).reshape(len(seen), seen.rows, -1)
    factor = (
        compute_whitening(seen, jacobian, noise)
        .apply(identity)
        .reshape(covariance.shape)
    )
    np.testing.assert_allclose(
        factor @ covariance @ factor.T, np.eye(len(covariance)), atol=1e-7
    )


@pytest.mark.parametrize("pose_rad", [0.0, 3e-5])
@pytest.mark.parametrize("offset", [None, (0.0, 0.0, 0.1)])
def test_products_by_factors_are_those_of_the_columns_written_out(
    fanuc, offset, pose_rad, monkeypatch
):
    """Targets that are fitted and that are known; errors of a state alone, and of a
    pose that has several."""
    targets = tuple(replace(target, offset_m=offset) for target in TARGETS)
    model = build_model(
        fanuc,
        "joint_offset@2",
        "lost_motion@3",
        "link_geometry@3",
        targets=targets,
        rows=6,
    )
    states = replace(
        make_states(6, 12, seed=88), pose=np.arange(12) // 3, load=np.arange(12) % 3
    )
    estimate = make_estimate(model, seed=87)
    seen = add_noise(
        observe_exactly(model, estimate, states), np.random.default_rng(89)
    )
    joints = 1e-6 * np.array([40.0, 15, 15, 30, 45, 220])
    noise = Noise("declared", 5e-6, 1e-5, joints, pose_rad=pose_rad)
    plausible = np.array(
        [parameter.plausible for _, parameter in list_parameters(model, estimate)]
    )
    weights = np.random.default_rng(90).uniform(0.3, 1.0, len(seen))
    found = []
    for fewest in (0, 1000):
        monkeypatch.setattr(
            "elastocal.fitting.normal_equations._COLUMNS_PER_COORDINATE", fewest
        )
        measurements = LeastSquaresProblem(model, seen, noise, estimate, plausible)
        measurements.linearize(estimate)
        measurements.whiten()
        found.append(measurements.normal_equations(weights))
    (gram, along), (written_out, _) = found
    np.testing.assert_allclose(
        gram, written_out, rtol=1e-9, atol=1e-9 * np.abs(written_out).max()
    )
    # Products with the residual are half of what the squares fall by with each
    # parameter.
    steps = 1e-4 * np.diag(plausible / np.sqrt(np.diag(gram)))
    ends = [
        [
            measurements.squares(weights, apply_step(model, estimate, way * step))
            for way in (-1, 1)
        ]
        for step in steps
    ]
    slopes = -np.diff(ends, axis=1)[:, 0] / 4e-4 * np.sqrt(np.diag(gram))
    np.testing.assert_allclose(slopes, along, atol=1e-5 * np.abs(along).max())


@pytest.mark.parametrize("at_once", [None, 7])
@pytest.mark.parametrize("kind", GANTRY_NOISES)
def test_normal_equations_of_a_linear_problem_are_those_written_out(
    kind, at_once, monkeypatch
):
    """Weights come before the covariance is divided out; in parts of whole poses as in
    one."""
    if at_once:
        monkeypatch.setattr(
            "elastocal.fitting.observations._MAX_SENSITIVITIES", 3 * 60 * at_once
        )
    noise = GANTRY_NOISES[kind]
    states = make_gantry_states(20, 8)
    plausible = np.array([0.1, 2.0, 0.5])
    rng = np.random.default_rng(98)
    left = evaluate_waves(states.joint_angles, 3)
    off = 1e-4 * rng.standard_normal((20, 3))
    weights = rng.uniform(0.2, 1.0, 20)
    model = make_gantry_model(make_linear_law(3))
    seen = observe_with_errors(states, off)
    estimate = replace(
        make_estimate(model), coefficients=(np.array([1e-4, -2e-4, 3e-5]),)
    )
    parts = LeastSquaresProblem(model, seen, noise, estimate, plausible)
    assert len(parts.blocks) == 1 if at_once is None else len(parts.blocks) > 2
    parts.linearize(estimate)
    parts.whiten()
    residual = off - left @ estimate.coefficients[0]
    inverse = np.linalg.inv(compute_gantry_covariance(states, noise))
    root = np.repeat(np.sqrt(weights), 3)
    columns = root[:, None] * left.reshape(60, 3) * plausible
    gram, along = parts.normal_equations(weights)
    np.testing.assert_allclose(gram, columns.T @ inverse @ columns, rtol=1e-9)
    np.testing.assert_allclose(
        along, columns.T @ inverse @ (root * residual.ravel()), rtol=1e-7
    )
    assert parts.squares(weights) == pytest.approx(
        (root * residual.ravel()) @ inverse @ (root * residual.ravel()), rel=1e-7
    )
    there = replace(estimate, coefficients=(np.array([0.0, 1e-4, 0.0]),))
    moved = root * (off - left @ there.coefficients[0]).ravel()
    assert parts.squares(weights, there) == pytest.approx(
        moved @ inverse @ moved, rel=1e-7
    )
    if kind != "poses":
        # Without an error of the pose every state is whitened by itself: its squares
        # are those of its own covariance.
        blocks = [inverse[3 * n : 3 * n + 3, 3 * n : 3 * n + 3] for n in range(20)]
        expected = [
            np.sqrt(row @ block @ row / 3)
            for row, block in zip(residual, blocks, strict=True)
        ]
        np.testing.assert_allclose(parts.distance(), expected, rtol=1e-7)


def test_squares_of_another_estimate_are_whitened_in_the_axes_in_which_the_step_began(
    fanuc,
):
    model = build_model(fanuc, targets=TARGETS)
    estimate = make_estimate(model, seed=3)
    seen = add_noise(
        observe_exactly(model, estimate, make_states(6, 9, seed=4)),
        np.random.default_rng(5),
    )
    parts = LeastSquaresProblem(model, seen, OF_JOINTS, estimate, np.ones(12))
    parts.linearize(estimate)
    parts.whiten()
    there = apply_step(model, estimate, np.array([0, 0, 0, 0.3, -0.2, 0.1, *[0.0] * 6]))
    residual = compute_residuals(
        model, there, seen, evaluate_conditions(model, there, seen.states)
    )
    turned = residual @ there.frame_rotation[0].T @ estimate.frame_rotation[0]
    expected = (
        compute_whitening(seen, parts.blocks[0].joint_jacobian, OF_JOINTS).apply(turned)
        ** 2
    ).sum()
    assert parts.squares(np.ones(len(seen)), there) == pytest.approx(expected, rel=1e-6)
    assert parts.squares(np.ones(len(seen)), there) != pytest.approx(
        (parts.blocks[0].whitening.apply(residual) ** 2).sum(), rel=1e-3
    )
