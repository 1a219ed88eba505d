"""Robust generalized least squares on the composite model, by Gauss-Newton steps on
exact predictions; and what it finds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import gammaincinv

from elastocal.campaigns.campaign import NO_ROTATION
from elastocal.effects.conditions import at_states
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
)
from elastocal.fitting.normal_equations import (
    LeastSquaresProblem,
    compute_whitening,
    solve_normal_equations,
)
from elastocal.fitting.observations import sample_observations, split_into_blocks
from elastocal.mechanics.kinematics import poses_of_points

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Parameter
    from elastocal.fitting.model import Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.normal_equations import Whitening
    from elastocal.fitting.observations import Observations, States

    Solved = tuple[np.ndarray, np.ndarray, np.ndarray]

# Rounds by which frames and targets are registered at most, and the move that ends
# them.
_ROUNDS = 200
_SETTLED_M = 1e-9
_STEPS = 30
# A step that does not help is halved so often at most: one of a 64th that does not help
# points the wrong way, or along a kink.
_HALVINGS = 6
# Largest step that remains, in standard errors: in a fit, and in one from which others
# start.
CONVERGENCE_TOLERANCE = 1e-3
INTERMEDIATE_TOLERANCE = 0.1
# A fit to more observations that does not come of a fit starts from the fit to so many
# of them: they show the size of some fifty parameters as well as any number.
START_SAMPLE_SIZE = 2_000
# Standard errors: a step that moves no parameter farther, and no shape, leaves its Gram
# matrix to the next one: standard errors by it are as sure as an estimate is within
# `SETTLED`.
_NEAR = 0.3
# A step by all of so many observations takes seconds: the last of some that a fit to
# all takes follow a fit to so many.
LARGE_FIT_SIZE = 100_000
_STEPPING_STONE = 20_000
# Loads are those of the step before: of a step so much is still to come, at most, by
# deflection over reach.
_LAGGING = 1e-2
# Share of the slope by which a step must lower the objective (Armijo); a parabola gives
# a half.
_LEAST_FALL = 0.1
# Of the objective. In a fit of a thousand rows a thousandth of a standard error in one
# parameter makes half of that.
_ROUNDING = 1e-9
# Observations beyond this quantile of their distance lose weight.
_HUBER_QUANTILE = 0.99


@dataclass(frozen=True)
class Fit:
    """A model fitted to observations.

    `unidentifiable` (P,) of bool: parameters that are not identifiable from the data.
    `covariance` (P, P): of the parameters: inverse of the normal matrix of the last
    step, which approximates the Hessian (Gauss-Newton); with priors as in Laplace's
    approximation (Tierney and Kadane, J. Am. Stat. Assoc. 81, 1986). Zero where held.
    `weights` (M,): robust weight of each observation. `residual` (M, rows): m and rad,
    base axes. `joint_jacobian` (M, rows, n): of each target with respect to the joints;
    None where there are too many to keep it. `conditions`: of the states fitted; None
    where these are too many to keep it. `converged`: whether the last step was as small
    as was asked for, in standard errors, in every parameter.
    """

    model: Model
    estimate: Estimate
    noise: Noise
    unidentifiable: np.ndarray
    covariance: np.ndarray
    weights: np.ndarray
    whitener: Whitening
    residual: np.ndarray
    joint_jacobian: np.ndarray | None
    conditions: Conditions | None
    converged: bool = True

    @property
    def parameters(self) -> list[tuple[str, Parameter]]:
        """As `model.list_parameters`."""
        return list_parameters(self.model, self.estimate)

    @property
    def prior_std(self) -> np.ndarray:
        """Standard deviation of the prior of each of the parameters, infinite where it
        has none, ndarray (P,)."""
        return np.array(
            [
                np.inf if parameter.prior_std is None else parameter.prior_std
                for _, parameter in self.parameters
            ]
        )

    def parameter_indices(self, owner: str) -> np.ndarray:
        """Places among the parameters of those that belong to one owner, such as the
        key of an effect; ndarray of int."""
        return np.flatnonzero([each == owner for each, _ in self.parameters])

    def effect_values(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Linear parameters (D,) and shapes (F,) of one effect."""
        number = [effect.key for effect in self.model.effects].index(key)
        return self.estimate.coefficients[number], self.estimate.shapes[number]

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Rows (M, rows, ...) weighted and whitened as in the fit."""
        return self.whitener.apply(
            values * np.sqrt(self.weights).reshape(-1, *[1] * (values.ndim - 1))
        )

    def iterate_sensitivities(
        self, observations: Observations
    ) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Sensitivities of the observations that were fitted, as they are and whitened,
        in parts of whole poses.

        Yields `seen`: observations of the part; `plain`, `whitened` (M', rows, P).
        """
        for states, seen, part in split_into_blocks(
            observations, len(self.unidentifiable)
        ):
            around = self.get_conditions(
                part.states, states if len(part) < len(observations) else None
            )
            line = linearize(self.model, self.estimate, part, around)
            jacobian = (
                line.joint_jacobian
                if self.joint_jacobian is None
                else self.joint_jacobian[seen]
            )
            white = compute_whitening(part, jacobian, self.noise)
            yield (
                seen,
                line.sensitivities,
                white.apply(
                    line.sensitivities * np.sqrt(self.weights[seen])[:, None, None]
                ),
            )

    def get_conditions(self, states: States, chosen: slice | None = None) -> Conditions:
        """Conditions of the states, or of those chosen: as they were kept, or found
        again where they were too many."""
        if self.conditions is None:
            return evaluate_conditions(self.model, self.estimate, states)
        return self.conditions if chosen is None else at_states(self.conditions, chosen)


def fit_model(
    model: Model,
    observations: Observations,
    noise: Noise,
    start: Estimate | None = None,
    reweight_first_step: bool = False,
    tolerance: float = CONVERGENCE_TOLERANCE,
) -> Fit:
    """Fit a model by robust generalized least squares and Gauss-Newton steps (Björck
    1996), see `robustly`.

    `start`: of this model; by `registered` without. `reweight_first_step`: whether the start
    comes of a fit: outliers lose weight from the first step on. `tolerance`: largest step
    that remains, in standard errors.
    """
    for most in ([] if reweight_first_step else [START_SAMPLE_SIZE]) + (
        [_STEPPING_STONE] if len(observations) > LARGE_FIT_SIZE else []
    ):
        few = sample_observations(observations, most)
        if len(few) < len(observations):
            # Where all the measurements lead is close to where some of them do.
            start = fit_model(
                model, few, noise, start, reweight_first_step, INTERMEDIATE_TOLERANCE
            ).estimate
            reweight_first_step = True
    start = register_placement(model, observations) if start is None else start
    return fit_robustly(
        model,
        observations,
        noise,
        start,
        reweight_first_step=reweight_first_step,
        tolerance=tolerance,
    )


def evaluate_as_fit(
    model: Model, observations: Observations, noise: Noise, estimate: Estimate
) -> Fit:
    """An estimate as a fit to observations that it need not come of; they have weight
    one, whatever their distance."""
    return replace(
        fit_robustly(model, observations, noise, estimate, frozen=True),
        weights=np.ones(len(observations)),
    )


def fit_placement(fitted: Fit, model: Model, observations: Observations) -> Estimate:
    """Fit frames and targets of other observations; everything else stays as it was
    found.

    `model`: the same effects with the targets of these observations.
    """
    found = fitted.estimate
    start = replace(
        register_placement(model, observations),
        coefficients=found.coefficients,
        shapes=found.shapes,
    )
    frozen = ~find_placement_parameters(
        owner for owner, _ in list_parameters(model, start)
    )
    return fit_robustly(model, observations, fitted.noise, start, frozen).estimate


def fit_robustly(
    model: Model,
    observations: Observations,
    noise: Noise,
    estimate: Estimate,
    frozen: bool | np.ndarray = False,
    reweight_first_step: bool = False,
    tolerance: float = CONVERGENCE_TOLERANCE,
) -> Fit:
    """Iteratively reweighted least squares with Huber's weights [1] by Gauss-Newton
    steps, each halved until it helps enough.

    Where errors are independent, weighted squares are a bound of Huber's objective that
    touches it at the present estimate (Huber and Ronchetti, Robust Statistics, 7.8), so
    that it falls with them. Where measurements have errors in common there is none:
    weights come before whitening, which would carry an outlier into the measurements
    beside it, and the estimate solves the weighted equations (Preisser and Qaqish,
    Biometrics 55, 1999). A whitening belongs to the axes in which a step begins:
    residuals after the step are turned into these, or a fit would turn frame and robot
    together on and on. Against curvature a step is backtracked until weighted squares
    and priors fall by Armijo's condition (Nocedal and Wright, Numerical Optimization,
    3.1). Where that hinders the first trial, what is linear given the laws that other
    parameters load, and given their shapes, is solved for again there, as in variable
    projection (Golub and Pereyra 1973): that is the acceleration by which a path
    follows a bent valley (Transtrum and Sethna, arXiv 1201.5885), in which steps are
    then halved. The first step gives all observations one weight, unless the start
    comes of reweighted steps already.

    `estimate`: from which the first step is taken. `frozen` (P,) of bool: parameters
    not to move. `reweight_first_step`, `tolerance`: as in `fit`.

    [1] Holland, P. W. and Welsch, R. E., Robust regression using iteratively reweighted least-squares, Communications in
        Statistics A6, 1977.
    """
    rows = observations.rows
    listed = [parameter for _, parameter in list_parameters(model, estimate)]
    # Of chi-squared with as many degrees of freedom as a measurement has rows.
    corner, typical = np.sqrt(2 * gammaincinv(rows / 2, [_HUBER_QUANTILE, 0.5]) / rows)
    nonlinear = find_nonlinear_parameters(model, estimate)
    bounds = get_parameter_bounds(model, estimate)
    plausible = get_plausible_sizes(model, estimate)
    penalty = np.array(
        [0.0 if p.prior_std is None else p.prior_std**-2 for p in listed]
    )
    # Given what goes with the loads that other parameters make, and shapes, the
    # residual is nearly linear in all others.
    through = {
        effect.key
        for effect in model.effects
        if effect.effect == "joint_compliance" or "load" in effect.needs
    }
    yielding = np.array(
        [owner in through for owner, _ in list_parameters(model, estimate)], bool
    )

    def objective(estimate: Estimate, squares: float) -> float:
        """Half the weighted squares of the residual and of what has a prior."""
        return 0.5 * (squares + penalty @ get_parameter_values(model, estimate) ** 2)

    def solved(
        gram: np.ndarray,
        along: np.ndarray,
        present: np.ndarray,
        frozen: bool | np.ndarray,
    ) -> Solved:
        """Gauss-Newton step, covariance and what is held, as of `solve_normal`, within
        the ranges of the shapes."""
        step, covariance, held = solve_normal_equations(
            gram, along, plausible, frozen, penalty, present, nonlinear
        )
        # A shape that would leave its range goes to the end of it, and the others as
        # they do then.
        leaving = (present + step < bounds[:, 0]) | (present + step > bounds[:, 1])
        if leaving.any():
            ends = np.clip(present + step, *bounds.T)[leaving] - present[leaving]
            rest = along - gram[:, leaving] @ (ends / plausible[leaving])
            step = solve_normal_equations(
                gram, rest, plausible, frozen | leaving, penalty, present, nonlinear
            )[0]
            step[leaving] = ends
        return step, covariance, held

    measurements = LeastSquaresProblem(model, observations, noise, estimate, plausible)
    weights = np.ones(len(observations))
    measurements.linearize(estimate)
    scale = 1.0
    last = np.zeros(len(plausible))
    stuck = False
    known = None
    for number in range(_STEPS):
        # Loads where the robot yielded to in the last step: a fixed point that the
        # steps bring about.
        measurements.whiten()
        if number or reweight_first_step:
            distance = measurements.distance()
            scale = max(np.median(distance) / typical, 1.0)
            weights = corner / np.maximum(distance / scale, corner)
        gram, along = measurements.normal_equations(weights, known)
        present = get_parameter_values(model, estimate)
        if known is None:
            step, covariance, held = solved(gram, along, present, frozen)
            deviation = np.sqrt(np.diag(covariance))
        else:
            step = covariance @ (along / plausible - penalty * present)
        # Standard errors of the errors that are there, which the noise may be less
        # than.
        small = tolerance * (scale * deviation) + (deviation == 0)
        # A small step under the loads of before a large one says nothing of what these
        # loads still bring about.
        coming = np.maximum(
            np.abs(step), _LAGGING * np.abs(last) * plausible * yielding
        )
        converged = bool(number or reweight_first_step) and bool(
            (coming <= small).all()
        )
        if converged:
            estimate = apply_step(model, estimate, step)
            break
        # Weights and whitening follow the estimate. Where they throw it to and fro,
        # half the way lies between (relaxation of a fixed-point iteration): a step that
        # takes back more than half of the last one is halved.
        with_priors = gram + np.diag(penalty * plausible**2)
        first = int(with_priors @ (step / plausible + last / 2) @ last < 0)
        last = step / plausible
        # Twice the fall that a parabola promises.
        slope = along @ (step / plausible) - penalty @ (present * step)
        before = objective(estimate, measurements.squares(weights))
        origin = estimate
        acceleration = np.zeros(len(step))
        for halving in range(first, _HALVINGS + 1):
            share = 0.5**halving
            estimate = apply_step(model, origin, share * step + share**2 * acceleration)
            measurements.linearize(estimate)
            after = objective(estimate, measurements.squares(weights))
            least = _LEAST_FALL * share * slope - _ROUNDING * max(before, 1.0)
            if after > before - least and halving == first:
                # What it fell from was under the loads of the step before.
                before = objective(origin, measurements.squares(weights, origin))
                if (
                    after > before - least
                    and (nonlinear | yielding).any()
                    and measurements.kept
                ):
                    there = measurements.normal_equations(weights)
                    rest = solved(
                        *there,
                        get_parameter_values(model, estimate),
                        frozen | nonlinear | yielding,
                    )[0]
                    acceleration = rest / share**2
                    estimate = apply_step(
                        model, origin, share * step + share**2 * acceleration
                    )
                    measurements.linearize(estimate)
                    after = objective(estimate, measurements.squares(weights))
            if after <= before - least:
                near = np.abs(step) <= np.where(
                    nonlinear & ~held, 0.0, _NEAR * scale * deviation + (deviation == 0)
                )
                known = (
                    gram
                    if (number or reweight_first_step) and not halving and near.all()
                    else None
                )
                stuck = False
                break
        else:
            estimate = origin
            measurements.linearize(estimate)
            # A step goes by the loads of the step before, and the first one by weights
            # that are all alike: once more by those of now.
            if stuck:
                break
            stuck = True
            known = None
    return Fit(
        model,
        estimate,
        noise,
        held,
        covariance,
        weights,
        *measurements.ended(estimate),
        converged,
    )


def get_plausible_sizes(model: Model, estimate: Estimate) -> np.ndarray:
    """Sizes of the parameters, ndarray (P,), beyond which a standard error means that
    the data do not identify them.

    What has a prior need not be held: where the data do not identify it, the prior
    does. Nor need what the start has found larger than it should be, or it would be
    held there, without a standard error, once the noise turns out to be larger.
    """
    plausible = np.array(
        [
            max(p.plausible, p.prior_std or 0.0)
            for _, p in list_parameters(model, estimate)
        ]
    )
    linear = ~find_nonlinear_parameters(model, estimate)
    return np.maximum(plausible, linear * np.abs(get_parameter_values(model, estimate)))


def register_placement(model: Model, observations: Observations) -> Estimate:
    """Frames and targets of a model that its nominal kinematics explain best, by
    alternating closed-form steps.

    Block coordinate descent: frames by the Kabsch algorithm (Acta Cryst. A32, 1976) for
    Wahba's problem, given the targets; positions of targets as means, given the frames.
    The turn of a target is the chordal mean of rotations (Markley et al., J. Guidance
    30, 2007).

    Returns with all effects at zero, except that joint compliances start at their
    nominal values.
    """
    observations = sample_observations(observations, START_SAMPLE_SIZE)
    return register_to_poses(
        model, observations, *compute_nominal_poses(model, observations)
    )


def compute_nominal_poses(
    model: Model, observations: Observations
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (M, 3) and rotations (M, 3, 3) of measuring points on the nominal robot
    without loads, base axes."""
    chain = model.sites.chain
    points = [chain.point(target.point) for target in model.targets]
    position, rotation = poses_of_points(
        chain, chain.at(observations.states.joint_angles), points
    )
    seen = observations.target, observations.state
    return position[seen], rotation[seen]


def register_to_poses(
    model: Model,
    observations: Observations,
    nominal_position: np.ndarray,
    nominal_rotation: np.ndarray,
) -> Estimate:
    """As `registered`, to nominal poses that are known, as by `nominal_poses`."""
    states = observations.states
    target = observations.target
    measured = observations.position
    sessions = np.unique(states.session)
    session = np.searchsorted(sessions, states.session[observations.state])
    of_session = [np.flatnonzero(session == number) for number in range(len(sessions))]
    # A target may have all of its measurements among those held out.
    seen = {
        index: mine
        for index in range(len(model.targets))
        if len(mine := np.flatnonzero(target == index))
    }
    unknown = {
        index: mine
        for index, mine in seen.items()
        if model.targets[index].offset_m is None
    }
    offsets = np.array(
        [target.offset_m or (0.0, 0.0, 0.0) for target in model.targets], float
    )
    turn = np.tile(np.eye(3), (len(sessions), 1, 1))
    shift = np.zeros((len(sessions), 3))
    for _ in range(_ROUNDS if model.fitted_frames and unknown else 1):
        placed = nominal_position + np.einsum(
            "mij,mj->mi", nominal_rotation, offsets[target]
        )
        for number, mine in enumerate(of_session if model.fitted_frames else ()):
            centre = placed[mine].mean(axis=0)
            middle = measured[mine].mean(axis=0)
            left, _, right = np.linalg.svd(
                (measured[mine] - middle).T @ (placed[mine] - centre)
            )
            left[:, -1] *= np.sign(np.linalg.det(left @ right))
            turn[number] = left @ right
            shift[number] = middle - turn[number] @ centre
        in_base = np.einsum("mji,mj->mi", turn[session], measured - shift[session])
        local = np.einsum("mji,mj->mi", nominal_rotation, in_base - nominal_position)
        before = offsets.copy()
        for index, mine in unknown.items():
            offsets[index] = local[mine].mean(axis=0)
        if np.abs(offsets - before).max() < _SETTLED_M:
            break
    turns = Rotation.from_rotvec(
        [target.rotation or NO_ROTATION for target in model.targets]
    ).as_matrix()
    if observations.rotation is not None:
        turned = (
            nominal_rotation.transpose(0, 2, 1)
            @ turn[session].transpose(0, 2, 1)
            @ observations.rotation
        )
        for index in (index for index in seen if model.targets[index].rotation is None):
            turns[index] = Rotation.from_matrix(turned[seen[index]]).mean().as_matrix()
    nothing = Estimate(
        tuple(sessions.tolist()), turn, shift, offsets, turns
    ).with_effects(model.effects)
    return replace(nothing, coefficients=model.nominal_coefficients)
