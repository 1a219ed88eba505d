"""Equation 11 for every prefix of many data sets in one pass, one strategy at a time.

A prefix is the first k configurations of a data set. Its least-squares problem is solved
for every k by a QR decomposition that processes one configuration after the other, for
all data sets at once. The solution is that of the normal equations of equation 11, but
these are not formed, so that prefixes of one or two configurations keep their digits.

Equations and triangles have the data sets on their last axis, so that one step of the
algebra runs over all of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import Columns, read_blocks
from elastocal.mechanics.elastostatics import (
    build_regressor,
    compute_generalized_forces,
    select_loaded_point,
)
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.study.schemas import DEFLECTIONS, EXPERIMENTS
from elastocal.study.simulation import (
    DEFLECTION_COLUMNS,
    Experiments,
    list_data_sets,
    make_prefix_index,
    unpack_deflections,
    unpack_experiments,
)

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain
    from elastocal.study.jobs import Job
    from elastocal.study.strategies import Stage, Strategy

# Columns of one block of experiments and, for each measuring point, of its deflections.
Blocks = Iterable[tuple[Columns, Mapping[str, Columns]]]
# Above this condition number the measurements do not determine the compliances.
# Condition numbers come from squares of singular values, so larger ones than the root
# of the machine's precision mean nothing.
MAX_CONDITION_NUMBER = 1e7


@dataclass(frozen=True)
class Measurements:
    """What one measuring point contributes.

    Attributes
    ----------
    regressor : (rows, n, configurations, sets) array
        Matrix A of equation 10, base axes.
    deflection : (rows, configurations, sets) array
        Measured deflection; rows are three displacements (m), then, if poses are
        measured, three rotations (rad).
    """

    regressor: np.ndarray
    deflection: np.ndarray


def find_first_solvable_length(strategy: Strategy, rows: int) -> int:
    """Find the smallest number of configurations with at least as many measurements as
    unknowns in every stage.

    Parameters
    ----------
    strategy
    rows : int
        Components measured at one point in one configuration: 6 of a pose, 3 of a
        position.
    """
    return max(
        -(-len(stage.identified) // (rows * len(stage.points)))
        for stage in strategy.stages
    )


def estimate_compliance(
    strategy: Strategy, measurements: Mapping[str, Measurements], joints: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Solve the stages of a strategy one after the other (equation 11).

    Parameters
    ----------
    strategy
    measurements
        Of each measuring point of the strategy, by its name.
    joints : int
        Number of joints n.

    Returns
    -------
    compliance : (configurations, n, sets) array, rad/(N m)
        Meaningless if a prefix is too short, see `find_first_solvable_length`.
    triangles : list of (configurations, pivots, columns, sets) arrays
        Triangular factor of each stage; columns: joints identified, joints fixed,
        right-hand side.
    """
    *_, configurations, sets = next(iter(measurements.values())).regressor.shape
    compliance = np.full((configurations, joints, sets), np.nan)
    triangles = []
    for stage in strategy.stages:
        identified = list(stage.identified)
        fixed = list(stage.fixed)
        pivots = len(identified)
        shape = configurations, pivots, pivots + len(fixed) + 1, sets
        triangle = factorize_prefixes(_stack_equations(stage, measurements), shape)
        right_side = triangle[:, :, -1] - np.einsum(
            "kpfs,kfs->kps", triangle[:, :, pivots:-1], compliance[:, fixed]
        )
        solution = _substitute_back(triangle[:, :, :pivots], right_side[:, :, None])
        compliance[:, identified] = solution[:, :, 0]
        triangles.append(triangle)
    return compliance, triangles


def find_undetermined_prefixes(
    strategy: Strategy, rows: int, triangles: Iterable[np.ndarray]
) -> np.ndarray:
    """Find the prefixes that do not determine the compliances, because they have too few
    measurements or not the right ones.

    The condition number of a triangle is that of the identification Jacobian; its
    inverse is an observability index of calibration [1]. An upper bound from determinant
    and Frobenius norm [2] shows that almost all are far below the limit, so only the
    doubtful ones are decomposed.

    Parameters
    ----------
    strategy
    rows : int
        As in `find_first_solvable_length`.
    triangles
        From `estimate_compliance`.

    Returns
    -------
    (configurations, sets) array of bool

    References
    ----------
    .. [1] Driels, M. R. and Pathre, U. S., Significance of observation strategy on the
       design of robot calibration experiments, Journal of Robotic Systems 7, 1990.
    .. [2] Guggenheimer, H. W., Edelman, A. S. and Johnson, C. R., A simple estimate of the
       condition number of a linear system, College Mathematics Journal 26, 1995.
    """
    undetermined: np.ndarray = np.zeros((), bool)
    for stage, triangle in zip(strategy.stages, triangles, strict=True):
        size = len(stage.identified)
        square = triangle[:, :, :size]
        determinant = np.abs(np.einsum("kpps->kps", square).prod(axis=1))
        norm = np.sqrt(np.einsum("kpqs,kpqs->ks", square, square) / size)
        with np.errstate(divide="ignore", invalid="ignore"):
            bound = 2.0 * norm**size / determinant
        # A comparison with NaN is false, so what is not a number counts as undetermined.
        doubtful = ~(bound < MAX_CONDITION_NUMBER)
        condition = _compute_condition_numbers(np.moveaxis(square, -1, 1)[doubtful])
        doubtful[doubtful] = ~(condition < MAX_CONDITION_NUMBER)
        undetermined = undetermined | doubtful
    undetermined[: find_first_solvable_length(strategy, rows) - 1] = True
    return undetermined


def factorize_prefixes(
    equations: Iterable[np.ndarray], shape: tuple[int, ...]
) -> np.ndarray:
    """Compute the triangular factor of the equations of the first k configurations, for
    every k.

    Sequential accumulation [1]: the factor of k configurations on top of the rows of the
    next one is again reduced to a triangle, by Householder reflections of all data sets
    at once. numpy's stacked QR calls LAPACK for each small matrix and takes twice as
    long.

    Parameters
    ----------
    equations
        Of one configuration after the other, (rows, columns, sets) each, overwritten;
        unknowns first, right-hand side last.
    shape
        Shape of the result: configurations, pivots, columns, sets.

    Returns
    -------
    (configurations, pivots, columns, sets) array
        The rows of R and, in the columns that are no pivots, Q^T times these columns.

    References
    ----------
    .. [1] Lawson, C. L. and Hanson, R. J., Solving Least Squares Problems, Prentice-Hall,
       1974.
    """
    triangles = np.empty(shape)
    previous = np.zeros(shape[1:])
    for triangle, rows in zip(triangles, equations, strict=True):
        triangle[:] = previous
        for pivot in range(len(triangle)):
            head = triangle[pivot, pivot]
            column = rows[:, pivot]
            products = np.einsum("rs,rcs->cs", column, rows[:, pivot:])
            norm = np.sqrt(head**2 + products[0])
            first = head + np.copysign(norm, head)
            # A column of zeros stays as it is.
            scale = np.where(norm > 0.0, norm * np.abs(first), 1.0)
            projection = (first * triangle[pivot, pivot:] + products) / scale
            triangle[pivot, pivot:] -= first * projection
            rows[:, pivot + 1 :] -= column[:, None] * projection[1:]
        previous = triangle
    return triangles


def _stack_equations(
    stage: Stage, measurements: Mapping[str, Measurements]
) -> Iterator[np.ndarray]:
    """Yield the equations of a stage, configuration by configuration.

    Columns: joints identified, joints fixed, measured deflection.
    """
    order = [*stage.identified, *stage.fixed]
    points = [measurements[name] for name in stage.points]
    for k in range(points[0].regressor.shape[2]):
        blocks = [
            (point.regressor[:, order, k], point.deflection[:, None, k])
            for point in points
        ]
        yield np.concatenate([np.concatenate(block, axis=1) for block in blocks])


def _substitute_back(triangles: np.ndarray, right_side: np.ndarray) -> np.ndarray:
    """Solve all triangular systems at once by back substitution.

    numpy's solve and inverse would decompose each triangle again.

    Parameters
    ----------
    triangles : (configurations, pivots, pivots, sets) array
    right_side : (configurations, pivots, columns, sets) array

    Returns
    -------
    array of the shape of `right_side`
        NaN if a triangle determines nothing: its condition number is at least the ratio
        of the largest to the smallest element of the diagonal.
    """
    diagonal = np.einsum("kpps->kps", triangles)
    sizes = np.abs(diagonal)
    largest = sizes.max(axis=1, keepdims=True)
    determined = largest < MAX_CONDITION_NUMBER * sizes.min(axis=1, keepdims=True)
    pivots = np.where(determined, diagonal, np.nan)
    solution = np.empty(right_side.shape)
    for row in reversed(range(pivots.shape[1])):
        later = np.einsum(
            "kps,kpcs->kcs", triangles[:, row, row + 1 :], solution[:, row + 1 :]
        )
        solution[:, row] = (right_side[:, row] - later) / pivots[:, row, None]
    return solution


def _compute_condition_numbers(matrices: np.ndarray) -> np.ndarray:
    """2-norm condition numbers of matrices (..., n, n)."""
    eigenvalues = np.linalg.eigvalsh(np.swapaxes(matrices, -1, -2) @ matrices)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(eigenvalues[..., -1] / np.maximum(eigenvalues[..., 0], 0.0))


def compute_regressors(
    experiments: Experiments,
    chain: Chain,
    points: Collection[str],
    rows: int,
    wrench_at: str,
) -> dict[str, np.ndarray]:
    """Compute the matrices A of equation 10 of each measuring point.

    Parameters
    ----------
    experiments
    chain
    points
        Names of measuring points.
    rows : int
        Components measured at a point, 6 or 3.
    wrench_at : str
        Where the wrench that deflects a point acts (interpretation R6).

    Returns
    -------
    dict of (rows, n, configurations, sets) arrays
        Configurations lie before data sets in memory.
    """
    joint_angles = order_by_configuration(experiments.joint_angles)
    wrench = order_by_configuration(experiments.wrench)
    measured = {name: chain.point(name) for name in points}
    loaded = {
        name: select_loaded_point(chain, point, wrench_at)
        for name, point in measured.items()
    }
    point_jacobians = {
        point: compute_jacobians(chain, joint_angles, point)
        for point in {*loaded.values(), *measured.values()}
    }
    forces = {
        point: compute_generalized_forces(point_jacobians[point], wrench)
        for point in {*loaded.values()}
    }
    regressors = {}
    for name, point in measured.items():
        # The Jacobian of a measured point is not needed any more, so its regressor
        # overwrites it.
        jacobian = point_jacobians[point]
        matrix = build_regressor(jacobian, forces[loaded[name]], out=jacobian)
        regressors[name] = np.moveaxis(matrix, (-2, -1), (0, 1))[:rows]
    return regressors


def order_by_configuration(array: np.ndarray) -> np.ndarray:
    """Turn (sets, configurations, k) into (configurations, sets, k), which lies in memory
    in the order k, configurations, sets."""
    components_first = np.ascontiguousarray(np.moveaxis(array, (2, 1, 0), (0, 1, 2)))
    return np.moveaxis(components_first, 0, -1)


def stack_measurements(matrix: np.ndarray, deflections: np.ndarray) -> Measurements:
    """Combine a point's matrix A (rows, n, configurations, sets) with its deflections
    (sets, configurations, 3 or 6)."""
    measured = order_by_configuration(deflections)[..., : len(matrix)]
    return Measurements(matrix, np.moveaxis(measured, -1, 0))


def identify_blocks(
    blocks: Blocks, chain: Chain, strategy: Strategy, rows: int, wrench_at: str
) -> Iterator[dict[str, np.ndarray]]:
    """Identify compliances, block of data sets by block.

    Parameters
    ----------
    blocks
        Experiments and deflections of each measuring point.
    chain
    strategy
    rows, wrench_at
        As in `compute_regressors`.

    Yields
    ------
    dict
        Columns of the identified table; NaN if a prefix does not determine the
        compliances.
    """
    for block, deflections in blocks:
        regressors = compute_regressors(
            unpack_experiments(block), chain, strategy.points, rows, wrench_at
        )
        measurements = {
            name: stack_measurements(
                regressors[name], unpack_deflections(deflections[name])
            )
            for name in strategy.points
        }
        compliance, triangles = estimate_compliance(
            strategy, measurements, chain.coordinates
        )
        undetermined = find_undetermined_prefixes(strategy, rows, triangles)
        np.moveaxis(compliance, 1, -1)[undetermined] = np.nan
        columns = make_prefix_index(list_data_sets(block), len(compliance))
        yield columns | {
            f"compliance_{j + 1}": compliance[:, j].T.ravel()
            for j in range(chain.coordinates)
        }


def read_measured_blocks(job: Job, joints: int, points: Iterable[str]) -> Blocks:
    """Read the blocks of a job's experiments with those of the measured deflections of
    the same data sets."""
    deflections = {
        name: read_blocks(
            job.input.measured, DEFLECTIONS, DEFLECTION_COLUMNS, point=name
        )
        for name in points
    }
    schema = EXPERIMENTS.for_joints(joints)
    return pair_blocks(read_blocks(job.input.experiments, schema), deflections)


def pair_blocks(
    experiments: Iterable[Columns],
    deflections: Mapping[str, Iterable[Columns]],
) -> Blocks:
    """Pair blocks of the experiments with the blocks of each measuring point."""
    for block, *measured in zip(experiments, *deflections.values(), strict=True):
        yield block, dict(zip(deflections, measured, strict=True))
