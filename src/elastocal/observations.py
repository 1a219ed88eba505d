"""Readings as the loop uses them: repeats averaged, grouped by the state of the robot in which they were taken."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

# Readings this many times as far from the middle of their repeats as half of all are not noise: eight standard deviations.
_WILD = 12.0


@dataclass(frozen=True)
class States:
    """Each pose, load and sense of approach once; arrays of S.

    Attributes
    ----------
    session, pose, load : ndarray (S,)
    joint_angles : ndarray (S, n)
        rad.
    wrench : ndarray (S, 6)
        N, N m, at the origin of the last measuring point, base axes.
    repeats : ndarray (S,)
        How many approaches were averaged.
    approach : ndarray (S, n) or None
        Sense in which each joint was approached, -1, 0, +1.
    time_s, temperature_c : ndarray (S,) or None
    row : ndarray (S,) or None
        First row of the file that belongs to the state.
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

    def __len__(self):
        return len(self.pose)


@dataclass(frozen=True)
class Observations:
    """One averaged reading of one target in one state; M of them, in the order of the states.

    Attributes
    ----------
    states : States
    state, target : ndarray (M,)
        Index of the state and of the target.
    position : ndarray (M, 3)
        m, in the frame of the session.
    rotation : ndarray (M, 3, 3) or None
        Measured orientation, where poses are measured.
    """

    states: States
    state: np.ndarray
    target: np.ndarray
    position: np.ndarray
    rotation: np.ndarray | None

    def __len__(self):
        return len(self.state)

    @property
    def rows(self):
        """Numbers in one observation: 3 for a position, 6 for a pose."""
        return 3 if self.rotation is None else 6

    @property
    def cluster(self):
        """ndarray (M,): number of the (session, pose) that each observation belongs to, 0 .. P-1."""
        return state_clusters(self.states)[self.state]


def state_clusters(states):
    """Number of the (session, pose) of each state, 0 .. P-1.

    Parameters
    ----------
    states : States or Readings
        Of readings, that of each reading.

    Returns
    -------
    ndarray (S,)
    """
    return np.unique(np.column_stack([states.session, states.pose]), axis=0, return_inverse=True)[1].ravel()


def averaged(readings):
    """Observations with the repeats averaged that were approached alike.

    Parameters
    ----------
    readings : Readings
        Of `campaign`.

    Returns
    -------
    Observations
    """
    return _observations(readings, _approached_alike(readings))


def each_approach(readings):
    """Observations of every single approach: repeats are states of their own.

    Parameters
    ----------
    readings : Readings

    Returns
    -------
    observations : Observations
    repeated : ndarray (S,)
        Number of the state that would hold this approach if repeats were averaged.
    """
    key = _approached_alike(readings)
    observations = _observations(readings, np.column_stack([key, readings.repeat]))
    unique = np.unique(np.column_stack([key, readings.repeat]), axis=0)
    return observations, np.unique(unique[:, :-1], axis=0, return_inverse=True)[1].ravel()


def without_wild_repeats(readings):
    """Readings without those that are far from the other repeats of their state and target.

    A wild one would be taken for noise, and would move the mean of its repeats. Of two repeats nothing tells which is wild.

    Parameters
    ----------
    readings : Readings

    Returns
    -------
    Readings
    """
    group = np.unique(np.column_stack([_approached_alike(readings), readings.target]), axis=0, return_inverse=True)[1].ravel()
    off = np.abs(readings.position - _medians(readings.position, group)[group])
    telling = np.bincount(group)[group] > 2
    if not telling.any():
        return readings
    apart = off[telling]
    # The middle one of an odd number is not off at all, and tells nothing of the others.
    usual = np.median(apart[apart > 0]) if apart.any() else 0.0
    return readings.select(np.flatnonzero(~(telling & (off > _WILD * usual).any(axis=1))))


def _medians(values, group):
    """Median of each column in each group, ndarray (G, k)."""
    count = np.bincount(group)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    rising = np.column_stack([column[np.lexsort((column, group))] for column in values.T])
    return 0.5 * (rising[start + (count - 1) // 2] + rising[start + count // 2])


def _approached_alike(readings):
    key = np.column_stack([readings.session, readings.pose, readings.load])
    return key if readings.approach is None else np.column_stack([key, readings.approach])


def _observations(readings, key):
    _, first, state_of = np.unique(key, axis=0, return_index=True, return_inverse=True)
    state_of = state_of.ravel()
    pairs, pair_of = np.unique(np.column_stack([state_of, readings.target]), axis=0, return_inverse=True)
    pair_of = pair_of.ravel()

    def of_states(values):
        return None if values is None else _means(values, state_of)

    repeats = np.full(len(first), len(readings))
    np.minimum.at(repeats, pairs[:, 0], np.bincount(pair_of))
    first_row = readings.row[first].copy()
    np.minimum.at(first_row, state_of, readings.row)
    states = States(
        session=readings.session[first],
        pose=readings.pose[first],
        load=readings.load[first],
        joint_angles=of_states(readings.joint_angles),
        wrench=of_states(readings.wrench),
        repeats=repeats,
        approach=None if readings.approach is None else readings.approach[first],
        time_s=of_states(readings.time_s),
        temperature_c=of_states(readings.temperature_c),
        row=first_row,
    )
    rotation = None
    if readings.rotation_vector is not None:
        rotation = _mean_rotations(Rotation.from_rotvec(readings.rotation_vector), pair_of)
    return Observations(states, pairs[:, 0], pairs[:, 1], _means(readings.position, pair_of), rotation)


def select_states(observations, kept):
    """The part of some observations that was taken in some of their states.

    Parameters
    ----------
    observations : Observations
    kept : ndarray of bool (S,)

    Returns
    -------
    Observations
    """
    states = States(
        **{name: None if value is None else value[kept] for name, value in vars(observations.states).items()},
    )
    mask = kept[observations.state]
    number = np.cumsum(kept) - 1
    rotation = None if observations.rotation is None else observations.rotation[mask]
    return Observations(
        states, number[observations.state[mask]], observations.target[mask], observations.position[mask], rotation
    )


def _means(values, group):
    count = np.bincount(group)
    total = np.zeros((len(count), *values.shape[1:]))
    np.add.at(total, group, values)
    return total / count.reshape(-1, *[1] * (values.ndim - 1))


def _mean_rotations(rotations, group):
    """Mean of rotations close to each other: the mean turn from the first of each group."""
    first = np.unique(group, return_index=True)[1]
    reference = rotations[first]
    turns = (rotations * reference[group].inv()).as_rotvec()
    return (Rotation.from_rotvec(_means(turns, group)) * reference).as_matrix()
