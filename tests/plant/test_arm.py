"""Robot files as the plant reads them, by hand and against pinocchio."""

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


def document(chain=CHAIN, joints=2, **more):
    lengths = {"l1": 0.4, "l2": 0.2} if chain == CHAIN else {}
    limits = [[-90.0, 180.0]] * joints
    compliance = [float(joint) for joint in range(1, joints + 1)]
    return {
        "name": "test",
        "chain": chain,
        "lengths_m": lengths,
        "compliance_urad_per_Nm": compliance,
        "joint_limits_deg": limits,
    } | more


ARM = build_arm(document())


def test_a_chain_is_cut_into_stretches_at_its_joints():
    column, link, flange = ARM.links
    np.testing.assert_allclose(
        [s.vector_m for s in ARM.links],
        [[0, 0, 0.4], [-0.2, 0, 0.5], [0, 0, 0.3]],
        atol=1e-15,
    )
    np.testing.assert_allclose(
        link.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15
    )
    np.testing.assert_array_equal(column.rotation, np.eye(3))
    np.testing.assert_array_equal(ARM.axes, [[0, 0, 1], [0, -1, 0]])
    assert not column.points and [*link.points, *flange.points] == list(ARM.points) == [
        "A",
        "B",
    ]
    # [A] stands before the fixed rotation.
    place, turn = link.points["A"]
    np.testing.assert_array_equal(turn, np.eye(3))
    np.testing.assert_allclose(place, [-0.2, 0, 0])


@pytest.mark.parametrize(
    "chain",
    [
        "Tx(q1) Rz(q2) Tx(1) [A]",
        "Rz(q1) Ry(q2) Tz(1) Ry(-q2) [A]",
        "Rz(q2) Rz(q1) Tx(1) [A]",
        CHAIN,
    ],
)
def test_an_arm_that_the_plant_cannot_move_or_whose_controller_shows_other_angles_is_refused(
    chain,
):
    shown = {"reported_joints": {"offset_deg": [0, 90]}} if chain == CHAIN else {}
    with refused("my.yaml", *(["reported_joints"] if shown else ["chain", "R.("])):
        build_arm(document(chain, **shown), "my.yaml")


def test_masses_and_gravity_are_as_the_file_declares_them_or_of_the_usual_kind():
    entries = [
        {"link": 0, "mass_kg": 5, "centre_m": [0, 0, 1]},
        {"link": 2, "mass_kg": 7.5, "centre_m": [0.1, 0.2, 0.3], "relative_std": 0.02},
    ]
    arm = build_arm(document(masses=entries, gravity_m_s2=[9.8, 0, 0]))
    assert [(m.link, m.mass_kg, m.centre_m, m.relative_std) for m in arm.masses] == [
        (0, 5.0, (0.0, 0.0, 1.0), 0.1),
        (2, 7.5, (0.1, 0.2, 0.3), 0.02),
    ]
    assert arm.gravity_m_s2 == (9.8, 0.0, 0.0)
    assert ARM.gravity_m_s2 == (0.0, 0.0, -9.80665) and (
        arm.compensated,
        ARM.compensated,
    ) == (False, True)
    # Of the arm in the foot and in the carousel with its motors; each link behind it
    # weighs half of the one before.
    usual = read_arm(ROBOTS / "kuka.yaml").masses
    mass = np.array([m.mass_kg for m in usual])
    assert [m.link for m in usual] == list(range(7)) and {
        m.relative_std for m in usual
    } == {0.1}
    np.testing.assert_allclose(mass[3:] / mass[2:-1], 0.5, rtol=5e-3)
    np.testing.assert_allclose(mass[:2] / mass.sum(), [0.18, 0.27], rtol=1e-3)


def test_rotations_are_pinocchios_and_survive_the_way_there_and_back_up_to_a_half_turn(
    rng,
):
    axis = rng.standard_normal((200, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.concatenate(
        [
            rng.uniform(0, np.pi, 150),
            np.geomspace(1e-12, 1e-3, 25),
            np.pi - np.geomspace(1e-9, 1e-3, 25),
        ]
    )
    vector = angle[:, None] * axis
    np.testing.assert_allclose(
        to_rotation_matrix(vector), [pin.exp3(v) for v in vector], atol=1e-12
    )
    np.testing.assert_allclose(
        to_rotation_vector(to_rotation_matrix(vector)), vector, atol=1e-9
    )


def test_a_file_without_compliances_and_limits_is_of_an_arm_of_usual_ones():
    described = document()
    del described["compliance_urad_per_Nm"], described["joint_limits_deg"]
    arm = build_arm(described | {"payload_kg": 50})
    reach = np.array([np.hypot(0.2, 0.5) + 0.3, 0.3])
    np.testing.assert_allclose(
        arm.compliance, 2e-3 / (50 * 9.80665 * reach), rtol=1e-12
    )
    np.testing.assert_allclose(arm.limits, [[-2 * np.pi, 2 * np.pi]] * 2)
    shortest = build_arm(
        described | {"payload_kg": 50, "chain": "Rz(q1) Tx(1) Rz(q2) Tx(0.1) [A]"}
    )
    np.testing.assert_allclose(
        shortest.compliance[1], 2e-3 / (50 * 9.80665 * 0.2), rtol=1e-12
    )


@pytest.mark.parametrize(
    "centre, std, allowed",
    [
        ((0.0, 0.3, 0.4), 0.01, 0.01),
        ((0.0, 0.0, 0.0), 0.002, 0.006),
        ((0.2, 0.0, 0.0), 0.004, 0.006),
    ],
)
def test_a_centre_is_known_as_a_share_of_its_distance_and_no_better_than_a_short_lever(
    centre, std, allowed
):
    mass = LinkMass(1, 10.0, centre, 0.02)
    assert mass.centre_std_m() == pytest.approx(std)
    assert mass.centre_std_m(0.3) == pytest.approx(allowed)


def test_centres_off_the_line_move_across_it_alone_and_weights_stay():
    arm = arm_of("Tz(0.4) Ry(q1) Tx(2) Ry(q2) [elbow] Tx(1) [hand]")
    largest = 0.02
    arm = replace(
        arm,
        masses=(
            LinkMass(0, 9.0, (0.0, 0.0, 0.1), 0.1),
            LinkMass(1, 8.0, (0.5, 0.0, 0.0), 0.1),
        )
        * 100,
    )
    there, moved = (
        draw_true_masses(arm, np.random.default_rng(3), most, np.random.default_rng(4))
        for most in (0.0, largest)
    )
    shift = np.array([m.centre_m for m in moved]) - np.array(
        [m.centre_m for m in there]
    )
    assert [(m.link, m.mass_kg) for m in moved] == [(m.link, m.mass_kg) for m in there]
    for link, along, across in ((0, [2], [0, 1]), (1, [0], [1, 2])):
        mine = shift[link::2]
        np.testing.assert_allclose(mine[:, along], 0.0, atol=1e-15)
        assert (np.abs(mine[:, across]) <= largest).all() and (
            np.abs(mine[:, across]).max(axis=0) > 0.8 * largest
        ).all()
