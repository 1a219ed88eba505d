"""Data sets and test configurations of a study, drawn and measured in memory and not
kept.

They equal those of the pipeline's steps, because random streams are named, see
`random_streams`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.io.storage import write_table
from elastocal.mechanics.elastostatics import (
    build_regressor,
    compute_joint_torques,
    select_loaded_point,
)
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.mechanics.robot import Robot, set_target_offset
from elastocal.mechanics.robot_file import parse_robot
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
    RandomDesign,
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

    Attributes
    ----------
    loading : Loading
    rows : int
        Components measured at a point: 6 of a pose, 3 of a position.
    wrench_at : str
        R6.
    average : str
        R7, see `evaluation.average_estimates`.
    """

    loading: Loading
    rows: int
    wrench_at: str
    average: str


@dataclass(frozen=True)
class StudySize:
    """Size of a study, and the standard deviation of its noise: the same number in m and
    rad."""

    data_sets: int
    configurations: int
    tests: int
    noise: float


@dataclass(frozen=True)
class StudyInMemory:
    """The study of one robot, and further studies of the same size.

    Studies have numbers; that of the tables is 0. The data sets of a study follow those
    of the study before, and each study has its own test configurations.

    Attributes
    ----------
    robot : Robot
        With the offset of its targets.
    key : str
        Name of the robot's file; part of the names of the random streams.
    seed : int
    interpretation : Interpretation
    size : StudySize
    """

    robot: Robot
    key: str
    seed: int
    interpretation: Interpretation
    size: StudySize

    def with_loading(self, **loading: Any) -> StudyInMemory:
        """The same study with other attributes of its `Loading`."""
        changed = replace(self.interpretation.loading, **loading)
        interpretation = replace(self.interpretation, loading=changed)
        return replace(self, interpretation=interpretation)

    def list_blocks(self, number: int = 0) -> Iterator[np.ndarray]:
        """Yield the numbers of a study's data sets, block by block."""
        for sets in split_data_sets(self.size.data_sets):
            yield np.array(sets) + number * self.size.data_sets

    def draw_experiments(
        self,
        sets: Sequence[int] | np.ndarray,
        configurations: int | None = None,
        purpose: str = "identification",
    ) -> Experiments:
        """Draw configurations and loads of data sets; by default as many configurations
        as the study has."""
        robot = self.robot
        loading = self.interpretation.loading
        design = RandomDesign(robot.chain, robot.joint_limits, loading, self.key)
        count = configurations or self.size.configurations
        return draw_random_experiments(design, self.seed, purpose, sets, count)

    def draw_tests(self, number: int = 0) -> Experiments:
        """Draw the test configurations of a study, as one data set."""
        return self.draw_experiments([number], self.size.tests, "test")

    def compute_deflections(
        self, experiments: Experiments, point: str | None = None
    ) -> np.ndarray:
        """Deflections (sets, configurations, 6) of a measuring point, by default of the
        end-effector; m, rad."""
        chain = self.robot.chain
        measured = chain.point(point) if point else chain.end_effector
        return compute_true_deflections(
            self.robot, experiments, measured, self.interpretation.wrench_at
        )

    def compute_regressor(self, experiments: Experiments) -> np.ndarray:
        """Regressors (sets, configurations, 6, n) of poses of the end-effector."""
        chain = self.robot.chain
        point = chain.end_effector
        angles = experiments.joint_angles
        loaded = select_loaded_point(chain, point, self.interpretation.wrench_at)
        torques = compute_joint_torques(chain, angles, experiments.wrench, loaded)
        return build_regressor(compute_jacobians(chain, angles, point), torques)

    def make_validation_set(self, number: int = 0) -> ValidationSet:
        """Prepare the test configurations of a study for the errors of models."""
        return self.validate_on(self.draw_tests(number))

    def validate_on(self, experiments: Experiments) -> ValidationSet:
        """Prepare any configurations for the errors of models."""
        deflections = self.compute_deflections(experiments)
        wrench_at = self.interpretation.wrench_at
        return make_validation_set(self.robot, experiments, deflections, wrench_at)

    def measure(
        self, sets: np.ndarray, points: Sequence[str], repeat: str = ""
    ) -> dict[str, Measurements]:
        """Simulate what each measuring point contributes to some data sets.

        Parameters
        ----------
        sets : array of int
            Numbers of the data sets.
        points
            Names of measuring points.
        repeat : str
            Part of the name of the noise's stream; distinguishes repeated measurements
            of the same configurations.
        """
        experiments = self.draw_experiments(sets)
        interpretation = self.interpretation
        regressors = compute_regressors(
            experiments,
            self.robot.chain,
            points,
            interpretation.rows,
            interpretation.wrench_at,
        )
        measurements = {}
        for name in points:
            noise = draw_measurement_noise(
                self.seed, self.key, name + repeat, sets, self.size.configurations
            )
            ideal = self.compute_deflections(experiments, name)
            measurements[name] = stack_measurements(
                regressors[name], ideal + self.size.noise * noise
            )
        return measurements

    def estimate(
        self, strategy: Strategy, measurements: Mapping[str, Measurements]
    ) -> np.ndarray:
        """Estimate compliances (lengths, n, sets), rad/(N m); NaN if a length has too
        few measurements."""
        compliance, _ = estimate_compliance(strategy, measurements, self.robot.joints)
        first = find_first_solvable_length(strategy, self.interpretation.rows)
        compliance[: first - 1] = np.nan
        return compliance

    def estimate_all(
        self, strategies: Sequence[Strategy], number: int = 0
    ) -> dict[str, list[np.ndarray]]:
        """Estimate compliances from all data sets of a study by several strategies.

        Strategies that are one estimator under equation 11 are computed once and share
        their arrays.

        Returns
        -------
        dict of lists of (sets, lengths, n) arrays, rad/(N m)
            Blocks of data sets by the names of the strategies.
        """
        stages = {
            strategy.name: drop_superseded_stages(strategy, self.robot.joints).stages
            for strategy in strategies
        }
        estimators = [
            Strategy("", estimator) for estimator in dict.fromkeys(stages.values())
        ]
        points = dict.fromkeys(
            name for estimator in estimators for name in estimator.points
        )
        estimates: dict[tuple[Stage, ...], list[np.ndarray]] = {
            estimator.stages: [] for estimator in estimators
        }
        for sets in self.list_blocks(number):
            measurements = self.measure(sets, [*points])
            for estimator in estimators:
                compliance = self.estimate(estimator, measurements)
                estimates[estimator.stages].append(np.moveaxis(compliance, -1, 0))
        return {name: estimates[estimator] for name, estimator in stages.items()}


def load_study(job: Job) -> StudyInMemory:
    """Load the study of a rule's robot from the parameter `study`: the robot's file, the
    seed, the interpretation and the size."""
    settings = job.params.study
    robot = set_target_offset(parse_robot(settings["robot"]), settings["tool_offset_m"])
    loading = Loading(**settings["loading"])
    return StudyInMemory(
        robot,
        job.wildcards.robot,
        settings["seed"],
        Interpretation(loading, **settings["interpretation"]),
        StudySize(**settings["size"]),
    )


def define_study_step(
    schema: TableSchema, evaluate: Callable[..., Iterator[dict[str, Any]]]
) -> Callable[[Job], None]:
    """Define a step that fills one table of one robot.

    Parameters
    ----------
    schema
        Of the table.
    evaluate
        Called with the study and, by name, the rule's parameters; strategies are made
        from their documents. Yields the columns of the table, block by block.
    """

    def step(job: Job) -> None:
        settings = collect_settings(job, "study")
        if "strategies" in settings:
            settings["strategies"] = load_strategies(job)
        blocks = evaluate(load_study(job), **settings)
        write_table(job.output[0], schema, blocks, collect_provenance(job))

    return step
