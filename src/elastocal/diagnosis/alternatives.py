"""Models that are left after the present measurements, and what an experiment would tell of them.

Models of the posterior are linear in their coefficients, so that what an experiment tells is one matrix, its information G on
declared parameters and units together. A model j that present measurements leave with coefficients N(m_j, P_j^-1) expects
measurements with mean A_j m_j and covariance I + A_j P_j^-1 A_j', A'A = G. If measurements come from coefficients t instead,
then on average

    -2 ln p_j = u'G u - u'G_j (P_j + G_jj)^-1 G_j'u + tr((P_j + G_jj)^-1 P_j) + ln |P_j + G_jj| - ln |P_j| - d_j + const,

with u = t - m_j and d_j coefficients, and the difference between two models, drawn over the posterior of t, is the
*separation*. Experiments are compared by the entropy that they leave, of models with one covariance bounded from below through
exp(-separation / 8), their Bhattacharyya coefficient [1] (`Criterion`). What one of them promises is simulated (`Promise`):
preposterior analysis [2], with coefficients from the posterior and measurements of the whole experiment. Where coefficients are
known, odds of 19:1 are reached with 50, 90 and 95 % if the separation is 6, 16 and 21; where they may turn out small, the
separation that is stated is the one for which this holds.

[1] Kolchinsky, A. and Tracey, B. D., Estimating mixture entropy with pairwise distances, Entropy 19, 2017.
[2] Raiffa, H. and Schlaifer, R., Applied Statistical Decision Theory, Harvard University, 1961.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.statistics import normal_equations

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.diagnosis.findings import Evidence
    from elastocal.diagnosis.next_experiment import Instrument
    from elastocal.diagnosis.search import Model

# Draws of each model's coefficients, and times as many that are drawn where physics gives signs.
_DRAWS, _SPARE = 4, 16
# Separations with which odds of 19:1 are reached in half of all experiments: ln 19 = lambda / 2 - z sqrt(lambda).
HALF_RESOLVED = 2 * np.log(19.0)
# Simulated experiments of each hypothesis (standard error 2 %).
PROMISE_DRAWS = 600
# Poses after which nobody goes on: some two days with a tracker.
MOST_POSES = 100


@dataclass(frozen=True)
class Alternative:
    """A model as it is after the present measurements.

    `name`: of its hypothesis. `columns` (d,): of the unknowns that it has. `mean` (U,): of the unknowns; zero for those that it
    does not have. `precision` (d, d): of its coefficients. `signs` (d,): that physics gives them, 0 where they may have either.
    """

    name: tuple[str, ...]
    log_odds: float
    columns: np.ndarray
    mean: np.ndarray
    precision: np.ndarray
    signs: np.ndarray

    @cached_property
    def root(self) -> np.ndarray:
        """Times white noise, deviations of its coefficients, ndarray (d, d)."""
        return np.linalg.inv(np.linalg.cholesky(self.precision)).T

    def drawn(self, count: int, stream: np.random.Generator) -> np.ndarray:
        """Coefficients from its posterior, those that break no sign first, ndarray (count, U)."""
        spare = _SPARE if self.signs.any() else 1
        some = self.mean[self.columns] + stream.standard_normal((spare * count, len(self.columns))) @ self.root.T
        found = np.repeat(self.mean[None], count, axis=0)
        found[:, self.columns] = some[np.argsort((some * self.signs < 0.0).any(axis=1), kind="stable")[:count]]
        return found


def alternatives_of(
    evidence: Evidence, kept: Mapping[tuple[str, ...], Sequence[Model]], instrument: Instrument, lead: Model, factor: float
) -> list[Alternative]:
    """Posterior of the coefficients of each model, in units of the noise that the leading model leaves.

    All models are taken at the pose error of the leading one; half-normal priors count as normal ones but in what is drawn.

    `kept`: models of each hypothesis, the best first. `factor`: times the noise taken that the leading model leaves.
    """
    problem, products = evidence.linearized.problem, evidence.linearized.products
    total = normal_equations(products, lead.pose_error_rad)[0] / factor**2
    declared = products.declared
    place = np.zeros(products.gram.shape[0], int)
    place[declared + instrument.columns] = declared + np.arange(len(instrument.columns))
    known = np.arange(declared)
    found = []
    for name, model in [(name, model) for name, models in kept.items() for model in models]:
        mine, deviations = problem.columns_of(model.units, model.scales)
        chosen, at = (np.concatenate([known, where]) for where in (declared + mine, place[declared + mine]))
        precision = total[np.ix_(chosen, chosen)] + np.diag(np.append(np.zeros(declared), (factor * deviations) ** -2))
        mean = np.zeros(instrument.unknowns)
        mean[at] = np.linalg.solve(precision, total[chosen, -1])
        signs = np.concatenate([np.zeros(declared, int), *(problem.units[n].signs for n in model.units)])
        found.append(Alternative(name, model.log_odds, at, mean, precision, signs))
    return found


class _Hypotheses:
    """Models by the hypotheses to which they belong, the best first.

    `names`. `hypothesis` (M,) of int. `log_weights` (M,): of the models' probabilities, which sum to one.
    """

    def __init__(self, models: Sequence[Alternative]) -> None:
        self.models = models
        self.names = list(dict.fromkeys(model.name for model in models))
        self.hypothesis = np.array([self.names.index(model.name) for model in models])
        odds = np.array([model.log_odds for model in models])
        self.log_weights = odds - log_sum_exp(odds)

    def misfits(self, information: np.ndarray, truths: np.ndarray, noise: np.ndarray | None = None) -> np.ndarray:
        """-2 ln p of measurements that true coefficients make under each model, but for what is common to all models.

        `information` (N, U, U): of N experiments. `truths`, `noise` (T, U): its products with the sensitivities, of variance G;
        on average over the noise where it is not given. Returns (N, T, M).
        """
        expected = information @ truths.T
        squares = (expected * truths.T).sum(axis=1)
        if noise is not None:
            expected, squares = expected + noise.T, squares + 2.0 * (noise * truths).sum(axis=1)
        found = np.empty((len(information), len(truths), len(self.models)))
        for number, model in enumerate(self.models):
            of_mean = information @ model.mean
            left = squares - 2.0 * model.mean @ expected + (of_mean @ model.mean)[:, None]
            seen = expected[:, model.columns] - of_mean[:, model.columns, None]
            inner = information[:, model.columns[:, None], model.columns] + model.precision
            factor, inverse = np.linalg.cholesky(inner), np.linalg.inv(inner)
            left -= (seen * (inverse @ seen)).sum(axis=1)
            common = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1) - np.linalg.slogdet(model.precision)[1]
            if noise is None:
                common += (inverse * model.precision).sum(axis=(1, 2)) - len(model.columns)
            found[..., number] = left + common[:, None]
        return found


class Criterion(_Hypotheses):
    """Entropy of the hypotheses that an experiment leaves, by pairwise separations.

    `truths` (T, U): fresh draws of each model's coefficients. `source` (T,) of int: whose.
    """

    def __init__(self, models: Sequence[Alternative], stream: np.random.Generator) -> None:
        super().__init__(models)
        self.truths = np.concatenate([model.drawn(_DRAWS, stream) for model in models])
        self.source = np.repeat(np.arange(len(models)), _DRAWS)

    @property
    def work(self) -> int:
        """Multiplications for one entry."""
        return sum(len(model.columns) ** 3 for model in self.models) + self.truths.size * self.truths.shape[1]

    def left(self, information: np.ndarray) -> np.ndarray:
        """Entropy left after experiments of some information (N, U, U), ndarray (N,), nats."""
        misfits = self.misfits(information, self.truths)
        own = misfits[:, np.arange(len(self.source)), self.source]
        exponents = self.log_weights - (misfits - own[..., None]) / 8.0
        mine = self.hypothesis == self.hypothesis[self.source][:, None]
        right = log_sum_exp(np.where(mine, exponents, -np.inf), axis=2)
        return (log_sum_exp(exponents, axis=2) - right) @ (np.exp(self.log_weights[self.source]) / _DRAWS)


class Promise(_Hypotheses):
    """What an experiment brings, by simulation with random numbers that are the same for every experiment.

    `log_prior` (H,): of the hypotheses. `source` (T,) of int: hypothesis of each simulated experiment.
    """

    def __init__(self, models: Sequence[Alternative], stream: np.random.Generator) -> None:
        super().__init__(models)
        hypotheses = range(len(self.names))
        self.log_prior = np.array([log_sum_exp(self.log_weights[self.hypothesis == h]) for h in hypotheses])
        truths, self.source = [], np.repeat(hypotheses, PROMISE_DRAWS)
        for h in hypotheses:
            mine = np.flatnonzero(self.hypothesis == h)
            share = np.exp(self.log_weights[mine] - self.log_prior[h])
            counts = np.bincount(stream.choice(len(mine), PROMISE_DRAWS, p=share / share.sum()), minlength=len(mine))
            truths += [models[m].drawn(int(count), stream) for m, count in zip(mine.tolist(), counts, strict=True)]
        self.truths = np.concatenate(truths)
        self.white = stream.standard_normal(self.truths.shape)

    def log_factors(self, information: np.ndarray) -> np.ndarray:
        """ln p of the simulated measurements under each hypothesis, but for what is common to all; ndarray (N, H).

        `information` (U, U): of a whole experiment.
        """
        values, vectors = np.linalg.eigh(information)
        noise = self.white @ (vectors * np.sqrt(np.clip(values, 0.0, None))).T
        logs = self.log_weights - 0.5 * self.misfits(information[None], self.truths, noise)[0]
        found = [log_sum_exp(logs[:, self.hypothesis == h], axis=1) for h in range(len(self.names))]
        return np.column_stack(found) - self.log_prior

    def separations(self, logs: np.ndarray) -> np.ndarray:
        """Separation of the best hypothesis from each by `log_factors` of an experiment, ndarray (H,); 0 for the best.

        Twice the mean log Bayes factor for the true model, or, where a few large draws carry that mean, the separation of two
        fixed hypotheses of which one gets odds of 19:1 as often: the smaller of both.
        """
        weights = np.exp(self.log_prior)
        found = np.zeros(len(weights))
        for h in range(1, len(weights)):
            shares = weights[[0, h]] / (weights[0] + weights[h])
            factors = [logs[self.source == true, true] - logs[self.source == true, h - true] for true in (0, h)]
            mean = shares @ [factor.mean() for factor in factors]
            often = shares @ [(factor >= np.log(19.0)).mean() for factor in factors]
            found[h] = max(min(2.0 * mean, separation_resolved(often)), 0.0)
        return found

    def resolved(self, logs: np.ndarray) -> float:
        """Probability that the right hypothesis ends up with odds of 19:1, by `log_factors` of an experiment."""
        logs = logs + self.log_prior
        right = logs[np.arange(len(logs)), self.source] - log_sum_exp(logs, axis=1) >= np.log(0.95)
        weights = np.exp(self.log_prior[self.source]) / PROMISE_DRAWS
        return float(right @ weights / weights.sum())


def separation_resolved(probability: float) -> float:
    """Separation of two fixed hypotheses with which one gets odds of 19:1 so often: ln 19 = lambda / 2 - z sqrt(lambda).

    The log Bayes factor of two normal distributions with one covariance is normal, with mean lambda / 2 and variance lambda.
    """
    z = ndtri(probability)
    return float((z + np.sqrt(z**2 + 2 * np.log(19.0))) ** 2) if probability > 0 else 0.0
