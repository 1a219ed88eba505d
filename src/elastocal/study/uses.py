"""How to evaluate (RQ4): what strategies leave by several yardsticks, and where these
rank them differently, with intervals.

An accuracy on random configurations says little to whom the robot works in one corner
of its space. ISO 9283 [1] has five poses in a cube and one orientation; the accuracy of
a pose is the distance of the mean of the reached positions from the commanded one. A
model that corrects the command leaves its own error there, as repeatability averages
out.

All strategies see the same data sets, so that their scores go up and down together:
what counts is the ratio of two of them, data set by data set. For a score that is a
smooth function of means over data sets its influence values give the variance of the
logarithm of a ratio (delta method [2]; of a quantile by Bahadur's representation); the
paper's scores of averaged models have the bootstrap replicates, whose weights all
strategies share.

[1] ISO 9283:1998, Manipulating industrial robots: Performance criteria and related test
methods. [2] van der Vaart, A. W., Asymptotic Statistics, chapters 3 and 21, Cambridge
University Press, 1998.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.inverse_kinematics import (
    SOLVED_M,
    find_beyond_limits,
    solve_path,
)
from elastocal.study.evaluation import REPLICATES, make_metrics_schema
from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import (
    DATA_SET,
    MICRO,
    STRATEGY,
    Job,
    make_frame,
    make_real_column,
    make_schema,
    read_frames,
    write_csvs,
)
from elastocal.study.metrics import compute_position_errors, make_validation_set
from elastocal.study.points import Score, mean_of
from elastocal.study.simulation import Experiments

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

    # Of each robot by metric and strategy.
    Scores = Mapping[str, Mapping[str, Mapping[str, "Score"]]]

USES = make_schema(
    "uses",
    STRATEGY,
    DATA_SET,
    make_real_column("mean", "m", "mean end-effector error on test configurations"),
    make_real_column("mean_square", "m^2", "mean square of the same"),
    make_real_column("p95", "m", "95th percentile of the same"),
    make_real_column(
        "pooled_p95",
        "m",
        "95th percentile over test configurations and data sets, the same in every row",
    ),
    make_real_column(
        "pooled_p95_influence",
        "m",
        "influence of the data set on the pooled percentile",
    ),
    make_real_column(
        "iso_9283", "m", "largest error at the five poses of ISO 9283", missing=True
    ),
    make_real_column(
        "path_mean_square",
        "m^2",
        "mean square error along the milling path",
        missing=True,
    ),
    make_real_column(
        "path_max", "m", "largest error along the milling path", missing=True
    ),
)
REFERENCE = "rms_um"
# What is shown of each, in this order.
METRICS = {
    REFERENCE: "RMS of one data set",
    "mean_um": "mean of one data set",
    "p95_um": "p95 of one data set",
    "pooled_p95_um": "p95 pooled over data sets",
    "iso_9283_um": "largest at the ISO 9283 poses",
    "path_rms_um": "RMS on a milling path",
    "path_max_um": "largest on a milling path",
    "dev_um": "dev (equation 15)",
    "k_sigma_percent": "k_Σ of all joints",
    "k_sigma_percent_fixed_joints": "k_Σ of the fixed joints",
}
# Of single data sets: column and whether the score is the root of its mean.
_SINGLE = {
    REFERENCE: ("mean_square", True),
    "mean_um": ("mean", False),
    "p95_um": ("p95", False),
    "iso_9283_um": ("iso_9283", False),
    "path_rms_um": ("path_mean_square", True),
    "path_max_um": ("path_max", False),
}
# Of averaged models, with the factor to their units.
_AVERAGED = {
    "k_sigma_percent": ("k_sigma", 1.0),
    "k_sigma_percent_fixed_joints": ("k_sigma_fixed_joints", 1.0),
    "dev_um": ("deviation", MICRO),
}
# Scores of strategies that are one estimator agree to rounding.
_DIGITS = 6
# The quantile that is pooled, and over how much about it its density is taken.
_POOLED = 0.95
_ABOUT = 0.01
# Of a diagonal, from its ends: where the outer four poses lie.
_FROM_ENDS = 0.1
_PATH_POSES = 50
# The x axis of the end-effector downwards, as a spindle or a gripper over a table.
_DOWN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def make_iso_9283_poses(
    robot: Robot, centre_m: Sequence[float], edge_m: float, weight_N: float
) -> Experiments | None:
    """The five poses in the sloped plane of a cube, under a weight.

    `centre_m`: of the cube, base axes. `weight_N`: downwards, at the end-effector.
    Returns one set of five configurations within the joint limits; None where the robot
    does not reach them all.
    """
    reach = 0.5 * edge_m * (1 - 2 * _FROM_ENDS)
    corners = np.array([[0, 0, 0], [-1, -1, -1], [-1, 1, -1], [1, 1, 1], [1, -1, 1]])
    return _find_loaded(
        robot,
        np.array(centre_m) + reach * corners,
        np.tile([0.0, 0.0, -weight_N], (5, 1)),
    )


def make_milling_path(
    robot: Robot, centre_m: Sequence[float], length_m: float, cutting_N: float
) -> Experiments | None:
    """A straight level path across, the cutting force half against the feed and half
    upwards off the part.

    `robot`, `centre_m`: as in `iso_9283`. Returns one set of configurations within the
    joint limits; None where the robot does not reach all of the path.
    """
    along = np.array([0.0, 1.0, 0.0])
    position = (
        np.array(centre_m)
        + length_m * np.linspace(-0.5, 0.5, _PATH_POSES)[:, None] * along
    )
    force = cutting_N * np.sqrt(0.5) * (np.array([0.0, 0.0, 1.0]) - along)
    return _find_loaded(robot, position, np.tile(force, (_PATH_POSES, 1)))


def _find_loaded(
    robot: Robot, position: np.ndarray, force: np.ndarray
) -> Experiments | None:
    angles, left = solve_path(
        robot, position, np.broadcast_to(_DOWN, (len(position), 3, 3))
    )
    if (left > SOLVED_M).any() or find_beyond_limits(robot, angles).any():
        return None
    return Experiments(angles[None], np.pad(force, ((0, 0), (0, 3)))[None])


def evaluate_uses(
    study: StudyInMemory, strategies: Sequence[Strategy], uses: Mapping[str, Any]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Errors of the models of all data sets, strategy by strategy, from all
    configurations of a data set.

    `uses`: centre_m, edge_m, weight_N, path_m and cutting_N. Not a number for uses out
    of the robot's reach.
    """
    robot = study.robot
    at = study.interpretation.wrench_at
    cube = make_iso_9283_poses(
        robot, uses["centre_m"], uses["edge_m"], uses["weight_N"]
    )
    path = make_milling_path(robot, uses["centre_m"], uses["path_m"], uses["cutting_N"])
    judges = [
        study.judge(),
        *(
            use and make_validation_set(robot, use, study.deflections(use), at)
            for use in (cube, path)
        ),
    ]
    for strategy, blocks in study.estimates(strategies).items():
        models = np.concatenate([block[:, -1] for block in blocks])
        tests, at_cube, on_path = (
            compute_position_errors(judge, models)
            if judge
            else np.full((len(models), 1), np.nan)
            for judge in judges
        )
        low, pooled, high = np.quantile(
            tests, [_POOLED - _ABOUT, _POOLED, _POOLED + _ABOUT]
        )
        slope = (high - low) / (2 * _ABOUT)
        yield {
            "strategy": strategy,
            "data_set": np.arange(study.size.data_sets),
            "mean": tests.mean(axis=1),
            "mean_square": (tests**2).mean(axis=1),
            "p95": np.quantile(tests, _POOLED, axis=1),
            "pooled_p95": np.full(len(tests), pooled),
            "pooled_p95_influence": slope
            * ((tests > pooled).mean(axis=1) - (1 - _POOLED)),
            "iso_9283": at_cube.max(axis=1),
            "path_mean_square": (on_path**2).mean(axis=1),
            "path_max": on_path.max(axis=1),
        }


def score_strategies(
    uses: pd.DataFrame, metrics: pd.DataFrame, replicates: pd.DataFrame, length: int
) -> dict[str, dict[str, Score]]:
    """Scores of one robot's strategies by every metric.

    `uses`: the uses table. `metrics`, `replicates`: long, of the robot at the noise of
    the tables. Returns metric, strategy; without metrics at places that the robot does
    not reach.
    """
    found: dict[str, dict[str, Score]] = {}
    for strategy in dict.fromkeys(uses.strategy):
        mine = uses[uses.strategy == strategy].sort_values("data_set")
        for name, score in _of_single_sets(mine).items():
            found.setdefault(name, {})[strategy] = score
        at = metrics[(metrics.strategy == strategy) & (metrics.length == length)]
        drawn = replicates[
            (replicates.strategy == strategy) & (replicates.length == length)
        ].sort_values("replicate")
        for name, (column, factor) in _AVERAGED.items():
            value = float(at[column].iloc[0])
            relative = drawn[column].to_numpy() / value - 1
            found.setdefault(name, {})[strategy] = Score(factor * value, relative, 1.0)
    return found


def build_ranks_table(found: Scores, classical: str) -> pd.DataFrame:
    """Every strategy by every metric, its rank, and its ratio to the classical strategy
    with its 95 % interval.

    One estimator under two names has one rank, from 1.
    """
    from scipy.stats import rankdata

    rows = []
    for robot, by_metric in found.items():
        for metric, by_strategy in by_metric.items():
            values = np.array([score.value for score in by_strategy.values()])
            places = rankdata(_round(np.abs(values)), method="min")
            for (strategy, score), rank in zip(
                by_strategy.items(), places, strict=True
            ):
                ratio = score.ratio(by_strategy[classical])
                rows.append(
                    (
                        robot,
                        metric,
                        strategy,
                        score.value,
                        score.std_error(),
                        *ratio,
                        int(rank),
                    )
                )
    head = ("robot", "metric", "strategy", "value", "value_std_error")
    return make_frame(rows, (*head, "ratio", "ratio_low", "ratio_high", "rank"))


def build_pairs_table(found: Scores) -> pd.DataFrame:
    """Every two different estimators by every metric and by the RMS error of one data
    set.

    reversed: both intervals exclude one, on opposite sides.
    """
    rows = []
    for robot, by_metric in found.items():
        reference = by_metric[REFERENCE]
        # The first name of each estimator.
        seen: dict[float, str] = {}
        for strategy, score in reference.items():
            seen.setdefault(float(_round(np.array([score.value]))[0]), strategy)
        names = [*seen.values()]
        for metric, by_strategy in by_metric.items():
            for strategy, other in combinations(names, 2):
                ratio, by_rms = (
                    some[strategy].ratio(some[other])
                    for some in (by_strategy, reference)
                )
                sides = [
                    int(low > 1) - int(high < 1) for _, low, high in (ratio, by_rms)
                ]
                rows.append(
                    (
                        robot,
                        metric,
                        strategy,
                        other,
                        *ratio,
                        *by_rms,
                        sides[0] * sides[1] < 0,
                    )
                )
    columns = [
        f"{of}ratio{end}" for of in ("", "rms_") for end in ("", "_low", "_high")
    ]
    return make_frame(
        rows, ("robot", "metric", "strategy", "other", *columns, "reversed")
    )


def _of_single_sets(mine: pd.DataFrame) -> dict[str, Score]:
    found = {}
    for name, (column, root) in _SINGLE.items():
        values = mine[column].to_numpy()
        if not np.isnan(values).any():
            found[name] = mean_of(values, root, MICRO)
    pooled = float(mine.pooled_p95.iloc[0])
    influence = mine.pooled_p95_influence.to_numpy() / pooled
    found["pooled_p95_um"] = Score(MICRO * pooled, influence, 1 / np.sqrt(len(mine)))
    return found


def _round(values: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.{_DIGITS}g}") for value in values])


def tabulate_uses(job: Job) -> None:
    """Of all robots."""
    from elastocal.io.data_frames import read_long

    asked = job.params
    averaged = read_long(job.input.metrics, make_metrics_schema)
    drawn = read_long(job.input.replicates, lambda joints: REPLICATES)
    found = {
        robot: score_strategies(
            frame,
            averaged[averaged.robot == robot],
            drawn[drawn.robot == robot],
            asked.length,
        )
        for robot, frame in read_frames(job, job.input.uses, USES).items()
    }
    write_csvs(
        job,
        scores=build_ranks_table(found, asked.classical),
        pairs=build_pairs_table(found),
    )


judge_in_use = define_study_step(USES, evaluate_uses)
