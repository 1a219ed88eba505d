"""A regression and its setting, chosen by poses that it has not seen, or none: nested cross-validation judges the choice too.

The best of many settings is a winner by luck. So each outer fold of the training poses is predicted by what the others choose
among themselves and fit (nested cross-validation [1]), and those predictions decide whether anything is corrected, by one test
over configurations, and how much of the correction is kept, by a slope of at most one.

[1] Varma, S. and Simon, R., Bias in error estimation when using cross-validation for model selection, BMC Bioinformatics 7,
    2006.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtr

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.remainder.protocol import Folds, Inputs, Predictor, Regression, Setting

CONFIDENCE = 0.95
# Half width of the interval that holds 95 % of a normal distribution, in standard deviations.
NORMAL_WIDTH = 1.959964
# How often a regression is chosen where nothing is left. A few configurations leave the outer folds' fits so unlike the final
# one that they must be surer.
_LEVEL, _LEVEL_OF_FEW, _FEW = 0.05, 0.01, 40
# Of fewer configurations a fold of a fold leaves nothing to regress.
FEWEST_CONFIGURATIONS = 10


@dataclass(frozen=True)
class Gain:
    """What predictions of left-out configurations gain.

    `factor`: in [0, 1], by which they are to be multiplied. `statistic`: Student's t of the mean fall of the squared error by
    these, over configurations; `p_value`: that chance alone makes it so large. `rms_m`, `rms_std_error_m`: what is predictable
    of each position, m: root of the mean fall before the second shrinkage.
    """

    factor: float = 0.0
    statistic: float = 0.0
    p_value: float = 1.0
    rms_m: float = 0.0
    rms_std_error_m: float = 0.0


@dataclass(frozen=True)
class Spread:
    """What poses left out say of a regression's standard deviations.

    `times`: by how much its own are to be multiplied for intervals that hold; None where no fold states any. `otherwise_m`: of
    a coordinate where it states none, m. `typical`: root mean square of the errors over that, which tails make large.
    """

    times: float | None
    otherwise_m: float
    typical: float


@dataclass(frozen=True)
class Tuned:
    """A regression with the setting that poses chose; neither where nothing is corrected.

    `gain`: of the outer folds; None where there are too few configurations. `level`: of the test that it had to pass. `spread`:
    by the outer folds too. `seed`: by which it was fitted.
    """

    predictor: Predictor
    regression: Regression | None = None
    setting: Setting | None = None
    gain: Gain | None = None
    level: float = _LEVEL
    spread: Spread | None = None
    seed: int = 0


def tuned(regressions: Sequence[Regression], folds: Folds, inputs: Inputs, residual: np.ndarray, seed: int) -> Tuned:
    """Choose a regression and its setting by nested cross-validation and fit it; the outer folds make its intervals honest too.

    `folds`: of the same training poses, or some of them. `residual` (M, 3): m, base axes.
    """
    count = int(folds.configuration.max()) + 1
    if count < FEWEST_CONFIGURATIONS:
        return Tuned(no_correction)
    pairs = [(regression, setting) for regression in regressions for setting in regression.SETTINGS]
    products = _products_without(regressions, folds, seed)
    off = folds.residual[folds.fold, np.arange(len(folds.fold))]
    predicted, std = np.zeros_like(off), np.full_like(off, np.nan)
    for number, left in enumerate(folds.residual):
        best = _best(products[number].sum(axis=0))
        if best is not None:
            (regression, setting), mine = pairs[best], folds.fold == number
            predictor = next(iter(regression.fitted(folds.inputs.select(~mine), left[~mine], [setting], seed)))
            found = predictor(folds.inputs.select(mine))
            predicted[mine], std[mine] = found.mean, np.nan if found.std is None else found.std
    along, square = (np.bincount(folds.configuration, (rows * predicted).sum(axis=1)) for rows in (off, predicted))
    gain, level = gain_of(along, square, len(off), len(folds.residual)), _LEVEL if count >= _FEW else _LEVEL_OF_FEW
    chosen = _best(products.sum(axis=(0, 1)))
    if gain.p_value > level or chosen is None:
        return Tuned(no_correction, gain=gain, level=level)
    regression, setting = pairs[chosen]
    spread = spread_of(np.abs(off - gain.factor * predicted), std)
    predictor = shrunk(regression, setting, gain.factor, spread, inputs, residual, seed)
    return Tuned(predictor, regression, setting, gain, level, spread, seed)


def gain_of(along: np.ndarray, square: np.ndarray, rows: int, folds: int) -> Gain:
    """What predictions gain on configurations that they were made without.

    Their slope on the residuals is less than one where a regression follows noise; it is shrunk once more as a mean is by James
    and Stein [1]. Folds share most of the configurations that they are fitted to, which leaves the mean of their errors more
    variance than independent ones would have, by 1 + k / (k - 1) of k folds [2].

    `along`, `square` (G,): of each configuration the products of predictions with residuals and with themselves, m². `rows`:
    positions predicted. `folds`: their number.

    [1] James, W. and Stein, C., Estimation with quadratic loss, Fourth Berkeley Symposium 1, 1961.
    [2] Nadeau, C. and Bengio, Y., Inference for the generalization error, Machine Learning 52, 2003.
    """
    count = len(along)
    shared = (1.0 + folds / (folds - 1.0)) * count / (count - 1.0)
    slope = along.sum() / square.sum() if square.any() else 0.0
    if slope <= 0.0:
        return Gain()
    error = np.sqrt(shared * ((along - slope * square) ** 2).sum()) / square.sum()
    kept = np.array([np.clip(slope - error**2 / slope, 0.0, 1.0), min(slope, 1.0)])[:, None]
    falls = kept * (2.0 * along - kept * square)
    spread = np.sqrt(shared * ((falls - falls.mean(axis=1, keepdims=True)) ** 2).sum(axis=1))
    statistic = float(falls[0].sum() / spread[0]) if spread[0] > 0.0 else 0.0
    rms = float(np.sqrt(falls[1].sum() / rows))
    std_error = 0.5 * rms * float(spread[1] / falls[1].sum())
    return Gain(float(kept[0, 0]), statistic, float(stdtr(count - 1.0, -statistic)), rms, std_error)


def _best(products: np.ndarray) -> int | None:
    """The setting whose predictions gain most, shrunk as they need but by no more than half; None where none gains.

    `products` (settings, 2).
    """
    along, square = products.T
    factor = np.clip(along / np.maximum(square, np.finfo(float).tiny), 0.5, 1.0)
    gains = factor * (2.0 * along - factor * square)
    best = int(np.argmax(gains))
    return best if gains[best] > 0.0 else None


def _products_without(regressions: Sequence[Regression], folds: Folds, seed: int) -> np.ndarray:
    """Of predictions of one fold, fitted without it and without another: with the residuals, and with themselves, m².

    Returns (K, K, settings, 2): the other fold first; zero where both are one.
    """
    count = len(folds.residual)
    found = np.zeros((count, count, sum(len(regression.SETTINGS) for regression in regressions), 2))
    for pair in combinations(range(count), 2):
        # Of a model without both, to first order of what leaving out each of them does to it.
        left, rest = folds.residual[list(pair)].sum(axis=0) - folds.whole, ~np.isin(folds.fold, pair)
        some, number = folds.inputs.select(rest), 0
        there = [(*ends, folds.fold == ends[1], folds.inputs.select(folds.fold == ends[1])) for ends in (pair[::-1], pair)]
        for regression in regressions:
            for predictor in regression.fitted(some, left[rest], regression.SETTINGS, seed):
                for other, one, mine, inputs in there:
                    mean = predictor(inputs).mean
                    found[other, one, number] = (left[mine] * mean).sum(), (mean**2).sum()
                number += 1
    return found


def no_correction(inputs: Inputs) -> Prediction:
    """The predictor that leaves everything as it is."""
    return Prediction(np.zeros((len(inputs), 3)))


def spread_of(errors: np.ndarray, std: np.ndarray) -> Spread:
    """How large standard deviations must be for intervals to hold `CONFIDENCE` of the errors of poses left out.

    Locally weighted conformal prediction [1] by cross-validation: a regression's own standard deviations say where it is less
    sure, residuals of poses left out, with what the physical model errs by beyond its training poses, how large these must be.

    `errors`, `std` (M, 3): magnitudes, and what was stated for them, not a number where nothing was.

    [1] Lei, J., G'Sell, M., Rinaldo, A., Tibshirani, R. J. and Wasserman, L., Distribution-free predictive inference for
        regression, Journal of the American Statistical Association 113, 2018.
    """

    def width(scores: np.ndarray) -> float:
        # The quantile with conformal prediction's correction for a finite sample; the largest where that asks for more.
        return float(np.quantile(scores, min(CONFIDENCE * (1.0 + 1.0 / scores.size), 1.0), method="higher")) / NORMAL_WIDTH

    own = np.isfinite(std)
    otherwise = width(errors)
    typical = float(np.sqrt((errors**2).mean())) / otherwise
    return Spread(width(errors[own] / std[own]) if own.any() else None, otherwise, typical)


def shrunk(
    regression: Regression,
    setting: Setting,
    factor: float,
    spread: Spread,
    inputs: Inputs,
    residual: np.ndarray,
    seed: int,
) -> Predictor:
    """A regression fitted to all training poses, shrunk by a factor, with intervals as wide as poses left out say."""
    predictor = next(iter(regression.fitted(inputs, residual, [setting], seed)))

    def scaled(there: Inputs) -> Prediction:
        found = predictor(there)

        def std() -> np.ndarray:
            if spread.times is None or found.std is None:
                return np.full_like(found.mean, spread.otherwise_m)
            return spread.times * found.std

        return Prediction(factor * found.mean, std)

    return scaled
