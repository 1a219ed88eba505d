"""Which points to measure and how many configurations: sets of points compared at an equal budget, data set by data set."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

MICRO = 1e6
_BUDGET = ("robot", "points", "measurements_per_configuration", "configurations", "crlb_rms_um", "rms_um", "std_error_um")
_PAIRED = (
    *("robot", "points", "against", "measurements", "configurations", "configurations_against"),
    *("difference_um", "difference_um_std_error", "ratio", "ratio_low", "ratio_high"),
)
# Of a normal distribution: 95 % within.
QUANTILE = 1.96


def budget_table(frames: Mapping[str, pd.DataFrame], point_sets: Mapping[str, Sequence[str]], length: int) -> pd.DataFrame:
    """Error of one data set by set of points: with as many configurations, and with as many measurements.

    `frames`: the budget table of each robot. `point_sets`: measuring points by the names of sets. `length`: configurations; the
    budget is twice as many measurements. Returns robot, points, measurements_per_configuration, configurations, crlb_rms_um,
    rms_um, std_error_um; without rows that would take longer data sets.
    """
    rows = []
    for robot, frame in frames.items():
        for points, names in point_sets.items():
            for configurations in sorted({length, 2 * length // len(names)}):
                at = _at(frame, points, configurations)
                if at.empty:
                    continue
                rms, error = root_mean(at.mean_square.to_numpy())
                rows.append(
                    {
                        "robot": robot,
                        "points": points,
                        "measurements_per_configuration": len(names),
                        "configurations": configurations,
                        "crlb_rms_um": MICRO * np.sqrt(at.bound.mean()),
                        "rms_um": MICRO * rms,
                        "std_error_um": MICRO * error,
                    }
                )
    return pd.DataFrame(rows, columns=[*_BUDGET])


def paired_table(frames: Mapping[str, pd.DataFrame], point_sets: Mapping[str, Sequence[str]], length: int) -> pd.DataFrame:
    """Sets of points against the first one, at a budget of twice `length` measurements, paired by data set.

    `frames`, `point_sets`, `length`: as in `budget_table`. Returns robot, points, against, measurements, configurations,
    configurations_against, difference_um with its standard error, ratio with its 95 % interval, ratio_low and ratio_high.
    """
    rows = []
    against = next(iter(point_sets))
    for robot, frame in frames.items():
        theirs_at = 2 * length // len(point_sets[against])
        theirs = _at(frame, against, theirs_at).mean_square.to_numpy()
        for points, names in point_sets.items():
            configurations = 2 * length // len(names)
            ours = _at(frame, points, configurations).mean_square.to_numpy()
            if points == against or not len(ours) or not len(theirs):
                continue
            roots = np.sqrt([ours.mean(), theirs.mean()])
            # Delta method: deviations of both roots data set by data set.
            each = np.stack([ours, theirs]) / (2 * roots[:, None])
            error = (each[0] - each[1]).std(ddof=1) / np.sqrt(len(ours))
            ratio, low, high = ratio_of_roots(ours, theirs)
            rows.append(
                {
                    "robot": robot,
                    "points": points,
                    "against": against,
                    "measurements": configurations * len(names),
                    "configurations": configurations,
                    "configurations_against": theirs_at,
                    "difference_um": MICRO * (roots[0] - roots[1]),
                    "difference_um_std_error": MICRO * error,
                    "ratio": ratio,
                    "ratio_low": low,
                    "ratio_high": high,
                }
            )
    return pd.DataFrame(rows, columns=[*_PAIRED])


def lengths_table(
    frames: Mapping[str, pd.DataFrame], point_sets: Mapping[str, Sequence[str]], accuracies_um: Sequence[float]
) -> pd.DataFrame:
    """How many random configurations bring the error of one data set to a wanted accuracy; every length is looked at.

    `frames`, `point_sets`: as in `budget_table`. Returns robot, points, accuracy_um, configurations with their 95 % interval
    (configurations_low, configurations_high), configurations_by_bound, measurements; infinite where the longest data set does
    not reach it.
    """
    rows = []
    for robot, frame in frames.items():
        for points, names in point_sets.items():
            mine = frame[frame.points == points]
            if mine.empty:
                continue
            squares = mine.pivot(index="data_set", columns="length", values="mean_square")
            lengths = squares.columns.to_numpy()
            rms, error = root_mean(squares.to_numpy())
            bound = np.sqrt(mine.groupby("length").bound.mean().reindex(lengths).to_numpy())
            for accuracy in accuracies_um:
                found = {
                    "configurations": rms,
                    "configurations_low": rms - QUANTILE * error,
                    "configurations_high": rms + QUANTILE * error,
                    "configurations_by_bound": bound,
                }
                needed = {name: _first(lengths, MICRO * values <= accuracy) for name, values in found.items()}
                head = {"robot": robot, "points": points, "accuracy_um": accuracy}
                rows.append(head | needed | {"measurements": needed["configurations"] * len(names)})
    return pd.DataFrame(rows)


def root_mean(squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root of the mean over data sets with its standard error by the delta method.

    `squares` (sets, ...). Returns `root`, `std_error` (...).
    """
    root = np.sqrt(squares.mean(axis=0))
    return root, squares.std(axis=0, ddof=1) / np.sqrt(len(squares)) / (2 * root)


def ratio_of_roots(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float, float]:
    """Ratio of two root mean squares over the same data sets with its 95 % interval, by the delta method.

    `ours`, `theirs` (sets,): mean squares, of one data set at one place.
    """
    ratio = float(np.sqrt(ours.mean() / theirs.mean()))
    relative = (ours / ours.mean() - theirs / theirs.mean()) / 2
    error = QUANTILE * relative.std(ddof=1) / np.sqrt(len(ours))
    return ratio, ratio * np.exp(-error), ratio * np.exp(error)


def _at(frame: pd.DataFrame, points: str, configurations: int) -> pd.DataFrame:
    return frame[(frame.points == points) & (frame.length == configurations)].sort_values("data_set")


def _first(lengths: np.ndarray, reached: np.ndarray) -> float:
    """The first length from which on it is reached for good."""
    missed = np.flatnonzero(~reached)
    place = missed[-1] + 1 if len(missed) else 0
    return float(lengths[place]) if place < len(lengths) else np.inf
