"""Which points to measure: one least-squares problem over each set of points, all data sets and lengths, beside its bound.

Sets of points share their configurations and noise, so that they may be compared data set by data set.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.bounds import squared_error_bounds
from elastocal.study.identification import prefix_information
from elastocal.study.metrics import mean_form, mean_square_errors
from elastocal.study.steps.columns import prefix_index_columns
from elastocal.study.strategies import all_at_once

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.study.steps.in_memory import StudyInMemory

# A point that is measured twice in a configuration has noise of its own the second time.
_AGAIN = "/again"


def budget_blocks(study: StudyInMemory, point_sets: Mapping[str, Sequence[str]]) -> Iterator[dict[str, np.ndarray | str]]:
    """Squared error of each data set, and the least that an unbiased estimator could have.

    `point_sets`: measuring points by the names of sets; a point may stand in a set twice. Sets with a point that the robot
    lacks are left out. Yields columns of one block of the budget table: one set of points in one block of data sets.
    """
    robot, n, form = study.robot, study.robot.joints, mean_form(study.judge())
    there = {point.name for point in robot.chain.points}
    point_sets = {label: points for label, points in point_sets.items() if there.issuperset(points)}
    names = tuple(dict.fromkeys(name for points in point_sets.values() for name in points))
    twice = tuple(name for name in names if any([*points].count(name) > 1 for points in point_sets.values()))
    for sets in study.blocks():
        measurements = study.measure(sets, names)
        again = study.measure(sets, twice, _AGAIN) if twice else {}
        measurements |= {name + _AGAIN: found for name, found in again.items()}
        information = {name: prefix_information(measurements[name].regressor) for name in names}
        for label, points in point_sets.items():
            read = tuple(name + _AGAIN * (name in points[:place]) for place, name in enumerate(points))
            squares = mean_square_errors(form, study.estimate(all_at_once(read, n), measurements) - robot.compliance[:, None])
            bounds = squared_error_bounds(sum((information[name] for name in points), np.zeros(())), form[:-1, :-1])
            columns = prefix_index_columns(sets, len(squares))
            yield {
                **columns,
                "points": label,
                "mean_square": squares.T.ravel(),
                "bound": np.where(np.isfinite(bounds), study.size.noise**2 * bounds, np.nan).T.ravel(),
            }
