"""Equilibria of the plant against pinocchio, MuJoCo's inverse dynamics and closed forms."""

from dataclasses import replace
from itertools import cycle

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from arms_at_rest import STATES, angles_and_wrenches, arm_of, at_rest, driven_to, loading_of
from scipy.optimize import brentq

from elastocal_proof.plant.multibody import machine_of
from elastocal_proof.plant.statics import Loading, equilibrium, generalized_forces, places
from elastocal_proof.plant.structure import Compensator, Mass, Structure, TaperedTube


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
    found = generalized_forces(machine, driven_to(machine, angles), loading_of(angles))[0][:, machine.gear]
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
    found = places(machine, driven_to(machine, angles), np.tile(growth, (STATES, 1))).position[:, -1]
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
    found = generalized_forces(machine, driven_to(machine, angles), loading_of(angles))[0][:, machine.gear]
    np.testing.assert_allclose(found[:, 1], wanted, atol=1e-4)
    assert np.abs(np.delete(found, 1, axis=1)).max() < 1e-9


# One joint about y, its link forwards along x, and a measuring point at its end.
LEVER = arm_of("Ry(q1) Tx(1.0) [A]", compliance_urad_per_Nm=[50.0])


def test_a_lever_comes_to_rest_where_its_spring_carries_its_weight():
    mass, angles = 200.0, np.array([[-1.0], [0.0], [0.7], [np.pi / 2]])
    found = at_rest(LEVER, angles, np.zeros((4, 6)), Structure(masses=(Mass(1, mass, 0.8),)))[1]
    moment = mass * 9.80665 * 0.8
    # theta = C m g l cos(q + theta), to all orders; seven degrees at most.
    wanted = [brentq(lambda t, q=q: t - 50e-6 * moment * np.cos(q + t), -1.0, 1.0, xtol=1e-15) for q in angles[:, 0]]
    np.testing.assert_allclose(found.coordinates[:, found.gear[0]], wanted, atol=1e-11)
    np.testing.assert_allclose(found.position[:, 0, 2], -np.sin(angles[:, 0] + wanted), atol=1e-11)
    assert max(wanted) > 0.07


def test_a_force_acts_at_the_deflected_flange_and_a_moment_wherever_it_is():
    wrench = np.array([[300.0, 0.0, -800.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 500.0, 0.0]])
    found = at_rest(LEVER, np.zeros((2, 1)), wrench)[1].coordinates[:, 1]
    # (cos t, 0, -sin t) x (300, 0, -800) about y.
    bent = brentq(lambda t: t - 50e-6 * (-300.0 * np.sin(t) + 800.0 * np.cos(t)), -1.0, 1.0, xtol=1e-15)
    np.testing.assert_allclose(found, [bent, 50e-6 * 500.0], atol=1e-11)


def test_a_structural_spring_yields_by_its_compliance_its_law_and_its_offset():
    machine = machine_of(LEVER, Structure(base=(0.0, 0.0, 2e-8, 0.0, 0.0, 0.0)))
    index, wrench = machine.springs["base_z"], np.array([[0.0, 0.0, 1000.0, 0.0, 0.0, 0.0], [0.0, 0.0, -500.0, 0.0, 0.0, 0.0]])
    offsets = {index: np.array([1e-5, 3e-5])}
    loading = Loading(np.full((2, 1), np.pi / 2), wrench, np.zeros((2, 2)), offsets)
    laws = [("base_z", lambda force: 1e-11 * force**2), ("nothing", lambda force: force)]
    found = equilibrium(machine, loading, lambda torque, unloaded: 0.0 * torque, laws)
    np.testing.assert_allclose(found.coordinates[:, index], [2e-5 + 1e-5 + 1e-5, -1e-5 + 0.25e-5 + 3e-5], rtol=1e-12)
    np.testing.assert_allclose(found.torque[:, index], [1000.0, -500.0])


@pytest.mark.parametrize("mass", [0.0, 100.0])
def test_gears_know_the_torque_before_the_load_came_on(mass):
    seen = []
    machine = machine_of(LEVER, Structure(masses=(Mass(1, mass, 1.0),) if mass else ()))

    def law(torque, unloaded):
        seen.append(unloaded.copy())
        return 0.0 * torque

    equilibrium(machine, Loading(np.zeros((1, 1)), np.array([[0, 0, -50.0, 0, 0, 0]]), np.zeros((1, 2))), law)
    np.testing.assert_allclose(seen, np.full((len(seen), 1, 1), mass * 9.80665), atol=1e-9)


def test_an_arm_that_finds_no_rest_is_an_error_that_has_its_last_step():
    signs = cycle([0.01, -0.01])
    loading = Loading(np.zeros((1, 1)), np.zeros((1, 6)), np.zeros((1, 2)))
    with pytest.raises(RuntimeError, match=r"^no equilibrium after 60 sweeps: the last moved by 0\.02$"):
        equilibrium(machine_of(LEVER, Structure()), loading, lambda torque, _: 0 * torque + next(signs))


def test_a_start_near_the_rest_saves_sweeps_and_changes_nothing():
    angles = np.array([[0.1], [0.9]])
    wrench = np.tile([0.0, 0.0, -900.0, 0.0, 0.0, 0.0], (2, 1))
    machine, first = at_rest(LEVER, angles, wrench)
    loading = Loading(angles, wrench, np.zeros((2, 2)))
    again = equilibrium(machine, loading, lambda torque, _: LEVER.compliance * torque, start=first.coordinates[:, first.gear])
    np.testing.assert_allclose(again.coordinates, first.coordinates, atol=1e-12)
    assert again.sweeps == 1 < first.sweeps


def test_growth_of_one_state_is_in_no_other_and_the_model_keeps_its_own_lengths():
    machine = machine_of(LEVER, Structure())
    growth = np.array([[0.0, 0.0], [0.0, 1e-3], [0.0, 0.0], [0.0, -2e-3]])
    before = machine.model.body_pos.copy(), machine.model.site_pos.copy()
    found = places(machine, np.zeros((4, 2)), growth)
    np.testing.assert_allclose(found.position[:, 0, 0], [1.0, 1.001, 1.0, 0.998], atol=1e-15)
    np.testing.assert_array_equal(machine.model.body_pos, before[0])
    np.testing.assert_array_equal(machine.model.site_pos, before[1])


def test_forces_do_the_work_that_moving_each_coordinate_takes(fanuc_arm):
    """Virtual work: of the load, the weights and the compensator together, by differences of their energies."""
    machine = machine_of(fanuc_arm, everything(fanuc_arm))
    rng, model = np.random.default_rng(3), machine.model
    angles, push = rng.uniform(-1, 1, (1, 6)), np.array([[400.0, -700.0, 300.0, 0.0, 0.0, 0.0]])
    coordinates, loading = driven_to(machine, angles), Loading(angles, push, np.zeros((1, 7)))
    force = generalized_forces(machine, coordinates, loading)[0][0]

    def energy(moved):
        where = places(machine, moved, np.zeros((len(moved), 7)))
        length = np.linalg.norm(where.spring[:, 0] - where.spring[:, 1], axis=1)
        weight = where.mass @ [0.0, 0.0, 9.80665] @ model.body_mass
        return weight + 0.5 * 1.5e5 * (length - 0.3) ** 2 - where.position[:, -1] @ push[0, :3]

    step = 1e-5
    ahead, behind = (energy(coordinates + sign * step * np.eye(model.nq)) for sign in (1, -1))
    np.testing.assert_allclose(force, (behind - ahead) / (2 * step), atol=1e-3)
