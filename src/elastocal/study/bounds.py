"""Cramér-Rao bounds: the least error that any unbiased estimator can have from the measurements that a strategy takes."""

import numpy as np

from elastocal.study.identification import LARGEST_CONDITION


def squared_error_bounds(information: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Cramér-Rao bound of the mean squared end-effector position error, for normal measurements of unit variance [1], [2].

    `information` (configurations, sets, n, n): sum of A^T A over the measurements of the first k configurations, for every k
    (`identification.prefix_information`). `moment` (n, n): mean over test configurations of A^T A of the end-effector position
    (`metrics.error_moment`). Returns (configurations, sets): trace(M N^-1), m^2 per m^2 of measurement variance; infinite where
    N is singular.

    The sweep operator [4] solves N X = M for all prefixes at once; inverses by LAPACK, one small matrix after the other, take
    twice as long. N is singular where of a diagonal element less than the precision is left as its pivot.

    As a criterion for designs it is V-optimality [3].

    [1] Rao, C. R., Information and the accuracy attainable in the estimation of statistical parameters, Bulletin of the
        Calcutta Mathematical Society 37, 1945.
    [2] Cramér, H., Mathematical Methods of Statistics, Princeton University Press, 1946.
    [3] Atkinson, A. C., Donev, A. N. and Tobias, R. D., Optimum Experimental Designs, with SAS, Oxford University Press, 2007.
    [4] Goodnight, J. H., A tutorial on the SWEEP operator, The American Statistician 33, 1979.
    """
    size = len(moment)
    system = np.empty((size, 2 * size, *information.shape[:2]))
    system[:, :size] = np.moveaxis(information, (2, 3), (0, 1))
    system[:, size:] = moment[..., None, None]
    least = np.einsum("ii...->i...", system[:, :size]) / LARGEST_CONDITION**2
    for pivot in range(size):
        head = system[pivot, pivot]
        row = system[pivot, pivot + 1 :] / np.where(head > least[pivot], head, np.nan)
        system[:, pivot + 1 :] -= system[:, pivot, None] * row
        system[pivot, pivot + 1 :] = row
    trace = np.einsum("ii...->...", system[:, size:])
    return np.where(np.isnan(trace), np.inf, trace)
