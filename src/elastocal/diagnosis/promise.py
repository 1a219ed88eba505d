"""What an experiment promises: simulated, with coefficients from the posterior and measurements of the whole experiment.

Preposterior analysis [1]. Where coefficients are known, odds of 19:1 are reached with 50, 90 and 95 % if the separation is 6,
16 and 21; where they may turn out small, the separation that is stated is the one for which this holds.

[1] Raiffa, H. and Schlaifer, R., Applied Statistical Decision Theory, Harvard University, 1961.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.proposal import MOST_POSES, WANTED_PROBABILITY

if TYPE_CHECKING:
    from elastocal.diagnosis.alternatives import Members

# Separations with which odds of 19:1 are reached in half of all experiments: ln 19 = lambda / 2 - z sqrt(lambda).
HALF_RESOLVED = 2 * np.log(19.0)
# Of each hypothesis (standard error 2 %).
PROMISE_DRAWS = 600


class Promise:
    """What an experiment brings, by simulation with the same random numbers for every experiment.

    Common random numbers [1]: experiments differ by what they tell, not by luck.

    [1] Glasserman, P. and Yao, D. D., Some guidelines and guarantees for common random numbers, Management Science 38, 1992.
    """

    def __init__(self, members: Members, stream: np.random.Generator) -> None:
        self.members = members
        hypotheses = len(members.names)
        self.log_prior = np.array([log_sum_exp(members.log_weights[members.hypothesis == h]) for h in range(hypotheses)])
        truths, self.hypothesis = [], np.repeat(np.arange(hypotheses), PROMISE_DRAWS)
        for h in range(hypotheses):
            mine = np.flatnonzero(members.hypothesis == h)
            share = np.exp(members.log_weights[mine] - self.log_prior[h])
            counts = np.bincount(stream.choice(len(mine), PROMISE_DRAWS, p=share / share.sum()), minlength=len(mine))
            truths += [members.drawn(int(model), int(count), stream) for model, count in zip(mine, counts, strict=True)]
        self.truths = np.concatenate(truths)
        self.white = stream.standard_normal(self.truths.shape)

    def log_factors(self, information: np.ndarray) -> np.ndarray:
        """ln p of the simulated measurements under each hypothesis, but for what is common to all; ndarray (N, H).

        `information` (U, U): of a whole experiment.
        """
        members = self.members
        values, vectors = np.linalg.eigh(information)
        noise = self.white @ (vectors * np.sqrt(np.clip(values, 0.0, None))).T
        logs, of_truths = np.empty((len(self.truths), len(members.means))), self.truths @ information
        for number, (columns, mean, precision) in enumerate(
            zip(members.columns, members.means, members.precisions, strict=True)
        ):
            off = self.truths - mean
            seen = of_truths - mean @ information
            inner = precision + information[np.ix_(columns, columns)]
            along = (seen + noise)[:, columns]
            quadratic = ((seen + 2.0 * noise) * off).sum(axis=1) - (along * np.linalg.solve(inner, along.T).T).sum(axis=1)
            logs[:, number] = -0.5 * (quadratic + np.linalg.slogdet(inner)[1] - np.linalg.slogdet(precision)[1])
        logs += members.log_weights
        found = [log_sum_exp(logs[:, members.hypothesis == h], axis=1) for h in range(len(members.names))]
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
            factors = [logs[self.hypothesis == true, true] - logs[self.hypothesis == true, h - true] for true in (0, h)]
            mean = shares @ [factor.mean() for factor in factors]
            often = shares @ [(factor >= np.log(19.0)).mean() for factor in factors]
            found[h] = max(min(2.0 * mean, separation_resolved(often)), 0.0)
        return found

    def resolved(self, logs: np.ndarray) -> float:
        """Probability that the right hypothesis ends up with odds of 19:1, by `log_factors` of an experiment."""
        logs = logs + self.log_prior
        right = logs[np.arange(len(logs)), self.hypothesis] - log_sum_exp(logs, axis=1) >= np.log(0.95)
        weights = np.exp(self.log_prior[self.hypothesis]) / PROMISE_DRAWS
        return float(right @ weights / weights.sum())


def separation_resolved(probability: float) -> float:
    """Separation of two fixed hypotheses with which one gets odds of 19:1 so often: ln 19 = lambda / 2 - z sqrt(lambda).

    The log Bayes factor of two normal distributions with one covariance is normal, with mean lambda / 2 and variance lambda.
    """
    z = ndtri(probability)
    return float((z + np.sqrt(z**2 + 2 * np.log(19.0))) ** 2) if probability > 0 else 0.0


def poses_needed(promise: Promise, total: np.ndarray, resolved: np.ndarray) -> int | None:
    """Poses after which 90 % are resolved: of those proposed, or as many more as tell the same.

    By bisection in the number of poses.

    `total` (U, U): information of all poses proposed. `resolved` (E,): probability that it is resolved after each. Returns None
    beyond the most.
    """
    enough = np.flatnonzero(resolved >= WANTED_PROBABILITY)
    if len(enough):
        return int(enough[0]) + 1
    poses = len(resolved)
    low, high = poses, MOST_POSES
    if high <= poses or promise.resolved(promise.log_factors(total * (high / poses))) < WANTED_PROBABILITY:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if promise.resolved(promise.log_factors(total * (middle / poses))) >= WANTED_PROBABILITY:
            high = middle
        else:
            low = middle
    return high
