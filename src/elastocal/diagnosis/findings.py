"""What was found, as people and files want it: effects with parameters, probabilities and what else may be meant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.counting import plural
from elastocal.data_checks.protocol import OF_DATA
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.verdict import location_probabilities, locations_of
from elastocal.effects.catalogue import effects
from elastocal.effects.protocol import Shape
from elastocal.effects.sizes import lever_m
from elastocal.fitting.linearization import effect_columns

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from elastocal.data_checks.protocol import Fault
    from elastocal.diagnosis.alarm import Alarm
    from elastocal.diagnosis.averaging import Averaged
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.search import Posterior
    from elastocal.diagnosis.verdict import Conclusion
    from elastocal.effects.protocol import Candidate, Parameter
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Model
    from elastocal.fitting.observations import Observations

# Hypotheses and locations with less than this are not listed.
_LEAST_LISTED = 0.001
# Standard errors beyond which a value is taken at its word, and times the plausible size that no machine reaches.
_SURE, _IMPLAUSIBLE = 2.0, 3.0
# Units of masses and first moments, and of their products with a compliance; what of an entry goes with them.
_OF_MASS = {"kg": "rad kg/(N m)", "kg m": "rad kg m/(N m)"}
_SCALED = ("value", "std_error", "prior_std")


@dataclass(frozen=True)
class Evidence:
    """What the last linearisation of a diagnosis says; None of it where the data are at fault.

    `adopted`: whether the effects found enter the model. `settled`: whether a further linearisation would find the same.
    """

    linearized: Linearized
    posterior: Posterior
    alarm: Alarm
    conclusion: Conclusion
    adopted: bool
    settled: bool


def location_words(mechanism: str, location: Sequence[int | str]) -> str:
    """A location in words: joint 2, links 2 and 3, joint 4 orders 1-2.

    `location`: of `Unit`.
    """
    joints = [str(entry) for entry in location if not isinstance(entry, str)]
    names = [entry for entry in location if isinstance(entry, str)]
    # Numbers count joints, or links, which begin at the joint of the same number.
    part = getattr(effects().get(mechanism), "part", "joint")
    where = f"{plural(part, len(joints))} {' and '.join(joints)}" if joints else ""
    return " ".join(filter(None, [where, *names])) or ("base" if mechanism == OTHER else "")


def probability_facts(found: Evidence) -> dict[str, Any]:
    """Probabilities as they stand in verdict.json.

    Returns ``nothing``, ``stated``: that of what the verdict leaves open, ``alarm_p_value``, ``mechanisms`` by name, and
    ``sets`` of mechanisms with the locations of their most probable model.
    """
    sets, problem, hypotheses = [], found.linearized.problem, found.conclusion.hypotheses
    for hypothesis in hypotheses:
        if hypothesis.probability < _LEAST_LISTED:
            continue
        model = found.posterior.models[hypothesis.model]
        where = {
            name: [location_words(name, at) for at in locations_of(problem, model, name)] for name in hypothesis.mechanisms
        }
        sets.append({"mechanisms": list(hypothesis.mechanisms), "probability": hypothesis.probability, "locations": where})
    return {
        "nothing": next(h.probability for h in hypotheses if not h.mechanisms),
        "stated": found.conclusion.probability,
        "alarm_p_value": found.alarm.p_value,
        "mechanisms": {name: value for name, value in found.conclusion.mechanisms.items() if value >= _LEAST_LISTED},
        "sets": sets,
    }


def effect_entries(found: Evidence, final: Fit, averages: Averaged, observations: Observations) -> list[dict[str, Any]]:
    """Entries of the effects found, those of the most probable mechanisms first.

    `final`: of the most probable model. `averages`: what the other models add to it. `observations`: to which it was fitted.
    """
    problem, conclusion = found.linearized.problem, found.conclusion
    numbers = found.posterior.models[conclusion.best.model].units if conclusion.best.named else ()
    units = [problem.units[number] for number in numbers]
    entries = []
    for name in sorted(conclusion.best.named, key=lambda name: -conclusion.mechanisms[name]):
        members = [unit.candidate for unit in units if unit.candidate and unit.mechanism == name]
        where = location_probabilities(problem, found.posterior, name)
        values = [entry for member in members for entry in parameter_entries(member, final, averages)]
        entries.append(
            {
                "name": name,
                "family": members[0].family,
                "joints": sorted({joint for member in members for joint in member.joints}),
                "members": [member.key for member in members],
                "probability": conclusion.mechanisms[name],
                "locations": [
                    {"location": location_words(name, at), "probability": value}
                    for at, value in where.items()
                    if value >= _LEAST_LISTED
                ],
                "parameters": sag_entries(name, members, final, observations) + values,
                "p_value": found.alarm.p_value,
                "heldout_gain": None,
                "alternatives": list(conclusion.alternatives[name]),
                "adopted": found.adopted,
            }
        )
    return entries


def parameter_entries(member: Candidate, final: Fit, averages: Averaged) -> list[dict[str, Any]]:
    """Parameters and shapes of one candidate in a fit.

    How far springs of unknown compliance sag does not tell a mass. Where the compliances are those of the robot
    file, a mass is given as its product with that of the joint that it turns most, which measurements tell.
    """
    effect = next(effect for effect in final.model.effects if effect.key == member.key)
    mine, values = final.places_of(member.key), np.concatenate(final.values_of(member.key))
    unknowns: list[Parameter | Shape] = [*effect.parameters, *effect.shapes]
    entries = [
        {
            "name": f"{member.key} {parameter.name}",
            "value": float(value) + averages.shift.get((member.key, parameter.name), 0.0),
            "std_error": averages.std_error.get((member.key, parameter.name), float(np.sqrt(final.covariance[index, index]))),
            "unit": parameter.unit,
            "prior_std": getattr(parameter, "prior_std", None),
            "held": bool(final.held[index]),
            "identifiable": not final.held[index] and (member.key, parameter.name) not in averages.of_prior,
        }
        # Where a shape has no slope, such as the row of a step, a search has chosen it.
        | ({"shape": True, "identifiable": True} if isinstance(parameter, Shape) else {})
        for parameter, value, index in zip(unknowns, values, mine, strict=True)
    ]
    as_masses = final.model.identifies_compliance or member.family != "gravity"
    return entries if as_masses else [_product(entry, final.model) if entry["unit"] in _OF_MASS else entry for entry in entries]


def _product(entry: dict[str, Any], model: Model) -> dict[str, Any]:
    """The entry of a mass, or of a first moment, times the compliance of the joint that a weight at the end turns most."""
    sites, compliance = model.sites, model.nominal_compliance
    turned = [c * lever_m(sites, j) if sites.carried_links(j) else 0.0 for j, c in enumerate(compliance)]
    joint = int(np.argmax(turned))
    owner, name = entry["name"].rsplit(" ", 1)
    scaled = {key: None if entry[key] is None else float(compliance[joint] * entry[key]) for key in _SCALED}
    return entry | scaled | {"name": f"{owner} compliance_of_joint_{joint + 1}_times_{name}", "unit": _OF_MASS[entry["unit"]]}


def sag_entries(name: str, members: Sequence[Candidate], final: Fit, observations: Observations) -> list[dict[str, Any]]:
    """How far weight lets a target sag at most, where the measurements identify no masses.

    Its standard error is by the delta method.

    `name`: of the effect. `members`: at all of its locations. `observations`: to which it was fitted. Returns one entry, in m;
    none where the effect is not of gravity, or where its masses are identifiable.
    """
    if members[0].family != "gravity" or final.model.identifies_compliance:
        return []
    if final.joint_jacobian is None:
        return []
    jacobian = final.joint_jacobian[:, :3]
    columns = effect_columns([(m, ()) for m in members], final.conditions_of(observations.states), jacobian, observations.state)
    mine = np.concatenate([final.places_of(member.key) for member in members])
    sag = columns @ np.concatenate([final.values_of(member.key)[0] for member in members])
    most = int(np.argmax((sag**2).sum(axis=1)))
    size = float(np.linalg.norm(sag[most]))
    along = sag[most] @ columns[most] / max(size, np.finfo(float).tiny)
    error = float(np.sqrt(along @ final.covariance[np.ix_(mine, mine)] @ along))
    found = {"name": f"{name} largest_sag", "value": size, "std_error": error, "unit": "m", "prior_std": None}
    return [found | {"held": False, "identifiable": True}]


def fault_entry(fault: Fault) -> dict[str, Any]:
    """Entry of a decisive fault of the data."""
    return {
        "name": fault.name,
        "family": OF_DATA,
        "joints": fault.joints,
        "detail": fault.detail,
        "members": [],
        "probability": None,
        "locations": [],
        "parameters": [vars(value) | {"std_error": None} for value in fault.parameters],
        "p_value": None,
        "heldout_gain": None,
        "adopted": False,
        "alternatives": list(fault.alternatives),
        "evidence": [float(value) if np.isfinite(value) else None for value in fault.evidence],
    }


def oversized(final: Fit, names: Collection[str]) -> set[str]:
    """Which of some effects have a parameter beyond what such an effect reaches: size or name is wrong."""
    some = [effect for effect in final.model.effects if effect.effect in names]
    return {effect.effect for effect in some if any(_too_large(*entry) for entry in _estimates(final, effect))}


def _estimates(final: Fit, effect: Candidate) -> Iterator[tuple[float, float, Parameter]]:
    """Value, standard error and kind of each parameter of an effect, its shapes aside."""
    errors = np.sqrt(np.diag(final.covariance)[final.places_of(effect.key)])
    yield from zip(final.values_of(effect.key)[0], errors, effect.parameters, strict=False)


def _too_large(value: float, std_error: float, parameter: Parameter) -> bool:
    return bool(abs(value) > _IMPLAUSIBLE * parameter.plausible + _SURE * std_error)


def implausible(final: Fit, entries: Iterable[Mapping[str, Any]], rated_kg: float | None = None) -> list[str]:
    """Warnings of found parameters that nature does not allow, however many effects were found.

    `entries`: of `effect_entries`. `rated_kg`: payload for which the robot is rated; looked at where the compliances are
    identified, without which no mass is.
    """
    fitted = {effect.key: effect for effect in final.model.effects}
    found = []
    for key in [key for entry in entries for key in entry["members"]]:
        for value, error, parameter in _estimates(final, fitted[key]):
            size = f"{value:.3g} ± {error:.2g} {parameter.unit}"
            if parameter.sign * value < -_SURE * error:
                needed = "positive" if parameter.sign > 0 else "negative"
                found.append(f"{key}: {parameter.name} is {size}, and by its physics {needed}")
            if _too_large(value, error, parameter):
                found.append(f"{key}: {parameter.name} is {size}, more than {_IMPLAUSIBLE:g} times what such an effect reaches")
            carried = parameter.carried and final.model.identifies_compliance
            if rated_kg is not None and carried and value - _SURE * error > rated_kg:
                found.append(f"{key}: {parameter.name} is {size}, beyond the rated payload of {rated_kg:g} kg")
    return found
