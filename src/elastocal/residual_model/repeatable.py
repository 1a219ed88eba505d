"""Test whether the residual of a fitted model is a function of the joint angles.

The test is a posterior predictive check [1]_. Its discrepancy says how well ridge
regressions on functions of the joint angles, fitted to the residuals of most
configurations, predict the residuals of the other configurations, in repeated
cross-validation [3]_.

Residuals are not independent errors: the fit has removed what its parameters can
follow, and its priors have left what they do not allow. Chance is therefore simulated
by residuals with random signs, one for each configuration (the cluster bootstrap of
residuals [2]_), and by parameters that are drawn from their priors. Both pass through
the same fit. Each configuration keeps the size of its errors and everything that its
measurements share, so that the noise need not be known.

References
----------
.. [1] Gelman, Meng and Stern, Posterior predictive assessment of model fitness via
   realized discrepancies, Statistica Sinica 6, 1996.
.. [2] Cameron, Gelbach and Miller, Bootstrap-based improvements for inference with
   clustered errors, Review of Economics and Statistics 90, 2008.
.. [3] Burman, A comparative study of ordinary cross-validation, v-fold cross-validation
   and the repeated learning-testing methods, Biometrika 76, 1989.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from elastocal.campaigns.holdout import SAME_POSE_RAD, number_configurations
from elastocal.fitting.least_squares import INTERMEDIATE_TOLERANCE, fit_model
from elastocal.fitting.observations import index_poses, sample_observations
from elastocal.residual_model.regressions import (
    Inputs,
    compute_harmonic_columns,
    compute_pair_columns,
)
from elastocal.residual_model.selection import (
    MIN_CONFIGURATIONS,
    build_geometric_inputs,
    estimate_gain,
)
from elastocal.verdict import RepeatableResidual

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations

# Functions of the joints: (M, 3, D) displacements of the targets of M observations.
Basis = Callable[[Inputs], np.ndarray]

# Level of the test: how often it rejects if the residual is chance alone.
LEVEL = 0.01
_FOLDS = 5
# The result of a single partition into folds depends on chance, so scores are summed
# over several partitions [3]_. Configurations are dealt out to groups once; each
# partition combines the groups to folds anew, which needs no further pass through the
# measurements.
_GROUPS = 10
_PARTITIONS = 4
# Number of simulated data sets.
_DRAWS = 299
_MAX_OBSERVATIONS = 10_000
# A basis has as many functions as there are configurations, within these bounds.
_MIN_FUNCTIONS = 60
_MAX_FUNCTIONS = 240
# Functions of two angles displace this many joints, those that move the targets most.
_DISPLACED_JOINTS = 3
# Ridge penalties in mean squares of a basis function: a small one suits strong errors
# that few functions describe, a large one suits weak errors of many functions.
_PENALTIES = (0.1, 1.0, 10.0)
# Length over which a smooth function of all joints changes, in standard deviations of
# the joint angles.
_LENGTH = 2.0


def detect_repeatable_residual(
    fitted: Fit, observations: Observations, seed: int
) -> RepeatableResidual | None:
    """Test whether the residual of a fitted model is a function of the joint angles.

    Parameters
    ----------
    fitted : Fit
    observations : the observations of the fit
    seed : of the signs, folds and basis functions

    Returns
    -------
    RepeatableResidual or None
        None with too few configurations, or if measurements have no vectors.
    """
    if fitted.model.rows == 1:
        return None
    sample = sample_observations(observations, _MAX_OBSERVATIONS)
    if len(sample) < len(observations):
        fitted = fit_model(
            fitted.model,
            sample,
            fitted.noise,
            fitted.estimate,
            reweight_first_step=True,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
    pose = index_poses(sample.states)
    configuration = number_configurations(sample.states.joint_angles, pose)
    if configuration.max() + 1 < MIN_CONFIGURATIONS:
        return None
    stream = np.random.default_rng(seed)
    models = _fit_models(fitted, sample, configuration[sample.cluster], stream)
    scores = np.stack([model.scores for model in models])
    mean = scores[:, 1:].mean(axis=1, keepdims=True)
    scores = (scores - mean) / scores[:, 1:].std(axis=1, keepdims=True)
    # One p-value for all models: the largest score of the data among the largest scores
    # of the simulated data sets.
    largest = scores.max(axis=0)
    p_value = float((largest >= largest[0]).mean())
    best = models[np.argmax(scores[:, 0])]
    gain = estimate_gain(*best.sum_predictions(), len(sample), _FOLDS)
    return RepeatableResidual(
        p_value, bool(p_value <= LEVEL), gain.rms_m, gain.rms_std_error_m
    )


@dataclass
class _BasisProducts:
    """Accumulates products of the D functions of a basis, over blocks of M observations.

    Attributes
    ----------
    basis : Basis
    configuration : (M,) int array, configuration of each observation, 0 .. G-1
    group : (G,) int array, group of each configuration, 0 .. C-1
    residual : (G, D) array, products with the residuals of each configuration
    gram : (C, D, D) array, Gram matrix of each group
    sensitivity : (C, D, P) array, products with the sensitivities of each group
    """

    basis: Basis
    configuration: np.ndarray
    group: np.ndarray
    residual: np.ndarray
    gram: np.ndarray
    sensitivity: np.ndarray

    def add(
        self,
        block: slice,
        inputs: Inputs,
        weight: np.ndarray,
        residual: np.ndarray,
        sensitivities: np.ndarray,
    ) -> None:
        """Add a block of observations.

        `weight` (M, 1, 1) is the square root of the robust weight. Sensitivities
        (M, 3, P) are weighted, residuals (M, 3) are not.
        """
        configuration = self.configuration[block]
        functions = weight * self.basis(inputs)
        products = (weight[:, :, 0] * residual)[:, None] @ functions
        _add_by_group(self.residual, configuration, products[:, 0])
        for number in range(_GROUPS):
            members = self.group[configuration] == number
            rows = functions[members].reshape(-1, functions.shape[2])
            self.gram[number] += rows.T @ rows
            # Explicit sizes, because a block may hold no member and a model no parameter.
            size = len(rows), self.sensitivity.shape[2]
            self.sensitivity[number] += rows.T @ sensitivities[members].reshape(size)


@dataclass(frozen=True)
class _Chance:
    """N simulated data sets of G configurations.

    Attributes
    ----------
    factor : (N, G) array, by which the residuals of each configuration are multiplied
    parameters : (N, P) array, change of the fitted parameters
    """

    factor: np.ndarray
    parameters: np.ndarray


@dataclass(frozen=True)
class _CrossValidatedModel:
    """Ridge regressions on one basis with one penalty, each fitted without a fold.

    Attributes
    ----------
    products : _BasisProducts
    scores : (1 + N,) array, products of left-out residuals and predictions over the norm
        of the predictions, summed over the partitions: of the data, then of the
        simulated data sets
    partitions : (R, C) int array, fold of each group of configurations
    coefficients : (R, K, D) array, fitted to the data without each fold
    """

    products: _BasisProducts
    scores: np.ndarray
    partitions: np.ndarray
    coefficients: np.ndarray

    def sum_predictions(self) -> tuple[np.ndarray, np.ndarray]:
        """Products (G,) of the predictions with the residuals of each configuration, and
        with themselves, averaged over the configurations, m²; both averaged over the
        partitions."""
        products = self.products
        count = len(products.group)
        with_residual = np.zeros(count)
        square = 0.0
        for fold, coefficients in zip(self.partitions, self.coefficients, strict=True):
            of_group = coefficients[fold]
            of_configuration = of_group[products.group]
            with_residual += (products.residual * of_configuration).sum(axis=1)
            square += np.einsum("cd,cde,ce", of_group, products.gram, of_group)
        repetitions = len(self.partitions)
        mean_square = square / (repetitions * count)
        return with_residual / repetitions, np.full(count, mean_square)


class _LeftOutFold(NamedTuple):
    """A fold, along the D principal axes of the Gram matrix of all other folds.

    Attributes
    ----------
    eigenvalues : (D,) array, of this Gram matrix
    mean : mean of the eigenvalues
    axes : (D, D) array, principal axes
    training, left_out : (1 + N, D) arrays
        Products of the basis in the other folds, and in this one, with the residuals of
        the data and of the simulated data sets.
    """

    eigenvalues: np.ndarray
    mean: float
    axes: np.ndarray
    training: np.ndarray
    left_out: np.ndarray


def _fit_models(
    fitted: Fit,
    observations: Observations,
    configuration: np.ndarray,
    stream: np.random.Generator,
) -> list[_CrossValidatedModel]:
    """Fit all models of the residual to the data and to simulated data sets."""
    count = int(configuration.max()) + 1
    parameters = len(fitted.unidentifiable)
    group = stream.permutation(count) % _GROUPS
    partitions = stream.permuted(
        np.tile(np.arange(_GROUPS) % _FOLDS, (_PARTITIONS, 1)), axis=1
    )
    inputs = build_geometric_inputs(fitted.model, fitted.estimate, observations)
    size = int(np.clip(count, _MIN_FUNCTIONS, _MAX_FUNCTIONS))
    products = [
        _start_products(basis, inputs, configuration, group, parameters)
        for basis in _choose_bases(inputs, size, stream)
    ]
    white_residual = fitted.whiten(fitted.residual)
    weight = np.sqrt(fitted.weights)[:, None, None]
    gradient = np.zeros((count, parameters))
    leverage = np.zeros(count)
    for block, sensitivities, whitened in fitted.iterate_sensitivities(observations):
        np.add.at(
            gradient,
            configuration[block],
            np.einsum("mrp,mr->mp", whitened, white_residual[block]),
        )
        np.add.at(
            leverage,
            configuration[block],
            _compute_leverage(whitened, fitted.covariance),
        )
        for basis_products in products:
            basis_products.add(
                block,
                inputs.select(block),
                weight[block],
                fitted.residual[block, :3],
                weight[block] * sensitivities[:, :3],
            )
    leverage /= np.bincount(configuration)
    chance = _draw_chance(fitted, gradient, leverage, stream)
    return [
        model
        for basis_products in products
        for model in _cross_validate(basis_products, chance, partitions)
    ]


def _start_products(
    basis: Basis,
    inputs: Inputs,
    configuration: np.ndarray,
    group: np.ndarray,
    parameters: int,
) -> _BasisProducts:
    """Start the products of a basis at zero.

    `configuration` (M,) and `group` (G,) as in `_BasisProducts`; `parameters`: number
    of parameters of the fit.
    """
    functions = basis(inputs.select(slice(1))).shape[2]
    return _BasisProducts(
        basis,
        configuration,
        group,
        np.zeros((len(group), functions)),
        np.zeros((_GROUPS, functions, functions)),
        np.zeros((_GROUPS, functions, parameters)),
    )


def _add_by_group(sums: np.ndarray, group: np.ndarray, values: np.ndarray) -> None:
    """Add values (M, D) of groups (M,) to sums (G, D). numpy's `add.at` takes five times
    as long."""
    present, index = np.unique(group, return_inverse=True)
    members = csr_array(
        (np.ones(len(group)), (index, np.arange(len(group)))),
        (len(present), len(group)),
    )
    sums[present] += members @ values


def _compute_leverage(sensitivities: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Mean leverage of the rows of each observation, (M,) array, from its whitened
    sensitivities (M, rows, P)."""
    count, rows, parameters = sensitivities.shape
    flat = sensitivities.reshape(count * rows, parameters)
    leverage = ((flat @ covariance) * flat).sum(axis=1)
    return leverage.reshape(count, rows).mean(axis=1)


def _choose_bases(
    inputs: Inputs, functions: int, stream: np.random.Generator
) -> list[Basis]:
    """Choose bases of about so many functions of the joint angles.

    Harmonics of each joint's angle as its deviations; displacements that are smooth in
    all joints together (random Fourier features [1]_); and, for each pair of joints,
    functions of both angles as deviations of the joints that move the targets most.

    References
    ----------
    .. [1] Rahimi and Recht, Random features for large-scale kernel machines, NeurIPS 20,
       2007.
    """
    joints = inputs.joint_angles.shape[1]
    spread = np.maximum(inputs.joint_angles.std(axis=0), SAME_POSE_RAD)
    frequencies = stream.normal(size=(joints, functions)) / (_LENGTH * spread[:, None])
    axes = np.eye(3)[np.arange(functions) % 3].T
    phases = stream.uniform(0.0, 2.0 * np.pi, functions)
    squares = (inputs.jacobian[:, :, :joints] ** 2).sum(axis=(0, 1))
    displaced = np.argsort(-squares, kind="stable")[:_DISPLACED_JOINTS]
    orders = max(1, functions // (2 * joints))

    def smooth(block: Inputs) -> np.ndarray:
        return axes * np.cos(block.joint_angles @ frequencies + phases)[:, None]

    pairs = [
        partial(compute_pair_columns, pair=pair, displaced_joints=displaced)
        for pair in combinations(range(joints), 2)
    ]
    return [partial(compute_harmonic_columns, orders=orders), smooth, *pairs]


def _draw_chance(
    fitted: Fit,
    gradient: np.ndarray,
    leverage: np.ndarray,
    stream: np.random.Generator,
) -> _Chance:
    """Draw signs for the residuals of configurations, and parameters from their priors,
    and carry both through the fit.

    `gradient` (G, P): products of whitened sensitivities and residuals of each
    configuration. `leverage` (G,): its mean leverage.
    """
    count, parameters = gradient.shape
    # The fit follows a configuration with a large leverage, so that its errors are
    # larger than its residuals.
    residual_share = np.maximum(1.0 - leverage, 1.0 / count)
    signs = stream.choice([-1.0, 1.0], (_DRAWS, count)) / np.sqrt(residual_share)
    prior_term = stream.normal(size=(_DRAWS, parameters)) / fitted.prior_std
    return _Chance(signs, (prior_term - signs @ gradient) @ fitted.covariance)


def _cross_validate(
    products: _BasisProducts, chance: _Chance, partitions: np.ndarray
) -> Iterator[_CrossValidatedModel]:
    """Predict each fold of each partition (R, C) by a ridge regression on the other
    folds, for each penalty.

    The regressions are solved along the principal axes of the Gram matrix of the other
    folds.
    """
    projections = np.stack(
        [_project_residuals(products, chance, number) for number in range(_GROUPS)]
    )
    with_residual, square = np.zeros((2, len(_PENALTIES), 1 + _DRAWS))
    coefficients = []
    for fold in partitions:
        for of_fold in _leave_out_folds(products.gram, projections, fold):
            ridge = of_fold.mean * np.array(_PENALTIES)[:, None]
            inverse = 1.0 / (of_fold.eigenvalues + ridge)
            with_residual += inverse @ (of_fold.left_out * of_fold.training).T
            square += (of_fold.eigenvalues * inverse**2) @ (of_fold.training**2).T
            coefficients.append((of_fold.training[0] * inverse) @ of_fold.axes.T)
    scores = with_residual / np.sqrt(square)
    shape = (len(partitions), _FOLDS, len(_PENALTIES), -1)
    by_penalty = np.moveaxis(np.reshape(coefficients, shape), 2, 0)
    for of_penalty, by_fold in zip(scores, by_penalty, strict=True):
        yield _CrossValidatedModel(products, of_penalty, partitions, by_fold)


def _leave_out_folds(
    gram: np.ndarray, projections: np.ndarray, fold: np.ndarray
) -> Iterator[_LeftOutFold]:
    """Leave out each fold of a partition, and express its and the other measurements'
    products along the principal axes of the other ones.

    Parameters
    ----------
    gram : (C, D, D) array, Gram matrix of each group
    projections : (C, 1 + N, D) array, products of each group with the residuals
    fold : (C,) int array, fold of each group
    """
    is_left_out = fold == np.arange(_FOLDS)[:, None]
    training_grams = _sum_groups(~is_left_out, gram)
    training = _sum_groups(~is_left_out, projections)
    left_out = _sum_groups(is_left_out, projections)
    for number in range(_FOLDS):
        eigenvalues, axes = np.linalg.eigh(training_grams[number])
        yield _LeftOutFold(
            np.maximum(eigenvalues, 0.0),
            float(eigenvalues.mean()),
            axes,
            training[number] @ axes,
            left_out[number] @ axes,
        )


def _sum_groups(chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sum values (C, ...) over the groups that are chosen by the rows of (K, C) bool:
    (K, ...), as one product of two matrices."""
    sums = chosen.astype(float) @ values.reshape(len(values), -1)
    return sums.reshape(len(chosen), *values.shape[1:])


def _project_residuals(
    products: _BasisProducts, chance: _Chance, number: int
) -> np.ndarray:
    """Products (1 + N, D) of a basis in one group with the residuals of the data and of
    the simulated data sets."""
    members = products.group == number
    residual = products.residual[members]
    simulated = (
        chance.factor[:, members] @ residual
        + chance.parameters @ products.sensitivity[number].T
    )
    return np.vstack([residual.sum(axis=0), simulated])
