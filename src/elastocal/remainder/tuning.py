"""A regression and its setting, chosen by cross-validation of the training poses alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.intervals import calibrated
from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.remainder.protocol import Inputs, Part, Predictor, Regression, Setting


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
