"""The measurements choose between a wide and a narrow prior of the centres of mass."""

from dataclasses import replace

import numpy as np
import pytest
from planted import two_loads_a_pose
from synthetic import NOISE, made_estimate, made_model, seen_exactly, with_noise

from elastocal.campaigns.campaign import Target
from elastocal.diagnosis.centre_prior import choose_centre_prior
from elastocal.diagnosis.fitted_subset import FittedSubset
from elastocal.diagnosis.settings import Settings
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import Case
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


def kept(robot, off=0.0, payload_kg=0.0):
    """Two loads a pose of a robot whose moments are off by `off` standard deviations of
    the wide prior."""
    model = made_model(
        robot,
        TARGETS,
        fitted_frames=False,
        compliance=robot.compliance,
        identified=True,
    )
    candidates = candidates_on(model.sites)
    weight = model.effects[1]
    true = made_estimate(model, size=0.0).with_effects([candidates["payload[mass]"]])
    moved = [
        off * p.prior_std * (-1) ** n * p.name.startswith("moment")
        for n, p in enumerate(weight.parameters)
    ]
    true = replace(
        true, coefficients=(robot.compliance, np.array(moved), np.array([payload_kg]))
    )
    states = two_loads_a_pose(6, 30, 5)
    seen = seen_exactly(model.with_effects([candidates["payload[mass]"]]), true, states)
    seen = with_noise(seen, np.random.default_rng(6))
    noise = replace(NOISE, joint_rad=np.zeros(6))
    declared = fit_model(model, seen, noise)
    return FittedSubset(
        Case(None, seen, model, candidates),
        np.ones(len(seen), bool),
        noise,
        [],
        declared,
        seen,
    )


@pytest.mark.parametrize(
    ("off", "payload_kg", "stays_wide"),
    [(0.0, 0.0, False), (1.0, 0.0, True), (0.0, 20.0, False)],
)
def test_the_prior_is_that_which_the_measurements_make_more_probable(
    fanuc, off, payload_kg, stays_wide
):
    part = kept(replace(fanuc, masses=MASSES, payload_kg=165.0), off, payload_kg)
    found = choose_centre_prior(part, Settings())
    assert (found is part) == stays_wide
    deviations = [
        p.prior_std
        for effect in found.declared.model.effects[1:2]
        for p in effect.parameters
    ]
    assert (
        deviations[1] == pytest.approx(28.0 * np.linalg.norm(MASSES[0].centre_m))
        or stays_wide
    )
    assert found.case.model.effects[1] == found.declared.model.effects[1]
