"""Optimal designs: the best subset of many candidates by a criterion.

M is the information matrix in units of the plausible sizes of the parameters. Each
parameter has a prior of one plausible size, so M = I before any measurement (a Bayesian
design [1], in which not all parameters need to be identifiable). A candidate with rows Z
changes M to M + Z' Z, and

- D: log det M grows by log det (I + Z M^-1 Z'), by the matrix determinant lemma;
- A and I: tr C M^-1 falls by tr (I + Z M^-1 Z')^-1 Z M^-1 C M^-1 Z', by Woodbury's
  identity. C is I over the number of parameters for A, and for I the mean of G' G over
  the poses at which the robot should be accurate, with the sensitivities G there.

The choice is greedy, followed by Fedorov's exchange [2].

[1] Chaloner, K. and Verdinelli, I., Bayesian experimental design: a review, Statistical
Science 10, 1995.
[2] Fedorov, V. V., Theory of Optimal Experiments, Academic Press, 1972.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CRITERIA = ("D", "A", "I")
# Candidates whose small matrices are in memory at a time.
_CHUNK = 1000
# Candidates that the exchange considers: those with the largest gains at the end of the
# greedy choice.
_SHORT_LIST = 400
# Upper bound on the rounds of the exchange; most designs settle in two or three.
_ROUNDS = 4
# Relative improvement below which an exchange is rounding.
_SMALLEST_IMPROVEMENT = 1e-6
# Relative rounding error of a sum of thousands of products in double precision.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Criterion:
    """A criterion of optimality.

    Attributes
    ----------
    weight : (P, P) matrix C of the criteria A and I; None for D.
    """

    weight: np.ndarray | None

    def value(self, matrix: np.ndarray) -> float:
        """Value of an information matrix, log det M or -tr C M^-1; more is better."""
        if self.weight is None:
            return float(np.linalg.slogdet(matrix)[1])
        return -float(np.trace(np.linalg.solve(matrix, self.weight)))

    def gains(self, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        """Compute by how much the value grows with each candidate.

        Parameters
        ----------
        rows : (N, k, P) rows of the candidates.
        matrix : (P, P) information matrix.

        Returns
        -------
        (N,) gains.
        """
        chunks = np.split(rows, range(_CHUNK, len(rows), _CHUNK))
        return np.concatenate([self._compute_gains(chunk, matrix) for chunk in chunks])

    def _compute_gains(self, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        inverse_root = np.linalg.inv(np.linalg.cholesky(matrix))
        # Whiten in double precision: in single precision an unknown base would swamp the
        # 1 of I + Z Z'.
        flat = rows.reshape(-1, rows.shape[2])
        whitened = (flat @ inverse_root.T).reshape(rows.shape)
        transposed = whitened.transpose(0, 2, 1)
        inner = add_prior(whitened @ transposed)
        if self.weight is None:
            return np.linalg.slogdet(inner)[1]
        weight = inverse_root @ self.weight @ inverse_root.T
        weighted = whitened @ weight @ transposed
        return np.trace(np.linalg.solve(inner, weighted), axis1=1, axis2=2)


def build_criterion(kind: str, accuracy_rows: np.ndarray) -> Criterion:
    """Build one of `CRITERIA`.

    Parameters
    ----------
    kind : its letter.
    accuracy_rows : (N, 3, P) sensitivities as by `survey.compute_accuracy_rows`.
    """
    if kind == "D":
        return Criterion(None)
    if kind == "A":
        count = accuracy_rows.shape[2]
        return Criterion(np.eye(count) / count)
    return Criterion(compute_mean_gram(accuracy_rows))


def compute_mean_gram(rows: np.ndarray) -> np.ndarray:
    """Compute the mean of G' G over N sensitivity matrices (N, k, P), (P, P)."""
    flat = rows.reshape(-1, rows.shape[2])
    return flat.T @ flat / len(rows)


def add_prior(gram: np.ndarray) -> np.ndarray:
    """Add I to Gram matrices (..., P, P) in place, so that they are positive definite.

    If rounding errors are larger than 1, the diagonal element grows by their bound
    instead.
    """
    diagonal = np.arange(gram.shape[-1])
    values = gram[..., diagonal, diagonal]
    gram[..., diagonal, diagonal] += np.maximum(1.0, _ROUNDING * values)
    return gram


def compute_information_matrix(
    rows: np.ndarray, chosen: np.ndarray | list[int]
) -> np.ndarray:
    """Compute the information matrix (P, P) of chosen candidates and the prior, in
    double precision."""
    flat = rows[chosen].reshape(-1, rows.shape[2]).astype(float)
    return add_prior(flat.T @ flat)


def count_effective_parameters(
    rows: np.ndarray, chosen: np.ndarray | list[int]
) -> float:
    """Count the parameters that chosen candidates determine; one that its prior
    determines as well counts by the share that they add."""
    inverse = np.linalg.inv(compute_information_matrix(rows, chosen))
    return float(len(inverse) - np.trace(inverse))


def choose_greedily(rows: np.ndarray, count: int, criterion: Criterion) -> list[int]:
    """Choose candidates, each the one with the largest gain after those before it.

    Parameters
    ----------
    rows : (N, k, P) rows of the candidates.
    count : number of candidates to choose.
    criterion : defines the gain.
    """
    chosen: list[int] = []
    for _ in range(count):
        gains = criterion.gains(rows, compute_information_matrix(rows, chosen))
        gains[chosen] = -np.inf
        chosen.append(int(np.argmax(gains)))
    return chosen


def exchange_candidates(
    rows: np.ndarray, chosen: list[int], criterion: Criterion
) -> list[int]:
    """Exchange chosen candidates until no single one on a short list is better.

    Parameters
    ----------
    rows : (N, k, P) rows of the candidates.
    chosen : numbers of the chosen candidates.
    criterion : defines what is better.

    Returns
    -------
    The chosen candidates after the exchange, in their order.
    """
    design = list(chosen)
    gains = criterion.gains(rows, compute_information_matrix(rows, design))
    short_list = np.union1d(np.argsort(-gains)[:_SHORT_LIST], design)
    for _ in range(_ROUNDS):
        previous = list(design)
        for index, old in enumerate(previous):
            remaining = design[:index] + design[index + 1 :]
            matrix = compute_information_matrix(rows, remaining)
            gains = criterion.gains(rows[short_list], matrix)
            gains[np.isin(short_list, remaining)] = -np.inf
            best = int(np.argmax(gains))
            old_gain = gains[np.searchsorted(short_list, old)]
            if gains[best] > (1.0 + _SMALLEST_IMPROVEMENT) * old_gain:
                design[index] = int(short_list[best])
        if design == previous:
            break
    return design
