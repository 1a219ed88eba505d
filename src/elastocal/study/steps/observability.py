"""Which number tells the worth of configurations beforehand (RQ3): observability indices of each data set of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.bounds import squared_error_bounds
from elastocal.study.identification import estimate_compliance, prefix_information
from elastocal.study.metrics import error_forms, error_moment
from elastocal.study.observability import observability
from elastocal.study.steps.in_memory import judge_of_study, measured
from elastocal.study.strategies import Stage, Strategy

if TYPE_CHECKING:
    from elastocal.mechanics.robot import Robot
    from elastocal.study.interpretation import Interpretation, Size


def observability_columns(
    robot: Robot, limits: np.ndarray, key: str, seed: int, interpretation: Interpretation, size: Size
) -> dict[str, np.ndarray]:
    """Observability indices of each data set beside its bound and its error, by measurements of the end-effector.

    Compliances are in units of their true values, so that an index does not depend on the units of measurement.

    Parameters
    ----------
    robot, limits, key, seed, interpretation
        As in `repeat.repeated_blocks`.
    size : Size
        Of the study of the tables, with as many configurations as are looked at.

    Returns
    -------
    dict of str to ndarray
        Columns data_set, O1 to O5, bound and mean_square (m^2).
    """
    point, n = robot.chain.end_effector.name, robot.joints
    judge, sets = judge_of_study(robot, limits, key, seed, 0, interpretation, size), np.arange(size.data_sets)
    measurements = measured(robot, limits, key, seed, sets, (point,), interpretation, size)
    strategy = Strategy("", (Stage((point,), tuple(range(n))),))
    error = estimate_compliance(strategy, measurements, n)[0][-1] - robot.compliance[:, None]
    whole = np.concatenate([error, np.ones_like(error[:1])])
    information = prefix_information(measurements[point].regressor)[-1:]
    scaled = np.moveaxis(information[0], -1, 0) * np.outer(robot.compliance, robot.compliance)
    return {
        "data_set": sets,
        **observability(scaled, size.configurations),
        "bound": size.noise**2 * squared_error_bounds(information, error_moment(judge))[0],
        "mean_square": (whole * (error_forms(judge).mean(axis=0) @ whole)).sum(axis=0),
    }
