"""Where the robot stands and where its targets sit, roughly and from nothing: the start of every fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import NOT_TURNED
from elastocal.fitting.model import Estimate
from elastocal.fitting.observations import sample_of
from elastocal.mechanics.kinematics import poses_of_points

if TYPE_CHECKING:
    from elastocal.fitting.model import Model
    from elastocal.fitting.observations import Observations

# Of more observations than this a sample tells where a fit starts.
_MOST = 5_000
_ROUNDS = 200
_SETTLED_M = 1e-9


def registered(model: Model, observations: Observations) -> Estimate:
    """Frames and targets of a model that its nominal kinematics explain best, by alternating closed-form steps.

    Block coordinate descent: frames by the Kabsch algorithm [1] for Wahba's problem [2], given the targets; positions of
    targets as means, given the frames. The turn of a target is the chordal mean of rotations [3].

    Returns with all effects at zero, except that joint compliances start at their nominal values.

    [1] Kabsch, W., A solution for the best rotation to relate two sets of vectors, Acta Crystallographica A32, 1976.
    [2] Wahba, G., A least squares estimate of satellite attitude, SIAM Review 7, 1965.
    [3] Markley, F. L., Cheng, Y., Crassidis, J. L. and Oshman, Y., Averaging quaternions, Journal of Guidance, Control, and
        Dynamics 30, 2007.
    """
    observations = sample_of(observations, _MOST)
    return registered_to(model, observations, *nominal_poses(model, observations))


def nominal_poses(model: Model, observations: Observations) -> tuple[np.ndarray, np.ndarray]:
    """Poses of the measuring points of some observations on the nominal robot without loads.

    `observations`: M of them. Returns `position` (M, 3): m, base axes; `rotation` (M, 3, 3).
    """
    chain, states = model.sites.chain, observations.states
    points = [chain.point(target.point) for target in model.targets]
    position, rotation = poses_of_points(chain, chain.at(states.joint_angles), points)
    seen = observations.target, observations.state
    return position[seen], rotation[seen]


def registered_to(
    model: Model, observations: Observations, nominal_position: np.ndarray, nominal_rotation: np.ndarray
) -> Estimate:
    """As `registered`, to nominal poses that are known.

    `nominal_position`, `nominal_rotation` (M, 3), (M, 3, 3): of them, as by `nominal_poses`.
    """
    states = observations.states
    sessions = np.unique(states.session)
    session = np.searchsorted(sessions, states.session[observations.state])
    frames = np.tile(np.eye(3), (len(sessions), 1, 1)), np.zeros((len(sessions), 3))
    offsets = np.array([target.offset_m or (0.0, 0.0, 0.0) for target in model.targets], float)
    seen = np.flatnonzero(np.bincount(observations.target, minlength=len(model.targets))).tolist()
    # A target may have all of its measurements among those held out.
    unknown = [index for index in seen if model.targets[index].offset_m is None]
    pairs = {
        (int(number), index): _Sums(nominal_position[mask], nominal_rotation[mask], observations.position[mask])
        for number in np.unique(session)
        for index in seen
        if (mask := (session == number) & (observations.target == index)).any()
    }
    for _ in range(_ROUNDS if model.fitted_frames and unknown else 1):
        if model.fitted_frames:
            frames = _frames(pairs, offsets, len(sessions))
        before = offsets.copy()
        for index in unknown:
            mine = [(sums, *(part[number] for part in frames)) for (number, target), sums in pairs.items() if target == index]
            offsets[index] = sum(sums.local(*frame) for sums, *frame in mine) / sum(sums.count for sums, *_ in mine)
        if np.abs(offsets - before).max() < _SETTLED_M:
            break
    turns = Rotation.from_rotvec([target.rotation or NOT_TURNED for target in model.targets]).as_matrix()
    if observations.rotation is not None:
        turned = frames[0][session].transpose(0, 2, 1) @ observations.rotation
        for index in (index for index in seen if model.targets[index].rotation is None):
            mask = observations.target == index
            turns[index] = Rotation.from_matrix(nominal_rotation[mask].transpose(0, 2, 1) @ turned[mask]).mean().as_matrix()
    nothing = Estimate(tuple(sessions.tolist()), *frames, offsets, turns).with_effects(model.effects)
    start = [
        model.nominal_compliance.copy() if effect.effect == "joint_compliance" else values
        for effect, values in zip(model.effects, nothing.coefficients, strict=True)
    ]
    return Estimate(nothing.sessions, *frames, offsets, turns, tuple(start), nothing.shapes)


class _Sums:
    """What rounds need of the measurements of one target in one session, whose number does not matter then.

    `position` (N, 3): p, of the nominal measuring point. `rotation` (N, 3, 3): R, of the same. `measured` (N, 3): y.
    """

    def __init__(self, position: np.ndarray, rotation: np.ndarray, measured: np.ndarray) -> None:
        self.count, self.measured = len(position), measured.mean(axis=0)
        self.position, self.rotation = position.mean(axis=0), rotation.mean(axis=0)
        # About the means, so that nothing cancels.
        off = measured - self.measured
        self.with_position = off.T @ (position - self.position)
        self.with_rotation = np.tensordot(off, rotation - self.rotation, (0, 0))
        self.backwards = np.einsum("nik,ni->k", rotation, position)

    def placed(self, offset: np.ndarray) -> np.ndarray:
        """Mean of p + R o, (3,)."""
        return self.position + self.rotation @ offset

    def across(self, offset: np.ndarray) -> np.ndarray:
        """Sum of y (p + R o)' about the means of both, (3, 3)."""
        return self.with_position + self.with_rotation @ offset

    def local(self, turn: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Sum of R' (F' (y - t) - p) with a frame's F and t, (3,)."""
        mean = self.count * self.rotation.T @ (turn.T @ (self.measured - shift))
        # As tensordot would, bit by bit, which takes most of a round to prepare.
        return turn.reshape(1, 9).dot(self.with_rotation.reshape(9, 3))[0] + mean - self.backwards


def _frames(pairs: dict[tuple[int, int], _Sums], offsets: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    for number in range(count):
        mine = [(sums, offsets[target]) for (session, target), sums in pairs.items() if session == number]
        counts = np.array([sums.count for sums, _ in mine])
        each, measured = np.array([sums.placed(o) for sums, o in mine]), np.array([sums.measured for sums, _ in mine])
        centre, seen = counts @ each / counts.sum(), counts @ measured / counts.sum()
        across = sum(sums.across(o) for sums, o in mine) + (counts[:, None] * (measured - seen)).T @ (each - centre)
        left, _, right = np.linalg.svd(across)
        left[:, -1] *= np.sign(np.linalg.det(left @ right))
        rotation[number] = left @ right
        position[number] = seen - rotation[number] @ centre
    return rotation, position
