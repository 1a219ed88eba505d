"""From the posterior alone: which mechanisms, with which probability, and the one word that follows.

A hypothesis is a set of mechanisms, whatever their locations. `OTHER` beside a mechanism means that a related mechanism acts;
`OTHER` alone, that the catalogue does not have what acts.

The probability of a mechanism is its posterior inclusion probability [1], summed over hypotheses. A law is never quite that of
the machine: what the smooth error adds to a mechanism counts as the mechanism itself while it is small beside it.

[1] Barbieri, M. M. and Berger, J. O., Optimal predictive model selection, Annals of Statistics 32, 2004.
[2] Berger, J. O., Statistical Decision Theory and Bayesian Analysis, section 1.3, Springer, 1985.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.averaging import squares_beyond
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.fitting.model import joint_compliances

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from elastocal.diagnosis.alarm import Alarm
    from elastocal.diagnosis.search import Model, Posterior, Problem
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.remainder.repeatable import Repeatable

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
    probability that each mechanism is there, in falling order. `probability`: that one of the hypotheses which the verdict
    leaves open is right; None where nothing was tested.
    """

    verdict: str
    hypotheses: tuple[Hypothesis, ...]
    best: Hypothesis
    alternatives: dict[str, tuple[str, ...]]
    mechanisms: dict[str, float]
    probability: float | None


def concluded(problem: Problem, posterior: Posterior, alarm: Alarm) -> Conclusion:
    """State the verdict.

    Returns adequate: no alarm. named: one mechanism, stated alone. class: one mechanism, but which of some, or whether a
    related one, remains ambiguous. several: more than one mechanism. unexplained: something acts that the catalogue does not
    have, or that no model explains better than "nothing" does. not_testable: the measurements can test no mechanism of the
    robot, and nothing of the set-up shows.
    """
    hypotheses = hypotheses_of(problem, posterior)
    nothing = next(h for h in hypotheses if not h.mechanisms)
    mechanisms: dict[str, float] = {}
    for name, probability in [(name, h.probability) for h in hypotheses for name in h.mechanisms]:
        # Their sum may exceed one by rounding.
        mechanisms[name] = min(mechanisms.get(name, 0.0) + probability, 1.0)
    mechanisms = dict(sorted(mechanisms.items(), key=lambda entry: -entry[1]))
    families = {unit.candidate.family for unit in problem.units if unit.candidate}
    if not families or not (families - {_OF_THE_SETUP} or alarm.raised):
        return Conclusion(NOT_TESTABLE, hypotheses, nothing, {}, mechanisms, None)
    if not alarm.raised:
        return Conclusion(ADEQUATE, hypotheses, nothing, {}, mechanisms, nothing.probability)
    # The alarm has decided that something is missing; the posterior says what: first how many mechanisms, then which.
    there = [h for h in hypotheses if h.mechanisms]
    kinds = (UNEXPLAINED, CLASS, SEVERAL)
    kind = max(kinds, key=lambda kind: sum(h.probability for h in there if h.kind == kind))
    best = next((h for h in there if h.kind == kind), nothing)
    sure, stated = _least_expected_loss([best, *(h for h in there if h != best)], problem.settings)
    if not stated or kind == UNEXPLAINED:
        unknown = sum(h.probability for h in there if h.kind == UNEXPLAINED) + (0.0 if stated else nothing.probability)
        return Conclusion(UNEXPLAINED, hypotheses, best if stated else nothing, {}, mechanisms, unknown)
    named = sure and kind == CLASS and OTHER not in best.mechanisms
    alternatives = {name: () if named else _instead_of(name, best, stated) for name in best.named}
    probability = min(best.probability if named else sum(h.probability for h in stated), 1.0)
    return Conclusion(NAMED if named else kind, hypotheses, best, alternatives, mechanisms, probability)


def with_related(conclusion: Conclusion, doubted: Collection[str]) -> Conclusion:
    """The same where something related may act instead of some mechanisms, none of which is then stated alone."""
    alternatives = {
        name: (*others, OTHER) if name in doubted and OTHER not in others else others
        for name, others in conclusion.alternatives.items()
    }
    alone = conclusion.verdict == NAMED and doubted
    return replace(conclusion, verdict=CLASS if alone else conclusion.verdict, alternatives=alternatives)


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
    """What each model says that acts, in the order of the names; empty for "nothing".

    Its mechanisms, and something unknown where it has a smooth error beside them. Neither a law nor the smooth error is quite
    what the machine does. So of the two that counts as a part of the other which makes displacements that the other cannot
    make, but within the tolerance of laws. Nothing related to a mechanism acts where the smooth error is far larger.
    """
    found, of_laws, of_unknown = [], problem.settings.law_tolerance**2, problem.settings.smooth_tolerance**2
    for model, probability in zip(posterior.models, posterior.probabilities, strict=True):
        names = {problem.units[unit].mechanism for unit in model.units}
        known = names - {OTHER}
        if known and known != names and probability > _TELLING:
            (by_laws, beyond_unknown), (by_unknown, beyond_laws) = squares_beyond(problem, model, known)
            if beyond_laws < of_laws * by_laws:
                names = known
            elif beyond_unknown < of_laws * by_unknown or by_laws < of_unknown * by_unknown:
                names = {OTHER}
        found.append(tuple(sorted(names)))
    return found


def locations_of(problem: Problem, model: Model, mechanism: str) -> list[tuple[int | str, ...]]:
    """Where a mechanism acts in a model, in the order of the units: that of a set differs from one process to the next."""
    return list(dict.fromkeys(problem.units[n].location for n in model.units if problem.units[n].mechanism == mechanism))


def location_probabilities(problem: Problem, posterior: Posterior, mechanism: str) -> dict[tuple[int | str, ...], float]:
    """Probability of each location of a mechanism, given that it is there."""
    where = [locations_of(problem, model, mechanism) for model in posterior.models]
    total = sum(p for p, locations in zip(posterior.probabilities, where, strict=True) if locations)
    found: dict[tuple[int | str, ...], float] = {}
    for probability, locations in zip(posterior.probabilities, where, strict=True):
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


def contradictions(final: Fit, measured: Noise, settings: Settings) -> list[str]:
    """What forbids to call a declared model adequate, although no alarm is raised against it; a sentence for each.

    The alarm asks whether a mechanism explains the measurements better than noise does. Noise that is estimated along with the
    model may swallow a misfit, and a parameter may do so at a value that no robot has. `measured`: the noise as repeats or the
    sensor have it, before the model was fitted.
    """
    # Noise that somebody declared may be a guess, and a warning says that it is far off.
    found = scatter_warnings(final.noise, measured, settings.largest_scatter) if measured.source == "repeats" else []
    found += pose_error_warnings(final.noise, settings.largest_pose_error_rad)
    if final.model.identifies_compliance:
        compliance = joint_compliances(final.model, final.estimate)
        deviation = np.sqrt(np.diag(final.covariance))[final.places_of("joint_compliance")]
        found += [
            f"the compliance of joint {joint + 1} is negative by {-compliance[joint] / deviation[joint]:.1f} standard errors"
            for joint in np.flatnonzero(compliance < -settings.negative_compliance * deviation)
        ]
    return found


def remainder_sentences(left: Repeatable | None) -> list[str]:
    """A sentence where what a model leaves is a function of the joints, so that no verdict covers it."""
    if left is None or not left.remains:
        return []
    size, error = 1e6 * left.rms_m, 1e6 * left.rms_std_error_m
    return [f"{size:.0f} ± {error:.0f} µm RMS of what is left are a function of the joint angles and have no name"]


def scatter_warnings(left: Noise, measured: Noise, least: float) -> list[str]:
    """A sentence where a model leaves at least so many times the noise that was measured or declared."""
    factor = left.position_m / measured.position_m
    if factor < least:
        return []
    reference = "their repeats about each other" if measured.source == "repeats" else "the noise that is declared for them"
    return [f"measurements scatter about the model {factor:.{0 if factor > 10 else 1}f} times as much as {reference}"]


def pose_error_warnings(left: Noise, least_rad: float) -> list[str]:
    """A sentence where measurements of a pose have at least such an error in common."""
    if left.pose_rad < least_rad:
        return []
    return [
        f"measurements of a pose err together as if every joint were {1e6 * left.pose_rad:.0f} µrad off, which repeats of a"
        " pose do not show: new poses will err as much"
    ]
