"""What equal weights cost where measurements are not equally certain: ordinary against generalized least squares [1].

[1] Aitken, A. C., On least squares and linear combination of observations, Proceedings of the Royal Society of Edinburgh 55,
    1935.
"""

import numpy as np


def expected_errors(regressor: np.ndarray, deviation: np.ndarray, moment: np.ndarray) -> tuple[float, float]:
    """RMS error by equal weights and by those of the noise.

    `regressor` (sets, rows, n). `deviation` (sets, rows): standard deviation of each measurement, m or rad. `moment` (n, n):
    from `metrics.error_moment`. Returns `equal`, `weighted`: m; the latter is the Cramér-Rao bound.
    """
    across = regressor.swapaxes(1, 2)
    inverse = np.linalg.inv(across @ regressor)
    scattered = regressor * deviation[..., None]
    sandwich = inverse @ (scattered.swapaxes(1, 2) @ scattered) @ inverse
    white = regressor / deviation[..., None]
    weighted = np.linalg.inv(white.swapaxes(1, 2) @ white)
    equal, best = (float(np.sqrt((moment * covariance.mean(axis=0)).sum())) for covariance in (sandwich, weighted))
    return equal, best


def pose_deviation(position_m: np.ndarray | float, orientation_rad: float, shape: tuple[int, ...]) -> np.ndarray:
    """Standard deviations of the six components of poses.

    `position_m` (sets, configurations). `shape`: (sets, configurations). Returns (sets, 6 configurations).
    """
    found = np.empty((*shape, 6))
    found[..., :3] = np.broadcast_to(position_m, shape)[..., None]
    found[..., 3:] = orientation_rad
    return found.reshape(shape[0], -1)


def range_noise(position_m: np.ndarray, tracker_m: np.ndarray, base_m: float, per_metre: float) -> np.ndarray:
    """Standard deviation of a tracker's positions, which grows with the range: root of the sum of the squares of its parts.

    `position_m` (..., 3): of the target. `tracker_m` (3,). Returns (...): m.
    """
    return np.hypot(base_m, per_metre * np.linalg.norm(position_m - tracker_m, axis=-1))
