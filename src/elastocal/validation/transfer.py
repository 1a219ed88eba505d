"""Transfer of a fit to other measurements.

Their frames and targets are fitted, effects that cannot act there are dropped, and
poses at which the model extrapolates are found.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas
from scipy.spatial.transform import Rotation

from elastocal.campaigns.holdout import (
    compute_pose_range,
    find_poses_beyond_range,
    find_repeated,
)
from elastocal.counting import format_count
from elastocal.effects.protocol import LOADED_JOINTS
from elastocal.fitting.least_squares import evaluate_as_fit, fit_placement
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import evaluate_conditions, find_placement_parameters
from elastocal.fitting.observations import (
    batch_groups_by_size,
    index_poses,
    sample_observations,
    select_states,
    split_into_blocks,
)

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.observations import Observations, States

# Upper bound on the observations from which the certainty of predictions at fitted poses
# is computed; of more observations a sample is used.
_MAX_FITTED = 10_000
# Rounding of forces and moments: as a share, and in N or N m. Forces of one load cell
# are given to a few digits.
_LOAD_ROUNDING = 1e-3


def transfer_fit(fitted: Fit, case: Case, test_case: Case) -> tuple[Model, Estimate]:
    """Transfer a fit to other measurements.

    Parameters
    ----------
    fitted : Fit
    case : Case that it was fitted to
    test_case : Case of the same campaign or of another one

    Returns
    -------
    Model and estimate: as fitted, or with frames and targets of the other campaign
    """
    observations = test_case.observations
    if is_same_campaign(case, test_case):
        return fitted.model, place_unseen_sessions(fitted, observations)
    transferable = keep_transferable_effects(
        fitted, test_case.model, observations.states
    )
    model = replace(
        test_case.model,
        nominal_compliance=fitted.model.nominal_compliance,
        effects=transferable.model.effects,
    )
    return model, fit_placement(transferable, model, observations)


def is_same_campaign(case: Case, test_case: Case) -> bool:
    """Whether two cases belong to one campaign."""
    return test_case is case or test_case.campaign.name == case.campaign.name


def place_unseen_sessions(fitted: Fit, observations: Observations) -> Estimate:
    """Add the frames of sessions that a fit has not seen to its estimate.

    The frame of such a session, six numbers, is fitted to the same observations that
    test it, so their errors come out slightly too small. Everything else stays.
    """
    estimate = fitted.estimate
    unseen = ~np.isin(observations.states.session, estimate.sessions)
    if not unseen.any():
        return estimate
    rotations = Rotation.from_matrix(estimate.target_rotation).as_rotvec()
    known_targets = tuple(
        replace(
            target,
            offset_m=tuple(offset),
            rotation=tuple(rotation),
            offset_std_m=0.0,
        )
        for target, offset, rotation in zip(
            fitted.model.targets, estimate.target_offset, rotations, strict=True
        )
    )
    placed = fit_placement(
        fitted,
        replace(fitted.model, targets=known_targets),
        select_states(observations, unseen),
    )
    sessions = np.array([*estimate.sessions, *placed.sessions])
    frame_rotation = np.concatenate([estimate.frame_rotation, placed.frame_rotation])
    frame_position = np.concatenate([estimate.frame_position, placed.frame_position])
    order = np.argsort(sessions)
    return replace(
        estimate,
        sessions=tuple(sessions[order].tolist()),
        frame_rotation=frame_rotation[order],
        frame_position=frame_position[order],
    )


def keep_transferable_effects(fitted: Fit, model: Model, states: States) -> Fit:
    """Drop effects that another campaign cannot have or does not record.

    Examples are a wandering tracker and a temperature. `model` and `states` are those
    of the other campaign.
    """
    inputs = model.available_inputs(states) | {*LOADED_JOINTS, "external load"}
    estimate = fitted.estimate
    effects = fitted.model.effects
    kept = [
        number
        for number, effect in enumerate(effects)
        if not effect.of_setup and effect.needs <= inputs
    ]
    return replace(
        fitted,
        model=replace(fitted.model, effects=tuple(effects[n] for n in kept)),
        estimate=replace(
            estimate,
            coefficients=tuple(estimate.coefficients[n] for n in kept),
            shapes=tuple(estimate.shapes[n] for n in kept),
        ),
    )


def find_extrapolated_poses(fitted: Fit, case: Case, held_out: Case) -> np.ndarray:
    """Find poses outside the range of the fitted poses, where a model extrapolates.

    Either a joint is beyond the fitted poses by more than chance explains, see
    `holdout.find_poses_beyond_range`; or the predicted position is less certain than at
    any fitted pose that is left out of the fit. Unlike the ranges of single joints, the
    second criterion finds corners between the poses, and loads, times and temperatures
    beyond the fitted ones. A pose drawn like the P fitted ones exceeds their maximum
    with probability 1 / (P + 1) at most, because all are exchangeable: the argument of
    conformal prediction [1]_.

    Parameters
    ----------
    fitted : Fit
    case : Case that it was fitted to
    held_out : Case

    Returns
    -------
    (P,) bool array, in the order of `Observations.cluster`

    References
    ----------
    .. [1] Vovk, Gammerman and Shafer 2005.
    """
    unseen = held_out.observations
    if not is_same_campaign(case, held_out):
        fitted = keep_transferable_effects(fitted, held_out.model, unseen.states)
    fitted_variances, variances = compute_predictive_variances(
        fitted, case.observations, *transfer_fit(fitted, case, held_out), unseen
    )
    outside = find_beyond_campaign(
        case.observations.states, unseen.states.joint_angles, None
    )
    outside |= variances > fitted_variances.max(initial=0.0)
    return np.bincount(index_poses(unseen.states), outside) > 0


def warn_of_repeated_poses(
    fitted_states: States | Measurements, states: States | Measurements
) -> list[str]:
    """Warn of validation poses whose configurations were fitted as well.

    See `holdout.find_repeated`.
    """
    repeated = find_repeated(_angles_of_poses(fitted_states), _angles_of_poses(states))
    if not repeated.any():
        return []
    poses = format_count(len(repeated), "validation pose")
    count = f"all {poses}" if repeated.all() else f"{repeated.sum()} of {poses}"
    return [
        f"{count} repeat configurations that were fitted: these errors say nothing of other poses"
    ]


def _angles_of_poses(states: States | Measurements) -> np.ndarray:
    """Joint angles (P, n) of each pose, which its loads and repeats share."""
    return states.joint_angles[np.unique(index_poses(states), return_index=True)[1]]


def find_beyond_campaign(
    fitted_states: States, joint_angles: np.ndarray, wrench: np.ndarray | None
) -> np.ndarray:
    """Find poses and loads beyond those that a campaign measured, without any fit.

    Parameters
    ----------
    fitted_states : States of the campaign
    joint_angles : (N, n) array, of the chain, rad
    wrench : (N, 6) array, N and N m, or None without loads

    Returns
    -------
    (N,) bool array: joint angles as in `find_extrapolated_poses`, or loads
    """
    outside = find_poses_beyond_range(_angles_of_poses(fitted_states), joint_angles)
    if wrench is None:
        return outside
    return outside | find_larger_loads(fitted_states, wrench)


def find_larger_loads(
    fitted_states: States, wrench: np.ndarray, times: float = 1.0
) -> np.ndarray:
    """Find wrenches (N, 6) with forces or moments above `times` the campaign's largest.

    Returns a (N,) bool array.
    """
    sizes = np.linalg.norm(wrench.reshape(-1, 2, 3), axis=2)
    return (sizes > compute_load_limits(fitted_states, times)).any(axis=1)


def compute_load_limits(fitted_states: States, times: float = 1.0) -> np.ndarray:
    """Compute the largest force, N, and moment, N m, that do not exceed `times` the
    campaign's largest, (2,) array."""
    fitted_sizes = np.linalg.norm(fitted_states.wrench.reshape(-1, 2, 3), axis=2)
    limits = (1.0 + _LOAD_ROUNDING) * times * fitted_sizes.max(axis=0) + _LOAD_ROUNDING
    return np.asarray(limits)


def compute_joint_range(fitted_states: States) -> tuple[np.ndarray, np.ndarray]:
    """Compute the lowest and the highest angle (n,) of each joint beyond which
    `find_beyond_campaign` finds a pose."""
    return compute_pose_range(_angles_of_poses(fitted_states))


def compute_predictive_variances(
    fitted: Fit,
    observations: Observations,
    model: Model,
    estimate: Estimate,
    unseen: Observations,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute how uncertain the positions are that a fit predicts.

    The variance comes from the parameters alone, each with its normal prior or
    otherwise one of its plausible size: a parameter that the measurements do not
    identify is as uncertain as that, and a pose that alone identifies a parameter does
    not make all others look certain. It is the leverage of a prediction. Fitted poses
    are left out in turn by case deletion [1]_ with Woodbury's identity. Frames and
    targets count only if they are those of the fit.

    Parameters
    ----------
    fitted : Fit
    observations : Observations that it was fitted to
    model, estimate : of the fit, for the other observations
    unseen : Observations

    Returns
    -------
    fitted_variances : (P,) array, m², of fitted poses; of very many a sample
    variances : (S,) array, m², of the other states
        Each is that of the least certain observation.

    References
    ----------
    .. [1] Cook and Weisberg 1982.
    """
    count = len(fitted.parameters)
    if not count:
        return (
            _largest_by_group(np.zeros(len(observations)), observations.cluster),
            _largest_by_group(np.zeros(len(unseen)), unseen.state),
        )
    scale = np.array(
        [
            parameter.prior_std or parameter.plausible
            for _, parameter in fitted.parameters
        ]
    )
    placement = find_placement_parameters(owner for owner, _ in fitted.parameters)
    counted = ~placement | _shares_placement(fitted, observations, model, unseen)
    sample = sample_observations(observations, _MAX_FITTED)
    if len(sample) < len(observations):
        fitted = evaluate_as_fit(fitted.model, sample, fitted.noise, fitted.estimate)
    gram = np.zeros((count, count))
    for _, _, whitened in fitted.iterate_sensitivities(sample):
        rows = (whitened * scale).reshape(-1, count)
        gram += rows.T @ rows
    gram *= len(observations) / len(sample)
    root = np.linalg.inv(np.linalg.cholesky(gram + np.eye(count)))
    fitted_variances = np.zeros(len(sample))
    for indices, plain, whitened in fitted.iterate_sensitivities(sample):
        fitted_variances[indices] = _variances_left_out(
            _apply_root(root, plain[:, :3] * (scale * counted)),
            _apply_root(root, whitened * scale),
            sample.cluster[indices],
        )
    unseen_variances = _variances_of_unseen(
        model, estimate, unseen, scale[counted], root[:, counted]
    )
    return (
        _largest_by_group(fitted_variances, sample.cluster),
        _largest_by_group(unseen_variances, unseen.state),
    )


def _variances_of_unseen(
    model: Model,
    estimate: Estimate,
    unseen: Observations,
    scale: np.ndarray,
    root: np.ndarray,
) -> np.ndarray:
    """Variances (M,) of predicted positions.

    `scale` (C,) and `root` (P, C) are those of the C parameters that count.
    """
    count = len(scale)
    variances = np.zeros(len(unseen))
    for _, indices, block in split_into_blocks(unseen, len(root)):
        conditions = evaluate_conditions(model, estimate, block.states)
        linear_model = linearize(model, estimate, block, conditions)
        sensitivities = linear_model.sensitivities[:, :3]
        # Effects come last in the order of the parameters, whatever frames and targets
        # precede them.
        sensitivities = sensitivities[..., sensitivities.shape[-1] - count :]
        rows = (sensitivities * scale).reshape(-1, count)
        squares = ((rows @ root.T) ** 2).sum(axis=1)
        variances[indices] = squares.reshape(len(block), -1).sum(axis=1)
    return variances


def _shares_placement(
    fitted: Fit, observations: Observations, model: Model, unseen: Observations
) -> bool:
    """Whether other observations have the frames and targets of a fit."""
    sessions = set(unseen.states.session)
    return model.targets == fitted.model.targets and sessions <= set(
        observations.states.session
    )


def _apply_root(root: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows (M, r, P) times the transpose of a lower triangular matrix (P, P).

    BLAS skips the zeros of the matrix and determines the order of the axes.
    """
    flat = rows.reshape(-1, rows.shape[2]).T
    return blas.dtrmm(1.0, root.T, flat, lower=0, trans_a=1).T.reshape(rows.shape)


def _variances_left_out(
    projected: np.ndarray, whitened: np.ndarray, cluster: np.ndarray
) -> np.ndarray:
    """Variances (M,) of positions, each predicted without its own pose.

    `projected` and `whitened` are the sensitivities (M, 3, P) and (M, rows, P) after
    `_apply_root`; `cluster` (M,) is the pose of each observation.
    """
    variance = (projected**2).sum(axis=(1, 2))
    width = projected.shape[2]
    for members in batch_groups_by_size(cluster):
        rows = whitened[members].reshape(len(members), -1, width)
        targets = projected[members].reshape(len(members), -1, width)
        cross = targets @ rows.transpose(0, 2, 1)
        remaining = np.eye(rows.shape[1]) - rows @ rows.transpose(0, 2, 1)
        solved = np.linalg.solve(remaining, cross.transpose(0, 2, 1))
        increase = (cross * solved.transpose(0, 2, 1)).sum(axis=-1)
        variance[members] += increase.reshape(*members.shape, -1).sum(axis=-1)
    return variance


def _largest_by_group(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Largest value of each group; values are not negative."""
    largest = np.zeros(group.max() + 1)
    np.maximum.at(largest, group, values)
    return largest
