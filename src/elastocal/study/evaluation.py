"""From identified compliances to the figures that judge a strategy, block of data sets by block.

Two views of the same estimates: the paper's, which averages the stiffness over all data sets before it looks at the error
(equations 12-15), and that of somebody who has one data set.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from elastocal.study.metrics import (
    Judge,
    first_length_below,
    k_sigma,
    length_to_reach,
    mean_deviation,
    position_errors,
    relative_stiffness_error,
    split_models,
)

LARGEST_TRUSTED_SPREAD = 0.25


@dataclass(frozen=True)
class Averages:
    """Averages over data sets, replicate 0 with every data set once, the others with bootstrap weights.

    `compliance` (1 + replicates, lengths, n): inverse of the averaged stiffness, rad/(N m). `deviation` (1 + replicates,
    lengths): Equation 15, m. `initial_deviation` (1 + replicates, lengths): the same without any model; it does not depend on
    the length. `nonpositive_share`, `relative_spread` (lengths,).
    """

    compliance: np.ndarray
    deviation: np.ndarray
    initial_deviation: np.ndarray
    nonpositive_share: np.ndarray
    relative_spread: np.ndarray


def average(
    blocks: Iterable[tuple[np.ndarray, np.ndarray]], judge: Judge, method: str, deviation_of: str, test_weights: np.ndarray
) -> Averages:
    """Average the estimates over data sets (equation 12) and score the averaged model (equation 15).

    A replicate multiplies weights of data sets by independent weights of test configurations: the product-weight bootstrap of
    crossed factors [1].

    `blocks` (compliance, weights): compliances (sets, lengths, n) and bootstrap weights (1 + replicates, sets). `method`: what
    is averaged: 1/c or c, by its mean; or the median of c (interpretation R7). `deviation_of`: whether equation 15 scores the
    averaged model or averages the scores of the data sets (interpretation R8). `test_weights` (1 + replicates, tests): from
    `bootstrap.bootstrap_test_weights`: the error of equation 15 is one over data sets and over test configurations. Where each
    data set is scored, the deviation has the weights of data sets alone.

    [1] Owen, A. B. and Eckles, D., Bootstrapping data arrays of arbitrary order, Annals of Applied Statistics 6, 2012.
    """
    if method == "median":
        compliances, weights = zip(*blocks, strict=True)
        blocks = [(np.concatenate(compliances), np.concatenate(weights, axis=1))]
    zero: np.ndarray = np.zeros(())
    total = sums = scores = moments = nonpositive = zero
    sets = 0
    for compliance, weights in blocks:
        sets += len(compliance)
        total = total + weights.sum(axis=1)
        nonpositive = nonpositive + (compliance <= 0).any(axis=-1).sum(axis=0)
        scaled = compliance / judge.reference
        moments = moments + np.stack([scaled.sum(axis=0), (scaled**2).sum(axis=0)])
        if method == "median":
            averaged = _weighted_medians(compliance, weights)
        else:
            values = compliance if method == "compliance" else 1.0 / compliance
            sums = sums + np.tensordot(weights, values, axes=1)
        if deviation_of == "each_data_set":
            scores = scores + weights @ mean_deviation(judge, compliance)
    if method != "median":
        averaged = sums / total[:, None, None]
        averaged = averaged if method == "compliance" else 1.0 / averaged
    deviation = mean_deviation(judge, averaged, test_weights) if deviation_of == "averaged_model" else scores / total[:, None]
    initial = np.broadcast_to((test_weights @ judge.initial_errors / test_weights.sum(axis=1))[:, None], deviation.shape)
    mean, square = moments / sets
    spread = (np.sqrt(np.maximum(square - mean**2, 0.0)) / np.abs(mean)).max(axis=-1)
    return Averages(averaged, deviation, initial, nonpositive / sets, spread)


def metrics_table(averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]) -> dict[str, np.ndarray]:
    """Columns of the metrics table, one row for each length, from `average`.

    `true_compliance` (n,).
    """
    replicated = {}
    relative = relative_stiffness_error(averages.compliance, true_compliance)
    for j in range(len(true_compliance)):
        replicated[f"compliance_{j + 1}"] = averages.compliance[..., j]
        replicated[f"delta_k_{j + 1}"] = relative[..., j]
    replicated |= _replicated_scores(averages, true_compliance, fixed_joints)
    table = {"length": np.arange(1, averages.deviation.shape[1] + 1)}
    for name, values in replicated.items():
        table[name], table[f"{name}_std_error"] = values[0], values[1:].std(axis=0, ddof=1)
    table["nonpositive_share"], table["relative_spread"] = averages.nonpositive_share, averages.relative_spread
    with np.errstate(invalid="ignore"):
        table["trustworthy"] = (averages.nonpositive_share == 0) & (averages.relative_spread <= LARGEST_TRUSTED_SPREAD)
    return table


def replicates_table(averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]) -> dict[str, np.ndarray]:
    """Columns of the replicates table: the scores of every bootstrap replicate at every length.

    `averages`, `true_compliance`, `fixed_joints`: as in `metrics_table`.
    """
    replicates, lengths = averages.deviation[1:].shape
    table = {
        "replicate": np.repeat(np.arange(1, replicates + 1), lengths),
        "length": np.tile(np.arange(1, lengths + 1), replicates),
    }
    scores = _replicated_scores(averages, true_compliance, fixed_joints)
    return table | {name: values[1:].ravel() for name, values in scores.items()}


def accuracy_sums(compliance: np.ndarray, judge: Judge) -> np.ndarray:
    """What one data set gives, summed over the data sets of a block: add the sums of blocks for `accuracy_table`.

    `compliance` (sets, lengths, n): rad/(N m), of the lengths to evaluate. Returns (3, lengths, 4 + n): number of data sets,
    sum and sum of squares of: mean (m), mean square (m^2), 95th percentile and largest (m) of the position error over the test
    configurations, squared relative error of each compliance.
    """
    sets, lengths, _ = compliance.shape
    single = np.empty((sets, lengths, 4))
    for part in split_models(sets, lengths):
        single[part] = _scores_of_one_data_set(compliance[part], judge)
    values = np.concatenate([single, ((compliance - judge.reference) / judge.reference) ** 2], axis=-1)
    return np.stack([np.full(values.shape[1:], float(sets)), values.sum(axis=0), (values**2).sum(axis=0)])


def accuracy_table(sums: np.ndarray, lengths: Sequence[int]) -> dict[str, np.ndarray]:
    """Columns of the accuracy table: what one data set gives, averaged over data sets.

    Standard errors of roots are by the delta method.

    `sums` (3, lengths, 4 + n): from `accuracy_sums`, of all data sets. `lengths`: data set lengths that they stand for.
    """
    sets, (mean, second) = sums[0, 0, 0], sums[1:] / sums[0]
    error = np.sqrt(np.maximum(second - mean**2, 0.0) / max(sets - 1, 1))
    squared = np.zeros(mean.shape[1], bool)
    squared[[1, *range(4, mean.shape[1])]] = True
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.where(squared & (mean > 0), error / (2 * np.sqrt(mean)), error)
    mean = np.where(squared, np.sqrt(mean), mean)
    names = ["mean", "rms", "p95", "max", *(f"relative_error_{j + 1}" for j in range(mean.shape[1] - 4))]
    table = {"length": np.asarray(lengths)}
    for column, name in enumerate(names):
        scale = 100.0 if name.startswith("relative") else 1.0
        table[name], table[f"{name}_std_error"] = scale * mean[:, column], scale * error[:, column]
    return table


def find_length(values: np.ndarray, replicate_values: np.ndarray, limit: float) -> tuple[float, float]:
    """First length at which a metric is at most `limit`, with its Monte Carlo standard error.

    `values` (lengths,), `replicate_values` (replicates, lengths). Returns `length`, `std_error`: the length is infinite where
    it is not reached; replicates that do not reach it are continued, see `metrics.length_to_reach`, since leaving them out
    would make the error too small.
    """
    return float(first_length_below(values, limit)), float(np.std(length_to_reach(replicate_values, limit), ddof=1))


def _scores_of_one_data_set(compliance: np.ndarray, judge: Judge) -> np.ndarray:
    """Mean, mean square, 95th percentile and largest of the position error, (sets, lengths, 4)."""
    sets, lengths, n = compliance.shape
    errors = position_errors(judge, compliance.reshape(-1, n))
    rank = int(np.ceil(0.95 * errors.shape[1])) - 1
    mean, square = errors.mean(axis=1), np.einsum("mt,mt->m", errors, errors) / errors.shape[1]
    errors.partition(rank, axis=1)
    return np.stack([mean, square, errors[:, rank], errors[:, rank:].max(axis=1)], 1).reshape(sets, lengths, 4)


def _replicated_scores(averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]) -> dict[str, np.ndarray]:
    return {
        "k_sigma": k_sigma(averages.compliance, true_compliance),
        "k_sigma_fixed_joints": k_sigma(averages.compliance, true_compliance, list(fixed_joints)),
        "deviation": averages.deviation,
        "initial_deviation": averages.initial_deviation,
    }


def _weighted_medians(compliance: np.ndarray, weights: np.ndarray) -> np.ndarray:
    counts = weights.astype(int)
    return np.stack([np.median(np.repeat(compliance, count, axis=0), axis=0) for count in counts])
