"""How to evaluate (RQ4): the errors of strategies by several metrics, and which metrics
rank strategies differently, with intervals.

An accuracy on random configurations says little to a user whose robot works in one
corner of its workspace. ISO 9283 [1] prescribes five poses in a cube with one
orientation; the accuracy of a pose is the distance of the mean of the reached positions
from the commanded one. A model that corrects the command leaves its own error there,
because repeatability averages out.

All strategies use the same data sets, so that their scores go up and down together. The
ratio of two of them, data set by data set, is therefore what counts. For a score that is
a smooth function of means over data sets, its influence values give the variance of the
logarithm of a ratio (delta method [2]; for a quantile by Bahadur's representation). The
paper's scores of averaged models have bootstrap replicates, whose weights all strategies
share.

References
----------
.. [1] ISO 9283:1998, Manipulating industrial robots: Performance criteria and related test
   methods.
.. [2] van der Vaart, A. W., Asymptotic Statistics, chapters 3 and 21, Cambridge University
   Press, 1998.
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
from elastocal.study import schemas
from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import (
    MICRO,
    Job,
    make_frame,
    read_frames,
    write_csvs,
)
from elastocal.study.metrics import compute_position_errors
from elastocal.study.points import Score, score_mean, score_rms
from elastocal.study.simulation import Experiments

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.robot import Robot
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

    # Scores of each robot by metric and strategy.
    Scores = Mapping[str, Mapping[str, Mapping[str, Score]]]

REFERENCE = "rms_um"
# Metrics with their words, in the order of the tables.
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
# Metrics that are the root of a mean square over data sets, and those that are a mean,
# by the columns of the uses table.
_RMS_COLUMNS = {REFERENCE: "mean_square", "path_rms_um": "path_mean_square"}
_MEAN_COLUMNS = {
    "mean_um": "mean",
    "p95_um": "p95",
    "iso_9283_um": "iso_9283",
    "path_max_um": "path_max",
}
# Metrics of averaged models: their columns, and the factor to their unit.
_AVERAGED = {
    "k_sigma_percent": ("k_sigma", 1.0),
    "k_sigma_percent_fixed_joints": ("k_sigma_fixed_joints", 1.0),
    "dev_um": ("deviation", MICRO),
}
# Scores of strategies that are one estimator agree to this number of digits.
_DIGITS = 6
# The pooled quantile, and half the range of probability over which its density is
# estimated.
_POOLED = 0.95
_DENSITY_HALF_WIDTH = 0.01
# The outer four poses lie at this share of a diagonal from its ends.
_SHARE_FROM_ENDS = 0.1
_PATH_POSES = 50
# Orientation of a spindle or a gripper over a table: the x axis of the end-effector
# points downwards.
_DOWN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def make_iso_9283_poses(
    robot: Robot, centre_m: Sequence[float], edge_m: float, weight_N: float
) -> Experiments | None:
    """Find configurations at the five poses in the sloped plane of a cube, under a
    weight.

    Parameters
    ----------
    robot
    centre_m : (3,)
        Centre of the cube, base axes.
    edge_m : float
        Edge of the cube.
    weight_N : float
        Downward force at the end-effector.

    Returns
    -------
    Experiments or None
        One set of five configurations within the joint limits; None if the robot does
        not reach all of them.
    """
    half_edge = 0.5 * edge_m * (1 - 2 * _SHARE_FROM_ENDS)
    corners = np.array([[0, 0, 0], [-1, -1, -1], [-1, 1, -1], [1, 1, 1], [1, -1, 1]])
    positions = np.array(centre_m) + half_edge * corners
    return _find_configurations(robot, positions, np.array([0.0, 0.0, -weight_N]))


def make_milling_path(
    robot: Robot, centre_m: Sequence[float], length_m: float, cutting_N: float
) -> Experiments | None:
    """Find configurations on a straight level path along y; the cutting force has equal
    components against the feed and upwards, off the part.

    Returns one set of configurations within the joint limits; None if the robot does not
    reach all of the path.
    """
    feed = np.array([0.0, 1.0, 0.0])
    shares = np.linspace(-0.5, 0.5, _PATH_POSES)
    positions = np.array(centre_m) + length_m * shares[:, None] * feed
    force = cutting_N * np.sqrt(0.5) * (np.array([0.0, 0.0, 1.0]) - feed)
    return _find_configurations(robot, positions, force)


def _find_configurations(
    robot: Robot, positions: np.ndarray, force: np.ndarray
) -> Experiments | None:
    """Find configurations at positions (N, 3), the tool pointing downwards, under one
    force (3,)."""
    rotations = np.broadcast_to(_DOWN, (len(positions), 3, 3))
    angles, residuals = solve_path(robot, positions, rotations)
    if (residuals > SOLVED_M).any() or find_beyond_limits(robot, angles).any():
        return None
    wrench = np.tile(np.pad(force, (0, 3)), (len(positions), 1))
    return Experiments(angles[None], wrench[None])


def evaluate_uses(
    study: StudyInMemory, strategies: Sequence[Strategy], uses: Mapping[str, Any]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Evaluate the models of all data sets in several uses; each model is identified
    from all configurations of a data set.

    Parameters
    ----------
    study
    strategies
    uses
        centre_m, edge_m, weight_N, path_m and cutting_N.

    Yields
    ------
    dict
        Columns of the uses table, for one strategy after the other; NaN for uses out of
        the robot's reach.
    """
    robot = study.robot
    centre_m = uses["centre_m"]
    cube = make_iso_9283_poses(robot, centre_m, uses["edge_m"], uses["weight_N"])
    path = make_milling_path(robot, centre_m, uses["path_m"], uses["cutting_N"])
    tests = study.draw_tests()
    validation_sets = [
        None if use is None else study.validate_on(use) for use in (tests, cube, path)
    ]
    for strategy, blocks in study.estimate_all(strategies).items():
        models = np.concatenate([block[:, -1] for block in blocks])
        test_errors, cube_errors, path_errors = (
            np.full((len(models), 1), np.nan)
            if validation is None
            else compute_position_errors(validation, models)
            for validation in validation_sets
        )
        pooled, influence = _pool_quantile(test_errors)
        yield {
            "strategy": strategy,
            "data_set": np.arange(study.size.data_sets),
            "mean": test_errors.mean(axis=1),
            "mean_square": (test_errors**2).mean(axis=1),
            "p95": np.quantile(test_errors, _POOLED, axis=1),
            "pooled_p95": np.full(len(models), pooled),
            "pooled_p95_influence": influence,
            "iso_9283": cube_errors.max(axis=1),
            "path_mean_square": (path_errors**2).mean(axis=1),
            "path_max": path_errors.max(axis=1),
        }


def _pool_quantile(errors: np.ndarray) -> tuple[float, np.ndarray]:
    """Quantile over all errors (sets, tests), and the influence (sets,) of each data set
    on it by Bahadur's representation."""
    probabilities = [
        _POOLED - _DENSITY_HALF_WIDTH,
        _POOLED,
        _POOLED + _DENSITY_HALF_WIDTH,
    ]
    low, pooled, high = np.quantile(errors, probabilities)
    slope = (high - low) / (2 * _DENSITY_HALF_WIDTH)
    return pooled, slope * ((errors > pooled).mean(axis=1) - (1 - _POOLED))


def score_strategies(
    uses: pd.DataFrame, metrics: pd.DataFrame, replicates: pd.DataFrame, length: int
) -> dict[str, dict[str, Score]]:
    """Score one robot's strategies by every metric.

    Parameters
    ----------
    uses
        The uses table.
    metrics, replicates
        Long tables of the robot at the noise of the tables.
    length : int
        Data set length of the scores of averaged models.

    Returns
    -------
    dict
        Scores by metric and strategy, without the metrics of positions that the robot
        does not reach.
    """
    scores: dict[str, dict[str, Score]] = {}
    metrics = metrics[metrics.length == length]
    replicates = replicates[replicates.length == length].sort_values("replicate")
    for strategy in dict.fromkeys(uses.strategy):
        cell = uses[uses.strategy == strategy].sort_values("data_set")
        by_metric = _score_data_sets(cell) | _score_averaged_models(
            metrics[metrics.strategy == strategy].iloc[0],
            replicates[replicates.strategy == strategy],
        )
        for metric, score in by_metric.items():
            scores.setdefault(metric, {})[strategy] = score
    return scores


def _score_data_sets(cell: pd.DataFrame) -> dict[str, Score]:
    """Scores of one strategy by the metrics of single data sets and the pooled one."""
    scores = {}
    for metric in METRICS:
        if metric in _RMS_COLUMNS:
            score = score_rms(cell[_RMS_COLUMNS[metric]].to_numpy(), MICRO)
        elif metric in _MEAN_COLUMNS:
            score = score_mean(cell[_MEAN_COLUMNS[metric]].to_numpy(), MICRO)
        else:
            continue
        if not np.isnan(score.value):
            scores[metric] = score
    pooled = float(cell.pooled_p95.iloc[0])
    relative = cell.pooled_p95_influence.to_numpy() / pooled
    spread = 1 / np.sqrt(len(cell))
    return scores | {"pooled_p95_um": Score(MICRO * pooled, relative, spread)}


def _score_averaged_models(
    metrics: pd.Series, replicates: pd.DataFrame
) -> dict[str, Score]:
    """Scores of one strategy by the metrics of averaged models at one length."""
    scores = {}
    for metric, (column, factor) in _AVERAGED.items():
        value = float(metrics[column])
        relative = replicates[column].to_numpy() / value - 1
        scores[metric] = Score(factor * value, relative, 1.0)
    return scores


def build_ranks_table(scores: Scores, classical: str) -> pd.DataFrame:
    """Every strategy by every metric: its score, its rank, and its ratio to the classical
    strategy with its 95 % interval.

    Ranks count from 1; one estimator under two names has one rank.
    """
    from scipy.stats import rankdata

    rows = []
    for robot, by_metric in scores.items():
        for metric, by_strategy in by_metric.items():
            values = np.array([score.value for score in by_strategy.values()])
            ranks = rankdata(_round(np.abs(values)), method="min")
            for (strategy, score), rank in zip(by_strategy.items(), ranks, strict=True):
                value = (score.value, score.compute_std_error())
                ratio = score.compute_ratio(by_strategy[classical])
                rows.append((robot, metric, strategy, *value, *ratio, int(rank)))
    head = ("robot", "metric", "strategy", "value", "value_std_error")
    return make_frame(rows, (*head, "ratio", "ratio_low", "ratio_high", "rank"))


def build_pairs_table(scores: Scores) -> pd.DataFrame:
    """Compare every two different estimators by every metric and by the RMS error of one
    data set.

    ``reversed``: both 95 % intervals exclude one, on opposite sides.
    """
    rows = []
    for robot, by_metric in scores.items():
        by_rms = by_metric[REFERENCE]
        pairs = list(combinations(_name_estimators(by_rms), 2))
        for metric, by_strategy in by_metric.items():
            for strategy, compared in pairs:
                ratio = by_strategy[strategy].compute_ratio(by_strategy[compared])
                rms_ratio = by_rms[strategy].compute_ratio(by_rms[compared])
                is_reversed = _find_side(ratio) * _find_side(rms_ratio) < 0
                head = (robot, metric, strategy, compared)
                rows.append((*head, *ratio, *rms_ratio, is_reversed))
    columns = [
        *("robot", "metric", "strategy", "other"),
        *("ratio", "ratio_low", "ratio_high"),
        *("rms_ratio", "rms_ratio_low", "rms_ratio_high"),
        "reversed",
    ]
    return make_frame(rows, columns)


def _name_estimators(scores: Mapping[str, Score]) -> list[str]:
    """The first name of each different estimator."""
    names: dict[float, str] = {}
    for strategy, score in scores.items():
        names.setdefault(float(_round(np.array([score.value]))[0]), strategy)
    return [*names.values()]


def _find_side(ratio: tuple[float, float, float]) -> int:
    """1 or -1 if the interval of a ratio lies above or below one, else 0."""
    _, low, high = ratio
    return int(low > 1) - int(high < 1)


def _round(values: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.{_DIGITS}g}") for value in values])


def tabulate_uses(job: Job) -> None:
    """Write scores and pairs of the strategies on all robots."""
    from elastocal.io.data_frames import read_robot_tables

    metrics = read_robot_tables(job.input.metrics, schemas.METRICS)
    replicates = read_robot_tables(job.input.replicates, schemas.REPLICATES)
    scores = {
        robot: score_strategies(
            uses,
            metrics[metrics.robot == robot],
            replicates[replicates.robot == robot],
            job.params.length,
        )
        for robot, uses in read_frames(job, job.input.uses, schemas.USES).items()
    }
    ranks = build_ranks_table(scores, job.params.classical)
    write_csvs(job, scores=ranks, pairs=build_pairs_table(scores))


judge_in_use = define_study_step(schemas.USES, evaluate_uses)
