"""What links weigh: as declared, by rule, as drawn, and the torques that follow."""

import mujoco
import numpy as np
import pytest
from arms_at_rest import STATES, angles_and_wrenches

from elastocal.plant.arm import link_frames
from elastocal.plant.multibody import machine_of
from elastocal.plant.random_numbers import stream
from elastocal.plant.structure import Structure
from elastocal.plant.weights import declared_masses, gravity_torque, on_stretches, true_masses


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.80665), (3.0, -9.0, 2.0)])
def test_weight_by_levers_is_what_mujocos_model_has_whichever_way_gravity_pulls(arm, gravity):
    masses = on_stretches(true_masses(declared_masses(arm), stream(1, "test")), arm)
    machine = machine_of(arm, Structure(masses=masses, gravity_m_s2=gravity))
    angles, _ = angles_and_wrenches(arm)
    coordinates = np.zeros((STATES, machine.model.nq))
    coordinates[:, machine.drive] = angles
    found = gravity_torque(arm, masses, gravity, angles)
    data = mujoco.MjData(machine.model)
    for row, torque in zip(coordinates[:20], found[:20], strict=True):
        data.qpos[:] = row
        mujoco.mj_forward(machine.model, data)
        np.testing.assert_allclose(torque, -data.qfrc_bias[machine.gear], atol=1e-9 * np.abs(found).max())


def test_declared_centres_stand_in_the_frame_that_turns_with_their_joint(arm):
    """A target put there by a fixed chain of its own moves as the model's centre of mass does."""
    declared = declared_masses(arm)
    machine = machine_of(arm, Structure(masses=on_stretches(declared, arm)))
    angles, _ = angles_and_wrenches(arm)
    coordinates = np.zeros((STATES, machine.model.nq))
    coordinates[:, machine.drive] = angles
    data = mujoco.MjData(machine.model)
    origin, rotation = link_frames(arm, angles)
    for state in range(10):
        data.qpos[:] = coordinates[state]
        mujoco.mj_kinematics(machine.model, data)
        for mass in declared:
            wanted = origin[state, mass.link] + rotation[state, mass.link] @ mass.centre_m
            np.testing.assert_allclose(data.xipos[machine.links[mass.link]], wanted, atol=1e-9)
