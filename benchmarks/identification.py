"""Every prefix of 1000 data sets against a Python loop over numpy.linalg.lstsq."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import Row, interleaved, load_robot, load_strategy

from elastocal.mechanics.robot import Robot
from elastocal.study.equation_11 import (
    Measurements,
    compute_regressors,
    estimate_compliance,
    stack_measurements,
)
from elastocal.study.simulation import (
    Loading,
    RandomDesign,
    compute_true_deflections,
    draw_measurement_noise,
    draw_random_experiments,
    split_data_sets,
)
from elastocal.study.strategies import Strategy

ROWS = 6
LOADING = Loading(
    force_N=1000.0,
    offset_m=(0.0, 0.5, 0.0),
    offset_frame="base",
    joint_range="full_turn",
)
NOISE = 200e-6
TARGET = 20
TOLERANCE = 1e-9


@dataclass(frozen=True)
class Setting:
    """How many data sets, configurations of each and repetitions."""

    sets: int
    configurations: int
    repetitions: int


FULL = Setting(1000, 100, 3)
SMALL = Setting(4, 10, 1)


def rows(work: Path, setting: Setting) -> list[Row]:
    """The row of the report; `work` is not used."""
    sets = setting.sets
    configurations = setting.configurations
    repetitions = setting.repetitions
    robot = load_robot("kuka")
    strategy = load_strategy("6DoF")
    joints = robot.joints
    blocks = [
        _measurements(robot, strategy, block, configurations)
        for block in split_data_sets(sets)
    ]
    systems = [_systems(measurements["6DoF"]) for measurements in blocks]
    order = list(strategy.stages[0].identified)

    def ours() -> list[np.ndarray]:
        return [
            estimate_compliance(strategy, measurements, joints)[0]
            for measurements in blocks
        ]

    def loop() -> np.ndarray:
        estimates = np.empty((sets, configurations, joints))
        number = 0
        for matrices, deflections in systems:
            for matrix, deflection in zip(matrices, deflections, strict=True):
                for length in range(1, configurations + 1):
                    end = ROWS * length
                    estimates[number, length - 1] = np.linalg.lstsq(
                        matrix[:end], deflection[:end]
                    )[0]
                number += 1
        return estimates

    _assert_equal(np.concatenate(ours(), axis=2).transpose(2, 0, 1)[..., order], loop())
    alone, theirs = map(
        min, interleaved({"elastocal": ours, "numpy.linalg.lstsq": loop}, repetitions)
    )
    how = (
        f"estimate_compliance against a loop of numpy.linalg.lstsq over {sets} data sets"
        f" and {configurations} prefixes, 6DoF on kuka, minimum of {repetitions},"
        f" equal to {TOLERANCE:g}"
    )
    return [Row.of_speedup("identification", alone, theirs, TARGET, how)]


def _measurements(
    robot: Robot, strategy: Strategy, sets: Sequence[int], configurations: int
) -> dict[str, Measurements]:
    design = RandomDesign(robot.chain, robot.joint_limits, LOADING, "kuka")
    experiments = draw_random_experiments(
        design, 1, "identification", sets, configurations
    )
    point = robot.chain.end_effector
    noise = NOISE * draw_measurement_noise(1, "kuka", point.name, sets, configurations)
    measured = (
        compute_true_deflections(robot, experiments, point, "end_effector") + noise
    )
    matrices = compute_regressors(
        experiments, robot.chain, strategy.points, ROWS, "end_effector"
    )
    return {point.name: stack_measurements(matrices[point.name], measured)}


def _systems(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and right-hand side of each data set, contiguous, so that the loop has
    nothing to do but to solve."""
    _, joints, _, sets = measurements.regressor.shape
    matrices = np.ascontiguousarray(
        measurements.regressor.transpose(3, 2, 0, 1)
    ).reshape(sets, -1, joints)
    return matrices, np.ascontiguousarray(
        measurements.deflection.transpose(2, 1, 0)
    ).reshape(sets, -1)


def _assert_equal(ours: np.ndarray, theirs: np.ndarray) -> None:
    """No estimate differs by more than the tolerance times the largest compliance of
    the same data set and prefix."""
    difference = np.abs(ours - theirs) / np.abs(theirs).max(axis=2, keepdims=True)
    if not difference.max() <= TOLERANCE:
        raise AssertionError(
            f"estimates differ by {difference.max():.2g} of the largest compliance"
        )
