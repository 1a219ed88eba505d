"""Stated standard deviations made honest: scaled so that intervals hold what they claim of poses that a fit has not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.remainder.protocol import Inputs, Predictor

CONFIDENCE = 0.95
# Half width of the interval that holds 95 % of a normal distribution, in standard deviations.
NORMAL_WIDTH = 1.959964


def calibrated(predictor: Predictor, scores: Sequence[np.ndarray]) -> Predictor:
    """A predictor whose standard deviations are scaled by what cross-validation of the training poses says of them.

    Locally weighted conformal prediction [1] with the residuals of a cross-validation [2]: a regression's own standard
    deviations say where it is less sure, residuals of poses left out say how large these must be. What the physical model errs
    by beyond its training poses is in those residuals too.

    `predictor`: fitted to all training poses. `scores`: of poses left out, errors over the standard deviations stated for them;
    empty where none are stated. Returns with the same mean.

    [1] Lei, J., G'Sell, M., Rinaldo, A., Tibshirani, R. J. and Wasserman, L., Distribution-free predictive inference for
        regression, Journal of the American Statistical Association 113, 2018.
    [2] Barber, R. F., Candès, E. J., Ramdas, A. and Tibshirani, R. J., Predictive inference with the jackknife+, Annals of
        Statistics 49, 2021.
    """
    factor = _quantile(np.concatenate(scores, axis=None)) / NORMAL_WIDTH if scores else 1.0

    def scaled(inputs: Inputs) -> Prediction:
        found = predictor(inputs)
        return Prediction(found.mean, None if found.std is None else factor * found.std)

    return scaled


def _quantile(scores: np.ndarray) -> float:
    """Quantile with the correction of conformal prediction for a finite sample; the largest where that asks for more."""
    return float(np.quantile(scores, min(CONFIDENCE * (1.0 + 1.0 / len(scores)), 1.0), method="higher"))
