"""Equation 11 for every prefix of many data sets in one pass, one strategy at a time.

The least-squares problem of the first k configurations, for every k, is solved by a QR
decomposition that takes one configuration after the other and all data sets at once. It
gives the solution of the normal equations of equation 11 without forming them, so that
prefixes of one or two configurations keep their digits.

Equations and triangles have the data sets on their last axis, so that one step of the
algebra runs over all of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import TableSchema, read_blocks
from elastocal.mechanics.elastostatics import (
    generalized_forces,
    loaded_point,
    regressor,
)
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.jobs import DATA_SET, LENGTH, Job, make_real_column, make_schema
from elastocal.study.simulation import (
    DEFLECTION_COLUMNS,
    DEFLECTIONS,
    Experiments,
    list_data_sets,
    make_experiments_schema,
    make_prefix_index,
    unpack_deflections,
    unpack_experiments,
)

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain
    from elastocal.study.strategies import Stage, Strategy

# Columns of one pass through the experiments and, for each measuring point, the
# deflections.
Blocks = Iterable[
    tuple[Mapping[str, np.ndarray], Mapping[str, Mapping[str, np.ndarray]]]
]
# Condition numbers come from squares of singular values, so they mean nothing beyond
# the root of the machine's precision; there the measurements do not determine the
# compliances.
MAX_CONDITION_NUMBER = 1e7


@dataclass(frozen=True)
class Measurements:
    """What one measuring point contributes.

    `regressor` (rows, n, configurations, sets): matrix A of equation 10, base axes.
    `deflection` (rows, configurations, sets): measured deflection; rows are three
    displacements (m), then, where poses are measured, three rotations (rad).
    """

    regressor: np.ndarray
    deflection: np.ndarray


def find_first_solvable_length(strategy: Strategy, rows: int) -> int:
    """Smallest number of configurations with at least as many measurements as unknowns
    in every stage.

    `rows`: measurements of one point in one configuration: 6 for poses, 3 for
    positions.
    """
    return max(
        -(-len(stage.identified) // (rows * len(stage.points)))
        for stage in strategy.stages
    )


def estimate_compliance(
    strategy: Strategy, measurements: Mapping[str, Measurements], joints: int
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Solve the stages of a strategy one after the other (equation 11).

    `measurements`: of each measuring point of the strategy. `joints`: n. Returns
    `compliance` (configurations, n, sets): rad/(N m); meaningless where a prefix is too
    short, see `first_solvable_length`; `triangles` (configurations, pivots, columns,
    sets): triangular factor of each stage; columns: joints identified, joints fixed,
    right-hand side.
    """
    *_, configurations, sets = next(iter(measurements.values())).regressor.shape
    compliance = np.full((configurations, joints, sets), np.nan)
    triangles = []
    for stage in strategy.stages:
        pivots = len(stage.identified)
        shape = configurations, pivots, pivots + len(stage.fixed) + 1, sets
        triangle = factorize_prefixes(_equations(stage, measurements), shape)
        right = triangle[:, :, -1] - np.einsum(
            "kpfs,kfs->kps", triangle[:, :, pivots:-1], compliance[:, list(stage.fixed)]
        )
        compliance[:, list(stage.identified)] = _solve(
            triangle[:, :, :pivots], right[:, :, None]
        )[:, :, 0]
        triangles.append(triangle)
    return compliance, triangles


def find_undetermined_prefixes(
    strategy: Strategy, rows: int, triangles: Iterable[np.ndarray]
) -> np.ndarray:
    """Prefixes (configurations, sets) that do not determine the compliances: too few
    measurements, or not the right ones.

    `triangles`: from `estimate_compliance`; their condition number is that of the
    identification Jacobian, whose inverse is an observability index of calibration [1].
    Almost all are far below the largest that is allowed, which an upper bound from
    determinant and Frobenius norm shows [2]; only the others are decomposed.

    [1] Driels, M. R. and Pathre, U. S., Significance of observation strategy on the design of robot calibration experiments,
        Journal of Robotic Systems 7, 1990.
    [2] Guggenheimer, H. W., Edelman, A. S. and Johnson, C. R., A simple estimate of the condition number of a linear system,
        College Mathematics Journal 26, 1995.
    """
    found: np.ndarray = np.zeros((), bool)
    for stage, triangle in zip(strategy.stages, triangles, strict=True):
        size = len(stage.identified)
        square = triangle[:, :, :size]
        determinant = np.abs(np.einsum("kpps->kps", square).prod(axis=1))
        norm = np.sqrt(np.einsum("kpqs,kpqs->ks", square, square) / size)
        with np.errstate(divide="ignore", invalid="ignore"):
            doubtful = ~(2.0 * norm**size / determinant < MAX_CONDITION_NUMBER)
        doubtful[doubtful] = ~(
            _condition(np.moveaxis(square, -1, 1)[doubtful]) < MAX_CONDITION_NUMBER
        )
        found = found | doubtful
    found[: find_first_solvable_length(strategy, rows) - 1] = True
    return found


def factorize_prefixes(
    equations: Iterable[np.ndarray], shape: tuple[int, ...]
) -> np.ndarray:
    """Triangular factor of the equations of the first k configurations, for every k.

    `equations`: of one configuration after the other, (rows, columns, sets) each,
    overwritten: unknowns first, right-hand side last. Returns an array of the given
    shape (configurations, pivots, columns, sets): the rows of R and, in the columns
    that are no pivots, Q^T times them.

    Sequential accumulation [1]: the factor of k configurations on top of the rows of
    the next one is again reduced to a triangle, by Householder reflections of all data
    sets at once. numpy's stacked QR calls LAPACK for each small matrix and takes twice
    as long.

    [1] Lawson, C. L. and Hanson, R. J., Solving Least Squares Problems, Prentice-Hall,
    1974.
    """
    found = np.empty(shape)
    before = np.zeros(shape[1:])
    for triangle, rows in zip(found, equations, strict=True):
        triangle[:] = before
        for pivot in range(len(triangle)):
            head = triangle[pivot, pivot]
            below = rows[:, pivot]
            products = np.einsum("rs,rcs->cs", below, rows[:, pivot:])
            norm = np.sqrt(head**2 + products[0])
            first = head + np.copysign(norm, head)
            # A column of zeros is left as it is.
            scale = np.where(norm > 0.0, norm * np.abs(first), 1.0)
            along = (first * triangle[pivot, pivot:] + products) / scale
            triangle[pivot, pivot:] -= first * along
            rows[:, pivot + 1 :] -= below[:, None] * along[1:]
        before = triangle
    return found


def _equations(
    stage: Stage, measurements: Mapping[str, Measurements]
) -> Iterator[np.ndarray]:
    """Equations of a stage, configuration by configuration; columns: joints identified,
    joints fixed, measured deflection."""
    order = [*stage.identified, *stage.fixed]
    points = [measurements[name] for name in stage.points]
    for k in range(points[0].regressor.shape[2]):
        rows = [
            np.concatenate(
                [each.regressor[:, order, k], each.deflection[:, None, k]], axis=1
            )
            for each in points
        ]
        yield np.concatenate(rows)


def _solve(triangles: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Back substitution for all triangles at once; numpy's solve and inverse would
    decompose each again.

    `triangles` (configurations, pivots, pivots, sets). `right` (configurations, pivots,
    columns, sets). Returns as `right`: not a number where a triangle determines
    nothing: its condition is at least the largest of the diagonal over its least.
    """
    diagonal = np.einsum("kpps->kps", triangles)
    sizes = np.abs(diagonal)
    determined = sizes.max(axis=1, keepdims=True) < MAX_CONDITION_NUMBER * sizes.min(
        axis=1, keepdims=True
    )
    pivots = np.where(determined, diagonal, np.nan)
    solution = np.empty(right.shape)
    for row in reversed(range(pivots.shape[1])):
        later = np.einsum(
            "kps,kpcs->kcs", triangles[:, row, row + 1 :], solution[:, row + 1 :]
        )
        solution[:, row] = (right[:, row] - later) / pivots[:, row, None]
    return solution


def _condition(matrices: np.ndarray) -> np.ndarray:
    """2-norm condition numbers of matrices (..., n, n)."""
    eigenvalues = np.linalg.eigvalsh(np.swapaxes(matrices, -1, -2) @ matrices)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(eigenvalues[..., -1] / np.maximum(eigenvalues[..., 0], 0.0))


def make_identified_schema(joints: int) -> TableSchema:
    """What a strategy identified; one row for each data set and length."""
    compliances = [
        make_real_column(
            f"compliance_{j}",
            "rad/(N m)",
            f"identified compliance of joint {j}",
            missing=True,
        )
        for j in range(1, joints + 1)
    ]
    return make_schema("identified", DATA_SET, LENGTH, *compliances)


def compute_regressors(
    experiments: Experiments,
    chain: Chain,
    points: Collection[str],
    rows: int,
    wrench_at: str,
) -> dict[str, np.ndarray]:
    """Matrices A of equation 10 (rows, n, configurations, sets) of each measuring
    point, configuration before data set."""
    joint_angles = order_by_configuration(experiments.joint_angles)
    wrench = order_by_configuration(experiments.wrench)
    loaded = {
        name: loaded_point(chain, chain.point(name), wrench_at) for name in points
    }
    measured = {name: chain.point(name) for name in points}
    movements = {
        point: jacobians(chain, joint_angles, point)
        for point in {*loaded.values(), *measured.values()}
    }
    forces = {
        point: generalized_forces(movements[point], wrench)
        for point in {*loaded.values()}
    }
    # Nothing else needs the Jacobian of a measured point: its regressor takes its place
    # in memory.
    return {
        name: np.moveaxis(
            regressor(movements[point], forces[loaded[name]], out=movements[point]),
            (-2, -1),
            (0, 1),
        )[:rows]
        for name, point in measured.items()
    }


def order_by_configuration(array: np.ndarray) -> np.ndarray:
    """(sets, configurations, k) to (configurations, sets, k) with memory in the order
    k, configurations, sets."""
    return np.moveaxis(
        np.ascontiguousarray(np.moveaxis(array, (2, 1, 0), (0, 1, 2))), 0, -1
    )


def stack_measurements(matrix: np.ndarray, deflections: np.ndarray) -> Measurements:
    """A point's matrix A (rows, n, configurations, sets) with its deflections (sets,
    configurations, 3 or 6)."""
    return Measurements(
        matrix,
        np.moveaxis(order_by_configuration(deflections)[..., : len(matrix)], -1, 0),
    )


def identify_blocks(
    blocks: Blocks, chain: Chain, strategy: Strategy, rows: int, wrench_at: str
) -> Iterator[dict[str, np.ndarray]]:
    """Compliances, columns of the identified table; not a number where a prefix does
    not determine them.

    `rows`: 6 where poses are measured, 3 where positions are. `wrench_at`:
    interpretation R6.
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
        np.moveaxis(compliance, 1, -1)[
            find_undetermined_prefixes(strategy, rows, triangles)
        ] = np.nan
        columns = make_prefix_index(list_data_sets(block), len(compliance))
        yield columns | {
            f"compliance_{j + 1}": compliance[:, j].T.ravel()
            for j in range(chain.coordinates)
        }


def read_measured_blocks(job: Job, joints: int, points: Iterable[str]) -> Blocks:
    """Blocks of the experiments of a job with those of what is measured of the same
    data sets."""
    found = {
        name: read_blocks(
            job.input.measured, DEFLECTIONS, DEFLECTION_COLUMNS, point=name
        )
        for name in points
    }
    return pair_blocks(
        read_blocks(job.input.experiments, make_experiments_schema(joints)), found
    )


def pair_blocks(
    experiments: Iterable[Mapping[str, np.ndarray]],
    deflections: Mapping[str, Iterable[Mapping[str, np.ndarray]]],
) -> Blocks:
    """Blocks of the experiments with those of each measuring point."""
    for block, *measured in zip(experiments, *deflections.values(), strict=True):
        yield block, dict(zip(deflections, measured, strict=True))
