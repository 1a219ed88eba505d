"""Data sets and test configurations of a study, drawn and measured in memory: nothing of them is kept.

They are the same as those of the pipeline's steps: random streams have names, see `random_streams`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.mechanics.elastostatics import joint_torques, loaded_point, regressor
from elastocal.mechanics.kinematics import jacobians
from elastocal.mechanics.robot import Robot, with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.identification import Measurements
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.metrics import Judge, make_judge
from elastocal.study.simulation import Loading, measurement_noise, random_experiments, true_deflections
from elastocal.study.steps.blocks import blocks_of_sets
from elastocal.study.steps.design import Design, configuration_first

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.mechanics.chain import MeasuringPoint
    from elastocal.study.experiments import Experiments


@dataclass(frozen=True)
class StudyInMemory:
    """The study of one robot, and further ones of the same size.

    Studies have numbers; that of the tables is 0. The data sets of one follow on those of the one before, and each has test
    configurations of its own.

    `robot`: with the offset of its targets. `key`: name of the robot's file; part of the name of the random streams.
    """

    robot: Robot
    key: str
    seed: int
    interpretation: Interpretation
    size: Size

    def blocks(self, number: int = 0) -> Iterator[np.ndarray]:
        """Numbers of the data sets of a study, block by block, ndarray of int each."""
        for sets in blocks_of_sets(self.size.data_sets):
            yield np.array(sets) + number * self.size.data_sets

    def experiments(
        self, sets: Sequence[int] | np.ndarray, configurations: int | None = None, purpose: str = "identification"
    ) -> Experiments:
        """Configurations and loads of data sets, as many as in the study where nothing else is said."""
        return random_experiments(
            self.robot.chain,
            self.robot.joint_limits,
            self.seed,
            self.key,
            self.interpretation.loading,
            purpose,
            sets,
            configurations or self.size.configurations,
        )

    def tests(self, number: int = 0) -> Experiments:
        """Test configurations of a study, as one data set."""
        return self.experiments([number], self.size.tests, "test")

    def deflections(self, experiments: Experiments, point: str | None = None) -> np.ndarray:
        """Deflections (sets, configurations, 6) of a measuring point, of the end-effector where none is named."""
        return true_deflections(self.robot, experiments, self._point(point), self.interpretation.wrench_at)

    def noise(
        self, sets: Sequence[int] | np.ndarray, point: str | None = None, configurations: int | None = None
    ) -> np.ndarray:
        """Standard normal noise (sets, configurations, 6) of the measurements of a point."""
        name = point or self.robot.chain.end_effector.name
        return measurement_noise(self.seed, self.key, name, sets, configurations or self.size.configurations)

    def regressor(self, experiments: Experiments, point: MeasuringPoint | None = None) -> np.ndarray:
        """Regressors (sets, configurations, 6, n) of poses of a point of the arm, of the end-effector without."""
        chain, angles = self.robot.chain, experiments.joint_angles
        point = point or chain.end_effector
        torques = joint_torques(chain, angles, experiments.wrench, loaded_point(chain, point, self.interpretation.wrench_at))
        return regressor(jacobians(chain, angles, point), torques)

    def judge(self, number: int = 0) -> Judge:
        """Score sheet of the test configurations of a study."""
        tests = self.tests(number)
        return make_judge(self.robot, tests, self.deflections(tests), self.interpretation.wrench_at)

    def measured(
        self, sets: np.ndarray, points: Sequence[str], repeat: str = "", drawn: Experiments | None = None
    ) -> dict[str, Measurements]:
        """What each measuring point contributes to some data sets.

        `sets`: numbers of the data sets. `points`: names of measuring points. `repeat`: part of the name of the noise's stream,
        by which measurements of the same configurations differ. `drawn`: other configurations and loads than those of the
        study, as many of them.
        """
        drawn, rows = drawn or self.experiments(sets), self.interpretation.rows
        if reflectors := self.interpretation.reflectors_m:
            one = replace(self.interpretation, reflectors_m=())
            parts = [
                replace(self, robot=with_target_offset(self.robot, offset), interpretation=one).measured(
                    sets, points, f"{repeat}/reflector {number}", drawn
                )
                for number, offset in enumerate(reflectors, 1)
            ]
            return {name: _stacked([part[name] for part in parts]) for name in points}
        regressors = Design(drawn, self.robot.chain, points, rows, self.interpretation.wrench_at).regressors
        found = {}
        for name in points:
            deflection = self.deflections(drawn, name) + self.size.noise * self.noise(sets, name + repeat)
            found[name] = Measurements(regressors[name], np.moveaxis(configuration_first(deflection)[..., :rows], -1, 0))
        return found

    def _point(self, name: str | None) -> MeasuringPoint:
        return self.robot.chain.point(name) if name else self.robot.chain.end_effector


def _stacked(parts: Sequence[Measurements]) -> Measurements:
    """Measurements of several targets of one point as those of one."""
    regressors, deflections = zip(*((part.regressor, part.deflection) for part in parts), strict=True)
    return Measurements(np.concatenate(regressors), np.concatenate(deflections))


def study_in_memory(
    key: str,
    robot: Mapping[str, Any],
    seed: int,
    tool_offset_m: Sequence[float],
    loading: Mapping[str, Any],
    interpretation: Mapping[str, Any],
    size: Mapping[str, Any],
) -> StudyInMemory:
    """Study from what configuration and robot file say.

    `key`: name of the robot's file. `robot`: the robot's file. `tool_offset_m`: of the targets (interpretation R5). `loading`,
    `interpretation`, `size`: attributes of `Loading`, of `Interpretation` beside its loading, and of `Size`.
    """
    conventions = Interpretation(Loading(**loading), **interpretation)
    return StudyInMemory(with_target_offset(robot_from_document(robot), tool_offset_m), key, seed, conventions, Size(**size))
