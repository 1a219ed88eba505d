"""Which points to measure, and what an accuracy costs (RQ2): sets of points over as
many measurements and over their costs.

One least-squares problem over each set of points. Sets share their configurations and
noise, so that they are compared data set by data set. In units of one measurement, n
configurations with m measurements each cost n (r + m), where going to a configuration
costs r. A set of points that needs fewer configurations pays from the cost on at which
both are equal: its break-even.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import (
    DATA_SET,
    LENGTH,
    MEAN_SQUARE,
    MICRO,
    Job,
    make_frame,
    make_group_column,
    make_schema,
    read_frames,
    write_csvs,
)
from elastocal.study.simulation import draw_bootstrap_weights, make_prefix_index
from elastocal.study.strategies import Stage, Strategy

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.study.in_memory import StudyInMemory

    Frames = Mapping[str, pd.DataFrame]
    PointSets = Mapping[str, Sequence[str]]

BUDGET = make_schema(
    "budget",
    make_group_column("points", "set of measuring points; a row group holds one"),
    DATA_SET,
    LENGTH,
    MEAN_SQUARE,
)
# A point that is measured twice in a configuration has noise of its own the second
# time.
_AGAIN = "/again"
# Of a normal distribution: 95 % within.
QUANTILE = 1.96


def evaluate_point_sets(
    study: StudyInMemory, point_sets: PointSets
) -> Iterator[dict[str, np.ndarray | str]]:
    """Squared error of each data set at every length.

    `point_sets`: measuring points by the names of sets; a point may stand in a set
    twice. Sets with a point that the robot lacks are left out.
    """
    n = study.robot.joints
    judge = study.judge()
    there = {point.name for point in study.robot.chain.points}
    point_sets = {
        label: points
        for label, points in point_sets.items()
        if there.issuperset(points)
    }
    names = tuple(
        dict.fromkeys(name for points in point_sets.values() for name in points)
    )
    twice = tuple(
        name
        for name in names
        if any([*points].count(name) > 1 for points in point_sets.values())
    )
    for sets in study.blocks():
        measurements = study.measure(sets, names)
        again = study.measure(sets, twice, _AGAIN) if twice else {}
        measurements |= {name + _AGAIN: found for name, found in again.items()}
        for label, points in point_sets.items():
            read = tuple(
                name + _AGAIN * (name in points[:place])
                for place, name in enumerate(points)
            )
            squares = judge.mean_square(
                study.estimate(
                    Strategy("", (Stage(read, tuple(range(n))),)), measurements
                )
            )
            yield {
                **make_prefix_index(sets, len(squares)),
                "points": label,
                "mean_square": squares.T.ravel(),
            }


@dataclass(frozen=True)
class Score:
    """A score over data sets, with what its intervals need.

    `relative` (N,): deviations of its logarithm, of data sets or replicates that all
    that is compared shares. `spread`: the standard error over the standard deviation of
    `relative`: 1 over the root of N for data sets, 1 for replicates.
    """

    value: float
    relative: np.ndarray
    spread: float

    def std_error(self) -> float:
        """Standard error of the value."""
        return float(abs(self.value) * self.spread * self.relative.std(ddof=1))

    def ratio(self, other: Score) -> tuple[float, float, float]:
        """Ratio to another score with its 95 % interval, paired."""
        ratio = self.value / other.value
        error = QUANTILE * self.spread * (self.relative - other.relative).std(ddof=1)
        return ratio, ratio * np.exp(-error), ratio * np.exp(error)


def mean_of(values: np.ndarray, root: bool = False, factor: float = 1.0) -> Score:
    """Mean of values (N,) over data sets, or its root, times a factor; errors by the
    delta method."""
    mean = values.mean()
    # The logarithm of a root deviates half as much as that of the mean below it.
    relative = (values / mean - 1) / (2 if root else 1)
    return Score(
        factor * float(np.sqrt(mean) if root else mean),
        relative,
        1 / np.sqrt(len(values)),
    )


def build_budget_table(
    found: Frames, point_sets: PointSets, length: int
) -> pd.DataFrame:
    """Error of one data set by set of points: with as many configurations, and with as
    many measurements.

    `found`: the budget table of each robot. `length`: configurations; the budget is
    twice as many measurements. Without rows that would take longer data sets.
    """
    rows = []
    for robot, frame in found.items():
        for points, names in point_sets.items():
            for configurations in sorted({length, 2 * length // len(names)}):
                at = _at(frame, points, configurations)
                if len(at):
                    rms = mean_of(at.mean_square.to_numpy(), True, MICRO)
                    rows.append(
                        (
                            robot,
                            points,
                            len(names),
                            configurations,
                            rms.value,
                            rms.std_error(),
                        )
                    )
    columns = ("robot", "points", "measurements_per_configuration", "configurations")
    return make_frame(rows, (*columns, "rms_um", "std_error_um"))


def build_paired_table(
    found: Frames, point_sets: PointSets, length: int
) -> pd.DataFrame:
    """Sets of points against the first one, at a budget of twice `length` measurements,
    paired by data set.

    The ratio has its 95 % interval.
    """
    rows = []
    against = next(iter(point_sets))
    for robot, frame in found.items():
        theirs_at = 2 * length // len(point_sets[against])
        theirs = _at(frame, against, theirs_at).mean_square.to_numpy()
        for points, names in point_sets.items():
            configurations = 2 * length // len(names)
            ours = _at(frame, points, configurations).mean_square.to_numpy()
            if points == against or not len(ours) or not len(theirs):
                continue
            head = (
                robot,
                points,
                against,
                configurations * len(names),
                configurations,
                theirs_at,
            )
            rows.append((*head, *mean_of(ours, True).ratio(mean_of(theirs, True))))
    columns = (
        "robot",
        "points",
        "against",
        "measurements",
        "configurations",
        "configurations_against",
    )
    return make_frame(rows, (*columns, "ratio", "ratio_low", "ratio_high"))


def build_lengths_table(
    found: Frames, point_sets: PointSets, accuracies_um: Sequence[float]
) -> pd.DataFrame:
    """How many random configurations bring the error of one data set to a wanted
    accuracy for good, with 95 % intervals.

    Infinite where the longest data set does not reach it.
    """
    rows = []
    for robot, frame in found.items():
        for points, names in point_sets.items():
            mine = frame[frame.points == points]
            if mine.empty:
                continue
            squares = mine.pivot(
                index="data_set", columns="length", values="mean_square"
            )
            lengths = squares.columns.to_numpy()
            rms = np.sqrt(squares.to_numpy().mean(axis=0))
            error = (
                squares.to_numpy().std(axis=0, ddof=1)
                / np.sqrt(len(squares))
                / (2 * rms)
            )
            curves = {
                "configurations": rms,
                "configurations_low": rms - QUANTILE * error,
                "configurations_high": rms + QUANTILE * error,
            }
            for accuracy in accuracies_um:
                needed = {
                    name: _first(lengths, MICRO * values <= accuracy)
                    for name, values in curves.items()
                }
                head = {"robot": robot, "points": points, "accuracy_um": accuracy}
                rows.append(
                    head
                    | needed
                    | {"measurements": needed["configurations"] * len(names)}
                )
    return make_frame(rows)


def _at(frame: pd.DataFrame, points: str, configurations: int) -> pd.DataFrame:
    return frame[
        (frame.points == points) & (frame.length == configurations)
    ].sort_values("data_set")


def _first(lengths: np.ndarray, reached: np.ndarray) -> float:
    """The first length from which on it is reached for good."""
    missed = np.flatnonzero(~reached)
    place = missed[-1] + 1 if len(missed) else 0
    return float(lengths[place]) if place < len(lengths) else np.inf


def interpolate_configurations(squares: np.ndarray, accuracy: float) -> np.ndarray:
    """Configurations after which the RMS error stays below an accuracy, a real number
    by interpolation of its logarithm.

    `squares` (..., lengths): mean square errors for the lengths 1, 2, 3 ... `accuracy`:
    in the units of their roots. Returns (...): infinite where the longest does not
    reach it.
    """
    excess = np.log(np.where(np.isnan(squares), np.inf, squares)) - 2 * np.log(accuracy)
    above = excess > 0
    last = excess.shape[-1] - 1 - np.argmax(above[..., ::-1], axis=-1)
    reached = ~above[..., -1]
    start = np.minimum(last, excess.shape[-1] - 2)[..., None]
    before, after = (np.take_along_axis(excess, start + k, -1)[..., 0] for k in (0, 1))
    with np.errstate(invalid="ignore"):
        share = np.where(np.isinf(before), 1.0, before / (before - after))
    between = np.exp(
        np.log1p(start[..., 0]) + share * np.log1p(1.0 / (start[..., 0] + 1.0))
    )
    return np.where(~above.any(axis=-1), 1.0, np.where(reached, between, np.inf))


def build_break_even_table(
    found: Frames,
    point_sets: PointSets,
    accuracies_um: Sequence[float],
    weights: Mapping[str, np.ndarray],
) -> pd.DataFrame:
    """From which cost of a configuration on each set of points is cheaper than the
    first one, with its 95 % interval.

    `weights`: bootstrap weights of each robot's data sets. Costs are in measurements;
    infinite where the set never pays.
    """
    rows = []
    against = next(iter(point_sets))
    for robot, frame in found.items():
        squares = {
            points: mine.pivot(index="data_set", columns="length", values="mean_square")
            for points, mine in frame.groupby("points")
        }
        shares = weights[robot] / weights[robot].sum(axis=1, keepdims=True)
        means = {
            points: shares @ squares[points].to_numpy()
            for points in point_sets
            if points in squares
        }
        for accuracy in accuracies_um:
            needed = {
                points: interpolate_configurations(mean, accuracy / MICRO)
                for points, mean in means.items()
            }
            theirs = needed.pop(against, np.full(1, np.inf))
            m = len(point_sets[against])
            for points, ours in needed.items():
                if not (np.isfinite(ours[0]) and np.isfinite(theirs[0])):
                    continue
                with np.errstate(divide="ignore", invalid="ignore"):
                    even = (ours * len(point_sets[points]) - theirs * m) / (
                        theirs - ours
                    )
                even = np.where(ours < theirs, np.maximum(even, 0.0), np.inf)
                ends = np.quantile(even[1:], [0.025, 0.975], method="nearest")
                rows.append(
                    (
                        robot,
                        accuracy,
                        points,
                        against,
                        ours[0],
                        theirs[0],
                        even[0],
                        *ends,
                    )
                )
    columns = (
        "robot",
        "accuracy_um",
        "points",
        "against",
        "configurations",
        "configurations_against",
    )
    return make_frame(
        rows, (*columns, "break_even", "break_even_low", "break_even_high")
    )


def tabulate_budget(job: Job) -> None:
    """Of all robots: at an equal budget, paired, and how many configurations each set
    needs."""
    asked = job.params
    found = read_frames(job, job.input.budgets, BUDGET)
    write_csvs(
        job,
        budget=build_budget_table(found, asked.point_sets, asked.length),
        pairs=build_paired_table(found, asked.point_sets, asked.length),
        lengths=build_lengths_table(found, asked.point_sets, asked.accuracies_um),
    )


def tabulate_costs(job: Job) -> None:
    """Of all robots."""
    asked = job.params
    found = read_frames(job, job.input.budgets, BUDGET)
    weights = {
        robot: draw_bootstrap_weights(
            asked.weights["seed"],
            robot,
            sorted(set(frame.data_set)),
            asked.weights["replicates"],
        )
        for robot, frame in found.items()
    }
    write_csvs(
        job,
        table=build_break_even_table(
            found, asked.point_sets, asked.accuracies_um, weights
        ),
    )


compare_point_sets = define_study_step(BUDGET, evaluate_point_sets)
