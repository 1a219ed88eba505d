"""The next experiment: poses, loads and measuring points that best tell apart what these data cannot."""

from dataclasses import dataclass, replace

import numpy as np

from elastocal.campaign import Target
from elastocal.model import circumstances, effect_columns, linearize
from elastocal.observations import Observations, States
from elastocal.selection import without
from elastocal.whitening import whitening

_POOL = 300
_RIVALS = 5
_REPEATS = 1
# Against rounding where a rival makes only what the model makes.
_RIDGE = 1e-9


@dataclass(frozen=True)
class Proposal:
    """States to measure next, in the order of their worth; arrays of E.

    Attributes
    ----------
    joint_angles : ndarray (E, n)
        rad.
    wrench : ndarray (E, 6)
        N, N m, at the last measuring point, base axes.
    point : tuple of str
        Measuring point to put a target on; several, with spaces between, where targets are read together.
    separation : ndarray (E,)
        Smallest non-centrality between what was found and a rival, after this state and all before it.
    present : float
        The same with the present data alone.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
    point: tuple
    separation: np.ndarray
    present: float


def propose(final, attribution, observations, candidates, joint_limits, count, stream, ladder=None):
    """Choose states one by one, each the one that most raises the smallest separation from the alternatives.

    Parameters
    ----------
    final : Fit
        With all effects found.
    attribution : Attribution
        With at least one alternative.
    observations : Observations
    candidates : dict of str to Candidate
    joint_limits : ndarray (n, 2)
        rad; poses are drawn within.
    count : int
        States to choose.
    stream : numpy.random.Generator
    ladder : tuple of float, optional
        Shares of a load at which each pose is read, at all targets of the campaign. What is chosen are then poses, none twice,
        each with the load at the share 1; without, readings of one target under one load, which may be on a measuring point
        that has no target yet.

    Returns
    -------
    Proposal
    """
    bare = without(final, {member.key for member in attribution.members}, observations)
    model, estimate = _with_targets_everywhere(bare) if ladder is None else (bare.model, bare.estimate)
    drawn = _drawn(observations.states, joint_limits, ladder is not None, stream)
    pool = _pool(model, observations.states, estimate.sessions[0], drawn, ladder, stream)
    rivals = [
        (candidates[key], [shape.start for shape in candidates[key].shapes]) for key in attribution.alternatives[:_RIVALS]
    ]
    here = _rows(bare.model, bare.estimate, bare, final, attribution.members, rivals, observations)
    there = _rows(model, estimate, bare, final, attribution.members, rivals, pool)
    entries = len(pool.target) if ladder is None else _POOL
    contests = [
        (_Information.of(mine.reshape(-1, mine.shape[-1])), _compressed(more.reshape(entries, -1, more.shape[-1])))
        for mine, more in zip(here, there, strict=True)
    ]
    before = min(information.separation for information, _ in contests)
    chosen, separations = [], []
    for _ in range(count):
        worst = np.min([information.separation + information.gains(there) for information, there in contests], axis=0)
        worst[chosen] = -np.inf
        best = int(np.argmax(worst))
        chosen.append(best)
        separations.append(worst[best])
        contests = [(information.with_rows(there[best]), there) for information, there in contests]
    angles, wrench = drawn
    poses = np.array(chosen) // (entries // _POOL)
    names = [target.point for target in model.targets]
    together = " ".join(dict.fromkeys(names))
    points = tuple(names[pool.target[index]] if ladder is None else together for index in chosen)
    return Proposal(angles[poses], wrench[poses], points, np.array(separations), before)


def _with_targets_everywhere(fitted):
    """Model and estimate with one more target at each measuring point that has none yet."""
    chain, targets = fitted.model.sites.chain, fitted.model.targets
    bare = [point.name for point in chain.points if point.name not in {target.point for target in targets}]
    added = tuple(Target(name, name, (0.0, 0.0, 0.0)) for name in bare)
    offsets = np.concatenate([fitted.estimate.target_offset, np.zeros((len(added), 3))])
    turns = np.concatenate([fitted.estimate.target_rotation, np.tile(np.eye(3), (len(added), 1, 1))])
    estimate = replace(fitted.estimate, target_offset=offsets, target_rotation=turns)
    return replace(fitted.model, targets=(*targets, *added)), estimate


def _drawn(states, joint_limits, only_largest, stream):
    """Random poses under loads of the campaign or their opposites: angles (E, n) and wrenches (E, 6)."""
    low, high = np.clip(joint_limits, -np.pi, np.pi).T
    angles = low + (high - low) * stream.random((_POOL, len(low)))
    force = np.linalg.norm(states.wrench[:, :3], axis=1)
    loads = states.wrench[force >= np.median(force[force > 0])] if only_largest and force.any() else states.wrench
    return angles, loads[stream.integers(0, len(loads), _POOL)] * stream.choice([-1.0, 1.0], (_POOL, 1))


def _pool(model, states, session, drawn, ladder, stream):
    """Readings of each pose drawn: at every target in turn, or at all of them under each share of its load."""
    (angles, wrench), count = drawn, len(model.targets)
    shares = np.ones(count) if ladder is None else np.array(ladder)
    size = _POOL * len(shares)
    warmth = None if states.temperature_c is None else np.full(size, states.temperature_c.mean())
    loaded = States(
        np.full(size, session),
        np.arange(size),
        np.ones(size, int),
        np.repeat(angles, len(shares), axis=0),
        (wrench[:, None] * shares[:, None]).reshape(size, -1),
        np.full(size, _REPEATS),
        None if states.approach is None else stream.choice([-1.0, 1.0], (size, angles.shape[1])),
        None if states.time_s is None else np.full(size, states.time_s.max()),
        warmth,
    )
    targets = np.tile(np.arange(count), _POOL if ladder is None else size)
    state = np.arange(size) if ladder is None else np.repeat(np.arange(size), count)
    rotation = np.tile(np.eye(3), (len(targets), 1, 1)) if model.rows == 6 else None
    return Observations(loaded, state, targets, np.zeros((len(targets), 3)), rotation)


def _rows(model, estimate, bare, final, members, rivals, observations):
    """Whitened sensitivities (M, rows, P + d + 1) for each rival: of the model, of the rival, of what was found at its size."""
    around = circumstances(model, estimate, observations.states)
    line = linearize(model, estimate, observations, around)
    scale = np.array([parameter.plausible for _, parameter in bare.parameters])
    known = (line.sensitivities * scale)[..., ~bare.held]

    def columns(law):
        return effect_columns([law], around, line.coordinate_jacobian, observations.state)

    made = 0.0
    for member in members:
        values, shapes = final.values_of(member.key)
        made = made + columns((member, shapes)) @ values
    jacobian = line.coordinate_jacobian[..., : model.sites.joints]
    whitener = whitening(observations, jacobian, final.noise, final.discrepancy_m)
    found = []
    for rival in rivals:
        other = columns(rival) * np.array([parameter.plausible for parameter in rival[0].parameters])
        found.append(whitener.apply(np.concatenate([known, other, made[..., None]], axis=-1)))
    return found


def _compressed(blocks):
    """Fewer rows (E, P, P) with the same normal equations as blocks (E, rows, P), where that is fewer."""
    return np.linalg.qr(blocks, mode="r") if blocks.shape[1] > blocks.shape[2] else blocks


@dataclass(frozen=True)
class _Information:
    """Normal equations of what was found, regressed on all that could stand in its place.

    Attributes
    ----------
    gram : ndarray (P + 1, P + 1)
        Of the rows of `_rows`.
    inverse : ndarray (P, P)
        Of the part of what stands in its place.
    """

    gram: np.ndarray
    inverse: np.ndarray

    @classmethod
    def of(cls, rows):
        """From whitened rows (R, P + 1)."""
        return cls._from(rows.T @ rows)

    @classmethod
    def _from(cls, gram):
        others = gram[:-1, :-1].copy()
        others[np.diag_indices_from(others)] *= 1 + _RIDGE
        return cls(gram, np.linalg.pinv(others, hermitian=True))

    @property
    def separation(self):
        """Squared length of what was found that nothing else makes: the Schur complement."""
        along = self.gram[:-1, -1]
        return float(self.gram[-1, -1] - along @ self.inverse @ along)

    def gains(self, pool):
        """By how much the separation grows with each block (E, rows, P + 1): innovations over their covariance."""
        others, found = pool[..., :-1], pool[..., -1]
        innovation = found - others @ (self.inverse @ self.gram[:-1, -1])
        covariance = np.eye(pool.shape[1]) + (others @ self.inverse) @ others.transpose(0, 2, 1)
        return (innovation * np.linalg.solve(covariance, innovation[..., None])[..., 0]).sum(axis=-1)

    def with_rows(self, rows):
        """With one more block (rows, P + 1)."""
        return self._from(self.gram + rows.T @ rows)
