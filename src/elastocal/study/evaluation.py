"""Each strategy on each robot at each noise level: from measured data sets to the
figures that judge it, in studies over again.

As the paper does, which averages the stiffness over all data sets before it looks at
the error (equations 12-15). All work goes block of data sets by block. Further studies
have data sets that no other one has, and nothing of these is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.io.storage import (
    Column,
    TableSchema,
    read_blocks,
    read_table,
    write_table,
)
from elastocal.study.equation_11 import (
    identify_blocks,
    make_identified_schema,
    read_measured_blocks,
)
from elastocal.study.in_memory import load_study
from elastocal.study.jobs import (
    LENGTH,
    MICRO,
    STRATEGY,
    Job,
    add_slugs,
    collect_provenance,
    load_robot,
    load_strategies,
    make_frame,
    make_integer_column,
    make_real_column,
    make_schema,
    write_csvs,
)
from elastocal.study.metrics import (
    ValidationSet,
    compute_k_sigma,
    compute_mean_deviation,
    compute_relative_stiffness_error,
    extrapolate_length,
    find_first_length_below,
    make_validation_set,
)
from elastocal.study.simulation import (
    DATA_SETS,
    DEFLECTIONS,
    REPLICATE,
    TESTS,
    WEIGHTS,
    list_data_sets,
    make_experiments_schema,
    unpack_deflections,
    unpack_experiments,
)
from elastocal.study.strategies import drop_superseded_stages, strategy_from_document

if TYPE_CHECKING:
    import pandas as pd

    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

MAX_TRUSTED_SPREAD = 0.25
# Those of Table 4: name, column, factor, unit, key of the limit.
_FIGURES = (
    ("k_sigma", "k_sigma", 1.0, "percent", "k_sigma"),
    ("k_sigma_fixed_joints", "k_sigma_fixed_joints", 1.0, "percent", "k_sigma"),
    ("dev", "deviation", MICRO, "um", "deviation"),
)

SCORES = (
    make_real_column("k_sigma", "percent", "as in the metrics", missing=True),
    make_real_column(
        "k_sigma_fixed_joints", "percent", "as in the metrics", missing=True
    ),
    make_real_column("deviation", "m", "as in the metrics", missing=True),
)
REPLICATES = make_schema(
    "replicates",
    REPLICATE,
    LENGTH,
    *SCORES,
    make_real_column("initial_deviation", "m", "as in the metrics"),
)


def make_metrics_schema(joints: int) -> TableSchema:
    """Equations 12-15, averaged over the data sets; one row for each length."""
    of_stiffness = "the averaged stiffness of joint"
    quantities = [
        *(
            (
                f"compliance_{j}",
                "rad/(N m)",
                f"inverse of {of_stiffness} {j} (equation 12)",
            )
            for j in range(1, joints + 1)
        ),
        *(
            (
                f"delta_k_{j}",
                "percent",
                f"relative error of {of_stiffness} {j} (equation 13)",
            )
            for j in range(1, joints + 1)
        ),
        ("k_sigma", "percent", "sum of delta_k over all joints (equation 14)"),
        (
            "k_sigma_fixed_joints",
            "percent",
            "sum of delta_k over the joints fixed in the last stage (interpretation R10)",
        ),
        (
            "deviation",
            "m",
            "mean end-effector error of the averaged model on test configurations (equation 15)",
        ),
        (
            "initial_deviation",
            "m",
            "mean deflection of the end-effector on the test configurations",
        ),
    ]
    return make_schema(
        "metrics",
        LENGTH,
        *(
            make_real_column(name + end, unit, words + meaning, missing=True)
            for name, unit, meaning in quantities
            for end, words in (
                ("", ""),
                (
                    "_std_error",
                    "Monte Carlo error over data sets and test configurations of: ",
                ),
            )
        ),
        make_real_column(
            "nonpositive_share",
            "",
            "share of data sets with a compliance that is not positive",
        ),
        make_real_column(
            "relative_spread",
            "",
            "largest standard deviation over mean of an identified compliance",
            missing=True,
        ),
        Column(
            "trustworthy",
            "bool",
            "",
            "whether the mean of 1/c exists in practice: none <= 0 and relative spread <= 0.25",
        ),
    )


def unpack_weights(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Weights (1 + replicates, members) of a block of the weights table; replicate 0
    counts each member once."""
    counts = columns["count"].reshape(-1, columns["replicate"].max())
    return np.vstack([np.ones(len(counts)), counts.T])


@dataclass(frozen=True)
class Averages:
    """Averages over data sets, replicate 0 with every data set once, the others with
    bootstrap weights.

    `compliance` (1 + replicates, lengths, n): inverse of the averaged stiffness, rad/(N
    m). `deviation` (1 + replicates, lengths): Equation 15, m. `initial_deviation` (1 +
    replicates, lengths): the same without any model; it does not depend on the length.
    `nonpositive_share`, `relative_spread` (lengths,).
    """

    compliance: np.ndarray
    deviation: np.ndarray
    initial_deviation: np.ndarray
    nonpositive_share: np.ndarray
    relative_spread: np.ndarray


def average_estimates(
    blocks: Iterable[tuple[np.ndarray, np.ndarray]],
    judge: ValidationSet,
    method: str,
    test_weights: np.ndarray,
) -> Averages:
    """Average the estimates over data sets (equation 12) and score the averaged model
    (equation 15).

    A replicate multiplies weights of data sets by independent weights of test
    configurations: the product-weight bootstrap of crossed factors [1].

    `blocks` (compliance, weights): compliances (sets, lengths, n) and bootstrap weights
    (1 + replicates, sets). `method`: what is averaged: stiffness 1/c or compliance c
    (interpretation R7). `test_weights` (1 + replicates, tests).

    [1] Owen, A. B. and Eckles, D., Bootstrapping data arrays of arbitrary order, Annals
    of Applied Statistics 6, 2012.
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
        sums = sums + np.tensordot(
            weights, compliance if method == "compliance" else 1.0 / compliance, axes=1
        )
    averaged = sums / total[:, None, None]
    averaged = averaged if method == "compliance" else 1.0 / averaged
    deviation = compute_mean_deviation(judge, averaged, test_weights)
    initial = np.broadcast_to(
        (test_weights @ judge.initial_errors / test_weights.sum(axis=1))[:, None],
        deviation.shape,
    )
    mean, square = moments / sets
    spread = (np.sqrt(np.maximum(square - mean**2, 0.0)) / np.abs(mean)).max(axis=-1)
    return Averages(averaged, deviation, initial, nonpositive / sets, spread)


def compute_scores(
    compliance: np.ndarray,
    deviation: np.ndarray,
    true_compliance: np.ndarray,
    fixed_joints: Sequence[int],
) -> dict[str, np.ndarray]:
    """Scores (..., lengths) of averaged models: `compliance` (..., lengths, n) and
    `deviation` (..., lengths)."""
    return {
        "k_sigma": compute_k_sigma(compliance, true_compliance),
        "k_sigma_fixed_joints": compute_k_sigma(
            compliance, true_compliance, list(fixed_joints)
        ),
        "deviation": deviation,
    }


def build_metrics_table(
    averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Columns of the metrics table, one row for each length, from `average`."""
    replicated = {}
    relative = compute_relative_stiffness_error(averages.compliance, true_compliance)
    for j in range(len(true_compliance)):
        replicated[f"compliance_{j + 1}"] = averages.compliance[..., j]
        replicated[f"delta_k_{j + 1}"] = relative[..., j]
    replicated |= _replicated_scores(averages, true_compliance, fixed_joints)
    columns = {"length": np.arange(1, averages.deviation.shape[1] + 1)}
    for name, values in replicated.items():
        columns[name] = values[0]
        columns[f"{name}_std_error"] = values[1:].std(axis=0, ddof=1)
    columns["nonpositive_share"] = averages.nonpositive_share
    columns["relative_spread"] = averages.relative_spread
    with np.errstate(invalid="ignore"):
        columns["trustworthy"] = (averages.nonpositive_share == 0) & (
            averages.relative_spread <= MAX_TRUSTED_SPREAD
        )
    return columns


def build_replicates_table(
    averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    """Columns of the replicates table: the scores of every bootstrap replicate at every
    length."""
    replicates, lengths = averages.deviation[1:].shape
    scores = _replicated_scores(averages, true_compliance, fixed_joints)
    return {
        "replicate": np.repeat(np.arange(1, replicates + 1), lengths),
        "length": np.tile(np.arange(1, lengths + 1), replicates),
        **{name: values[1:].ravel() for name, values in scores.items()},
    }


def _replicated_scores(
    averages: Averages, true_compliance: np.ndarray, fixed_joints: Sequence[int]
) -> dict[str, np.ndarray]:
    scores = compute_scores(
        averages.compliance, averages.deviation, true_compliance, fixed_joints
    )
    return scores | {"initial_deviation": averages.initial_deviation}


def find_length_with_error(
    values: np.ndarray, replicate_values: np.ndarray, limit: float
) -> tuple[float, float]:
    """First length at which a metric is at most `limit`, infinite where none is, with
    its Monte Carlo standard error.

    `values` (lengths,), `replicate_values` (replicates, lengths): those that do not
    reach it are continued, see `metrics.length_to_reach`, since leaving them out would
    make the error too small.
    """
    return float(find_first_length_below(values, limit)), float(
        np.std(extrapolate_length(replicate_values, limit), ddof=1)
    )


def make_repeated_schema(joints: int) -> TableSchema:
    """Scores of further studies of the same size; one row for each study, strategy and
    length."""
    other = (
        "by the mean of the compliances where the metrics have that of the stiffnesses"
    )
    return make_schema(
        "repeated",
        make_integer_column(
            "study", "number of the study, from 1; that of the tables is number 0", 1
        ),
        STRATEGY,
        LENGTH,
        *(
            make_real_column(
                f"compliance_{j}",
                "rad/(N m)",
                f"as in the metrics, of joint {j}",
                missing=True,
            )
            for j in range(1, joints + 1)
        ),
        *SCORES,
        make_real_column(
            "k_sigma_mean_compliance",
            "percent",
            f"sum of delta_k over all joints, {other}",
            missing=True,
        ),
        make_real_column(
            "k_sigma_fixed_joints_mean_compliance",
            "percent",
            f"the same of the fixed joints, {other}",
            missing=True,
        ),
        make_real_column(
            "deviation_mean_compliance", "m", f"deviation {other}", missing=True
        ),
        make_real_column(
            "mean_square",
            "m^2",
            "mean square end-effector error of single data sets",
            missing=True,
        ),
    )


def evaluate_studies(
    study: StudyInMemory, studies: Iterable[int], strategies: Sequence[Strategy]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Scores of studies of these numbers, block by block one strategy in one study."""
    robot = study.robot
    read = study.interpretation
    tests = np.ones((1, study.size.tests))
    for number in studies:
        judge = study.judge(number)
        found = study.estimates(strategies, number)
        for strategy in strategies:
            blocks = [
                (compliance, np.ones((1, len(compliance))))
                for compliance in found[strategy.name]
            ]
            averages = average_estimates(blocks, judge, read.average, tests)
            plain = average_estimates(blocks, judge, "compliance", tests)
            fixed = strategy.fixed_joints
            others = compute_scores(
                plain.compliance[0], plain.deviation[0], robot.compliance, fixed
            )
            squares = [
                judge.mean_square(np.moveaxis(each, 0, -1)) for each, _ in blocks
            ]
            yield {
                "length": np.arange(1, len(squares[0]) + 1),
                **{
                    f"compliance_{j + 1}": column
                    for j, column in enumerate(averages.compliance[0].T)
                },
                **compute_scores(
                    averages.compliance[0],
                    averages.deviation[0],
                    robot.compliance,
                    fixed,
                ),
                **{
                    f"{name}_mean_compliance": values for name, values in others.items()
                },
                "mean_square": np.concatenate(squares, axis=1).mean(axis=1),
                "study": np.full(len(squares[0]), number),
                "strategy": strategy.name,
            }


def build_over_studies_table(
    studies: pd.DataFrame, length: int, limits: Mapping[str, float]
) -> pd.DataFrame:
    """Table 4 over studies, by what is averaged (stiffness or compliance).

    `studies`: robot and the columns of `repeated`. `limits`: k_sigma in percent and
    deviation in µm whose lengths are given. Each figure is the median over studies with
    a robust standard deviation between them (1.4826 times the median absolute
    deviation); rms: of one data set.
    """
    rows = []
    for (robot, strategy), cell in studies.groupby(["robot", "strategy"], sort=False):
        for averaged, end in (("stiffness", ""), ("compliance", "_mean_compliance")):
            row: dict[str, Any] = {
                "robot": robot,
                "strategy": strategy,
                "average": averaged,
            }
            for name, column, factor, unit, key in _FIGURES:
                curves = (
                    factor
                    * cell.pivot(
                        index="study", columns="length", values=f"{column}{end}"
                    ).to_numpy()
                )
                row |= _middle(f"{name}_{length}_{unit}", curves[:, length - 1])
                row |= _middle(
                    f"n_{name}_{limits[key]:g}_{unit}",
                    extrapolate_length(curves, limits[key]),
                )
            rows.append(
                row
                | _middle(
                    f"rms_{length}_um",
                    MICRO * np.sqrt(cell.mean_square[cell.length == length]),
                )
            )
    return make_frame(rows)


def _middle(name: str, values: np.ndarray | pd.Series) -> dict[str, float]:
    """Median, and a standard deviation that outlying studies do not move."""
    middle = float(np.median(values))
    return {
        name: middle,
        f"{name}_std": float(1.4826 * np.median(np.abs(values - middle))),
    }


def identify(job: Job) -> None:
    """One strategy for one robot at one noise level: compliances at every prefix
    length, and what they are worth."""
    asked = job.params
    robot = load_robot(job)
    n = robot.joints
    strategy = strategy_from_document(asked.strategy)
    blocks = read_measured_blocks(job, n, strategy.points)
    solved = identify_blocks(
        blocks,
        robot.chain,
        drop_superseded_stages(strategy, n),
        asked.rows,
        asked.wrench_at,
    )
    write_table(
        job.output.identified,
        make_identified_schema(n),
        solved,
        collect_provenance(job),
    )

    tested = read_table(job.input.test_experiments, make_experiments_schema(n))
    ideal = read_table(
        job.input.test_ideal, DEFLECTIONS, point=robot.chain.end_effector.name
    )
    counts = ["replicate", "count"]
    # Read again, so that any number of data sets is worked off in the same memory.
    columns = [f"compliance_{j + 1}" for j in range(n)]
    estimated = (
        np.stack(
            [block[name].reshape(len(list_data_sets(block)), -1) for name in columns],
            axis=-1,
        )
        for block in read_blocks(
            job.output.identified, make_identified_schema(n), ["data_set", *columns]
        )
    )
    weights = map(
        unpack_weights,
        read_blocks(job.input.weights, WEIGHTS, counts, members=DATA_SETS),
    )
    of_tests = unpack_weights(
        read_table(job.input.weights, WEIGHTS, counts, members=TESTS)
    )
    judge = make_validation_set(
        robot, unpack_experiments(tested), unpack_deflections(ideal), asked.wrench_at
    )
    averages = average_estimates(
        zip(estimated, weights, strict=True), judge, asked.average, of_tests
    )
    scored = averages, judge.reference, strategy.fixed_joints
    write_table(
        job.output.metrics,
        make_metrics_schema(n),
        [build_metrics_table(*scored)],
        collect_provenance(job),
    )
    write_table(
        job.output.replicates,
        REPLICATES,
        [build_replicates_table(*scored)],
        collect_provenance(job),
    )


def repeat_studies(job: Job) -> None:
    """Further studies of one robot."""
    study = load_study(job)
    blocks = evaluate_studies(
        study, range(1, job.params.studies + 1), load_strategies(job)
    )
    write_table(
        job.output.repeated,
        make_repeated_schema(study.robot.joints),
        blocks,
        collect_provenance(job),
    )


def tabulate_studies(job: Job) -> None:
    """Table 4 over studies."""
    from elastocal.io.data_frames import read_long

    asked = job.params
    found = build_over_studies_table(
        read_long(job.input.studies, make_repeated_schema), asked.length, asked.limits
    )
    write_csvs(job, table=add_slugs(found, asked.slugs))
