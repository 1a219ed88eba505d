"""Lengths in another unit, joints with another sense or in another order: named before a
fit of the geometry bends the robot until the measurements agree."""

import numpy as np
import pytest
from contact_campaigns import (
    build_contact_case,
    open_workshop,
    touch_crossing_planes,
    write_contacts,
)

from elastocal.data_checks.faults import find_faults

ANCHORS_M = {"left": [0.4, 1.2, 0.1], "right": [0.6, -1.1, 0.2], "above": [0.3, 0.1, 2]}
IDENTITY = np.eye(6)
EXCHANGED = IDENTITY[[1, 0, 2, 3, 4, 5]]
REVERSED = np.diag([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])


def measure_distances(unit_m=1.0, joints=IDENTITY):
    """Return the rows of a draw wire from three anchors, with a zero of 30 mm."""
    workshop = open_workshop(2, limits=0.8)
    draws = np.random.default_rng(3)
    rows = []
    for name, anchor in ANCHORS_M.items():
        for _ in range(25):
            angles = draws.uniform(*workshop.joint_limits.T)
            tip_m, _ = workshop.locate(angles)
            length_m = np.linalg.norm(tip_m - anchor) + 0.03
            row = {"angles": joints @ angles, "kind": "distance", "feature": name}
            rows.append(row | {"value": length_m / unit_m})
    features = {name: {"zero_m": "unknown"} for name in ANCHORS_M}
    return {"measured": "distance", "features": features}, rows


def find_faults_of(folder, document, rows):
    noise = {"noise": {"position_m": 1e-4}}
    case = build_contact_case(write_contacts(folder, document | noise, rows))
    return find_faults(case.campaign)


def test_measured_lengths_of_a_robot_with_errors_have_no_fault(tmp_path):
    assert find_faults_of(tmp_path / "wire", *measure_distances()) == ()


@pytest.mark.parametrize(
    ("changes", "name", "joints", "phrase"),
    [
        ({"unit_m": 1e-3}, "wrong_unit", (), "value looks like millimetres"),
        ({"joints": REVERSED}, "wrong_sign", (3,), "joint 3 has the wrong sense"),
        (
            {"joints": EXCHANGED},
            "exchanged_joints",
            (1, 2),
            "the angles of joints 1 and 2 are exchanged",
        ),
    ],
    ids=["millimetres", "sense", "order"],
)
def test_another_interpretation_of_the_file_is_named(
    tmp_path, changes, name, joints, phrase
):
    (fault,) = find_faults_of(tmp_path / "wire", *measure_distances(**changes))
    assert (fault.name, fault.joints) == (name, joints)
    assert phrase in fault.detail
    before_m, after_m = fault.evidence
    assert after_m < 0.02 < before_m


def test_contacts_that_no_interpretation_explains_are_implausible(tmp_path):
    document, rows = measure_distances()
    draws = np.random.default_rng(4)
    for row in rows:
        row["angles"] = draws.permutation(row["angles"])
    (fault,) = find_faults_of(tmp_path / "wire", document, rows)
    assert fault.name == "implausible_measurements"
    assert "the error of the distance is" in fault.detail


def test_touches_of_planes_show_exchanged_joints(tmp_path):
    rows, features = touch_crossing_planes(open_workshop(5), 30, 5e-5)
    document = {"measured": "plane", "features": features}
    assert find_faults_of(tmp_path / "right", document, rows) == ()
    for row in rows:
        row["angles"] = EXCHANGED @ row["angles"]
    (fault,) = find_faults_of(tmp_path / "wrong", document, rows)
    assert fault.joints == (1, 2)


def test_touches_of_another_plane_than_the_named_one_are_found(tmp_path):
    rows, features = touch_crossing_planes(open_workshop(5), 30, 5e-5)
    for row in rows[20:28]:
        row["feature"] = "plane1"
    document = {"measured": "plane", "features": features}
    (fault,) = find_faults_of(tmp_path / "swapped", document, rows)
    assert fault.name == "swapped_places"
    assert "of plane1 in session 0" in fault.detail and "fit plane0" in fault.detail
    before_m, after_m = fault.evidence
    assert after_m < 0.01 < before_m
