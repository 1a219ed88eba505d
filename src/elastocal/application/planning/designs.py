"""Optimal designs: the best few of many candidates by a criterion.

With M the information matrix in units of the plausible sizes, which a prior of one
plausible size each makes I without any measurement (Bayesian designs [1], for which no
parameter need be identifiable), a candidate with rows Z makes it M + Z' Z, and

- D: log det M grows by log det (I + Z M^-1 Z'), by the matrix determinant lemma;
- A and I: tr C M^-1 falls by tr (I + Z M^-1 Z')^-1 Z M^-1 C M^-1 Z', by Woodbury's identity; C is the identity over the number
  of parameters for A, and for I the mean of G' G over where the robot shall be accurate, G the sensitivities there.

Chosen is greedily, then by Fedorov's exchange [2].

[1] Chaloner, K. and Verdinelli, I., Bayesian experimental design: a review, Statistical
Science 10, 1995. [2] Fedorov, V. V., Theory of Optimal Experiments, Academic Press,
1972.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CRITERIA = ("D", "A", "I")
# Candidates whose small matrices are in memory at a time.
_AT_ONCE = 1000
# Candidates for which the exchange looks: those that add most at the end of the greedy
# choice; and its rounds: most designs settle in two or three. An exchange that gains
# less than a share is rounding.
_SHORT_LIST = 400
_ROUNDS = 4
_LEAST_GAIN = 1e-6
# What a sum of thousands of products in double precision is known to, over the sum.
_ROUNDING = 1e-12


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
        """By how much the value grows with each candidate. `rows` (N, k, P), `matrix`
        (P, P). Returns (N,)."""
        return np.concatenate(
            [
                self._gains(part, matrix)
                for part in np.split(rows, range(_AT_ONCE, len(rows), _AT_ONCE))
            ]
        )

    def _gains(self, rows: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        inverse = np.linalg.inv(np.linalg.cholesky(matrix))
        # Double precision, in which the matrix is I: single precision loses the 1 of I
        # + Z Z' to an unknown base.
        white = (rows.reshape(-1, rows.shape[2]) @ inverse.T).reshape(rows.shape)
        inner = add_prior(white @ white.transpose(0, 2, 1))
        if self.weight is None:
            return np.linalg.slogdet(inner)[1]
        across = white @ (inverse @ self.weight @ inverse.T) @ white.transpose(0, 2, 1)
        return np.trace(np.linalg.solve(inner, across), axis1=1, axis2=2)


def build_criterion(kind: str, accuracy_rows: np.ndarray) -> Criterion:
    """One of `CRITERIA`, over sensitivities (N, 3, P) as by `plan.accuracy_rows`."""
    if kind == "D":
        return Criterion(None)
    return Criterion(
        np.eye(accuracy_rows.shape[2]) / accuracy_rows.shape[2]
        if kind == "A"
        else mean_squares(accuracy_rows)
    )


def mean_squares(rows: np.ndarray) -> np.ndarray:
    """Mean of G' G over N places, ndarray (P, P)."""
    flat = rows.reshape(-1, rows.shape[2])
    return flat.T @ flat / len(rows)


def add_prior(sums: np.ndarray) -> np.ndarray:
    """Sums of products, ndarray (..., P, P), plus I: in place, and positive definite
    whatever their size.

    Where rounding has lost more than the 1, a diagonal element grows by what rounding
    may have lost.
    """
    here = np.arange(sums.shape[-1])
    sums[..., here, here] += np.maximum(1.0, _ROUNDING * sums[..., here, here])
    return sums


def matrix_of(rows: np.ndarray, chosen: np.ndarray | list[int]) -> np.ndarray:
    """Information matrix of some candidates with the prior, ndarray (P, P), in double
    precision."""
    flat = rows[chosen].reshape(-1, rows.shape[2]).astype(float)
    return add_prior(flat.T @ flat)


def choose_greedily(rows: np.ndarray, count: int, criterion: Criterion) -> list[int]:
    """Candidates, each that which adds most to those before it. `rows` (N, k, P)."""
    chosen: list[int] = []
    for _ in range(count):
        gains = criterion.gains(rows, matrix_of(rows, chosen))
        gains[chosen] = -np.inf
        chosen.append(int(np.argmax(gains)))
    return chosen


def exchange_candidates(
    rows: np.ndarray, chosen: list[int], criterion: Criterion
) -> list[int]:
    """A design in which no single candidate of a short list would be better than one
    that is in it.

    `rows` (N, k, P). Returns in the place of each the one that took it.
    """
    found = list(chosen)
    gains = criterion.gains(rows, matrix_of(rows, found))
    short = np.union1d(np.argsort(-gains)[:_SHORT_LIST], found)
    for _ in range(_ROUNDS):
        before = list(found)
        for place, old in enumerate(before):
            rest = found[:place] + found[place + 1 :]
            gains = criterion.gains(rows[short], matrix_of(rows, rest))
            gains[np.isin(short, rest)] = -np.inf
            best = int(np.argmax(gains))
            if gains[best] > (1.0 + _LEAST_GAIN) * gains[np.searchsorted(short, old)]:
                found[place] = int(short[best])
        if found == before:
            break
    return found
