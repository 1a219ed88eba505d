"""Harmonics of each joint's angle as deviations of that joint, by ridge regression.

What gears, encoders and runout can do to a joint, without saying what: a Fourier series of every joint carried to the target by
the Jacobian, all coefficients with one penalty [1]. What a displacement of base and links takes up may be fitted once more
beside them, as harmonics and geometry resemble each other; that has no penalty, so it is eliminated [2].

[1] Hoerl, A. E. and Kennard, R. W., Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12, 1970.
[2] Frisch, R. and Waugh, F. V., Partial time regressions as compared with individual trends, Econometrica 1, 1933.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "ridge_harmonics", "ridge regression on harmonics of the joint angles"
# The penalty counts in mean squares of a column.
SETTINGS: Sequence[Setting] = tuple(
    {"orders": orders, "penalty": float(penalty), "geometry": geometry}
    for geometry in (False, True)
    for orders in (1, 2, 6, 12, 36)
    for penalty in np.logspace(-5.0, 3.0, 9)
)
# Observations whose columns are held at once.
_AT_ONCE = 2_000
# Directions of geometry that the poses hardly show are left alone: share of the largest mean square.
_SEEN = 1e-9


class _Predictor:
    def __init__(self, coefficients: np.ndarray, geometry: np.ndarray, orders: int) -> None:
        self._coefficients, self._geometry, self._orders = coefficients, geometry, orders

    def __call__(self, inputs: Inputs) -> Prediction:
        parts = [
            by_harmonics(part, self._orders) @ self._coefficients + part.jacobian @ self._geometry for part in _parts(inputs)
        ]
        return Prediction(np.concatenate(parts))


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """Ridge regression for each number of orders and penalty; one decomposition serves all penalties.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`; nothing is drawn.
    """
    most, joints = max(setting["orders"] for setting in settings), inputs.joint_angles.shape[1]
    harmonics, coordinates = 2 * most * joints, inputs.jacobian.shape[2]
    gram, right, start = np.zeros((harmonics + coordinates,) * 2), np.zeros(harmonics + coordinates), 0
    for part in _parts(inputs):
        columns = np.concatenate([by_harmonics(part, most), part.jacobian], axis=2).reshape(3 * len(part), -1)
        gram += columns.T @ columns
        right += columns.T @ residual[start : start + len(part)].ravel()
        start += len(part)
    geometry = np.linalg.pinv(gram[harmonics:, harmonics:], rcond=_SEEN, hermitian=True)
    across = {False: np.zeros((coordinates, harmonics)), True: geometry @ gram[harmonics:, :harmonics]}
    alone = {False: np.zeros(coordinates), True: geometry @ right[harmonics:]}
    eigen: dict[tuple[bool, int], tuple[np.ndarray, np.ndarray]] = {}
    for setting in settings:
        orders, with_geometry = setting["orders"], setting["geometry"]
        # Orders come first among the harmonics, so that fewer of them are the first columns.
        size = 2 * orders * joints
        taken, left = across[with_geometry][:, :size], right[:size] - gram[:size, harmonics:] @ alone[with_geometry]
        if (with_geometry, orders) not in eigen:
            eigen[with_geometry, orders] = np.linalg.eigh(gram[:size, :size] - gram[:size, harmonics:] @ taken)
        values, vectors = eigen[with_geometry, orders]
        values = np.maximum(values, 0.0)
        shrunk = values + setting["penalty"] * max(values.mean(), np.finfo(float).tiny)
        coefficients = vectors @ (vectors.T @ left / shrunk)
        yield _Predictor(coefficients, alone[with_geometry] - taken @ coefficients, orders)


def _parts(inputs: Inputs) -> list[Inputs]:
    return [inputs.select(np.arange(len(inputs))[start : start + _AT_ONCE]) for start in range(0, len(inputs), _AT_ONCE)]


def by_harmonics(inputs: Inputs, orders: int) -> np.ndarray:
    """Displacement of the target by one radian of each harmonic, (M, 3, 2 n orders), lower orders first."""
    phase = np.arange(1, orders + 1)[:, None] * inputs.joint_angles[:, None, :]
    harmonics = np.stack([np.sin(phase), np.cos(phase)], axis=2)
    along = inputs.jacobian[:, :, None, None, : inputs.joint_angles.shape[1]]
    return (along * harmonics[:, None]).reshape(len(inputs), 3, -1)
