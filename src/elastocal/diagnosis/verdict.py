"""From the posterior alone: which mechanisms, with which probability, the one word that
follows, and how verdict.json says it.

A hypothesis is a set of mechanisms, whatever their locations. `OTHER` beside a
mechanism means that a related mechanism acts; `OTHER` alone, that the catalogue does
not have what acts.

The probability of a mechanism is its posterior inclusion probability (Barbieri and
Berger, Annals of Statistics 2004), summed over hypotheses. A law is never quite that of
the machine: what the smooth error adds to a mechanism counts as the mechanism itself
while it is small beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.counting import pluralize
from elastocal.data_checks.protocol import OF_DATA, Fault
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.model_averaging import ModelAverage, compute_extra_squares
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import Candidate, Parameter, Shape
from elastocal.effects.sizes import lever_m
from elastocal.fitting.linearization import compute_effect_sensitivities
from elastocal.fitting.model import get_joint_compliances

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from elastocal.diagnosis.alarm import Alarm
    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.search import Posterior, ScoredModel, SearchProblem
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations
    from elastocal.remainder.repeatable import Repeatable

Location = tuple[int | str, ...]
ADEQUATE = "adequate"
NAMED = "named"
CLASS = "class"
SEVERAL = "several"
UNEXPLAINED = "unexplained"
NOT_TESTABLE = "not_testable"
# Family of what any measurements test, even of a single pose: that nothing of it shows
# says nothing of the robot.
_OF_THE_SETUP = "drift"
# Models below this move no probability that is stated; hypotheses and locations below
# this are not listed.
_TELLING = 1e-3
# Standard errors beyond which a value is taken at its word, and times the plausible
# size that no machine reaches.
_SURE = 2.0
_IMPLAUSIBLE = 3.0
# Units of masses and first moments, and of their products with a compliance; what of an
# entry goes with them.
_OF_MASS = {"kg": "rad kg/(N m)", "kg m": "rad kg m/(N m)"}
_SCALED = ("value", "std_error", "prior_std")


@dataclass(frozen=True)
class Hypothesis:
    """A set of mechanisms in the order of their names, empty for "nothing"; `model`:
    its most probable one in the posterior."""

    mechanisms: tuple[str, ...]
    probability: float
    model: int

    @property
    def named(self) -> tuple[str, ...]:
        """Its mechanisms of the catalogue."""
        return tuple(name for name in self.mechanisms if name != OTHER)


@dataclass(frozen=True)
class Conclusion:
    """What the posterior says.

    `hypotheses`: the most probable first; "nothing" among them. `best`: the most
    probable in accordance with the alarm: "nothing" without one. `alternatives`: for
    each mechanism of the best hypothesis what may be meant instead. `mechanisms`:
    probability that each mechanism is there, in falling order. `probability`: that one
    of the hypotheses which the verdict leaves open is right; None where nothing was
    tested.
    """

    verdict: str
    hypotheses: tuple[Hypothesis, ...]
    best: Hypothesis
    alternatives: dict[str, tuple[str, ...]]
    mechanisms: dict[str, float]
    probability: float | None


@dataclass(frozen=True)
class Evidence:
    """What the last linearisation of a diagnosis says; None of it where the data are at
    fault.

    `adopted`: whether the effects found enter the model. `settled`: whether a further
    linearisation would find the same. `fitted`: the model found, to what the search
    looks at. `tested`: the last fit asked for what it leaves, and that.
    """

    linearized: CandidateDesign
    posterior: Posterior
    alarm: Alarm
    conclusion: Conclusion
    adopted: bool
    settled: bool
    fitted: Fit
    tested: tuple[Fit, Repeatable | None] | None


def concluded(problem: SearchProblem, posterior: Posterior, alarm: Alarm) -> Conclusion:
    """State the verdict: adequate without an alarm; named: one mechanism alone; class:
    one, but which remains ambiguous, or whether a related one acts; several;
    unexplained: what the catalogue does not have, or no model explains better than
    "nothing" does; not_testable: the measurements can test no mechanism of the robot,
    and nothing of the set-up shows."""
    hypotheses = hypotheses_of(problem, posterior)
    nothing = next(h for h in hypotheses if not h.mechanisms)
    mechanisms: dict[str, float] = {}
    for name, probability in [
        (name, h.probability) for h in hypotheses for name in h.mechanisms
    ]:
        # Their sum may exceed one by rounding.
        mechanisms[name] = min(mechanisms.get(name, 0.0) + probability, 1.0)
    mechanisms = dict(sorted(mechanisms.items(), key=lambda entry: -entry[1]))
    families = {unit.candidate.family for unit in problem.terms if unit.candidate}
    if not families or not (families - {_OF_THE_SETUP} or alarm.raised):
        return Conclusion(NOT_TESTABLE, hypotheses, nothing, {}, mechanisms, None)
    if not alarm.raised:
        return Conclusion(
            ADEQUATE, hypotheses, nothing, {}, mechanisms, nothing.probability
        )
    # The alarm has decided that something is missing; the posterior says what: first
    # how many mechanisms, then which.
    there = [h for h in hypotheses if h.mechanisms]
    kinds = (UNEXPLAINED, CLASS, SEVERAL)
    of_kind = {
        kind: [h for h in there if min(len(h.named), 2) == number]
        for number, kind in enumerate(kinds)
    }
    kind = max(kinds, key=lambda kind: sum(h.probability for h in of_kind[kind]))
    best = next(iter(of_kind[kind]), nothing)
    sure, stated = _least_expected_loss(
        [best, *(h for h in there if h != best)], problem.settings
    )
    if not stated or kind == UNEXPLAINED:
        unknown = sum(h.probability for h in of_kind[UNEXPLAINED]) + (
            0.0 if stated else nothing.probability
        )
        return Conclusion(
            UNEXPLAINED,
            hypotheses,
            best if stated else nothing,
            {},
            mechanisms,
            unknown,
        )
    named = sure and kind == CLASS and OTHER not in best.mechanisms
    alternatives = {
        name: () if named else _instead_of(name, best, stated) for name in best.named
    }
    probability = min(
        best.probability if named else sum(h.probability for h in stated), 1.0
    )
    return Conclusion(
        NAMED if named else kind,
        hypotheses,
        best,
        alternatives,
        mechanisms,
        probability,
    )


def with_related(conclusion: Conclusion, doubted: Collection[str]) -> Conclusion:
    """The same where something related may act instead of some mechanisms, none of
    which is then stated alone."""
    related = {
        name
        for name, others in conclusion.alternatives.items()
        if name in doubted and OTHER not in others
    }
    found = {
        name: (*others, OTHER) if name in related else others
        for name, others in conclusion.alternatives.items()
    }
    alone = conclusion.verdict == NAMED and doubted
    return replace(
        conclusion, verdict=CLASS if alone else conclusion.verdict, alternatives=found
    )


def _least_expected_loss(
    ranked: Sequence[Hypothesis], settings: Settings
) -> tuple[bool, Sequence[Hypothesis]]:
    """Whether to state the first of some hypotheses alone, and which to state where
    not: a Bayes decision.

    A wrong name costs one, and so does a class that does not hold what is so; a class
    costs something by itself, and for each line. To state none costs what a missed
    effect does. `ranked`: without "nothing", which a class leaves open.
    """
    probability = np.array([hypothesis.probability for hypothesis in ranked])
    further = np.arange(len(ranked))
    missed = np.clip(probability.sum() - np.cumsum(probability), 0.0, None)
    classes = settings.ambiguity_loss + settings.width_loss * further + missed
    none = settings.missed_loss * probability.sum()
    alone = 1.0 - probability[0]
    worth = ranked[: int(np.argmin(classes)) + 1]
    return alone < classes.min(), worth if none > min(alone, classes.min()) else ()


def hypotheses_of(
    problem: SearchProblem, posterior: Posterior
) -> tuple[Hypothesis, ...]:
    """Probability of each set of mechanisms, the most probable first; "nothing" is
    always among them."""
    found: dict[tuple[str, ...], tuple[float, int]] = {(): (0.0, -1)}
    for number, (model, probability) in enumerate(
        zip(posterior.models, posterior.probabilities.tolist(), strict=True)
    ):
        names = tuple(sorted(_acting(problem, model, probability)))
        held, best = found.get(names, (0.0, number))
        found[names] = held + probability, number if best < 0 else best
    ranked = sorted(found.items(), key=lambda item: -item[1][0])
    return tuple(
        Hypothesis(names, probability, model) for names, (probability, model) in ranked
    )


def _acting(problem: SearchProblem, model: ScoredModel, probability: float) -> set[str]:
    """What a model says that acts: its mechanisms, and something unknown beside a
    smooth error.

    Neither is quite what the machine does: that counts as a part of the other which
    makes displacements that the other cannot make, but within the tolerance of laws.
    Nothing related to a mechanism acts where the smooth error is far larger.
    """
    names = {problem.terms[unit].mechanism for unit in model.term_indices}
    known = names - {OTHER}
    if not known or known == names or probability <= _TELLING:
        return names
    of_laws = problem.settings.law_tolerance**2
    of_unknown = problem.settings.smooth_tolerance**2
    (by_laws, beyond_unknown), (by_unknown, beyond_laws) = compute_extra_squares(
        problem, model, known
    )
    if beyond_laws < of_laws * by_laws:
        return known
    return (
        {OTHER}
        if beyond_unknown < of_laws * by_unknown or by_laws < of_unknown * by_unknown
        else names
    )


def locations_of(
    problem: SearchProblem, model: ScoredModel, mechanism: str
) -> list[Location]:
    """Where a mechanism acts in a model, in the order of the units: that of a set
    differs from one process to the next."""
    return list(
        dict.fromkeys(
            problem.terms[n].location
            for n in model.term_indices
            if problem.terms[n].mechanism == mechanism
        )
    )


def location_probabilities(
    problem: SearchProblem, posterior: Posterior, mechanism: str
) -> dict[Location, float]:
    """Probability of each location of a mechanism, given that it is there."""
    total = 0.0
    found = dict[Location, float]()
    for probability, model in zip(
        posterior.probabilities.tolist(), posterior.models, strict=True
    ):
        locations = locations_of(problem, model, mechanism)
        total += probability * bool(locations)
        found |= {
            location: found.get(location, 0.0) + probability for location in locations
        }
    return {
        location: value / total
        for location, value in sorted(found.items(), key=lambda entry: -entry[1])
    }


def _instead_of(
    name: str, best: Hypothesis, credible: Iterable[Hypothesis]
) -> tuple[str, ...]:
    """What stands instead of one mechanism in the other credible hypotheses."""
    each = [
        [
            other
            for other in h.mechanisms
            if other == name or other not in best.mechanisms
        ]
        for h in credible
        if h != best
    ]
    instead = [
        other
        for others in each
        if name not in others or {*others} == {name, OTHER}
        for other in others
    ]
    return tuple(
        dict.fromkeys(
            other
            for other in (*instead, *{OTHER}.intersection(best.mechanisms))
            if other != name
        )
    )


def contradictions(final: Fit, measured: Noise, settings: Settings) -> list[str]:
    """What forbids to call a declared model adequate, although no alarm is raised
    against it; a sentence for each.

    Noise that is estimated along with the model may swallow a misfit, and so may a
    parameter at a value that no robot has. `measured`: the noise as repeats or the
    sensor have it.
    """
    # Noise that somebody declared may be a guess, and a warning says that it is far
    # off.
    found = (
        scatter_warnings(final.noise, measured, settings.largest_scatter)
        if measured.source == "repeats"
        else []
    )
    found += pose_error_warnings(final.noise, settings.largest_pose_error_rad)
    if final.model.identifies_compliance:
        compliance = get_joint_compliances(final.model, final.estimate)
        deviation = np.sqrt(np.diag(final.covariance))[
            final.parameter_indices("joint_compliance")
        ]
        found += [
            f"the compliance of joint {joint + 1} is negative by {-compliance[joint] / deviation[joint]:.1f} standard errors"
            for joint in np.flatnonzero(
                compliance < -settings.negative_compliance * deviation
            )
        ]
    return found


def remainder_sentences(left: Repeatable | None) -> list[str]:
    """A sentence where what a model leaves is a function of the joints, so that no
    verdict covers it."""
    words = "µm RMS of what is left are a function of the joint angles and have no name"
    return (
        [f"{1e6 * left.rms_m:.0f} ± {1e6 * left.rms_std_error_m:.0f} {words}"]
        if left and left.remains
        else []
    )


def scatter_warnings(left: Noise, measured: Noise, least: float) -> list[str]:
    """A sentence where a model leaves at least so many times the noise that was
    measured or declared."""
    factor = left.position_m / measured.position_m
    reference = (
        "their repeats about each other"
        if measured.source == "repeats"
        else "the noise that is declared for them"
    )
    words = f"measurements scatter about the model {factor:.{0 if factor > 10 else 1}f} times as much as {reference}"
    return [words] if factor >= least else []


def pose_error_warnings(left: Noise, least_rad: float) -> list[str]:
    """A sentence where measurements of a pose have at least such an error in common."""
    words = f"measurements of a pose err together as if every joint were {1e6 * left.pose_rad:.0f} µrad off, which repeats of a"
    return (
        [f"{words} pose do not show: new poses will err as much"]
        if left.pose_rad >= least_rad
        else []
    )


def location_words(mechanism: str, location: Sequence[int | str]) -> str:
    """A location of a unit in words: joint 2, links 2 and 3, joint 4 orders 1-2."""
    joints, names = (
        [str(each) for each in location if isinstance(each, str) == named]
        for named in (False, True)
    )
    # Numbers count joints, or links, which begin at the joint of the same number.
    part = getattr(list_effects().get(mechanism), "part", "joint")
    where = f"{pluralize(part, len(joints))} {' and '.join(joints)}" if joints else ""
    return " ".join(filter(None, [where, *names])) or (
        "base" if mechanism == OTHER else ""
    )


def probability_facts(found: Evidence) -> dict[str, Any]:
    """Probabilities as they stand in verdict.json.

    Returns ``nothing``, ``stated``: that of what the verdict leaves open,
    ``alarm_p_value``, ``mechanisms`` by name, and ``sets`` of mechanisms with the
    locations of their most probable model.
    """
    problem = found.linearized.problem
    conclusion = found.conclusion
    models = found.posterior.models
    sets = []
    for each in (h for h in conclusion.hypotheses if h.probability >= _TELLING):
        where = {
            name: locations_of(problem, models[each.model], name)
            for name in each.mechanisms
        }
        words = {
            name: [location_words(name, at) for at in locations]
            for name, locations in where.items()
        }
        sets.append(
            {
                "mechanisms": list(each.mechanisms),
                "probability": each.probability,
                "locations": words,
            }
        )
    return {
        "nothing": next(
            h.probability for h in conclusion.hypotheses if not h.mechanisms
        ),
        "stated": conclusion.probability,
        "alarm_p_value": found.alarm.p_value,
        "mechanisms": {
            name: value
            for name, value in conclusion.mechanisms.items()
            if value >= _TELLING
        },
        "sets": sets,
    }


def effect_entries(
    found: Evidence, final: Fit, averages: ModelAverage, observations: Observations
) -> list[dict[str, Any]]:
    """Entries of the effects found, those of the most probable mechanisms first.

    `final`: of the most probable model. `averages`: what the other models add to it.
    `observations`: to which it was fitted.
    """
    problem = found.linearized.problem
    conclusion = found.conclusion
    numbers = (
        found.posterior.models[conclusion.best.model].term_indices
        if conclusion.best.named
        else ()
    )
    units = [problem.terms[number] for number in numbers]
    entries = []
    for name in sorted(
        conclusion.best.named, key=lambda name: -conclusion.mechanisms[name]
    ):
        members = [
            unit.candidate
            for unit in units
            if unit.candidate and unit.mechanism == name
        ]
        where = location_probabilities(problem, found.posterior, name)
        values = [
            entry
            for member in members
            for entry in parameter_entries(member, final, averages)
        ]
        entries.append(
            {
                "name": name,
                "family": members[0].family,
                "joints": sorted(
                    {joint for member in members for joint in member.joints}
                ),
                "members": [member.key for member in members],
                "probability": conclusion.mechanisms[name],
                "locations": [
                    {"location": location_words(name, at), "probability": value}
                    for at, value in where.items()
                    if value >= _TELLING
                ],
                "parameters": sag_entries(name, members, final, observations) + values,
                "p_value": found.alarm.p_value,
                "heldout_gain": None,
                "alternatives": list(conclusion.alternatives[name]),
                "adopted": found.adopted,
            }
        )
    return entries


def parameter_entries(
    member: Candidate, final: Fit, averages: ModelAverage
) -> list[dict[str, Any]]:
    """Parameters and shapes of one candidate in a fit.

    Where the compliances are those of the robot file a mass is given as its product
    with that of the joint that it turns most, which measurements tell.
    """
    effect = next(effect for effect in final.model.effects if effect.key == member.key)
    mine = final.parameter_indices(member.key)
    values = np.concatenate(final.effect_values(member.key))
    unknowns: list[Parameter | Shape] = [*effect.parameters, *effect.shapes]
    entries = [
        {
            "name": f"{member.key} {parameter.name}",
            "value": float(value)
            + averages.shift.get((member.key, parameter.name), 0.0),
            "std_error": averages.std_error.get(
                (member.key, parameter.name),
                float(np.sqrt(final.covariance[index, index])),
            ),
            "unit": parameter.unit,
            "prior_std": getattr(parameter, "prior_std", None),
            "held": bool(final.unidentifiable[index]),
            "identifiable": not final.unidentifiable[index]
            and (member.key, parameter.name) not in averages.prior_dominated,
        }
        # Where a shape has no slope, such as the row of a step, a search has chosen it.
        | (
            {"shape": True, "identifiable": True}
            if isinstance(parameter, Shape)
            else {}
        )
        for parameter, value, index in zip(unknowns, values, mine, strict=True)
    ]
    as_masses = final.model.identifies_compliance or member.family != "gravity"
    return (
        entries
        if as_masses
        else [
            _product(entry, final) if entry["unit"] in _OF_MASS else entry
            for entry in entries
        ]
    )


def _product(entry: dict[str, Any], final: Fit) -> dict[str, Any]:
    """The entry of a mass, or of a first moment, times the compliance of the joint that
    a weight at the end turns most."""
    sites = final.model.sites
    compliance = final.model.nominal_compliance
    turned = [
        c * lever_m(sites, j) if sites.carried_links(j) else 0.0
        for j, c in enumerate(compliance)
    ]
    joint = int(np.argmax(turned))
    owner, name = entry["name"].rsplit(" ", 1)
    scaled = {
        key: None if entry[key] is None else float(compliance[joint] * entry[key])
        for key in _SCALED
    }
    return (
        entry
        | scaled
        | {
            "name": f"{owner} compliance_of_joint_{joint + 1}_times_{name}",
            "unit": _OF_MASS[entry["unit"]],
        }
    )


def sag_entries(
    name: str, members: Sequence[Candidate], final: Fit, observations: Observations
) -> list[dict[str, Any]]:
    """How far an effect's weight, at all its locations, lets a target sag at most, m,
    where no masses are identified.

    Its standard error is by the delta method. Returns one entry; none where the effect
    is not of gravity.
    """
    if (
        members[0].family != "gravity"
        or final.model.identifies_compliance
        or final.joint_jacobian is None
    ):
        return []
    jacobian = final.joint_jacobian[:, :3]
    laws = [(member.displacement, ()) for member in members]
    around = final.get_conditions(observations.states)
    columns = compute_effect_sensitivities(laws, around, jacobian, observations.state)
    mine = np.concatenate([final.parameter_indices(member.key) for member in members])
    sag = columns @ np.concatenate(
        [final.effect_values(member.key)[0] for member in members]
    )
    most = int(np.argmax((sag**2).sum(axis=1)))
    size = float(np.linalg.norm(sag[most]))
    along = sag[most] @ columns[most] / max(size, np.finfo(float).tiny)
    error = float(np.sqrt(along @ final.covariance[np.ix_(mine, mine)] @ along))
    found = {
        "name": f"{name} largest_sag",
        "value": size,
        "std_error": error,
        "unit": "m",
        "prior_std": None,
    }
    return [found | {"held": False, "identifiable": True}]


def fault_entry(fault: Fault) -> dict[str, Any]:
    """Entry of a fault of the data."""
    nothing: dict[str, Any] = {"members": [], "locations": [], "adopted": False}
    nothing |= dict.fromkeys(("probability", "p_value", "heldout_gain"))
    return nothing | {
        "name": fault.name,
        "family": OF_DATA,
        "joints": fault.joints,
        "detail": fault.detail,
        "parameters": [vars(value) | {"std_error": None} for value in fault.parameters],
        "alternatives": list(fault.alternatives),
        "evidence": [
            float(value) if np.isfinite(value) else None for value in fault.evidence
        ],
    }


def oversized(final: Fit, names: Collection[str]) -> set[str]:
    """Which of some effects have a parameter beyond what such an effect reaches: size
    or name is wrong."""
    some = [effect for effect in final.model.effects if effect.effect in names]
    return {
        effect.effect
        for effect in some
        if any(too_large for *_, too_large in _estimates(final, effect))
    }


def _estimates(
    final: Fit, effect: Candidate
) -> Iterator[tuple[float, float, Parameter, bool]]:
    """Value, standard error and kind of each parameter of an effect, its shapes aside,
    and whether it is too large."""
    errors = np.sqrt(np.diag(final.covariance)[final.parameter_indices(effect.key)])
    for value, error, parameter in zip(
        final.effect_values(effect.key)[0], errors, effect.parameters, strict=False
    ):
        yield (
            value,
            error,
            parameter,
            bool(abs(value) > _IMPLAUSIBLE * parameter.plausible + _SURE * error),
        )


def implausible(final: Fit, entries: Iterable[Mapping[str, Any]]) -> list[str]:
    """Warnings of parameters of `effect_entries` that nature does not allow."""
    fitted = {effect.key: effect for effect in final.model.effects}
    found = []
    for key in [key for entry in entries for key in entry["members"]]:
        for value, error, parameter, too_large in _estimates(final, fitted[key]):
            size = (
                f"{key}: {parameter.name} is {value:.3g} ± {error:.2g} {parameter.unit}"
            )
            if parameter.sign * value < -_SURE * error:
                found.append(
                    f"{size}, and by its physics {'positive' if parameter.sign > 0 else 'negative'}"
                )
            if too_large:
                found.append(
                    f"{size}, more than {_IMPLAUSIBLE:g} times what such an effect reaches"
                )
    return found
