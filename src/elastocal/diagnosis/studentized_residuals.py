"""Distance of each row from what the other rows predict, in standard deviations.

This is the length of the externally studentized residual [1]_: the residual of a row
from a fit without that row, whitened by its covariance. It comes in closed form from a
fit to all rows, by their leverages.

References
----------
.. [1] Cook and Weisberg, Residuals and Influence in Regression, 1982.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaincinv

from elastocal.effects.conditions import select_conditions
from elastocal.fitting.linearization import linearize, linearize_coordinates
from elastocal.fitting.model import (
    compute_residuals,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.normal_equations import compute_measurement_covariances
from elastocal.fitting.observations import (
    select_spread_poses,
    select_states,
    separate_measurements,
    split_into_blocks,
)
from elastocal.fitting.sensor_noise import (
    compute_sensor_roots,
    standardize_residual,
)

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# Rows farther off than this share of all are examined closely, however many there are.
_EXAMINED_QUANTILE = 0.75
# Lower bound on the share of a row's variance that is independent of the fit. A row
# with more leverage than 0.99 determines a parameter by itself, and its residual says
# nothing.
_MIN_RESIDUAL_SHARE = 0.01
# Shares of the estimated pose error that are tried as the pose error of the rows.
_POSE_ERROR_SHARES = (0.0, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
# Sample size for the scale of the residuals, which so many rows give to one percent.
# More rows determine the parameters so well that leverage hardly counts.
MAX_SAMPLE_SIZE = 4_000


@dataclass(frozen=True)
class PredictionUncertainty:
    """What makes a good row differ from its prediction.

    Attributes
    ----------
    noise
        Noise of one row.
    parameter_covariance
        (P, P), covariance of the fitted parameters under this noise; None if it is
        negligible.
    """

    noise: Noise
    parameter_covariance: np.ndarray | None


@dataclass(frozen=True)
class _RowBlock:
    """Some of the examined rows, m rows of c components; residuals are in base axes.

    Attributes
    ----------
    rows
        Their indices among the examined rows.
    sensitivities
        (m, c, P), sensitivities to the parameters; None if the parameter covariance is
        negligible.
    noise_covariance
        (m, c, c), covariance of the noise of single rows.
    joint_covariance
        (m, c, c), covariance that an error of one radian in each joint causes.
    """

    rows: slice
    sensitivities: np.ndarray | None
    noise_covariance: np.ndarray
    joint_covariance: np.ndarray


@dataclass(frozen=True)
class StudentizedResiduals:
    """Residuals of N rows of c components from a model, ready to be studentized.

    In a long campaign only a sample and the rows with large residuals are linearised
    and examined closely; the others keep their distance by the sensor noise.

    Attributes
    ----------
    residual
        (N, c), m and rad, base axes.
    sensor_distance
        (N,), length of the residual in standard deviations of the sensor.
    in_sample
        (N,) of bool, rows at poses spread over those that were fitted.
    examined
        (N,) of bool, the rows of the blocks: the sample, and every row that is as far
        off as the farthest quarter of the campaign.
    blocks
        The examined rows.
    noise
        Noise of one row, without the pose error.
    """

    residual: np.ndarray
    sensor_distance: np.ndarray
    in_sample: np.ndarray
    examined: np.ndarray
    blocks: list[_RowBlock]
    noise: Noise

    def estimate_uncertainty(self, fitted: Fit) -> PredictionUncertainty:
        """Estimate from the sampled rows how far good rows are from their predictions.

        The rows themselves choose the share of the fit's pose error that makes their
        generalized variance smallest, an S-estimate [1]_. The other share may come from
        the very errors that are sought, or from a nonlinear effect.

        References
        ----------
        .. [1] Davies, Annals of Statistics 15, 1987.
        """
        shares = _POSE_ERROR_SHARES if fitted.noise.pose_rad else (0.0,)
        ranked = []
        for share in shares:
            noise = replace(self.noise, pose_rad=share * fitted.noise.pose_rad)
            whiteners = self._compute_whiteners(noise)
            covariance = self._compute_parameter_covariance(fitted, whiteners)
            log_variance = self._log_generalized_variance(whiteners, covariance)
            ranked.append((log_variance, PredictionUncertainty(noise, covariance)))
        return min(ranked, key=lambda entry: entry[0])[1]

    def compute_distances(
        self, uncertainty: PredictionUncertainty, fitted: np.ndarray
    ) -> np.ndarray:
        """Distances from the predictions by the other rows, in standard deviations.

        Parameters
        ----------
        uncertainty
            Noise of a row and covariance of the parameters.
        fitted
            (N,) of bool, rows that the parameters were fitted to. The fit makes the
            residuals of these smaller and those of all others larger.

        Returns
        -------
        ndarray
            (N,); the distance by the sensor noise for rows that are not examined.
        """
        distance = self.sensor_distance.copy()
        distance[self.examined] = self._compute_examined_distances(
            self._compute_whiteners(uncertainty.noise),
            uncertainty.parameter_covariance,
            fitted[self.examined],
        )
        return distance

    def _compute_whiteners(self, noise: Noise) -> list[np.ndarray]:
        """Inverse Cholesky factors of the row covariances, (m, c, c) for each block."""
        whiteners = []
        for block in self.blocks:
            joint_covariance = noise.pose_rad**2 * block.joint_covariance
            covariance = block.noise_covariance + joint_covariance
            whiteners.append(np.linalg.inv(np.linalg.cholesky(covariance)))
        return whiteners

    def _compute_parameter_covariance(
        self, fitted: Fit, whiteners: list[np.ndarray]
    ) -> np.ndarray | None:
        """Covariance of the parameters by the sampled rows, (P, P), in units of their
        plausible sizes while it is inverted; None if it is negligible."""
        free = ~fitted.unidentifiable
        if not free.any():
            return None
        in_sample = self.in_sample[self.examined]
        sizes = np.array([p.plausible for _, p in fitted.parameters])[free]
        information = np.diag((sizes / fitted.prior_std[free]) ** 2)
        for block, whitener in zip(self.blocks, whiteners, strict=True):
            if block.sensitivities is None:
                return None
            whitened = whitener @ (block.sensitivities[..., free] * sizes)
            rows = whitened[in_sample[block.rows]].reshape(-1, len(sizes))
            information += rows.T @ rows
        covariance = np.zeros((len(free), len(free)))
        inverse = np.linalg.pinv(information, hermitian=True)
        covariance[np.ix_(free, free)] = inverse * np.outer(sizes, sizes)
        return covariance

    def _log_generalized_variance(
        self, whiteners: list[np.ndarray], covariance: np.ndarray | None
    ) -> float:
        """Logarithm of the determinant of the scatter of most sampled rows.

        The scatter is the noise covariance times the squared scale of the distances,
        which is at least one: rows do not scatter less than their known noise, and a
        share of the pose error that claims so is too large.
        """
        in_sample = self.in_sample[self.examined]
        components = self.residual.shape[1]
        log_dets = [
            np.log(np.diagonal(whitener, axis1=1, axis2=2)).sum(axis=1)
            for whitener in whiteners
        ]
        log_volume = -np.concatenate(log_dets)[in_sample].mean()
        fitted = np.ones(len(in_sample), bool)
        distance = self._compute_examined_distances(whiteners, covariance, fitted)
        scale = np.median(distance[in_sample]) / chi_quantile(0.5, components)
        return log_volume + components * np.log(max(scale, 1.0))

    def _compute_examined_distances(
        self,
        whiteners: list[np.ndarray],
        covariance: np.ndarray | None,
        fitted: np.ndarray,
    ) -> np.ndarray:
        """As `compute_distances`, of the examined rows alone."""
        distance = np.empty(len(fitted))
        residual = self.residual[self.examined]
        for block, whitener in zip(self.blocks, whiteners, strict=True):
            whitened = whitener @ residual[block.rows, :, None]
            studentized = whitened
            if covariance is not None and block.sensitivities is not None:
                leverage = _compute_leverages(
                    whitener @ block.sensitivities, covariance
                )
                scatter = _compute_scatter(leverage, fitted[block.rows])
                studentized = np.linalg.solve(scatter, whitened)
            squares = (whitened * studentized).sum(axis=(1, 2))
            distance[block.rows] = np.sqrt(squares)
        return distance


def _compute_leverages(sensitivities: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Diagonal blocks of the hat matrix, (m, c, c), by whitened sensitivities (m, c, P)
    and the parameter covariance (P, P)."""
    product = (sensitivities.reshape(-1, len(covariance)) @ covariance).reshape(
        sensitivities.shape
    )
    return product @ sensitivities.transpose(0, 2, 1)


def _compute_scatter(leverage: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """Covariances of the whitened residuals of rows with given leverages, (m, c, c).

    The residual of a row that was fitted has the covariance I - H, the deviation of a
    new row from its prediction I + H, with H the leverage. If H comes close to I, the
    eigenvalues of I - H are bounded from below.
    """
    sign = np.where(fitted, -1.0, 1.0)[:, None, None]
    scatter = np.eye(leverage.shape[1]) + sign * leverage
    total_leverage = np.trace(leverage, axis1=1, axis2=2)
    dominant = fitted & (total_leverage > 1.0 - _MIN_RESIDUAL_SHARE)
    values, axes = np.linalg.eigh(scatter[dominant])
    bounded = np.maximum(values, _MIN_RESIDUAL_SHARE)
    scatter[dominant] = (axes * bounded[:, None]) @ axes.transpose(0, 2, 1)
    return scatter


def examine_residuals(
    model: Model,
    estimate: Estimate,
    measurements: Measurements,
    noise: Noise,
    kept: np.ndarray,
    *,
    include_parameters: bool,
) -> StudentizedResiduals:
    """Compute the residuals of all rows, and linearise the examined rows.

    Parameters
    ----------
    model, estimate
        What predicts the rows.
    measurements
        N rows.
    noise
        Noise of one row, without the pose error.
    kept
        (N,) of bool, rows that the sample is taken from.
    include_parameters
        Whether to provide for the covariance of the parameters, which is negligible
        after a fit to many rows.
    """
    observations = separate_measurements(measurements)
    in_sample = kept.copy()
    in_sample[kept] = select_spread_poses(
        select_states(observations, kept), MAX_SAMPLE_SIZE
    )
    spread = select_spread_poses(observations, MAX_SAMPLE_SIZE)
    # If every row is examined, both passes share the conditions of all rows.
    shared = None
    if spread.all():
        shared = evaluate_conditions(model, estimate, observations.states)
    residual = _compute_in_blocks(model, estimate, observations, shared)
    roots = compute_sensor_roots(model, estimate, observations, noise)
    sensor_distance = np.linalg.norm(
        standardize_residual(residual, noise, roots), axis=1
    )
    limit = np.quantile(sensor_distance[spread], _EXAMINED_QUANTILE)
    examined = spread | in_sample | (sensor_distance > limit)
    blocks = _linearize_rows(
        model,
        estimate,
        select_states(observations, examined),
        noise,
        shared,
        include_parameters=include_parameters,
    )
    return StudentizedResiduals(
        residual, sensor_distance, in_sample, examined, blocks, noise
    )


def _compute_in_blocks(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    shared: Conditions | None,
) -> np.ndarray:
    """Compute the residuals (N, r) of all observations, some at a time."""
    residual = np.empty((len(observations), model.rows))
    for states, rows, block in split_into_blocks(observations, 0):
        around = _conditions_at(model, estimate, block, shared, states)
        residual[rows] = compute_residuals(model, estimate, block, around)
    return residual


def _linearize_rows(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    noise: Noise,
    shared: Conditions | None,
    *,
    include_parameters: bool,
) -> list[_RowBlock]:
    """Linearise the examined observations in blocks, with their covariances.

    The sensitivities to the parameters are computed only if they are included.
    """
    blocks = []
    linearized = linearize if include_parameters else linearize_coordinates
    columns = len(list_parameters(model, estimate))
    for states, rows, block in split_into_blocks(observations, columns):
        around = _conditions_at(model, estimate, block, shared, states)
        linear_model = linearized(model, estimate, block, around)
        jacobian = linear_model.joint_jacobian[:, None]
        roots = compute_sensor_roots(model, estimate, block, noise)
        roots = None if roots is None else roots[:, None]
        blocks.append(
            _RowBlock(
                rows,
                linear_model.sensitivities if include_parameters else None,
                compute_measurement_covariances(noise, jacobian, model.rows, roots),
                jacobian[:, 0] @ jacobian[:, 0].transpose(0, 2, 1),
            )
        )
    return blocks


def _conditions_at(
    model: Model,
    estimate: Estimate,
    block: Observations,
    shared: Conditions | None,
    states: slice,
) -> Conditions:
    """Conditions of a block of the observations: its `states` of the shared ones."""
    if shared is None:
        return evaluate_conditions(model, estimate, block.states)
    if len(block.states) == len(shared.joint_angles):
        return shared
    return select_conditions(shared, states)


def estimate_prediction_uncertainty(
    fitted: Fit, noise: Noise, measurements: Measurements
) -> PredictionUncertainty:
    """Estimate how far good rows are from the predictions of a fit.

    Parameters
    ----------
    fitted
        The fit.
    noise
        Noise of one row as it was declared or as repeats show it.
    measurements
        Rows that the model was fitted to.
    """
    sampled = select_spread_poses(separate_measurements(measurements), MAX_SAMPLE_SIZE)
    return examine_residuals(
        fitted.model,
        fitted.estimate,
        measurements.select(sampled),
        noise,
        sampled[sampled],
        include_parameters=len(measurements) <= MAX_SAMPLE_SIZE,
    ).estimate_uncertainty(fitted)


def chi_quantile(probability: float | tuple[float, ...], components: int) -> np.ndarray:
    """Quantiles of the chi distribution: of the length of a standard normal vector of
    so many components."""
    return np.sqrt(2 * gammaincinv(components / 2, probability))
