"""The best few of many candidates: greedy choice, then Fedorov's exchange [1].

[1] Fedorov, V. V., Theory of Optimal Experiments, Academic Press, 1972.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from elastocal.application.planning.criteria import Criterion

# Candidates for which the exchange looks: those that add most at the end of the greedy choice.
_SHORT_LIST = 400
# Rounds of exchange: most designs settle in two or three.
_ROUNDS = 4
# An exchange that gains less than this share is rounding.
_LEAST_GAIN = 1e-6
# What a sum of thousands of products in double precision is known to, over the sum.
_ROUNDING = 1e-12


def add_prior(sums: np.ndarray) -> np.ndarray:
    """Sums of products, ndarray (..., P, P), plus I: in place, and positive definite whatever their size.

    Where rounding has lost more than the 1, a diagonal element grows by what rounding may have lost.
    """
    here = np.arange(sums.shape[-1])
    sums[..., here, here] += np.maximum(1.0, _ROUNDING * sums[..., here, here])
    return sums


def matrix_of(rows: np.ndarray, chosen: np.ndarray | list[int]) -> np.ndarray:
    """Information matrix of some candidates with the prior, ndarray (P, P), in double precision."""
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


def exchange_candidates(rows: np.ndarray, chosen: list[int], criterion: Criterion) -> list[int]:
    """A design in which no single candidate of a short list would be better than one that is in it.

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
