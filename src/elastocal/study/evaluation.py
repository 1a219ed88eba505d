"""Each strategy on each robot at each noise level: from measured data sets to the figures that judge it.

Two views of the same estimates: the paper's, which averages the stiffness over all data sets before it looks at the error
(equations 12-15), and that of somebody who has one data set. All work goes block of data sets by block.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.provenance import provenance
from elastocal.io.storage import Column, TableSchema, read_blocks, read_table, write_table
from elastocal.study.equation_11 import identified, identified_blocks, prefix_information, read_measured, regressors_of
from elastocal.study.jobs import LENGTH, Job, group, origin, real, robot_of, table
from elastocal.study.metrics import (
    Judge,
    first_length_below,
    k_sigma,
    length_to_reach,
    make_judge,
    mean_deviation,
    position_errors,
    relative_stiffness_error,
    split_models,
    squared_error_bounds,
)
from elastocal.study.simulation import (
    DATA_SETS,
    DEFLECTIONS,
    REPLICATE,
    TESTS,
    WEIGHTS,
    data_sets,
    experiments,
    to_deflections,
    to_experiments,
)
from elastocal.study.strategies import drop_forgotten_stages, strategy_from_document

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Robot

LARGEST_TRUSTED_SPREAD = 0.25

BOUNDS = table(
    "bounds",
    group("points", "measuring points read, joined by +; a row group holds one set"),
    LENGTH,
    real("rms_per_noise", "m/m", "Cramér-Rao bound of the RMS end-effector error per unit noise", missing=True),
)

SCORES = (
    real("k_sigma", "percent", "as in the metrics", missing=True),
    real("k_sigma_fixed_joints", "percent", "as in the metrics", missing=True),
    real("deviation", "m", "as in the metrics", missing=True),
)
REPLICATES = table("replicates", REPLICATE, LENGTH, *SCORES, real("initial_deviation", "m", "as in the metrics"))


def metrics(joints: int) -> TableSchema:
    """Equations 12-15, averaged over the data sets; one row for each length."""
    of_stiffness = "the averaged stiffness of joint"
    quantities = [
        *((f"compliance_{j}", "rad/(N m)", f"inverse of {of_stiffness} {j} (equation 12)") for j in range(1, joints + 1)),
        *((f"delta_k_{j}", "percent", f"relative error of {of_stiffness} {j} (equation 13)") for j in range(1, joints + 1)),
        ("k_sigma", "percent", "sum of delta_k over all joints (equation 14)"),
        ("k_sigma_fixed_joints", "percent", "sum of delta_k over the joints fixed in the last stage (interpretation R10)"),
        ("deviation", "m", "mean end-effector error of the averaged model on test configurations (equation 15)"),
        ("initial_deviation", "m", "mean deflection of the end-effector on the test configurations"),
    ]
    return table(
        "metrics",
        LENGTH,
        *_with_errors(quantities, "data sets and test configurations"),
        real("nonpositive_share", "", "share of data sets with a compliance that is not positive"),
        real("relative_spread", "", "largest standard deviation over mean of an identified compliance", missing=True),
        Column("trustworthy", "bool", "", "whether the mean of 1/c exists in practice: none <= 0 and relative spread <= 0.25"),
    )


def accuracy(joints: int) -> TableSchema:
    """What one data set gives, as the mean over data sets; one row for each evaluated length."""
    relative = "root mean square relative error of the compliance of joint"
    quantities = [
        ("mean", "m", "mean over test configurations of the end-effector position error"),
        ("rms", "m", "root mean square over test configurations and data sets"),
        ("p95", "m", "95th percentile over test configurations"),
        ("max", "m", "largest over test configurations"),
    ]
    joint_errors = [(f"relative_error_{j}", "percent", f"{relative} {j}") for j in range(1, joints + 1)]
    over = "data sets, for these test configurations", "data sets and test configurations"
    columns = *_with_errors(quantities, over[0]), *_with_errors(joint_errors, over[1])
    return table("accuracy", LENGTH, *columns)


def _with_errors(quantities: Iterable[tuple[str, str, str]], over: str) -> Iterator[Column]:
    for name, unit, meaning in quantities:
        yield real(name, unit, meaning, missing=True)
        yield real(f"{name}_std_error", unit, f"Monte Carlo standard error of {name} over {over}", missing=True)


def to_weights(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Weights (1 + replicates, members) of a block of the weights table; replicate 0 counts each member once."""
    counts = columns["count"].reshape(-1, columns["replicate"].max())
    return np.vstack([np.ones(len(counts)), counts.T])


def bound_blocks(
    experiment_blocks: Iterable[Mapping[str, np.ndarray]],
    chain: Chain,
    point_sets: Iterable[Iterable[str]],
    rows: int,
    wrench_at: str,
    judge: Judge,
) -> Iterator[dict[str, np.ndarray | str]]:
    """Cramér-Rao bound of the RMS end-effector error for each set of measuring points and each length."""
    distinct = list(dict.fromkeys(tuple(sorted(points)) for points in point_sets))
    names = sorted({name for points in distinct for name in points})
    moment, sets = judge.form[:-1, :-1], 0
    sums: dict[tuple[str, ...], np.ndarray] = dict.fromkeys(distinct, np.zeros(()))
    for block in experiment_blocks:
        regressors = regressors_of(to_experiments(block), chain, names, rows, wrench_at)
        information = {name: prefix_information(matrix) for name, matrix in regressors.items()}
        sets += regressors[names[0]].shape[-1]
        for points in distinct:
            together = sum((information[name] for name in points), np.zeros(()))
            sums[points] = sums[points] + squared_error_bounds(together, moment).sum(axis=1)
    for points, total in sums.items():
        yield {"points": "+".join(points), "length": np.arange(1, len(total) + 1), "rms_per_noise": np.sqrt(total / sets)}


@dataclass(frozen=True)
class Averages:
    """Averages over data sets, replicate 0 with every data set once, the others with bootstrap weights.

    `compliance` (1 + replicates, lengths, n): inverse of the averaged stiffness, rad/(N m). `deviation` (1 + replicates,
    lengths): Equation 15, m. `initial_deviation` (1 + replicates, lengths): the same without any model; it does not depend on
    the length. `nonpositive_share`, `relative_spread` (lengths,).
    """

    compliance: np.ndarray
    deviation: np.ndarray
    initial_deviation: np.ndarray
    nonpositive_share: np.ndarray
    relative_spread: np.ndarray


def average(blocks: Iterable[tuple[np.ndarray, np.ndarray]], judge: Judge, method: str, test_weights: np.ndarray) -> Averages:
    """Average the estimates over data sets (equation 12) and score the averaged model (equation 15).

    A replicate multiplies weights of data sets by independent weights of test configurations: the product-weight bootstrap of
    crossed factors [1].

    `blocks` (compliance, weights): compliances (sets, lengths, n) and bootstrap weights (1 + replicates, sets). `method`: what
    is averaged: stiffness 1/c or compliance c (interpretation R7). `test_weights` (1 + replicates, tests).

    [1] Owen, A. B. and Eckles, D., Bootstrapping data arrays of arbitrary order, Annals of Applied Statistics 6, 2012.
    """
    zero: np.ndarray = np.zeros(())
    total = sums = moments = nonpositive = zero
    sets = 0
    for compliance, weights in blocks:
        sets += len(compliance)
        total = total + weights.sum(axis=1)
        nonpositive = nonpositive + (compliance <= 0).any(axis=-1).sum(axis=0)
        scaled = compliance / judge.reference
        moments = moments + np.stack([scaled.sum(axis=0), (scaled**2).sum(axis=0)])
        sums = sums + np.tensordot(weights, compliance if method == "compliance" else 1.0 / compliance, axes=1)
    averaged = sums / total[:, None, None]
    averaged = averaged if method == "compliance" else 1.0 / averaged
    deviation = mean_deviation(judge, averaged, test_weights)
    initial = np.broadcast_to((test_weights @ judge.initial_errors / test_weights.sum(axis=1))[:, None], deviation.shape)
    mean, square = moments / sets
    spread = (np.sqrt(np.maximum(square - mean**2, 0.0)) / np.abs(mean)).max(axis=-1)
    return Averages(averaged, deviation, initial, nonpositive / sets, spread)


def score_columns(
    compliance: np.ndarray, deviation: np.ndarray, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Scores (..., lengths) of averaged models: `compliance` (..., lengths, n) and `deviation` (..., lengths)."""
    return {
        "k_sigma": k_sigma(compliance, true_compliance),
        "k_sigma_fixed_joints": k_sigma(compliance, true_compliance, list(fixed_joints)),
        "deviation": deviation,
    }


def metrics_table(averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]) -> dict[str, np.ndarray]:
    """Columns of the metrics table, one row for each length, from `average`."""
    replicated = {}
    relative = relative_stiffness_error(averages.compliance, true_compliance)
    for j in range(len(true_compliance)):
        replicated[f"compliance_{j + 1}"] = averages.compliance[..., j]
        replicated[f"delta_k_{j + 1}"] = relative[..., j]
    replicated |= _replicated_scores(averages, true_compliance, fixed_joints)
    columns = {"length": np.arange(1, averages.deviation.shape[1] + 1)}
    for name, values in replicated.items():
        columns[name], columns[f"{name}_std_error"] = values[0], values[1:].std(axis=0, ddof=1)
    columns["nonpositive_share"], columns["relative_spread"] = averages.nonpositive_share, averages.relative_spread
    with np.errstate(invalid="ignore"):
        columns["trustworthy"] = (averages.nonpositive_share == 0) & (averages.relative_spread <= LARGEST_TRUSTED_SPREAD)
    return columns


def replicates_table(averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]) -> dict[str, np.ndarray]:
    """Columns of the replicates table: the scores of every bootstrap replicate at every length."""
    replicates, lengths = averages.deviation[1:].shape
    scores = _replicated_scores(averages, true_compliance, fixed_joints)
    return {
        "replicate": np.repeat(np.arange(1, replicates + 1), lengths),
        "length": np.tile(np.arange(1, lengths + 1), replicates),
        **{name: values[1:].ravel() for name, values in scores.items()},
    }


def _replicated_scores(averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]) -> dict[str, np.ndarray]:
    scores = score_columns(averages.compliance, averages.deviation, true_compliance, fixed_joints)
    return scores | {"initial_deviation": averages.initial_deviation}


def accuracy_sums(compliance: np.ndarray, judge: Judge) -> np.ndarray:
    """What one data set gives, summed over the data sets of a block: add the sums of blocks for `accuracy_table`.

    `compliance` (sets, lengths, n): rad/(N m), of the lengths to evaluate. Returns (3, lengths, 4 + n): number of data sets,
    sum and sum of squares of: mean (m), mean square (m^2), 95th percentile and largest (m) of the position error over the test
    configurations, squared relative error of each compliance.
    """
    sets, lengths, n = compliance.shape
    single = np.empty((sets, lengths, 4))
    for part in split_models(sets, lengths):
        errors = position_errors(judge, compliance[part].reshape(-1, n))
        rank = int(np.ceil(0.95 * errors.shape[1])) - 1
        mean, square = errors.mean(axis=1), np.einsum("mt,mt->m", errors, errors) / errors.shape[1]
        errors.partition(rank, axis=1)
        found = np.stack([mean, square, errors[:, rank], errors[:, rank:].max(axis=1)], 1)
        single[part] = found.reshape(-1, lengths, 4)
    values = np.concatenate([single, ((compliance - judge.reference) / judge.reference) ** 2], axis=-1)
    return np.stack([np.full(values.shape[1:], float(sets)), values.sum(axis=0), (values**2).sum(axis=0)])


def accuracy_table(sums: np.ndarray, lengths: Sequence[int]) -> dict[str, np.ndarray]:
    """Columns of the accuracy table: what one data set gives, averaged over data sets; roots have errors by the delta method.

    `sums` (3, lengths, 4 + n): from `accuracy_sums`, of all data sets. `lengths`: data set lengths that they stand for.
    """
    sets, (mean, second) = sums[0, 0, 0], sums[1:] / sums[0]
    error = np.sqrt(np.maximum(second - mean**2, 0.0) / max(sets - 1, 1))
    squared = np.zeros(mean.shape[1], bool)
    squared[[1, *range(4, mean.shape[1])]] = True
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.where(squared & (mean > 0), error / (2 * np.sqrt(mean)), error)
    mean = np.where(squared, np.sqrt(mean), mean)
    names = ["mean", "rms", "p95", "max", *(f"relative_error_{j + 1}" for j in range(mean.shape[1] - 4))]
    columns = {"length": np.asarray(lengths)}
    for column, name in enumerate(names):
        scale = 100.0 if name.startswith("relative") else 1.0
        columns[name], columns[f"{name}_std_error"] = scale * mean[:, column], scale * error[:, column]
    return columns


def evaluate_strategy(
    identified_blocks: Iterable[Mapping[str, np.ndarray]],
    weight_blocks: Iterable[Mapping[str, np.ndarray]],
    test_weights: Mapping[str, np.ndarray],
    judge: Judge,
    fixed_joints: Sequence[int],
    method: str,
    lengths: Sequence[int],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Tables of metrics, bootstrap replicates and accuracy of one strategy from blocks of its estimates and of the weights.

    `method`: interpretation R7, see `average`. `lengths`: for the accuracy of one data set.
    """
    joints, evaluated_rows = len(judge.reference), np.asarray(lengths) - 1
    sums: list[np.ndarray] = []

    def weigh() -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Estimates with their weights, one pass for both views of them."""
        for block, counts in zip(identified_blocks, weight_blocks, strict=True):
            sets = data_sets(block)
            compliance = np.stack([block[f"compliance_{j + 1}"].reshape(len(sets), -1) for j in range(joints)], axis=-1)
            sums.append(accuracy_sums(compliance[:, evaluated_rows], judge))
            yield compliance, to_weights(counts)

    averages = average(weigh(), judge, method, to_weights(test_weights))
    return (
        metrics_table(averages, judge.reference, fixed_joints),
        replicates_table(averages, judge.reference, fixed_joints),
        accuracy_table(sum(sums, np.zeros(())), lengths),
    )


def find_length(values: np.ndarray, replicate_values: np.ndarray, limit: float) -> tuple[float, float]:
    """First length at which a metric is at most `limit`, infinite where none is, with its Monte Carlo standard error.

    `values` (lengths,), `replicate_values` (replicates, lengths): those that do not reach it are continued, see
    `metrics.length_to_reach`, since leaving them out would make the error too small.
    """
    return float(first_length_below(values, limit)), float(np.std(length_to_reach(replicate_values, limit), ddof=1))


def judge_from(
    robot: Robot, test_experiments: Mapping[str, np.ndarray], test_deflections: Mapping[str, np.ndarray], wrench_at: str
) -> Judge:
    """Score sheet from the tables of the test configurations; see `metrics.make_judge`."""
    return make_judge(robot, to_experiments(test_experiments), to_deflections(test_deflections), wrench_at)


def judge_of(job: Job, robot: Robot) -> Judge:
    """The same from the files of a job."""
    tested = read_table(job.input.test_experiments, experiments(robot.joints))
    ideal = read_table(job.input.test_ideal, DEFLECTIONS, point=robot.chain.end_effector.name)
    return judge_from(robot, tested, ideal, job.params.wrench_at)


def bound(job: Job) -> None:
    """Cramér-Rao bounds of one robot for every set of measuring points that a strategy reads."""
    asked, robot = job.params, robot_of(job)
    blocks = read_blocks(job.input.experiments, experiments(robot.joints))
    bounds = bound_blocks(blocks, robot.chain, asked.point_sets, asked.rows, asked.wrench_at, judge_of(job, robot))
    write_table(job.output.bounds, BOUNDS, bounds, provenance(asked))


def identify(job: Job) -> None:
    """One strategy for one robot at one noise level: compliances at every prefix length, and what they are worth."""
    asked, robot = job.params, robot_of(job)
    n, strategy = robot.joints, strategy_from_document(asked.strategy)
    blocks = read_measured(job, n, strategy.points)
    solved = identified_blocks(blocks, robot.chain, drop_forgotten_stages(strategy, n), asked.rows, asked.wrench_at)
    write_table(job.output.identified, identified(n), solved, origin(job))

    counts = ["replicate", "count"]
    # Read again, so that any number of data sets is worked off in the same memory.
    tables = evaluate_strategy(
        read_blocks(job.output.identified, identified(n), ["data_set", *(f"compliance_{j + 1}" for j in range(n))]),
        read_blocks(job.input.weights, WEIGHTS, counts, members=DATA_SETS),
        read_table(job.input.weights, WEIGHTS, counts, members=TESTS),
        judge_of(job, robot),
        strategy.fixed_joints,
        asked.average,
        asked.lengths,
    )
    scores = (job.output.metrics, metrics(n)), (job.output.replicates, REPLICATES), (job.output.accuracy, accuracy(n))
    for (path, schema), columns in zip(scores, tables, strict=True):
        write_table(path, schema, [columns], origin(job))
