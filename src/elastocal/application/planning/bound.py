"""How far a design is from the best that any weights on the candidates could be: the general equivalence theorem.

For a concave criterion f of M(w) = I + n sum w_i Z_i' Z_i no weights have more than f(M) + n max_i s_i - n sum w_i s_i, with
s_i the slope of f along candidate i: Kiefer and Wolfowitz's theorem [1] as a bound that holds for any w. The weights come from
the multiplicative algorithm [2].

[1] Kiefer, J. and Wolfowitz, J., The equivalence of two extremum problems, Canadian Journal of Mathematics 12, 1960.
[2] Silvey, S. D., Titterington, D. M. and Torsney, B., An algorithm for optimal designs on a finite design space,
    Communications in Statistics - Theory and Methods 7, 1978.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.exchange import add_prior, matrix_of

if TYPE_CHECKING:
    from elastocal.application.planning.criteria import Criterion

# Of the multiplicative algorithm; each raises the criterion.
_STEPS = 120
# Candidates on which weights are put, and how often those that break the bound join them.
_SUPPORT, _ROUNDS = 300, 2


def best_value(rows: np.ndarray, count: int, criterion: Criterion, chosen: list[int]) -> float:
    """A value of the criterion that no design of so many configurations exceeds.

    `rows` (N, k, P). `count`: configurations of the design, each as often as it likes. `chosen`: a good design, on which the
    weights start.
    """
    slopes = criterion.slopes(rows, matrix_of(rows, chosen))
    support = np.union1d(np.argsort(-slopes)[:_SUPPORT], chosen)
    bound = np.inf
    for _ in range(_ROUNDS):
        weights = _weights(rows[support], count, criterion)
        matrix = _matrix(rows[support], count * weights)
        slopes = criterion.slopes(rows, matrix)
        gap = count * (slopes.max() - weights @ slopes[support])
        bound = min(bound, criterion.value(matrix) + float(gap))
        support = np.union1d(support[weights > 1e-6], np.argsort(-slopes)[:_SUPPORT])
    return bound


def efficiency(criterion: Criterion, matrix: np.ndarray, bound: float) -> float:
    """Share of the best design's worth that a design is sure to have.

    `matrix` (P, P): of the design. `bound`: as by `best_value`. Returns D: by determinants, per parameter that the measurements
    tell more of than the prior; A, I: of variances.
    """
    if criterion.weight is None:
        learned = float(np.trace(np.eye(len(matrix)) - np.linalg.inv(matrix)))
        return float(np.exp((criterion.value(matrix) - bound) / learned))
    return bound / criterion.value(matrix)


def _weights(rows: np.ndarray, count: int, criterion: Criterion) -> np.ndarray:
    weights = np.full(len(rows), 1.0 / len(rows))
    for _ in range(_STEPS):
        slopes = criterion.slopes(rows, _matrix(rows, count * weights)).astype(float)
        # The exponent with which the algorithm rises monotonically: 1 for determinants, 1/2 for traces.
        weights = weights * (slopes if criterion.weight is None else np.sqrt(slopes))
        weights /= weights.sum()
    return weights


def _matrix(rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
    flat = (np.sqrt(weights)[:, None, None] * rows).reshape(-1, rows.shape[2]).astype(float)
    return add_prior(flat.T @ flat)
