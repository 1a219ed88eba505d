"""Gauss-Newton steps of a robust fit: outliers lose weight, and a step that does not help is halved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaincinv

from elastocal.fitting.identifiability import solve_normal
from elastocal.fitting.normal_equations import Parts
from elastocal.fitting.parameters import limits, nonlinear_parameters, parameter_values, parameters, stepped

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

    Solved = tuple[np.ndarray, np.ndarray, np.ndarray]

_STEPS = 30
# A step that does not help is halved so often at most: one of a 64th that does not help points the wrong way, or along a kink.
_HALVINGS = 6
# Largest step that remains, in standard errors.
SETTLED = 1e-3
# Loads are those of the step before: of a step so much is still to come, at most, by deflection over reach.
_LAGGING = 1e-2
# Share of the slope by which a step must lower the objective (Armijo); a parabola gives a half.
_LEAST_FALL = 0.1
# Of the objective. In a fit of a thousand rows a thousandth of a standard error in one parameter makes half of that.
_ROUNDING = 1e-9
# Observations beyond this quantile of their distance lose weight.
_HUBER_QUANTILE = 0.99


def robustly(
    model: Model,
    observations: Observations,
    around: Conditions | None,
    noise: Noise,
    estimate: Estimate,
    frozen: bool | np.ndarray = False,
    reweighted: bool = False,
    settled: float = SETTLED,
) -> Fit:
    """Iteratively reweighted least squares with Huber's weights [1] by Gauss-Newton steps, each halved until it helps enough.

    Where errors are independent, weighted squares are a bound of Huber's objective that touches it at the present estimate
    [2], so that it falls with them. Where measurements have errors in common there is none: weights come before whitening,
    which would carry an outlier into the measurements beside it, and the estimate solves the weighted equations [3]. A
    whitening belongs to the axes in which a step begins: residuals after the step are turned into these, or a fit would turn
    frame and robot together on and on. Against curvature a step is backtracked until weighted squares and priors fall by
    Armijo's condition [4]. Where that hinders the first trial, what is linear given the laws that other parameters load, and
    given their shapes, is solved for again there, as in variable projection [5]: that is the acceleration by which a path
    follows a bent valley [6], in which steps are then halved. The first step gives all observations one weight, unless the
    start comes of reweighted steps already.

    `observations`: M of them. `around`: of all their states; None where these are too many to keep it. `estimate`: from which
    the first step is taken. `frozen` (P,) of bool: parameters not to move. `reweighted`, `settled`: as in `least_squares.fit`.

    [1] Holland, P. W. and Welsch, R. E., Robust regression using iteratively reweighted least-squares, Communications in
        Statistics A6, 1977.
    [2] Huber, P. J. and Ronchetti, E. M., Robust Statistics, section 7.8, Wiley, 2009.
    [3] Preisser, J. S. and Qaqish, B. F., Robust regression for clustered data with application to binary responses, Biometrics
        55, 1999.
    [4] Nocedal, J. and Wright, S. J., Numerical Optimization, section 3.1, Springer, 2006.
    [5] Golub, G. H. and Pereyra, V., The differentiation of pseudo-inverses and nonlinear least squares problems whose
        variables separate, SIAM Journal on Numerical Analysis 10, 1973.
    [6] Transtrum, M. K. and Sethna, J. P., Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
        minimization, arXiv 1201.5885, 2012.
    """
    rows = observations.rows
    # Of chi-squared with as many degrees of freedom as a measurement has rows.
    corner, typical = np.sqrt(2 * gammaincinv(rows / 2, [_HUBER_QUANTILE, 0.5]) / rows)
    priors = [parameter.prior_std for _, parameter in parameters(model, estimate)]
    nonlinear, bounds = nonlinear_parameters(model, estimate), limits(model, estimate)
    # What has a prior need not be held: where the data do not identify it, the prior does. Nor need what the start has found
    # larger than it should be, or it would be held there, without a standard error, once the noise turns out to be larger.
    plausible = np.array([max(p.plausible, p.prior_std or 0.0) for _, p in parameters(model, estimate)])
    plausible = np.maximum(plausible, np.where(nonlinear, 0.0, np.abs(parameter_values(model, estimate))))
    penalty = np.array([0.0 if prior is None else prior**-2 for prior in priors])
    weights = np.ones(len(observations))

    def objective(estimate: Estimate, squares: float) -> float:
        """Half the weighted squares of the residual and of what has a prior."""
        return 0.5 * (squares + penalty @ parameter_values(model, estimate) ** 2)

    # Given what goes with the loads that other parameters make, and shapes, the residual is nearly linear in all others.
    through = {effect.key for effect in model.effects if effect.effect == "joint_compliance" or "load" in effect.needs}
    yielding = np.array([owner in through for owner, _ in parameters(model, estimate)], bool)
    bending = nonlinear | yielding

    def solved(gram: np.ndarray, along: np.ndarray, present: np.ndarray, frozen: bool | np.ndarray) -> Solved:
        """Gauss-Newton step, covariance and what is held, as of `solve_normal`, within the ranges of the shapes."""
        step, covariance, held = solve_normal(gram, along, plausible, frozen, penalty, present, nonlinear)
        # A shape that would leave its range goes to the end of it, and the others as they do then.
        leaving = (present + step < bounds[:, 0]) | (present + step > bounds[:, 1])
        if leaving.any():
            ends = np.clip(present + step, *bounds.T)[leaving] - present[leaving]
            rest = along - gram[:, leaving] @ (ends / plausible[leaving])
            step = solve_normal(gram, rest, plausible, frozen | leaving, penalty, present, nonlinear)[0]
            step[leaving] = ends
        return step, covariance, held

    converged, scale, last, stuck = False, 1.0, np.zeros(len(plausible)), False
    measurements = Parts(model, observations, noise, around, plausible)
    measurements.linearize(estimate)
    for step_number in range(_STEPS):
        # Loads where the robot yielded to in the last step: a fixed point that the steps bring about.
        measurements.whiten()
        if step_number or reweighted:
            distance = measurements.distance()
            scale = max(np.median(distance) / typical, 1.0)
            weights = corner / np.maximum(distance / scale, corner)
        gram, along = measurements.normal_equations(weights)
        present = parameter_values(model, estimate)
        step, covariance, held = solved(gram, along, present, frozen)
        deviation = np.sqrt(np.diag(covariance))
        # Standard errors of the errors that are there, which the noise may be less than.
        small = settled * (scale * deviation) + (deviation == 0)
        # A small step under the loads of before a large one says nothing of what these loads still bring about.
        coming = np.maximum(np.abs(step), _LAGGING * np.abs(last) * plausible * yielding)
        converged = bool(step_number or reweighted) and bool((coming <= small).all())
        if converged:
            estimate = stepped(model, estimate, step)
            break
        # Weights and whitening follow the estimate. Where they throw it to and fro, half the way lies between (relaxation of a
        # fixed-point iteration): a step that takes back more than half of the last one is halved.
        with_priors = gram + np.diag(penalty * plausible**2)
        first = int(with_priors @ (step / plausible + last / 2) @ last < 0)
        last = step / plausible
        # Twice the fall that a parabola promises.
        slope = along @ (step / plausible) - penalty @ (present * step)
        before, origin, acceleration = objective(estimate, measurements.squares(weights)), estimate, np.zeros(len(step))
        for halving in range(first, _HALVINGS + 1):
            share = 0.5**halving
            estimate = stepped(model, origin, share * step + share**2 * acceleration)
            measurements.linearize(estimate)
            after = objective(estimate, measurements.squares(weights))
            least = _LEAST_FALL * share * slope - _ROUNDING * max(before, 1.0)
            if after > before - least and halving == first:
                # What it fell from was under the loads of the step before.
                before = objective(origin, measurements.squares(weights, origin))
                if after > before - least and bending.any():
                    there = measurements.copy().normal_equations(weights)
                    rest = solved(*there, parameter_values(model, estimate), frozen | bending)[0]
                    acceleration = rest / share**2
                    estimate = stepped(model, origin, share * step + share**2 * acceleration)
                    measurements.linearize(estimate)
                    after = objective(estimate, measurements.squares(weights))
            if after <= before - least:
                break
        else:
            estimate = origin
            measurements.linearize(estimate)
            # A step goes by the loads of the step before, and the first one by weights that are all alike: once more by those
            # of now.
            if stuck:
                break
            stuck = True
            continue
        stuck = False
    return measurements.fit(estimate, held, covariance, weights, converged)
