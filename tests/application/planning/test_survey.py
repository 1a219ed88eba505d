"""Sensitivities of a survey: they agree with the fit, and count errors as the accuracy
statement does."""

from dataclasses import replace

import numpy as np
import pytest
from made_surveys import make_candidates, make_survey

from elastocal.application.planning.survey import (
    build_observations,
    compute_accuracy_rows,
    compute_information_rows,
    declare_model,
)
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import evaluate_conditions, list_parameters, predict
from elastocal.fitting.noise import Noise


@pytest.fixture(scope="module")
def survey():
    return make_survey()


def with_plausible_priors(model):
    """Give each parameter a prior of one plausible size, and the compliances none, as
    the plan does."""
    compliance, *effects = model.effects
    free = tuple(
        replace(parameter, prior_std=None) for parameter in compliance.parameters
    )
    compliance = replace(compliance, parameters=free)
    priors = []
    for effect in effects:
        parameters = tuple(
            replace(parameter, prior_std=parameter.plausible)
            for parameter in effect.parameters
        )
        priors.append(replace(effect, parameters=parameters))
    return replace(model, effects=(compliance, *priors))


def fit_with_priors(survey, candidates):
    """Fit exact measurements of a survey with the priors of the plan."""
    model, estimate = declare_model(survey)
    model = with_plausible_priors(model)
    observations = build_observations(survey, candidates.joint_angles, candidates.force)
    position, rotation = predict(
        model,
        estimate,
        observations,
        evaluate_conditions(model, estimate, observations.states),
    )
    if observations.rotation is None:
        rotation = None
    exact = replace(observations, position=position, rotation=rotation)
    noise = Noise("declared", survey.position_m, survey.orientation_rad, np.zeros(6))
    return fit_model(model, exact, noise, estimate)


@pytest.mark.parametrize("measured", ["position", "pose"])
def test_information_is_the_inverse_of_the_covariance_of_a_fit_with_priors(measured):
    survey = make_survey(measured=measured)
    candidates = make_candidates(survey, 40)
    fit = fit_with_priors(survey, candidates)
    parameters = list_parameters(*declare_model(survey))
    without_prior = ("frame", "target", "joint_compliance")
    prior = np.diag(
        [0.0 if owner.startswith(without_prior) else 1.0 for owner, _ in parameters]
    )
    rows = compute_information_rows(survey, candidates.joint_angles, candidates.force)
    fitted = np.flatnonzero(~fit.unidentifiable)
    assert len(fitted) > 30
    information = prior + np.einsum("nki,nkj->ij", rows, rows)
    scale = np.array([parameter.plausible for _, parameter in parameters])[fitted]
    covariance = np.linalg.inv(information[np.ix_(fitted, fitted)])
    np.testing.assert_allclose(
        np.sqrt(np.diag(fit.covariance))[fitted],
        np.sqrt(np.diag(covariance * np.outer(scale, scale))),
        rtol=0.02,
    )


def test_a_target_on_the_end_effector_moves_as_the_end_effector(survey):
    """Under the full load, which is the second of three measurements, by every parameter
    that a command contains."""
    target = replace(survey.targets[0], offset_m=(0.0, 0.0, 0.0))
    known = replace(survey, targets=(target,), unknown_base=False)
    candidates = make_candidates(known, 20)
    measured = compute_information_rows(
        known, candidates.joint_angles, candidates.force
    )
    moved = compute_accuracy_rows(known, candidates.joint_angles, candidates.force)
    owners = [owner for owner, _ in list_parameters(*declare_model(known))]
    is_without_command = np.array(
        [owner.startswith(("target", "declared_application_point")) for owner in owners]
    )
    assert is_without_command.sum() == 3
    expected = known.position_m * measured[:, 3:6]
    expected[..., is_without_command] = 0.0
    np.testing.assert_allclose(moved, expected, atol=1e-9)


@pytest.mark.parametrize("unknown_base", [True, False])
def test_a_motion_of_the_base_is_an_error_only_if_the_base_is_known(unknown_base):
    survey = replace(make_survey(), unknown_base=unknown_base)
    candidates = make_candidates(survey, 40)
    rows = compute_accuracy_rows(survey, candidates.joint_angles, candidates.force)
    parameters = list_parameters(*declare_model(survey))
    names = [(owner, parameter.name) for owner, parameter in parameters]
    assert rows.shape == (40, 3, len(names))
    size = np.sqrt((rows**2).sum(axis=1).mean(axis=0))
    first_joint = size[names.index(("joint_offset@1", "offset"))]
    second_joint = size[names.index(("joint_offset@2", "offset"))]
    # The first joint rotates the whole arm, like another placement of the base; only the
    # load keeps its direction.
    if unknown_base:
        assert first_joint < 1e-2 * second_joint
    else:
        assert first_joint > 0.3 * second_joint
    of_placement = [owner.startswith(("frame", "target")) for owner, _ in names]
    assert not size[of_placement].any()


def test_an_unknown_offset_of_the_reflector_absorbs_the_lengths_of_the_last_link(
    survey,
):
    candidates = make_candidates(survey, 40)
    sizes = []
    for offset_m in (None, (0.0, 0.0, 0.0)):
        target = replace(survey.targets[0], offset_m=offset_m)
        with_offset = replace(survey, targets=(target,), unknown_base=False)
        is_last_length = [
            owner == "link_geometry@6" and parameter.unit == "m"
            for owner, parameter in list_parameters(*declare_model(with_offset))
        ]
        rows = compute_accuracy_rows(
            with_offset, candidates.joint_angles, candidates.force
        )
        sizes.append(np.abs(rows[..., is_last_length]).max())
    size_if_unknown, size_if_known = sizes
    assert size_if_unknown < 1e-2 * size_if_known


def test_a_survey_measures_without_load_and_both_ways_of_a_pull(survey):
    assert survey.shares == (0.0, 1.0, -1.0)
    assert replace(survey, force_N=0.0).shares == (0.0,)
