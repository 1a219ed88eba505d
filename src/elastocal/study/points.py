"""Which points to measure, and the cost of an accuracy (RQ2): sets of measuring points
compared at equal numbers of measurements and at equal costs.

Each set of points is one least-squares problem. The sets share their configurations and
noise, so that they are compared data set by data set. In units of one measurement, n
configurations with m measurements each cost n (r + m), if moving to a configuration
costs r. A set of points that needs fewer configurations pays above the cost at which
both are equal, its break-even.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.in_memory import define_study_step
from elastocal.study.jobs import MICRO, Job, make_frame, read_frames, write_csvs
from elastocal.study.metrics import find_kept_length
from elastocal.study.schemas import BUDGET
from elastocal.study.simulation import draw_bootstrap_weights, make_prefix_index
from elastocal.study.strategies import Stage, Strategy

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.io.data_frames import Frames
    from elastocal.io.storage import Columns
    from elastocal.study.in_memory import StudyInMemory

    PointSets = Mapping[str, Sequence[str]]

# Suffix of a point that is measured a second time in a configuration, with new noise.
_AGAIN = "/again"
# A normal distribution has 95 % within this number of standard deviations.
QUANTILE = 1.96


def evaluate_point_sets(
    study: StudyInMemory, point_sets: PointSets
) -> Iterator[dict[str, np.ndarray | str]]:
    """Evaluate the squared error of each data set at every length.

    Sets with a point that the robot lacks are left out.

    Parameters
    ----------
    study
    point_sets
        Measuring points by the names of sets; a point may occur in a set twice.

    Yields
    ------
    dict
        Columns of the budget table, for one set of points after the other.
    """
    joints = tuple(range(study.robot.joints))
    validation = study.make_validation_set()
    available = {point.name for point in study.robot.chain.points}
    measured_points = {
        label: _name_measurements(points)
        for label, points in point_sets.items()
        if available.issuperset(points)
    }
    names = dict.fromkeys(name for names in measured_points.values() for name in names)
    once = [name for name in names if not name.endswith(_AGAIN)]
    again = [name.removesuffix(_AGAIN) for name in names if name.endswith(_AGAIN)]
    for sets in study.list_blocks():
        measurements = study.measure(sets, once)
        if again:
            repeated = study.measure(sets, again, _AGAIN)
            measurements |= {name + _AGAIN: repeated[name] for name in again}
        for label, points in measured_points.items():
            strategy = Strategy("", (Stage(points, joints),))
            estimates = study.estimate(strategy, measurements)
            squares = validation.compute_mean_square(estimates)
            yield {
                **make_prefix_index(sets, len(squares)),
                "points": label,
                "mean_square": squares.T.ravel(),
            }


def _name_measurements(points: Sequence[str]) -> tuple[str, ...]:
    """Names of the measurements of a set of points; repeated points get a suffix."""
    return tuple(
        name + _AGAIN if name in points[:position] else name
        for position, name in enumerate(points)
    )


@dataclass(frozen=True)
class Score:
    """A score over data sets, with what its intervals need.

    Attributes
    ----------
    value : float
    relative : (N,) array
        Deviations of the score's logarithm, of data sets or replicates that all compared
        scores share.
    spread : float
        Standard error over the standard deviation of `relative`: 1 over the root of N
        for data sets, 1 for replicates.
    """

    value: float
    relative: np.ndarray
    spread: float

    def compute_std_error(self) -> float:
        """Standard error of the value."""
        return float(abs(self.value) * self.spread * self.relative.std(ddof=1))

    def compute_ratio(self, reference: Score) -> tuple[float, float, float]:
        """Ratio to another score with its 95 % interval, paired."""
        ratio = self.value / reference.value
        difference = self.relative - reference.relative
        error = QUANTILE * self.spread * difference.std(ddof=1)
        return ratio, ratio * np.exp(-error), ratio * np.exp(error)


def score_mean(values: np.ndarray, factor: float = 1.0) -> Score:
    """Score by the mean of values (N,) over data sets, times a factor."""
    mean = values.mean()
    return Score(factor * float(mean), values / mean - 1, 1 / np.sqrt(len(values)))


def score_rms(squares: np.ndarray, factor: float = 1.0) -> Score:
    """Score by the root mean of squares (N,) over data sets, times a factor; its errors
    follow by the delta method."""
    mean = squares.mean()
    # The logarithm of a root deviates half as much as that of its argument.
    relative = (squares / mean - 1) / 2
    return Score(factor * float(np.sqrt(mean)), relative, 1 / np.sqrt(len(squares)))


def build_budget_table(
    budgets: Frames, point_sets: PointSets, length: int
) -> pd.DataFrame:
    """Error of one data set by set of points: with as many configurations, and with as
    many measurements.

    Rows that would need longer data sets are left out.

    Parameters
    ----------
    budgets
        The budget table of each robot.
    point_sets
    length : int
        Number of configurations; the budget is twice as many measurements.
    """
    rows = []
    for robot, frame in budgets.items():
        for points, names in point_sets.items():
            for configurations in sorted({length, 2 * length // len(names)}):
                squares = _select_squares(frame, points, configurations)
                if len(squares):
                    rms = score_rms(squares, MICRO)
                    head = (robot, points, len(names), configurations)
                    rows.append((*head, rms.value, rms.compute_std_error()))
    columns = ("robot", "points", "measurements_per_configuration", "configurations")
    return make_frame(rows, (*columns, "rms_um", "std_error_um"))


def build_paired_table(
    budgets: Frames, point_sets: PointSets, length: int
) -> pd.DataFrame:
    """Compare sets of points with the first one, at a budget of twice `length`
    measurements, paired by data set.

    The ratio of the RMS errors has its 95 % interval.
    """
    rows = []
    reference = next(iter(point_sets))
    reference_length = 2 * length // len(point_sets[reference])
    for robot, frame in budgets.items():
        reference_squares = _select_squares(frame, reference, reference_length)
        for points, names in point_sets.items():
            configurations = 2 * length // len(names)
            squares = _select_squares(frame, points, configurations)
            if points == reference or not len(squares) or not len(reference_squares):
                continue
            ratio = score_rms(squares).compute_ratio(score_rms(reference_squares))
            measurements = configurations * len(names)
            lengths = (configurations, reference_length)
            rows.append((robot, points, reference, measurements, *lengths, *ratio))
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
    budgets: Frames, point_sets: PointSets, accuracies_um: Sequence[float]
) -> pd.DataFrame:
    """Number of random configurations that keep the error of one data set below an
    accuracy, with 95 % intervals.

    Infinite if the longest data set does not reach it.
    """
    rows = []
    for robot, frame in budgets.items():
        for points, names in point_sets.items():
            cell = frame[frame.points == points]
            if cell.empty:
                continue
            squares = _pivot_squares(cell).to_numpy()
            rms = np.sqrt(squares.mean(axis=0))
            std_error = squares.std(axis=0, ddof=1) / np.sqrt(len(squares)) / (2 * rms)
            bounds = {
                "configurations": rms,
                "configurations_low": rms - QUANTILE * std_error,
                "configurations_high": rms + QUANTILE * std_error,
            }
            for accuracy in accuracies_um:
                needed = {
                    name: float(find_kept_length(MICRO * curve, accuracy))
                    for name, curve in bounds.items()
                }
                head = {"robot": robot, "points": points, "accuracy_um": accuracy}
                needed["measurements"] = needed["configurations"] * len(names)
                rows.append({**head, **needed})
    return make_frame(rows)


def _select_squares(
    frame: pd.DataFrame, points: str, configurations: int
) -> np.ndarray:
    """Mean squares of a set of points at a length, in the order of the data sets."""
    cell = frame[(frame.points == points) & (frame.length == configurations)]
    return cell.sort_values("data_set").mean_square.to_numpy()


def _pivot_squares(cell: pd.DataFrame) -> pd.DataFrame:
    """Mean squares of a set of points, a row for each data set."""
    return cell.pivot(index="data_set", columns="length", values="mean_square")


def interpolate_configurations(squares: np.ndarray, accuracy: float) -> np.ndarray:
    """Number of configurations after which the RMS error stays below an accuracy: a real
    number by interpolation of its logarithm.

    Parameters
    ----------
    squares : (..., lengths) array
        Mean square errors for the lengths 1, 2, 3 ...
    accuracy : float
        In the unit of their roots.

    Returns
    -------
    (...) array
        Infinite if the longest data set does not reach the accuracy.
    """
    finite_or_inf = np.where(np.isnan(squares), np.inf, squares)
    excess = np.log(finite_or_inf) - 2 * np.log(accuracy)
    above = excess > 0
    longest = excess.shape[-1]
    last_above = longest - 1 - np.argmax(above[..., ::-1], axis=-1)
    # Interpolate between the last length above the accuracy and the next one.
    start = np.minimum(last_above, longest - 2)
    before = np.take_along_axis(excess, start[..., None], -1)[..., 0]
    after = np.take_along_axis(excess, start[..., None] + 1, -1)[..., 0]
    with np.errstate(invalid="ignore"):
        share = np.where(np.isinf(before), 1.0, before / (before - after))
    crossing = np.exp(np.log1p(start) + share * np.log1p(1.0 / (start + 1.0)))
    reached = np.where(above[..., -1], np.inf, crossing)
    return np.where(above.any(axis=-1), reached, 1.0)


def build_break_even_table(
    budgets: Frames,
    point_sets: PointSets,
    accuracies_um: Sequence[float],
    weights: Columns,
) -> pd.DataFrame:
    """Cost of a configuration above which each set of points is cheaper than the first
    one, with its 95 % interval.

    Costs are in measurements; infinite if the set never pays.

    Parameters
    ----------
    budgets
        The budget table of each robot.
    point_sets
    accuracies_um
    weights
        Bootstrap weights (1 + replicates, sets) of each robot's data sets.
    """
    rows = []
    reference = next(iter(point_sets))
    counts = {points: len(names) for points, names in point_sets.items()}
    for robot, frame in budgets.items():
        means = _average_squares(frame, point_sets, weights[robot])
        for accuracy in accuracies_um:
            needed = {
                points: interpolate_configurations(mean, accuracy / MICRO)
                for points, mean in means.items()
            }
            reference_needed = needed.pop(reference, np.full(1, np.inf))
            for points, configurations in needed.items():
                first = configurations[0], reference_needed[0]
                if not np.isfinite(first).all():
                    continue
                even = _compute_break_even(
                    (configurations, counts[points]),
                    (reference_needed, counts[reference]),
                )
                interval = np.quantile(even[1:], [0.025, 0.975], method="nearest")
                rows.append(
                    (robot, accuracy, points, reference, *first, even[0], *interval)
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


def _average_squares(
    frame: pd.DataFrame, point_sets: Iterable[str], weights: np.ndarray
) -> dict[str, np.ndarray]:
    """Weighted mean squares (1 + replicates, lengths) of the sets of points that a robot
    has."""
    shares = weights / weights.sum(axis=1, keepdims=True)
    cells = dict(iter(frame.groupby("points")))
    return {
        points: shares @ _pivot_squares(cells[points]).to_numpy()
        for points in point_sets
        if points in cells
    }


def _compute_break_even(
    candidate: tuple[np.ndarray, int], reference: tuple[np.ndarray, int]
) -> np.ndarray:
    """Cost r of a configuration, in measurements, at which two sets of points cost the
    same: n (r + m) = n0 (r + m0).

    Both arguments are the numbers of configurations (1 + replicates,) and the
    measurements in each. Infinite if the candidate needs no fewer configurations.
    """
    count, size = candidate
    reference_count, reference_size = reference
    with np.errstate(divide="ignore", invalid="ignore"):
        even = (count * size - reference_count * reference_size) / (
            reference_count - count
        )
    return np.where(count < reference_count, np.maximum(even, 0.0), np.inf)


def tabulate_budget(job: Job) -> None:
    """Compare the sets of points of all robots: at an equal budget, paired, and by the
    number of configurations that each needs."""
    params = job.params
    budgets = read_frames(job, job.input.budgets, BUDGET)
    write_csvs(
        job,
        budget=build_budget_table(budgets, params.point_sets, params.length),
        pairs=build_paired_table(budgets, params.point_sets, params.length),
        lengths=build_lengths_table(budgets, params.point_sets, params.accuracies_um),
    )


def tabulate_costs(job: Job) -> None:
    """Write the break-even costs of all robots."""
    params = job.params
    budgets = read_frames(job, job.input.budgets, BUDGET)
    seed = params.weights["seed"]
    replicates = params.weights["replicates"]
    weights = {
        robot: draw_bootstrap_weights(
            seed, robot, sorted(set(frame.data_set)), replicates
        )
        for robot, frame in budgets.items()
    }
    table = build_break_even_table(
        budgets, params.point_sets, params.accuracies_um, weights
    )
    write_csvs(job, table=table)


compare_point_sets = define_study_step(BUDGET, evaluate_point_sets)
