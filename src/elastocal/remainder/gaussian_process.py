"""A Gaussian process: smooth in all inputs, with intervals that grow away from the poses that were measured.

Its variance far from all of them is that of the residuals themselves, so that what it has not seen it calls unknown [1].

[1] Rasmussen, C. E. and Williams, C. K. I., Gaussian Processes for Machine Learning, chapters 2 and 5, MIT Press, 2006.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.feature_selection import VarianceThreshold
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "gaussian_process", "Gaussian process"
# Marginal likelihood chooses among its hyperparameters, from the same poses.
SETTINGS: Sequence[Setting] = ({},)
# Hyperparameters come from so many observations: a step towards them costs the third power of their number, and 800 take eight
# times as long for errors that differ by 2 % either way (UR5 and UR10).
_MOST_FOR_HYPERPARAMETERS = 300
# Of so many the covariance matrix takes 1.2 GB; of more, so many are drawn.
_MOST = 12_000
# In standard deviations of each input: from wiggles between neighbours to one trend across all poses.
_LENGTHS = (0.05, 100.0)
# An input that differs by less than this over all poses says nothing: rad, N, m, s, degC.
_STILL = 1e-10
# At once, when a prediction asks for its covariances with all poses.
_PREDICTED_AT_ONCE = 2_000


class _Predictor:
    def __init__(self, scaling: Pipeline, process: GaussianProcessRegressor) -> None:
        self._scaling, self._process = scaling, process

    def __call__(self, inputs: Inputs) -> Prediction:
        scaled = self._scaling.transform(inputs.columns)
        parts = [scaled[start : start + _PREDICTED_AT_ONCE] for start in range(0, len(scaled), _PREDICTED_AT_ONCE)]
        found = [self._process.predict(part, return_std=True) for part in parts]
        mean, std = (np.concatenate(values) for values in zip(*found, strict=True))
        return Prediction(mean, std)


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """One process for all three axes, each with its own size: a Matérn kernel with a length for each input, and noise.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`. Yields with standard deviations.
    """
    draws = np.random.default_rng(seed)
    scaling = make_pipeline(VarianceThreshold(_STILL**2), StandardScaler()).fit(inputs.columns)
    scaled = scaling.transform(inputs.columns)
    kernel = ConstantKernel(1.0, (1e-3, 1e3)) * Matern(np.ones(scaled.shape[1]), _LENGTHS, nu=2.5)
    kernel += WhiteKernel(0.5, (1e-4, 10.0))
    few, many = (np.sort(draws.permutation(len(scaled))[:most]) for most in (_MOST_FOR_HYPERPARAMETERS, _MOST))
    for _ in settings:
        with warnings.catch_warnings():
            # A length at its bound is an input without influence, not a failure.
            warnings.simplefilter("ignore", ConvergenceWarning)
            found = GaussianProcessRegressor(kernel, normalize_y=True).fit(scaled[few], residual[few]).kernel_
        process = GaussianProcessRegressor(found, optimizer=None, normalize_y=True).fit(scaled[many], residual[many])
        yield _Predictor(scaling, process)
