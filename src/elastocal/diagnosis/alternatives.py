"""Models that are left after the present measurements, and what an experiment would tell of them.

Models of the posterior are linear in their coefficients, so that what an experiment tells is one matrix, its information G on
declared parameters and units together. A model j that present measurements leave with coefficients N(m_j, P_j^-1) expects
measurements with mean A_j m_j and covariance I + A_j P_j^-1 A_j', A'A = G. If measurements come from coefficients t instead,
then on average

    -2 ln p_j = u'G u - u'G_j (P_j + G_jj)^-1 G_j'u + tr((P_j + G_jj)^-1 P_j) + ln |P_j + G_jj| - ln |P_j| - d_j + const,

with u = t - m_j and d_j coefficients, and the difference between two models, drawn over the posterior of t, is the
*separation*: twice the Kullback-Leibler divergence of which Box and Hill add up all pairs [1]. Such a sum never has enough of
two models that are far apart already; the expected fall of the entropy [2] does. Of models with one covariance it is bounded
from below through exp(-separation / 8), their Bhattacharyya coefficient [3]; here, where covariances differ and each draw of t
has its separations, that is an approximation.

[1] Box, G. E. P. and Hill, W. J., Discrimination among mechanistic models, Technometrics 9, 1967.
[2] Lindley, D. V., On a measure of the information provided by an experiment, Annals of Mathematical Statistics 27, 1956.
[3] Kolchinsky, A. and Tracey, B. D., Estimating mixture entropy with pairwise distances, Entropy 19, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.statistics import normal_equations

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.diagnosis.findings import Evidence
    from elastocal.diagnosis.new_states import Instrument
    from elastocal.diagnosis.search import Model

# Draws of each model's coefficients, and times as many that are drawn where physics gives signs.
_DRAWS, _SPARE = 4, 16


@dataclass(frozen=True)
class Members:
    """Models as they are after the present measurements; M of them.

    `names`: of the hypotheses, the best first. `hypothesis` (M,) of int. `log_weights` (M,): of their probabilities, which sum
    to one. `columns`: of the unknowns that each has. `means` (M, U): of the unknowns; zero for those that a model does not
    have. `precisions` (d, d). `roots` (d, d): times white noise, deviations of its coefficients. `signs` (d,): that physics
    gives them, 0 where they may have either.
    """

    names: tuple[tuple[str, ...], ...]
    hypothesis: np.ndarray
    log_weights: np.ndarray
    columns: tuple[np.ndarray, ...]
    means: np.ndarray
    precisions: tuple[np.ndarray, ...]
    roots: tuple[np.ndarray, ...]
    signs: tuple[np.ndarray, ...]

    def without(self, hypotheses: Sequence[int]) -> Members:
        """These models without those of some hypotheses."""
        kept = np.flatnonzero(~np.isin(self.hypothesis, hypotheses))
        numbers = [h for h in range(len(self.names)) if h not in hypotheses]
        return Members(
            tuple(self.names[h] for h in numbers),
            np.searchsorted(numbers, self.hypothesis[kept]),
            self.log_weights[kept] - log_sum_exp(self.log_weights[kept]),
            tuple(self.columns[m] for m in kept),
            self.means[kept],
            tuple(self.precisions[m] for m in kept),
            tuple(self.roots[m] for m in kept),
            tuple(self.signs[m] for m in kept),
        )

    def drawn(self, model: int, count: int, stream: np.random.Generator) -> np.ndarray:
        """Coefficients from the posterior of one model, those that break no sign first, ndarray (count, U)."""
        columns, signs = self.columns[model], self.signs[model]
        spare = _SPARE if signs.any() else 1
        some = self.means[model][columns] + stream.standard_normal((spare * count, len(columns))) @ self.roots[model].T
        found = np.repeat(self.means[model][None], count, axis=0)
        found[:, columns] = some[np.argsort((some * signs < 0.0).any(axis=1), kind="stable")[:count]]
        return found


def members_of(
    evidence: Evidence, kept: Mapping[tuple[str, ...], Sequence[Model]], instrument: Instrument, lead: Model, factor: float
) -> Members:
    """Posterior of the coefficients of each model, in units of the noise that the leading model leaves.

    All models are taken at the pose error of the leading one; half-normal priors count as normal ones but in what is drawn.

    `kept`: models of each hypothesis, the best first. `factor`: times the noise taken that the leading model leaves.
    """
    problem, products = evidence.linearized.problem, evidence.linearized.products
    total, _ = normal_equations(products, lead.pose_error_rad)
    total = total / factor**2
    declared, added = products.declared, int(instrument.added.sum())
    place = np.zeros(products.gram.shape[0], int)
    place[declared + instrument.columns] = declared + np.arange(len(instrument.columns))
    unknown_places = np.arange(instrument.unknowns - added, instrument.unknowns)
    hypothesis, odds, columns, means, precisions, roots, signs = [], [], [], [], [], [], []
    for number, (_, models) in enumerate(kept.items()):
        for model in models:
            mine, deviations = problem.columns_of(model.units, model.scales)
            chosen = np.concatenate([np.arange(declared), declared + mine])
            precision = total[np.ix_(chosen, chosen)] + np.diag(np.append(np.zeros(declared), (factor * deviations) ** -2))
            mean = np.zeros(instrument.unknowns)
            at = np.concatenate([np.arange(declared), place[declared + mine]])
            mean[at] = np.linalg.solve(precision, total[chosen, -1])
            # Places of further targets: a prior of a metre and a radian decides nothing.
            size = len(chosen) + added
            whole = np.eye(size)
            whole[: len(chosen), : len(chosen)] = precision
            hypothesis.append(number)
            odds.append(model.log_odds)
            columns.append(np.concatenate([at, unknown_places]))
            means.append(mean)
            precisions.append(whole)
            roots.append(np.linalg.inv(np.linalg.cholesky(whole)).T)
            given = [problem.units[n].signs for n in model.units]
            signs.append(np.concatenate([np.zeros(declared, int), *given, np.zeros(added, int)]))
    log_weights = np.array(odds)
    return Members(
        tuple(kept),
        np.array(hypothesis),
        log_weights - log_sum_exp(log_weights),
        tuple(columns),
        np.array(means),
        tuple(precisions),
        tuple(roots),
        tuple(signs),
    )


def _misfits(members: Members, information: np.ndarray, truths: np.ndarray) -> np.ndarray:
    """-2 ln p_j on average, but for what is common to all models, for measurements that true coefficients make.

    `information` (N, U, U), `truths` (T, U). Returns (N, T, M).
    """
    of_truths = information @ truths.T
    squares = (of_truths * truths.T).sum(axis=1)
    found = np.empty((len(information), len(truths), len(members.means)))
    for number, (columns, mean, precision) in enumerate(zip(members.columns, members.means, members.precisions, strict=True)):
        of_mean = information @ mean
        quadratic = squares - 2.0 * of_mean @ truths.T + (of_mean @ mean)[:, None]
        seen = of_truths[:, columns] - of_mean[:, columns, None]
        inner = information[:, columns[:, None], columns] + precision
        factor = np.linalg.cholesky(inner)
        inverse = np.linalg.inv(inner)
        quadratic -= (seen * (inverse @ seen)).sum(axis=1)
        log_det = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1) - np.linalg.slogdet(precision)[1]
        common = (inverse * precision).sum(axis=(1, 2)) - len(columns) + log_det
        found[..., number] = quadratic + common[:, None]
    return found


@dataclass(frozen=True)
class Criterion:
    """Entropy of the hypotheses that an experiment leaves, by pairwise separations.

    `truths` (T, U): draws of each model's coefficients. `source` (T,) of int: whose.
    """

    members: Members
    truths: np.ndarray
    source: np.ndarray

    @classmethod
    def of(cls, members: Members, stream: np.random.Generator) -> Criterion:
        """With fresh draws."""
        count = len(members.means)
        truths = np.concatenate([members.drawn(model, _DRAWS, stream) for model in range(count)])
        return cls(members, truths, np.repeat(np.arange(count), _DRAWS))

    @property
    def work(self) -> int:
        """Multiplications for one entry."""
        return sum(len(columns) ** 3 for columns in self.members.columns) + self.truths.size * self.truths.shape[1]

    def left(self, information: np.ndarray) -> np.ndarray:
        """Entropy left after experiments of some information (N, U, U), ndarray (N,), nats."""
        misfits = _misfits(self.members, information, self.truths)
        own = misfits[:, np.arange(len(self.source)), self.source]
        exponents = self.members.log_weights - (misfits - own[..., None]) / 8.0
        mine = self.members.hypothesis == self.members.hypothesis[self.source][:, None]
        right = log_sum_exp(np.where(mine, exponents, -np.inf), axis=2)
        weights = np.exp(self.members.log_weights[self.source]) / _DRAWS
        return (log_sum_exp(exponents, axis=2) - right) @ weights
