"""Which points to measure: one least-squares problem over each set of points, all data sets and lengths, beside its bound.

Sets of points share their configurations and noise, so that they may be compared data set by data set.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.bounds import squared_error_bounds
from elastocal.study.identification import estimate_compliance, first_solvable_length, prefix_information
from elastocal.study.metrics import error_forms, error_moment
from elastocal.study.steps import SETS_PER_BLOCK
from elastocal.study.steps.columns import prefix_index_columns
from elastocal.study.steps.in_memory import judge_of_study, measured
from elastocal.study.strategies import Stage, Strategy

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.interpretation import Interpretation, Size

# A point that is measured twice in a configuration has noise of its own the second time.
_AGAIN = "/again"


def budget_blocks(
    robot: Robot,
    limits: np.ndarray,
    key: str,
    seed: int,
    point_sets: Mapping[str, Sequence[str]],
    interpretation: Interpretation,
    size: Size,
) -> Iterator[dict[str, np.ndarray | str]]:
    """Squared error of each data set, and the least that an unbiased estimator could have.

    Parameters
    ----------
    robot, limits, key, seed, interpretation, size
        As in `repeat.repeated_blocks`; of the study of the tables.
    point_sets : dict of str to sequence of str
        Measuring points by the names of sets; a point may stand in a set twice. Sets with a point that the robot lacks are left
        out.

    Yields
    ------
    dict
        Columns of one block of the budget table: one set of points in one block of data sets.
    """
    judge, n = judge_of_study(robot, limits, key, seed, 0, interpretation, size), robot.joints
    moment, mean_form = error_moment(judge), error_forms(judge).mean(axis=0)
    there = {point.name for point in robot.chain.points}
    point_sets = {label: points for label, points in point_sets.items() if there.issuperset(points)}
    names = tuple(dict.fromkeys(name for points in point_sets.values() for name in points))
    twice = tuple(name for name in names if any([*points].count(name) > 1 for points in point_sets.values()))
    for first in range(0, size.data_sets, SETS_PER_BLOCK):
        sets = np.arange(first, min(first + SETS_PER_BLOCK, size.data_sets))
        given = (robot, limits, key, seed, sets)
        measurements = measured(*given, names, interpretation, size)
        again = measured(*given, twice, interpretation, size, _AGAIN) if twice else {}
        measurements |= {name + _AGAIN: found for name, found in again.items()}
        information = {name: prefix_information(measurements[name].regressor) for name in names}
        for label, points in point_sets.items():
            read = tuple(name + _AGAIN * (name in points[:place]) for place, name in enumerate(points))
            strategy = Strategy(label, (Stage(read, tuple(range(n))),))
            compliance = estimate_compliance(strategy, measurements, n)[0]
            compliance[: first_solvable_length(strategy, interpretation.rows) - 1] = np.nan
            error = compliance - robot.compliance[:, None]
            whole = np.concatenate([error, np.ones_like(error[:, :1])], axis=1)
            squares = (whole * np.einsum("ij,ljs->lis", mean_form, whole)).sum(axis=1)
            bounds = squared_error_bounds(sum((information[name] for name in points), np.zeros(())), moment)
            columns = prefix_index_columns(sets, len(squares))
            yield {
                **columns,
                "points": label,
                "mean_square": squares.T.ravel(),
                "bound": np.where(np.isfinite(bounds), size.noise**2 * bounds, np.nan).T.ravel(),
            }
