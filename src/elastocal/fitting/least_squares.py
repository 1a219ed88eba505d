"""Robust generalized least squares by Gauss-Newton steps on exact predictions.

`fit_model` fits a model to observations, `fit_robustly` is the iteration itself, and
`register_placement` computes where it starts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import gammaincinv

from elastocal.campaigns.campaign import NO_ROTATION
from elastocal.effects.conditions import select_conditions
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    Estimate,
    apply_step,
    evaluate_conditions,
    find_nonlinear_parameters,
    find_placement_parameters,
    get_parameter_bounds,
    get_parameter_values,
    list_parameters,
    place_in_session,
)
from elastocal.fitting.normal_equations import (
    LeastSquaresProblem,
    NormalSolution,
    ParameterScales,
    compute_whitening,
    solve_normal_equations,
)
from elastocal.fitting.observations import sample_observations, split_into_blocks
from elastocal.fitting.sensor_noise import compute_sensor_roots
from elastocal.measuring.catalogue import list_kinds
from elastocal.mechanics.kinematics import align_points, compute_point_poses

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Parameter
    from elastocal.fitting.model import Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.normal_equations import Whitening
    from elastocal.fitting.observations import Observations, States

# Upper bound on the rounds of registration, and the move of a target below which the
# registration has converged.
_MAX_REGISTRATION_ROUNDS = 200
_REGISTRATION_TOLERANCE_M = 1e-9
# Number of earlier rounds from which the next one is extrapolated. A target has three
# unknowns, so that more rounds than these tell little.
_REGISTRATION_MEMORY = 6
# Share of its prior variance above which a parameter counts as not identified: the prior
# says more of it than the measurements do, and its value is no reason for a warning.
IDENTIFIED_SHARE = 0.5
# Upper bound on the Gauss-Newton steps of a fit.
_MAX_STEPS = 30
# A fit that ends without the tolerance has converged all the same if its last step is
# below this many standard errors. Where the order of a wave is hardly determined, a step
# is 0.85 of the one before, and all further ones are less than a tenth of a standard
# error together.
_NEGLIGIBLE_STEP = 1e-2
# Upper bound on the halvings of a step. If a 64th of it does not lower the objective,
# the step points in a wrong direction or along a kink.
_MAX_HALVINGS = 6
# A fit has converged if its next step is below this many standard errors in every
# parameter. Intermediate models, from which other fits start, need no tight
# convergence.
CONVERGENCE_TOLERANCE = 1e-3
INTERMEDIATE_TOLERANCE = 0.1
# A fit to more observations than this starts from a fit to a sample of this size, which
# shows the size of some fifty parameters as well as any larger number.
START_SAMPLE_SIZE = 2_000
# A step with more observations than this takes seconds. Such a fit first converges on a
# sample of the second size, so that few steps use all observations.
LARGE_FIT_SIZE = 100_000
_INTERMEDIATE_SAMPLE_SIZE = 20_000
# If a step moves every parameter by less than this many standard errors and no shape at
# all, the next step uses the same Gram matrix. Standard errors computed with it are as
# accurate as the estimate is within `CONVERGENCE_TOLERANCE`.
_REUSE_THRESHOLD = 0.3
# Loads lag one step behind. Of a step, at most this share is still to come: the ratio of
# deflection to reach.
_LAG_SHARE = 1e-2
# Armijo's condition: share of the fall along the slope that a step must achieve. A
# parabola achieves one half.
_SUFFICIENT_DECREASE = 0.1
# Rounding of the objective, relative to it. In a fit of a thousand rows, moving one
# parameter by a thousandth of a standard error changes the objective by half of this.
_OBJECTIVE_ROUNDING = 1e-9
# Observations beyond this quantile of their distance lose weight.
_HUBER_QUANTILE = 0.99


@dataclass(frozen=True)
class Fit:
    """A model fitted to M observations, with P parameters.

    Attributes
    ----------
    model : Model
    estimate : Estimate
    noise : Noise
    unidentifiable : (P,) bool array
        Parameters that the data do not identify, which keep their values.
    covariance : (P, P) array
        Parameter covariance: inverse of the normal matrix of the last step, which
        approximates the Hessian (Gauss-Newton); with priors as in Laplace's
        approximation [1]_. Zero for unidentifiable parameters.
    weights : (M,) array
        Robust weight of each observation.
    whitening : Whitening
    residual : (M, rows) array
        Measured minus predicted, m and rad, base axes.
    joint_jacobian : (M, rows, n) array or None
        Of each target with respect to the joints; None if there are too many states to
        keep it in memory.
    conditions : Conditions or None
        Of the fitted states; None if there are too many to keep them in memory.
    converged : bool
        Whether the last step was within the tolerance in every parameter.
    beyond_bound : (P,) array or None
        How far the measurements would move each parameter beyond the bound of physics
        at which it stays; None if no bound binds.

    References
    ----------
    .. [1] Tierney and Kadane, J. Am. Stat. Assoc. 81, 1986.
    """

    model: Model
    estimate: Estimate
    noise: Noise
    unidentifiable: np.ndarray
    covariance: np.ndarray
    weights: np.ndarray
    whitening: Whitening
    residual: np.ndarray
    joint_jacobian: np.ndarray | None
    conditions: Conditions | None
    converged: bool = True
    beyond_bound: np.ndarray | None = None

    @property
    def parameters(self) -> list[tuple[str, Parameter]]:
        """Owner and parameter, as `model.list_parameters` returns them."""
        return list_parameters(self.model, self.estimate)

    @property
    def prior_std(self) -> np.ndarray:
        """Standard deviation of the prior of each parameter, infinite without a prior,
        (P,) array."""
        return np.array(
            [
                np.inf if parameter.prior_std is None else parameter.prior_std
                for _, parameter in self.parameters
            ]
        )

    @property
    def identified(self) -> np.ndarray:
        """Parameters of which the measurements say more than their priors, (P,) bool
        array: at most `IDENTIFIED_SHARE` of the prior variance is left."""
        variance = np.diag(self.covariance)
        return (variance > 0.0) & (variance < IDENTIFIED_SHARE * self.prior_std**2)

    def parameter_indices(self, owner: str) -> np.ndarray:
        """Indices of the parameters of one owner, such as the key of an effect."""
        return np.flatnonzero([name == owner for name, _ in self.parameters])

    def effect_values(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Linear parameters (D,) and shapes (F,) of one effect."""
        number = [effect.key for effect in self.model.effects].index(key)
        return self.estimate.coefficients[number], self.estimate.shapes[number]

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Weight and whiten rows (M, rows, ...) as in the fit."""
        root = np.sqrt(self.weights).reshape(-1, *[1] * (values.ndim - 1))
        return self.whitening.apply(values * root)

    def iterate_sensitivities(
        self, observations: Observations
    ) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Compute the sensitivities of the fitted observations, by blocks of poses.

        Yields
        ------
        indices : slice of the observations
        plain : (M', rows, P) array
        whitened : (M', rows, P) array, weighted and whitened
        """
        for block in split_into_blocks(observations, len(self.unidentifiable)):
            indices = block.indices
            whole = len(block.observations) == len(observations)
            conditions = self.get_conditions(
                block.observations.states, None if whole else block.states
            )
            linear_model = linearize(
                self.model, self.estimate, block.observations, conditions
            )
            if self.joint_jacobian is None:
                jacobian = linear_model.joint_jacobian
            else:
                jacobian = self.joint_jacobian[indices]
            roots = compute_sensor_roots(
                self.model, self.estimate, block.observations, self.noise
            )
            whitening = compute_whitening(
                block.observations, jacobian, self.noise, roots
            )
            plain = linear_model.sensitivities
            root = np.sqrt(self.weights[indices])[:, None, None]
            yield indices, plain, whitening.apply(plain * root)

    def get_conditions(self, states: States, chosen: slice | None = None) -> Conditions:
        """Conditions of the fitted states, or of a slice of them, which `states` are.

        They are recomputed if there were too many to keep them in memory.
        """
        if self.conditions is None:
            return evaluate_conditions(self.model, self.estimate, states)
        return (
            self.conditions
            if chosen is None
            else select_conditions(self.conditions, chosen)
        )


def fit_model(
    model: Model,
    observations: Observations,
    noise: Noise,
    start: Estimate | None = None,
    *,
    reweight_first_step: bool = False,
    tolerance: float = CONVERGENCE_TOLERANCE,
) -> Fit:
    """Fit a model by robust generalized least squares (Björck 1996).

    A fit to many observations starts from fits to samples of them.

    Parameters
    ----------
    model, observations, noise
    start : Estimate, optional
        Estimate of this model; by default `register_placement` computes it.
    reweight_first_step : bool
        Whether outliers lose weight in the first step already, as they should if
        `start` is the result of a fit.
    tolerance : float
        Largest remaining step, in standard errors.
    """
    sample_sizes = [] if reweight_first_step else [START_SAMPLE_SIZE]
    if len(observations) > LARGE_FIT_SIZE:
        sample_sizes = [*sample_sizes, _INTERMEDIATE_SAMPLE_SIZE]
    for size in sample_sizes:
        sample = sample_observations(observations, size)
        if len(sample) < len(observations):
            start = fit_model(
                model,
                sample,
                noise,
                start,
                reweight_first_step=reweight_first_step,
                tolerance=INTERMEDIATE_TOLERANCE,
            ).estimate
            reweight_first_step = True
    if start is None:
        start = register_placement(model, observations)
    options = IterationOptions(
        reweight_first_step=reweight_first_step, tolerance=tolerance
    )
    return fit_robustly(model, observations, noise, start, options)


def evaluate_as_fit(
    model: Model, observations: Observations, noise: Noise, estimate: Estimate
) -> Fit:
    """Evaluate an estimate as if it were fitted to observations.

    The estimate may come from elsewhere. All observations have weight one, whatever
    their distance.
    """
    frozen = np.ones(len(list_parameters(model, estimate)), bool)
    fitted = fit_robustly(
        model, observations, noise, estimate, IterationOptions(frozen=frozen)
    )
    return replace(fitted, weights=np.ones(len(observations)))


def fit_placement(fitted: Fit, model: Model, observations: Observations) -> Estimate:
    """Fit frames and targets of other observations and keep all effects of a fit.

    `model` has the effects of the fit and the targets of these observations.
    """
    start = replace(
        register_placement(model, observations),
        coefficients=fitted.estimate.coefficients,
        shapes=fitted.estimate.shapes,
    )
    owners = [owner for owner, _ in list_parameters(model, start)]
    options = IterationOptions(frozen=~find_placement_parameters(owners))
    return fit_robustly(model, observations, fitted.noise, start, options).estimate


@dataclass(frozen=True)
class IterationOptions:
    """Options of `fit_robustly`.

    Attributes
    ----------
    frozen : (P,) bool array, optional
        Parameters that must not move; none by default.
    reweight_first_step, tolerance
        As in `fit_model`.
    """

    frozen: np.ndarray | None = None
    reweight_first_step: bool = False
    tolerance: float = CONVERGENCE_TOLERANCE


def fit_robustly(
    model: Model,
    observations: Observations,
    noise: Noise,
    start: Estimate,
    options: IterationOptions,
) -> Fit:
    """Iterate reweighted least squares with Huber's weights and Gauss-Newton steps [1]_.

    If errors are independent, the weighted squares are an upper bound of Huber's
    objective that touches it at the present estimate ([2]_, 7.8), so it falls with
    them. If measurements have errors in common, there is no such bound: weights come
    before whitening, because whitening would spread an outlier over the correlated
    measurements, and the estimate solves the weighted equations [3]_. Each step is
    backtracked, see `ArmijoLineSearch`. The first step gives all observations one
    weight, unless the options say otherwise.

    References
    ----------
    .. [1] Holland and Welsch, Robust regression using iteratively reweighted
       least-squares, Communications in Statistics A6, 1977.
    .. [2] Huber and Ronchetti, Robust Statistics.
    .. [3] Preisser and Qaqish, Biometrics 55, 1999.
    """
    traits = ParameterTraits.of(model, start, options.frozen)
    problem = LeastSquaresProblem(
        model, observations, noise, start, traits.scales.plausible
    )
    problem.linearize(start)
    iterate = Iterate(start, np.zeros(len(traits.bounds)))
    huber = HuberWeights(np.ones(len(observations)), 1.0)
    converged = False
    for number in range(_MAX_STEPS):
        # Loads are evaluated at the deflected pose of the previous step; they converge
        # to their fixed point together with the parameters.
        problem.whiten()
        reweighted = number > 0 or options.reweight_first_step
        if reweighted:
            huber = HuberWeights.from_distance(problem.distance(), observations.rows)
        step = GaussNewtonStep.compute(problem, traits, huber, iterate)
        converged = reweighted and step.is_within(options.tolerance)
        if converged:
            iterate = replace(
                iterate, estimate=apply_step(model, iterate.estimate, step.step)
            )
            break
        line_search = ArmijoLineSearch(problem, traits, huber.weights, step)
        accepted = line_search.search()
        if accepted is None and iterate.stalled:
            break
        iterate = iterate.advance(step, accepted, reweighted=reweighted)
    converged = converged or (reweighted and step.is_within(_NEGLIGIBLE_STEP))
    final = problem.finish(iterate.estimate)
    return Fit(
        model,
        iterate.estimate,
        noise,
        step.solution.unidentifiable,
        step.solution.covariance,
        huber.weights,
        final.whitening,
        final.residual,
        final.joint_jacobian,
        final.conditions,
        converged,
        step.solution.beyond_bound,
    )


@dataclass(frozen=True)
class ParameterTraits:
    """What a step must respect in the P parameters of a model.

    Attributes
    ----------
    scales : ParameterScales
    bounds : (P, 2) array, lowest and highest values
    load_coupled : (P,) bool array
        Parameters of effects that load the robot or depend on its loads. Given these
        and the shapes, the residual is nearly linear in all other parameters.
    frozen : (P,) bool array, parameters that must not move
    damped : (P,) bool array, see `_find_damped_parameters`
    """

    scales: ParameterScales
    bounds: np.ndarray
    load_coupled: np.ndarray
    frozen: np.ndarray
    damped: np.ndarray

    @classmethod
    def of(
        cls, model: Model, estimate: Estimate, frozen: np.ndarray | None
    ) -> ParameterTraits:
        """Collect the traits of the parameters of a model; by default none is frozen."""
        parameters = list_parameters(model, estimate)
        damped = _find_damped_parameters(model, parameters)
        plausible = get_plausible_sizes(model, estimate)
        penalty = [
            0.0 if parameter.prior_std is None else parameter.prior_std**-2
            for _, parameter in parameters
        ]
        coupled_effects = {
            effect.key
            for effect in model.effects
            if effect.effect == "joint_compliance" or "load" in effect.needs
        }
        scales = ParameterScales(
            plausible,
            np.where(damped, plausible**-2, penalty),
            find_nonlinear_parameters(model, estimate),
        )
        return cls(
            scales,
            get_parameter_bounds(model, estimate),
            np.array([owner in coupled_effects for owner, _ in parameters], bool),
            np.zeros(len(parameters), bool) if frozen is None else frozen,
            damped,
        )

    def solve(
        self,
        gram: np.ndarray,
        gradient: np.ndarray,
        present: np.ndarray,
        frozen: np.ndarray,
    ) -> NormalSolution:
        """Solve the normal equations within the bounds of the parameters.

        Parameters that would leave their ranges stay at the nearer bounds (active set
        [1]_), and the others move as they must given that. A step starts from an empty
        set, so that bounds which no longer bind are released.

        References
        ----------
        .. [1] Björck, Numerical Methods for Least Squares Problems, 5.2, SIAM, 1996.
        """
        solution = solve_normal_equations(gram, gradient, self.scales, present, frozen)
        target = present + solution.step
        beyond_bound = target - np.clip(target, *self.bounds.T)
        beyond_bound[frozen] = 0.0
        if not beyond_bound.any():
            return solution
        active = np.zeros(len(target), bool)
        fixed = frozen | solution.unidentifiable
        step = solution.step
        # Each round adds a parameter to the set, so there are no more rounds than these.
        while (out := self.find_out_of_range(present + step, active | fixed)).any():
            active |= out
            step_to_bound = np.clip(present + step, *self.bounds.T)[active]
            step_to_bound -= present[active]
            scaled = step_to_bound / self.scales.plausible[active]
            step = solve_normal_equations(
                gram,
                gradient - gram[:, active] @ scaled,
                self.scales,
                present,
                fixed | active,
            ).step
            step[active] = step_to_bound
        return replace(solution, step=step, beyond_bound=beyond_bound)

    def find_out_of_range(self, values: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        """Find the values (P,) out of their ranges, without those of fixed parameters."""
        lowest, highest = self.bounds.T
        return ~fixed & ((values < lowest) | (values > highest))


@dataclass(frozen=True)
class HuberWeights:
    """Huber's weights (M,) of observations, and the scale of their whitened residuals.

    The scale is how many times larger the errors are than the noise says, at least 1.
    """

    weights: np.ndarray
    scale: float

    @classmethod
    def from_distance(cls, distance: np.ndarray, rows: int) -> HuberWeights:
        """Weight observations by their whitened distance (M,) from the prediction.

        The squared distance, times `rows`, has a chi-squared distribution with as many
        degrees of freedom.
        """
        huber_threshold, median_distance = np.sqrt(
            2 * gammaincinv(rows / 2, [_HUBER_QUANTILE, 0.5]) / rows
        )
        scale = max(np.median(distance) / median_distance, 1.0)
        return cls(
            huber_threshold / np.maximum(distance / scale, huber_threshold), scale
        )


@dataclass(frozen=True)
class Iterate:
    """Where the iteration stands between two steps.

    Attributes
    ----------
    estimate : Estimate
    last_step : (P,) array, previous step, in plausible sizes
    reused : GaussNewtonStep or None
        The previous step if the next one is to use its Gram matrix and covariance.
    stalled : bool
        Whether the previous step did not lower the objective.
    """

    estimate: Estimate
    last_step: np.ndarray
    reused: GaussNewtonStep | None = None
    stalled: bool = False

    def advance(
        self,
        step: GaussNewtonStep,
        accepted: AcceptedStep | None,
        *,
        reweighted: bool,
    ) -> Iterate:
        """Move to the estimate that the line search accepted.

        Without one the estimate stays, and one more step is tried: the failed one used
        the loads of the step before and perhaps equal weights, the next one uses the
        current ones.
        """
        if accepted is None:
            return Iterate(self.estimate, step.scaled, stalled=True)
        reusable = reweighted and accepted.halvings == 0 and step.is_short()
        return Iterate(
            accepted.estimate, step.scaled, reused=step if reusable else None
        )


@dataclass(frozen=True)
class GaussNewtonStep:
    """A Gauss-Newton step from an iterate.

    Attributes
    ----------
    traits : ParameterTraits
    iterate : Iterate from which the step is taken
    scale : float, see `HuberWeights`
    gram : (P, P) array, in plausible sizes, without priors
    gradient : (P,) array, in plausible sizes, without priors
    present : (P,) array, values of the parameters
    solution : NormalSolution
    """

    traits: ParameterTraits
    iterate: Iterate
    scale: float
    gram: np.ndarray
    gradient: np.ndarray
    present: np.ndarray
    solution: NormalSolution

    @classmethod
    def compute(
        cls,
        problem: LeastSquaresProblem,
        traits: ParameterTraits,
        huber: HuberWeights,
        iterate: Iterate,
    ) -> GaussNewtonStep:
        """Solve the normal equations, with the Gram matrix of the last step if it is
        reused."""
        reused = iterate.reused
        present = get_parameter_values(problem.model, iterate.estimate)
        gram, gradient = problem.normal_equations(
            huber.weights, None if reused is None else reused.gram
        )
        if reused is None:
            solution = traits.solve(gram, gradient, present, traits.frozen)
        else:
            scales = traits.scales
            gradient_with_prior = gradient / scales.plausible - scales.penalty * present
            solution = replace(
                reused.solution, step=reused.solution.covariance @ gradient_with_prior
            )
            leaves = traits.find_out_of_range(
                present + solution.step, reused.solution.unidentifiable
            )
            if leaves.any():
                solution = traits.solve(gram, gradient, present, traits.frozen)
        return cls(traits, iterate, huber.scale, gram, gradient, present, solution)

    @property
    def step(self) -> np.ndarray:
        """The step (P,) of the parameters."""
        return self.solution.step

    @property
    def scaled(self) -> np.ndarray:
        """The step (P,) in plausible sizes."""
        return self.step / self.traits.scales.plausible

    def is_within(self, tolerance: float) -> bool:
        """Whether the step is below so many standard errors in every parameter.

        Standard errors are those of the actual errors, which the noise may
        underestimate. A small step under the loads before a large step says nothing
        about what these loads still change, so a share of the last step counts too.
        """
        traits = self.traits
        still_to_come = (
            _LAG_SHARE
            * np.abs(self.iterate.last_step)
            * traits.scales.plausible
            * traits.load_coupled
        )
        size = np.maximum(np.abs(self.step), still_to_come)
        return bool((size <= self._standard_errors(tolerance)).all())

    def is_short(self) -> bool:
        """Whether the Gram matrix is still valid after the step: see
        `_REUSE_THRESHOLD`."""
        if self.solution.beyond_bound is not None:
            return False
        # The line about which a base can turn freely moves with each step.
        if self.traits.damped.any():
            return False
        moving_shapes = self.traits.scales.nonlinear & ~self.solution.unidentifiable
        limit = np.where(moving_shapes, 0.0, self._standard_errors(_REUSE_THRESHOLD))
        return bool((np.abs(self.step) <= limit).all())

    def _standard_errors(self, count: float) -> np.ndarray:
        """So many standard errors (P,), no limit for parameters that do not move."""
        deviation = np.sqrt(np.diag(self.solution.covariance))
        return count * (self.scale * deviation) + (deviation == 0)

    def takes_back_last(self) -> bool:
        """Whether the step takes back more than half of the last one."""
        scales = self.traits.scales
        last = self.iterate.last_step
        gram = self.gram + np.diag(scales.penalty * scales.plausible**2)
        return bool(gram @ (self.scaled + last / 2) @ last < 0)

    def slope(self) -> float:
        """Twice the fall of the objective that a parabola predicts for the step."""
        prior_slope = self.traits.scales.penalty @ (self.present * self.step)
        return float(self.gradient @ self.scaled - prior_slope)


@dataclass(frozen=True)
class AcceptedStep:
    """Estimate after a step that was halved so many times."""

    estimate: Estimate
    halvings: int


@dataclass(frozen=True)
class ArmijoLineSearch:
    """Backtracking of a step until weighted squares and priors fall enough [1]_.

    Against curvature, a step is halved until the objective meets Armijo's condition. If
    the first trial does not, the parameters in which the residual is linear, given
    shapes and loads, are solved for again there, as in variable projection [2]_. This
    is the acceleration with which a path follows a curved valley [3]_; halved steps
    follow it.

    Attributes
    ----------
    problem : LeastSquaresProblem, linearized at the iterate
    traits : ParameterTraits
    weights : (M,) array
    step : GaussNewtonStep

    References
    ----------
    .. [1] Nocedal and Wright, Numerical Optimization, 3.1.
    .. [2] Golub and Pereyra, 1973.
    .. [3] Transtrum and Sethna, arXiv 1201.5885.
    """

    problem: LeastSquaresProblem
    traits: ParameterTraits
    weights: np.ndarray
    step: GaussNewtonStep

    def search(self) -> AcceptedStep | None:
        """Find the longest step that lowers the objective enough; None without one.

        The problem is linearized at the accepted estimate, or at the origin again.
        """
        origin = self.step.iterate.estimate
        slope = self.step.slope()
        objective = self._objective(origin, self.problem.squares(self.weights))
        acceleration = np.zeros(len(self.step.step))
        # Weights and whitening follow the estimate. If they throw it to and fro, half
        # of the step is better: relaxation of a fixed-point iteration.
        first = int(self.step.takes_back_last())
        for halvings in range(first, _MAX_HALVINGS + 1):
            share = 0.5**halvings
            decrease = _SUFFICIENT_DECREASE * share * slope
            decrease -= _OBJECTIVE_ROUNDING * max(objective, 1.0)
            estimate, after = self._try_step(share, acceleration)
            if after > objective - decrease and halvings == first:
                # The previous objective used the loads of the previous step, so
                # evaluate it again with the current loads.
                squares = self.problem.squares(self.weights, origin)
                objective = self._objective(origin, squares)
                if after > objective - decrease and self._can_accelerate():
                    correction = self._solve_linear_parameters(estimate)
                    acceleration = correction / share**2
                    estimate, after = self._try_step(share, acceleration)
            if after <= objective - decrease:
                return AcceptedStep(estimate, halvings)
        self.problem.linearize(origin)
        return None

    def _try_step(
        self, share: float, acceleration: np.ndarray
    ) -> tuple[Estimate, float]:
        """Linearize after a share of the step; return estimate and objective there."""
        step = share * self.step.step + share**2 * acceleration
        estimate = apply_step(self.problem.model, self.step.iterate.estimate, step)
        self.problem.linearize(estimate)
        squares = self.problem.squares(self.weights)
        return estimate, self._objective(estimate, squares)

    def _objective(self, estimate: Estimate, squares: float) -> float:
        """Half the weighted squares of the residual and of parameters with a prior."""
        values = get_parameter_values(self.problem.model, estimate)
        return 0.5 * (squares + self.traits.scales.penalty @ values**2)

    def _can_accelerate(self) -> bool:
        """Whether some parameters bend the path, and conditions stay in memory."""
        return self.problem.in_memory and bool(self._curving().any())

    def _curving(self) -> np.ndarray:
        """Parameters (P,) in which the residual is not linear."""
        return self.traits.scales.nonlinear | self.traits.load_coupled

    def _solve_linear_parameters(self, estimate: Estimate) -> np.ndarray:
        """Step (P,) of the linear parameters at an estimate, given all others."""
        gram, gradient = self.problem.normal_equations(self.weights)
        present = get_parameter_values(self.problem.model, estimate)
        frozen = self.traits.frozen | self._curving()
        return self.traits.solve(gram, gradient, present, frozen).step


def _find_damped_parameters(
    model: Model, parameters: Sequence[tuple[str, Parameter]]
) -> np.ndarray:
    """Find the components of frames of which contacts may leave a turn open, (P,) bool.

    Two sockets do not show a turn about the line through them. So such a frame has a
    penalty of its plausible size. It is at zero before each step, so that this damping,
    Levenberg's, changes no result [1]_.

    References
    ----------
    .. [1] Levenberg, A method for the solution of certain non-linear problems in least
       squares, Quarterly of Applied Mathematics 2, 1944.
    """
    is_free_frame = [
        owner.startswith("frame ") and parameter.prior_std is None
        for owner, parameter in parameters
    ]
    return np.array(is_free_frame, bool) & model.has_contact_vectors


def compute_negative_compliances(fitted: Fit) -> np.ndarray:
    """Compute by how many standard errors each joint compliance would be negative if
    physics did not keep it at zero, (n,) array; zero for compliances above zero.

    A compliance whose prior says more than the measurements is never negative.
    """
    indices = fitted.parameter_indices("joint_compliance")
    if fitted.beyond_bound is None:
        return np.zeros(len(indices))
    std_error = np.sqrt(np.diag(fitted.covariance))[indices]
    return np.where(
        fitted.identified[indices],
        -fitted.beyond_bound[indices] / np.maximum(std_error, np.finfo(float).tiny),
        0.0,
    )


def get_plausible_sizes(model: Model, estimate: Estimate) -> np.ndarray:
    """Sizes (P,) of the parameters; a larger standard error means no identification.

    A parameter with a prior is never unidentifiable: its prior identifies it if the
    data do not. Nor is a parameter that the start has found larger than plausible.
    Otherwise it would keep this value, without a standard error, once the noise turns
    out to be larger.
    """
    plausible = np.array(
        [
            max(parameter.plausible, parameter.prior_std or 0.0)
            for _, parameter in list_parameters(model, estimate)
        ]
    )
    linear = ~find_nonlinear_parameters(model, estimate)
    return np.maximum(plausible, linear * np.abs(get_parameter_values(model, estimate)))


def register_placement(model: Model, observations: Observations) -> Estimate:
    """Compute the frames and targets that the nominal kinematics explain best.

    Block coordinate descent in closed form: frames by the Kabsch algorithm [1]_ for
    Wahba's problem, given the targets; positions of targets as means, given the frames.
    The rotation of a target is the chordal mean of rotations [2]_.

    Returns an estimate with all effects at zero, except that joint compliances have
    their nominal values.

    References
    ----------
    .. [1] Kabsch, Acta Cryst. A32, 1976.
    .. [2] Markley et al., J. Guidance 30, 2007.
    """
    observations = sample_observations(observations, START_SAMPLE_SIZE)
    nominal = compute_nominal_poses(model, observations)
    if model.measuring is not None:
        return start_features(model, observations, *nominal)
    return register_to_poses(model, observations, *nominal)


def start_features(
    model: Model,
    observations: Observations,
    nominal_position: np.ndarray,
    nominal_rotation: np.ndarray,
) -> Estimate:
    """Find frames, targets and features from which a fit converges.

    Frames and targets come from the rows whose positions in the frame of the session are
    known: poses of targets, and features whose places are stated. A feature starts from
    the nominal positions of its targets.

    Parameters
    ----------
    model : Model with a measuring plan
    observations : M observations
    nominal_position, nominal_rotation : (M, 3) and (M, 3, 3) arrays, base axes
    """
    sessions = np.unique(observations.states.session)
    estimate = _place_at_base(model, sessions)
    is_located, position = _find_known_positions(model, observations)
    if is_located.any():
        located = replace(
            observations,
            state=observations.state[is_located],
            target=observations.target[is_located],
            position=position[is_located],
            channel=None,
            spread=None,
            rotation=None,
        )
        estimate = _register_located(
            model,
            estimate,
            located,
            (nominal_position[is_located], nominal_rotation[is_located]),
        )
    targets = nominal_position + np.einsum(
        "mij,mj->mi", nominal_rotation, estimate.target_offset[observations.target]
    )
    in_session = place_in_session(estimate, observations, targets, nominal_rotation)
    return replace(
        estimate.with_effects(model.effects),
        coefficients=model.nominal_coefficients,
        features=_start_from_targets(model, observations, in_session.position),
    )


def _start_from_targets(
    model: Model, observations: Observations, position: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Start each feature from the positions (M, 3), m, of its targets in the session.

    A feature that none of these observations touches starts from all of them, because
    no residual depends on it.
    """
    plan = model.measuring
    assert plan is not None
    assert observations.channel is not None
    feature_of_channel = np.array(
        [
            -1 if channel.feature is None else channel.feature
            for channel in plan.channels
        ]
    )
    feature_of_row = feature_of_channel[observations.channel]
    features = []
    for index, feature in enumerate(plan.features):
        rows = feature_of_row == index
        if not rows.any():
            rows = np.ones(len(rows), bool)
        kind = list_kinds()[feature.kind]
        features.append(
            kind.start(feature, position[rows], observations.position[rows])
        )
    return tuple(features)


def _place_at_base(model: Model, sessions: np.ndarray) -> Estimate:
    """Make an estimate with all sessions in base axes.

    Targets are at their declared offsets, or on their measuring points if the offset is
    unknown.
    """
    count = len(sessions)
    rotations = [target.rotation or NO_ROTATION for target in model.targets]
    offsets = [target.offset_m or (0.0, 0.0, 0.0) for target in model.targets]
    return Estimate(
        tuple(sessions.tolist()),
        np.tile(np.eye(3), (count, 1, 1)),
        np.zeros((count, 3)),
        np.array(offsets, float),
        Rotation.from_rotvec(rotations).as_matrix(),
    )


def _register_located(
    model: Model,
    start: Estimate,
    located: Observations,
    nominal: tuple[np.ndarray, np.ndarray],
) -> Estimate:
    """Register sessions by their observations with known positions.

    Parameters
    ----------
    model : Model
    start : estimate whose frames remain in sessions without such observations
    located : L observations, whose positions are those of their targets in the session
    nominal : positions (L, 3) and rotations (L, 3, 3), as `compute_nominal_poses`
    """
    registered = register_to_poses(
        replace(model, rows=3, measuring=None, effects=()), located, *nominal
    )
    is_registered = np.isin(start.sessions, located.states.session[located.state])
    return replace(
        start,
        frame_rotation=np.where(
            is_registered[:, None, None],
            registered.frame_rotation,
            start.frame_rotation,
        ),
        frame_position=np.where(
            is_registered[:, None], registered.frame_position, start.frame_position
        ),
        target_offset=registered.target_offset,
    )


def _find_known_positions(
    model: Model, observations: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """Find the observations whose target has a known position in the session.

    Returns
    -------
    is_located : (M,) bool array
    position : (M, 3) array, m, zero for the other observations
    """
    plan = model.measuring
    assert plan is not None
    assert observations.channel is not None
    is_located = np.zeros(len(observations), bool)
    position = np.zeros((len(observations), 3))
    for number, channel in enumerate(plan.channels):
        rows = observations.channel == number
        if channel.feature is not None:
            stated = channel.kind.locate(plan.features[channel.feature])
            if stated is not None and channel.component in (None, 0):
                is_located |= rows
                position[rows] = stated
        elif channel.component is None:
            is_located |= rows
            position[rows] = observations.position[rows]
    return is_located, position


def compute_nominal_poses(
    model: Model, observations: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """Compute poses of the measuring points on the nominal robot without loads.

    Returns positions (M, 3) and rotations (M, 3, 3) in base axes.
    """
    chain = model.sites.chain
    points = [chain.point(target.point) for target in model.targets]
    position, rotation = compute_point_poses(
        chain, chain.at(observations.states.joint_angles), points
    )
    indices = (observations.target, observations.state)
    return position[indices], rotation[indices]


def register_to_poses(
    model: Model,
    observations: Observations,
    nominal_position: np.ndarray,
    nominal_rotation: np.ndarray,
) -> Estimate:
    """Compute frames and targets as `register_placement`, for given nominal poses.

    Nominal poses (M, 3), (M, 3, 3) are as `compute_nominal_poses` returns them.
    """
    sessions = np.unique(observations.states.session)
    session = np.searchsorted(sessions, observations.states.session[observations.state])
    target = observations.target
    unknown_targets = [
        index for index in np.unique(target) if model.targets[index].offset_m is None
    ]
    offsets = np.array(
        [target.offset_m or (0.0, 0.0, 0.0) for target in model.targets], float
    )
    rotation = np.tile(np.eye(3), (len(sessions), 1, 1))
    position = np.zeros((len(sessions), 3))
    rounds: list[tuple[np.ndarray, np.ndarray]] = []
    is_alternating = model.fitted_frames and unknown_targets
    for _ in range(_MAX_REGISTRATION_ROUNDS if is_alternating else 1):
        if model.fitted_frames:
            points = nominal_position + np.einsum(
                "mij,mj->mi", nominal_rotation, offsets[target]
            )
            for number in range(len(sessions)):
                members = session == number
                rotation[number], position[number] = align_points(
                    points[members], observations.position[members]
                )
        in_base = _rotate_back(
            rotation[session], observations.position - position[session]
        )
        previous = offsets.copy()
        on_point = _rotate_back(nominal_rotation, in_base - nominal_position)
        for index in unknown_targets:
            offsets[index] = on_point[target == index].mean(axis=0)
        if np.abs(offsets - previous).max() < _REGISTRATION_TOLERANCE_M:
            break
        rounds = [*rounds[-_REGISTRATION_MEMORY:], (previous, offsets)]
        offsets = _extrapolate_fixed_point(rounds)
    placement = Estimate(
        tuple(sessions.tolist()),
        rotation,
        position,
        offsets,
        _average_target_rotations(
            model, observations, nominal_rotation, rotation[session]
        ),
    )
    return replace(
        placement.with_effects(model.effects), coefficients=model.nominal_coefficients
    )


def _rotate_back(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (M, 3) in the axes that rotations (M, 3, 3) turn into base axes."""
    return np.einsum("mji,mj->mi", rotation, vectors)


def _extrapolate_fixed_point(
    rounds: list[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """Next argument of a fixed-point iteration by Anderson's method [1]_.

    Of the affine combinations of the last arguments it takes the one whose change would
    be smallest if the function were linear. The alternation of frames and offsets is
    close to linear, and alone it converges slowly where the measurements hardly tell
    one from the other.

    Parameters
    ----------
    rounds : arguments and values of the function, arrays of equal shape, oldest first

    References
    ----------
    .. [1] Walker and Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer.
       Anal. 49, 2011.
    """
    values = np.array([value.ravel() for _, value in rounds])
    arguments = np.array([argument.ravel() for argument, _ in rounds])
    changes = values - arguments
    weights = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1], rcond=None)[0]
    extrapolated = values[-1] - np.diff(values, axis=0).T @ weights
    return extrapolated.reshape(rounds[-1][1].shape)


def _average_target_rotations(
    model: Model,
    observations: Observations,
    nominal_rotation: np.ndarray,
    frame_rotation: np.ndarray,
) -> np.ndarray:
    """Rotations (T, 3, 3) of the targets on their measuring points.

    `nominal_rotation` and `frame_rotation` (M, 3, 3) are those of the measuring points
    and of the base in the frame of the session.
    """
    rotations = Rotation.from_rotvec(
        [target.rotation or NO_ROTATION for target in model.targets]
    ).as_matrix()
    if observations.rotation is not None:
        into_base = frame_rotation.transpose(0, 2, 1)
        local = nominal_rotation.transpose(0, 2, 1) @ into_base @ observations.rotation
        for index in np.unique(observations.target):
            if model.targets[index].rotation is None:
                members = Rotation.from_matrix(local[observations.target == index])
                rotations[index] = members.mean().as_matrix()
    return rotations
