"""Fewer than ten configurations: strategies with and without a prior, where nominal compliances are off by a known share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.random_streams import draw
from elastocal.study.identification import Prior, estimate_compliance
from elastocal.study.metrics import mean_form, mean_square_errors
from elastocal.study.steps.columns import prefix_index_columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.study.steps.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy


def few_blocks(
    study: StudyInMemory, strategies: Sequence[Strategy], nominal_errors: Sequence[float]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Mean square error of each data set at every length, by each strategy.

    `study`: with as many configurations as are looked at. `nominal_errors`: standard deviations of the logarithm of the nominal
    compliances over the true ones, which each data set has its own of. A strategy without a prior does not look at them;
    strategies of points or joints that the robot lacks are left out. Yields
    columns of one block of the few table: one strategy with one error of the nominal values in one block of data sets.
    """
    robot, n, form = study.robot, study.robot.joints, mean_form(study.judge())
    there = {point.name for point in robot.chain.points}
    strategies = [
        strategy
        for strategy in strategies
        if there.issuperset(strategy.points) and {j for stage in strategy.stages for j in stage.identified} == {*range(n)}
    ]
    points = tuple(dict.fromkeys(name for strategy in strategies for name in strategy.points))
    for sets in study.blocks():
        measurements = study.measure(sets, points)
        normal = draw(study.seed, study.key, "nominal compliances", sets, lambda stream: stream.standard_normal(n)).T
        for error in nominal_errors:
            nominal = robot.compliance[:, None] * np.exp(error * normal)
            for strategy in strategies:
                if strategy.prior_std is None:
                    compliance = study.estimate(strategy, measurements)
                else:
                    prior = Prior(nominal, strategy.prior_std * nominal / study.size.noise)
                    compliance = estimate_compliance(strategy, measurements, n, prior)[0]
                squares = mean_square_errors(form, compliance - robot.compliance[:, None])
                yield {
                    **prefix_index_columns(sets, len(squares)),
                    "nominal_error": np.full(squares.size, error),
                    "strategy": strategy.name,
                    "mean_square": squares.T.ravel(),
                }
