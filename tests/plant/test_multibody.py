"""The compiled arm and its equilibria, checked against the model of the analysis,
pinocchio, MuJoCo's inverse dynamics and closed forms."""

from itertools import cycle

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from arms_at_rest import angles_and_wrenches, arm_of, at_rest, forces_at
from support import OTHER_CHAINS, robot_of

from elastocal.errors import InputError
from elastocal.mechanics.elastostatics import (
    compute_generalized_forces as joint_torques,
)
from elastocal.mechanics.kinematics import (
    compute_pose_differences,
    compute_poses_and_jacobians,
)
from elastocal_proof.plant.arm import LinkMass
from elastocal_proof.plant.multibody import (
    EquilibriumProblem,
    Structure,
    TaperedTube,
    build_model,
    solve_equilibrium,
)

# One joint about y, and a link along x with a measuring point at its end.
LEVER = arm_of("Ry(q1) Tx(1.0) [A]", compliance_urad_per_Nm=[50.0])


def make_complete_structure(arm):
    """A structure with every kind of elasticity and weight."""
    return Structure(
        base=(1e-8, 1e-8, 5e-9, 5e-8, 5e-8, 1e-8),
        flange=(1e-8, 2e-8, 1e-8, 2e-7, 1e-7, 3e-7),
        bearings={1: (1e-7, 1e-7), arm.joints - 1: (2e-7, 2e-7)},
        tubes={
            k: TaperedTube(2e7, 1.5e7, 2e9, 4e8, 0.2) for k in (2, 3) if k < arm.joints
        },
        masses=(
            LinkMass(2, 300.0, (0.1, 0.0, 0.4)),
            LinkMass(min(3, arm.joints), 200.0, (0.2, 0.0, 0.1), along=0.4),
        ),
        payload=LinkMass(arm.joints, 100.0, (0.1, 0.0, 0.1)),
        compensator=((-0.3, 0.0, -0.25), (0.2, 0.0, 0.05), 1.5e5, 0.3),
    )


@pytest.mark.parametrize("chain", sorted(OTHER_CHAINS))
def test_arms_of_three_to_seven_joints_bend_like_the_model_of_the_analysis(chain):
    """J C J^T w of each measuring point; both arms have compliances 1 to n, and joints
    that turn backwards."""
    robot = robot_of(OTHER_CHAINS[chain])
    arm = arm_of(OTHER_CHAINS[chain])
    angles, wrench = angles_and_wrenches(arm, force=10.0)
    model, rest = at_rest(arm, angles, wrench)
    _, position, rotation = forces_at(model, angles)
    poses_and_jacobians = [
        compute_poses_and_jacobians(robot.chain, angles, point)
        for point in robot.chain.points
    ]
    turn = robot.compliance * joint_torques(poses_and_jacobians[-1][2], wrench)
    for point, (expected_position, expected_rotation, jacobian) in enumerate(
        poses_and_jacobians
    ):
        np.testing.assert_allclose(position[:, point], expected_position, atol=1e-12)
        np.testing.assert_allclose(rotation[:, point], expected_rotation, atol=1e-12)
        deflection = compute_pose_differences(
            rest.position[:, point],
            rest.rotation[:, point],
            position[:, point],
            rotation[:, point],
        )
        np.testing.assert_allclose(
            deflection, np.einsum("sij,sj->si", jacobian, turn), atol=2e-8
        )


GRAVITY = (3.0, -2.0, -9.0)


def build_pinocchio_model(arm, masses, payload):
    """The same rigid arm with the same weights in pinocchio."""
    model = pin.Model()
    parent = 0
    for number, axis in enumerate(arm.axes):
        placement = pin.SE3(arm.links[number].rotation, arm.links[number].vector_m)
        joint = pin.JointModelRevoluteUnaligned(axis)
        parent = model.addJoint(parent, joint, placement, f"q{number}")
        weights = [
            (mass.mass_kg, np.array(mass.centre_m))
            for mass in masses
            if mass.link == number + 1
        ]
        if number == arm.joints - 1:
            link = arm.links[number + 1]
            centre = link.vector_m + link.rotation @ np.array(payload.centre_m)
            weights.append((payload.mass_kg, centre))
        for mass_kg, centre in weights:
            inertia = pin.Inertia(mass_kg, centre, np.eye(3))
            model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.gravity.linear = np.array(GRAVITY)
    return model


def test_gravity_torques_agree_with_pinocchio(arm):
    masses = (
        LinkMass(1, 300.0, (0.1, 0.0, 0.3)),
        LinkMass(2, 250.0, (0.4, 0.02, -0.04)),
        LinkMass(2, 90.0, (0.0, 0.1, 0.9)),
        LinkMass(3, 150.0, (0.3, 0, 0.1)),
    )
    payload = LinkMass(arm.joints, 120.0, (0.1, -0.05, 0.15))
    structure = Structure(masses=masses, payload=payload, gravity_m_s2=GRAVITY)
    angles, _ = angles_and_wrenches(arm)
    torques = forces_at(build_model(arm, structure), angles)[0]
    model = build_pinocchio_model(arm, masses, payload)
    data = model.createData()
    expected = -np.array(
        [pin.computeGeneralizedGravity(model, data, row) for row in angles]
    )
    tolerance = 1e-9 * np.abs(expected).max()
    np.testing.assert_allclose(torques, expected, atol=tolerance)


def test_a_complete_arm_is_in_equilibrium_by_mujocos_inverse_dynamics(arm):
    """Each spring pulls back by its deflection divided by its compliance."""
    angles, wrench = angles_and_wrenches(arm)
    model, rest = at_rest(arm, angles, wrench, structure=make_complete_structure(arm))
    mujoco_model = model.model
    data = mujoco.MjData(mujoco_model)
    compliance = model.compliance.copy()
    compliance[model.gear] = arm.compliance
    # Drives, and coordinates that no law moves, do not yield.
    elastic = np.flatnonzero(compliance > 0)
    flange = model.sites[-1]
    for row, push in zip(rest.coordinates[:20], wrench[:20], strict=True):
        data.qpos[:] = row
        data.qvel[:] = 0.0
        data.qacc[:] = 0.0
        mujoco.mj_inverse(mujoco_model, data)
        force = np.zeros(mujoco_model.nv)
        mujoco.mj_applyFT(
            mujoco_model,
            data,
            push[:3],
            push[3:],
            data.site_xpos[flange],
            mujoco_model.site_bodyid[flange],
            force,
        )
        spring_force = row[elastic] / compliance[elastic]
        imbalance = (data.qfrc_inverse - force)[elastic] + spring_force
        assert np.abs(imbalance).max() < 1e-9 * np.abs(force).max()


def test_an_iteration_that_does_not_settle_is_an_error():
    signs = cycle([0.01, -0.01])
    problem = EquilibriumProblem(
        drive=np.zeros((1, 1)),
        growth=np.zeros((1, 2)),
        applied_wrench=lambda rotation: np.zeros((1, 6)),
        gear_deflection=lambda torque, unloaded: 0 * torque + next(signs),
    )
    with pytest.raises(
        RuntimeError, match=r"^no equilibrium after 60 sweeps: the last moved by 0\.02$"
    ):
        solve_equilibrium(build_model(LEVER, Structure()), problem)


def test_geometry_errors_of_a_link_move_no_point_inside_it():
    arm = arm_of("Rz(q1) Tx(0.4) [inner] Tx(0.6) Ry(q2) Tx(0.5) [B]")
    errors = {1: ((0.0, 0.02, 0.0), (0.0, 0.0, 0.1))}
    model = build_model(arm, Structure(geometry_errors=errors))
    position = forces_at(model, np.zeros((1, 2)))[1]
    np.testing.assert_allclose(position[0, 0], [0.4, 0.0, 0.0], atol=1e-14)


def test_an_elastic_link_with_a_point_inside_it_is_refused():
    arm = arm_of("Rz(q1) Tx(0.4) [inner] Tx(0.6) Ry(q2) Tx(0.5) [B]")
    with pytest.raises(InputError, match="inner"):
        build_model(arm, Structure(tubes={1: TaperedTube(1e6, 1e6)}))
