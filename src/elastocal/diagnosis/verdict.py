"""From the posterior alone: which mechanisms, with which probability, and the one word that follows.

A hypothesis is a set of mechanisms, whatever their locations. `OTHER` beside a mechanism means that a related mechanism acts;
`OTHER` alone, that the catalogue does not have what acts.

The probability of a mechanism is its posterior inclusion probability [1], summed over hypotheses. A law is never quite that of
the machine: what the smooth error adds to a mechanism counts as the mechanism itself while it is small beside it.

[1] Barbieri, M. M. and Berger, J. O., Optimal predictive model selection, Annals of Statistics 32, 2004.
[2] Berger, J. O., Statistical Decision Theory and Bayesian Analysis, section 1.3, Springer, 1985.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.averaging import squares_beyond
from elastocal.diagnosis.hypotheses import OTHER

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.diagnosis.alarm import Alarm
    from elastocal.diagnosis.search import Model, Posterior, Problem
    from elastocal.diagnosis.settings import Settings

ADEQUATE, NAMED, CLASS, SEVERAL = "adequate", "named", "class", "several"
UNEXPLAINED, NOT_TESTABLE = "unexplained", "not_testable"
# Family of what any measurements test, even of a single pose: that nothing of it shows says nothing of the robot.
_OF_THE_SETUP = "drift"
# Models below this move no probability that is stated.
_TELLING = 1e-3


@dataclass(frozen=True)
class Hypothesis:
    """A set of mechanisms.

    `mechanisms`: in the order of their names; empty for "nothing". `model`: number of its most probable model in the posterior.
    """

    mechanisms: tuple[str, ...]
    probability: float
    model: int

    @property
    def named(self) -> tuple[str, ...]:
        """Its mechanisms of the catalogue."""
        return tuple(name for name in self.mechanisms if name != OTHER)

    @property
    def kind(self) -> str:
        """Verdict to which it belongs: nothing of the catalogue, one mechanism of some, or more than one."""
        return (UNEXPLAINED, CLASS)[len(self.named)] if len(self.named) < 2 else SEVERAL


@dataclass(frozen=True)
class Conclusion:
    """What the posterior says.

    `hypotheses`: the most probable first; "nothing" among them. `best`: the most probable in accordance with the alarm:
    "nothing" without one. `alternatives`: for each mechanism of the best hypothesis what may be meant instead. `mechanisms`:
    probability that each mechanism is there, in falling order.
    """

    verdict: str
    hypotheses: tuple[Hypothesis, ...]
    best: Hypothesis
    alternatives: dict[str, tuple[str, ...]]
    mechanisms: dict[str, float]


def concluded(problem: Problem, posterior: Posterior, alarm: Alarm) -> Conclusion:
    """State the verdict.

    Returns adequate: no alarm. named: one mechanism, stated alone. class: one mechanism, but which of some, or whether a
    related one, remains ambiguous. several: more than one mechanism. unexplained: something acts that the catalogue does not
    have, or that no model explains better than "nothing" does. not_testable: the measurements can test no mechanism of the
    robot, and nothing of the set-up shows.
    """
    settings = problem.settings
    hypotheses = hypotheses_of(problem, posterior)
    nothing = next(h for h in hypotheses if not h.mechanisms)
    mechanisms = _marginal(hypotheses)
    tested = [unit for unit in problem.units if unit.mechanism != OTHER]
    of_the_robot = [unit for unit in tested if unit.candidate and unit.candidate.family != _OF_THE_SETUP]
    if not tested or not (of_the_robot or alarm.raised):
        return Conclusion(NOT_TESTABLE, hypotheses, nothing, {}, mechanisms)
    if not alarm.raised:
        return Conclusion(ADEQUATE, hypotheses, nothing, {}, mechanisms)
    # The alarm has decided that something is missing; the posterior says what: first how many mechanisms, then which.
    there = [h for h in hypotheses if h.mechanisms]
    weights = [sum(h.probability for h in there if h.kind == kind) for kind in (UNEXPLAINED, CLASS, SEVERAL)]
    kind = (UNEXPLAINED, CLASS, SEVERAL)[int(np.argmax(weights))]
    best = next((h for h in there if h.kind == kind), nothing)
    sure, stated = _least_expected_loss([best, *(h for h in there if h != best)], settings)
    if not stated or kind == UNEXPLAINED:
        return Conclusion(UNEXPLAINED, hypotheses, best if stated else nothing, {}, mechanisms)
    named = sure and kind == CLASS and OTHER not in best.mechanisms
    alternatives = {name: () if named else _instead_of(name, best, stated) for name in best.named}
    return Conclusion(NAMED if named else kind, hypotheses, best, alternatives, mechanisms)


def _least_expected_loss(ranked: Sequence[Hypothesis], settings: Settings) -> tuple[bool, Sequence[Hypothesis]]:
    """Whether to state the first of some hypotheses alone, and which to state where not: a Bayes decision [2].

    A wrong name costs one, and so does a class that does not hold what is so; a class costs something by itself, and for each
    line. To state none costs what a missed effect does. `ranked`: without "nothing", which a class leaves open.
    """
    probability = np.array([hypothesis.probability for hypothesis in ranked])
    further, missed = np.arange(len(ranked)), np.clip(probability.sum() - np.cumsum(probability), 0.0, None)
    classes = settings.ambiguity_loss + settings.width_loss * further + missed
    none, alone = settings.missed_loss * probability.sum(), 1.0 - probability[0]
    worth = ranked[: int(np.argmin(classes)) + 1]
    return alone < classes.min(), worth if none > min(alone, classes.min()) else ()


def _marginal(hypotheses: Iterable[Hypothesis]) -> dict[str, float]:
    """Probability of each mechanism, in falling order."""
    present: dict[str, float] = {}
    for hypothesis in hypotheses:
        for mechanism in hypothesis.mechanisms:
            # Their sum may exceed one by rounding.
            present[mechanism] = min(present.get(mechanism, 0.0) + hypothesis.probability, 1.0)
    return dict(sorted(present.items(), key=lambda entry: -entry[1]))


def hypotheses_of(problem: Problem, posterior: Posterior) -> tuple[Hypothesis, ...]:
    """Probability of each set of mechanisms.

    Returns the most probable first; "nothing" is always among them.
    """
    found: dict[tuple[str, ...], tuple[float, int]] = {(): (0.0, -1)}
    stated = zip(mechanisms_of_models(problem, posterior), posterior.probabilities, strict=True)
    for number, (names, probability) in enumerate(stated):
        held, best = found.get(names, (0.0, number))
        found[names] = held + float(probability), number if best < 0 else best
    ranked = sorted(found.items(), key=lambda item: -item[1][0])
    return tuple(Hypothesis(names, probability, model) for names, (probability, model) in ranked)


def mechanisms_of_models(problem: Problem, posterior: Posterior) -> list[tuple[str, ...]]:
    """What each model says that acts, in the order of the names; empty for "nothing"."""
    pairs = zip(posterior.models, posterior.probabilities, strict=True)
    return [tuple(sorted(_mechanisms_of(problem, model, probability))) for model, probability in pairs]


def _mechanisms_of(problem: Problem, model: Model, probability: float) -> set[str]:
    """What a model says that acts: its mechanisms, and something unknown where it has a smooth error beside them.

    Neither a law nor the smooth error is quite what the machine does. So of the two that counts as a part of the other which
    makes displacements that the other cannot make, but within the tolerance of laws.
    """
    names = {problem.units[unit].mechanism for unit in model.units}
    known = names - {OTHER}
    if OTHER not in names or not known or probability <= _TELLING:
        return names
    (by_laws, beyond_unknown), (by_unknown, beyond_laws) = squares_beyond(problem, model, known)
    tolerance = problem.settings.law_tolerance**2
    if beyond_laws < tolerance * by_laws:
        return known
    return {OTHER} if beyond_unknown < tolerance * by_unknown else names


def locations_of(problem: Problem, model: Model, mechanism: str) -> list[tuple[int | str, ...]]:
    """Where a mechanism acts in a model, in the order of the units: that of a set differs from one process to the next."""
    return list(dict.fromkeys(problem.units[n].location for n in model.units if problem.units[n].mechanism == mechanism))


def location_probabilities(problem: Problem, posterior: Posterior, mechanism: str) -> dict[tuple[int | str, ...], float]:
    """Probability of each location of a mechanism, given that it is there."""
    total = 0.0
    found: dict[tuple[int | str, ...], float] = {}
    for model, probability in zip(posterior.models, posterior.probabilities, strict=True):
        locations = locations_of(problem, model, mechanism)
        total += probability if locations else 0.0
        for location in locations:
            found[location] = found.get(location, 0.0) + float(probability)
    return {location: value / total for location, value in sorted(found.items(), key=lambda entry: -entry[1])}


def _instead_of(name: str, best: Hypothesis, credible: Iterable[Hypothesis]) -> tuple[str, ...]:
    """What stands instead of one mechanism in the other credible hypotheses."""
    rest = set(best.mechanisms) - {name}
    found: list[str] = []
    for hypothesis in credible:
        others = set(hypothesis.mechanisms) - rest
        if hypothesis != best and name not in others:
            found += [other for other in hypothesis.mechanisms if other in others and other not in found]
        if hypothesis != best and others == {name, OTHER} and OTHER not in found:
            found.append(OTHER)
    if OTHER in best.mechanisms and OTHER not in found:
        found.append(OTHER)
    return tuple(found)
