"""The springs of the declared model: each joint turns, or shifts, by its own torque alone."""

import numpy as np
from support import ODD_CHAINS, chain_of, robot_of
from synthetic import made_estimate, made_model, made_states

from elastocal.campaigns.campaign import Target
from elastocal.effects import catalogue
from elastocal.effects.joint_compliance import candidate as joint_compliance
from elastocal.fitting.displacement import conditions, displaced_coordinates
from elastocal.mechanics.sites import sites_of


def test_carriage_yields_to_the_force_along_its_track():
    robot = robot_of(ODD_CHAINS["track"], [1e-8, 1e-6, 1e-6, 1e-6])
    model = made_model(robot, (Target("A", "hand", (0, 0, 0)),), fitted_frames=False, compliance=robot.compliance)
    states = made_states(4, 3, seed=22)
    shifted = displaced_coordinates(model, made_estimate(model), conditions(model, made_estimate(model), states))[:, 0]
    # The carriage runs along -x.
    np.testing.assert_allclose(shifted - states.joint_angles[:, 0], -1e-8 * states.wrench[:, 0], rtol=1e-9)
    assert [p.unit for p in joint_compliance(model.sites).parameters] == ["m/N", *["rad/(N m)"] * 3]


def test_springs_are_no_effect_that_the_model_may_lack():
    assert "joint_compliance" not in catalogue.effects()
    springs = joint_compliance(sites_of(chain_of(ODD_CHAINS["parallelogram"])))
    assert springs.family == "declared" and [p.name for p in springs.parameters] == ["c1", "c2", "c3", "c4"]
    assert all(p.prior_std is None and p.plausible > 0 for p in springs.parameters)
