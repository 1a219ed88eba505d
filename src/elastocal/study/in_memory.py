"""Data sets and test configurations of a study, drawn and measured in memory: nothing
of them is kept.

They are the same as those of the pipeline's steps: random streams have names, see
`random_streams`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.io.storage import write_table
from elastocal.mechanics.elastostatics import joint_torques, loaded_point, regressor
from elastocal.mechanics.kinematics import jacobians
from elastocal.mechanics.robot import Robot, with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.equation_11 import (
    Measurements,
    compute_regressors,
    estimate_compliance,
    find_first_solvable_length,
    stack_measurements,
)
from elastocal.study.jobs import collect_provenance, collect_settings, load_strategies
from elastocal.study.metrics import ValidationSet, make_validation_set
from elastocal.study.simulation import (
    Experiments,
    Loading,
    compute_true_deflections,
    draw_measurement_noise,
    draw_random_experiments,
    split_data_sets,
)
from elastocal.study.strategies import Strategy, drop_superseded_stages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from elastocal.io.storage import TableSchema
    from elastocal.study.jobs import Job
    from elastocal.study.strategies import Stage


@dataclass(frozen=True)
class Interpretation:
    """How the paper is read; see `interpretations` in config.yaml.

    `rows`: 6 where poses are measured, 3 where positions are. `wrench_at`: R6.
    `average`: R7, see `evaluation.average`.
    """

    loading: Loading
    rows: int
    wrench_at: str
    average: str


@dataclass(frozen=True)
class StudySize:
    """How large a study is; `noise`: standard deviation, the same number in m and
    rad."""

    data_sets: int
    configurations: int
    tests: int
    noise: float


@dataclass(frozen=True)
class StudyInMemory:
    """The study of one robot, and further ones of the same size.

    Studies have numbers; that of the tables is 0. The data sets of one follow on those
    of the one before, and each has test configurations of its own. `robot`: with the
    offset of its targets. `key`: name of the robot's file; part of the name of the
    random streams.
    """

    robot: Robot
    key: str
    seed: int
    interpretation: Interpretation
    size: StudySize

    def under(self, **loading: Any) -> StudyInMemory:
        """The same study where the robot is moved and loaded otherwise, by attributes
        of `Loading`."""
        changed = replace(self.interpretation.loading, **loading)
        return replace(
            self, interpretation=replace(self.interpretation, loading=changed)
        )

    def blocks(self, number: int = 0) -> Iterator[np.ndarray]:
        """Numbers of the data sets of a study, block by block, ndarray of int each."""
        for sets in split_data_sets(self.size.data_sets):
            yield np.array(sets) + number * self.size.data_sets

    def experiments(
        self,
        sets: Sequence[int] | np.ndarray,
        configurations: int | None = None,
        purpose: str = "identification",
    ) -> Experiments:
        """Configurations and loads of data sets, as many as in the study where nothing
        else is said."""
        robot = self.robot
        count = configurations or self.size.configurations
        loading = self.interpretation.loading
        return draw_random_experiments(
            robot.chain,
            robot.joint_limits,
            self.seed,
            self.key,
            loading,
            purpose,
            sets,
            count,
        )

    def tests(self, number: int = 0) -> Experiments:
        """Test configurations of a study, as one data set."""
        return self.experiments([number], self.size.tests, "test")

    def deflections(
        self, experiments: Experiments, point: str | None = None
    ) -> np.ndarray:
        """Deflections (sets, configurations, 6) of a measuring point, of the
        end-effector where none is named."""
        chain = self.robot.chain
        named = chain.point(point) if point else chain.end_effector
        return compute_true_deflections(
            self.robot, experiments, named, self.interpretation.wrench_at
        )

    def regressor(self, experiments: Experiments) -> np.ndarray:
        """Regressors (sets, configurations, 6, n) of poses of the end-effector."""
        chain = self.robot.chain
        angles = experiments.joint_angles
        at = loaded_point(chain, chain.end_effector, self.interpretation.wrench_at)
        return regressor(
            jacobians(chain, angles, chain.end_effector),
            joint_torques(chain, angles, experiments.wrench, at),
        )

    def judge(self, number: int = 0) -> ValidationSet:
        """Score sheet of the test configurations of a study."""
        tests = self.tests(number)
        return make_validation_set(
            self.robot, tests, self.deflections(tests), self.interpretation.wrench_at
        )

    def measure(
        self, sets: np.ndarray, points: Sequence[str], repeat: str = ""
    ) -> dict[str, Measurements]:
        """What each measuring point contributes to some data sets.

        `sets`: numbers of the data sets. `points`: names of measuring points. `repeat`:
        part of the name of the noise's stream, by which measurements of the same
        configurations differ.
        """
        drawn = self.experiments(sets)
        read = self.interpretation
        regressors = compute_regressors(
            drawn, self.robot.chain, points, read.rows, read.wrench_at
        )
        found = {}
        for name in points:
            noise = draw_measurement_noise(
                self.seed, self.key, name + repeat, sets, self.size.configurations
            )
            found[name] = stack_measurements(
                regressors[name],
                self.deflections(drawn, name) + self.size.noise * noise,
            )
        return found

    def estimate(
        self, strategy: Strategy, measurements: Mapping[str, Measurements]
    ) -> np.ndarray:
        """Compliances (lengths, n, sets), rad/(N m), not a number where a length does
        not determine them."""
        compliance = estimate_compliance(strategy, measurements, self.robot.joints)[0]
        compliance[
            : find_first_solvable_length(strategy, self.interpretation.rows) - 1
        ] = np.nan
        return compliance

    def estimates(
        self, strategies: Sequence[Strategy], number: int = 0
    ) -> dict[str, list[np.ndarray]]:
        """Compliances (sets, lengths, n) from all data sets of a study, block by block,
        by the names of strategies.

        Strategies that are one estimator under equation 11 are worked out once and
        share their arrays.
        """
        stages = {
            strategy.name: drop_superseded_stages(strategy, self.robot.joints).stages
            for strategy in strategies
        }
        points = tuple(
            dict.fromkeys(
                name
                for some in stages.values()
                for stage in some
                for name in stage.points
            )
        )
        found: dict[tuple[Stage, ...], list[np.ndarray]] = {}
        for sets in self.blocks(number):
            measurements = self.measure(sets, points)
            for estimator in dict.fromkeys(stages.values()):
                compliance = self.estimate(Strategy("", estimator), measurements)
                found.setdefault(estimator, []).append(np.moveaxis(compliance, -1, 0))
        return {name: found[estimator] for name, estimator in stages.items()}


def load_study(job: Job) -> StudyInMemory:
    """The study of a rule's robot: its file, the seed, how the paper is read, the
    study's size (`study` of its parameters)."""
    read = job.params.study
    robot = with_target_offset(
        robot_from_document(read["robot"]), read["tool_offset_m"]
    )
    conventions = Interpretation(Loading(**read["loading"]), **read["interpretation"])
    return StudyInMemory(
        robot, job.wildcards.robot, read["seed"], conventions, StudySize(**read["size"])
    )


def define_study_step(
    schema: TableSchema, question: Callable[..., Any]
) -> Callable[[Job], None]:
    """A step of one robot, which fills one table: `question` has its study and, by
    their names, the rule's parameters.

    Strategies come as documents. The question returns the columns of the table, or
    yields those of one block after the other.
    """

    def step(job: Job) -> None:
        settings = collect_settings(job, "study")
        if "strategies" in settings:
            settings["strategies"] = load_strategies(job)
        found = question(load_study(job), **settings)
        write_table(
            job.output[0],
            schema,
            [found] if isinstance(found, dict) else found,
            collect_provenance(job),
        )

    return step
