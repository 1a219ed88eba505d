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
    ("mechanism", "location", "words"),
    [
        ("joint_offset", (2,), "joint 2"),
        ("link_elasticity", (2, 3), "links 2 and 3"),
        ("transmission_harmonic", (4, "orders 1-2"), "joint 4 orders 1-2"),
        ("other", (), "base"),
        ("payload", (), ""),
    ],
)
def test_a_location_is_given_by_joints_or_links_and_details(mechanism, location, words):
    assert format_location(mechanism, location) == words


def test_a_fault_of_the_data_has_evidence_and_no_probability():
    fault = state_fault(
        Fault("wrong_sign", (2,), "why", (Value("x", 0.5, "m"),), (np.inf, 1e-4))
    )
    assert fault.family == "data" and fault.probability is None
    assert fault.evidence == (None, 1e-4) and fault.parameters[0].value == 0.5


@pytest.fixture(scope="module")
def campaign(kuka):
    return planted(kuka, {}, seed=1)


@pytest.fixture(scope="module")
def found(campaign):
    """A fit of some effects that the robot does not have."""
    effects = [
        campaign.candidates[key]
        for key in ("joint_tilt@2", "payload", "joint_offset@3", "base_compliance")
    ]
    model = campaign.declared.model.with_effects(effects)
    start = campaign.declared.estimate.with_effects(effects)
    count = len(campaign.declared.parameters) + sum(
        len(effect.parameters) for effect in effects
    )
    stated = {
        "covariance": 1e-24 * np.eye(count),
        "unidentifiable": np.zeros(count, bool),
    }
    fitted = replace(campaign.declared, model=model, estimate=start, **stated)
    return fitted, [effect.key for effect in effects]


def effect_of(fitted, key):
    return next(effect for effect in fitted.model.effects if effect.key == key)


def with_value(fitted, key, value, error):
    """The same fit with the first parameter of an effect at a value of a given standard
    error."""
    number = [effect.key for effect in fitted.model.effects].index(key)
    values = [part.copy() for part in fitted.estimate.coefficients]
    values[number][0] = value
    place = [owner for owner, _ in fitted.parameters].index(key)
    covariance = fitted.covariance.copy()
    covariance[place, place] = error**2
    return replace(
        fitted,
        estimate=replace(fitted.estimate, coefficients=tuple(values)),
        covariance=covariance,
    )


def test_parameters_have_their_values_errors_and_priors(found):
    fitted, _ = found
    fitted = with_value(fitted, "joint_offset@3", 3e-4, 2e-5)
    effect = effect_of(fitted, "joint_offset@3")
    (entry,) = state_parameters(effect, fitted, ModelAverage({}, {}))
    assert asdict(entry) == {
        "name": "joint_offset@3 offset",
        "value": pytest.approx(3e-4),
        "std_error": pytest.approx(2e-5),
        "unit": "rad",
        "prior_std": None,
        "held": False,
        "identifiable": True,
        "shape": False,
    }
    # What other models say moves the value and widens its error, and it may be the
    # prior alone that says it.
    name = ("joint_offset@3", "offset")
    (entry,) = state_parameters(
        effect, fitted, ModelAverage({name: 1e-5}, {name: 4e-5}, frozenset([name]))
    )
    assert (
        entry.value == pytest.approx(3.1e-4)
        and entry.std_error == 4e-5
        and not entry.identifiable
    )


def declared_springs(fitted, compliance):
    """The same fit of a campaign that takes the compliances from the robot file."""
    kept = [
        n
        for n, effect in enumerate(fitted.model.effects)
        if effect.effect != "joint_compliance"
    ]
    free = np.array([owner != "joint_compliance" for owner, _ in fitted.parameters])
    return replace(
        fitted,
        model=replace(
            fitted.model,
            effects=tuple(fitted.model.effects[n] for n in kept),
            nominal_compliance=compliance,
        ),
        estimate=replace(
            fitted.estimate,
            coefficients=tuple(fitted.estimate.coefficients[n] for n in kept),
            shapes=tuple(fitted.estimate.shapes[n] for n in kept),
        ),
        covariance=fitted.covariance[np.ix_(free, free)],
        unidentifiable=fitted.unidentifiable[free],
    )


def test_no_mass_is_told_where_the_compliances_are_not_identified(found):
    fitted, _ = found
    heavy = with_value(fitted, "payload", 24.4, 0.9)
    payload = effect_of(heavy, "payload")
    assert state_parameters(payload, heavy, ModelAverage({}, {}))[0].unit == "kg"
    taken = declared_springs(heavy, 1e-6 * np.array([20.0, 8.0, 3.0, 2.0, 2.0, 2.0]))
    # Weight cannot turn the first joint, however soft it is.
    first, *others = state_parameters(payload, taken, ModelAverage({}, {}))
    assert first.name == "payload compliance_of_joint_2_times_mass"
    assert (first.value, first.std_error) == pytest.approx((8e-6 * 24.4, 8e-6 * 0.9))
    assert [entry.unit for entry in (first, *others)] == [
        "rad kg/(N m)",
        *["rad kg m/(N m)"] * 3,
    ]


def test_sag_is_how_far_the_weight_moves_a_target_at_most(found, campaign, kuka):
    fitted, _ = found
    payload = effect_of(fitted, "payload")
    heavy = with_value(fitted, "payload", 20.0, 1.0)
    assert state_largest_sag("payload", [payload], heavy, campaign.observations) == []
    taken = declared_springs(heavy, kuka.compliance)
    (entry,) = state_largest_sag("payload", [payload], taken, campaign.observations)
    # Predictions with and without the mass, by the exact kinematics.
    around = taken.conditions
    light = with_value(taken, "payload", 0.0, 1.0)
    positions = [
        predict(each.model, each.estimate, campaign.observations, around)[0]
        for each in (taken, light)
    ]
    largest = np.linalg.norm(positions[0] - positions[1], axis=1).max()
    assert entry.unit == "m" and entry.value == pytest.approx(largest, rel=0.02)
    assert entry.std_error == pytest.approx(entry.value / 20.0, rel=1e-3)
    assert (
        state_largest_sag(
            "joint_tilt",
            [effect_of(fitted, "joint_tilt@2")],
            taken,
            campaign.observations,
        )
        == []
    )


def test_the_wrong_sign_is_named(found):
    fitted, entries = found
    (warning,) = warn_of_implausible_values(
        with_value(fitted, "joint_tilt@2", -1e-7, 1e-8), entries
    )
    assert (
        warning.startswith("joint_tilt@2: tilt_about_")
        and "by its physics positive" in warning
    )


def test_a_size_beyond_what_such_an_effect_reaches_is_named(found):
    fitted, entries = found
    plausible = effect_of(fitted, "joint_offset@3").parameters[0].plausible
    for sign in (1, -1):
        (warning,) = warn_of_implausible_values(
            with_value(
                fitted, "joint_offset@3", 3.5 * sign * plausible, 0.1 * plausible
            ),
            entries,
        )
        assert (
            warning.startswith("joint_offset@3: offset is")
            and "3 times what such an effect reaches" in warning
        )
        large = with_value(
            fitted, "joint_offset@3", 3.5 * sign * plausible, 0.1 * plausible
        )
        assert find_oversized_effects(large, {"joint_offset", "payload"}) == {
            "joint_offset"
        } and not find_oversized_effects(large, {"payload"})
    assert (
        warn_of_implausible_values(
            with_value(fitted, "joint_offset@3", 3.1 * plausible, 0.1 * plausible),
            entries,
        )
        == []
    )
