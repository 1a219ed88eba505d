"""Geometry beside compliances against differences and closed forms."""

import numpy as np
import pytest
from made_audits import CONFIGURATION, ROBOT

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.assumptions import qualities, stretch
from elastocal_proof.audit.audited import Audited

QUESTIONS = {"geometry_errors": {"zero_rad": 1e-3, "length_m": 5e-4}}


@pytest.fixture
def run(tmp_path):
    return Audited(tmp_path, CONFIGURATION | {"questions": QUESTIONS}, {"two": ROBOT}, {}, 4)


def test_columns_of_lengths_are_what_a_longer_robot_moves(run):
    angles, step = np.array([0.4, -0.9]), 1e-6
    longer = stretch(run, "two")
    assert longer.joints == 5
    found = longer.jacobian(np.array([*angles, 0, 0, 0]), "hand target")[:3, 2:]
    for column, (old, new) in enumerate(
        [("Tz(0.4)", "Tz(0.400001)"), ("Tx(0.1)", "Tx(0.100001)"), ("Tx(0.7)", "Tx(0.700001)")]
    ):
        other = Arm(ROBOT | {"chain": ROBOT["chain"].replace(old, new)})
        moved = other.pose(angles, "hand")[0] - run.arm("two").pose(angles, "hand")[0]
        np.testing.assert_allclose(found[:, column], moved / step, atol=1e-6)


def test_a_length_of_zero_is_none(run):
    run.robots["two"] = ROBOT | {"chain": ROBOT["chain"].replace("Tx(0.1)", "Tx(a1)"), "lengths_m": {"a1": 0.0}}
    assert stretch(run, "two").joints == 4


def test_what_is_estimated_at_once_leaks_nothing_and_what_is_left_out_does(run):
    # A robot of which the base height and the first zero are seen in every pose.
    found = qualities(run, "two")
    assert found["at once"]["leak"] == 0
    assert found["compliances from differences"]["leak"] == 0
    assert found["compliances from loaded poses alone"]["zero_leak"] == pytest.approx(1e-3)
    assert found["geometry from all poses alone"]["compliance_leak"] == pytest.approx(100)
    assert found["compliances from differences"]["compliance_noise"] > found["at once"]["compliance_noise"]
