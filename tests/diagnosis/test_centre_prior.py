"""The measurements choose between a wide and a narrow prior of the centres of mass."""

from dataclasses import replace

import numpy as np
import pytest
from planted import two_loads_a_pose
from synthetic import NOISE, add_noise, make_estimate, make_model, observe_exactly

from elastocal.campaigns.campaign import Target
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.centre_prior import choose_centre_prior
from elastocal.diagnosis.fitted_subset import FittedSubset
from elastocal.diagnosis.refit import reset_declared_masses
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import Case, get_mass_corrections
from elastocal.mechanics.robot import Mass

MASSES = (
    Mass(1, 280.0, (0.1, 0.02, -0.10), 0.1),
    Mass(2, 190.0, (0.52, 0.05, 0.0), 0.1),
    Mass(3, 220.0, (0.35, -0.04, 0.2), 0.1),
)
TARGETS = (
    Target("elbow", "3DoF", (0.0, 0.1, 0.05)),
    Target("hand", "6DoF", (0.1, 0.05, 0.02)),
)


def fitted_subset(robot, deviation=0.0, payload_kg=0.0):
    """Measurements with two loads a pose of a robot whose first moments deviate by some
    standard deviations of the wide prior, fitted with that prior."""
    model = make_model(
        robot,
        TARGETS,
        fitted_frames=False,
        compliance=robot.compliance,
        identified=True,
    )
    candidates = candidates_on(model.sites)
    payload = candidates["payload[mass]"]
    moments = np.zeros(len(model.effects[1].parameters))
    for index, parameter in enumerate(model.effects[1].parameters):
        if parameter.name.startswith("moment"):
            moments[index] = deviation * parameter.prior_std * (-1) ** index
    truth = replace(
        make_estimate(model, size=0.0).with_effects([payload]),
        coefficients=(robot.compliance, moments, np.array([payload_kg])),
    )
    states = two_loads_a_pose(6, 30, 5)
    exact = observe_exactly(model.with_effects([payload]), truth, states)
    observations = add_noise(exact, np.random.default_rng(6))
    noise = replace(NOISE, joint_rad=np.zeros(6))
    return FittedSubset(
        Case(None, observations, model, candidates),
        np.ones(len(observations), bool),
        noise,
        [],
        fit_model(model, observations, noise),
        observations,
        np.zeros(len(observations)),
    )


@pytest.mark.parametrize(
    ("deviation", "payload_kg", "stays_wide"),
    [(0.0, 0.0, False), (1.0, 0.0, True), (0.0, 20.0, False)],
)
def test_the_prior_is_the_one_that_the_measurements_make_more_probable(
    fanuc, deviation, payload_kg, stays_wide
):
    robot = replace(fanuc, masses=MASSES, payload_kg=165.0)
    subset = fitted_subset(robot, deviation, payload_kg)
    chosen = choose_centre_prior(subset, Settings())
    assert (chosen is subset) == stays_wide
    weight = chosen.declared.model.effects[1]
    assert chosen.case.model.effects[1] == weight
    if not stays_wide:
        stated = 28.0 * np.linalg.norm(MASSES[0].centre_m)
        assert weight.parameters[1].prior_std == pytest.approx(stated)


def test_a_law_not_linear_in_the_load_is_evaluated_at_fitted_and_at_declared_masses(
    kuka,
):
    """The columns differ where the errors of the masses change the torque."""
    subset = fitted_subset(replace(kuka, masses=MASSES), deviation=2.0)
    candidate = subset.case.candidates["lost_motion@2"]
    design = build_candidate_design(
        subset.declared, subset.search_sample, [candidate], Settings()
    )
    variants = [term for term in design.terms if term.mechanism == "lost_motion"]
    fitted = [term for term in variants if not term.at_declared_masses]
    declared = [term for term in variants if term.at_declared_masses]
    assert len(fitted) == len(declared) > 0
    columns = design.rows.candidates.dense()
    for term, other in zip(fitted, declared, strict=True):
        assert term.shapes == other.shapes
        change = columns[..., term.columns] - columns[..., other.columns]
        assert np.abs(change).max() > 0.01 * np.abs(columns[..., term.columns]).max()
    start = reset_declared_masses(subset.declared)
    assert get_mass_corrections(subset.declared.model, subset.declared.estimate).any()
    assert not get_mass_corrections(start.model, start.estimate).any()
