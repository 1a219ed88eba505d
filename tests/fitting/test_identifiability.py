"""What cannot be told is held and named, and what can be told is the solution of numpy."""

import numpy as np
import pytest
from fitted_models import model_of, names_held
from synthetic import NOISE, made_estimate, made_states, seen_exactly, with_noise

from elastocal.fitting.least_squares import fit
from elastocal.fitting.normal_equations import identifiable, solve_normal


def solved(left, right, plausible, *given):
    """By the normal equations of whitened sensitivities and residual."""
    scaled = left * plausible
    return solve_normal(scaled.T @ scaled, scaled.T @ right, plausible, *given)


def test_solution_with_a_prior_is_that_of_numpy_with_a_row_for_each_prior():
    rng = np.random.default_rng(45)
    left, right, present = 10 * rng.standard_normal((8, 6)), rng.standard_normal(8), rng.standard_normal(6)
    penalty = np.array([0.0, 0.0, 4.0, 9.0, 25.0, 1.0])
    root = np.diag(np.sqrt(penalty))
    rows, ends = np.concatenate([left, root]), np.concatenate([right, -root @ present])
    step, covariance, held = solved(left, right, np.full(6, 2.0), False, penalty, present)
    np.testing.assert_allclose(step, np.linalg.lstsq(rows, ends)[0], rtol=1e-9)
    np.testing.assert_allclose(covariance, np.linalg.inv(rows.T @ rows), rtol=1e-9, atol=1e-15)
    assert not held.any()


def test_parameters_are_held_given_those_before_them():
    gram = 1e4 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(identifiable(gram, np.zeros(3, bool), np.zeros(3, bool)), [True, False, True])
    np.testing.assert_array_equal(identifiable(gram, np.array([True, False, False]), np.zeros(3, bool)), [False, True, True])


def informed(*covariance):
    """Information whose inverse is a covariance, in plausible sizes."""
    return np.linalg.inv(np.array(covariance))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("correlation", "kept"), [(0.49, [False, True]), (0.51, [True, False])])
def test_a_shape_is_given_up_for_another_from_a_correlation_of_a_half_on(correlation, kept, sign):
    """Of either sign. The other has a standard error of 1.05 beside the shape, and is told without it."""
    shared = sign * correlation * 1.05 * 0.5
    gram = informed([1.05**2, shared], [shared, 0.5**2])
    assert 1 / np.sqrt(gram[0, 0]) < 1.0
    np.testing.assert_array_equal(identifiable(gram, np.zeros(2, bool), np.array([False, True])), kept)


@pytest.mark.parametrize(("error", "kept"), [(0.999, True), (1.001, False)])
@pytest.mark.parametrize("beside", [0.0, 0.6])
def test_a_standard_error_of_the_plausible_size_is_the_largest_that_is_estimated(error, kept, beside):
    """Alone as beside another parameter that is known better."""
    gram = informed([0.01, 0.1 * error * beside], [0.1 * error * beside, error**2])
    np.testing.assert_array_equal(identifiable(gram, np.zeros(2, bool), np.zeros(2, bool)), [True, kept])


@pytest.mark.parametrize(("sizes", "kept"), [((0.7, 0.6, 1.0), [True, False, True]), ((0.6, 0.7, 1.0), [False, True, True])])
def test_what_is_told_worst_beside_all_others_goes_and_those_that_are_told_without_it_stay(sizes, kept):
    """The third column is the sum of the first two but for a little: each of these is told without the other alone."""
    left = np.linalg.qr(np.random.default_rng(46).standard_normal((40, 3)))[0]
    left = np.column_stack([100 * left[:, 0], 100 * left[:, 1], 100 * (left[:, 0] + left[:, 1]) + 1.25 * left[:, 2]]) * sizes
    gram = left.T @ left
    deviation = np.sqrt(np.diag(np.linalg.inv(gram)))
    np.testing.assert_allclose(deviation, 1 / (1.25 * np.array(sizes)), rtol=1e-3)
    np.testing.assert_array_equal(identifiable(gram, np.zeros(3, bool), np.zeros(3, bool)), kept)


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


def test_identified_compliance_and_force_scale_cannot_both_be_told(fanuc):
    model = model_of(fanuc, "force_scale", identified=True)
    true = made_estimate(model, seed=18)
    seen = with_noise(seen_exactly(model, true, made_states(6, 30, seed=19)), np.random.default_rng(20))
    assert names_held(fit(model, seen, NOISE)) == ["force_scale scale"]


@pytest.mark.parametrize("off", [-2.0, 0.0, 2.0])
def test_a_prior_of_the_plausible_size_alone_identifies_nothing_however_it_rounds(off):
    gram = np.diag([50.0, 1.0 + off * np.finfo(float).eps, 3.0])
    none = np.zeros(3, bool)
    np.testing.assert_array_equal(identifiable(gram, none, none), [True, False, True])


def test_kept_are_those_of_one_pivot_after_the_other_where_ranks_are_deficient():
    rng, given_up = np.random.default_rng(48), 0
    for _ in range(200):
        size = int(rng.integers(2, 12))
        left = rng.standard_normal((int(rng.integers(1, size + 4)), size)) * 10.0 ** rng.uniform(-1, 3, size)
        gram, kept = left.T @ left, []
        for number in range(size):
            before = gram[kept, number]
            rest = gram[number, number] - before @ np.linalg.solve(gram[np.ix_(kept, kept)], before)
            if rest > max(1.0, 1e-11 * gram[number, number]):
                kept.append(number)
        none = np.zeros(size, bool)
        found = np.flatnonzero(identifiable(gram, none, none)).tolist()
        # Those that come later may take what told their predecessors.
        assert set(found) <= set(kept)
        if (np.diag(np.linalg.inv(gram[np.ix_(kept, kept)])) <= 1.0).all():
            assert found == kept
            given_up += len(kept) < size
    assert given_up > 20
