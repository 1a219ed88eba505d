"""From the posterior alone: which mechanisms, with which probability, and the one word that follows.

A hypothesis is a set of mechanisms, whatever their locations. `OTHER` beside a mechanism means that a related mechanism acts;
`OTHER` alone, that the catalogue does not have what acts.

A class lists the credible set of highest posterior probability [1] and what the measurements alone favour; the probability of
a mechanism is its posterior inclusion probability [2], summed over hypotheses.

[1] Box, G. E. P. and Tiao, G. C., Bayesian Inference in Statistical Analysis, Addison-Wesley, 1973.
[2] Barbieri, M. M. and Berger, J. O., Optimal predictive model selection, Annals of Statistics 32, 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.hypotheses import OTHER

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.diagnosis.alarm import Alarm
    from elastocal.diagnosis.search import Posterior, Problem

ADEQUATE, NAMED, CLASS, SEVERAL = "adequate", "named", "class", "several"
UNEXPLAINED, NOT_TESTABLE = "unexplained", "not_testable"
# Family of what any measurements test, even of a single pose: that nothing of it shows says nothing of the robot.
_OF_THE_SETUP = "drift"


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

    Returns adequate: no alarm. named: one mechanism, with at least the probability that the settings ask for, and favoured over
    each other one by the measurements alone. class: one mechanism, but which of some, or whether a related one, remains
    ambiguous. several: more than one mechanism. unexplained: something acts that the catalogue does not have, or that no model
    explains better than "nothing" does. not_testable: the measurements can test no mechanism of the robot, and nothing of the
    set-up shows.
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
    # The alarm has decided that something is missing; the posterior says what: nothing of the catalogue, one mechanism or more.
    there = [h for h in hypotheses if h.mechanisms]
    if nothing.probability >= settings.credible:
        return Conclusion(UNEXPLAINED, hypotheses, nothing, {}, mechanisms)
    weights = [sum(h.probability for h in there if h.kind == kind) for kind in (UNEXPLAINED, CLASS, SEVERAL)]
    kind = (UNEXPLAINED, CLASS, SEVERAL)[int(np.argmax(weights))]
    best = next(h for h in there if h.kind == kind)
    if kind == UNEXPLAINED:
        return Conclusion(UNEXPLAINED, hypotheses, best, {}, mechanisms)
    total = sum(weights)
    favoured = _favoured_instead(problem, posterior, best, there) if kind == CLASS else ()
    sure = best.probability >= settings.named_probability and not favoured
    if kind == CLASS and OTHER not in best.mechanisms and sure:
        return Conclusion(NAMED, hypotheses, best, dict.fromkeys(best.named, ()), mechanisms)
    credible = _credible(there, settings.credible * total)
    credible += tuple(hypothesis for hypothesis in favoured if hypothesis not in credible)
    return Conclusion(kind, hypotheses, best, {name: _instead_of(name, best, credible) for name in best.named}, mechanisms)


def _favoured_instead(
    problem: Problem, posterior: Posterior, best: Hypothesis, hypotheses: Iterable[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Other single mechanisms under which the measurements are at least as probable, each at its best location.

    The best has only its prior over these, which goes by how many locations and laws each has: no name rests on that alone.
    """

    def log_bayes_factor(hypothesis: Hypothesis) -> float:
        model = posterior.models[hypothesis.model]
        return model.log_odds - problem.prior.log_odds_of(problem.units[number] for number in model.units)

    single = [h for h in hypotheses if len(h.mechanisms) == 1 and h.model >= 0 and h != best]
    return tuple(h for h in single if log_bayes_factor(h) >= log_bayes_factor(best))


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
    for number, (model, probability) in enumerate(zip(posterior.models, posterior.probabilities, strict=True)):
        names = tuple(sorted({problem.units[unit].mechanism for unit in model.units}))
        held, best = found.get(names, (0.0, number))
        found[names] = held + float(probability), number if best < 0 else best
    ranked = sorted(found.items(), key=lambda item: -item[1][0])
    return tuple(Hypothesis(names, probability, model) for names, (probability, model) in ranked)


def location_probabilities(problem: Problem, posterior: Posterior, mechanism: str) -> dict[tuple[int | str, ...], float]:
    """Probability of each location of a mechanism, given that it is there."""
    total = 0.0
    found: dict[tuple[int | str, ...], float] = {}
    for model, probability in zip(posterior.models, posterior.probabilities, strict=True):
        # In the order of the units: equally probable ones keep it, and that of a set differs from one process to the next.
        locations = dict.fromkeys(problem.units[n].location for n in model.units if problem.units[n].mechanism == mechanism)
        total += probability if locations else 0.0
        for location in locations:
            found[location] = found.get(location, 0.0) + float(probability)
    return {location: value / total for location, value in sorted(found.items(), key=lambda entry: -entry[1])}


def _credible(hypotheses: list[Hypothesis], probability: float) -> list[Hypothesis]:
    """Smallest set of hypotheses, in falling order, that holds a probability."""
    reached = np.cumsum([h.probability for h in hypotheses])
    return hypotheses[: int(np.searchsorted(reached, probability)) + 1]


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
