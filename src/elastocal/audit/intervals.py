"""Intervals over poses as docs/held_out_intervals.md describes them: bootstrap-t, Student's t, Woodruff's of a percentile."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    from collections.abc import Sequence

_REPLICATES = 1000
# Fewer poses, and more, have Student's t.
_DRAWN = range(6, 301)
# What is smaller is rounding.
_NOTHING = 1e-12


@dataclass(frozen=True)
class Errors:
    """Position errors of several models for the same measurements.

    `distances` (M,): m, of each model. `pose` (M,): by any name of the pose. `outside` (M,) of bool: whether the pose is known
    to lie beyond those that were fitted.
    """

    distances: tuple[np.ndarray, ...]
    pose: np.ndarray
    outside: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def poses(self) -> int:
        """How many."""
        return len(np.unique(self.pose))

    def totals(self, model: int, power: int) -> np.ndarray:
        """Sum of a power of a model's errors in each pose."""
        number = np.unique(self.pose, return_inverse=True)[1]
        return np.bincount(number, self.distances[model] ** power)


def drawn(generator: np.random.Generator, poses: int) -> np.ndarray | None:
    """How often each pose counts in each replicate (B, P), those of one pose alone left out; None where none are drawn."""
    if poses not in _DRAWN:
        return None
    counts = generator.multinomial(poses, [1 / poses] * poses, _REPLICATES)
    return np.array([row for row in counts if np.count_nonzero(row) > 1])


def log_ratio(over: np.ndarray, under: np.ndarray, counts: np.ndarray | None) -> tuple[float, float, float]:
    """Interval of the logarithm of a ratio of totals, and its standard error.

    `over`, `under` (P,): of each pose. `counts` (B, P): from `drawn`.
    """
    poses = len(over)
    if poses < 2:
        return np.nan, np.nan, np.nan
    value, error = _jackknifed(np.arange(poses), over, under)
    if error <= _NOTHING:
        return value, value, 0.0
    if counts is None:
        below, above = np.array(stats.t.ppf([0.025, 0.975], poses - 1))
    else:
        found = [_jackknifed(np.repeat(np.arange(poses), row), over, under) for row in counts]
        pivots = [(one - value) / own for one, own in found if own > _NOTHING]
        # What the largest pivots say of the lower end, the smallest say of the upper one.
        farthest = stats.t.ppf(0.975, 2)
        above, below = np.clip(-np.quantile(pivots, [0.025, 0.975]), -farthest, farthest)
    return value + error * below, value + error * above, error


def _jackknifed(members: np.ndarray, over: np.ndarray, under: np.ndarray) -> tuple[float, float]:
    """Logarithm of the ratio over some poses, and its standard error by leaving each of them out."""
    top, bottom = over[members], under[members]
    left = np.log((top.sum() - top) / (bottom.sum() - bottom))
    error = np.sqrt((len(members) - 1) * np.var(left))
    return float(np.log(top.sum() / bottom.sum())), float(error)


def limits(errors: Errors, counts: np.ndarray | None, model: int) -> dict[str, tuple[float, float]]:
    """Intervals of mean, RMS, 95th percentile and maximum of a model's errors.

    `counts` (B, P). Returns (float, float).
    """
    number = errors.totals(model, 0)
    mean = log_ratio(errors.totals(model, 1), number, counts)
    square = log_ratio(errors.totals(model, 2), number, counts)
    return {
        "mean": (float(np.exp(mean[0])), float(np.exp(mean[1]))),
        "rms": (float(np.exp(square[0] / 2)), float(np.exp(square[1] / 2))),
        "p95": _of_percentile(errors.distances[model], errors.pose),
        "max": (np.nan, np.nan),
    }


def reduction(errors: Errors, counts: np.ndarray | None, before: int, after: int) -> tuple[float, float, float]:
    """Interval and standard error of the share by which the RMS falls from one model to another."""
    squares = errors.totals(before, 2), errors.totals(after, 2)
    low, high, error = log_ratio(squares[1], squares[0], counts)
    ratio = float(np.sqrt(squares[1].sum() / squares[0].sum()))
    return 1 - float(np.exp(high / 2)), 1 - float(np.exp(low / 2)), ratio * error / 2


def _of_percentile(distance: np.ndarray, pose: np.ndarray) -> tuple[float, float]:
    """Interval of the 95th percentile by ranks, at the number of measurements that poses are worth."""
    poses = np.unique(pose)
    if len(poses) < 2:
        return np.nan, np.nan
    below = distance <= np.quantile(distance, 0.95)
    share = below.mean()
    spread = sum((below[pose == one] - share).sum() ** 2 for one in poses) * len(poses) / (len(poses) - 1)
    design = max(spread / (len(distance) * max(share * (1 - share), _NOTHING)), 1.0)
    worth = int(len(distance) / design)
    first, last = np.array(stats.binom.ppf([0.025, 0.975], worth, 0.95))
    rising, each = np.sort(distance), len(distance) / worth
    low = rising[int(first * each) - 1] if first >= 1 else 0.0
    high = rising[int(np.ceil((last + 1) * each)) - 1] if last < worth else np.inf
    return float(low), float(high)


def metrics(distance: np.ndarray) -> dict[str, float]:
    """Mean, RMS, 95th percentile and maximum of errors (M,), m."""
    return {
        "mean": float(np.mean(distance)),
        "rms": float(np.sqrt(np.mean(np.square(distance)))),
        "p95": float(np.percentile(distance, 95)),
        "max": float(np.max(distance)),
    }


def distances(residuals: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Lengths of position residuals (M, 3 or more) of several models."""
    return tuple(np.sqrt((np.asarray(each)[:, :3] ** 2).sum(axis=1)) for each in residuals)
