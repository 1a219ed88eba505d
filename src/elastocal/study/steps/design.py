"""Step 2b: what a strategy can identify from the experiments of each data set, before anything is measured.

Covariance and condition number depend on configurations and loads alone, so they are worked out once for all noise levels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import generalized_forces, loaded_point, regressor
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.identification import Measurements, condition_numbers, covariance, estimate_compliance
from elastocal.study.steps.columns import data_sets, prefix_index_columns, to_experiments
from elastocal.study.table_schemas import covariance_columns

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from elastocal.mechanics.chain import Chain
    from elastocal.study.experiments import Experiments
    from elastocal.study.strategies import Strategy


class Design:
    """Regressors of one block of data sets, configuration before data set.

    `joint_angles` (configurations, sets, n). `torques` (configurations, sets, n): joint torques behind the measurements of each
    point, N m. `regressors` (rows, n, configurations, sets).

    `rows`: 6 where poses are measured, 3 where positions are. `wrench_at`: interpretation R6.
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


def design_blocks(
    experiment_blocks: Iterable[Mapping[str, np.ndarray]], chain: Chain, strategy: Strategy, rows: int, wrench_at: str
) -> Iterator[dict[str, np.ndarray]]:
    """Covariances for measurements of unit variance and condition numbers of a strategy, in blocks.

    `experiment_blocks`: blocks of the experiments table. `chain`, `strategy`, `rows`, `wrench_at`: as in `Design`. Yields
    columns of one block of the design table.
    """
    for block in experiment_blocks:
        sets = data_sets(block)
        regressors = Design(to_experiments(block), chain, strategy.points, rows, wrench_at).regressors
        silent = np.zeros((rows, *next(iter(regressors.values())).shape[2:]))
        measurements = {name: Measurements(matrix, silent) for name, matrix in regressors.items()}
        triangles = estimate_compliance(strategy, measurements, chain.coordinates)[1]
        spread = covariance(strategy, measurements, triangles)
        condition = condition_numbers(strategy, measurements, triangles)
        spread[np.isnan(condition)] = np.nan
        columns = prefix_index_columns(sets, len(condition))
        for name, i, j in covariance_columns(chain.coordinates):
            columns[name] = spread[..., i, j].T.ravel()
        yield columns | {"condition": condition.T.ravel()}


def configuration_first(array: np.ndarray) -> np.ndarray:
    """(sets, configurations, k) to (configurations, sets, k) with memory in the order k, configurations, sets."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(array, (2, 1, 0), (0, 1, 2))), 0, -1)
