"""A model without one part of its observations: from the normal equations of all of them less those of the part.

One Gauss-Newton step from the fit to all observations leads to the fit without a part [1]. What a parameter was is not carried
over where only that part identifies it: it goes back to where a fit starts, to its prior. Where the errors of a few poses
decide, the step is taken as it is; where a refit is asked for, exact residuals and their gradient after the step prove it, or
lead on from there.

[1] Cook, R. D. and Weisberg, S., Residuals and Influence in Regression, section 2.2, Chapman and Hall, 1982.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.joint_space import configurations
from elastocal.fitting.identifiability import solve_normal
from elastocal.fitting.least_squares import ON_THE_WAY, fit
from elastocal.fitting.memory import kept_conditions
from elastocal.fitting.observations import select_states, state_clusters
from elastocal.fitting.parameters import nonlinear_parameters, parameter_values, stepped
from elastocal.fitting.registration import registered
from elastocal.fitting.robust import robustly
from elastocal.validation.placing import placed_estimate

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate
    from elastocal.fitting.observations import Observations

# A step without a part is proven where the exact equations after it ask for a step below this in every parameter, in standard
# errors, which is taken too. What is left is a share of that, from the weights of outliers and the curvature: no error of
# prediction moves by a hundredth of its standard error.
_PROVEN = 0.01


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

    By the step alone. What a configuration alone determines, such as the frame of a session of one pose, is no error of it.
    """
    states = observations.states
    configuration = configurations(states.joint_angles, state_clusters(states))[state_clusters(states)]
    steps = np.array([step for step, _ in _steps_without(fitted, observations, configuration)])
    of_each, squares = configuration[observations.state], np.empty(len(observations))
    for seen, plain, _ in fitted.sensitivities(observations):
        moved = (plain[:, :3] @ steps[of_each[seen]][..., None])[..., 0]
        squares[seen] = ((fitted.residual[seen, :3] - moved) ** 2).sum(axis=1)
    return np.bincount(of_each, squares) / np.bincount(of_each)


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
