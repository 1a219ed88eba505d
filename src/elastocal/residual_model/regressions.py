"""Regressions on the residuals of a fitted model: the catalogue, what each of them is
shown, and what it predicts.

Each is a function of inputs of M observations, their residuals (M, 3), m, base axes,
settings, and the seed of whatever it draws; it yields a predictor for each setting in
turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import lapack

from elastocal.fitting.normal_equations import invert_cholesky_factor
from elastocal.io import plugins
from elastocal.io.plugins import load_plugins

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    Setting = Mapping[str, Any]

# Observations whose columns or covariances are held at once; trees of a forest.
_AT_ONCE = 500
_TREES = 100
# Penalties of functions of two joints, in mean squares of a column.
_PENALTIES = np.logspace(-4.0, 2.0, 7)
# Hyperparameters come from so many observations: a step towards them costs the third
# power of their number, and 800 take eight times as long for errors that differ by 2 %
# either way (UR5 and UR10).
_MOST_FOR_HYPERPARAMETERS = 300
# Observations at which the process has values, drawn at random; their covariance takes
# 32 MB. Held-out RMS of UR10 A (8,350 observations) after geometry: 0.169 mm with 1,000
# in 0.5 s, 0.141 with 2,000 in 1.7 s, 0.122 with all in 14 s and 0.56 GB.
_MOST = 2_000
# Variance of the process, lengths in standard deviations of each input, from wiggles
# between neighbours to one trend across all poses, and variance of the noise: where the
# search starts, and its bounds.
_VARIANCE = (1.0, 1e-3, 1e3)
_LENGTH = (1.0, 0.05, 100.0)
_NOISE = (0.5, 1e-4, 10.0)
# By which share of the likelihood's logarithm the last steps of the search raise it:
# scipy's own 2e-9 stops on a plateau, whose way out changes of the residuals by 1e-8
# decided (the simulated KUKA: a regression or none).
_LAST_GAIN = 1e-11
# Of the variance: added to the diagonal, so that rounding leaves it positive definite.
_JITTER = 1e-8
# An input that differs by less than this over all poses says nothing: rad, N, m, s,
# degC.
_STILL = 1e-10


@dataclass(frozen=True, eq=False)
class Inputs:
    """What a regression may know of an observation; arrays of M.

    `joint_angles` (M, n): rad. `others` (M, k): wrench and place of the target in its
    measuring point; neither time nor temperature, of which a correction knows nothing.
    `jacobian` (M, 3, C): of the target's position with respect to the joints, first,
    and whatever else of the chain may be displaced: base and links; base axes, m per
    rad or m; then what effects of the model do, see `corrected.inputs_of`.
    """

    joint_angles: np.ndarray
    others: np.ndarray
    jacobian: np.ndarray

    def __len__(self) -> int:
        return len(self.joint_angles)

    @property
    def columns(self) -> np.ndarray:
        """ndarray (M, n + k): joint angles, then the others."""
        return np.hstack([self.joint_angles, self.others])

    def select(self, chosen: np.ndarray | slice) -> Inputs:
        """The inputs of some observations."""
        return Inputs(
            self.joint_angles[chosen], self.others[chosen], self.jacobian[chosen]
        )


@dataclass(frozen=True)
class Predictor:
    """A fitted regression, by functions of inputs of other observations.

    `mean`: predicted residuals (M, 3), m, base axes. `std`: standard deviation (M, 3)
    of a new measurement about them, not a number where the regression states none.
    """

    mean: Callable[[Inputs], np.ndarray]
    std: Callable[[Inputs], np.ndarray] = lambda there: np.full((len(there), 3), np.nan)


@dataclass(frozen=True)
class Regression:
    """An entry of the catalogue.

    `words`: as people call it. `settings`: among which poses that a fit has not seen
    choose; one where it chooses itself. `by_jacobian`: whether it looks at that, which
    takes most of the memory.
    """

    words: str
    fitted: Callable[[Inputs, np.ndarray, Sequence[Setting], int], Iterator[Predictor]]
    settings: Sequence[Setting] = ({},)
    by_jacobian: bool = False


@dataclass(frozen=True)
class _Geometry:
    """The part of geometry in ridge regressions on it and other columns: along its
    principal axes, which all of them share.

    `squares` (G,): eigenvalues of its Gram matrix. `axes` (G, G). `along` (G,):
    products with the residual along these.
    """

    squares: np.ndarray
    axes: np.ndarray
    along: np.ndarray

    @classmethod
    def of(cls, gram: np.ndarray, right: np.ndarray) -> _Geometry:
        """By its Gram matrix and its products with the residual."""
        squares, axes = np.linalg.eigh(gram)
        return cls(np.maximum(squares, 0.0), axes, axes.T @ right)

    def mean_square(self, gram: np.ndarray) -> float:
        """Of all columns, those with a Gram matrix (D, D) beside it."""
        return max(
            (self.squares.sum() + np.trace(gram)) / (len(self.squares) + len(gram)),
            np.finfo(float).tiny,
        )

    def ridge(
        self, mixed: np.ndarray, gram: np.ndarray, right: np.ndarray, penalty: float
    ) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Coefficients of geometry and others, the squares that they explain, and ln |I
        + G / penalty| of all columns.

        `mixed` (G, D): products of its principal axes with the others. `right` (D,): of
        these with the residual.
        """
        shrunk = mixed / (self.squares + penalty)[:, None]
        lower, found, _ = lapack.dposv(
            gram - shrunk.T @ mixed + penalty * np.eye(len(gram)),
            right - shrunk.T @ self.along,
            lower=1,
        )
        own = self.along / (self.squares + penalty) - shrunk @ found
        volume = (
            np.log1p(self.squares / penalty).sum()
            + np.log(np.diag(lower) ** 2 / penalty).sum()
        )
        return self.axes @ own, found, self.along @ own + right @ found, volume


def fit_ridge_harmonics(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Harmonics of each joint's angle as deviations of that joint, beside geometry, by
    ridge regression.

    What gears, encoders and runout can do to a joint, without saying what: a Fourier
    series of every joint carried to the target by the Jacobian, and constant
    displacements of base and links, which resemble each other; all coefficients with
    one penalty [1], in mean squares of a column.

    [1] Hoerl, A. E. and Kennard, R. W., Ridge regression: biased estimation for
    nonorthogonal problems, Technometrics 12, 1970.
    """

    # The same poses are predicted with one penalty after the other.
    @lru_cache(maxsize=2)
    def columns(every: Inputs, first: int, orders: int) -> np.ndarray:
        some = every.select(slice(first, first + _AT_ONCE))
        return np.concatenate(
            [some.jacobian, compute_harmonic_columns(some, orders)], axis=2
        )

    most = max(setting["orders"] for setting in settings)
    joints = inputs.joint_angles.shape[1]
    split = inputs.jacobian.shape[2]
    size = split + 2 * most * joints
    gram = np.zeros((size, size))
    right = np.zeros(size)
    for part in _parts(inputs):
        rows = columns(inputs, part.start, most).reshape(-1, size)
        gram += rows.T @ rows
        right += rows.T @ residual[part].ravel()
    geometry = _Geometry.of(gram[:split, :split], right[:split])
    mixed = geometry.axes.T @ gram[:split, split:]
    own = gram[split:, split:]
    along = right[split:]
    for setting in settings:
        # Orders come first among the harmonics, so that fewer of them are the first
        # columns.
        size = 2 * setting["orders"] * joints
        penalty = setting["penalty"] * geometry.mean_square(own[:size, :size])
        found = np.concatenate(
            geometry.ridge(mixed[:, :size], own[:size, :size], along[:size], penalty)[
                :2
            ]
        )

        def mean(
            there: Inputs,
            coefficients: np.ndarray = found,
            orders: int = setting["orders"],
        ) -> np.ndarray:
            return _stacked(
                columns(there, part.start, orders) @ coefficients
                for part in _parts(there)
            )

        yield Predictor(mean)


def fit_two_joints(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Functions of two joints' angles at once as deviations of joints, beside geometry:
    what no catalogue of one joint's has.

    Ridge regression whose pair of joints and penalty have the largest marginal
    likelihood, with the noise profiled [1].

    [1] MacKay, D. J. C., Bayesian interpolation, Neural Computation 4, 1992.
    """

    def functions(some: Inputs, pair: tuple[int, int]) -> np.ndarray:
        return compute_pair_columns(some, pair, np.arange(some.joint_angles.shape[1]))

    target = residual.ravel()
    jacobian = inputs.jacobian.reshape(residual.size, -1)
    most = -np.inf
    geometry = _Geometry.of(jacobian.T @ jacobian, jacobian.T @ target)
    for pair in combinations(range(inputs.joint_angles.shape[1]), 2):
        rows = functions(inputs, pair).reshape(residual.size, -1)
        mixed = geometry.axes.T @ (jacobian.T @ rows)
        gram = rows.T @ rows
        right = rows.T @ target
        for penalty in _PENALTIES * geometry.mean_square(gram):
            of_geometry, found, explained, volume = geometry.ridge(
                mixed, gram, right, penalty
            )
            left = max(target @ target - explained, np.finfo(float).tiny)
            if (probable := -residual.size * np.log(left) - volume) > most:
                most = probable
                best = pair
                coefficients = (of_geometry, found)
    yield Predictor(
        lambda there: (
            there.jacobian @ coefficients[0] + functions(there, best) @ coefficients[1]
        )
    )


def fit_extra_trees(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Extremely randomized trees: averages of neighbours in boxes, for whatever is not
    smooth [1]; for all axes together.

    [1] Geurts, P., Ernst, D. and Wehenkel, L., Extremely randomized trees, Machine
    Learning 63, 2006.
    """
    # Most of what needs the catalogue grows no tree.
    from sklearn.tree import ExtraTreeRegressor

    (setting,), columns, target = (
        settings,
        inputs.columns.astype(np.float32),
        np.ascontiguousarray(residual),
    )
    draws = np.random.RandomState(seed)
    seeds = [draws.randint(np.iinfo(np.int32).max) for _ in range(_TREES)]
    # One by one: a forest would look at the same inputs again for each of its trees.
    trees = [
        ExtraTreeRegressor(random_state=each, **setting).fit(
            columns, target, check_input=False
        )
        for each in seeds
    ]

    def mean(there: Inputs) -> np.ndarray:
        asked = there.columns.astype(np.float32)
        return np.mean(
            [tree.predict(asked, check_input=False) for tree in trees], axis=0
        )

    yield Predictor(mean)


def fit_gaussian_process(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """A Gaussian process: smooth in all inputs, with intervals that grow away from the
    poses that were measured.

    One process for all three axes, each with its own size: a Matérn kernel with a
    length for each input, and noise, which have the largest marginal likelihood. Its
    variance far from all poses is that of the residuals themselves, so that what it has
    not seen it calls unknown [1]. With many observations it is projected onto its
    values at some of them (section 8.3.4 of [1]), which is exact where these are all.

    [1] Rasmussen, C. E. and Williams, C. K. I., Gaussian Processes for Machine Learning, chapters 2, 4, 5 and 8, MIT Press,
        2006.
    """
    from scipy.optimize import Bounds, minimize

    draws = np.random.default_rng(seed)
    columns = inputs.columns
    taken = np.flatnonzero(columns.std(axis=0) > _STILL)
    middle = columns[:, taken].mean(axis=0)
    spread = columns[:, taken].std(axis=0)

    def scaled(some: Inputs) -> np.ndarray:
        return (some.columns[:, taken] - middle) / spread

    known = scaled(inputs)
    few, many = (
        np.sort(draws.permutation(len(known))[:most])
        for most in (_MOST_FOR_HYPERPARAMETERS, _MOST)
    )
    offset = residual.mean(axis=0)
    size = residual.std(axis=0)
    size = np.where(size > 0.0, size, 1.0)
    standard = (residual - offset) / size
    ranges = np.log([_VARIANCE, *[_LENGTH] * len(taken), _NOISE])
    # A length at its bound is an input without influence, not a failure.
    args = (known[few], standard[few])
    bounds = Bounds(*ranges[:, 1:].T)
    found = minimize(
        _surprise,
        ranges[:, 0],
        args,
        "L-BFGS-B",
        jac=True,
        bounds=bounds,
        options={"ftol": _LAST_GAIN},
    ).x
    variance, *lengths, noise = np.exp(found)
    places = known[many] / lengths
    lower = lapack.dpotrf(
        variance * (_matern(places, places)[0] + _JITTER * np.eye(len(many))), lower=1
    )[0]

    def features(asked: np.ndarray) -> np.ndarray:
        return lapack.dtrtrs(
            lower, variance * _matern(places, asked / lengths)[0], lower=1
        )[0]

    gram = noise * np.eye(len(many))
    right = np.zeros((len(many), 3))
    for part in _parts(inputs):
        rows = features(known[part])
        gram += rows @ rows.T
        right += rows @ standard[part]
    factor = lapack.dpotrf(gram, lower=1)[0]
    weights = (
        variance
        * lapack.dtrtrs(
            lower, lapack.dpotrs(factor, right, lower=1)[0], lower=1, trans=1
        )[0]
        * size
    )

    def mean(there: Inputs) -> np.ndarray:
        asked = scaled(there)
        return _stacked(
            _matern(asked[part] / lengths, places)[0] @ weights + offset
            for part in _parts(there)
        )

    def std(there: Inputs) -> np.ndarray:
        asked = scaled(there)
        found = [np.zeros(0)]
        for part in _parts(there):
            rows = features(asked[part])
            unsure = noise * (lapack.dtrtrs(factor, rows, lower=1)[0] ** 2).sum(axis=0)
            found.append(variance + noise - (rows**2).sum(axis=0) + unsure)
        return np.sqrt(np.maximum(np.concatenate(found), 0.0))[:, None] * size

    yield Predictor(mean, std)


REGRESSIONS = {
    # What the method's authors use for regression: all inputs at each node, and no node
    # of fewer observations is split.
    "extra_trees": Regression(
        "forest of extremely randomized trees",
        fit_extra_trees,
        ({"min_samples_split": 5, "max_features": 1.0},),
    ),
    "gaussian_process": Regression("Gaussian process", fit_gaussian_process),
    "ridge_harmonics": Regression(
        "ridge regression on harmonics of the joint angles",
        fit_ridge_harmonics,
        tuple(
            {"orders": n, "penalty": float(each)}
            for n in (1, 2, 6, 12, 36)
            for each in np.logspace(-5.0, 3.0, 9)
        ),
        by_jacobian=True,
    ),
    "two_joints": Regression(
        "ridge regression on functions of two joints' angles",
        fit_two_joints,
        by_jacobian=True,
    ),
}


def list_regressions() -> dict[str, Regression]:
    """Regressions of this package, and those that installed packages offer, by name."""
    return REGRESSIONS | _plugin_regressions()


@cache
def _plugin_regressions() -> dict[str, Regression]:
    return load_plugins(plugins.REGRESSIONS, Regression, REGRESSIONS)


def compute_harmonic_columns(inputs: Inputs, orders: int) -> np.ndarray:
    """Displacement of the target by one radian of each harmonic, (M, 3, 2 n orders),
    lower orders first."""
    waves = np.cumprod(
        np.repeat(np.exp(1j * inputs.joint_angles)[:, None], orders, axis=1), axis=1
    )
    harmonics = np.stack([waves.imag, waves.real], axis=2)
    along = inputs.jacobian[:, :, None, None, : inputs.joint_angles.shape[1]]
    return (along * harmonics[:, None]).reshape(len(inputs), 3, -1)


def compute_pair_columns(
    inputs: Inputs, pair: tuple[int, int], moved: np.ndarray
) -> np.ndarray:
    """What products of the first waves of two joints' angles, and the second of each,
    do as deviations of joints: (M, 3, D)."""
    angles = inputs.joint_angles[:, pair]
    first = np.stack([np.ones_like(angles), np.sin(angles), np.cos(angles)], axis=1)
    products = (first[:, :, None, 0] * first[:, None, :, 1]).reshape(len(inputs), -1)
    functions = np.hstack([products, np.sin(2.0 * angles), np.cos(2.0 * angles)])
    return (inputs.jacobian[:, :, moved, None] * functions[:, None, None]).reshape(
        len(inputs), 3, -1
    )


def _parts(inputs: Inputs) -> list[slice]:
    return [slice(first, first + _AT_ONCE) for first in range(0, len(inputs), _AT_ONCE)]


def _stacked(parts: Iterator[np.ndarray]) -> np.ndarray:
    """Rows of three of all parts, and none of no part."""
    return np.concatenate([np.zeros((0, 3)), *parts])


def _matern(some: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matérn's correlation of order 5/2, and the slope by which it falls with half of a
    squared distance: ndarray (N, M)."""
    square = (
        (some**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2.0 * some @ others.T
    )
    root = np.sqrt(np.maximum(5.0 * square, 0.0))
    falling = np.exp(-root)
    slope = (1.0 + root) * falling
    return slope + root**2 / 3.0 * falling, 5.0 / 3.0 * slope


def _surprise(
    logarithms: np.ndarray, inputs: np.ndarray, standard: np.ndarray
) -> tuple[float, np.ndarray]:
    """Minus the logarithm of a Gaussian process's marginal likelihood, and its
    gradient: its equations 5.8 and 5.9.

    A length moves the covariance by a product of the slope and squared differences of
    one input, whose sum over all pairs is a product of matrices.

    `inputs` (N, k). `standard` (N, 3): residuals of mean 0 and size 1.
    """
    variance, *lengths, noise = np.exp(logarithms)
    (count, axes), scaled = standard.shape, inputs / lengths
    correlation, slope = _matern(scaled, scaled)
    covariance = variance * correlation
    covariance[np.diag_indices(count)] = variance + noise + _JITTER
    lower, failed = lapack.dpotrf(covariance.T, lower=1, overwrite_a=1)
    if failed:
        return np.inf, np.zeros(len(logarithms))
    along = lapack.dpotrs(lower, standard, lower=1)[0]
    value = 0.5 * (standard * along).sum() + axes * (
        np.log(np.diag(lower)).sum() + 0.5 * count * np.log(2.0 * np.pi)
    )
    inverse = -axes * invert_cholesky_factor(lower)
    inverse += along @ along.T
    of_noise = noise * np.trace(inverse)
    of_variance = variance * np.vdot(inverse.T, correlation)
    slope *= inverse
    of_lengths = (
        2.0
        * variance
        * (slope.sum(axis=1) @ scaled**2 - (scaled * (slope @ scaled)).sum(axis=0))
    )
    return float(value), -0.5 * np.array([of_variance, *of_lengths, of_noise])
