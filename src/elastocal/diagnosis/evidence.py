"""Bayes factors of models from sufficient statistics.

Coefficients of a unit are normal about zero with standard deviation s times their plausible size, one size s for the unit. With
D the diagonal of all s^2,

    ln p(y | model, s, tau) = -1/2 ln |I + D^1/2 G D^1/2| + l(y'My - b'(G + D^-1)^-1 b),

where l(rss) = -nu/2 ln sigma^2 - rss / (2 sigma^2) at sigma^2 = max(rss / nu, 1): the noise is at least what repeats or the
campaign say, or else a smooth competitor could interpolate. Sizes and tau are averaged over, never maximised.

References
----------
.. [1] Kass, R. E. and Raftery, A. E. (1995). Bayes factors. JASA 90, 773-795.
.. [2] Liang, F. et al. (2008). Mixtures of g priors for Bayesian variable selection. JASA 103, 410-423.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr


def log_sum_exp(values, axis=None):
    """ln of the sum of exponentials, as scipy's logsumexp without its cost on small arrays.

    Parameters
    ----------
    values : ndarray
    axis : int, optional

    Returns
    -------
    ndarray or float
    """
    highest = np.max(values, axis=axis, keepdims=True)
    highest = np.where(np.isfinite(highest), highest, 0.0)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(values - highest).sum(axis=axis, keepdims=True)) + highest
    return total.squeeze() if axis is None else total.squeeze(axis)


@dataclass(frozen=True)
class Grid:
    """Sizes that are averaged over, with the logarithms of their weights.

    Attributes
    ----------
    scales, log_weights : ndarray (S,)
    """

    scales: np.ndarray
    log_weights: np.ndarray


def scale_weights(scales, settings):
    """Logarithms of the prior weights of sizes: log-normal pieces below and above the most likely size.

    Parameters
    ----------
    scales : ndarray (S,)
    settings : Settings

    Returns
    -------
    ndarray (S,)
    """
    off = np.log(np.asarray(scales) / settings.scale_center)
    spread = np.where(off < 0, *settings.scale_spread)
    log_weights = -0.5 * (off / spread) ** 2
    return log_weights - log_sum_exp(log_weights)


def pose_weights(pose_error_rad, settings):
    """Logarithms of the prior weights of sizes of the pose error, one of which is zero.

    Parameters
    ----------
    pose_error_rad : ndarray (T,)
    settings : Settings

    Returns
    -------
    ndarray (T,)
    """
    there = pose_error_rad > 0
    share = settings.pose_error_probability / max(there.sum(), 1)
    return np.log(np.where(there, share, 1.0 - settings.pose_error_probability))


def log_likelihood(squares, freedom):
    """l(rss): the profiled likelihood of the noise, which is at least one.

    Parameters
    ----------
    squares : ndarray
    freedom : int

    Returns
    -------
    ndarray
    """
    variance = np.maximum(squares / freedom, 1.0)
    return -0.5 * freedom * np.log(variance) - 0.5 * squares / variance


@dataclass(frozen=True)
class Conditioned:
    """Statistics given that some columns are in the model with given sizes.

    Attributes
    ----------
    gram : ndarray (T, K, K)
    along : ndarray (T, K) or (T, K, N)
    squares : ndarray (T,) or (T, N)
    log_occam : ndarray (T,)
        -1/2 ln |I + D^1/2 G D^1/2| of these columns, with what tau contributes alone and its prior.
    """

    gram: np.ndarray
    along: np.ndarray
    squares: np.ndarray
    log_occam: np.ndarray


def condition(statistics, columns, deviations, log_pose):
    """Take columns into the model.

    Parameters
    ----------
    statistics : Statistics
        Of one set of readings, or ``along`` and ``squares`` of N sets.
    columns : ndarray of int (D,)
    deviations : ndarray (D,)
        Prior standard deviation of each, in plausible sizes.
    log_pose : ndarray (T,)

    Returns
    -------
    Conditioned
    """
    start = statistics.log_likelihood + log_pose
    if not len(columns):
        return Conditioned(statistics.gram, statistics.along, statistics.squares, start)
    inner = deviations[:, None] * statistics.gram[:, columns[:, None], columns] * deviations + np.eye(len(columns))
    factor = np.linalg.cholesky(inner)
    cross = np.linalg.solve(factor, deviations[:, None] * statistics.gram[:, columns])
    along = statistics.along.reshape(*statistics.along.shape[:2], -1)
    fitted = np.linalg.solve(factor, deviations[:, None] * along[:, columns])
    return Conditioned(
        statistics.gram - cross.transpose(0, 2, 1) @ cross,
        (along - cross.transpose(0, 2, 1) @ fitted).reshape(statistics.along.shape),
        statistics.squares - (fitted**2).sum(axis=1).reshape(statistics.squares.shape),
        start - np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1),
    )


@dataclass(frozen=True)
class Blocks:
    """Units gathered by their number of columns, decomposed for any size: G_uu = V diag(values) V'.

    Attributes
    ----------
    members : tuple of ndarray of int (U,)
        Numbers of the units of each block.
    values : tuple of ndarray (T, U, d)
    vectors : tuple of ndarray (T, U, d, d)
    columns : tuple of ndarray of int (U, d)
    """

    members: tuple
    values: tuple
    vectors: tuple
    columns: tuple


def blocks_of(gram, units, chosen):
    """Decompose the Gram matrix of each of some units.

    Parameters
    ----------
    gram : ndarray (T, K, K)
    units : sequence of Unit
    chosen : sequence of int
        Which of them.

    Returns
    -------
    Blocks
    """
    chosen = np.asarray(chosen, int)
    width = np.array([len(units[number].columns) for number in chosen], int)
    members, values, vectors, columns = [], [], [], []
    for size in np.unique(width):
        mine = chosen[width == size]
        at = np.array([units[number].columns for number in mine])
        part = gram[:, at[:, :, None], at[:, None, :]]
        found, turned = np.linalg.eigh(part) if size > 1 else (part[..., 0], np.ones_like(part))
        members.append(mine)
        values.append(np.clip(found, 0.0, None))
        vectors.append(turned)
        columns.append(at)
    return Blocks(tuple(members), tuple(values), tuple(vectors), tuple(columns))


def added_evidence(conditioned, blocks, grid, freedom, count):
    """Log evidence of a model with each of some units added, at every size of that unit.

    Parameters
    ----------
    conditioned : Conditioned
        By what the model has already.
    blocks : Blocks
        Of the conditioned Gram matrix.
    grid : Grid
    freedom : int
    count : int
        Number of all units.

    Returns
    -------
    ndarray (T, count, S)
        -inf for units that are not in the blocks.
    """
    found = np.full((len(conditioned.squares), count, len(grid.scales)), -np.inf)
    variances = grid.scales**2
    for members, values, vectors, columns in zip(*vars(blocks).values(), strict=True):
        along = conditioned.along[:, columns]
        turned = (vectors.swapaxes(-1, -2) @ along[..., None])[..., 0] ** 2
        widened = 1.0 + values[..., None] * variances
        gains = (turned[..., None] * (variances / widened)).sum(axis=2)
        occam = -0.5 * np.log(widened).sum(axis=2)
        likelihood = log_likelihood(conditioned.squares[:, None, None] - gains, freedom)
        found[:, members] = conditioned.log_occam[:, None, None] + occam + likelihood
    return found + grid.log_weights


@dataclass(frozen=True)
class Evaluated:
    """A model with its evidence.

    Attributes
    ----------
    log_evidence : float
        Averaged over sizes and tau.
    scales : ndarray (m,)
        Most probable size of each unit.
    log_pose : ndarray (T,)
        Log posterior weight of each tau at these sizes.
    """

    log_evidence: float
    scales: np.ndarray
    log_pose: np.ndarray


def evaluate(statistics, units, grids, log_pose, start):
    """Evidence of one model, averaged over the sizes of its units.

    The sum over all combinations of sizes is taken as the product of the sums over each size about the mode, found by
    coordinate ascent; exact for one unit, and where sizes are independent given the readings.

    Parameters
    ----------
    statistics : Statistics
    units : sequence of Unit
    grids : sequence of Grid
        One for each unit.
    log_pose : ndarray (T,)
        Logarithm of the prior weight of each size of the pose error.
    start : sequence of float
        Sizes from which the search for the mode starts.

    Returns
    -------
    Evaluated
    """
    base = statistics.log_likelihood + log_pose
    if not units:
        values = base + log_likelihood(statistics.squares, statistics.freedom)
        return Evaluated(float(log_sum_exp(values)), np.zeros(0), values - log_sum_exp(values))
    columns = np.concatenate([unit.columns for unit in units])
    owner = np.repeat(np.arange(len(units)), [len(unit.columns) for unit in units])
    signs = np.concatenate([unit.signs for unit in units])
    size = len(columns)
    joint = np.empty((len(base), size + 1, size + 1))
    joint[:, :size, :size] = statistics.gram[:, columns[:, None], columns]
    joint[:, size, :size] = joint[:, :size, size] = statistics.along[:, columns]
    joint[:, size, size] = statistics.squares
    unit_diagonal = np.append(np.ones(size), 0.0)

    def log_densities(scales):
        """ndarray (N, T): log joint density of the readings at N combinations of sizes (N, m), without their weights."""
        deviations = np.append(scales[:, owner], np.ones((len(scales), 1)), axis=1)
        inner = deviations[:, None, :, None] * joint * deviations[:, None, None, :]
        inner[..., np.arange(size + 1), np.arange(size + 1)] += unit_diagonal
        # The factor's last row solves for the coefficients, and its last element is what they leave of the squares.
        factor = np.linalg.cholesky(inner)
        diagonal = np.diagonal(factor, axis1=-2, axis2=-1)
        squares = diagonal[..., -1] ** 2
        occam = -np.log(diagonal[..., :-1]).sum(axis=-1)
        values = base + occam + log_likelihood(squares, statistics.freedom)
        if not signs.any():
            return values
        return values + _log_sign_factor(factor, signs, squares, statistics.freedom)

    scales = np.array(start, float)
    while True:
        before, sums = scales.copy(), []
        for number, grid in enumerate(grids):
            tried = np.repeat(scales[None], len(grid.scales), axis=0)
            tried[:, number] = grid.scales
            values = log_sum_exp(log_densities(tried), axis=1) + grid.log_weights
            best = int(np.argmax(values))
            scales[number] = grid.scales[best]
            sums.append(log_sum_exp(values) - values[best])
        if np.array_equal(scales, before):
            break
    at_mode = log_densities(scales[None])[0]
    weights = sum(float(grid.log_weights[grid.scales == size][0]) for grid, size in zip(grids, scales, strict=True))
    total = log_sum_exp(at_mode)
    return Evaluated(float(total + weights + sum(sums)), scales, at_mode - total)


def _log_sign_factor(factor, signs, squares, freedom):
    """Half-normal priors where physics gives the sign: ln 2 Phi(mean / std) of each such coefficient."""
    signed = np.flatnonzero(signs)
    inverse = np.linalg.inv(factor[..., :-1, :-1])
    mean = (factor[..., -1:, :-1] @ inverse)[..., 0, signed]
    variance = (inverse[..., signed] ** 2).sum(axis=-2)
    sigma = np.sqrt(np.maximum(squares / freedom, 1.0))[..., None]
    return (np.log(2.0) + log_ndtr(signs[signed] * mean / (np.sqrt(variance) * sigma))).sum(axis=-1)
