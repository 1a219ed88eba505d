"""A fit carried to other measurements: their frames and targets, the effects that can
act there, and where it extrapolates."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas
from scipy.spatial.transform import Rotation

from elastocal.campaigns.holdout import find_poses_beyond_range, find_repeated
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

# Of more observations a sample says how surely those that were fitted are predicted.
_MOST_FITTED = 10_000
# A share of forces and moments, and N or N m: forces of one cell are stated to a few
# digits.
_ROUNDING = 1e-3


def transfer_fit(fitted: Fit, case: Case, part: Case) -> tuple[Model, Estimate]:
    """Model and estimate for other measurements: as fitted, or with frames and targets
    of another campaign.

    `case`: which it was fitted to. `part`: measurements of the same campaign or of
    another one.
    """
    if is_same_campaign(case, part):
        return fitted.model, place_unseen_sessions(fitted, part.observations)
    carried = keep_transferable_effects(fitted, part.model, part.observations.states)
    model = replace(
        part.model,
        nominal_compliance=fitted.model.nominal_compliance,
        effects=carried.model.effects,
    )
    return model, fit_placement(carried, model, part.observations)


def is_same_campaign(case: Case, part: Case) -> bool:
    """Whether two cases are parts of one campaign."""
    return part is case or part.campaign.name == case.campaign.name


def place_unseen_sessions(fitted: Fit, observations: Observations) -> Estimate:
    """The estimate of a fit for other observations of its targets, whose sessions it
    may not have seen.

    The frame of such a session is fitted to the very observations that test it, six
    numbers of each session, and so its errors come out slightly too small. Everything
    else stays.
    """
    found = fitted.estimate
    unseen = ~np.isin(observations.states.session, found.sessions)
    if not unseen.any():
        return found
    turns = Rotation.from_matrix(found.target_rotation).as_rotvec()
    places = zip(fitted.model.targets, found.target_offset, turns, strict=True)
    known = [
        replace(target, offset_m=tuple(at), rotation=tuple(turn))
        for target, at, turn in places
    ]
    there = fit_placement(
        fitted,
        replace(fitted.model, targets=tuple(known)),
        select_states(observations, unseen),
    )
    sessions = np.array([*found.sessions, *there.sessions])
    order = np.argsort(sessions)
    return replace(
        found,
        sessions=tuple(sessions[order].tolist()),
        frame_rotation=np.concatenate([found.frame_rotation, there.frame_rotation])[
            order
        ],
        frame_position=np.concatenate([found.frame_position, there.frame_position])[
            order
        ],
    )


def keep_transferable_effects(fitted: Fit, model: Model, states: States) -> Fit:
    """A fit without the effects that another campaign cannot have, or does not record:
    a wandering tracker, a temperature.

    `states`: of the other campaign.
    """
    there = model.available_inputs(states) | {*LOADED_JOINTS, "external load"}
    estimate = fitted.estimate
    kept = [
        n
        for n, effect in enumerate(fitted.model.effects)
        if not effect.of_setup and effect.needs <= there
    ]
    known = replace(fitted.model, effects=tuple(fitted.model.effects[n] for n in kept))
    coefficients, shapes = (
        tuple(values[n] for n in kept)
        for values in (estimate.coefficients, estimate.shapes)
    )
    return replace(
        fitted,
        model=known,
        estimate=replace(estimate, coefficients=coefficients, shapes=shapes),
    )


def find_extrapolated_poses(fitted: Fit, case: Case, held_out: Case) -> np.ndarray:
    """Which poses lie outside the range of those that a model was fitted to, where it
    has to extrapolate.

    Either a joint stands beyond the fitted poses by more than chance explains, see
    `holdout.find_poses_beyond_range`; or the model predicts the position less surely than it would
    have predicted any pose it was fitted to, had that pose been left out. The second
    finds what ranges joint by joint miss: corners between the poses, loads, times and
    temperatures beyond those fitted. Poses drawn like the fitted ones pass that maximum
    with probability 1 / (P + 1) at most, as all are exchangeable: the argument of
    conformal prediction (Vovk, Gammerman and Shafer 2005).

    `case`: which it was fitted to. Returns (P,) of bool: by `Observations.cluster`.
    """
    unseen = held_out.observations
    if not is_same_campaign(case, held_out):
        fitted = keep_transferable_effects(fitted, held_out.model, unseen.states)
    own, other = compute_predictive_variances(
        fitted, case.observations, *transfer_fit(fitted, case, held_out), unseen
    )
    outside = find_beyond_campaign(
        case.observations.states, unseen.states.joint_angles, None
    ) | (other > own.max(initial=0.0))
    return np.bincount(index_poses(unseen.states), outside) > 0


def warn_of_repeated_poses(
    fitted_states: States | Measurements, states: States | Measurements
) -> list[str]:
    """What to say of poses for the test whose configurations were fitted as well, see
    `holdout.find_repeated`, if any."""
    again = find_repeated(_angles_of_poses(fitted_states), _angles_of_poses(states))
    if not again.any():
        return []
    many = format_count(len(again), "validation pose")
    count = f"{again.sum()} of {many}" if not again.all() else f"all {many}"
    return [
        f"{count} repeat configurations that were fitted: these errors say nothing of other poses"
    ]


def _angles_of_poses(states: States | Measurements) -> np.ndarray:
    """Joint angles of each pose, (P, n): its loads and repeats share them."""
    return states.joint_angles[np.unique(index_poses(states), return_index=True)[1]]


def find_beyond_campaign(
    fitted_states: States, joint_angles: np.ndarray, wrench: np.ndarray | None
) -> np.ndarray:
    """Poses and loads beyond those that a campaign measured, before any fit is at hand.

    `joint_angles` (N, n): of the chain, rad. `wrench` (N, 6): N, N m; none where
    nothing loads the robot. Returns (N,) of bool: by the joint angles as in
    `outside_poses`, or by its loads.
    """
    outside = find_poses_beyond_range(_angles_of_poses(fitted_states), joint_angles)
    return (
        outside
        if wrench is None
        else outside | find_larger_loads(fitted_states, wrench)
    )


def find_larger_loads(
    fitted_states: States, wrench: np.ndarray, times: float = 1.0
) -> np.ndarray:
    """Forces or moments, of wrenches (N, 6), that are larger than so many times any of
    the campaign: bool (N,)."""
    sizes, largest = (
        np.linalg.norm(each.reshape(-1, 2, 3), axis=2)
        for each in (wrench, fitted_states.wrench)
    )
    return (sizes > (1.0 + _ROUNDING) * times * largest.max(axis=0) + _ROUNDING).any(
        axis=1
    )


def compute_predictive_variances(
    fitted: Fit,
    observations: Observations,
    model: Model,
    estimate: Estimate,
    unseen: Observations,
) -> tuple[np.ndarray, np.ndarray]:
    """How surely a fit predicts positions: its own poses (P,), of very many some, each
    left out in turn, and other states (S,).

    The variance of the least sure reading, m², comes from the parameters alone, each
    with its normal prior or else one of its plausible size: what the measurements do
    not identify is as uncertain as that, and a pose that alone identifies a parameter
    does not make all others look sure. It is the leverage of a prediction; poses are
    left out by case deletion (Cook and Weisberg 1982) with Woodbury's identity. Frames
    and targets count only where they are those of the fit.

    `observations`: which it was fitted to. `estimate`: of the fit, for the other
    observations.
    """
    listed = fitted.parameters
    own = np.zeros(len(observations))
    other = np.zeros(len(unseen))
    shared = model.targets == fitted.model.targets and set(
        unseen.states.session
    ) <= set(observations.states.session)
    kept = shared | ~find_placement_parameters(owner for owner, _ in listed)
    plausible = np.array(
        [parameter.prior_std or parameter.plausible for _, parameter in listed]
    )
    if not listed:
        return _largest(own, observations.cluster), _largest(other, unseen.state)
    some = sample_observations(observations, _MOST_FITTED)
    gram = np.zeros((len(listed),) * 2)
    if len(some) < len(observations):
        fitted = evaluate_as_fit(fitted.model, some, fitted.noise, fitted.estimate)
        own = np.zeros(len(some))
    for _, _, white in fitted.iterate_sensitivities(some):
        rows = (white * plausible).reshape(-1, len(listed))
        gram += rows.T @ rows
    gram *= len(observations) / len(some)
    root = np.linalg.inv(np.linalg.cholesky(gram + np.eye(len(listed))))
    cluster = some.cluster
    for seen, plain, white in fitted.iterate_sensitivities(some):
        projected = _through(root, plain[:, :3] * (plausible * kept))
        rows = _through(root, white * plausible)
        own[seen] = _variances_left_out(projected, rows, cluster[seen])
    for _, seen, part in split_into_blocks(unseen, len(listed)):
        there = linearize(
            model, estimate, part, evaluate_conditions(model, estimate, part.states)
        ).sensitivities[:, :3]
        # Effects come last in the order of the parameters, whatever frames and targets
        # stand before them.
        there = there[..., there.shape[-1] - kept.sum() :] * plausible[kept]
        flat = there.reshape(-1, there.shape[2]) @ root[:, kept].T
        other[seen] = (flat**2).sum(axis=1).reshape(len(part), 3).sum(axis=1)
    return _largest(own, cluster), _largest(other, unseen.state)


def _through(root: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows (M, r, P) times the transpose of a lower triangular matrix (P, P), without
    its zeros, laid out as BLAS wants it."""
    return blas.dtrmm(
        1.0, root.T, rows.reshape(-1, rows.shape[2]).T, lower=0, trans_a=1
    ).T.reshape(rows.shape)


def _variances_left_out(
    projected: np.ndarray, rows: np.ndarray, cluster: np.ndarray
) -> np.ndarray:
    """Variance (M,) of positions without their own poses, by sensitivities through a
    root, plain (M, 3, P) and whitened."""
    variance = (projected**2).sum(axis=(1, 2))
    width = projected.shape[2]
    for members in batch_groups_by_size(cluster):
        own, asked = (
            each[members].reshape(len(members), -1, width) for each in (rows, projected)
        )
        across = asked @ own.transpose(0, 2, 1)
        left = np.eye(own.shape[1]) - own @ own.transpose(0, 2, 1)
        gained = (
            across * np.linalg.solve(left, across.transpose(0, 2, 1)).transpose(0, 2, 1)
        ).sum(axis=-1)
        variance[members] += gained.reshape(*members.shape, -1).sum(axis=-1)
    return variance


def _largest(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    found = np.zeros(group.max() + 1)
    np.maximum.at(found, group, values)
    return found
