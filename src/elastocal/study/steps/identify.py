"""Step 3: one strategy on measured data sets, every prefix length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.gauss_newton import identify_exactly
from elastocal.study.identification import Measurements, estimate_compliance, undetermined
from elastocal.study.steps.columns import data_sets, prefix_index_columns, to_deflections, to_experiments
from elastocal.study.steps.design import Design, configuration_first

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.mechanics.chain import Chain
    from elastocal.study.strategies import Strategy


def paired_blocks(
    experiments: Iterable[dict[str, np.ndarray]], deflections: Mapping[str, Iterable[dict[str, np.ndarray]]]
) -> Iterator[tuple[dict[str, np.ndarray], dict[str, dict[str, np.ndarray]]]]:
    """Blocks of the experiments with those of the deflections of the same data sets.

    `deflections`: for each measuring point.
    """
    for block, *measured in zip(experiments, *deflections.values(), strict=True):
        yield block, dict(zip(deflections, measured, strict=True))


def identified_blocks(
    blocks: Iterable[tuple[Mapping[str, np.ndarray], Mapping[str, Mapping[str, np.ndarray]]]],
    chain: Chain,
    strategy: Strategy,
    rows: int,
    wrench_at: str,
    start: float | None = None,
) -> Iterator[dict[str, np.ndarray]]:
    """Compliances in blocks; not a number where a prefix does not determine them.

    `blocks` (dict, dict of str to dict): blocks of the experiments table and, for each measuring point, of the deflections
    table. `rows`: 6 where poses are measured, 3 where positions are. `wrench_at`: interpretation R6. `start`: given,
    compliances come from Gauss-Newton on the exact kinematics, started there (rad/(N m)); else from equation 11. Yields columns
    of one block of the identified table.
    """
    for experiments, deflections in blocks:
        sets = data_sets(experiments)
        situation = Situation(experiments, deflections, chain, strategy, rows, wrench_at)
        compliance, triangles = estimate_compliance(strategy, situation.measurements, chain.coordinates)
        if start is not None:
            compliance = situation.solve_exactly(start, range(1, len(compliance) + 1))
        np.moveaxis(compliance, 1, -1)[undetermined(strategy, rows, triangles)] = np.nan
        columns = prefix_index_columns(sets, len(compliance))
        yield columns | {f"c{j + 1}": compliance[:, j].T.ravel() for j in range(chain.coordinates)}


class Situation:
    """Measurements of one block, configuration before data set, ready for either solver.

    `measurements`: for equation 11.

    `chain`, `strategy`, `rows`, `wrench_at`: as in `identified_blocks`.
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
        starts = np.full(self.chain.coordinates, start)
        return identify_exactly(
            self.strategy, self.chain, self.design.joint_angles, self.design.torques, self.measured, starts, lengths
        )
