"""The next experiment: poses and loads after which the measurements, most probably, say which hypothesis holds.

The experiment that leaves the least entropy between the models of the posterior ([1], `alternatives`) is looked for greedily,
then by Fedorov's exchange [2] in its modified form, each pose in turn against all of a short list [3], then by random local
search in angles, directions of loads and approaches. What is promised of it is simulated (`promise`).

[1] Lindley, D. V., On a measure of the information provided by an experiment, Annals of Mathematical Statistics 27, 1956.
[2] Fedorov, V. V., Theory of Optimal Experiments, Academic Press, 1972.
[3] Cook, R. D. and Nachtsheim, C. J., A comparison of algorithms for constructing exact D-optimal designs, Technometrics 22,
    1980.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis import new_states
from elastocal.diagnosis.alternatives import Criterion, members_of
from elastocal.diagnosis.promise import HALF_RESOLVED, Promise, poses_needed
from elastocal.diagnosis.proposal import (
    DATA_AT_FAULT,
    MOST_POSES,
    NOT_DISTINGUISHABLE,
    NOTHING_AMBIGUOUS,
    NOTHING_MISSING,
    NOTHING_TESTABLE,
    Proposal,
    without_poses,
)
from elastocal.diagnosis.refit import mean_square_left
from elastocal.diagnosis.verdict import ADEQUATE, NAMED, NOT_TESTABLE, mechanisms_of_models

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.diagnosis.alternatives import Members
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.findings import Evidence
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.new_states import Entries, Instrument
    from elastocal.diagnosis.search import Model
    from elastocal.diagnosis.settings import Settings

# States that are looked at, and entries among them that greedy search and exchange choose from: as many by what they tell alone
# as at random, for some tell only together with others.
_STATES, _SHORT_LIST = 10_000, 300
# Multiplications that the search may take: fewer entries are looked at where models have hundreds of unknowns. And numbers in
# memory at once.
_WORK, _MEMORY = 4e9, 2e7
# Models that stand for the hypotheses; the others hold a few per cent.
_MODELS, _HYPOTHESES = 12, 8
# Standard deviations of the steps in the joint angles, and neighbours tried with each.
_RADII, _NEIGHBOURS = (0.5, 0.2, 0.08), 24
_EXCHANGES = 2
# Targets on further points are not asked for where they bring less than this share of the fall of the entropy.
_WORTH_A_TARGET = 0.05


def propose(
    diagnosis: Diagnosis,
    joint_limits: np.ndarray,
    settings: Settings,
    stream: np.random.Generator,
    poses: int = 10,
    ladder: tuple[float, ...] | None = None,
) -> Proposal:
    """Choose the poses and loads that most probably resolve what a diagnosis leaves ambiguous.

    `joint_limits` (n, 2): rad. `ladder`: shares of its load at which each pose is read, at the targets of the campaign and with
    any approach. Without, each is read without its load, under it and, where the campaign has such, under the opposite one;
    sizes and levers of the load, a reference weight, targets on further points and the side of the approach are chosen.
    """
    joints, case, evidence = len(joint_limits), diagnosis.case, diagnosis.evidence
    if evidence is None:
        return without_poses(joints, (), (), DATA_AT_FAULT)
    kept, reason = _ambiguous(evidence, settings)
    best = evidence.conclusion.best.mechanisms
    if reason:
        return without_poses(joints, best, (), reason)
    problem = evidence.linearized.problem
    numbers = sorted({n for models in kept.values() for model in models for n in model.units})
    states = case.observations.states
    of_load_cell = any(problem.units[number].of_load_cell for number in numbers)
    reach = new_states.reach_of(states, case.campaign.robot, joint_limits, ladder, of_load_cell)
    lead = kept[best][0]
    factor = float(np.sqrt(max(mean_square_left(problem, lead), 1.0)))
    noise = replace(evidence.linearized.about.noise.scaled(factor), pose_rad=factor * lead.pose_error_rad)
    instrument = new_states.instrument_of(evidence.linearized, diagnosis.final, numbers, noise, states, reach, ladder is None)
    members = members_of(evidence, kept, instrument, lead, factor)
    entries, information, targets = _searched(members, instrument, poses, stream)
    if not reach.free:
        # Nobody is asked to approach from the sides with which the search was lucky.
        entries = replace(entries, approach=new_states.approaches(reach, poses, stream))
        information = instrument.information(entries, targets)
    promise = Promise(members, stream)
    far = information.sum(axis=0) * (MOST_POSES / poses)
    apart = promise.separations(promise.log_factors(far))
    lost = [h for h in range(1, len(members.names)) if apart[h] < HALF_RESOLVED]
    unreachable = tuple(members.names[h] for h in lost)
    members = members.without(lost)
    promise = Promise(members, stream)
    # What is distinguishable from the best holds no more probability than is left open where nothing is ambiguous.
    if np.exp(promise.log_prior[0]) >= settings.credible:
        return without_poses(joints, best, unreachable, NOT_DISTINGUISHABLE)
    order = _greedy(Criterion.of(members, stream), information, poses)
    entries, information = entries.at(order), information[order]
    totals = np.cumsum(information, axis=0)
    factors = [promise.log_factors(total) for total in totals]
    apart = np.array([promise.separations(logs)[1:] for logs in factors])
    resolved = np.array([promise.resolved(logs) for logs in factors])
    nearest = int(np.argmin(apart[-1]))
    return Proposal(
        entries.joint_angles,
        entries.wrench,
        entries.approach[:, 0] if reach.free and entries.approach is not None else None,
        entries.weighed,
        reach.shares,
        tuple(dict.fromkeys(instrument.model.targets[target].point for target in targets)),
        apart.min(axis=1),
        resolved,
        _present_separation(evidence.linearized, lead, kept[members.names[nearest + 1]][0], factor),
        poses_needed(promise, totals[-1], resolved),
        best,
        members.names[nearest + 1],
        unreachable,
        "",
    )


def _ambiguous(evidence: Evidence, settings: Settings) -> tuple[dict[tuple[str, ...], list[Model]], str]:
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
    models: dict[tuple[str, ...], list[Model]] = {name: [] for name in names}
    for model, name in zip(found.models, mechanisms_of_models(evidence.linearized.problem, found), strict=True):
        if name in models:
            models[name].append(model)
    room = _MODELS - len(names)
    extra = sorted((m for each in models.values() for m in each[1:]), key=lambda model: -model.log_odds)[:room]
    return {name: [m for m in each if m is each[0] or any(m is other for other in extra)] for name, each in models.items()}, ""


def _searched(
    members: Members, instrument: Instrument, poses: int, stream: np.random.Generator
) -> tuple[Entries, np.ndarray, list[int]]:
    """The experiment that leaves least entropy: its entries, their information, and the targets that are read."""
    criterion, reach = Criterion.of(members, stream), instrument.reach
    every = list(range(len(instrument.model.targets)))
    pool, looks = _STATES // len(reach.shares), (1 + _EXCHANGES) * poses
    share = min(1.0, _WORK / (criterion.work * (pool + looks * _SHORT_LIST)))
    short = max(int(share * _SHORT_LIST), 2 * poses)
    # Hypotheses of a hundred units each leave time for one pass over the shortest list alone.
    exchanges, radii = (_EXCHANGES, _RADII) if share * _SHORT_LIST >= poses else (0, ())
    entries = new_states.drawn(reach, max(int(share * pool), short), stream)
    entries, information = _short_list(criterion, instrument, entries, every, short, stream)
    chosen = _greedy(criterion, information, poses)
    for _ in range(exchanges):
        before = list(chosen)
        for place in range(poses):
            rest = [number for number in chosen if number != chosen[place]]
            left = criterion.left(information[rest].sum(axis=0) + information)
            left[rest] = np.inf
            chosen[place] = int(np.argmin(left))
        if chosen == before:
            break
    entries, information = entries.at(chosen), information[chosen]
    for radius in radii:
        tried = new_states.near(reach, entries, _NEIGHBOURS, radius, stream)
        gained = instrument.information(tried, every)
        numbers = np.arange(poses)
        both, known = entries.then(tried), np.concatenate([information, gained])
        for place in range(poses):
            mine = np.append(place, poses + _NEIGHBOURS * place + np.arange(_NEIGHBOURS))
            rest = known[np.delete(numbers, place)].sum(axis=0)
            numbers[place] = mine[int(np.argmin(criterion.left(rest + known[mine])))]
        entries, information = both.at(numbers), known[numbers]
    return _without_idle_targets(criterion, instrument, entries, information, every)


def _short_list(
    criterion: Criterion,
    instrument: Instrument,
    entries: Entries,
    targets: Sequence[int],
    count: int,
    stream: np.random.Generator,
) -> tuple[Entries, np.ndarray]:
    """Half of a short list by what entries tell alone, half at random."""
    left, size = [], max(int(_MEMORY / instrument.unknowns**2), 1)
    for start in range(0, len(entries), size):
        part = entries.at(np.arange(start, min(start + size, len(entries))))
        left.append(criterion.left(instrument.information(part, targets)))
    order = np.argsort(np.concatenate(left), kind="stable")
    half = count // 2
    kept = entries.at(np.concatenate([order[:half], stream.permutation(order[half:])[: count - half]]))
    return kept, instrument.information(kept, targets)


def _without_idle_targets(
    criterion: Criterion, instrument: Instrument, entries: Entries, information: np.ndarray, targets: list[int]
) -> tuple[Entries, np.ndarray, list[int]]:
    """Leave out targets on further points that are not worth mounting."""
    nothing = np.zeros((1, *information.shape[1:]))
    start = criterion.left(nothing)[0]
    for point in instrument.extra_points:
        fewer = [target for target in targets if target != point]
        less = instrument.information(entries, fewer)
        with_it, without = (criterion.left(each.sum(axis=0)[None])[0] for each in (information, less))
        if without - with_it < _WORTH_A_TARGET * (start - with_it):
            targets, information = fewer, less
    return entries, information, targets


def _greedy(criterion: Criterion, information: np.ndarray, count: int) -> list[int]:
    """So many entries, each of which leaves least entropy after those before it."""
    chosen: list[int] = []
    for _ in range(count):
        left = criterion.left(information[chosen].sum(axis=0) + information)
        left[chosen] = np.inf
        chosen.append(int(np.argmin(left)))
    return chosen


def _present_separation(linearized: Linearized, found: Model, alternative: Model, factor: float) -> float:
    """What the present measurements separate an effect as large as the one found from a model that is fitted to it."""
    problem = linearized.problem
    statistics = problem.statistics
    at = statistics.nearest(found.pose_error_rad)
    gram, along = statistics.gram[at] / factor**2, statistics.along[at] / factor**2

    def of(model: Model) -> tuple[np.ndarray, np.ndarray]:
        columns, deviations = problem.columns_of(model.units, factor * model.scales)
        return columns, gram[np.ix_(columns, columns)] + np.diag(deviations**-2)

    mine, inner = of(found)
    value = np.linalg.solve(inner, along[mine])
    others, inner = of(alternative)
    seen = gram[np.ix_(others, mine)] @ value
    return float(value @ gram[np.ix_(mine, mine)] @ value - seen @ np.linalg.solve(inner, seen))
