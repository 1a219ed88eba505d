"""Functions of two joints' angles at once as deviations of the joints, beside geometry: what no catalogue of one joint's has.

Ridge regression whose pair of joints and penalty have the largest marginal likelihood, with the noise profiled [1].

[1] MacKay, D. J. C., Bayesian interpolation, Neural Computation 4, 1992.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "two_joints", "ridge regression on functions of two joints' angles"
# Marginal likelihood chooses, from the same poses.
SETTINGS: Sequence[Setting] = ({},)
# In mean squares of a column.
_PENALTIES = np.logspace(-4.0, 2.0, 7)


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """Ridge regression for the most probable pair of joints.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`; nothing is drawn.
    """
    target, most = residual.ravel(), -np.inf
    for pair in combinations(range(inputs.joint_angles.shape[1]), 2):
        columns = _columns(inputs, pair).reshape(len(target), -1)
        gram, right = columns.T @ columns, columns.T @ target
        for penalty in _PENALTIES * max(np.diag(gram).mean(), np.finfo(float).tiny):
            lower, found, _ = lapack.dposv(gram + penalty * np.eye(len(right)), right, lower=1)
            left = max(target @ target - right @ found, np.finfo(float).tiny)
            probable = -len(target) * np.log(left) - np.log(np.diag(lower) ** 2 / penalty).sum()
            if probable > most:
                most, best, coefficients = probable, pair, found
    yield from ((lambda there: Prediction(_columns(there, best) @ coefficients)) for _ in settings)


def _columns(inputs: Inputs, pair: tuple[int, int]) -> np.ndarray:
    return np.concatenate([inputs.jacobian, of_two(inputs, pair, np.arange(inputs.joint_angles.shape[1]))], axis=2)


def of_two(inputs: Inputs, pair: tuple[int, int], moved: np.ndarray) -> np.ndarray:
    """What products of the first waves of two joints' angles, and the second of each, do as deviations of joints: (M, 3, D)."""
    angles = inputs.joint_angles[:, pair]
    first = np.stack([np.ones_like(angles), np.sin(angles), np.cos(angles)], axis=1)
    products = (first[:, :, None, 0] * first[:, None, :, 1]).reshape(len(inputs), -1)
    functions = np.hstack([products, np.sin(2.0 * angles), np.cos(2.0 * angles)])
    return (inputs.jacobian[:, :, moved, None] * functions[:, None, None]).reshape(len(inputs), 3, -1)
