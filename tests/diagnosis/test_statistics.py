"""Sufficient statistics: dense generalized least squares with the covariance written
out, and measurements drawn one by one."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import made_rows

from elastocal.diagnosis import statistics
from elastocal.diagnosis.statistics import compute_statistics

TAU = np.array([0.0, 0.1, 0.7, 5.0])
CASES = {
    "poses of unequal size": {},
    "priors that matter": {"prior": 0.3},
    "one measurement a pose": {"size": (1, 3), "poses": 20},
    "nothing but a prior on some": {"declared": 9, "prior": 1.0, "poses": 3},
}


def dense(rows, tau):
    """W'MW, W'My, y'My and -1/2 ln |V|, with the declared parameters integrated over
    their prior: V = Sigma + X P X'."""
    marginal = rows.marginal_covariance(tau)
    y = rows.residual - rows.expected
    inverse = np.linalg.inv(marginal)
    return (
        rows.candidates.T @ inverse @ rows.candidates,
        rows.candidates.T @ inverse @ y,
        y @ inverse @ y,
        -0.5 * np.linalg.slogdet(marginal)[1],
    )


@pytest.mark.parametrize(
    ("at_once", "columns_a_row"), [(1, 4), (40, 4), (40, 0), (10**6, 0)]
)
@pytest.mark.parametrize("case", CASES)
def test_statistics_are_those_of_dense_generalized_least_squares(
    case, at_once, columns_a_row, monkeypatch
):
    """However many poses are looked at in one go, and whether what they take is kept
    beside the products."""
    monkeypatch.setattr(statistics, "_AT_ONCE", at_once)
    monkeypatch.setattr(statistics, "_COLUMNS_A_ROW", columns_a_row)
    rows = made_rows(1, **CASES[case])
    found = compute_statistics(rows.products, TAU)
    gram, along, squares, logs = (
        np.array(part) for part in zip(*(dense(rows, tau) for tau in TAU), strict=True)
    )
    every = np.arange(gram.shape[1])
    assert len(found.gram) == (len(TAU) if columns_a_row else 1)
    for between in (
        found.gram_rows(every),
        found.gram_blocks(every),
        found.at([1, 3]).gram_rows(every[:2]),
    ):
        expected = gram if len(between) == len(gram) else gram[[1, 3], :2]
        np.testing.assert_allclose(
            between, expected, rtol=1e-9, atol=1e-9 * np.abs(gram).max()
        )
    np.testing.assert_allclose(
        found.score, along, rtol=1e-9, atol=1e-9 * np.abs(along).max()
    )
    np.testing.assert_allclose(found.residual_squares, squares, rtol=1e-9)
    # Up to a constant that does not depend on tau.
    np.testing.assert_allclose(
        np.diff(found.log_likelihood), np.diff(logs), rtol=1e-9, atol=1e-9
    )


def _orthonormal(columns):
    """Gram-Schmidt, twice, in extended precision."""
    basis = []
    for column in columns.T.astype(np.longdouble):
        for _ in range(2):
            for known in basis:
                column = column - (known @ column) * known
        basis.append(column / np.sqrt(column @ column))
    return np.array(basis).T


def test_badly_scaled_and_nearly_collinear_columns_cost_no_precision():
    """Declared columns of sizes from 1e-8 to 1e6, two of them alike to 1e-6, and
    candidates that they nearly are."""
    rng = np.random.default_rng(4)
    rows = made_rows(4, declared=4, candidates=3)
    X = rows.declared.copy()
    X[:, 1] = X[:, 0] + 1e-6 * X[:, 1]
    own = rng.standard_normal((len(X), 3))
    rows = replace(
        rows,
        declared=X * [1e-8, 1e-8, 1e6, 1.0],
        prior_std=np.array([1e12, 1e12, 1e-2, 1e4]),
        candidates=X @ rng.standard_normal((4, 3)) + 1e-3 * own,
    )
    found = compute_statistics(rows.products, [0.0])
    augmented = np.concatenate([rows.declared, np.diag(1 / rows.prior_std)]).astype(
        np.longdouble
    )
    basis = _orthonormal(augmented / np.linalg.norm(augmented.astype(float), axis=0))
    rest = np.zeros((len(augmented), 4), np.longdouble)
    rest[: len(X), :3] = rows.candidates
    rest[: len(X), 3] = rows.residual
    rest[len(X) :, 3] = -rows.present / rows.prior_std
    for _ in range(2):
        rest = rest - basis @ (basis.T @ rest)
    exact = (rest.T @ rest).astype(float)
    # Forming the normal equations would leave 1e-4 of it: the square of one over the
    # collinearity times the rounding.
    np.testing.assert_allclose(
        found.gram[0], exact[:3, :3], rtol=1e-7, atol=1e-7 * np.abs(exact[:3, :3]).max()
    )
    np.testing.assert_allclose(
        found.score[0], exact[:3, 3], rtol=1e-7, atol=1e-7 * np.abs(exact[:3, 3]).max()
    )
    np.testing.assert_allclose(found.residual_squares[0], exact[3, 3], rtol=1e-9)
