"""What the study's assumptions cost: geometry that is known, and noise that is the same for every measurement.

Closed forms over the data sets of the study, which are drawn again in memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.designs import mean_squares
from elastocal.mechanics.kinematics import poses
from elastocal.study.geometry import geometry_columns, qualities
from elastocal.study.weighting import expected_errors, pose_deviation, range_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.study.steps.in_memory import StudyInMemory


def geometry_rows(study: StudyInMemory, zero_rad: float, length_m: float) -> dict[str, np.ndarray]:
    """Geometry and compliances from as many unloaded as loaded poses of the end-effector, by each estimator.

    `zero_rad`, `length_m`: standard deviations of the errors of joint zeros and link lengths. Returns columns estimator, noise,
    leak (m), compliance_noise and compliance_leak (percent) and zero_noise and zero_leak (rad): root mean squares over the
    joints.
    """
    robot, size, drawn, tests = study.robot, study.size, study.experiments(range(study.size.data_sets)), study.tests()
    geometry, there = geometry_columns(robot.chain, drawn.joint_angles), geometry_columns(robot.chain, tests.joint_angles)
    sensitivities = np.concatenate([there, study.regressor(tests)], axis=-1)[0, :, :3]
    deviation = np.full(geometry.shape[-1], length_m)
    deviation[: robot.joints] = zero_rad
    found = qualities(
        geometry.reshape(size.data_sets, -1, geometry.shape[-1]),
        study.regressor(drawn).reshape(size.data_sets, -1, robot.joints),
        size.noise,
        robot.compliance,
        deviation,
        mean_squares(sensitivities),
    )
    columns: dict[str, list[object]] = {"estimator": [*found]}
    for name in ("noise", "leak"):
        columns[name] = [getattr(quality, name) for quality in found.values()]
    for name, factor in (("compliance_noise", 100.0), ("compliance_leak", 100.0), ("zero_noise", 1.0), ("zero_leak", 1.0)):
        columns[name] = [factor * np.sqrt((getattr(quality, name) ** 2).mean()) for quality in found.values()]
    return {name: np.array(values, object if name == "estimator" else float) for name, values in columns.items()}


def weighting_rows(
    study: StudyInMemory, orientation_ratios: Sequence[float], tracker_m: Sequence[float], per_metre: Sequence[float]
) -> dict[str, np.ndarray]:
    """Equal weights against those of the noise, measured at the end-effector.

    `study`: the noise of its size is that of positions. `orientation_ratios`: noise of orientations over that of positions, rad
    per m. `tracker_m`: where the tracker stands. `per_metre`: by which the noise of positions grows with the range, m per m.
    Returns columns orientation_ratio, per_metre, equal and weighted (m).
    """
    robot, size, drawn = study.robot, study.size, study.experiments(range(study.size.data_sets))
    columns, shape = study.regressor(drawn).reshape(size.data_sets, -1, robot.joints), drawn.joint_angles.shape[:2]
    moment = mean_squares(study.regressor(study.tests())[0, :, :3])
    position, _ = poses(robot.chain, drawn.joint_angles, robot.chain.end_effector)
    cases = [(ratio, 0.0) for ratio in orientation_ratios] + [(1.0, grown) for grown in per_metre]
    errors = []
    for ratio, grown in cases:
        noise = range_noise(position, np.array(tracker_m), size.noise, grown)
        errors.append(expected_errors(columns, pose_deviation(noise, ratio * size.noise, shape), moment))
    ratios, growths = np.array(cases).T
    equal, weighted = np.array(errors).T
    return {"orientation_ratio": ratios, "per_metre": growths, "equal": equal, "weighted": weighted}
