"""Criteria of optimal design, and what each candidate adds to a design.

With M the information matrix in units of the plausible sizes, which a prior of one plausible size each makes I without any
measurement (Bayesian designs [1], for which no parameter need be identifiable), a candidate with rows Z makes it M + Z' Z, and

- D: log det M grows by log det (I + Z M^-1 Z'), by the matrix determinant lemma;
- A and I: tr C M^-1 falls by tr (I + Z M^-1 Z')^-1 Z M^-1 C M^-1 Z', by Woodbury's identity; C is the identity over the number
  of parameters for A, and for I the mean of G' G over where the robot shall be accurate, G the sensitivities there.

[1] Chaloner, K. and Verdinelli, I., Bayesian experimental design: a review, Statistical Science 10, 1995.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elastocal.application.planning.exchange import add_prior

CRITERIA = ("D", "A", "I")
# Candidates whose small matrices are in memory at a time.
_AT_ONCE = 1000


@dataclass(frozen=True)
class Criterion:
    """What makes a design good. `weight` (P, P): C of A and I; None for D."""

    weight: np.ndarray | None

    def value(self, matrix: np.ndarray) -> float:
        """log det M, or -tr C M^-1: the larger the better."""
        if self.weight is None:
            return float(np.linalg.slogdet(matrix)[1])
        return -float(np.trace(np.linalg.solve(matrix, self.weight)))

    def gains(self, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        """By how much the value grows with each candidate. `rows` (N, k, P), `matrix` (P, P). Returns (N,)."""
        return np.concatenate([self._gains(part, matrix) for part in np.split(rows, range(_AT_ONCE, len(rows), _AT_ONCE))])

    def _gains(self, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        white = _whiten(rows, matrix)
        inner = add_prior(white @ white.transpose(0, 2, 1))
        if self.weight is None:
            return np.linalg.slogdet(inner)[1]
        across = white @ self._whiten_weight(matrix) @ white.transpose(0, 2, 1)
        return np.trace(np.linalg.solve(inner, across), axis1=1, axis2=2)

    def slopes(self, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        """Derivatives of the value by the weight of each candidate: tr M^-1 Z' Z, or tr M^-1 C M^-1 Z' Z; ndarray (N,)."""
        white = _whiten(rows, matrix)
        if self.weight is None:
            return (white**2).sum(axis=(1, 2))
        across = white @ self._whiten_weight(matrix)
        return (across * white).sum(axis=(1, 2))

    def _whiten_weight(self, matrix: np.ndarray) -> np.ndarray:
        assert self.weight is not None
        inverse = np.linalg.inv(np.linalg.cholesky(matrix))
        return inverse @ self.weight @ inverse.T


def criterion(kind: str, accuracy_rows: np.ndarray) -> Criterion:
    """One of `CRITERIA`.

    `kind`: one of "D", "A", "I". `accuracy_rows` (N, 3, P): as by `survey.accuracy_rows`.
    """
    if kind == "D":
        return Criterion(None)
    return Criterion(np.eye(accuracy_rows.shape[2]) / accuracy_rows.shape[2] if kind == "A" else mean_squares(accuracy_rows))


def mean_squares(rows: np.ndarray) -> np.ndarray:
    """Mean of G' G over N places, ndarray (P, P)."""
    flat = rows.reshape(-1, rows.shape[2])
    return flat.T @ flat / len(rows)


def _whiten(rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Rows in which the matrix is I, in double precision: single precision loses the 1 of I + Z Z' to an unknown base."""
    inverse = np.linalg.inv(np.linalg.cholesky(matrix))
    return (rows.reshape(-1, rows.shape[2]) @ inverse.T).reshape(rows.shape)
