"""What could be measured next on a robot, and what it would tell: poses with loads, and the information in each.

An entry is one pose, read at all targets without its load, under it and under the opposite one, or under given shares of it.
Loads are those of the campaign: as large, at the same lever or none, in any direction where the campaign has loads in all of
them; up to the weight of the rated payload where the robot file has it. A weight hung at the flange is known without a load
cell: measurements of its force have no errors. A repeat is another entry: it costs as much as another pose, and tells no more
than a pose close by.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import NOT_TURNED, Target
from elastocal.diagnosis.statistics import rows_alike
from elastocal.fitting.displacement import conditions
from elastocal.fitting.linearization import effect_columns, linearize
from elastocal.fitting.observations import Observations, States
from elastocal.fitting.parameters import parameters
from elastocal.fitting.whitening import whitening

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.linearize import Linearized
    from elastocal.effects.protocol import Displacing
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.mechanics.robot import Robot

# Without a ladder of loads: each pose without its load and under it, and under the opposite one where the campaign has such.
WITHOUT_AND_WITH, BOTH_SENSES = (0.0, 1.0), (0.0, 1.0, -1.0)
# Directions of force whose smallest principal mean square reaches this (a third where they are uniform) are free.
_FREE_DIRECTIONS = 0.02
# Share of entries under a reference weight, where there can be one.
_WEIGHTS = 0.25
# Least share of the largest load that is drawn: laws of gears differ in small loads.
_SMALLEST_LOAD = 0.2
# Entries whose sensitivities are in memory at once.
_BLOCK = 250
# Chance that a neighbour of an entry approaches a joint from the other side.
_OTHER_SIDE = 0.15


@dataclass(frozen=True)
class Entries:
    """E poses with their loads.

    `joint_angles` (E, n): rad. `wrench` (E, 6): N, N m, at the last measuring point, base axes. `approach` (E, L, n): sense in
    which each joint is approached at each of L shares of the load. `weighed` (E,) of bool: whether the load is a known weight
    instead of what a load cell shows.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
    approach: np.ndarray | None
    weighed: np.ndarray

    def __len__(self) -> int:
        return len(self.joint_angles)

    def at(self, chosen: np.ndarray | list[int]) -> Entries:
        """Some of the entries."""
        approach = None if self.approach is None else self.approach[chosen]
        return Entries(self.joint_angles[chosen], self.wrench[chosen], approach, self.weighed[chosen])

    def then(self, others: Entries) -> Entries:
        """These entries and others."""
        both = None if self.approach is None or others.approach is None else np.concatenate([self.approach, others.approach])
        return Entries(
            np.concatenate([self.joint_angles, others.joint_angles]),
            np.concatenate([self.wrench, others.wrench]),
            both,
            np.concatenate([self.weighed, others.weighed]),
        )


@dataclass(frozen=True)
class Reach:
    """What robot and campaign can do.

    `limits` (n, 2): rad. `wrenches` (W, 6): loads of the campaign, none or more. `any_direction`, `either_sense`: whether loads
    can have any direction, or at least the opposite one. `down` (3,): direction of weights. `weights`: whether a reference
    weight is worth considering. `shares`: shares of its load at which each pose is read. `free`: whether size and lever of the
    load and the side of the approach are chosen for each pose; with a given ladder loads are as large as they can be, and the
    side is drawn anew for each share.
    """

    limits: np.ndarray
    wrenches: np.ndarray
    largest_N: float
    any_direction: bool
    either_sense: bool
    down: np.ndarray
    weights: bool
    shares: tuple[float, ...]
    free: bool
    approach_noted: bool


def reach_of(states: States, robot: Robot, joint_limits: np.ndarray, ladder: tuple[float, ...] | None, weights: bool) -> Reach:
    """What a robot can be asked to do after a campaign.

    `states`: of the campaign. `joint_limits` (n, 2): rad. `ladder`: as in `next_experiment.propose`. `weights`: whether a
    reference weight would tell anything, were it within reach.
    """
    force = states.wrench[:, :3]
    size = np.linalg.norm(force, axis=1)
    loaded = size > 0
    heavy = size >= np.median(size[loaded]) if loaded.any() else loaded
    along = force[loaded] / size[loaded, None]
    cosines = along @ along.T
    free = bool(loaded.any()) and np.linalg.eigvalsh(along.T @ along / len(along))[0] > _FREE_DIRECTIONS
    rated = (robot.payload_kg or 0.0) * standard_gravity
    gravity = np.asarray(robot.gravity_m_s2, float)
    either = bool(cosines.min(initial=0.0) < -0.5)
    shares = ladder if ladder is not None else BOTH_SENSES if either else WITHOUT_AND_WITH
    return Reach(
        np.clip(joint_limits, -np.pi, np.pi),
        states.wrench[heavy],
        max(size.max(initial=0.0), rated) if loaded.any() else 0.0,
        free,
        either,
        gravity / max(np.linalg.norm(gravity), np.finfo(float).tiny),
        weights and ladder is None and bool(loaded.any()) and bool(gravity.any()),
        shares if loaded.any() else (1.0,),
        ladder is None,
        states.approach is not None,
    )


def drawn(reach: Reach, count: int, stream: np.random.Generator) -> Entries:
    """Random entries within reach."""
    low, high = reach.limits.T
    angles = low + (high - low) * stream.random((count, len(low)))
    wrench, weighed = np.zeros((count, 6)), np.zeros(count, bool)
    if len(reach.wrenches):
        wrench = reach.wrenches[stream.integers(0, len(reach.wrenches), count)]
        share = np.where(stream.random(count) < 0.5, 1.0, stream.uniform(_SMALLEST_LOAD, 1.0, count))
        # A ladder has its own shares of the largest load.
        share = share if reach.free else np.ones(count)
        wrench = wrench * (reach.largest_N * share / np.linalg.norm(wrench[:, :3], axis=1))[:, None]
        if reach.any_direction:
            wrench = _turned(wrench, Rotation.random(count, rng=stream))
        elif reach.either_sense:
            wrench = wrench * stream.choice([-1.0, 1.0], (count, 1))
        if reach.free:
            wrench[:, 3:] *= stream.choice([0.0, 1.0], (count, 1))
        if reach.weights:
            weighed = stream.random(count) < _WEIGHTS
            wrench[weighed] = 0.0
            wrench[weighed, :3] = reach.largest_N * share[weighed, None] * reach.down
    return Entries(angles, wrench, approaches(reach, count, stream), weighed)


def near(reach: Reach, entries: Entries, count: int, radius: float, stream: np.random.Generator) -> Entries:
    """Neighbours of entries: other angles, for half of them another direction of the load, now and then the other side.

    `radius`: rad. Returns `count` of the first, then of the second.
    """
    found = entries.at(np.repeat(np.arange(len(entries)), count))
    angles = found.joint_angles + radius * stream.standard_normal(found.joint_angles.shape)
    wrench, approach = found.wrench, found.approach
    if reach.any_direction:
        turn = radius * stream.standard_normal((len(found), 3)) * (stream.random((len(found), 1)) < 0.5)
        turn[found.weighed] = 0.0
        wrench = _turned(wrench, Rotation.from_rotvec(turn))
    if reach.free and approach is not None:
        approach = approach * np.where(stream.random(angles.shape) < _OTHER_SIDE, -1.0, 1.0)[:, None]
    return Entries(np.clip(angles, *reach.limits.T), wrench, approach, found.weighed)


def _turned(wrench: np.ndarray, rotation: Rotation) -> np.ndarray:
    return np.concatenate([rotation.apply(wrench[:, :3]), rotation.apply(wrench[:, 3:])], axis=1)


def approaches(reach: Reach, count: int, stream: np.random.Generator) -> np.ndarray | None:
    """Random senses of approach: one for each entry where it is chosen, else one for each share of its load.

    Returns (count, L, n): None where the campaign does not note them.
    """
    if not reach.approach_noted:
        return None
    shape = (count, len(reach.shares), len(reach.limits))
    sides = stream.choice([-1.0, 1.0], shape)
    return np.broadcast_to(sides[:, :1], shape).copy() if reach.free else sides


@dataclass(frozen=True)
class Instrument:
    """Turns entries into information on declared parameters and units.

    `model`, `estimate`: about which sensitivities are taken, with a target at each measuring point that has none yet. `own`:
    number of the campaign's own targets, which come first. `linearized`: in the parameters of whose products information is
    stated. `laws` (Displacing, tuple): in the order of the columns. `columns` (U,) of int: of the statistics. `sizes` (U,).
    `of_load_cell` (U,) of bool: columns of effects that a reference weight does not have. `declared`, `added` (P,) of bool:
    which of the model's parameters are those of the products, and which belong to targets that are not there yet. `noise`: with
    the error common to the measurements of a pose. `states`: of the campaign, whose last session, time and usual temperature go
    on.
    """

    model: Model
    estimate: Estimate
    own: int
    linearized: Linearized
    laws: list[tuple[Displacing, tuple[float, ...]]]
    columns: np.ndarray
    sizes: np.ndarray
    of_load_cell: np.ndarray
    declared: np.ndarray
    added: np.ndarray
    noise: Noise
    states: States
    reach: Reach

    @property
    def extra_points(self) -> range:
        """Measuring points without a target of the campaign, as numbers of targets."""
        return range(self.own, len(self.model.targets))

    @property
    def unknowns(self) -> int:
        """Number of columns: declared parameters, units, offsets of further targets."""
        return int(self.declared.sum()) + len(self.columns) + int(self.added.sum())

    def information(self, entries: Entries, targets: Sequence[int]) -> np.ndarray:
        """Fisher information on all unknowns in each entry, ndarray (E, U, U).

        `targets`: which targets are read.
        """
        parts = [np.zeros((0, self.unknowns, self.unknowns))]
        for start in range(0, len(entries), _BLOCK):
            rows = self.rows(entries.at(np.arange(start, min(start + _BLOCK, len(entries)))), targets)
            parts.append(rows.transpose(0, 2, 1) @ rows)
        return np.concatenate(parts)

    def rows(self, entries: Entries, targets: Sequence[int]) -> np.ndarray:
        """Whitened sensitivities of the measurements of each entry, ndarray (E, rows, U)."""
        observations = self.observations(entries, targets)
        around = conditions(self.model, self.estimate, observations.states)
        # Nothing comes after the last row of the campaign but these.
        around = replace(around, progress=np.ones(len(observations.states)))
        line = linearize(self.model, self.estimate, observations, around)
        jacobian, state, around = line.coordinate_jacobian, observations.state, line.conditions
        made = effect_columns(self.laws, around, jacobian, state) * self.sizes
        weighed = np.repeat(entries.weighed, len(observations) // len(entries))
        made[np.ix_(weighed, np.ones(made.shape[1], bool), self.of_load_cell)] = 0.0
        parts = line.sensitivities[..., self.declared], made, line.sensitivities[..., self.added]
        white = whitening(observations, jacobian[..., : self.model.sites.joints], self.noise)
        declared, made, added = (white.apply(part) for part in parts)
        rows = np.concatenate([rows_alike(self.linearized.products, declared, made, self.columns), added], axis=-1)
        return rows.reshape(len(entries), -1, rows.shape[-1])

    def observations(self, entries: Entries, targets: Sequence[int]) -> Observations:
        """Entries as observations, those of an entry together; what is measured stays zero."""
        # A weight only hangs.
        shares = np.where(entries.weighed[:, None], np.abs(self.reach.shares), self.reach.shares)
        each = shares.shape[1]
        count = shares.size
        usual = None if self.states.temperature_c is None else np.full(count, self.states.temperature_c.mean())
        states = States(
            np.full(count, self.estimate.sessions[-1]),
            np.repeat(np.arange(len(entries)), each),
            np.tile(np.arange(each), len(entries)),
            np.repeat(entries.joint_angles, each, axis=0),
            (entries.wrench[:, None] * shares[..., None]).reshape(count, 6),
            np.ones(count, int),
            None if entries.approach is None else entries.approach.reshape(count, -1),
            None if self.states.time_s is None else np.full(count, self.states.time_s.max()),
            usual,
        )
        state, target = np.repeat(np.arange(count), len(targets)), np.tile(np.asarray(targets, int), count)
        rotation = np.tile(np.eye(3), (len(target), 1, 1)) if self.model.rows == 6 else None
        return Observations(states, state, target, np.zeros((len(target), 3)), rotation)


def instrument_of(
    linearized: Linearized,
    fitted: Fit,
    numbers: Sequence[int],
    noise: Noise,
    states: States,
    reach: Reach,
    further_targets: bool,
) -> Instrument:
    """What tells the information in entries.

    `fitted`: about which new states are linear: the model found. `numbers`: units of the problem whose columns matter. `noise`:
    of one measurement, with the error common to the measurements of a pose. `states`: of the campaign. `further_targets`:
    whether a target can be put on measuring points that have none: at a known place where the campaign's targets are.
    """
    model, estimate, own = fitted.model, fitted.estimate, len(fitted.model.targets)
    if further_targets:
        model, estimate = _with_targets_everywhere(model, estimate)
    owners = [owner for owner, _ in parameters(model, estimate)]
    new = {f"target {target.name}" for target in model.targets[own:]}
    added = np.array([owner in new for owner in owners], bool)
    declared = np.array([owner not in linearized.candidates for owner in owners], bool) & ~added
    laws: list[tuple[Displacing, tuple[float, ...]]] = []
    problem = linearized.problem
    units = [problem.units[number] for number in numbers]
    for unit in units:
        law = unit.candidate or unit.law
        assert law is not None
        laws.append((law, unit.shapes))
    columns, of_load_cell = problem.columns_of(numbers, [unit.of_load_cell for unit in units])
    return Instrument(
        model,
        estimate,
        own,
        linearized,
        laws,
        columns,
        np.concatenate([np.zeros(0), *(unit.sizes for unit in units)]),
        of_load_cell.astype(bool),
        declared,
        added,
        noise,
        states,
        reach,
    )


def _with_targets_everywhere(model: Model, estimate: Estimate) -> tuple[Model, Estimate]:
    """One more target on each measuring point without; what all of the campaign's own leave unknown is unknown of it too."""
    taken = {target.point for target in model.targets}
    bare = [point.name for point in model.sites.chain.points if point.name not in taken]
    place = None if all(target.offset_m is None for target in model.targets) else (0.0, 0.0, 0.0)
    turn = None if all(target.rotation is None for target in model.targets) else NOT_TURNED
    added = tuple(Target(f"further target on {name}", name, place, turn) for name in bare)
    offsets = np.concatenate([estimate.target_offset, np.zeros((len(added), 3))])
    turns = np.concatenate([estimate.target_rotation, np.tile(np.eye(3), (len(added), 1, 1))])
    estimate = replace(estimate, target_offset=offsets, target_rotation=turns)
    return replace(model, targets=(*model.targets, *added)), estimate
