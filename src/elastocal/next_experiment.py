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


def propose(final, attribution, observations, candidates, joint_limits, count, stream, together=False):
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
    together : bool
        Whether each state is read at all targets of the campaign, and then not twice; otherwise at one target, which may be on
        a measuring point that has none yet.

    Returns
    -------
    Proposal
    """
    bare = without(final, {member.key for member in attribution.members}, observations)
    model, estimate = (bare.model, bare.estimate) if together else _with_targets_everywhere(bare)
    targets = model.targets
    pool = _pool(model, estimate, observations, joint_limits, stream)
    contests = []
    for key in attribution.alternatives[:_RIVALS]:
        rival = (candidates[key], [shape.start for shape in candidates[key].shapes])
        here = _rows(bare.model, bare.estimate, bare, final, attribution.members, rival, observations)
        there = _rows(model, estimate, bare, final, attribution.members, rival, pool)
        if together:
            there = there.reshape(_POOL, -1, there.shape[-1])
        contests.append((_Information.of(here.reshape(-1, here.shape[-1])), there))
    before = min(information.separation for information, _ in contests)
    chosen, separations = [], []
    for _ in range(count):
        worst = np.min([information.separation + information.gains(there) for information, there in contests], axis=0)
        worst[chosen] = -np.inf
        best = int(np.argmax(worst))
        chosen.append(best)
        separations.append(worst[best])
        contests = [(information.with_rows(there[best]), there) for information, there in contests]
    if together:
        # The states of a pose follow each other, one for each target.
        chosen = [index * len(targets) for index in chosen]
        points = (" ".join(dict.fromkeys(target.point for target in targets)),) * count
    else:
        points = tuple(targets[pool.target[index]].point for index in chosen)
    states = pool.states
    return Proposal(states.joint_angles[chosen], states.wrench[chosen], points, np.array(separations), before)


def _with_targets_everywhere(fitted):
    """Model and estimate with one more target at each measuring point that has none yet."""
    chain, targets = fitted.model.sites.chain, fitted.model.targets
    bare = [point.name for point in chain.points if point.name not in {target.point for target in targets}]
    added = tuple(Target(name, name, (0.0, 0.0, 0.0)) for name in bare)
    offsets = np.concatenate([fitted.estimate.target_offset, np.zeros((len(added), 3))])
    turns = np.concatenate([fitted.estimate.target_rotation, np.tile(np.eye(3), (len(added), 1, 1))])
    estimate = replace(fitted.estimate, target_offset=offsets, target_rotation=turns)
    return replace(fitted.model, targets=(*targets, *added)), estimate


def _pool(model, estimate, observations, joint_limits, stream):
    """Random poses under the loads of the campaign and their opposites, with one target each, at every target in turn."""
    states, count = observations.states, len(model.targets)
    low, high = np.clip(joint_limits, -np.pi, np.pi).T
    angles = low + (high - low) * stream.random((_POOL, len(low)))
    wrench = states.wrench[stream.integers(0, len(states), _POOL)] * stream.choice([-1.0, 1.0], (_POOL, 1))
    size = _POOL * count

    def each(values):
        return np.repeat(values, count, axis=0)

    session = np.full(size, estimate.sessions[0])
    later = None if states.time_s is None else np.full(size, states.time_s.max())
    warmth = None if states.temperature_c is None else np.full(size, states.temperature_c.mean())
    approach = None if states.approach is None else stream.choice([-1.0, 1.0], (size, len(low)))
    drawn = States(
        session,
        np.arange(size),
        np.ones(size, int),
        each(angles),
        each(wrench),
        np.full(size, _REPEATS),
        approach,
        later,
        warmth,
    )
    rotation = np.tile(np.eye(3), (size, 1, 1)) if model.rows == 6 else None
    return Observations(drawn, np.arange(size), np.tile(np.arange(count), _POOL), np.zeros((size, 3)), rotation)


def _rows(model, estimate, bare, final, members, rival, observations):
    """Whitened sensitivities (M, rows, P + d + 1): of the model, of a rival, and what was found at its fitted size."""
    around = circumstances(model, estimate, observations.states)
    line = linearize(model, estimate, observations, around)
    scale = np.array([parameter.plausible for _, parameter in bare.parameters])
    known = (line.sensitivities * scale)[..., ~bare.held]
    plausible = np.array([parameter.plausible for parameter in rival[0].parameters])
    other = effect_columns([rival], around, line.coordinate_jacobian, observations.state) * plausible
    keys = [effect.key for effect in final.model.effects]
    made = 0.0
    for member in members:
        number = keys.index(member.key)
        law = (final.model.effects[number], final.estimate.shapes[number])
        made = (
            made
            + effect_columns([law], around, line.coordinate_jacobian, observations.state)
            @ (final.estimate.coefficients[number])
        )
    jacobian = line.coordinate_jacobian[..., : model.sites.joints]
    whitener = whitening(observations, jacobian, final.noise, final.discrepancy_m)
    return whitener.apply(np.concatenate([known, other, made[..., None]], axis=-1))


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
