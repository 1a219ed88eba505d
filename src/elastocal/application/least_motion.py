"""The path through candidate joint angles of each row along which the joints move least.

Chosen is a path without large steps if there is one, and among these the path along
which the joints move least, by dynamic programming (Viterbi's algorithm [1]).

[1] Forney, G. D., The Viterbi algorithm, Proceedings of the IEEE 61, 1973.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Rounding errors of joint angles at their limits (rad, or m).
JOINT_ROUNDING = 1e-9
# Weights of further costs of a path relative to its length: the excess of steps that are
# too large outweighs the length, the distance from the middle of the limits only decides
# between equal paths.
_EXCESS_WEIGHT = 1e4
_MIDDLE_WEIGHT = 1e-5
# Rows of a path whose costs are in memory at once.
_BLOCK = 512


@dataclass(frozen=True)
class PathCandidates:
    """Up to K postures of each of N rows, each with copies shifted by whole turns, and
    the cost of a path through them.

    Attributes
    ----------
    copies : for each joint, its angles (K, N, turns): the lowest one within the limits,
        and its copies shifted upwards by whole turns.
    limits : (n, 2), rad or m; copies above them are excluded.
    exclusion : (K, N) infinite if a row has fewer postures, else 0.
    allowed : (N - 1, n) largest steps without an additional cost, rad or m.
    """

    copies: list[np.ndarray]
    limits: np.ndarray
    exclusion: np.ndarray
    allowed: np.ndarray

    @property
    def turns(self) -> list[int]:
        """Number of copies of each joint."""
        return [copies.shape[-1] for copies in self.copies]

    def broadcast(self, values: np.ndarray, joint: int) -> np.ndarray:
        """Reshape values (..., turns) of a joint for arrays (..., turns of all
        joints)."""
        shape = [1] * len(self.copies)
        shape[joint] = self.turns[joint]
        return values.reshape(*values.shape[:-1], *shape)

    def split_rows(self) -> list[slice]:
        """Split all rows but the first one into blocks."""
        rows = self.exclusion.shape[1]
        starts = range(1, rows, _BLOCK)
        return [slice(start, min(start + _BLOCK, rows)) for start in starts]

    def motion_costs(self, rows: slice) -> list[np.ndarray]:
        """Costs of the steps of each joint to B rows, (B, K, K, turns, turns): postures
        of the row before and of this row, and the turns of both."""
        before = slice(rows.start - 1, rows.stop - 1)
        costs = []
        for joint, copies in enumerate(self.copies):
            start = copies[:, before].transpose(1, 0, 2)[:, :, None, :, None]
            end = copies[:, rows].transpose(1, 0, 2)[:, None, :, None, :]
            step = np.abs(start - end)
            allowed = self.allowed[before, joint].reshape(-1, 1, 1, 1, 1)
            excess = np.maximum(step - allowed, 0.0)
            costs.append(step + _EXCESS_WEIGHT * excess)
        return costs

    def posture_costs(self, rows: slice) -> np.ndarray:
        """Costs of the postures of B rows, (B, K, turns of all joints)."""
        exclusion = self.exclusion[:, rows].T
        costs = exclusion.reshape(*exclusion.shape, *[1] * len(self.copies))
        for joint, (low, high) in enumerate(self.limits):
            angles = self.copies[joint][:, rows].transpose(1, 0, 2)
            distance = _MIDDLE_WEIGHT * np.abs(angles - 0.5 * (low + high))
            joint_costs = np.where(angles > high + JOINT_ROUNDING, np.inf, distance)
            costs = costs + self.broadcast(joint_costs, joint)
        return costs


def find_least_motion(candidates: PathCandidates) -> np.ndarray:
    """Find the path with the least cost: first the excess of steps above the allowed
    ones, then the sum of all steps.

    Returns
    -------
    (N, n) angles of the chain, rad.
    """
    states = _find_smooth_path(candidates)
    if states is None:
        states = _find_least_excess(candidates)
    posture, *turns = states.T
    rows = np.arange(len(states))
    angles = [
        copies[posture, rows, turn]
        for copies, turn in zip(candidates.copies, turns, strict=True)
    ]
    return np.stack(angles, axis=1)


@dataclass(frozen=True)
class _SmoothSteps:
    """Steps between K postures of each of N rows that are as small as allowed.

    Attributes
    ----------
    lengths : (N - 1, K, K) sum of the steps of all joints from a posture of the row
        before to one of this row, rad and m; infinite if a step is too large.
    shifts : (N - 1, K, K, n) int, by how many turns the copy of each joint changes.
    is_unchanged : (N - 1,) bool, whether each posture can only stay the same, with the
        same turns.
    """

    lengths: np.ndarray
    shifts: np.ndarray
    is_unchanged: np.ndarray

    @classmethod
    def between(cls, candidates: PathCandidates) -> _SmoothSteps:
        """Find the steps, which have to be shorter than half a turn."""
        length = candidates.exclusion[:, :-1].T[:, :, None]
        length = length + candidates.exclusion[:, 1:].T[:, None, :]
        shifts = np.zeros((*length.shape, len(candidates.copies)), np.int8)
        for joint, count in enumerate(candidates.turns):
            lowest = candidates.copies[joint][..., 0].T
            difference = lowest[1:, None, :] - lowest[:-1, :, None]
            if count > 1:
                turns = -np.round(difference / (2 * np.pi))
                difference += 2 * np.pi * turns
                shifts[..., joint] = turns
            step = np.abs(difference)
            is_large = step > candidates.allowed[:, None, None, joint]
            is_beyond = np.abs(shifts[..., joint]) >= count
            length += np.where(is_large | is_beyond, np.inf, step)
        is_allowed = np.isfinite(length)
        is_changed = is_allowed & shifts.any(axis=-1)
        is_other = is_allowed & ~np.eye(length.shape[1], dtype=bool)
        return cls(length, shifts, ~(is_changed | is_other).any(axis=(1, 2)))


def _find_smooth_path(candidates: PathCandidates) -> np.ndarray | None:
    """Find the path with the least motion among those without large steps.

    Two postures determine by how many turns each joint changes between them if all steps
    are shorter than half a turn. All turns then take one operation.

    Returns
    -------
    (N, 1 + n) posture of each row, and the turn of each joint; None if there is no such
    path, or if steps of half a turn are allowed.
    """
    if candidates.allowed.size and candidates.allowed.max() >= np.pi:
        return None
    steps = _SmoothSteps.between(candidates)
    totals = _accumulate_smooth_steps(candidates, steps)
    if not np.isfinite(totals[-1]).any():
        return None
    states = np.empty((len(totals), totals[0].ndim), int)
    states[-1] = np.unravel_index(np.argmin(totals[-1]), totals[-1].shape)
    for row in range(len(totals) - 2, -1, -1):
        if steps.is_unchanged[row]:
            states[row] = states[row + 1]
            continue
        posture, *turns = states[row + 1]
        lengths = steps.lengths[row, :, posture]
        turns_before = np.array(turns) - steps.shifts[row, :, posture]
        states[row] = _find_state_before(totals[row], lengths, turns_before)
    return states


def _accumulate_smooth_steps(
    candidates: PathCandidates, steps: _SmoothSteps
) -> list[np.ndarray]:
    """Accumulate the least cost of a path by such steps from the first row to each
    posture of each row, (K, turns of all joints)."""
    posture_axis = (slice(None), *[None] * len(candidates.copies))
    totals = [candidates.posture_costs(slice(0, 1))[0]]
    for rows in candidates.split_rows():
        for step, posture_cost in enumerate(
            candidates.posture_costs(rows), rows.start - 1
        ):
            lengths = steps.lengths[step]
            if steps.is_unchanged[step]:
                total = totals[-1] + np.diagonal(lengths)[posture_axis]
            else:
                total = _step_to_postures(totals[-1], lengths, steps.shifts[step])
            totals.append(total + posture_cost)
    return totals


def _step_to_postures(
    total: np.ndarray, lengths: np.ndarray, shifts: np.ndarray
) -> np.ndarray:
    """Compute the least cost (K, turns of all joints) of a path to each posture of a row
    from that of the row before."""
    reached = np.full_like(total, np.inf)
    for before, after in np.argwhere(np.isfinite(lengths)):
        start = [before]
        end = [after]
        for shift, count in zip(
            shifts[before, after].tolist(), total.shape[1:], strict=True
        ):
            start.append(slice(max(-shift, 0), count - max(shift, 0)))
            end.append(slice(max(shift, 0), count - max(-shift, 0)))
        cost = total[tuple(start)] + lengths[before, after]
        np.minimum(reached[tuple(end)], cost, out=reached[tuple(end)])
    return reached


def _find_state_before(
    total: np.ndarray, lengths: np.ndarray, turns: np.ndarray
) -> tuple[int, ...]:
    """Find the posture and the turns of the row before from which a path comes, among K
    postures with their turns (K, n)."""
    count = total.shape[1:]
    is_possible = np.isfinite(lengths) & ((turns >= 0) & (turns < count)).all(axis=1)
    states = [
        (posture, *turns[posture].tolist()) for posture in np.flatnonzero(is_possible)
    ]
    return min(states, key=lambda state: total[state] + lengths[state[0]])


def _find_least_excess(candidates: PathCandidates) -> np.ndarray:
    """Find the path with the least cost: first the excess of steps above the allowed
    ones, then the sum of all steps.

    The cost is a sum over joints, so the best turns of each joint are found separately:
    with two turns each, the 2^n copies of a posture take 2 n operations.

    Returns
    -------
    (N, 1 + n) posture of each row, and the turn of each joint.
    """
    totals = _accumulate_costs(candidates)
    # The posture of each row, and the turn of each joint.
    states = np.empty((len(totals), 1 + len(candidates.copies)), int)
    states[-1] = np.unravel_index(np.argmin(totals[-1]), totals[-1].shape)
    for rows in reversed(candidates.split_rows()):
        motion = candidates.motion_costs(rows)
        for row in range(rows.stop - 1, rows.start - 1, -1):
            posture, *turns = states[row]
            total = totals[row - 1]
            for joint, turn in enumerate(turns):
                cost = motion[joint][row - rows.start, :, posture, :, turn]
                total = total + candidates.broadcast(cost, joint)
            states[row - 1] = np.unravel_index(np.argmin(total), total.shape)
    return states


def _accumulate_costs(candidates: PathCandidates) -> list[np.ndarray]:
    """Accumulate the least cost of a path from the first row to each posture of each
    row, (K, turns of all joints)."""
    joints = len(candidates.copies)
    totals = [candidates.posture_costs(slice(0, 1))[0]]
    for rows in candidates.split_rows():
        posture_costs = candidates.posture_costs(rows)
        # Axes: rows, K of the row before, K, turns of all joints. The first axis of turns
        # belongs to the row before. Minimising over it appends the axis of this row, so
        # after all joints the axes of turns belong to this row.
        motion_costs = [
            np.expand_dims(costs, tuple(range(4, joints + 3)))
            for costs in candidates.motion_costs(rows)
        ]
        for row, posture_cost in enumerate(posture_costs):
            cost = totals[-1][:, None]
            for motion_cost in motion_costs:
                cost = (cost[..., None] + motion_cost[row]).min(axis=2)
            totals.append(cost.min(axis=0) + posture_cost)
    return totals
