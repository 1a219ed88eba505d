"""Normal equations of a step of generalized least squares: whitened, added up over the
measurements, and solved.

Generalized least squares (Aitken, Proc. R. Soc. Edinburgh 55, 1935) divides residuals
and sensitivities by the noise of the states in which they were taken; what the data do
not identify is held at its value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    compute_residuals,
    evaluate_conditions,
    update_springs_and_masses,
)
from elastocal.fitting.observations import batch_groups_by_size, split_into_blocks

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.linearization import LinearModel
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# Correlation beyond which a parameter is not identifiable because of a shape.
_BOUND_TO_SHAPE = 0.5
# States beyond which conditions are not kept from step to step, and with a fit, but
# found again: they take some ten kilobytes each, and there is one fit after another.
_MOST_STATES = 20_000
_MOST_STATES_OF_A_FIT = 2_000
# Columns for each coordinate from which on products by factors cost less than those of
# the columns written out.
_COLUMNS_A_COORDINATE = 4


def solve_normal_equations(
    gram: np.ndarray,
    along: np.ndarray,
    plausible: np.ndarray,
    frozen: bool | np.ndarray = False,
    penalty: float | np.ndarray = 0.0,
    present: float | np.ndarray = 0.0,
    nonlinear: bool | np.ndarray = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least squares over the parameters that the data identify, from the normal
    equations.

    A parameter whose standard error would exceed its plausible size, first beside those
    before it and then beside all, keeps its value. Nothing is regularised but what
    carries a prior, as in generalized ridge regression (Hoerl and Kennard,
    Technometrics 12, 1970).

    `gram` (P, P): products of whitened sensitivities in plausible sizes with each
    other. `along` (P,): with the whitened residual. `plausible` (P,): plausible size of
    each parameter. `frozen` (P,) of bool: parameters not to move. `penalty` (P,): one
    over the variance of the prior about zero; 0 for none. `present` (P,): values from
    which the step is taken. `nonlinear` (P,) of bool: as in `identifiable`. Returns
    `step` (P,): zero where held; `covariance` (P, P); `held` (P,) of bool.
    """
    gram = gram + np.diag(np.broadcast_to(penalty, len(plausible)) * plausible**2)
    along = along - plausible * np.broadcast_to(penalty * present, len(plausible))
    known, inverse = find_identifiable_parameters(
        gram, *(np.broadcast_to(flags, len(plausible)) for flags in (frozen, nonlinear))
    )
    return (
        plausible * (inverse @ along),
        inverse * np.outer(plausible, plausible),
        ~known,
    )


def find_identifiable_parameters(
    gram: np.ndarray, frozen: np.ndarray, nonlinear: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which parameters the data distinguish from zero at their plausible size: first
    given those before them, then given all.

    Forward selection in the order given, by the pivots of a Cholesky decomposition,
    then backward elimination.

    `gram` (P, P): information on the parameters, each in units of its plausible size.
    `frozen` (P,) of bool: left out from the start. `nonlinear` (P,) of bool: shapes:
    given up before a parameter that they are bound to, as that of their law is where it
    is nearly a straight line. Returns (P,) of bool, and the covariance of these (P, P),
    zero of all others.
    """
    kept = np.flatnonzero(~frozen)
    found = np.zeros_like(gram)
    while (first := _first_without_information(gram[np.ix_(kept, kept)])) is not None:
        kept = np.delete(kept, first)
    # Parameters that came later may have taken from what identified their predecessors.
    while len(kept):
        covariance = invert_cholesky_factor(
            dpotrf(gram[np.ix_(kept, kept)], lower=1)[0]
        )
        deviation = np.sqrt(np.diag(covariance))
        worst = int(np.argmax(deviation))
        if deviation[worst] <= 1.0:
            found[np.ix_(kept, kept)] = covariance
            break
        correlation = np.where(
            nonlinear[kept],
            np.abs(covariance[worst]) / (deviation[worst] * deviation),
            0.0,
        )
        shape = int(np.argmax(correlation))
        kept = np.delete(kept, shape if correlation[shape] > _BOUND_TO_SHAPE else worst)
    return np.isin(np.arange(len(gram)), kept), found


def invert_cholesky_factor(lower: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric positive matrix, of which this is Cholesky's factor."""
    inverse = dpotri(lower, lower=1)[0]
    # LAPACK leaves the other triangle as it was.
    return np.tril(inverse) + np.tril(inverse, -1).T


def _first_without_information(gram: np.ndarray) -> int | None:
    """The first of some parameters that those before it leave not enough information
    on; None where there is none."""
    if not len(gram):
        return None
    # Where a pivot is not positive, LAPACK says which (from 1), and has those before
    # it.
    factor, number = dpotrf(gram, lower=1)
    known = number - 1 if number else len(gram)
    left_over = np.diag(factor)[:known] ** 2
    # Rounding of the squares counts as nothing, nor that of a prior which alone makes
    # one.
    lacking = left_over <= np.maximum(1.0 + 1e-12, 1e-11 * np.diag(gram)[:known])
    if lacking.any():
        return int(np.argmax(lacking))
    return known if number else None


@dataclass(frozen=True)
class Whitening:
    """What turns correlated rows into independent ones of unit variance.

    `blocks` (ndarray (G, k), ndarray (G, k * rows, k * rows)): for what errs together,
    k observations each: their indices, and the inverse Cholesky factor of their
    covariance.
    """

    blocks: tuple[tuple[np.ndarray, np.ndarray], ...]

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Whitened values (M, rows, ...)."""
        (members, factor), *others = self.blocks
        if not others and (members.ravel() == np.arange(len(values))).all():
            # One after the other: nothing to gather.
            return (factor @ values.reshape(*factor.shape[:2], -1)).reshape(
                values.shape
            )
        whitened = np.empty(values.shape)
        for members, factor in self.blocks:
            stacked = values[members].reshape(*factor.shape[:2], -1)
            whitened[members] = (factor @ stacked).reshape(
                *members.shape, *values.shape[1:]
            )
        return whitened

    @property
    def transposed(self) -> Whitening:
        """What carries whitened values back, as products with whitened sensitivities
        do."""
        return Whitening(
            tuple((members, factor.swapaxes(1, 2)) for members, factor in self.blocks)
        )

    def after(self, maps: np.ndarray) -> Whitening:
        """What whitens values to each of whose observations a matrix is applied first,
        ndarray (M, rows, rows)."""
        blocks = []
        for members, factor in self.blocks:
            by_member = factor.reshape(
                len(members), -1, members.shape[1], maps.shape[1]
            ).swapaxes(1, 2)
            blocks.append(
                (
                    members,
                    (by_member @ maps[members]).swapaxes(1, 2).reshape(factor.shape),
                )
            )
        return Whitening(tuple(blocks))


def compute_measurement_covariances(
    noise: Noise, jacobians: np.ndarray, rows: int
) -> np.ndarray:
    """Covariance of all measurements of one approach, ndarray (G, k * rows, k * rows).

    `jacobians` (G, k, rows, n): of the k targets, with respect to the joints. `rows`: 3
    for positions, 6 for poses.
    """
    groups, targets = jacobians.shape[:2]
    stacked = jacobians.reshape(groups, targets * rows, -1) * noise.joint_rad
    covariance = stacked @ stacked.transpose(0, 2, 1)
    covariance[:, np.arange(targets * rows), np.arange(targets * rows)] += np.tile(
        noise.sensor_std(rows) ** 2, targets
    )
    return covariance


def compute_whitening(
    observations: Observations, jacobian: np.ndarray | None, noise: Noise
) -> Whitening:
    """Whitening of averaged observations.

    Those of a state share the approach; where poses have an error in common, those of
    all states of a pose share it.

    `jacobian` (M, rows, n): with respect to the joints; where they do not err it is not
    looked at. `noise`: of one measurement.
    """
    rows = observations.rows
    repeats = observations.states.repeats[observations.state]
    if not noise.pose_rad and not noise.joint_rad.any():
        each = (np.sqrt(repeats)[:, None] / noise.sensor_std(rows))[..., None] * np.eye(
            rows
        )
        return Whitening(((np.arange(len(each))[:, None], each),))
    assert jacobian is not None
    blocks = []
    for members in batch_groups_by_size(
        observations.cluster if noise.pose_rad else observations.state
    ):
        stacked = jacobian[members].reshape(len(members), members.shape[1] * rows, -1)
        state = np.repeat(observations.state[members], rows, axis=1)
        alike = (state[:, :, None] == state[:, None, :]) / np.repeat(
            repeats[members], rows, axis=1
        )[:, None, :]
        common = noise.pose_rad**2 * (stacked @ stacked.transpose(0, 2, 1))
        covariance = (
            alike * compute_measurement_covariances(noise, jacobian[members], rows)
            + common
        )
        blocks.append((members, np.linalg.inv(np.linalg.cholesky(covariance))))
    return Whitening(tuple(blocks))


@dataclass
class _Part:
    """Some observations beside a model.

    `states`, `seen`: which. `around`: of their states, where conditions are kept: then
    `line` is at the present estimate, and `jacobian` (M', rows, n), with respect to the
    joints, is that by which `whitener` was found. Else `coordinates` (S, C): where the
    robot has yielded to, by which loads are taken.
    """

    states: slice
    seen: slice
    observations: Observations
    around: Conditions | None = None
    line: LinearModel | None = None
    jacobian: np.ndarray | None = None
    coordinates: np.ndarray | None = None
    whitener: Whitening = Whitening(())


class LeastSquaresProblem:
    """Measurements beside a model, in parts of whole poses: what a step needs of them
    adds up over the parts.

    Of very many states nothing is kept from step to step but the whitening of the last
    step and where the robot yielded to. `estimate`: at which loads are first taken.
    `plausible` (P,): plausible size of each parameter.
    """

    def __init__(
        self,
        model: Model,
        observations: Observations,
        noise: Noise,
        estimate: Estimate,
        plausible: np.ndarray,
    ) -> None:
        self.model = model
        self.observations = observations
        self.noise = noise
        self.plausible = plausible
        self.parts = [
            _Part(*edges) for edges in split_into_blocks(observations, len(plausible))
        ]
        self.kept = len(observations.states) <= _MOST_STATES
        for part in self.parts if self.kept else ():
            part.around = evaluate_conditions(model, estimate, part.observations.states)
        # What is whitened over several states has no factors any more, one of which
        # belongs to the state.
        self.factors = not noise.pose_rad or observations.cluster.max() + 1 == len(
            observations.states
        )

    def linearize(self, estimate: Estimate) -> None:
        """Go to an estimate."""
        self.estimate = estimate
        found = []
        for part in self.parts:
            if part.around is not None:
                part.line = linearize(
                    self.model, estimate, part.observations, part.around
                )
            found.append(
                part.line.residual if part.line else self._residual_of(part, estimate)
            )
        self.residual = np.concatenate(found)

    def whiten(self) -> None:
        """Take loads and whitening at the present estimate."""
        self.origin = self.estimate
        for part in self.parts:
            if part.line is not None:
                part.around = part.line.conditions
                part.jacobian = part.line.joint_jacobian
                part.whitener = compute_whitening(
                    part.observations, part.jacobian, self.noise
                )
            elif not part.whitener.blocks and (
                self.noise.pose_rad or self.noise.joint_rad.any()
            ):
                self._linearized(part)
            elif not part.whitener.blocks:
                part.whitener = compute_whitening(part.observations, None, self.noise)

    def normal_equations(
        self, weights: np.ndarray, known: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrix of the weighted, whitened sensitivities in plausible sizes, and
        their products with the residual.

        `known`: Gram matrix of a step before, if it is to be taken as it was.
        """
        size = len(self.plausible)
        gram = np.zeros((size, size))
        along = np.zeros(size)
        root = np.sqrt(weights)
        for part in self.parts if size else ():
            line = part.line or self._linearized(part)
            mine = root[part.seen]
            turned = part.whitener.after(
                _of_rotation_vectors(line.residual) * mine[:, None, None]
            )
            right = turned.transposed.apply(
                part.whitener.apply(line.residual * mine[:, None])
            )
            along += line.columns.times(right[..., None])[:, 0]
            if (
                known is None
                and self.factors
                and size > _COLUMNS_A_COORDINATE * len(line.columns.spans)
            ):
                gram += replace(
                    line.columns, jacobian=turned.apply(line.columns.jacobian)
                ).gram()
            elif known is None:
                left = turned.apply(line.sensitivities).reshape(right.size, size)
                gram += left.T @ left
        return gram * np.outer(
            self.plausible, self.plausible
        ) if known is None else known, along * self.plausible

    def distance(self) -> np.ndarray:
        """Whitened distance of each observation from the prediction, ndarray (M,)."""
        return np.sqrt((self._whitened(self.residual) ** 2).mean(axis=1))

    def squares(self, weights: np.ndarray, estimate: Estimate | None = None) -> float:
        """Sum of squares of the residual, weighted and whitened as in
        `normal_equations`; of this or another estimate."""
        residual = self.residual if estimate is None else self._residual(estimate)
        # A residual in the base axes of an estimate in those of the one by which it is
        # whitened.
        estimate = estimate or self.estimate
        turn = self.origin.frame_rotation.transpose(0, 2, 1) @ estimate.frame_rotation
        if (turn != np.eye(3)).any():
            session = np.searchsorted(
                estimate.sessions,
                self.observations.states.session[self.observations.state],
            )
            vectors = residual.reshape(len(residual), -1, 3)
            residual = (vectors @ turn[session].transpose(0, 2, 1)).reshape(
                residual.shape
            )
        return float((self._whitened(residual * np.sqrt(weights)[:, None]) ** 2).sum())

    def ended(
        self, estimate: Estimate
    ) -> tuple[Whitening, np.ndarray, np.ndarray | None, Conditions | None]:
        """What is kept of a fit at its last estimate, of all observations, under the
        loads where its last step led.

        Whitening; residual (M, rows); Jacobian with respect to the joints (M, rows, n),
        None where there are too many to keep it; conditions, None where there are.
        """
        for part in self.parts:
            if part.line is not None:
                part.around = update_springs_and_masses(
                    self.model, estimate, part.line.conditions
                )
        blocks = [
            (members + part.seen.start, factor)
            for part in self.parts
            for members, factor in part.whitener.blocks
        ]
        kept = [part.jacobian for part in self.parts if part.jacobian is not None]
        around = (
            self.parts[0].around
            if len(self.observations.states) <= _MOST_STATES_OF_A_FIT
            and len(self.parts) == 1
            else None
        )
        return (
            Whitening(tuple(blocks)),
            self._residual(estimate),
            np.concatenate(kept) if kept else None,
            around,
        )

    def _residual(self, estimate: Estimate) -> np.ndarray:
        return np.concatenate(
            [self._residual_of(part, estimate) for part in self.parts]
        )

    def _residual_of(self, part: _Part, estimate: Estimate) -> np.ndarray:
        return compute_residuals(
            self.model, estimate, part.observations, self._around(part, estimate)
        )

    def _whitened(self, residual: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [part.whitener.apply(residual[part.seen]) for part in self.parts]
        )

    def _around(self, part: _Part, estimate: Estimate) -> Conditions:
        """Conditions as they are kept; else at the coordinates that are, which are
        found at first."""
        if part.around is not None:
            return part.around
        around = evaluate_conditions(
            self.model, estimate, part.observations.states, part.coordinates
        )
        if part.coordinates is None:
            part.coordinates = compute_displaced_coordinates(
                self.model, estimate, around
            )
        return around

    def _linearized(self, part: _Part) -> LinearModel:
        """At the present estimate, by which whitening and loads are then taken, where
        lines are not kept."""
        line = linearize(
            self.model,
            self.estimate,
            part.observations,
            self._around(part, self.estimate),
        )
        part.coordinates = line.coordinates
        part.whitener = compute_whitening(
            part.observations, line.joint_jacobian, self.noise
        )
        return line


def _of_rotation_vectors(residual: np.ndarray) -> np.ndarray:
    """Matrices (M, rows, rows) that turn sensitivities of poses into those of the
    residual itself.

    Where a pose turns by -w, its rotation vector r grows by w + r x w / 2 + O(r^2):
    Bortz's equation (IEEE Trans. Aerosp. Electron. Syst. 7, 1971).
    """
    maps = np.tile(np.eye(residual.shape[1]), (len(residual), 1, 1))
    if residual.shape[1] > 3:
        maps[:, 3:, 3:] += 0.5 * np.cross(residual[:, None, 3:], np.eye(3)).transpose(
            0, 2, 1
        )
    return maps
