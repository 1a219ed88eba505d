"""Every prefix of 1000 data sets against a Python loop over numpy.linalg.lstsq."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from common import Row, interleaved, load_robot, load_strategy

from elastocal.mechanics.robot import Robot
from elastocal.study.identification import Estimates, Measurements, estimate_compliance, identify
from elastocal.study.simulation import Loading, measurement_noise, random_experiments, true_deflections
from elastocal.study.steps import SETS_PER_BLOCK
from elastocal.study.steps.columns import deflection_columns, experiment_columns
from elastocal.study.steps.identify import Situation
from elastocal.study.strategies import Strategy

SETS, CONFIGURATIONS, ROWS = 1000, 100, 6
LOADING = Loading(force_N=1000.0, offset_m=(0.0, 0.5, 0.0), offset_frame="base", joint_range="full_turn")
NOISE = 200e-6
REPETITIONS = 3
TARGET = 20
TOLERANCE = 1e-9


def rows(work: Path) -> list[Row]:
    """Rows of the report, for the estimates alone and with what the study stores beside them; `work` is not used."""
    robot, strategy = load_robot("kuka"), load_strategy("6DoF")
    joints = robot.joints
    blocks = [_measurements(robot, strategy, range(i, i + SETS_PER_BLOCK)) for i in range(0, SETS, SETS_PER_BLOCK)]
    systems = [_systems(measurements["6DoF"]) for measurements in blocks]
    order = list(strategy.stages[0].identified)

    def ours() -> list[np.ndarray]:
        return [estimate_compliance(strategy, measurements, joints)[0] for measurements in blocks]

    def loop() -> np.ndarray:
        found = np.empty((SETS, CONFIGURATIONS, joints))
        number = 0
        for matrices, deflections in systems:
            for matrix, deflection in zip(matrices, deflections, strict=True):
                for length in range(1, CONFIGURATIONS + 1):
                    end = ROWS * length
                    found[number, length - 1] = np.linalg.lstsq(matrix[:end], deflection[:end])[0]
                number += 1
        return found

    def with_covariance() -> list[Estimates]:
        return [identify(strategy, measurements, joints) for measurements in blocks]

    _assert_equal(np.concatenate(ours(), axis=2).transpose(2, 0, 1)[..., order], loop())
    functions = {"elastocal": ours, "with covariance": with_covariance, "numpy.linalg.lstsq": loop}
    alone, full, theirs = map(min, interleaved(functions, REPETITIONS))
    against = f"a loop of numpy.linalg.lstsq over {SETS} data sets and {CONFIGURATIONS} prefixes, 6DoF on kuka"
    how = f"estimate_compliance against {against}, minimum of {REPETITIONS}, equal to {TOLERANCE:g}"
    more = (
        f"identify, which adds covariances and condition numbers, against {against}, which does not; minimum of {REPETITIONS}"
    )
    return [
        Row("identification", alone, theirs, theirs / alone, f">= {TARGET}", theirs / alone >= TARGET, how),
        Row("identification with covariance", full, theirs, theirs / full, "", None, more),
    ]


def _measurements(robot: Robot, strategy: Strategy, sets: Sequence[int]) -> dict[str, Measurements]:
    experiments = random_experiments(
        robot.chain, robot.joint_limits, 1, "kuka", LOADING, "identification", sets, CONFIGURATIONS
    )
    point = robot.chain.end_effector
    noise = NOISE * measurement_noise(1, "kuka", point.name, sets, CONFIGURATIONS)
    measured = true_deflections(robot, experiments, point, "end_effector") + noise
    columns = {point.name: deflection_columns(point.name, sets, measured)}
    return Situation(experiment_columns(sets, experiments), columns, robot.chain, strategy, ROWS, "end_effector").measurements


def _systems(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and right-hand side of each data set, contiguous, so that the loop has nothing to do but to solve."""
    _, joints, _, sets = measurements.regressor.shape
    matrices = np.ascontiguousarray(measurements.regressor.transpose(3, 2, 0, 1)).reshape(sets, -1, joints)
    return matrices, np.ascontiguousarray(measurements.deflection.transpose(2, 1, 0)).reshape(sets, -1)


def _assert_equal(ours: np.ndarray, theirs: np.ndarray) -> None:
    """No estimate differs by more than the tolerance times the largest compliance of the same data set and prefix."""
    difference = np.abs(ours - theirs) / np.abs(theirs).max(axis=2, keepdims=True)
    if not difference.max() <= TOLERANCE:
        raise AssertionError(f"estimates differ by {difference.max():.2g} of the largest compliance")
