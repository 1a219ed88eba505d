"""The simulation's parser of robot files, checked by hand and against pinocchio."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from analysed_robots import ROBOTS
from arms_at_rest import arm_of
from support import refused

from elastocal_proof.plant.arm import (
    LinkMass,
    build_arm,
    draw_true_masses,
    read_arm,
    to_rotation_matrix,
    to_rotation_vector,
)

CHAIN = "Tz(l1) Rz(q1) Tx(-l2) [A] Rx(90deg) Ty(0.5) Ry(-q2) Tz(0.3) [B]"


def make_document(chain=CHAIN, joints=2, **fields):
    """Contents of a robot file with a chain of some joints."""
    document = {
        "name": "test",
        "chain": chain,
        "lengths_m": {"l1": 0.4, "l2": 0.2} if chain == CHAIN else {},
        "compliance_urad_per_Nm": [float(joint) for joint in range(1, joints + 1)],
        "joint_limits_deg": [[-90.0, 180.0]] * joints,
    }
    return document | fields


ARM = build_arm(make_document())


def test_a_chain_is_cut_into_links_at_its_joints():
    column, link, flange = ARM.links
    np.testing.assert_allclose(
        [link.vector_m for link in ARM.links],
        [[0, 0, 0.4], [-0.2, 0, 0.5], [0, 0, 0.3]],
        atol=1e-15,
    )
    np.testing.assert_allclose(
        link.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15
    )
    np.testing.assert_array_equal(column.rotation, np.eye(3))
    np.testing.assert_array_equal(ARM.axes, [[0, 0, 1], [0, -1, 0]])
    assert not column.points
    assert [*link.points, *flange.points] == list(ARM.points) == ["A", "B"]
    # [A] stands before the fixed rotation.
    position, rotation = link.points["A"]
    np.testing.assert_array_equal(rotation, np.eye(3))
    np.testing.assert_allclose(position, [-0.2, 0, 0])


@pytest.mark.parametrize(
    "chain",
    [
        "Tx(q1) Rz(q2) Tx(1) [A]",
        "Rz(q1) Ry(q2) Tz(1) Ry(-q2) [A]",
        "Rz(q2) Rz(q1) Tx(1) [A]",
    ],
)
def test_a_chain_that_the_simulation_cannot_move_is_refused(chain):
    with refused("my.yaml", "chain", "R.("):
        build_arm(make_document(chain), "my.yaml")


def test_an_arm_whose_controller_reports_other_angles_is_refused():
    reported = {"offset_deg": [0, 90]}
    with refused("my.yaml", "reported_joints"):
        build_arm(make_document(reported_joints=reported), "my.yaml")


def test_masses_and_gravity_are_declared_or_typical():
    entries = [
        {"link": 0, "mass_kg": 5, "centre_m": [0, 0, 1]},
        {"link": 2, "mass_kg": 7.5, "centre_m": [0.1, 0.2, 0.3], "relative_std": 0.02},
    ]
    arm = build_arm(make_document(masses=entries, gravity_m_s2=[9.8, 0, 0]))
    assert arm.masses == (
        LinkMass(0, 5.0, (0.0, 0.0, 1.0), 0.1),
        LinkMass(2, 7.5, (0.1, 0.2, 0.3), 0.02),
    )
    assert arm.gravity_m_s2 == (9.8, 0.0, 0.0)
    assert ARM.gravity_m_s2 == (0.0, 0.0, -9.80665)
    assert not arm.compensated
    assert ARM.compensated
    # The foot, and the carousel with its motors, have their shares of the mass. Each
    # further link weighs half of the one before.
    typical = read_arm(ROBOTS / "kuka.yaml").masses
    mass_kg = np.array([mass.mass_kg for mass in typical])
    assert [mass.link for mass in typical] == list(range(7))
    assert {mass.relative_std for mass in typical} == {0.1}
    np.testing.assert_allclose(mass_kg[3:] / mass_kg[2:-1], 0.5, rtol=5e-3)
    np.testing.assert_allclose(mass_kg[:2] / mass_kg.sum(), [0.18, 0.27], rtol=1e-3)


def test_rotations_agree_with_pinocchio_and_are_inverted_up_to_a_half_turn(rng):
    axis = rng.standard_normal((200, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.concatenate(
        [
            rng.uniform(0, np.pi, 150),
            np.geomspace(1e-12, 1e-3, 25),
            np.pi - np.geomspace(1e-9, 1e-3, 25),
        ]
    )
    vectors = angle[:, None] * axis
    rotations = to_rotation_matrix(vectors)
    expected = [pin.exp3(vector) for vector in vectors]
    np.testing.assert_allclose(rotations, expected, atol=1e-12)
    np.testing.assert_allclose(to_rotation_vector(rotations), vectors, atol=1e-9)


def test_undeclared_compliances_and_limits_are_typical():
    document = make_document(payload_kg=50)
    del document["compliance_urad_per_Nm"], document["joint_limits_deg"]
    arm = build_arm(document)
    levers = np.array([np.hypot(0.2, 0.5) + 0.3, 0.3])
    np.testing.assert_allclose(
        arm.compliance, 2e-3 / (50 * 9.80665 * levers), rtol=1e-12
    )
    np.testing.assert_allclose(arm.limits, [[-2 * np.pi, 2 * np.pi]] * 2)
    short_arm = build_arm(document | {"chain": "Rz(q1) Tx(1) Rz(q2) Tx(0.1) [A]"})
    np.testing.assert_allclose(
        short_arm.compliance[1], 2e-3 / (50 * 9.80665 * 0.2), rtol=1e-12
    )


@pytest.mark.parametrize(
    "centre, std_m, std_with_lower_bound_m",
    [
        ((0.0, 0.3, 0.4), 0.01, 0.01),
        ((0.0, 0.0, 0.0), 0.002, 0.006),
        ((0.2, 0.0, 0.0), 0.004, 0.006),
    ],
)
def test_the_std_of_a_centre_is_a_share_of_its_distance_with_a_lower_bound(
    centre, std_m, std_with_lower_bound_m
):
    mass = LinkMass(1, 10.0, centre, 0.02)
    assert mass.centre_std_m() == pytest.approx(std_m)
    assert mass.centre_std_m(0.3) == pytest.approx(std_with_lower_bound_m)


def test_undeclared_offsets_move_centres_across_their_links_only():
    arm = arm_of("Tz(0.4) Ry(q1) Tx(2) Ry(q2) [elbow] Tx(1) [hand]")
    max_offset_m = 0.02
    masses = (
        LinkMass(0, 9.0, (0.0, 0.0, 0.1), 0.1),
        LinkMass(1, 8.0, (0.5, 0.0, 0.0), 0.1),
    )
    arm = replace(arm, masses=masses * 100)
    on_line, moved = (
        draw_true_masses(
            arm, np.random.default_rng(3), offset_m, np.random.default_rng(4)
        )
        for offset_m in (0.0, max_offset_m)
    )
    assert [(mass.link, mass.mass_kg) for mass in moved] == [
        (mass.link, mass.mass_kg) for mass in on_line
    ]
    centres_on_line = np.array([mass.centre_m for mass in on_line])
    offsets = np.array([mass.centre_m for mass in moved]) - centres_on_line
    for link, along, across in ((0, [2], [0, 1]), (1, [0], [1, 2])):
        link_offsets = offsets[link::2]
        np.testing.assert_allclose(link_offsets[:, along], 0.0, atol=1e-15)
        largest = np.abs(link_offsets[:, across]).max(axis=0)
        assert (largest <= max_offset_m).all()
        assert (largest > 0.8 * max_offset_m).all()
