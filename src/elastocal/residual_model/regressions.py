"""Regressions on the residuals of a fitted model: the catalogue, their inputs and their
predictions.

A regression is a function of the inputs of M observations, their residuals (M, 3), m,
base axes, a sequence of settings, and the seed of its random numbers. It yields one
predictor for each setting.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import lapack

from elastocal.effects.formulas import Term, list_terms, make_symbolic_angles
from elastocal.fitting.normal_equations import invert_cholesky_factor
from elastocal.io import plugins
from elastocal.io.plugins import load_plugins
from elastocal.residual_model.laws import DisplacementLaw, ProcessLaw, Tree, TreesLaw

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence

    from elastocal.residual_model.laws import Law

    Setting = Mapping[str, Any]

# Number of observations whose columns or covariances are in memory at once.
_CHUNK = 500
# Trees of a forest.
_TREES = 100
# A node of fewer observations is not split, as the method's authors suggest for
# regression.
_MIN_SAMPLES_SPLIT = 5
# Penalties of functions of two joints, in mean squares of a column.
_PENALTIES = np.logspace(-4.0, 2.0, 7)
# Observations from which the hyperparameters of the process are estimated. A step of
# this search costs the third power of their number; 800 observations take eight times
# as long and change errors by 2 % in either direction (UR5 and UR10).
_MAX_FOR_HYPERPARAMETERS = 300
# Upper bound on the inducing points of the process, drawn at random from the
# observations; their covariance takes 32 MB. Held-out RMS of UR10 A (8,350
# observations) after geometry: 0.169 mm with 1,000 in 0.5 s, 0.141 with 2,000 in 1.7 s,
# 0.122 with all in 14 s and 0.56 GB.
_MAX_INDUCING_POINTS = 2_000
# Start and bounds of the search for the hyperparameters: the variance of the process;
# lengths in standard deviations of each input, from changes between neighbours to one
# trend across all poses; and the variance of the noise.
_VARIANCE = (1.0, 1e-3, 1e3)
_LENGTH = (1.0, 0.05, 100.0)
_NOISE = (0.5, 1e-4, 10.0)
# The search stops when a step raises the log likelihood by less than this share. With
# scipy's default of 2e-9 it stopped on a plateau, and changes of the residuals by 1e-8
# decided the way out (simulated KUKA: a regression or none).
_LIKELIHOOD_TOLERANCE = 1e-11
# Share of the variance that is added to the diagonal, so that the covariance is positive
# definite despite rounding.
_JITTER = 1e-8
# An input whose standard deviation over all poses is smaller is constant: rad, N, m, s,
# degC.
_CONSTANT_STD = 1e-10


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of a regression at M observations.

    Attributes
    ----------
    joint_angles : (M, n) array, rad
    covariates : (M, k) array
        Wrench, and position of the target in the frame of its measuring point. Time and
        temperature are not included, because a correction does not know them.
    jacobian : (M, 3, C) array, base axes
        Displacement of the target by the joints first, then by base and links, m per rad
        or m; then by the effects of the model, see `selection.build_inputs`.
    parts : tuple of Inputs
        Inputs that together have the same observations, in any order. Their stored Gram
        matrices serve every union of them. Empty if there are none.
    """

    joint_angles: np.ndarray
    covariates: np.ndarray
    jacobian: np.ndarray
    parts: tuple[Inputs, ...] = ()

    def __len__(self) -> int:
        return len(self.joint_angles)

    @property
    def columns(self) -> np.ndarray:
        """Joint angles and covariates, (M, n + k) array."""
        return np.hstack([self.joint_angles, self.covariates])

    def select(self, chosen: np.ndarray | slice) -> Inputs:
        """Select observations."""
        return Inputs(
            self.joint_angles[chosen], self.covariates[chosen], self.jacobian[chosen]
        )

    @cached_property
    def _grams(self) -> dict[Hashable, np.ndarray]:
        """Gram matrices of these observations, by the name of their columns."""
        return {}

    def sum_gram(
        self, columns: Hashable, compute: Callable[[Inputs], np.ndarray]
    ) -> np.ndarray:
        """Sum a Gram matrix over the observations in chunks, and store it.

        Inputs with parts add the stored matrices of their parts, because the
        cross-validation fits many unions of the same few folds.

        Parameters
        ----------
        columns : name of the columns
        compute : returns the matrix of a chunk of the observations
        """
        if self.parts:
            grams = [inputs.sum_gram(columns, compute) for inputs in self.parts]
            return np.asarray(np.sum(grams, axis=0))
        if columns not in self._grams:
            chunks = _split_into_chunks(self)
            self._grams[columns] = np.sum(
                [compute(self.select(chunk)) for chunk in chunks], axis=0
            )
        return self._grams[columns]

    @cached_property
    def principal_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues (C,), not negative, and eigenvectors (C, C) of the Gram matrix of
        the Jacobian's columns."""
        eigenvalues, axes = np.linalg.eigh(
            self.sum_gram("jacobian", _compute_jacobian_gram)
        )
        return np.maximum(eigenvalues, 0.0), axes


@dataclass(frozen=True)
class Predictor:
    """A fitted regression, as functions of the inputs of M other observations.

    Attributes
    ----------
    mean : function
        Returns predicted residuals, (M, 3) array, m, base axes.
    std : function
        Returns the standard deviation of a new measurement about them, (M, 3) array, m;
        not a number if the regression states none.
    law : function, optional
        Returns the formula of the mean, see `laws`; None if it has none that other
        programs can evaluate. Cross-validation fits hundreds and asks for none.
    """

    mean: Callable[[Inputs], np.ndarray]
    std: Callable[[Inputs], np.ndarray] = lambda inputs: np.full(
        (len(inputs), 3), np.nan
    )
    law: Callable[[], Law] | None = None


@dataclass(frozen=True)
class Regression:
    """An entry of the catalogue.

    Attributes
    ----------
    description : name for reports
    fit : function of inputs, residuals, settings and seed, see the module
    settings : hyperparameters among which cross-validation chooses; a single one if the
        regression chooses by itself
    uses_jacobian : whether it needs `Inputs.jacobian`, which takes most of the memory
    tune : function or None
        Estimates hyperparameters, by inputs, residuals and seed, that all folds of a
        cross-validation share: a setting instead of the single one.
    min_rows : function
        Fewest observations, by the number of joints, with which the best regression may
        be this one; a campaign that names it has it with any number.
    """

    description: str
    fit: Callable[[Inputs, np.ndarray, Sequence[Setting], int], Iterator[Predictor]]
    settings: Sequence[Setting] = ({},)
    uses_jacobian: bool = False
    tune: Callable[[Inputs, np.ndarray, int], Setting] | None = None
    min_rows: Callable[[int], int] = lambda joints: 0


@dataclass(frozen=True)
class _RidgeSolution:
    """Solution of a ridge regression on G geometry columns and D other columns.

    Attributes
    ----------
    coefficients : (G + D,) array
    explained_square : product of the solution with the projected residual
    log_determinant : ln |I + Gram matrix / penalty| of all columns
    """

    coefficients: np.ndarray
    explained_square: float
    log_determinant: float


@dataclass(frozen=True)
class _GeometryBlock:
    """The geometry columns that all ridge regressions on the same data share, along the
    principal axes of their Gram matrix.

    Attributes
    ----------
    eigenvalues : (G,) array
    axes : (G, G) array, eigenvectors
    projection : (G,) array, products of the columns along these axes with the residual
    """

    eigenvalues: np.ndarray
    axes: np.ndarray
    projection: np.ndarray

    @classmethod
    def from_inputs(cls, inputs: Inputs, residual: np.ndarray) -> _GeometryBlock:
        """Project residuals (M, 3) on the principal axes of the Jacobian's columns."""
        eigenvalues, axes = inputs.principal_axes
        columns = inputs.jacobian.reshape(residual.size, -1)
        return cls(eigenvalues, axes, axes.T @ (columns.T @ residual.ravel()))

    def mean_square(self, gram: np.ndarray) -> float:
        """Mean square of all columns, with the others' Gram matrix (D, D)."""
        trace = self.eigenvalues.sum() + np.trace(gram)
        columns = len(self.eigenvalues) + len(gram)
        return max(trace / columns, np.finfo(float).tiny)

    def solve_ridge(
        self,
        cross_gram: np.ndarray,
        gram: np.ndarray,
        projection: np.ndarray,
        penalty: float,
    ) -> _RidgeSolution:
        """Solve a ridge regression by the Schur complement of the geometry columns.

        Parameters
        ----------
        cross_gram : (G, D) array, products of the principal axes with the other columns
        gram : (D, D) array, Gram matrix of the other columns
        projection : (D,) array, products of the other columns with the residual
        penalty : of all coefficients
        """
        shrunk = cross_gram / (self.eigenvalues + penalty)[:, None]
        factor, others, _ = lapack.dposv(
            gram - shrunk.T @ cross_gram + penalty * np.eye(len(gram)),
            projection - shrunk.T @ self.projection,
            lower=1,
        )
        along_axes = self.projection / (self.eigenvalues + penalty) - shrunk @ others
        log_determinant = (
            np.log1p(self.eigenvalues / penalty).sum()
            + np.log(np.diag(factor) ** 2 / penalty).sum()
        )
        return _RidgeSolution(
            np.concatenate([self.axes @ along_axes, others]),
            self.projection @ along_axes + projection @ others,
            log_determinant,
        )


@dataclass(frozen=True)
class _DualRidge:
    """Ridge regression with fewer rows than columns, along the principal axes of the
    products of the rows [1]_, so that further penalties cost next to nothing.

    Attributes
    ----------
    rows : (R, P) array
    eigenvalues : (R,) array
    axes : (R, R) array, eigenvectors
    projection : (R,) array, the residual along these axes

    References
    ----------
    .. [1] Saunders, Gammerman and Vovk, Ridge regression learning algorithm in dual
       variables, International Conference on Machine Learning 15, 1998.
    """

    rows: np.ndarray
    eigenvalues: np.ndarray
    axes: np.ndarray
    projection: np.ndarray

    @classmethod
    def from_rows(cls, rows: np.ndarray, target: np.ndarray) -> _DualRidge:
        """Diagonalize the products of the rows (R, P), given the residual (R,)."""
        eigenvalues, axes = np.linalg.eigh(rows @ rows.T)
        return cls(rows, np.maximum(eigenvalues, 0.0), axes, axes.T @ target)

    def solve(self, penalty: float) -> np.ndarray:
        """Solve for the coefficients (P,), with a penalty on all of them."""
        multipliers = self.axes @ (self.projection / (self.eigenvalues + penalty))
        return self.rows.T @ multipliers


def fit_ridge_harmonics(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Fit harmonics of each joint's angle as deviations of that joint, and geometry.

    The harmonics describe what gears, encoders and runout can do to a joint: a Fourier
    series of every joint, carried to the target by the Jacobian. Constant displacements
    of base and links resemble some of them, so both are fitted together by ridge
    regression with one penalty for all coefficients [1]_, in mean squares of a column.

    References
    ----------
    .. [1] Hoerl and Kennard, Ridge regression: biased estimation for nonorthogonal
       problems, Technometrics 12, 1970.
    """

    # The same poses are predicted with one penalty after the other.
    @lru_cache(maxsize=2)
    def evaluate(queries: Inputs, orders: int) -> np.ndarray:
        return compute_harmonics(queries.joint_angles, orders)

    max_orders = max(setting["orders"] for setting in settings)
    joints = inputs.joint_angles.shape[1]
    split = inputs.jacobian.shape[2]
    gram = inputs.sum_gram(
        ("harmonics", max_orders), partial(_compute_harmonic_gram, orders=max_orders)
    )
    projection = _project_on_harmonics(inputs, residual, max_orders)
    geometry = _GeometryBlock.from_inputs(inputs, residual)
    cross_gram = geometry.axes.T @ gram[:split]

    # Settings of the same orders follow each other.
    @lru_cache(maxsize=1)
    def build_dual(orders: int) -> _DualRidge:
        columns = [inputs.jacobian, compute_harmonic_columns(inputs, orders)]
        rows = np.concatenate(columns, axis=2).reshape(residual.size, -1)
        return _DualRidge.from_rows(rows, residual.ravel())

    for setting in settings:
        # Lower orders come first among the harmonics, so that fewer orders are the first
        # columns.
        orders = setting["orders"]
        end = split + 2 * orders * joints
        harmonic_gram = gram[split:end, : end - split]
        penalty = setting["penalty"] * geometry.mean_square(harmonic_gram)
        if residual.size < end:
            coefficients = build_dual(orders).solve(penalty)
        else:
            coefficients = geometry.solve_ridge(
                cross_gram[:, : end - split],
                harmonic_gram,
                projection[: end - split],
                penalty,
            ).coefficients

        def mean(
            queries: Inputs,
            coefficients: np.ndarray = coefficients,
            orders: int = orders,
        ) -> np.ndarray:
            geometric, amplitudes = np.split(coefficients, [split])
            deviations = np.einsum(
                "mwn,wn->mn",
                evaluate(queries, orders),
                amplitudes.reshape(2 * orders, joints),
            )
            by_joint = queries.jacobian[:, :, :joints] @ deviations[..., None]
            return queries.jacobian @ geometric + by_joint[..., 0]

        law = partial(_express_harmonics, coefficients, orders, joints)
        yield Predictor(mean, law=law)


def _compute_jacobian_gram(inputs: Inputs) -> np.ndarray:
    """Gram matrix (C, C) of the Jacobian's columns."""
    rows = inputs.jacobian.reshape(-1, inputs.jacobian.shape[2])
    return rows.T @ rows


def _compute_harmonic_gram(inputs: Inputs, orders: int) -> np.ndarray:
    """Products (C + D, D) of the Jacobian's columns and of the harmonics with the
    harmonics."""
    columns = compute_harmonic_columns(inputs, orders)
    return _multiply_with_all(inputs.jacobian, columns)


def _compute_pair_gram(inputs: Inputs, pair: tuple[int, int]) -> np.ndarray:
    """Products (C + D, D) of the Jacobian's columns and of the functions of two joints'
    angles with the latter."""
    joints = np.arange(inputs.joint_angles.shape[1])
    return _multiply_with_all(
        inputs.jacobian, compute_pair_columns(inputs, pair, joints)
    )


def _multiply_with_all(jacobian: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Multiply the columns of a Jacobian (M, 3, C) and further columns (M, 3, D) with the
    further ones: (C + D, D) array."""
    column_rows = columns.reshape(-1, columns.shape[2])
    jacobian_rows = jacobian.reshape(-1, jacobian.shape[2])
    return np.concatenate([jacobian_rows.T @ column_rows, column_rows.T @ column_rows])


def _project_on_harmonics(
    inputs: Inputs, residual: np.ndarray, orders: int
) -> np.ndarray:
    """Products (D,) of the columns of `compute_harmonic_columns` with residuals (M, 3)."""
    harmonics = compute_harmonics(inputs.joint_angles, orders)
    along_joints = _project_on_joints(inputs, residual)
    return np.einsum("mwn,mn->wn", harmonics, along_joints).ravel()


def _project_on_joints(inputs: Inputs, residual: np.ndarray) -> np.ndarray:
    """Products (M, n) of residuals (M, 3) with the displacement by each joint."""
    joint_jacobian = inputs.jacobian[:, :, : inputs.joint_angles.shape[1]]
    return np.einsum("maj,ma->mj", joint_jacobian, residual)


def _express_harmonics(
    coefficients: np.ndarray, orders: int, joints: int
) -> DisplacementLaw:
    """Express a ridge regression on `compute_harmonic_columns`."""
    geometry, harmonics = np.split(coefficients, [-2 * orders * joints])
    amplitudes = harmonics.reshape(orders, 2, joints)
    terms = [
        Term(joint, float(amplitude), ("sin", "cos")[wave], ((joint, order + 1.0),))
        for (order, wave, joint), amplitude in np.ndenumerate(amplitudes)
    ]
    return DisplacementLaw(geometry, tuple(terms))


def _profile_likelihood(target: np.ndarray, solution: _RidgeSolution) -> float:
    """Compute twice the log marginal likelihood of a solution, up to a constant.

    The noise variance has its most probable value.
    """
    unexplained = max(target @ target - solution.explained_square, np.finfo(float).tiny)
    return -len(target) * np.log(unexplained) - solution.log_determinant


def fit_two_joints(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Fit functions of two joints' angles as deviations of joints, and geometry.

    Effects of the catalogue belong to one joint each and cannot describe such deviations.
    The pair of joints and the penalty of this ridge regression have the largest marginal
    likelihood, with the noise profiled [1]_.

    References
    ----------
    .. [1] MacKay, Bayesian interpolation, Neural Computation 4, 1992.
    """
    joints = np.arange(inputs.joint_angles.shape[1])
    target = residual.ravel()
    split = inputs.jacobian.shape[2]
    geometry = _GeometryBlock.from_inputs(inputs, residual)
    along_joints = _project_on_joints(inputs, residual)
    largest_likelihood = -np.inf
    for pair in combinations(range(len(joints)), 2):
        for solution in _solve_pair(inputs, pair, geometry, along_joints):
            likelihood = _profile_likelihood(target, solution)
            if likelihood > largest_likelihood:
                largest_likelihood = likelihood
                best_pair = pair
                coefficients = solution.coefficients

    def mean(queries: Inputs) -> np.ndarray:
        columns = compute_pair_columns(queries, best_pair, joints)
        geometric, by_pair = np.split(coefficients, [split])
        return queries.jacobian @ geometric + columns @ by_pair

    yield Predictor(
        mean, law=partial(_express_pair, coefficients, best_pair, len(joints))
    )


def _solve_pair(
    inputs: Inputs,
    pair: tuple[int, int],
    geometry: _GeometryBlock,
    along_joints: np.ndarray,
) -> Iterator[_RidgeSolution]:
    """Solve the ridge regression on functions of two joints' angles for each penalty.

    `along_joints` (M, n) are the products of the residuals with the displacement by
    each joint.
    """
    products = inputs.sum_gram(("pair", pair), partial(_compute_pair_gram, pair=pair))
    split = inputs.jacobian.shape[2]
    cross_gram = geometry.axes.T @ products[:split]
    gram = products[split:]
    functions = compute_pair_functions(inputs.joint_angles[:, pair])
    projection = (along_joints.T @ functions).ravel()
    for penalty in _PENALTIES * geometry.mean_square(gram):
        yield geometry.solve_ridge(cross_gram, gram, projection, penalty)


def _express_pair(
    coefficients: np.ndarray, pair: tuple[int, int], joints: int
) -> DisplacementLaw:
    """Express a ridge regression on `compute_pair_columns` of all joints."""
    functions = compute_pair_functions(make_symbolic_angles(joints)[:, pair])[0]
    geometry, by_pair = np.split(coefficients, [-joints * len(functions)])
    displacements = by_pair.reshape(joints, -1) @ functions
    terms: list[Term] = []
    for joint, displacement in enumerate(displacements):
        terms += list_terms(joint, displacement)
    return DisplacementLaw(geometry, tuple(terms))


def fit_extra_trees(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Fit extremely randomized trees for all axes together [1]_.

    They average neighbours in boxes, which suits residuals that are not smooth.

    References
    ----------
    .. [1] Geurts, Ernst and Wehenkel, Extremely randomized trees, Machine Learning 63,
       2006.
    """
    # Import scikit-learn only here, because most users of the catalogue grow no tree.
    from sklearn.tree import ExtraTreeRegressor

    (setting,) = settings
    columns = inputs.columns.astype(np.float32)
    target = np.ascontiguousarray(residual)
    stream = np.random.RandomState(seed)
    seeds = [stream.randint(np.iinfo(np.int32).max) for _ in range(_TREES)]
    # Fit the trees one by one: a forest would check the same inputs for each tree.
    trees = [
        ExtraTreeRegressor(random_state=tree_seed, **setting).fit(
            columns, target, check_input=False
        )
        for tree_seed in seeds
    ]

    def mean(queries: Inputs) -> np.ndarray:
        rows = queries.columns.astype(np.float32)
        predictions = [tree.predict(rows, check_input=False) for tree in trees]
        return np.mean(predictions, axis=0)

    def law() -> TreesLaw:
        grown = []
        for tree in trees:
            nodes = tree.tree_
            children = np.stack([nodes.children_left, nodes.children_right], axis=1)
            value = nodes.value[:, :, 0]
            grown.append(Tree(nodes.feature, nodes.threshold, children, value))
        return TreesLaw(tuple(grown))

    yield Predictor(mean, law=law)


def count_rows_of_a_tree(joints: int) -> int:
    """Count the observations with which a tree can split once along each joint.

    With fewer, its boxes average over most of the workspace, as smoother regressions do
    at less cost.
    """
    return int(_MIN_SAMPLES_SPLIT * 2**joints)


@dataclass(frozen=True)
class _Hyperparameters:
    """Variance of a Gaussian process, length of each scaled input (d,), and variance of
    the noise."""

    variance: float
    lengths: np.ndarray
    noise: float

    @classmethod
    def from_logarithms(cls, logarithms: np.ndarray) -> _Hyperparameters:
        """Hyperparameters by their logarithms, in the order of the fields."""
        variance, *lengths, noise = np.exp(logarithms)
        return cls(variance, np.array(lengths), noise)


@dataclass(frozen=True)
class _GaussianProcess:
    """A Gaussian process that is projected onto its values at N inducing points.

    Attributes
    ----------
    hyperparameters : of scaled inputs and standardized residuals
    points : (N, d) array, inducing points in units of the lengths
    prior_factor : (N, N) Cholesky factor of their prior covariance
    gram_factor : (N, N) Cholesky factor of the Gram matrix of the features plus the noise
    weights : (N, 3) array, of the correlations with the inducing points
    """

    hyperparameters: _Hyperparameters
    points: np.ndarray
    prior_factor: np.ndarray
    gram_factor: np.ndarray
    weights: np.ndarray

    def mean(self, inputs: np.ndarray) -> np.ndarray:
        """Predict standardized residuals (M, 3) at scaled inputs (M, d)."""
        inputs = inputs / self.hyperparameters.lengths
        return _concatenate(
            _evaluate_matern(inputs[chunk], self.points)[0] @ self.weights
            for chunk in _split_into_chunks(inputs)
        )

    def std(self, inputs: np.ndarray) -> np.ndarray:
        """Predict the standard deviation (M,) of new standardized residuals."""
        variance = self.hyperparameters.variance
        noise = self.hyperparameters.noise
        inputs = inputs / self.hyperparameters.lengths
        variances = [np.zeros(0)]
        for chunk in _split_into_chunks(inputs):
            features = _compute_features(
                self.points, inputs[chunk], self.prior_factor, variance
            )
            solved = lapack.dtrtrs(self.gram_factor, features, lower=1)[0]
            posterior = noise * (solved**2).sum(axis=0)
            variances.append(variance + noise - (features**2).sum(axis=0) + posterior)
        return np.sqrt(np.maximum(np.concatenate(variances), 0.0))


def fit_gaussian_process(
    inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int
) -> Iterator[Predictor]:
    """Fit a Gaussian process: smooth in all inputs, with intervals that grow away from
    the measured poses.

    All three axes share one process, each with a size of its own: a Matérn kernel with
    a length for each input, and noise, with the largest marginal likelihood. Far from
    all poses its variance is that of the residuals themselves, so that its intervals
    there say that nothing is known [1]_. With many observations the process is projected
    onto its values at some of them (section 8.3.4 of [1]_); the result is exact if these
    are all observations.

    References
    ----------
    .. [1] Rasmussen and Williams, Gaussian Processes for Machine Learning, chapters 2,
       4, 5 and 8, MIT Press, 2006.
    """
    (setting,) = settings
    scaling = _Scaling.from_observations(inputs, residual)
    stream = np.random.default_rng(seed)
    chosen = setting or _tune_process(scaling, inputs, residual, stream)
    hyperparameters = _Hyperparameters(
        chosen["variance"],
        np.asarray(chosen["lengths"])[scaling.varying],
        chosen["noise"],
    )
    process = _fit_process(
        scaling.scale(inputs), scaling.standardize(residual), hyperparameters, stream
    )
    yield Predictor(
        lambda queries: (
            process.mean(scaling.scale(queries)) * scaling.size + scaling.offset
        ),
        lambda queries: process.std(scaling.scale(queries))[:, None] * scaling.size,
        partial(
            ProcessLaw,
            scaling.varying,
            scaling.center,
            scaling.spread,
            hyperparameters.lengths,
            process.points,
            process.weights,
            scaling.offset,
            scaling.size,
            chosen,
        ),
    )


def tune_gaussian_process(inputs: Inputs, residual: np.ndarray, seed: int) -> Setting:
    """Estimate the hyperparameters of `fit_gaussian_process`, as a setting of it."""
    scaling = _Scaling.from_observations(inputs, residual)
    return _tune_process(scaling, inputs, residual, np.random.default_rng(seed))


@dataclass(frozen=True)
class _Scaling:
    """Scale of the inputs and residuals of a process.

    Attributes
    ----------
    varying : (d,) int array, columns of the inputs that vary over the observations
    center, spread : (d,) arrays, mean and standard deviation of these columns
    offset, size : (3,) arrays, mean and standard deviation of the residuals, m
    """

    varying: np.ndarray
    center: np.ndarray
    spread: np.ndarray
    offset: np.ndarray
    size: np.ndarray

    @classmethod
    def from_observations(cls, inputs: Inputs, residual: np.ndarray) -> _Scaling:
        """Scale by M observations with residuals (M, 3), m."""
        columns = inputs.columns
        varying = np.flatnonzero(columns.std(axis=0) > _CONSTANT_STD)
        size = residual.std(axis=0)
        return cls(
            varying,
            columns[:, varying].mean(axis=0),
            columns[:, varying].std(axis=0),
            residual.mean(axis=0),
            np.where(size > 0.0, size, 1.0),
        )

    def scale(self, queries: Inputs) -> np.ndarray:
        """Scale the varying inputs, (M, d) array."""
        return (queries.columns[:, self.varying] - self.center) / self.spread

    def standardize(self, residual: np.ndarray) -> np.ndarray:
        """Standardize residuals (M, 3), m."""
        return (residual - self.offset) / self.size


def _tune_process(
    scaling: _Scaling,
    inputs: Inputs,
    residual: np.ndarray,
    stream: np.random.Generator,
) -> Setting:
    """Estimate the hyperparameters by some of the observations. An input that does not
    vary there has an infinite length, which is no influence."""
    subset = np.sort(stream.permutation(len(inputs))[:_MAX_FOR_HYPERPARAMETERS])
    optimum = _maximize_likelihood(
        scaling.scale(inputs.select(subset)), scaling.standardize(residual[subset])
    )
    lengths = np.full(inputs.columns.shape[1], np.inf)
    lengths[scaling.varying] = optimum.lengths
    return {"variance": optimum.variance, "lengths": lengths, "noise": optimum.noise}


def _fit_process(
    inputs: np.ndarray,
    residual: np.ndarray,
    hyperparameters: _Hyperparameters,
    stream: np.random.Generator,
) -> _GaussianProcess:
    """Fit a process to scaled inputs (M, d) and standardized residuals (M, 3)."""
    inducing = np.sort(stream.permutation(len(inputs))[:_MAX_INDUCING_POINTS])
    variance = hyperparameters.variance
    inputs = inputs / hyperparameters.lengths
    points = inputs[inducing]
    correlation = _evaluate_matern(points, points)[0]
    correlation[np.diag_indices_from(correlation)] += _JITTER
    prior_factor = lapack.dpotrf(variance * correlation, lower=1)[0]
    gram = hyperparameters.noise * np.eye(len(points))
    projection = np.zeros((len(points), 3))
    for chunk in _split_into_chunks(inputs):
        features = _compute_features(points, inputs[chunk], prior_factor, variance)
        gram += features @ features.T
        projection += features @ residual[chunk]
    gram_factor = lapack.dpotrf(gram, lower=1)[0]
    coefficients = lapack.dpotrs(gram_factor, projection, lower=1)[0]
    weights = variance * lapack.dtrtrs(prior_factor, coefficients, lower=1, trans=1)[0]
    return _GaussianProcess(hyperparameters, points, prior_factor, gram_factor, weights)


REGRESSIONS = {
    # The settings that the method's authors use for regression: all inputs are candidates
    # at each node, and nodes of fewer observations are not split.
    "extra_trees": Regression(
        "forest of extremely randomized trees",
        fit_extra_trees,
        ({"min_samples_split": _MIN_SAMPLES_SPLIT, "max_features": 1.0},),
        min_rows=count_rows_of_a_tree,
    ),
    "gaussian_process": Regression(
        "Gaussian process", fit_gaussian_process, tune=tune_gaussian_process
    ),
    "ridge_harmonics": Regression(
        "ridge regression on harmonics of the joint angles",
        fit_ridge_harmonics,
        tuple(
            {"orders": orders, "penalty": float(penalty)}
            for orders in (1, 2, 6, 12, 36)
            for penalty in np.logspace(-5.0, 3.0, 9)
        ),
        uses_jacobian=True,
    ),
    "two_joints": Regression(
        "ridge regression on functions of two joints' angles",
        fit_two_joints,
        uses_jacobian=True,
    ),
}


def list_regressions() -> dict[str, Regression]:
    """List the regressions of this package and of installed plug-ins, by name."""
    return REGRESSIONS | _load_plugin_regressions()


@cache
def _load_plugin_regressions() -> dict[str, Regression]:
    return load_plugins(plugins.REGRESSIONS, Regression, REGRESSIONS)


def compute_harmonic_columns(inputs: Inputs, orders: int) -> np.ndarray:
    """Displacement of the target by one radian of each harmonic of each joint's angle.

    Returns a (M, 3, 2 n orders) array, lower orders first.
    """
    functions = compute_harmonics(inputs.joint_angles, orders)
    joint_jacobian = inputs.jacobian[:, :, : inputs.joint_angles.shape[1]]
    columns = joint_jacobian[:, :, None] * functions[:, None]
    return columns.reshape(len(inputs), 3, np.prod(columns.shape[2:]))


def compute_harmonics(joint_angles: np.ndarray, orders: int) -> np.ndarray:
    """Compute sine and cosine of the multiples of each angle (M, n), lower orders first:
    (M, 2 orders, n) array."""
    waves = np.repeat(np.exp(1j * joint_angles)[:, None], orders, axis=1)
    harmonics = np.cumprod(waves, axis=1)
    functions = np.stack([harmonics.imag, harmonics.real], axis=2)
    return functions.reshape(len(joint_angles), 2 * orders, joint_angles.shape[1])


def compute_pair_columns(
    inputs: Inputs, pair: tuple[int, int], displaced_joints: np.ndarray
) -> np.ndarray:
    """Displacement of the target by functions of two joints' angles.

    Every one of `compute_pair_functions` is a deviation of every joint in
    `displaced_joints`. Returns a (M, 3, D) array.
    """
    functions = compute_pair_functions(inputs.joint_angles[:, pair])
    displacement = inputs.jacobian[:, :, displaced_joints, None]
    count = len(displaced_joints) * functions.shape[1]
    return (displacement * functions[:, None, None]).reshape(len(inputs), 3, count)


def compute_pair_functions(angles: np.ndarray) -> np.ndarray:
    """Compute functions of two angles (M, 2), (M, 13) array.

    They are the products of the first harmonics of both angles, and the second harmonics
    of each.
    """
    first = np.stack([np.ones_like(angles), np.sin(angles), np.cos(angles)], axis=1)
    products = first[:, :, None, 0] * first[:, None, :, 1]
    return np.hstack(
        [
            # Sizes are written out, because a size of no rows cannot be inferred.
            products.reshape(len(angles), products.shape[1] * products.shape[2]),
            np.sin(2.0 * angles),
            np.cos(2.0 * angles),
        ]
    )


def _split_into_chunks(inputs: Inputs | np.ndarray) -> list[slice]:
    return [slice(start, start + _CHUNK) for start in range(0, len(inputs), _CHUNK)]


def _concatenate(chunks: Iterator[np.ndarray]) -> np.ndarray:
    """Rows of three columns of all chunks; without chunks there are no rows."""
    return np.concatenate([np.zeros((0, 3)), *chunks])


def _evaluate_matern(
    inputs: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Matérn correlation of order 5/2 between inputs (N, d) and points (M, d), in units
    of the lengths, and the negative slope by half of the squared distance: (N, M)."""
    square = (
        (inputs**2).sum(axis=1)[:, None]
        + (points**2).sum(axis=1)
        - 2.0 * inputs @ points.T
    )
    root = np.sqrt(np.maximum(5.0 * square, 0.0))
    decay = np.exp(-root)
    slope = (1.0 + root) * decay
    return slope + root**2 / 3.0 * decay, 5.0 / 3.0 * slope


def _compute_features(
    points: np.ndarray, inputs: np.ndarray, prior_factor: np.ndarray, variance: float
) -> np.ndarray:
    """Compute the covariances (N, M) between the process at inputs (M, d) and its
    whitened values at the N inducing points."""
    covariance = variance * _evaluate_matern(points, inputs)[0]
    return lapack.dtrtrs(prior_factor, covariance, lower=1)[0]


def _maximize_likelihood(inputs: np.ndarray, residual: np.ndarray) -> _Hyperparameters:
    """Hyperparameters with the largest marginal likelihood; arguments as in
    `_negative_log_likelihood`."""
    from scipy.optimize import Bounds, minimize

    ranges = np.log([_VARIANCE, *[_LENGTH] * inputs.shape[1], _NOISE])
    # A length at its bound is an input without influence, not a failure.
    optimum = minimize(
        _negative_log_likelihood,
        ranges[:, 0],
        (inputs, residual),
        "L-BFGS-B",
        jac=True,
        bounds=Bounds(*ranges[:, 1:].T),
        options={"ftol": _LIKELIHOOD_TOLERANCE},
    )
    return _Hyperparameters.from_logarithms(optimum.x)


def _negative_log_likelihood(
    logarithms: np.ndarray, inputs: np.ndarray, residual: np.ndarray
) -> tuple[float, np.ndarray]:
    """Negative log marginal likelihood of a Gaussian process, and its gradient.

    Equations 5.8 and 5.9 of Rasmussen and Williams (see `fit_gaussian_process`). A
    length changes the covariance by the product of the slope and the squared
    differences of one input, whose sum over all pairs is a product of matrices.

    Parameters
    ----------
    logarithms : (d + 2,) array, see `_Hyperparameters`
    inputs : (N, d) array, scaled
    residual : (N, 3) array, with mean 0 and standard deviation 1
    """
    hyperparameters = _Hyperparameters.from_logarithms(logarithms)
    variance = hyperparameters.variance
    noise = hyperparameters.noise
    axes = residual.shape[1]
    scaled = inputs / hyperparameters.lengths
    correlation, slope = _evaluate_matern(scaled, scaled)
    covariance = variance * correlation
    covariance[np.diag_indices_from(covariance)] = variance + noise + _JITTER
    factor, failed = lapack.dpotrf(covariance.T, lower=1, overwrite_a=1)
    if failed:
        return np.inf, np.zeros(len(logarithms))
    solved = lapack.dpotrs(factor, residual, lower=1)[0]
    value = 0.5 * (residual * solved).sum() + axes * (
        np.log(np.diag(factor)).sum() + 0.5 * len(residual) * np.log(2.0 * np.pi)
    )
    # Derivative of the log likelihood by the covariance, times two.
    inverse = -axes * invert_cholesky_factor(factor)
    inverse += solved @ solved.T
    slope *= inverse
    by_lengths = slope.sum(axis=1) @ scaled**2 - (scaled * (slope @ scaled)).sum(axis=0)
    gradient = [
        variance * np.vdot(inverse.T, correlation),
        *(2.0 * variance * by_lengths),
        noise * np.trace(inverse),
    ]
    return float(value), -0.5 * np.array(gradient)
