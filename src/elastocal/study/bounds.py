"""Cramér-Rao bounds: the least error that any unbiased estimator can have from the measurements that a strategy takes."""

import numpy as np

from elastocal.study.identification import LARGEST_CONDITION


def squared_error_bounds(information: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Cramér-Rao bound of the mean squared end-effector position error, for normal measurements of unit variance [1], [2].

    `information` (configurations, sets, n, n): sum of A^T A over the measurements of the first k configurations, for every k
    (`identification.prefix_information`). `moment` (n, n): mean over test configurations of A^T A of the end-effector position
    (`metrics.error_moment`). Returns (configurations, sets): trace(M N^-1), m^2 per m^2 of measurement variance; infinite where
    N is singular.

    As a criterion for designs it is V-optimality [3].

    [1] Rao, C. R., Information and the accuracy attainable in the estimation of statistical parameters, Bulletin of the
        Calcutta Mathematical Society 37, 1945.
    [2] Cramér, H., Mathematical Methods of Statistics, Princeton University Press, 1946.
    [3] Atkinson, A. C., Donev, A. N. and Tobias, R. D., Optimum Experimental Designs, with SAS, Oxford University Press, 2007.
    """
    regular = np.linalg.matrix_rank(information, rtol=LARGEST_CONDITION**-2, hermitian=True) == len(moment)
    inverse = np.linalg.inv(np.where(regular[..., None, None], information, np.nan))
    return np.where(regular, (moment * inverse).sum(axis=(-2, -1)), np.inf)
