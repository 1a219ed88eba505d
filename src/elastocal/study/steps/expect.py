"""Step 4b: expectations of the scores of one strategy in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.expectations import expected_compliance, expected_deviation
from elastocal.study.steps.columns import data_sets
from elastocal.study.steps.repeat import score_columns
from elastocal.study.table_schemas import covariance_columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.metrics import Judge


def expected_scores(
    design_blocks: Iterable[Mapping[str, np.ndarray]],
    noise_free: np.ndarray | None,
    noise: float,
    robot: Robot,
    judge: Judge,
    fixed_joints: Sequence[int],
    method: str,
    deviation_of: str,
) -> dict[str, np.ndarray]:
    """Expectations at every length.

    `design_blocks`: blocks of the design table. `noise_free` (lengths, n): compliances of the averaged model without noise,
    rad/(N m): what the linearisation does. None: the true ones. `noise`: standard deviation, the same number in m and rad.
    `method`, `deviation_of`: interpretations R7 and R8, see `evaluation.average`. Returns columns of the expected table; not a
    number where some data set does not determine the compliances.
    """
    n, sets, total = robot.joints, 0, np.zeros(())
    for block in design_blocks:
        count = len(data_sets(block))
        covariance = np.empty((len(block["length"]) // count, n, n))
        for name, i, j in covariance_columns(n):
            covariance[:, i, j] = covariance[:, j, i] = block[name].reshape(count, -1).sum(axis=0, dtype=float)
        total, sets = total + covariance, sets + count
    covariance = noise**2 * total / sets
    start = np.broadcast_to(robot.compliance, covariance.shape[:2]) if noise_free is None else noise_free
    compliance = expected_compliance(start, np.diagonal(covariance, axis1=1, axis2=2), method)
    # The mean over so many data sets scatters by so much less.
    scatter = covariance / sets if deviation_of == "averaged_model" else covariance
    return score_columns(compliance, expected_deviation(judge, compliance, scatter), robot, fixed_joints)
