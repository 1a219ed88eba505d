"""Where on the arm a second target pays (RQ2): each place at an equal number of measurements, and how often it is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.arm_points import in_sight, places
from elastocal.study.metrics import error_moment

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.mechanics.chain import MeasuringPoint
    from elastocal.study.experiments import Experiments
    from elastocal.study.steps.in_memory import StudyInMemory


def place_columns(study: StudyInMemory, tracker_m: Sequence[float], arm: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Cramér-Rao bounds of the end-effector and a second target, against the end-effector in twice as many configurations.

    `study`: with as many configurations as both are measured in. `arm`: sets, radius_m, bar_m, acceptance_deg; see
    `arm_points`. Returns columns joints, along (m), side, data_set, bound and bound_end_effector (m^2), turned and fixed:
    shares of the configurations of the data set in which the target is seen.
    """
    chain, length, sets = study.robot.chain, study.size.configurations, np.arange(arm["sets"])
    drawn, moment = study.experiments(sets, 2 * length), error_moment(study.judge())
    first = drawn.first(length)
    once = _information(study, first, chain.end_effector)
    angles = first.joint_angles.reshape(-1, chain.coordinates)
    scale, columns = study.size.noise**2, []
    alone = scale * _bounds(_information(study, drawn, chain.end_effector), moment)
    for place in places(chain, arm["radius_m"], arm["bar_m"]):
        seen = in_sight(chain, angles, place, tracker_m, arm["radius_m"], arm["acceptance_deg"])
        turned, fixed = (each.reshape(len(sets), length).mean(axis=1) for each in seen)
        columns.append(
            {
                "joints": np.full(len(sets), place.joints),
                "along": np.full(len(sets), place.along_m),
                "side": np.full(len(sets), place.side, object),
                "data_set": sets,
                "bound": scale * _bounds(once + _information(study, first, place.point), moment),
                "bound_end_effector": alone,
                "turned": turned,
                "fixed": fixed,
            }
        )
    return {name: np.concatenate([each[name] for each in columns]) for name in columns[0]}


def _information(study: StudyInMemory, experiments: Experiments, point: MeasuringPoint) -> np.ndarray:
    """Sum of A' A (sets, n, n) over the configurations of each data set, from what is measured of a point."""
    rows = study.regressor(experiments, point)[:, :, : study.interpretation.rows]
    flat = rows.reshape(len(rows), -1, rows.shape[-1])
    return flat.swapaxes(1, 2) @ flat


def _bounds(information: np.ndarray, moment: np.ndarray) -> np.ndarray:
    return (np.linalg.inv(information) * moment).sum(axis=(1, 2))
