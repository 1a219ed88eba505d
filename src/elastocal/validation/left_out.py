"""A model without one part of its observations: from the normal equations of all of them less those of the part.

One Gauss-Newton step from the fit to all observations leads to the fit without a part (Cook and Weisberg, Residuals and
Influence in Regression, 2.2, 1982). What a parameter was is not carried over where only that part identifies it: it goes back
to where a fit starts, to its prior. Where the errors of a few poses decide, the step is taken as it is; where a refit is asked
for, exact residuals and their gradient after the step prove it, or lead on from there.

Cross-validation over blocks and sessions says how far a model carries. Poses drawn at random have neighbours among those
fitted, so their errors say how well a model interpolates; whole blocks of joint space left out say how well it extrapolates
(Roberts et al., Ecography 40, 2017). The effects stay those that were chosen with all training poses: what is refitted is their
size, so the errors carry the selection's optimism.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import FEWEST_TRAINING_POSES
from elastocal.campaigns.joint_space import blocks_of_poses, configurations
from elastocal.fitting.least_squares import ON_THE_WAY, fit, registered, robustly, sizes_of
from elastocal.fitting.model import nonlinear_parameters, of_placement, parameter_values, stepped
from elastocal.fitting.normal_equations import solve_normal
from elastocal.fitting.observations import select_states, state_clusters
from elastocal.validation.held_out import Errors, intervals, position_errors, summary
from elastocal.validation.placing import placed_estimate

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate
    from elastocal.fitting.observations import Observations

# A step without a part is proven where the exact equations after it ask for a step below this in every parameter, in standard
# errors, which is taken too. What is left is a share of that, from the weights of outliers and the curvature: no error of
# prediction moves by a hundredth of its standard error.
_PROVEN = 0.01
# What a pose alone determines, such as the frame of a session of one pose, is no error of it: shares below are rounding.
_ROUNDING = 1e-9
# A quarter of the poses is about the share that campaigns hold out at random, so that both errors come from as many poses.
JOINT_SPACE_BLOCKS = 4


@dataclass(frozen=True)
class Refit:
    """A model fitted without one part of some observations.

    `within` (S,) of bool: states of the part left out. `estimate`: fitted to the rest. `there`: the same for the part left out.
    """

    within: np.ndarray
    rest: Observations
    left_out: Observations
    estimate: Estimate
    there: Estimate


def refits(fitted: Fit, observations: Observations, part: np.ndarray) -> Iterator[Refit]:
    """Fit a model without each part of the observations in turn, as a fit from the nominal robot would with the same shapes.

    A session that is left out has its frame fitted to itself, see `placing.placed_estimate`.

    `observations`: which it was fitted to, or some of them. `part` (S,) of int: of each state, by whole poses.
    """
    model, noise = fitted.model, fitted.noise
    if len(observations) < len(fitted.weights):
        fitted = fit(model, observations, noise, fitted.estimate, reweighted=True, settled=ON_THE_WAY)
    found, owners = fitted.estimate, [owner for owner, _ in fitted.parameters]
    for number, (step, held) in zip(np.unique(part), _steps_without(fitted, observations, part), strict=True):
        within = part == number
        rest, left_out = select_states(observations, ~within), select_states(observations, within)
        seen = np.isin(found.sessions, rest.states.session)
        kept = ~np.isin(owners, [f"frame {session}" for session in np.array(found.sessions)[~seen]])
        refit = None
        # Where the rest does not say where a frame or a target is, the nominal robot does.
        if not (held & of_placement(owners) & kept).any():
            start = replace(
                found,
                sessions=tuple(np.array(found.sessions)[seen].tolist()),
                frame_rotation=found.frame_rotation[seen],
                frame_position=found.frame_position[seen],
            )
            start = stepped(model, start, step[kept])
            refit = robustly(model, rest, noise, start, held[kept], reweighted=True, settled=_PROVEN)
        if refit is None or not refit.converged:
            refit = fit(model, rest, noise, replace(registered(model, rest), shapes=found.shapes))
        yield Refit(within, rest, left_out, refit.estimate, placed_estimate(refit, left_out))


def _steps_without(fitted: Fit, observations: Observations, part: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Step (P,) of all parameters that leads to the fit without each part, and which (P,) the rest does not identify.

    `observations`: which it was fitted to. `part` (S,) of int.
    """
    model, estimate = fitted.model, fitted.estimate
    nonlinear, present = nonlinear_parameters(model, estimate), parameter_values(model, estimate)
    # As in a fit from there.
    nominal = replace(estimate, coefficients=model.nominal_coefficients)
    start, plausible = parameter_values(model, nominal), sizes_of(model, nominal)
    of_each = np.unique(part, return_inverse=True)[1][observations.state]
    count, size = of_each.max() + 1, len(plausible)
    grams, alongs = np.zeros((count, size, size)), np.zeros((count, size))
    off = fitted.whitened(fitted.residual)
    for seen, _, white in fitted.sensitivities(observations):
        for number in np.unique(of_each[seen]):
            mine = of_each[seen] == number
            rows = white[mine].reshape(mine.sum() * white.shape[1], size) * plausible
            grams[number] += rows.T @ rows
            alongs[number] += rows.T @ off[seen][mine].ravel()
    gram, along, penalty = grams.sum(axis=0), alongs.sum(axis=0), fitted.prior_std**-2
    for mine, my_along in zip(grams, alongs, strict=True):
        rest, right = gram - mine, along - my_along
        step, _, held = solve_normal(rest, right, plausible, False, penalty, present, nonlinear)
        back = np.where(held, start - present, 0.0)
        if back.any():
            right = right - rest @ (back / plausible)
            step = solve_normal(rest, right, plausible, held, penalty, present, nonlinear)[0] + back
        yield step, held


def left_out_squares(fitted: Fit, observations: Observations) -> np.ndarray:
    """Mean square position error of each configuration as all others predict it, m², ndarray (configurations,).

    By the step alone, in closed form, with what is held as in the fit.
    """
    white, states, found = fitted.whitened(fitted.residual), observations.states, []
    configuration = configurations(states.joint_angles, state_clusters(states))[observations.cluster]
    plain, whitened = (np.concatenate(parts) for parts in list(zip(*fitted.sensitivities(observations), strict=True))[1:])
    for number in range(configuration.max() + 1):
        mine = configuration == number
        rows = whitened[mine].reshape(mine.sum() * whitened.shape[1], len(fitted.held))
        gain = fitted.covariance @ rows.T
        inverse = np.linalg.pinv(np.eye(len(rows)) - rows @ gain, rcond=_ROUNDING, hermitian=True)
        moved = plain[mine][:, :3] @ (gain @ (inverse @ white[mine].ravel()))
        found.append(((fitted.residual[mine][:, :3] + moved) ** 2).sum(axis=1).mean())
    return np.array(found)


def split_rows(
    declared: Fit, final: Fit, observations: Observations, replicates: int, stream: np.random.Generator
) -> list[dict[str, Any]]:
    """Leave-one-part-out errors of the declared and the final model, over blocks of joint space and sessions.

    `observations`: training poses, which both were fitted to. `replicates`: of the bootstrap over poses. Returns rows of
    splits.csv: "all" parts together and each; without a split that leaves too few configurations to fit. Intervals take poses
    as independent, which refits that share most of their poses make only nearly true (Bengio and Grandvalet 2004).
    """
    states, rows = observations.states, []
    pose, parts = state_clusters(states), {}
    configuration = configurations(states.joint_angles, pose)[pose]
    if configuration.max() + 1 >= JOINT_SPACE_BLOCKS:
        parts["joint space"] = 1 + blocks_of_poses(states.joint_angles, pose, JOINT_SPACE_BLOCKS)[pose]
    if np.ptp(states.session):
        parts["session"] = states.session
    for name, part in parts.items():
        labels = np.unique(part)
        if min(len(np.unique(configuration[part != label])) for label in labels) < FEWEST_TRAINING_POSES:
            continue
        before = cross_validated(declared, observations, part)
        pair = before, before if final is declared else cross_validated(final, observations, part)
        rows.append(error_row(name, "all", *pair, replicates, stream))
        for label in labels.tolist():
            seen = part[observations.state] == label
            cluster = np.unique(before.cluster[seen], return_inverse=True)[1]
            rows.append(error_row(name, label, *(Errors(each.distance[seen], cluster) for each in pair), replicates, stream))
    return rows


def cross_validated(fitted: Fit, observations: Observations, part: np.ndarray) -> Errors:
    """Position errors of observations, each predicted by a refit without the part that it belongs to; as of `refits`."""
    distance = np.empty(len(observations))
    for refit in refits(fitted, observations, part):
        distance[refit.within[observations.state]] = position_errors(fitted.model, refit.there, refit.left_out).distance
    return Errors(distance, observations.cluster)


def error_row(
    split: str, block: str | int, before: Errors, after: Errors, replicates: int, stream: np.random.Generator
) -> dict[str, Any]:
    """One row of splits.csv."""
    limits, reductions = intervals([before, after], replicates, stream)
    row: dict[str, Any] = {"split": split, "block": block, "poses": before.poses}
    rms = [summary(errors.distance)["rms_m"] for errors in (before, after)]
    for stage, value, limit in zip(("before", "after"), rms, limits, strict=True):
        row |= {f"{stage}_rms_m": value, f"{stage}_rms_m_low": limit["rms_m"][0], f"{stage}_rms_m_high": limit["rms_m"][1]}
    change = reductions[1]
    row |= {"reduction": 1.0 - rms[1] / rms[0], "reduction_low": change.low, "reduction_high": change.high}
    return row | {"reduction_std_error": change.std_error}
