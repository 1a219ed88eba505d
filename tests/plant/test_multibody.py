"""The compiled arm and its equilibria against the analysis' own model, pinocchio,
MuJoCo's inverse dynamics, closed forms."""

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

# One joint about y, its link forwards along x, and a measuring point at its end.
LEVER = arm_of("Ry(q1) Tx(1.0) [A]", compliance_urad_per_Nm=[50.0])


def everything(arm):
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


@pytest.mark.parametrize("name_of_chain", sorted(OTHER_CHAINS))
def test_chains_of_three_to_seven_joints_that_turn_backwards_are_read_and_bend_alike(
    name_of_chain,
):
    """J C J^T w of each measuring point; both have compliances 1 to n."""
    robot = robot_of(OTHER_CHAINS[name_of_chain])
    arm = arm_of(OTHER_CHAINS[name_of_chain])
    angles, wrench = angles_and_wrenches(arm, force=10.0)
    machine, bent = at_rest(arm, angles, wrench)
    _, position, rotation = forces_at(machine, angles)
    seen = [
        compute_poses_and_jacobians(robot.chain, angles, point)
        for point in robot.chain.points
    ]
    turn = robot.compliance * joint_torques(seen[-1][2], wrench)
    for p, (place, facing, jacobian) in enumerate(seen):
        np.testing.assert_allclose(position[:, p], place, atol=1e-12)
        np.testing.assert_allclose(rotation[:, p], facing, atol=1e-12)
        found = compute_pose_differences(
            bent[2][:, p], bent[3][:, p], position[:, p], rotation[:, p]
        )
        np.testing.assert_allclose(
            found, np.einsum("sij,sj->si", jacobian, turn), atol=2e-8
        )


def test_weight_turns_the_joints_as_pinocchio_says(arm):
    places = [
        (1, 300.0, (0.1, 0.0, 0.3)),
        (2, 250.0, (0.4, 0.02, -0.04)),
        (2, 90.0, (0.0, 0.1, 0.9)),
        (3, 150.0, (0.3, 0, 0.1)),
    ]
    masses = tuple(LinkMass(*each) for each in places)
    load = LinkMass(arm.joints, 120.0, (0.1, -0.05, 0.15))
    gravity = (3.0, -2.0, -9.0)
    angles, _ = angles_and_wrenches(arm)
    found = forces_at(
        build_model(arm, Structure(masses=masses, payload=load, gravity_m_s2=gravity)),
        angles,
    )[0]
    model = pin.Model()
    parent = 0
    for number, axis in enumerate(arm.axes):
        place = pin.SE3(arm.links[number].rotation, arm.links[number].vector_m)
        parent = model.addJoint(
            parent, pin.JointModelRevoluteUnaligned(axis), place, f"q{number}"
        )
        stretch = arm.links[number + 1]
        weights = [
            (m.mass_kg, np.array(m.centre_m)) for m in masses if m.link == number + 1
        ]
        if number == arm.joints - 1:
            weights.append(
                (
                    load.mass_kg,
                    stretch.vector_m + stretch.rotation @ np.array(load.centre_m),
                )
            )
        for kilograms, centre in weights:
            model.appendBodyToJoint(
                parent, pin.Inertia(kilograms, centre, np.eye(3)), pin.SE3.Identity()
            )
    model.gravity.linear = np.array(gravity)
    data = model.createData()
    wanted = -np.array(
        [pin.computeGeneralizedGravity(model, data, row) for row in angles]
    )
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())


def test_an_arm_with_everything_is_in_equilibrium_by_mujocos_inverse_dynamics(arm):
    """Each spring pulls back by what it has yielded over its compliance."""
    angles, wrench = angles_and_wrenches(arm)
    machine, rest = at_rest(arm, angles, wrench, structure=everything(arm))
    model, data = machine.model, mujoco.MjData(machine.model)
    compliance = machine.compliance.copy()
    compliance[machine.gear] = arm.compliance
    # What is commanded stays where it is, and so does what no law lets yield.
    free = np.flatnonzero(compliance > 0)
    flange = machine.sites[-1]
    for row, push in zip(rest[0][:20], wrench[:20], strict=True):
        data.qpos[:] = row
        data.qvel[:] = 0.0
        data.qacc[:] = 0.0
        mujoco.mj_inverse(model, data)
        force = np.zeros(model.nv)
        mujoco.mj_applyFT(
            model,
            data,
            push[:3],
            push[3:],
            data.site_xpos[flange],
            model.site_bodyid[flange],
            force,
        )
        left = (data.qfrc_inverse - force)[free] + row[free] / compliance[free]
        assert np.abs(left).max() < 1e-9 * np.abs(force).max()


def test_an_arm_that_finds_no_rest_is_an_error():
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


def test_a_point_inside_a_link_of_wrong_length_keeps_its_place_and_none_may_be_inside_an_elastic_one():
    arm = arm_of("Rz(q1) Tx(0.4) [inner] Tx(0.6) Ry(q2) Tx(0.5) [B]")
    machine = build_model(
        arm, Structure(geometry_errors={1: ((0.0, 0.02, 0.0), (0.0, 0.0, 0.1))})
    )
    np.testing.assert_allclose(
        forces_at(machine, np.zeros((1, 2)))[1][0, 0], [0.4, 0.0, 0.0], atol=1e-14
    )
    with pytest.raises(InputError, match="inner"):
        build_model(arm, Structure(tubes={1: TaperedTube(1e6, 1e6)}))
