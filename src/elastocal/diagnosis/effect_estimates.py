"""State the effects that were found, with their locations and parameters, and the faults
of the data, as they stand in verdict.json."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import format_digits, pluralize
from elastocal.data_checks.protocol import DATA_FAMILY, Fault
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.verdict import (
    MIN_REPORTED_PROBABILITY,
    compute_location_probabilities,
)
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import Parameter, Shape
from elastocal.effects.sizes import lever_m
from elastocal.fitting.linearization import compute_effect_sensitivities
from elastocal.verdict import DataFault, Effect, EffectParameter, FaultValue
from elastocal.verdict import Location as StatedLocation

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from elastocal.diagnosis.model_averaging import ModelAverage
    from elastocal.diagnosis.verdict import Evidence
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.observations import Observations

# A value counts as implausible beyond this multiple of the size that the effect can
# reach, plus this many standard errors.
_IMPLAUSIBLE_FACTOR = 3.0
_STD_ERRORS = 2.0
# Units of masses and of first moments, and of their products with a compliance.
_PRODUCT_UNITS = {"kg": "rad kg/(N m)", "kg m": "rad kg m/(N m)"}


def state_effects(
    evidence: Evidence, fitted: Fit, average: ModelAverage, observations: Observations
) -> tuple[Effect, ...]:
    """State the effects of the best hypothesis, the most probable mechanism first.

    Parameters
    ----------
    evidence : Evidence
        Result of the search.
    fitted : Fit
        Fit of the most probable model.
    average : ModelAverage
        Corrections of its values and standard errors by the other models.
    observations : Observations
        Observations of that fit.
    """
    conclusion = evidence.conclusion
    terms = evidence.design.problem.terms
    candidates = [terms[index].candidate for index in evidence.named_model.term_indices]
    names = sorted(conclusion.best.named, key=lambda name: -conclusion.mechanisms[name])
    stated = []
    for name in names:
        members = [
            candidate
            for candidate in candidates
            if candidate and candidate.effect == name
        ]
        parameters = state_largest_sag(name, members, fitted, observations)
        for member in members:
            parameters += state_parameters(member, fitted, average)
        joints = {joint for member in members for joint in member.joints}
        stated.append(
            Effect(
                name=name,
                family=members[0].family,
                joints=tuple(sorted(joints)),
                members=tuple(member.key for member in members),
                probability=conclusion.mechanisms[name],
                locations=_state_locations(evidence, name),
                parameters=tuple(parameters),
                p_value=evidence.alarm.p_value,
                heldout_gain=None,
                alternatives=conclusion.alternatives[name],
                adopted=evidence.adopted,
            )
        )
    return tuple(stated)


def _state_locations(evidence: Evidence, mechanism: str) -> tuple[StatedLocation, ...]:
    """State the locations of a mechanism whose probability is worth reporting."""
    probabilities = compute_location_probabilities(
        evidence.design.problem, evidence.posterior, mechanism
    )
    return tuple(
        StatedLocation(format_location(mechanism, location), probability)
        for location, probability in probabilities.items()
        if probability >= MIN_REPORTED_PROBABILITY
    )


def format_location(mechanism: str, location: Sequence[int | str]) -> str:
    """Return a location in words: joint 2, links 2 and 3, joint 4 orders 1-2.

    Parameters
    ----------
    mechanism : str
        Name in the catalogue.
    location : sequence of (int or str)
        Joints or links, which begin at the joint of the same number, and details.
    """
    numbers = [str(entry) for entry in location if not isinstance(entry, str)]
    phrases = [entry for entry in location if isinstance(entry, str) and entry]
    if numbers:
        noun = getattr(list_effects().get(mechanism), "part", "joint")
        phrases.insert(0, f"{pluralize(noun, len(numbers))} {' and '.join(numbers)}")
    if not phrases and mechanism == OTHER:
        return "base"
    return " ".join(phrases)


def state_parameters(
    member: Candidate, fitted: Fit, average: ModelAverage
) -> list[EffectParameter]:
    """State the parameters and shapes of one candidate.

    Measurements determine a mass only as its product with a compliance. If the
    compliances are those of the robot file, a mass is therefore given as its product
    with the compliance of the joint that it turns most.

    Parameters
    ----------
    member : Candidate
        The candidate.
    fitted : Fit
        Fit of a model that contains it.
    average : ModelAverage
        Corrections by the other models.
    """
    effect = next(effect for effect in fitted.model.effects if effect.key == member.key)
    unknowns: list[Parameter | Shape] = [*effect.parameters, *effect.shapes]
    values = np.concatenate(fitted.effect_values(member.key))
    keeps_masses = fitted.model.identifies_compliance or member.family != "gravity"
    stated = []
    for unknown, value, index in zip(
        unknowns, values, fitted.parameter_indices(member.key), strict=True
    ):
        key = (member.key, unknown.name)
        is_held = bool(fitted.unidentifiable[index])
        is_shape = isinstance(unknown, Shape)
        std_error = float(np.sqrt(fitted.covariance[index, index]))
        averaged = float(value) + average.shift.get(key, 0.0)
        if isinstance(unknown, Parameter):
            # Averages are of normal approximations, which know no sign.
            averaged = float(np.clip(averaged, *unknown.bounds))
        parameter = EffectParameter(
            name=f"{member.key} {unknown.name}",
            value=averaged,
            std_error=average.std_error.get(key, std_error),
            unit=unknown.unit,
            prior_std=getattr(unknown, "prior_std", None),
            held=is_held,
            # A shape without a slope, such as the row of a step, was chosen by a
            # search.
            identifiable=is_shape
            or (not is_held and key not in average.prior_dominated),
            shape=is_shape,
        )
        if not keeps_masses and parameter.unit in _PRODUCT_UNITS:
            parameter = _multiply_by_compliance(parameter, fitted)
        stated.append(parameter)
    return stated


def _multiply_by_compliance(parameter: EffectParameter, fitted: Fit) -> EffectParameter:
    """Return a mass, or a first moment, times the compliance of the joint that a weight
    at the end effector turns most."""
    sites = fitted.model.sites
    compliances = fitted.model.nominal_compliance
    rotations = [
        compliance * lever_m(sites, joint) if sites.carried_links(joint) else 0.0
        for joint, compliance in enumerate(compliances)
    ]
    joint = int(np.argmax(rotations))
    compliance = compliances[joint]
    owner, name = parameter.name.rsplit(" ", 1)

    def scale(value: float | None) -> float | None:
        return None if value is None else float(compliance * value)

    return replace(
        parameter,
        name=f"{owner} compliance_of_joint_{joint + 1}_times_{name}",
        value=float(compliance * parameter.value),
        std_error=scale(parameter.std_error),
        unit=_PRODUCT_UNITS[parameter.unit],
        prior_std=scale(parameter.prior_std),
    )


def state_largest_sag(
    name: str, members: Sequence[Candidate], fitted: Fit, observations: Observations
) -> list[EffectParameter]:
    """State the largest displacement of a target by the weight of a gravity effect.

    It stands for masses that are not identified. Its standard error is that of the
    delta method.

    Parameters
    ----------
    name : str
        Name of the effect.
    members : sequence of Candidate
        Its candidates, at all locations.
    fitted : Fit
        Fit of a model that contains them.
    observations : Observations
        Observations of that fit.

    Returns
    -------
    list of EffectParameter
        One parameter, in m; empty if masses are identified, or for another effect.
    """
    if (
        members[0].family != "gravity"
        or fitted.model.identifies_compliance
        or fitted.joint_jacobian is None
    ):
        return []
    columns = compute_effect_sensitivities(
        [(member.displacement, ()) for member in members],
        fitted.get_conditions(observations.states),
        fitted.joint_jacobian[:, :3],
        observations.state,
    )
    indices = np.concatenate(
        [fitted.parameter_indices(member.key) for member in members]
    )
    coefficients = np.concatenate(
        [fitted.effect_values(member.key)[0] for member in members]
    )
    sag = columns @ coefficients
    largest = int(np.argmax((sag**2).sum(axis=1)))
    size_m = float(np.linalg.norm(sag[largest]))
    gradient = sag[largest] @ columns[largest] / max(size_m, np.finfo(float).tiny)
    variance = gradient @ fitted.covariance[np.ix_(indices, indices)] @ gradient
    return [
        EffectParameter(
            name=f"{name} largest_sag",
            value=size_m,
            std_error=float(np.sqrt(variance)),
            unit="m",
            prior_std=None,
            held=False,
            identifiable=True,
        )
    ]


def state_fault(fault: Fault) -> DataFault:
    """State a fault of the data among the effects of a verdict."""
    return DataFault(
        name=fault.name,
        family=DATA_FAMILY,
        joints=tuple(fault.joints),
        detail=fault.detail,
        parameters=tuple(
            FaultValue(value.name, value.value, value.unit)
            for value in fault.parameters
        ),
        alternatives=tuple(fault.alternatives),
        evidence=tuple(
            float(rms_m) if np.isfinite(rms_m) else None for rms_m in fault.evidence
        ),
    )


def find_oversized_effects(fitted: Fit, names: Collection[str]) -> set[str]:
    """Return effects with a parameter beyond the size that such an effect can reach,
    so that either its size or its name is wrong.

    Parameters
    ----------
    fitted : Fit
        Fit of a model that contains them.
    names : collection of str
        Effects to look at.
    """
    return {
        effect.effect
        for effect in fitted.model.effects
        if effect.effect in names
        for estimate in _generate_estimates(fitted, effect)
        if _is_oversized(*estimate)
    }


def _generate_estimates(
    fitted: Fit, effect: Candidate
) -> Iterator[tuple[float, float, Parameter]]:
    """Yield value, standard error and definition of each linear parameter that the
    measurements identify; the value is the one that the measurements alone would give,
    beyond the bounds of physics too."""
    indices = fitted.parameter_indices(effect.key)
    std_errors = np.sqrt(np.diag(fitted.covariance)[indices])
    values = fitted.effect_values(effect.key)[0].copy()
    # Shapes come last and are not among the parameters.
    if fitted.beyond_bound is not None:
        values += fitted.beyond_bound[indices[: len(values)]]
    identified = fitted.identified[indices]
    for number, parameter in enumerate(effect.parameters):
        if identified[number]:
            yield float(values[number]), float(std_errors[number]), parameter


def _is_oversized(value: float, std_error: float, parameter: Parameter) -> bool:
    limit = _IMPLAUSIBLE_FACTOR * parameter.plausible + _STD_ERRORS * std_error
    return bool(abs(value) > limit)


def warn_of_implausible_values(fitted: Fit, keys: Sequence[str]) -> list[str]:
    """Return warnings of parameters whose sign or size is physically impossible.

    Parameters
    ----------
    fitted : Fit
        Fit of a model that contains the effects.
    keys : sequence of str
        Keys of the candidates to look at.
    """
    effects_by_key = {effect.key: effect for effect in fitted.model.effects}
    warnings = []
    for key in keys:
        estimates = _generate_estimates(fitted, effects_by_key[key])
        for value, std_error, parameter in estimates:
            size = f"{format_digits(value, 3)} ± {format_digits(std_error, 2)}"
            estimate = f"{key}: {parameter.name} is {size} {parameter.unit}"
            if parameter.sign * value < -_STD_ERRORS * std_error:
                sign = "positive" if parameter.sign > 0 else "negative"
                warnings.append(
                    f"{estimate}, although physics requires it to be {sign}"
                )
            if _is_oversized(value, std_error, parameter):
                warnings.append(
                    f"{estimate}, more than {_IMPLAUSIBLE_FACTOR:g} times "
                    "the reference size of such an effect"
                )
    return warnings
