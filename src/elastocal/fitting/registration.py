"""Where the robot stands and where its targets sit, roughly and from nothing: the start of every fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.fitting.model import Estimate
from elastocal.fitting.observations import sample_of
from elastocal.mechanics.kinematics import poses

if TYPE_CHECKING:
    from elastocal.fitting.model import Model
    from elastocal.fitting.observations import Observations

# Of more observations than this a sample tells where a fit starts.
_MOST = 5_000
_ROUNDS = 200
_SETTLED_M = 1e-9


def registered(model: Model, observations: Observations) -> Estimate:
    """Frames and targets of a model that its nominal kinematics explain best, by alternating closed-form steps.

    Block coordinate descent: frames by the Kabsch algorithm [1]_ for Wahba's problem [2]_, given the targets; positions of
    targets as means, given the frames. The turn of a target is the chordal mean of rotations [3]_.

    Parameters
    ----------
    model : Model
    observations : Observations

    Returns
    -------
    Estimate
        With all effects at zero, except that joint compliances start at their nominal values.

    References
    ----------
    .. [1] Kabsch, W., A solution for the best rotation to relate two sets of vectors, Acta Crystallographica A32, 1976.
    .. [2] Wahba, G., A least squares estimate of satellite attitude, SIAM Review 7, 1965.
    .. [3] Markley, F. L., Cheng, Y., Crassidis, J. L. and Oshman, Y., Averaging quaternions, Journal of Guidance, Control, and
       Dynamics 30, 2007.
    """
    observations = sample_of(observations, _MOST)
    chain, states = model.sites.chain, observations.states
    coordinates = np.zeros((len(states), chain.coordinates))
    coordinates[:, : model.sites.joints] = states.joint_angles
    nominal_position, nominal_rotation = np.empty((len(observations), 3)), np.empty((len(observations), 3, 3))
    for index, target in enumerate(model.targets):
        mask = observations.target == index
        found = poses(chain, coordinates[observations.state[mask]], chain.point(target.point))
        nominal_position[mask], nominal_rotation[mask] = found
    sessions = np.unique(states.session)
    session = np.searchsorted(sessions, states.session[observations.state])
    frames = np.tile(np.eye(3), (len(sessions), 1, 1)), np.zeros((len(sessions), 3))
    offsets = np.array([target.offset_m or (0.0, 0.0, 0.0) for target in model.targets], float)
    seen = set(observations.target.tolist())
    # A target may have all of its measurements among those held out.
    unknown = [index for index, target in enumerate(model.targets) if target.offset_m is None and index in seen]
    for _ in range(_ROUNDS if model.fitted_frames and unknown else 1):
        placed = nominal_position + (nominal_rotation @ offsets[observations.target][..., None])[..., 0]
        if model.fitted_frames:
            frames = _frames(placed, observations.position, session, len(sessions))
        in_base = _into_base(frames, session, observations.position - frames[1][session])
        before = offsets.copy()
        for index in unknown:
            mask = observations.target == index
            local = nominal_rotation[mask].transpose(0, 2, 1) @ (in_base[mask] - nominal_position[mask])[..., None]
            offsets[index] = local[..., 0].mean(axis=0)
        if np.abs(offsets - before).max() < _SETTLED_M:
            break
    turns = np.tile(np.eye(3), (len(model.targets), 1, 1))
    if observations.rotation is not None:
        turned = frames[0][session].transpose(0, 2, 1) @ observations.rotation
        for index in unknown:
            mask = observations.target == index
            turns[index] = Rotation.from_matrix(nominal_rotation[mask].transpose(0, 2, 1) @ turned[mask]).mean().as_matrix()
    nothing = Estimate(tuple(sessions.tolist()), *frames, offsets, turns).with_effects(model.effects)
    start = [
        model.nominal_compliance.copy() if effect.effect == "joint_compliance" else values
        for effect, values in zip(model.effects, nothing.coefficients, strict=True)
    ]
    return Estimate(nothing.sessions, *frames, offsets, turns, tuple(start), nothing.shapes)


def _frames(placed: np.ndarray, measured: np.ndarray, session: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    for number in range(count):
        mask = session == number
        centre, seen = placed[mask].mean(axis=0), measured[mask].mean(axis=0)
        rotation[number] = Rotation.align_vectors(measured[mask] - seen, placed[mask] - centre)[0].as_matrix()
        position[number] = seen - rotation[number] @ centre
    return rotation, position


def _into_base(frames: tuple[np.ndarray, np.ndarray], session: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return (frames[0][session].transpose(0, 2, 1) @ vectors[..., None])[..., 0]
