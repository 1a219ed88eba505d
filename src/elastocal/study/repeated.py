"""Further studies of the same size, hundreds of them: equation 11 as normal equations of
every prefix, with the data sets behind each other.

A further study counts by its scores alone, so that it may be cheaper than the study of
the tables in two ways. Deflections are linear in the compliances (equation 9): at no
noise the exact kinematics move dev by some nanometres, where a noise of 200 µm moves it
by micrometres. And the normal equations of equation 11 are formed and solved by
Cholesky's decomposition, as they are printed; the digits that this costs a prefix of one
or two configurations, which no table shows, are those that `equation_11` keeps.

Unknowns are the relative errors of the compliances, so that the right-hand sides hold
the noise alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.storage import write_table
from elastocal.study.equation_11 import (
    compute_regressors,
    find_first_solvable_length,
    order_by_configuration,
)
from elastocal.study.in_memory import load_study
from elastocal.study.jobs import Job, collect_provenance, load_strategies
from elastocal.study.metrics import (
    compute_mean_deviation,
    compute_scores,
    evaluate_quadratic_form,
)
from elastocal.study.schemas import REPEATED
from elastocal.study.simulation import draw_measurement_noise
from elastocal.study.strategies import Strategy, drop_superseded_stages

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.metrics import ValidationSet
    from elastocal.study.strategies import Stage

# Block size: what one step of the solution uses of this many data sets stays in a
# second-level cache of 2 MB. Twice as many data sets take 5 % longer.
_SETS_PER_BLOCK = 100


@dataclass(frozen=True)
class PrefixEquations:
    """Normal equations of every prefix of some data sets, of one or more measuring
    points.

    Attributes
    ----------
    matrix : dict of (configurations, sets) arrays
        Elements of the sum of A^T A by their joints, the larger joint first.
    right_side : dict of (configurations, sets) arrays
        Elements of the sum of A^T times the noise, by the joint.
    """

    matrix: Mapping[tuple[int, int], np.ndarray]
    right_side: Mapping[int, np.ndarray]

    def solve(
        self, identified: Sequence[int], fixed: Mapping[int, np.ndarray]
    ) -> dict[int, np.ndarray]:
        """Solve for the joints of a stage by Cholesky's decomposition.

        Parameters
        ----------
        identified
            Joints that the stage identifies, ascending.
        fixed
            Errors (configurations, sets) of joints that the stage fixes.

        Returns
        -------
        dict of (configurations, sets) arrays
            Relative errors of the identified joints; NaN if a prefix is too short.
        """
        factor: dict[tuple[int, int], np.ndarray] = {}
        reduced: dict[int, np.ndarray] = {}
        for row, joint in enumerate(identified):
            before = identified[:row]
            for column in identified[: row + 1]:
                element = self.matrix[joint, column].copy()
                for earlier in identified[: identified.index(column)]:
                    element -= factor[joint, earlier] * factor[column, earlier]
                if column == joint:
                    # The inverse of the diagonal saves divisions.
                    factor[joint, joint] = 1.0 / np.sqrt(element)
                else:
                    factor[joint, column] = element * factor[column, column]
            value = self.right_side[joint].copy()
            for known_joint, error in fixed.items():
                pair = (max(joint, known_joint), min(joint, known_joint))
                value -= self.matrix[pair] * error
            for earlier in before:
                value -= factor[joint, earlier] * reduced[earlier]
            reduced[joint] = value * factor[joint, joint]
        solution: dict[int, np.ndarray] = {}
        for joint in reversed(identified):
            value = reduced[joint]
            for later, error in solution.items():
                value = value - factor[later, joint] * error
            solution[joint] = value * factor[joint, joint]
        return solution


def add_equations(points: Sequence[PrefixEquations]) -> PrefixEquations:
    """Add the normal equations of measuring points that a stage uses together."""
    matrix: dict[tuple[int, int], np.ndarray] = {}
    right_side: dict[int, np.ndarray] = {}
    for point in points:
        for pair, element in point.matrix.items():
            matrix[pair] = matrix[pair] + element if pair in matrix else element
        for joint, value in point.right_side.items():
            right_side[joint] = (
                right_side[joint] + value if joint in right_side else value
            )
    return PrefixEquations(matrix, right_side)


def form_prefix_equations(
    study: StudyInMemory, sets: np.ndarray, points: Sequence[str]
) -> dict[str, PrefixEquations]:
    """Form the normal equations of each measuring point from simulated data sets."""
    chain = study.robot.chain
    rows = study.interpretation.rows
    regressors = compute_regressors(
        study.draw_experiments(sets),
        chain,
        points,
        rows,
        study.interpretation.wrench_at,
    )
    scale = study.robot.compliance
    equations = {}
    for name in points:
        normal = draw_measurement_noise(
            study.seed, study.key, name, sets, study.size.configurations
        )
        noise = study.size.noise * np.moveaxis(order_by_configuration(normal), -1, 0)
        joints = chain.moved_by(chain.point(name))
        columns = {joint: regressors[name][:, joint] for joint in joints}
        equations[name] = _sum_over_prefixes(columns, noise[:rows], scale)
    return equations


def _sum_over_prefixes(
    columns: Mapping[int, np.ndarray], noise: np.ndarray, scale: np.ndarray
) -> PrefixEquations:
    """Inner products of columns by joint, times the joint's scale, and of the noise, all
    (rows, configurations, sets), summed over the configurations of every prefix."""
    pairs = [pair for pair in product(columns, columns) if pair[1] <= pair[0]]
    sums = np.empty((len(pairs) + len(columns), *noise.shape[1:]))
    factors = [
        (columns[larger], columns[smaller], scale[larger] * scale[smaller])
        for larger, smaller in pairs
    ]
    factors += [(column, noise, scale[joint]) for joint, column in columns.items()]
    for element, (first, second, factor) in zip(sums, factors, strict=True):
        np.einsum("rks,rks->ks", first, second, out=element)
        element *= factor
    # A loop over the configurations is faster than numpy's cumulative sum, which goes
    # along an axis that is far apart in memory.
    for configuration in range(1, sums.shape[1]):
        sums[:, configuration] += sums[:, configuration - 1]
    return PrefixEquations(
        dict(zip(pairs, sums, strict=False)),
        dict(zip(columns, sums[len(pairs) :], strict=True)),
    )


def solve_stage(
    stage: Stage,
    equations: Mapping[str, PrefixEquations],
    earlier: Mapping[int, np.ndarray],
) -> dict[int, np.ndarray]:
    """Solve a stage of a strategy.

    Parameters
    ----------
    stage
    equations
        Of each measuring point, by its name.
    earlier
        Relative errors (configurations, sets) by joint, from the earlier stages.

    Returns
    -------
    dict of (configurations, sets) arrays
        The relative errors after this stage.
    """
    stacked = add_equations([equations[name] for name in stage.points])
    fixed = {joint: earlier[joint] for joint in stage.fixed}
    return {**earlier, **stacked.solve(sorted(stage.identified), fixed)}


def solve_strategies(
    strategies: Sequence[Strategy], equations: Mapping[str, PrefixEquations]
) -> list[dict[int, np.ndarray]]:
    """Solve the stages of each strategy one after the other; strategies that begin with
    the same stages share their solution.

    Returns
    -------
    list of dicts of (configurations, sets) arrays
        Relative errors of the compliances, by joint, of each strategy.
    """
    solved: dict[tuple[Stage, ...], dict[int, np.ndarray]] = {(): {}}
    for strategy in strategies:
        for number, stage in enumerate(strategy.stages):
            before = strategy.stages[:number]
            if (*before, stage) not in solved:
                solved[*before, stage] = solve_stage(stage, equations, solved[before])
    return [solved[strategy.stages] for strategy in strategies]


@dataclass(frozen=True)
class StudyMeans:
    """Means over the data sets of a study, by what is averaged.

    Attributes
    ----------
    compliance : dict of (lengths, n) arrays, rad/(N m)
        Of the averaged model, for ``stiffness`` and ``compliance`` (interpretation R7).
    mean_square : (lengths,) array, m^2
        Mean square error of single data sets on the test configurations.
    """

    compliance: Mapping[str, np.ndarray]
    mean_square: np.ndarray


def average_study(
    study: StudyInMemory,
    estimators: Sequence[Strategy],
    number: int,
    validation: ValidationSet,
) -> dict[tuple[Stage, ...], StudyMeans]:
    """Identify all data sets of a study by different estimators, and average.

    Parameters
    ----------
    study
        Of a robot whose links are rigid.
    estimators
        Strategies that differ, see `strategies.drop_superseded_stages`.
    number : int
        Of the study; that of the tables is 0.
    validation
        The test configurations of the study.

    Returns
    -------
    dict
        By the stages of the estimators.
    """
    count = study.size.data_sets
    numbers = np.arange(number * count, (number + 1) * count)
    sums = {estimator.stages: _Sums() for estimator in estimators}
    for first in range(0, count, _SETS_PER_BLOCK):
        sets = numbers[first : first + _SETS_PER_BLOCK]
        # The matrix of a prefix has no factor if the prefix is too short, or if its
        # points are too few: two positions of one body determine five of six numbers.
        with np.errstate(divide="ignore", invalid="ignore"):
            errors_by_stages = _estimate_block(study, estimators, sets)
            for stages, errors in errors_by_stages.items():
                sums[stages].add(errors, study.robot.compliance, validation)
    return {
        stages: total.average(study.robot.compliance, count)
        for stages, total in sums.items()
    }


def _estimate_block(
    study: StudyInMemory, estimators: Sequence[Strategy], sets: np.ndarray
) -> dict[tuple[Stage, ...], np.ndarray]:
    """Relative errors (n, configurations, sets) of data sets by each estimator; NaN if a
    prefix is too short."""
    points = dict.fromkeys(name for strategy in estimators for name in strategy.points)
    equations = form_prefix_equations(study, sets, [*points])
    solutions = solve_strategies(estimators, equations)
    errors_by_stages = {}
    for estimator, by_joint in zip(estimators, solutions, strict=True):
        errors = np.stack([by_joint[joint] for joint in range(study.robot.joints)])
        first = find_first_solvable_length(estimator, study.interpretation.rows)
        errors[:, : first - 1] = np.nan
        errors_by_stages[estimator.stages] = errors
    return errors_by_stages


class _Sums:
    """Sums over data sets of what `StudyMeans` averages."""

    def __init__(self) -> None:
        self.stiffness: np.ndarray | float = 0.0
        self.errors: np.ndarray | float = 0.0
        self.squares: np.ndarray | float = 0.0

    def add(
        self, errors: np.ndarray, scale: np.ndarray, validation: ValidationSet
    ) -> None:
        """Add relative errors (n, configurations, sets) of compliances `scale` (n,)."""
        self.stiffness = self.stiffness + (1.0 / (1.0 + errors)).sum(axis=-1)
        self.errors = self.errors + errors.sum(axis=-1)
        absolute = errors.swapaxes(0, 1) * scale[:, None]
        squares = evaluate_quadratic_form(validation.mean_form, absolute)
        self.squares = self.squares + squares.sum(axis=-1)

    def average(self, scale: np.ndarray, count: int) -> StudyMeans:
        """Average over `count` data sets."""
        compliance = {
            "stiffness": (scale[:, None] * count / self.stiffness).T,
            "compliance": (scale[:, None] * (1.0 + self.errors / count)).T,
        }
        return StudyMeans(compliance, np.asarray(self.squares / count))


def evaluate_studies(
    study: StudyInMemory, numbers: Iterable[int], strategies: Sequence[Strategy]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Score strategies in the studies of these numbers; yields columns of the table of
    repeated studies, for one strategy in one study after the other."""
    estimators = {
        strategy.name: drop_superseded_stages(strategy, study.robot.joints)
        for strategy in strategies
    }
    distinct = {estimator.stages: estimator for estimator in estimators.values()}
    for number in numbers:
        validation = study.make_validation_set(number)
        means = average_study(study, [*distinct.values()], number, validation)
        for strategy in strategies:
            averaged = means[estimators[strategy.name].stages]
            lengths = len(averaged.mean_square)
            yield {
                "length": np.arange(1, lengths + 1),
                "study": np.full(lengths, number),
                "strategy": strategy.name,
                **_score_study(study, strategy, averaged, validation),
            }


def _score_study(
    study: StudyInMemory,
    strategy: Strategy,
    averaged: StudyMeans,
    validation: ValidationSet,
) -> dict[str, np.ndarray]:
    """Compliances and scores (lengths,) of one strategy in one study."""
    tests = np.ones((1, study.size.tests))
    compliance = averaged.compliance[study.interpretation.average]
    columns = {f"compliance_{j}": column for j, column in enumerate(compliance.T, 1)}
    for method, suffix in (
        (study.interpretation.average, ""),
        ("compliance", "_mean_compliance"),
    ):
        model = averaged.compliance[method]
        scores = compute_scores(
            model,
            compute_mean_deviation(validation, model[None], tests)[0],
            study.robot.compliance,
            strategy.fixed_joints,
        )
        columns |= {f"{name}{suffix}": values for name, values in scores.items()}
    return columns | {"mean_square": averaged.mean_square}


def repeat_studies(job: Job) -> None:
    """Evaluate further studies of one robot."""
    write_studies(job, load_study(job))


def write_studies(job: Job, study: StudyInMemory) -> None:
    """Evaluate the first further studies of a robot, and write their scores."""
    blocks = evaluate_studies(
        study, range(1, job.params.studies + 1), load_strategies(job)
    )
    schema = REPEATED.for_joints(study.robot.joints)
    write_table(job.output.repeated, schema, blocks, collect_provenance(job))
