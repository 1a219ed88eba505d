"""What was found, as people and files want it: effects with parameters, probabilities and what may stand in their place."""

import numpy as np

from elastocal.diagnosis.confounding import nearest_angles
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.verdict import location_probabilities
from elastocal.diagnosis.words import part_of

# Hypotheses and locations with less than this are not listed.
_LEAST_LISTED = 0.001
# Standard errors beyond which a value is taken at its word, and times the plausible size that no machine reaches.
_SURE, _IMPLAUSIBLE = 2.0, 3.0


def location_words(mechanism, location):
    """A location in words: joint 2, links 2 and 3, joint 4 orders 1-2.

    Parameters
    ----------
    mechanism : str
    location : tuple
        Of `Unit`.

    Returns
    -------
    str
    """
    joints = [str(entry) for entry in location if not isinstance(entry, str)]
    places = [entry for entry in location if isinstance(entry, str)]
    where = f"{part_of(mechanism)}{'s' if len(joints) > 1 else ''} {' and '.join(joints)}" if joints else ""
    return " ".join(filter(None, [where, *places])) or ("base" if mechanism == OTHER else "")


def probability_facts(problem, posterior, conclusion, alarm):
    """Probabilities as they stand in verdict.json.

    Returns
    -------
    dict
        ``nothing``, ``alarm_p_value``, ``mechanisms`` by name, and ``sets`` of mechanisms with the locations of their most
        probable model.
    """
    sets = []
    for hypothesis in conclusion.hypotheses:
        if hypothesis.probability < _LEAST_LISTED:
            continue
        units = posterior.models[hypothesis.model].units if hypothesis.model >= 0 else ()
        where = {
            name: [location_words(name, problem.units[n].location) for n in units if problem.units[n].mechanism == name]
            for name in hypothesis.mechanisms
        }
        sets.append({"mechanisms": list(hypothesis.mechanisms), "probability": hypothesis.probability, "locations": where})
    nothing = next(h.probability for h in conclusion.hypotheses if not h.mechanisms)
    return {
        "nothing": nothing,
        "alarm_p_value": alarm.p_value,
        "mechanisms": {name: value for name, value in conclusion.mechanisms.items() if value >= _LEAST_LISTED},
        "sets": sets,
    }


def effect_entries(problem, posterior, conclusion, alarm, final, averages):
    """Entries of the effects found, those of the most probable mechanisms first.

    Parameters
    ----------
    problem : Problem
    posterior : Posterior
    conclusion : Conclusion
    alarm : Alarm
    final : Fit
        Of the most probable model.
    averages : Averaged
        What the other models add to it.

    Returns
    -------
    list of dict
    """
    numbers = posterior.models[conclusion.best.model].units if conclusion.best.named else ()
    units = [problem.units[number] for number in numbers]
    entries = []
    for name in sorted(conclusion.best.named, key=lambda name: -conclusion.mechanisms[name]):
        members = [unit.candidate for unit in units if unit.mechanism == name]
        where = location_probabilities(problem, posterior, name)
        entries.append(
            {
                "name": name,
                "family": members[0].family,
                "joints": sorted({joint for member in members for joint in member.joints}),
                "members": [member.key for member in members],
                "probability": conclusion.mechanisms[name],
                "locations": [
                    {"location": location_words(name, place), "probability": value}
                    for place, value in where.items()
                    if value >= _LEAST_LISTED
                ],
                "parameters": [entry for member in members for entry in parameter_entries(member, final, averages)],
                "p_value": alarm.p_value,
                "heldout_gain": None,
                "alternatives": list(conclusion.alternatives[name]),
                "angle_to_nearest_deg": _angle_to_nearest(problem, [n for n in numbers if problem.units[n].mechanism == name]),
            }
        )
    return entries


def _angle_to_nearest(problem, found):
    """Angle of what was found of a mechanism to the nearest candidate of another one; None where there is no other."""
    mechanism = problem.units[found[0]].mechanism
    others = [unit.mechanism not in (mechanism, OTHER) for unit in problem.units]
    return float(nearest_angles(problem, found)[others].min()) if any(others) else None


def parameter_entries(member, final, averages):
    """Parameters and shapes of one candidate in a fit.

    Parameters
    ----------
    member : Candidate
    final : Fit
    averages : Averaged

    Returns
    -------
    list of dict
    """
    effect = next(effect for effect in final.model.effects if effect.key == member.key)
    mine = np.flatnonzero([owner == member.key for owner, _ in final.parameters])
    values = np.concatenate(final.values_of(member.key))
    return [
        {
            "name": f"{member.key} {parameter.name}",
            "value": float(value) + averages.shift.get((member.key, parameter.name), 0.0),
            "std_error": averages.std_error.get((member.key, parameter.name), float(np.sqrt(final.covariance[index, index]))),
            "unit": parameter.unit,
            "prior_std": getattr(parameter, "prior_std", None),
            "held": bool(final.held[index]),
        }
        for parameter, value, index in zip((*effect.parameters, *effect.shapes), values, mine, strict=True)
    ]


def fault_entry(fault):
    """Entry of a decisive fault of the data.

    Parameters
    ----------
    fault : dict
        Fields of `faults.protocol.Fault`.

    Returns
    -------
    dict
    """
    return {
        "name": fault["name"],
        "family": "data",
        "joints": fault["joints"],
        "detail": fault["detail"],
        "members": [],
        "probability": None,
        "locations": [],
        "parameters": [value | {"std_error": None} for value in fault["parameters"]],
        "p_value": None,
        "heldout_gain": None,
        "alternatives": list(fault["alternatives"]),
        "angle_to_nearest_deg": None,
        "evidence": [float(value) if np.isfinite(value) else None for value in fault["evidence"]],
    }


def implausible(final, entries, rated_kg=None):
    """Warnings of found parameters that nature does not allow, however many effects were found.

    Parameters
    ----------
    final : Fit
    entries : sequence of dict
        Of `effect_entries`.
    rated_kg : float, optional
        Payload for which the robot is rated.

    Returns
    -------
    list of str
    """
    effects = {effect.key: effect for effect in final.model.effects}
    found = []
    for key in [key for entry in entries for key in entry["members"]]:
        mine = np.flatnonzero([owner == key for owner, _ in final.parameters])
        for parameter, value, index in zip(effects[key].parameters, final.values_of(key)[0], mine, strict=False):
            error = float(np.sqrt(final.covariance[index, index]))
            size = f"{value:.3g} ± {error:.2g} {parameter.unit}"
            if parameter.sign * value < -_SURE * error:
                needed = "positive" if parameter.sign > 0 else "negative"
                found.append(f"{key}: {parameter.name} is {size}, and by its physics {needed}")
            if abs(value) > _IMPLAUSIBLE * parameter.plausible + _SURE * error:
                found.append(f"{key}: {parameter.name} is {size}, more than {_IMPLAUSIBLE:g} times what such an effect reaches")
            if rated_kg is not None and parameter.unit == "kg" and value - _SURE * error > rated_kg:
                found.append(f"{key}: {parameter.name} is {size}, beyond the rated payload of {rated_kg:g} kg")
    return found
