"""Cramér-Rao bounds: the least error that any unbiased estimator can have from the measurements that a strategy takes."""

import numpy as np

from elastocal.study.identification import cholesky_triangles, inverse_triangles


def squared_error_bounds(information: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Cramér-Rao bound of the mean squared end-effector position error, for normal measurements of unit variance [1], [2].

    `information` (configurations, n, n, sets): sum of A^T A over the measurements of the first k configurations, for every k
    (`identification.prefix_information`). `moment` (n, n): mean over test configurations of A^T A of the end-effector position
    (`metrics.error_moment`). Returns (configurations, sets): trace(M N^-1), m^2 per m^2 of measurement variance; infinite where
    N is singular.

    With N = R^T R the trace is that of X^T M X, where X = R^-1. As a criterion for designs it is V-optimality [3].

    [1] Rao, C. R., Information and the accuracy attainable in the estimation of statistical parameters, Bulletin of the
        Calcutta Mathematical Society 37, 1945.
    [2] Cramér, H., Mathematical Methods of Statistics, Princeton University Press, 1946.
    [3] Atkinson, A. C., Donev, A. N. and Tobias, R. D., Optimum Experimental Designs, with SAS, Oxford University Press, 2007.
    """
    inverse = inverse_triangles(cholesky_triangles(information))
    rows = inverse.reshape(*inverse.shape[:2], -1)
    weighted = (moment @ rows).reshape(inverse.shape)
    bounds = (weighted * inverse).sum(axis=(1, 2))
    return np.where(np.isnan(bounds), np.inf, bounds)
