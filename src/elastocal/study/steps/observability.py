"""Which number tells the worth of configurations beforehand (RQ3): observability indices of each data set of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.bounds import squared_error_bounds
from elastocal.study.identification import estimate_compliance, prefix_information
from elastocal.study.metrics import mean_form, mean_square_errors
from elastocal.study.observability import observability
from elastocal.study.strategies import all_at_once

if TYPE_CHECKING:
    from elastocal.study.steps.in_memory import StudyInMemory


def observability_columns(study: StudyInMemory) -> dict[str, np.ndarray]:
    """Observability indices of each data set beside its bound and its error, by measurements of the end-effector.

    Compliances are in units of their true values, so that an index does not depend on the units of measurement.

    `study`: with as many configurations as are looked at. Returns columns data_set, O1 to O5, bound and mean_square (m^2).
    """
    robot, size, sets = study.robot, study.size, np.arange(study.size.data_sets)
    point, n, form = robot.chain.end_effector.name, robot.joints, mean_form(study.judge())
    measurements = study.measure(sets, (point,))
    error = estimate_compliance(all_at_once((point,), n), measurements, n)[0][-1] - robot.compliance[:, None]
    information = prefix_information(measurements[point].regressor)[-1:]
    scaled = information[0] * np.outer(robot.compliance, robot.compliance)
    return {
        "data_set": sets,
        **observability(scaled, size.configurations),
        "bound": size.noise**2 * squared_error_bounds(information, form[:-1, :-1])[0],
        "mean_square": mean_square_errors(form, error),
    }
