"""A model without one part of its observations: from the normal equations of all of them less those of the part.

One Gauss-Newton step from the fit to all observations leads to the fit without a part [1]. What a parameter was is not carried
over where only that part identifies it: it goes back to where a fit starts, to its prior. Where the errors of a few poses
decide, the step is taken as it is; where a refit is asked for, exact residuals and their gradient after the step prove it, or
lead on from there.

Cross-validation over blocks and sessions says how far a model carries. Poses drawn at random have neighbours among those
fitted, so their errors say how well a model interpolates; whole blocks of joint space left out say how well it extrapolates
(block cross-validation [2]). The effects stay those that were chosen with all training poses: what is refitted is their size,
so the errors carry the selection's optimism.

[1] Cook, R. D. and Weisberg, S., Residuals and Influence in Regression, section 2.2, Chapman and Hall, 1982.
[2] Roberts, D. R. et al., Cross-validation strategies for data with temporal, spatial, hierarchical, or phylogenetic structure,
    Ecography 40, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.holdout import FEWEST_TRAINING_POSES, blocks_of_poses, configurations
from elastocal.fitting.displacement import kept_conditions
from elastocal.fitting.identifiability import solve_normal
from elastocal.fitting.least_squares import ON_THE_WAY, fit
from elastocal.fitting.observations import select_states, state_clusters
from elastocal.fitting.parameters import nonlinear_parameters, parameter_values, stepped
from elastocal.fitting.registration import registered
from elastocal.fitting.robust import robustly
from elastocal.validation.held_out import Errors, intervals, position_errors, summary
from elastocal.validation.placing import placed_estimate

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate
    from elastocal.fitting.observations import Observations, States

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
    owners = [owner for owner, _ in fitted.parameters]
    placing = np.array([owner.startswith(("frame ", "target ")) for owner in owners], bool)
    for number, (step, held) in zip(np.unique(part), _steps_without(fitted, observations, part), strict=True):
        within = part == number
        rest, left_out = select_states(observations, ~within), select_states(observations, within)
        sessions = np.isin(fitted.estimate.sessions, rest.states.session)
        gone = {f"frame {session}" for session in np.array(fitted.estimate.sessions)[~sessions]}
        kept = np.array([owner not in gone for owner in owners], bool)
        refit = None
        # Where the rest does not say where a frame or a target is, the nominal robot does.
        if not (held & placing & kept).any():
            start = replace(
                fitted.estimate,
                sessions=tuple(np.array(fitted.estimate.sessions)[sessions].tolist()),
                frame_rotation=fitted.estimate.frame_rotation[sessions],
                frame_position=fitted.estimate.frame_position[sessions],
            )
            start = stepped(model, start, step[kept])
            around = kept_conditions(model, start, rest)
            refit = robustly(model, rest, around, noise, start, held[kept], reweighted=True, settled=_PROVEN)
        if refit is None or not refit.converged:
            refit = fit(model, rest, noise, replace(registered(model, rest), shapes=fitted.estimate.shapes))
        yield Refit(within, rest, left_out, refit.estimate, placed_estimate(refit, left_out))


def left_out_squares(fitted: Fit, observations: Observations) -> np.ndarray:
    """Mean square position error of each configuration as all others predict it, m², ndarray (configurations,).

    By the step alone, in closed form, with what is held as in the fit.
    """
    white = fitted.whitened(fitted.residual)
    states = observations.states
    configuration = configurations(states.joint_angles, state_clusters(states))[observations.cluster]
    found = np.empty(configuration.max() + 1)
    plain, whitened = (np.concatenate(parts) for parts in list(zip(*fitted.sensitivities(observations), strict=True))[1:])
    for number in range(len(found)):
        mine = configuration == number
        rows = whitened[mine].reshape(mine.sum() * whitened.shape[1], len(fitted.held))
        gain = fitted.covariance @ rows.T
        inverse = np.linalg.pinv(np.eye(len(rows)) - rows @ gain, rcond=_ROUNDING, hermitian=True)
        moved = plain[mine][:, :3] @ (gain @ (inverse @ white[mine].ravel()))
        found[number] = ((fitted.residual[mine][:, :3] + moved) ** 2).sum(axis=1).mean()
    return found


def certain_loss(squares: np.ndarray, others: np.ndarray) -> bool:
    """Whether mean squares exceed those of another model on the same poses by more than the difference's standard error."""
    off = squares - others
    return bool(off.mean() > off.std(ddof=1) / np.sqrt(len(off)))


def _steps_without(fitted: Fit, observations: Observations, part: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Step (P,) of all parameters that leads to the fit without each part, and which (P,) the rest does not identify.

    `observations`: which it was fitted to. `part` (S,) of int.
    """
    model, estimate, listed = fitted.model, fitted.estimate, [parameter for _, parameter in fitted.parameters]
    nonlinear, present = nonlinear_parameters(model, estimate), parameter_values(model, estimate)
    nominal = [
        model.nominal_compliance if e.effect == "joint_compliance" else np.zeros(len(e.parameters)) for e in model.effects
    ]
    start = parameter_values(model, replace(estimate, coefficients=tuple(nominal)))
    # As in a fit from there.
    plausible = np.array([max(parameter.plausible, parameter.prior_std or 0.0) for parameter in listed])
    plausible = np.maximum(plausible, np.where(nonlinear, 0.0, np.abs(start)))
    parts, of_each = np.unique(part[observations.state], return_inverse=True)
    grams, alongs = np.zeros((len(parts), len(listed), len(listed))), np.zeros((len(parts), len(listed)))
    off = fitted.whitened(fitted.residual)
    for seen, _, white in fitted.sensitivities(observations):
        for number in np.unique(of_each[seen]):
            mine = of_each[seen] == number
            rows = white[mine].reshape(mine.sum() * white.shape[1], len(listed)) * plausible
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


@dataclass(frozen=True)
class Split:
    """A partition of the states of observations.

    `labels`: name of each part. `part` (S,) of int: index into `labels`, of every state.
    """

    name: str
    labels: tuple[int, ...]
    part: np.ndarray


def splits_of(states: States) -> list[Split]:
    """The partitions that some states allow: blocks of joint space and, where there are several, sessions.

    Returns without those that leave too few configurations to fit.
    """
    pose = state_clusters(states)
    configuration = configurations(states.joint_angles, pose)[pose]
    sessions, session = np.unique(states.session, return_inverse=True)
    found = [Split("session", tuple(sessions.tolist()), session.ravel())] if len(sessions) > 1 else []
    if configuration.max() + 1 >= JOINT_SPACE_BLOCKS:
        labels = tuple(range(1, JOINT_SPACE_BLOCKS + 1))
        found.insert(0, Split("joint space", labels, blocks_of_poses(states.joint_angles, pose, JOINT_SPACE_BLOCKS)[pose]))
    return [split for split in found if _fewest_left(split, configuration) >= FEWEST_TRAINING_POSES]


def cross_validated(fitted: Fit, observations: Observations, part: np.ndarray) -> Errors:
    """Position errors of observations, each predicted by a refit without the part that it belongs to.

    Leave-one-block-out cross-validation, see `refits`.

    `fitted`, `observations`, `part`: as in `refits`.
    """
    distance = np.empty(len(observations))
    for refit in refits(fitted, observations, part):
        errors = position_errors(fitted.model, refit.there, refit.left_out)
        distance[refit.within[observations.state]] = errors.distance
    return Errors(distance, observations.cluster)


def split_rows(
    declared: Fit, final: Fit, observations: Observations, replicates: int, stream: np.random.Generator
) -> list[dict[str, Any]]:
    """Cross-validated errors of the declared and the final model over every split that the training poses allow.

    `observations`: training poses, which both were fitted to. `replicates`: of the bootstrap over poses. Returns rows of
    splits.csv: each part of each split, and "all" parts together. Intervals take poses as independent, which refits that share
    most of their poses make only nearly true [1].

    [1] Bengio, Y. and Grandvalet, Y., No unbiased estimator of the variance of K-fold cross-validation, Journal of Machine
        Learning Research 5, 2004.
    """
    rows = []
    for split in splits_of(observations.states):
        before = cross_validated(declared, observations, split.part)
        after = before if final is declared else cross_validated(final, observations, split.part)
        rows.append(error_row(split.name, "all", before, after, replicates, stream))
        of_each = split.part[observations.state]
        for number, label in enumerate(split.labels):
            pair = _part(before, of_each == number), _part(after, of_each == number)
            rows.append(error_row(split.name, label, *pair, replicates, stream))
    return rows


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


def _fewest_left(split: Split, configuration: np.ndarray) -> int:
    return min(len(np.unique(configuration[split.part != number])) for number in range(len(split.labels)))


def _part(errors: Errors, mask: np.ndarray) -> Errors:
    return Errors(errors.distance[mask], np.unique(errors.cluster[mask], return_inverse=True)[1])
