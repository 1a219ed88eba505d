"""Equations 12-15: how good an identified model is, in its stiffnesses and at the
end-effector."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import (
    exact_deflections,
    joint_torques,
    loaded_point,
    regressor,
)
from elastocal.mechanics.kinematics import jacobians

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.simulation import Experiments

# So many models at a time keep their errors at 500 test configurations in a
# second-level cache.
MODELS_AT_A_TIME = 400


@dataclass(frozen=True)
class ValidationSet:
    """Loaded configurations that no identification has seen, ready to score any
    compliances.

    `reference` (n,): compliances about which the prediction is linear, rad/(N m).
    `quadratic_forms` (tests, (n + 1)(n + 2) / 2): squared position error at each test
    configuration as a quadratic form in (c - reference, 1). `initial_errors` (tests,):
    position error without any elastostatic model: the deflection itself, m.
    """

    reference: np.ndarray
    quadratic_forms: np.ndarray
    initial_errors: np.ndarray

    @cached_property
    def form(self) -> np.ndarray:
        """Their mean as a matrix; but for the last row and column that of A^T A, m^2
        per (rad/(N m))^2."""
        size = len(self.reference) + 1
        half = np.zeros((size, size))
        half[np.triu_indices(size)] = self.quadratic_forms.mean(axis=0) / 2
        return half + half.T

    def mean_square(self, compliance: np.ndarray) -> np.ndarray:
        """Mean squared position error (..., models) over the test configurations, m^2,
        of compliances (..., n, models)."""
        return evaluate_quadratic_form(self.form, compliance - self.reference[:, None])


def evaluate_quadratic_form(form: np.ndarray, error: np.ndarray) -> np.ndarray:
    """A quadratic form in (error, 1) of errors (..., n, models) of compliances."""
    whole = np.concatenate([error, np.ones_like(error[..., :1, :])], axis=-2)
    return (whole * (form @ whole)).sum(axis=-2)


def make_validation_set(
    robot: Robot,
    experiments: Experiments,
    true_deflection: np.ndarray,
    wrench_at: str = "end_effector",
) -> ValidationSet:
    """Score sheet of the reduced model on test configurations.

    `robot`: its joint compliances are the reference. `true_deflection` (..., 6): of the
    end-effector, as simulated with the robot's full model. `wrench_at`: interpretation
    R6; it matters where a target is offset from the end-effector.

    The position error of a model c is (exact prediction at the reference - true
    position) + A (c - reference); what this leaves out is of second order in the
    compliance *error*, below a thousandth of the error itself.
    """
    point = robot.chain.end_effector
    at = loaded_point(robot.chain, point, wrench_at)
    torques = joint_torques(
        robot.chain, experiments.joint_angles, experiments.wrench, at
    )
    jacobian = jacobians(robot.chain, experiments.joint_angles, point)
    slope = regressor(jacobian, torques)[..., :3, :].reshape(-1, 3, robot.joints)
    predicted = exact_deflections(
        robot.chain, experiments.joint_angles, robot.compliance * torques, point
    )
    offset = (predicted - true_deflection)[..., :3].reshape(-1, 3, 1)
    rows = np.concatenate([slope, offset], axis=-1)
    first, second = np.triu_indices(robot.joints + 1)
    forms = (rows[..., first] * rows[..., second]).sum(axis=1) * np.where(
        first == second, 1.0, 2.0
    )
    initial = np.linalg.norm(true_deflection[..., :3], axis=-1).ravel()
    return ValidationSet(robot.compliance, forms, initial)


def compute_position_errors(judge: ValidationSet, compliance: np.ndarray) -> np.ndarray:
    """End-effector position error (models, tests), m, of models (models, n) at every
    test configuration."""
    error = np.column_stack([compliance - judge.reference, np.ones(len(compliance))])
    first, second = np.triu_indices(error.shape[1])
    squares = (error[:, first] * error[:, second]) @ judge.quadratic_forms.T
    return np.sqrt(np.maximum(squares, 0.0, out=squares), out=squares)


def compute_mean_deviation(
    judge: ValidationSet, compliance: np.ndarray, test_weights: np.ndarray
) -> np.ndarray:
    """Equation 15: position error of models, mean over the test configurations.

    `compliance` (groups, models, n). `test_weights` (groups, tests): how often each
    test configuration counts for a group of models. Returns (groups, models): m.
    """
    groups, models, joints = compliance.shape
    means = np.empty((groups, models))
    size = max(1, MODELS_AT_A_TIME // models)
    for part in (slice(start, start + size) for start in range(0, groups, size)):
        errors = compute_position_errors(
            judge, compliance[part].reshape(-1, joints)
        ).reshape(-1, models, test_weights.shape[1])
        means[part] = (errors @ test_weights[part, :, None])[..., 0]
    return means / test_weights.sum(axis=1, keepdims=True)


def compute_relative_stiffness_error(
    compliance: np.ndarray, true_compliance: np.ndarray
) -> np.ndarray:
    """Equation 13, (k - k0) / k0 in percent, with k = 1 / c; of compliances (...,
    n)."""
    return 100.0 * (true_compliance / compliance - 1.0)


def compute_k_sigma(
    compliance: np.ndarray,
    true_compliance: np.ndarray,
    joints: Sequence[int] | slice = slice(None),
) -> np.ndarray:
    """Equation 14: sum of the relative stiffness errors in percent over joints, or some
    of them (interpretation R10)."""
    return compute_relative_stiffness_error(compliance, true_compliance)[
        ..., joints
    ].sum(axis=-1)


def find_first_length_below(values: np.ndarray, limit: float) -> np.ndarray:
    """First data set length at which a metric is at most `limit` in absolute value.

    `values` (..., lengths): for the lengths 1, 2, 3 ...; not-a-number counts as above.
    Returns (...): infinite where no length reaches it.
    """
    below = np.abs(values) <= limit
    return np.where(below.any(axis=-1), below.argmax(axis=-1) + 1.0, np.inf)


def extrapolate_length(values: np.ndarray, limit: float) -> np.ndarray:
    """Data set length at which a metric comes down to `limit`, past the longest one if
    need be.

    As `first_length_below`; where that is infinite, the metric is continued as a bias
    of second order, which falls as 1 / length.
    """
    first = find_first_length_below(values, limit)
    longest = values.shape[-1]
    return np.where(
        np.isfinite(first),
        first,
        longest * np.maximum(np.abs(values[..., -1]) / limit, 1.0),
    )
