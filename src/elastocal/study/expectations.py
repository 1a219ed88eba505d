"""What the scores of a study are expected to be, in closed form to second order; no simulation.

Let an unbiased estimate of a compliance be normal with mean c and standard deviation s. A Taylor series gives the mean of its
inverse (the delta method to second order [1]), E[1/c_hat] = (1 + s^2/c^2 + 3 s^4/c^4 + ...) / c, so that the averaged
stiffness is too large by delta_k = s^2 / c^2, however many data sets there are. s^2 falls as one over the number of
configurations, and with it every score of the averaged model.

[1] Casella, G. and Berger, R. L., Statistical Inference, section 5.5.4, 2nd edition, Duxbury, 2002.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from elastocal.study.metrics import error_forms

if TYPE_CHECKING:
    from elastocal.study.metrics import Judge


def expected_compliance(noise_free: np.ndarray, variance: np.ndarray, method: str) -> np.ndarray:
    """Expected compliance of the averaged model (equation 12).

    `noise_free` (..., n): estimates without noise, which the linearisation alone takes off the truth, rad/(N m). `variance`
    (..., n): of the estimates, mean over data sets. `method`: what is averaged (interpretation R7); the mean and the median of
    a normal estimate have no bias. Returns (..., n).
    """
    return noise_free / (1.0 + variance / noise_free**2) if method == "stiffness" else noise_free


def expected_deviation(judge: Judge, compliance: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Expected position error of a model whose compliances are normal, mean over the test configurations.

    The squared error is a quadratic form in normal variables; its square root has the mean that it has under the gamma
    distribution of the same mean and variance [1], [2], which is exact where one direction dominates and in the limit of no
    scatter.

    `compliance` (L, n): mean. `covariance` (L, n, n). Returns (L,): m.

    [1] Satterthwaite, F. E., An approximate distribution of estimates of variance components, Biometrics Bulletin 2, 1946.
    [2] Box, G. E. P., Some theorems on quadratic forms applied in the study of analysis of variance problems I, Annals of
        Mathematical Statistics 25, 1954.
    """
    forms = error_forms(judge)
    inner = forms[:, :-1, :-1]
    found = np.empty(len(compliance))
    for place, (error, spread) in enumerate(zip(compliance - judge.reference, covariance, strict=True)):
        whole = np.append(error, 1.0)
        slope = forms[:, :-1] @ whole
        scattered = inner @ spread
        mean = (forms @ whole) @ whole + np.trace(scattered, axis1=1, axis2=2)
        variance = 2 * (scattered * scattered.swapaxes(1, 2)).sum(axis=(1, 2)) + 4 * ((slope @ spread) * slope).sum(axis=1)
        found[place] = _mean_root(mean, variance).mean()
    return found


def _mean_root(mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Mean of the root of gamma variables."""
    with np.errstate(divide="ignore"):
        shape = mean**2 / variance
    # The ratio of gamma functions by its series where it is the difference of large numbers.
    large = shape > _LARGE_SHAPE
    few = np.where(large, 1.0, shape)
    ratio = np.where(large, 1.0 - 0.125 / shape, np.exp(gammaln(few + 0.5) - gammaln(few)) / np.sqrt(few))
    return np.sqrt(mean) * ratio


_LARGE_SHAPE = 1e4
