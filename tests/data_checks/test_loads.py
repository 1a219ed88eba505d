"""Deflections beside what loads should have made of them: units and signs are named, compliances that are only off are not."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import POINTS, Plan, made, with_measured, with_other_compliances
from support import PinocchioPoint

from elastocal.data_checks.loads import UNITS, deflections, wrong_loads

EXACT = Plan(poses=6, loads=2, noise=0.0)
JOINTS = 6


@pytest.fixture(scope="module")
def campaign(fanuc):
    return made(fanuc, 1, EXACT)


def expected_parts(robot, seen, part):
    """Deflection of each target by each joint at nominal compliance from forces or moments alone, ndarray (N, 3, n)."""
    end = PinocchioPoint(robot.chain, robot.chain.end_effector)
    points = [PinocchioPoint(robot.chain, robot.chain.point(name)) for name in POINTS]
    parts = []
    for q, wrench, target in zip(seen.joint_angles, seen.wrench, seen.target, strict=True):
        torques = end.pose_and_jacobian(q)[2][part].T @ wrench[part]
        parts.append(points[target].pose_and_jacobian(q)[2][:3] * torques * robot.compliance)
    return np.array(parts)


def less_group_means(values, *keys):
    group = np.unique(np.column_stack(keys), axis=0, return_inverse=True)[1].ravel()
    return np.array([value - values[group == number].mean(axis=0) for value, number in zip(values, group, strict=True)])


def test_deflections_are_those_of_each_joint_by_pinocchio_less_the_mean_of_target_and_pose(fanuc, campaign):
    seen = campaign.measurements
    found, expected = deflections(campaign)
    for by, part in ((0, slice(0, 3)), (1, slice(3, 6))):
        whole = expected_parts(fanuc, seen, part).sum(axis=2)
        reference = less_group_means(whole, seen.pose, seen.target)
        np.testing.assert_allclose(expected[:, by].reshape(-1, 3), reference, rtol=0, atol=1e-12)
    # Second order in turns of some milliradians over metres.
    np.testing.assert_allclose(found, expected.sum(axis=1), rtol=0, atol=2e-4)
    assert np.abs(found).max() > 1e-3


def selected(campaign, kept):
    return replace(campaign, measurements=campaign.measurements.select(kept))


def test_joints_off_their_zeros_leave_no_trace_in_the_deflections(fanuc):
    plan = Plan(poses=40, loads=1, noise=0.0)
    straight, off = (made(fanuc, 1, plan, true_offset=offset) for offset in (0.0, 2e-3 * np.array([1, -1, 1, -1, 1, -1])))
    assert np.linalg.norm(off.measurements.position - straight.measurements.position, axis=1).max() > 3e-3
    (one, _), (other, _) = map(deflections, (straight, off))
    # What is left is of second order: two milliradians of every deflection.
    assert np.abs(other - one).max() < 0.02 * np.abs(one).max()


def test_nothing_is_said_without_differing_loads_or_known_compliances_or_with_too_few_poses(campaign):
    seen = campaign.measurements
    assert deflections(selected(campaign, seen.load == 1)) is None
    assert deflections(with_measured(campaign, wrench=0.0 * seen.wrench)) is None
    assert deflections(replace(campaign, robot=replace(campaign.robot, compliance_known=False))) is None
    assert deflections(selected(campaign, seen.pose < 3)) is None
    assert deflections(selected(campaign, seen.pose < 4)) is not None


def made_deflections(sign=1.0, force=1.0, moment=1.0, ratios=1.0, noise=1e-2):
    """Of joints that are so many times as soft as in the file, seen as loads in another unit make them seen."""
    rng = np.random.default_rng(1)
    by_force, by_moment = 1e-3 * rng.standard_normal((2, 450, JOINTS))
    seen = sign * (force * by_force + moment * by_moment) @ (ratios * np.ones(JOINTS))
    seen = seen + noise * np.abs(seen).max() * rng.standard_normal(450)
    return seen, np.stack([by_force.sum(axis=1), by_moment.sum(axis=1)], axis=1)


KILOGRAM, POUND = 9.80665, 4.4482216152605


def told(faults):
    """Sign, newtons and newton metres for each unit, and the words of each fault, of what is found."""
    unit = [value.value for fault in faults if fault.name == "wrong_unit" for value in fault.parameters[:2]]
    return (-1.0 if "wrong_sign" in [fault.name for fault in faults] else 1.0), *(unit or [1.0, 1.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("force", "moment", "words"), UNITS)
def test_every_unit_and_sign_is_found_by_what_it_makes_of_the_deflections(sign, force, moment, words):
    seen, expected = made_deflections(sign, force, moment)
    found = wrong_loads(seen, expected)
    assert bool(found) == (sign < 0 or bool(words))
    assert told(found) == pytest.approx((sign, force, moment))
    for fault in found:
        # Forces and moments deflect alike here, so that the slope is the mean of their factors.
        slope = sign * (force + moment) / 2
        assert fault.parameters[-1].value == pytest.approx(slope, rel=0.01 if force == moment else 0.1)
        # Of what robots have in common, 1/1.7 to 1.7, the factor that leaves least.
        left = seen - np.linspace(1 / 1.7, 1.7, 2001)[:, None] * expected.sum(axis=1)
        assert fault.evidence[0] == pytest.approx(np.sqrt((left**2).mean(axis=1)).min(), rel=0.02)
        assert fault.evidence[1] < 0.1 * fault.evidence[0]


@pytest.mark.parametrize(
    "ratios",
    [1.0, 0.5, 2.0, 3.0, 9.8 * np.array([1.0, 3.0, 0.4, 1.0, 2.5, 0.5]), 9.8 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])],
    ids=str,
)
def test_no_unit_is_found_for_compliances_that_are_only_off(ratios):
    assert wrong_loads(*made_deflections(ratios=ratios)) == []


def test_of_two_units_within_reach_the_one_by_which_compliances_are_nearest_nominal_is_named_first():
    # 1.4 times pounds-force are 0.63 times kilogram-force, and 1.55 times 0.70.
    (fault,) = wrong_loads(*made_deflections(force=POUND, moment=POUND, ratios=1.4))
    assert fault.detail.startswith("the loads look like pounds-force")
    assert [each.startswith("the loads look like kilogram-force") for each in fault.alternatives] == [True]
    (fault,) = wrong_loads(*made_deflections(force=POUND, moment=POUND, ratios=1.55))
    assert fault.detail.startswith("the loads look like kilogram-force") and fault.alternatives
    (fault,) = wrong_loads(*made_deflections(force=KILOGRAM, moment=KILOGRAM))
    assert not fault.alternatives


@pytest.fixture(scope="module", params=["base", "tracker"])
def loaded(request, fanuc):
    return made(fanuc, 2, Plan(poses=20, tracker=request.param == "tracker"), with_other_compliances(fanuc, 1, 0.3))


@pytest.mark.parametrize("factor", [(KILOGRAM, KILOGRAM), (1e3, 1e3), (1e-3, 1e-3), (1 / POUND, 1 / POUND), (1.0, 1e-3)])
def test_loads_in_another_unit_are_named_with_its_factor(loaded, factor):
    written = loaded.measurements.wrench / np.repeat(factor, 3)
    (fault,) = wrong_loads(*deflections(with_measured(loaded, wrench=written)))
    assert (fault.name, fault.joints) == ("wrong_unit", ())
    assert [value.value for value in fault.parameters[:2]] == pytest.approx(factor)
    assert fault.evidence[1] < 0.5 * fault.evidence[0]


def test_loads_turned_round_are_named(loaded):
    (fault,) = wrong_loads(*deflections(with_measured(loaded, wrench=-loaded.measurements.wrench)))
    assert (fault.name, fault.joints) == ("wrong_sign", ()) and "loads" in fault.detail
    assert -2.0 < fault.parameters[0].value < -0.5
