"""Bayes factors of models (Kass and Raftery, JASA 1995) from sufficient statistics.

Coefficients of a term are normal about zero with standard deviation s times their
plausible size, where the term has one scale s. This is a local prior next to the
probability that the term is absent: spike and slab (Mitchell and Beauchamp, JASA 1988).
With D the diagonal matrix of all s^2 and G the Gram matrix,

    ln p(y | model, s, tau) = -1/2 ln |I + D^1/2 G D^1/2| + l(y'My - b'(G + D^-1)^-1 b),

where l(rss) = -nu/2 ln sigma^2 - rss / (2 sigma^2) at sigma^2 = max(rss / nu, 1). The
noise is at least as large as the repeats or the campaign state; otherwise a smooth
discrepancy could interpolate the data. Above one the noise is profiled, and the priors
widen with it as conjugate ones do. The evidence is averaged over scales and tau, never
maximised, as over g in mixtures of g priors (Liang et al., JASA 2008).

If physics fixes the sign of a coefficient, its prior is half-normal. The Bayes factor
is then that of the normal prior times twice the posterior probability of the sign, as
against an encompassing model (Klugkist et al., Psychological Methods 2005). Several
such coefficients are treated as independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack
from scipy.special import log_ndtr

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from elastocal.diagnosis.hypotheses import ModelTerm
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.statistics import SufficientStatistics

# The grid of the pose error reaches this many times the largest size that physics
# allows, so that an estimate of that size is not at its end.
_BEYOND_PHYSICS = 2.0
# A step of the ascent must raise the log density by more than rounding does.
_NO_GAIN = 1e-9
# If moving all terms at once does not raise the density, this many times fewer are
# moved in the next attempt.
_FEWER = 4
# From this many columns on, one call of LAPACK for each positive matrix is faster than
# numpy's stacked inverse.
_MANY_COLUMNS = 30


def log_sum_exp(
    values: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> np.ndarray:
    """ln of a sum of exponentials over some axes, or over all.

    The same as scipy's logsumexp, without its overhead on small arrays.
    """
    highest = np.max(values, axis=axis, keepdims=True)
    highest = np.where(np.isfinite(highest), highest, 0.0)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(values - highest).sum(axis=axis, keepdims=True)) + highest
    return total.squeeze() if axis is None else total.squeeze(axis)


@dataclass(frozen=True)
class SizeGrid:
    """Scales over which the evidence of a term is averaged.

    Attributes
    ----------
    scales : (S,), in plausible sizes, rising
    log_weights : (S,), logarithms of their prior weights
    """

    scales: np.ndarray
    log_weights: np.ndarray

    @classmethod
    def from_settings(cls, settings: Settings) -> SizeGrid:
        """Weights of a split normal distribution of the log scale about the most likely
        one."""
        distance = np.log(np.asarray(settings.scales) / settings.scale_center)
        spread = np.where(distance < 0, *settings.scale_spread)
        log_weights = -0.5 * (distance / spread) ** 2
        return cls(np.array(settings.scales), log_weights - log_sum_exp(log_weights))

    def log_weights_of(self, term: ModelTerm) -> np.ndarray:
        """Log weights (S,) of the scales of one term, from its smallest to its
        largest."""
        return self.log_weights_by_range[term.smallest, term.largest]

    def root_mean_square(self, term: ModelTerm) -> float:
        """Prior standard deviation of a coefficient of a term over all its scales, in
        plausible sizes."""
        return float(np.sqrt(np.exp(self.log_weights_of(term)) @ self.scales**2))

    @cached_property
    def log_weights_by_range(self) -> np.ndarray:
        """Log weights (S, S, S) by smallest scale, largest scale and scale, shared out
        among the scales between the two."""
        index = np.arange(len(self.scales))
        outside = (index < index[:, None, None]) | (index > index[:, None])
        weights = np.where(outside, -np.inf, self.log_weights)
        with np.errstate(invalid="ignore"):
            return weights - log_sum_exp(weights, axis=2)[..., None]


def compute_pose_error_log_prior(
    pose_error_rad: np.ndarray, settings: Settings
) -> np.ndarray:
    """Log prior weights (T,) of the sizes of the pose error, one of which is zero.

    The sizes other than zero have a half-Cauchy prior, whose scale is what robots repeat
    to: its tail falls so slowly that measurements overrule it at any size (Gelman, Prior
    distributions for variance parameters in hierarchical models, Bayesian Analysis 1,
    2006). Its density in the logarithm of the size weighs the sizes of a grid in equal
    ratios.
    """
    ratio = np.asarray(pose_error_rad) / settings.pose_repeatability_rad
    density = ratio / (1.0 + ratio**2)
    total = density.sum()
    present = settings.pose_error_probability
    if total > 0.0:
        density *= present / total
    with np.errstate(divide="ignore"):
        return np.log(np.where(ratio > 0.0, density, 1.0 - present))


def list_pose_errors(std_error_rad: float, settings: Settings) -> np.ndarray:
    """List the sizes of the pose error that are considered, rad, zero first.

    The grid starts below what one pose resolves and reaches beyond what physics allows:
    an error that is larger than the whole grid would be left to the effects.

    Parameters
    ----------
    std_error_rad : standard error of a joint angle from the measurements of one pose
    settings : settings of the diagnosis
    """
    sizes = [std_error_rad * step for step in settings.pose_steps]
    while sizes[-1] < _BEYOND_PHYSICS * settings.largest_pose_error_rad:
        sizes.append(settings.pose_error_ratio * sizes[-1])
    return np.array(sizes)


def log_likelihood(squares: np.ndarray, degrees_of_freedom: int) -> np.ndarray:
    """l(rss), the likelihood with the profiled noise, which is at least one."""
    variance = np.maximum(squares / degrees_of_freedom, 1.0)
    return -0.5 * degrees_of_freedom * np.log(variance) - 0.5 * squares / variance


def decompose_grams(gram: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (..., d), not negative, and eigenvectors (..., d, d) of Gram matrices
    (..., d, d)."""
    if gram.shape[-1] > 1:
        values, vectors = np.linalg.eigh(gram)
    else:
        values = gram[..., 0]
        vectors = np.ones_like(gram)
    return np.clip(values, 0.0, None), vectors


@dataclass(frozen=True)
class TermBlock:
    """Terms that have the same number d of columns.

    Attributes
    ----------
    numbers : (U,) int, indices of the terms
    columns : (U, d) int
    gram : (T, U, d, d), W'MW of the columns of each term
    eigenvalues : (T, U, d), of these
    eigenvectors : (T, U, d, d)
    """

    numbers: np.ndarray
    columns: np.ndarray
    gram: np.ndarray
    eigenvalues: np.ndarray
    eigenvectors: np.ndarray

    @classmethod
    def group(
        cls,
        statistics: SufficientStatistics,
        terms: Sequence[ModelTerm],
        first_number: int = 0,
    ) -> list[TermBlock]:
        """Group terms, numbered from `first_number`, by their number of columns."""
        widths = np.array([len(term.columns) for term in terms], int)
        blocks = []
        for width in np.unique(widths):
            numbers = np.flatnonzero(widths == width)
            columns = np.array([terms[number].columns for number in numbers.tolist()])
            gram = statistics.gram_blocks(columns)
            blocks.append(
                cls(numbers + first_number, columns, gram, *decompose_grams(gram))
            )
        return blocks

    def select(self, terms: np.ndarray) -> TermBlock:
        """Select some terms (u,), rising, and number them from 0 in this order."""
        chosen = np.isin(self.numbers, terms)
        return TermBlock(
            np.searchsorted(terms, self.numbers[chosen]),
            self.columns[chosen],
            self.gram[:, chosen],
            self.eigenvalues[:, chosen],
            self.eigenvectors[:, chosen],
        )

    def at(self, chosen: np.ndarray | slice) -> TermBlock:
        """Select sizes of the pose error."""
        return TermBlock(
            self.numbers,
            self.columns,
            self.gram[chosen],
            self.eigenvalues[chosen],
            self.eigenvectors[chosen],
        )


def _scaled_precision(
    statistics: SufficientStatistics, columns: np.ndarray, deviations: np.ndarray
) -> np.ndarray:
    """I + D^1/2 G D^1/2 (T, D, D), the posterior precision of the coefficients in units
    of their prior standard deviations."""
    precision = statistics.gram_blocks(columns)
    precision *= deviations[:, None]
    precision *= deviations
    diagonal = np.arange(len(columns))
    precision[:, diagonal, diagonal] += 1.0
    return precision


def evaluate_extensions(
    statistics: SufficientStatistics,
    base: np.ndarray,
    scaled_columns: tuple[np.ndarray, np.ndarray],
    blocks: Sequence[TermBlock],
    grid: SizeGrid,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the log evidence of a model, and of the model with each single term added
    at every scale of that term.

    Parameters
    ----------
    statistics : sufficient statistics
    base : (T,), what each tau contributes by itself, with its prior
    scaled_columns : columns (D,) of the model, and the prior standard deviation of
        each, in plausible sizes
    blocks : the terms that are added, numbered from 0
    grid : scales of a term

    Returns
    -------
    (T,) of the model; (T, number of terms, S) of its extensions, not weighted by scale
    """
    term_count = sum(len(block.numbers) for block in blocks)
    columns_of_terms = np.concatenate([block.columns.ravel() for block in blocks])
    added_columns = np.unique(columns_of_terms)
    model = _condition_on_model(statistics, base, scaled_columns, added_columns)
    log_evidence = np.empty((len(base), term_count, len(grid.scales)))
    for block in blocks:
        eigenvalues, by_axis = model.decompose(
            block, np.searchsorted(added_columns, block.columns)
        )
        # Integrate over the coefficients of each term at every scale.
        variances = grid.scales**2
        widened = 1.0 + eigenvalues[..., None] * variances
        gains = ((by_axis**2)[..., None] * (variances / widened)).sum(axis=2)
        occam = -0.5 * np.log(widened).sum(axis=2)
        likelihood = log_likelihood(
            model.squares[:, None, None] - gains, statistics.degrees_of_freedom
        )
        log_evidence[:, block.numbers] = (
            model.log_occam[:, None, None] + occam + likelihood
        )
    likelihood = log_likelihood(model.squares, statistics.degrees_of_freedom)
    return model.log_occam + likelihood, log_evidence


@dataclass(frozen=True)
class _ModelConditional:
    """Statistics of A columns, the D coefficients of a model integrated out.

    Attributes
    ----------
    cross : (T, D, A), whose product with itself is subtracted from the Gram matrix
    score : (T, A)
    squares : (T,), residual sum of squares
    log_occam : (T,), log Occam factor of the model, with what each tau contributes
    """

    cross: np.ndarray
    score: np.ndarray
    squares: np.ndarray
    log_occam: np.ndarray

    def decompose(
        self, block: TermBlock, positions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues (T, U, d) of the Gram matrix of each of U terms, whose columns have
        these positions (U, d), and the score (T, U, d) along its eigenvectors."""
        eigenvalues = block.eigenvalues
        eigenvectors = block.eigenvectors
        if self.cross.shape[1]:
            shared = self.cross[:, :, positions].transpose(0, 2, 1, 3)
            gram = block.gram - shared.swapaxes(-1, -2) @ shared
            eigenvalues, eigenvectors = decompose_grams(gram)
        score = self.score[:, positions, None]
        return eigenvalues, (eigenvectors.swapaxes(-1, -2) @ score)[..., 0]


def _condition_on_model(
    statistics: SufficientStatistics,
    base: np.ndarray,
    scaled_columns: tuple[np.ndarray, np.ndarray],
    added_columns: np.ndarray,
) -> _ModelConditional:
    """Integrate out the coefficients of a model; `added_columns` (A,) are the columns
    whose statistics are computed, and the other arguments those of
    `evaluate_extensions`."""
    columns, deviations = scaled_columns
    factors = np.linalg.cholesky(_scaled_precision(statistics, columns, deviations))
    # Rows of the Gram matrix and of the score, divided by the factor.
    right = np.concatenate(
        [
            statistics.gram_rows(columns, added_columns),
            statistics.score[:, columns, None],
        ],
        axis=2,
    )
    right *= deviations[:, None]
    if len(columns):
        for factor, rows in zip(factors, right, strict=True):
            # A product with the inverse takes half the time of solving, and is accurate
            # enough, because no eigenvalue is below one. The transposes have the column
            # order that BLAS expects, so that nothing is copied.
            inverse = lapack.dtrtri(factor.T, lower=0)[0]
            rows[:] = blas.dtrmm(1.0, inverse, rows.T, side=1, overwrite_b=1).T
    cross = right[..., :-1]
    fitted = right[..., -1]
    log_diagonal = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    return _ModelConditional(
        cross,
        statistics.score[:, added_columns] - (fitted[:, None] @ cross)[:, 0],
        statistics.residual_squares - (fitted**2).sum(axis=1),
        base - log_diagonal,
    )


@dataclass(frozen=True)
class ModelEvidence:
    """Evidence of a model, averaged over scales and tau.

    Attributes
    ----------
    log_evidence : its logarithm
    scales : (m,), most probable scale of each term
    log_pose_posterior : (T,), log posterior weight of each tau at these scales
    without : (m,), log evidence of the model without each of its terms, at the scales
        of the other terms
    """

    log_evidence: float
    scales: np.ndarray
    log_pose_posterior: np.ndarray
    without: np.ndarray


def evaluate_model(
    statistics: SufficientStatistics,
    terms: Sequence[ModelTerm],
    grid: SizeGrid,
    log_pose_prior: np.ndarray,
    start: Iterable[float],
) -> ModelEvidence:
    """Compute the evidence of one model, averaged over the scales of its terms.

    The sum over all combinations of scales is approximated by the product of the sums
    over each scale about the mode. That is exact for one term, and if the scales are
    independent given the measurements. The mode is found by coordinate ascent (iterated
    conditional modes; Besag, JRSS B 1986). A step moves all terms at once if that
    raises the density, and otherwise those that gain most. One inverse gives the
    conditional information of every term given all others: with C the posterior
    covariance of the scaled coefficients, C_uu^-1 = I + s^2 G_uu|rest.

    Parameters
    ----------
    statistics : sufficient statistics
    terms : terms of the model
    grid : scales of a term
    log_pose_prior : (T,), log prior weight of each size of the pose error
    start : scale of each term at which the ascent starts; the nearest one that the
        term may have is taken
    """
    distances = [
        np.where(
            np.isfinite(grid.log_weights_of(term)), np.abs(grid.scales - scale), np.inf
        )
        for scale, term in zip(start, terms, strict=True)
    ]
    scale_indices = np.array([np.argmin(by_scale) for by_scale in distances], int)
    base = statistics.log_likelihood + log_pose_prior
    density = ModelDensity(statistics, terms, grid, base, scale_indices)
    profiles = density.profiles()
    while (ascended := _ascend(statistics, density, profiles)) is not None:
        density = ascended
        profiles = density.profiles()
    numbers = np.arange(len(terms))
    sums = (
        log_sum_exp(profiles[:, 1:], axis=1)
        - profiles[numbers, 1 + density.scale_indices]
    )
    return ModelEvidence(
        float(density.log_density + sums.sum()),
        density.scales,
        density.by_pose_error - log_sum_exp(density.by_pose_error),
        profiles[:, 0] - sums + sums.sum(),
    )


def _ascend(
    statistics: SufficientStatistics, density: ModelDensity, profiles: np.ndarray
) -> ModelDensity | None:
    """One step of the ascent, None at the mode.

    It moves as many terms as raise the density, those that gain most first. The scales
    lie on a grid and the density rises with every step, so that the ascent ends.
    """
    best = profiles[:, 1:].argmax(axis=1)
    current = profiles[np.arange(len(best)), 1 + density.scale_indices]
    gains = profiles[:, 1:].max(axis=1) - current
    order = np.argsort(-gains)
    count = int((gains > _NO_GAIN).sum())
    while count:
        moved_terms = order[:count]
        scale_indices = density.scale_indices.copy()
        scale_indices[moved_terms] = best[moved_terms]
        moved = ModelDensity(
            statistics, density.terms, density.grid, density.base, scale_indices
        )
        if moved.log_density > density.log_density:
            return moved
        count = 0 if count == 1 else max(count // _FEWER, 1)
    return None


def _invert_positive(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses (T, D, D) of symmetric positive matrices, and the logarithms of their
    determinants (T,)."""
    if matrices.shape[1] < _MANY_COLUMNS:
        return np.linalg.inv(matrices), np.linalg.slogdet(matrices)[1]
    inverses = np.empty_like(matrices)
    log_dets = np.empty(len(matrices))
    for number, matrix in enumerate(matrices):
        # The transpose has the column order that LAPACK expects.
        factor = lapack.dpotrf(matrix.T, lower=0, clean=1)[0]
        log_dets[number] = 2.0 * np.log(np.diag(factor)).sum()
        upper = lapack.dpotri(factor, lower=0, overwrite_c=1)[0]
        np.add(upper, upper.T, out=inverses[number])
        np.fill_diagonal(inverses[number], np.diag(upper))
    return inverses, log_dets


@dataclass(frozen=True)
class _ScaleProfile:
    """Terms of one width d at every scale, the other terms at their present scales.

    Attributes
    ----------
    numbers : (u,) int, indices of the terms
    log_density : (1 + S, T, u), for scale zero first
    eigenvectors : (T, u, d, d), principal axes of the coefficients
    mean, variance : (S, T, u, d), of the coefficients along these, the variance for
        unit noise
    noise_variance : (S, T, u)
    """

    numbers: np.ndarray
    log_density: np.ndarray
    eigenvectors: np.ndarray
    mean: np.ndarray
    variance: np.ndarray
    noise_variance: np.ndarray


@dataclass(frozen=True)
class _ConditionalStatistics:
    """What the measurements say of u terms of one width d, each given all other terms
    of the model.

    Attributes
    ----------
    eigenvectors : (T, u, d, d), of the conditional Gram matrix G of each term
    eigenvalues : (T, u, d)
    score : (T, u, d), along the eigenvectors
    squares : (T, u), residual sum of squares without the term
    log_det : (T, u), log determinant of the precision without the term
    """

    eigenvectors: np.ndarray
    eigenvalues: np.ndarray
    score: np.ndarray
    squares: np.ndarray
    log_det: np.ndarray


class ModelDensity:
    """Density of the measurements under one model with one scale for each term.

    Parameters
    ----------
    statistics : sufficient statistics
    terms : terms of the model
    grid : scales of a term
    base : (T,), what each tau contributes by itself, with its prior
    scale_indices : (m,) int, scale of each term in the grid

    Attributes
    ----------
    by_pose_error : (T,), log density at each size of the pose error
    log_density : over all sizes, with the prior weights of the scales
    """

    def __init__(
        self,
        statistics: SufficientStatistics,
        terms: Sequence[ModelTerm],
        grid: SizeGrid,
        base: np.ndarray,
        scale_indices: np.ndarray,
    ) -> None:
        self.terms = terms
        self.grid = grid
        self.base = base
        self.scale_indices = scale_indices
        self.scales = grid.scales[scale_indices]
        self._degrees_of_freedom = statistics.degrees_of_freedom
        self._log_weights_by_scale = np.array(
            [grid.log_weights_of(term) for term in terms]
        ).reshape(len(terms), len(grid.scales))
        self._log_weights = self._log_weights_by_scale[
            np.arange(len(terms)), scale_indices
        ]
        widths = [len(term.columns) for term in terms]
        self._starts = np.concatenate([[0], np.cumsum(widths, dtype=int)])
        no_columns = np.zeros(0, int)
        columns = np.concatenate([no_columns, *(term.columns for term in terms)])
        deviations = np.repeat(self.scales, np.diff(self._starts))
        self._covariance, self._log_det = _invert_positive(
            _scaled_precision(statistics, columns, deviations)
        )
        score = deviations * statistics.score[:, columns]
        self._mean = (self._covariance @ score[..., None])[..., 0]
        self._squares = statistics.residual_squares - (score * self._mean).sum(axis=1)
        log_densities = (
            self.base
            - 0.5 * self._log_det
            + log_likelihood(self._squares, self._degrees_of_freedom)
        )
        self._sign_factors = self._compute_sign_factors()
        self.by_pose_error = log_densities + self._sign_factors.sum(axis=0)
        self.log_density = float(
            log_sum_exp(self.by_pose_error) + self._log_weights.sum()
        )

    def _compute_sign_factors(self) -> np.ndarray:
        """Log factors (m, T) of the terms whose signs physics gives."""
        factors = np.zeros((len(self.terms), len(self.base)))
        for number, term in enumerate(self.terms):
            if term.signs.any():
                columns = slice(self._starts[number], self._starts[number + 1])
                variance = np.diagonal(
                    self._covariance[:, columns, columns], axis1=1, axis2=2
                )
                factors[number] = _log_sign_factor(
                    self._mean[:, columns],
                    variance,
                    term.signs,
                    self._squares,
                    self._degrees_of_freedom,
                )
        return factors

    def profiles(self) -> np.ndarray:
        """Log density (m, 1 + S) over the scales of each term, for scale zero first,
        the other terms at their present scales."""
        profiles = np.empty((len(self.terms), 1 + len(self.grid.scales)))
        for profile in self._scale_profiles():
            profiles[profile.numbers] = log_sum_exp(profile.log_density, axis=1).T
        return profiles

    def moments(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Mean (d,) and variance (d,) of the coefficients of each term, averaged over
        its scales and tau."""
        moments: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for profile in self._scale_profiles():
            log_density = profile.log_density[1:]
            weights = np.exp(log_density - log_sum_exp(log_density, axis=(0, 1)))
            weights = weights[..., None]
            means, variances = _rotate_back(
                profile.eigenvectors, profile.mean, profile.variance
            )
            variances *= profile.noise_variance[..., None]
            centers = (weights * means).sum(axis=(0, 1))
            spreads = (weights * (variances + (means - centers) ** 2)).sum(axis=(0, 1))
            for number, center, spread in zip(
                profile.numbers.tolist(), centers, spreads, strict=True
            ):
                moments[number] = center, spread
        return [moments[number] for number in range(len(self.terms))]

    def _scale_profiles(self) -> Iterator[_ScaleProfile]:
        widths = np.diff(self._starts)
        for width in set(widths.tolist()):
            yield self._scale_profile(np.flatnonzero(widths == width), width)

    def _condition_on_other_terms(
        self, numbers: np.ndarray, width: int
    ) -> _ConditionalStatistics:
        """Statistics of some terms of one width, the other terms integrated out.

        The precision of a term is then I + s^2 G; the eigenvalues of G and the score
        along its eigenvectors follow from the covariance.
        """
        columns = self._starts[numbers][:, None] + np.arange(width)
        scales = self.scales[numbers][:, None]
        variances, eigenvectors = np.linalg.eigh(
            self._covariance[:, columns[:, :, None], columns[:, None, :]]
        )
        mean = (eigenvectors.swapaxes(-1, -2) @ self._mean[:, columns, None])[..., 0]
        return _ConditionalStatistics(
            eigenvectors,
            eigenvalues=np.clip(1.0 / variances - 1.0, 0.0, None) / scales**2,
            score=mean / (variances * scales),
            squares=self._squares[:, None] + (mean**2 / variances).sum(axis=-1),
            log_det=self._log_det[:, None] + np.log(variances).sum(axis=-1),
        )

    def _scale_profile(self, numbers: np.ndarray, width: int) -> _ScaleProfile:
        terms = self._condition_on_other_terms(numbers, width)
        # At scale zero a term is absent.
        prior_variances = np.concatenate([[0.0], self.grid.scales**2])
        prior_variances = prior_variances[:, None, None, None]
        widened = 1.0 + prior_variances * terms.eigenvalues
        squares = terms.squares - (prior_variances * terms.score**2 / widened).sum(
            axis=-1
        )
        log_density = (
            self.base[:, None]
            - 0.5 * (terms.log_det + np.log(widened).sum(axis=-1))
            + log_likelihood(squares, self._degrees_of_freedom)
        )
        other_signs = self._sign_factors.sum(axis=0) - self._sign_factors[numbers]
        log_density += other_signs.T
        mean = (prior_variances * terms.score / widened)[1:]
        variance = (prior_variances / widened)[1:]
        for index, number in enumerate(numbers.tolist()):
            signs = self.terms[number].signs
            if signs.any():
                coefficients = _rotate_back(
                    terms.eigenvectors[:, index],
                    mean[:, :, index],
                    variance[:, :, index],
                )
                log_density[1:, :, index] += _log_sign_factor(
                    *coefficients,
                    signs,
                    squares[1:, :, index],
                    self._degrees_of_freedom,
                )
        log_density[1:] += self._log_weights_by_scale[numbers].T[:, None]
        log_density += self._log_weights.sum() - self._log_weights[numbers]
        noise_variance = np.maximum(squares[1:] / self._degrees_of_freedom, 1.0)
        return _ScaleProfile(
            numbers, log_density, terms.eigenvectors, mean, variance, noise_variance
        )


def _rotate_back(
    eigenvectors: np.ndarray, mean: np.ndarray, variance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (S, ..., d) of coefficients, from those along eigenvectors
    (..., d, d)."""
    coefficients = (eigenvectors @ mean[..., None])[..., 0]
    return coefficients, (eigenvectors**2 @ variance[..., None])[..., 0]


def _log_sign_factor(
    mean: np.ndarray,
    variance: np.ndarray,
    signs: np.ndarray,
    squares: np.ndarray,
    degrees_of_freedom: int,
) -> np.ndarray:
    """ln 2 Phi(mean / std) of each coefficient whose sign physics gives, summed: the
    factor of its half-normal prior."""
    signed = np.flatnonzero(signs)
    sigma = np.sqrt(np.maximum(squares / degrees_of_freedom, 1.0))[..., None]
    ratio = signs[signed] * mean[..., signed] / (np.sqrt(variance[..., signed]) * sigma)
    return (np.log(2.0) + log_ndtr(ratio)).sum(axis=-1)
