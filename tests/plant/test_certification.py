"""The faultless plant against the analysis' own model, pinocchio and MuJoCo's inverse dynamics, which share no line with it."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS, analysed
from arms_at_rest import STATES, angles_and_wrenches, arm_of, at_rest, driven_to, loading_of
from durations import growth
from support import OTHER_CHAINS, robot_of

from elastocal.mechanics.chain import stretches
from elastocal.mechanics.elastostatics import generalized_forces as joint_torques
from elastocal.mechanics.kinematics import poses, poses_and_jacobians
from elastocal.mechanics.links import extended_chain, spring_compliance
from elastocal.mechanics.pose_differences import pose_differences
from elastocal.mechanics.robot import Link, Tube
from elastocal_proof.plant.arm import arm_from_file, link_frames
from elastocal_proof.plant.campaigns import usual_force_N
from elastocal_proof.plant.statics import generalized_forces
from elastocal_proof.plant.structure import Structure, TaperedTube
from elastocal_proof.plant.weights import declared_masses, on_stretches


def deflections(arm, angles, wrench, **more):
    """Of each measuring point, m and rad, ndarray (points, S, 6)."""
    machine, bent = at_rest(arm, angles, wrench, **more)
    rest = generalized_forces(machine, driven_to(machine, bent.coordinates[:, machine.drive]), loading_of(angles))[1]
    position, rotation = rest.position, rest.rotation
    points = range(position.shape[1])
    return np.array(
        [pose_differences(bent.position[:, p], bent.rotation[:, p], position[:, p], rotation[:, p]) for p in points]
    )


def linear_deflections(chain, coordinates, wrench, compliance):
    """J C J^T w of each measuring point, ndarray (points, S, 6)."""
    torque = joint_torques(poses_and_jacobians(chain, coordinates, chain.end_effector)[2], wrench)
    turn = torque @ compliance
    return np.array([np.einsum("sij,sj->si", poses_and_jacobians(chain, coordinates, p)[2], turn) for p in chain.points])


def assert_unloaded_poses_alike(arm, robot, angles):
    _, rest = at_rest(arm, angles, np.zeros((len(angles), 6)))
    for number, point in enumerate(robot.chain.points):
        position, rotation = poses(robot.chain, angles, point)
        np.testing.assert_allclose(rest.position[:, number], position, atol=1e-12)
        np.testing.assert_allclose(rest.rotation[:, number], rotation, atol=1e-12)


@pytest.mark.parametrize("key", ["kuka", "fanuc", "abb", "ur10", "gp180", "iiwa14"])
def test_poses_without_load_are_those_of_the_kinematics(key):
    arm = arm_from_file(ROBOTS / f"{key}.yaml")
    assert_unloaded_poses_alike(arm, analysed(key), angles_and_wrenches(arm)[0])


@pytest.mark.parametrize("name_of_chain", sorted(OTHER_CHAINS))
def test_joints_that_turn_backwards_fixed_rotations_and_points_inside_links_are_read_alike(name_of_chain):
    """Poses and deflections of chains of three to seven joints."""
    text = OTHER_CHAINS[name_of_chain]
    # Both have compliances 1 to n.
    robot, arm = robot_of(text), arm_of(text)
    angles, wrench = angles_and_wrenches(arm, force=10.0)
    assert_unloaded_poses_alike(arm, robot, angles)
    wanted = linear_deflections(robot.chain, angles, wrench, np.diag(robot.compliance))
    np.testing.assert_allclose(deflections(arm, angles, wrench), wanted, atol=2e-8)


def test_joint_springs_deflect_all_points_as_the_reduced_model_to_second_order(arm, name):
    robot = analysed(name)
    angles, wrench = angles_and_wrenches(arm, usual_force_N(arm))
    # Of a heavy arm under a kilonewton 1; deflections of second order go with its square.
    more = arm.softness * arm.load_share
    linear = linear_deflections(robot.chain, angles, wrench, np.diag(robot.compliance))
    rest = deflections(arm, angles, wrench) - linear
    metres = np.linalg.norm(rest[..., :3], axis=-1)
    # Second order: theta F L / K, a thousandth of millimetres. The FANUC's first joint is the softest of them.
    assert np.sqrt((metres**2).mean(axis=1)).max() < 6e-6 * more**2
    assert metres.max() < 2.5e-3 * more * np.linalg.norm(linear[..., :3], axis=-1).max() + 1e-9
    halved = deflections(arm, angles, 0.5 * wrench) - 0.5 * linear
    # And nothing of first order: a quarter of it remains at half the force.
    np.testing.assert_allclose(halved[..., :3], 0.25 * rest[..., :3], atol=2e-8 * more**3)


def test_a_tube_in_segments_bends_twists_and_stretches_as_the_catalogues_cantilever():
    arm, robot = arm_from_file(ROBOTS / "kuka.yaml"), analysed("kuka")
    tube = Tube(0.25, 0.02, 70e9, 26e9)
    robot = replace(robot, links=tuple(Link(after, vector, tube) for after, vector in stretches(robot.chain)))
    inner = tube.outer_diameter_m - 2 * tube.wall_m
    second = np.pi * (tube.outer_diameter_m**4 - inner**4) / 64
    area = np.pi * (tube.outer_diameter_m**2 - inner**2) / 4
    mine = TaperedTube(70e9 * second, 2 * 26e9 * second, 70e9 * area)
    long = {number: mine for number, stretch in enumerate(arm.stretches) if stretch.vector_m.any()}
    angles, wrench = angles_and_wrenches(arm, force=10.0)
    chain = extended_chain(robot)
    coordinates = np.zeros((STATES, chain.coordinates))
    coordinates[:, : arm.joints] = angles
    wanted = linear_deflections(chain, coordinates, wrench, spring_compliance(robot))
    worst = []
    for segments in (2, 4, 8):
        found = deflections(arm, angles, wrench, structure=Structure(tubes=long, segments=segments))
        off = np.linalg.norm((found - wanted)[..., :3], axis=-1)
        worst.append(np.sqrt((off**2).mean() / (np.linalg.norm(wanted[..., :3], axis=-1) ** 2).mean()))
    # The midpoint rule misses l^3 / 12 n^2 EI of l^3 / 3 EI.
    assert worst[2] < 5e-4
    assert worst[0] / worst[1] == pytest.approx(4.0, rel=0.1)


def test_base_springs_and_bearing_tilt_deflect_as_springs_of_the_chain():
    arm, robot = arm_from_file(ROBOTS / "kuka.yaml"), analysed("kuka")
    angles, wrench = angles_and_wrenches(arm, force=10.0)
    base, tilt = np.array([3e-8, 2e-8, 1e-8, 4e-8, 5e-8, 2e-8]), (2e-7, 3e-7)
    found = deflections(arm, angles, wrench, structure=Structure(base=tuple(base), tilt={2: tilt}))
    wanted = linear_deflections(robot.chain, angles, wrench, np.diag(robot.compliance))
    flange = poses(robot.chain, angles, robot.chain.end_effector)[0]
    shoulder = poses(robot.chain, angles, replace(robot.chain.end_effector, after=3))
    force, moment = wrench[:, :3], wrench[:, 3:]
    foot_turn = base[3:] * (moment + np.cross(flange, force))
    at_shoulder = moment + np.cross(flange - shoulder[0], force)
    # Behind joint 2, which turns about y, axes x and z of the frame that it carries.
    arm_frame = poses(robot.chain, angles, replace(robot.chain.end_effector, after=4))[1]
    across = ((tilt[0], arm_frame[..., 0]), (tilt[1], arm_frame[..., 2]))
    tilted = sum(c * (at_shoulder * axis).sum(axis=1)[:, None] * axis for c, axis in across)
    for number, point in enumerate(robot.chain.points):
        position = poses(robot.chain, angles, point)[0]
        moved = base[:3] * force + np.cross(foot_turn, position) + np.cross(tilted, position - shoulder[0])
        off = found[number] - wanted[number] - np.hstack([moved, foot_turn + tilted])
        assert np.abs(off).max() < 3e-9


def test_base_and_links_yield_under_the_arms_own_weight(arm):
    """Without a load and with stiff gears, what sags is the foot under the moment of all weights."""
    masses = on_stretches(declared_masses(arm), arm)
    angles, wrench = angles_and_wrenches(arm)
    tilt = 5e-9 * arm.softness
    structure = Structure(base=(0.0, 0.0, 0.0, tilt, tilt, 0.0), masses=masses)
    found = at_rest(arm, angles, 0.0 * wrench, structure=structure, compliance=1e-15 * arm.compliance)[1]
    weights = [mass for mass in declared_masses(arm)]
    origin, rotation = link_frames(arm, angles)
    centres = np.stack([origin[:, m.link] + rotation[:, m.link] @ m.centre_m for m in weights], axis=1)
    pull = np.array([m.mass_kg for m in weights])[:, None] * np.array([0.0, 0.0, -9.80665])
    turn = tilt * np.cross(centres, pull).sum(axis=1) * [1.0, 1.0, 0.0]
    still = at_rest(arm, angles, 0.0 * wrench)[1].position[:, -1]
    moved = found.position[:, -1] - still
    np.testing.assert_allclose(moved, np.cross(turn, still), atol=2e-3 * np.abs(moved).max())


def test_a_hundred_states_take_less_than_ten_times_as_long_as_one(arm):
    angles, wrench = angles_and_wrenches(arm)
    assert len(angles) == 100
    assert growth(lambda: at_rest(arm, angles[:1], wrench[:1]), lambda: at_rest(arm, angles, wrench)) < 10
