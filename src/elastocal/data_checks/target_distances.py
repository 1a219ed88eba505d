"""Compare the distances between targets, which every state measures, with the declared
ones: no model of the robot is needed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.counting import format_count

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.campaigns.campaign import Campaign, Measurements

# Fewer states than this show no scatter.
_MIN_STATES = 4
# Standard error of a median of normal values over that of their mean, and their standard
# deviation over their median absolute deviation (Rousseeuw and Croux, JASA 1993).
_MEDIAN_STD_ERROR = 1.2533
_NORMAL_MAD = 1.4826
# Deviations below this are rounding, m: the last digit of sensors.
_RESOLUTION_M = 1e-6
# Standard errors beyond which a deviation is no chance: once in a thousand pairs.
_STD_ERRORS = 3.29


@dataclass(frozen=True)
class DistanceDeviation:
    """How far the distance between two targets is from the declared one.

    Attributes
    ----------
    names : their names.
    deviation_m : median over the states, m; positive if they are farther apart.
    scatter_m : standard deviation of one state, m.
    states, same_sign : numbers of states, and of those that deviate to the same side.
    """

    names: tuple[str, str]
    deviation_m: float
    scatter_m: float
    states: int
    same_sign: int

    @property
    def is_significant(self) -> bool:
        """Whether chance does not explain the deviation, and a single state shows it."""
        std_error_m = _MEDIAN_STD_ERROR * self.scatter_m / np.sqrt(self.states)
        limit_m = max(_STD_ERRORS * std_error_m, self.scatter_m, _RESOLUTION_M)
        return abs(self.deviation_m) > limit_m

    @property
    def sentence(self) -> str:
        """The deviation and its cure in a line."""
        side = "farther apart" if self.deviation_m > 0.0 else "closer together"
        count = format_count(self.states, "state")
        share = f"all {count}"
        if self.same_sign < self.states:
            share = f"{self.same_sign} of {count}"
        return (
            f"{' and '.join(self.names)} are {1e3 * abs(self.deviation_m):.2f} mm {side}"
            f" than declared in {share}: measure the tool with the tracker, or give the"
            " measured offsets"
        )


def compare_target_distances(campaign: Campaign) -> list[str]:
    """Return a sentence for the pair of targets whose distance deviates most from the
    declared one; none if chance explains all deviations.

    Only targets on one measuring point are compared, because no joint lies between.
    """
    if campaign.measuring.channels:
        return []
    deviations = [
        deviation
        for deviation in _measure_deviations(campaign)
        if deviation.is_significant
    ]
    if not deviations:
        return []
    largest = max(deviations, key=lambda deviation: abs(deviation.deviation_m))
    if len(deviations) == 1:
        return [largest.sentence]
    further = format_count(len(deviations) - 1, "further pair")
    return [f"{largest.sentence} ({further} of targets likewise)"]


def _measure_deviations(campaign: Campaign) -> Iterator[DistanceDeviation]:
    measurements = campaign.measurements
    state = _number_states(measurements)
    for first, second in combinations(range(len(campaign.targets)), 2):
        targets = campaign.targets[first], campaign.targets[second]
        if targets[0].point != targets[1].point:
            continue
        if targets[0].offset_m is None or targets[1].offset_m is None:
            continue
        declared_m = np.linalg.norm(
            np.subtract(targets[0].offset_m, targets[1].offset_m)
        )
        distance_m = _measure_distances(measurements, state, (first, second))
        if len(distance_m) < _MIN_STATES:
            continue
        deviation_m = distance_m - declared_m
        median_m = float(np.median(deviation_m))
        yield DistanceDeviation(
            (targets[0].name, targets[1].name),
            median_m,
            _NORMAL_MAD * float(np.median(np.abs(deviation_m - median_m))),
            len(deviation_m),
            int((np.sign(deviation_m) == np.sign(median_m)).sum()),
        )


def _number_states(measurements: Measurements) -> np.ndarray:
    """Number (N,) the states, each approach by itself."""
    keys = np.column_stack(
        [
            measurements.session,
            measurements.pose,
            measurements.load,
            measurements.repeat,
        ]
    )
    return group_equal_rows(keys)[1]


def _measure_distances(
    measurements: Measurements, state: np.ndarray, pair: tuple[int, int]
) -> np.ndarray:
    """Measure the distance between two targets in each state with both, (S,), m."""
    rows = [np.flatnonzero(measurements.target == target) for target in pair]
    _, first, second = np.intersect1d(
        state[rows[0]], state[rows[1]], return_indices=True
    )
    difference = (
        measurements.position[rows[0][first]] - measurements.position[rows[1][second]]
    )
    return np.linalg.norm(difference, axis=1)
