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

from elastocal.effects.circumstances import at_states, with_springs
from elastocal.fitting.model import (
    bends,
    circumstances,
    displaced_coordinates,
    joint_compliances,
    limits,
    linearize,
    mass_corrections,
    parameter_values,
    parameters,
    residuals,
    stepped,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import part_at, parts_of, sample_of
from elastocal.fitting.registration import registered
from elastocal.fitting.whitening import Whitening, whitening

_STEPS = 30
# A step that does not help is halved so often at most: one of a 64th that does not help points the wrong way, or along a kink.
_HALVINGS = 6
# Largest step that remains, in standard errors; and that of a fit from which others start.
_SETTLED, ON_THE_WAY = 1e-3, 0.1
# Share of the slope by which a step must lower the objective (Armijo); a parabola gives a half.
_LEAST_FALL = 0.1
# Of the objective. In a fit of a thousand rows a thousandth of a standard error in one parameter makes half of that.
_ROUNDING = 1e-9
# Observations beyond this quantile of their distance lose weight.
_HUBER_QUANTILE = 0.99
# Correlation beyond which a parameter cannot be told because of a shape.
_BOUND_TO_SHAPE = 0.5
# Values of sensitivities that a fit holds at once, of which there are five copies: observations beyond come in parts, which are
# linearised again in each step.
_MOST_HELD = 4_000_000
# Observations of a part: what it makes stays in the processor's cache and is not asked of the system again and again.
_MOST_AT_ONCE = 4000
# States beyond which circumstances are not kept from step to step but found again: they take some ten kilobytes each.
_MOST_STATES = 20_000
# A fit to more observations starts from the fit to so many of them.
_MOST_STARTED_FROM = 30_000


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
    joint_jacobian : ndarray (M, rows, n) or None
        Of each target with respect to the joints; None where there are too many to keep it.
    circumstances : Circumstances or None
        Of the states fitted; None where these are too many to keep it.
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

    def sensitivities(self, observations):
        """Sensitivities of the observations that were fitted, as they are and whitened, in parts of whole poses.

        Parameters
        ----------
        observations : Observations

        Yields
        ------
        seen : slice
            Observations of the part.
        plain, whitened : ndarray (M', rows, P)
        """
        for states, seen in parts_of(observations, observations_at_once(observations.rows, len(self.held))):
            some = part_at(observations, states, seen)
            if self.circumstances is None:
                around = circumstances(self.model, self.estimate, some.states)
            else:
                around = at_states(self.circumstances, states)
            line = linearize(self.model, self.estimate, some, around)
            white = whitening(some, self.jacobian_at(line, seen), self.noise)
            yield seen, line.sensitivities, white.apply(line.sensitivities * np.sqrt(self.weights[seen])[:, None, None])

    def jacobian_at(self, line, seen):
        """Jacobian of some observations with respect to the joints: as it was kept, or that of their `Linearization`."""
        if self.joint_jacobian is None:
            return line.coordinate_jacobian[..., : self.model.sites.joints]
        return self.joint_jacobian[seen]


def fit(model, observations, noise, start=None, reweighted=False, settled=_SETTLED):
    """Fit a model.

    Parameters
    ----------
    model : Model
    observations : Observations
    noise : Noise
    start : Estimate, optional
        Of this model; by `registered` without.
    reweighted : bool
        Whether the start comes of a fit: outliers lose weight from the first step on.
    settled : float
        Largest step that remains, in standard errors.

    Returns
    -------
    Fit
    """
    few = sample_of(observations, _MOST_STARTED_FROM)
    if len(few) < len(observations):
        # Where all the readings lead is close to where some of them do.
        start = fit(model, few, noise, start, reweighted, ON_THE_WAY).estimate
        around = _kept_circumstances(model, start, observations)
        return _robustly(model, observations, around, noise, start, reweighted=True, settled=settled)
    start = registered(model, observations) if start is None else start
    around = _kept_circumstances(model, start, observations)
    return _robustly(model, observations, around, noise, start, reweighted=reweighted, settled=settled)


def _kept_circumstances(model, estimate, observations):
    return circumstances(model, estimate, observations.states) if len(observations.states) <= _MOST_STATES else None


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
    around = _kept_circumstances(model, start, observations)
    return _robustly(model, observations, around, noise, start, frozen).estimate


def _robustly(model, observations, around, noise, estimate, frozen=False, reweighted=False, settled=_SETTLED):
    """Iteratively reweighted least squares by Gauss-Newton steps, each halved until the weighted squares do not rise.

    Where errors are independent, weighted squares are a bound of Huber's objective that touches it at the present estimate
    (Huber and Ronchetti 2009, 7.8), so that it falls with them. Where readings have errors in common there is none: weights
    come before whitening, which would carry an outlier into the readings beside it, and the estimate solves the weighted
    equations (Preisser and Qaqish 1999). A whitening belongs to the axes in which a step begins: residuals after the step
    are turned into these, or a fit would turn frame and robot together on and on. Against curvature a step is backtracked
    (Nocedal and Wright 2006, 3.1). The first step gives all observations one weight, unless the start comes of reweighted
    steps already.
    """
    rows = observations.rows
    norm = HuberT(np.sqrt(chi2.ppf(_HUBER_QUANTILE, rows) / rows))
    priors = [parameter.prior_std for _, parameter in parameters(model, estimate)]
    # What has a prior need not be held: where the data cannot tell it, the prior does.
    plausible = np.array([max(p.plausible, p.prior_std or 0.0) for _, p in parameters(model, estimate)])
    penalty = np.array([0.0 if prior is None else prior**-2 for prior in priors])
    bending, bounds = bends(model, estimate), limits(model, estimate)
    typical = np.sqrt(chi2.median(rows) / rows)
    weights = np.ones(len(observations))

    def objective(estimate, squares):
        """Half the weighted squares of the residual and of what has a prior."""
        return 0.5 * (squares + penalty @ parameter_values(model, estimate) ** 2)

    converged, scale, last, stuck = False, 1.0, np.zeros(len(plausible)), False
    readings = _Parts(model, observations, noise, around, plausible)
    readings.linearize(estimate)
    for step_number in range(_STEPS):
        # Loads where the robot yielded to in the last step: a fixed point that the steps bring about.
        readings.whiten()
        if step_number or reweighted:
            distance = readings.distance()
            scale = max(np.median(distance) / typical, 1.0)
            weights = norm.weights(distance / scale)
        gram, along = readings.normal_equations(weights)
        present = parameter_values(model, estimate)
        step, covariance, held = solve_normal(gram, along, plausible, frozen, penalty, present, bending)
        # A shape that would leave its range goes to the end of it, and the others as they do then.
        leaving = (present + step < bounds[:, 0]) | (present + step > bounds[:, 1])
        if leaving.any():
            ends = np.clip(present + step, *bounds.T)[leaving] - present[leaving]
            rest = along - gram[:, leaving] @ (ends / plausible[leaving])
            step = solve_normal(gram, rest, plausible, frozen | leaving, penalty, present, bending)[0]
            step[leaving] = ends
        deviation = np.sqrt(np.diag(covariance))
        # Standard errors of the errors that are there, which the noise may be less than.
        small = settled * (scale * deviation) + (deviation == 0)
        converged = bool(step_number or reweighted) and bool((np.abs(step) <= small).all())
        if converged:
            estimate = stepped(model, estimate, step)
            break
        # Weights and whitening follow the estimate. Where they throw it to and fro, half the way lies between (relaxation of a
        # fixed-point iteration): a step that takes back more than half of the last one is halved.
        first = int(gram @ (step / plausible + last / 2) @ last < 0)
        last = step / plausible
        # Twice the fall that a parabola promises.
        slope = along @ (step / plausible) - penalty @ (present * step)
        before, origin = objective(estimate, readings.squares(weights)), estimate
        for halving in range(first, _HALVINGS + 1):
            estimate = stepped(model, origin, 0.5**halving * step)
            readings.linearize(estimate)
            after = objective(estimate, readings.squares(weights))
            least = _LEAST_FALL * 0.5**halving * slope - _ROUNDING * max(before, 1.0)
            if after > before - least and halving == first:
                # What it fell from was under the loads of the step before.
                before = objective(origin, readings.squares(weights, origin))
            if after <= before - least:
                break
        else:
            estimate = origin
            readings.linearize(estimate)
            # A step goes by the loads of the step before, and the first one by weights that are all alike: once more by those
            # of now.
            if stuck:
                break
            stuck = True
            continue
        stuck = False
    return readings.fit(estimate, held, covariance, weights, converged)


def observations_at_once(rows, columns):
    """How many observations are linearised at once; what a linearisation makes beside parameters is as 60 of them."""
    return max(min(_MOST_HELD // (rows * max(columns, 60)), _MOST_AT_ONCE), 1)


class _Parts:
    """Readings beside a model, whole or in parts of whole poses: what a step needs of them adds up over the parts.

    Whitening in parts is that of the last step; where the noise has no part of the joints it is always the same. Of states that
    are too many to keep their circumstances, the coordinates are kept at which loads are taken.
    """

    def __init__(self, model, observations, noise, around, plausible):
        self.model, self.observations, self.noise, self.plausible = model, observations, noise, plausible
        held = observations.rows * len(observations) * max(len(plausible), 60) <= _MOST_HELD
        most = len(observations) if held else observations_at_once(observations.rows, len(plausible))
        self.slices = parts_of(observations, most)
        self.whole = len(self.slices) == 1 and around is not None
        self.parts = [observations] if self.whole else [part_at(observations, *edges) for edges in self.slices]
        self.around = [around] if self.whole else [None] * len(self.parts)
        if not self.whole and around is not None:
            self.around = [at_states(around, states) for states, _ in self.slices]
        self.coordinates = [None] * len(self.parts)
        self.whiteners = [None] * len(self.parts)
        # Of so many states that circumstances are not kept neither is this.
        shape = len(observations), observations.rows, model.sites.joints
        self.jacobian = None if around is None else np.zeros(shape)
        self.line = None

    def linearize(self, estimate):
        """Go to an estimate."""
        self.estimate = estimate
        if self.whole:
            self.line = linearize(self.model, estimate, self.observations, self.around[0])
            self.residual = self.line.residual
        else:
            self.residual = np.concatenate(
                [residuals(self.model, estimate, part, self._around(number)) for number, part in enumerate(self.parts)]
            )

    def whiten(self):
        """Take loads and whitening at the present estimate."""
        self.origin = self.estimate
        if self.whole:
            self.around = [self.line.circumstances]
            self.jacobian = self.line.coordinate_jacobian[..., : self.model.sites.joints]
            self.whiteners = [whitening(self.observations, self.jacobian, self.noise)]
        elif self.whiteners[0] is None:
            for number, part in enumerate(self.parts):
                if self.noise.pose_rad or self.noise.joint_rad.any():
                    self._linearized(number, part)
                else:
                    self.whiteners[number] = whitening(part, None, self.noise)

    def normal_equations(self, weights):
        """Gram matrix of the whitened sensitivities, in plausible sizes, and their products with the residual."""
        size = len(self.plausible)
        gram, along, root = np.zeros((size, size)), np.zeros(size), np.sqrt(weights)
        for number, (part, (_, seen)) in enumerate(zip(self.parts, self.slices, strict=True)):
            line = self.line if self.whole else self._linearized(number, part)
            whitener, mine = self.whiteners[number], root[seen]
            right = whitener.apply(line.residual * mine[:, None]).reshape(-1)
            left = _of_rotation_vectors(line.sensitivities, line.residual) * mine[:, None, None]
            left = whitener.apply(left).reshape(len(right), -1)
            left *= self.plausible
            gram += left.T @ left
            along += left.T @ right
        return gram, along

    def distance(self):
        """Whitened distance of each observation from the prediction, ndarray (M,)."""
        return np.sqrt(np.concatenate([(part**2).mean(axis=1) for part in self._whitened(self.residual)]))

    def squares(self, weights, estimate=None):
        """Sum of squares of the residual, weighted and whitened as in `normal_equations`; of this or another estimate."""
        residual = self.residual
        if estimate is not None:
            found = [residuals(self.model, estimate, part, self._around(n, estimate)) for n, part in enumerate(self.parts)]
            residual = np.concatenate(found)
        residual = self._in_axes_of_step(residual, self.estimate if estimate is None else estimate)
        return float(sum((part**2).sum() for part in self._whitened(residual * np.sqrt(weights)[:, None])))

    def _in_axes_of_step(self, residual, estimate):
        """A residual in the base axes of an estimate in those of the one by which it is whitened."""
        turn = self.origin.frame_rotation.transpose(0, 2, 1) @ estimate.frame_rotation
        if (turn == np.eye(3)).all():
            return residual
        states, state = self.observations.states, self.observations.state
        session = np.searchsorted(estimate.sessions, states.session[state])
        vectors = residual.reshape(len(residual), -1, 3)
        return (vectors @ turn[session].transpose(0, 2, 1)).reshape(residual.shape)

    def fit(self, estimate, held, covariance, weights, converged):
        """The `Fit` of these readings."""
        model, around = self.model, None
        if self.whole:
            springs = joint_compliances(model, estimate), mass_corrections(model, estimate)
            around = with_springs(self.line.circumstances, *springs)
            residual = residuals(model, estimate, self.observations, around)
        else:
            self.linearize(estimate)
            residual = self.residual
            if len(self.observations.states) <= _MOST_STATES:
                around = circumstances(model, estimate, self.observations.states)
        whitener = Whitening(
            tuple(
                (members + edges[1].start, factor)
                for edges, found in zip(self.slices, self.whiteners, strict=True)
                for members, factor in found.blocks
            )
        )
        return Fit(model, estimate, self.noise, held, covariance, weights, whitener, residual, self.jacobian, around, converged)

    def _around(self, number, estimate=None):
        kept = self.around[number]
        if kept is not None:
            return kept
        states, coordinates = self.parts[number].states, None
        if self.coordinates[number] is not None:
            moved, displaced = self.coordinates[number]
            coordinates = np.zeros((len(states), self.model.sites.chain.coordinates))
            coordinates[:, moved] = displaced
        return circumstances(self.model, estimate or self.estimate, states, coordinates)

    def _linearized(self, number, part):
        around = self._around(number)
        line = linearize(self.model, self.estimate, part, around)
        if self.around[number] is None:
            displaced = displaced_coordinates(self.model, self.estimate, around)
            moved = np.flatnonzero(displaced.any(axis=0))
            self.coordinates[number] = moved, displaced[:, moved]
        else:
            self.around[number] = line.circumstances
        jacobian = line.coordinate_jacobian[..., : self.model.sites.joints]
        if self.jacobian is not None:
            self.jacobian[self.slices[number][1]] = jacobian
        self.whiteners[number] = whitening(part, jacobian, self.noise)
        return line

    def _whitened(self, residual):
        pairs = zip(self.whiteners, self.slices, strict=True)
        return [whitener.apply(residual[seen]) for whitener, (_, seen) in pairs]


def _of_rotation_vectors(sensitivities, residual):
    """Sensitivities of the residual itself: where a pose turns by -w, its rotation vector r grows by w + r x w / 2 + O(r^2)."""
    if residual.shape[1] == 3:
        return sensitivities
    turned = sensitivities[:, 3:]
    exact = turned + 0.5 * np.cross(residual[:, 3:, None], turned, axis=1)
    return np.concatenate([sensitivities[:, :3], exact], axis=1)


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
    return solve_normal(scaled.T @ scaled, scaled.T @ right, plausible, frozen, penalty, present, bending)


def solve_normal(gram, along, plausible, frozen=False, penalty=0.0, present=0.0, bending=False):
    """As `solve_identifiable`, from products of sensitivities in plausible sizes.

    Parameters
    ----------
    gram : ndarray (P, P)
    along : ndarray (P,)
    plausible, frozen, penalty, present, bending
        As in `solve_identifiable`.

    Returns
    -------
    step, covariance, held
        As in `solve_identifiable`.
    """
    gram = gram + np.diag(np.broadcast_to(penalty, len(plausible)) * plausible**2)
    along = along - plausible * np.broadcast_to(penalty * present, len(plausible))
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
