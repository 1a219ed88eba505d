"""Cramér-Rao bounds: the least error that any unbiased estimator can have from the readings that a strategy takes."""

import numpy as np


def squared_error_bounds(information, moment):
    """Bound of the mean squared end-effector position error, for readings of unit variance.

    Parameters
    ----------
    information : ndarray (configurations, sets, n, n)
        Sum of A^T A over the readings of the first k configurations, for every k (`identification.prefix_information`).
    moment : ndarray (n, n)
        Mean over test configurations of A^T A of the end-effector position (`metrics.error_moment`).

    Returns
    -------
    ndarray (configurations, sets)
        trace(M N^-1), m^2 per m^2 of reading variance; infinite where N is singular.
    """
    eigenvalues = np.linalg.eigvalsh(information)
    solvable = eigenvalues[..., 0] > eigenvalues[..., -1] * np.finfo(float).eps
    safe = np.where(solvable[..., None, None], information, np.eye(information.shape[-1]))
    return np.where(solvable, np.trace(moment @ np.linalg.inv(safe), axis1=-2, axis2=-1), np.inf)
