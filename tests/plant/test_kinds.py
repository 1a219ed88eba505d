"""Where kinds of defects can be on an arm, and how large they plausibly are."""

import pytest
from analysed_robots import ROBOTS

from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.kinds import KINDS


def test_a_kind_is_where_the_arm_has_its_part(arm):
    joints = range(1, arm.joints + 1)
    assert KINDS["joint_offset"].locations(arm) == [(joint,) for joint in joints]
    assert KINDS["payload"].locations(arm) == [()]
    assert len(KINDS["cross_compliance"].locations(arm)) == arm.joints * (arm.joints - 1) // 2
    assert KINDS["compensator_torque"].locations(arm) == ([(2,)] if arm.compensated else [])
    assert all(arm.lengths_m[link] > 0.1 for (link,) in KINDS["link_elasticity"].locations(arm))


def test_weight_is_of_the_upper_arm_of_the_forearm_or_of_all_links_by_the_joints_that_it_turns(fanuc_arm):
    upper, fore, everything = KINDS["link_weight"].locations(fanuc_arm)
    assert upper == (2,) and fore == (2, 3) and everything == (2, 3, 4, 5)


@pytest.mark.parametrize(
    ("kind", "soft", "light"), [("joint_tilt", 1, 0), ("payload", 0, 1), ("outside:stiffening_link", 1, -2)]
)
def test_a_plausible_size_goes_with_how_soft_an_arm_is_and_what_it_carries(kind, soft, light):
    arm = arm_from_file(ROBOTS / "iiwa14.yaml")
    assert arm.softness > 1 and arm.load_share < 1
    found = KINDS[kind].plausible_on(arm) / KINDS[kind].plausible
    assert found == pytest.approx(arm.softness**soft * arm.load_share**light)
