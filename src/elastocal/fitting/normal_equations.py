"""Normal equations of generalized least squares: assembly and solution.

Generalized least squares (Aitken, Proc. R. Soc. Edinburgh 55, 1935) whitens residuals
and sensitivities: it multiplies them by the inverse Cholesky factor of the noise
covariance of the states in which they were measured. Parameters that the data do not
identify stay fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from elastocal.fitting.contact_density import compute_mean_strains
from elastocal.fitting.linearization import linearize_residual
from elastocal.fitting.model import (
    compute_displaced_coordinates,
    compute_residuals,
    evaluate_conditions,
    get_parameter_values,
    update_springs_and_masses,
)
from elastocal.fitting.observations import batch_groups_by_size, split_into_blocks
from elastocal.fitting.sensor_noise import compute_sensor_roots
from elastocal.mechanics.kinematics import form_cross_matrices

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.linearization import LinearModel
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# If a parameter is not identifiable and correlates more than this with a nonlinear
# parameter, the nonlinear parameter is given up instead.
_NONLINEAR_CORRELATION = 0.5
# Upper bound on the states whose conditions stay in memory from step to step, and on
# those whose conditions stay in memory with the finished fit. Conditions take some ten
# kilobytes a state, and there is one fit after another. Above it they are recomputed.
_MAX_STATES_IN_MEMORY = 20_000
_MAX_STATES_OF_A_FIT = 2_000
# Above this many columns per displaced coordinate, products of the factored
# sensitivities are cheaper than those of the dense ones.
_COLUMNS_PER_COORDINATE = 4
# A pivot this close to the information of the prior alone, absolutely and relative to
# the diagonal, is rounding.
_PIVOT_ROUNDING = 1e-12
_RELATIVE_PIVOT_ROUNDING = 1e-11


@dataclass(frozen=True)
class ParameterScales:
    """What normal equations need to know about P parameters besides the measurements.

    Attributes
    ----------
    plausible : (P,) array, plausible size of each parameter
    penalty : (P,) array, inverse variance of the normal prior about zero; 0 if a
        parameter has no prior
    nonlinear : (P,) bool array, shape parameters
    """

    plausible: np.ndarray
    penalty: np.ndarray
    nonlinear: np.ndarray


@dataclass(frozen=True)
class NormalSolution:
    """Solution of normal equations.

    Attributes
    ----------
    step : (P,) array, zero for parameters that do not move
    covariance : (P, P) array, zero for parameters that do not move
    unidentifiable : (P,) bool array, parameters that do not move
    beyond_bound : (P,) array, optional
        How far the measurements would move each parameter beyond its bound, with the
        sign of that move; zero for all parameters if None.
    """

    step: np.ndarray
    covariance: np.ndarray
    unidentifiable: np.ndarray
    beyond_bound: np.ndarray | None = None


def solve_normal_equations(
    gram: np.ndarray,
    gradient: np.ndarray,
    scales: ParameterScales,
    present: np.ndarray,
    frozen: np.ndarray,
) -> NormalSolution:
    """Solve normal equations for the parameters that the data identify.

    A parameter whose standard error would exceed its plausible size, first given the
    parameters before it and then given all, keeps its value. Only parameters with a
    prior are regularised, as in generalized ridge regression.

    Parameters
    ----------
    gram : (P, P) array
        Products of whitened sensitivities, each in units of its plausible size.
    gradient : (P,) array
        Products of these sensitivities with the whitened residual.
    scales : ParameterScales
    present : (P,) array
        Values from which the step is taken.
    frozen : (P,) bool array
        Parameters that must not move.

    References
    ----------
    Hoerl and Kennard, Technometrics 12, 1970.
    """
    plausible = scales.plausible
    gram = gram + np.diag(scales.penalty * plausible**2)
    gradient = gradient - plausible * (scales.penalty * present)
    identified, inverse = find_identifiable_parameters(gram, frozen, scales.nonlinear)
    return NormalSolution(
        plausible * (inverse @ gradient),
        inverse * np.outer(plausible, plausible),
        ~identified,
    )


def find_identifiable_parameters(
    gram: np.ndarray, frozen: np.ndarray, nonlinear: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the parameters that the data distinguish from zero at their plausible size.

    Forward selection in the given order by the pivots of a Cholesky decomposition, then
    backward elimination, because later parameters may take the information that
    identified earlier ones.

    Parameters
    ----------
    gram : (P, P) array
        Information on the parameters, each in units of its plausible size.
    frozen : (P,) bool array
        Parameters that are excluded from the start.
    nonlinear : (P,) bool array
        Shape parameters. If a parameter of a basis function is not identifiable because
        it correlates with the shape, as when that function is nearly a straight line,
        the shape is given up first.

    Returns
    -------
    identifiable : (P,) bool array
    covariance : (P, P) array, zero for all other parameters
    """
    kept = np.flatnonzero(~frozen)
    inverse = np.zeros_like(gram)
    first = _find_first_uninformed(gram[np.ix_(kept, kept)])
    while first is not None:
        kept = np.delete(kept, first)
        first = _find_first_uninformed(gram[np.ix_(kept, kept)])
    while len(kept):
        covariance = invert_cholesky_factor(
            dpotrf(gram[np.ix_(kept, kept)], lower=1)[0]
        )
        deviation = np.sqrt(np.diag(covariance))
        worst = int(np.argmax(deviation))
        if deviation[worst] <= 1.0:
            inverse[np.ix_(kept, kept)] = covariance
            break
        correlation = np.abs(covariance[worst]) / (deviation[worst] * deviation)
        correlation = np.where(nonlinear[kept], correlation, 0.0)
        shape = int(np.argmax(correlation))
        if correlation[shape] > _NONLINEAR_CORRELATION:
            worst = shape
        kept = np.delete(kept, worst)
    return np.isin(np.arange(len(gram)), kept), inverse


def invert_cholesky_factor(lower: np.ndarray) -> np.ndarray:
    """Invert the symmetric positive definite matrix that has this Cholesky factor."""
    inverse = dpotri(lower, lower=1)[0]
    # LAPACK leaves the upper triangle as it was.
    return np.tril(inverse) + np.tril(inverse, -1).T


def _find_first_uninformed(gram: np.ndarray) -> int | None:
    """Index of the first parameter that has too little information given its
    predecessors; None if all have enough."""
    if not len(gram):
        return None
    # If a pivot is not positive, LAPACK returns its number, counted from 1, and the
    # pivots before it.
    factor, failed = dpotrf(gram, lower=1)
    count = failed - 1 if failed else len(gram)
    pivots = np.diag(factor)[:count] ** 2
    # A prior alone gives a pivot of one, so neither that nor rounding is information.
    uninformed = pivots <= np.maximum(
        1.0 + _PIVOT_ROUNDING, _RELATIVE_PIVOT_ROUNDING * np.diag(gram)[:count]
    )
    if uninformed.any():
        return int(np.argmax(uninformed))
    return count if failed else None


@dataclass(frozen=True)
class Whitening:
    """Linear map that turns correlated rows into independent rows of unit variance.

    Attributes
    ----------
    blocks : tuple of pairs
        For each number k of observations with correlated errors: the indices (G, k) of
        the observations, and the inverse Cholesky factors (G, k * rows, k * rows) of
        their covariance.
    """

    blocks: tuple[tuple[np.ndarray, np.ndarray], ...]

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Whiten values (M, rows, ...)."""
        members, factor = self.blocks[0]
        single = len(self.blocks) == 1
        if single and (members.ravel() == np.arange(len(values))).all():
            # Observations are in the order of the blocks, so there is nothing to gather.
            stacked = values.reshape(*factor.shape[:2], -1)
            return (factor @ stacked).reshape(values.shape)
        whitened = np.empty(values.shape)
        for members, factor in self.blocks:
            stacked = values[members].reshape(*factor.shape[:2], -1)
            whitened[members] = (factor @ stacked).reshape(
                *members.shape, *values.shape[1:]
            )
        return whitened

    @property
    def transposed(self) -> Whitening:
        """Transpose of the map, as in products with whitened sensitivities."""
        return Whitening(
            tuple((members, factor.swapaxes(1, 2)) for members, factor in self.blocks)
        )

    def after(self, maps: np.ndarray) -> Whitening:
        """Compose with a matrix for each observation, (M, rows, rows), applied first."""
        blocks = []
        for members, factor in self.blocks:
            by_member = factor.reshape(
                len(members), -1, members.shape[1], maps.shape[1]
            ).swapaxes(1, 2)
            composed = (by_member @ maps[members]).swapaxes(1, 2)
            blocks.append((members, composed.reshape(factor.shape)))
        return Whitening(tuple(blocks))


def compute_measurement_covariances(
    noise: Noise,
    jacobians: np.ndarray,
    rows: int,
    roots: np.ndarray | None = None,
) -> np.ndarray:
    """Compute the covariance of all measurements of one approach.

    Parameters
    ----------
    noise : Noise
    jacobians : (G, k, rows, n) array
        Jacobians of k targets with respect to the joints.
    rows : int
        3 for positions, 6 for poses, 1 for single numbers.
    roots : (G, k, rows, rows) array, optional
        See `compute_sensor_roots`.

    Returns
    -------
    (G, k * rows, k * rows) array
    """
    groups, targets = jacobians.shape[:2]
    size = targets * rows
    stacked = jacobians.reshape(groups, size, -1) * noise.joint_rad
    covariance = stacked @ stacked.transpose(0, 2, 1)
    diagonal = np.arange(size)
    if roots is None:
        variance = np.tile(noise.sensor_std(rows) ** 2, targets)
        covariance[:, diagonal, diagonal] += variance
        return covariance
    for number in range(targets):
        block = slice(number * rows, (number + 1) * rows)
        root = roots[:, number]
        covariance[:, block, block] += root @ root.transpose(0, 2, 1)
    return covariance


def compute_whitening(
    observations: Observations,
    jacobian: np.ndarray | None,
    noise: Noise,
    roots: np.ndarray | None = None,
) -> Whitening:
    """Compute the whitening of averaged observations.

    Observations of a state share the joints' error of one approach. If poses have an
    error in common, the observations of all states of a pose share it.

    Parameters
    ----------
    observations : Observations
    jacobian : (M, rows, n) array or None
        With respect to the joints. It is not needed if the noise has no joint error.
    noise : Noise
        Of a single measurement.
    roots : (M, rows, rows) array, optional
        Of the covariances of single measurements, see `compute_sensor_roots`; needed if
        they are not all alike.
    """
    rows = observations.rows
    repeats = observations.states.repeats[observations.state]
    if not noise.has_joint_error:
        if roots is None:
            factors = (np.sqrt(repeats)[:, None] / noise.sensor_std(rows))[
                ..., None
            ] * np.eye(rows)
        else:
            factors = np.sqrt(repeats)[:, None, None] * np.linalg.inv(roots)
        return Whitening(((np.arange(len(factors))[:, None], factors),))
    assert jacobian is not None
    group = observations.cluster if noise.pose_rad else observations.state
    blocks = []
    for members in batch_groups_by_size(group):
        of_members = jacobian[members]
        stacked = of_members.reshape(len(members), members.shape[1] * rows, -1)
        state = np.repeat(observations.state[members], rows, axis=1)
        repeats_of_row = np.repeat(repeats[members], rows, axis=1)
        # The mean of k repeats has one k-th of their variance.
        same_state = state[:, :, None] == state[:, None, :]
        averaging = same_state / repeats_of_row[:, None, :]
        pose_covariance = noise.pose_rad**2 * (stacked @ stacked.transpose(0, 2, 1))
        covariance = (
            averaging
            * compute_measurement_covariances(
                noise,
                of_members,
                rows,
                None if roots is None else roots[members],
            )
            + pose_covariance
        )
        blocks.append((members, np.linalg.inv(np.linalg.cholesky(covariance))))
    return Whitening(tuple(blocks))


@dataclass
class _ProblemBlock:
    """State of the iteration for one block of observations.

    Attributes
    ----------
    indices : slice of all observations
    observations : Observations
    conditions : Conditions or None
        Of the states of the block if conditions stay in memory.
    linear_model : LinearModel or None
        About the present estimate if conditions stay in memory.
    joint_jacobian : (M', rows, n) array or None
        Jacobian with which `whitening` was computed, if conditions stay in memory.
    coordinates : (S, C) array or None
        Otherwise, the displaced coordinates at which loads are evaluated.
    whitening : Whitening, without blocks until it is computed
    """

    indices: slice
    observations: Observations
    conditions: Conditions | None = None
    linear_model: LinearModel | None = None
    joint_jacobian: np.ndarray | None = None
    coordinates: np.ndarray | None = None
    whitening: Whitening = Whitening(())


@dataclass(frozen=True)
class FittedState:
    """What stays in memory of a finished fit, for all M observations.

    Attributes
    ----------
    whitening : Whitening
    residual : (M, rows) array, m and rad, base axes
    joint_jacobian : (M, rows, n) array with respect to the joints; None if there are
        too many states to keep it
    conditions : Conditions of the states; None if there are too many to keep them
    """

    whitening: Whitening
    residual: np.ndarray
    joint_jacobian: np.ndarray | None
    conditions: Conditions | None


class LeastSquaresProblem:
    """Weighted, whitened least squares of a model, summed over blocks of whole poses.

    For very many states, nothing stays in memory from step to step except the whitening
    of the last step and the displaced coordinates.

    Parameters
    ----------
    model : Model
    observations : Observations
    noise : Noise
    estimate : Estimate
        Estimate at which loads are evaluated first.
    plausible : (P,) array
        Plausible size of each parameter.
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
        self.blocks = [
            _ProblemBlock(block.indices, block.observations)
            for block in split_into_blocks(observations, len(plausible))
        ]
        self.in_memory = len(observations.states) <= _MAX_STATES_IN_MEMORY
        if self.in_memory:
            for block in self.blocks:
                block.conditions = evaluate_conditions(
                    model, estimate, block.observations.states
                )
        self.strains = compute_mean_strains(model, estimate, observations)
        # The factored form needs each whitened row to belong to one state, so a pose
        # error that correlates several states rules it out.
        poses = observations.cluster.max() + 1
        self.factored = not noise.pose_rad or poses == len(observations.states)

    def linearize(self, estimate: Estimate) -> None:
        """Linearize the model about an estimate."""
        self.estimate = estimate
        residuals = []
        for block in self.blocks:
            if block.conditions is None:
                residuals.append(self._compute_block_residual(block, estimate))
            else:
                block.linear_model = linearize_residual(
                    self.model, estimate, block.observations, block.conditions
                )
                residuals.append(block.linear_model.residual)
        self.residual = np.concatenate(residuals)

    def whiten(self) -> None:
        """Evaluate loads and whitening at the present estimate."""
        self.whitened_at = self.estimate
        for block in self.blocks:
            if block.linear_model is not None:
                block.conditions = block.linear_model.conditions
                block.joint_jacobian = block.linear_model.joint_jacobian
                block.whitening = self._compute_whitening(block, block.joint_jacobian)
            elif not block.whitening.blocks and self.noise.has_joint_error:
                self._linearize_block(block)
            elif not block.whitening.blocks:
                block.whitening = self._compute_whitening(block, None)

    def normal_equations(
        self, weights: np.ndarray, reused_gram: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Assemble the normal equations of the weighted, whitened residual.

        Parameters
        ----------
        weights : (M,) array
        reused_gram : (P, P) array, optional
            Gram matrix of an earlier step, if it is to be used again.

        Returns
        -------
        gram : (P, P) array
            Products of the sensitivities, each in units of its plausible size.
        gradient : (P,) array
            Products of these sensitivities with the residual.
        """
        size = len(self.plausible)
        gram = np.zeros((size, size))
        gradient = np.zeros(size)
        root = np.sqrt(weights)
        squares = 0.0
        for block in self.blocks if size else ():
            linear_model = block.linear_model or self._linearize_block(block)
            whitening = block.whitening
            residual = linear_model.residual
            block_root = root[block.indices]
            whitened_map = whitening.after(
                _map_to_rotation_vectors(residual) * block_root[:, None, None]
            )
            whitened = whitening.apply(residual * block_root[:, None])
            squares += float((whitened**2).sum())
            adjoint = whitened_map.transposed.apply(whitened)
            gradient += linear_model.columns.times(adjoint[..., None])[:, 0]
            if reused_gram is None:
                gram += self._compute_gram(linear_model, whitened_map)
        if self.strains is not None:
            stretch = self._compute_stretch(self.estimate)
            gram, gradient = _add_strains(
                gram, gradient, squares, self.strains / stretch
            )
            gram /= stretch**2
            gradient /= stretch**2
        if reused_gram is None:
            reused_gram = gram * np.outer(self.plausible, self.plausible)
        return reused_gram, gradient * self.plausible

    def _compute_gram(
        self, linear_model: LinearModel, whitened_map: Whitening
    ) -> np.ndarray:
        """Products (P, P) of the sensitivities of a block after a linear map."""
        columns = linear_model.columns
        size = len(self.plausible)
        if self.factored and size > _COLUMNS_PER_COORDINATE * len(columns.spans):
            jacobian = whitened_map.apply(columns.jacobian)
            return replace(columns, jacobian=jacobian).gram()
        dense = whitened_map.apply(linear_model.sensitivities)
        dense = dense.reshape(linear_model.residual.size, size)
        return dense.T @ dense

    def distance(self) -> np.ndarray:
        """Whitened distance (M,) of each observation from its prediction."""
        return np.sqrt((self._whiten(self.residual) ** 2).mean(axis=1))

    def squares(self, weights: np.ndarray, estimate: Estimate | None = None) -> float:
        """Compute the sum of squares of the weighted, whitened residual.

        Heights of contacts are divided by the mean of |dh/dt|: see `contact_density`.

        Parameters
        ----------
        weights : (M,) array
        estimate : Estimate, optional
            The present one by default.
        """
        if estimate is None:
            estimate = self.estimate
            residual = self.residual
        else:
            residual = self._compute_residual(estimate)
        # The errors of an instrument keep the axes of its session, so turn the residual
        # into the base axes of the estimate at which the whitening was computed.
        if self.model.measuring is None:
            turn = (
                self.whitened_at.frame_rotation.transpose(0, 2, 1)
                @ estimate.frame_rotation
            )
            if (turn != np.eye(3)).any():
                session = estimate.index_sessions(self.observations)
                vectors = residual.reshape(len(residual), -1, 3)
                turned = vectors @ turn[session].transpose(0, 2, 1)
                residual = turned.reshape(residual.shape)
        weighted = self._whiten(residual * np.sqrt(weights)[:, None])
        squares = float((weighted**2).sum())
        if self.strains is None:
            return squares
        return squares / self._compute_stretch(estimate) ** 2

    def finish(self, estimate: Estimate) -> FittedState:
        """Evaluate at the last estimate, under the loads to which the last step led."""
        for block in self.blocks:
            if block.linear_model is not None:
                block.conditions = update_springs_and_masses(
                    self.model, estimate, block.linear_model.conditions
                )
        whitening_blocks = []
        jacobians = []
        for block in self.blocks:
            for members, factor in block.whitening.blocks:
                whitening_blocks.append((members + block.indices.start, factor))
            if block.joint_jacobian is not None:
                jacobians.append(block.joint_jacobian)
        conditions = None
        if (
            len(self.observations.states) <= _MAX_STATES_OF_A_FIT
            and len(self.blocks) == 1
        ):
            conditions = self.blocks[0].conditions
        return FittedState(
            Whitening(tuple(whitening_blocks)),
            self._compute_residual(estimate),
            np.concatenate(jacobians) if jacobians else None,
            conditions,
        )

    def _compute_stretch(self, estimate: Estimate) -> float:
        """Compute the mean of |dh/dt| over contacts, relative to the nominal robot."""
        assert self.strains is not None
        values = get_parameter_values(self.model, estimate)
        return 1.0 + float(self.strains @ values)

    def _compute_residual(self, estimate: Estimate) -> np.ndarray:
        return np.concatenate(
            [self._compute_block_residual(block, estimate) for block in self.blocks]
        )

    def _compute_block_residual(
        self, block: _ProblemBlock, estimate: Estimate
    ) -> np.ndarray:
        conditions = self._get_conditions(block, estimate)
        return compute_residuals(self.model, estimate, block.observations, conditions)

    def _whiten(self, residual: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [block.whitening.apply(residual[block.indices]) for block in self.blocks]
        )

    def _get_conditions(self, block: _ProblemBlock, estimate: Estimate) -> Conditions:
        """Conditions in memory; otherwise evaluated at the block's coordinates, which
        are computed the first time."""
        if block.conditions is not None:
            return block.conditions
        conditions = evaluate_conditions(
            self.model, estimate, block.observations.states, block.coordinates
        )
        if block.coordinates is None:
            block.coordinates = compute_displaced_coordinates(
                self.model, estimate, conditions
            )
        return conditions

    def _linearize_block(self, block: _ProblemBlock) -> LinearModel:
        """Linearize a block that does not stay in memory, and update its loads and
        whitening."""
        conditions = self._get_conditions(block, self.estimate)
        linear_model = linearize_residual(
            self.model, self.estimate, block.observations, conditions
        )
        block.coordinates = linear_model.coordinates
        block.whitening = self._compute_whitening(block, linear_model.joint_jacobian)
        return linear_model

    def _compute_whitening(
        self, block: _ProblemBlock, jacobian: np.ndarray | None
    ) -> Whitening:
        roots = compute_sensor_roots(
            self.model, self.estimate, block.observations, self.noise
        )
        return compute_whitening(block.observations, jacobian, self.noise, roots)


def _add_strains(
    gram: np.ndarray, gradient: np.ndarray, squares: float, strains: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Change Gram matrix (P, P) and gradient (P,) to those of the residual over the mean
    |dh/dt| of contacts, times this mean.

    With sensitivities S, residual r and the strains s over the mean, S becomes S + r s'.
    """
    mixed = np.outer(gradient, strains)
    gram = gram + mixed + mixed.T + squares * np.outer(strains, strains)
    return gram, gradient + squares * strains


def _map_to_rotation_vectors(residual: np.ndarray) -> np.ndarray:
    """Compute the matrices (M, rows, rows) that map sensitivities of poses to those of the
    residual.

    If a pose turns by -w, its rotation vector r grows by w + r x w / 2 + O(r^2):
    Bortz's equation (IEEE Trans. Aerosp. Electron. Syst. 7, 1971).
    """
    maps = np.tile(np.eye(residual.shape[1]), (len(residual), 1, 1))
    if residual.shape[1] > 3:
        maps[:, 3:, 3:] += 0.5 * form_cross_matrices(residual[:, 3:])
    return maps
