"""The next experiment: poses and loads after which the measurements, most probably, say which hypothesis holds.

An entry is one pose, read at the campaign's targets without its load, under it and, where the campaign has such, under the
opposite one, or under given shares of it. Loads are as large as the campaign's, or as the rated payload, at the same lever, in
any direction where the campaign has loads in all of them.

The experiment that leaves the least entropy between the models of the posterior ([1], `alternatives`) is chosen greedily from
random entries, then by one round of Fedorov's exchange [2] and random search in the angles nearby. What is promised of it is
simulated, by the same models.

[1] Lindley, D. V., On a measure of the information provided by an experiment, Annals of Mathematical Statistics 27, 1956.
[2] Fedorov, V. V., Theory of Optimal Experiments, Academic Press, 1972.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from elastocal.diagnosis.alternatives import (
    HALF_RESOLVED,
    MOST_POSES,
    Criterion,
    Promise,
    alternatives_of,
)
from elastocal.diagnosis.refit import mean_square_left
from elastocal.diagnosis.statistics import rows_alike
from elastocal.diagnosis.verdict import ADEQUATE, NAMED, NOT_TESTABLE, mechanisms_of_models
from elastocal.fitting.linearization import effect_columns, linearize
from elastocal.fitting.model import conditions, parameters
from elastocal.fitting.normal_equations import whitening
from elastocal.fitting.observations import Observations, States
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from elastocal.diagnosis.alternatives import Alternative
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.findings import Evidence
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.search import Model
    from elastocal.diagnosis.settings import Settings
    from elastocal.effects.protocol import Displacing
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.mechanics.robot import Robot

    _Name = tuple[str, ...]

# Said where nothing within reach helps.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING, NOTHING_AMBIGUOUS = "nothing is missing", "nothing is ambiguous"
DATA_AT_FAULT, NOTHING_TESTABLE = "the data are at fault", "the measurements can test no mechanism"
# Directions of force whose smallest principal mean square reaches this (a third where they are uniform) are free; loads are
# of both senses where the cosine between two falls below this.
_FREE_DIRECTIONS, _OPPOSITE = 0.02, -0.5
# Entries that the search chooses from, and multiplications that it may take; numbers in memory at once, and entries whose
# sensitivities are.
_STATES, _WORK, _MEMORY, _BLOCK = 600, 4e9, 5e5, 250
# Standard deviations of the steps in the joint angles, rad, and neighbours tried with each.
_RADII, _NEIGHBOURS = (0.5, 0.2, 0.08), 24
# Models that stand for the hypotheses; the others hold a few per cent.
_MODELS, _HYPOTHESES = 12, 8


@dataclass(frozen=True)
class Entries:
    """E poses with their loads.

    `joint_angles` (E, n): rad. `wrench` (E, 6): N, N m, at the last measuring point, base axes. `approach` (E, L, n): sense in
    which each joint is approached at each of L shares of the load; None where the campaign does not note it.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray
    approach: np.ndarray | None

    def __len__(self) -> int:
        return len(self.joint_angles)

    def at(self, chosen: np.ndarray | list[int]) -> Entries:
        """Some of the entries."""
        approach = None if self.approach is None else self.approach[chosen]
        return Entries(self.joint_angles[chosen], self.wrench[chosen], approach)


def shares_of(states: States) -> tuple[float, ...]:
    """Shares of its load at which each pose is read: none and all of it, and the opposite one where the campaign has such."""
    force = states.wrench[states.wrench[:, :3].any(axis=1), :3]
    along = force / np.linalg.norm(force, axis=1, keepdims=True)
    return (1.0,) if not len(force) else (0.0, 1.0, -1.0) if (along @ along.T).min() < _OPPOSITE else (0.0, 1.0)


def drawn(states: States, robot: Robot, shares: tuple[float, ...], count: int, stream: np.random.Generator) -> Entries:
    """Random entries within reach of a robot and of the states of its campaign."""
    low, high = np.clip(robot.joint_limits, -np.pi, np.pi).T
    angles = low + (high - low) * stream.random((count, len(low)))
    size = np.linalg.norm(states.wrench[:, :3], axis=1)
    loaded, wrench = np.flatnonzero(size), np.zeros((count, 6))
    if len(loaded):
        heavy = loaded[size[loaded] >= np.median(size[loaded])]
        chosen = heavy[stream.integers(0, len(heavy), count)]
        largest = max(size.max(), (robot.payload_kg or 0.0) * standard_gravity)
        wrench = states.wrench[chosen] * (largest / size[chosen])[:, None]
        along = states.wrench[loaded, :3] / size[loaded, None]
        if np.linalg.eigvalsh(along.T @ along / len(along))[0] > _FREE_DIRECTIONS:
            turn = Rotation.random(count, rng=stream)
            wrench = np.concatenate([turn.apply(wrench[:, :3]), turn.apply(wrench[:, 3:])], axis=1)
        elif (along @ along.T).min() < _OPPOSITE:
            wrench = wrench * stream.choice([-1.0, 1.0], (count, 1))
    return Entries(angles, wrench, _sides(states, (count, len(shares), len(low)), stream))


def _sides(states: States, shape: tuple[int, ...], stream: np.random.Generator) -> np.ndarray | None:
    """Random senses of approach; none where the campaign does not note them."""
    return None if states.approach is None else stream.choice([-1.0, 1.0], shape)


@dataclass(frozen=True)
class Instrument:
    """Turns entries into information on declared parameters and units.

    `fitted`: about which sensitivities are taken. `linearized`: in the parameters of whose products information is stated.
    `laws` (Displacing, tuple): in the order of the columns. `columns` (U,) of int: of the statistics. `sizes` (U,). `declared`
    (P,) of bool: which of the model's parameters are those of the products. `noise`: with the error common to the measurements
    of a pose. `states`: of the campaign, whose last session, time and usual temperature go on.
    """

    fitted: Fit
    linearized: Linearized
    laws: list[tuple[Displacing, tuple[float, ...]]]
    columns: np.ndarray
    sizes: np.ndarray
    declared: np.ndarray
    noise: Noise
    states: States
    shares: tuple[float, ...]

    @property
    def unknowns(self) -> int:
        """Number of columns: declared parameters and units."""
        return int(self.declared.sum()) + len(self.columns)

    def information(self, entries: Entries) -> np.ndarray:
        """Fisher information on all unknowns in each entry, ndarray (E, U, U)."""
        parts = [np.zeros((0, self.unknowns, self.unknowns))]
        for start in range(0, len(entries), _BLOCK):
            rows = self._rows(entries.at(np.arange(start, min(start + _BLOCK, len(entries)))))
            parts.append(rows.transpose(0, 2, 1) @ rows)
        return np.concatenate(parts)

    def _rows(self, entries: Entries) -> np.ndarray:
        """Whitened sensitivities of the measurements of each entry, ndarray (E, rows, U)."""
        model, estimate, observations = self.fitted.model, self.fitted.estimate, self.observations(entries)
        around = conditions(model, estimate, observations.states)
        # Nothing comes after the last row of the campaign but these.
        around = replace(around, progress=np.ones(len(observations.states)))
        line = linearize(model, estimate, observations, around)
        jacobian = line.coordinate_jacobian
        made = effect_columns(self.laws, line.conditions, jacobian, observations.state) * self.sizes
        white = whitening(observations, jacobian[..., : model.sites.joints], self.noise)
        parts = [white.apply(part) for part in (line.sensitivities[..., self.declared], made)]
        rows = rows_alike(self.linearized.products, parts[0], parts[1], self.columns)
        return np.asarray(rows.reshape(len(entries), -1, rows.shape[-1]))

    def observations(self, entries: Entries) -> Observations:
        """Entries as observations, those of an entry together; what is measured stays zero."""
        model, each = self.fitted.model, len(self.shares)
        count, targets = each * len(entries), len(model.targets)
        states = States(
            np.full(count, self.fitted.estimate.sessions[-1]),
            np.repeat(np.arange(len(entries)), each),
            np.tile(np.arange(each), len(entries)),
            np.repeat(entries.joint_angles, each, axis=0),
            (entries.wrench[:, None] * np.array(self.shares)[:, None]).reshape(count, 6),
            np.ones(count, int),
            None if entries.approach is None else entries.approach.reshape(count, -1),
            None if self.states.time_s is None else np.full(count, self.states.time_s.max()),
            None if self.states.temperature_c is None else np.full(count, self.states.temperature_c.mean()),
        )
        state, target = np.repeat(np.arange(count), targets), np.tile(np.arange(targets), count)
        rotation = np.tile(np.eye(3), (len(target), 1, 1)) if model.rows == 6 else None
        return Observations(states, state, target, np.zeros((len(target), 3)), rotation)


def instrument_of(
    linearized: Linearized, fitted: Fit, numbers: Sequence[int], noise: Noise, states: States, shares: tuple[float, ...]
) -> Instrument:
    """What tells the information in entries; `numbers`: units of the problem whose columns matter."""
    owners = [owner for owner, _ in parameters(fitted.model, fitted.estimate)]
    declared = np.array([owner not in linearized.candidates for owner in owners], bool)
    units = [linearized.problem.units[number] for number in numbers]
    laws: list[tuple[Displacing, tuple[float, ...]]] = []
    for unit in units:
        law = unit.candidate or unit.law
        assert law is not None
        laws.append((law, unit.shapes))
    columns, sizes = (np.concatenate([getattr(unit, name) for unit in units]) for name in ("columns", "sizes"))
    return Instrument(fitted, linearized, laws, columns, sizes, declared, noise, states, shares)


@dataclass(frozen=True)
class Proposal:
    """Poses to measure next, in the order of their worth, and what they promise; arrays of E, empty where nothing helps.

    `best`: mechanisms of the best hypothesis. `indistinguishable`: alternatives that no experiment within reach distinguishes
    from the best; they do not count in the promise. `reason`: why there is nothing to measure; empty where there is. `nearest`:
    of the alternative with the smallest separation. `entries`: poses and loads, to approach from any side. `shares`: of its
    load at which each pose is read. `points`: measuring points at which targets are read in every pose. `separation` (E,): from
    the nearest alternative, by measurements of this pose and all before it: at most twice the log Bayes factor that they bring
    for the true hypothesis on average; 16 gives it odds of 19:1 from even ones with 90 %. `resolved` (E,): probability that
    after this pose the right hypothesis has 95 %, those in `indistinguishable` aside.
    """

    best: _Name
    indistinguishable: tuple[_Name, ...] = ()
    reason: str = ""
    nearest: _Name = ()
    entries: Entries | None = None
    shares: tuple[float, ...] = ()
    points: tuple[str, ...] = ()
    separation: np.ndarray = field(default_factory=lambda: np.zeros(0))
    resolved: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        return len(self.separation)


def propose(
    diagnosis: Diagnosis,
    joint_limits: np.ndarray,
    settings: Settings,
    stream: np.random.Generator,
    poses: int = 10,
    ladder: tuple[float, ...] | None = None,
) -> Proposal:
    """Choose the poses and loads that most probably resolve what a diagnosis leaves ambiguous.

    `joint_limits` (n, 2): rad. `ladder`: shares of its load at which each pose is read. Without, each is read without its load,
    under it and, where the campaign has such, under the opposite one.
    """
    case, evidence = diagnosis.case, diagnosis.evidence
    if evidence is None:
        return Proposal((), reason=DATA_AT_FAULT)
    kept, reason = _ambiguous(evidence, settings)
    best = evidence.conclusion.best.mechanisms
    if reason:
        return Proposal(best, reason=reason)
    problem, states = evidence.linearized.problem, case.observations.states
    numbers = sorted({n for models in kept.values() for model in models for n in model.units})
    shares = ladder or shares_of(states)
    robot = replace(case.campaign.robot, joint_limits=joint_limits)
    lead = kept[best][0]
    factor = float(np.sqrt(max(mean_square_left(problem, lead), 1.0)))
    noise = replace(evidence.linearized.about.noise.scaled(factor), pose_rad=factor * lead.pose_error_rad)
    instrument = instrument_of(evidence.linearized, diagnosis.final, numbers, noise, states, shares)
    models = alternatives_of(evidence, kept, instrument, lead, factor)
    entries = _searched(models, instrument, robot, poses, stream)
    # Nobody is asked to approach from the sides with which the search was lucky.
    entries = replace(entries, approach=_sides(states, (poses, len(shares), robot.joints), stream))
    information = instrument.information(entries)
    promise = Promise(models, stream)
    apart = promise.separations(promise.log_factors(information.sum(axis=0) * (MOST_POSES / poses)))
    unreachable = tuple(name for name, far in zip(promise.names[1:], apart[1:], strict=True) if far < HALF_RESOLVED)
    models = [model for model in models if model.name not in unreachable]
    promise = Promise(models, stream)
    # What is distinguishable from the best holds no more probability than is left open where nothing is ambiguous.
    if np.exp(promise.log_prior[0]) >= settings.credible:
        return Proposal(best, unreachable, NOT_DISTINGUISHABLE)
    order = _greedy(Criterion(models, stream), information, poses)
    totals = np.cumsum(information[order], axis=0)
    factors = [promise.log_factors(total) for total in totals]
    separations = np.array([promise.separations(logs)[1:] for logs in factors])
    resolved = np.array([promise.resolved(logs) for logs in factors])
    return Proposal(
        best,
        unreachable,
        "",
        promise.names[1 + int(np.argmin(separations[-1]))],
        entries.at(order),
        shares,
        tuple(dict.fromkeys(target.point for target in diagnosis.final.model.targets)),
        separations.min(axis=1),
        resolved,
    )


def _ambiguous(evidence: Evidence, settings: Settings) -> tuple[dict[_Name, list[Model]], str]:
    """Models of each credible hypothesis, the best first, each by falling probability; or why there is nothing to resolve."""
    conclusion, found = evidence.conclusion, evidence.posterior
    if conclusion.verdict in (ADEQUATE, NOT_TESTABLE):
        return {}, NOTHING_MISSING if conclusion.verdict == ADEQUATE else NOTHING_TESTABLE
    there = [h for h in conclusion.hypotheses if h.mechanisms and h.model >= 0]
    reached = np.cumsum([h.probability for h in there])
    credible = there[: int(np.searchsorted(reached, settings.credible * reached[-1])) + 1]
    names = [conclusion.best.mechanisms, *(h.mechanisms for h in credible if h != conclusion.best)][:_HYPOTHESES]
    # Where the verdict names one mechanism, whatever else is beside it does not make the name ambiguous.
    instead = [name for name in names[1:] if not set(name) >= set(names[0])]
    if len(names) < 2 or (conclusion.verdict == NAMED and not instead):
        return {}, NOTHING_AMBIGUOUS
    models: dict[_Name, list[Model]] = {name: [] for name in names}
    for model, name in zip(found.models, mechanisms_of_models(evidence.linearized.problem, found), strict=True):
        if name in models:
            models[name].append(model)
    room = _MODELS - len(names)
    extra = sorted((m for each in models.values() for m in each[1:]), key=lambda model: -model.log_odds)[:room]
    return {name: [m for m in each if m is each[0] or any(m is other for other in extra)] for name, each in models.items()}, ""


def _searched(
    models: Sequence[Alternative], instrument: Instrument, robot: Robot, poses: int, stream: np.random.Generator
) -> Entries:
    """The experiment that leaves least entropy: greedily, then each pose in turn against all others and its neighbours."""
    criterion = Criterion(models, stream)
    # Hypotheses of a hundred units each leave time for few entries.
    looked_at = int(_WORK / (criterion.work * 2 * poses))
    entries = drawn(instrument.states, robot, instrument.shares, int(np.clip(looked_at, 2 * poses, _STATES)), stream)
    information = instrument.information(entries)
    chosen = _greedy(criterion, information, poses)
    for place in range(poses if looked_at >= _STATES else 0):
        chosen[place] = _best_beside(criterion, information, chosen[:place] + chosen[place + 1 :])
    entries, information = entries.at(chosen), information[chosen]
    limits = np.clip(robot.joint_limits, -np.pi, np.pi)
    for radius in _RADII:
        for place in range(poses):
            # The entry itself stays among its neighbours.
            tried = entries.at(np.full(_NEIGHBOURS, place))
            angles = tried.joint_angles + radius * stream.standard_normal(tried.joint_angles.shape)
            angles = np.clip(np.vstack([entries.joint_angles[place], angles[1:]]), *limits.T)
            known = instrument.information(replace(tried, joint_angles=angles))
            best = int(np.argmin(criterion.left(np.delete(information, place, axis=0).sum(axis=0) + known)))
            entries.joint_angles[place], information[place] = angles[best], known[best]
    return entries


def _greedy(criterion: Criterion, information: np.ndarray, count: int) -> list[int]:
    """So many entries, each of which leaves least entropy after those before it."""
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(_best_beside(criterion, information, chosen))
    return chosen


def _best_beside(criterion: Criterion, information: np.ndarray, chosen: list[int]) -> int:
    """The entry that leaves least entropy beside those chosen."""
    size = max(int(_MEMORY / information.shape[1] ** 2), 1)
    known = information[chosen].sum(axis=0)
    left = np.concatenate([criterion.left(known + part) for part in np.split(information, range(size, len(information), size))])
    left[chosen] = np.inf
    return int(np.argmin(left))


def table_of(proposal: Proposal, robot: Robot) -> pd.DataFrame:
    """The proposal as whoever drives the robot wants it.

    Returns one row for each pose; joint angles as the controller reports them (rad), ``load`` 1 where it is loaded,
    ``separation`` and ``resolved`` after it and all before, and what the promise leaves aside as ``indistinguishable``.
    """
    import pandas as pd

    count, entries = len(proposal), proposal.entries
    angles, wrench = (entries.joint_angles, entries.wrench) if entries else (np.zeros((0, robot.joints)), np.zeros((0, 6)))
    reported = robot.reported_angles(angles) if entries else angles
    columns: dict[str, Any] = {
        "effect": [f"{' + '.join(proposal.best)} or {' + '.join(proposal.nearest)}"] * count,
        "pose": np.arange(count),
        "load": wrench.any(axis=1).astype(int),
        "point": [" ".join(proposal.points)] * count,
        **{f"q{joint + 1}": reported[:, joint] for joint in range(robot.joints)},
        **dict(zip(WRENCH_NAMES, wrench.T, strict=True)),
        "separation": proposal.separation,
        "resolved": proposal.resolved,
        "indistinguishable": ["; ".join(map(" + ".join, proposal.indistinguishable))] * count,
    }
    return pd.DataFrame(columns)


def facts_of(proposal: Proposal) -> dict[str, Any]:
    """What verdict.json says of the next experiment."""
    return {
        "poses": len(proposal),
        "reason": proposal.reason,
        "best": list(proposal.best),
        "nearest": list(proposal.nearest),
        "separation": float(proposal.separation[-1]) if len(proposal) else None,
        "resolved": float(proposal.resolved[-1]) if len(proposal) else None,
        "indistinguishable": [list(name) for name in proposal.indistinguishable],
    }
