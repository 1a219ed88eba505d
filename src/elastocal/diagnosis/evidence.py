"""Bayes factors of models (Kass and Raftery, JASA 1995) from sufficient statistics.

Coefficients of a unit are normal about zero with standard deviation s times their
plausible size, one size s for the unit: a local prior beside the probability that the
unit is not there, spike and slab (Mitchell and Beauchamp, JASA 1988). With D the
diagonal of all s^2,

    ln p(y | model, s, tau) = -1/2 ln |I + D^1/2 G D^1/2| + l(y'My - b'(G + D^-1)^-1 b),

where l(rss) = -nu/2 ln sigma^2 - rss / (2 sigma^2) at sigma^2 = max(rss / nu, 1): the
noise is at least what repeats or the campaign say, or else a smooth competitor could
interpolate. Above one it is profiled, and the priors widen with it as conjugate ones
do. Sizes and tau are averaged over, never maximised, as g is in mixtures of g priors
(Liang et al., JASA 2008).

Where physics gives a coefficient its sign, the prior is half-normal: the Bayes factor
of the normal one times twice the posterior probability of that sign, as against an
encompassing model (Klugkist et al., Psychological Methods 2005); of several such
coefficients as if they were independent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack, solve_triangular
from scipy.special import log_ndtr

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from elastocal.diagnosis.hypotheses import ModelTerm
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.statistics import SufficientStatistics


def log_sum_exp(
    values: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> np.ndarray:
    """ln of the sum of exponentials, as scipy's logsumexp without its cost on small
    arrays.

    Returns without these axes; of no dimension where all are summed.
    """
    highest = np.max(values, axis=axis, keepdims=True)
    highest = np.where(np.isfinite(highest), highest, 0.0)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(values - highest).sum(axis=axis, keepdims=True)) + highest
    return total.squeeze() if axis is None else total.squeeze(axis)


@dataclass(frozen=True)
class SizeGrid:
    """Sizes that are averaged over, with the logarithms of their weights. `scales`,
    `log_weights` (S,)."""

    scales: np.ndarray
    log_weights: np.ndarray

    @classmethod
    def from_settings(cls, settings: Settings) -> SizeGrid:
        """Sizes whose logarithms have normal pieces below and above the most likely
        size."""
        off = np.log(np.asarray(settings.scales) / settings.scale_center)
        log_weights = -0.5 * (off / np.where(off < 0, *settings.scale_spread)) ** 2
        return cls(np.array(settings.scales), log_weights - log_sum_exp(log_weights))

    def of(self, unit: ModelTerm) -> np.ndarray:
        """Logarithms of the weights for one unit: sizes from its smallest to its
        largest share them, ndarray (S,)."""
        return self.between(unit.smallest, unit.largest)

    def between(self, smallest: int, largest: int) -> np.ndarray:
        """The same by the places of both sizes."""
        return self._between[smallest, largest]

    def root_mean_square(self, unit: ModelTerm) -> float:
        """Standard deviation of a coefficient of a unit before the measurements, over
        all its sizes, in plausible sizes."""
        return float(np.sqrt(np.exp(self.of(unit)) @ self.scales**2))

    @cached_property
    def _between(self) -> np.ndarray:
        """Weights from each size to each, ndarray (S, S, S)."""
        places = np.arange(len(self.scales))
        outside = (places < places[:, None, None]) | (places > places[:, None])
        weights = np.where(outside, -np.inf, self.log_weights)
        with np.errstate(invalid="ignore"):
            return weights - log_sum_exp(weights, axis=2)[..., None]


def compute_pose_error_log_prior(
    pose_error_rad: np.ndarray, settings: Settings
) -> np.ndarray:
    """Logarithms of the prior weights of sizes of the pose error, one of which is zero,
    (T,)."""
    there = pose_error_rad > 0
    share = settings.pose_error_probability / max(there.sum(), 1)
    return np.log(np.where(there, share, 1.0 - settings.pose_error_probability))


def log_likelihood(squares: np.ndarray, freedom: int) -> np.ndarray:
    """l(rss): the profiled likelihood of the noise, which is at least one."""
    variance = np.maximum(squares / freedom, 1.0)
    return -0.5 * freedom * np.log(variance) - 0.5 * squares / variance


@dataclass(frozen=True)
class TermBlock:
    """Units of one width d: their `numbers` (U,), `columns` (U, d), and W'MW of the
    columns of each, `gram` (T, U, d, d)."""

    numbers: np.ndarray
    columns: np.ndarray
    gram: np.ndarray

    @classmethod
    def of(
        cls, statistics: SufficientStatistics, units: Sequence[ModelTerm]
    ) -> list[TermBlock]:
        """Units in the order of their widths."""
        width = np.array([len(unit.columns) for unit in units], int)
        found = []
        for size in np.unique(width):
            numbers = np.flatnonzero(width == size)
            columns = np.array([units[number].columns for number in numbers.tolist()])
            found.append(cls(numbers, columns, statistics.between(columns, columns)))
        return found

    def at(self, chosen: np.ndarray | slice) -> TermBlock:
        """The same at some of the sizes of the pose error only."""
        found = TermBlock(self.numbers, self.columns, self.gram[chosen])
        vars(found)["axes"] = tuple(part[chosen] for part in self.axes)
        return found

    @cached_property
    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Principal axes of the blocks, V diag(values) V': values (T, U, d), V (T, U,
        d, d)."""
        values, vectors = (
            np.linalg.eigh(self.gram)
            if self.gram.shape[-1] > 1
            else (self.gram[..., 0], np.ones_like(self.gram))
        )
        return np.clip(values, 0.0, None), vectors


def _with_priors(
    statistics: SufficientStatistics, columns: np.ndarray, deviations: np.ndarray
) -> np.ndarray:
    """I + D^1/2 G D^1/2 of some columns, ndarray (T, D, D)."""
    inner = statistics.between(columns, columns)
    inner *= deviations[:, None]
    inner *= deviations
    inner[:, np.arange(len(columns)), np.arange(len(columns))] += 1.0
    return inner


def evaluate_extensions(
    statistics: SufficientStatistics,
    base: np.ndarray,
    given: tuple[np.ndarray, np.ndarray],
    blocks: Sequence[TermBlock],
    grid: SizeGrid,
) -> tuple[np.ndarray, np.ndarray]:
    """Log evidence of a model, and of the same with each single unit added, at every
    size of that unit.

    `base` (T,): what each tau contributes alone, with its prior. `given` (D,): columns
    of the model, and the prior standard deviation of each, in plausible sizes.
    `blocks`: of all units. Returns (T,); (T, number of units, S), not weighted by size.
    """
    columns, deviations = given
    factor = np.linalg.cholesky(_with_priors(statistics, columns, deviations))
    # Rows of W'MW of these columns, and of W'My, divided by the factor: what they take
    # from all others.
    right = deviations[:, None] * np.concatenate(
        [statistics.between(columns), statistics.score[:, columns, None]], axis=2
    )
    if len(columns):
        pairs = zip(factor, right, strict=True)
        right = np.array(
            [solve_triangular(*pair, lower=True, check_finite=False) for pair in pairs]
        )
    cross = right[..., :-1]
    fitted = right[..., -1]
    along_all = statistics.score - (fitted[:, None] @ cross)[:, 0]
    squares = statistics.residual_squares - (fitted**2).sum(axis=1)
    log_occam = base - np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    found = np.empty(
        (len(base), sum(len(each.numbers) for each in blocks), len(grid.scales))
    )
    variances = grid.scales**2
    for each in blocks:
        mine = cross[:, :, each.columns].transpose(0, 2, 1, 3)
        left = (
            replace(each, gram=each.gram - mine.swapaxes(-1, -2) @ mine)
            if len(columns)
            else each
        )
        values, vectors = left.axes
        turned = (vectors.swapaxes(-1, -2) @ along_all[:, each.columns, None])[
            ..., 0
        ] ** 2
        widened = 1.0 + values[..., None] * variances
        gains = (turned[..., None] * (variances / widened)).sum(axis=2)
        occam = -0.5 * np.log(widened).sum(axis=2)
        likelihood = log_likelihood(
            squares[:, None, None] - gains, statistics.degrees_of_freedom
        )
        found[:, each.numbers] = log_occam[:, None, None] + occam + likelihood
    return log_occam + log_likelihood(squares, statistics.degrees_of_freedom), found


@dataclass(frozen=True)
class ModelEvidence:
    """A model with its evidence, averaged over sizes and tau.

    `scales` (m,): most probable size of each unit. `log_pose` (T,): log posterior
    weight of each tau at these. `without` (m,): log evidence of the model without each
    of its units, the sizes of the others as they are.
    """

    log_evidence: float
    scales: np.ndarray
    log_pose: np.ndarray
    without: np.ndarray


def evaluate_model(
    statistics: SufficientStatistics,
    units: Sequence[ModelTerm],
    grid: SizeGrid,
    log_pose: np.ndarray,
    start: Iterable[float],
) -> ModelEvidence:
    """Evidence of one model, averaged over the sizes of its units.

    The sum over all combinations of sizes is taken as the product of the sums over each
    size about the mode; exact for one unit, and where sizes are independent given the
    measurements. The mode is found by coordinate ascent (iterated conditional modes;
    Besag, JRSS B 1986), all units at once where that raises the density and else those
    that gain most. One inverse gives what every unit sees given all others: with C the
    posterior covariance of the scaled coefficients, C_uu^-1 = I + s^2 G_uu|rest.

    `log_pose` (T,): logarithm of the prior weight of each size of the pose error.
    `start`: sizes from which the search for the mode starts; each in its grid.
    """
    off = [
        np.where(np.isfinite(grid.of(u)), np.abs(grid.scales - size), np.inf)
        for size, u in zip(start, units, strict=True)
    ]
    places = np.array([np.argmin(distances) for distances in off], int)
    present = ModelDensity(
        statistics, units, grid, statistics.log_likelihood + log_pose, places
    )
    profiles = present.profiles()
    while (moved := _ascended(statistics, present, profiles)) is not None:
        present = moved
        profiles = moved.profiles()
    numbers = np.arange(len(units))
    sums = log_sum_exp(profiles[:, 1:], axis=1) - profiles[numbers, 1 + present.places]
    log_posterior = present.by_pose_error - log_sum_exp(present.by_pose_error)
    without = profiles[:, 0] - sums + sums.sum()
    return ModelEvidence(
        float(present.log_density + sums.sum()), present.scales, log_posterior, without
    )


# Of what the steps of an ascent take, that which rounding may make.
_NO_GAIN = 1e-9
# So many times fewer units are moved where all at once do not raise the density.
_FEWER = 4


def _ascended(
    statistics: SufficientStatistics, present: ModelDensity, profiles: np.ndarray
) -> ModelDensity | None:
    """A step of the ascent: as many units as raise the density, those that gain most
    first; None at the mode.

    Sizes lie on a grid and the density rises, so that steps end.
    """
    best = profiles[:, 1:].argmax(axis=1)
    gains = (
        profiles[:, 1:].max(axis=1) - profiles[np.arange(len(best)), 1 + present.places]
    )
    order = np.argsort(-gains)
    count = int((gains > _NO_GAIN).sum())
    while count:
        places = present.places.copy()
        places[order[:count]] = best[order[:count]]
        moved = ModelDensity(
            statistics, present.terms, present.grid, present.base, places
        )
        if moved.log_density > present.log_density:
            return moved
        count = 0 if count == 1 else max(count // _FEWER, 1)
    return None


# Above so many columns LAPACK's inverse of positive matrices, called for each of them,
# costs less than all of numpy's together.
_MANY_COLUMNS = 30


def _inverses(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (T, D, D) of symmetric positive matrices, and the logarithms of their
    determinants (T,)."""
    if matrices.shape[1] < _MANY_COLUMNS:
        return np.linalg.inv(matrices), np.linalg.slogdet(matrices)[1]
    found = np.empty_like(matrices)
    log_dets = np.empty(len(matrices))
    for number, matrix in enumerate(matrices):
        # The transpose is laid out as LAPACK wants it.
        factor = lapack.dpotrf(matrix.T, lower=0, clean=1)[0]
        log_dets[number] = 2.0 * np.log(np.diag(factor)).sum()
        upper = lapack.dpotri(factor, lower=0, overwrite_c=1)[0]
        np.add(upper, upper.T, out=found[number])
        np.fill_diagonal(found[number], np.diag(upper))
    return found, log_dets


class ModelDensity:
    """Density of the measurements under one model with one size for each unit.

    `base` (T,): what each tau contributes alone, with its prior. `places` (m,) of int:
    size of each unit in the grid.
    """

    def __init__(
        self,
        statistics: SufficientStatistics,
        units: Sequence[ModelTerm],
        grid: SizeGrid,
        base: np.ndarray,
        places: np.ndarray,
    ) -> None:
        self.terms = units
        self.grid = grid
        self.base = base
        self.places = places
        self.freedom = statistics.degrees_of_freedom
        self.weights = np.array([grid.of(unit) for unit in units]).reshape(
            len(units), len(grid.scales)
        )
        self.scales = grid.scales[places]
        self.log_weights = self.weights[np.arange(len(units)), places]
        columns = np.concatenate([np.zeros(0, int), *(unit.columns for unit in units)])
        signs = np.concatenate([np.zeros(0, int), *(unit.signs for unit in units)])
        self.starts = np.concatenate(
            [[0], np.cumsum([len(unit.columns) for unit in units], dtype=int)]
        )
        deviations = np.repeat(self.scales, np.diff(self.starts))
        self.covariance, self.log_det = _inverses(
            _with_priors(statistics, columns, deviations)
        )
        along = deviations * statistics.score[:, columns]
        self.mean = (self.covariance @ along[..., None])[..., 0]
        self.squares = statistics.residual_squares - (along * self.mean).sum(axis=1)
        values = (
            self.base - 0.5 * self.log_det + log_likelihood(self.squares, self.freedom)
        )
        self.sign_factors = np.zeros((len(units), len(base)))
        for number in np.flatnonzero([unit.signs.any() for unit in units]):
            mine = slice(self.starts[number], self.starts[number + 1])
            variance = np.diagonal(self.covariance[:, mine, mine], axis1=1, axis2=2)
            self.sign_factors[number] = _log_sign_factor(
                self.mean[:, mine], variance, signs[mine], self.squares, self.freedom
            )
        self.by_pose_error = values + self.sign_factors.sum(axis=0)
        self.log_density = float(
            log_sum_exp(self.by_pose_error) + self.log_weights.sum()
        )

    def profiles(self) -> np.ndarray:
        """Log density over the sizes of each unit, the others as they are, for size
        zero first, ndarray (m, 1 + S)."""
        found = np.empty((len(self.terms), 1 + len(self.grid.scales)))
        for numbers, density, _, _ in self._over_sizes():
            found[numbers] = log_sum_exp(density, axis=1).T
        return found

    def moments(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Mean and variance of the coefficients of each unit, averaged over its sizes
        and tau; list of two ndarray (d,)."""
        found: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for numbers, density, coefficients, noise in self._over_sizes():
            weights = np.exp(density[1:] - log_sum_exp(density[1:], axis=(0, 1)))[
                ..., None
            ]
            means, variances = _turned_back(*coefficients)
            variances *= noise[..., None]
            centers = (weights * means).sum(axis=(0, 1))
            spreads = (weights * (variances + (means - centers) ** 2)).sum(axis=(0, 1))
            found |= dict(
                zip(numbers.tolist(), zip(centers, spreads, strict=True), strict=True)
            )
        return [found[number] for number in range(len(self.terms))]

    def _over_sizes(
        self,
    ) -> Iterator[
        tuple[
            np.ndarray,
            np.ndarray,
            tuple[np.ndarray, np.ndarray, np.ndarray],
            np.ndarray,
        ]
    ]:
        """What the u units of one width d say at every size, the others at theirs:
        numbers; log density (1 + S, T, u), for size zero first; their coefficients, as
        `_turned_back` takes them; variance (S, T, u) of the noise."""
        widths = np.diff(self.starts)
        sizes = np.concatenate([[0.0], self.grid.scales**2])[:, None, None, None]
        for width in set(widths.tolist()):
            numbers = np.flatnonzero(widths == width)
            mine = self.starts[numbers][:, None] + np.arange(width)
            scales = self.scales[numbers][:, None]
            # With the others integrated out: the precision is I + s^2 G.
            left_over, vectors = np.linalg.eigh(
                self.covariance[:, mine[:, :, None], mine[:, None, :]]
            )
            mean = (vectors.swapaxes(-1, -2) @ self.mean[:, mine, None])[..., 0]
            squares = self.squares[:, None] + (mean**2 / left_over).sum(axis=-1)
            log_det = self.log_det[:, None] + np.log(left_over).sum(axis=-1)
            values = np.clip(1.0 / left_over - 1.0, 0.0, None) / scales**2
            turned = mean / (left_over * scales)
            widened = 1.0 + sizes * values
            left = squares - (sizes * turned**2 / widened).sum(axis=-1)
            density = (
                self.base[:, None]
                - 0.5 * (log_det + np.log(widened).sum(axis=-1))
                + log_likelihood(left, self.freedom)
            )
            density += (self.sign_factors.sum(axis=0) - self.sign_factors[numbers]).T
            along = (sizes * turned / widened)[1:]
            widths_left = (sizes / widened)[1:]
            for place, number in enumerate(numbers.tolist()):
                signs = self.terms[number].signs
                if signs.any():
                    seen = _turned_back(
                        vectors[:, place], along[:, :, place], widths_left[:, :, place]
                    )
                    density[1:, :, place] += _log_sign_factor(
                        *seen, signs, left[1:, :, place], self.freedom
                    )
            density[1:] += self.weights[numbers].T[:, None]
            density += self.log_weights.sum() - self.log_weights[numbers]
            yield (
                numbers,
                density,
                (vectors, along, widths_left),
                np.maximum(left[1:] / self.freedom, 1.0),
            )


def _turned_back(
    vectors: np.ndarray, mean: np.ndarray, variance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (S, ..., d) of coefficients, from those along eigenvectors
    (..., d, d)."""
    return (vectors @ mean[..., None])[..., 0], (vectors**2 @ variance[..., None])[
        ..., 0
    ]


def _log_sign_factor(
    mean: np.ndarray,
    variance: np.ndarray,
    signs: np.ndarray,
    squares: np.ndarray,
    freedom: int,
) -> np.ndarray:
    """Half-normal priors where physics gives the sign: ln 2 Phi(mean / std) of each
    such coefficient, summed."""
    signed = np.flatnonzero(signs)
    sigma = np.sqrt(np.maximum(squares / freedom, 1.0))[..., None]
    ratio = signs[signed] * mean[..., signed] / (np.sqrt(variance[..., signed]) * sigma)
    return (np.log(2.0) + log_ndtr(ratio)).sum(axis=-1)
