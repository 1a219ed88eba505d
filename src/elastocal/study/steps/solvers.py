"""Equation 11 against Gauss-Newton on the exact kinematics: what "used as initial condition" changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.study.identification import estimate_compliance
from elastocal.study.steps.columns import data_sets
from elastocal.study.steps.identify import Situation
from elastocal.study.strategies import Strategy, drop_forgotten_stages

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import numpy as np

    from elastocal.mechanics.chain import Chain


def solver_table(
    blocks: Iterable[tuple[Mapping[str, np.ndarray], Mapping[str, Mapping[str, np.ndarray]]]],
    chain: Chain,
    strategies: Sequence[Strategy],
    rows: int,
    wrench_at: str,
    length: int,
    start: float,
) -> Iterator[dict[str, np.ndarray | str]]:
    """Estimates of both solvers at one length, for each strategy.

    `blocks` (dict, dict of str to dict): as in `identify.identified_blocks`, with the points of all strategies. `length`:
    configurations used. `start`: where Gauss-Newton starts, rad/(N m). Yields columns of one block of the solvers table: one
    strategy in one block of data sets.
    """
    for experiments, deflections in blocks:
        experiments, deflections = _first(experiments, length), {n: _first(d, length) for n, d in deflections.items()}
        sets = data_sets(experiments)
        for strategy in strategies:
            situation = Situation(experiments, deflections, chain, strategy, rows, wrench_at)
            exact = situation.solve_exactly(start, [length])[0]
            lasting = drop_forgotten_stages(strategy, chain.coordinates)
            linear = estimate_compliance(lasting, situation.measurements, chain.coordinates)[0][length - 1]
            columns: dict[str, np.ndarray | str] = {"strategy": strategy.name, "data_set": sets}
            for j in range(chain.coordinates):
                columns[f"equation_11_c{j + 1}"], columns[f"gauss_newton_c{j + 1}"] = linear[j], exact[j]
            yield columns


def _first(block: Mapping[str, np.ndarray], length: int) -> dict[str, np.ndarray]:
    """Rows of the first configurations of each data set."""
    kept = block["configuration"] < length
    return {name: values[kept] for name, values in block.items()}
