"""Stated standard deviations made honest: scaled so that intervals hold what they claim of poses that a fit has not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.remainder.protocol import Inputs, Part, Predictor, Regression, Setting

CONFIDENCE = 0.95
# Half width of the interval that holds 95 % of a normal distribution, in standard deviations.
NORMAL_WIDTH = 1.959964


def calibrated(regression: Regression, setting: Setting, predictor: Predictor, parts: Iterable[Part], seed: int) -> Predictor:
    """A predictor whose standard deviations are scaled by cross-validation of the training poses.

    Locally weighted conformal prediction [1] with the residuals of a cross-validation [2]: a regression's own standard
    deviations say where it is less sure, residuals of poses left out say how large these must be. What the physical model errs
    by beyond its training poses is in those residuals too.

    `predictor`: fitted to all training poses. `parts`: of the training poses. Returns with the same mean.

    [1] Lei, J., G'Sell, M., Rinaldo, A., Tibshirani, R. J. and Wasserman, L., Distribution-free predictive inference for
        regression, Journal of the American Statistical Association 113, 2018.
    [2] Barber, R. F., Candès, E. J., Ramdas, A. and Tibshirani, R. J., Predictive inference with the jackknife+, Annals of
        Statistics 49, 2021.
    """
    scores = []
    for part in parts:
        found = next(iter(regression.fitted(part.fitted, part.fitted_residual, [setting], seed)))(part.judged)
        if found.std is not None:
            scores.append(np.abs(part.judged_residual - found.mean) / found.std)
    factor = _quantile(np.concatenate(scores).ravel()) / NORMAL_WIDTH if scores else 1.0

    def scaled(inputs: Inputs) -> Prediction:
        found = predictor(inputs)
        return Prediction(found.mean, None if found.std is None else factor * found.std)

    return scaled


def _quantile(scores: np.ndarray) -> float:
    """Quantile with the correction of conformal prediction for a finite sample; the largest where that asks for more."""
    return float(np.quantile(scores, min(CONFIDENCE * (1.0 + 1.0 / len(scores)), 1.0), method="higher"))
