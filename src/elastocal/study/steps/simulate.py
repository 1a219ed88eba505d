"""Step 1: random configurations and wrenches, and the deflections that they cause, without noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.study.simulation import Loading, random_experiments, true_deflections
from elastocal.study.steps.blocks import blocks_of_sets
from elastocal.study.steps.columns import data_sets, deflection_columns, experiment_columns, to_experiments

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import numpy as np

    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Robot


def experiment_blocks(
    chain: Chain, limits: np.ndarray, key: str, seed: int, loading: Loading, purpose: str, data_sets: int, configurations: int
) -> Iterator[dict[str, np.ndarray]]:
    """Random experiments, in blocks of data sets.

    `limits` (n, 2): joint limits in rad. `key`: name of the robot's file. `purpose`: data that identify and data that judge
    come from different random streams. Yields columns of one block of the experiments table.
    """
    for sets in blocks_of_sets(data_sets):
        yield experiment_columns(sets, random_experiments(chain, limits, seed, key, loading, purpose, sets, configurations))


def ideal_blocks(
    experiments: Iterable[Mapping[str, np.ndarray]], robot: Robot, wrench_at: str
) -> Iterator[dict[str, np.ndarray | str]]:
    """Deflections without noise of every measuring point.

    `experiments`: blocks of the experiments table. `wrench_at`: interpretation R6. Yields columns of one block of the
    deflections table: one point in one block of data sets.
    """
    for block in experiments:
        loaded, sets = to_experiments(block), data_sets(block)
        for point in robot.chain.points:
            yield deflection_columns(point.name, sets, true_deflections(robot, loaded, point, wrench_at))
