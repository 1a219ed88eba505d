"""The robot file: its meaning, one-line errors for every fault, and writing it."""

from copy import deepcopy

import numpy as np
import pytest
from support import refused

from elastocal.io.documents import check_document
from elastocal.mechanics.robot import estimate_typical_compliance
from elastocal.mechanics.robot_file import describe_robot, parse_robot

TWO_JOINTS = {
    "name": "two joints",
    "chain": "Tz(l1) Rz(q1) Tx(l2) [A] Ry(q2) Tx(l3) [B]",
    "lengths_m": {"l1": 0.5, "l2": 0.25, "l3": 1.5},
    "joint_limits_deg": [[-180, 180], [-90, 45]],
    "compliance_urad_per_Nm": [1.5, 2.5],
}
TRACKED = {
    "name": "on a track",
    "chain": "Tx(q1) Tz(0.5) Rz(q2) Tx(1) Ry(q3) Tx(1) [hand]",
    "lengths_m": {},
    "joint_limits_deg": [[-0.5, 4.0], [-180, 180], [-90, 90]],
    "compliance_urad_per_Nm": [0.02, 1.0, 2.0],
    "reported_joints": {
        "matrix": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "offset_deg": [2.5, 0, 90],
    },
}
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
REPORTED = {"reported_joints": {"matrix": [[1, 0], [1, -1]], "offset_deg": [90, -45]}}
TUBES = {
    "youngs_modulus_GPa": 70,
    "shear_modulus_GPa": 26,
    "tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.02}],
}


def document(**changes):
    changed = deepcopy(TWO_JOINTS) | changes
    return {key: value for key, value in changed.items() if value is not None}


def test_robot_file_is_converted_to_si_units():
    robot = parse_robot(document())
    assert robot.joints == 2 and robot.links == ()
    np.testing.assert_allclose(robot.compliance, [1.5e-6, 2.5e-6], rtol=1e-15)
    np.testing.assert_allclose(
        robot.joint_limits, [[-np.pi, np.pi], [-np.pi / 2, np.pi / 4]], rtol=1e-15
    )
    np.testing.assert_array_equal(robot.reported_matrix, np.eye(2))
    np.testing.assert_array_equal(robot.reported_offset, np.zeros(2))
    unlimited = parse_robot(document(joint_limits_deg=None)).joint_limits
    np.testing.assert_allclose(unlimited, [[-2 * np.pi, 2 * np.pi]] * 2, rtol=1e-15)


def test_without_compliances_typical_ones_count_as_unknown_and_are_never_written():
    robot = parse_robot(document(compliance_urad_per_Nm=None, payload_kg=20))
    np.testing.assert_allclose(
        robot.compliance, estimate_typical_compliance(robot.chain, 20.0), rtol=1e-15
    )
    assert not robot.compliance_known and parse_robot(document()).compliance_known
    assert "compliance_urad_per_Nm" not in describe_robot(robot)
    assert not parse_robot(describe_robot(robot)).compliance_known


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        (
            {"joint_limits_deg": [[-180, 180]]},
            "joint_limits_deg",
            ["1 entry", "each of the 2 joints"],
        ),
        (
            {"compliance_urad_per_Nm": [1, 2, 3]},
            "compliance_urad_per_Nm",
            ["3 entries", "each of the 2 joints"],
        ),
        (
            {"joint_limits_deg": [[-180, 180], [45, -45]]},
            "joint_limits_deg[1]",
            ["[45, -45]", "[lower, upper]"],
        ),
        (
            {"joint_limits_deg": [[5, 5], [-45, 45]]},
            "joint_limits_deg[0]",
            ["[5, 5]", "[lower, upper]"],
        ),
        (
            {"joint_names": ["shoulder"]},
            "joint_names",
            ["1 entry", "each of the 2 joints"],
        ),
        (
            {"reported_joints": {"matrix": [[1, 0]]}},
            "reported_joints",
            ["rows of [2]", "2 rows", "up to 2"],
        ),
        (
            {"reported_joints": {"offset_deg": [1, 2, 3]}},
            "reported_joints",
            ["and 2 offsets"],
        ),
        (
            {"reported_joints": {"matrix": [[1, 0], [1]]}},
            "reported_joints",
            ["rows of [2, 1]", "the same count"],
        ),
        (
            {"reported_joints": {"matrix": [[1, 1], [2, 2]]}},
            "reported_joints",
            ["several reported angles", "independent columns"],
        ),
        (
            {"reported_joints": {"matrix": [[1], [2]], "names": ["a", "b"]}},
            "reported_joints.names",
            ["2 names", "each of the 1 reported"],
        ),
        ({"lengths_m": None}, "chain", ["'Tz(l1)'", "metres"]),
        ({"lengths_m": {"l1": 1, "l2": 1, "l3": 1, "l4": 1}}, "lengths_m", ["l4"]),
        (
            {"lengths_m": {"l1": 500, "l2": 250, "l3": 1500}},
            "lengths_m",
            ["reaches 2250 m", "in metres (not millimetres)", "10 m"],
        ),
        (
            {"chain": "Tz(0.5) Rz(q1) Tx(-9) Ry(q2) Tx(0.6) [B]", "lengths_m": None},
            "chain",
            ["reaches 10.1 m", "metres"],
        ),
        (
            {"links": TUBES | {"tubes": TUBES["tubes"] * 2}},
            "links.tubes",
            ["2 tubes", "each of the 3"],
        ),
        (
            {"links": TUBES | {"tubes": [{"outer_diameter_m": 0.2, "wall_m": 0.101}]}},
            "links.tubes",
            ["0.101", "half"],
        ),
        # Tubes need links that neither change their length nor have fixed rotations.
        *(
            (
                {
                    "chain": chain,
                    "lengths_m": None,
                    "joint_limits_deg": [[-3, 3], [-90, 45]],
                    "links": TUBES,
                },
                "links",
                [feature, "turn at their joints only"],
            )
            for chain, feature in (
                ("Rz(q1) Tx(1) Rx(90deg) [A] Ry(q2) Tx(1) [B]", "fixed rotations"),
                ("Tx(q1) Tz(0.5) Rz(q2) Tx(1) [B]", "prismatic joints"),
            )
        ),
        (
            TRACKED | {"joint_limits_deg": [[-500, 4000], [-180, 180], [-90, 90]]},
            "joint_limits_deg[0]",
            ["4000", "metres (not millimetres), 100 m at most"],
        ),
        (
            TRACKED | {"joint_limits_deg": None},
            "joint_limits_deg",
            ["T.(q1)", "metres"],
        ),
        (
            {"masses": [WEIGHED["masses"][0] | {"link": 3}]},
            "masses[0].link",
            ["3", "to 2"],
        ),
        (
            {"masses": WEIGHED["masses"][:1] * 2},
            "masses",
            ["link 2 twice", "each link once"],
        ),
        ({"gravity_m_s2": [0, 0, 0]}, "gravity_m_s2", ["[0, 0, 0]", "base axes"]),
        (
            {"gravity_m_s2": [0, 1e-300, 0]},
            "gravity_m_s2",
            ["[0, 1e-300, 0]", "1e-06 m/s² or more"],
        ),
        ({"gear_ratio": [100]}, "gear_ratio", ["1 entry", "2 joints"]),
        (
            {"compensator": {"joint": 3, "kind": "gas"}},
            "compensator.joint",
            ["3", "1 to 2"],
        ),
    ],
)
def test_faulty_robot_file_is_refused_in_one_line(changes, key, words):
    with refused("robots/two.yaml", key, *words):
        parse_robot(document(**changes), "robots/two.yaml")


@pytest.mark.parametrize(
    "changes",
    [
        {},
        WEIGHED,
        TRACKED,
        REPORTED,
        # An offset alone, and a matrix alone.
        {"reported_joints": {"offset_deg": [90, -45]}},
        {"reported_joints": {"matrix": [[1, 0], [1, -1]]}},
        # The second joint follows the first.
        {"reported_joints": {"matrix": [[1], [-0.5]], "names": ["shoulder"]}},
    ],
)
def test_a_described_robot_parses_to_the_same_robot(changes):
    robot = parse_robot(document(**changes))
    written = describe_robot(robot)
    check_document(written, "robot", "robot.yaml")
    again = parse_robot(written)
    assert again.chain == robot.chain
    for name, value in vars(robot).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_allclose(getattr(again, name), value, rtol=1e-15)
        else:
            assert getattr(again, name) == value, name
