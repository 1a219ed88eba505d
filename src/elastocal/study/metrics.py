"""Equations 12-15: how good an identified model is, in its stiffnesses and at the
end-effector."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import (
    build_regressor,
    compute_exact_deflections,
    compute_joint_torques,
    select_loaded_point,
)
from elastocal.mechanics.kinematics import compute_jacobians

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.simulation import Experiments

# Block size: the errors of this many models at 500 test configurations fit into a
# second-level cache.
MODELS_PER_BLOCK = 400


@dataclass(frozen=True)
class ValidationSet:
    """Loaded test configurations that no identification uses, for the errors of models.

    Attributes
    ----------
    reference : (n,) array, rad/(N m)
        Compliances about which the prediction is linear.
    quadratic_forms : (tests, (n + 1)(n + 2) / 2) array
        Squared position error at each test configuration as a quadratic form in
        (c - reference, 1).
    initial_errors : (tests,) array, m
        Position error without any elastostatic model: the deflection itself.
    """

    reference: np.ndarray
    quadratic_forms: np.ndarray
    initial_errors: np.ndarray

    @cached_property
    def mean_form(self) -> np.ndarray:
        """Matrix (n + 1, n + 1) of the mean quadratic form.

        Without its last row and column it is the mean of A^T A, m^2 per
        (rad/(N m))^2.
        """
        size = len(self.reference) + 1
        half = np.zeros((size, size))
        half[np.triu_indices(size)] = self.quadratic_forms.mean(axis=0) / 2
        return half + half.T

    def compute_mean_square(self, compliance: np.ndarray) -> np.ndarray:
        """Mean squared position error (..., models) over the test configurations, m^2,
        of compliances (..., n, models)."""
        error = compliance - self.reference[:, None]
        return evaluate_quadratic_form(self.mean_form, error)


def evaluate_quadratic_form(form: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Values (..., models) of a form in (error, 1) at errors (..., n, models)."""
    extended = np.concatenate([error, np.ones_like(error[..., :1, :])], axis=-2)
    return (extended * (form @ extended)).sum(axis=-2)


def make_validation_set(
    robot: Robot,
    experiments: Experiments,
    true_deflection: np.ndarray,
    wrench_at: str = "end_effector",
) -> ValidationSet:
    """Prepare test configurations for the errors of the reduced model.

    The position error of a model c is (exact prediction at the reference - true
    position) + A (c - reference). The neglected terms are of second order in the
    compliance *error*, below a thousandth of the error itself.

    Parameters
    ----------
    robot : Robot
        Its joint compliances are the reference.
    experiments : Experiments
        The test configurations and their loads.
    true_deflection : (..., 6) array, m and rad
        Deflection of the end-effector, simulated with the robot's full model.
    wrench_at : str
        Interpretation R6; it matters if a target is offset from the end-effector.
    """
    chain = robot.chain
    angles = experiments.joint_angles
    point = chain.end_effector
    loaded = select_loaded_point(chain, point, wrench_at)
    torques = compute_joint_torques(chain, angles, experiments.wrench, loaded)
    jacobian = compute_jacobians(chain, angles, point)
    slope = build_regressor(jacobian, torques)[..., :3, :].reshape(-1, 3, robot.joints)
    predicted = compute_exact_deflections(
        chain, angles, robot.compliance * torques, point
    )
    offset = (predicted - true_deflection)[..., :3].reshape(-1, 3, 1)
    rows = np.concatenate([slope, offset], axis=-1)
    first, second = np.triu_indices(robot.joints + 1)
    multiplicity = np.where(first == second, 1.0, 2.0)
    forms = (rows[..., first] * rows[..., second]).sum(axis=1) * multiplicity
    initial = np.linalg.norm(true_deflection[..., :3], axis=-1).ravel()
    return ValidationSet(robot.compliance, forms, initial)


def compute_position_errors(
    validation: ValidationSet, compliance: np.ndarray
) -> np.ndarray:
    """End-effector position errors (models, tests), m, of models (models, n) at every
    test configuration."""
    ones = np.ones(len(compliance))
    error = np.column_stack([compliance - validation.reference, ones])
    first, second = np.triu_indices(error.shape[1])
    squares = (error[:, first] * error[:, second]) @ validation.quadratic_forms.T
    return np.sqrt(np.maximum(squares, 0.0, out=squares), out=squares)


def compute_mean_deviation(
    validation: ValidationSet, compliance: np.ndarray, test_weights: np.ndarray
) -> np.ndarray:
    """Equation 15: mean position error of models over the test configurations.

    Parameters
    ----------
    validation
    compliance : (groups, models, n) array, rad/(N m)
    test_weights : (groups, tests) array
        How often each test configuration counts for a group of models.

    Returns
    -------
    (groups, models) array, m
    """
    groups, models, joints = compliance.shape
    sums = np.empty((groups, models))
    size = max(1, MODELS_PER_BLOCK // models)
    for start in range(0, groups, size):
        block = slice(start, start + size)
        errors = compute_position_errors(
            validation, compliance[block].reshape(-1, joints)
        ).reshape(-1, models, test_weights.shape[1])
        sums[block] = (errors @ test_weights[block, :, None])[..., 0]
    return sums / test_weights.sum(axis=1, keepdims=True)


def compute_relative_stiffness_error(
    compliance: np.ndarray, true_compliance: np.ndarray
) -> np.ndarray:
    """Equation 13: (k - k0) / k0 in percent, with k = 1 / c, of compliances (..., n)."""
    return 100.0 * (true_compliance / compliance - 1.0)


def compute_k_sigma(
    compliance: np.ndarray,
    true_compliance: np.ndarray,
    joints: Sequence[int] | slice = slice(None),
) -> np.ndarray:
    """Equation 14: sum of the relative stiffness errors in percent over all joints, or
    some of them (interpretation R10)."""
    errors = compute_relative_stiffness_error(compliance, true_compliance)
    return errors[..., joints].sum(axis=-1)


def compute_scores(
    compliance: np.ndarray,
    deviation: np.ndarray,
    true_compliance: np.ndarray,
    fixed_joints: Sequence[int],
) -> dict[str, np.ndarray]:
    """Compute the scores (..., lengths) of averaged models.

    Parameters
    ----------
    compliance : (..., lengths, n) array
    deviation : (..., lengths) array
    true_compliance : (n,) array
    fixed_joints
        Joints that are fixed in the last stage.
    """
    return {
        "k_sigma": compute_k_sigma(compliance, true_compliance),
        "k_sigma_fixed_joints": compute_k_sigma(
            compliance, true_compliance, list(fixed_joints)
        ),
        "deviation": deviation,
    }


def find_kept_length(values: np.ndarray, limit: float) -> np.ndarray:
    """Find the first data set length from which on a metric stays within `limit` in
    absolute value.

    Parameters
    ----------
    values : (..., lengths) array
        The metric for the lengths 1, 2, 3 ...; NaN counts as above the limit.
    limit : float

    Returns
    -------
    (...) array
        Infinite if the longest data set is not within the limit.
    """
    above = ~(np.abs(values) <= limit)
    longest = values.shape[-1]
    last_above = longest - above[..., ::-1].argmax(axis=-1)
    kept = np.where(above.any(axis=-1), last_above + 1.0, 1.0)
    return np.where(kept <= longest, kept, np.inf)


def extrapolate_length(values: np.ndarray, limit: float) -> np.ndarray:
    """Data set length at which a metric comes down to `limit`, beyond the longest one if
    necessary.

    As `find_kept_length`; if that is infinite, the metric is extrapolated as a bias of
    second order, which falls as 1 / length.
    """
    kept = find_kept_length(values, limit)
    longest = values.shape[-1]
    excess = np.maximum(np.abs(values[..., -1]) / limit, 1.0)
    return np.where(np.isfinite(kept), kept, longest * excess)


def extrapolate_first_length(values: np.ndarray, limit: float) -> np.ndarray:
    """As `extrapolate_length`, but the first length within the limit, even if longer data
    sets leave it again (the alternative to interpretation R14)."""
    within = np.abs(values) <= limit
    first = within.argmax(axis=-1) + 1.0
    return np.where(within.any(axis=-1), first, extrapolate_length(values, limit))
