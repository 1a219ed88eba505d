"""Whether what a fitted model leaves is a function of the joints: one test, by poses that are left out.

A posterior predictive check [1] whose discrepancy is how well ridge regressions on functions of the joint angles, fitted to the
residuals of most configurations, predict those of the others. Residuals of a fitted model are no independent errors: the fit
has taken out of them what its parameters can follow, and its priors have left in them what these hold back. So the chance
distribution is that of residuals which are errors of changing sign, one sign for each configuration (wild cluster bootstrap
[2]), and parameters drawn from their priors, both carried through the same fit. Signs leave each configuration its own size of
error and all that its measurements share, so that neither the noise nor the pose error need be known.

[1] Gelman, A., Meng, X.-L. and Stern, H., Posterior predictive assessment of model fitness via realized discrepancies,
    Statistica Sinica 6, 1996.
[2] Cameron, A. C., Gelbach, J. B. and Miller, D. L., Bootstrap-based improvements for inference with clustered errors, Review
    of Economics and Statistics 90, 2008.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.joint_space import SAME_POSE_RAD, configurations
from elastocal.fitting.least_squares import ON_THE_WAY, fit
from elastocal.fitting.observations import parts_of, sample_of, state_clusters
from elastocal.remainder.corrected import inputs_of
from elastocal.remainder.ridge_harmonics import by_harmonics
from elastocal.remainder.tuning import FEWEST_CONFIGURATIONS, gain_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.observations import Observations
    from elastocal.remainder.protocol import Inputs

    Functions = Callable[[Inputs], np.ndarray]

# Where less is left by chance alone, something repeatable is said to remain so often.
LEVEL = 0.01
_FOLDS, _DRAWS = 5, 299
# Functions of each kind: as many as configurations, within these.
_FEWEST, _MOST = 60, 240
# Penalties, in mean squares of a function: from strong errors of few functions to weak ones of many.
_PENALTIES = np.array([0.1, 1.0, 10.0])
# Of more observations a sample by poses is looked at.
_MOST_OBSERVATIONS = 10_000
# Angles over which a function of all joints changes, in standard deviations of each.
_LENGTH = 2.0
# Joints that functions of two angles move.
_MOVED = 3
# Observations whose functions are held at once.
_AT_ONCE = 2_000


@dataclass(frozen=True)
class Repeatable:
    """What left-out configurations say of a model's remainder.

    `statistic`: how many standard deviations better than by chance they are predicted, by the best of a few regressions.
    `p_value`: of the same best by chance. `remains`: whether it is below `LEVEL`. `rms_m`, `rms_std_error_m`: of each position
    what is predictable, m.
    """

    statistic: float
    p_value: float
    remains: bool
    level: float
    rms_m: float
    rms_std_error_m: float
    configurations: int


def repeatable_part(fitted: Fit, observations: Observations, seed: int) -> Repeatable | None:
    """Test whether a fitted model leaves something that is a function of the joints.

    `observations`: which it was fitted to. `seed`: of signs, folds and functions. None with too few configurations.
    """
    some = sample_of(observations, _MOST_OBSERVATIONS)
    if len(some) < len(observations):
        fitted = fit(fitted.model, some, fitted.noise, fitted.estimate, reweighted=True, settled=ON_THE_WAY)
    group = configurations(some.states.joint_angles, state_clusters(some.states))[some.cluster]
    count, draws = int(group.max()) + 1, np.random.default_rng(seed)
    if count < FEWEST_CONFIGURATIONS:
        return None
    fold, seen = draws.permutation(count) % _FOLDS, inputs_of(fitted.model, fitted.estimate, some, elsewhere=True)
    kinds = _kinds(seen, int(np.clip(count, _FEWEST, _MOST)), draws)
    signs = draws.choice([-1.0, 1.0], (_DRAWS, count))
    held_back = draws.normal(size=(_DRAWS, len(fitted.held))) / fitted.prior_std
    sums = _sums(fitted, some, seen, group, fold, kinds)
    # A configuration that the fit follows has errors larger than its residuals.
    signs /= np.sqrt(np.maximum(1.0 - sums.leverage, 1.0 / count))
    moved = (held_back - signs @ sums.followed) @ fitted.covariance
    scores, fits = [], []
    for kind in range(len(kinds)):
        of_folds = [
            np.vstack([along.sum(axis=0), signs[:, fold == k] @ along + moved @ sums.across[kind][k].T])
            for k in range(_FOLDS)
            for along in [sums.along[kind][fold == k]]
        ]
        found, coefficients = _left_out(sums.gram[kind], np.stack(of_folds))
        scores.append(found)
        fits += [(kind, each) for each in coefficients]
    score = np.concatenate(scores)
    score = (score - score[:, 1:].mean(axis=1, keepdims=True)) / score[:, 1:].std(axis=1, keepdims=True)
    best, number = score.max(axis=0), int(np.argmax(score[:, 0]))
    p_value = float((1 + (best[1:] >= best[0]).sum()) / (1 + _DRAWS))
    kind, coefficients = fits[number]
    predicted = np.concatenate(
        [
            (kinds[kind](seen.select(part)) @ coefficients[fold[group[part]]][:, :, None])[..., 0]
            for _, part in parts_of(some, _AT_ONCE)
        ]
    )
    weight = np.sqrt(fitted.weights)[:, None]
    gain = gain_of(group, weight * fitted.residual[:, :3], weight * predicted, _FOLDS)
    return Repeatable(float(best[0]), p_value, p_value <= LEVEL, LEVEL, gain.rms_m, gain.rms_std_error_m, count)


def _kinds(inputs: Inputs, most: int, draws: np.random.Generator) -> list[Functions]:
    """Functions of the joints, each kind (M, 3, D): waves of each joint as its deviations; displacements that are smooth in all
    joints together (random Fourier features [1]); and of each two joints' angles, deviations of those joints that move the
    targets most.

    [1] Rahimi, A. and Recht, B., Random features for large-scale kernel machines, NeurIPS 20, 2007.
    """
    joints = inputs.joint_angles.shape[1]
    orders, phases = max(1, most // (2 * joints)), draws.uniform(0.0, 2.0 * np.pi, most)
    spread = np.maximum(inputs.joint_angles.std(axis=0), SAME_POSE_RAD)
    of_all = draws.normal(size=(joints, most)) / (_LENGTH * spread[:, None])
    axes = np.eye(3)[np.arange(most) % 3].T
    moved = np.argsort(-(inputs.jacobian[:, :, :joints] ** 2).sum(axis=(0, 1)), kind="stable")[:_MOVED]
    return [
        lambda some: by_harmonics(some, orders),
        lambda some: axes * np.cos(some.joint_angles @ of_all + phases)[:, None],
        *(partial(_of_two, pair=pair, moved=moved) for pair in combinations(range(joints), 2)),
    ]


def _of_two(inputs: Inputs, pair: tuple[int, int], moved: np.ndarray) -> np.ndarray:
    """Deviations of some joints by products of the first waves of two joints' angles, and by each one's second wave."""
    one, other = (inputs.joint_angles[:, joint] for joint in pair)
    first, second = (np.stack([np.ones(len(angle)), np.sin(angle), np.cos(angle)], axis=1) for angle in (one, other))
    double = [wave(2.0 * angle) for angle in (one, other) for wave in (np.sin, np.cos)]
    functions = np.column_stack([(first[:, :, None] * second[:, None]).reshape(len(inputs), -1), *double])
    return (inputs.jacobian[:, :, moved, None] * functions[:, None, None]).reshape(len(inputs), 3, -1)


@dataclass(frozen=True)
class _Sums:
    """Over K folds and G configurations, for each kind of D functions; P parameters of the fit.

    `gram` (K, D, D), `across` (K, D, P): products of functions with each other and with sensitivities. `along` (G, D): with
    residuals. `followed` (G, P): whitened sensitivities with residuals. `leverage` (G,): share of its errors that the fit takes
    up, 0 to 1.
    """

    gram: list[np.ndarray]
    across: list[np.ndarray]
    along: list[np.ndarray]
    followed: np.ndarray
    leverage: np.ndarray


def _sums(
    fitted: Fit, observations: Observations, inputs: Inputs, group: np.ndarray, fold: np.ndarray, kinds: list[Functions]
) -> _Sums:
    parameters, count, first = len(fitted.held), len(fold), inputs.select(np.arange(1))
    sizes = [kind(first).shape[2] for kind in kinds]
    found = _Sums(
        [np.zeros((_FOLDS, size, size)) for size in sizes],
        [np.zeros((_FOLDS, size, parameters)) for size in sizes],
        [np.zeros((count, size)) for size in sizes],
        np.zeros((count, parameters)),
        np.zeros(count),
    )
    off, weight = fitted.whitened(fitted.residual), np.sqrt(fitted.weights)[:, None, None]
    for seen, plain, white in fitted.sensitivities(observations):
        some, mine = inputs.select(seen), group[seen]
        np.add.at(found.followed, mine, np.einsum("mrp,mr->mp", white, off[seen]))
        np.add.at(found.leverage, mine, ((white @ fitted.covariance) * white).sum(axis=(1, 2)))
        sensitivities, residual = weight[seen] * plain[:, :3], weight[seen] * fitted.residual[seen, :3, None]
        for number, kind in enumerate(kinds):
            functions = weight[seen] * kind(some)
            np.add.at(found.along[number], mine, (functions * residual).sum(axis=1))
            for k in range(_FOLDS):
                of_fold = fold[mine] == k
                rows = functions[of_fold].reshape(-1, functions.shape[2]).T
                found.gram[number][k] += rows @ rows.T
                found.across[number][k] += rows @ sensitivities[of_fold].reshape(-1, parameters)
    found.leverage[:] /= np.bincount(group) * off.shape[1]
    return found


def _left_out(gram: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Ridge regression of each fold by the others, for each penalty.

    `gram` (K, D, D). `right` (K, N, D): products of functions with N sets of residuals. Returns `score` (penalties, N): of
    residuals with their predictions over the size of these; coefficients (K, D) of the first set for each penalty.
    """
    inner, size = np.zeros((2, len(_PENALTIES), right.shape[1]))
    coefficients = []
    for mine, my_right in zip(gram, right, strict=True):
        values, vectors = np.linalg.eigh(gram.sum(axis=0) - mine)
        values = np.maximum(values, 0.0)
        rest, judged = (right.sum(axis=0) - my_right) @ vectors, my_right @ vectors
        shrunk = [rest / (values + penalty * values.mean()) for penalty in _PENALTIES]
        inner += [(judged * each).sum(axis=1) for each in shrunk]
        size += [(values * each**2).sum(axis=1) for each in shrunk]
        coefficients.append([vectors @ each[0] for each in shrunk])
    return inner / np.sqrt(size), [np.stack(each) for each in zip(*coefficients, strict=True)]
