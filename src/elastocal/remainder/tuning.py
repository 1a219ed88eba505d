"""A regression and its setting, chosen by cross-validation of the training poses, which makes its intervals honest too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.remainder.protocol import Inputs, Part, Predictor, Regression, Setting

CONFIDENCE = 0.95
# Half width of the interval that holds 95 % of a normal distribution, in standard deviations.
NORMAL_WIDTH = 1.959964


@dataclass(frozen=True)
class Tuned:
    """A regression with the setting that poses chose; neither where no correction at all was best."""

    predictor: Predictor
    regression: Regression | None
    setting: Setting | None


def tuned(regressions: Sequence[Regression], parts: Iterable[Part], inputs: Inputs, residual: np.ndarray, seed: int) -> Tuned:
    """Choose a regression and its setting by cross-validation [1] and fit it, or none where that gains no more than its
    standard error [2]; the same folds make the standard deviations honest that it states.

    `parts`: of the same training poses. `residual` (M, 3): m, base axes.

    [1] Stone, M., Cross-validatory choice and assessment of statistical predictions, Journal of the Royal Statistical Society B
        36, 1974.
    [2] Breiman, L., Friedman, J. H., Olshen, R. A. and Stone, C. J., Classification and Regression Trees, section 3.4,
        Wadsworth, 1984.
    """
    pairs = [(regression, setting) for regression in regressions for setting in regression.SETTINGS]
    judged = [_judged(regressions, part, seed) for part in parts]
    gains = np.array([[gain for gain, _ in fold] for fold in judged])
    best = int(np.argmax(gains.sum(axis=0)))
    if gains[:, best].mean() <= gains[:, best].std(ddof=1) / np.sqrt(len(gains)):
        return Tuned(no_correction, None, None)
    regression, setting = pairs[best]
    predictor = next(iter(regression.fitted(inputs, residual, [setting], seed)))
    scores = [fold[best][1] for fold in judged]
    return Tuned(calibrated(predictor, [score for score in scores if score is not None]), regression, setting)


def _judged(regressions: Iterable[Regression], part: Part, seed: int) -> list[tuple[float, np.ndarray | None]]:
    """By how much each setting of each regression lowers the sum of squares of one fold, m^2, and its errors over the standard
    deviations that it states, None without."""
    found = []
    for regression in regressions:
        for predictor in regression.fitted(part.fitted, part.fitted_residual, regression.SETTINGS, seed):
            prediction = predictor(part.judged)
            left = part.judged_residual - prediction.mean
            gain = float((part.judged_residual**2).sum() - (left**2).sum())
            found.append((gain, None if prediction.std is None else np.abs(left) / prediction.std))
    return found


def no_correction(inputs: Inputs) -> Prediction:
    """The predictor that leaves everything as it is."""
    return Prediction(np.zeros((len(inputs), 3)))


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
