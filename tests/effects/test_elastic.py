"""A carriage yields along its track, beside the closed forms."""

import numpy as np
from support import ODD_CHAINS, robot_of
from synthetic import made_estimate, made_model, made_states

from elastocal.campaigns.campaign import Target
from elastocal.effects.elastic import joint_compliance
from elastocal.fitting.model import conditions, displaced_coordinates


def test_carriage_yields_to_the_force_along_its_track():
    robot = robot_of(ODD_CHAINS["track"], [1e-8, 1e-6, 1e-6, 1e-6])
    model = made_model(robot, (Target("A", "hand", (0, 0, 0)),), fitted_frames=False, compliance=robot.compliance)
    states = made_states(4, 3, seed=22)
    shifted = displaced_coordinates(model, made_estimate(model), conditions(model, made_estimate(model), states))[:, 0]
    # The carriage runs along -x.
    np.testing.assert_allclose(shifted - states.joint_angles[:, 0], -1e-8 * states.wrench[:, 0], rtol=1e-9)
    assert [p.unit for p in joint_compliance(model.sites).parameters] == ["m/N", *["rad/(N m)"] * 3]
