"""Each strategy on each robot at each noise level: from measured data sets to the scores
that judge it; and the same in further studies.

As in the paper, the stiffness is averaged over all data sets before its error is
computed (equations 12-15). All work goes block of data sets by block. Further studies
have their own data sets, which are not kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.io.storage import read_blocks, read_table, write_table
from elastocal.study.equation_11 import identify_blocks, read_measured_blocks
from elastocal.study.jobs import (
    MICRO,
    Job,
    add_slugs,
    collect_provenance,
    load_robot,
    make_frame,
    write_csvs,
)
from elastocal.study.metrics import (
    ValidationSet,
    compute_mean_deviation,
    compute_relative_stiffness_error,
    compute_scores,
    extrapolate_length,
    find_kept_length,
    make_validation_set,
)
from elastocal.study.schemas import (
    DEFLECTIONS,
    EXPERIMENTS,
    IDENTIFIED,
    METRICS,
    REPEATED,
    REPLICATES,
    WEIGHTS,
)
from elastocal.study.simulation import (
    DATA_SETS,
    TESTS,
    list_data_sets,
    unpack_deflections,
    unpack_experiments,
)
from elastocal.study.strategies import drop_superseded_stages, strategy_from_document

if TYPE_CHECKING:
    import pandas as pd

    from elastocal.io.storage import Columns
    from elastocal.mechanics.robot import Robot

# Largest spread of an identified compliance, relative to its mean, at which the mean of
# its inverse is trustworthy.
MAX_TRUSTED_SPREAD = 0.25
# Standard deviation of a normal distribution over its median absolute deviation.
_STD_OVER_MAD = 1.4826


@dataclass(frozen=True)
class _Table4Quantity:
    """A score of Table 4.

    Attributes
    ----------
    name, unit : str
        Parts of the names of the columns.
    column : str
        Column of the table of repeated studies.
    factor : float
        From the unit of that column to `unit`.
    limit : str
        Key of the limit that the score is to reach.
    """

    name: str
    unit: str
    column: str
    factor: float
    limit: str


_TABLE4_QUANTITIES = (
    _Table4Quantity("k_sigma", "percent", "k_sigma", 1.0, "k_sigma"),
    _Table4Quantity(
        "k_sigma_fixed_joints", "percent", "k_sigma_fixed_joints", 1.0, "k_sigma"
    ),
    _Table4Quantity("dev", "um", "deviation", MICRO, "deviation"),
)


def unpack_weights(columns: Columns) -> np.ndarray:
    """Unpack the weights (1 + replicates, members) of a block of the weights table.

    Replicate 0 counts each member once.
    """
    counts = columns["count"].reshape(-1, columns["replicate"].max())
    return np.vstack([np.ones(len(counts)), counts.T])


@dataclass(frozen=True)
class Averages:
    """Averages over data sets: replicate 0 with every data set once, the others with
    bootstrap weights.

    Attributes
    ----------
    compliance : (1 + replicates, lengths, n) array, rad/(N m)
        Inverse of the averaged stiffness.
    deviation : (1 + replicates, lengths) array, m
        Equation 15.
    initial_deviation : (1 + replicates, lengths) array, m
        The same without any model; it does not depend on the length.
    nonpositive_share : (lengths,) array
        Share of data sets with a compliance that is not positive.
    relative_spread : (lengths,) array
        Largest standard deviation over mean of a compliance.
    """

    compliance: np.ndarray
    deviation: np.ndarray
    initial_deviation: np.ndarray
    nonpositive_share: np.ndarray
    relative_spread: np.ndarray


def average_estimates(
    blocks: Iterable[tuple[np.ndarray, np.ndarray]],
    validation: ValidationSet,
    method: str,
    test_weights: np.ndarray,
) -> Averages:
    """Average the estimates over data sets (equation 12) and score the averaged model
    (equation 15).

    A replicate multiplies weights of data sets by independent weights of test
    configurations: the product-weight bootstrap of crossed factors [1].

    Parameters
    ----------
    blocks
        Compliances (sets, lengths, n) and bootstrap weights (1 + replicates, sets).
    validation
    method : str
        What is averaged: stiffness 1/c or compliance c (interpretation R7).
    test_weights : (1 + replicates, tests) array

    References
    ----------
    .. [1] Owen, A. B. and Eckles, D., Bootstrapping data arrays of arbitrary order, Annals
       of Applied Statistics 6, 2012.
    """
    total_weight: Any = 0.0
    weighted_sum: Any = 0.0
    moments: Any = 0.0
    nonpositive: Any = 0.0
    sets = 0
    for compliance, weights in blocks:
        sets += len(compliance)
        total_weight = total_weight + weights.sum(axis=1)
        nonpositive = nonpositive + (compliance <= 0).any(axis=-1).sum(axis=0)
        scaled = compliance / validation.reference
        moments = moments + np.stack([scaled.sum(axis=0), (scaled**2).sum(axis=0)])
        averaged_quantity = _to_averaged_quantity(compliance, method)
        weighted_sum = weighted_sum + np.tensordot(weights, averaged_quantity, axes=1)
    averaged = _to_averaged_quantity(weighted_sum / total_weight[:, None, None], method)
    deviation = compute_mean_deviation(validation, averaged, test_weights)
    initial = test_weights @ validation.initial_errors / test_weights.sum(axis=1)
    mean, mean_square = moments / sets
    std = np.sqrt(np.maximum(mean_square - mean**2, 0.0))
    return Averages(
        averaged,
        deviation,
        np.broadcast_to(initial[:, None], deviation.shape),
        nonpositive / sets,
        (std / np.abs(mean)).max(axis=-1),
    )


def _to_averaged_quantity(compliance: np.ndarray, method: str) -> np.ndarray:
    """Convert compliances to the averaged quantity, stiffness or compliance; the
    conversion is its own inverse."""
    return compliance if method == "compliance" else 1.0 / compliance


def build_metrics_table(
    averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Build the columns of the metrics table, one row for each length."""
    quantities = {}
    relative_error = compute_relative_stiffness_error(
        averages.compliance, true_compliance
    )
    for j in range(len(true_compliance)):
        quantities[f"compliance_{j + 1}"] = averages.compliance[..., j]
        quantities[f"delta_k_{j + 1}"] = relative_error[..., j]
    quantities |= _score_replicates(averages, true_compliance, fixed_joints)
    columns = {"length": np.arange(1, averages.deviation.shape[1] + 1)}
    for name, values in quantities.items():
        columns[name] = values[0]
        columns[f"{name}_std_error"] = values[1:].std(axis=0, ddof=1)
    columns["nonpositive_share"] = averages.nonpositive_share
    columns["relative_spread"] = averages.relative_spread
    with np.errstate(invalid="ignore"):
        small_spread = averages.relative_spread <= MAX_TRUSTED_SPREAD
    columns["trustworthy"] = (averages.nonpositive_share == 0) & small_spread
    return columns


def build_replicates_table(
    averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Build the columns of the replicates table: the scores of every bootstrap replicate
    at every length."""
    replicates, lengths = averages.deviation[1:].shape
    scores = _score_replicates(averages, true_compliance, fixed_joints)
    return {
        "replicate": np.repeat(np.arange(1, replicates + 1), lengths),
        "length": np.tile(np.arange(1, lengths + 1), replicates),
        **{name: values[1:].ravel() for name, values in scores.items()},
    }


def _score_replicates(
    averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    scores = compute_scores(
        averages.compliance, averages.deviation, true_compliance, fixed_joints
    )
    return scores | {"initial_deviation": averages.initial_deviation}


def find_length_with_error(
    values: np.ndarray, replicate_values: np.ndarray, limit: float
) -> tuple[float, float]:
    """Find the first length from which on a metric stays within `limit`, with its Monte
    Carlo standard error.

    Parameters
    ----------
    values : (lengths,) array
    replicate_values : (replicates, lengths) array
        Replicates that do not reach the limit are extrapolated, see
        `metrics.extrapolate_length`; leaving them out would make the error too small.
    limit : float

    Returns
    -------
    length : float
        Infinite if the longest data set is not within the limit.
    std_error : float
    """
    length = float(find_kept_length(values, limit))
    replicate_lengths = extrapolate_length(replicate_values, limit)
    return length, float(np.std(replicate_lengths, ddof=1))


def build_over_studies_table(
    studies: pd.DataFrame, length: int, limits: Mapping[str, float]
) -> pd.DataFrame:
    """Build Table 4 over studies, by what is averaged (stiffness or compliance).

    Parameters
    ----------
    studies
        Robot and the columns of the table of repeated studies.
    length : int
        Data set length of the scores.
    limits
        k_sigma in percent and deviation in µm for which the necessary lengths are given.

    Returns
    -------
    DataFrame
        Each score is the median over studies, with a robust standard deviation between
        them (1.4826 times the median absolute deviation); rms is that of one data set.
    """
    rows = []
    for (robot, strategy), cell in studies.groupby(["robot", "strategy"], sort=False):
        squares = cell.mean_square[cell.length == length]
        rms = _summarize_robustly(f"rms_{length}_um", MICRO * np.sqrt(squares))
        for averaged, suffix in (("stiffness", ""), ("compliance", "_mean_compliance")):
            row: dict[str, Any] = {
                "robot": robot,
                "strategy": strategy,
                "average": averaged,
            }
            for quantity in _TABLE4_QUANTITIES:
                column = f"{quantity.column}{suffix}"
                curves = cell.pivot(index="study", columns="length", values=column)
                scores = quantity.factor * curves.to_numpy()
                row |= _summarize_curves(quantity, scores, length, limits)
            rows.append(row | rms)
    return make_frame(rows)


def _summarize_curves(
    quantity: _Table4Quantity,
    scores: np.ndarray,
    length: int,
    limits: Mapping[str, float],
) -> dict[str, float]:
    """Summarize scores (studies, lengths): at a length, and the lengths from which on
    they stay within their limit."""
    limit = limits[quantity.limit]
    name = f"{quantity.name}_{length}_{quantity.unit}"
    length_name = f"n_{quantity.name}_{limit:g}_{quantity.unit}"
    return _summarize_robustly(name, scores[:, length - 1]) | _summarize_robustly(
        length_name, extrapolate_length(scores, limit)
    )


def _summarize_robustly(name: str, values: np.ndarray | pd.Series) -> dict[str, float]:
    """Median, and a standard deviation that outlying studies do not influence."""
    median = float(np.median(values))
    spread = float(_STD_OVER_MAD * np.median(np.abs(values - median)))
    return {name: median, f"{name}_std": spread}


def identify(job: Job) -> None:
    """Identify the compliances of one robot at one noise level by one strategy at every
    prefix length, and score them."""
    params = job.params
    robot = load_robot(job)
    strategy = strategy_from_document(params.strategy)
    blocks = identify_blocks(
        read_measured_blocks(job, robot.joints, strategy.points),
        robot.chain,
        drop_superseded_stages(strategy, robot.joints),
        params.rows,
        params.wrench_at,
    )
    origin = collect_provenance(job)
    schema = IDENTIFIED.for_joints(robot.joints)
    write_table(job.output.identified, schema, blocks, origin)

    validation = _read_validation_set(job, robot)
    counts = ["replicate", "count"]
    weights = map(
        unpack_weights,
        read_blocks(job.input.weights, WEIGHTS, counts, members=DATA_SETS),
    )
    tests = read_table(job.input.weights, WEIGHTS, counts, members=TESTS)
    # The estimates are read again, so that memory does not depend on the number of data
    # sets.
    averages = average_estimates(
        zip(_read_estimates(job, robot.joints), weights, strict=True),
        validation,
        params.average,
        unpack_weights(tests),
    )
    scored = averages, validation.reference, strategy.fixed_joints
    schema = METRICS.for_joints(robot.joints)
    write_table(job.output.metrics, schema, [build_metrics_table(*scored)], origin)
    replicates = build_replicates_table(*scored)
    write_table(job.output.replicates, REPLICATES, [replicates], origin)


def _read_validation_set(job: Job, robot: Robot) -> ValidationSet:
    """Read the test configurations of a job with their true deflections."""
    point = robot.chain.end_effector.name
    schema = EXPERIMENTS.for_joints(robot.joints)
    tests = read_table(job.input.test_experiments, schema)
    ideal = read_table(job.input.test_ideal, DEFLECTIONS, point=point)
    return make_validation_set(
        robot,
        unpack_experiments(tests),
        unpack_deflections(ideal),
        job.params.wrench_at,
    )


def _read_estimates(job: Job, joints: int) -> Iterator[np.ndarray]:
    """Read the identified compliances (sets, lengths, n), block by block."""
    names = [f"compliance_{j}" for j in range(1, joints + 1)]
    schema = IDENTIFIED.for_joints(joints)
    for block in read_blocks(job.output.identified, schema, ["data_set", *names]):
        sets = len(list_data_sets(block))
        yield np.stack([block[name].reshape(sets, -1) for name in names], axis=-1)


def tabulate_studies(job: Job) -> None:
    """Write Table 4 over studies."""
    from elastocal.io.data_frames import read_robot_tables

    params = job.params
    studies = read_robot_tables(job.input.studies, REPEATED)
    table = build_over_studies_table(studies, params.length, params.limits)
    write_csvs(job, table=add_slugs(table, params.slugs))
