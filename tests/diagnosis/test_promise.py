"""What an experiment promises: by measurements row by row, and by two normal distributions with one covariance."""

import numpy as np
import pytest
from open_alternatives import pieces
from scipy.stats import ks_2samp, multivariate_normal, norm

from elastocal.diagnosis import new_states
from elastocal.diagnosis.alternatives import Members
from elastocal.diagnosis.evidence import log_sum_exp
from elastocal.diagnosis.promise import HALF_RESOLVED, PROMISE_DRAWS, Promise, poses_needed, separation_resolved
from elastocal.diagnosis.proposal import MOST_POSES, WANTED_PROBABILITY


def test_promised_separation_is_twice_the_mean_log_bayes_factor_of_simulated_measurements(ambiguous, kuka):
    """Measurements row by row and their normal densities, against the promise from information alone; 600 draws of each.

    Kolmogorov-Smirnov at 0.1 % sees a shift of 0.4 standard deviations with a power of 0.9; means at 4 standard errors.
    """
    members, instrument, reach = pieces(ambiguous[0], kuka)
    rng = np.random.default_rng(0)
    targets = list(range(len(instrument.model.targets)))
    entries = new_states.drawn(reach, 15, rng)
    rows = instrument.rows(entries, targets).reshape(-1, instrument.unknowns)
    promise = Promise(members, rng)
    information = instrument.information(entries, targets).sum(axis=0)
    simulated = promise.log_factors(information)
    promised = promise.separations(simulated)
    densities = []
    for columns, mean, precision in zip(members.columns, members.means, members.precisions, strict=True):
        mine = rows[:, columns]
        covariance = np.eye(len(rows)) + mine @ np.linalg.solve(precision, mine.T)
        densities.append(multivariate_normal(rows @ mean, covariance))
    draws, hypotheses = 600, len(members.names)
    logs = np.empty((hypotheses, draws, hypotheses))
    for source in range(hypotheses):
        mine = np.flatnonzero(members.hypothesis == source)
        weight = np.exp(members.log_weights[mine])
        models = rng.choice(mine, draws, p=weight / weight.sum())
        truths = np.concatenate([members.drawn(model, 1, rng) for model in models])
        measurements = truths @ rows.T + rng.standard_normal((draws, len(rows)))
        each = np.column_stack([density.logpdf(measurements) for density in densities]) + members.log_weights
        for h in range(hypotheses):
            these = members.hypothesis == h
            logs[source, :, h] = log_sum_exp(each[:, these], axis=1) - log_sum_exp(members.log_weights[these])
    weights = np.array([np.exp(members.log_weights[members.hypothesis == h]).sum() for h in range(hypotheses)])
    for h in range(1, hypotheses):
        for_best, against = logs[0, :, 0] - logs[0, :, h], logs[h, :, h] - logs[h, :, 0]
        mine = simulated[promise.hypothesis == 0]
        assert ks_2samp(for_best, mine[:, 0] - mine[:, h]).pvalue > 1e-3
        mean = 2 * (weights[0] * for_best.mean() + weights[h] * against.mean()) / (weights[0] + weights[h])
        spread = 2 * max(for_best.std(), against.std())
        often = (weights[0] * (for_best > np.log(19)).mean() + weights[h] * (against > np.log(19)).mean()) / weights[
            [0, h]
        ].sum()
        error = spread * np.sqrt(1 / draws + 1 / PROMISE_DRAWS)
        # The smaller of both is stated; of a share of 1,200 draws, the separation that belongs to it is as sure as its slope.
        share = np.sqrt(often * (1 - often) * (1 / draws + 1 / PROMISE_DRAWS)) + 1e-3
        low, high = (separation_resolved(np.clip(often + 4 * side * share, 0, 1 - 1e-9)) for side in (-1, 1))
        assert min(mean - 4 * error, low) <= promised[h] <= min(mean + 4 * error, high), (h, promised, mean, often)


def test_stated_separation_is_that_of_two_fixed_hypotheses_resolved_as_often():
    rng = np.random.default_rng(0)
    for separation, often in ((2 * np.log(19), 0.5), (16.2, 0.9), (21.0, 0.95)):
        factors = separation / 2 + np.sqrt(separation) * rng.standard_normal(200_000)
        assert abs((factors >= np.log(19)).mean() - often) < 0.005
        assert abs(separation_resolved(often) - separation) < 0.2


# So sure that coefficients are as good as known.
CERTAIN = 1e12


def fixed(*means, weights=None, hypotheses=None):
    """Hypotheses of one model each, unless given, whose coefficients are known."""
    means = np.array(means, float)
    count, unknowns = means.shape
    weights = np.full(count, 1 / count) if weights is None else np.array(weights)
    hypotheses = np.arange(count) if hypotheses is None else np.array(hypotheses)
    every = np.arange(unknowns)
    return Members(
        tuple((f"h{number}",) for number in range(hypotheses.max() + 1)),
        hypotheses,
        np.log(weights),
        (every,) * count,
        means,
        (CERTAIN * np.eye(unknowns),) * count,
        (np.eye(unknowns) / np.sqrt(CERTAIN),) * count,
        (np.zeros(unknowns, int),) * count,
    )


def information_for(separation):
    """Of two unknowns, with which coefficients (1, 0) and (0, 1) are apart by so much."""
    return 0.5 * separation * np.eye(2)


@pytest.mark.parametrize("separation", [2.0, HALF_RESOLVED, 16.2])
def test_log_factors_of_two_fixed_hypotheses_are_normal_with_mean_half_the_separation(separation):
    """Mean lambda / 2 and variance lambda for the right one; 600 draws of each.

    At 5 standard errors: false once in a million, and a mean off by 0.26 standard deviations is seen with a power of 0.9.
    """
    promise = Promise(fixed([1, 0], [0, 1]), np.random.default_rng(0))
    logs = promise.log_factors(information_for(separation))
    for source in (0, 1):
        mine = promise.hypothesis == source
        factor = logs[mine, source] - logs[mine, 1 - source]
        assert abs(factor.mean() - separation / 2) < 5 * np.sqrt(separation / PROMISE_DRAWS)
        assert abs(factor.var() / separation - 1) < 5 * np.sqrt(2 / PROMISE_DRAWS)
    # With 1,200 draws in all: of a share of 0.9 the standard error is 0.009, of a half 0.014.
    often = norm.cdf((separation / 2 - np.log(19)) / np.sqrt(separation))
    assert abs(promise.resolved(logs) - often) < 5 * np.sqrt(often * (1 - often) / (2 * PROMISE_DRAWS))


def test_models_of_one_hypothesis_count_together_by_their_weights():
    """Two models of one hypothesis that are as far apart as can be are nothing to resolve, and their prior is their sum."""
    members = fixed([1, 0], [-1, 0], [0, 1], weights=(0.15, 0.45, 0.4), hypotheses=(0, 0, 1))
    promise = Promise(members, np.random.default_rng(3))
    np.testing.assert_allclose(np.exp(promise.log_prior), [0.6, 0.4])
    drawn = promise.truths[promise.hypothesis == 0, 0]
    # 600 draws of two models with 1/4 and 3/4: 5 standard errors are 0.09.
    assert abs((drawn > 0).mean() - 0.25) < 5 * np.sqrt(0.25 * 0.75 / PROMISE_DRAWS)
    far = 1e4 * np.eye(2)
    assert promise.resolved(promise.log_factors(far)) == pytest.approx(1.0)


def test_separation_resolved_solves_its_equation_and_is_none_where_nothing_is_resolved():
    """ln 19 = lambda / 2 - z sqrt(lambda), with z of the probability."""
    assert separation_resolved(0.0) == 0.0 and separation_resolved(0.5) == pytest.approx(HALF_RESOLVED)
    for often in (0.01, 0.3, 0.5, 0.9, 0.99):
        size = separation_resolved(often)
        assert size / 2 - norm.ppf(often) * np.sqrt(size) == pytest.approx(np.log(19))


@pytest.mark.parametrize(("each", "proposed"), [(0.7, 5), (3.0, 4), (0.25, 10)])
def test_poses_needed_are_the_first_that_resolve_nine_tenths(each, proposed):
    """Fixed hypotheses need a separation of 16.2: every pose brings `each`."""
    promise = Promise(fixed([1, 0], [0, 1]), np.random.default_rng(5))

    def resolved(poses):
        return promise.resolved(promise.log_factors(information_for(each * poses)))

    found = poses_needed(promise, information_for(each * proposed), np.array([resolved(n + 1) for n in range(proposed)]))
    assert resolved(found) >= WANTED_PROBABILITY > resolved(found - 1)
    # Of 1,200 draws a share of 0.9 is known to 0.009, which is 0.4 of the separation; and whole poses.
    assert abs(found * each - 16.2) < 5 * 0.4 + each


def test_poses_needed_are_one_of_those_proposed_where_they_are_enough():
    assert poses_needed(None, None, np.array([0.5, 0.91, 0.89, 0.99])) == 2


def test_more_poses_than_anyone_measures_are_none():
    promise = Promise(fixed([1, 0], [0, 1]), np.random.default_rng(6))
    few = np.full(10, 0.01)
    # A hundred poses bring a separation of 12, where 16.2 is needed; of 22 they are enough.
    assert poses_needed(promise, information_for(12 * 10 / MOST_POSES), few) is None
    assert 60 < poses_needed(promise, information_for(22 * 10 / MOST_POSES), few) < MOST_POSES
    assert poses_needed(promise, information_for(1.0), np.full(MOST_POSES, 0.1)) is None
