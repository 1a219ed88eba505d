"""Data sets and test configurations of a study, drawn and measured in memory: nothing of them is kept.

They are the same as those of the pipeline's steps: random streams have names, see `random_streams`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.identification import Measurements
from elastocal.study.metrics import make_judge
from elastocal.study.simulation import measurement_noise, random_experiments, true_deflections
from elastocal.study.steps.columns import experiment_columns
from elastocal.study.steps.design import Design, configuration_first

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.robot import Robot
    from elastocal.study.interpretation import Interpretation, Size
    from elastocal.study.metrics import Judge


def judge_of_study(
    robot: Robot, limits: np.ndarray, key: str, seed: int, number: int, interpretation: Interpretation, size: Size
) -> Judge:
    """Score sheet of the test configurations of a study, parameters as in `repeated_blocks`."""
    at = interpretation.wrench_at
    tests = random_experiments(robot.chain, limits, seed, key, interpretation.loading, "test", [number], size.tests)
    return make_judge(robot, tests, true_deflections(robot, tests, robot.chain.end_effector, at), at)


def measured(
    robot: Robot,
    limits: np.ndarray,
    key: str,
    seed: int,
    sets: np.ndarray,
    points: Sequence[str],
    interpretation: Interpretation,
    size: Size,
    repeat: str = "",
) -> dict[str, Measurements]:
    """What each measuring point contributes to some data sets.

    Parameters
    ----------
    robot, limits, key, seed, interpretation, size
        As in `repeated_blocks`.
    sets : ndarray of int
        Numbers of the data sets.
    points : sequence of str
        Names of measuring points.
    repeat : str
        Tells measurements of the same configurations apart: part of the name of the noise's stream.

    Returns
    -------
    dict of str to Measurements
    """
    chain, at, rows = robot.chain, interpretation.wrench_at, interpretation.rows
    drawn = random_experiments(chain, limits, seed, key, interpretation.loading, "identification", sets, size.configurations)
    regressors = Design(experiment_columns(sets, drawn), chain, points, rows, at).regressors
    found = {}
    for name in points:
        normal = measurement_noise(seed, key, name + repeat, sets, size.configurations)
        deflection = true_deflections(robot, drawn, chain.point(name), at) + size.noise * normal
        found[name] = Measurements(regressors[name], np.moveaxis(configuration_first(deflection)[..., :rows], -1, 0))
    return found
