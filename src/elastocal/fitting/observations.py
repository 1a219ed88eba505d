"""Observations: measurements averaged over repeats and grouped by robot state.

A state is one pose under one load, approached in one sense. Every fit uses observations
instead of the rows of the measurements file.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import average_by_group, group_equal_rows

if TYPE_CHECKING:
    from typing import Any

    from elastocal.campaigns.campaign import Measurements

# A repeat is an outlier if its distance from the median of its repeats exceeds this
# many times the median distance: eight standard deviations of normal noise.
_OUTLIER_RATIO = 12.0
# Upper bound on the number of sensitivities that one block of observations has. There
# are five copies of them, and larger blocks do not fit into the processor's cache.
_MAX_SENSITIVITIES = 2_000_000
_MAX_BLOCK_SIZE = 4000
# Linearizing takes as much memory as this many parameters, even without parameters.
_MIN_COLUMNS = 60


@dataclass(frozen=True)
class States:
    """Robot states: each pose, load and sense of approach once.

    Attributes
    ----------
    session, pose, load : (S,) int arrays
    joint_angles : (S, n) array, rad
    wrench : (S, 6) array, N and N m, at the origin of the last measuring point, base
        axes
    repeats : (S,) int array, number of approaches that were averaged
    approach : (S, n) array, sense in which each joint was approached, -1, 0 or +1
    time_s, temperature_c : (S,) arrays
    row : (S,) int array, first row of the measurements file that belongs to the state
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

    def select(self, chosen: np.ndarray | slice) -> States:
        """Select some of the states, in any order and any number of times."""
        columns: dict[str, Any] = {
            name: None if values is None else values[chosen]
            for name, values in vars(self).items()
        }
        return States(**columns)


@dataclass(frozen=True)
class Observations:
    """M averaged measurements, each of one target in one state, in the order of states.

    Attributes
    ----------
    states : States
    state, target : (M,) int arrays, indices of the state and of the target
    position : (M, 3) array, m, in the frame of the session
    rotation : (M, 3, 3) array, measured orientation; None if positions are measured
    channel : (M,) int array, see `Measurements`; None if everything is the position or
        pose of a target. If it is not, `position` (M, 1) or (M, 3) and `rotation` hold
        the numbers of the kind.
    spread : (M,) array, standard deviation of each observation over that of the noise;
        None if they are alike
    """

    states: States
    state: np.ndarray
    target: np.ndarray
    position: np.ndarray
    rotation: np.ndarray | None
    channel: np.ndarray | None = None
    spread: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.state)

    @property
    def rows(self) -> int:
        """Numbers in one observation: 3 for a position, 6 for a pose, or 1."""
        width = self.position.shape[1]
        return 6 if width == 3 and self.rotation is not None else width

    @property
    def cluster(self) -> np.ndarray:
        """Index 0 .. P-1 of the (session, pose) of each observation, (M,) array."""
        return index_poses(self.states)[self.state]


class Block(NamedTuple):
    """Consecutive observations of whole poses.

    `states` and `indices` are the slices of the block in the states and the
    observations that it was taken from; `observations` are its own.
    """

    states: slice
    indices: slice
    observations: Observations


def index_poses(states: States | Measurements) -> np.ndarray:
    """Number the (session, pose) of each state from 0 to P-1, (S,) array."""
    return group_equal_rows(np.column_stack([states.session, states.pose]))[1]


def batch_groups_by_size(group: np.ndarray) -> list[np.ndarray]:
    """Find the members of each group, stacked over all groups of the same size.

    `group` (M,) holds the group number of each member, such as the state or the pose of
    an observation. For each size k that occurs, the result has a (G, k) array of member
    indices. Groups are in the order of their numbers, indices in a group ascend.
    """
    order = np.argsort(group, kind="stable")
    sizes = np.bincount(group)
    start = np.cumsum(sizes) - sizes
    return [
        order[start[sizes == size][:, None] + np.arange(size)]
        for size in np.unique(sizes[sizes > 0])
    ]


def average_repeats(measurements: Measurements) -> Observations:
    """Average the repeats of each state and target."""
    return _average_equal_keys(measurements, _state_keys(measurements))


def separate_approaches(measurements: Measurements) -> tuple[Observations, np.ndarray]:
    """Make a state of every single approach.

    Returns
    -------
    Observations
    (S,) int array, index that each state would have if repeats were averaged
    """
    key = _state_keys(measurements)
    approach_key = np.column_stack([key, measurements.repeat])
    first = group_equal_rows(approach_key)[0]
    return _average_equal_keys(measurements, approach_key), group_equal_rows(
        key[first]
    )[1]


def separate_measurements(measurements: Measurements) -> Observations:
    """Make an observation and a state of every measurement, in their order."""
    count = len(measurements)
    names = [field.name for field in fields(States) if field.name != "repeats"]
    states = States(
        **{name: getattr(measurements, name) for name in names},
        repeats=np.ones(count, int),
    )
    rotation = None
    if measurements.rotation_vector is not None:
        rotation = Rotation.from_rotvec(measurements.rotation_vector).as_matrix()
    return Observations(
        states,
        np.arange(count),
        measurements.target,
        measurements.position,
        rotation,
        measurements.channel,
        measurements.spread,
    )


def remove_outlying_repeats(measurements: Measurements) -> Measurements:
    """Remove measurements that are far from the other repeats of their state and target.

    Hampel's identifier: distances from the median, here in units of the median absolute
    deviation of all repeats. An outlier would count as noise and would move the mean of
    its repeats. Of only two repeats it is unknown which one is the outlier, so both
    stay.

    References
    ----------
    Davies and Gather, J. Am. Stat. Assoc. 88, 1993.
    """
    group = group_equal_rows(_state_and_target_keys(measurements))[1]
    count = np.bincount(group)
    repeated = count[group] > 2
    if not repeated.any():
        return measurements
    start = np.cumsum(count) - count
    ascending = np.column_stack(
        [column[np.lexsort((column, group))] for column in measurements.position.T]
    )
    lower_middle = ascending[start + (count - 1) // 2]
    upper_middle = ascending[start + count // 2]
    medians = 0.5 * (lower_middle + upper_middle)
    distance = np.abs(measurements.position - medians[group])
    # The median of an odd number of repeats is one of them. Its distance of zero says
    # nothing about the scatter of the others.
    nonzero = distance[repeated[:, None] & (distance > 0)]
    median_distance = np.median(nonzero) if nonzero.size else 0.0
    outlier = repeated & (distance > _OUTLIER_RATIO * median_distance).any(axis=1)
    return measurements.select(np.flatnonzero(~outlier))


def match_states_and_targets(
    measured: Measurements | Observations,
    reference: Measurements | Observations,
    chosen: np.ndarray,
) -> np.ndarray:
    """Find measurements with the state and target of chosen reference measurements.

    Parameters
    ----------
    measured : N measurements or observations
    reference : R measurements or observations
    chosen : indices or (R,) bool array, the reference measurements to look for

    Returns
    -------
    (N,) bool array
    """
    keys = _state_and_target_keys(measured)
    reference_keys = _state_and_target_keys(reference)
    group = group_equal_rows(np.concatenate([keys, reference_keys]))[1]
    return np.isin(group[: len(keys)], group[len(keys) :][chosen])


def _state_and_target_keys(measured: Measurements | Observations) -> np.ndarray:
    """Rows (N, k) of integers, equal where state and target are equal."""
    if isinstance(measured, Observations):
        keys = _state_keys(measured.states)[measured.state]
    else:
        keys = _state_keys(measured)
    return np.column_stack([keys, *_target_keys(measured)])


def _target_keys(measured: Measurements | Observations) -> list[np.ndarray]:
    """Columns (N,) of integers, equal where target and channel are."""
    if measured.channel is None:
        return [measured.target]
    return [measured.target, measured.channel]


def _state_keys(measured: Measurements | States) -> np.ndarray:
    """Rows (N, k) of integers, equal where session, pose, load and approach are."""
    columns = [measured.session, measured.pose, measured.load]
    if measured.approach is not None:
        columns.append(measured.approach)
    return np.column_stack(columns)


def _average_equal_keys(measurements: Measurements, key: np.ndarray) -> Observations:
    """Average the measurements of each target in each state.

    Measurements are of the same state if their rows of `key` (N, k) are equal.
    """
    first, state_of = group_equal_rows(key)
    pairs = np.column_stack([state_of, *_target_keys(measurements)])
    first_of_pair, pair_of = group_equal_rows(pairs)
    state, target = pairs[first_of_pair, :2].T
    repeats = np.full(len(first), len(measurements))
    np.minimum.at(repeats, state, np.bincount(pair_of))
    row = measurements.row[first].copy()
    np.minimum.at(row, state_of, measurements.row)
    optional = {}
    if measurements.approach is not None:
        optional["approach"] = measurements.approach[first]
    for name in ("time_s", "temperature_c"):
        values = getattr(measurements, name)
        if values is not None:
            optional[name] = average_by_group(values, state_of)
    states = States(
        measurements.session[first],
        measurements.pose[first],
        measurements.load[first],
        average_by_group(measurements.joint_angles, state_of),
        average_by_group(measurements.wrench, state_of),
        repeats,
        row=row,
        **optional,
    )
    rotation = None
    if measurements.rotation_vector is not None:
        rotation = _mean_rotations(
            Rotation.from_rotvec(measurements.rotation_vector), first_of_pair, pair_of
        )
    averaged = Observations(
        states,
        state,
        target,
        average_by_group(measurements.position, pair_of),
        rotation,
    )
    if measurements.channel is None:
        return averaged
    first = first_of_pair
    averaged = replace(averaged, channel=measurements.channel[first])
    if measurements.spread is None:
        return averaged
    return replace(averaged, spread=measurements.spread[first])


def _mean_rotations(
    rotations: Rotation, first: np.ndarray, group: np.ndarray
) -> np.ndarray:
    """Mean rotation matrix (G, 3, 3) of each group, given its first member (G,).

    The rotations of a group are close to each other. Their mean is the first one,
    turned by the mean rotation vector from it: a step towards the Riemannian mean
    (Moakher 2002).
    """
    mean = rotations[first]
    if len(first) < len(group):
        from_first = (rotations * mean[group].inv()).as_rotvec()
        mean = Rotation.from_rotvec(average_by_group(from_first, group)) * mean
    return mean.as_matrix()


def select_states(observations: Observations, kept: np.ndarray) -> Observations:
    """Select the observations of some states, given as (S,) bool array."""
    new_number = np.cumsum(kept) - 1
    return _select(observations, kept, kept[observations.state], new_number)


def split_into_blocks(observations: Observations, columns: int) -> list[Block]:
    """Split observations into blocks of whole poses whose sensitivities fit in memory.

    Parameters
    ----------
    observations : Observations
        Those of a pose are consecutive, as `average_repeats` returns them.
    columns : int
        Number of sensitivities to each component of an observation.

    Returns
    -------
    list of Block, in the order of the observations; one if all of them fit
    """
    width = observations.rows * max(columns, _MIN_COLUMNS)
    count = len(observations)
    states = len(observations.states)
    if width * count <= _MAX_SENSITIVITIES:
        return [Block(slice(0, states), slice(0, count), observations)]
    block_size = max(min(_MAX_SENSITIVITIES // width, _MAX_BLOCK_SIZE), 1)
    state_edges, edges = _find_block_edges(observations, block_size)
    number = np.arange(states)
    blocks = []
    for (begin, end), (first, last) in zip(
        pairwise(state_edges), pairwise(edges), strict=True
    ):
        states_of_block = slice(begin, end)
        indices = slice(first, last)
        part = _select(observations, states_of_block, indices, number - begin)
        blocks.append(Block(states_of_block, indices, part))
    return blocks


def _find_block_edges(
    observations: Observations, block_size: int
) -> tuple[list[int], list[int]]:
    """Find where blocks of about `block_size` observations begin and end, at whole poses.

    Returns the edges of the blocks among the states, and among the observations.
    """
    count = len(observations)
    pose_start = np.flatnonzero(np.diff(index_poses(observations.states), prepend=-1))
    observation_start = np.searchsorted(observations.state, pose_start)
    first_pose = np.unique(
        np.searchsorted(observation_start, np.arange(0, count, block_size)).clip(
            max=len(pose_start) - 1
        )
    )
    return (
        [*pose_start[first_pose].tolist(), len(observations.states)],
        [*observation_start[first_pose].tolist(), count],
    )


def _select(
    observations: Observations,
    states: np.ndarray | slice,
    indices: np.ndarray | slice,
    new_number: np.ndarray,
) -> Observations:
    """Select observations and the states that they belong to.

    `new_number` (S,) is the index of each old state among the selected ones.
    """
    rotation = observations.rotation
    channel = observations.channel
    spread = observations.spread
    return Observations(
        observations.states.select(states),
        new_number[observations.state[indices]],
        observations.target[indices],
        observations.position[indices],
        None if rotation is None else rotation[indices],
        None if channel is None else channel[indices],
        None if spread is None else spread[indices],
    )


def select_spread_poses(observations: Observations, size: int) -> np.ndarray:
    """Select poses evenly spread over a campaign that have about `size` observations.

    Returns a (S,) bool array of the states of these poses: all states if there are no
    more observations than that.
    """
    if len(observations) <= size:
        return np.ones(len(observations.states), bool)
    pose = index_poses(observations.states)
    poses = pose.max() + 1
    sample_size = max(int(poses * size / len(observations)), 2)
    chosen = np.zeros(poses, bool)
    chosen[np.linspace(0, poses - 1, sample_size).round().astype(int)] = True
    return chosen[pose]


def sample_observations(
    observations: Observations, size: int, like: Observations | None = None
) -> Observations:
    """Sample about `size` observations at poses that are spread over the campaign.

    Parameters
    ----------
    observations : Observations
    size : int
    like : Observations, optional
        Sample of the same campaign whose states are to be sampled.

    Returns
    -------
    Observations : all of them if the sample would miss a session or a target
    """
    if len(observations) <= size:
        return observations
    if like is None:
        chosen = select_spread_poses(observations, size)
    else:
        matching = match_states_and_targets(
            observations, like, np.ones(len(like), bool)
        )
        chosen = np.zeros(len(observations.states), bool)
        chosen[observations.state[matching]] = True
    sample = select_states(observations, chosen)
    sessions = np.isin(observations.states.session, sample.states.session)
    targets = np.isin(observations.target, sample.target)
    has_all = sessions.all() and targets.all()
    if observations.channel is not None and sample.channel is not None:
        has_all &= np.isin(observations.channel, sample.channel).all()
    return sample if has_all else observations
