"""A regression and its setting, chosen by cross-validation of the training poses alone."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

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
    standard error [2].

    `parts`: of the same training poses; not asked where there is but one setting of one regression. `residual` (M, 3): m, base
    axes.

    [1] Stone, M., Cross-validatory choice and assessment of statistical predictions, Journal of the Royal Statistical Society B
        36, 1974.
    [2] Breiman, L., Friedman, J. H., Olshen, R. A. and Stone, C. J., Classification and Regression Trees, section 3.4,
        Wadsworth, 1984.
    """
    pairs = [(regression, setting) for regression in regressions for setting in regression.SETTINGS]
    best = 0
    if len(pairs) > 1:
        gains = np.array([_gains(regressions, part, seed) for part in parts])
        best = int(np.argmax(gains.sum(axis=0)))
        if gains[:, best].mean() <= gains[:, best].std(ddof=1) / np.sqrt(len(gains)):
            return Tuned(no_correction, None, None)
    regression, setting = pairs[best]
    return Tuned(next(iter(regression.fitted(inputs, residual, [setting], seed))), regression, setting)


def _gains(regressions: Iterable[Regression], part: Part, seed: int) -> list[float]:
    """By how much each setting of each regression lowers the sum of squares of one fold, m^2."""
    fitted = (each.fitted(part.fitted, part.fitted_residual, each.SETTINGS, seed) for each in regressions)
    left = (part.judged_residual - predictor(part.judged).mean for predictor in chain.from_iterable(fitted))
    return [float((part.judged_residual**2).sum() - (each**2).sum()) for each in left]


def no_correction(inputs: Inputs) -> Prediction:
    """The predictor that leaves everything as it is."""
    return Prediction(np.zeros((len(inputs), 3)))
