"""Measurements as the loop uses them: repeats averaged, grouped by the state of the
robot in which they were taken."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import average_by_group, group_equal_rows

if TYPE_CHECKING:
    from typing import Any

    from elastocal.campaigns.campaign import Measurements

# Measurements this many times as far from the middle of their repeats as half of all
# are not noise: eight standard deviations.
_WILD = 12.0
# Values of sensitivities that are held at once, of which there are five copies:
# observations beyond come in parts of so many, which stay in the processor's cache.
# What a linearisation makes beside parameters is as 60 of them.
_MOST_HELD = 2_000_000
_MOST_AT_ONCE = 4000
_BESIDE = 60


@dataclass(frozen=True)
class States:
    """Each pose, load and sense of approach once; arrays of S.

    `session`, `pose`, `load` (S,). `joint_angles` (S, n): rad. `wrench` (S, 6): N, N m,
    at the origin of the last measuring point, base axes. `repeats` (S,): how many
    approaches were averaged. `approach` (S, n): sense in which each joint was
    approached, -1, 0, +1. `time_s`, `temperature_c` (S,). `row` (S,): first row of the
    file that belongs to the state.
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
    """One averaged reading of one target in one state; M of them, in the order of the
    states.

    `state`, `target` (M,): index of the state and of the target. `position` (M, 3): m,
    in the frame of the session. `rotation` (M, 3, 3): measured orientation, where poses
    are measured.
    """

    states: States
    state: np.ndarray
    target: np.ndarray
    position: np.ndarray
    rotation: np.ndarray | None

    def __len__(self) -> int:
        return len(self.state)

    @property
    def rows(self) -> int:
        """Numbers in one observation: 3 for a position, 6 for a pose."""
        return 3 if self.rotation is None else 6

    @property
    def cluster(self) -> np.ndarray:
        """ndarray (M,): number of the (session, pose) that each observation belongs to,
        0 .. P-1."""
        return index_poses(self.states)[self.state]


def index_poses(states: States | Measurements) -> np.ndarray:
    """Number of the (session, pose) of each state, ndarray (S,): 0 .. P-1."""
    return group_equal_rows(np.column_stack([states.session, states.pose]))[1]


def batch_groups_by_size(group: np.ndarray) -> list[np.ndarray]:
    """Places of each group, for each number k of places in one, ndarray (G, k) of int.

    `group` (M,) of int: such as the states or the poses of observations. Groups by
    their numbers, the places of each rising.
    """
    order = np.argsort(group, kind="stable")
    seen = np.bincount(group)
    start = np.cumsum(seen) - seen
    return [
        order[start[seen == count][:, None] + np.arange(count)]
        for count in np.unique(seen[seen > 0])
    ]


def average_repeats(measurements: Measurements) -> Observations:
    """Observations with the repeats averaged that were approached alike."""
    return _observations(measurements, _approached_alike(measurements))


def separate_approaches(measurements: Measurements) -> tuple[Observations, np.ndarray]:
    """Observations of every single approach, and (S,) in which state it would be if
    repeats were averaged."""
    key = _approached_alike(measurements)
    single = np.column_stack([key, measurements.repeat])
    return _observations(measurements, single), group_equal_rows(
        key[group_equal_rows(single)[0]]
    )[1]


def separate_measurements(measurements: Measurements) -> Observations:
    """Every measurement as an observation in a state of its own, in the order of the
    measurements."""
    every = np.arange(len(measurements))
    shared = [field.name for field in fields(States) if field.name != "repeats"]
    states = States(
        **{name: getattr(measurements, name) for name in shared},
        repeats=np.ones(len(measurements), int),
    )
    turned = measurements.rotation_vector
    rotation = None if turned is None else Rotation.from_rotvec(turned).as_matrix()
    return Observations(
        states, every, measurements.target, measurements.position, rotation
    )


def remove_outlying_repeats(measurements: Measurements) -> Measurements:
    """Measurements without those that are far from the other repeats of their state and
    target.

    Hampel's identifier (Davies and Gather, J. Am. Stat. Assoc. 88, 1993): distances
    from the median, here in units of the median absolute deviation of all repeats. An
    outlier would be taken for noise, and would move the mean of its repeats. Of two
    repeats nothing tells which is outlying.
    """
    group = group_equal_rows(_states_and_targets(measurements))[1]
    count = np.bincount(group)
    repeated = count[group] > 2
    if not repeated.any():
        return measurements
    start = np.cumsum(count) - count
    rising = np.column_stack(
        [column[np.lexsort((column, group))] for column in measurements.position.T]
    )
    medians = 0.5 * (rising[start + (count - 1) // 2] + rising[start + count // 2])
    off = np.abs(measurements.position - medians[group])
    apart = off[repeated]
    # The middle one of an odd number is not off at all, and tells nothing of the
    # others.
    usual = np.median(apart[apart > 0]) if apart.any() else 0.0
    return measurements.select(
        np.flatnonzero(~(repeated & (off > _WILD * usual).any(axis=1)))
    )


def match_states_and_targets(
    some: Measurements | Observations,
    others: Measurements | Observations,
    chosen: np.ndarray,
) -> np.ndarray:
    """Which of some measurements, or averages of them, are of the same state and target
    as those chosen of others, (N,)."""
    mine = _states_and_targets(some)
    theirs = _states_and_targets(others)
    group = group_equal_rows(np.concatenate([mine, theirs]))[1]
    return np.isin(group[: len(mine)], group[len(mine) :][chosen])


def _states_and_targets(some: Measurements | Observations) -> np.ndarray:
    states, each = (
        (some.states, some.state)
        if isinstance(some, Observations)
        else (some, slice(None))
    )
    return np.column_stack([_approached_alike(states)[each], some.target])


def _approached_alike(measurements: Measurements | States) -> np.ndarray:
    key = np.column_stack([measurements.session, measurements.pose, measurements.load])
    return (
        key
        if measurements.approach is None
        else np.column_stack([key, measurements.approach])
    )


def _observations(measurements: Measurements, key: np.ndarray) -> Observations:
    """Averages of the measurements of each target in each state, which measurements
    (N,) share whose `key` (N, k) is equal."""
    first, state_of = group_equal_rows(key)
    pairs = np.column_stack([state_of, measurements.target])
    first_pair, pair_of = group_equal_rows(pairs)
    state, target = pairs[first_pair].T
    repeats = np.full(len(first), len(measurements))
    row = measurements.row[first].copy()
    np.minimum.at(repeats, state, np.bincount(pair_of))
    np.minimum.at(row, state_of, measurements.row)
    there = {
        name: values
        for name, values in vars(measurements).items()
        if values is not None
    }
    shared: dict[str, Any] = {
        name: there[name][first]
        for name in ("session", "pose", "load", "approach")
        if name in there
    }
    mean_of = ("joint_angles", "wrench", "time_s", "temperature_c")
    shared |= {
        name: average_by_group(there[name], state_of)
        for name in mean_of
        if name in there
    }
    states = States(**shared, repeats=repeats, row=row)
    rotation = None
    if measurements.rotation_vector is not None:
        each = Rotation.from_rotvec(measurements.rotation_vector)
        mean = each[first_pair]
        if len(first_pair) < len(measurements):
            # Of rotations close to each other, the mean turn from the first: a step
            # towards the Riemannian mean (Moakher 2002).
            mean = (
                Rotation.from_rotvec(
                    average_by_group((each * mean[pair_of].inv()).as_rotvec(), pair_of)
                )
                * mean
            )
        rotation = mean.as_matrix()
    return Observations(
        states,
        state,
        target,
        average_by_group(measurements.position, pair_of),
        rotation,
    )


def select_states(observations: Observations, kept: np.ndarray) -> Observations:
    """The part of some observations that was taken in some of their states, ndarray of
    bool (S,)."""
    return _some_of(observations, kept, kept[observations.state], np.cumsum(kept) - 1)


def split_into_blocks(
    observations: Observations, columns: int
) -> list[tuple[slice, slice, Observations]]:
    """Some observations in parts of whole poses, in their order, one where their
    sensitivities can be held at once.

    `observations`: those of a pose one after the other, as `averaged` gives them.
    `columns`: how many sensitivities each has. Returns for each part which states and
    which observations these are, and the part.
    """
    width = observations.rows * max(columns, _BESIDE)
    most = max(min(_MOST_HELD // width, _MOST_AT_ONCE), 1)
    if width * len(observations) <= _MOST_HELD:
        return [
            (
                slice(0, len(observations.states)),
                slice(0, len(observations)),
                observations,
            )
        ]
    first = np.flatnonzero(np.diff(index_poses(observations.states), prepend=-1))
    place = np.searchsorted(observations.state, first)
    chosen = np.unique(
        np.searchsorted(place, np.arange(0, len(observations), most)).clip(
            max=len(first) - 1
        )
    )
    ends = (
        [*first[chosen].tolist(), len(observations.states)],
        [*place[chosen].tolist(), len(observations)],
    )
    edges = ([slice(a, b) for a, b in pairwise(each)] for each in ends)
    number = np.arange(len(observations.states))
    return [
        (mine, seen, _some_of(observations, mine, seen, number - mine.start))
        for mine, seen in zip(*edges, strict=True)
    ]


def _some_of(
    observations: Observations,
    states: np.ndarray | slice,
    seen: np.ndarray | slice,
    number: np.ndarray,
) -> Observations:
    """Those seen of some observations, all in some of their states, which are numbered
    anew: `number` (S,)."""
    values: dict[str, Any] = {
        name: None if each is None else each[states]
        for name, each in vars(observations.states).items()
    }
    own = {
        name: None if each is None else each[seen]
        for name, each in vars(observations).items()
        if name != "states"
    }
    return Observations(States(**values), **own | {"state": number[own["state"]]})


def select_spread_poses(observations: Observations, most: int) -> np.ndarray:
    """Which states belong to poses evenly spread over a campaign, so many that about
    `most` observations are left.

    Returns (S,) of bool: True throughout where there are no more.
    """
    if len(observations) <= most:
        return np.ones(len(observations.states), bool)
    pose = index_poses(observations.states)
    poses = pose.max() + 1
    chosen = np.zeros(poses, bool)
    chosen[
        np.linspace(0, poses - 1, max(int(poses * most / len(observations)), 2))
        .round()
        .astype(int)
    ] = True
    return chosen[pose]


def sample_observations(
    observations: Observations, most: int, like: Observations | None = None
) -> Observations:
    """About so many observations at poses spread over a campaign, or all where the
    sample would miss a session or a target.

    `like`: a sample of the same campaign, of whose states they are to be.
    """
    if len(observations) <= most:
        return observations
    chosen = select_spread_poses(observations, most)
    if like is not None:
        chosen = np.isin(
            np.arange(len(chosen)),
            observations.state[
                match_states_and_targets(observations, like, np.ones(len(like), bool))
            ],
        )
    some = select_states(observations, chosen)
    sessions = np.isin(observations.states.session, some.states.session).all()
    return (
        some
        if sessions and np.isin(observations.target, some.target).all()
        else observations
    )
