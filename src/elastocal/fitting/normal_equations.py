"""Normal equations of a step, added up over measurements that are held whole or come in parts of whole poses."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import at_states, with_springs
from elastocal.fitting.displacement import (
    conditions,
    displaced_coordinates,
    held_at_once,
    joint_compliances,
    keeps_conditions,
    kept_conditions,
    mass_corrections,
    observations_at_once,
)
from elastocal.fitting.factored import Factored
from elastocal.fitting.fit_result import Fit
from elastocal.fitting.linearization import linearize
from elastocal.fitting.observations import part_at, parts_of
from elastocal.fitting.prediction import residuals
from elastocal.fitting.whitening import joined, whitening

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.linearization import Linearization
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations
    from elastocal.fitting.whitening import Scaling, Whitening


# Columns for each coordinate from which on products by factors cost less than those of the columns written out.
_COLUMNS_A_COORDINATE = 4


class Parts:
    """Measurements beside a model, whole or in parts of whole poses: what a step needs of them adds up over the parts.

    Whitening in parts is that of the last step; where the noise has no part of the joints it is always the same. Of states that
    are too many to keep their conditions, the coordinates are kept at which loads are taken.

    `observations`: M of them. `around`: of all their states; None where these are too many to keep it. `plausible` (P,):
    plausible size of each parameter.
    """

    def __init__(
        self, model: Model, observations: Observations, noise: Noise, around: Conditions | None, plausible: np.ndarray
    ) -> None:
        self.model, self.observations, self.noise, self.plausible = model, observations, noise, plausible
        held = held_at_once(observations, len(plausible))
        most = len(observations) if held else observations_at_once(observations.rows, len(plausible))
        self.slices = parts_of(observations, most)
        self.whole = len(self.slices) == 1 and around is not None
        self.parts = [observations] if self.whole else [part_at(observations, *edges) for edges in self.slices]
        self.around: list[Conditions | None] = [around] if self.whole else [None] * len(self.parts)
        if not self.whole and around is not None:
            self.around = [at_states(around, states) for states, _ in self.slices]
        # What is whitened over several states has no factors any more, one of which belongs to the state.
        self.factors = not noise.pose_rad or observations.cluster.max() + 1 == len(observations.states)
        self.coordinates: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self.whiteners: dict[int, Whitening | Scaling] = {}
        # Of so many states that conditions are not kept neither are these.
        self.jacobians: dict[int, np.ndarray] | None = None if around is None else {}
        self.line: Linearization | None = None

    def copy(self) -> Parts:
        """The same, which goes its own way from here."""
        other = copy(self)
        other.around, other.coordinates, other.whiteners = self.around.copy(), self.coordinates.copy(), self.whiteners.copy()
        other.jacobians = None if self.jacobians is None else self.jacobians.copy()
        return other

    def linearize(self, estimate: Estimate) -> None:
        """Go to an estimate."""
        self.estimate = estimate
        if self.whole:
            self.line = linearize(self.model, estimate, self.observations, self._around(0))
            self.residual = self.line.residual
        else:
            self.residual = np.concatenate(
                [residuals(self.model, estimate, part, self._around(number)) for number, part in enumerate(self.parts)]
            )

    def whiten(self) -> None:
        """Take loads and whitening at the present estimate."""
        self.origin = self.estimate
        if self.line is not None:
            self.around = [self.line.conditions]
            jacobian = self.line.coordinate_jacobian[..., : self.model.sites.joints]
            self.jacobians, self.whiteners = {0: jacobian}, {0: whitening(self.observations, jacobian, self.noise)}
        elif not self.whiteners:
            for number, part in enumerate(self.parts):
                if self.noise.pose_rad or self.noise.joint_rad.any():
                    self._linearized(number, part)
                else:
                    self.whiteners[number] = whitening(part, None, self.noise)

    def normal_equations(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix (P, P) of the whitened sensitivities, in plausible sizes, and their products with the residual, (P,).

        Observations count by their weights, ndarray (M,).
        """
        size = len(self.plausible)
        gram, along, root = np.zeros((size, size)), np.zeros(size), np.sqrt(weights)
        for number, (part, (_, seen)) in enumerate(zip(self.parts, self.slices, strict=True)):
            line = self._linearized(number, part) if self.line is None else self.line
            whitener, mine = self.whiteners[number], root[seen]
            right = whitener.apply(line.residual * mine[:, None])
            turned = whitener.after(_of_rotation_vectors(line.residual) * mine[:, None, None])
            if self.factors and size > _COLUMNS_A_COORDINATE * len(line.displacements.spans):
                part_gram, part_along = _products(line, turned, right)
                gram += part_gram
                along += part_along
            else:
                left = turned.apply(line.sensitivities).reshape(right.size, size)
                gram += left.T @ left
                along += left.T @ right.reshape(-1)
        return gram * np.outer(self.plausible, self.plausible), along * self.plausible

    def distance(self) -> np.ndarray:
        """Whitened distance of each observation from the prediction, ndarray (M,)."""
        return np.sqrt(np.concatenate([(part**2).mean(axis=1) for part in self._whitened(self.residual)]))

    def squares(self, weights: np.ndarray, estimate: Estimate | None = None) -> float:
        """Sum of squares of the residual, weighted and whitened as in `normal_equations`; of this or another estimate."""
        residual = self.residual
        if estimate is not None:
            found = [residuals(self.model, estimate, part, self._around(n, estimate)) for n, part in enumerate(self.parts)]
            residual = np.concatenate(found)
        residual = self._in_axes_of_step(residual, self.estimate if estimate is None else estimate)
        return float(sum((part**2).sum() for part in self._whitened(residual * np.sqrt(weights)[:, None])))

    def _in_axes_of_step(self, residual: np.ndarray, estimate: Estimate) -> np.ndarray:
        """A residual in the base axes of an estimate in those of the one by which it is whitened."""
        turn = self.origin.frame_rotation.transpose(0, 2, 1) @ estimate.frame_rotation
        if (turn == np.eye(3)).all():
            return residual
        states, state = self.observations.states, self.observations.state
        session = np.searchsorted(estimate.sessions, states.session[state])
        vectors = residual.reshape(len(residual), -1, 3)
        return (vectors @ turn[session].transpose(0, 2, 1)).reshape(residual.shape)

    def fit(self, estimate: Estimate, held: np.ndarray, covariance: np.ndarray, weights: np.ndarray, converged: bool) -> Fit:
        """The `Fit` of these measurements."""
        model, around = self.model, None
        if self.line is not None:
            springs = joint_compliances(model, estimate), mass_corrections(model, estimate)
            around = with_springs(self.line.conditions, *springs)
            residual = residuals(model, estimate, self.observations, around)
        else:
            self.linearize(estimate)
            residual = self.residual
            around = kept_conditions(model, estimate, self.observations) if keeps_conditions(self.observations) else None
        whitener = joined([*self.whiteners.values()], [seen.start for _, seen in self.slices])
        jacobian = None if self.jacobians is None else np.concatenate([*self.jacobians.values()])
        around = around if keeps_conditions(self.observations) else None
        return Fit(model, estimate, self.noise, held, covariance, weights, whitener, residual, jacobian, around, converged)

    def _around(self, number: int, estimate: Estimate | None = None) -> Conditions:
        kept = self.around[number]
        if kept is not None:
            return kept
        states, estimate = self.parts[number].states, estimate or self.estimate
        if number not in self.coordinates:
            around = conditions(self.model, estimate, states)
            self._keep_coordinates(number, estimate, around)
            return around
        moved, displaced = self.coordinates[number]
        coordinates = np.zeros((len(states), self.model.sites.chain.coordinates))
        coordinates[:, moved] = displaced
        return conditions(self.model, estimate, states, coordinates)

    def _keep_coordinates(self, number: int, estimate: Estimate, around: Conditions) -> None:
        displaced = displaced_coordinates(self.model, estimate, around)
        moved = np.flatnonzero(displaced.any(axis=0))
        self.coordinates[number] = moved, displaced[:, moved]

    def _linearized(self, number: int, part: Observations) -> Linearization:
        around = self._around(number)
        line = linearize(self.model, self.estimate, part, around)
        if self.around[number] is None:
            self._keep_coordinates(number, self.estimate, around)
        else:
            self.around[number] = line.conditions
        jacobian = line.coordinate_jacobian[..., : self.model.sites.joints]
        if self.jacobians is not None:
            self.jacobians[number] = jacobian
        self.whiteners[number] = whitening(part, jacobian, self.noise)
        return line

    def _whitened(self, residual: np.ndarray) -> list[np.ndarray]:
        pairs = zip(self.whiteners.values(), self.slices, strict=True)
        return [whitener.apply(residual[seen]) for whitener, (_, seen) in pairs]


def _products(line: Linearization, turned: Whitening | Scaling, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gram matrix of the whitened sensitivities and their products with the whitened residual, without the sensitivities."""
    columns = Factored(line.displacements, turned.apply(line.coordinate_jacobian), line.state)
    beside = np.concatenate([turned.apply(line.target_columns), right[..., None]], axis=2)
    gram, cross, at = columns.gram(), columns.times(beside), line.of_targets
    own = np.tensordot(beside, beside, ((0, 1), (0, 1)))
    gram[:, at] += cross[:, :-1]
    gram[at] += cross[:, :-1].T
    gram[np.ix_(at, at)] += own[:-1, :-1]
    along = cross[:, -1]
    along[at] += own[:-1, -1]
    return gram, along


def _of_rotation_vectors(residual: np.ndarray) -> np.ndarray:
    """Matrices (M, rows, rows) that turn sensitivities of poses into those of the residual itself.

    Where a pose turns by -w, its rotation vector r grows by w + r x w / 2 + O(r^2): Bortz's equation [1].

    [1] Bortz, J. E., A new mathematical formulation for strapdown inertial navigation, IEEE Transactions on Aerospace and
        Electronic Systems AES-7, 1971.
    """
    count, rows = residual.shape
    maps = np.tile(np.eye(rows), (count, 1, 1))
    if rows > 3:
        maps[:, 3:, 3:] += 0.5 * np.cross(residual[:, None, 3:], np.eye(3)).transpose(0, 2, 1)
    return maps
