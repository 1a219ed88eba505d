"""Equation 11 for every prefix of many data sets in one pass, one strategy at a time.

The least-squares problem of the first k configurations, for every k, is solved by a QR decomposition that takes one
configuration after the other and all data sets at once. It gives the solution of the normal equations of equation 11 without
forming them, so that prefixes of one or two configurations keep their digits.

Inside this module the batch lies last in memory, as (..., configuration, data set).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.strategies import Stage, Strategy, drop_forgotten_stages

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


# Condition numbers come from squares of singular values, so they mean nothing beyond the root of the machine's precision; there
# the measurements do not determine the compliances.
_LARGEST_CONDITION = 1e7


@dataclass(frozen=True)
class Measurements:
    """What one measuring point contributes.

    `regressor` (rows, n, configurations, sets): matrix A of equation 10, base axes. `deflection` (rows, configurations, sets):
    measured deflection; rows are three displacements (m), then, where poses are measured, three rotations (rad).
    """

    regressor: np.ndarray
    deflection: np.ndarray


@dataclass(frozen=True)
class Prior:
    """Compliances that are known beforehand, as from a data sheet.

    `nominal` (n, sets): rad/(N m). `std` (n, sets): their standard deviations over that of the measurements.
    """

    nominal: np.ndarray
    std: np.ndarray

    def triangle(self, stage: Stage) -> np.ndarray:
        """The equations c / std = nominal / std of the joints that a stage identifies, (pivots, columns, sets)."""
        mine, pivots = list(stage.identified), len(stage.identified)
        found = np.zeros((pivots, pivots + len(stage.fixed) + 1, self.nominal.shape[1]))
        found[range(pivots), range(pivots)] = 1.0 / self.std[mine]
        found[:, -1] = self.nominal[mine] / self.std[mine]
        return found


@dataclass(frozen=True)
class Estimates:
    """What a strategy makes of each prefix; the first axis for the prefixes 1, 2, 3 ...

    `compliance` (configurations, n, sets): rad/(N m); not a number where the measurements of the prefix do not determine them.
    `covariance` (configurations, sets, n, n): of the compliances for measurements with unit variance, through all stages.
    `condition` (configurations, sets): 2-norm condition number of the identification Jacobian, the largest of the stages.
    """

    compliance: np.ndarray
    covariance: np.ndarray
    condition: np.ndarray


def first_solvable_length(strategy: Strategy, rows: int) -> int:
    """Smallest number of configurations with at least as many measurements as unknowns in every stage.

    `rows`: measurements of one point in one configuration: 6 for poses, 3 for positions.
    """
    return max(-(-len(stage.identified) // (rows * len(stage.points))) for stage in strategy.stages)


def identify(strategy: Strategy, measurements: Mapping[str, Measurements], joints: int) -> Estimates:
    """Compliances by a strategy for every prefix length of every data set, with covariance and condition number.

    Parameters
    ----------
    strategy : Strategy
    measurements : dict of str to Measurements
        For each measuring point of the strategy.
    joints : int
        Number of joints, n.

    Returns
    -------
    Estimates
    """
    compliance, triangles = estimate_compliance(strategy, measurements, joints)
    spread = covariance(strategy, measurements, triangles)
    condition = condition_numbers(strategy, triangles)
    undetermined = find_undetermined_prefixes(strategy, measurements, condition)
    np.moveaxis(compliance, 1, -1)[undetermined] = np.nan
    spread[undetermined] = np.nan
    condition[undetermined] = np.nan
    return Estimates(compliance, spread, condition)


def find_undetermined_prefixes(
    strategy: Strategy, measurements: Mapping[str, Measurements], condition: np.ndarray
) -> np.ndarray:
    """Which prefixes of which data sets do not determine the compliances: too few measurements, or not the right ones.

    `strategy`, `measurements`: as in `identify`. `condition` (configurations, sets): from `condition_numbers`. Returns
    (configurations, sets) of bool.
    """
    rows = next(iter(measurements.values())).regressor.shape[0]
    undetermined = ~(condition < _LARGEST_CONDITION)
    undetermined[: first_solvable_length(strategy, rows) - 1] = True
    return undetermined


def estimate_compliance(
    strategy: Strategy, measurements: Mapping[str, Measurements], joints: int, prior: Prior | None = None
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Solve the stages of a strategy one after the other (equation 11).

    `strategy`, `measurements`, `joints`: as in `identify`. `prior`: what is known beforehand, as further measurements of each
    stage (ridge regression towards it [1]). Returns `compliance` (configurations, n, sets): rad/(N m); meaningless where a
    prefix is too short, see `first_solvable_length`; `triangles` (configurations, pivots, columns, sets): triangular factor of
    each stage; columns: joints identified, joints fixed, right-hand side.

    [1] Hoerl, A. E. and Kennard, R. W., Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12, 1970.
    """
    *_, configurations, sets = next(iter(measurements.values())).regressor.shape
    compliance = np.full((configurations, joints, sets), np.nan)
    triangles = []
    for stage in strategy.stages:
        pivots = len(stage.identified)
        start = None if prior is None else prior.triangle(stage)
        triangle = prefix_triangles(_systems(stage, measurements), configurations, pivots, start)
        right = triangle[:, :, -1]
        for column, joint in enumerate(stage.fixed, pivots):
            right = right - triangle[:, :, column] * compliance[:, None, joint]
        with np.errstate(divide="ignore", invalid="ignore"):
            for row in range(pivots - 1, -1, -1):
                rest = right[:, row].copy()
                for column in range(row + 1, pivots):
                    rest -= triangle[:, row, column] * compliance[:, stage.identified[column]]
                compliance[:, stage.identified[row]] = rest / triangle[:, row, row]
        triangles.append(triangle)
    return compliance, triangles


def covariance(strategy: Strategy, measurements: Mapping[str, Measurements], triangles: Sequence[np.ndarray]) -> np.ndarray:
    """Covariance of the estimates for measurements of unit variance, through all stages, also where stages share measurements.

    That of a multi-step estimator, whose later stages take over what earlier ones have estimated [1]_; exact here, since every
    stage is linear.

    Parameters
    ----------
    strategy, measurements
        As in `identify`.
    triangles : sequence of ndarray
        From `estimate_compliance`.

    Returns
    -------
    ndarray (configurations, sets, n, n)

    Notes
    -----
    A stage with triangle R solves R_II c_I = z - R_IH c_H, I the joints identified and H those fixed, where the reduced
    measurements z = Q^T y have unit covariance. So the estimates are linear in the z of all stages, and what is left is the
    covariance of the z of two stages that share points: R_s^-T (sum of A_s^T A_t over the shared measurements) R_t^-1.

    References
    ----------
    .. [1] Murphy, K. M. and Topel, R. H., Estimation and inference in two-step econometric models, Journal of Business &
       Economic Statistics 3, 1985.
    """
    joints = next(iter(measurements.values())).regressor.shape[1]
    stages = drop_forgotten_stages(strategy, joints).stages
    gains: list[np.ndarray] = []
    inverses: list[np.ndarray] = []
    for stage, triangle in zip(stages, triangles[-len(stages) :], strict=True):
        pivots, size = list(stage.identified), len(stage.identified)
        inverse = _row_major(inverse_triangles(triangle[:, :, :size]))
        back = inverse @ _row_major(triangle[:, :, size:-1])
        for gain in gains:
            gain[..., pivots, :] = -back @ gain[..., list(stage.fixed), :]
        gains.append(np.zeros((*inverse.shape[:2], joints, size)))
        gains[-1][..., pivots, :] = inverse
        inverses.append(inverse)
    total = sum(gain @ np.swapaxes(gain, -1, -2) for gain in gains)
    for (s, earlier), (t, later) in combinations(enumerate(stages), 2):
        if shared := set(earlier.points) & set(later.points):
            information = _row_major(
                sum((prefix_information(measurements[name].regressor) for name in sorted(shared)), np.zeros(()))
            )
            products = information[..., list(earlier.identified), :][..., list(later.identified)]
            between = np.swapaxes(inverses[s], -1, -2) @ products @ inverses[t]
            cross = gains[s] @ between @ np.swapaxes(gains[t], -1, -2)
            total += cross + np.swapaxes(cross, -1, -2)
    return total


def condition_numbers(strategy: Strategy, triangles: Iterable[np.ndarray]) -> np.ndarray:
    """2-norm condition number of the identification Jacobian, the largest of the stages.

    Its inverse is an observability index of calibration [1].

    `triangles`: from `estimate_compliance`; their singular values are those of the regressor. Returns (configurations, sets):
    infinite where the smallest singular value is zero to rounding.

    [1] Driels, M. R. and Pathre, U. S., Significance of observation strategy on the design of robot calibration experiments,
        Journal of Robotic Systems 7, 1990.
    """
    largest: np.ndarray = np.ones(())
    for stage, triangle in zip(strategy.stages, triangles, strict=True):
        matrices = _row_major(triangle[:, :, : len(stage.identified)])
        eigenvalues = np.linalg.eigvalsh(np.swapaxes(matrices, -1, -2) @ matrices)
        with np.errstate(divide="ignore"):
            largest = np.maximum(largest, np.sqrt(eigenvalues[..., -1] / np.maximum(eigenvalues[..., 0], 0.0)))
    return largest


def prefix_triangles(
    systems: Iterable[np.ndarray], configurations: int, pivots: int, start: np.ndarray | None = None
) -> np.ndarray:
    """Triangular factor of the first k configurations, for every k, by Householder reflections [1].

    `systems` (rows, columns, sets): equations of one configuration after the other: unknowns first, right-hand side last. They
    are overwritten, and each may lie in the memory of the one before. `configurations`: how many systems there are. `pivots`:
    how many leading columns are unknowns to eliminate. `start` (pivots, columns, sets): the triangle before any of them; zero
    without. Returns (configurations, pivots, columns, sets): rows of R and, in the
    remaining columns, Q^T times them.

    Sequential accumulation [2]: the factor of k configurations on top of the rows of the next one is again reduced to a
    triangle; a reflection touches one row of the triangle and the new rows only.

    [1] Householder, A. S., Unitary triangularization of a nonsymmetric matrix, Journal of the ACM 5, 1958.
    [2] Lawson, C. L. and Hanson, R. J., Solving Least Squares Problems, Prentice-Hall, 1974.
    """
    triangles: np.ndarray
    products: np.ndarray
    for index, new in enumerate(systems):
        if index == 0:
            triangles = np.zeros((configurations, pivots, *new.shape[1:]))
            triangles[0] = 0.0 if start is None else start
            products = np.empty_like(new)
        else:
            triangles[index] = triangles[index - 1]
        triangle = triangles[index]
        for k in range(pivots):
            head, tail, rest = triangle[k, k], new[:, k], new[:, k + 1 :]
            dots = np.einsum("rs,rcs->cs", tail, new[:, k:])
            reflected = -np.copysign(np.sqrt(head * head + dots[0]), head)
            lead = head - reflected
            scale = -reflected * lead
            weight = lead * triangle[k, k + 1 :] + dots[1:]
            weight /= np.where(scale > 0, scale, 1.0)
            triangle[k, k + 1 :] -= lead * weight
            rest -= np.multiply(tail[:, None], weight, out=products[:, k + 1 :])
            triangle[k, k] = reflected
    return triangles


def inverse_triangles(triangle: np.ndarray) -> np.ndarray:
    """Inverses of upper triangular matrices by back substitution.

    `triangle` (configurations, m, m, sets). Returns (configurations, m, m, sets): infinite or not a number where singular.
    """
    size = triangle.shape[1]
    inverse = np.zeros_like(triangle)
    with np.errstate(divide="ignore", invalid="ignore"):
        for column in range(size):
            inverse[:, column, column] = 1.0 / triangle[:, column, column]
            for row in range(column - 1, -1, -1):
                done = (triangle[:, row, row + 1 : column + 1] * inverse[:, row + 1 : column + 1, column]).sum(axis=1)
                inverse[:, row, column] = -done * inverse[:, row, row]
    return inverse


def cholesky_triangles(information: np.ndarray) -> np.ndarray:
    """Upper triangular Cholesky factors R of symmetric matrices R^T R.

    `information` (configurations, m, m, sets): only the upper triangles are read. Returns (configurations, m, m, sets): not a
    number where a matrix is not positive definite to rounding, see `_LARGEST_CONDITION`.
    """
    size = information.shape[1]
    triangle = np.zeros_like(information)
    for row in range(size):
        rest = information[:, row, row:].copy()
        for above in range(row):
            rest -= triangle[:, above, row, None] * triangle[:, above, row:]
        pivot, diagonal = rest[:, 0], information[:, row, row]
        pivot[~(pivot > diagonal / _LARGEST_CONDITION**2)] = np.nan
        triangle[:, row, row:] = rest / np.sqrt(pivot)[:, None]
    return triangle


def prefix_information(regressor: np.ndarray) -> np.ndarray:
    """Sum of A^T A over the first k configurations, for every k.

    `regressor` (rows, n, configurations, sets). Returns (configurations, n, n, sets).
    """
    _, joints, configurations, sets = regressor.shape
    information = np.empty((configurations, joints, joints, sets))
    for i in range(joints):
        for j in range(i + 1):
            product = sum(row[i] * row[j] for row in regressor)
            information[:, i, j] = information[:, j, i] = np.cumsum(product, axis=0)
    return information


def _systems(stage: Stage, measurements: Mapping[str, Measurements]) -> Iterator[np.ndarray]:
    """Equations of a stage, configuration by configuration; columns: joints identified, joints fixed, measured deflection."""
    order = stage.identified + stage.fixed
    points = [measurements[name] for name in stage.points]
    rows, _, configurations, sets = points[0].regressor.shape
    system = np.empty((len(points), rows, len(order) + 1, sets))
    for configuration in range(configurations):
        for part, point in zip(system, points, strict=True):
            for column, joint in enumerate(order):
                part[:, column] = point.regressor[:, joint, configuration]
            part[:, -1] = point.deflection[:, configuration]
        yield system.reshape(-1, *system.shape[2:])


def _row_major(matrices: np.ndarray) -> np.ndarray:
    """(configurations, m, n, sets) to contiguous (configurations, sets, m, n), as stacked linear algebra wants it."""
    return np.ascontiguousarray(np.moveaxis(matrices, -1, 1))
