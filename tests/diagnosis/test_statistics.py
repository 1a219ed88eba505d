"""Sufficient statistics are those of dense generalized least squares with the
covariance written out."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import make_rows

from elastocal.diagnosis import statistics
from elastocal.diagnosis.statistics import (
    assemble_normal_equations,
    compute_statistics,
)

TAU = np.array([0.0, 0.1, 0.7, 5.0])
CASES = {
    "poses of unequal size": {},
    "priors that matter": {"prior": 0.3},
    "one measurement a pose": {"size": (1, 3), "poses": 20},
    "nothing but a prior on some": {"declared": 9, "prior": 1.0, "poses": 3},
}


def dense_statistics(rows):
    """W'MW, W'My, y'My and -1/2 ln |V| at every tau, with the declared parameters
    integrated over their prior: V = Sigma + X P X'."""
    y = rows.residual - rows.expected
    grams = []
    scores = []
    squares = []
    log_likelihoods = []
    for tau in TAU:
        marginal = rows.marginal_covariance(tau)
        inverse = np.linalg.inv(marginal)
        grams.append(rows.candidates.T @ inverse @ rows.candidates)
        scores.append(rows.candidates.T @ inverse @ y)
        squares.append(y @ inverse @ y)
        log_likelihoods.append(-0.5 * np.linalg.slogdet(marginal)[1])
    return tuple(map(np.array, (grams, scores, squares, log_likelihoods)))


def assert_close(values, expected, rtol=1e-9):
    """Equal to a relative tolerance of each value and of the largest one."""
    atol = rtol * np.abs(expected).max()
    np.testing.assert_allclose(values, expected, rtol=rtol, atol=atol)


@pytest.mark.parametrize(
    ("at_once", "columns_a_row"), [(1, 4), (40, 4), (40, 0), (10**6, 0)]
)
@pytest.mark.parametrize("case", CASES)
def test_statistics_are_those_of_dense_generalized_least_squares(
    case, at_once, columns_a_row, monkeypatch
):
    """However many poses are in memory at once, and whether the correction for the pose
    error is dense or in factors."""
    monkeypatch.setattr(statistics, "_AT_ONCE", at_once)
    monkeypatch.setattr(statistics, "_COLUMNS_A_ROW", columns_a_row)
    rows = make_rows(1, **CASES[case])
    computed = compute_statistics(rows.products, TAU)
    gram, score, squares, log_likelihood = dense_statistics(rows)
    columns = np.arange(gram.shape[1])
    assert len(computed.gram) == (len(TAU) if columns_a_row else 1)
    scale = 1e-9 * np.abs(gram).max()
    for blocks, expected in (
        (computed.gram_rows(columns, columns), gram),
        (computed.gram_blocks(columns), gram),
        (computed.at([1, 3]).gram_rows(columns[:2], columns[1:]), gram[[1, 3], :2, 1:]),
    ):
        np.testing.assert_allclose(blocks, expected, rtol=1e-9, atol=scale)
    assert_close(computed.score, score)
    np.testing.assert_allclose(computed.residual_squares, squares, rtol=1e-9)
    # Up to a constant that does not depend on tau.
    np.testing.assert_allclose(
        np.diff(computed.log_likelihood), np.diff(log_likelihood), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize("columns_a_row", [4, 0])
def test_normal_equations_need_no_rows_at_a_pose_error_that_was_met(
    columns_a_row, monkeypatch
):
    """They are the same as those that are computed from the rows."""
    monkeypatch.setattr(statistics, "_COLUMNS_A_ROW", columns_a_row)
    rows = make_rows(1)
    columns = np.array([0, 2, 3])
    products = rows.products
    compute_statistics(products, TAU)
    from_cache = assemble_normal_equations(products.without_rows, TAU[2], columns)
    from_rows = assemble_normal_equations(rows.products, TAU[2], columns)
    assert_close(from_cache, from_rows)


def orthonormalize(columns):
    """Gram-Schmidt, twice, in extended precision."""
    basis = []
    for column in columns.T.astype(np.longdouble):
        for _ in range(2):
            for direction in basis:
                column = column - (direction @ column) * direction
        basis.append(column / np.sqrt(column @ column))
    return np.array(basis).T


def badly_scaled_rows():
    """Declared columns of sizes from 1e-8 to 1e6, two of them equal to 1e-6, and
    candidates that they nearly span."""
    rng = np.random.default_rng(4)
    rows = make_rows(4, declared=4, candidates=3)
    X = rows.declared.copy()
    X[:, 1] = X[:, 0] + 1e-6 * X[:, 1]
    outside = rng.standard_normal((len(X), 3))
    return replace(
        rows,
        declared=X * [1e-8, 1e-8, 1e6, 1.0],
        prior_std=np.array([1e12, 1e12, 1e-2, 1e4]),
        candidates=X @ rng.standard_normal((4, 3)) + 1e-3 * outside,
    )


def test_badly_scaled_and_nearly_collinear_columns_cost_no_precision():
    rows = badly_scaled_rows()
    computed = compute_statistics(rows.products, [0.0])
    priors = np.diag(1 / rows.prior_std)
    augmented = np.concatenate([rows.declared, priors]).astype(np.longdouble)
    norms = np.linalg.norm(augmented.astype(float), axis=0)
    basis = orthonormalize(augmented / norms)
    count = len(rows.residual)
    remaining = np.zeros((len(augmented), 4), np.longdouble)
    remaining[:count, :3] = rows.candidates
    remaining[:count, 3] = rows.residual
    remaining[count:, 3] = -rows.present / rows.prior_std
    for _ in range(2):
        remaining = remaining - basis @ (basis.T @ remaining)
    exact = (remaining.T @ remaining).astype(float)
    # Forming the normal equations would leave an error of 1e-4: the rounding times the
    # square of one over the collinearity.
    assert_close(computed.gram[0], exact[:3, :3], rtol=1e-7)
    assert_close(computed.score[0], exact[:3, 3], rtol=1e-7)
    np.testing.assert_allclose(computed.residual_squares[0], exact[3, 3], rtol=1e-9)
