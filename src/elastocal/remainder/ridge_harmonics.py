"""Harmonics of each joint's angle as deviations of that joint, beside geometry, by ridge regression.

What gears, encoders and runout can do to a joint, without saying what: a Fourier series of every joint carried to the target by
the Jacobian, and constant displacements of base and links, which resemble each other; all coefficients with one penalty [1].

[1] Hoerl, A. E. and Kennard, R. W., Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12, 1970.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "ridge_harmonics", "ridge regression on harmonics of the joint angles"
# The penalty counts in mean squares of a column.
SETTINGS: Sequence[Setting] = tuple(
    {"orders": orders, "penalty": float(penalty)} for orders in (1, 2, 6, 12, 36) for penalty in np.logspace(-5.0, 3.0, 9)
)
# Observations whose columns are held at once.
_AT_ONCE = 2_000


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """Ridge regression for each number of orders and penalty; one decomposition serves all penalties.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`; nothing is drawn.
    """
    most, joints = max(setting["orders"] for setting in settings), inputs.joint_angles.shape[1]
    size = inputs.jacobian.shape[2] + 2 * most * joints
    gram, right = np.zeros((size, size)), np.zeros(size)
    for part in _parts(inputs):
        columns = _columns(inputs.select(part), most).reshape(-1, size)
        gram += columns.T @ columns
        right += columns.T @ residual[part].ravel()
    eigen: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for setting in settings:
        orders = setting["orders"]
        # Orders come first among the harmonics, so that fewer of them are the first columns.
        size = inputs.jacobian.shape[2] + 2 * orders * joints
        if orders not in eigen:
            eigen[orders] = np.linalg.eigh(gram[:size, :size])
        values, vectors = eigen[orders]
        shrunk = np.maximum(values, 0.0) + setting["penalty"] * max(values.mean(), np.finfo(float).tiny)
        yield partial(_predicted, coefficients=vectors @ (vectors.T @ right[:size] / shrunk), orders=orders)


def _predicted(inputs: Inputs, coefficients: np.ndarray, orders: int) -> Prediction:
    return Prediction(np.concatenate([_columns(inputs.select(part), orders) @ coefficients for part in _parts(inputs)]))


def _parts(inputs: Inputs) -> list[slice]:
    return [slice(first, first + _AT_ONCE) for first in range(0, len(inputs), _AT_ONCE)]


def _columns(inputs: Inputs, orders: int) -> np.ndarray:
    return np.concatenate([inputs.jacobian, by_harmonics(inputs, orders)], axis=2)


def by_harmonics(inputs: Inputs, orders: int) -> np.ndarray:
    """Displacement of the target by one radian of each harmonic, (M, 3, 2 n orders), lower orders first."""
    phase = np.arange(1, orders + 1)[:, None] * inputs.joint_angles[:, None, :]
    harmonics = np.stack([np.sin(phase), np.cos(phase)], axis=2)
    along = inputs.jacobian[:, :, None, None, : inputs.joint_angles.shape[1]]
    return (along * harmonics[:, None]).reshape(len(inputs), 3, -1)
