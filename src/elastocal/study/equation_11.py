"""Equation 11 for every prefix of many data sets in one pass, one strategy at a time.

The least-squares problem of the first k configurations, for every k, is solved by a QR decomposition that takes one
configuration after the other and all data sets at once. It gives the solution of the normal equations of equation 11 without
forming them, so that prefixes of one or two configurations keep their digits.

Equations and triangles have the data sets on their last axis, so that one step of the algebra runs over all of them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from elastocal.study.strategies import Stage, Strategy, drop_forgotten_stages

# Condition numbers come from squares of singular values, so they mean nothing beyond the root of the machine's precision; there
# the measurements do not determine the compliances.
LARGEST_CONDITION = 1e7


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


def first_solvable_length(strategy: Strategy, rows: int) -> int:
    """Smallest number of configurations with at least as many measurements as unknowns in every stage.

    `rows`: measurements of one point in one configuration: 6 for poses, 3 for positions.
    """
    return max(-(-len(stage.identified) // (rows * len(stage.points))) for stage in strategy.stages)


def identify(
    strategy: Strategy, measurements: Mapping[str, Measurements], joints: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compliances by a strategy for every prefix length of every data set, with covariance and condition number.

    `measurements`: of each measuring point of the strategy. `joints`: n. Returns `compliance` (configurations, n, sets):
    rad/(N m), not a number where the measurements of the prefix do not determine them; `covariance` and `condition_numbers`.
    """
    compliance, triangles = estimate_compliance(strategy, measurements, joints)
    spread = covariance(strategy, measurements, triangles)
    condition = condition_numbers(strategy, measurements, triangles)
    hidden = np.isnan(condition)
    np.moveaxis(compliance, 1, -1)[hidden] = np.nan
    spread[hidden] = np.nan
    return compliance, spread, condition


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
        start = np.zeros((pivots, pivots + len(stage.fixed) + 1, sets)) if prior is None else prior.triangle(stage)
        triangle = prefix_triangles(_equations(stage, measurements), start)
        right = triangle[:, :, -1] - np.einsum("kpfs,kfs->kps", triangle[:, :, pivots:-1], compliance[:, list(stage.fixed)])
        compliance[:, list(stage.identified)] = _solve(triangle[:, :, :pivots], right[:, :, None])[:, :, 0]
        triangles.append(triangle)
    return compliance, triangles


def covariance(strategy: Strategy, measurements: Mapping[str, Measurements], triangles: Sequence[np.ndarray]) -> np.ndarray:
    """Covariance (configurations, sets, n, n) of the estimates for measurements of unit variance, through all stages.

    That of a multi-step estimator, whose later stages take over what earlier ones have estimated [1]; exact here, since every
    stage is linear. A stage with triangle R solves R_II c_I = z - R_IH c_H, I the joints identified and H those fixed, where
    the reduced measurements z = Q^T y have unit covariance. So the estimates are linear in the z of all stages, and what is
    left is the covariance of the z of two stages that share points: R_s^-T (sum of A_s^T A_t over the shared measurements)
    R_t^-1.

    `triangles`: from `estimate_compliance`.

    [1] Murphy, K. M. and Topel, R. H., Estimation and inference in two-step econometric models, Journal of Business & Economic
        Statistics 3, 1985.
    """
    joints = next(iter(measurements.values())).regressor.shape[1]
    stages = drop_forgotten_stages(strategy, joints).stages
    gains: list[np.ndarray] = []
    inverses: list[np.ndarray] = []
    for stage, triangle in zip(stages, triangles[-len(stages) :], strict=True):
        pivots, size = list(stage.identified), len(stage.identified)
        unit = np.broadcast_to(np.eye(size)[..., None], triangle[:, :, :size].shape)
        inverse = _matrices(_solve(triangle[:, :, :size], unit))
        back = inverse @ _matrices(triangle[:, :, size:-1])
        for gain in gains:
            gain[..., pivots, :] = -back @ gain[..., list(stage.fixed), :]
        gains.append(np.zeros((*inverse.shape[:2], joints, size)))
        gains[-1][..., pivots, :] = inverse
        inverses.append(inverse)
    total = sum(gain @ np.swapaxes(gain, -1, -2) for gain in gains)
    for (s, earlier), (t, later) in combinations(enumerate(stages), 2):
        if shared := set(earlier.points) & set(later.points):
            information = sum((prefix_information(measurements[name].regressor) for name in sorted(shared)), np.zeros(()))
            products = information[..., list(earlier.identified), :][..., list(later.identified)]
            between = np.swapaxes(inverses[s], -1, -2) @ products @ inverses[t]
            cross = gains[s] @ between @ np.swapaxes(gains[t], -1, -2)
            total += cross + np.swapaxes(cross, -1, -2)
    return total


def condition_numbers(
    strategy: Strategy, measurements: Mapping[str, Measurements], triangles: Iterable[np.ndarray]
) -> np.ndarray:
    """2-norm condition number of the identification Jacobian, the largest of the stages.

    Its inverse is an observability index of calibration [1].

    `triangles`: from `estimate_compliance`; their singular values are those of the regressor. Returns (configurations, sets):
    not a number where the measurements of a prefix do not determine the compliances: too few of them, or not the right ones.

    [1] Driels, M. R. and Pathre, U. S., Significance of observation strategy on the design of robot calibration experiments,
        Journal of Robotic Systems 7, 1990.
    """
    largest: np.ndarray = np.ones(())
    for stage, triangle in zip(strategy.stages, triangles, strict=True):
        largest = np.maximum(largest, _condition(_matrices(triangle[:, :, : len(stage.identified)])))
    rows = next(iter(measurements.values())).regressor.shape[0]
    condition = np.where(largest < LARGEST_CONDITION, largest, np.nan)
    condition[: first_solvable_length(strategy, rows) - 1] = np.nan
    return condition


def undetermined(strategy: Strategy, rows: int, triangles: Iterable[np.ndarray]) -> np.ndarray:
    """Prefixes whose `condition_numbers` are not a number, (configurations, sets) of bool.

    Almost all have a condition far below the largest that is allowed, which an upper bound from determinant and Frobenius norm
    shows [1]; only the others are decomposed.

    [1] Guggenheimer, H. W., Edelman, A. S. and Johnson, C. R., A simple estimate of the condition number of a linear system,
        College Mathematics Journal 26, 1995.
    """
    found: np.ndarray = np.zeros((), bool)
    for stage, triangle in zip(strategy.stages, triangles, strict=True):
        size = len(stage.identified)
        square = triangle[:, :, :size]
        determinant = np.abs(np.einsum("kpps->kps", square).prod(axis=1))
        norm = np.sqrt(np.einsum("kpqs,kpqs->ks", square, square) / size)
        with np.errstate(divide="ignore", invalid="ignore"):
            doubtful = ~(2.0 * norm**size / determinant < LARGEST_CONDITION)
        doubtful[doubtful] = ~(_condition(np.moveaxis(square, -1, 1)[doubtful]) < LARGEST_CONDITION)
        found = found | doubtful
    found[: first_solvable_length(strategy, rows) - 1] = True
    return found


def prefix_triangles(equations: Iterable[np.ndarray], start: np.ndarray) -> np.ndarray:
    """Triangular factor of the equations of the first k configurations, for every k.

    `equations`: of one configuration after the other, (rows, columns, sets) each, overwritten: unknowns first, right-hand side
    last. `start` (pivots, columns, sets): the triangle before any of them. Returns (configurations, pivots, columns, sets): the
    rows of R and, in the columns that are no pivots, Q^T times them.

    Sequential accumulation [1]: the factor of k configurations on top of the rows of the next one is again reduced to a
    triangle, by Householder reflections of all data sets at once. numpy's stacked QR calls LAPACK for each small matrix and
    takes twice as long.

    [1] Lawson, C. L. and Hanson, R. J., Solving Least Squares Problems, Prentice-Hall, 1974.
    """
    triangle, found = start.copy(), []
    for rows in equations:
        for pivot in range(len(triangle)):
            head, below = triangle[pivot, pivot], rows[:, pivot]
            products = np.einsum("rs,rcs->cs", below, rows[:, pivot:])
            norm = np.sqrt(head**2 + products[0])
            first = head + np.copysign(norm, head)
            # A column of zeros is left as it is.
            scale = np.where(norm > 0.0, norm * np.abs(first), 1.0)
            along = (first * triangle[pivot, pivot:] + products) / scale
            triangle[pivot, pivot:] -= first * along
            rows[:, pivot + 1 :] -= below[:, None] * along[1:]
        found.append(triangle.copy())
    return np.array(found)


def prefix_information(regressor: np.ndarray) -> np.ndarray:
    """Sum of A^T A over the first k configurations, for every k.

    `regressor` (rows, n, configurations, sets). Returns (configurations, sets, n, n).
    """
    return np.cumsum(np.einsum("rics,rjcs->csij", regressor, regressor), axis=0)


def _equations(stage: Stage, measurements: Mapping[str, Measurements]) -> Iterator[np.ndarray]:
    """Equations of a stage, configuration by configuration; columns: joints identified, joints fixed, measured deflection."""
    order, points = [*stage.identified, *stage.fixed], [measurements[name] for name in stage.points]
    for configuration in range(points[0].regressor.shape[2]):
        matrix = np.concatenate([each.regressor[:, order, configuration] for each in points])
        measured = np.concatenate([each.deflection[:, None, configuration] for each in points])
        yield np.concatenate([matrix, measured], axis=1)


def _solve(triangles: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Back substitution for all triangles at once; numpy's solve and inverse would decompose each again.

    `triangles` (configurations, pivots, pivots, sets). `right` (configurations, pivots, columns, sets). Returns as `right`: not
    a number where a triangle determines nothing: its condition is at least the largest of the diagonal over its least.
    """
    diagonal = np.einsum("kpps->kps", triangles)
    sizes = np.abs(diagonal)
    determined = sizes.max(axis=1, keepdims=True) < LARGEST_CONDITION * sizes.min(axis=1, keepdims=True)
    pivots = np.where(determined, diagonal, np.nan)
    solution = np.empty(right.shape)
    for row in reversed(range(pivots.shape[1])):
        later = np.einsum("kps,kpcs->kcs", triangles[:, row, row + 1 :], solution[:, row + 1 :])
        solution[:, row] = (right[:, row] - later) / pivots[:, row, None]
    return solution


def _condition(matrices: np.ndarray) -> np.ndarray:
    """2-norm condition numbers of matrices (..., n, n)."""
    eigenvalues = np.linalg.eigvalsh(np.swapaxes(matrices, -1, -2) @ matrices)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(eigenvalues[..., -1] / np.maximum(eigenvalues[..., 0], 0.0))


def _matrices(stacked: np.ndarray) -> np.ndarray:
    """From (configurations, rows, columns, sets) to (configurations, sets, rows, columns), as numpy multiplies matrices."""
    return np.ascontiguousarray(np.moveaxis(stacked, -1, 1))
