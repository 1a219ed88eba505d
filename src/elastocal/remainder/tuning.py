"""The setting of a regression, chosen by cross-validation of the training poses alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.remainder.protocol import Inputs, Part, Predictor, Regression, Setting


@dataclass(frozen=True)
class Tuned:
    """A regression with the setting that poses chose.

    `setting`: None where no correction at all was best.
    """

    predictor: Predictor
    setting: Setting | None


def tuned(regression: Regression, parts: Iterable[Part], inputs: Inputs, residual: np.ndarray, seed: int) -> Tuned:
    """Choose a setting by cross-validation [1] and fit the regression with it.

    `parts`: of the same training poses; not asked where there is but one setting. `residual` (M, 3): m, base axes.

    [1] Stone, M., Cross-validatory choice and assessment of statistical predictions, Journal of the Royal Statistical Society B
        36, 1974.
    """
    setting = regression.SETTINGS[0]
    if len(regression.SETTINGS) > 1:
        squares, nothing = np.zeros(len(regression.SETTINGS)), 0.0
        for part in parts:
            each = regression.fitted(part.fitted, part.fitted_residual, regression.SETTINGS, seed)
            squares += [((part.judged_residual - predictor(part.judged).mean) ** 2).sum() for predictor in each]
            nothing += (part.judged_residual**2).sum()
        if nothing <= squares.min():
            return Tuned(no_correction, None)
        setting = regression.SETTINGS[int(np.argmin(squares))]
    return Tuned(next(iter(regression.fitted(inputs, residual, [setting], seed))), setting)


def no_correction(inputs: Inputs) -> Prediction:
    """The predictor that leaves everything as it is."""
    return Prediction(np.zeros((len(inputs), 3)))
