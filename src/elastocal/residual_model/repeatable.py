"""Whether what a fitted model leaves is a function of the joints: one test, by poses
that are left out.

A posterior predictive check [1] whose discrepancy is how well ridge regressions on
functions of the joint angles, fitted to the residuals of most configurations, predict
those of the others. Residuals are no independent errors: the fit has taken out of them
what its parameters can follow, and its priors have left in them what these hold back.
So chance is errors of changing sign, one sign for each configuration (the cluster
bootstrap of residuals [2]), and parameters drawn from their priors, both carried
through the same fit. Each configuration keeps its size of error and all that its
measurements share; no noise need be known.

[1] Gelman, A., Meng, X.-L. and Stern, H., Posterior predictive assessment of model fitness via realized discrepancies,
    Statistica Sinica 6, 1996.
[2] Cameron, A. C., Gelbach, J. B. and Miller, D. L., Bootstrap-based improvements for inference with clustered errors, Review
    of Economics and Statistics 90, 2008.
"""

from __future__ import annotations

from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import SAME_POSE_RAD, number_configurations
from elastocal.fitting.least_squares import INTERMEDIATE_TOLERANCE, fit_model
from elastocal.fitting.observations import index_poses, sample_observations
from elastocal.residual_model.regressions import (
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
    from collections.abc import Callable, Iterator

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations
    from elastocal.residual_model.regressions import Inputs

# How often something repeatable is said to remain where only chance does.
LEVEL = 0.01
_FOLDS = 5
_DRAWS = 299
_MOST_OBSERVATIONS = 10_000
# Functions of a kind, as many as configurations within these; joints that functions of
# two angles move.
_FEWEST = 60
_MOST = 240
_MOVED = 3
# Penalties, in mean squares of a function: from strong errors of few functions to weak
# ones of many.
_PENALTIES = (0.1, 1.0, 10.0)
# Angles over which a function of all joints changes, in standard deviations of each.
_LENGTH = 2.0


def detect_repeatable_residual(
    fitted: Fit, observations: Observations, seed: int
) -> RepeatableResidual | None:
    """Test whether a fitted model leaves something that is a function of the joints.

    `observations`: which it was fitted to. `seed`: of signs, folds and functions. None
    with too few configurations.
    """
    some = sample_observations(observations, _MOST_OBSERVATIONS)
    if len(some) < len(observations):
        fitted = fit_model(
            fitted.model,
            some,
            fitted.noise,
            fitted.estimate,
            reweight_first_step=True,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
    group = number_configurations(some.states.joint_angles, index_poses(some.states))[
        some.cluster
    ]
    count = int(group.max()) + 1
    draws = np.random.default_rng(seed)
    if count < MIN_CONFIGURATIONS:
        return None
    fold = draws.permutation(count) % _FOLDS
    inputs = build_geometric_inputs(fitted.model, fitted.estimate, some)
    kinds = _kinds(inputs, int(np.clip(count, _FEWEST, _MOST)), draws)
    sizes = [kind(inputs.select(slice(1))).shape[2] for kind in kinds]
    parameters = len(fitted.unidentifiable)
    # Of each kind of functions the products with residuals by configurations, with
    # themselves and with sensitivities by folds.
    sums = [
        [np.zeros(s) for s in ((count, n), (_FOLDS, n, n), (_FOLDS, n, parameters))]
        for n in sizes
    ]
    followed = np.zeros((count, parameters))
    leverage = np.zeros(count)
    white_residual = fitted.whiten(fitted.residual)
    weight = np.sqrt(fitted.weights)[:, None, None]
    for seen, plain, white in fitted.iterate_sensitivities(some):
        mine = group[seen]
        w = weight[seen]
        there = inputs.select(seen)
        np.add.at(followed, mine, np.einsum("mrp,mr->mp", white, white_residual[seen]))
        flat = white.reshape(len(white) * white.shape[1], parameters)
        spread = ((flat @ fitted.covariance) * flat).sum(axis=1)
        np.add.at(leverage, mine, spread.reshape(white.shape[:2]).mean(axis=1))
        parts = [fold[mine] == k for k in range(_FOLDS)]
        slopes = [
            (w[part] * plain[part, :3]).reshape(3 * part.sum(), parameters)
            for part in parts
        ]
        for kind, (along, gram, across) in zip(kinds, sums, strict=True):
            functions = w * kind(there)
            np.add.at(
                along,
                mine,
                (functions * w * fitted.residual[seen, :3, None]).sum(axis=1),
            )
            for k, part in enumerate(parts):
                rows = functions[part].reshape(-1, functions.shape[2])
                gram[k] += rows.T @ rows
                across[k] += rows.T @ slopes[k]
    # A configuration that the fit follows has errors larger than its residuals.
    free = np.maximum(1.0 - leverage / np.bincount(group), 1.0 / count)
    signs = draws.choice([-1.0, 1.0], (_DRAWS, count)) / np.sqrt(free)
    held_back = draws.normal(size=(_DRAWS, parameters)) / fitted.prior_std
    moved = (held_back - signs @ followed) @ fitted.covariance
    judged = []
    for along, gram, across in sums:
        of_folds = [
            (along[fold == k], signs[:, fold == k], across[k]) for k in range(_FOLDS)
        ]
        right = np.stack(
            [
                np.vstack([own.sum(axis=0), sign @ own + moved @ other.T])
                for own, sign, other in of_folds
            ]
        )
        for score, coefficients in _left_out(gram, right):
            square = np.einsum("kd,kde,ke", coefficients, gram, coefficients) / count
            judged.append(
                (
                    score,
                    (along * coefficients[fold]).sum(axis=1),
                    np.full(count, square),
                )
            )
    scores = np.stack([score for score, *_ in judged])
    scores = (scores - scores[:, 1:].mean(axis=1, keepdims=True)) / scores[:, 1:].std(
        axis=1, keepdims=True
    )
    best, (_, of_residual, of_itself) = (
        scores.max(axis=0),
        judged[np.argmax(scores[:, 0])],
    )
    p_value = float((best >= best[0]).mean())
    gain = estimate_gain(of_residual, of_itself, len(some), _FOLDS)
    return RepeatableResidual(
        p_value, bool(p_value <= LEVEL), gain["rms_m"], gain["rms_std_error_m"]
    )


def _kinds(
    inputs: Inputs, most: int, draws: np.random.Generator
) -> list[Callable[[Inputs], np.ndarray]]:
    """Functions of the joints, each kind (M, 3, D): waves of each joint as its
    deviations; displacements that are smooth in all joints together (random Fourier
    features [1]); and of each two joints' angles, deviations of those joints that move
    the targets most.

    [1] Rahimi, A. and Recht, B., Random features for large-scale kernel machines,
    NeurIPS 20, 2007.
    """
    joints = inputs.joint_angles.shape[1]
    spread = np.maximum(inputs.joint_angles.std(axis=0), SAME_POSE_RAD)
    turns = draws.normal(size=(joints, most)) / (_LENGTH * spread[:, None])
    axes = np.eye(3)[np.arange(most) % 3].T
    phases = draws.uniform(0.0, 2.0 * np.pi, most)
    moved = np.argsort(
        -(inputs.jacobian[:, :, :joints] ** 2).sum(axis=(0, 1)), kind="stable"
    )[:_MOVED]
    return [
        lambda some: compute_harmonic_columns(some, max(1, most // (2 * joints))),
        lambda some: axes * np.cos(some.joint_angles @ turns + phases)[:, None],
        *(
            partial(compute_pair_columns, pair=pair, moved=moved)
            for pair in combinations(range(joints), 2)
        ),
    ]


def _left_out(
    gram: np.ndarray, right: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Ridge regression of each fold by the others: products of residuals with
    predictions over the size of these.

    `gram` (K, D, D). `right` (K, N, D): products of functions with N sets of residuals.
    Yields (N,) for each penalty, and the coefficients (K, D) of the first set.
    """
    rest = []
    for mine, own in zip(gram, right, strict=True):
        values, vectors = np.linalg.eigh(gram.sum(axis=0) - mine)
        rest.append(
            (
                np.maximum(values, 0.0),
                values.mean(),
                vectors,
                (right.sum(axis=0) - own) @ vectors,
                own @ vectors,
            )
        )
    for penalty in _PENALTIES:
        (along, square), coefficients = np.zeros((2, right.shape[1])), []
        for values, mean, vectors, others, own in rest:
            shrunk = others / (values + penalty * mean)
            along += (own * shrunk).sum(axis=1)
            square += (values * shrunk**2).sum(axis=1)
            coefficients.append(vectors @ shrunk[0])
        yield along / np.sqrt(square), np.stack(coefficients)
