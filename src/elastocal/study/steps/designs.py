"""Which configurations (RQ3): random against optimal ones, measured at the end-effector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import joint_torques, regressor
from elastocal.mechanics.kinematics import jacobians
from elastocal.random_streams import stream
from elastocal.study.designs import worths
from elastocal.study.simulation import random_experiments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.experiments import Experiments
    from elastocal.study.interpretation import Interpretation, Size


def design_worths(
    robot: Robot,
    limits: np.ndarray,
    key: str,
    seed: int,
    interpretation: Interpretation,
    size: Size,
    candidates: int,
    sizes: Sequence[int],
) -> dict[str, np.ndarray]:
    """Random against optimal configurations, measured at the end-effector.

    Parameters
    ----------
    robot, limits, key, seed, interpretation, size
        As in `repeat.repeated_blocks`.
    candidates : int
        Random configurations among which is chosen.
    sizes : sequence of int
        Configurations of a design.

    Returns
    -------
    dict of str to ndarray
        Columns design, configurations, rms, low and high (m).
    """
    loading = interpretation.loading
    drawn = random_experiments(robot.chain, limits, seed, key, loading, "candidates of designs", [0], candidates)
    tests = random_experiments(robot.chain, limits, seed, key, loading, "test", [0], size.tests)
    rows = robot.compliance * _regressors(robot, drawn)[:, : interpretation.rows] / size.noise
    accuracy = robot.compliance * _regressors(robot, tests)[:, :3]
    found = worths(rows, accuracy, sizes, stream(seed, key, "random designs", 0))
    return {
        "design": np.array([worth.kind for worth in found], object),
        "configurations": np.array([worth.configurations for worth in found]),
        **{name: np.array([getattr(worth, name) for worth in found]) for name in ("rms", "low", "high")},
    }


def _regressors(robot: Robot, experiments: Experiments) -> np.ndarray:
    """Regressors (configurations, 6, n) of the end-effector in one data set."""
    point = robot.chain.end_effector
    torques = joint_torques(robot.chain, experiments.joint_angles, experiments.wrench, point)
    return regressor(jacobians(robot.chain, experiments.joint_angles, point), torques)[0]
