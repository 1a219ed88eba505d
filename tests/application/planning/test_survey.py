"""What a configuration tells is what the fit would learn from it."""

from dataclasses import replace

import numpy as np
import pytest
from made_surveys import made_candidates, made_survey

from elastocal.application.planning.survey import SENSORS, accuracy_rows, information, model_of, observe
from elastocal.fitting.displacement import conditions
from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise
from elastocal.fitting.parameters import parameters
from elastocal.fitting.prediction import predict


@pytest.mark.parametrize("measured", ["position", "pose"])
def test_information_is_the_inverse_of_the_covariance_of_a_fit_with_priors(measured):
    survey = made_survey(measured=measured)
    some = made_candidates(survey, 40)
    model, estimate = model_of(survey)
    # The fit takes the priors that the plan takes: a plausible size each.
    effects = tuple(
        replace(e, parameters=tuple(replace(p, prior_std=p.plausible) for p in e.parameters)) for e in model.effects[1:]
    )
    model = replace(model, effects=(model.effects[0], *effects))
    seen = observe(survey, some.joint_angles, some.force)
    position, rotation = predict(model, estimate, seen, conditions(model, estimate, seen.states))
    exact = replace(seen, position=position, rotation=None if seen.rotation is None else rotation)
    noise = Noise("declared", survey.position_m, survey.orientation_rad, np.zeros(6))
    found = fit(model, exact, noise, estimate)
    rows = information(survey, some.joint_angles, some.force)
    scale = np.array([p.plausible for _, p in parameters(model, estimate)])
    free = np.array([owner.startswith(("frame", "target", "joint_compliance")) for owner, _ in parameters(model, estimate)])
    prior = np.diag(np.where(free, 0.0, 1.0))
    here = np.flatnonzero(~found.held)
    assert len(here) > 30
    matrix = (prior + np.einsum("nki,nkj->ij", rows, rows))[np.ix_(here, here)]
    expected = np.linalg.inv(matrix) * np.outer(scale[here], scale[here])
    std = np.sqrt(np.diag(found.covariance))[here]
    np.testing.assert_allclose(std, np.sqrt(np.diag(expected)), rtol=0.02)


def test_what_a_placement_of_the_base_takes_up_is_no_error_unless_the_base_is_known():
    for unknown in (True, False):
        survey = replace(made_survey(), unknown_base=unknown)
        some = made_candidates(survey, 40)
        rows = accuracy_rows(survey, some.joint_angles, some.force)
        names = [(owner, parameter.name) for owner, parameter in parameters(*model_of(survey))]
        assert rows.shape == (40, 3, len(names))
        size = np.sqrt((rows**2).sum(axis=1).mean(axis=0))
        first = names.index(("joint_offset@1", "offset"))
        # The first axis turns the whole arm, as a base does that was placed otherwise.
        second = size[names.index(("joint_offset@2", "offset"))]
        # But for the load, which does not turn with it.
        assert (size[first] < 1e-2 * second) if unknown else (size[first] > 0.3 * second)
        assert not size[[number for number, (owner, _) in enumerate(names) if owner.startswith(("frame", "target"))]].any()


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_has_a_source_and_noise_of_what_it_reads(name):
    sensor = SENSORS[name]
    assert "Leica" in sensor.words
    assert 1e-8 <= sensor.position_m <= 0.1
    assert (name == "pose") == (sensor.orientation_rad is not None)
    assert sensor.orientation_rad is None or 1e-8 <= sensor.orientation_rad <= 0.2
