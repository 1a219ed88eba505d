"""Measurements as the loop uses them: repeats averaged, grouped by the state of the robot in which they were taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import groups_of

if TYPE_CHECKING:
    from typing import Any

    from elastocal.campaigns.campaign import Measurements

# Measurements this many times as far from the middle of their repeats as half of all are not noise: eight standard deviations.
_WILD = 12.0
# Half width of the interval that holds 95 % of a normal distribution, in standard deviations.
_COVERAGE = 1.959964


@dataclass(frozen=True)
class States:
    """Each pose, load and sense of approach once; arrays of S.

    `session`, `pose`, `load` (S,). `joint_angles` (S, n): rad. `wrench` (S, 6): N, N m, at the origin of the last measuring
    point, base axes. `repeats` (S,): how many approaches were averaged. `approach` (S, n): sense in which each joint was
    approached, -1, 0, +1. `time_s`, `temperature_c` (S,). `row` (S,): first row of the file that belongs to the state.
    """

    session: np.ndarray
    pose: np.ndarray
    load: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    repeats: np.ndarray
    approach: np.ndarray | None = None
    time_s: np.ndarray | None = None
    temperature_c: np.ndarray | None = None
    row: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.pose)


@dataclass(frozen=True)
class Observations:
    """One averaged reading of one target in one state; M of them, in the order of the states.

    `state`, `target` (M,): index of the state and of the target. `position` (M, 3): m, in the frame of the session. `rotation`
    (M, 3, 3): measured orientation, where poses are measured. `position_std` (M,): stated standard deviation of one measurement
    of one coordinate of the position, m; None where it is not stated.
    """

    states: States
    state: np.ndarray
    target: np.ndarray
    position: np.ndarray
    rotation: np.ndarray | None
    position_std: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.state)

    @property
    def rows(self) -> int:
        """Numbers in one observation: 3 for a position, 6 for a pose."""
        return 3 if self.rotation is None else 6

    @property
    def cluster(self) -> np.ndarray:
        """ndarray (M,): number of the (session, pose) that each observation belongs to, 0 .. P-1."""
        return state_clusters(self.states)[self.state]


def state_clusters(states: States | Measurements) -> np.ndarray:
    """Number of the (session, pose) of each state, 0 .. P-1.

    Returns (S,).
    """
    return groups_of(np.column_stack([states.session, states.pose]))[1]


def groups_by_size(group: np.ndarray) -> list[np.ndarray]:
    """Places of each group, for each number of places in one.

    `group` (M,) of int: such as the states or the poses of observations. Returns (G, k) of int: groups by their numbers, the
    places of each rising.
    """
    order, seen = np.argsort(group, kind="stable"), np.bincount(group)
    start = np.concatenate([[0], np.cumsum(seen)[:-1]])
    return [order[start[seen == count][:, None] + np.arange(count)] for count in np.unique(seen[seen > 0])]


def averaged(measurements: Measurements) -> Observations:
    """Observations with the repeats averaged that were approached alike.

    `measurements`: of `campaign`.
    """
    return _observations(measurements, _approached_alike(measurements))


def each_approach(measurements: Measurements) -> tuple[Observations, np.ndarray]:
    """Observations of every single approach: repeats are states of their own.

    Returns `repeated` (S,): number of the state that would hold this approach if repeats were averaged.
    """
    key = _approached_alike(measurements)
    single = np.column_stack([key, measurements.repeat])
    return _observations(measurements, single), groups_of(key[groups_of(single)[0]])[1]


def single_observations(measurements: Measurements) -> Observations:
    """Every measurement as an observation in a state of its own, in the order of the measurements."""
    states = States(
        measurements.session,
        measurements.pose,
        measurements.load,
        measurements.joint_angles,
        measurements.wrench,
        np.ones(len(measurements), int),
        measurements.approach,
        measurements.time_s,
        measurements.temperature_c,
        measurements.row,
    )
    rotation = None if measurements.rotation_vector is None else Rotation.from_rotvec(measurements.rotation_vector).as_matrix()
    spread = None if measurements.u95_m is None else standard_uncertainty(measurements.u95_m)
    return Observations(states, np.arange(len(measurements)), measurements.target, measurements.position, rotation, spread)


def without_outlying_repeats(measurements: Measurements) -> Measurements:
    """Measurements without those that are far from the other repeats of their state and target.

    Hampel's identifier [1]: distances from the median, here in units of the median absolute deviation of all repeats. An
    outlier would be taken for noise, and would move the mean of its repeats. Of two repeats nothing tells which is outlying.

    [1] Davies, L. and Gather, U., The identification of multiple outliers, Journal of the American Statistical Association 88,
        1993.
    """
    group = groups_of(np.column_stack([_approached_alike(measurements), measurements.target]))[1]
    off = np.abs(measurements.position - _medians(measurements.position, group)[group])
    repeated = np.bincount(group)[group] > 2
    if not repeated.any():
        return measurements
    apart = off[repeated]
    # The middle one of an odd number is not off at all, and tells nothing of the others.
    usual = np.median(apart[apart > 0]) if apart.any() else 0.0
    return measurements.select(np.flatnonzero(~(repeated & (off > _WILD * usual).any(axis=1))))


def _medians(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Median of each column in each group, ndarray (G, k)."""
    count = np.bincount(group)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    rising = np.column_stack([column[np.lexsort((column, group))] for column in values.T])
    return 0.5 * (rising[start + (count - 1) // 2] + rising[start + count // 2])


def _approached_alike(measurements: Measurements | States) -> np.ndarray:
    key = np.column_stack([measurements.session, measurements.pose, measurements.load])
    return key if measurements.approach is None else np.column_stack([key, measurements.approach])


def measured_in(some: Measurements | Observations, others: Measurements | Observations, chosen: np.ndarray) -> np.ndarray:
    """Which of some measurements, or averages of them, are of the same state and target as those chosen of others, (N,)."""
    mine, theirs = _states_and_targets(some), _states_and_targets(others)
    group = groups_of(np.concatenate([mine, theirs]))[1]
    return np.isin(group[: len(mine)], group[len(mine) :][chosen])


def _states_and_targets(some: Measurements | Observations) -> np.ndarray:
    states, each = (some.states, some.state) if isinstance(some, Observations) else (some, slice(None))
    return np.column_stack([_approached_alike(states)[each], some.target])


def _observations(measurements: Measurements, key: np.ndarray) -> Observations:
    first, state_of = groups_of(key)
    pairs = np.column_stack([state_of, measurements.target])
    first_pair, pair_of = groups_of(pairs)
    pairs = pairs[first_pair]

    def of_states(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else _means(values, state_of)

    repeats = np.full(len(first), len(measurements))
    np.minimum.at(repeats, pairs[:, 0], np.bincount(pair_of))
    first_row = measurements.row[first].copy()
    np.minimum.at(first_row, state_of, measurements.row)
    states = States(
        session=measurements.session[first],
        pose=measurements.pose[first],
        load=measurements.load[first],
        joint_angles=_means(measurements.joint_angles, state_of),
        wrench=_means(measurements.wrench, state_of),
        repeats=repeats,
        approach=None if measurements.approach is None else measurements.approach[first],
        time_s=of_states(measurements.time_s),
        temperature_c=of_states(measurements.temperature_c),
        row=first_row,
    )
    rotation = None
    if measurements.rotation_vector is not None:
        rotation = _mean_rotations(Rotation.from_rotvec(measurements.rotation_vector), pair_of)
    spread = None
    if measurements.u95_m is not None:
        # Of repeats that are averaged the mean square, as if they were alike.
        spread = np.sqrt(_means(standard_uncertainty(measurements.u95_m) ** 2, pair_of))
    return Observations(states, pairs[:, 0], pairs[:, 1], _means(measurements.position, pair_of), rotation, spread)


def standard_uncertainty(u95: np.ndarray) -> np.ndarray:
    """Standard deviations of one coordinate, by the quantile of the normal distribution [1].

    `u95`: expanded uncertainties of 95 %.

    [1] JCGM 100:2008, Guide to the expression of uncertainty in measurement, section 6.
    """
    return u95 / _COVERAGE


def select_states(observations: Observations, kept: np.ndarray) -> Observations:
    """The part of some observations that was taken in some of their states.

    `kept` (S,) of bool.
    """
    return _some_of(observations, kept, kept[observations.state], np.cumsum(kept) - 1)


def parts_of(observations: Observations, most: int) -> list[tuple[slice, slice]]:
    """Some observations in parts of whole poses, in their order.

    `observations`: those of a pose one after the other, as `averaged` gives them. `most`: about so many observations in a part.
    Returns (slice, slice): states and observations of each part; one part where they are few.
    """
    first = np.flatnonzero(np.diff(state_clusters(observations.states), prepend=-1))
    place = np.searchsorted(observations.state, first)
    chosen = np.unique(np.searchsorted(place, np.arange(0, len(observations), most)).clip(max=len(first) - 1))
    states, seen = [*first[chosen].tolist(), len(observations.states)], [*place[chosen].tolist(), len(observations)]
    edges = zip(states, states[1:], seen, seen[1:], strict=False)
    return [(slice(a, b), slice(c, d)) for a, b, c, d in edges]


def part_at(observations: Observations, states: slice, seen: slice) -> Observations:
    """One of the `parts_of` observations.

    `states`, `seen`: of the states and of the observations.
    """
    return _some_of(observations, states, seen, np.arange(len(observations.states)) - states.start)


def _some_of(
    observations: Observations, states: np.ndarray | slice, seen: np.ndarray | slice, number: np.ndarray
) -> Observations:
    """Those seen of some observations, all in some of their states, which are numbered anew: `number` (S,)."""
    values: dict[str, Any] = {name: None if each is None else each[states] for name, each in vars(observations.states).items()}
    rotation = None if observations.rotation is None else observations.rotation[seen]
    spread = None if observations.position_std is None else observations.position_std[seen]
    target, position = observations.target[seen], observations.position[seen]
    return Observations(States(**values), number[observations.state[seen]], target, position, rotation, spread)


def spread_poses(observations: Observations, most: int) -> np.ndarray:
    """Which states belong to poses evenly spread over a campaign, so many that about `most` observations are left.

    Returns (S,) of bool: True throughout where there are no more.
    """
    if len(observations) <= most:
        return np.ones(len(observations.states), bool)
    pose = state_clusters(observations.states)
    poses = pose.max() + 1
    chosen = np.zeros(poses, bool)
    chosen[np.linspace(0, poses - 1, max(int(poses * most / len(observations)), 2)).round().astype(int)] = True
    return chosen[pose]


def sample_of(observations: Observations, most: int, like: Observations | None = None) -> Observations:
    """About so many observations at poses spread over a campaign, or all where the sample would miss a session or a target.

    `like`: a sample of the same campaign, of whose states they are to be.
    """
    if len(observations) <= most:
        return observations
    chosen = spread_poses(observations, most)
    if like is not None:
        chosen = np.isin(np.arange(len(chosen)), observations.state[measured_in(observations, like, np.ones(len(like), bool))])
    some = select_states(observations, chosen)
    sessions = np.isin(observations.states.session, some.states.session).all()
    return some if sessions and np.isin(observations.target, some.target).all() else observations


def _means(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    count = np.bincount(group)
    if len(count) == len(values):
        # Nothing to average, whatever the order.
        total = np.empty(values.shape)
        total[group] = values
        return total
    total = np.zeros((len(count), *values.shape[1:]))
    np.add.at(total, group, values)
    return total / count.reshape(-1, *[1] * (values.ndim - 1))


def _mean_rotations(rotations: Rotation, group: np.ndarray) -> np.ndarray:
    """Mean of rotations close to each other: the mean turn from the first of each group.

    The first step towards the Riemannian mean [1].

    [1] Moakher, M., Means and averaging in the group of rotations, SIAM Journal on Matrix Analysis and Applications 24, 2002.
    """
    first = np.unique(group, return_index=True)[1]
    reference = rotations[first]
    turns = (rotations * reference[group].inv()).as_rotvec()
    return (Rotation.from_rotvec(_means(turns, group)) * reference).as_matrix()
