"""A model fitted to observations, and what is asked of it: estimate, covariance, weights, whitened sensitivities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import at_states
from elastocal.fitting.displacement import conditions, observations_at_once
from elastocal.fitting.linearization import linearize
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import part_at, parts_of
from elastocal.fitting.parameters import parameters
from elastocal.fitting.whitening import whitening

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Parameter
    from elastocal.fitting.linearization import Linearization
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations, States
    from elastocal.fitting.whitening import Scaling, Whitening


@dataclass(frozen=True)
class Fit:
    """A model fitted to observations.

    `held` (P,) of bool: parameters that are not identifiable from the data. `covariance` (P, P): of the parameters: inverse of
    the normal matrix of the last step, which approximates the Hessian (Gauss-Newton); with priors as in Laplace's approximation
    [1]. Zero where held. `weights` (M,): robust weight of each observation. `residual` (M, rows): m and rad, base axes.
    `joint_jacobian` (M, rows, n): of each target with respect to the joints; None where there are too many to keep it.
    `conditions`: of the states fitted; None where these are too many to keep it. `converged`: whether the last step was below a
    thousandth of a standard error in every parameter, so that the estimate is a minimum.

    [1] Tierney, L. and Kadane, J. B., Accurate approximations for posterior moments and marginal densities, Journal of the
        American Statistical Association 81, 1986.
    """

    model: Model
    estimate: Estimate
    noise: Noise
    held: np.ndarray
    covariance: np.ndarray
    weights: np.ndarray
    whitener: Whitening | Scaling
    residual: np.ndarray
    joint_jacobian: np.ndarray | None
    conditions: Conditions | None
    converged: bool = True

    @property
    def parameters(self) -> list[tuple[str, Parameter]]:
        """As `parameters.parameters`."""
        return parameters(self.model, self.estimate)

    @property
    def prior_std(self) -> np.ndarray:
        """Standard deviation of the prior of each of the parameters, infinite where it has none, ndarray (P,)."""
        return np.array([np.inf if parameter.prior_std is None else parameter.prior_std for _, parameter in self.parameters])

    def places_of(self, owner: str) -> np.ndarray:
        """Places among the parameters of those that belong to one owner, such as the key of an effect; ndarray of int."""
        return np.flatnonzero([each == owner for each, _ in self.parameters])

    def values_of(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Linear parameters (D,) and shapes (F,) of one effect."""
        number = [effect.key for effect in self.model.effects].index(key)
        return self.estimate.coefficients[number], self.estimate.shapes[number]

    def whitened(self, values: np.ndarray) -> np.ndarray:
        """Rows (M, rows, ...) weighted and whitened as in the fit."""
        weights = np.sqrt(self.weights).reshape(-1, *[1] * (values.ndim - 1))
        return self.whitener.apply(values * weights)

    def sensitivities(self, observations: Observations) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Sensitivities of the observations that were fitted, as they are and whitened, in parts of whole poses.

        Yields `seen`: observations of the part; `plain`, `whitened` (M', rows, P).
        """
        for states, seen in parts_of(observations, observations_at_once(observations.rows, len(self.held))):
            some = part_at(observations, states, seen)
            line = linearize(self.model, self.estimate, some, self.conditions_of(some.states, states))
            white = whitening(some, self.jacobian_at(line, seen), self.noise)
            yield seen, line.sensitivities, white.apply(line.sensitivities * np.sqrt(self.weights[seen])[:, None, None])

    def conditions_of(self, states: States, chosen: slice | np.ndarray | None = None) -> Conditions:
        """Conditions of the states, or of those chosen: as they were kept, or found again where they were too many."""
        if self.conditions is None:
            return conditions(self.model, self.estimate, states)
        return self.conditions if chosen is None else at_states(self.conditions, chosen)

    def jacobian_at(self, line: Linearization, seen: slice) -> np.ndarray:
        """Jacobian of some observations with respect to the joints: as kept, or of their `Linearization`, (M', rows, n)."""
        if self.joint_jacobian is None:
            return line.coordinate_jacobian[..., : self.model.sites.joints]
        return self.joint_jacobian[seen]
