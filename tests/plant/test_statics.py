"""Equilibria of the plant against pinocchio, MuJoCo's inverse dynamics and closed forms."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
from arms_at_rest import STATES, angles_and_wrenches, at_rest, loading_of

from elastocal.plant.multibody import machine_of
from elastocal.plant.statics import generalized_forces, places
from elastocal.plant.structure import Compensator, Mass, Structure, TaperedTube


def test_weight_turns_the_joints_as_pinocchio_says(arm):
    masses = (
        Mass(1, 300.0, 0.4),
        Mass(2, 250.0, 0.3, (0.05, 0.02, -0.04)),
        Mass(2, 90.0, 0.9),
        Mass(3, 150.0, 0.6, (0.0, 0.0, 0.1)),
        Mass(arm.joints, 30.0, 0.5),
    )
    load = Mass(arm.joints, 120.0, 1.0, (0.1, -0.05, 0.15))
    machine = machine_of(arm, Structure(masses=masses, payload=load))
    angles, _ = angles_and_wrenches(arm)
    coordinates = np.zeros((STATES, machine.model.nq))
    coordinates[:, machine.drive] = angles
    found = generalized_forces(machine, coordinates, loading_of(angles))[0][:, machine.gear]
    model, parent = pin.Model(), 0
    for number, axis in enumerate(arm.axes):
        place = pin.SE3(arm.stretches[number].rotation, arm.stretches[number].vector_m)
        parent = model.addJoint(parent, pin.JointModelRevoluteUnaligned(axis), place, f"q{number}")
        stretch = arm.stretches[number + 1]
        for mass in masses:
            if mass.stretch == number + 1:
                centre = mass.along * stretch.vector_m + np.array(mass.aside_m)
                model.appendBodyToJoint(parent, pin.Inertia(mass.mass_kg, centre, np.eye(3)), pin.SE3.Identity())
        if number == arm.joints - 1:
            centre = stretch.vector_m + stretch.rotation @ np.array(load.aside_m)
            model.appendBodyToJoint(parent, pin.Inertia(load.mass_kg, centre, np.eye(3)), pin.SE3.Identity())
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    data = model.createData()
    wanted = -np.array([pin.computeGeneralizedGravity(model, data, row) for row in angles])
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())


def test_stretches_that_grow_each_by_its_own_move_targets_as_longer_links_do(arm):
    angles, wrench = angles_and_wrenches(arm)
    growth = np.linspace(2e-4, -1e-4, arm.joints + 1)
    machine = machine_of(arm, Structure())
    coordinates = np.zeros((STATES, machine.model.nq))
    coordinates[:, machine.drive] = angles
    found = places(machine, coordinates, np.broadcast_to(growth, (STATES, arm.joints + 1))).position[:, -1]
    longer = tuple(
        replace(s, vector_m=s.vector_m * (1 + g), points=tuple(replace(p, position_m=p.position_m * (1 + g)) for p in s.points))
        for s, g in zip(arm.stretches, growth, strict=True)
    )
    wanted = at_rest(replace(arm, stretches=longer), angles, 0.0 * wrench)[1].position[:, -1]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def everything(arm):
    tubes = {k: TaperedTube(2e7, 1.5e7, 2e9, 4e8, 0.2) for k in (2, 3)}
    return Structure(
        base=(1e-8, 1e-8, 5e-9, 5e-8, 5e-8, 1e-8),
        flange=(1e-8, 2e-8, 1e-8, 2e-7, 1e-7, 3e-7),
        tilt={1: (1e-7, 1e-7), 4: (2e-7, 2e-7)},
        tubes=tubes,
        masses=(Mass(2, 300.0), Mass(3, 200.0, 0.4, (0.0, 0.0, 0.1))),
        payload=Mass(arm.joints, 100.0, 1.0, (0.1, 0.0, 0.1)),
        compensator=Compensator((-0.3, 0.0, -0.25), (0.2, 0.0, 0.05), 1.5e5, 0.3),
    )


def test_an_arm_with_everything_is_in_equilibrium_by_mujocos_inverse_dynamics(arm):
    """It takes the springs and the compensator from the model's own stiffnesses and tendon, none of which the solver uses."""
    angles, wrench = angles_and_wrenches(arm)
    machine, rest = at_rest(arm, angles, wrench, structure=everything(arm))
    model, data = machine.model, mujoco.MjData(machine.model)
    site = machine.sites[machine.flange]
    free = np.setdiff1d(np.arange(model.nv), machine.drive)
    for row, push in zip(rest.coordinates[:20], wrench[:20], strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = row, 0.0, 0.0
        mujoco.mj_inverse(model, data)
        force = np.zeros(model.nv)
        mujoco.mj_applyFT(model, data, push[:3], push[3:], data.site_xpos[site], model.site_bodyid[site], force)
        left = (data.qfrc_inverse - force)[free]
        assert np.abs(left).max() < 1e-9 * np.abs(force).max()


def test_a_compensator_pulls_by_the_derivative_of_its_energy(arm):
    spring = Compensator((-0.3, 0.1, -0.25), (0.2, 0.0, 0.05), 1.5e5, 0.3)
    machine = machine_of(arm, Structure(compensator=spring))
    angles, _ = angles_and_wrenches(arm)
    before, sense = arm.stretches[1], arm.axes[1]

    def energy(turn):
        rotation = np.array([pin.exp3(q * sense) for q in turn])
        length = np.linalg.norm(
            before.rotation @ rotation @ np.array(spring.crank_m) - before.rotation @ spring.anchor_m, axis=1
        )
        return 0.5 * spring.stiffness_N_per_m * (length - spring.free_length_m) ** 2

    # The anchor is stated in the frame before the shoulder's fixed rotation; none of these arms has one.
    step = 1e-5
    wanted = -(energy(angles[:, 1] + step) - energy(angles[:, 1] - step)) / (2 * step)
    coordinates = np.zeros((STATES, machine.model.nq))
    coordinates[:, machine.drive] = angles
    found = generalized_forces(machine, coordinates, loading_of(angles))[0][:, machine.gear]
    np.testing.assert_allclose(found[:, 1], wanted, atol=1e-4)
    assert np.abs(np.delete(found, 1, axis=1)).max() < 1e-9
