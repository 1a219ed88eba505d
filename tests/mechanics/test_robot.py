"""The chain notation and the robot file: what they mean, and that every fault is refused in one line."""

import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import chain_of, refused

from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.robot import (
    Compensator,
    Mass,
    Transform,
    document_of,
    notation,
    parse_chain,
    robot_from_document,
    stretches,
    with_target_offset,
)

TWO_JOINTS = {
    "name": "two joints",
    "chain": "Tz(l1) Rz(q1) Tx(l2) [A] Ry(q2) Tx(l3) [B]",
    "lengths_m": {"l1": 0.5, "l2": 0.25, "l3": 1.5},
    "joint_limits_deg": [[-180, 180], [-90, 45]],
    "compliance_urad_per_Nm": [1.5, 2.5],
}
TUBES = {"youngs_modulus_GPa": 70, "shear_modulus_GPa": 26, "tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.02}]}


def document(**changes):
    changed = deepcopy(TWO_JOINTS) | changes
    return {key: value for key, value in changed.items() if value is not None}


def test_each_token_becomes_one_transform():
    text = "Tz(l1) Rz(q1) Tx(-l2) Ry(-q2) Rx(90deg) Rx(-30.5deg) Ty(-.25) Tz(2) [EE]"
    chain = parse_chain(text, {"l1": 0.6, "l2": 0.3}, "test")
    assert chain.transforms == (
        Transform("T", 2, 0.6),
        Transform("R", 2, 0.0, 0, 1.0),
        Transform("T", 0, -0.3),
        Transform("R", 1, 0.0, 1, -1.0),
        Transform("R", 0, math.pi / 2),
        Transform("R", 0, -math.radians(30.5)),
        Transform("T", 1, -0.25),
        Transform("T", 2, 2.0),
    )
    assert chain.coordinates == 2
    assert [(p.name, p.after) for p in chain.points] == [("EE", 8)]


def test_minus_sign_of_a_negative_length_is_plus():
    assert parse_chain("Rz(q1) Tx(-l) [A]", {"l": -0.041}, "test").transforms[1].constant == 0.041


def test_points_stand_where_they_are_written_and_the_last_is_the_end_effector():
    chain = chain_of("[base] Rz(q1) Tx(1) [A] Ry(q2) [B] [C]")
    assert [(p.name, p.after) for p in chain.points] == [("base", 0), ("A", 2), ("B", 3), ("C", 3)]
    assert chain.end_effector == chain.point("C")
    assert [chain.moved_by(p) for p in chain.points] == [(), (0,), (0, 1), (0, 1)]


def test_unknown_point_names_those_of_the_chain():
    with pytest.raises(KeyError, match=r"'C'.*A, B"):
        chain_of("Rz(q1) [A] Ry(q2) [B]").point("C")


def test_both_robots_have_the_points_and_joints_of_the_paper(robot):
    assert [p.name for p in robot.chain.points] == ["2DoF", "3DoF", "4DoF", "6DoF"]
    assert [robot.chain.moved_by(p) for p in robot.chain.points] == [(0, 1), (0, 1, 2), (0, 1, 2, 3), (0, 1, 2, 3, 4, 5)]
    assert robot.joints == 6


@st.composite
def written_chains(draw):
    """(text, transforms) of a chain of random tokens."""
    words, transforms, joints = [], [], 0
    for kind in [*draw(st.lists(st.sampled_from("TRq"), min_size=1, max_size=12)), "q"]:
        axis, sign = draw(st.integers(0, 2)), draw(st.sampled_from(["", "-"]))
        factor = -1.0 if sign else 1.0
        if kind == "q":
            joints += 1
            words.append(f"R{'xyz'[axis]}({sign}q{joints})")
            transforms.append(Transform("R", axis, 0.0, joints - 1, factor))
        else:
            number = f"{draw(st.integers(0, 359))}.{draw(st.integers(0, 999)):03d}"
            words.append(f"{kind}{'xyz'[axis]}({sign}{number}{'deg' if kind == 'R' else ''})")
            amount = math.radians(float(number)) if kind == "R" else float(number)
            transforms.append(Transform(kind, axis, factor * amount))
    return " ".join([*words, "[EE]"]), tuple(transforms)


@given(written_chains())
def test_any_written_chain_is_read_as_written(written):
    text, transforms = written
    assert chain_of(text).transforms == transforms


def test_blanks_and_line_breaks_separate_tokens_alike():
    assert chain_of("Tz(1)\n  Rz(q1)   Tx(2)\t[EE]") == chain_of("Tz(1) Rz(q1) Tx(2) [EE]")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Tz(l1) Rz(q1) Tw(l2) [A]", ["'Tw(l2)'", "Tx(length)", "[POINT]"]),
        ("Tz(l1) rz(q1) Tx(l2) [A]", ["'rz(q1)'"]),
        ("Tz(l1)Rz(q1) Tx(l2) [A]", ["'Tz(l1)Rz(q1)'", "separated by blanks"]),
        ("Tz(l1) Rz(q1) Tx(l2 [A]", ["'Tx(l2'"]),
        ("Tz(l1) Rz(q1) Tx(--l2) [A]", ["'Tx(--l2)'"]),
        ("Tz(l1) Rz(q1) Tx() [A]", ["'Tx()'"]),
        ("Tz(l1) Rz(q1) Tx(l2) []", ["'[]'"]),
        ("Tz(l1) Rz(q2) Tx(l2) [A]", ["'Rz(q2)'", "q1 or degrees"]),
        ("Tz(l1) Rz(q1) Tx(l2) Ry(q3) [A]", ["'Ry(q3)'", "q2, a joint before it or degrees"]),
        ("Tz(l1) Rz(q1) Tx(q1) Tx(l2) [A]", ["'Tx(q1)'", "R.() or in T.() alone"]),
        ("Tz(l1) Tx(q1) Rz(q1) Tx(l2) [A]", ["'Rz(q1)'", "R.() or in T.() alone"]),
        ("Tz(l1) Rz(q2) Tx(l2) [A]", ["'Rz(q2)'", "q1 or degrees"]),
        ("Tz(l1) Rz(q1) Tx(l2) Ry(90) [A]", ["'Ry(90)'", "90deg"]),
        ("Tz(l1) Rz(q1) Tx(l2) Ry(l2) [A]", ["'Ry(l2)'"]),
        ("Tz(l1) Rz(q1) Tx(l9) [A]", ["'Tx(l9)'", "l1, l2 or metres"]),
        ("Tz(l1) Rz(q1) Tx(q3) [A]", ["'Tx(q3)'", "q2, a joint before it or l1, l2 or metres"]),
        ("Tz(l1) Rz(q1) Tx(5deg) [A]", ["'Tx(5deg)'", "l1, l2 or metres"]),
        ("Tz(l1) Rz(q1) Tx(1,5) [A]", ["'Tx(1,5)'"]),
        ("Tz(l1) Rz(q1) [A] Tx(l2) [A]", ["[A] twice", "once"]),
        ("Tz(l1) Rz(q1) [A] Tx(l2)", ["'Tx(l2)' at its end", "measuring point"]),
        ("Tz(l1) Rz(q1) Tx(l2)", ["'Tx(l2)' at its end", "[6DoF] at the end"]),
        ("Tz(l1) Tx(l2) [A]", ["no joint", "q1"]),
        ("", ["no joint", "q1"]),
    ],
)
def test_faulty_chain_is_refused_in_one_line(text, words):
    with refused("robots/x.yaml", "chain", *words):
        parse_chain(text, {"l1": 1.0, "l2": 2.0}, "robots/x.yaml")


def test_length_that_the_chain_does_not_use_is_refused():
    with refused("robots/x.yaml", "lengths_m", "l2, l3", "that the chain uses"):
        parse_chain("Tz(l1) Rz(q1) [A]", {"l1": 1.0, "l3": 2.0, "l2": 2.0}, "robots/x.yaml")


def test_robot_file_comes_in_si_units():
    robot = robot_from_document(document())
    assert robot.joints == 2 and robot.links == ()
    np.testing.assert_allclose(robot.compliance, [1.5e-6, 2.5e-6], rtol=1e-15)
    np.testing.assert_allclose(robot.joint_limits, [[-np.pi, np.pi], [-np.pi / 2, np.pi / 4]], rtol=1e-15)
    np.testing.assert_array_equal(robot.reported_matrix, np.eye(2))
    np.testing.assert_array_equal(robot.reported_offset, np.zeros(2))


def test_reported_joints_come_in_radians():
    robot = robot_from_document(document(reported_joints={"matrix": [[1, 0], [1, -1]], "offset_deg": [90, -45]}))
    np.testing.assert_array_equal(robot.reported_matrix, [[1, 0], [1, -1]])
    np.testing.assert_allclose(robot.reported_offset, [np.pi / 2, -np.pi / 4], rtol=1e-15)


def test_reported_angles_are_converted_both_ways():
    robot = robot_from_document(document(reported_joints={"matrix": [[1, 0], [1, -1]], "offset_deg": [90, -45]}))
    reported = np.radians([[10.0, 20.0], [-30.0, 5.0], [0.0, 0.0]])
    angles = np.radians([[100.0, -55.0], [60.0, -80.0], [90.0, -45.0]])
    np.testing.assert_allclose(robot.model_angles(reported), angles, rtol=1e-12)
    np.testing.assert_allclose(robot.reported_angles(angles), reported, atol=1e-12)
    np.testing.assert_allclose(robot.model_angles(reported[0]), angles[0], rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"joint_limits_deg": [[-180, 180]]}, "joint_limits_deg", ["1 entries", "each of the 2 joints"]),
        ({"compliance_urad_per_Nm": [1, 2, 3]}, "compliance_urad_per_Nm", ["3 entries", "each of the 2 joints"]),
        ({"joint_limits_deg": [[-180, 180], [45, -45]]}, "joint_limits_deg[1]", ["[45, -45]", "[lower, upper]"]),
        ({"joint_limits_deg": [[5, 5], [-45, 45]]}, "joint_limits_deg[0]", ["[5, 5]", "[lower, upper]"]),
        ({"reported_joints": {"matrix": [[1, 0]]}}, "reported_joints", ["2 rows of 2 numbers"]),
        ({"reported_joints": {"offset_deg": [1, 2, 3]}}, "reported_joints", ["and 2 offsets"]),
        ({"reported_joints": {"matrix": [[1, 0], [1]]}}, "reported_joints", ["2 rows of 2 numbers"]),
        ({"lengths_m": None}, "chain", ["'Tz(l1)'", "metres"]),
        ({"lengths_m": {"l1": 1, "l2": 1, "l3": 1, "l4": 1}}, "lengths_m", ["l4"]),
        (
            {"lengths_m": {"l1": 500, "l2": 250, "l3": 1500}},
            "lengths_m",
            ["reaches 2250 m", "in metres (not millimetres)", "10 m"],
        ),
        ({"chain": "Tz(0.5) Rz(q1) Tx(-9) Ry(q2) Tx(0.6) [B]", "lengths_m": None}, "chain", ["reaches 10.1 m", "metres"]),
        ({"links": TUBES | {"tubes": TUBES["tubes"] * 2}}, "links.tubes", ["2 tubes", "each of the 3"]),
        ({"links": TUBES | {"tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.101}]}}, "links.tubes", ["0.101", "half"]),
    ],
)
def test_faulty_robot_file_is_refused_in_one_line(changes, key, words):
    with refused("robots/two.yaml", key, *words):
        robot_from_document(document(**changes), "robots/two.yaml")


def test_links_on_a_chain_with_fixed_rotations_are_refused():
    with refused("robots/two.yaml", "links", "turn at their joints only"):
        turned = document(chain="Tz(l1) Rz(q1) Tx(l2) Rx(90deg) [A] Ry(q2) Tx(l3) [B]", links=TUBES)
        robot_from_document(turned, "robots/two.yaml")


def test_one_tube_serves_every_link_and_a_list_of_tubes_goes_from_the_base_on():
    same = robot_from_document(document(links=TUBES))
    assert len(same.links) == 3 and len({link.tube for link in same.links}) == 1
    sizes = [{"outer_diameter_m": d, "wall_m": 0.01} for d in (0.3, 0.2, 0.1)]
    each = robot_from_document(document(links=TUBES | {"tubes": sizes}))
    assert [link.tube.outer_diameter_m for link in each.links] == [0.3, 0.2, 0.1]
    assert {(link.tube.youngs_modulus_Pa, link.tube.shear_modulus_Pa) for link in each.links} == {(70e9, 26e9)}


def test_a_solid_tube_is_allowed():
    solid = TUBES | {"tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.1}]}
    assert len(robot_from_document(document(links=solid)).links) == 3


def test_stretches_are_the_rigid_parts_between_the_joints(kuka):
    assert stretches(kuka.chain) == (
        (1, (0.0, 0.0, 0.675)),
        (3, (0.35, 0.0, 0.0)),
        (5, (1.15, 0.0, 0.0)),
        (8, (1.2, 0.0, -0.041)),
        (12, (0.24, 0.0, 0.0)),
    )


def test_target_offset_reaches_every_point_and_leaves_the_chain_alone(kuka):
    moved = with_target_offset(kuka, [0.1, 0.2, 0.3])
    assert {p.offset_m for p in moved.chain.points} == {(0.1, 0.2, 0.3)}
    assert moved.chain.transforms == kuka.chain.transforms
    assert {p.offset_m for p in kuka.chain.points} == {(0.0, 0.0, 0.0)}
    assert with_target_offset(kuka.chain, [0.1, 0.2, 0.3]) == moved.chain


def test_every_robot_of_the_repository_has_the_compliances_of_table_1(config_folder):
    table = {"kuka": [0.54, 0.29, 0.42, 2.79, 3.48, 2.07], "fanuc": [1.23, 0.37, 0.46, 2.68, 2.70, 2.72]}
    for name, compliance in (table | {"kuka_extended": table["kuka"]}).items():
        robot = robot_from_document(read_document(config_folder / "robots" / f"{name}.yaml"))
        np.testing.assert_allclose(robot.compliance, 1e-6 * np.array(compliance), rtol=1e-12)


WEIGHED = {
    "masses": [
        {"link": 2, "mass_kg": 40, "centre_m": [0.5, 0, -0.02], "relative_std": 0.1},
        {"link": 0, "mass_kg": 90.5, "centre_m": [0, 0, 0.2], "relative_std": 0.2},
    ],
    "gravity_m_s2": [0, 9.80665, 0],
    "gear_ratio": [None, 171],
    "compensator": {"joint": 2, "kind": "spring"},
    "payload_kg": 12,
}


def test_what_the_links_weigh_comes_in_their_order():
    robot = robot_from_document(document(**WEIGHED))
    assert robot.masses == (Mass(0, 90.5, (0.0, 0.0, 0.2), 0.2), Mass(2, 40, (0.5, 0.0, -0.02), 0.1))
    assert robot.gravity_m_s2 == (0.0, 9.80665, 0.0) and robot.gear_ratio == (None, 171)
    assert robot.compensator == Compensator(2, "spring") and robot.payload_kg == 12


def test_robot_file_that_says_nothing_of_weights_is_a_weightless_arm_on_a_floor():
    robot = robot_from_document(document())
    assert robot.masses == () and robot.gravity_m_s2 == (0.0, 0.0, -9.80665)
    assert robot.gear_ratio is None and robot.compensator is None and robot.payload_kg is None


@pytest.mark.parametrize("more", [{}, WEIGHED, {"reported_joints": {"matrix": [[1, 0], [1, -1]], "offset_deg": [90, -45]}}])
def test_robot_becomes_a_document_that_gives_it_back(more):
    robot = robot_from_document(document(**more))
    written = document_of(robot)
    check_document(written, "robot", "robot.yaml")
    again = robot_from_document(written)
    assert again.chain == robot.chain
    for name, value in vars(robot).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_allclose(getattr(again, name), value, rtol=1e-15)
        else:
            assert getattr(again, name) == value, name


@given(written_chains())
def test_notation_of_a_chain_is_read_as_that_chain(written):
    chain = chain_of(written[0])
    again = chain_of(notation(chain))
    for ours, theirs in zip(again.transforms, chain.transforms, strict=True):
        assert replace(ours, constant=0.0) == replace(theirs, constant=0.0)
        assert ours.constant == pytest.approx(theirs.constant, rel=1e-15)
    assert again.points == chain.points


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"masses": [WEIGHED["masses"][0] | {"link": 3}]}, "masses[0].link", ["3", "to 2"]),
        ({"masses": WEIGHED["masses"][:1] * 2}, "masses", ["link 2 twice", "each link once"]),
        ({"gravity_m_s2": [0, 0, 0]}, "gravity_m_s2", ["[0, 0, 0]", "base axes"]),
        ({"gear_ratio": [100]}, "gear_ratio", ["1 entries", "2 joints"]),
        ({"compensator": {"joint": 3, "kind": "gas"}}, "compensator.joint", ["3", "1 to 2"]),
    ],
)
def test_weights_that_do_not_suit_the_robot_are_refused(changes, key, words):
    with refused("robots/two.yaml", key, *words):
        robot_from_document(document(**changes), "robots/two.yaml")


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"masses": [{"link": 1, "mass_kg": 5, "centre_m": [0, 0, 0]}]}, "masses[0].relative_std"),
        ({"masses": [WEIGHED["masses"][0] | {"mass_kg": 0}]}, "masses[0].mass_kg"),
        ({"masses": [WEIGHED["masses"][0] | {"centre_m": [0, 0]}]}, "masses[0].centre_m"),
        ({"gravity_m_s2": [0, 0]}, "gravity_m_s2"),
        ({"gear_ratio": [0, 100]}, "gear_ratio[0]"),
        ({"compensator": {"joint": 2, "kind": "rope"}}, "compensator.kind"),
        ({"payload_kg": 0}, "payload_kg"),
    ],
)
def test_schema_refuses_weights_that_cannot_be(changes, key):
    with refused("robots/two.yaml", key):
        check_document(document(**changes), "robot", "robots/two.yaml")


TRACKED = {
    "name": "on a track",
    "chain": "Tx(q1) Tz(0.5) Rz(q2) Tx(1) Ry(q3) Tx(1) Ry(-q3) [hand]",
    "joint_limits_deg": [[-0.5, 4.0], [-180, 180], [-90, 90]],
    "compliance_urad_per_Nm": [0.02, 1.0, 2.0],
    "reported_joints": {"matrix": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]], "offset_deg": [2.5, 0, 90]},
}


def test_prismatic_joints_are_in_metres_and_newtons():
    robot = robot_from_document(TRACKED)
    assert robot.chain.prismatic == (True, False, False) and robot.joints == 3
    np.testing.assert_allclose(robot.joint_limits, [[-0.5, 4.0], [-np.pi, np.pi], [-np.pi / 2, np.pi / 2]], rtol=1e-15)
    np.testing.assert_allclose(robot.reported_offset, [2.5, 0.0, np.pi / 2], rtol=1e-15)
    np.testing.assert_allclose(robot.compliance, [2e-8, 1e-6, 2e-6], rtol=1e-15)


def test_joint_in_two_places_is_one_coordinate_and_passive_in_the_second():
    chain = robot_from_document(TRACKED).chain
    assert [t.coordinate for t in chain.transforms if t.coordinate is not None] == [0, 1, 2, 2]
    assert [place for place in range(len(chain.transforms)) if chain.is_passive(place)] == [6]
    assert chain.moved_by(chain.end_effector) == (0, 1, 2)


def test_robot_on_a_track_becomes_a_document_that_gives_it_back():
    robot = robot_from_document(TRACKED)
    again = robot_from_document(document_of(robot))
    assert again.chain == robot.chain
    for name in ("joint_limits", "reported_offset", "compliance", "reported_matrix"):
        np.testing.assert_allclose(getattr(again, name), getattr(robot, name), rtol=1e-15)


@pytest.mark.parametrize(
    ("chain", "what"),
    [("Tx(q1) Tz(0.5) Rz(q2) Tx(1) [B]", "prismatic joints"), ("Rz(q1) Tx(1) Ry(q2) Tx(1) Ry(-q2) [B]", "passive joints")],
)
def test_tubes_are_refused_where_links_change_their_length_or_turn_by_themselves(chain, what):
    with refused("robots/x.yaml", "links", what):
        robot_from_document(document(chain=chain, lengths_m=None, links=TUBES), "robots/x.yaml")
