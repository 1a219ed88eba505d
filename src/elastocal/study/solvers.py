"""Strategies that are one estimator, by equation 11 and by Gauss-Newton: what "used as initial condition" changes.

And whether it matters where an iterative solver starts: 6DoF is claimed to converge from any start.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.provenance import provenance
from elastocal.io.storage import TableSchema, write_table
from elastocal.study.columns import SET, group, real, table
from elastocal.study.equation_11 import estimate_compliance
from elastocal.study.gauss_newton import identify_exactly
from elastocal.study.identify import Design, Situation, configuration_first, read_measured
from elastocal.study.in_memory import ask
from elastocal.study.jobs import Job, below, chain_of, rows_as_frame, strategies_of, tabulate, write_csvs
from elastocal.study.simulation import data_sets
from elastocal.study.strategies import drop_forgotten_stages

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.chain import Chain
    from elastocal.study.identify import Blocks
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

_SOLVERS = ("equation_11", "gauss_newton")
STARTS = table(
    "starts",
    real("start", "rad/(N m)", "where Gauss-Newton starts each joint"),
    real("difference", "", "largest relative difference of a compliance from that of the first start"),
    real("unsettled", "", "share of data sets whose steps do not settle"),
)


def solvers(joints: int) -> TableSchema:
    """Estimates of both solvers at one length; one row for each strategy and data set, a row group holds one strategy."""
    pairs = [
        real(f"{solver}_c{j}", "rad/(N m)", f"compliance of joint {j} by {solver.replace('_', ' ')}")
        for j in range(1, joints + 1)
        for solver in _SOLVERS
    ]
    return table("solvers", group("strategy", "name of the strategy"), SET, *pairs)


def solver_blocks(
    blocks: Blocks, chain: Chain, strategies: Sequence[Strategy], rows: int, wrench_at: str, length: int, start: float
) -> Iterator[dict[str, np.ndarray | str]]:
    """Estimates of both solvers from so many configurations, for each strategy.

    `blocks`: as in `identify.identified_blocks`, with the points of all strategies. `start`: of Gauss-Newton, rad/(N m).
    """
    for experiments, deflections in blocks:
        experiments, deflections = _first(experiments, length), {n: _first(d, length) for n, d in deflections.items()}
        for strategy in strategies:
            situation = Situation(experiments, deflections, chain, strategy, rows, wrench_at)
            exact = situation.solve_exactly(start, [length])[0]
            lasting = drop_forgotten_stages(strategy, chain.coordinates)
            linear = estimate_compliance(lasting, situation.measurements, chain.coordinates)[0][length - 1]
            columns: dict[str, np.ndarray | str] = {"strategy": strategy.name, "data_set": data_sets(experiments)}
            for solver, found in zip(_SOLVERS, (linear, exact), strict=True):
                columns |= {f"{solver}_c{j + 1}": found[j] for j in range(chain.coordinates)}
            yield columns


def _first(block: Mapping[str, np.ndarray], length: int) -> dict[str, np.ndarray]:
    """Rows of the first configurations of each data set."""
    kept = block["configuration"] < length
    return {name: values[kept] for name, values in block.items()}


def solver_summary(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Which strategies are one estimator: the closest other one of each, by Gauss-Newton, in any data set.

    `found`: the solvers table of each robot. Returns robot, strategy, closest_strategy, equation_11_difference and
    gauss_newton_difference (largest relative difference of a compliance), between_solvers.
    """
    rows = []
    for robot, frame in found.items():
        linear, exact = (
            {
                strategy: cell.sort_values("data_set").filter(like=solver).to_numpy()
                for strategy, cell in frame.groupby("strategy", sort=False, observed=True)
            }
            for solver in _SOLVERS
        )
        for strategy in exact:
            distance = {other: _largest(exact[strategy], exact[other]) for other in exact if other != strategy}
            closest = min(distance, key=distance.__getitem__, default=strategy)
            row = {"robot": robot, "strategy": strategy, "closest_strategy": closest}
            row |= {"equation_11_difference": _largest(linear[strategy], linear[closest])}
            row |= {"gauss_newton_difference": _largest(exact[strategy], exact[closest])}
            rows.append(row | {"between_solvers": _largest(linear[strategy], exact[strategy])})
    return rows_as_frame(rows)


def _largest(values: np.ndarray, others: np.ndarray) -> float:
    return float(np.abs(values / others - 1.0).max())


def start_columns(study: StudyInMemory, strategies: Sequence[Strategy], starts: Sequence[float]) -> dict[str, np.ndarray]:
    """Whether Gauss-Newton comes by the one strategy to the same estimates from every start, rad/(N m) for all joints."""
    (strategy,) = strategies
    sets, read, chain = np.arange(study.size.data_sets), study.interpretation, study.robot.chain
    drawn = study.experiments(sets)
    design = Design(drawn, chain, strategy.points, read.rows, read.wrench_at)
    measured = {
        name: configuration_first(study.deflections(drawn, name) + study.size.noise * study.noise(sets, name))[..., : read.rows]
        for name in strategy.points
    }
    situation = (strategy, chain, design.joint_angles, design.torques, measured)
    lengths = [study.size.configurations]
    found = [identify_exactly(*situation, np.full(chain.coordinates, start), lengths)[0] for start in starts]
    return {
        "start": np.array(starts),
        "difference": np.array([np.nanmax(np.abs(each / found[0] - 1)) for each in found]),
        "unsettled": np.array([np.isnan(each).any(axis=0).mean() for each in found]),
    }


def starts_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The starts of all robots, whose names come last."""
    return below(found)[[*(column.name for column in STARTS.columns), "robot"]]


def compare_solvers(job: Job) -> None:
    """Both solvers on the data sets of one robot."""
    asked, chain, strategies = job.params, chain_of(job), strategies_of(job)
    blocks = read_measured(job, chain.coordinates, dict.fromkeys(name for each in strategies for name in each.points))
    solved = solver_blocks(blocks, chain, strategies, asked.rows, asked.wrench_at, asked.length, asked.start)
    write_table(job.output.solvers, solvers(chain.coordinates), solved, provenance(asked))


def tabulate_solvers(job: Job) -> None:
    """Of all robots."""
    from elastocal.io.data_frames import read_frame

    files = zip(job.params.robots, job.params.joints, job.input.solvers, strict=True)
    write_csvs(job, table=solver_summary({robot: read_frame(path, solvers(n)) for robot, n, path in files}))


vary_starts = ask(STARTS, start_columns)
tabulate_starts = tabulate(STARTS, starts_table)
