"""Sites: the chain with all deviations against the chain of the robot, and the links
that each joint carries."""

import numpy as np
import pytest
from support import ODD_CHAINS, OTHER_CHAINS, TRACK, random_angles, robot_of, robot_on

from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians
from elastocal.mechanics.robot_file import parse_robot
from elastocal.mechanics.sites import build_sites

NAMES = ["kuka", "fanuc", *OTHER_CHAINS]
ROUNDING = 2e-14


@pytest.fixture(params=NAMES)
def chain(request, chain_called):
    return chain_called(request.param)


def extended(sites, angles):
    """Coordinates of the sites with joint angles and zeros."""
    return np.concatenate(
        [
            angles,
            np.zeros((*angles.shape[:-1], sites.chain.coordinates - sites.joints)),
        ],
        axis=-1,
    )


@pytest.mark.parametrize("name", [*NAMES, *ODD_CHAINS])
def test_sites_at_zero_leave_the_poses_and_jacobians_of_the_robot(name, chain_called):
    chain = chain_called(name)
    sites = build_sites(robot_on(chain))
    angles = random_angles(np.random.default_rng(0), chain, 2, 3)
    assert [p.name for p in sites.chain.points] == [p.name for p in chain.points]
    for site_point, point in zip(sites.chain.points, chain.points, strict=True):
        expected = compute_poses_and_jacobians(chain, angles, point)
        actual = compute_poses_and_jacobians(
            sites.chain, extended(sites, angles), site_point
        )
        np.testing.assert_allclose(actual[0], expected[0], rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(actual[1], expected[1], rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(
            actual[2][..., : sites.joints], expected[2], rtol=0, atol=ROUNDING
        )


def columns_at(sites, angles, point, coordinates):
    return compute_poses_and_jacobians(
        sites.chain, extended(sites, angles), sites.chain.point(point)
    )[2][..., list(coordinates)]


def test_tilt_about_the_axis_of_a_joint_is_the_joint_itself(chain):
    sites = build_sites(robot_on(chain))
    angles = random_angles(np.random.default_rng(4), chain)
    turning = [t for t in chain.transforms if t.coordinate is not None]
    for joint, transform in enumerate(turning):
        assert sites.joint_axes[joint] == transform.axis
        tilt_axis = sites.tilt[joint][sites.joint_axes[joint]]
        for point in chain.points:
            tilt, turn = columns_at(sites, angles, point.name, [tilt_axis, joint]).T
            np.testing.assert_allclose(
                transform.sign * tilt, turn, rtol=0, atol=ROUNDING
            )


@pytest.mark.parametrize(
    ("point", "link"), [("2DoF", 2), ("3DoF", 3), ("4DoF", 4), ("6DoF", 6)]
)
def test_point_at_the_end_of_a_link_moves_with_it(fanuc, point, link):
    sites = build_sites(fanuc)
    angles = random_angles(np.random.default_rng(5), fanuc.chain)
    rotation = compute_poses(fanuc.chain, angles, fanuc.chain.point(point))[1]
    # A site at the origin of a point shifts and turns it along the axes of their common
    # frame.
    expected = np.kron(np.eye(2), rotation)
    np.testing.assert_allclose(
        columns_at(sites, angles, point, sites.link_end[link]),
        expected,
        rtol=0,
        atol=ROUNDING,
    )
    if link < sites.joints:
        assert not columns_at(
            sites, angles, point, [*sites.tilt[link], *sites.link_end[link + 1]]
        ).any()


CARRIED = {
    "fanuc": [[], [2, 3, 6], [3, 6], [6], [6], []],
    "three joints": [[], [2, 3], [3]],
    "seven joints": [[], [2, 4, 6, 7], [4, 6, 7], [4, 6, 7], [6, 7], [6, 7], [7]],
    # Joints 1 and 2 of this chain are horizontal, so the first one is the shoulder.
    "fixed rotations": [[1, 2, 3, 4], [2, 3, 4], [3, 4], [4]],
}


@pytest.mark.parametrize("name", CARRIED)
def test_carried_links_are_those_whose_weight_can_turn_the_joint(name, chain_called):
    sites = build_sites(robot_on(chain_called(name)))
    lengths = np.linalg.norm(sites.link_vectors_m, axis=1)
    expected = []
    for links in CARRIED[name]:
        expected.append([link for link in links if lengths[link] > 0])
    assert [sites.carried_links(joint) for joint in range(sites.joints)] == expected
    # The shoulder is the first joint that carries weight.
    assert sites.shoulder == next(
        joint for joint, links in enumerate(expected) if links
    )


def test_sites_of_a_robot_on_a_track():
    sites = build_sites(robot_of(TRACK))
    assert sites.prismatic == (True, False, False, False) and sites.joint_signs == (
        -1.0,
        1.0,
        1.0,
        1.0,
    )
    np.testing.assert_allclose(
        sites.link_vectors_m[:3], [(0, 0, 0.3), (0, 0, 0.5), (0.3, 0, 0)], atol=1e-16
    )


def test_weight_acts_on_a_joint_at_the_longest_lever_of_the_middle_of_its_link():
    """Two links of 0.3 and 0.2 m with 4 and 2 kg, stretched out before the joints."""
    robot = parse_robot(
        {
            "name": "planar arm",
            "chain": "Ry(q1) Tx(0.3) Ry(q2) Tx(0.2) [tool]",
            "masses": [
                {"link": 1, "mass_kg": 4, "centre_m": [0, 0, 0], "relative_std": 0.1},
                {"link": 2, "mass_kg": 2, "centre_m": [0, 0, 0], "relative_std": 0.1},
            ],
        }
    )
    sites = build_sites(robot)
    gravity = np.linalg.norm(robot.gravity_m_s2)
    stretched_out = gravity * np.array([4 * 0.15 + 2 * 0.4, 2 * 0.1])
    torques = [sites.longest_weight_torque_Nm(joint) for joint in (0, 1)]
    # The levers are those of sampled postures, the longest of which are nearly stretched.
    assert (torques <= stretched_out).all()
    assert (torques > 0.9 * stretched_out).all()
