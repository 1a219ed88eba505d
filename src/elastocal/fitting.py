"""Robust generalized least squares on the composite model, by Gauss-Newton steps on exact predictions.

What the data cannot tell is named and held: a parameter whose standard error would exceed its plausible size, first beside
those before it and then beside all, keeps its value and is listed. Nothing is regularised but series whose parameters carry a
prior, which is reported with them.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2
from statsmodels.robust.norms import HuberT

from elastocal.effects.protocol import with_springs
from elastocal.model import (
    bends,
    circumstances,
    joint_compliances,
    limits,
    linearize,
    mass_corrections,
    parameter_values,
    parameters,
    residuals,
    stepped,
)
from elastocal.noise import Noise
from elastocal.registration import registered
from elastocal.whitening import Whitening, whitening

_STEPS = 30
# A step that does not help is halved so often at most: one of a 64th that does not help points the wrong way, or along a kink.
_HALVINGS = 6
# Largest step that remains, in standard errors.
_SETTLED = 1e-3
# Share of the slope by which a step must lower the objective (Armijo); a parabola gives a half.
_LEAST_FALL = 0.1
# Of the objective. In a fit of a thousand rows a thousandth of a standard error in one parameter makes half of that.
_ROUNDING = 1e-9
# Observations beyond this quantile of their distance lose weight.
_HUBER_QUANTILE = 0.99
# Correlation beyond which a parameter cannot be told because of a shape.
_BOUND_TO_SHAPE = 0.5


@dataclass(frozen=True)
class Fit:
    """A model fitted to observations.

    Attributes
    ----------
    model : Model
    estimate : Estimate
    noise : Noise
    held : ndarray of bool (P,)
        Parameters that the data cannot tell.
    covariance : ndarray (P, P)
        Of the parameters; zero where held.
    weights : ndarray (M,)
        Robust weight of each observation.
    whitener : Whitening
    residual : ndarray (M, rows)
        m and rad, base axes.
    joint_jacobian : ndarray (M, rows, n)
        Of each target with respect to the joints.
    circumstances : Circumstances
        Of the states fitted.
    converged : bool
        Whether the last step was below a thousandth of a standard error in every parameter, so that the estimate is a minimum.
    """

    model: object
    estimate: object
    noise: Noise
    held: np.ndarray
    covariance: np.ndarray
    weights: np.ndarray
    whitener: Whitening
    residual: np.ndarray
    joint_jacobian: np.ndarray
    circumstances: object
    converged: bool = True

    @property
    def parameters(self):
        """As `model.parameters`."""
        return parameters(self.model, self.estimate)

    def values_of(self, key):
        """Linear parameters and shapes of one effect."""
        number = [effect.key for effect in self.model.effects].index(key)
        return self.estimate.coefficients[number], self.estimate.shapes[number]

    def whitened(self, values):
        """Rows (M, rows, ...) weighted and whitened as in the fit."""
        weights = np.sqrt(self.weights).reshape(-1, *[1] * (values.ndim - 1))
        return self.whitener.apply(values * weights)


def fit(model, observations, noise, start=None):
    """Fit a model.

    Parameters
    ----------
    model : Model
    observations : Observations
    noise : Noise
    start : Estimate, optional
        Of this model; by `registered` without.

    Returns
    -------
    Fit
    """
    start = registered(model, observations) if start is None else start
    return _robustly(model, observations, circumstances(model, start, observations.states), noise, start)


def fit_frames(fitted, model, observations, noise, own_targets=True):
    """Fit frames and targets of other observations; everything else stays as it was found.

    Parameters
    ----------
    fitted : Fit
    model : Model
        The same effects with the targets of these observations.
    observations : Observations
    noise : Noise
    own_targets : bool
        Whether these observations have targets of their own; where not, those of the fit stay as they were found.

    Returns
    -------
    Estimate
    """
    found = fitted.estimate
    if not own_targets:
        known = [replace(t, offset_m=tuple(at)) for t, at in zip(model.targets, found.target_offset, strict=True)]
        model = replace(model, targets=tuple(known))
    start = registered(model, observations)
    start = replace(start, coefficients=found.coefficients, shapes=found.shapes)
    if not own_targets:
        start = replace(start, target_rotation=found.target_rotation)
    frozen = np.array([not owner.startswith(("frame ", "target ")) for owner, _ in parameters(model, start)], bool)
    around = circumstances(model, start, observations.states)
    return _robustly(model, observations, around, noise, start, frozen).estimate


def _robustly(model, observations, around, noise, estimate, frozen=False):
    """Gauss-Newton steps on Huber's objective by iteratively reweighted least squares, each halved until it does not rise.

    The step minimises a bound of the objective that touches it at the present estimate (Huber and Ronchetti 2009, 7.8), so that
    without curvature it never rises; against curvature it is backtracked (Nocedal and Wright 2006, 3.1).
    """
    rows = observations.rows
    norm = HuberT(np.sqrt(chi2.ppf(_HUBER_QUANTILE, rows) / rows))
    plausible = np.array([parameter.plausible for _, parameter in parameters(model, estimate)])
    priors = [parameter.prior_std for _, parameter in parameters(model, estimate)]
    penalty = np.array([0.0 if prior is None else prior**-2 for prior in priors])
    bending, bounds = bends(model, estimate), limits(model, estimate)
    typical = np.sqrt(chi2.median(rows) / rows)
    weights = np.ones(len(observations))

    def objective(estimate, residual):
        """Half the squared distances, those of outliers counted linearly, and half the squares of what has a prior."""
        distance = np.sqrt((whitener.apply(residual) ** 2).mean(axis=1))
        lost = distance**2 / 2 if scale is None else scale**2 * norm.rho(distance / scale)
        return rows * lost.sum() + 0.5 * penalty @ parameter_values(model, estimate) ** 2

    converged, scale = False, None
    line = linearize(model, estimate, observations, around)
    for step_number in range(_STEPS):
        # Loads where the robot yielded to in the last step: a fixed point that the steps bring about.
        around = line.circumstances
        jacobian = line.coordinate_jacobian[..., : model.sites.joints]
        whitener = whitening(observations, jacobian, noise)
        if step_number:
            distance = np.sqrt((whitener.apply(line.residual) ** 2).mean(axis=1))
            scale = max(np.median(distance) / typical, 1.0)
            weights = norm.weights(distance / scale)
        root = np.sqrt(weights)
        right = whitener.apply(line.residual * root[:, None]).reshape(-1)
        left = whitener.apply(line.sensitivities * root[:, None, None]).reshape(len(right), -1)
        present = parameter_values(model, estimate)
        step, covariance, held = solve_identifiable(left, right, plausible, frozen, penalty, present, bending)
        # A shape that would leave its range goes to the end of it, and the others as they do then.
        leaving = (present + step < bounds[:, 0]) | (present + step > bounds[:, 1])
        if leaving.any():
            ends = np.clip(present + step, *bounds.T)[leaving] - present[leaving]
            rest = right - left[:, leaving] @ ends
            step = solve_identifiable(left, rest, plausible, frozen | leaving, penalty, present, bending)[0]
            step[leaving] = ends
        deviation = np.sqrt(np.diag(covariance))
        converged = bool(step_number) and bool((np.abs(step) <= _SETTLED * deviation + (deviation == 0)).all())
        if converged:
            estimate = stepped(model, estimate, step)
            break
        # Twice the fall that a parabola promises.
        slope = right @ (left @ step) - penalty @ (present * step)
        before, origin = objective(estimate, line.residual), estimate
        for halving in range(_HALVINGS + 1):
            estimate = stepped(model, origin, 0.5**halving * step)
            line = linearize(model, estimate, observations, around)
            after = objective(estimate, line.residual)
            least = _LEAST_FALL * 0.5**halving * slope - _ROUNDING * max(before, 1.0)
            if after > before - least and not halving:
                # What it fell from was under the loads of the step before.
                before = objective(origin, residuals(model, origin, observations, around))
            if after <= before - least:
                break
        else:
            estimate = origin
            line = linearize(model, estimate, observations, around)
            # The first step has another objective than those that follow: all observations count alike.
            if step_number:
                break
    around = with_springs(line.circumstances, joint_compliances(model, estimate), mass_corrections(model, estimate))
    residual = residuals(model, estimate, observations, around)
    return Fit(model, estimate, noise, held, covariance, weights, whitener, residual, jacobian, around, converged)


def solve_identifiable(left, right, plausible, frozen=False, penalty=0.0, present=0.0, bending=False):
    """Least squares over the parameters that the data can tell.

    Parameters
    ----------
    left : ndarray (R, P)
        Whitened sensitivities.
    right : ndarray (R,)
        Whitened residual.
    plausible : ndarray (P,)
        Plausible size of each parameter.
    frozen : bool or ndarray of bool (P,)
        Parameters not to move.
    penalty : float or ndarray (P,)
        One over the variance of the prior about zero; 0 for none.
    present : float or ndarray (P,)
        Values from which the step is taken.
    bending : bool or ndarray of bool (P,)
        As in `identifiable`.

    Returns
    -------
    step : ndarray (P,)
        Zero where held.
    covariance : ndarray (P, P)
    held : ndarray of bool (P,)
    """
    scaled = left * plausible
    gram = scaled.T @ scaled + np.diag(np.broadcast_to(penalty, len(plausible)) * plausible**2)
    along = scaled.T @ right - plausible * np.broadcast_to(penalty * present, len(plausible))
    held = ~identifiable(gram, *(np.broadcast_to(flags, len(plausible)) for flags in (frozen, bending)))
    free = np.flatnonzero(~held)
    step, covariance = np.zeros(len(plausible)), np.zeros((len(plausible),) * 2)
    if len(free):
        inverse = np.linalg.inv(np.linalg.cholesky(gram[np.ix_(free, free)]))
        step[free] = plausible[free] * (inverse.T @ (inverse @ along[free]))
        covariance[np.ix_(free, free)] = np.outer(plausible[free], plausible[free]) * (inverse.T @ inverse)
    return step, covariance, held


def identifiable(gram, frozen, bending):
    """Which parameters the data can tell from zero at their plausible size: first given those before them, then given all.

    Parameters
    ----------
    gram : ndarray (P, P)
        Information on the parameters, each in units of its plausible size.
    frozen : ndarray of bool (P,)
        Left out from the start.
    bending : ndarray of bool (P,)
        Shapes: given up before a parameter that they are bound to, as that of their law is where it is nearly a straight line.

    Returns
    -------
    ndarray of bool (P,)
    """
    kept = []
    factor = np.zeros_like(gram)
    for number in range(len(gram)):
        if frozen[number]:
            continue
        row = solve_triangular(factor[: len(kept), : len(kept)], gram[kept, number], lower=True) if kept else np.zeros(0)
        left_over = gram[number, number] - row @ row
        # Rounding of the squares counts as nothing.
        if left_over > max(1.0, 1e-11 * gram[number, number]):
            factor[len(kept), : len(kept)], factor[len(kept), len(kept)] = row, np.sqrt(left_over)
            kept.append(number)
    # Parameters that came later may have taken from what their predecessors could be told by.
    while kept:
        covariance = np.linalg.inv(gram[np.ix_(kept, kept)])
        deviation = np.sqrt(np.diag(covariance))
        worst = int(np.argmax(deviation))
        if deviation[worst] <= 1.0:
            break
        correlation = np.where(bending[kept], np.abs(covariance[worst]) / (deviation[worst] * deviation), 0.0)
        shape = int(np.argmax(correlation))
        kept.pop(shape if correlation[shape] > _BOUND_TO_SHAPE else worst)
    mask = np.zeros(len(gram), bool)
    mask[kept] = True
    return mask
