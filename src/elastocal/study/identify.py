"""Estimates: each strategy on measured data sets, every prefix length; and what it can identify before anything is measured."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import Column, TableSchema, read_blocks, write_table
from elastocal.mechanics.elastostatics import generalized_forces, loaded_point, regressor
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.columns import LENGTH, SET, real, table
from elastocal.study.equation_11 import Measurements, condition_numbers, covariance, estimate_compliance, undetermined
from elastocal.study.gauss_newton import identify_exactly
from elastocal.study.jobs import Job, chain_of, origin
from elastocal.study.simulation import (
    DEFLECTION_COLUMNS,
    DEFLECTIONS,
    Experiments,
    data_sets,
    experiments,
    prefix_index_columns,
    to_deflections,
    to_experiments,
)
from elastocal.study.strategies import Strategy, strategy_from_document

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain

# Columns of one pass through the experiments and, for each measuring point, the deflections.
Blocks = Iterable[tuple[Mapping[str, np.ndarray], Mapping[str, Mapping[str, np.ndarray]]]]


def covariance_columns(joints: int) -> list[tuple[str, int, int]]:
    """(name, row, column) of the lower triangle of the covariance of the compliances."""
    return [(f"cov_{i + 1}_{j + 1}", i, j) for i in range(joints) for j in range(i + 1)]


def design(joints: int) -> TableSchema:
    """What a strategy can identify from the experiments, whatever the noise; one row for each data set and length."""
    covariances = [
        Column(name, "float32", "1/(N m)^2", f"covariance of c{i + 1} and c{j + 1} for unit measurement variance", missing=True)
        for name, i, j in covariance_columns(joints)
    ]
    condition = Column("condition", "float32", "", "condition number of the identification Jacobian, worst stage", missing=True)
    return table("design", SET, LENGTH, *covariances, condition)


def identified(joints: int) -> TableSchema:
    """What a strategy identified; one row for each data set and length."""
    compliances = [
        real(f"compliance_{j}", "rad/(N m)", f"identified compliance of joint {j}", missing=True) for j in range(1, joints + 1)
    ]
    return table("identified", SET, LENGTH, *compliances)


class Design:
    """Regressors of one block of data sets, configuration before data set.

    `joint_angles` (configurations, sets, n). `torques` (configurations, sets, n): joint torques behind the measurements of each
    point, N m. `regressors` (rows, n, configurations, sets): of each point; `rows`: 6 where poses are measured, 3 where
    positions are. `wrench_at`: interpretation R6.
    """

    def __init__(self, experiments: Experiments, chain: Chain, points: Collection[str], rows: int, wrench_at: str) -> None:
        self.joint_angles, wrench = configuration_first(experiments.joint_angles), configuration_first(experiments.wrench)
        loaded = {name: loaded_point(chain, chain.point(name), wrench_at) for name in points}
        measured = {name: chain.point(name) for name in points}
        movements = {point: jacobians(chain, self.joint_angles, point) for point in {*loaded.values(), *measured.values()}}
        forces = {point: generalized_forces(movements[point], wrench) for point in {*loaded.values()}}
        self.torques = {name: forces[loaded[name]] for name in points}
        # Nothing else needs the Jacobian of a measured point: its regressor takes its place in memory.
        self.regressors = {
            name: np.moveaxis(regressor(movements[point], self.torques[name], out=movements[point]), (-2, -1), (0, 1))[:rows]
            for name, point in measured.items()
        }


def configuration_first(array: np.ndarray) -> np.ndarray:
    """(sets, configurations, k) to (configurations, sets, k) with memory in the order k, configurations, sets."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(array, (2, 1, 0), (0, 1, 2))), 0, -1)


def design_blocks(
    experiment_blocks: Iterable[Mapping[str, np.ndarray]], chain: Chain, strategy: Strategy, rows: int, wrench_at: str
) -> Iterator[dict[str, np.ndarray]]:
    """Covariances for measurements of unit variance and condition numbers of a strategy, columns of the design table.

    They depend on configurations and loads alone, so that they are worked out once for all noise levels.
    """
    for block in experiment_blocks:
        regressors = Design(to_experiments(block), chain, strategy.points, rows, wrench_at).regressors
        silent = np.zeros((rows, *next(iter(regressors.values())).shape[2:]))
        measurements = {name: Measurements(matrix, silent) for name, matrix in regressors.items()}
        triangles = estimate_compliance(strategy, measurements, chain.coordinates)[1]
        spread = covariance(strategy, measurements, triangles)
        condition = condition_numbers(strategy, measurements, triangles)
        spread[np.isnan(condition)] = np.nan
        columns = prefix_index_columns(data_sets(block), len(condition))
        columns |= {name: spread[..., i, j].T.ravel() for name, i, j in covariance_columns(chain.coordinates)}
        yield columns | {"condition": condition.T.ravel()}


class Situation:
    """Measurements of one block by a strategy, configuration before data set, ready for either solver.

    `measurements`: for equation 11. `rows`: 6 where poses are measured, 3 where positions are. `wrench_at`: R6.
    """

    def __init__(
        self,
        experiments: Mapping[str, np.ndarray],
        deflections: Mapping[str, Mapping[str, np.ndarray]],
        chain: Chain,
        strategy: Strategy,
        rows: int,
        wrench_at: str,
    ) -> None:
        self.chain, self.strategy = chain, strategy
        self.design = Design(to_experiments(experiments), chain, strategy.points, rows, wrench_at)
        self.measured = {name: configuration_first(to_deflections(deflections[name]))[..., :rows] for name in strategy.points}
        self.measurements = {
            name: Measurements(self.design.regressors[name], np.moveaxis(self.measured[name], -1, 0))
            for name in strategy.points
        }

    def solve_exactly(self, start: float, lengths: Sequence[int]) -> np.ndarray:
        """Compliances by Gauss-Newton from `start`, (lengths, n, sets); see `gauss_newton.identify_exactly`."""
        starts, design = np.full(self.chain.coordinates, start), self.design
        return identify_exactly(self.strategy, self.chain, design.joint_angles, design.torques, self.measured, starts, lengths)


def identified_blocks(
    blocks: Blocks, chain: Chain, strategy: Strategy, rows: int, wrench_at: str, start: float | None = None
) -> Iterator[dict[str, np.ndarray]]:
    """Compliances, columns of the identified table; not a number where a prefix does not determine them.

    `start`: given, compliances come from Gauss-Newton on the exact kinematics, started there (rad/(N m)); else from equation
    11.
    """
    for block, deflections in blocks:
        situation = Situation(block, deflections, chain, strategy, rows, wrench_at)
        compliance, triangles = estimate_compliance(strategy, situation.measurements, chain.coordinates)
        if start is not None:
            compliance = situation.solve_exactly(start, range(1, len(compliance) + 1))
        np.moveaxis(compliance, 1, -1)[undetermined(strategy, rows, triangles)] = np.nan
        columns = prefix_index_columns(data_sets(block), len(compliance))
        yield columns | {f"compliance_{j + 1}": compliance[:, j].T.ravel() for j in range(chain.coordinates)}


def read_measured(job: Job, joints: int, points: Iterable[str]) -> Blocks:
    """Blocks of the experiments of a job with those of what is measured of the same data sets."""
    found = {name: read_blocks(job.input.measured, DEFLECTIONS, DEFLECTION_COLUMNS, point=name) for name in points}
    return paired_blocks(read_blocks(job.input.experiments, experiments(joints)), found)


def paired_blocks(
    experiments: Iterable[Mapping[str, np.ndarray]], deflections: Mapping[str, Iterable[Mapping[str, np.ndarray]]]
) -> Blocks:
    """Blocks of the experiments with those of each measuring point."""
    for block, *measured in zip(experiments, *deflections.values(), strict=True):
        yield block, dict(zip(deflections, measured, strict=True))


def judge_design(job: Job) -> None:
    """What a strategy can identify from the experiments of a robot, before anything is measured."""
    asked, chain = job.params, chain_of(job)
    blocks = read_blocks(job.input.experiments, experiments(chain.coordinates))
    judged = design_blocks(blocks, chain, strategy_from_document(asked.strategy), asked.rows, asked.wrench_at)
    write_table(job.output.design, design(chain.coordinates), judged, origin(job))
