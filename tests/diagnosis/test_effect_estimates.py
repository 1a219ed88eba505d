"""Effects that were found are stated with their locations, sizes and errors, and faults
of the data with their evidence."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from planted import planted

from elastocal.data_checks.protocol import Fault, Value
from elastocal.diagnosis.effect_estimates import (
    find_oversized_effects,
    format_location,
    state_fault,
    state_largest_sag,
    state_parameters,
    warn_of_implausible_values,
)
from elastocal.diagnosis.model_averaging import ModelAverage
from elastocal.fitting.model import predict


@pytest.mark.parametrize(
    ("mechanism", "location", "phrase"),
    [
        ("joint_offset", (2,), "joint 2"),
        ("link_elasticity", (2, 3), "links 2 and 3"),
        ("transmission_harmonic", (4, "orders 1-2"), "joint 4 orders 1-2"),
        ("other", (), "base"),
        ("payload", (), ""),
    ],
)
def test_a_location_is_given_by_joints_or_links_and_details(
    mechanism, location, phrase
):
    assert format_location(mechanism, location) == phrase


def test_a_fault_of_the_data_has_evidence_and_no_probability():
    fault = state_fault(
        Fault("wrong_sign", (2,), "why", (Value("x", 0.5, "m"),), (np.inf, 1e-4))
    )
    assert fault.family == "data"
    assert fault.probability is None
    assert fault.evidence == (None, 1e-4)
    assert fault.parameters[0].value == 0.5


@pytest.fixture(scope="module")
def campaign(kuka):
    return planted(kuka, {}, seed=1)


@pytest.fixture(scope="module")
def fitted(campaign):
    """A fit of four effects that the robot does not have, with tiny standard errors."""
    keys = ("joint_tilt@2", "payload", "joint_offset@3", "base_compliance")
    effects = [campaign.candidates[key] for key in keys]
    declared = campaign.declared
    widths = [len(effect.parameters) for effect in effects]
    count = len(declared.parameters) + sum(widths)
    return replace(
        declared,
        model=declared.model.with_effects(effects),
        estimate=declared.estimate.with_effects(effects),
        covariance=1e-24 * np.eye(count),
        unidentifiable=np.zeros(count, bool),
    )


def find_effect(fitted, key):
    return next(effect for effect in fitted.model.effects if effect.key == key)


def replace_first_parameter(fitted, key, value, std_error):
    """The same fit with another estimate of the first parameter of an effect."""
    effect_index = [effect.key for effect in fitted.model.effects].index(key)
    coefficients = [values.copy() for values in fitted.estimate.coefficients]
    coefficients[effect_index][0] = value
    parameter_index = [owner for owner, _ in fitted.parameters].index(key)
    covariance = fitted.covariance.copy()
    covariance[parameter_index, parameter_index] = std_error**2
    return replace(
        fitted,
        estimate=replace(fitted.estimate, coefficients=tuple(coefficients)),
        covariance=covariance,
    )


def test_parameters_have_their_values_errors_and_priors(fitted):
    fitted = replace_first_parameter(fitted, "joint_offset@3", 3e-4, 2e-5)
    effect = find_effect(fitted, "joint_offset@3")
    (parameter,) = state_parameters(effect, fitted, ModelAverage({}, {}))
    assert asdict(parameter) == {
        "name": "joint_offset@3 offset",
        "value": pytest.approx(3e-4),
        "std_error": pytest.approx(2e-5),
        "unit": "rad",
        "prior_std": None,
        "held": False,
        "identifiable": True,
        "shape": False,
    }
    # Other models shift the value and widen its error. If the prior dominates, the
    # parameter is not identifiable.
    key = ("joint_offset@3", "offset")
    average = ModelAverage({key: 1e-5}, {key: 4e-5}, frozenset([key]))
    (parameter,) = state_parameters(effect, fitted, average)
    assert parameter.value == pytest.approx(3.1e-4)
    assert parameter.std_error == 4e-5
    assert not parameter.identifiable


def use_nominal_compliances(fitted, compliance):
    """The same fit of a campaign that takes the compliances from the robot file."""
    model = fitted.model
    estimate = fitted.estimate
    kept = [
        number
        for number, effect in enumerate(model.effects)
        if effect.effect != "joint_compliance"
    ]
    is_kept = np.array([owner != "joint_compliance" for owner, _ in fitted.parameters])
    return replace(
        fitted,
        model=replace(
            model,
            effects=tuple(model.effects[number] for number in kept),
            nominal_compliance=compliance,
        ),
        estimate=replace(
            estimate,
            coefficients=tuple(estimate.coefficients[number] for number in kept),
            shapes=tuple(estimate.shapes[number] for number in kept),
        ),
        covariance=fitted.covariance[np.ix_(is_kept, is_kept)],
        unidentifiable=fitted.unidentifiable[is_kept],
    )


def test_masses_are_stated_times_a_compliance_if_compliances_are_not_identified(fitted):
    heavy = replace_first_parameter(fitted, "payload", 24.4, 0.9)
    payload = find_effect(heavy, "payload")
    assert state_parameters(payload, heavy, ModelAverage({}, {}))[0].unit == "kg"
    compliance = 1e-6 * np.array([20.0, 8.0, 3.0, 2.0, 2.0, 2.0])
    nominal = use_nominal_compliances(heavy, compliance)
    parameters = state_parameters(payload, nominal, ModelAverage({}, {}))
    # Weight cannot turn the first joint, however compliant it is.
    mass = parameters[0]
    assert mass.name == "payload compliance_of_joint_2_times_mass"
    assert mass.value == pytest.approx(8e-6 * 24.4)
    assert mass.std_error == pytest.approx(8e-6 * 0.9)
    units = [parameter.unit for parameter in parameters]
    assert units == ["rad kg/(N m)", *["rad kg m/(N m)"] * 3]


def test_sag_is_the_largest_displacement_of_a_target_by_the_weight(
    fitted, campaign, kuka
):
    observations = campaign.observations
    payload = find_effect(fitted, "payload")
    heavy = replace_first_parameter(fitted, "payload", 20.0, 1.0)
    assert state_largest_sag("payload", [payload], heavy, observations) == []
    nominal = use_nominal_compliances(heavy, kuka.compliance)
    (sag,) = state_largest_sag("payload", [payload], nominal, observations)
    # Compare with predictions with and without the mass, by the exact kinematics.
    conditions = nominal.conditions
    light = replace_first_parameter(nominal, "payload", 0.0, 1.0)
    model = nominal.model
    position, _ = predict(model, nominal.estimate, observations, conditions)
    light_position, _ = predict(model, light.estimate, observations, conditions)
    largest = np.linalg.norm(position - light_position, axis=1).max()
    assert sag.unit == "m"
    assert sag.value == pytest.approx(largest, rel=0.02)
    assert sag.std_error == pytest.approx(sag.value / 20.0, rel=1e-3)
    tilt = find_effect(fitted, "joint_tilt@2")
    assert state_largest_sag("joint_tilt", [tilt], nominal, observations) == []


def list_warnings(fitted):
    """Warnings of the four effects of the fixture."""
    keys = [effect.key for effect in fitted.model.effects][-4:]
    return warn_of_implausible_values(fitted, keys)


def test_a_sign_against_physics_causes_a_warning(fitted):
    negative = replace_first_parameter(fitted, "joint_tilt@2", -1e-7, 1e-8)
    (warning,) = list_warnings(negative)
    assert warning.startswith("joint_tilt@2: tilt_about_")
    assert "physics requires it to be positive" in warning


def test_a_size_beyond_the_reach_of_an_effect_causes_a_warning(fitted):
    key = "joint_offset@3"
    plausible = find_effect(fitted, key).parameters[0].plausible
    for size in (3.5 * plausible, -3.5 * plausible):
        large = replace_first_parameter(fitted, key, size, 0.1 * plausible)
        (warning,) = list_warnings(large)
        assert warning.startswith("joint_offset@3: offset is")
        assert "3 times the reference size of such an effect" in warning
        oversized = find_oversized_effects(large, {"joint_offset", "payload"})
        assert oversized == {"joint_offset"}
        assert not find_oversized_effects(large, {"payload"})
    usual = replace_first_parameter(fitted, key, 3.1 * plausible, 0.1 * plausible)
    assert list_warnings(usual) == []
