"""Which poses lie outside the range of those that a model was fitted to: there its errors are extrapolated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas

from elastocal.campaigns.holdout import beyond_range, find_repeated
from elastocal.counting import counted
from elastocal.fitting.displacement import conditions, observations_at_once
from elastocal.fitting.linearization import linearize
from elastocal.fitting.observations import part_at, parts_of, state_clusters
from elastocal.validation.placing import carried_over, placed, same_campaign

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations, States

# A share of forces and moments, and N or N m.
_ROUNDING = 1e-3


def outside_fitted_range(
    fitted_states: States, states: States, fitted_variance: np.ndarray | None = None, variance: np.ndarray | None = None
) -> np.ndarray:
    """States at which a model has to extrapolate.

    Either a joint stands beyond the fitted poses by more than chance explains, see `holdout.beyond_range`; or the model
    predicts the position less surely than it would have predicted any pose it was fitted to, had that pose been left out. The
    second finds what ranges joint by joint miss: corners between the poses, loads, times and temperatures beyond those fitted.
    Poses drawn like the fitted ones pass that maximum with probability 1 / (P + 1) at most, as all are exchangeable: the
    argument of conformal prediction [1].

    `fitted_variance` (P,): as the two of `predictive_variances`; only the angles are judged without. `variance` (S,). Returns
    (S,) of bool.

    [1] Vovk, V., Gammerman, A. and Shafer, G., Algorithmic Learning in a Random World, Springer, 2005.
    """
    outside = beyond_range(_angles_of_poses(fitted_states), states.joint_angles)
    if fitted_variance is None or variance is None:
        return outside
    return outside | (variance > fitted_variance.max(initial=0.0))


def _angles_of_poses(states: States | Measurements) -> np.ndarray:
    """Joint angles of each pose, (P, n): its loads and repeats share them."""
    return states.joint_angles[np.unique(state_clusters(states), return_index=True)[1]]


def outside_poses(fitted: Fit, case: Case, held_out: Case) -> np.ndarray:
    """Which poses lie outside the range of those that a model was fitted to, see `outside_fitted_range`.

    `case`: which it was fitted to. Returns (P,) of bool: by `Observations.cluster`.
    """
    unseen = held_out.observations
    if not same_campaign(case, held_out):
        fitted = carried_over(fitted, held_out.model, unseen.states)
    variances = predictive_variances(fitted, case.observations, *placed(fitted, case, held_out), unseen)
    outside = outside_fitted_range(case.observations.states, unseen.states, *variances)
    return np.bincount(state_clusters(unseen.states), outside) > 0


def repeat_warnings(fitted_states: States | Measurements, states: States | Measurements) -> list[str]:
    """What to say of poses for the test whose configurations were fitted as well, see `holdout.find_repeated`, if any."""
    again = find_repeated(_angles_of_poses(fitted_states), _angles_of_poses(states))
    if not again.any():
        return []
    many = counted(len(again), "validation pose")
    count = f"{again.sum()} of {many}" if not again.all() else f"all {many}"
    return [f"{count} repeat configurations that were fitted: these errors say nothing of other poses"]


def beyond_campaign(fitted_states: States, joint_angles: np.ndarray, wrench: np.ndarray | None) -> np.ndarray:
    """Poses and loads beyond those that a campaign measured, before any fit is at hand.

    `joint_angles` (N, n): of the chain, rad. `wrench` (N, 6): N, N m; none where nothing loads the robot. Returns (N,) of bool:
    by the joint angles as in `outside_fitted_range`, or by its loads.
    """
    outside = beyond_range(_angles_of_poses(fitted_states), joint_angles)
    return outside if wrench is None else outside | beyond_loads(fitted_states, wrench)


def beyond_loads(fitted_states: States, wrench: np.ndarray, times: float = 1.0) -> np.ndarray:
    """Forces or moments, of wrenches (N, 6), that are larger than so many times any of the campaign: bool (N,)."""
    outside = np.zeros(len(wrench), bool)
    for part in (slice(0, 3), slice(3, 6)):
        largest = np.linalg.norm(fitted_states.wrench[:, part], axis=1).max()
        # Forces of one cell are stated to a few digits.
        outside = outside | (np.linalg.norm(wrench[:, part], axis=1) > (1.0 + _ROUNDING) * times * largest + _ROUNDING)
    return outside


def predictive_variances(
    fitted: Fit, observations: Observations, model: Model, estimate: Estimate, unseen: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """How surely a fit predicts positions: those of its own poses, each left out in turn, and those of other states.

    The variance comes from the parameters alone, each with its normal prior or else one of its plausible size: what the
    measurements do not identify is as uncertain as that, and a pose that alone identifies a parameter does not make all
    others look sure.

    The variance of a prediction is its leverage, here in m². Poses are left out by case deletion [1] with Woodbury's identity
    [2].

    `observations`: which it was fitted to. `estimate`: of the fit, for the other observations. Frames and targets count only
    where they are those of the fit. Returns `own` (P,): m², of the least sure reading of each pose; `other` (S,): m², of the
    least sure reading of each state. Zero without parameters.

    [1] Cook, R. D. and Weisberg, S., Residuals and Influence in Regression, Chapman and Hall, 1982.
    [2] Hager, W. W., Updating the inverse of a matrix, SIAM Review 31, 1989.
    """
    listed = fitted.parameters
    if not listed:
        return np.zeros(observations.cluster.max() + 1), np.zeros(len(unseen.states))
    shared = model.targets == fitted.model.targets and set(unseen.states.session) <= set(observations.states.session)
    kept = np.array([shared or not owner.startswith(("frame ", "target ")) for owner, _ in listed], bool)
    plausible = np.array([parameter.prior_std or parameter.plausible for _, parameter in listed])
    gram = np.eye(len(plausible))
    for _, _, white in fitted.sensitivities(observations):
        rows = (white * plausible).reshape(-1, len(plausible))
        gram += rows.T @ rows
    root = np.linalg.inv(np.linalg.cholesky(gram))
    own, cluster = np.empty(len(observations)), observations.cluster
    for seen, plain, white in fitted.sensitivities(observations):
        wanted = plain[:, :3] * (plausible * kept)
        own[seen] = _variances_left_out(wanted, white * plausible, root, cluster[seen] - cluster[seen.start])
    other = np.empty(len(unseen))
    for states, seen in parts_of(unseen, observations_at_once(unseen.rows, len(plausible))):
        some = part_at(unseen, states, seen)
        there = linearize(model, estimate, some, conditions(model, estimate, some.states)).sensitivities[:, :3]
        # Effects come last in the order of the parameters, whatever frames and targets stand before them.
        there = there[..., there.shape[-1] - kept.sum() :] * plausible[kept]
        other[seen] = ((there @ root[:, kept].T) ** 2).sum(axis=(1, 2))
    return _largest(own, cluster), _largest(other, unseen.state)


def _variances_left_out(wanted: np.ndarray, whitened: np.ndarray, root: np.ndarray, cluster: np.ndarray) -> np.ndarray:
    """Variance (M,) of each position with the measurements of its own pose left out of the fit, by Woodbury's identity."""
    projected, own = _through(root, wanted), _through(root, whitened)
    variance = (projected**2).sum(axis=(1, 2))
    order, size = np.argsort(cluster, kind="stable"), np.bincount(cluster)
    start = np.concatenate([[0], np.cumsum(size)[:-1]])
    for count in np.unique(size):
        members = order[start[size == count][:, None] + np.arange(count)]
        rows = own[members].reshape(len(members), -1, own.shape[-1])
        asked = projected[members].reshape(len(members), -1, own.shape[-1])
        left = np.eye(rows.shape[1]) - rows @ rows.transpose(0, 2, 1)
        across = asked @ rows.transpose(0, 2, 1)
        gained = (across * np.linalg.solve(left, across.transpose(0, 2, 1)).transpose(0, 2, 1)).sum(axis=-1)
        variance[members] += gained.reshape(len(members), count, -1).sum(axis=-1)
    return variance


def _through(root: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows (M, r, P) times the transpose of a lower triangular matrix (P, P), without its zeros."""
    # Transposes are laid out as BLAS wants them.
    turned = blas.dtrmm(1.0, root.T, rows.reshape(-1, rows.shape[2]).T, lower=0, trans_a=1)
    return turned.T.reshape(rows.shape)


def _largest(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    found = np.zeros(group.max() + 1)
    np.maximum.at(found, group, values)
    return found
