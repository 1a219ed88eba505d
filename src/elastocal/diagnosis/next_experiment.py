"""The next experiment: poses and loads after which the measurements, most probably, say which hypothesis holds.

The experiment that leaves the least entropy between the models of the posterior ([1], `alternatives`) is looked for greedily,
then by Fedorov's exchange [2] in its modified form, each pose in turn against all of a short list [3], then by random local
search in angles, directions of loads and approaches. What is promised of it is simulated, by the same models.

[1] Lindley, D. V., On a measure of the information provided by an experiment, Annals of Mathematical Statistics 27, 1956.
[2] Fedorov, V. V., Theory of Optimal Experiments, Academic Press, 1972.
[3] Cook, R. D. and Nachtsheim, C. J., A comparison of algorithms for constructing exact D-optimal designs, Technometrics 22,
    1980.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.counting import counted
from elastocal.diagnosis import new_states
from elastocal.diagnosis.alternatives import (
    HALF_RESOLVED,
    MOST_POSES,
    WANTED_PROBABILITY,
    Criterion,
    Promise,
    alternatives_of,
)
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.refit import mean_square_left
from elastocal.diagnosis.verdict import ADEQUATE, NAMED, NOT_TESTABLE, mechanisms_of_models
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pandas as pd

    from elastocal.diagnosis.alternatives import Alternative
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.findings import Evidence
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.new_states import Entries, Instrument
    from elastocal.diagnosis.search import Model
    from elastocal.diagnosis.settings import Settings
    from elastocal.mechanics.robot import Robot

    _Name = tuple[str, ...]

# Said where nothing within reach helps.
NOT_DISTINGUISHABLE = "not distinguishable with this robot and tracker"
NOTHING_MISSING, NOTHING_AMBIGUOUS = "nothing is missing", "nothing is ambiguous"
DATA_AT_FAULT, NOTHING_TESTABLE = "the data are at fault", "the measurements can test no mechanism"
# States that are looked at, and entries among them that greedy search and exchange choose from: as many by what they tell alone
# as at random, for some tell only together with others.
_STATES, _SHORT_LIST = 10_000, 300
# Multiplications that the search may take: fewer entries are looked at where models have hundreds of unknowns. And numbers in
# memory at once.
_WORK, _MEMORY = 4e9, 5e5
# Models that stand for the hypotheses; the others hold a few per cent.
_MODELS, _HYPOTHESES = 12, 8
# Standard deviations of the steps in the joint angles, and neighbours tried with each.
_RADII, _NEIGHBOURS = (0.5, 0.2, 0.08), 24
_EXCHANGES = 2
# Targets on further points are not asked for where they bring less than this share of the fall of the entropy.
_WORTH_A_TARGET = 0.05


@dataclass(frozen=True)
class Proposal:
    """Poses to measure next, in the order of their worth, and what they promise; arrays of E, empty where nothing helps.

    `best`: mechanisms of the best hypothesis. `indistinguishable`: alternatives that no experiment within reach distinguishes
    from the best; they do not count in the promise. `reason`: why there is nothing to measure; empty where there is. `nearest`:
    of the alternative with the smallest separation. `entries`: poses and loads. `senses` (E, n): in which to approach each
    joint; None where the campaign does not note it, or where a ladder is given: then any. `shares`: of its load at which each
    pose is read; a weight hangs at their absolute values. `points`: measuring points at which targets are read in every pose.
    `separation` (E,): from the nearest alternative, by measurements of this pose and all before it: at most twice the log Bayes
    factor that they bring for the true hypothesis on average; 16 gives it odds of 19:1 from even ones with 90 %. `resolved`
    (E,): probability that after this pose the right hypothesis has 95 %, those in `indistinguishable` aside. `present`:
    separation from the nearest alternative that the present measurements give to an effect as large as the one found.
    `poses_needed`: for `resolved` of 90 %, if further poses tell as much as these; None where a hundred are not enough.
    """

    best: _Name
    indistinguishable: tuple[_Name, ...] = ()
    reason: str = ""
    nearest: _Name = ()
    entries: Entries | None = None
    senses: np.ndarray | None = None
    shares: tuple[float, ...] = ()
    points: tuple[str, ...] = ()
    separation: np.ndarray = field(default_factory=lambda: np.zeros(0))
    resolved: np.ndarray = field(default_factory=lambda: np.zeros(0))
    present: float = 0.0
    poses_needed: int | None = None

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

    `joint_limits` (n, 2): rad. `ladder`: shares of its load at which each pose is read, at the targets of the campaign and with
    any approach. Without, each is read without its load, under it and, where the campaign has such, under the opposite one;
    sizes and levers of the load, a reference weight, targets on further points and the side of the approach are chosen.
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
    of_load_cell = any(problem.units[number].of_load_cell for number in numbers)
    reach = new_states.reach_of(states, case.campaign.robot, joint_limits, ladder, of_load_cell)
    lead = kept[best][0]
    factor = float(np.sqrt(max(mean_square_left(problem, lead), 1.0)))
    noise = replace(evidence.linearized.about.noise.scaled(factor), pose_rad=factor * lead.pose_error_rad)
    instrument = new_states.instrument_of(evidence.linearized, diagnosis.final, numbers, noise, states, reach, ladder is None)
    models = alternatives_of(evidence, kept, instrument, lead, factor)
    entries, information, targets = _searched(models, instrument, poses, stream)
    if not reach.free:
        # Nobody is asked to approach from the sides with which the search was lucky.
        entries = replace(entries, approach=new_states.approaches(reach, poses, stream))
        information = instrument.information(entries, targets)
    promise = Promise(models, stream)
    apart = promise.separations(promise.log_factors(information.sum(axis=0) * (MOST_POSES / poses)))
    unreachable = tuple(name for name, far in zip(promise.names[1:], apart[1:], strict=True) if far < HALF_RESOLVED)
    models = [model for model in models if model.name not in unreachable]
    promise = Promise(models, stream)
    # What is distinguishable from the best holds no more probability than is left open where nothing is ambiguous.
    if np.exp(promise.log_prior[0]) >= settings.credible:
        return Proposal(best, unreachable, NOT_DISTINGUISHABLE)
    order = _greedy(Criterion(models, stream), information, poses)
    entries, totals = entries.at(order), np.cumsum(information[order], axis=0)
    factors = [promise.log_factors(total) for total in totals]
    separations = np.array([promise.separations(logs)[1:] for logs in factors])
    resolved = np.array([promise.resolved(logs) for logs in factors])
    nearest = promise.names[1 + int(np.argmin(separations[-1]))]
    return Proposal(
        best,
        unreachable,
        "",
        nearest,
        entries,
        entries.approach[:, 0] if reach.free and entries.approach is not None else None,
        reach.shares,
        tuple(dict.fromkeys(instrument.model.targets[target].point for target in targets)),
        separations.min(axis=1),
        resolved,
        _present_separation(evidence.linearized, lead, kept[nearest][0], factor),
        promise.poses_needed(totals[-1], resolved),
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
    models: Sequence[Alternative], instrument: Instrument, poses: int, stream: np.random.Generator
) -> tuple[Entries, np.ndarray, list[int]]:
    """The experiment that leaves least entropy: its entries, their information, and the targets that are read."""
    criterion, reach = Criterion(models, stream), instrument.reach
    targets = list(range(len(instrument.model.targets)))
    pool, looks = _STATES // len(reach.shares), (1 + _EXCHANGES) * poses
    share = min(1.0, _WORK / (criterion.work * (pool + looks * _SHORT_LIST)))
    short = max(int(share * _SHORT_LIST), 2 * poses)
    # Hypotheses of a hundred units each leave time for one pass over the shortest list alone.
    exchanges, radii = (_EXCHANGES, _RADII) if share * _SHORT_LIST >= poses else (0, ())
    entries = new_states.drawn(reach, max(int(share * pool), short), stream)
    size = max(int(_MEMORY / instrument.unknowns**2), 1)
    parts = [entries.at(np.arange(start, min(start + size, len(entries)))) for start in range(0, len(entries), size)]
    alone = np.concatenate([criterion.left(instrument.information(part, targets)) for part in parts])
    order, half = np.argsort(alone, kind="stable"), short // 2
    entries = entries.at(np.concatenate([order[:half], stream.permutation(order[half:])[: short - half]]))
    information = instrument.information(entries, targets)
    chosen = _greedy(criterion, information, poses)
    for _ in range(exchanges):
        before = list(chosen)
        for place in range(poses):
            rest = [number for number in chosen if number != chosen[place]]
            chosen[place] = _best_beside(criterion, information, rest)
        if chosen == before:
            break
    entries, information = entries.at(chosen), information[chosen]
    for radius in radii:
        tried = new_states.near(reach, entries, _NEIGHBOURS, radius, stream)
        both, known = entries.then(tried), np.concatenate([information, instrument.information(tried, targets)])
        numbers = np.arange(poses)
        for place in range(poses):
            mine = np.append(place, poses + _NEIGHBOURS * place + np.arange(_NEIGHBOURS))
            rest = known[np.delete(numbers, place)].sum(axis=0)
            numbers[place] = mine[int(np.argmin(criterion.left(rest + known[mine])))]
        entries, information = both.at(numbers), known[numbers]
    # Targets on further points are left out that are not worth mounting.
    start = criterion.left(np.zeros((1, *information.shape[1:])))[0]
    for point in instrument.extra_points:
        fewer = [target for target in targets if target != point]
        less = instrument.information(entries, fewer)
        with_it, without = criterion.left(np.array([information.sum(axis=0), less.sum(axis=0)]))
        if without - with_it < _WORTH_A_TARGET * (start - with_it):
            targets, information = fewer, less
    return entries, information, targets


def _best_beside(criterion: Criterion, information: np.ndarray, chosen: list[int]) -> int:
    """The entry that leaves least entropy beside those chosen."""
    left = criterion.left(information[chosen].sum(axis=0) + information)
    left[chosen] = np.inf
    return int(np.argmin(left))


def _greedy(criterion: Criterion, information: np.ndarray, count: int) -> list[int]:
    """So many entries, each of which leaves least entropy after those before it."""
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(_best_beside(criterion, information, chosen))
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


def table_of(proposal: Proposal, robot: Robot) -> pd.DataFrame:
    """The proposal as whoever drives the robot wants it.

    Returns one row for each pose; joint angles as the controller reports them (rad), ``load`` 1 where it is loaded,
    ``separation`` and ``resolved`` after it and all before, ``separation_without`` from the present measurements, and what the
    promise leaves aside as ``indistinguishable``; ``approach1..n`` where the campaign has them and ``reference_weight_kg``
    where a weight is asked for.
    """
    import pandas as pd

    count, entries = len(proposal), proposal.entries
    angles, wrench = (entries.joint_angles, entries.wrench) if entries else (np.zeros((0, robot.joints)), np.zeros((0, 6)))
    reported = robot.reported_angles(angles) if entries else angles
    columns: dict[str, Any] = {
        "effect": [f"{words(proposal.best)} or {words(proposal.nearest)}"] * count,
        "pose": np.arange(count),
        "load": wrench.any(axis=1).astype(int),
        "point": [" ".join(proposal.points)] * count,
        **{f"q{joint + 1}": reported[:, joint] for joint in range(robot.joints)},
        **dict(zip(WRENCH_NAMES, wrench.T, strict=True)),
        "separation": proposal.separation,
        "separation_without": np.full(count, proposal.present),
        "resolved": proposal.resolved,
        "indistinguishable": ["; ".join(words(name) for name in proposal.indistinguishable)] * count,
    }
    if proposal.senses is not None:
        columns |= {f"approach{joint + 1}": proposal.senses[:, joint] for joint in range(robot.joints)}
    if entries and entries.weighed.any():
        mass = np.linalg.norm(wrench[:, :3], axis=1) / standard_gravity
        columns["reference_weight_kg"] = np.where(entries.weighed, mass, 0.0)
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
        "poses_needed": proposal.poses_needed,
        "indistinguishable": [list(name) for name in proposal.indistinguishable],
        "sentence": sentence_of(proposal),
    }


def sentence_of(proposal: Proposal) -> str:
    """What the report says of the next experiment."""
    aside = "".join(f" {sentence}" for sentence in _left_aside(proposal))
    if proposal.reason == NOT_DISTINGUISHABLE:
        return f"No further measurement is proposed.{aside}"
    if proposal.reason:
        return f"No further measurement is proposed: {proposal.reason}."
    needed = counted(proposal.poses_needed, "pose") if proposal.poses_needed else f"more than {MOST_POSES} poses"
    shares = ", ".join(f"{share:g}" for share in proposal.shares)
    return (
        f"{counted(len(proposal), 'further pose')}, each measured at {shares} times its load, separate "
        f"{words(proposal.best)} from {words(proposal.nearest)} by "
        f"{proposal.separation[-1]:.1f} and resolve the verdict at 19:1 with a probability of {proposal.resolved[-1]:.0%}; "
        f"{WANTED_PROBABILITY:.0%} needs {needed}.{aside}"
    )


def words(mechanisms: Sequence[str]) -> str:
    """A hypothesis in words: joint_tilt, payload and link_weight, joint_tilt or a related mechanism."""
    named = [name for name in mechanisms if name != OTHER]
    if not named:
        return "a mechanism that the catalogue lacks"
    return " and ".join(named) + (" with a related mechanism" if OTHER in mechanisms else "")


def _left_aside(proposal: Proposal) -> Iterator[str]:
    """Sentences on the alternatives that nothing within reach distinguishes from the best: instead of it, or beside it."""
    best = set(proposal.best)
    instead = [words(name) for name in proposal.indistinguishable if not set(name) > best or OTHER in set(name) - best]
    beside = dict.fromkeys(
        mechanism
        for name in proposal.indistinguishable
        if set(name) > best
        for mechanism in name
        if mechanism not in best and mechanism != OTHER
    )
    if instead:
        yield f"{words(proposal.best)} and {', '.join(instead)} are {NOT_DISTINGUISHABLE}."
    if beside:
        yield f"Whether {' or '.join(beside)} acts beside {words(proposal.best)} is {NOT_DISTINGUISHABLE}."
